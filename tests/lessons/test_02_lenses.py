"""What lesson 02 says about lenses, recomputed with NumPy and SciPy from rays and triangles."""

import numpy as np
import pytest
from scipy.optimize import brentq
from scipy.special import jn_zeros

from camviz import optics
from camviz.scenes.photographs import photograph
from camviz_school.course.material import module
from camviz_school.views.depth_of_field import LAMPLIT_FINE, DepthOfFieldView
from camviz_school.views.garland import GLOBE_Z
from camviz_school.views.lens_elements import LensElementsView

lesson02 = module("02")

EXCEPTIONS = {
    "United States patent 4,113,357": "the number of a patent",
    "The patent states 600 mm": "what the patent's inventors wrote",
}

GREEN_UM = 0.55
FIRST_DARK_RING = 2 * jn_zeros(1, 1)[0] / np.pi
"""Of the Airy pattern: its diameter in λ v / D, from the first zero of J1."""
FULL_FRAME = np.hypot(36, 24)


def image(f, u):
    """Where two rays from a point meet: one through the middle of the lens, one parallel to the axis, bent to F'."""
    if np.isinf(u):
        return f
    height = 1.0  # the point's; its rays are y = −x/u and y = 1 − x/f behind the lens
    return height / (height / f - height / u)


def blur(f, N, s, u):
    """How far apart the rays through both rims of the lens are at the sensor, from the lens's matrix."""
    lens, way = np.array([[1, 0], [-1 / f, 1]]), np.array([[1, image(f, s)], [0, 1]])
    ends = [(way @ lens @ [side * f / N / 2, side * f / N / 2 / u])[0] for side in (-1, 1)]
    return abs(ends[1] - ends[0])


def limits(f, N, s, c):
    """Where the blur is c, by looking for it."""
    near = brentq(lambda u: blur(f, N, s, u) - c, 1.01 * f, s, xtol=1e-9)
    if blur(f, N, s, 1e12) < c:
        return near, np.inf
    return near, brentq(lambda u: blur(f, N, s, u) - c, s, 1e12, xtol=1e-6)


def hyperfocal(f, N, c):
    """The nearest focus for which infinity is blurred by no more than c."""
    return brentq(lambda s: blur(f, N, s, 1e12) - c, 2 * f, 1e9)


def airy_um(N, m=0.0):
    return FIRST_DARK_RING * GREEN_UM * N * (1 + m)


def view_deg(width, v):
    return np.degrees(2 * np.arctan(width / (2 * v)))


def through(surfaces):
    """Height and slope of rays behind the last surface, one parallel to the axis and one from its middle: a matrix."""
    columns = []
    for height, slope in ((1.0, 0.0), (0.0, 1.0)):
        before = 1.0
        for i, (radius, distance, after) in enumerate(surfaces):
            # n₁ sin = n₂ sin for small angles, measured from the normal, which leans by height / radius
            slope = (before * (slope + height / radius) - after * height / radius) / after
            height += slope * distance * (i < len(surfaces) - 1)
            before = after
        columns.append((height, slope))
    return np.array(columns).T


# 1: all of the lens makes all of the picture -------------------------------------------------------------------------


def test_the_lens_before_the_lamps(says):
    (f,) = says("The [focal length](00_start_here.ipynb#focal-length) is 85 mm.")
    view = DepthOfFieldView.at_dusk()
    assert f == view.focal_mm
    (points,) = says("The picture is the sum of 224 pictures")
    assert points == view.samples_for(*LAMPLIT_FINE)
    assert points == view.but(focus_m=0.9).samples_for(*LAMPLIT_FINE)


def test_a_lamp_out_of_focus_is_a_large_heart(says):
    """The heart of a far lamp, focused at the left end of the first slider, is a tenth of the picture wide and more."""
    says("A card with a heart-shaped hole is in front of this lens.")
    view = DepthOfFieldView.at_dusk(focus_m=0.9)
    far = view.lens.blur_px(6.3 - GLOBE_Z + view.distance_m)
    assert 0.1 * view.lens.width < far < 0.2 * view.lens.width


def test_covering_half_the_lens_darkens_all_and_takes_nothing_away(says):
    says("Notice that the picture gets darker as a whole.")
    says("But nothing of it is missing.")
    says("All of it is there, half as bright.")
    view = DepthOfFieldView(f_number=4.0, focus_m=2.3)
    whole, half, heart = (
        v.image(64).astype(float) for v in (view, view.but(covered="left half"), view.but(aperture="heart"))
    )
    assert view.but(covered="left half").open_share == pytest.approx(0.5, abs=0.01)
    blocks = [one.reshape(12, 20, 16, 20, 3).mean(axis=(1, 3, 4)) for one in (whole, half, heart)]
    for covered in blocks[1:]:
        share = covered / blocks[0]
        assert share.max() < 1
        assert share.min() > 0.55  # of the bytes: half of the light is 0.73 of them, a block that is missing none


