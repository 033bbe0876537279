"""Sample data: the 26 chessboard photographs of OpenCV's samples, their published calibrations and a photograph of a
building (Apache-2.0), and a stereo pair with its true disparities from scikit-image.

A file is looked for in the folder that CAMVIZ_SAMPLES names, then among those fetched before, then on the network; its
sha256 is checked wherever it comes from. Where there is none, the virtual camera pictures a chessboard instead.
"""

from __future__ import annotations

import hashlib
import os
from collections.abc import Sequence
from dataclasses import dataclass
from importlib.resources import as_file, files
from importlib.util import find_spec
from pathlib import Path
from typing import TYPE_CHECKING, Any, overload

import numpy as np
from numpy.typing import NDArray

from camviz.lenses.base import Array, unit
from camviz.poses import RigidTransform

if TYPE_CHECKING:
    from camviz.cameras import Camera

BASE_URL = "https://raw.githubusercontent.com/opencv/opencv/4.6.0/samples/data/"
TIMEOUT_S = 5
BASELINE = 0.33  # metres, of the rendered pairs: as many squares as between the real cameras

REGISTRY = {
    "left01.jpg": "9621899098adffa1440c8264606bb7be535ccfd9ad126ae8e0bd9b0c5a5b8676",
    "left02.jpg": "052e700bbcc865c112958ec2ea105cb1bce4deca50ac8d6efae13adca9df7a2c",
    "left03.jpg": "c85b9426c3d8fcf161e1e727356105091009c3fd0b1b1a65bc2da91fea2724d2",
    "left04.jpg": "b490599dccfbfe5eb56d33363415b02227a9548ab8c9b8e7b05d3580e97266d9",
    "left05.jpg": "40bab8934fa76f82ec614a7fd0e6ebb4d9f74391d5e8b0c6f2f0ed6080c6c4de",
    "left06.jpg": "1cb164db61b3bd52f58a7e9340bb27c5e0278895bc80b6f292fba5cf9bccc4a1",
    "left07.jpg": "d2211fe9f971646b6ff88ed93a4f0d3f443741eb2894095cba15caade7c8c6e4",
    "left08.jpg": "f7a0737894812a28243af5b409c5689f4fadfe7610958b8ca5fc79aec2f2cd1b",
    "left09.jpg": "753939bc62d093c001d9118e989bef2b887f1b2f9ac03603df915a8b85aa81d3",
    "left11.jpg": "e736ace3d515c94c547009c3c10d818c81506ed7059cb31123749b9cc3f94ee8",
    "left12.jpg": "04bdd78b3b507fe0551aa7062a3ffd94846a147ee2bea7fb38082c720bdbe231",
    "left13.jpg": "2637fb6dd5e557f4fadb06b353a453eb0b9223f4671f6f572f815302bc4a70b3",
    "left14.jpg": "d4c032971dd7b859f9d6aed5090c9888bd8039b82e0604bee5bfe05444fce834",
    "right01.jpg": "94a160342fade4d0c4d2e94b8cb6c1e144a6e7682389d2991257e3a28625cb2d",
    "right02.jpg": "f7819b2fcc45fdeff0cefd666a1f8bd2a5828c4d34367d7b6b6691f442bf1c42",
    "right03.jpg": "43a3cea1907be641268ea18478362ab6c459424a9d8b7265eb5fb2264fcfb894",
    "right04.jpg": "d5874ff3d948dbb673beb035dd70aef5e517119ff626ecdfd612fdd6a1eec32e",
    "right05.jpg": "9382a24af5a21a9e3ec477bd4f74011e4bb10b0cdbc7e0de3ae60b75e95d650b",
    "right06.jpg": "874b60edc8a53da477c6ee393184a1aafdc83ceaedcb4d0535f7c482d1c80e76",
    "right07.jpg": "446093eead30c8cb1e51c8d01d322907760a3a57876596a81af6bf0795e9be67",
    "right08.jpg": "5f1be870c8709fd5fc4dd578103b320018aabb4e18b8e8edaba9afbdd4d0b8f4",
    "right09.jpg": "de28e9f146f4b7de78b0e39be6682997a7428f8ec5ef4efc753415d4ff8d9d76",
    "right11.jpg": "2695e8f8e94eaef0bcfe56818090dada6dc76f53e30b77b97bea3a91080949db",
    "right12.jpg": "07489b6a334fae390954bbbddedf03a0556163e5e364820838e881ebd3f33e0d",
    "right13.jpg": "a576cc5e69668d65dd926366d103c4c77377e0cd71403e4e0fc278e335ed953c",
    "right14.jpg": "e98bbe907610e9499d704bd0fe68d4adc158b19346cbc32f4cfe8a0014b1bd62",
    "intrinsics.yml": "c419615d0f1794cdd64eba97da74f5f6b15c31eb09bdd9cf7b6025d00764f92b",
    "left_intrinsics.yml": "93a35a94eaaa63afba5128292cf2800fce3e783eba12a69e3d3731360d594684",
    "stereo_calib.xml": "585a31531d6624f34acfce2cc9ca0be4d46d30db061494c8ea189f7274b80391",
    "building.jpg": "742a1baad62ac82e91e718e77eedf7e85c2eddc4badfb8c87c6cbc86c45a8b07",
}


