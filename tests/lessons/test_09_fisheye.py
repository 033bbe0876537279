"""What lesson 09 says about fisheye lenses, recomputed with NumPy, SciPy and OpenCV."""

import cv2
import numpy as np
import pytest
from scipy.integrate import quad
from scipy.optimize import brentq, least_squares

from camviz.cameras import Camera, Intrinsics
from camviz.lenses import KannalaBrandt
from camviz.scenes import board_corners, snapshot, textured_scene
from camviz_school.views.fisheye import FisheyeView
from camviz_school.views.walk import around_board

EXCEPTIONS: dict[str, str] = {}

RADIUS = {
    "perspective": np.tan,
    "stereographic": lambda theta: 2 * np.tan(theta / 2),
    "equidistant": lambda theta: theta,
    "equisolid": lambda theta: 2 * np.sin(theta / 2),
    "orthographic": np.sin,
}
F, C = np.array([379.045, 379.008]), np.array([505.512, 509.969])
COEFFICIENTS = np.array([0.00693023, -0.0013828, -0.000272596, -0.000452646])
K = np.array([[F[0], 0, C[0]], [0, F[1], C[1]], [0, 0, 1]])
"""The lens of section 2, as the Basalt project's test has it."""


def g(theta, k=COEFFICIENTS):
    return theta * (1 + k[0] * theta**2 + k[1] * theta**4 + k[2] * theta**6 + k[3] * theta**8)


def fold(k=COEFFICIENTS):
    """The smallest θ > 0 with slope 0, from the roots of the slope in θ²."""
    squares = np.roots([9 * k[3], 7 * k[2], 5 * k[1], 3 * k[0], 1.0])
    return np.sqrt(min(root.real for root in squares if abs(root.imag) < 1e-12 and root.real > 0))


def angle_of(r):
    return brentq(lambda theta: g(theta) - r, 0, fold())


def ray(theta, around=0.0):
    return np.array([np.sin(theta) * np.cos(around), np.sin(theta) * np.sin(around), np.cos(theta)])


def by_opencv(point, k=COEFFICIENTS, matrix=K):
    pixel, _ = cv2.fisheye.projectPoints(np.reshape(point, (1, 1, 3)), np.zeros(3), np.zeros(3), matrix, k)
    return pixel.ravel()


def stretch(name, theta, step=1e-5):
    """How many focal lengths a radian gets along the radius and around the axis."""
    r = RADIUS[name]
    return (r(theta + step) - r(theta - step)) / (2 * step), r(theta) / np.sin(theta)


def test_the_lens_of_the_first_picture_sees_more_than_everything_in_front(says):
    says("A dashed circle comes in: what is outside it lies behind the camera.")
    circle = FisheyeView(panels="picture").radius(np.array(np.pi / 2))
    assert circle == pytest.approx(np.pi / 2)
    for f, comes_in in ((300.0, False), (60.0, True)):  # where the slider stands first, and its left end
        assert ("90°" in FisheyeView(f=f, panels="picture").figure(draft=True).body) == comes_in
        assert (f * np.pi / 2 < 239.5) == comes_in
    assert ray(np.radians(91))[2] < 0 < ray(np.radians(89))[2]
    (across,) = says("out of a picture that is 183° wide, beside the one that camviz cuts")
    assert across == np.degrees(2 * 240 / 150)
    assert across.value > 180


def test_the_five_projections_near_the_axis_and_at_90_degrees(says):
    says("Near the axis they all agree")
    for r in RADIUS.values():
        assert r(0.01) == pytest.approx(0.01, rel=1e-4)
    at_90 = {name: float(r(np.pi / 2)) for name, r in RADIUS.items()}
    (right_angle,) = says("Perspective alone runs off to infinity at 90°. f · tan θ diverges there; the others do not.")
    assert right_angle == 90
    assert [name for name, r in at_90.items() if r > 1e6] == ["perspective"]
    assert np.tan(np.radians(right_angle.value - 1e-6)) > 1e6
    degrees, equisolid, equidistant, stereographic = says("at 90°: r/f is 1, 1.41, 1.57, 2 and infinity")
    also, *again = says("at 90° their r/f is 1, 1.41, 1.57, 2 or infinite")
    assert np.degrees(np.pi / 2) == pytest.approx(degrees.value)
    assert also == degrees.value
    names = ("equisolid", "equidistant", "stereographic")
    for said, name in zip((equisolid, equidistant, stereographic), names, strict=True):
        assert said == at_90[name]
    assert [one.value for one in again] == [equisolid.value, equidistant.value, stereographic.value]
    assert at_90["orthographic"] == pytest.approx(1)