def test_out_of_focus_the_blur_of_half_a_lens_is_smaller(says):
    says("Out of focus the blur even becomes smaller, a half disc where a disc was.")
    one, rim = np.array([[1, 50], [0, 1]]) @ [[1, 0], [-1 / 50, 1]], 10.0
    whole = np.ptp([(one @ [y, y / 1000])[0] for y in np.linspace(-rim, rim, 9)])
    half = np.ptp([(one @ [y, y / 1000])[0] for y in np.linspace(0, rim, 9)])
    assert half == pytest.approx(whole / 2)


def test_in_front_of_the_focus_it_is_the_other_half(says):
    """Where rays through the right half of a lens meet the sensor, from points of the axis nearer and farther."""
    says("A lamp out of focus becomes half a disc. Lamps nearer than the focus show the other half.")

    def at_sensor(u):
        y = np.linspace(0, 30, 4)
        return y * (1 - image(85, 4500) / image(85, u))

    assert (at_sensor(2200) >= 0).all()
    assert (at_sensor(7500) <= 0).all()


# 2: blur -------------------------------------------------------------------------------------------------------------


def test_a_point_by_hand(says):
    f, u = says("Take f = 50 mm and a point 1 m in front of the lens:")
    assert image(f.value, 1000 * u.value) == pytest.approx(52.63, abs=0.005)
    focal, near = says(
        "a little behind the focal point at 50 mm, because the light from 1 m away still spreads a little"
    )
    assert focal == f.value
    assert near == u.value
    assert image(f.value, 1000 * near.value) > focal.value


def test_the_image_moves_away_and_then_is_virtual(says):
    (f,) = says("Here is your function beside camviz's, for a lens of 50 mm.")
    says("As the object comes nearer, its image moves away from the lens.")
    (pole,) = says("At u = 50 mm the image is infinitely far away")
    assert pole.value == f.value
    assert image(50, 60) > image(50, 100) > image(50, 1000)
    assert image(50, 50 + 1e-9) > 1e9
    assert image(50, 40) < 0


def test_the_blur_of_the_globe_by_hand(says):
    f, N, s, u = says("Take a lens of f = 50 mm and N = 1.4, focused at s = 1.3 m. A globe is at u = 2.3 m:")
    assert blur(f.value, N.value, 1000 * s.value, 1000 * u.value) == pytest.approx(0.621, abs=5e-4)
    view = DepthOfFieldView(f_number=N.value, focus_m=s.value)
    assert (view.focal_mm, view.distance_m) == (f.value, u.value)


def test_a_disc_s_variance(says):
    (points,) = says("by tracing rays from 64 points of the lens through the plane in focus")
    (parts,) = says("A disc of diameter D has the variance D²/16 along either axis.")
    y, x = np.mgrid[-1:1:401j, -1:1:401j]
    inside = x**2 + y**2 <= 1
    assert parts == 2**2 / np.var(x[inside])
    assert points.value == 64  # the cell asks for them


# 3: sharp enough -----------------------------------------------------------------------------------------------------


def test_the_usual_circle(says):
    share, c = says("1/1500 of the picture's diagonal is usual, 0.03 mm for full frame")
    assert c == FULL_FRAME / share.value


def test_from_half_of_h_to_infinity(says):
    says("Focus on H or beyond, and there is no far limit.")
    says("Focus on H, and everything from H/2 to infinity is sharp enough.")
    says("At the [hyperfocal distance](00_start_here.ipynb#hyperfocal-distance) H it reaches from H/2 to infinity.")
    says("focused on H, it is sharp enough from H/2 to infinity")
    f, N, s = says("Take one lens by hand: 50 mm at f/8, focused at 3 m.")
    near, far = limits(f.value, N.value, 1000 * s.value, 0.03)
    assert near == pytest.approx(2338, abs=0.5)
    assert far == pytest.approx(4185, abs=0.5)
    f, N = says("Here are your limits over all focus distances, for 50 mm at f/8:")
    assert (f.value, N.value) == (50, 8)
    H = hyperfocal(50, 8, 0.03)
    assert pytest.approx(10466.67, abs=0.01) == H
    assert blur(50, 8, H, 1e12) == pytest.approx(0.03)
    assert blur(50, 8, H, H / 2) == pytest.approx(0.03)
    near, far = limits(50, 8, H / 2, 0.03)
    assert near == pytest.approx(3494.48, abs=0.01)
    assert far == pytest.approx(10416.67, abs=0.01)


def test_more_of_the_depth_lies_behind_the_focus(says):
    says("Notice that more of the green band lies behind the focus than in front of it.")
    near, far = limits(35, 5.6, 3000, FULL_FRAME / 1500)
    assert far - 3000 > 2 * (3000 - near)
    says("The blur grows faster towards the lens, so the far limit is the farther one.")


def test_a_smaller_sensor_has_less_depth_of_field_with_the_same_lens(says):
    says("Less is in the picture, and the band becomes narrower")
    full, small = (np.diff(limits(35, 5.6, 3000, width / 36 * 0.03))[0] for width in (36, 17.3))
    assert small < full