class SampleUnavailable(RuntimeError):  # noqa: N818 - it says what is the case
    """A sample file that this machine neither has nor can fetch; the message is one sentence."""


@dataclass(frozen=True)
class Pictures:
    """Pictures (height, width, 3), uint8 sRGB, of a board with 9 × 6 inner corners, by file name.

    `real` tells photographs from what the virtual camera rendered instead, and `sentence` says so to a reader.
    """

    names: tuple[str, ...]
    pictures: Sequence[NDArray[np.uint8]]
    square_size: float  # metres
    real: bool
    sentence: str


def sample(name: str) -> Path:
    """The path of a sample file, fetched once if need be.

    ValueError for a name that is not in REGISTRY; SampleUnavailable without a network or with a file that is not the
    published one.
    """
    if name not in REGISTRY:
        raise ValueError(f"name must be one of {', '.join(REGISTRY)}, got {name!r}")
    return local_sample(name) or _fetched(name)


def local_sample(name: str) -> Path | None:
    """The path of a sample file that needs no network: from CAMVIZ_SAMPLES, or fetched before. None otherwise."""
    if folder := os.environ.get("CAMVIZ_SAMPLES"):
        for path in (Path(folder) / name, Path(folder) / "opencv-samples" / name):
            if path.is_file():
                return _verified(path)
    cached = Path(_pooch().path) / name
    return cached if cached.is_file() and _sha256(cached) == REGISTRY[name] else None


def chessboard_pictures(side: str = "left", count: int = 13) -> Pictures:
    """The first `count` photographs of the left or right camera; where they cannot be had, the virtual camera's."""
    if side not in ("left", "right"):
        raise ValueError(f"side must be 'left' or 'right', got {side!r}")
    names = tuple(name for name in REGISTRY if name.startswith(side) and name.endswith(".jpg"))[:count]
    try:
        pictures = _Packed(tuple(np.fromfile(sample(name), np.uint8) for name in names))
    except SampleUnavailable as reason:
        return _rendered(names, side, f"{reason} The virtual camera's pictures take their place.")
    credit = "Photographs from OpenCV's samples (samples/data at 4.6.0), Apache-2.0."
    return Pictures(names, pictures, 0.025, True, credit)


def _verified(path: Path) -> Path:
    if _sha256(path) != REGISTRY[path.name]:
        raise SampleUnavailable(f"{path} is not the file that OpenCV publishes under that name (its sha256 differs).")
    return path


def _sha256(path: Path) -> str:
    return hashlib.sha256(path.read_bytes()).hexdigest()


def _pooch() -> Any:
    import pooch

    cache = pooch.os_cache("camviz")
    return pooch.create(path=cache, base_url=BASE_URL, registry={k: f"sha256:{v}" for k, v in REGISTRY.items()})


def _fetched(name: str) -> Path:
    import pooch

    pooch.get_logger().setLevel("WARNING")
    try:
        return Path(_pooch().fetch(name, downloader=pooch.HTTPDownloader(timeout=TIMEOUT_S)))
    except (OSError, ValueError) as error:
        reason = "what came is not the published file" if isinstance(error, ValueError) else "there is no way to it now"
        raise SampleUnavailable(
            f"The sample {name} could not be fetched from {BASE_URL.split('/')[2]}: {reason}; "
            "with the files in a folder of yours, CAMVIZ_SAMPLES can name that folder."
        ) from error