def test_pixels_a_degree(says):
    says("The equidistant lens gives every degree the same number along the radius.")
    says(
        "The perspective one spends most of its pixels on its corners. The orthographic one has almost "
        "none left at its rim."
    )
    angles = np.radians([5.0, 40.0, 80.0])
    assert np.ptp([stretch("equidistant", theta)[0] for theta in angles]) < 1e-9
    assert stretch("perspective", angles[2])[0] > 30 * stretch("perspective", angles[0])[0]
    assert stretch("orthographic", np.radians(89))[0] < 0.02


def test_what_each_projection_keeps_and_where_it_ends(says):
    (column,) = says("keeps | at 90° | ends at")
    assert column == 90
    (below,) = says("| perspective | f tan θ | straight lines | ∞ | below 90° |")
    assert np.tan(np.radians(below.value)) > 1e15
    (almost,) = says("| shapes: circles stay circles | 2 f | below 180° |")
    assert 2 * np.tan(np.radians(almost.value) / 2) > 1e15
    at_90, end = says("| equidistant | f θ | angles from the axis | 1.571 f | 180° |")
    assert at_90 == np.pi / 2
    assert end == np.degrees(np.pi)
    at_90, end = says("| areas | 1.414 f | 180° |")
    assert at_90 == 2 * np.sin(np.pi / 4)
    assert end == np.degrees(np.pi)
    (end,) = says("equal areas of the picture give equal light on a surface parallel to the image | f | 90° |")
    assert stretch("orthographic", np.radians(end.value))[0] == pytest.approx(0, abs=1e-4)
    for theta in np.radians([10.0, 40.0, 70.0, 85.0]):
        along, around = stretch("stereographic", theta)
        assert along == pytest.approx(around)
        assert np.prod(stretch("equisolid", theta)) == pytest.approx(1)
        assert np.prod(stretch("orthographic", theta)) == pytest.approx(np.cos(theta))  # the light's obliquity
    says("the only one of the five that keeps small shapes")
    for name in set(RADIUS) - {"stereographic"}:
        along, around = stretch(name, 1.0)
        assert along != pytest.approx(around, rel=0.05)


def test_a_perspective_picture_ends_below_90_degrees(says):
    limit, f, wide, ends, ten_times = says(
        "θ = atan(r / f), less than 90°. With f = 150 px, a picture 480 px wide ends 58° from the axis, "
        "and one ten times as wide at 86°."
    )
    assert ends == np.degrees(np.arctan(wide.value / 2 / f.value))
    assert ten_times == np.degrees(np.arctan(10 * wide.value / 2 / f.value))
    assert ten_times.value < limit.value
    (side,) = says("comes in exactly from the side, 90° from the axis?")
    (nowhere,) = says("Nowhere: tan 90° is infinite.")
    infinite, beyond = says(
        "At exactly 90° the tangent is infinite: no place in any picture, on neither side. tan θ does "
        "turn negative beyond 90°"
    )
    for said in (side, nowhere, infinite, beyond):
        assert ray(np.radians(said.value))[2] == pytest.approx(0, abs=1e-12)  # parallel to the picture
    assert np.tan(np.radians(beyond.value + 1)) < 0


def test_the_window_is_exact_below_its_own_90_degrees(says):
    (own,) = says("the geometry is exact at every θ below the window's own 90°")
    small, large = says("Then make the window's field 20°, and 120°.")
    assert small.value < large.value < 2 * own.value
    says("as straight as in the middle")
    line = np.stack([np.linspace(-2, 2, 50), np.full(50, 1.0), np.full(50, 1.5)], axis=-1)  # a joint of the terrace
    yaw = np.radians(60)
    turn = np.array([[np.cos(yaw), 0, -np.sin(yaw)], [0, 1, 0], [np.sin(yaw), 0, np.cos(yaw)]])
    theta = np.arctan2(np.hypot(line[:, 0], line[:, 1]), line[:, 2])
    round_picture = theta[:, None] * line[:, :2] / np.hypot(line[:, 0], line[:, 1])[:, None]
    back = np.stack([ray(np.hypot(*xy), np.arctan2(xy[1], xy[0])) for xy in round_picture]) @ turn.T
    window = (back[:, :2] / back[:, 2:])[back[:, 2] > 0.1]

    def bow(points):
        return np.linalg.svd(points - points.mean(axis=0))[1][1]

    assert bow(window) < 1e-9 < 1e-2 < bow(round_picture)