def test_the_depth_of_field_in_one_formula(says):
    says(
        "twice the f-number is twice the depth, and twice the focal length is a quarter of it. "
        "Twice as far away is four times the depth."
    )
    H = hyperfocal(50, 8, 0.03)

    def depth(f, N, s):
        return np.diff(limits(f, N, s, 0.03))[0]

    base = depth(50, 2.8, 1500)
    assert depth(50, 5.6, 1500) == pytest.approx(2 * base, rel=0.03)
    assert depth(100, 2.8, 1500) == pytest.approx(base / 4, rel=0.05)
    assert depth(50, 2.8, 3000) == pytest.approx(4 * base, rel=0.05)
    f, N, over, tenth, under = says(
        "For 50 mm at f/8 the formula is 4 % too large at s = H/10, and 24 % too small at s = H/2."
    )
    rule = [2 * N.value * 0.03 * s**2 / f.value**2 for s in (H / tenth.value, H / 2)]
    assert over == 100 * (rule[0] / depth(f.value, N.value, H / tenth.value) - 1)
    assert under == 100 * (1 - rule[1] / depth(f.value, N.value, H / 2))


def test_the_airy_disc_on_the_sensor(says):
    radii = says("so the disc's radius is 1.22 λ v/D") + says("the radius is **1.22 λ N**, whatever the focal length")
    radii += says("the radius is 1.22 λ N (1 + m)")
    assert all(one == FIRST_DARK_RING / 2 for one in radii)
    (diameter,) = says("until the Airy disc, 2.44 λ N (1 + m), is wider than the pixels or the circle")
    assert diameter == FIRST_DARK_RING
    says("There v = f (1 + m)")
    assert image(100, 500) == pytest.approx(100 * (1 + image(100, 500) / 500))


def test_diffraction_in_the_question_about_stopping_down(says):
    closed, spread = says("at f/22 light is spread into an Airy disc 30 µm across")
    assert spread == airy_um(closed.value)
    says("as wide as the circle of confusion that is usually allowed")
    assert spread.value / 1000 == pytest.approx(0.03)
    constant, wide, number, narrow = says("by 2.44 λ N, 30 µm at f/22 and 2.7 µm at f/2.")
    assert constant == FIRST_DARK_RING
    assert wide == airy_um(number.value)
    assert narrow == airy_um(2)
    number, across = says("At f/8 it is 11 µm across, two pixels of many cameras.")
    assert across == airy_um(number.value)
    (closed,) = says("You close the aperture from f/2 to f/22")
    says("Notice that the blue curve sinks while the purple line rises.")
    assert blur(50, closed.value, 3000, 4000) < blur(50, 2, 3000, 4000)


def test_a_lens_stopped_down_until_nothing_is_sharp_enough(says):
    says("A lens that is stopped down gains depth until the Airy disc is as wide as c.")
    assert airy_um(16) < 1000 * FULL_FRAME / 1500 < airy_um(22)


# 4: focusing near ----------------------------------------------------------------------------------------------------


def test_refocusing_a_lens_that_moves_as_a_whole(says):
    f, s = says(
        "A lens of 100 mm is focused as a whole, by changing its distance from the sensor: first on the hills, then on "
        "something 0.8 m away."
    )
    near, infinity, wide, narrow, width = says(
        "But the sensor is now 114 mm behind the lens instead of 100 mm, and the field of view goes with that distance:"
        " it shrinks from 20.4° to 17.9° for a sensor 36 mm wide."
    )
    v = image(f.value, 1000 * s.value)
    assert near == v
    assert infinity == image(f.value, np.inf)
    assert wide == view_deg(width.value, f.value)
    assert narrow == view_deg(width.value, v)
    (again,) = says("Yes: the sensor is v = 114 mm behind the lens now")
    assert again == v
    says("At s = 2f the sensor stands at 2f: a life-size picture.")
    assert image(100, 200) == pytest.approx(200)


def test_what_else_changes_with_the_focus(says):
    (f,) = says("Here is the lens of 100 mm, with its exposure fixed:")
    far, near = says("Drag focus s from 10 m to 0.8 m")
    m = [image(f.value, 1000 * s.value) / (1000 * s.value) for s in (far, near)]
    small, large = says("it grows from 5.4 µm to 6.1 µm, with v")
    assert small == airy_um(4, m[0])
    assert large == airy_um(4, m[1])
    bright, dark = says("it falls from 98 % to 77 %, because it goes with 1/v²")
    assert bright == 100 / (1 + m[0]) ** 2
    assert dark == 100 / (1 + m[1]) ** 2
    shown = DepthOfFieldView(focal_mm=100, f_number=4, focus_m=near.value, match_exposure=False).numbers()
    assert shown["Airy disc"] == "6.1 µm across"
    assert shown["light"].startswith("77 %")


