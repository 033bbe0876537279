"""What lesson 11 says about slopes, refocusing and its range, and what it costs, recomputed with NumPy and SciPy."""

import re

import numpy as np
import pytest
from quoting import LESSONS
from scipy.ndimage import shift

from camviz.lightfields import LightField, from_microlens_image, to_microlens_image
from camviz_school.course import notebooks
from camviz_school.course.exercises import exercise
from camviz_school.course.material import module
from camviz_school.views.garden_field import FENCE_DISTANCE
from camviz_school.views.light_field import LightFieldView

lesson11 = module("11")

LESSON = notebooks.read(LESSONS / "11_light_field.ipynb")

EXCEPTIONS: dict[str, str] = {}

F = 80 / np.tan(np.radians(19))  # 160 pixels over 38°, as the garden's camera has them
B, Z_F, PLACES = 0.056, 4.0, 9


def slope(z, b=B, f=F, z_f=Z_F):
    """From the images of one point in two parallel cameras, less those of a point in focus."""
    images = [f * (0 - place) / z - f * (0 - place) / z_f for place in (0.0, b)]
    return images[0] - images[1]


def depth(d, b=B, f=F, z_f=Z_F):
    return 1 / (d / (b * f) + 1 / z_f)


# The lens and its views ----------------------------------------------------------------------------------------------


def test_the_views_of_the_lens(says):
    says("The virtual camera has a lens half a metre wide today")
    assert abs(PLACES * B - 0.5) < 0.01
    (millimetres,) = says("So far every view came through a pinhole, 56 mm from the next")
    assert millimetres == 1000 * B
    (views,) = says("Pinhole shows one of the 81 views")
    (directions,) = says("What is spent on 81 directions is not there for places.")
    (agree,) = says("keep the one at which the 81 views agree best")
    assert views == PLACES**2
    assert directions == agree.value == views.value


def test_the_sensor_and_the_panel_that_shows_a_part_of_it(says):
    wide, tall, n, again = says(
        "The second panel shows the sensor around the mark: 12 × 9 microlenses, with 9 × 9 pixels under each."
    )
    view = LightFieldView(panels="picture sensor")
    shown = view._under_the_microlenses()
    assert shown.shape[:2] == (tall.value * n.value, wide.value * again.value)
    across, down, width, height = says("So the sensor of 1440 × 1080 pixels gives pictures of 160 × 120 pixels.")
    views = view.light_field.views
    assert views.shape[:4] == (n.value, again.value, height.value, width.value)
    assert (across.value, down.value) == (again.value * width.value, n.value * height.value)


def test_the_fence_and_the_focus(says):
    says("Pull slope slowly to the right, all the way.")
    (code,) = (cell.source for cell in LESSON.cells if cell.get("id") == "first-sight")
    end = float(re.search(r"slope=\(-1.3, ([\d.]+), 0.02\)", code)[1])
    away, blur = says(
        "The shear is right for the fence, 2.0 m away, and yet the slats are soft: each view blurs them over 3.25 px."
    )
    (asked,) = says("The slope stays right for the fence, 2.0 m away.")
    says("Between it and the garden, two metres away, the fence stood all the time.")
    assert abs(end - slope(away.value)) < 0.02
    assert blur == abs(slope(away.value))
    assert asked.value == away.value == FENCE_DISTANCE == 2
    says("What the main lens had in focus, at $z_f = 4$ m, stands upright")
    assert slope(Z_F) == 0
    b, f, bf, globe = says(
        "The views of the garden are b = 0.056 m apart, and f = 232.3 px. So b f = 13.0 px·m. Take the "
        "globe, 3.03 m away:"
    )
    assert b == B
    assert f == F
    assert bf == B * F
    assert slope(globe.value) == pytest.approx(1.04, abs=0.01)  # as printed


