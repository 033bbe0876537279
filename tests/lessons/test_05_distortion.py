"""What lesson 05 says about lens distortion, recomputed with NumPy and OpenCV."""

import re

import cv2
import numpy as np
import pytest
from quoting import LESSONS
from scipy.optimize import brentq
from test_exercises import function_of, solution_of
from test_mutants import mutants

from camviz.scenes.wall import LAMP
from camviz.views.distortion import DistortionView
from camviz_school.course import notebooks
from camviz_school.course.exercises import exercises

EXCEPTIONS: dict[str, str] = {}

VISIBLE = 5e-4
"""Of a picture's pixels: as many as one moved marker covers, as in test_own_functions.py."""

UNSEEN = re.compile(r"np\.(?:abs|maximum)\(|2\.02|3\.03|1\.01")
"""Absolute values of what is above zero in the view, and a hundredth of a number: the checker finds them, no eye."""

LEFT = ((534.80, 335.69, 240.66), (0.29589439552724328, -1.0354662043042675))
RIGHT = ((534.80, 334.56, 242.05), (-0.16916358306948096, -0.11214173641213163))
"""f, cx, cy and k1, k2 of OpenCV's sample file intrinsics.yml, as cell 52 prints them."""


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


def test_a_barrel_draws_corners_in_most(says):
    says("With k1 < 0 the corners are drawn in, and the picture bulges like a barrel.")
    says("With k1 < 0 points far out are drawn in most, the corners most of all")
    says("and the sides of a square bow outwards")
    says("With k1 > 0 the corners are pulled out, as in a pincushion.")
    k1, r, strength, square, factor = says(
        "With k1 = −0.3 it is near 1 in the middle, and at r = 0.5 it is 1 − 0.3 · 0.25 = 0.925."
    )
    corner, middle, half = g(np.sqrt(2), k1.value), g(1.0, k1.value), np.linspace(0, 1, 9)
    assert np.sqrt(2) - corner > 1 - middle > 0
    assert g(np.sqrt(2), -k1.value) > np.sqrt(2)
    side = bend(np.stack([np.full(9, 0.5), half / 2], axis=-1), k1.value, 0.0, 0.0, 0.0)
    assert (np.diff(side[:, 0]) < 0).all()  # widest in the middle: the side bows outwards
    assert g(0.05, k1.value) / 0.05 > 0.999
    assert square == r.value**2
    assert factor == 1 - strength.value * r.value**2
    assert strength == -k1.value


def test_near_the_left_end_of_the_slider_the_model_has_no_ray_for_the_corners(says):
    """The slider ends at k1 = -0.2; the corners of a picture of 90° across and 16:9 are as far out as its diagonal."""
    says("Near the left end of the slider the corners go dark: the model has no ray for them.")
    corner = np.hypot(1, 9 / 16)
    assert g(folds_at(-0.2), -0.2) < corner < g(folds_at(-0.1), -0.1)


def test_a_point_moves_along_its_line_to_the_centre_by_what_r_alone_says(says):
    says("A line through the centre stays straight whatever k1 is: each point moves along its line to the centre.")
    says("The factor depends on r alone, so one curve says everything")
    angle = np.linspace(0, 2 * np.pi, 12)
    circle = 0.7 * np.stack([np.cos(angle), np.sin(angle)], axis=-1)
    bent = bend(circle, -0.28, 0.07, 0.0, 0.0)
    np.testing.assert_allclose(circle[:, 0] * bent[:, 1], circle[:, 1] * bent[:, 0], atol=1e-12)
    np.testing.assert_allclose(np.linalg.norm(bent - circle, axis=-1), 0.7 - g(0.7, -0.28, 0.07), atol=1e-12)


def shown_beside(view, function):
    """The picture that a view draws by a function, (height, width, 3); None where it draws none."""
    shown = view.but(yours=function).figure(draft=True).photographs.get("yours")
    return None if shown is None else cv2.imdecode(np.frombuffer(shown, np.uint8), cv2.IMREAD_COLOR)