def test_internal_focusing_can_widen_the_view(says):
    """A telephoto of two thin groups with a fixed sensor, the stop at the front and the rear group moved to focus."""
    says("Such a lens may breathe more, less, or the other way round: some see a wider field when focused near.")

    def focused(length, rear, d, front):
        """Distance in focus, and the image's height for a ray of slope 1 through the middle of the front group."""
        meets = d + 1 / (1 / (length - d) - 1 / rear)  # from where the rear group takes its light, behind the front
        subject = np.inf if abs(meets - front) < 1e-9 else 1 / (1 / front - 1 / meets)
        return subject, d + (length - d) * (1 - d / rear)

    def near_over_far(d, step, rear):
        front = d + 1 / (1 / (100 - d) - 1 / rear)  # focused at infinity with the rear group at d
        (infinity, far), (subject, near) = (focused(100, rear, at, front) for at in (d, d + step))
        assert np.isinf(infinity)
        assert 500 < subject < 20_000
        return near / far  # above 1 the picture grows, and the view narrows

    assert near_over_far(60, 3, -50.0) < 0.995
    assert near_over_far(30, 3, -50.0) > 1.005


def test_what_the_usual_formula_leaves_out(says):
    f, width = says("Look at what it says about a lens of 100 mm and a sensor 36 mm wide:")
    near, far = (view_deg(width.value, image(f.value, s)) for s in (150, 10_000))
    assert near < 0.4 * far < far < view_deg(width.value, f.value)


# 5: perspective and what is held -------------------------------------------------------------------------------------


def test_a_change_of_lens_enlarges_all_alike(says):
    short, long = says("you change from a 35 mm lens to a 100 mm lens")
    says("From one place the ratio is the same with every lens.")
    says("Twice the distance changes the ratio, with any lens.")

    def sizes(f, Z):
        return np.array([image(f, 1000 * Z) * 2 * r / z for r, z in ((0.27, Z), (0.33, Z + 1.4))])

    growth = sizes(long.value, 1.6) / sizes(short.value, 1.6)
    assert growth[0] == pytest.approx(growth[1])
    ratios = [np.divide(*sizes(f, Z)[::-1]) for f, Z in ((35, 1.6), (70, 1.6), (70, 3.2))]
    np.testing.assert_allclose(ratios, [0.652, 0.652, 0.850], atol=5e-4)


def test_with_the_diameter_held_the_blur_on_the_scene_stays(says):
    says("with D held, the blur relative to the scene does not change")
    says("The bush grows on the sensor, and so does its blur.")
    says("measured on the scene, the disc is D |u − s|/u wide")
    for f in (20, 35, 70, 100):
        m = image(f, 1600) / 1600
        assert blur(f, f / 6.25, 1600, 3000) / m == pytest.approx(6.25 * (3000 - 1600) / 3000)
    blurs, bushes = np.array([(blur(f, f / 6.25, 1600, 3000), image(f, 1600) * 0.66 / 3.0) for f in (35, 70)]).T
    assert bushes[1] > bushes[0]
    assert blurs[1] / blurs[0] == pytest.approx(bushes[1] / bushes[0])
    view = DepthOfFieldView(focal_mm=35, f_number=5.6, distance_m=1.6, focus_m=1.6, hold="diameter")
    for f in (20.0, 100.0):  # the controls' ends: the opening is really held there
        assert view.but(focal_mm=f).lens.aperture_mm == pytest.approx(view.lens.aperture_mm)


def test_with_the_framing_held_the_depth_of_field_hardly_changes(says):
    says("At equal framing and the same f-number the depth of field is nearly the same with every lens")
    says("Notice that the bush and the picture of the cat grow behind it.")
    walked = [image(f, f * (1 + 45)) / (f * (1 + 45) + 1400) for f in (35, 100)]  # of what is 1.4 m behind the globe
    assert walked[1] > 1.2 * walked[0]
    says("As long as s is much smaller than H, far − near ≈ 2 N c s (s − f)/f².")
    N, c, m = 5.6, 0.03, 1 / 45

    def rule(m):  # of the formula under it
        return 2 * N * c * (1 + m) / m**2

    depths = [np.diff(limits(f, N, f * (1 + 1 / m), c))[0] for f in (35, 50, 100)]
    life_size = np.diff(limits(35, N, 2 * 35, c))[0]
    assert life_size == pytest.approx(rule(1), abs=5e-4) == pytest.approx(0.672)
    np.testing.assert_allclose(depths, [730, 712, 700], atol=0.5)  # as cell 37 prints
    assert max(depths) / min(depths) < 1.05
    np.testing.assert_allclose(depths, rule(m), rtol=0.05)
    long, short = says("nearly three times as much at 100 mm as at 35 mm")
    discs = [blur(f.value, 5.6, f.value * (1 + 1 / m), 1e12) for f in (short, long)]
    assert discs[1] / discs[0] == pytest.approx(3, rel=0.06)
    assert discs[0] == pytest.approx(short.value * m / 5.6)


# 6: what is behind the thin lens -------------------------------------------------------------------------------------


def test_the_telephoto_lens(says):
    long, f = says("from its first surface to the image it is 444 mm long, and its focal length is 605 mm")
    surfaces = optics.TELEPHOTO.surfaces
    M = through(surfaces)
    assert f == -1 / M[1, 0]
    glass = sum(distance for _, distance, _ in surfaces[:-1])
    assert long == glass - M[0, 0] / M[1, 0]
    says("in the air, far in front of the glass")
    behind_the_first = glass - M[0, 0] / M[1, 0] + 1 / M[1, 0]
    assert behind_the_first == pytest.approx(-160.6, abs=0.05)
    assert (M[1, 1] - 1) / M[1, 0] == pytest.approx(-326.0, abs=0.05)
    assert "600" in LensElementsView(lens="telephoto").description()