def test_the_fence_cannot_be_told_at_first_and_can_at_its_own_slope(says):
    """Beside the garden without one: what the fence adds to upright edges."""
    says("A fence comes out of nothing.")
    says("The sum spreads it over the whole picture as a thin veil.")

    def uprights(d, fence):
        columns = LightFieldView(fence=fence, slope=d).image()[:60].mean(axis=(0, 2))
        return np.abs(np.diff(columns)).mean()

    assert uprights(1.04, True) < 1.1 * uprights(1.04, False)
    assert uprights(3.24, True) > 1.9 * uprights(3.24, False)


def test_what_is_nearer_leans_to_the_left(says):
    (at,) = says("What the main lens was focused on, at 4 m, has the same place in all views.")
    (nearer,) = says("What does a point *nearer* than 4 m draw in the slice?")
    (stands,) = says("That is what a point at 4 m draws")
    assert at.value == nearer.value == stands.value == Z_F
    (over,) = says("One step of the camera to the right moves a near point to the left, by d = b f (1/z − 1/4) pixels.")
    says("What is nearer leans to the left as u grows, what is farther to the right.")
    column = [F * (0.3 - u * B) / 3.0 + F * u * B / Z_F for u in range(PLACES)]
    assert (np.diff(column) < 0).all()
    assert np.ptp(np.diff(column)) < 1e-9  # a straight line
    assert np.diff(column)[0] == pytest.approx(-B * F * (1 / 3.0 - 1 / over.value))
    says("where two lines cross, the one that leans more to the left is in front")
    assert slope(2.5) > slope(3.5) > slope(6.0)


# How far it reaches --------------------------------------------------------------------------------------------------


def test_a_view_through_an_opening_as_wide_as_the_step_blurs_over_d_pixels(says):
    says("every view blurs it over |d| pixels")
    (sharp,) = says("A single view now has a depth of field: what is 4 m away is sharp, the fence is not.")
    through = np.linspace(-B / 2, B / 2, 101)  # places of one opening
    for z in (2.0, 3.0, 6.5):
        landed = F * (0.1 - through) / z + F * through / Z_F
        assert np.ptp(landed) == pytest.approx(abs(slope(z)))
    assert np.ptp(F * (0.1 - through) / sharp.value + F * through / Z_F) < 1e-9


def test_the_range_of_exact_refocusing(says):
    (pixel,) = says("as sharply as its pixels allow for **|d| ≤ 1 px**")
    near, far = says("Here it reaches from 3.06 m to 5.78 m.")
    assert near == depth(pixel.value)
    assert far == depth(-pixel.value)
    width, whole_near, whole_far = says(
        "A lens of the same width, 504 mm, without microlenses keeps its blur within a pixel from 3.87 m to 4.14 m "
        "only."
    )
    assert width == 1000 * PLACES * B
    whole = width.value / 1000
    assert whole_near == depth(1.0, b=whole)
    assert whole_far == depth(-1.0, b=whole)
    says("In 1/z the range is nine times as wide, because there are nine views in a row.")
    ratio = (1 / depth(1.0) - 1 / depth(-1.0)) / (1 / depth(1.0, b=whole) - 1 / depth(-1.0, b=whole))
    assert ratio == pytest.approx(PLACES)


def test_refocused_through_openings_a_point_stays_as_wide_as_one_view_has_it(says):
    says("and no shear takes that back")
    for d in (0.5, 1.0, 3.25):
        places = np.linspace(-PLACES / 2, PLACES / 2, 9 * 200, endpoint=False) + 1 / 400
        step = np.rint(places)  # of the view that a place belongs to
        landed = -d * places + d * step
        assert np.ptp(landed) == pytest.approx(d, rel=0.01)


# α -------------------------------------------------------------------------------------------------------------------


