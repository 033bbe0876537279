"""What lesson 11 claims about light fields, recomputed with NumPy and SciPy from pinholes and thin lenses."""

import numpy as np
import pytest
from claims import claims
from scipy.ndimage import shift

from camviz.lightfields import from_microlens_image
from camviz_school.course.material import module

says = claims("11")
lesson11 = module("11")

F, B, Z_F, PLACES = 80 / np.tan(np.radians(19)), 0.056, 4.0, 9
"""160 pixels over 38°, places 56 mm apart, nine in a row, a focus at 4 m."""


def slope(z, b=B, f=F, z_f=Z_F):
    """From the images of one point in two parallel cameras, less those of a point in focus."""
    first, second = (f * -place / z - f * -place / z_f for place in (0.0, b))
    return first - second


def depth(d, b=B, f=F, z_f=Z_F):
    return 1 / (d / (b * f) + 1 / z_f)


def thirds(microlens, n=PLACES, per=3):
    """Which parts of a wall at slope 1/per the n pixels under a microlens see: x(u) = x0 − d u."""
    return [per * microlens + u for u in range(n)]


def test_the_slope_of_a_thing_tells_its_distance():
    says("What the main lens was focused on, at 4 m, has the same place in all views.", "by d = b f (1/z − 1/4) pixels")
    says("The views of the garden are b = 0.056 m apart, and f = 232.3 px. So b f = 13.0 px·m. Take the globe, 3.03 m")
    says("The globe has d = 1.04, nearly 1.", "each view blurs them over 3.25 px", "the fence, 2.0 m away")
    assert pytest.approx([232.3, 13.0], abs=0.05) == [F, B * F]
    assert [slope(3.03), slope(2.0)] == pytest.approx([1.04, 3.25], abs=5e-3)
    np.testing.assert_allclose(lesson11.disparity(np.array([3.03, 2, 7]), B, F, Z_F), slope(np.array([3.03, 2, 7])))
    says("What is nearer leans to the left as u grows, what is farther to the right.")
    column = [F * (0.3 - u * B) / 3.0 + F * u * B / Z_F for u in range(PLACES)]
    np.testing.assert_allclose(np.diff(column), -slope(3.0))
    says("Here the slope of infinity is −b f / z_f, and it is negative.")
    assert slope(1e9) == pytest.approx(-B * F / Z_F)


def test_a_published_light_field_s_slopes_are_its_depths():
    says("f = 100 mm on a 35 mm sensor of 512 pixels", "two neighbours 25 mm apart and a focus at 4.25 m")
    says("Its slopes from −1.6 to 1.5 px must be depths from 5.22 to 3.62 m.")
    f = 100 / 35 * 512
    assert depth(np.array([-1.6, 1.5]), 0.025, f, 4.25) == pytest.approx([5.22, 3.62], abs=5e-3)
    published = lesson11.disparity(np.array([5.2207, 3.6191]), 0.025, f, 4.25)
    np.testing.assert_allclose(published, [-1.6, 1.5], atol=5e-4)


def test_how_far_refocusing_reaches():
    says("as sharply as its pixels allow for **|d| ≤ 1 px**", "Here it reaches from 3.06 m to 5.78 m.")
    says("A lens of the same width, 504 mm, without microlenses keeps its blur within a pixel from 3.87 m to 4.14 m")
    both = np.array([1.0, -1.0])
    assert depth(both) == pytest.approx([3.06, 5.78], abs=5e-3)
    assert depth(both, b=PLACES * B) == pytest.approx([3.87, 4.14], abs=5e-3)
    says("In 1/z the range is nine times as wide, because there are nine views in a row.")
    assert np.ptp(1 / depth(both)) / np.ptp(1 / depth(both, b=0.504)) == pytest.approx(9)


def test_no_shear_sharpens_what_one_opening_blurs():
    says("every view blurs it over |d| pixels", "and no shear takes that back")
    through = np.linspace(-B / 2, B / 2, 101)
    assert np.ptp(F * (0.1 - through) / 2.5 + F * through / Z_F) == pytest.approx(slope(2.5))
    places = np.linspace(-PLACES / 2, PLACES / 2, 9 * 200, endpoint=False) + 1 / 400
    for d in (0.5, 1.0, 3.25):
        assert np.ptp(d * np.rint(places) - d * places) == pytest.approx(d, rel=0.01)


def test_the_slope_is_linear_in_the_inverse_of_alpha():
    says("So the slope is linear in 1/α, not in α, and it is not the depth either.")
    says("Let the microlenses be p = 2 mm apart. Then the sensor is 232.3 of them behind the main lens.")
    pitch, sensor = 0.002, F * 0.002
    focal, d = 1 / (1 / Z_F + 1 / sensor), np.array([-3.0, -1, 0, 2, 3])
    alpha = 1 / (1 / focal - 1 / depth(d)) / sensor
    np.testing.assert_allclose(1 - 1 / alpha, d * pitch / B, atol=1e-12)
    np.testing.assert_allclose(lesson11.alpha(depth(d), focal, Z_F), alpha)
    assert alpha[-1] > 1  # of a nearer point the film lies farther behind the lens


