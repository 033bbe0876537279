"""A virtual camera before virtual boards, whose truth is known: what the tests of calibration share."""

from dataclasses import replace

import numpy as np
from scipy.spatial.transform import RigidTransform, Rotation

from camviz.cameras import Camera, Intrinsics
from camviz.lenses import BrownConrady
from camviz_clinic.calibration.adjustment import Adjustment
from camviz_clinic.calibration.problem import moved
from camviz_clinic.calibration.types import Board

BOARD = Board(9, 6, 0.025)
CAMERA = Camera(Intrinsics(640, 480, 530.0, 532.0, 325.0, 236.0), BrownConrady(-0.28, 0.1, 1e-3, -5e-4))
ESTIMATED = ("fx", "fy", "cx", "cy", "k1", "k2", "p1", "p2")
RIGHT = CAMERA.at(RigidTransform.from_components([0.08, 0.002, 0.001], Rotation.from_rotvec([0.01, -0.02, 0.005])))


def board_poses(rng, views, tilt=0.6, camera=CAMERA):
    """Poses cam_from_board of boards all over the picture, 0.25 to 0.5 m away, tilted by up to about `tilt` radians."""
    turns = Rotation.from_rotvec(rng.uniform(-1, 1, (views, 3)) * [tilt, tilt, 0.3])
    uv = rng.uniform([150, 120], [490, 360], (views, 2))
    middles = camera.lens.unproject(camera.intrinsics.from_pixels(uv)) * rng.uniform(0.25, 0.5, (views, 1))
    return RigidTransform.from_components(middles - turns.apply(BOARD.corners.mean(axis=0)), turns)


def truth(poses, cameras=None, estimated=ESTIMATED, warp=None, board=BOARD):
    """The adjustment at the truth, with the corners exactly where they are; those outside a picture are not seen."""
    cameras = {"camera": CAMERA} if cameras is None else cameras
    points = moved(poses, board.corners if warp is None else board.warped(warp))
    detections = {}
    for name, camera in cameras.items():
        uv = camera.project(points)
        detections[name] = np.where(camera.intrinsics.contains(uv)[..., None], uv, np.nan)
    return Adjustment(board, cameras, detections, poses, dict.fromkeys(cameras, estimated), warp=warp)


def noisy(adjustment, rng, sigma):
    """The same problem with noise on its corners."""
    detections = {name: uv + rng.normal(0, sigma, uv.shape) for name, uv in adjustment.detections.items()}
    return replace(adjustment, detections=detections)