def test_the_entrance_pupil_of_the_triplet(says):
    """By rays out of the middle of the stop and from its rim, through the two elements in front of it, backwards."""
    stop, pupil, wider = says(
        "In the triplet the stop lies 10.3 mm behind the first surface. Seen through the two elements in front of it, "
        "it appears at 11.5 mm, and 1.32 times as wide. This width is the D in N = f/D."
    )
    surfaces = optics.COOKE_TRIPLET.surfaces[:4]
    assert stop == sum(distance for _, distance, _ in surfaces[:-1])
    back = np.linalg.inv(through(surfaces))
    height, slope = back @ [0.0, 0.1]
    assert pupil == -height / slope
    rim = back @ [1.0, 0.0]
    assert wider == rim[0] + rim[1] * pupil.value


def test_the_telecentric_lens(says):
    f, s, behind, tall = says(
        "Compare a thin lens of 50 mm, focused at 200 mm, with its stop at the lens and with its stop at 50 mm behind "
        "it. It looks at a thing of 30 mm:"
    )
    sensor = image(f.value, s.value)
    lens = np.array([[1, 0], [-1 / f.value, 1]])

    def at_sensor(u, stop):
        """Where the ray from `tall` above the axis at u, through the middle of the stop, meets the sensor."""
        to_stop = np.array([[1, stop], [0, 1]]) @ lens @ [[1, u], [0, 1]]
        slope = -to_stop[0, 0] * tall.value / to_stop[0, 1]
        return (np.array([[1, sensor], [0, 1]]) @ lens @ [[1, u], [0, 1]] @ [tall.value, slope])[0]

    step, error = says(
        "A step of 10 mm makes an error of 5 % with the ordinary lens and none with the telecentric one."
    )
    ordinary, telecentric = (
        [at_sensor(u, stop) for u in (s.value, s.value - step.value)] for stop in (0.0, behind.value)
    )
    assert error == 100 * (ordinary[1] / ordinary[0] - 1)
    assert telecentric[1] == pytest.approx(telecentric[0])
    assert telecentric[0] == pytest.approx(ordinary[0])


def test_a_tilted_lens(says):
    """Points of a tilted sensor, each taken back through the lens, lie in one tilted plane."""
    f, metres, v, ratio, tilt, tilted = says(
        "For f = 50 mm and u = 2 m, v is 51.3 mm and u/v is 39: tilt the lens by 1°, and the plane in focus tilts by "
        "34°."
    )
    u, at = 1000 * metres.value, image(f.value, 1000 * metres.value)
    assert v == at
    assert ratio == u / at

    def in_focus(tau, at, heights):
        z = at + heights * np.tan(np.radians(tau))
        away = np.array([image(f.value, one) for one in z])  # the equation is its own inverse
        return away, -heights * away / z

    z, y = in_focus(tilt.value, at, np.array([-5.0, 0.0, 5.0]))
    slopes = np.diff(z) / np.diff(y)
    assert slopes[0] == pytest.approx(slopes[1])
    assert tilted == np.degrees(np.arctan(abs(slopes[0])))
    assert abs(z[1] / slopes[0]) == pytest.approx(at / np.tan(np.radians(tilt.value)))  # one line with the sensor
    height, again, angle = says("From a height of 1.25 m this takes v/tan τ = 1250 mm, a tilt of 2.3°.")
    assert again == 1000 * height.value
    assert angle == np.degrees(np.arctan(f.value / again.value))


def test_rounded_indices_change_the_focal_length(says):
    (change,) = says("Our table has its indices to three decimals, and rounding them may change f by up to 8 mm.")
    table, total = np.array(optics.TELEPHOTO.surfaces), 0.0
    for row in np.flatnonzero(table[:, 2] != 1):
        rounded = table.copy()
        rounded[row, 2] += 0.0005
        total += abs(1 / through(rounded)[1, 0] - 1 / through(table)[1, 0])
    assert change == total
    assert abs(-1 / through(table)[1, 0] - 600) < total
    (across, down) = says("Near the axis every surface acts on (y, y′) as a 2 × 2 matrix.")
    assert (across.value, down.value) == through(table).shape


def test_the_triplet(says):
    (f,) = says("The triplet has the 50.0 mm that it was designed for.")
    assert f == -1 / through(optics.COOKE_TRIPLET.surfaces)[1, 0]
    (again,) = says("50 mm is what the triplet in this lesson has.")
    assert again == f.value
    assert lesson02.effective_focal_length(np.array(optics.COOKE_TRIPLET.surfaces)) == pytest.approx(50, abs=1e-3)