@pytest.fixture(scope="module")
def view_beside():
    """The lesson's view of the reader's own `distort`, as its cell makes it."""
    cells = [cell.source for cell in notebooks.read(LESSONS / "05_distortion.ipynb").cells if cell.cell_type == "code"]
    (source,) = (one for one in cells if "bent = DistortionView" in one)
    namespace = {"DistortionView": DistortionView, "distort": None}
    exec(source.splitlines()[0], namespace)
    return namespace["bent"]


@pytest.mark.parametrize("show", [pytest.param("distorted", marks=pytest.mark.thorough), "undistorted"])
def test_each_slip_of_the_pen_in_distort_changes_the_wall_in_each_mode(says, view_beside, show):
    """Signs, factors, powers, axes, terms: each small change of the solution makes another picture, or none at all."""
    says("The lens bends the left picture, and your `distort` bends the right one: the two should look alike")
    says("Choose undistorted, and your function straightens the wall.")
    exercise, view = exercises("05")["05.distort"], view_beside.but(show=show)
    right = shown_beside(view, function_of(exercise, solution_of(exercise)))
    every = mutants(solution_of(exercise))
    made = [mutant for mutant in every if not UNSEEN.search(mutant.change)]
    assert len(made) >= 40
    alike = []
    for mutant in made:
        yours = shown_beside(view, function_of(exercise, mutant.source))
        if yours is not None and np.mean(np.abs(right.astype(int) - yours).max(axis=-1) > 40) < VISIBLE:
            alike.append(mutant.change)
    assert alike == []


def test_one_point_by_hand(says):
    k1, k2 = says("Put in one point, with k1 = −0.28 and k2 = 0.07:")
    says("The point moved towards the centre, and it stayed on its line through the centre.")
    point = np.array([[0.5, 0.25]])
    bent = bend(point, k1.value, k2.value, 0.0, 0.0)
    r = np.hypot(0.5, 0.25)
    np.testing.assert_allclose(bent, point * g(r, k1.value, k2.value) / r, atol=1e-12)
    assert np.linalg.norm(bent) < r
    assert bent[0, 0] * 0.25 == pytest.approx(bent[0, 1] * 0.5)


def test_the_last_digits_agree(says):
    (limit,) = says("a difference below 1e-15")
    radii = np.linspace(0, 1.25, 26)
    points = np.stack([radii, 0 * radii], axis=-1)
    by_hand = points * (1 - 0.28 * radii**2 + 0.07 * radii**4)[:, None]
    assert np.abs(by_hand - bend(points, -0.28, 0.07, 0.0, 0.0)).max() < limit.value


def test_where_k1_alone_folds(says):
    (k1,) = says("Take the simplest barrel there is, k1 = −0.3 and nothing else.")
    fold = folds_at(k1.value)
    again, radicand, r, angle, at, reach = says(
        "For k1 = −0.3 this is 1/√0.9 = **1.054**, a ray **46.5°** from the axis, and the largest radius that a ray "
        "before the fold can reach in the picture is g(1.054) = 0.703."
    )
    assert again == k1.value
    assert radicand == -3 * k1.value
    assert r == fold
    assert angle == degrees(fold)
    assert at == fold
    assert reach == g(fold, k1.value)


def test_rays_past_the_fold_come_back(says):
    k1, *angles = says("Keep k1 = −0.3 and look at rays farther and farther from the axis: 30°, 40°, 50°, 60°.")
    landed = g(np.tan(np.radians([one.value for one in angles])), k1.value)
    assert np.diff(landed)[0] > 0 > np.diff(landed)[-1]
    fold = folds_at(k1.value)
    strength, r, angle = says("r_d = r − 0.3 r³ is a cubic: it climbs to r = 1.054 (46.5°) and then falls")
    assert strength == -k1.value
    assert r == fold
    assert angle == degrees(fold)
    slope, r, angle = says(
        "The slope 1 − 0.9 r² is zero at r = 1.054, 46.5° from the axis, and beyond it the curve comes back"
    )
    assert slope == -3 * k1.value
    assert r == fold
    assert angle == degrees(fold)
    (r,) = says("A polynomial cannot stay level: after its highest point, at r = 1.054, it comes down again")
    assert r == fold
    reach, beyond = says(
        "Up to the fold the largest r_d is 0.703. What this model puts farther out lies beyond 64.6° and on the "
        "wrong side."
    )
    assert reach == g(np.linspace(0, fold, 10000), k1.value).max()
    far = np.tan(np.radians(beyond.value + np.array([-0.1, 0.1])))
    assert abs(g(far[0], k1.value)) < g(fold, k1.value) < abs(g(far[1], k1.value))
    assert g(far[1], k1.value) < 0
    through, again = says(
        "Beyond 61.3° the polynomial with k1 = −0.3 even passes through the centre and out on the other side."
    )
    assert again == k1.value
    assert through == degrees(np.sqrt(-1 / k1.value))
    (angle,) = says("such as that of an orthographic fisheye at 90°")
    assert np.cos(np.radians(angle.value)) == pytest.approx(0, abs=1e-12)  # the slope of sin θ
    k1, angle = says("for k1 = −0.3 it lies 46.5° from the axis")
    assert angle == degrees(folds_at(k1.value))


