"""The view of a chain puts a reader's corners where their chain has them, and says so where it has none."""

import re

import cv2
import numpy as np
import pytest

from camviz.scenes import board_corners
from camviz_school.views.board_chain import ChainView

BESIDE = {"x": -0.4, "yaw_deg": 8.0, "roll_deg": 5.0}


def right(world_from_cam, world_from_board):
    return np.linalg.inv(world_from_cam) @ world_from_board


def as_given(world_from_cam, world_from_board):
    return world_from_board @ np.linalg.inv(world_from_cam)


def test_the_board_s_frame_has_its_corners_in_a_plane_a_tenth_of_a_metre_apart():
    on_board = np.array([(0.1 * (i % 9), 0.1 * (i // 9), 0, 1) for i in range(54)])
    T = ChainView().world_from_board
    np.testing.assert_allclose((on_board @ T.T)[:, :3], board_corners(), atol=1e-12)
    np.testing.assert_allclose(T[:3, :3].T @ T[:3, :3], np.eye(3), atol=1e-12)
    assert np.linalg.det(T[:3, :3]) == pytest.approx(1)


def test_a_right_chain_puts_the_corners_where_opencv_projects_them():
    view = ChainView.on_the_world(chain=right, **BESIDE)
    R, t = view.camera.extrinsics
    expected = cv2.projectPoints(board_corners(), cv2.Rodrigues(R)[0], t, view.camera.intrinsics.K, None)[0]
    x, y, z = view.your_corners[0].T
    uv = view.camera.intrinsics.K @ (x / z, y / z, np.ones(54))
    np.testing.assert_allclose(uv[:2].T, expected.reshape(-1, 2), atol=1e-9)


def test_the_program_as_given_is_right_on_the_world_and_leaves_the_corners_behind_when_the_camera_turns():
    on_the_world = ChainView.on_the_world(chain=as_given)
    np.testing.assert_allclose(on_the_world.your_corners[0], board_corners(), atol=1e-12)
    turned = on_the_world.but(yaw_deg=15.0)
    away = np.linalg.norm(turned.your_corners[0] - turned.but(chain=right).your_corners[0], axis=-1)
    assert away.min() > 0.1
    assert turned.figure(draft=True).body != turned.but(chain=right).figure(draft=True).body


@pytest.mark.parametrize(
    ("function", "words"),
    [
        (lambda a, b: np.eye(3), "answers in shape"),
        (lambda a, b: undefined, "NameError"),  # noqa: F821
        (lambda a, b: np.diag([1.0, 1, -1, 1]) @ right(a, b), "by the program: not in the picture"),
        (as_given, "orange: by the program"),
        (None, ""),
    ],
)
def test_what_a_chain_makes_of_the_corners_is_drawn_or_said(function, words):
    body = ChainView.on_the_world(chain=function).figure(draft=True).body
    assert words in body
    assert "nan" not in body
    assert ("by the program" in body) == ("by the program" in words)


def test_a_cross_lies_on_each_corner_in_the_picture():
    view = ChainView.on_the_world(chain=right)
    lines = re.search(r'd="([^"]*)"[^>]*class="orange thick"', view.figure(draft=True).body)
    assert lines
    assert lines[1].count("M") == int(view.camera.sees(board_corners()).sum())
