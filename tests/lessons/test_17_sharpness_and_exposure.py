"""Lesson 17: how sharp a camera is and why, colours, dark corners, exposure and metering."""

import cv2
import numpy as np
import pytest
from scipy.integrate import quad
from scipy.optimize import brentq
from scipy.special import j1
from scipy.stats import norm

from camviz.scenes import to_linear
from camviz_clinic.measuring.sharpness import SlantedEdge
from camviz_school.views.exposure import ExposureView
from camviz_school.views.sharpness import SharpnessView

EXCEPTIONS: dict[str, str] = {
    "near 0.1 to 0.2 cycles per pixel": "where phones put the peak of their sharpening, as a rule",
}

GREEN = 550e-6  # mm


def lens(f, N, c=0.0, wavelength=GREEN):
    """A perfect round lens with rays' disc c, by SciPy's quadrature over the overlap of the pupil with its copy."""
    s = f * wavelength * N
    if s >= 1:
        return 0.0
    return 4 / np.pi * quad(lambda x: np.sqrt(1 - (x + s) ** 2) * np.cos(np.pi * f * c * x), 0, 1 - s, limit=200)[0]


def mtf50(N, c, pitch):
    f = np.linspace(1, 250, 60)
    values = np.array([abs(lens(one, N, c) * np.sinc(one * pitch)) for one in f])
    after = int(np.argmax(values < 0.5))
    return brentq(lambda one: abs(lens(one, N, c) * np.sinc(one * pitch)) - 0.5, f[after - 1], f[after])


def kept_by_a_rim(x, aperture, rim, distance):
    """The share of an aperture that a rim leaves open for light of slope x, counted point by point."""
    v, u = np.meshgrid(np.linspace(-1, 1, 1201), np.linspace(-1, 1, 1201))
    disc = u**2 + v**2 <= 1
    seen = np.hypot(u * aperture / 2 - distance * x, v * aperture / 2) <= rim / 2
    return (disc & seen).sum() / disc.sum()


@pytest.fixture(scope="module")
def edge(samples):
    photograph = cv2.imread(str(samples / "left06.jpg"), cv2.IMREAD_GRAYSCALE)
    return to_linear(photograph[287:317, 559:583].astype(float) / 255)


def plain_mtf(light):
    """Rows' steepest places give the line; quarter-pixel strips, differences, NumPy's transform; nothing of camviz."""
    change = np.diff(light, axis=1)
    rows, columns = np.arange(len(light)), np.arange(light.shape[1] - 1) + 0.5
    middle = (change * columns).sum(axis=1) / change.sum(axis=1)
    slope, intercept = np.polyfit(rows, middle, 1)
    v, u = np.indices(light.shape)
    d = (u - slope * v - intercept) * np.cos(np.arctan(slope))
    borders = np.arange(-6, 6.1, 0.25)
    profile = np.histogram(d, borders, weights=light)[0] / np.histogram(d, borders)[0]
    f = np.fft.rfftfreq(512, 0.25)
    spread = np.diff(profile)
    return f, np.abs(np.fft.rfft(spread, 512)) / spread.sum()


def test_a_leaning_edge_is_sampled_within_a_pixel(says):
    (lean,) = says("Then you lean it by 5°.")
    at, again, step = says("At 5° the edge moves on by tan 5° = 0.087 px from row to row, so a dozen rows sample")
    assert lean == at.value
    assert again == at.value
    assert step == np.tan(np.radians(at.value))
    assert 1 / np.tan(np.radians(at.value)) == pytest.approx(12, abs=0.6)
    (phone,) = says("leaning by about 5°, without flash")
    assert 2 < phone.value < 10  # between these, ISO 12233's rows neither repeat too soon nor blur the edge


def test_the_photograph_s_mtf50_and_its_error(says, edge):
    value, error, period = says(
        "For the camera of OpenCV's photograph MTF50 is 0.149 ± 0.011 cycles per pixel: stripes that repeat every 6.7 "
        "pixels keep half of their contrast."
    )
    measured = SlantedEdge.of(edge)
    assert value == measured.mtf50
    assert error == measured.mtf50_error
    assert period == 1 / measured.mtf50
    f, plain = plain_mtf(edge)
    after = int(np.argmax(plain < 0.5))
    assert np.interp(-0.5, -plain[after - 1 : after + 1], f[after - 1 : after + 1]) == pytest.approx(
        value.value, abs=0.01
    )
    (begin,) = says("From 0.3 cycles per pixel to the Nyquist frequency less than a tenth is left")
    assert plain[(f >= begin.value) & (f <= 0.5)].max() < 0.1
    assert measured.mtf(np.linspace(begin.value, 0.5, 50)).max() < 0.1


def test_two_halves_of_the_edge_differ_by_about_their_error(says, edge):
    says("The ± counts noise that neighbours share and pieces of the edge that differ, too.")
    measured = SlantedEdge.of(edge).error
    assert measured.shared > 1
    assert measured.pieces[1] > measured.independent
    rows, upper, again, lower = says("The upper 16 rows of this edge alone give 0.139, the lower 16 give 0.153")
    says("they differ by about one standard error")
    assert again == rows.value
    halves = [SlantedEdge.of(part) for part in (edge[: int(rows.value)], edge[-int(rows.value) :])]
    assert upper == halves[0].mtf50
    assert lower == halves[1].mtf50
    error = np.hypot(halves[0].mtf50_error, halves[1].mtf50_error)
    assert (lower.value - upper.value) / error == pytest.approx(1, abs=0.3)