def test_a_small_k2_takes_the_fold_away(says):
    (k2,) = says("A positive k2 of 0.05 takes this fold away.")
    assert folds_at(-0.3) < folds_at(-0.3, 0.02) < np.inf
    assert folds_at(-0.3, k2.value) == np.inf


def test_the_one_lamp_is_there_twice_and_the_second_lies_outside_the_dashed_circle(says):
    """In the upper right: by the roots of r + k1 r³ = r_d, within the frame of 90° across and 16:9."""
    (k1,) = says("Pull k1 to −0.5, and look for the lamp in the upper right corner.")
    (again,) = says("With k1 = −0.5 the garden's one lamp is there twice.")
    says("There are two lamps, and the garden has one.")
    says("Outside it you see mirror images of what lies inside it.")
    (taught,) = says("Pull k1 to −0.5 and wait until someone sees the second lamp.")
    assert taught == k1.value
    assert again == k1.value
    lamp = np.array(LAMP[:2]) / LAMP[2]
    r, fold = np.hypot(*lamp), folds_at(k1.value)
    farther = max(np.roots([k1.value, 0, 1, -g(r, k1.value)]).real)
    assert r < fold < farther
    x, y = lamp / r * farther
    assert 0.8 < x < 1
    assert -9 / 16 < y < -0.3
    x, y = lamp / r * max(np.roots([-0.3, 0, 1, -g(r, -0.3)]).real)
    assert not (x < 1 and y > -9 / 16)  # at first the second lamp lies outside the frame


def test_the_ways_to_straighten_the_photograph(says):
    k1, k2 = says("through a lens with k1 = −0.28 and k2 = 0.07.")
    (f,) = says("the photograph has f = 286 px")
    assert f == 240 / np.tan(np.radians(40))
    K = np.array([[f.value, 0, 239.5], [0, f.value, 179.5], [0, 0, 1]])
    coefficients = np.array([k1.value, k2.value, 0, 0])
    fx, fy = says("To fill the frame it scales columns and rows separately: fx = 219 px, fy = 250 px.")
    new, _ = cv2.getOptimalNewCameraMatrix(K, coefficients, (480, 360), 0.0)
    assert fx == new[0, 0]
    assert fy == new[1, 1]
    (kept,) = says("alpha = 1 keeps every pixel of the photograph, f = 206 px, at the price of black borders.")
    new, _ = cv2.getOptimalNewCameraMatrix(K, coefficients, (480, 360), 1.0)
    assert kept == new[0, 0]
    assert kept == new[1, 1]
    says("loses what was near the border: a barrel-shaped photograph reaches farther")
    border = np.array([[[479.0, 179.5]]])
    seen = cv2.undistortPoints(border, K, coefficients, criteria=(3, 100, 1e-12))[0, 0, 0]
    assert seen > 239.5 / f.value


def test_the_inverse_of_one_term_is_a_cubic_and_more_terms_are_of_degree_seven(says):
    says("With k1 alone, r + k1 r³ = r_d is a cubic equation, and cubics have a formula.")
    says("With k2 and k3 the equation has degree seven and there is none")
    r = np.poly1d([1.0, 0.0])
    assert (r + -0.3 * r**3).order == 3
    assert (r + -0.3 * r**3 + 0.1 * r**5 + 0.02 * r**7).order == 7
    (said,) = says("It should have said 2.00, and it did not say that it failed.")
    assert said == max(root.real for root in np.roots([0.5, 0, 1, -6.0]) if abs(root.imag) < 1e-12)
    five = cv2.undistortPoints(np.array([[[6.0, 0.0]]]), np.eye(3), np.array([0.5, 0, 0, 0]))[0, 0, 0]
    assert abs(five - said.value) > 1


