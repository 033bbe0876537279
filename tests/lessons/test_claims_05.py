"""What lesson 05 claims about lens distortion, recomputed with OpenCV and NumPy."""

import cv2
import numpy as np
import pytest
from claims import claims
from scipy.optimize import brentq

from camviz.scenes.wall import LAMP
from camviz.views.distortion import DistortionView

says = claims("05")

LEFT = ((534.80, 335.69, 240.66), (0.29589439552724328, -1.0354662043042675))
RIGHT = ((534.80, 334.56, 242.05), (-0.16916358306948096, -0.11214173641213163))
"""f, cx, cy and k1, k2 of OpenCV's sample file intrinsics.yml."""


def g(r, k1, k2=0.0, k3=0.0):
    return r * (1 + k1 * r**2 + k2 * r**4 + k3 * r**6)


def folds_at(k1, k2=0.0, k3=0.0):
    """The smallest r > 0 with slope 0, from the roots of 1 + 3 k1 r² + 5 k2 r⁴ + 7 k3 r⁶; infinite without one."""
    squares = np.roots(np.trim_zeros([7 * k3, 5 * k2, 3 * k1, 1.0], "f"))
    real = [root.real for root in squares if abs(root.imag) < 1e-12 and root.real > 0]
    return np.sqrt(min(real)) if real else np.inf


def degrees(r):
    return np.degrees(np.arctan(r))


def bend(xy, *coefficients):
    points = np.concatenate([xy, np.ones_like(xy[..., :1])], axis=-1).reshape(-1, 1, 3)
    return cv2.projectPoints(points, np.zeros(3), np.zeros(3), np.eye(3), np.array(coefficients))[0].reshape(xy.shape)


def test_where_k1_alone_folds():
    says("For k1 = −0.3 this is 1/√0.9 = **1.054**, a ray **46.5°** from the axis, and the largest radius that a ray")
    says("before the fold can reach in the picture is g(1.054) = 0.703.", "A positive k2 of 0.05 takes this fold away.")
    fold = folds_at(-0.3)
    assert fold == pytest.approx(1 / np.sqrt(0.9))
    assert [fold, g(fold, -0.3)] == pytest.approx([1.054, 0.703], abs=5e-4)
    assert degrees(fold) == pytest.approx(46.5, abs=0.05)
    landed = bend(np.array([[fold - 0.01, 0], [fold, 0], [fold + 0.01, 0.0]]), -0.3, 0.0, 0.0, 0.0)[:, 0]
    assert landed.argmax() == 1
    assert folds_at(-0.3, 0.05) == np.inf > folds_at(-0.3, 0.02)
    says("Beyond 61.3° the polynomial with k1 = −0.3 even passes through the centre and out on the other side.")
    assert degrees(np.sqrt(1 / 0.3)) == pytest.approx(61.3, abs=0.05)


def test_the_one_lamp_is_there_twice():
    says("Pull **k1** to −0.5, and look for the lamp", "There are two lamps, and the garden has one.")
    lamp = np.array(LAMP[:2]) / LAMP[2]
    r = np.hypot(*lamp)
    farther = max(np.roots([-0.5, 0, 1, -g(r, -0.5)]).real)
    x, y = lamp / r * farther
    assert r < folds_at(-0.5) < farther
    assert max(abs(x), abs(y) * 16 / 9) < 1  # within the frame, 90° across and 16:9


def test_what_straightening_keeps():
    says("through a lens with k1 = −0.28 and k2 = 0.07.", "the photograph has f = 286 px")
    says("fx = 219 px, fy = 250 px", "alpha = 1 keeps every pixel of the photograph, f = 206 px")
    f = 240 / np.tan(np.radians(40))
    K, lens = np.array([[f, 0, 239.5], [0, f, 179.5], [0, 0, 1]]), np.array([-0.28, 0.07, 0, 0])
    filled, kept = (cv2.getOptimalNewCameraMatrix(K, lens, (480, 360), alpha)[0] for alpha in (0.0, 1.0))
    assert [f, filled[0, 0], filled[1, 1], kept[0, 0], kept[1, 1]] == pytest.approx([286, 219, 250, 206, 206], abs=0.5)
    says("A straightened picture of a barrel loses its corners: the lens had drawn them in")
    grid = DistortionView().camera.intrinsics
    taken = grid.from_pixels([0, 0])
    far = np.hypot(*taken)
    assert (grid.to_pixels(taken / far * brentq(lambda r: g(r, -0.28, 0.07) - far, far, 3)) < -0.5).all()