def test_the_slope_is_linear_in_the_inverse_of_alpha(says):
    says("So the slope is linear in 1/α, not in α, and it is not the depth either.")
    pitch, sensor = 0.002, F * 0.002
    focal = 1 / (1 / Z_F + 1 / sensor)
    d = np.array([-3.0, -1.0, 0.0, 2.0, 3.0])
    alpha = 1 / (1 / focal - 1 / depth(d)) / sensor
    np.testing.assert_allclose(1 - 1 / alpha, d * pitch / B, atol=1e-12)
    says("the picture becomes α times as large")  # an image is as large as its distance from the lens
    says("For z far beyond f, α hardly differs from 1")
    says("the film of a nearer point lies *farther* behind the lens, so α > 1 for z < z_f")
    assert alpha[-1] > 1


def test_the_published_benchmark(says):
    focal_mm, sensor_mm, pixels = says("f = 100 mm on a 35 mm sensor of 512 pixels")
    apart_mm, focus = says("two neighbours 25 mm apart and a focus at 4.25 m")
    far, near, deepest, nearest = says("Its slopes from −1.6 to 1.5 px must be depths from 5.22 to 3.62 m.")
    f, b = focal_mm.value / sensor_mm.value * pixels.value, apart_mm.value / 1000
    assert deepest == depth(far.value, b, f, focus.value)
    assert nearest == depth(near.value, b, f, focus.value)


# What it costs -------------------------------------------------------------------------------------------------------


def test_what_views_cost_in_pixels(says):
    sensor, n, again = says(
        "A light field camera has a sensor of 40 million pixels and 10 × 10 of them under each microlens."
    )
    total, views, millions, width, height = says("Yes: 40 / 100 = 0.40 million, a picture of about 630 × 630 pixels.")
    assert total.value == sensor.value
    assert views == n.value * again.value
    assert millions == sensor.value / views.value
    assert width.about(1000 * np.sqrt(millions.value), 0.01)
    assert height.value == width.value
    (all_of_them,) = says("40 million: every pixel of the sensor takes part in it.")
    assert all_of_them.value == sensor.value
    (a_ninth,) = says("About 4 million, a tenth.")
    assert a_ninth == sensor.value / n.value
    (right,) = says("About 0.4 million.")
    assert right.value == millions.value
    (under_one,) = says("They do take part, 100 at a time")
    (directions,) = says("What was spent on 100 directions is not there for places.")
    assert directions.value == views.value
    (rows, columns, share) = says("10 × 10 = 100 views share the sensor")
    assert share == rows.value * columns.value
    assert under_one.value == share.value
    wide, tall = says("one sensor of 720 × 540 pixels, three ways")
    three, again_three, nine, again_nine = says("All pixels go to one view; to 3 × 3 views; to 9 × 9.")
    n, m, every, left = says(
        "With 9 × 9 views the focus and the viewpoint are free, and of the sensor's 388,800 pixels 4800 are left."
    )
    assert every == wide.value * tall.value
    assert left == every.value / (n.value * m.value)
    assert (three.value, nine.value) == (again_three.value, again_nine.value)
    sensor = np.zeros((int(tall.value), int(wide.value)))
    assert sensor[:: int(nine.value), :: int(again_nine.value)].size == left.value
    assert sensor[:: int(three.value), :: int(again_three.value)].size == every.value / 9


# A focused plenoptic camera ------------------------------------------------------------------------------------------


def thirds(microlens, n, per=3):
    """Which parts of the wall the n pixels under a microlens see, from x(u) = x0 − d u with d = 1/per."""
    return [per * microlens + u for u in range(n)]