def test_a_pole_of_the_rational_model(says):
    (k4,) = says("Put **p1** back to 0 and take **k4** to −1 to see one.")
    r = np.linspace(0, 1.2, 1201)
    assert np.abs(1 + k4.value * r**2).min() < 1e-9


def test_flipping_the_sign_of_k1_is_not_the_inverse(says):
    k1, r, miss = says("For k1 = −0.3 and r = 0.8 it misses by 0.07 focal lengths: tens of pixels.")
    r_d = g(r.value, k1.value)
    assert miss == r.value - g(r_d, -k1.value)
    assert 10 < miss.value * 286 < 100


def test_the_published_stereo_calibration_folds_inside_its_images(says):
    width, height = says("This is its left lens, out to the corners of its 640 × 480 image:")
    folds, reaches, nearest, corners = {}, {}, {}, {}
    for name, ((f, cx, cy), coefficients) in (("left", LEFT), ("right", RIGHT)):
        folds[name] = folds_at(*coefficients)
        reaches[name] = g(folds[name], *coefficients)
        ends = [np.hypot(u - cx, v - cy) / f for u in (-0.5, width.value - 0.5) for v in (-0.5, height.value - 0.5)]
        nearest[name], corners[name] = min(ends), max(ends)
    near, corner = says("that is after distortion, the corners of the left image are 0.72 to 0.77 from the centre")
    assert near == nearest["left"]
    assert corner == corners["left"]
    fold, reach = says(
        "The left polynomial turns back at r = 0.73 before distortion, and that ray lands at 0.63 in the photograph."
    )
    assert fold == folds["left"]
    assert reach == reaches["left"]
    fold, reach = says(
        "The right polynomial turns back at r = 0.98, and no ray before that lands beyond 0.72: its corners are empty "
        "too."
    )
    assert fold == folds["right"]
    assert reach == reaches["right"]
    assert all(reaches[name] < nearest[name] for name in corners)


def test_one_of_the_two_goes_out_and_then_in(says):
    outwards, inwards = says(
        "The left one moves points outwards near the centre, by at most 4.5 px, and then inwards, by 53 px at the "
        "fold. The right one moves every point inwards."
    )
    moved = {}
    for name, ((f, _, _), coefficients) in (("left", LEFT), ("right", RIGHT)):
        r = np.linspace(1e-3, folds_at(*coefficients), 20000)
        moved[name] = f * (g(r, *coefficients) - r)
    assert outwards == moved["left"].max()
    assert inwards == -moved["left"][-1]
    assert (moved["right"] < 0).all()


def test_the_value_that_the_calibration_of_the_chessboard_published(says, samples):
    pictures, k1, f = says("a calibration of all 13 pictures published k1 = −0.27 for this lens, at f = 536 px.")
    file = cv2.FileStorage(str(samples / "left_intrinsics.yml"), cv2.FILE_STORAGE_READ)
    assert k1 == file.getNode("distortion_coefficients").mat()[0, 0]
    assert pictures == file.getNode("nframes").real()
    assert f == file.getNode("camera_matrix").mat()[0, 0]


def test_the_quiz_about_the_fold(says):
    (k1,) = says("A calibration has k1 = −0.12 and no other coefficient.")
    fold = folds_at(k1.value)
    r, angle = says("At r = 1.667, about 59° from the axis.")
    assert r == fold
    assert angle == degrees(fold)
    radicand, r, again, angle = says("gives r = 1/sqrt(0.36) = 1.667, and atan 1.667 = 59.0°")
    assert radicand == -3 * k1.value
    assert r == fold
    assert again == fold
    assert angle == degrees(fold)
    r, angle = says("At r = 2.887, about 71° from the axis.")
    zero = 1 / np.sqrt(-k1.value)  # where the factor, not the slope, vanishes
    assert r == zero
    assert angle == degrees(zero)