def test_five_steps_of_opencv_s_inverse_may_be_far_off():
    says("With k1 alone, r + k1 r³ = r_d is a cubic equation, and cubics have a formula.")
    says("It should have said 2.00, and it did not say that it failed.")
    assert max(root.real for root in np.roots([0.5, 0, 1, -6.0]) if abs(root.imag) < 1e-12) == pytest.approx(
        2, abs=5e-3
    )
    five = cv2.undistortPoints(np.array([[[6.0, 0.0]]]), np.eye(3), np.array([0.5, 0, 0, 0]))[0, 0, 0]
    assert abs(five - 2) > 1


def test_the_published_stereo_lenses_fold_inside_their_images():
    says("the corners of the left image are 0.72 to 0.77 from the centre")
    says("The left polynomial turns back at r = 0.73 before distortion, and that ray lands at 0.63 in the photograph.")
    says("The right polynomial turns back at r = 0.98, and no ray before that lands beyond 0.72")
    moved = {}
    for (f, cx, cy), lens, numbers in ((*LEFT, (0.73, 0.63)), (*RIGHT, (0.98, 0.72))):
        fold = folds_at(*lens)
        assert [fold, g(fold, *lens)] == pytest.approx(numbers, abs=5e-3)
        corners = [np.hypot(u - cx, v - cy) / f for u in (-0.5, 639.5) for v in (-0.5, 479.5)]
        assert g(fold, *lens) < min(corners)
        if lens == LEFT[1]:
            assert [min(corners), max(corners)] == pytest.approx([0.72, 0.77], abs=5e-3)
        r = np.linspace(1e-3, fold, 20000)
        moved[lens] = f * (g(r, *lens) - r)
    says("by at most 4.5 px, and then inwards, by 53 px at the fold. The right one moves every point inwards.")
    assert moved[LEFT[1]].max() == pytest.approx(4.5, abs=0.05)
    assert moved[LEFT[1]][-1] == pytest.approx(-53, abs=0.5)
    assert (moved[RIGHT[1]] < 0).all()


def test_the_chessboard_s_lens(samples):
    says("a calibration of all 13 pictures published k1 = −0.27 for this lens, at f = 536 px.")
    file = cv2.FileStorage(str(samples / "left_intrinsics.yml"), cv2.FILE_STORAGE_READ)
    assert file.getNode("distortion_coefficients").mat()[0, 0] == pytest.approx(-0.27, abs=5e-3)
    assert file.getNode("camera_matrix").mat()[0, 0] == pytest.approx(536, abs=0.5)
    assert file.getNode("nframes").real() == 13


def test_the_smaller_terms_are_opencv_s():
    says("the factor is divided by $1 + k_4 r^2 + k_5 r^4 + k_6 r^6$", "add $s_1 r^2 + s_2 r^4$ to $x_d$")
    says("Put **p1** back to 0 and take **k4** to −1 to see one.")
    x, y, k4, k5, k6, s1, s2, s3, s4 = 0.4, -0.3, 0.2, -0.1, 0.3, 0.02, -0.03, 0.01, 0.05
    r2, xy = x * x + y * y, np.array([[x, y]])
    rational = bend(xy, 0, 0, 0, 0, 0, k4, k5, k6)
    np.testing.assert_allclose(rational, xy / (1 + k4 * r2 + k5 * r2**2 + k6 * r2**3))
    np.testing.assert_allclose(bend(xy, *[0] * 8, s1, s2, s3, s4) - xy, [[s1 * r2 + s2 * r2**2, s3 * r2 + s4 * r2**2]])


# The numbers of the questions ----------------------------------------------------------------------------------------