def test_the_way_behind_the_last_surface_leaves_c_alone(says):
    says("The way behind the last surface changes A and B, but not C and D.")
    M = through(optics.TELEPHOTO.surfaces)
    changed = np.array([[1, 7.0], [0, 1]]) @ M
    assert (changed[0] != M[0]).all()
    assert (changed[1] == M[1]).all()


def test_between_its_principal_planes_a_thick_lens_is_thin(says):
    says("With these two planes for its front and back, the thin-lens equation is exact for small angles.")
    M = through(optics.COOKE_TRIPLET.surfaces)
    f, first, last = -1 / M[1, 0], (M[1, 1] - 1) / M[1, 0], (1 - M[0, 0]) / M[1, 0]
    u = 700.0  # before the first principal plane; `first` lies behind the first surface, `last` behind the last one
    ways = [np.array([[1, way], [0, 1]]) for way in (u - first, image(f, u) + last)]
    whole = ways[1] @ M @ ways[0]
    assert whole[0, 1] == pytest.approx(0, abs=1e-9)  # all rays from the point meet again


def test_the_signs_of_c(says):
    numbers = [
        *says("So for a lens in air f = −1/C."),
        *says("so f = −1/C"),
        *says("This is C itself, and with its sign. The focal length is −1/C."),
    ]
    numbers += says("−A/C. The focal length is −1/C, counted from a principal plane")
    C = through(optics.COOKE_TRIPLET.surfaces)[1, 0]
    assert C < 0
    assert all(one.value / C == pytest.approx(50, abs=1e-3) for one in numbers)


def test_a_diverging_lens_has_a_negative_focal_length(says):
    """A thin biconcave lens of n = 1.5 and radii of 100 mm: 1/f = (n − 1)(1/R₁ − 1/R₂)."""
    (numerator,) = says("A lens that makes it diverge has a negative focal length: keep the sign of −1/C.")
    bent = np.eye(2)
    for radius, before, behind in ((-100.0, 1.0, 1.5), (100.0, 1.5, 1.0)):
        bent = np.array([[1, 0], [(before - behind) / (radius * behind), before / behind]]) @ bent
    assert numerator.value / bent[1, 0] == pytest.approx(1 / (0.5 * (-1 / 100 - 1 / 100)))
    assert numerator.value / bent[1, 0] < 0


def test_the_small_numbers_of_the_exercises(says):
    (half,) = says("The triangle has half the sensor's width for its side: width / 2.")
    assert view_deg(36.0, 50.0) == pytest.approx(2 * np.degrees(np.arctan(36.0 / half.value / 50)))
    (factor,) = says("It is the diameter of the disc that is allowed: H = f²/(N c) + f, without a 2.")
    assert lesson02.limits(50, 8, np.array(2000.0), factor.value * 0.03)[0] == pytest.approx(
        limits(50, 8, 2000.0, 0.06)[0]
    )
    (columns,) = says("an array (n, 3) whose rows are radius, distance to the next surface, and refractive index")
    assert columns == np.shape(optics.TELEPHOTO.surfaces)[1]
    says("An object at infinity has its image at f, and one at 2f has it at 2f. One inside f has a virtual image.")
    assert image(50, np.inf) == 50
    assert image(50, 100) == pytest.approx(100)
    assert image(50, 30) < 0


def test_the_exercises_answers_are_those_of_camviz_s_optics():
    rng = np.random.default_rng(5)
    for f, u in lesson02.IMAGE.cases(rng):
        np.testing.assert_allclose(lesson02.image_distance(f, u), optics.image_distance_mm(f, u))
    for width, f, s in lesson02.VIEW.cases(rng):
        wanted = optics.field_of_view_deg(width, optics.image_distance_mm(f, s))
        np.testing.assert_allclose(np.degrees(lesson02.field_of_view(width, f, s)), wanted)
    for f, N, s, u in lesson02.BLUR.cases(rng):
        np.testing.assert_allclose(lesson02.blur(f, N, s, u), optics.circle_of_confusion_mm(f, N, s, u), atol=1e-12)
    for f, N, s, c in lesson02.LIMITS.cases(rng):
        near, far = lesson02.limits(f, N, s, c)
        np.testing.assert_allclose(near, optics.near_limit_mm(f, N, s, c))
        np.testing.assert_allclose(far, optics.far_limit_mm(f, N, s, c))
    for (rows,) in lesson02.ELEMENTS.cases(rng):
        wanted = optics.Prescription("", tuple(map(tuple, rows))).focal_mm
        assert lesson02.effective_focal_length(rows) == pytest.approx(wanted)


# 8: real data --------------------------------------------------------------------------------------------------------


def test_the_table_under_the_coffee(says):
    """Against the spectrum itself: the share of the grain's power in details up to about three pixels wide."""
    says("In front on the left it is sharp; behind the cup it has lost its fine detail.")

    def fine(patch):
        grey = patch.astype(float).mean(axis=-1)
        power = np.abs(np.fft.fft2((grey - grey.mean()) * np.outer(np.hanning(60), np.hanning(60)))) ** 2
        frequency = np.hypot(*np.meshgrid(np.fft.fftfreq(60), np.fft.fftfreq(60)))
        return power[frequency > 0.15].sum() / power[(frequency > 0.03) & (frequency < 0.1)].sum()

    picture = photograph("coffee")
    assert fine(picture[235:295, :60]) > 2 * fine(picture[65:125, :60])