def test_opencv_s_omnidirectional_model_is_the_stereographic_projection(says):
    says("With ξ = 1 and γ = 2f it is the stereographic projection.")
    rng = np.random.default_rng(9)
    for _ in range(20):
        theta, around, f = rng.uniform(0.05, 3.0), rng.uniform(0, 2 * np.pi), rng.uniform(100, 400)
        gamma = np.diag([2 * f, 2 * f, 1.0])
        point = ray(theta, around).reshape(1, 1, 3)
        pixel, _ = cv2.omnidir.projectPoints(point, np.zeros(3), np.zeros(3), gamma, 1.0, np.zeros((1, 4)))
        want = 2 * f * np.tan(theta / 2) * np.array([np.cos(around), np.sin(around)])
        np.testing.assert_allclose(pixel.ravel(), want, rtol=1e-9)
    says("OpenCV's fisheye model with all coefficients 0 is the equidistant one.")
    np.testing.assert_allclose(by_opencv(ray(1.2), np.zeros(4), np.eye(3)), (1.2, 0), atol=1e-12)
    (right_angle,) = says("θ is finite for every ray, so nothing diverges at 90°.")
    assert np.isfinite(g(np.radians(right_angle.value)))


def test_the_published_lens(says):
    f, cx, cy, width, height, across = says(
        "It has f = 379 px, with the middle of the picture near (506, 510). A picture of 1024 × 1024 pixels then "
        "reaches 155° from side to side."
    )
    folds, reach, y, z = says(
        "at 112° from the axis, 1.75 focal lengths from the middle. The picture's corners lie beyond that and are "
        "empty. Here is a point at (1, 2, 5):"
    )
    assert height == width.value
    assert all(f == one for one in F)
    assert cx == C[0]
    assert cy == C[1]
    sides = [angle_of((C[0] + 0.5) / F[0]), angle_of((width.value - 0.5 - C[0]) / F[0])]
    assert across == np.degrees(sum(sides))
    assert across == np.degrees(angle_of((C[1] + 0.5) / F[1]) + angle_of((height.value - 0.5 - C[1]) / F[1]))
    assert folds == np.degrees(fold())
    assert reach == g(fold())
    corners = [np.hypot((u - C[0]) / F[0], (v - C[1]) / F[1]) for u in (-0.5, 1023.5) for v in (-0.5, 1023.5)]
    assert min(corners) > g(fold())
    point = np.array([1.0, y.value, z.value])
    theta = np.arctan2(np.hypot(*point[:2]), point[2])
    np.testing.assert_allclose(F * g(theta) * point[:2] / np.hypot(*point[:2]) + C, by_opencv(point), atol=1e-9)
    off, pixels, to = says(
        "The lens of section 2 keeps to the equidistant one within 2.1 px of 1024 up to 78° from the axis."
    )
    assert to == np.degrees(max(sides))
    theta = np.linspace(0, max(sides), 1000)
    assert off == (F[0] * np.abs(g(theta) - theta)).max()
    assert off.value > (F[0] * np.abs(g(theta) - theta)).max()  # within: not rounded down
    assert pixels == width.value
    *beyond, at_fold = says("It is off by 7 px at 90°, 25 px at 100° and 78 px at its fold.")
    for missed, degrees in zip(beyond[::2], beyond[1::2], strict=True):
        angle = np.radians(degrees.value)
        assert missed == F[0] * (angle - g(angle))
    assert at_fold == F[0] * (fold() - g(fold()))
    theta = np.radians(78.0)  # in front, where OpenCV's own polynomial can be asked
    assert by_opencv(ray(theta))[0] - C[0] == pytest.approx(F[0] * g(theta))


