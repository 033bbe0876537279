"""ORB-SLAM2's and ORB-SLAM3's settings: one camera or a pair, with a key for each number."""

from __future__ import annotations

import re
from collections.abc import Iterator
from typing import Any

import numpy as np

from camviz.cameras import Camera
from camviz.lenses import BrownConrady, Perspective
from camviz.poses import RigidTransform
from camviz_clinic.calibration.redundancy import Redundancy, compared, share
from camviz_clinic.calibration.types import Calibration, CalibrationError
from camviz_clinic.files.format import File, Format, parameters_of
from camviz_clinic.files.models import Model, expressed
from camviz_clinic.files.output import as_opencv
from camviz_clinic.files.parameter_layouts import LAYOUTS
from camviz_clinic.files.section import Section, Size, agreed_size

TITLE = "ORB-SLAM settings"
MODELS = LAYOUTS["orbslam"]
READ = [*MODELS, Model("Rectified", Perspective, "fx fy cx cy")]
LEFT_FROM_RIGHT = ("Stereo.T_c1_c2", "Tlr")
IMU_FROM_LEFT = ("IMU.T_b_c1", "Tbc")
DEPTH = ("RGBD.DepthMapFactor", "DepthMapFactor")  # only settings for a camera with depth have it


def read(file: File) -> Calibration:
    """Camera1 and Camera2, or ORB-SLAM2's Camera, or the pair LEFT and RIGHT that it rectifies first."""
    section, redundant = file.section, tuple[Redundancy, ...]()
    if "LEFT.K" in section and "RIGHT.K" in section:
        cameras, notes = _unrectified(section, file.size), []
        redundant = tuple(_redundant(section))
    else:
        size = agreed_size(section.sides("Camera.width", "Camera.height"), file.size, "Camera.width, Camera.height")
        first = "Camera1" if "Camera1.fx" in section else "Camera"
        cameras, notes = {"camera": _camera(section, first, size)}, _notes(section)
        if "Camera2.fx" in section:
            right, left_from_right = _camera(section, "Camera2", size), _pose(section, LEFT_FROM_RIGHT)
            placed = right if left_from_right is None else right.at(left_from_right)
            cameras = {"left": cameras["camera"], "right": placed}
    imu_from_left = _pose(section, IMU_FROM_LEFT)
    imu = imu_from_left.inv() if imu_from_left is not None else None
    return Calibration(cameras, file.path, TITLE, world_from_imu=imu, notes=tuple(notes), redundant=redundant)


def _camera(section: Section, prefix: str, size: Size) -> Camera:
    name = section.choice("Camera.type", [model.name for model in READ]) if "Camera.type" in section else "PinHole"
    model = next(model for model in READ if model.name == name)
    values = parameters_of(section, model, {key: f"{prefix}.{key}" for key in model.names})
    return model.camera(values, *size, 0.0, section.where(prefix))


def _pose(section: Section, keys: tuple[str, ...]) -> RigidTransform | None:
    """The transform under one of the keys, 4×4, or 3×4 as Tlr is written."""
    key = next((key for key in keys if key in section), None)
    if key is None:
        return None
    if section.array(key).size == 12:
        matrix = np.vstack([section.matrix(key, 3, 4), [0, 0, 0, 1]])
        return section.part({key: matrix.tolist()}, section.path).transform(key)
    return section.transform(key)


def _notes(section: Section) -> list[str]:
    """What a pair's settings say of the other camera; of an RGB-D camera bf is that of no second picture."""
    notes: list[str] = []
    if any(key in section for key in DEPTH):
        return notes
    if "Camera2.fx" not in section and ("Camera.bf" in section or "Stereo.b" in section):
        baseline = section.number("Stereo.b") if "Stereo.b" in section else _baseline(section)
        notes.append(f"These are rectified pictures; the other camera of the pair is {baseline:.4g} m to the right.")
    elif "Camera2.fx" in section and not any(key in section for key in LEFT_FROM_RIGHT):
        notes.append("The file does not say where the right camera stands: it is drawn at the place of the left one.")
    return notes


def _baseline(section: Section) -> float:
    focal = section.number("Camera.fx" if "Camera.fx" in section else "Camera1.fx")
    return section.number("Camera.bf") / focal if focal else float("inf")


