"""What lesson 09 claims about fisheye lenses, recomputed with OpenCV, NumPy and SciPy."""

import cv2
import numpy as np
import pytest
from claims import claims
from scipy.optimize import brentq, least_squares

from camviz.cameras import Camera, Intrinsics
from camviz.lenses import KannalaBrandt
from camviz.scenes import snapshot, textured_scene
from camviz_school.views.walk import around_board

says = claims("09")

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
BOARD = np.stack([*np.meshgrid(0.1 * np.arange(9.0), 0.1 * np.arange(6.0)), np.zeros((6, 9))], axis=-1).reshape(54, 3)


def g(theta, k=COEFFICIENTS):
    return theta * (1 + k[0] * theta**2 + k[1] * theta**4 + k[2] * theta**6 + k[3] * theta**8)


def fold(k=COEFFICIENTS):
    """The smallest θ > 0 with slope 0, from the roots of the slope in θ²."""
    squares = np.roots([9 * k[3], 7 * k[2], 5 * k[1], 3 * k[0], 1.0])
    return np.sqrt(min(root.real for root in squares if abs(root.imag) < 1e-12 and root.real > 0))


def angle_of(r):
    return brentq(lambda theta: g(theta) - r, 0, fold())


def ray(degrees):
    return np.array([np.sin(np.radians(degrees)), 0, np.cos(np.radians(degrees))])


def by_opencv(point, k=COEFFICIENTS, matrix=K):
    return cv2.fisheye.projectPoints(np.reshape(point, (1, 1, 3)), np.zeros(3), np.zeros(3), matrix, k)[0].ravel()


def stretch(name, theta, step=1e-5):
    """Focal lengths a radian, along the radius and around the axis."""
    r = RADIUS[name]
    return (r(theta + step) - r(theta - step)) / (2 * step), r(theta) / np.sin(theta)


def area(name, theta):
    return np.prod(stretch(name, theta))


def test_the_five_projections_and_what_each_keeps():
    says("| f tan θ | straight lines | ∞ | below 90° |", "| equidistant | f θ | angles from the axis | 1.571 f |")
    says("| shapes: circles stay circles | 2 f | below 180° |", "| areas | 1.414 f | 180° |")
    at_90 = [RADIUS[name](np.pi / 2) for name in ("equidistant", "stereographic", "equisolid", "orthographic")]
    assert at_90 == pytest.approx([1.571, 2, 1.414, 1], abs=5e-4)
    for theta in np.radians([10.0, 40, 70, 85]):
        assert area("equisolid", theta) == pytest.approx(1)
        assert area("orthographic", theta) == pytest.approx(np.cos(theta))
        along, around = stretch("stereographic", theta)
        assert along == pytest.approx(around)
    says("With ξ = 1 and γ = 2f it is the stereographic projection.")
    gamma, point = np.diag([2.0, 2, 1]), ray(130).reshape(1, 1, 3)
    omni = cv2.omnidir.projectPoints(point, np.zeros(3), np.zeros(3), gamma, 1.0, np.zeros((1, 4)))[0]
    assert omni[0, 0, 0] == pytest.approx(2 * np.tan(np.radians(65)))
    says("OpenCV's fisheye model with all coefficients 0 is the equidistant one.")
    assert by_opencv(ray(69), np.zeros(4), np.eye(3))[0] == pytest.approx(np.radians(69))


def test_the_published_lens():
    says("f = 379 px, with the middle of the picture near (506, 510)", "then reaches 155° from side to side.")
    says("at 112° from the axis, 1.75 focal lengths from the middle. The picture's corners lie beyond that and are")
    assert [*F, *C] == pytest.approx([379, 379, 506, 510], abs=0.5)
    left, right = angle_of((C[0] + 0.5) / F[0]), angle_of((1023.5 - C[0]) / F[0])
    assert np.degrees([left + right, fold()]) == pytest.approx([155, 112], abs=0.5)
    assert g(fold()) == pytest.approx(1.75, abs=5e-3)
    corners = [np.hypot((u - C[0]) / F[0], (v - C[1]) / F[1]) for u in (-0.5, 1023.5) for v in (-0.5, 1023.5)]
    assert g(fold()) < min(corners)
    point = np.array([1.0, 2, 5])
    theta = np.arccos(point[2] / np.linalg.norm(point))
    np.testing.assert_allclose(F * g(theta) * point[:2] / np.hypot(1, 2) + C, by_opencv(point))