def test_opencv_mirrors_what_is_behind(says):
    field, angle = says("A lens of 220° sees a point 100° from its axis, to the right and a little behind.")
    assert angle.value < field.value / 2
    assert ray(np.radians(angle.value))[2] < 0
    says("OpenCV's fisheye module divides x and y by z first.")
    ratio, radius, wrong = says(
        "But z is negative here, and x/z is −5.67: the point is on the left before there is an angle, and "
        "atan(5.67) is 80°."
    )
    x, _, z = ray(np.radians(angle.value))
    assert z < 0
    assert ratio == x / z
    assert radius == np.hypot(x / z, 0)
    assert wrong == np.degrees(np.arctan(radius.value))
    again, same = says("Yes: dividing by a negative z turns right into left, and atan(5.67) = 80°.")
    (mirror,) = says("On the left, at 80° from the axis.")
    assert again.value == radius.value
    assert same.value == mirror.value == wrong.value
    assert by_opencv(ray(np.radians(angle.value)))[0] == pytest.approx(
        C[0] - F[0] * g(np.radians(mirror.value)), abs=0.1
    )
    hundred, eighty, further, u, width = says(
        "At 100° the true place is on the right. OpenCV puts the point on the left, at the mirror image "
        "of 80°. The point at 110° lies behind the camera and outside this picture, at u = 1167 of 1024."
    )
    left, right = (by_opencv(ray(np.radians(one.value)))[0] for one in (hundred, eighty))
    assert left - C[0] == pytest.approx(C[0] - right)
    assert left < C[0]
    assert u == C[0] + F[0] * g(np.radians(further.value))
    assert u.value > width.value
    says("OpenCV puts it into the picture, on the other side.")
    assert 0 < by_opencv(ray(np.radians(further.value)))[0] < C[0]
    minus, one = says("OpenCV divides by z first, and x/z cannot tell (x, z) = (1, −1) from (−1, 1).")
    assert 1 / minus.value == one.value / 1
    assert np.arctan2(1, minus.value) != np.arctan2(one.value, 1)
    (beyond,) = says("A fisheye may see beyond 90°, to points behind it:")
    assert beyond == np.degrees(np.arctan2(1, 0))
    nature, products, needed = says(
        '"180° is a limit of nature". It is the limit of one formula. Fisheyes of more than 180° are '
        "ordinary products. Their model must go past 90° from the axis"
    )
    assert nature == products.value
    assert needed == products.value / 2


def test_the_first_guess_of_the_calibration(says):
    half, field, f = says("Half the picture's width over half its field in radians will do: 320 px / 1.35 = 237 px.")
    small = 640 / 1024
    across = angle_of((C[0] + 0.5) / F[0]) + angle_of((1023.5 - C[0]) / F[0])
    assert half == 640 / 2
    assert field == across / 2
    assert f == half.value / (across / 2)
    assert f.about(F[0] * small, 0.01)


def test_the_boards_reached_62_degrees_and_there_the_powers_look_alike(says):
    reached, begin, end, beyond = says(
        "The boards reached 62° from the axis, and as far as that the curve is right to a small fraction of a pixel. "
        "The single coefficients are not. θ³, θ⁵, θ⁷ and θ⁹ look much alike between 0° and 62°, so the others make up "
        "for an error in one. Compare curves, never coefficients. Beyond the last corner, at 70°,"
    )
    seen = np.array([place.inv().apply(board_corners().reshape(-1, 3)) for place in around_board(10)])
    assert reached == np.degrees(np.arctan2(np.hypot(seen[..., 0], seen[..., 1]), seen[..., 2])).max()
    theta = np.radians(np.linspace(begin.value, end.value, 200)[1:])
    powers = np.stack([theta**n for n in (3, 5, 7, 9)], axis=-1)
    assert np.linalg.cond(powers / np.linalg.norm(powers, axis=0)) > 100
    assert beyond.value > reached.value


@pytest.fixture(scope="module")
def found():
    """The corners (10, 54, 2) of the ten boards, found in pictures taken through the lens of section 2."""
    k = Intrinsics(1024, 1024, *F, *C).within(640)
    pictures = [snapshot(textured_scene(), Camera(k, KannalaBrandt(*COEFFICIENTS), at)) for at in around_board(10)]
    flags = cv2.CALIB_CB_EXHAUSTIVE | cv2.CALIB_CB_ACCURACY
    greys = [cv2.cvtColor(picture, cv2.COLOR_RGB2GRAY) for picture in pictures]
    return np.array([cv2.findChessboardCornersSB(grey, (9, 6), flags=flags)[1].reshape(54, 2) for grey in greys])


BOARD = np.stack([*np.meshgrid(0.1 * np.arange(9.0), 0.1 * np.arange(6.0)), np.zeros((6, 9))], axis=-1).reshape(54, 3)
TRUE_F = F[0] * 640 / 1024