@dataclass(frozen=True)
class _Packed(Sequence[NDArray[np.uint8]]):
    """Pictures that are decoded when they are looked at: all of them at once would take a megabyte each."""

    files: tuple[NDArray[np.uint8], ...]  # what JPEG or PNG files hold

    def __len__(self) -> int:
        return len(self.files)

    @overload
    def __getitem__(self, index: int) -> NDArray[np.uint8]: ...
    @overload
    def __getitem__(self, index: slice) -> Sequence[NDArray[np.uint8]]: ...
    def __getitem__(self, index: int | slice) -> NDArray[np.uint8] | Sequence[NDArray[np.uint8]]:
        if isinstance(index, slice):
            return _Packed(self.files[index])
        import cv2

        picture: Any = cv2.imdecode(self.files[index], cv2.IMREAD_COLOR)
        return np.ascontiguousarray(picture[..., ::-1])


def _rendered(names: tuple[str, ...], side: str, sentence: str) -> Pictures:
    """The board of the standard scene from around it, through a lens like that of the photographs."""
    import cv2

    from camviz.cameras import Camera, Intrinsics
    from camviz.lenses import BrownConrady
    from camviz.scenes import render, textured_scene, to_display
    from camviz.scenes.standard import SQUARE

    camera = Camera(Intrinsics(640, 480, 536, 536, 342, 236), BrownConrady(k1=-0.27, k2=-0.04, k3=0.24))
    poses = [_pose(view, 0.5 if side == "right" else -0.5) for view in range(len(names))]
    pictures = (to_display(render(textured_scene(), camera.at(pose), supersample=2)) for pose in poses)
    packed = _Packed(tuple(cv2.imencode(".png", picture[..., ::-1])[1] for picture in pictures))
    return Pictures(names, packed, SQUARE, False, sentence)


def _pose(view: int, offset: float) -> RigidTransform:
    """Where the pair stands for a view, half a baseline to either side: spread around the board, turned and tilted."""
    from camviz.cameras import look_at
    from camviz.scenes import board_corners

    corners = board_corners().reshape(6, 9, 3)
    right, down = unit(corners[0, -1] - corners[0, 0]), unit(corners[-1, 0] - corners[0, 0])
    turn, lift, roll = 0.7 * np.sin(2.4 * view), 0.4 * np.cos(1.7 * view), 0.35 * np.sin(1.3 * view)
    distance = 1.5 + 0.3 * np.cos(0.9 * view)
    centre = corners.mean(axis=(0, 1))
    eye = centre + distance * (turn * right + lift * down - np.cross(right, down))
    aim = centre + 0.15 * (np.cos(2 * view) * right + np.sin(3 * view) * down)
    pose = look_at(eye, aim, down + roll * right)
    return pose * RigidTransform.from_translation([offset * BASELINE, 0, 0])


# A published stereo pair with its truth ------------------------------------------------------------------------------


@dataclass(frozen=True)
class StereoSample:
    """A pair of pictures (height, width, 3), uint8 sRGB, in rectified rows, and what is known of it.

    `disparity` (height, width) are the true u_left − u_right in pixels, NaN where unknown; `focal_length` and
    `doffs` = cx_right − cx_left are in pixels, `baseline` in metres. `real` and `sentence` as in `Pictures`.
    """

    left: NDArray[np.uint8]
    right: NDArray[np.uint8]
    disparity: NDArray[np.float32]
    focal_length: float
    baseline: float
    doffs: float
    real: bool
    sentence: str

    @property
    def cameras(self) -> tuple[Camera, Camera]:
        """The left camera, its principal point in the middle of the picture, and the right one beside it."""
        from camviz.cameras import Camera, Intrinsics

        height, width = self.disparity.shape
        f, cx, cy = self.focal_length, (width - 1) / 2, (height - 1) / 2
        beside = RigidTransform.from_translation([self.baseline, 0, 0])
        right = Intrinsics(width, height, f, f, cx + self.doffs, cy)
        return Camera(Intrinsics(width, height, f, f, cx, cy)), Camera(right, world_from_cam=beside)

    @property
    def depth(self) -> Array:
        """The true Z (height, width) in metres, NaN where it is unknown."""
        from camviz.twoview import depth_from_disparity

        return depth_from_disparity(self.disparity, self.focal_length, self.baseline, self.doffs)