def _unrectified(section: Section, given: Size | None) -> dict[str, Camera]:
    """ORB-SLAM2's LEFT and RIGHT: K and D before rectification, and cv::stereoRectify's R and P.

    R_r x_r = R_l x_l + (P_r[0, 3] / fx, 0, 0), both sides being the rectified frames.
    """
    cameras = {}
    for name in ("LEFT", "RIGHT"):
        size = agreed_size(section.sides(f"{name}.width", f"{name}.height"), given, f"{name}.width, {name}.height")
        grid = section.intrinsics(section.matrix(f"{name}.K", 3, 3), section.where(f"{name}.K"), size)
        lens = BrownConrady.from_coefficients(section.coefficients(f"{name}.D", [4, 5, 8], "k1 k2 p1 p2 k3"))
        cameras[name.lower()] = Camera(grid, lens)
    P = section.matrix("RIGHT.P", 3, 4)
    if not P[0, 0] > 0:
        raise section.error("RIGHT.P", "a projection matrix with a positive focal length", f"{P[0, 0]:g}")
    turned = [RigidTransform.from_rotation(section.rotation(f"{name}.R")) for name in ("LEFT", "RIGHT")]
    right_from_left = turned[1].inv() * RigidTransform.from_translation([P[0, 3] / P[0, 0], 0, 0]) * turned[0]
    return cameras | {"right": cameras["right"].at(right_from_left.inv())}


def _redundant(section: Section) -> Iterator[Redundancy]:
    """The rectified camera beside LEFT.P, and Camera.bf beside RIGHT.P, whose P[0, 3] = -bf."""
    keys = [f"Camera.{name}" for name in ("fx", "fy", "cx", "cy")]
    if "LEFT.P" in section and all(key in section for key in keys):
        values = [section.number(key) for key in keys]
        P = section.matrix("LEFT.P", 3, 4)
        yield compared("LEFT.P", "Camera.fx …", lambda P, k: {"px": P[[0, 1, 0, 1], [0, 1, 2, 2]] - k}, P, values)
    shift = section.matrix("RIGHT.P", 3, 4)[0, 3]
    if shift and "Camera.bf" in section and section.number("Camera.bf"):
        yield compared("Camera.bf", "RIGHT.P", lambda bf, x: share(bf, -x), section.number("Camera.bf"), shift)


def write(calibration: Calibration) -> bytes:
    """ORB-SLAM3's keys for the cameras; features, viewer and noise of the IMU are yours to add."""
    held = [expressed(name, camera, MODELS, TITLE) for name, camera in calibration.cameras.items()]
    (model, _), camera = held[0], next(iter(calibration.cameras.values()))
    if any(other.name != model.name or _size(each) != _size(camera) for other, each in held):
        raise CalibrationError(f"{TITLE} have one camera model and one image size for a pair, and these cameras differ")
    tree: dict[str, Any] = {"File.version": "1.0", "Camera.type": model.name}
    for number, (_, same) in enumerate(held, 1):
        values = zip(model.names, model.values(same, 0.0), strict=True)
        tree |= {f"Camera{number}.{name}": value for name, value in values}
    tree |= dict(zip(("Camera.width", "Camera.height"), _size(camera), strict=True))
    if len(held) == 2:
        tree[LEFT_FROM_RIGHT[0]] = held[1][1].world_from_cam.as_matrix()
    if calibration.world_from_imu is not None:
        tree[IMU_FROM_LEFT[0]] = calibration.world_from_imu.inv().as_matrix()
    return as_opencv(tree)


def _size(camera: Camera) -> Size:
    return camera.intrinsics.width, camera.intrinsics.height


FORMAT = Format(
    name="orbslam",
    title=TITLE,
    file="settings.yaml",
    recognise=lambda file: any(re.fullmatch(r"Camera1?\.(fx|type)|LEFT\.K", key) for key in file.section.values),
    read=read,
    write=write,
    most_cameras=2,
    models="PinHole, KannalaBrandt8; Rectified is read too",
    says="ORB-SLAM2's and 3's; T_c1_c2: right camera → left; T_b_c1: left camera → IMU; Camera.bf is a note",
    lacks="skew, two kinds of lens in one file",
    rank=45,
)