def test_most_of_the_error_comes_from_the_light(says, edge):
    says(
        "Most of the ± comes from the light: so small a piece hardly shows whether its light is uneven or the blur has "
        "wide feet."
    )
    measured = SlantedEdge.of(edge).error
    assert measured.light**2 > measured.total**2 / 2
    v, u = np.indices((200, 160))  # the same blur where there is room beside it
    wide = SlantedEdge.of(1 / (1 + np.exp(-(u - 80 - 0.15 * (v - 100)) / 0.7)) + 0.05)
    assert wide.error.light < measured.light / 10


@pytest.mark.thorough
def test_four_times_the_rows_halve_the_error(says, thorough):
    says("The ± falls with the root of the edge's length: four times the rows, half the error.")
    rng = np.random.default_rng(2)
    errors = []
    for rows in (80, 320):
        v, u = np.indices((rows, 160))
        light = 1 / (1 + np.exp(-(u - 80 - 0.087 * (v - rows / 2)) / 0.6))
        found = [SlantedEdge.of(light + rng.normal(0, 0.02, light.shape)).mtf50 for _ in range(80 if thorough else 50)]
        errors.append(np.std(found))
    assert errors[0] / errors[1] == pytest.approx(2, abs=0.5)  # each known to 10 %, with --all to 8 %


def test_what_the_strips_blur(says):
    says("camviz fits a smooth curve to all pixels, takes its means over strips of an eighth of a pixel and")
    (factor,) = says("Both dim a grating, by a factor of 0.987 at half a cycle, which it takes out")
    eighth = np.sin(np.pi / 16) / (np.pi / 16)
    assert factor == eighth**2  # a mean over a strip, and a difference of strips


def test_what_the_standard_of_2014_does_otherwise(says):
    """Differences of every second quarter, the filter (−1/2, 0, 1/2), and the window of a cosine on a pedestal."""
    says("take differences of every second value")
    (left,) = says("At half a cycle per pixel it is 0.900.")
    x = np.arange(400) / 4
    wave = np.sin(np.pi * x)  # half a cycle per pixel
    steps = np.convolve(wave, [0.5, 0, -0.5], "valid") * 4
    assert left == np.abs(steps).max() / np.pi
    says("in the middle and fades from there on")
    assert np.hamming(65)[32] == 1
    assert np.all(np.diff(np.hamming(65)[32:]) < 0)
    says("its window is flat over the edge")
    v, u = np.mgrid[:64, :64]
    edge = SlantedEdge.of(np.clip(u - 32 - 0.0875 * (v - 32) + 0.5, 0, 1))
    (x, spread), (_, rise) = edge.line_spread, edge.edge_spread
    flat = np.abs(x) < edge.rise
    np.testing.assert_allclose(spread[flat], 8 * np.diff(rise)[flat])


@pytest.mark.thorough
def test_how_long_an_edge_must_be(says, thorough):
    noise, rows, within, sharp_rows = says(
        "At 2 % noise, 80 rows are within 3 % nearly always for a lens of usual sharpness. A very sharp one needs 200 "
        "rows."
    )
    rng = np.random.default_rng(4)
    for length, spread, share in ((rows.value, 0.6, 0.93), (sharp_rows.value, 0.12, 0.93), (rows.value, 0.12, 0.0)):
        v, u = np.meshgrid(np.arange(int(length)), np.arange(100), indexing="ij")
        fine = [1 / (1 + np.exp(-(u + o - 50 - 0.087 * v) / spread)) for o in (np.arange(16) - 7.5) / 16]
        light = np.mean(fine, axis=0)  # over the pixel's width
        truth = SlantedEdge.of(light).mtf50
        shots = [
            SlantedEdge.of(light + rng.normal(0, noise.value / 100, light.shape)).mtf50
            for _ in range(60 if thorough else 20)
        ]
        inside = np.mean(np.abs(np.array(shots) / truth - 1) < within.value / 100)
        assert inside >= share
        if not share:
            assert inside < 0.93


def test_the_question_about_stopping_down(says):
    off, pitch, widest, narrowest = says(
        "the sensor stands 40 µm behind the sharp image. Its pixels are 4 µm wide. You go through all f-numbers from "
        "f/1.4 to f/32."
    )
    best = max(
        np.arange(widest.value, narrowest.value, 0.8), key=lambda N: mtf50(N, off.value / N / 1000, pitch.value / 1000)
    )
    assert widest.value < 4 < best < 8 < narrowest.value
    (open_,) = says("At f/1.4: a wide opening has the least diffraction.")
    (closed,) = says("At f/32: the smaller the opening, the deeper the sharpness.")
    assert (open_.value, closed.value) == (widest.value, narrowest.value)
    again, N, cone = says("Out of focus by 40 µm, the cone of f/1.4 is 29 µm wide on the sensor: seven pixels.")
    assert cone == again.value / N.value
    assert cone.value / pitch.value == pytest.approx(7, abs=0.3)
    disc, airy, equal, wavelength = says(
        "The disc of the rays is 40 µm / N wide, the Airy disc 2.44 λ N. They are equally wide at N = 5.5, for green "
        "light of 550 nm."
    )
    assert disc == off.value
    assert airy == 2 * brentq(j1, 3, 4.5) / np.pi
    assert equal == np.sqrt(disc.value / (airy.value * wavelength.value / 1000))
    N, rays, airy = says("At f/32 the rays' disc is only 1.3 µm wide, and the Airy disc 43 µm.")
    assert rays == off.value / N.value
    assert airy == 2.44 * 0.55 * N.value
    (nyquist,) = says("Half a cycle per pixel is 125 cycles per mm here.")
    assert nyquist == 0.5 / (pitch.value / 1000)


