"""The distortion visualizer shows true numbers and true pictures."""

import cv2
import numpy as np
import pytest
from every_view import written

from camviz.cameras import Camera, Intrinsics
from camviz.lenses import KannalaBrandt
from camviz.scenes import render, textured_scene, to_display
from camviz.scenes.wall import LAMP, wall_scene
from camviz.views import garden
from camviz.views.distortion import DistortionView, _grid_lines
from camviz.views.written_lens import straightened
from camviz.views.yours import YOURS_HERE


def test_the_fold_is_named_where_it_is():
    """Radii by hand, and of OpenCV's samples/data/intrinsics.yml, which folds inside its images."""
    for k1, k2, where in (
        (-0.3, 0.0, "r = 1.0541 (46.5°)"),
        (0.29589439552724328, -1.0354662043042675, "r = 0.7304"),
        (-0.16916358306948096, -0.11214173641213163, "r = 0.9785"),
    ):
        assert DistortionView(k1=k1, k2=k2).numbers()["fold"].startswith(where)
    pole = DistortionView(k1=0.0, k2=0.0, k4=-0.25)  # 1 + k4 r² is zero at r = 1/sqrt(-k4)
    assert pole.numbers()["fold"] == "none; pole 2.0000"
    assert pole.but(k4=-1.0).numbers()["corner moves"] == "beyond the pole"
    assert pole.but(k1=-0.3, k4=0.0).numbers()["corner moves"] == "folded away"


def test_a_fisheye_has_its_own_numbers():
    """Its own coefficients, not those at which the sliders of a polynomial begin; folds where θ_d' is zero.

    1 - 3 (0.2) θ² is 0 at 73.97°, and 1 - 5 (0.015) θ⁴ at 109.5°, which no point of the plane z = 1 shows.
    """
    view = DistortionView.of(Camera(Intrinsics(752, 480, 190, 190, 375.5, 239.5), KannalaBrandt(-0.2)))
    words = written(view.figure(draft=True)).split("This lens")[1]
    assert "k1 −0.2000" in words
    assert "p1" not in words
    angle = 1 / np.sqrt(0.6)
    assert view.numbers()["fold"] == f"r = {np.tan(angle):.4f} (74.0°)"
    assert view.numbers()["farthest a ray lands"] == f"r = {angle * (1 - 0.2 * angle**2):.4f}"
    assert view.numbers()["image corner"].endswith("no ray")
    view = DistortionView.of(Camera(Intrinsics(640, 480, 290, 290, 319.5, 239.5), KannalaBrandt(0, -0.015)))
    assert view.numbers()["fold"] == f"{np.rad2deg((1 / 0.075) ** 0.25):.1f}° off axis"
    assert view.camera.lens == KannalaBrandt(0, -0.015)


def test_the_grid_is_drawn_where_opencv_bends_it():
    """And before it is bent, it reaches beyond every corner of an undistorted picture."""
    view = DistortionView(k1=-0.28, k2=0.07, p1=0.01, panels="picture grid")
    (panel,) = view.figure(draft=True).marks.panels().values()
    drawn = [line for mark in panel.marks.of("thin") for line in mark.lines if mark.style["stroke"] == "#f2c94c"]
    K = view.intrinsics
    straight = _grid_lines(K, 25).reshape(-1, 2)
    rays = np.column_stack([straight, np.ones(len(straight))])
    uv = cv2.projectPoints(rays, np.zeros(3), np.zeros(3), K.K, np.array([-0.28, 0.07, 0.01, 0]))[0].reshape(-1, 2)
    there = (uv + 0.5) * (panel.width / K.width, panel.height / K.height)
    inside = [one for one in np.concatenate(drawn) if (one > 0).all() and (one < (panel.width, panel.height)).all()]
    assert len(inside) > 200
    assert max(np.linalg.norm(there - one, axis=1).min() for one in inside) < 1e-6
    for size in ((640, 480), (480, 640), (1000, 300)):
        k = Intrinsics.from_fov(*size, 80)
        reach = k.to_pixels(_grid_lines(k, 65)).reshape(-1, 2)
        assert (reach.min(axis=0) < -0.5).all()
        assert (reach.max(axis=0) > np.array(size) - 0.5).all()


def test_a_corner_moves_as_far_as_opencv_says():
    view = DistortionView(k1=-0.2, k2=0.05, p1=0.01, p2=-0.02, k3=0.01, k4=0.02, s1=0.01, s3=-0.02)
    K = view.intrinsics
    corners = np.array([(0.0, 0), (K.width - 1, 0), (0, K.height - 1), (K.width - 1, K.height - 1)])
    rays = np.concatenate([K.from_pixels(corners), np.ones((4, 1))], axis=-1)
    coefficients = np.array([-0.2, 0.05, 0.01, -0.02, 0.01, 0.02, 0, 0, 0.01, 0, -0.02, 0])
    there = cv2.projectPoints(rays, np.zeros(3), np.zeros(3), K.K, coefficients)[0].reshape(-1, 2)
    np.testing.assert_allclose(view.moved(corners), np.linalg.norm(there - corners, axis=-1), atol=1e-9)


def test_a_straightened_picture_is_a_perfect_lens_s():
    view = DistortionView(k1=-0.28, k2=0.07, show="undistorted")
    straight = view.image(draft=False)
    perfect = to_display(render(textured_scene(), Camera(view.intrinsics.within(garden.FINE))))
    inner = np.s_[40:272, 52:364]  # away from the border, where both have light
    assert cv2.PSNR(straight[inner], perfect[inner]) > 23
    bent = view.but(show="distorted").image(draft=False)
    assert cv2.PSNR(bent[inner], perfect[inner]) < 18