def test_how_far_the_lens_is_from_its_design():
    says("keeps to the equidistant one within 2.1 px of 1024 up to 78° from the axis")
    says("It is off by 7 px at 90°, 25 px at 100° and 78 px at its fold.")
    says("*Distortion*, usually departure from perspective, here means that from the design.")
    edge = max(angle_of((C[0] + 0.5) / F[0]), angle_of((1023.5 - C[0]) / F[0]))
    assert np.degrees(edge) == pytest.approx(78, abs=0.5)
    theta = np.linspace(0, edge, 1000)
    assert F[0] * np.abs(g(theta) - theta).max() == pytest.approx(2.1, abs=0.05)
    beyond = np.array([np.radians(90), np.radians(100), fold()])
    assert F[0] * (beyond - g(beyond)) == pytest.approx([7, 25, 78], abs=0.5)


def test_opencv_mirrors_what_lies_behind():
    says("At 100° the true place is on the right. OpenCV puts the point on the left, at the mirror image of 80°.")
    says("at u = 1167 of 1024", "OpenCV puts it into the picture, on the other side.")
    assert by_opencv(ray(100))[0] == pytest.approx(C[0] - F[0] * g(np.radians(80)))
    assert C[0] + F[0] * g(np.radians(110)) == pytest.approx(1167, abs=0.5)
    assert 0 < by_opencv(ray(110))[0] < C[0]


def test_a_window_straightens_lines():
    says("Take a window of 400 × 400 pixels that is 80° wide, so that its focal length is 200/tan 40° = 238.4 px.")
    says("It looks 45° to the right. Which pixel of the fisheye's picture belongs in its pixel (300, 120)?")
    f = 200 / np.tan(np.radians(40))
    assert f == pytest.approx(238.4, abs=0.05)
    ahead = cv2.Rodrigues(np.array([0, np.radians(45), 0]))[0] @ [(300 - 199.5) / f, (120 - 199.5) / f, 1]
    assert np.degrees(np.arccos(ahead[2] / np.linalg.norm(ahead))) == pytest.approx(68.9, abs=0.05)  # as printed
    says("the two maps differ by 0.96 px in the corners and by less elsewhere")
    theta = np.linspace(0, np.arctan(np.hypot(255.5, 255.5) / (256 / np.tan(np.radians(50)))), 2000)
    apart = F[0] / 2 * np.abs(g(theta) - theta)
    assert apart[-1] == apart.max() == pytest.approx(0.96, abs=5e-3)


def test_a_stereographic_lens_in_four_coefficients():
    says("at θ = 1 the stereographic r is 2 tan 0.5 = 1.0926, so k1 = 0.0926.")
    assert 2 * np.tan(0.5) == pytest.approx(1.0926, abs=5e-5)
    says("Up to 95° four right coefficients miss by less than 0.01 px. At 120° they miss by 4 px.")
    a, end = np.radians(np.arange(1, 96)), np.radians(120)
    exact = {"xtol": 1e-15, "ftol": 1e-15, "gtol": 1e-15}
    best = least_squares(lambda k: g(a, k) - 2 * np.tan(a / 2), np.zeros(4), **exact).x
    assert 0.005 < 300 * np.abs(g(a, best) - 2 * np.tan(a / 2)).max() < 0.01
    assert 300 * abs(g(end, best) - 2 * np.tan(end / 2)) == pytest.approx(4, abs=0.5)


@pytest.fixture(scope="module")
def corners():
    """The corners (10, 54, 2) of the ten boards, found in pictures taken through the lens of section 2."""
    k = Intrinsics(1024, 1024, *F, *C).within(640)
    cameras = [Camera(k, KannalaBrandt(*COEFFICIENTS), at) for at in around_board(10)]
    greys = [cv2.cvtColor(snapshot(textured_scene(), one), cv2.COLOR_RGB2GRAY) for one in cameras]
    flags = cv2.CALIB_CB_EXHAUSTIVE | cv2.CALIB_CB_ACCURACY
    return np.array([cv2.findChessboardCornersSB(grey, (9, 6), flags=flags)[1].reshape(54, 2) for grey in greys])


# The numbers of the questions ----------------------------------------------------------------------------------------


def test_question_ninety():
    says("at 90°: r/f is 1, 1.41, 1.57, 2 and infinity", "Nowhere: tan 90° is infinite.")
    says("Where does a ray land that comes in exactly from the side, 90° from the axis?")
    assert sorted(r(np.pi / 2) for r in RADIUS.values())[:4] == pytest.approx([1, 1.41, 1.57, 2], abs=5e-3)
    assert RADIUS["perspective"](np.pi / 2) > 1e15
    says("a picture 480 px wide ends 58° from the axis, and one ten times as wide at 86°")
    assert np.degrees(np.arctan([240 / 150, 2400 / 150])) == pytest.approx([58, 86], abs=0.5)


