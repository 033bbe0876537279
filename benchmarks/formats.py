"""How far other people's calibration files, read by camviz, project from the equations that their programs define.

    CAMVIZ_FIELD=~/field python benchmarks/formats.py

formats.toml says which files, and how to have them. Each is read a second time here, with nothing of camviz, and 100
points before each of its cameras are projected by the format's own formula. Printed is a Markdown table: the cameras,
the largest distance in pixels between the two, and, for points of the world, the same with the poses of the file, whose
rotations are rounded there and exact in camviz.
"""

from __future__ import annotations

import configparser
import hashlib
import json
import os
import re
import tomllib
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path
from xml.etree import ElementTree

import cv2
import numpy as np
from kernel import table
from numpy.typing import ArrayLike, NDArray
from scipy.spatial.transform import Rotation

from camviz.cameras import Camera, transform
from camviz.files import format_of, load
from camviz.files.format import File

MANIFEST = Path(__file__).with_name("formats.toml")
POINTS = np.random.default_rng(11).uniform([-0.4, -0.3, 1.0], [0.4, 0.3, 3.0], size=(100, 3))
Array = NDArray[np.float64]
HERE = np.eye(3)


@dataclass(frozen=True)
class Reference:
    """A camera as its file defines it: pixels of points in its frame, and where it stands, x_cam = R x_world + t."""

    project: Callable[[Array], Array]
    R: Array
    t: Array


def opencv(points: Array, K: ArrayLike, D: ArrayLike) -> Array:
    """OpenCV's own projection."""
    pixels, _ = cv2.projectPoints(points, np.zeros(3), np.zeros(3), np.array(K, float), np.array(D, float).ravel())
    return pixels[:, 0].astype(float)


def camera(K: ArrayLike, D: ArrayLike, R: ArrayLike = HERE, t: ArrayLike = (0, 0, 0)) -> Reference:
    """A camera of OpenCV's model."""
    return Reference(lambda points: opencv(points, K, D), np.array(R, float), np.array(t, float).ravel())


def matrix(fx: float, fy: float, cx: float, cy: float) -> list[list[float]]:
    """The camera matrix."""
    return [[fx, 0, cx], [0, fy, cy], [0, 0, 1]]


def qualisys(path: Path) -> Iterator[Reference]:
    """Lengths in 1/64 px less the window's corner; y up and z backward; millimetres."""
    for each in ElementTree.parse(path).iter("camera"):
        window, held, pose = (each.find(name).attrib for name in ("fov_video", "intrinsic", "transform"))  # type: ignore[union-attr]
        U, V = ((float(held[f"focalLength{a}"]) / 64, float(held[f"centerPoint{a}"]) / 64) for a in "UV")
        K = matrix(U[0], V[0], U[1] - float(window["left"]), V[1] - float(window["top"]))
        radial = [float(held[f"radialDistortion{n}"]) for n in (1, 2, 3)]
        D = [*radial[:2], *(float(held[f"tangentalDistortion{n}"]) for n in (1, 2)), radial[2]]
        R = np.diag([1, -1, -1]) @ [[float(pose[f"r{i}{j}"]) for j in (1, 2, 3)] for i in (1, 2, 3)]
        yield camera(K, D, R, -R @ [float(pose[axis]) / 1000 for axis in "xyz"])


def zed(path: Path) -> Iterator[Reference]:
    """The largest size; X_right = R X_left - T."""
    ini = configparser.ConfigParser()
    ini.read(path)
    stereo = {key: float(value) for key, value in ini["STEREO"].items()}
    turn = Rotation.from_rotvec([stereo[f"{key}_2k"] for key in ("rx", "cv", "rz")]).as_matrix()
    place = [-stereo[key] / 1000 for key in ("baseline", "ty", "tz")]
    for side, R, t in (("LEFT", np.eye(3), [0, 0, 0]), ("RIGHT", turn, place)):
        held = {key: float(value) for key, value in ini[f"{side}_CAM_2K"].items()}
        K = matrix(*(held[key] for key in ("fx", "fy", "cx", "cy")))
        yield camera(K, [held.get(key, 0.0) for key in ("k1", "k2", "p1", "p2", "k3")], R, t)


def realsense(path: Path) -> Iterator[Reference]:
    """Without coefficients."""
    held = json.loads(path.read_text())
    yield camera(matrix(held["fx"], held["fy"], held["ppx"], held["ppy"]), np.zeros(5))


def oak(path: Path) -> Iterator[Reference]:
    """x_to = R x + t / 100 along toCameraSocket; the world is socket 0."""
    held = dict(json.loads(path.read_text())["cameraData"])
    for socket in sorted(held):
        R, t, at = np.eye(3), np.zeros(3), socket
        while at != 0:
            step = held[at]["extrinsics"]
            turn, place = np.array(step["rotationMatrix"]), np.array([step["translation"][axis] for axis in "xyz"])
            R, t, at = turn @ R, turn @ t + place / 100, step["toCameraSocket"]
        yield camera(held[socket]["intrinsicMatrix"], held[socket]["distortionCoeff"], R.T, -R.T @ t)


