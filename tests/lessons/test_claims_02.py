"""What lesson 02 claims about lenses, recomputed with NumPy and SciPy from rays and triangles."""

import numpy as np
import pytest
from claims import claims
from scipy.optimize import brentq
from scipy.special import jn_zeros

from camviz import optics
from camviz_school.course.material import module

says = claims("02")
lesson02 = module("02")

AIRY = 2 * jn_zeros(1, 1)[0] / np.pi
"""The diameter of the first dark ring in λ v / D, from the first zero of J1."""
FULL_FRAME_MM = np.hypot(36, 24)


def image(f, u):
    """Where the ray through the middle, y = −x/u, meets the one parallel to the axis, y = 1 − x/f."""
    return 1 / (1 / f - 1 / u)


def blur(f, N, s, u):
    """How far apart the rays through both rims of the lens are at the sensor, from the lens's matrix."""
    lens, way = np.array([[1, 0], [-1 / f, 1]]), np.array([[1, image(f, s)], [0, 1]])
    ends = [(way @ lens @ [side * f / N / 2, side * f / N / 2 / u])[0] for side in (-1, 1)]
    return abs(ends[1] - ends[0])


def limits(f, N, s, c):
    """Near and far limit where the blur is c, by looking for them."""
    near = brentq(lambda u: blur(f, N, s, u) - c, 1.01 * f, s, xtol=1e-9)
    if blur(f, N, s, 1e12) < c:
        return np.array([near, np.inf])
    return np.array([near, brentq(lambda u: blur(f, N, s, u) - c, s, 1e12, xtol=1e-6)])


def hyperfocal(f, N, c):
    """The nearest focus for which infinity is blurred by no more than c."""
    return brentq(lambda s: blur(f, N, s, 1e12) - c, 2 * f, 1e9)


def circle_for(f, N, H):
    """The circle that gives a lens this hyperfocal distance."""
    return f**2 / (N * (H - f))


def airy_um(N, m=0.0):
    return AIRY * 0.55 * N * (1 + m)


def view_deg(width, v):
    return np.degrees(2 * np.arctan(width / (2 * v)))


def through(surfaces):
    """Height and slope behind the last surface of a ray parallel to the axis and of one from its middle: a matrix."""
    columns = []
    for height, slope in ((1.0, 0.0), (0.0, 1.0)):
        before = 1.0
        for i, (radius, distance, after) in enumerate(surfaces):
            slope = (before * (slope + height / radius) - after * height / radius) / after  # Snell's law, small angles
            height += slope * distance * (i < len(surfaces) - 1)
            before = after
        columns.append((height, slope))
    return np.array(columns).T


def test_the_image_by_hand_and_its_blur():
    says("Take f = 50 mm and a point 1 m in front of the lens:", "At u = 50 mm the image is infinitely far away")
    assert image(50, 1000) == pytest.approx(52.63, abs=5e-3)
    assert image(50, 50 + 1e-9) > 1e9
    says("Take a lens of f = 50 mm and N = 1.4, focused at s = 1.3 m. A globe is at u = 2.3 m:")
    assert blur(50, 1.4, 1300, 2300) == pytest.approx(0.621, abs=5e-4)


def test_from_half_of_h_to_infinity():
    says("1/1500 of the picture's diagonal is usual, 0.03 mm for full frame")
    assert pytest.approx(0.03, abs=0.005) == FULL_FRAME_MM / 1500
    says("focused on H, it is sharp enough from H/2 to infinity")
    H = hyperfocal(50, 8, 0.03)
    assert pytest.approx(10466.67, abs=0.01) == H
    assert blur(50, 8, H, H / 2) == pytest.approx(0.03)
    says("Take one lens by hand: 50 mm at f/8, focused at 3 m.")
    assert limits(50, 8, 3000, 0.03) == pytest.approx([2338, 4185], abs=0.5)


def test_the_depth_of_field_in_one_formula():
    says("twice the f-number is twice the depth, and twice the focal length is a quarter of it.")
    says("For 50 mm at f/8 the formula is 4 % too large at s = H/10, and 24 % too small at s = H/2.")
    H = hyperfocal(50, 8, 0.03)
    rule = [2 * 8 * 0.03 * s**2 / 50**2 for s in (H / 10, H / 2)]
    depth = [np.ptp(limits(50, 8, s, 0.03)) for s in (H / 10, H / 2)]
    assert 100 * (np.divide(rule, depth) - 1) == pytest.approx([4, -24], abs=0.5)
    base = np.ptp(limits(50, 2.8, 1500, 0.03))
    assert np.ptp(limits(50, 5.6, 1500, 0.03)) == pytest.approx(2 * base, rel=0.03)
    assert np.ptp(limits(100, 2.8, 1500, 0.03)) == pytest.approx(base / 4, rel=0.05)