def test_the_table_of_f_numbers_is_that_of_the_integral():
    view = SharpnessView(defocus_um=40.0, pitch_um=4.0)
    for N in (1.4, 2.8, 5.6, 8, 11, 32):
        assert view.but(f_number=N).mtf50_per_mm == pytest.approx(mtf50(N, 0.04 / N, 0.004), rel=2e-3)


def test_the_star_reverses_beyond_the_first_zero(says):
    says("inside a grey ring the spokes come back, with black where white should be")
    N = 2.8  # of the view, 40 µm out of focus, with pixels of 2 µm
    c = 0.04 / N
    zero = brentq(lambda f: lens(f, N, c), 60, 140)
    assert lens(1.2 * zero, N, c) < 0  # bright and dark have changed places
    ring_um = 1000 * 36 / (2 * np.pi * zero)
    assert 30 < ring_um < 78  # inside the star
    assert zero < 0.5 / 0.002
    assert 2 * j1(np.pi * c * zero) / (np.pi * c * zero) < 0  # the rays' disc alone reverses sooner


def test_the_star_aliases_on_wide_pixels(says):
    N, pitch = says("Set f-number to 2 and make the pixels 12 µm wide")
    nyquist = 0.5 / (pitch.value / 1000)
    coarsest = 36 / (2 * np.pi * 0.078)  # at the star's rim
    assert coarsest > nyquist
    assert abs(lens(1.5 * coarsest, N.value) * np.sinc(1.5 * coarsest * pitch.value / 1000)) > 0.1


def test_one_frequency_by_hand(says):
    f, N, pitch = says("One frequency by hand, 100 cycles per mm at f/8, green light and pixels of 4 µm:")
    assert lens(f.value, N.value) == pytest.approx(0.458, abs=5e-4)
    pixel = quad(lambda x: np.cos(2 * np.pi * f.value * x), 0, pitch.value / 2000)[0] / (pitch.value / 2000)
    assert pixel == pytest.approx(0.757, abs=5e-4)
    assert lens(f.value, N.value) * pixel == pytest.approx(0.347, abs=5e-4)


def test_diffraction_and_defocus_do_not_multiply(says):
    (off,) = says("their product is wrong: by up to 0.22 at half a wave of defocus")
    N = 8.0
    c = 8 * N * 0.5 * GREEN
    f = np.linspace(1, 220, 110)
    exact = np.array([lens(one, N, c) for one in f])
    product = np.array([lens(one, N) for one in f]) * 2 * j1(np.pi * f * c) / (np.pi * f * c)
    assert off == np.abs(exact - product).max()
    at = SharpnessView(f_number=8.0, defocus_um=1000 * c * N).system(f)
    np.testing.assert_allclose(at, np.abs(exact * np.sinc(f * 0.004)), atol=1e-6)


def test_why_an_opening_s_overlap_with_its_copy_is_its_mtf(says):
    """Two slits at distance d before a screen at v, and the pairs of points of a disc that stand so far apart."""
    says("Two points of the opening draw stripes on the sensor, as two slits do: the farther apart they are, the finer")
    says(
        "Their share is the area that a round opening has in common with a copy of itself, moved aside by that distance"
    )
    v, N, f = 50.0, 8.0, 100.0  # mm and cycles per mm
    apart = f * GREEN * v
    at = np.linspace(0, 0.2, 2001)  # on the screen: 20 stripes
    light = np.abs(sum(np.exp(2j * np.pi / GREEN * np.hypot(v, at - slit)) for slit in (-apart / 2, apart / 2))) ** 2
    strongest = np.argmax(np.abs(np.fft.rfft(light[:-1] - light[:-1].mean()))) / 0.2
    assert strongest == pytest.approx(f)
    y, x = np.mgrid[-1:1:801j, -1:1:801j] * v / N / 2
    inside, moved = (np.hypot(x - shift, y) <= v / N / 2 for shift in (0, apart))
    assert (inside & moved).sum() / inside.sum() == pytest.approx(lens(f, N), abs=2e-3)


def test_half_a_wave_is_a_path_difference_of_c_over_8_n(says):
    says("at the rim, by W = c/(8N) more than in the middle")
    N, dz = 8.0, 0.02
    focal, radius = 50.0, 50.0 / 16
    to_image, to_sensor = focal, focal + dz  # spheres about the image and about the sensor, touching in the middle
    sag = radius**2 / 2 / to_image - radius**2 / 2 / to_sensor
    assert sag == pytest.approx((dz / N) / (8 * N), rel=1e-3)


def test_the_spilled_colours(says):
    (N,) = says("Drag the f-number up to 11: they nearly go.")
    wide, narrow = (SharpnessView(f_number=n, axial_um=40.0).image() for n in (2.8, N.value))
    fringe = [np.abs(one[..., 1] - one[..., [0, 2]].mean(axis=-1))[:, :40].max() for one in (wide, narrow)]
    assert fringe[1] < 0.35 * fringe[0]
    row = wide[30]
    dark = int(np.argmax(row[:, 1] > 0.5)) - 2  # the dark side of the edge
    assert row[dark, 0] > row[dark, 1]
    assert row[dark, 2] > row[dark, 1]
    assert row[dark + 4, 1] > row[dark + 4, 0]
    (aside,) = says("Set axial to 0 and lateral to 6 µm.")
    sides = [SharpnessView(f_number=n, lateral_um=aside.value).image() for n in (2.8, N.value)]
    fringe = [np.abs(one[..., 0] - one[..., 2])[:, :40].max() for one in sides]
    assert fringe[1] > 0.6 * fringe[0]