def test_what_views_cost_in_pixels():
    says("So the sensor of 1440 × 1080 pixels gives pictures of 160 × 120 pixels.", "one of the 81 views")
    says("of the sensor's 388,800 pixels 4800 are left", "one sensor of 720 × 540 pixels, three ways")
    sensor = np.arange(1080 * 1440.0).reshape(1080, 1440, 1)
    views = from_microlens_image(sensor, 9, 9)
    assert views.shape[:4] == (9, 9, 120, 160)
    np.testing.assert_array_equal(lesson11.sub_aperture(sensor[..., 0], 9, 4, 7), sensor[4::9, 7::9, 0])
    np.testing.assert_array_equal(views[4, 7], sensor[4::9, 7::9])
    assert (720 * 540, 720 * 540 / 81) == (388_800, 4800)


def test_patches_give_the_wall_back():
    says("Patches of 3 are right for this wall. What does a picture show that is made of patches of 5?")
    says("first microlens may see 0 1 2 3 4.", "The next one then sees 3 4 5 6 7.", "1 2 3 and 4 5 6: the wall")
    assert [thirds(0, 5), thirds(1, 5)] == [[0, 1, 2, 3, 4], [3, 4, 5, 6, 7]]
    assert thirds(0, 5)[1:4] + thirds(1, 5)[1:4] == [1, 2, 3, 4, 5, 6]
    says(
        "Of the sensor's 2,073,600 pixels the first camera keeps 25,600, one in 81.",
        "The second keeps 230,400, one in 9",
    )
    assert [(160 * 9) ** 2, 160**2, 480**2] == [2_073_600, 25_600, 230_400]
    says(
        "Neighbouring patches overlap on the wall by 2 of their 5 pixels", "To a wall at slope 1/5 they would be right."
    )
    wall = np.random.default_rng(0).random((480, 480))
    rows = np.clip(np.concatenate([np.array(thirds(x)) - 3 for x in range(160)]), 0, 479)
    np.testing.assert_array_equal(lesson11.patches(wall[np.ix_(rows, rows)], 9, 3), wall)
    five = lesson11.patches(wall[np.ix_(rows, rows)], 9, 5)
    np.testing.assert_array_equal(five[:, 3:5], five[:, 5:7])  # the last two of one patch, the first two of the next


def test_the_slope_is_found_from_derivatives():
    says("Let three neighbours in a view be 10, 20, 30, and the same pixels 14, 24, 34 in the next view.")
    says("slope is 4/10 = 0.4 px a view")
    L_u, L_x = np.gradient(np.array([[10.0, 20, 30], [14, 24, 34]]))
    assert L_u.mean() / L_x.mean() == pytest.approx(0.4)
    for d in (-0.8, 0.45):
        wall = np.array([shift(np.hanning(41), -d * u, order=3) for u in range(5)])
        assert lesson11.slope(wall) == pytest.approx(d, abs=0.02)


def test_the_sum_focuses_what_moves_by_d():
    picture = np.random.default_rng(0).random((16, 16))
    views = np.array([[np.roll(picture, (-2 * (v - 1), -2 * (u - 2)), (0, 1)) for u in range(5)] for v in range(3)])
    np.testing.assert_allclose(lesson11.refocused(views, 2), picture, atol=1e-12)
    says("In the leftmost view, u = 0, it is 4 steps away and so in column 118 + 4 = 122.")
    assert 118 - round(slope(3.03)) * (0 - (PLACES - 1) // 2) == 122


def test_questions_cost_and_veil():
    says("10 × 10 = 100 views share the sensor", "A mask that leaves out the 20 views would remove the veil")
    says("sensor of 40 million pixels and 10 × 10 of them under each microlens", "Yes: 40 / 100 = 0.40 million")
    says("a picture of about 630 × 630 pixels", "About 4 million, a tenth.", "They do take part, 100 at a time")
    assert np.sqrt(40e6 / 100) == pytest.approx(630, rel=0.01)
    says(
        "hides the globe in 20 of 81 views.", "61/81 of its own light and 20/81 from the slat", "The other 61 look past"
    )
    says(
        "A wire hides a coin in 9 of 49 views", "The coin, with 40/49 of its light, under a veil of 9/49 from the wire."
    )
    assert (81 - 20, 49 - 9) == (61, 40)


def test_question_half_of_every_square():
    says("each through another part of its main lens, which is focused at 3 m")
    says("small lens above every square of 9 × 9 pixels", "About half of them in every square.", "At 3 m.")
    light = np.ones((9 * 4, 9 * 6, 1))
    light[np.arange(36) % 9 >= 5] = 0  # what came through the covered places of the lens
    views = from_microlens_image(light, 9, 9)
    assert set(views.mean(axis=(2, 3, 4)).ravel()) == {0.0, 1.0}
    assert abs(views.mean() - 0.5) < 1 / 9
    assert slope(2.0, z_f=3.0) > slope(3.0, z_f=3.0) == 0 > slope(9.0, z_f=3.0)
