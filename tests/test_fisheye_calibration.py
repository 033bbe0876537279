"""A fisheye calibrated from rendered pictures of a board is the fisheye that took them."""

from dataclasses import replace

import cv2
import numpy as np
import pytest

from camviz.cameras import Camera, Intrinsics
from camviz.lenses import KannalaBrandt
from camviz.scenes import board_corners, snapshot, textured_scene
from camviz.scenes.standard import SQUARE
from camviz_clinic.calibration import Detections, calibrate, detect
from camviz_clinic.files import Board
from camviz_school.views.walk import around_board

TUM_VI = Camera(
    Intrinsics(1024, 1024, 379.045, 379.008, 505.512, 509.969).within(640),
    KannalaBrandt(0.00693023, -0.0013828, -0.000272596, -0.000452646),
)


BOARD = Board(9, 6, SQUARE)


@pytest.fixture(scope="module")
def found(tmp_path_factory):
    folder = tmp_path_factory.mktemp("boards")
    for i, pose in enumerate(around_board(12)):
        cv2.imwrite(str(folder / f"{i:02d}.png"), snapshot(textured_scene(), TUM_VI.at(pose))[..., ::-1])
    return detect(sorted(folder.iterdir()), BOARD, workers=1)


@pytest.fixture(scope="module")
def solved(found):
    return solution(found)


def solution(found):
    return next(iter(calibrate(found, BOARD, "fisheye").cameras.values()))


def true_corners():
    return np.array([TUM_VI.at(pose).project(board_corners().reshape(-1, 3)) for pose in around_board(12)])


def off_by(camera):
    """Pixels (69,) between where it and the true fisheye see rays 1° to 69° off the axis.

    Held by this curve, for single coefficients trade against each other.
    """
    theta = np.radians(np.arange(1, 70))
    rays = np.stack([np.sin(theta), 0 * theta, np.cos(theta)], axis=-1)
    seen = replace(camera, world_from_cam=TUM_VI.world_from_cam).project(rays)
    return np.linalg.norm(seen - TUM_VI.project(rays), axis=-1)


def test_exact_corners_give_the_exact_fisheye():
    exact = Detections(tuple(f"{i}.png" for i in range(12)), true_corners(), 640, 640)
    assert off_by(solution(exact)).max() < 1e-9


@pytest.mark.thorough
def test_corners_are_found_without_bias_where_the_fisheye_sees_them(found):
    assert len(found.pictures) == 12
    off = found.corners - true_corners()
    assert np.abs(off.mean(axis=(0, 1))).max() < 0.02
    assert np.sqrt((off**2).mean()) < 0.08


@pytest.mark.thorough
def test_rays_land_where_the_true_fisheye_has_them(solved):
    """Corners reach out to 58°. White noise as large as the corner finder's errors would cost 0.3 px there."""
    off = off_by(solved)
    assert off[:58].max() < 0.2
    assert off.max() < 1


@pytest.mark.thorough
def test_focal_length_and_middle_come_back(solved):
    truth = TUM_VI.intrinsics
    assert solved.intrinsics.fx == pytest.approx(truth.fx, rel=1e-3)
    assert solved.intrinsics.cx == pytest.approx(truth.cx, abs=0.2)
    assert solved.intrinsics.cy == pytest.approx(truth.cy, abs=0.2)


def test_the_walk_shows_the_board_all_over_the_picture():
    seen = true_corners()
    assert TUM_VI.intrinsics.contains(seen).all()
    directions = np.arctan2(*(seen.mean(axis=1) - 319.5).T[::-1])
    assert len(np.unique(np.floor(directions / (np.pi / 3)))) >= 5
    rays = TUM_VI.lens.unproject(TUM_VI.intrinsics.from_pixels(seen))
    assert np.degrees(np.arccos(rays[..., 2].min())) == pytest.approx(58, abs=1)