def test_the_foci_of_a_lens_of_crown_glass(says):
    focal, abbe, apart = says(
        "A lens of 50 mm made of ordinary crown glass (N-BK7, V = 64) has its blue and red foci 0.77 mm apart."
    )

    def index(um):  # Schott's Sellmeier coefficients of N-BK7
        B, C = (1.03961212, 0.231792344, 1.01046945), (0.00600069867, 0.0200179144, 103.560653)
        return np.sqrt(1 + sum(b * um**2 / (um**2 - c) for b, c in zip(B, C, strict=True)))

    red, yellow, blue = index(0.6563), index(0.5876), index(0.4861)
    assert abbe == (yellow - 1) / (blue - red)
    assert apart == focal.value * (yellow - 1) * (1 / (red - 1) - 1 / (blue - 1))


def test_the_corners(says):
    focal, rim, distance = says(
        "Here is the garden through a lens of 35 mm on full frame, wide open. A rim of the barrel, 32 mm wide, stands "
        "20 mm in front of the aperture."
    )
    slope = np.hypot(36, 24) / 2 / focal.value
    free, wide, corner, narrow, stays = says(
        "from f/5.6 on, the barrel covers nothing any more. The blue one stays. At f/1.4 the corner gets 31 % of the "
        "light in the middle, and at f/8 it still gets only 52 %."
    )

    def open_share(N):
        return kept_by_a_rim(slope, focal.value / N, rim.value, distance.value)

    assert open_share(free.value) == 1
    assert open_share(4.0) < 0.99
    cos4 = np.cos(np.arctan(slope)) ** 4
    assert corner == 100 * cos4 * open_share(wide.value)
    assert stays == 100 * cos4 * open_share(narrow.value)
    drawn = ExposureView(f_number=1.4, vignetting="cos⁴ and rim").falloff(np.array(np.hypot(18, 12)))
    assert drawn == pytest.approx(corner.value / 100, abs=5e-3)
    open_, closed = says("At f/1.4 the corners of your pictures are much darker than the middle. You stop down to f/8")
    assert open_share(open_.value) < open_share(closed.value)
    says("Behind a small hole, light that comes at an angle θ is weaker by cos⁴ θ.")
    x, y = np.meshgrid(np.linspace(-0.01, 0.01, 41), np.linspace(-0.01, 0.01, 41))
    bright = []
    for aside in (0.0, slope):  # patches of a round hole light a sensor at distance 1: two cosines over d²
        d2 = 1 + (aside - x) ** 2 + y**2
        bright.append(np.sum((np.hypot(x, y) <= 0.01) / d2**2))  # cos · cos / d², both cosines 1/d
    assert bright[1] / bright[0] == pytest.approx(cos4, rel=1e-4)
    says(
        "A lens that is symmetric about its aperture does the same, as far as its glasses show the aperture in one size"
    )
    (angle,) = says("at 45° a quarter of the light is left")
    assert np.cos(np.radians(angle.value)) ** 4 == pytest.approx(0.25)


def test_the_sunny_16_rule(says):
    N, time, ev, name, other, shorter = says(
        "In full sun f/16 at 1/125 s is right for ISO 100: EV 15, the sunny 16 rule. f/8 at 1/500 s lets in the same "
        "light."
    )
    assert ev == np.log2(N.value**2 * time.value)
    assert name == N.value
    assert other.value**2 * shorter.value == pytest.approx(N.value**2 * time.value)


def test_dusk_is_black_and_the_shutter_gives_more_light_than_the_gain(says):
    says("The light is that of a street at dusk, and the exposure is right.")
    (short,) = says("Then set shutter to −9 and bring the picture back with ISO.")
    longer = ExposureView(light_ev=9.0, shutter=-3.0)
    sunny = ExposureView(light_ev=15.0, shutter=-9.0).recorded(draft=True)
    assert longer.recorded(draft=True).mean() == pytest.approx(sunny.mean(), rel=0.02)
    black = longer.but(shutter=short.value)
    assert black.recorded(draft=True).mean() < 0.01
    gain = black.but(iso=6.0)
    assert longer.recorded(draft=True).mean() == pytest.approx(gain.recorded(draft=True).mean(), rel=0.02)
    electrons = [0.18 * view.electrons_of_white for view in (longer, gain)]
    assert electrons[0] / electrons[1] == pytest.approx(2**6)


def test_equal_brightness_at_a_quarter_of_the_light(says):
    says("Four pictures of equal brightness, each with a quarter of the light of the one before:")
    views = [ExposureView(iso=float(iso), shutter=-9.0 - iso) for iso in (0, 2, 4, 6)]
    means = [view.recorded(draft=True).mean() for view in views]
    assert np.ptp(means) < 0.01
    for view, electrons, ratio in zip(views, (5400, 1350, 338, 84), (73, 37, 18, 9), strict=True):
        free = 0.18 * 30_000 * 2.0 ** (15 - np.log2(8.0**2 * 2.0**-view.shutter))
        assert free == pytest.approx(electrons, abs=0.5)
        assert free / np.sqrt(free + 9) == pytest.approx(ratio, abs=0.5)
        assert view.numbers()["18 % grey"] == f"{electrons:,} electrons"
        assert view.numbers()["its signal / noise"] == str(ratio)


def test_iso_frees_no_electrons(says):
    (low,) = says("You turn ISO from 100 to 1600. What happens to the number of electrons")
    views = [ExposureView(iso=float(np.log2(iso / 100))) for iso in (low.value, 1600)]
    assert views[0].electrons_of_white == pytest.approx(views[1].electrons_of_white)
    assert views[1].sensor.gain_dn_per_e / views[0].sensor.gain_dn_per_e == pytest.approx(16)