def ost(path: Path) -> Iterator[Reference]:
    """Blocks of numbers under their names; # and ; begin remarks."""
    text = re.sub(r"^[#;].*$", "", path.read_text(), flags=re.MULTILINE)
    blocks = re.findall(r"^(camera matrix|distortion)\n((?:[-+.\deE \t]+\n)+)", text, re.MULTILINE)
    held = {name: [float(word) for word in numbers.split()] for name, numbers in blocks}
    yield camera(np.reshape(held["camera matrix"], (3, 3)), held["distortion"])


def easymocap(path: Path) -> Iterator[Reference]:
    """The cameras of intri.yml that extri.yml has too."""
    inside, outside = (cv2.FileStorage(str(path.with_name(f"{name}.yml")), 0) for name in ("intri", "extri"))
    names = inside.getNode("names")
    for name in (names.at(index).string() for index in range(names.size())):
        if not outside.getNode(f"T_{name}").empty():
            K, D = (inside.getNode(f"{key}_{name}").mat() for key in ("K", "dist"))
            R, t = (outside.getNode(f"{key}_{name}").mat() for key in ("Rot", "T"))
            yield camera(K, D, R, t)


def openmvg(path: Path) -> Iterator[Reference]:
    """Intrinsics without poses: three radial coefficients."""
    for each in json.loads(path.read_text())["intrinsics"]:
        held = each["value"]["ptr_wrapper"]["data"]
        k1, k2, k3 = held["disto_k3"]
        f = held["focal_length"]
        yield camera(matrix(f, f, *held["principal_point"]), [k1, k2, 0, 0, k3])


def ocamcalib(path: Path) -> Iterator[Reference]:
    """cam2world of the toolbox, inverted by bisection along each ray's radius."""
    lines = [line for line in path.read_text().splitlines() if line.strip() and not line.startswith("#")]
    s, (row, column), (c, d, e) = (np.array(lines[i].split(), float) for i in (0, 2, 3))

    def project(points: Array) -> Array:
        across = np.hypot(points[:, 0], points[:, 1])
        low, high = np.zeros(len(points)), np.full(len(points), 2000.0)
        for _ in range(200):
            rho = (low + high) / 2
            beyond = rho * points[:, 2] > -np.polyval(s[:0:-1], rho) * across  # the ray is (x, y, f(ρ)), z backward
            low, high = np.where(beyond, low, rho), np.where(beyond, rho, high)
        x, y = rho * points[:, 1] / across, rho * points[:, 0] / across  # its x runs down the rows
        return np.stack([column + e * x + y, row + c * x + d * y], axis=-1)

    yield Reference(project, np.eye(3), np.zeros(3))


def orbslam(path: Path) -> Iterator[Reference]:
    """LEFT and RIGHT as they were before cv::stereoRectify, or the one camera of an RGB-D set."""
    held = cv2.FileStorage(str(path), cv2.FILE_STORAGE_READ)
    if held.getNode("LEFT.K").empty():
        K = matrix(*(held.getNode(f"Camera.{key}").real() for key in ("fx", "fy", "cx", "cy")))
        yield camera(K, [held.getNode(f"Camera.{key}").real() for key in ("k1", "k2", "p1", "p2", "k3")])
        return
    turns = {side: held.getNode(f"{side}.R").mat() for side in ("LEFT", "RIGHT")}
    P = held.getNode("RIGHT.P").mat()
    for side, shift in (("LEFT", 0.0), ("RIGHT", P[0, 3] / P[0, 0])):
        K, D = (held.getNode(f"{side}.{key}").mat() for key in "KD")
        yield camera(K, D, turns[side].T @ turns["LEFT"], turns[side].T @ [shift, 0, 0])


REFERENCES = {
    each.__name__: each for each in (qualisys, zed, realsense, oak, ost, easymocap, openmvg, ocamcalib, orbslam)
}


def apart(ours: Camera, theirs: Reference) -> tuple[float, float]:
    """The largest distance in pixels, of points in the camera's frame and of the same in the world's."""
    inside = np.abs(ours.project(transform(ours.world_from_cam, POINTS)) - theirs.project(POINTS)).max()
    world = (POINTS - theirs.t) @ np.linalg.inv(theirs.R).T
    return float(inside), float(np.abs(ours.project(world) - theirs.project(POINTS)).max())


def row(entry: dict[str, object]) -> list[str]:
    """A line of the table, or why there is none."""
    repository, name = str(entry["repository"]), str(entry["path"])
    path = Path(os.environ["CAMVIZ_FIELD"], repository.replace("/", "+"), name)
    head = [str(entry["format"]), f"{repository}: {name}", str(entry["licence"])]
    if not path.is_file() or hashlib.sha256(path.read_bytes()).hexdigest() != entry["sha256"]:
        return [*head, "not there, or another file", "", ""]
    if format_of(File(path)).name != entry["format"]:
        return [*head, f"read as {format_of(File(path)).name}", "", ""]
    cameras = load(path, size=tuple(entry["size"]) if "size" in entry else None).cameras  # type: ignore[arg-type]
    references = list(REFERENCES[head[0]](path))
    found = [apart(*pair) for pair in zip(cameras.values(), references, strict=True)]
    return [*head, str(len(found)), *(f"{max(each):.1e}" for each in zip(*found, strict=True))]


if __name__ == "__main__":
    entries = tomllib.loads(MANIFEST.read_text(encoding="utf-8"))["file"]
    print(table(["format", "file", "licence", "cameras", "lens, px", "with pose, px"], [row(each) for each in entries]))