def test_the_quiz_about_a_low_error(says):
    says("This number says nothing about it: there the polynomial extrapolates.")
    fitted, *again = (
        says("fits the corners of a chessboard to 0.2 pixels")
        + says("It is known to about 0.2 pixels there too.")
        + says("The 0.2 pixels were measured where there were boards.")
    )
    assert all(one == fitted.value for one in again)
    r, width, height, f, k3, pixels = says(
        "At r = 0.78, the outermost pixel of a 640 × 480 image with f = 536 px, even k3 = −0.2 moves a point by 19 px."
    )
    corner = np.hypot(342, 479 - 236) / f.value  # the centre of the last pixel
    assert r == corner
    assert (width.value, height.value) == (640, 480)
    assert pixels == f.value * (corner - g(corner, 0, 0, k3.value))


def test_the_corners_of_the_straightened_picture_are_lost(says):
    """With the same K, the corner of the picture that was taken lands beyond the new frame."""
    says("A straightened picture of a barrel loses its corners: the lens had drawn them in")
    grid = DistortionView().camera.intrinsics
    taken = grid.from_pixels([0, 0])
    far = np.hypot(*taken)
    ideal = taken / far * brentq(lambda r: g(r, -0.28, 0.07) - far, far, 3)
    assert (grid.to_pixels(ideal) < -0.5).all()


@pytest.mark.parametrize("terms", ["rational", "thin prism"])
def test_the_formulas_of_the_smaller_terms_are_opencv_s(says, terms):
    x, y = 0.4, -0.3
    r2 = x * x + y * y
    k4, k5, k6, s1, s2, s3, s4 = 0.2, -0.1, 0.3, 0.02, -0.03, 0.01, 0.05
    if terms == "rational":
        says("the factor is divided by $1 + k_4 r^2 + k_5 r^4 + k_6 r^6$")
        coefficients, expected = (0, 0, 0, 0, 0, k4, k5, k6), np.array([x, y]) / (1 + k4 * r2 + k5 * r2**2 + k6 * r2**3)
    else:
        says("add $s_1 r^2 + s_2 r^4$ to $x_d$ and $s_3 r^2 + s_4 r^4$ to $y_d$.")
        coefficients = (*[0] * 8, s1, s2, s3, s4)
        expected = np.array([x + s1 * r2 + s2 * r2**2, y + s3 * r2 + s4 * r2**2])
    opencv = cv2.projectPoints(np.array([[x, y, 1.0]]), np.zeros(3), np.zeros(3), np.eye(3), np.array(coefficients))[0]
    np.testing.assert_allclose(opencv[0, 0], expected, atol=1e-12)


def test_the_tangential_exercise_s_point_and_its_twos(says):
    first, second = says("For x = y = 1 and p1 alone the equation gives the shift p1 (2, 4).")
    shift = bend(np.ones((1, 2)), 0.0, 0.0, 1.0, 0.0)[0] - 1
    assert first == shift[0]
    assert second == shift[1]
    at = np.array([[0.3, 0.7]])
    mixed = (bend(at, 0.0, 0.0, 1.0, 0.0) - at)[0, 0] / (0.3 * 0.7)
    (said,) = says("Both mixed terms carry a 2.")
    (lost,) = says("has lost its 2 in both lines")
    (belongs,) = says("The 2 belongs to the mixed terms only.")
    assert said == mixed
    assert lost == mixed
    assert belongs == mixed


def test_the_slope_in_the_replies(says):
    says("differentiating r³ gives 3 r², yours has 2 r")
    r, step = 0.4, 1e-6
    slope = (g(r + step, -0.3) - g(r - step, -0.3)) / (2 * step)
    assert slope == pytest.approx(1 + 3 * -0.3 * r**2)


def test_the_map_has_two_numbers_a_pixel(says):
    (two,) = says("an array (height, width, 2) of (u, v)")
    (again,) = says("Write `distort` for any number of points `xy` of shape (..., 2).")
    maps = cv2.initUndistortRectifyMap(np.eye(3), np.zeros(4), np.eye(3), np.eye(3), (4, 3), cv2.CV_32FC1)
    assert two == np.stack(maps[:2], axis=-1).shape[-1]
    assert again == two.value