def test_gain_lifts_the_noise_before_the_amplifier_and_no_other(says):
    """Shot noise and read noise of either kind, amplified 1 and 16 times, drawn 40,000 times."""
    says("Each electron counts for sixteen times as much, and so does all noise that comes before the amplifier")
    says("Noise that comes after it is not lifted (lesson 14); the camera above has none of that kind.")
    says("A high ISO lifts the noise of the light as well, by the same factor.")
    rng = np.random.default_rng(3)
    light, before, after = rng.poisson(400, 40_000), rng.normal(0, 3, 40_000), rng.normal(0, 30, 40_000)
    once, often = (gain * (light + before) for gain in (1, 16))
    assert often.std() / once.std() == pytest.approx(16)
    assert (often + after).std() / (once + after).std() < 16 / 1.5
    electrons = [(gain * (light + before) + after).std() / gain for gain in (1, 16)]
    assert electrons[1] < 0.7 * electrons[0]
    dark = ExposureView(light_ev=3.0)
    noise = [dark.but(iso=iso).sensor for iso in (0.0, 4.0)]
    assert noise[0].read_noise_e == noise[1].read_noise_e  # in electrons: all of it comes before the amplifier


def test_the_shutter_s_stops(says):
    one, other = says("from f/8 to f/16, how much longer?")
    assert (other.value / one.value) ** 2 == 4
    factor, *numbers = says("A stop is a factor of √2 in N: 2, 2.8, 4, 5.6.")
    for k, number in enumerate(numbers):
        assert number.about(2 * np.sqrt(factor.value) ** k, 0.015)  # as lenses are engraved
    N, time = says("A picture is right at f/4, 1/60 s and ISO 400.")
    (same, again), (right, longer), (larger, also) = (
        says("f/8, 1/60 s, ISO 800"), says("f/8, 1/30 s, ISO 800"), says("f/2.8, 1/30 s, ISO 400"),
    )  # fmt: skip

    def brightness(N, time, iso):
        return iso / time / N**2

    wanted = brightness(N.value, time.value, 400)
    assert brightness(right.value, longer.value, 800) == pytest.approx(wanted)
    assert brightness(same.value, again.value, 800) == pytest.approx(wanted / 2)
    assert brightness(larger.value, also.value, 400) == pytest.approx(4 * wanted, rel=0.03)
    first, second = says("From f/4 to f/8 is half the diameter and a quarter of the area: two stops.")
    assert (first.value, second.value) == (N.value, right.value)
    (wider,) = says(
        "f/2.8 is the larger opening: a stop more, and the shutter gives another. This picture is four times as"
    )
    assert wider.value == larger.value


def test_the_meter_s_constants(says):
    metered, saturated, share, grey, white = says(
        "A surface metered as the mean comes out at 10/78 = 12.8 % of saturation. 18 % of a white surface at "
        "100 % would be half a stop more"
    )
    assert share == 100 * metered.value / saturated.value
    (full,) = says("the saturation-based speed is 78/H, where H just fills the scale")
    assert full == saturated.value
    assert np.log2(grey.value / 100 / (share.value / white.value)) == pytest.approx(0.5, abs=0.02)
    ten, number, largest, of_white = says(
        "SOS, is 10/H, where H gives number 118 of 255 in the sRGB file, which is 18 % of white"
    )
    assert ten == metered.value
    assert of_white == 100 * to_linear(np.array(number.value / largest.value))
    assert abs(share.value - of_white.value) > 5  # one standard, two greys
    factor, base, K = says("A meter reads the luminance L = 0.125 · 2^EV cd/m² at ISO 100 (its constant K is 12.5).")
    assert factor == K.value / 100  # ISO 2720: N²/t = L S / K
    ev, sun, room, times = says(
        "Full sun is EV 15, or 4096 cd/m². The room at EV 7.6 is 170 times darker, and your eyes have hardly noticed."
    )
    assert sun == factor.value * base.value**ev.value
    assert room == np.log2(1.8**2 * 60)
    assert times.about(base.value ** (ev.value - np.log2(1.8**2 * 60)), 0.02)


def test_middle_grey_and_snow(says):
    (metered,) = says("the camera makes the mean of the picture 18 % of white")
    grey, stops, bits, number, snow, more = says(
        "Middle grey, 18 % of white, is 2.5 stops below white. In an 8-bit sRGB picture it is the number 118. Fresh "
        "snow reflects about 90 % of the light, five times as much as middle grey, and so it wants 2.3 stops more than "
        "the meter says."
    )
    assert metered == grey.value
    assert stops == -np.log2(grey.value / 100)
    linear = grey.value / 100
    assert number == (2**bits.value - 1) * (1.055 * linear ** (1 / 2.4) - 0.055)  # IEC 61966-2-1
    assert snow.value / grey.value == 5
    assert more == np.log2(snow.value / grey.value)


def test_snow_and_coal_come_out_as_the_same_grey(says):
    (mean,) = says("it makes the mean of the picture 18 % of white")
    (reply,) = says(
        "Yes: 18 % of white, whatever it is. Snow needs more exposure than the meter says, by two stops and more"
    )
    (shortened,) = says("But the meter shortens the exposure until the mean is 18 %")
    (recap,) = says("It makes everything one grey, here of 18 %")
    for subject in ("garden", "snow", "coal"):
        recorded = ExposureView(subject=subject, metering="average").recorded(draft=True)
        assert mean == 100 * recorded.mean()
    assert reply.value == shortened.value == recap.value == mean.value
    snow = ExposureView(subject="snow", metering="average")
    assert snow.but(compensation=2.3).recorded(draft=True).mean() > 0.7
    needed = brentq(lambda c: snow.but(compensation=c).electrons_of_white - 30_000, 0, 4)  # white is white
    assert 2 < needed < 2.5