def test_question_grid():
    says("at r = 0.5 it is 1 − 0.3 · 0.25 = 0.925", "and the sides of a square bow outwards")
    assert bend(np.array([[0.3, 0.4]]), -0.3, 0.0, 0.0, 0.0) / [0.3, 0.4] == pytest.approx(np.full((1, 2), 0.925))
    side = bend(np.stack([np.full(9, 0.5), np.linspace(0, 0.5, 9)], axis=-1), -0.3, 0.0, 0.0, 0.0)
    assert (np.diff(side[:, 0]) < 0).all()  # widest in the middle


def test_question_far_rays():
    says("Keep k1 = −0.3 and look at rays farther and farther from the axis: 30°, 40°, 50°, 60°.")
    says("it climbs to r = 1.054 (46.5°) and then falls", "The slope 1 − 0.9 r² is zero at r = 1.054, 46.5° from")
    landed = g(np.tan(np.radians([30, 40, 50, 60])), -0.3)
    assert np.diff(landed)[0] > 0 > np.diff(landed)[-1]
    says("Up to the fold the largest r_d is 0.703. What this model puts farther out lies beyond 64.6°")
    inside, outside = (abs(g(np.tan(np.radians(angle)), -0.3)) for angle in (64.55, 64.65))
    assert inside < 0.703 < outside
    says("such as that of an orthographic fisheye at 90°")
    assert np.cos(np.radians(90)) == pytest.approx(0)  # the slope of sin θ


def test_question_undistort():
    says("For k1 = −0.3 and r = 0.8 it misses by 0.07 focal lengths: tens of pixels.")
    assert 0.8 - g(g(0.8, -0.3), 0.3) == pytest.approx(0.07, abs=5e-3)


def test_questions_fold():
    says("A calibration has k1 = −0.12 and no other coefficient.", "At r = 1.667, about 59° from the axis.")
    says("At r = 2.887, about 71° from the axis.", "A lens model is r_d = r (1 − 0.2 r²), without any other term.")
    says("The slope 1 − 0.6 r² is zero at r = 1/sqrt(0.6) = 1.291, and atan 1.291 = 52.2°.", "r = 2.236, about 66°")
    says("For the one at r = 1.291, about 52° from the axis.", "gives r = 1/sqrt(0.36) = 1.667, and atan 1.667 = 59.0°")
    for k1, fold, fold_deg, zero, zero_deg in ((-0.12, 1.667, 59.0, 2.887, 71), (-0.2, 1.291, 52.2, 2.236, 66)):
        r = np.linspace(0, 3, 300_001)
        assert [r[g(r, k1).argmax()], brentq(g, 1, 5, (k1,))] == pytest.approx([fold, zero], abs=5e-4)
        assert degrees(fold) == pytest.approx(fold_deg, abs=0.05)
        assert degrees(zero) == pytest.approx(zero_deg, abs=0.5)


def test_questions_low_error():
    says(
        "At r = 0.78, the outermost pixel of a 640 × 480 image with f = 536 px, even k3 = −0.2 moves a point by 19 px."
    )
    r = np.hypot(342, 479 - 236) / 536
    assert r == pytest.approx(0.78, abs=5e-3)
    assert 536 * (r - g(r, 0, 0, -0.2)) == pytest.approx(19, abs=0.5)
    says("At r = 0.8, with f = 900 px, even k3 = −0.05 moves a point by 9.4 px.", "was ever farther than 300 px from")
    assert 900 * (0.8 - g(0.8, 0, 0, -0.05)) == pytest.approx(9.4, abs=0.05)
    says("You want to measure 700 px from the middle.", "A calibration of a 1280 × 960 camera leaves 0.3 px of error.")
    assert 300 < 700 < np.hypot(1280, 960) / 2
    assert pytest.approx(0.8, abs=0.05) == 700 / 900


def test_question_first_units():
    says("Resizing and cropping change K, and the rays stay what they were.", "makes k1 four times as large")
    ray = np.array([[0.3, 0.4]])
    whole, half = (f * bend(ray, -0.2, 0.0, 0.0, 0.0) for f in (500, 250))
    np.testing.assert_allclose(half, whole / 2)  # one k1 serves both sizes