def test_what_the_pixels_under_a_microlens_see_of_a_wall(says):
    wasted, of_all = says("For detail, 80 of 81 are wasted.")
    assert of_all == PLACES**2
    standing = {(7 + 0 * u, 5 + 0 * v) for v, u in np.ndindex(PLACES, PLACES)}
    assert wasted == of_all.value - len(standing)  # x0 = x + d u at slope 0
    (per,) = (int(said.value) for said in says("Let a wall have the slope d = 1/3."))
    n, *seen = says("In one row, with 5 pixels under each microlens, the first microlens may see 0 1 2 3 4.")
    following = says("The next one then sees 3 4 5 6 7.")
    m, *middle = says("The middle 3 of each are 1 2 3 and 4 5 6: the wall, without a gap and without repetition.")
    count = int(n.value)
    assert [one.value for one in seen] == [x0 for x0 in thirds(0, count, per) if x0 not in (0, 1)]  # 0 and 1 are no
    assert [one.value for one in following] == thirds(1, count, per)  # numbers to hold, says `quoting`
    cut = slice((count - int(m.value)) // 2, (count + int(m.value)) // 2)
    laid = thirds(0, count, per)[cut] + thirds(1, count, per)[cut]
    assert [one.value for one in middle] == [x0 for x0 in laid if x0 != 1]
    assert laid == list(range(1, 7))


def test_the_patches_give_the_photograph_back_and_those_of_another_size_repeat(says):
    wide, tall, n, again = says("Two cameras with the same 160 × 160 microlenses and 9 × 9 pixels under each")
    assert (wide.value, n.value) == (tall.value, again.value) == (160, PLACES)
    third, right, wrong = says(
        "The second has it at slope 1/3, with microlenses as sharp as a pixel. Your `patches` reads the second sensor, "
        "with patches of 3, the right ones, and of 5."
    )
    side = int(wide.value * third.value)
    wall = np.random.default_rng(0).random((side, side))
    rows = np.concatenate(
        [np.array(thirds(x, PLACES)) - 3 for x in range(int(wide.value))]
    )  # the middle pixel sees 3 x + 1
    rows = np.clip(rows, 0, side - 1)
    sensor = wall[np.ix_(rows, rows)]
    np.testing.assert_array_equal(lesson11.patches(sensor, PLACES, int(right.value)), wall)
    five = lesson11.patches(sensor, PLACES, int(wrong.value))
    (three, asked) = says(
        "Patches of 3 are right for this wall. What does a picture show that is made of patches of 5?"
    )
    assert (three.value, asked.value) == (right.value, wrong.value)
    (once,) = says("with patches of 3 every third of the wall is there once already")
    assert once.value == right.value
    overlap, of, fifth = says(
        "Neighbouring patches overlap on the wall by 2 of their 5 pixels, and both show what lies there. To a wall at "
        "slope 1/5 they would be right."
    )
    shared = int(overlap.value)
    np.testing.assert_array_equal(five[:, 3:5], five[:, 5:7])  # the last two of one patch, the first two of the next
    assert shared == of.value - right.value
    assert of.value == wrong.value
    assert fifth.value == wrong.value


def test_what_a_focused_plenoptic_camera_keeps(says):
    every, first, in_81 = says("Of the sensor's 2,073,600 pixels the first camera keeps 25,600, one in 81.")
    second, in_9 = says("The second keeps 230,400, one in 9.")
    nine, times, directions, of = says(
        "9 pixels in a row now see each third of the wall 3 times, from 3 directions instead of 9."
    )
    assert every == (160 * PLACES) ** 2
    assert first == 160**2
    assert in_81 == every.value / first.value
    assert second == (160 * 3) ** 2
    assert in_9 == every.value / second.value
    assert nine.value == of.value == PLACES
    seen = np.concatenate([thirds(x, PLACES) for x in range(20)])
    assert times == directions.value == np.bincount(seen)[30]
    den, patch = says("A wall at slope 1/5 needs patches of 5.")
    assert patch == len(set(thirds(0, PLACES, 5)) - set(thirds(1, PLACES, 5)))  # new ones before the next begins
    assert den.value == patch.value


def test_the_quiz_about_the_fence(says):
    hidden, views = says("A slat of the fence hides the globe in 20 of 81 views.")
    seen, of_all, slat, of_all_again = says("The globe with a veil, 61/81 of its own light and 20/81 from the slat.")
    light = np.full(int(views.value), 1.0)
    light[: int(hidden.value)] = 0.0
    assert seen == light.sum()
    assert of_all.value == of_all_again.value == views.value
    assert slat == (1 - light).sum()
    (again,) = says("It is hidden in 20 views only.")
    (others,) = says("The other 61 look past the slat.")
    (left_out,) = says("A mask that leaves out the 20 views would remove the veil")
    assert again.value == left_out.value == hidden.value
    assert others == views.value - hidden.value


def test_the_telephone_on_the_ruler(says):
    (wide,) = says("the aperture is a slit, 16 cm wide and as high as a telephone's lens")
    says("take nine pictures, two centimetres apart")
    assert wide == (9 - 1) * 2
    says("Its axes are parallel, so $z_f = \\infty$ and every slope is positive.")
    assert slope(np.array([1.0, 10.0, 1000.0]), z_f=np.inf).min() > 0
    says("Here the slope of infinity is −b f / z_f, and it is negative.")
    assert slope(1e9) == pytest.approx(-B * F / Z_F)
    assert slope(1e9) < 0


# The exercises -------------------------------------------------------------------------------------------------------


def cases(name):
    return list(exercise(name).cases(np.random.default_rng(5)))


def test_the_answers_are_camviz_s_own():
    for sensor, n, v, u in cases("11.sub_aperture"):
        np.testing.assert_array_equal(lesson11.sub_aperture(sensor, n, v, u), from_microlens_image(sensor, n, n)[v, u])
    for z, b, f, z_f in cases("11.disparity"):
        field = LightField(np.zeros((1, 1, 1, 1, 3)), b, f, z_f)
        np.testing.assert_allclose(lesson11.disparity(z, b, f, z_f), field.disparity(z))
    published = lesson11.disparity(np.array([5.2207, 3.6191]), 0.025, 100 / 35 * 512, 4.25)
    np.testing.assert_allclose(published, [-1.6, 1.5], atol=5e-4)


def test_the_mended_sum_focuses_what_moves_by_d_and_holds_the_middle_view_still(says):
    says("Now the middle view holds still, and the picture no longer slides when you turn the focus.")
    picture = np.random.default_rng(0).random((16, 16))
    views = np.array([[np.roll(picture, (-2 * (v - 1), -2 * (u - 2)), (0, 1)) for u in range(5)] for v in range(3)])
    np.testing.assert_allclose(lesson11.refocused(views, 2), picture, atol=1e-12)
    slid = lesson11.refocused_as_given(views, 2)
    np.testing.assert_allclose(slid, np.roll(picture, (2, 4), (0, 1)), atol=1e-12)
    (three,) = says("One step too far: views count from 0, so the middle of 3 views is number 1")
    assert int(three.value) // 2 == 1


@pytest.mark.parametrize("d", [-0.8, -0.3, 0.0, 0.45])
def test_the_slope_is_the_one_put_in(says, d):
    says("The plane may have a texture everywhere, or be a plain wall with one spot")
    rng = np.random.default_rng(1)
    assert lesson11.slope(lesson11._waves(rng, 7, 80, d)) == pytest.approx(d, abs=0.01)
    assert lesson11.slope(lesson11._spot(rng, 7, d)) == pytest.approx(d, abs=0.01)
    wall = np.array([shift(np.hanning(41), -d * u, order=3) for u in range(5)])
    assert lesson11.slope(wall) == pytest.approx(d, abs=0.02)


def test_means_of_derivatives_tell_nothing_of_a_spot_on_a_plain_wall(says):
    says("Rising and falling flanks cancel in a mean")
    _, L_x = np.gradient(lesson11._spot(np.random.default_rng(0), 5, 0.6))
    assert abs(L_x.mean()) < 1e-12 < np.sum(L_x**2)


def test_a_correlation_is_near_one_for_any_slope(says):
    (least,) = says("This is a correlation, near +1 or −1 for any slope.")
    for d in (-0.6, -0.2):
        L_u, L_x = np.gradient(lesson11._spot(np.random.default_rng(0), 5, d))
        assert np.corrcoef(L_u.ravel(), L_x.ravel())[0, 1] == pytest.approx(least.value, abs=0.01)


def test_alpha_is_the_ratio_of_thin_lens_image_distances():
    for z, f, z_f in cases("11.alpha"):
        image, sensor = (distance * f / (distance - f) for distance in (z, z_f))
        np.testing.assert_allclose(lesson11.alpha(z, f, z_f), image / sensor)


def test_the_pair_s_focus(says):
    says("A pair of parallel cameras with different principal points (`doffs`) is a sheared light field of two.")
    says("this pair has its focus where d = 0, at")
    f, b, doffs = 100.0, 0.2, 5.0
    z = f * b / doffs
    assert f * b / z - doffs == pytest.approx(0)


def test_the_whole_code_says_what_the_prose_says_of_it(says):
    says("It takes five lines, and one to undo the sRGB curve")
    code = "\n".join(cell.source for cell in LESSON.cells)
    body = re.search(r"def shift_and_sum.*?\n((?:    .+\n)+)", code)[1].strip("\n").splitlines()
    assert len(body) == 5 + 1
    assert sum("to_linear" in line for line in body) == 1


# Before the lesson ---------------------------------------------------------------------------------------------------


def test_before_the_lesson_a_part_of_the_lens_is_a_part_of_every_square(says):
    n, again = says("A camera has a small lens above every square of 9 × 9 pixels of its sensor.")
    says("Tape covers the lower half of its large lens in front.")
    says("About half of them in every square.")
    assert n.value == again.value == PLACES
    views = np.ones((PLACES, PLACES, 4, 6, 1))
    views[(PLACES + 1) // 2 :] = 0.0
    squares = to_microlens_image(views).reshape(4, PLACES, 6, PLACES)
    dark = (squares == 0).mean(axis=(1, 3))
    assert (dark == dark[0, 0]).all()
    assert abs(dark[0, 0] - 0.5) < 1 / PLACES
    says("Half of the views; the others show the whole scene.")
    assert (
        (from_microlens_image(squares.reshape(4 * PLACES, 6 * PLACES, 1), PLACES, PLACES) == 1).all((2, 3, 4))
    ).any()


def test_before_the_lesson_what_stands_still_is_in_focus(says):
    views, focus = says(
        "A camera takes 81 pictures at once, each through another part of its main lens, which is focused at 3 m."
    )
    (at,) = says("At 3 m.")
    assert views == PLACES**2
    assert at == depth(0.0, z_f=focus.value)
    assert slope(2.0, z_f=focus.value) * slope(9.0, z_f=focus.value) < 0  # one way and the other


def test_before_the_lesson_a_wire_in_front_of_a_coin(says):
    hidden, views = says("A wire hides a coin in 9 of 49 views, the middle one among them.")
    light = np.ones(int(views.value))
    light[: int(hidden.value)] = 0.0
    seen, of_all, wire, again = says("The coin, with 40/49 of its light, under a veil of 9/49 from the wire.")
    assert seen == light.sum()
    assert wire == (1 - light).sum()
    assert of_all.value == again.value == views.value
    (one_of,) = says("The middle view is one of 49. Forty of them look past the wire and show the coin.")
    (all_,) = says("Nine of the 49 views show wire at that place")
    assert one_of.value == all_.value == views.value
    assert (light.sum(), (1 - light).sum()) == (40, 9)


# By hand -------------------------------------------------------------------------------------------------------------


def test_one_pixel_of_the_sensor(says):
    says("Under the microlens in row y and column x begin the sensor's rows 9y and columns 9x.")
    says("The light that came through the place (v, u) of the lens is in row 9y + v and column 9x + u:")
    sensor = np.arange(3 * PLACES * 2 * PLACES).reshape(3 * PLACES, 2 * PLACES)
    views = from_microlens_image(sensor[..., None], PLACES, PLACES)
    assert views[4, 7, 2, 1, 0] == sensor[9 * 2 + 4, 9 * 1 + 7]


def test_one_view_is_moved_by_four_columns(says):
    d, middle, mark, steps, column, more, there = says(
        "The globe has d = 1.04, nearly 1. In the middle view, u = 4, its mark is in column 118. In the leftmost view, "
        "u = 0, it is 4 steps away and so in column 118 + 4 = 122."
    )
    (back,) = says("To bring it back, move this view by 4 columns to the left.")
    assert d == slope(3.03)
    assert middle == (PLACES - 1) / 2
    assert steps == middle.value
    assert (column.value, more.value) == (mark.value, steps.value)
    at_u_0 = mark.value - round(d.value) * (0 - middle.value)  # x(u) = x0 - d u
    assert there == at_u_0
    assert back == at_u_0 - mark.value
    (between,) = says("A shift by 1.04 pixels needs interpolation.")
    assert between.value == d.value
    far, z_far, near, z_near = says("from d = −1 px (5.78 m) to d = +1 px (3.06 m)")
    assert z_far == depth(far.value)
    assert z_near == depth(near.value)


def test_one_film_by_hand(says):
    pitch, microlenses, globe = says(
        "Let the microlenses be p = 2 mm apart. Then the sensor is 232.3 of them behind the main lens. The thin lens "
        "equation 1/f = 1/z + 1/v first tells the focal length of the main lens, for which $z_f = 4$ m is sharp on the "
        "sensor. Then it tells the place of the film for the globe at 3.03 m:"
    )
    assert microlenses == F
    v = microlenses.value * pitch.value / 1000
    f = 1 / (1 / Z_F + 1 / v)
    film = 1 / (1 / f - 1 / globe.value)
    assert 1 - v / film == pytest.approx(slope(globe.value) * pitch.value / 1000 / B, rel=1e-3)  # Ng's equation


def test_one_slope_by_hand_and_your_slopes_along_a_row(says):
    *one, a, b, c = says(
        "Let three neighbours in a view be 10, 20, 30, and the same pixels 14, 24, 34 in the next view."
    )
    along, across, num, den, d = says(
        "Along x the brightness grows by 10 a pixel, so $L_x = 10$. From view to view it grows by 4, so $L_u = 4$. The "
        "slope is 4/10 = 0.4 px a view."
    )
    epi = np.array([[said.value for said in one], [a.value, b.value, c.value]])
    L_u, L_x = np.gradient(epi)
    assert along == L_x.mean()
    assert across == L_u.mean()
    assert (num.value, den.value) == (across.value, along.value)
    assert d == np.mean(L_u) / np.mean(L_x)
    row, views, pixels = says(
        "So the slice at row 48 is sheared first, by one pixel a view, which makes the globe stand almost still. Then "
        "your `slope` measures a window of 3 views and 13 pixels around each column."
    )
    code = "\n".join(cell.source for cell in LESSON.cells)
    assert f"field.views[4, :, {row.value:.0f}]" in code
    window = np.arange(9 * 160).reshape(9, 160)[3:6, 10 - 6 : 10 + 7]
    assert "still[3:6, x - 6 : x + 7]" in code
    assert window.shape == (views.value, pixels.value)


def test_your_picture_of_a_pair_lies_half_a_slope_to_the_left(says):
    says("(Your pictures lie half a disparity beside camviz's.")
    d, x0 = 8, 100
    left, right = np.zeros(200), np.zeros(200)
    left[x0], right[x0 - d] = 1, 1
    yours = exercise("11.refocused").reference(np.stack([left, right])[None, :, None], d)[0]
    assert yours.argmax() == x0 - d / 2 - d / 2  # where the right view has it; in the middle between them it is at -d/2
