"""PhotonVision's calibration JSON: one camera, and since 2024 the corners that it was solved from."""

from __future__ import annotations

import re
from typing import Any

import numpy as np

from camviz.cameras import Camera
from camviz.lenses import BrownConrady
from camviz.lenses.base import Array
from camviz.poses import RigidTransform
from camviz_clinic.calibration.types import Board, Calibration, Mask
from camviz_clinic.files.format import File, Format
from camviz_clinic.files.models import GRID, Model, expressed
from camviz_clinic.files.output import as_json, as_matrix
from camviz_clinic.files.section import Section, agreed_size, explained
from camviz_clinic.files.trees import MAX_NODES, shown

TITLE = "PhotonVision calibration"
TERMS = "k1 k2 p1 p2 k3 k4 k5 k6 s1 s2 s3 s4"
MODELS = [Model("LENSMODEL_OPENCV", BrownConrady, f"{GRID} {' '.join(TERMS.split()[:count])}") for count in (5, 8, 12)]
FIRST_KEY = "cameraExtrinsics"  # of the coefficients, until 2023
_KEY = re.compile(r'"cameraIntrinsics"\s*:')
ON_GRID = 0.01  # of a square, which a corner of the board may be off its place
LARGEST_BOARD = 1000  # squares along a side
POSE_FITS_PX, POSE_FITS = 1.0, 3.0  # a pose of the file fits within a pixel, or three times what the file says


def is_calibration(file: File) -> bool:
    """True where resolution, K and the coefficients stand side by side."""
    return bool(_KEY.search(file.text)) and all(
        any(name in file.section for name in names)
        for names in (["cameraIntrinsics"], ["resolution"], ["distCoeffs", FIRST_KEY])
    )


def read(file: File) -> Calibration:
    """The camera at the origin, with the corners of its observations where they are those of a board."""
    section = file.section
    camera = _camera(section, file)
    views, notes = _views(section, camera)
    return Calibration({"camera": camera}, file.path, TITLE, notes=tuple(notes), **views)


def _camera(section: Section, file: File) -> Camera:
    if "lensmodel" in section:
        section.choice("lensmodel", [MODELS[0].name])
    if section.values.get("isFisheye") is True:
        raise section.error("isFisheye", "false, as its model of a fisheye is not documented", "true")
    held = section.section("resolution").sides("width", "height")
    size = agreed_size(held, file.size, "resolution")
    grid = section.intrinsics(section.matrix("cameraIntrinsics", 3, 3), section.where("cameraIntrinsics"), size)
    key = "distCoeffs" if "distCoeffs" in section else FIRST_KEY
    values = section.coefficients(key, [4, 5, 8, 12, 14], "k1 k2 p1 p2 k3 …")
    with explained(section.where(key)):
        return Camera(grid, BrownConrady.from_coefficients(values))


def _views(section: Section, camera: Camera) -> tuple[dict[str, Any], list[str]]:
    """What the file keeps of its views, as fields of Calibration, and what is dropped of it, in sentences."""
    observations = section.sections("observations") if "observations" in section else []
    if not observations:
        return _errors_alone(section)
    board = _board(section, observations)
    if board is None:
        return {}, ["The observations are left out: their points are no grid of a board's squares."]
    corners, used, errors = (
        np.stack(each) for each in zip(*(_view(each, board) for each in observations), strict=True)
    )
    views = {"detections": corners, "per_view_errors": errors}
    if (seen := np.isfinite(corners).all(axis=-1) & ~used).any():
        views["set_aside"] = seen
    if np.isnan(errors).all():
        del views["per_view_errors"]
    for values in views.values():
        values.flags.writeable = False
    poses, notes = _poses(observations, camera, board, corners, errors)
    held: dict[str, Any] = {key: {"camera": values} for key, values in views.items()}
    held |= {"board": board, "pictures": {"camera": _pictures(observations)}} | _warp(section)
    return held | ({"cam_from_board": {"camera": poses}} if poses is not None else {}), notes


def _errors_alone(section: Section) -> tuple[dict[str, Any], list[str]]:
    """Until 2023 the file had an RMS for each view and no corners."""
    if "perViewErrors" not in section:
        return {}, []
    errors = np.atleast_1d(section.array("perViewErrors")).ravel()
    errors.flags.writeable = False
    return ({"per_view_errors": {"camera": errors}} if len(errors) else {}), []


def _points(observation: Section, key: str, names: str) -> Array:
    points = observation.sections(key)
    return np.array([[point.number(name) for name in names] for point in points]).reshape(len(points), len(names))


def _board(section: Section, observations: list[Section]) -> Board | None:
    """The grid on which the points of all observations lie; None where there is no such grid."""
    points = np.concatenate([_points(each, "locationInObjectSpace", "xy") for each in observations])
    square = section.number("calobjectSpacing") if "calobjectSpacing" in section else 0.0
    if not len(points) or not square > 0:
        return None
    with np.errstate(over="ignore"):
        squares = points / square
    if not (np.abs(squares) <= LARGEST_BOARD).all():
        return None
    places = np.round(squares)
    columns, rows = (int(count) for count in places.max(axis=0) + 1)
    off = float(np.abs(squares - places).max())
    if off > ON_GRID or places.min() < 0 or min(columns, rows) < 2 or columns * rows * len(observations) > MAX_NODES:
        return None
    return Board(columns, rows, square)


