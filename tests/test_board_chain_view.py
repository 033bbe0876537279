"""The view of a chain puts a reader's corners where their chain has them, and says so where it has none."""

import cv2
import numpy as np
import pytest
from every_view import written

from camviz.scenes import board_corners
from camviz_school.views.board_chain import ChainView

BESIDE = {"x": -0.4, "yaw_deg": 8.0, "roll_deg": 5.0}


def right(world_from_cam, world_from_board):
    return np.linalg.inv(world_from_cam) @ world_from_board


def as_given(world_from_cam, world_from_board):
    return world_from_board @ np.linalg.inv(world_from_cam)


def test_the_boards_corners_are_a_tenth_of_a_metre_apart():
    on_board = np.array([(0.1 * (i % 9), 0.1 * (i // 9), 0, 1) for i in range(54)])
    T = ChainView().world_from_board
    np.testing.assert_allclose((on_board @ T.T)[:, :3], board_corners(), atol=1e-12)
    np.testing.assert_allclose(T[:3, :3].T @ T[:3, :3], np.eye(3), atol=1e-12)
    assert np.linalg.det(T[:3, :3]) == pytest.approx(1)


def test_a_right_chain_draws_a_cross_on_each_corner():
    """Where OpenCV projects it, if it is in the picture."""
    view = ChainView.on_the_world(chain=right, **BESIDE)
    R, t = view.camera.extrinsics
    expected = cv2.projectPoints(board_corners(), cv2.Rodrigues(R)[0], t, view.camera.intrinsics.K, None)[0]
    x, y, z = view.your_corners[0].T
    uv = view.camera.intrinsics.K @ (x / z, y / z, np.ones(54))
    np.testing.assert_allclose(uv[:2].T, expected.reshape(-1, 2), atol=1e-9)
    panel = view.figure(draft=True).marks.panels()["picture"]
    seen = expected.reshape(-1, 2)[view.camera.sees(board_corners())]
    places = (seen + 0.5) * (panel.width / 640, panel.height / 480)
    for arm in panel.marks.of("orange thick"):
        np.testing.assert_allclose(arm.ends.mean(axis=1), places, atol=1e-6)


def test_the_given_chain_is_right_until_the_camera_turns():
    on_the_world = ChainView.on_the_world(chain=as_given)
    np.testing.assert_allclose(on_the_world.your_corners[0], board_corners(), atol=1e-12)
    turned = on_the_world.but(yaw_deg=15.0)
    away = np.linalg.norm(turned.your_corners[0] - turned.but(chain=right).your_corners[0], axis=-1)
    assert away.min() > 0.1
    assert "by the program" in written(turned.figure(draft=True))


@pytest.mark.parametrize(
    ("function", "words"),
    [
        (lambda a, b: np.eye(3), "answers in shape"),
        (lambda a, b: undefined, "NameError"),  # noqa: F821
        (lambda a, b: np.diag([1.0, 1, -1, 1]) @ right(a, b), "by the program: not in the picture"),
    ],
)
def test_corners_that_a_chain_does_not_show_are_explained(function, words):
    picture = ChainView.on_the_world(chain=function).figure(draft=True)
    assert words in written(picture)
    assert "nan" not in written(picture)
    assert not picture.marks.panels()["picture"].marks.of("orange thick")