@pytest.mark.thorough
def test_the_model_of_lesson_05_fits_the_corners_and_is_wrong_beyond(says, found):
    (rms_said,) = says("The RMS error is 0.20 px.")
    (reached,) = says("The fit is held by corners as far as 62° from the axis.")
    says("Eight degrees farther out the polynomial in tan θ has left the picture.")
    says("An error of a fraction of a pixel, and rays farther out are wrong by hundreds of pixels.")
    (at_most,) = says("Even where the corners are, the wrong model's curve is off by up to 5.2 px")
    objects, images = [BOARD.astype(np.float32)] * 10, list(found.astype(np.float32))
    rms, matrix, bend, *_ = cv2.calibrateCamera(objects, images, (640, 640), None, None)
    assert rms_said == rms

    def miss(degrees):
        """How far OpenCV's own projection of a ray is from the truth along the radius."""
        uv, _ = cv2.projectPoints(ray(np.radians(degrees)).reshape(1, 1, 3), np.zeros(3), np.zeros(3), matrix, bend)
        return uv[0, 0, 0] - matrix[0, 2] - TRUE_F * g(np.radians(degrees))

    bend[0, 2:4] = 0  # p1 and p2 are no part of the curve
    assert at_most == max(abs(miss(degrees)) for degrees in np.arange(1, reached.value))
    assert 100 < abs(miss(reached.value + 8)) < 1000
    assert miss(reached.value + 8) + TRUE_F * g(np.radians(70)) < -320  # to the left of the picture: it should be right


@pytest.mark.thorough
def test_two_coefficients_are_enough(says, found):
    says("From none to two, each coefficient lowers the error. The third and the fourth do not.")
    says("with all four, the curve leaves the truth sooner where no corner holds it")
    guess = np.array([[230.0, 0, 319.5], [0, 230, 319.5], [0, 0, 1]])
    held = [cv2.CALIB_FIX_K1, cv2.CALIB_FIX_K2, cv2.CALIB_FIX_K3, cv2.CALIB_FIX_K4]
    flags = cv2.CALIB_RECOMPUTE_EXTRINSIC | cv2.CALIB_FIX_SKEW | cv2.CALIB_USE_INTRINSIC_GUESS
    stop = (cv2.TERM_CRITERIA_EPS + cv2.TERM_CRITERIA_COUNT, 100, 1e-9)
    rms, off = [], []
    for n in range(5):
        given = [BOARD[None]] * 10, list(found[:, None].astype(float)), (640, 640), guess.copy(), np.zeros(4)
        error, matrix, few, *_ = cv2.fisheye.calibrate(*given, flags=flags | sum(held[n:]), criteria=stop)
        rms.append(error)
        off.append(abs(matrix[0, 0] * g(np.radians(70), few.ravel()) - TRUE_F * g(np.radians(70))))
    assert rms[0] > 1.1 * rms[1] > 1.15 * rms[2]
    assert rms[2] == pytest.approx(rms[3], rel=0.01)
    assert rms[2] == pytest.approx(rms[4], rel=0.01)
    assert off[4] > 2 * off[2]


def test_a_stereographic_lens_in_four_coefficients(says):
    two, half, r, k1 = says("at θ = 1 the stereographic r is 2 tan 0.5 = 1.0926, so k1 = 0.0926.")
    assert half == 1 / two.value
    assert r == two.value * np.tan(half.value)
    assert k1 == r.value - 1
    last, near, further, far = says(
        "Up to 95° four right coefficients miss by less than 0.01 px. At 120° they miss by 4 px."
    )
    a = np.radians(np.arange(1, last.value + 1))
    best = least_squares(lambda k: g(a, k) - 2 * np.tan(a / 2), np.zeros(4), xtol=1e-15, ftol=1e-15, gtol=1e-15).x
    miss = 300 * np.abs(g(a, best) - 2 * np.tan(a / 2)).max()
    assert near.value / 2 < miss < near.value
    end = np.radians(further.value)
    assert far == 300 * abs(g(end, best) - 2 * np.tan(end / 2))


def test_the_wall_of_the_astronaut(says):
    (wide,) = says("Put it on a wall that is 100° wide")
    f = 256 / np.tan(np.radians(wide.value / 2))
    corner = np.degrees(np.arctan(np.hypot(255.5, 255.5) / f))
    assert corner < np.degrees(fold())  # the lens sees all of it
    says("Little is missing in the middle. Much is missing towards the corners")
    slope = (g(1e-4) - g(-1e-4)) / 2e-4
    at_50 = (g(np.radians(50) + 1e-4) - g(np.radians(50) - 1e-4)) / 2e-4
    covers = {0: f / (F[0] / 2 * slope), 50: f / np.cos(np.radians(50)) ** 2 / (F[0] / 2 * at_50)}
    assert covers[0] < 1.2 < 2.5 < covers[50]


def test_the_map_has_two_numbers_a_pixel(says):
    (three,) = says("Write the pixels of any number of `points` (…, 3) all around the camera")
    assert three == by_opencv(ray(1.0)).size + 1
    (two,) = says("The answer has shape (height, width, 2).")
    maps = cv2.fisheye.initUndistortRectifyMap(np.eye(3), np.zeros(4), np.eye(3), np.eye(3), (4, 3), cv2.CV_32FC1)
    assert two == np.stack(maps, axis=-1).shape[-1]