def test_with_the_framing_held_the_depth_hardly_changes():
    says("As long as s is much smaller than H, far − near ≈ 2 N c s (s − f)/f². With s − f = f/m, f drops out:")
    says(r"$$\text{far}-\text{near}\approx 2\,N\,c\,\frac{1+m}{m^2}$$")
    N, c, m = 5.6, 0.03, 1 / 45
    depths = [np.ptp(limits(f, N, f * (1 + 1 / m), c)) for f in (35, 50, 100)]
    assert depths == pytest.approx([2 * N * c * (1 + m) / m**2] * 3, rel=0.05)
    assert np.ptp(limits(35, N, 2 * 35, c)) == pytest.approx(2 * N * c * 2, abs=5e-4)  # life size, m = 1
    says("nearly three times as much at 100 mm as at 35 mm")
    discs = [blur(f, N, f * (1 + 1 / m), 1e12) for f in (35, 100)]
    assert discs[1] / discs[0] == pytest.approx(3, rel=0.06)


def test_diffraction_grows_with_the_f_number():
    says("the radius is **1.22 λ N**, whatever the focal length", "the Airy disc, 2.44 λ N (1 + m)")
    assert pytest.approx(2.44, abs=5e-3) == AIRY
    says("A lens that is stopped down gains depth until the Airy disc is as wide as c.")
    assert airy_um(16) < 1000 * FULL_FRAME_MM / 1500 < airy_um(22)


def test_the_telephoto_is_shorter_than_its_focal_length():
    says("from its first surface to the image it is 444 mm long, and its focal length is 605 mm")
    surfaces = optics.TELEPHOTO.surfaces
    M = through(surfaces)
    assert -1 / M[1, 0] == pytest.approx(605, abs=0.5)
    assert sum(distance for _, distance, _ in surfaces[:-1]) - M[0, 0] / M[1, 0] == pytest.approx(444, abs=0.5)
    says("The triplet has the 50.0 mm that it was designed for.", "So for a lens in air f = −1/C.")
    assert -1 / through(optics.COOKE_TRIPLET.surfaces)[1, 0] == pytest.approx(50.0, abs=0.05)


def test_the_entrance_pupil_of_the_triplet():
    says("In the triplet the stop lies 10.3 mm behind the first surface.")
    says("it appears at 11.5 mm, and 1.32 times as wide. This width is the D in N = f/D.")
    says("the focal length divided by the diameter of the entrance pupil, the opening as seen from the front")
    surfaces = optics.COOKE_TRIPLET.surfaces[:4]
    assert sum(distance for _, distance, _ in surfaces[:-1]) == pytest.approx(10.3, abs=0.05)
    back = np.linalg.inv(through(surfaces))  # rays out of the stop's middle and from its rim, backwards
    height, slope = back @ [0.0, 0.1]
    rim = back @ [1.0, 0.0]
    assert -height / slope == pytest.approx(11.5, abs=0.05)
    assert rim[0] - rim[1] * height / slope == pytest.approx(1.32, abs=5e-3)


def test_a_phone_against_full_frame():
    says("a phone whose files say 5.7 mm, f/1.8, and 26 mm", "2.9 m, this phone is sharp enough from 1.4 m to infinity")
    c = FULL_FRAME_MM * 5.7 / 26 / 1500
    H = hyperfocal(5.7, 1.8, c)
    assert [H / 1000, limits(5.7, 1.8, H * (1 + 1e-9), c)[0] / 1000] == pytest.approx([2.9, 1.4], abs=0.05)
    says("A phone with 5.7 mm at f/1.8 has an aperture 3.2 mm wide.", "Its blur is about 4.6 times as large")
    assert pytest.approx([3.2, 14.4], abs=0.05) == [5.7 / 1.8, 26 / 1.8]
    phone, full = (blur(f, 1.8, 1000, 5000) / f for f in (5.7, 26))  # the sensors go with f
    assert full / phone == pytest.approx(4.6, rel=0.02)


def test_the_exercises_answers_are_camviz_s():
    rng = np.random.default_rng(5)
    for f, u in lesson02.IMAGE.cases(rng):
        np.testing.assert_allclose(lesson02.image_distance(f, u), optics.image_distance_mm(f, u))
    for width, f, s in lesson02.VIEW.cases(rng):
        wanted = optics.field_of_view_deg(width, optics.image_distance_mm(f, s))
        np.testing.assert_allclose(np.degrees(lesson02.field_of_view(width, f, s)), wanted)
    for f, N, s, u in lesson02.BLUR.cases(rng):
        np.testing.assert_allclose(lesson02.blur(f, N, s, u), optics.circle_of_confusion_mm(f, N, s, u), atol=1e-12)
    for f, N, s, c in lesson02.LIMITS.cases(rng):
        wanted = optics.near_limit_mm(f, N, s, c), optics.far_limit_mm(f, N, s, c)
        np.testing.assert_allclose(lesson02.limits(f, N, s, c), wanted)
    for (rows,) in lesson02.ELEMENTS.cases(rng):
        assert lesson02.effective_focal_length(rows) == pytest.approx(-1 / through(rows)[1, 0])


