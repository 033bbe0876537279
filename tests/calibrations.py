"""Calibrations for the tests of the clinic's views: boards before a virtual camera, solved by OpenCV."""

from dataclasses import replace
from functools import cache
from pathlib import Path

import cv2
import numpy as np
from scipy.spatial.transform import RigidTransform, Rotation

from camviz.cameras import Camera, Intrinsics
from camviz.lenses import BrownConrady
from camviz_clinic.calibration.types import Board, Calibration

BOARD = Board(9, 6, 0.025)
TRUE = Camera(Intrinsics(640, 480, 530, 532, 322, 238), BrownConrady(-0.25, 0.06))
RIGHT_FROM_LEFT = RigidTransform.from_components([-0.1, 0.002, 0.001], Rotation.from_rotvec([0.01, 0.02, -0.005]))
NAMES = ("fx", "fy", "cx", "cy", "k1", "k2", "p1", "p2", "k3")


def poses(views: int, seed: int = 0) -> RigidTransform:
    """cam_from_board of boards around the axis, tilted by up to 40° or so."""
    rng = np.random.default_rng(seed)
    turns = Rotation.from_rotvec(rng.uniform(-0.5, 0.5, (views, 3)))
    middles = rng.uniform((-0.1, -0.07, 0.3), (0.1, 0.07, 0.5), (views, 3))
    return RigidTransform.from_components(middles - turns.apply(BOARD.corners.mean(axis=0)), turns)


def seen(
    camera: Camera, cam_from_board: RigidTransform, corners: np.ndarray, noise: float, seed: int = 1
) -> np.ndarray:
    """Detected corners (views, corners, 2) with Gaussian noise of `noise` pixels; NaN outside the picture."""
    R, t = cam_from_board.rotation.as_matrix(), cam_from_board.translation
    uv = camera.at(RigidTransform.identity()).project(np.einsum("vij,cj->vci", R, corners) + t[:, None])
    uv = uv + np.random.default_rng(seed).normal(0, noise, uv.shape)
    return np.where(camera.intrinsics.contains(uv)[..., None], uv, np.nan)


def solved(detections: np.ndarray) -> tuple[Camera, RigidTransform, np.ndarray]:
    """Camera, poses and the RMS of every view, by cv2.calibrateCameraExtended."""
    known = np.isfinite(detections).all(axis=-1)
    objects = [BOARD.corners.astype(np.float32)[k] for k in known]
    images = [uv[k].astype(np.float32)[:, None] for uv, k in zip(detections, known, strict=True)]
    _, K, D, rvecs, tvecs, _, _, errors = cv2.calibrateCameraExtended(objects, images, (640, 480), None, None)
    camera = Camera(Intrinsics.from_matrix(K, 640, 480), BrownConrady.from_coefficients(D.ravel()[:5]))
    found = RigidTransform.from_components(np.reshape(tvecs, (-1, 3)), Rotation.from_rotvec(np.reshape(rvecs, (-1, 3))))
    return camera, found, errors.ravel()


@cache
def single(views: int = 10, noise: float = 0.1, seed: int = 0) -> Calibration:
    """A healthy calibration of one camera."""
    detections = seen(TRUE, poses(views, seed), BOARD.corners, noise, seed + 1)
    camera, found, errors = solved(detections)
    return calibration({"camera": camera}, {"camera": detections}, {"camera": found}, {"camera": errors})


@cache
def pair(views: int = 8, noise: float = 0.1) -> Calibration:
    """A healthy calibration of two cameras."""
    left_poses = poses(views, 4)
    right_poses = RIGHT_FROM_LEFT * left_poses
    detections = {
        "left": seen(TRUE, left_poses, BOARD.corners, noise, 5),
        "right": seen(TRUE, right_poses, BOARD.corners, noise, 6),
    }
    left, right = (solved(detections[name]) for name in ("left", "right"))
    cameras = {"left": left[0], "right": right[0].at(RIGHT_FROM_LEFT.inv())}
    return calibration(
        cameras, detections, {"left": left[1], "right": RIGHT_FROM_LEFT * left[1]}, {"left": left[2], "right": right[2]}
    )


def sick() -> Calibration:
    """One view with a column of corners 4 px off, half of it set aside."""
    healthy = single()
    detections = healthy.detections["camera"].copy()
    column = np.arange(54) % 9 == 0
    detections[3, column] += (4, 1)
    aside = np.zeros(detections.shape[:2], bool)
    aside[3, np.flatnonzero(column)[:3]] = True
    return replace(healthy, detections={"camera": detections}, set_aside={"camera": aside})


def bare() -> Calibration:
    """A file that holds a camera and nothing else."""
    return Calibration({"camera": TRUE}, Path("bare.yml"), "a test")


def calibration(cameras, detections, found, errors, source: str = "camera.yml") -> Calibration:
    names = {name: tuple(f"{name}{i + 1:02d}.jpg" for i in range(len(uv))) for name, uv in detections.items()}
    return Calibration(
        cameras, Path(source), "a test", BOARD, detections, found, errors,
        pictures=names, estimated=dict.fromkeys(cameras, NAMES),
    )  # fmt: skip