def test_question_window():
    says("the geometry is exact at every θ below the window's own 90°", "as straight as in the middle")
    line = np.stack([np.linspace(-2, 2, 50), np.full(50, 1.0), np.full(50, 1.5)], axis=-1)  # a joint of the terrace
    theta = np.arctan2(np.hypot(line[:, 0], line[:, 1]), line[:, 2])
    fisheye = theta[:, None] * line[:, :2] / np.hypot(line[:, 0], line[:, 1])[:, None]
    r = np.hypot(*fisheye.T)
    back = np.column_stack([fisheye * (np.sin(r) / r)[:, None], np.cos(r)]) @ cv2.Rodrigues(np.array([0, 1.05, 0]))[0]
    window = (back[:, :2] / back[:, 2:])[back[:, 2] > 0.1]
    bows = [np.linalg.svd(points - points.mean(axis=0))[1][1] for points in (window, fisheye)]
    assert bows[0] < 1e-9 < 1e-2 < bows[1]


def test_question_behind():
    says("A lens of 220° sees a point 100° from its axis", "x/z is −5.67", "On the left, at 80° from the axis.")
    x, _, z = ray(100)
    assert 100 < 220 / 2
    assert x / z == pytest.approx(-5.67, abs=5e-3)
    assert np.degrees(np.arctan(5.67)) == pytest.approx(80, abs=0.5)


@pytest.mark.thorough
def test_question_wide_lens(corners):
    says("The RMS error is 0.20 px.", "The fit is held by corners as far as 62° from the axis.")
    says("Eight degrees farther out the polynomial in tan θ has left the picture.")
    views = list(corners.astype(np.float32))
    rms, matrix, bend, *_ = cv2.calibrateCamera([np.float32(BOARD)] * 10, views, (640, 640), None, None)
    assert rms == pytest.approx(0.20, abs=5e-3)
    at_70 = cv2.projectPoints(ray(70)[None], np.zeros(3), np.zeros(3), matrix, bend)[0][0, 0, 0]
    assert at_70 < -0.5
    assert 100 < abs(at_70 - matrix[0, 2] - F[0] * 640 / 1024 * g(np.radians(70))) < 1000


def test_questions_designed():
    says("A perspective picture of 180° is infinitely wide. At 120° its edges are already stretched four times along")
    says("75° from the axis a degree already takes 15 times the room", "A ray 95° from the axis comes from behind")
    says("The lens of a doorbell sees 190° from edge to edge.")
    assert [stretch("perspective", np.radians(at))[0] for at in (60, 75)] == pytest.approx([4, 15], abs=0.5)
    assert ray(190 / 2)[2] < 0 < ray(89)[2]


def test_questions_solid():
    says("a cloud at 90° is drawn with four times the area of one overhead", "sin θ: the rim counts too much")
    says("a patch at the horizon gets 1.57 times", "A patch 60° from the axis gets 1.78 times the pixels")
    patches = area("stereographic", np.pi / 2), area("equidistant", np.pi / 2), area("stereographic", np.pi / 3)
    assert patches == pytest.approx((4, 1.57, 1.78), abs=5e-3)
    assert area("equisolid", 1.5) == pytest.approx(area("equisolid", 0.1))


def test_questions_coefficients():
    says("here about +1/3, since tan θ ≈ θ + θ³/3", "At 80° the angle is 1.40 and its tangent 5.67")
    assert (np.tan(0.01) - 0.01) / 0.01**3 == pytest.approx(1 / 3, rel=1e-3)
    assert [np.radians(80), np.tan(np.radians(80))] == pytest.approx([1.40, 5.67], abs=5e-3)


def test_questions_omni():
    says("the whole horizon is then 90° from its axis, and a lens of more than 180° sees it")
    says("the lens reaches 100° from its axis. There are 10° to spare", "Its owner buys one fisheye lens of 200°.")
    says("when it looks up or down and sees more than 180°", "if it looks straight up: the horizon is then 90°")
    around = np.linspace(0, 2 * np.pi, 73)
    level = np.stack([np.sin(around), 0 * around, np.cos(around)], axis=-1)  # y is down
    up, ahead = (np.degrees(np.arccos(level @ axis)) for axis in ([0, -1, 0], [0, 0, 1]))
    np.testing.assert_allclose(up, 90)
    assert 200 / 2 - up.max() == pytest.approx(10)
    assert ahead.max() > 200 / 2 > 180 / 2