def motorcycle(width: int = 741) -> StereoSample:
    """The motorcycle of the Middlebury stereo data of 2014 (Scharstein et al.), from scikit-image, `width` pixels wide.

    The files are read from scikit-image's data folder without importing it. Where the installed one lacks them, the
    virtual camera's garden takes their place.
    """
    import cv2

    folder = files("skimage") / "data"
    names = ("motorcycle_left.png", "motorcycle_right.png", "motorcycle_disp.npz")
    if not all((folder / name).is_file() for name in names):
        missing = "The installed scikit-image has no motorcycle pair; the virtual camera's garden takes its place."
        return _garden_pair(width, missing)
    held = [np.frombuffer((folder / name).read_bytes(), np.uint8) for name in names[:2]]
    pictures = [cv2.cvtColor(cv2.imdecode(one, cv2.IMREAD_COLOR), cv2.COLOR_BGR2RGB) for one in held]
    with as_file(folder / names[2]) as path, np.load(path) as arrays:
        disparity = arrays["arr_0"].astype(np.float32)
    scale = width / pictures[0].shape[1]
    size = (width, round(scale * pictures[0].shape[0]))
    left, right = (cv2.resize(one, size, interpolation=cv2.INTER_AREA) for one in pictures)
    true = cv2.resize(disparity, size, interpolation=cv2.INTER_NEAREST)
    true = np.where(np.isfinite(true), np.float32(scale) * true, np.float32(np.nan))
    credit = "The motorcycle of the Middlebury stereo data (Scharstein et al. 2014), from scikit-image's data folder."
    return StereoSample(left, right, true, scale * 994.978, 0.193001, scale * 31.086, True, credit)


def _garden_pair(width: int, sentence: str) -> StereoSample:
    from camviz.cameras import Camera, Intrinsics
    from camviz.scenes import snapshot, textured_scene

    left = Camera(Intrinsics.from_fov(width, round(0.675 * width), 60))
    right = left.at(RigidTransform.from_translation([0.193001, 0, 0]))
    scene, rays = textured_scene(), left.rays()
    _, distance = scene.trace(left.centre, rays)
    f = left.intrinsics.fx
    true = (f * 0.193001 / (distance * rays[..., 2])).astype(np.float32)
    return StereoSample(snapshot(scene, left), snapshot(scene, right), true, f, 0.193001, 0.0, False, sentence)


# A panorama that no one here rendered --------------------------------------------------------------------------------


@dataclass(frozen=True)
class Panorama:
    """An equirectangular picture (height, 2 height, 3), uint8 sRGB, of all directions; else as `Pictures`."""

    picture: NDArray[np.uint8]
    real: bool
    sentence: str


def earth_map(width: int = 1024) -> Panorama:
    """The map of the earth in PyVista's wheel, `width` pixels wide, longitude −180° … 180°; else the garden's panorama.

    The file is read without importing PyVista.
    """
    import cv2

    found = find_spec("pyvista")
    folders = (found.submodule_search_locations or []) if found else []
    paths = [Path(folder) / "examples" / "2k_earth_daymap.jpg" for folder in folders]
    data = next((cv2.imread(str(path), cv2.IMREAD_COLOR) for path in paths if path.is_file()), None)
    if data is None:
        return _garden_around(width, "No installed PyVista has the map of the earth; the garden takes its place.")
    small = cv2.resize(data, (width, width // 2), interpolation=cv2.INTER_AREA)
    credit = (
        "The map of the earth by day (2k_earth_daymap.jpg) by Solar System Scope, CC BY 4.0, made smaller; "
        "the file is that of PyVista's examples."
    )
    return Panorama(np.ascontiguousarray(small[..., ::-1]), True, credit)


def _garden_around(width: int, sentence: str) -> Panorama:
    from camviz.panoramas.reprojection import equirectangular_camera
    from camviz.scenes import snapshot, textured_scene

    return Panorama(snapshot(textured_scene(), equirectangular_camera(width, width // 2)), False, sentence)