def test_two_bands_of_detail(says):
    says("divide the detail that is one or two pixels wide by the detail that is about six pixels wide")
    frequency = np.linspace(1e-3, 0.5, 5000)

    def passed(sigma):
        return np.exp(-2 * (np.pi * sigma * frequency) ** 2)

    coarse = passed(2.0) - passed(4.0)
    assert 1 / frequency[coarse.argmax()] / 2 == pytest.approx(6, abs=0.7)  # light and dark are half a period each
    half = frequency[np.argmax(1 - passed(1.0) > 0.5)]
    assert 2 < 1 / half / 2 < 3


def test_the_phone(says):
    f, number, equivalent = says("a phone whose files say 5.7 mm, f/1.8, and 26 mm")
    c = FULL_FRAME * f.value / equivalent.value / 1500
    H = hyperfocal(f.value, number.value, c)
    at, near, wide = says("2.9 m, this phone is sharp enough from 1.4 m to infinity: its aperture is only 3.2 mm wide")
    assert at == H / 1000
    assert near == limits(f.value, number.value, H * (1 + 1e-9), c)[0] / 1000
    assert wide == f.value / number.value


def test_the_phone_against_full_frame(says):
    (s,) = says("Both are focused at 1 m, and each blur is divided by its own sensor's diagonal")
    large, small, times = says(
        "The full-frame camera's blur is larger by nearly the ratio of the apertures, 14.4 mm to 3.2 mm: about 4.6 "
        "times."
    )
    assert large == 26 / 1.8
    assert small == 5.7 / 1.8
    shares = [
        blur(f, 1.8, 1000 * s.value, 5000) / wide for f, wide in ((5.7, FULL_FRAME * 5.7 / 26), (26.0, FULL_FRAME))
    ]
    assert times.about(shares[1] / shares[0], 0.02)


def test_the_phone_in_the_core(says):
    f, number, small, full, again, large, times = says(
        "A phone with 5.7 mm at f/1.8 has an aperture 3.2 mm wide. A full-frame camera with the same view has 26 mm at "
        "f/1.8, and 14.4 mm. Its blur is about 4.6 times as large a part of the picture"
    )
    assert small == f.value / number.value
    assert large == full.value / again.value
    shares = [blur(one.value, 1.8, 1000, 5000) / one.value for one in (f, full)]  # the sensors go with f
    assert times.about(shares[1] / shares[0], 0.02)


# The quiz ------------------------------------------------------------------------------------------------------------


def test_the_quiz_about_the_hyperfocal_distance(says):
    (H,) = says("A lens has a hyperfocal distance of 10 m.")
    f, N = 50.0, 4.0
    c = f**2 / (N * (1000 * H.value - f))
    assert hyperfocal(f, N, c) == pytest.approx(1000 * H.value)
    infinity = brentq(lambda u: blur(f, N, 1e12, u) - c, 1000, 1e6) / 1000
    from_, at = says("Focused at infinity it is sharp enough only from about 10 m on. Focused nearer, at 10 m")
    assert from_.about(infinity, 0.01)
    assert at == H.value
    at, near = says("At 10 m; then it is sharp enough from 5 m on.")
    assert near == limits(f, N, 1001 * at.value, c)[0] / 1000
    (wrong,) = says("On infinity; then it is sharp from 5 m on.")
    assert abs(wrong.value - infinity) > 1
    at, wrong = says("At 5 m; then it is sharp enough from 2.5 m to infinity.")
    near, far = limits(f, N, 1000 * at.value, c)
    assert abs(wrong.value - near / 1000) > 0.5
    beyond, third, metres = says(
        "everything beyond 10 m is blurred by more than c. And the near one is H/3, about 3.3 m"
    )
    assert beyond == far / 1000
    assert metres.about(near / 1000, 0.02)
    assert third.about(H.value * 1000 / near, 0.02)


def test_the_quiz_about_what_lies_within(says):
    near, far = says("The depth of field of a photograph reaches from 2 m to 3 m.")
    (at,) = says("What does that say about something at 2.9 m?")
    f, N = 50.0, 4.0
    focus = 2 * near.value * far.value / (near.value + far.value)  # 1/s is halfway, near enough for f << s
    c = blur(f, N, 1000 * focus, 1000 * far.value)
    assert blur(f, N, 1000 * focus, 1000 * near.value) == pytest.approx(c)
    assert 0.5 * c < blur(f, N, 1000 * focus, 1000 * at.value) < c
    circle, megapixels = says("The usual 0.03 mm are about six pixels of a full-frame camera of 33 megapixels.")
    pitch = np.sqrt(36 * 24 / (megapixels.value * 1e6))
    assert circle.value / pitch == pytest.approx(6, abs=0.3)


