"""The answers of lesson 10's exercises are OpenCV's and camviz's, and each wrong answer is told what is wrong."""

import cv2
import numpy as np
import pytest

from camviz.checks import judge
from camviz.cubemap import FACES, face_camera
from camviz.exercises import exercise, lesson10
from camviz.lenses import DoubleSphere, UnifiedSphere
from camviz.ring import Ring

NAMES = ("10.project", "10.unproject", "10.double_sphere", "10.cube_point", "10.parallax")


def cases(name):
    return list(exercise(name).cases(np.random.default_rng(5)))


def test_the_unified_sphere_is_opencv_s_omnidir_where_it_has_an_image_and_nan_elsewhere():
    for points, xi in cases("10.project"):
        flat = points.reshape(1, -1, 3)
        there = cv2.omnidir.projectPoints(flat, np.zeros(3), np.zeros(3), np.eye(3), xi, np.zeros(4))[0].reshape(-1, 2)
        ours = lesson10.project(points, xi).reshape(-1, 2)
        seen = points.reshape(-1, 3)[:, 2] + xi * np.linalg.norm(points.reshape(-1, 3), axis=-1) > 0
        np.testing.assert_allclose(ours[seen], there[seen], atol=1e-12)
        assert np.isnan(ours[~seen]).all()
        np.testing.assert_allclose(ours, UnifiedSphere(xi).project(points).reshape(-1, 2), atol=1e-12)


def test_its_inverse_comes_back_as_unit_rays():
    for xy, xi in cases("10.unproject"):
        rays = lesson10.unproject(xy, xi)
        np.testing.assert_allclose(np.linalg.norm(rays, axis=-1), 1, atol=1e-12)
        np.testing.assert_allclose(UnifiedSphere(xi).project(rays), xy, atol=1e-12)


def test_the_double_sphere_is_camviz_s():
    for points, xi, alpha in cases("10.double_sphere"):
        ours = lesson10.double_sphere(points, xi, alpha)
        np.testing.assert_allclose(ours, DoubleSphere(xi, alpha).project(points), atol=1e-12)


def test_the_point_on_the_cube_is_where_a_face_s_camera_sees_the_direction():
    for (directions,) in cases("10.cube_point"):
        for direction, on in zip(
            directions.reshape(-1, 3), lesson10.cube_point(directions).reshape(-1, 3), strict=True
        ):
            uv = [face_camera(face, 100).project(direction) for face in FACES]
            inside = [np.all(np.abs(one - 49.5) <= 50) for one in uv]
            assert sum(inside) == 1
            face = FACES[inside.index(True)]
            axis, sign = {
                "right": (0, 1),
                "left": (0, -1),
                "down": (1, 1),
                "up": (1, -1),
                "front": (2, 1),
                "back": (2, -1),
            }[face]
            assert on[axis] == pytest.approx(sign)


def test_the_parallax_is_the_ring_s():
    for cameras, radius, distance, width in cases("10.parallax"):
        there = Ring(cameras, radius).parallax(distance, np.inf) * width / (2 * np.pi)
        assert lesson10.parallax(cameras, radius, distance, width) == pytest.approx(there, abs=1e-9)


@pytest.mark.parametrize("name", NAMES)
def test_every_known_mistake_is_told_what_it_is_and_the_answer_is_praised(name):
    one = exercise(name)
    assert judge(one, one.reference, np.random.default_rng(1)).message == one.praise
    for known in one.misconceptions:
        verdict = judge(one, known.reference, np.random.default_rng(1))
        assert not verdict
        assert verdict.message == known.explanation


@pytest.mark.parametrize("name", NAMES)
def test_no_constant_and_no_stub_passes(name):
    one = exercise(name)
    for stub in (lambda *a: None, lambda *a: 0.0, lambda *a: one.reference(*cases(name)[0])):
        assert not judge(one, stub, np.random.default_rng(2))