def test_the_quiz_about_an_mtf(says):
    left, frequency = says("A camera's MTF is 0.3 at 0.25 cycles per pixel.")
    (share,) = says("Stripes that repeat every four pixels come out with 30 % of their contrast.")
    assert share == 100 * left.value
    again, kept = says("Yes: 0.25 cycles per pixel is one cycle in four pixels, and 0.3 of its contrast is left.")
    assert (again.value, kept.value) == (frequency.value, left.value)
    assert 1 / again.value == 4
    (sharp,) = says("30 % of the pixels are sharp.")
    assert sharp == share.value


def test_the_quiz_about_two_causes(says):
    lens_leaves, pixel = says(
        "a lens leaves 0.6 of the contrast of some grating, and the pixel by itself would leave 0.5"
    )
    (weaker,), (product,), (mean,) = (
        says("0.5: the weaker of the two decides."),
        says("0.3: they come one after the other"),
        says("0.55, their mean."),
    )  # fmt: skip
    one, other = says("Yes: 0.6 times 0.5.")
    assert product == one.value * other.value
    assert mean == (lens_leaves.value + pixel.value) / 2
    assert weaker == min(lens_leaves.value, pixel.value)
    assert (one.value, other.value) == (lens_leaves.value, pixel.value)


def test_before_the_lesson_what_an_mtf_says(says):
    says("A magazine tested a camera with black and white stripes that repeat every ten pixels.")
    (left,) = says("Its mark is 0.6, where 1 is perfect.")
    (share,) = says("As stripes everywhere, with 60 % of their contrast.")
    (sharp,) = says("Sharp in 60 % of the pixels, and blurred in the others.")
    assert share.value == sharp.value == 100 * left.value
    (seen,), (again,) = says("Where 0.6 is left, you see"), says("the difference is 0.6 of what it was")
    assert seen.value == again.value == left.value < 1
    says("Such a mark for every fineness is the modulation transfer function, MTF.")


def test_before_the_lesson_two_stages(says):
    (wall,) = says("A projector throws a grating on a wall, and 0.8 of its contrast arrives there.")
    (camera,), (alone,) = says("By itself it would leave 0.4 of this"), says("It would be 0.4 if the wall had the full")
    (product,), (weaker,), (mean,) = says("0.32: the camera takes"), says("0.4: the camera is"), says("0.6: the two")
    one, other = says("Yes: 0.8 times 0.4.")
    assert (one.value, other.value) == (wall.value, camera.value)
    width = brentq(lambda w: np.sinc(w) - camera.value, 0, 1)  # of a pixel that leaves this much of one cycle
    seen = quad(lambda x: wall.value * np.cos(2 * np.pi * x), -width / 2, width / 2)[0] / width
    assert product == seen
    assert product == one.value * other.value
    assert weaker.value == alone.value == min(wall.value, camera.value)
    assert mean == (wall.value + camera.value) / 2


def test_before_the_lesson_stops(says):
    N, time = says("At f/5.6, 1/50 s and ISO 200 a picture is right.")
    (narrow, short), (wide, twice), (right, shortest) = (
        says("f/8, 1/100 s, ISO 200"), says("f/2.8, 1/200 s, ISO 400"), says("f/2.8, 1/400 s, ISO 400"),
    )  # fmt: skip
    stops = [2 * np.log2(N.value / right.value), np.log2(time.value / shortest.value), np.log2(400 / 200)]
    np.testing.assert_allclose(stops, [2, -3, 1], atol=1e-9)
    assert (N.value / wide.value) ** 2 * time.value / twice.value * 400 / 200 == pytest.approx(2)
    assert (N.value / narrow.value) ** 2 * time.value / short.value == pytest.approx(1 / 4, rel=0.03)
    (smaller,) = says("f/8 is the smaller opening: half the light")
    first, second = says("From f/5.6 to f/2.8 the diameter doubles, and the area is four times as large.")
    assert (smaller.value, first.value, second.value) == (narrow.value, N.value, wide.value)


def test_before_the_lesson_light_against_gain(says):
    N, long, short = says("both times at f/4: once for 1/10 s at ISO 200, once for 1/160 s at ISO 3200")
    (claimed,), (times,) = says("The one of 1/10 s: it got more light."), says("Yes: 16 times the light.")
    assert times == short.value / long.value
    assert times == 3200 / 200  # so the pictures are equally bright
    assert claimed.value == long.value
    says("Against the noise of photons the signal is then four times as strong.")
    rng = np.random.default_rng(int(N.value))
    few, many = (rng.poisson(n, 40_000) for n in (500, 500 * times.value))
    assert (many.mean() / many.std()) / (few.mean() / few.std()) == pytest.approx(4, rel=0.03)


def test_the_replies_of_the_exercises(says):
    (airy,) = says("The 1.22 belongs to the Airy disc's dark ring.")
    assert airy == brentq(j1, 3, 4.5) / np.pi
    (two,) = says("Without the 2/π your lens is π/2 at frequency 0.")
    assert np.arccos(0) == pytest.approx(np.pi / two.value)
    (place,) = says("for the places x = step · 0, 1, 2 …")
    assert place.value == 2