def test_the_quiz(says):
    (right_angle,) = says(
        "the polynomial acts on tan θ, which is infinite at 90°, and with k1 < 0 it folds long before"
    )
    assert np.tan(np.radians(right_angle.value)) > 1e15
    assert np.degrees(np.arctan(1 / np.sqrt(3 * 0.05))) < 70  # the fold for as little as k1 = −0.05
    (full,) = says("removing the distortion gives the full 180° as a straight picture")
    wide, times = says(
        "A perspective picture of 180° is infinitely wide. At 120° its edges are already stretched four times"
    )
    assert full == wide.value
    assert np.tan(np.radians(wide.value / 2)) > 1e15
    assert stretch("perspective", np.radians(times.value / 2))[0] == pytest.approx(4)
    (cloud,) = says("a cloud at 90° is drawn with four times the area of one overhead")
    assert np.prod(stretch("stereographic", np.radians(cloud.value))) == pytest.approx(4, rel=1e-6)
    says("the circle of radius f θ is longer than that of the sphere, sin θ: the rim counts too much")
    assert stretch("equidistant", np.pi / 2)[1] > 1.5
    third, series = says("here about +1/3, since tan θ ≈ θ + θ³/3")
    theta = 1e-2
    assert (np.tan(theta) - theta) / theta**3 == pytest.approx(1 / third.value, rel=1e-3)
    assert series == third.value
    (reaches,) = says("so it reaches 90° and beyond")
    assert np.isfinite(g(np.radians(reaches.value + 20)))
    says("r = 2f sin(θ/2) makes a pixel worth the same solid angle everywhere")
    solid, _ = quad(lambda theta: 2 * np.pi * np.sin(theta), 0, 1.0)
    assert solid == pytest.approx(np.pi * (2 * np.sin(0.5)) ** 2)


def test_a_fisheye_that_looks_up_sees_the_whole_horizon(says):
    (more,) = says(
        "it is omnidirectional if the whole horizon lies in that cone, as when it looks up and sees more than 180°"
    )
    (ahead,) = says("One of 180° that looks straight ahead misses everything behind it.")
    horizon, wider = says(
        "let a fisheye look up: the whole horizon is then 90° from its axis, and a lens of more than 180° sees it"
    )
    (also,) = says("when it looks up or down and sees more than 180°")
    level, broad = says(
        "When it looks straight up, the horizon is 90° from its axis, and a lens of more than 180° has it in its "
        "picture."
    )
    assert level == horizon.value
    assert broad == wider.value
    around = np.linspace(0, 2 * np.pi, 73)
    directions = np.stack([np.sin(around), 0 * around, np.cos(around)], axis=-1)  # y is down: all level
    from_axis = {
        name: np.degrees(np.arccos(directions @ axis)) for name, axis in (("up", [0, -1, 0]), ("ahead", [0, 0, 1]))
    }
    np.testing.assert_allclose(from_axis["up"], horizon.value)
    for field in (more, wider, also):
        assert (from_axis["up"] < field.value / 2 + 0.1).all()
    assert (from_axis["ahead"] > ahead.value / 2 + 1).any()


def test_the_angles_in_the_exercises(says):
    (all_round,) = says(
        "`np.arctan2(a, b)` is the angle of a ray that goes a to the side and b ahead, right all the way "
        "round to 180°."
    )  # fmt: skip
    assert all_round == np.degrees(np.arctan2(1e-12, -1))
    (minus,) = says("one behind such as (1, 0, −1)")
    again, angle, most = says(
        "The point (1, 0, −1) is 135° from the axis. np.arctan never gives more than 90°, and a negative "
        "z makes it negative."
    )
    assert again == minus.value
    assert angle == np.degrees(np.arctan2(1, minus.value))
    assert most == np.degrees(np.arctan(np.inf))
    assert np.arctan(1 / minus.value) < 0
    one, other = says("Two points at 100° and at 150° would share a pixel")
    assert min(one.value, 90) == min(other.value, 90)
    true, wrong = says("a point at 135° is not at 45°")
    assert true == angle.value
    assert wrong == np.degrees(abs(np.arctan(1 / minus.value)))
    ends = [
        *says("arctan(r / z) ends at 90° and comes back negative"),
        *says("A ray at 90°, which no pinhole can show"),
        *says("θ simply exceeds 90°"),
        *says("θ goes on beyond 90°, and so does r"),
        *says("Everything behind the camera is put at 90°."),
        *says("which stays finite at 90°"),
        *says("You stop at 90°."),
        *says("the orthographic lens, which folds at 90°"),
    ]
    assert all(one == np.degrees(np.arctan(np.inf)) for one in ends)
    assert stretch("orthographic", np.pi / 2 - 0.01)[0] > 0 > stretch("orthographic", np.pi / 2 + 0.01)[0]
    three, five = says("Without the 3 and the 5 the steps are too long.")
    theta, step = 0.8, 1e-6
    slope = (g(theta + step, [0.02, 0.001, 0, 0]) - g(theta - step, [0.02, 0.001, 0, 0])) / (2 * step)
    assert slope == pytest.approx(1 + three.value * 0.02 * theta**2 + five.value * 0.001 * theta**4)