# The numbers of the questions ----------------------------------------------------------------------------------------


def test_question_zoom():
    says("you change from a 35 mm lens to a 100 mm lens", "still is, by the same ratio: a size in the picture is v·X/Z")
    globe, lamps = ([image(f, 1600) * size for f in (35, 100)] for size in (0.27 / 1.6, 0.33 / 3.0))
    assert globe[1] / globe[0] == pytest.approx(lamps[1] / lamps[0])


def test_question_refocus():
    says("A lens of 100 mm is focused as a whole", "first on the hills, then on something 0.8 m away")
    says(
        "the *sensor* is now 114 mm behind the lens instead of 100 mm", "it shrinks from 20.4° to 17.9° for a sensor 36"
    )
    v = image(100, 800)
    assert v == pytest.approx(114, abs=0.5)
    assert [view_deg(36, 100), view_deg(36, v)] == pytest.approx([20.4, 17.9], abs=0.05)


def test_question_stop():
    says("by 2.44 λ N, 30 µm at f/22 and 2.7 µm at f/2.", "At f/8 it is 11 µm across, two pixels of many cameras.")
    says("You close the aperture from f/2 to f/22", "at f/22 light is spread into an Airy disc 30 µm across")
    assert [airy_um(22), airy_um(8)] == pytest.approx([30, 11], abs=0.5)
    assert airy_um(2) == pytest.approx(2.7, abs=0.05)


def test_questions_hyperfocal():
    says("A lens has a hyperfocal distance of 10 m.", "At 10 m; then it is sharp enough from 5 m on.")
    says("everything beyond 10 m is blurred by more than c. And the near one is H/3, about 3.3 m")
    says("At 8 m: then it is sharp enough from 4 m on.", "And the near limit is 2.7 m.")
    says("On infinity; then it is sharp from 5 m on.", "At 5 m; then it is sharp enough from 2.5 m to infinity.")
    says("Focused at infinity it is sharp enough only from about 10 m on.", "everything beyond 8 m sharply enough")
    says("At 4 m: then it is sharp enough from 2 m to infinity.", "Then what lies between 4 m and 8 m is lost")
    says("Focused at 4 m, the lens shows things beyond 8 m with more blur than is allowed.")
    for H, near in ((10, 3.3), (8, 2.7)):
        c = circle_for(50, 4, 1000 * H)
        assert limits(50, 4, 1000 * H, c)[0] / 1000 == pytest.approx(H / 2, rel=0.01)
        assert limits(50, 4, 500 * H, c) / 1000 == pytest.approx([near, H], rel=0.02)
        assert brentq(lambda u, c=c: blur(50, 4, 1e12, u) - c, 1000, 1e6) / 1000 == pytest.approx(H, rel=0.01)


def test_questions_inside():
    says("The depth of field of a photograph reaches from 2 m to 3 m.", "What does that say about something at 2.9 m?")
    says("focused at 4 m, sharp from 3 m to 6 m. How sharp is a face at 5.5 m?")
    for near, far, at in ((2000, 3000, 2900), (3000, 6000, 5500)):
        focus = 2 * near * far / (near + far)
        c = blur(50, 4, focus, far)
        assert blur(50, 4, focus, near) == pytest.approx(c)
        assert 0.5 * c < blur(50, 4, focus, at) < c
    says("The usual 0.03 mm are about six pixels of a full-frame camera of 33 megapixels.")
    assert 0.03 / np.sqrt(36 * 24 / 33e6) == pytest.approx(6, abs=0.3)
    says("It allows a circle, often 0.03 mm wide, and that is 5 pixels of 6 µm.")
    assert 30 / 6 == 5


def test_questions_phone():
    says("Its aperture is 2.8 mm wide, the other's 14 mm.", "A phone would need f/0.35.")
    says("f = 5 mm and f/1.8, a full-frame camera 26 mm and f/1.8", "f = 9 mm at f/2, a large one f = 36 mm at f/2")
    assert pytest.approx(2.8, abs=0.05) == 5 / 1.8
    assert pytest.approx(14, abs=0.5) == 26 / 1.8
    assert pytest.approx(0.35, abs=5e-3) == 5 / (26 / 1.8)
    says("blur goes with the diameter f/N: five times less here")
    says("its aperture is 18 mm wide, the other's 4.5 mm", "here 4 times as much", "would need f/0.5 for the same")
    assert [36 / 2, 9 / 2, 9 / 18] == [18, 4.5, 0.5]
    for small, large, N, times in ((5, 26, 1.8, 5.2), (9, 36, 2, 4)):
        shares = [blur(f, N, 2000, 9000) / f for f in (small, large)]  # the sensors go with f
        assert shares[1] / shares[0] == pytest.approx(times, rel=0.03)