def test_the_quiz_about_the_phone(says):
    f, N, full, again = says("A phone's lens has f = 5 mm and f/1.8, a full-frame camera 26 mm and f/1.8")
    assert again == N.value
    small, large = says("Its aperture is 2.8 mm wide, the other's 14 mm.")
    assert small == f.value / N.value
    assert large == full.value / N.value
    (needed,) = says("A phone would need f/0.35.")
    assert needed == f.value / (full.value / N.value)
    says("blur goes with the diameter f/N: five times less here")
    shares = [blur(one.value, N.value, 1000, 5000) / one.value for one in (f, full)]  # the sensors go with f
    assert shares[1] / shares[0] == pytest.approx(5.2, rel=0.03)
    says("the cone of light that it takes from a point of the scene is five times as slender")


# Before the lesson ---------------------------------------------------------------------------------------------------


def test_before_the_lesson_where_to_focus(says):
    (H,) = says("Focused at infinity, a lens shows everything beyond 8 m sharply enough.")
    f, N = 50.0, 4.0
    c = f**2 / (N * (1000 * H.value - f))
    infinity = brentq(lambda u: blur(f, N, 1e12, u) - c, 1000, 1e6) / 1000
    assert H.about(infinity, 0.01)
    at, near = says("At 8 m: then it is sharp enough from 4 m on.")
    assert at == H.value
    assert near == limits(f, N, 1001 * at.value, c)[0] / 1000
    at, wrong = says("At 4 m: then it is sharp enough from 2 m to infinity.")
    again, beyond = says("Focused at 4 m, the lens shows things beyond 8 m with more blur than is allowed.")
    assert again == at.value
    near_limit, far_limit = limits(f, N, 1000 * at.value, c)
    assert beyond == far_limit / 1000
    (true,) = says("And the near limit is 2.7 m.")
    assert true == near_limit / 1000
    assert wrong.value < true.value
    gained, end = says("Then what lies between 4 m and 8 m is lost for nothing.")
    (nearest,) = says("Infinity stays sharp enough when the focus comes nearer, as far as 8 m.")
    assert gained == near.value
    assert end == H.value
    assert nearest == H.value
    assert blur(f, N, 1000 * H.value, 1e12) == pytest.approx(c, rel=0.01)


def test_before_the_lesson_what_an_app_promises(says):
    focus, near, far = says("An app says of your lens: focused at 4 m, sharp from 3 m to 6 m.")
    (face,) = says("How sharp is a face at 5.5 m?")
    f, N = 50.0, 4.0
    c = blur(f, N, 1000 * focus.value, 1000 * far.value)
    assert blur(f, N, 1000 * focus.value, 1000 * near.value) == pytest.approx(c)
    assert 0 < blur(f, N, 1000 * focus.value, 1000 * face.value) < c
    from_, limit = says("From 4 m on the blur grows all the way, and at 6 m it passes a limit that somebody chose.")
    assert limit == far.value
    for (one,) in (says("As sharp as a face at 4 m."), says("Less sharp than a face at 4 m"), [from_]):
        assert one == focus.value
    circle, pixels, pitch = says("It allows a circle, often 0.03 mm wide, and that is 5 pixels of 6 µm.")
    assert pixels == circle.value * 1000 / pitch.value


def test_before_the_lesson_whose_background_is_more_blurred(says):
    small, large = says("A small camera has f = 9 mm at f/2, a large one f = 36 mm at f/2.")
    wide, narrow = says("The large one's: its aperture is 18 mm wide, the other's 4.5 mm.")
    assert wide == large.value / 2
    assert narrow == small.value / 2
    says("f/2 puts equally much light on both sensors.")
    assert wide.value / large.value == narrow.value / small.value  # the cone of light has one angle
    (needed,) = says("The small camera would need f/0.5 for the same background.")
    assert needed == small.value / wide.value
    (times,) = says("as a share of the picture, blur goes with the aperture's width: here 4 times as much")
    shares = [blur(one.value, 2, 2000, 9000) / one.value for one in (small, large)]  # the sensors go with f
    assert times.about(shares[1] / shares[0], 0.02)


def test_before_the_lesson_light_near_the_rim_arrives_too(says):
    says("To the same point of the paper as the light through the middle.")
    assert blur(50.0, 1.0, 2000.0, 2000.0) == pytest.approx(0, abs=1e-12)  # both rims, and so all between them


def test_the_limits_that_a_teacher_draws_on_the_board(says):
    f, N, *drawn, no_limit = says(
        "draw near and far limits of 50 mm at f/8 on the board, both over the focus distance: 2.3 m and 4.2 m for 3 m, "
        "3.4 m and 9.5 m for 5 m. From 10.5 m on there is no far limit."
    )
    for near, far, s in (drawn[:3], drawn[3:]):
        found = limits(f.value, N.value, 1000 * s.value, 0.03)
        assert near == found[0] / 1000
        assert far == found[1] / 1000
    assert no_limit == hyperfocal(f.value, N.value, 0.03) / 1000
    by_hand, away = says("Do one point by hand on the board, 50 mm and 1 m.")
    assert image(by_hand.value, 1000 * away.value) == pytest.approx(52.63, abs=5e-3)  # as the lesson's cell prints it