# Before the lesson ---------------------------------------------------------------------------------------------------


def test_before_the_lesson_a_lens_of_more_than_180(says):
    (across,) = says("The lens of a doorbell sees 190° from edge to edge.")
    (behind,) = says("A ray 95° from the axis comes from behind, where Z < 0.")
    (number,) = says("By such a rule 95° is a number like any other.")
    assert behind == across.value / 2
    assert number == behind.value
    assert ray(np.radians(behind.value))[2] < 0
    says("X/Z would put it on the wrong side")
    assert ray(np.radians(behind.value))[0] / ray(np.radians(behind.value))[2] < 0
    at, times, edge = says(
        "75° from the axis a degree already takes 15 times the room it has in the middle, and 90° are infinitely "
        "far out"
    )
    assert times == stretch("perspective", np.radians(at.value))[0] / stretch("perspective", 1e-3)[0]
    assert np.tan(np.radians(edge.value)) > 1e15


def test_before_the_lesson_equal_pieces_of_sky(says):
    def area(name, theta):
        return np.prod(stretch(name, theta))

    says("The equisolid one, r = 2f sin(θ/2).")
    assert area("equisolid", 0.1) == pytest.approx(area("equisolid", 1.5))
    says("The equidistant one, r = f θ.")
    (rim,) = says("a patch at the horizon gets 1.57 times the pixels it would get overhead")
    assert rim == area("equidistant", np.pi / 2) / area("equidistant", 1e-3)
    says("The stereographic one, r = 2f tan(θ/2).")
    at, times = says("A patch 60° from the axis gets 1.78 times the pixels it would get overhead.")
    assert times == area("stereographic", np.radians(at.value)) / area("stereographic", 1e-3)


def test_before_the_lesson_an_angle_is_not_its_tangent(says):
    at, angle, tangent = says("At 80° the angle is 1.40 and its tangent 5.67")
    assert angle == np.radians(at.value)
    assert tangent == np.tan(np.radians(at.value))


def test_before_the_lesson_one_lens_for_the_whole_horizon(says):
    (across,) = says("Its owner buys one fisheye lens of 200°.")
    (horizon,) = says("Yes, if it looks straight up: the horizon is then 90° from its axis.")
    assert horizon == np.degrees(np.arccos(ray(np.pi / 2)[2]))
    reach, spare = says("the lens reaches 100° from its axis. There are 10° to spare")
    (side,) = says("Looking ahead, it sees 100° to each side of that direction.")
    (within,) = says("One lens does it when the whole horizon lies within its 200°.")
    assert reach == across.value / 2
    assert side == reach.value
    assert spare == reach.value - horizon.value
    assert within == across.value


def test_one_ray_by_hand_and_what_the_sliders_show(says):
    (f,) = says("the distance from the middle, here r = f θ with f = 150 px;")
    (more,) = says("The angle is more than 90°, because the point is behind the camera.")
    width, height = says("Still it has a pixel in this picture of 480 × 480.")
    point = np.array([1.0, -0.5, -0.2])
    theta = np.arccos(point[2] / np.linalg.norm(point))
    u, v = 239.5 + f.value * theta * point[:2] / np.hypot(*point[:2])
    assert np.degrees(theta) > more.value
    assert 0 < u < width.value
    assert 0 < v < height.value
    *circles, past = says(
        "circles 30°, 60° and 90° from the axis on the picture, and the curve. Yellow and blue are right. Pull focal "
        "length to the left: orange must cover them beyond 90°, too."
    )
    assert past == circles[-1].value
    assert all(f.value * np.radians(one.value) < width.value / 2 for one in circles)  # all are in the picture
    (yaw,) = says("Turn window yaw to 80°. Part of the window then shows what is beside and behind the camera.")
    half = 40
    assert yaw.value + half > more.value
    assert np.degrees(width.value / 2 / f.value) < yaw.value + half  # the picture ends inside the window
    (digits,) = says("by less than 1e-13")
    rays = np.random.default_rng(1).normal(size=(1000, 3))
    rays = rays[rays[:, 2] > 0.1]
    theta = np.arctan2(np.hypot(rays[:, 0], rays[:, 1]), rays[:, 2])
    ours = rays[:, :2] * (theta / np.hypot(rays[:, 0], rays[:, 1]))[:, None]
    theirs, _ = cv2.fisheye.projectPoints(rays[None], np.zeros(3), np.zeros(3), np.eye(3), np.zeros(4))
    assert np.abs(ours - theirs[0]).max() < digits.value