def _view(observation: Section, board: Board) -> tuple[Array, Mask, float]:
    """The corners (n, 2) in the board's order, NaN for one that was not seen; which were used; and their RMS."""
    points = _points(observation, "locationInObjectSpace", "xy")
    pixels = _points(observation, "locationInImageSpace", "xy")
    if len(points) != len(pixels):
        expected = f"{len(points)} points, one for each of the board's"
        raise observation.error("locationInImageSpace", expected, len(pixels))
    columns, rows = np.round(points / board.square_size).astype(int).T
    seen = (pixels >= 0).all(axis=1)  # PhotonVision has (-1, -1) for a corner that was not
    flags = _flags(observation, len(points))
    corners, used = np.full((board.columns * board.rows, 2), np.nan), np.zeros(board.columns * board.rows, bool)
    places = rows * board.columns + columns
    if len(set(places.tolist())) < len(places):
        raise observation.error("locationInObjectSpace", "each point of the board once", "one of them twice")
    corners[places[seen]] = pixels[seen]
    used[places] = flags
    return corners, used, _error(observation, flags & seen)


def _flags(observation: Section, count: int) -> Mask:
    """Which corners were used; until 2025 the file does not say, and all were."""
    flags = observation.values.get("cornersUsed")
    if flags is None:
        return np.ones(count, bool)
    if not isinstance(flags, list) or len(flags) != count or not all(isinstance(each, bool) for each in flags):
        raise observation.error("cornersUsed", f"true or false for each of {count} corners", shown(flags))
    return np.array(flags, bool)


def _error(observation: Section, counted: Mask) -> float:
    """The RMS of the distances that the file says; PhotonVision leaves out those of corners that it did not use."""
    if not observation.values.get("reprojectionErrors"):
        return float("nan")
    off = _points(observation, "reprojectionErrors", "xy")
    if len(off) == len(counted):
        off = off[counted]
    return float(np.sqrt(np.mean(np.sum(off**2, axis=1)))) if len(off) else float("nan")


def _poses(
    observations: list[Section], camera: Camera, board: Board, corners: Array, errors: Array
) -> tuple[RigidTransform | None, list[str]]:
    """The board's poses, unless they leave the corners elsewhere than the file says: then they are found anew."""
    if not all("optimisedCameraToObject" in each for each in observations):
        return None, []
    poses = RigidTransform.concatenate([_pose(each.section("optimisedCameraToObject")) for each in observations])
    expected = np.stack([camera.project(pose.apply(board.corners)) for pose in poses])
    left = float(np.sqrt(np.nanmean(np.sum((corners - expected) ** 2, axis=-1)))) if np.isfinite(corners).any() else 0.0
    said = float(np.nanmax(errors)) if np.isfinite(errors).any() else 0.0
    if left <= max(POSE_FITS_PX, POSE_FITS * said):
        return poses, []
    return None, [
        f"The poses of the board (optimisedCameraToObject) are left out: with this camera they put corners {left:.3g} "
        f"px RMS from where they were seen, and the file says {said:.3g} px at most. They are found anew."
    ]


def _pose(section: Section) -> RigidTransform:
    """cam_from_board with OpenCV's axes, whatever the key is called."""
    place, turn = section.section("translation"), section.section("rotation").section("quaternion")
    quaternion = [turn.number(axis) for axis in "WXYZ"]
    rotation = section.quaternion(quaternion, turn.path, scalar_first=True)
    return RigidTransform.from_components([place.number(axis) for axis in "xyz"], rotation)


def _pictures(observations: list[Section]) -> tuple[str, ...]:
    names = [each.values.get("snapshotName") for each in observations]
    return tuple(
        name if isinstance(name, str) and name.isprintable() and name else f"view {number}"
        for number, name in enumerate(names, 1)
    )


def _warp(section: Section) -> dict[str, Any]:
    """mrcal's two numbers; OpenCV's solution has none, or zeros."""
    if not section.values.get("calobjectWarp"):
        return {}
    warp = np.array(section.vector("calobjectWarp", [2], "w_x w_y"))
    warp.flags.writeable = False
    return {"board_warp": warp} if warp.any() else {}


def write(calibration: Calibration) -> bytes:
    """The camera, as PhotonVision imports it, without observations."""
    ((name, camera),) = calibration.cameras.items()
    model, same = expressed(name, camera, MODELS, TITLE)
    coefficients = np.array([model.values(same, 0.0)[4:]])
    grid, board = camera.intrinsics, calibration.board
    tree: dict[str, Any] = {
        "resolution": {"width": float(grid.width), "height": float(grid.height)},
        "cameraIntrinsics": _written(same.intrinsics.K),
        "distCoeffs": _written(coefficients),
        "calobjectWarp": [],
        "observations": [],
        "calobjectSize": {"width": float(board.columns), "height": float(board.rows)} if board else None,
        "calobjectSpacing": float(board.square_size) if board else 0.0,
        "lensmodel": model.name,
    }
    return as_json({key: value for key, value in tree.items() if value is not None})


def _written(values: Array) -> dict[str, Any]:
    """A matrix of CV_64FC1, OpenCV's type 6."""
    held = as_matrix(values)
    return {"rows": held["rows"], "cols": held["cols"], "type": 6, "data": held["data"]}


FORMAT = Format(
    name="photonvision",
    title=TITLE,
    file="calibration.json",
    recognise=is_calibration,
    read=read,
    write=write,
    most_cameras=1,
    models="4, 5, 8, 12, 14 coefficients of OpenCV (LENSMODEL_OPENCV)",
    says="corners, which of them were used, the bend of the board and its poses are read from the observations, and "
    "not written; optimisedCameraToObject: board → camera, quaternion W X Y Z; files of 2023 have the coefficients "
    "under cameraExtrinsics",
    lacks="skew, tilt",
    rank=29,  # before mrcal, whose files have the key lensmodel too
)