def test_dividing_again_and_again_settles_in_the_barrel_alone(says):
    says("But dividing settles only while k1 r² is below 1")
    r_d, k1 = says("For a strong pincushion, say r_d = 6 with k1 = 0.5, it never settles.")

    def last_two(r_d, k1):
        r = r_d
        for _ in range(10_000):
            before, r = r, r_d / (1 + k1 * r**2)
        return before, r

    before, after = last_two(r_d.value, k1.value)
    assert abs(after - before) > 1
    for product in (0.99, 1.01):  # near the answer r, one division makes an error 2 k1 r² / (1 + k1 r²) times as large
        r = np.sqrt(product / k1.value)
        before, after = last_two(r * (1 + product), k1.value)
        assert (abs(after - before) < 1e-6) == (product < 1)


# Before the lesson ---------------------------------------------------------------------------------------------------


def test_before_the_lesson_what_keeps_k1(says):
    says("Resizing and cropping change K, and the rays stay what they were.")
    says("Resizing to half makes k1 four times as large; cropping leaves it alone.")
    f, ray = 500.0, np.array([[0.3, 0.4]])
    pixels, halved = f * bend(ray, -0.2, 0.0, 0.0, 0.0), f / 2 * bend(ray, -0.2, 0.0, 0.0, 0.0)
    np.testing.assert_allclose(halved, pixels / 2)  # one k1 serves both sizes
    assert 4 * (0.5 * f) ** 2 == f**2  # in pixels it would be four of them


def test_before_the_lesson_where_a_polynomial_turns_back(says):
    (k,) = says("A lens model is r_d = r (1 − 0.2 r²), without any other term.")
    fold = folds_at(-k.value)
    r, angle = says("For the one at r = 1.291, about 52° from the axis.")
    slope, radicand, again, at, exactly = says(
        "The slope 1 − 0.6 r² is zero at r = 1/sqrt(0.6) = 1.291, and atan 1.291 = 52.2°."
    )
    assert all(one == fold for one in (r, again, at))
    assert slope == 3 * k.value
    assert radicand == 3 * k.value
    (seen,) = says("A small one does so farther out, here at 52°, which a wide lens sees.")
    assert all(one == degrees(fold) for one in (angle, exactly, seen))
    far = np.linspace(0, 5, 50001)
    assert far[g(far, -k.value).argmax()] == pytest.approx(fold, abs=1e-4)
    zero = 1 / np.sqrt(k.value)
    r, angle = says("For the one at r = 2.236, about 66° from the axis.")
    (factor,) = says("There 1 − 0.2 r² is zero, and the model has come all the way back to the centre.")
    assert factor == k.value
    assert r == zero
    assert angle == degrees(zero)
    assert g(zero, -k.value) == pytest.approx(0, abs=1e-12)


def test_before_the_lesson_a_low_error(says):
    width, height, left = says("A calibration of a 1280 × 960 camera leaves 0.3 px of error.")
    (seen,) = says("No corner of the board was ever farther than 300 px from the middle.")
    (wanted,) = says("You want to measure 700 px from the middle.")
    assert seen.value < wanted.value < np.hypot(width.value, height.value) / 2
    again, within = says("The 0.3 px were measured within 300 px of the middle.")
    (claimed,) = says("Yes, to about 0.3 px.")
    assert again == left.value
    assert claimed == left.value
    assert within == seen.value
    r, f, k3, moved = says("At r = 0.8, with f = 900 px, even k3 = −0.05 moves a point by 9.4 px.")
    assert moved == f.value * (r.value - g(r.value, 0.0, 0.0, k3.value))
    assert r.about(wanted.value / f.value)


def test_the_curve_that_a_teacher_draws_on_the_board(says):
    strength, r_low, low, r_top, top, r_down, down, r_last = says(
        "draw r_d = r − 0.3 r³ on the board: (0, 0), (0.5, 0.46), the top (1.05, 0.70), (1.4, 0.58), (1.83, 0)"
    )
    assert r_top == folds_at(-strength.value)
    assert top == g(folds_at(-strength.value), -strength.value)
    assert low == g(r_low.value, -strength.value)
    assert down == g(r_down.value, -strength.value)
    assert r_last == 1 / np.sqrt(strength.value)