def test_newton_s_three_steps_and_where_the_dots_stop(says):
    k1, r, *slope = says(
        "Take one coefficient, k1 = 0.02, and the radius r = 2. The slope of θ + k1 θ³ is 1 + 3 k1 θ²."
    )
    assert not slope  # a formula's numbers
    truth = brentq(lambda theta: theta + k1.value * theta**3 - r.value, 0, 3)
    theta = r.value
    for _ in range(3):
        theta -= (theta + k1.value * theta**3 - r.value) / (1 + 3 * k1.value * theta**2)
    assert theta == pytest.approx(truth, abs=1e-6)
    (last,) = says("they must stop where it stops: at 180°")
    assert last == np.degrees(np.pi)


def test_one_pixel_of_a_window(says):
    width, height, wide, half, angle, f, yaw, u, v = says(
        "Take a window of 400 × 400 pixels that is 80° wide, so that its focal length is 200/tan 40° = 238.4 px. It "
        "looks 45° to the right. Which pixel of the fisheye's picture belongs in its pixel (300, 120)?"
    )
    assert half == width.value / 2
    assert angle == wide.value / 2
    assert f == half.value / np.tan(np.radians(angle.value))
    assert max(u.value, v.value) < width.value == height.value
    turn, _ = cv2.Rodrigues(np.array([0.0, np.radians(yaw.value), 0.0]))
    ahead = turn @ [(u.value - 199.5) / f.value, (v.value - 199.5) / f.value, 1.0]
    assert np.degrees(np.arccos(ahead[2] / np.linalg.norm(ahead))) == pytest.approx(68.9, abs=0.05)  # as printed


def test_the_equidistant_map_nearly_straightens_the_published_lens(says):
    size, off = says(
        "At this size, 512 pixels, the two maps differ by 0.96 px in the corners and by less elsewhere. So your picture"
    )
    f = size.value / 2 / np.tan(np.radians(50))
    theta = np.linspace(0, np.arctan(np.hypot(255.5, 255.5) / f), 2000)
    apart = F[0] / 2 * np.abs(g(theta) - theta)
    assert off == apart.max()
    assert apart.argmax() == len(apart) - 1


def test_what_a_teacher_draws_and_shows(says):
    middle, side, tangent, half_tan, two, angle, at_90, half_sin, also, sine = says(
        "At 60° and 90° they are: perspective 1.73 and ∞, stereographic 1.15 and 2, equidistant 1.05 and 1.57, "
        "equisolid 1.00 and 1.41, orthographic 0.87 and 1."
    )
    at_60, right = ([r(np.radians(one.value)) for r in RADIUS.values()] for one in (middle, side))
    assert at_60 == [tangent, half_tan, angle, half_sin, sine]
    assert right[1:] == [two, at_90, also, 1]


def test_where_the_tangent_ends_and_the_angle_does_not(says):
    ends = [
        *says("the angle does not end at 90° · every pixel keeps its ray"),
        *says("The angle does not end at 90° A real lens"),
        *says("Watch the edge of the picture, and where the thick curve goes at 90°."),
        *says("Orange is by your function, and covers yellow and blue beyond 90°, too."),
        *says("ask each time what happens at the rim and at 90°"),
        *says("and read off where each curve goes at 90°"),
    ]
    for one in ends:
        assert np.tan(np.radians(one.value)) > 1e15
        assert g(np.radians(one.value + 10)) > g(np.radians(one.value))
    (jump,) = says("At 90° the red curve jumps to the other side of the picture.")
    assert by_opencv(ray(np.radians(jump.value - 0.5)))[0] > 1023.5
    assert by_opencv(ray(np.radians(jump.value + 0.5)))[0] < -0.5
    (narrow,) = says("let them find it in a window of 20°")
    assert narrow == FisheyeView.controls()["hfov_deg"].low
    (columns,) = says("as the columns of a matrix (n, 4)")
    assert columns == len(COEFFICIENTS)