def test_the_discs_are_equally_wide_where_the_picture_is_sharpest(says):
    (best,) = says("It is largest near f/5.6, where both discs are about equally wide.")
    assert 40 / best.value == pytest.approx(2 * brentq(j1, 3, 4.5) / np.pi * 0.55 * best.value, rel=0.1)
    assert max((1.4, 2, 2.8, 4, 5.6, 8, 11, 16), key=lambda N: mtf50(N, 0.04 / N, 0.004)) == best.value
    says("Set defocus to 0: without aberrations, a larger opening is now always sharper.")
    assert np.all(np.diff([mtf50(N, 0, 0.004) for N in (1.4, 2.8, 5.6, 11, 22)]) < 0)
    says("Nothing in this picture is out of focus.")
    sharp, soft = (SharpnessView(pitch_um=2.0, f_number=N).image()[..., 1] for N in (5.6, 32.0))
    inside = np.s_[35:85, 89:139]  # of the star
    assert np.std(soft[inside]) < 0.3 * np.std(sharp[inside])


def test_lens_and_pixel_by_hand_in_the_core(says):
    f, N, pitch = says("A grating of 100 cycles per mm, a perfect lens at f/8, pixels of 4 µm:")
    share = quad(lambda x: np.cos(2 * np.pi * f.value * x), 0, pitch.value / 2000)[0] / (pitch.value / 2000)
    assert lens(f.value, N.value) * share == pytest.approx(0.347, abs=5e-4)


def by_the_standard(profile, step, f):
    """Differences, window and correction of ISO 12233:2014, term by term."""
    n = len(profile) - 2
    window = [0.54 - 0.46 * np.cos(2 * np.pi * k / (n - 1)) for k in range(n)]
    light = [(profile[k + 2] - profile[k]) * window[k] for k in range(n)]
    waves = sum(one * np.exp(-2j * np.pi * f * step * k) for k, one in enumerate(light))
    return abs(waves) / abs(sum(light)) * (2 * np.pi * f * step) / np.sin(2 * np.pi * f * step)


def test_the_standard_s_window_sharpens_what_is_narrow(says):
    """A Gaussian and a pixel: MTF50 is the root of a formula; the profile is the integral of normal distributions."""
    sigma, narrow, wide = says(
        "a Gaussian blur of σ = 1 px, then the mean over a pixel. The window is as wide as the region that you cut "
        "out. Here it is 12 and 48 pixels wide."
    )
    truth, width, found, narrower, sharper, ours = says(
        "The truth has MTF50 at 0.180 cycles per pixel. In 48 pixels the recipe finds 0.181, and in 12 pixels 0.194: "
        "its window has cut off the feet of the line spread, and what is left looks sharper than it is. So a number by "
        "this recipe belongs to a width, and wants it said. camviz's window, flat over the edge, finds 0.180."
    )
    assert (width.value, narrower.value) == (wide.value, narrow.value)
    assert truth == brentq(lambda f: np.sinc(f) * np.exp(-2 * (np.pi * sigma.value * f) ** 2) - 0.5, 0.1, 0.3)
    for across, mark in ((width.value, found), (narrower.value, sharper)):
        x = np.arange(-across / 2, across / 2 + 0.1, 0.25)
        profile = [quad(lambda u: norm.cdf(u / sigma.value), one - 0.5, one + 0.5)[0] for one in x]
        assert mark == brentq(lambda f: by_the_standard(profile, 0.25, f) - 0.5, 0.1, 0.3)  # noqa: B023
    v, u = np.indices((80, 100))
    offsets = (np.arange(8) - 3.5) / 8
    lean = np.radians(5)
    light = np.mean(
        [norm.cdf((u + a - 50) * np.cos(lean) - (v + b - 40) * np.sin(lean)) for a in offsets for b in offsets], axis=0
    )
    assert ours == SlantedEdge.of(light).mtf50


def through_a_thin_lens(start, direction, focal, n):
    """A ray through an equiconvex lens of nearly no thickness by Snell's law: where it is behind it, and its way."""
    radius, thick = 2 * (n - 1) * focal, 1e-4
    place = np.array([*start, -10.0])
    for middle, before, after in ((radius, 1.0, n), (thick - radius, n, 1.0)):
        centre = np.array([0.0, 0.0, middle])
        b, c = direction @ (place - centre), (place - centre) @ (place - centre) - radius**2
        root = np.sqrt(b * b - c)
        place = place + (-b - root if middle > 0 else -b + root) * direction
        normal = (place - centre) / radius * (1 if middle > 0 else -1)
        cosine = -direction @ normal
        ratio = before / after
        direction = ratio * direction + (ratio * cosine - np.sqrt(1 - ratio**2 * (1 - cosine**2))) * normal
    return place, direction


def test_the_two_bowls_of_a_thin_lens_by_traced_rays(says):
    says("the bowls lie in front of the sensor by")
    focal, N, height, width = says("a lens of 50 mm at f/16 blurs tangential lines 10 mm from there over 0.23 mm.")
    n, h = 1.5, 3.0  # a small height: the formulas are the first terms of a series
    slope = h / focal.value
    way = np.array([0.0, slope, 1.0]) / np.hypot(slope, 1)

    def focus(aside):
        """How far in front of the sensor two near rays meet, that enter `aside` from the chief ray to either side."""
        ends = [through_a_thin_lens(np.array([0, -10 * slope]) + sign * aside, way, focal.value, n) for sign in (1, -1)]
        k = int(np.argmax(aside))
        (p, d), (q, e) = ends
        slopes = d[k] / d[2], e[k] / e[2]
        at = (q[k] - p[k] + slopes[0] * p[2] - slopes[1] * q[2]) / (slopes[0] - slopes[1])
        return focal.value - at

    flat = h**2 / (2 * focal.value)
    assert focus(np.array([0.02, 0])) == pytest.approx(flat * (1 + 1 / n), rel=0.03)
    assert focus(np.array([0, 0.02])) == pytest.approx(flat * (3 + 1 / n), rel=0.03)
    assert width == height.value**2 / (2 * focal.value * N.value) * (3 + 1 / 1.52)
    says("a solid curve for sagittal and a dashed one for tangential lines")
    again, index, stop, grating = says("a single lens of 50 mm, index 1.52, at f/16, for 10 cycles per mm.")
    assert (again.value, stop.value) == (focal.value, N.value)
    c = 100 / (2 * again.value * stop.value) * (1 + 1 / index.value), width.value
    sagittal, tangential = (abs(2 * j1(np.pi * grating.value * w) / (np.pi * grating.value * w)) for w in c)
    assert tangential < sagittal / 3  # 10 mm from the middle
    (two,) = says("The 2 below h² is missing")
    three, bracket = says("Your second width has the 3 before the whole bracket: the bracket is 3 + 1/n.")
    assert (two.value, three.value, bracket.value) == (2, 3, 3)


