"""From the corners of boards to cameras: OpenCV solves, and what it returns becomes a `Calibration`."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import cv2
import numpy as np
from scipy.spatial.transform import RigidTransform, Rotation

from camviz.calibration.detection import Detections
from camviz.cameras import Camera, Intrinsics, transform
from camviz.files.calibration import Board, Calibration
from camviz.lenses import BrownConrady
from camviz.lenses.base import Array

STANDARD = ("fx", "fy", "cx", "cy", "k1", "k2", "p1", "p2", "k3")
FEWEST_VIEWS = 3
CRITERIA = (cv2.TERM_CRITERIA_COUNT + cv2.TERM_CRITERIA_EPS, 100, 1e-12)


@dataclass(frozen=True)
class Model:
    """A camera model: the intrinsic parameters that are solved for, and OpenCV's flags for them."""

    parameters: tuple[str, ...]
    flags: int = 0


MODELS = {"standard": Model(STANDARD)}


def calibrate(
    detections: Detections, board: Board, model: str = "standard", *, fixed: Sequence[str] = (), robust: bool = True
) -> Calibration:
    """The camera, named "camera", that saw a board in at least three views."""
    camera, cam_from_board = _solved(detections, board, MODELS[model])
    return _calibration(
        {"camera": camera}, {"camera": detections}, {"camera": cam_from_board}, board, MODELS[model].parameters
    )


def calibrate_pair(
    left: Detections,
    right: Detections,
    board: Board,
    model: str = "standard",
    *,
    fixed: Sequence[str] = (),
    robust: bool = True,
) -> Calibration:
    """The cameras "left" and "right" of a pair, from the views that both have; the left one's frame is the world."""
    both = sorted(set(left.places) & set(right.places))
    left, right = _only(left, both), _only(right, both)
    solved = [_solved(detections, board, MODELS[model]) for detections in (left, right)]
    objects, first = _lists(board, left.corners)
    second = _lists(board, right.corners)[1]
    matrices = [x for camera, _ in solved for x in (camera.intrinsics.K, _coefficients(camera))]
    size = (left.width, left.height)
    R, t = cv2.stereoCalibrate(
        objects, first, second, *matrices, size, flags=cv2.CALIB_FIX_INTRINSIC, criteria=CRITERIA
    )[5:7]
    right_from_left = RigidTransform.from_components(np.ravel(t), Rotation.from_matrix(R))
    cameras = {"left": solved[0][0], "right": solved[1][0].at(right_from_left.inv())}
    poses = {"left": solved[0][1], "right": right_from_left * solved[0][1]}
    return _calibration(cameras, {"left": left, "right": right}, poses, board, MODELS[model].parameters)


def _solved(detections: Detections, board: Board, model: Model) -> tuple[Camera, RigidTransform]:
    if len(detections.corners) < FEWEST_VIEWS:
        raise ValueError(f"detections must have at least {FEWEST_VIEWS} views, got {len(detections.corners)}")
    objects, seen = _lists(board, detections.corners)
    size = (detections.width, detections.height)
    _, K, coefficients, rvecs, tvecs = cv2.calibrateCamera(
        objects, seen, size, None, None, flags=model.flags, criteria=CRITERIA
    )
    camera = Camera(Intrinsics.from_matrix(K, *size), BrownConrady.from_coefficients(coefficients))
    rotations = Rotation.from_rotvec(np.reshape(rvecs, (-1, 3)))
    return camera, RigidTransform.from_components(np.reshape(tvecs, (-1, 3)), rotations)


def _lists(board: Board, corners: Array) -> tuple[list[Array], list[Array]]:
    """What OpenCV takes: for each view the board's points and the pixels of the corners that were seen."""
    seen = np.isfinite(corners).all(-1)
    points = board.corners.astype(np.float32)
    pixels = corners.astype(np.float32)
    return [points[one] for one in seen], [view[one] for view, one in zip(pixels, seen, strict=True)]


def _coefficients(camera: Camera) -> Array:
    lens = camera.lens
    assert isinstance(lens, BrownConrady)
    return np.array([lens.k1, lens.k2, lens.p1, lens.p2, lens.k3])


def _only(detections: Detections, places: Sequence[int]) -> Detections:
    rows = [detections.places.index(place) for place in places]
    names = tuple(detections.pictures[row] for row in rows)
    return Detections(
        names, detections.corners[rows], detections.width, detections.height, detections.skipped, tuple(places)
    )


def _calibration(
    cameras: dict[str, Camera],
    detections: dict[str, Detections],
    poses: dict[str, RigidTransform],
    board: Board,
    estimated: tuple[str, ...],
) -> Calibration:
    errors, aside = {}, {}
    for name, camera in cameras.items():
        points_cam = transform_views(poses[name], board.corners)
        predicted = Camera(camera.intrinsics, camera.lens).project(points_cam)
        squared = np.sum((detections[name].corners - predicted) ** 2, axis=-1)
        errors[name] = np.sqrt(np.nanmean(squared, axis=1))
        aside[name] = np.zeros(squared.shape, dtype=bool)
    skipped = tuple(dict.fromkeys(pair for each in detections.values() for pair in each.skipped))
    return Calibration(
        cameras,
        Path(),
        "camviz",
        board,
        detections={name: each.corners for name, each in detections.items()},
        cam_from_board=poses,
        per_view_errors=errors,
        pictures={name: each.pictures for name, each in detections.items()},
        set_aside=aside,
        estimated=dict.fromkeys(cameras, estimated),
        skipped=skipped,
    )


def transform_views(cam_from_board: RigidTransform, points: Array) -> Array:
    """Board points (corners, 3) in the camera's frame of each view, (views, corners, 3)."""
    return np.stack([transform(pose, points) for pose in cam_from_board])