def test_pixels_beyond_the_fold_are_dark_while_it_is_hidden():
    view = DistortionView(k1=-0.6, k2=0, show="undistorted")
    corner = np.s_[:12, :12]
    assert np.ptp(view.image(draft=True)[corner], axis=(0, 1)).max() == 0
    assert np.ptp(view.but(hide_fold=False).image(draft=True)[corner], axis=(0, 1)).max() > 0


def test_the_coping_of_the_wall_runs_along_the_upper_border():
    """Its lower edge is half a focal length above the axis; the border of the 16:9 picture at 9/16."""
    across = np.linspace(-1, 1, 41)

    def light(height):
        rays = np.stack([across, np.full(41, -height), np.ones(41)], axis=-1)
        return wall_scene().trace((0, 0, 0), rays / np.linalg.norm(rays, axis=-1, keepdims=True))[0]

    assert np.ptp(light(0.505), axis=0).max() < 0.01  # plain stone, from one side to the other
    assert np.ptp(light(0.495), axis=0).max() > 0.05  # bricks
    assert DistortionView.by_the_wall().intrinsics.from_pixels((0, -0.5))[1] == pytest.approx(-9 / 16)


def test_beyond_the_fold_the_lamp_is_seen_a_second_time():
    """r - 0.5 r³ has one value at the lamp and, farther out on the same line, at a second root within the picture."""
    view = DistortionView.by_the_wall(k1=-0.5, show="undistorted", hide_fold=False)
    lamp = np.array(LAMP[:2]) / LAMP[2]
    r = np.hypot(*lamp)
    again = max(np.roots([-0.5, 0, 1, -(r - 0.5 * r**3)]).real)
    assert r < 1 / np.sqrt(1.5) < again
    picture, K = view.image(draft=False), view.intrinsics.within(garden.FINE)
    for where in (lamp, lamp / r * again):
        u, v = K.to_pixels(where).round().astype(int)
        assert picture[v, u].min() > 190  # its glass is nearly white, and nothing else of the wall is
    u, v = K.to_pixels(lamp / r * (again - 0.25)).round().astype(int)
    assert picture[v, u].min() < 150
    hidden = view.but(hide_fold=True).image(draft=False)
    u, v = K.to_pixels(lamp / r * again).round().astype(int)
    assert hidden[v, u].max() < 60


# The reader's own function -------------------------------------------------------------------------------------------


def polynomial(xy, k1, k2, k3):
    r2 = np.sum(xy**2, axis=-1, keepdims=True)
    return xy * (1 + k1 * r2 + k2 * r2**2 + k3 * r2**3)


def test_the_inverse_of_a_function_ends_at_its_fold():
    """r - 0.3 r³ turns back at 1.054, where it is 0.703: farther out nothing lands, and no farther root counts."""
    fold = 1 / np.sqrt(0.9)
    r = np.array([0.1, 0.6, 1.0])
    landed = r - 0.3 * r**3
    xy = np.stack([np.append(landed, 0.71), np.zeros(4)], axis=-1)

    def bend(points):
        return polynomial(points, -0.3, 0.0, 0.0)

    np.testing.assert_allclose(straightened(bend, xy)[:3, 0], r, atol=1e-3)
    assert np.isnan(straightened(bend, xy)[3]).all()
    beyond = np.full((4, 2), [1.4, 0.0])
    assert not (straightened(bend, xy, beyond)[:, 0] > fold).any()


@pytest.mark.parametrize("show", ["distorted", "undistorted"])
def test_the_readers_picture_is_the_cameras_where_it_is_right(show):
    """In the garden, before the wall and of a photograph; with the signs turned round, another one."""
    noise = np.random.default_rng(3).integers(0, 255, (24, 32, 3)).astype(np.uint8)
    photograph = cv2.resize(noise, (640, 480), interpolation=cv2.INTER_CUBIC)
    state = {"k1": -0.28, "k2": 0.07, "k3": 0.02, "show": show, "panels": "picture yours", "yours": polynomial}
    given = DistortionView(photograph=photograph, **state)
    for view in (DistortionView(**state), DistortionView.by_the_wall(**state), given):
        assert cv2.PSNR(*pictures(view)) > 40
    wrong = given.but(yours=lambda xy, k1, k2, k3: polynomial(xy, -k1, -k2, -k3))
    assert cv2.PSNR(*pictures(wrong)) < 20


def pictures(view):
    """The camera's picture and the one by the reader's function."""
    shown = view.figure().photographs
    return [cv2.imdecode(np.frombuffer(shown[name], np.uint8), 1) for name in ("camera", "yours")]


def test_a_function_without_an_answer_has_no_picture():
    view = DistortionView(panels="picture yours", yours=lambda xy, k1, k2, k3: None)
    figure = view.figure(draft=True)
    assert YOURS_HERE in written(figure)
    assert figure.marks.of("awaited")
    assert figure.photographs["yours"] == figure.photographs["camera"]
    figure = view.but(yours=lambda xy, k1, k2, k3: xy[7, 7, 7, 7]).figure(draft=True)
    assert "IndexError" in written(figure)
    assert list(figure.photographs) == ["camera"]