def test_what_glass_sends_back(says):
    surfaces, bare, coated = says(
        "A lens of ten glasses with air between them has 20 surfaces. Without a coating each reflects 4 % or more, "
        "with a good one about 0.5 %:"
    )
    assert surfaces == 2 * 10
    assert bare == 100 * ((1.5 - 1) / (1.5 + 1)) ** 2  # Fresnel, straight in
    (each,), (six, twenty) = (
        says("Each surface sends back about 4 % of the light."),
        says("Six surfaces leave 78 % of it, and twenty leave 44 %."),
    )  # fmt: skip
    left = [100.0]
    for _ in range(20):
        left.append(left[-1] * (1 - each.value / 100))
    assert six == left[6]
    assert twenty == left[20]
    assert 2 / np.sqrt(left[20] / 100) == pytest.approx(3.01, abs=5e-3)
    assert 2 / np.sqrt((1 - coated.value / 100) ** 20) == pytest.approx(2.10, abs=5e-3)
    again, pairs = says("20 surfaces make 190 pairs.")
    assert pairs == sum(1 for i in range(int(again.value)) for j in range(i))


def test_a_veil_on_black(says):
    glare, mean, stops = says(
        "With g = 2 % and a mean of 18 % of white, what was black comes out 8.1 stops below white"
    )
    veil = glare.value / 100 * mean.value / 100
    assert stops == np.log2((1 - glare.value / 100 + veil) / veil)
    (much,) = says("the garden through a lens with 20 % of glare")
    light = ExposureView().recorded(draft=True)
    veiled = (1 - much.value / 100) * light + much.value / 100 * light.mean(axis=(0, 1))
    np.testing.assert_allclose(veiled.mean(axis=(0, 1)), light.mean(axis=(0, 1)), rtol=1e-5)
    says("Spreading light evenly changes no mean, so the mean of what was recorded is that of the light.")


def test_two_cameras_of_one_number(says):
    says("Both are ISO 100 by the standard output sensitivity. By saturation they differ by half a stop.")
    for full, speed in ((0.552, 141), (0.78, 100)):
        assert 78 / full == pytest.approx(speed, abs=0.5)
    assert np.log2(0.78 / 0.552) == pytest.approx(0.5, abs=0.02)
    linear = brentq(lambda x: 255 * (1.055 * x ** (1 / 2.4) - 0.055) - 118, 0.01, 1)
    assert 10 / (0.552 * linear) == pytest.approx(100, abs=0.5)
    (recommended,) = says("REI, is 10/H, where H is what the maker recommends")
    (read,) = says("The exposure is read off at the number 118")
    (wrong, largest, mistaken, white, right), (half, again) = (
        says("You look for 18 % of 255, which is 46. The file's numbers are encoded: 18 % of white is 118 in sRGB."),
        says("You look for half of 255. The number of the standard is 118."),
    )  # fmt: skip
    assert mistaken == wrong.value / 100 * largest.value
    assert white.value == wrong.value
    assert right.value == again.value == read.value == pytest.approx(0.461 * half.value, abs=0.5)  # ISO 12232
    numerators = [
        *says("This is the exposure itself. The speed is 10 over it"),
        *says("Here it is 10 over the exposure."),
        *says("You interpolate 10 over the exposures."),
    ]
    assert {one.value for one in numerators} == {recommended.value}
    of_saturation = [*says("78 belongs to the satu"), *says("This is the saturation-based speed, 78 over")]
    assert [one.value for one in of_saturation] == [78, 78]
    named = [
        *says("At which exposure would the file have the number 118?"),
        *says("Here 118 decides."),
        *says("the numbers are known to be 118"),
    ]
    assert {one.value for one in named} == {read.value}
    assert recommended == 10


def test_the_steps_of_the_recipe(says):
    (steps,) = says("You correct for a difference of neighbours. Every second value is 2 steps away: sinc(")
    first, last = says("The recipe takes every second value: profile[2:] − profile[:-2].")
    assert steps.value == first.value == abs(last.value)
    (colours,) = says("(height, width, 3) by a camera")
    assert colours.value == ExposureView().recorded(draft=True).shape[-1]


def test_the_teacher_s_card_and_squared_paper(says):
    aside, height = says("their edges leaning: 9 mm aside on 10 cm of height")
    assert np.degrees(np.arctan(aside.value / (10 * height.value))) == pytest.approx(5, abs=0.2)
    says("a straight edge that moves one square aside in ten rows")
    assert len({round((row + 0.5) / 10 % 1, 6) for row in range(10)}) == 10
    narrow, wide = says("Ask how much longer the shutter stays open at f/16 than at f/8.")
    assert (narrow.value / wide.value) ** 2 == 4  # and not twice
