"""What lesson 17 claims about sharpness, exposure and metering, recomputed by SciPy's integrals, rays and counting."""

import cv2
import numpy as np
import pytest
from claims import claims
from scipy.integrate import quad
from scipy.optimize import brentq
from scipy.special import j1
from scipy.stats import norm

from camviz.scenes import to_linear
from camviz_clinic.measuring.sharpness import SlantedEdge
from camviz_school.views.exposure import ExposureView
from camviz_school.views.sharpness import SharpnessView

says = claims("17")

GREEN = 550e-6  # mm
AIRY = 2 * brentq(j1, 3, 4.5) / np.pi


def lens(f, N, c=0.0):
    """A perfect round lens with rays' disc c, by SciPy's quadrature over the overlap of the pupil with its copy."""
    s = f * GREEN * N
    if s >= 1:
        return 0.0
    return 4 / np.pi * quad(lambda x: np.sqrt(1 - (x + s) ** 2) * np.cos(np.pi * f * c * x), 0, 1 - s, limit=200)[0]


def disc(f, c):
    return 2 * j1(np.pi * f * c) / (np.pi * f * c)


def mtf50(N, c, pitch):
    f = np.linspace(1, 250, 60)
    values = np.array([abs(lens(one, N, c) * np.sinc(one * pitch)) for one in f])
    after = int(np.argmax(values < 0.5))
    return brentq(lambda one: abs(lens(one, N, c) * np.sinc(one * pitch)) - 0.5, f[after - 1], f[after])


def encoded(linear):
    return 255 * (1.055 * linear ** (1 / 2.4) - 0.055)  # IEC 61966-2-1


def test_the_photograph_s_mtf50(samples):
    """Rows' steepest places give the line; quarter-pixel strips, differences, NumPy's transform; nothing of camviz."""
    says("MTF50 is 0.149 ± 0.011 cycles per pixel: stripes that repeat every 6.7 pixels keep half of their contrast")
    photograph = cv2.imread(str(samples / "left06.jpg"), cv2.IMREAD_GRAYSCALE)
    light = to_linear(photograph[287:317, 559:583].astype(float) / 255)
    measured = SlantedEdge.of(light)
    assert (measured.mtf50, measured.mtf50_error) == pytest.approx((0.149, 0.011), abs=5e-4)
    assert 1 / measured.mtf50 == pytest.approx(6.7, abs=0.05)
    change, (v, u) = np.diff(light, axis=1), np.indices(light.shape)
    middle = (change * (u[:, 1:] - 0.5)).sum(axis=1) / change.sum(axis=1)
    slope, intercept = np.polyfit(np.arange(len(light)), middle, 1)
    d, borders = (u - slope * v - intercept) * np.cos(np.arctan(slope)), np.arange(-6, 6.1, 0.25)
    spread = np.diff(np.histogram(d, borders, weights=light)[0] / np.histogram(d, borders)[0])
    f, plain = np.fft.rfftfreq(512, 0.25), np.abs(np.fft.rfft(spread, 512)) / spread.sum()
    after = int(np.argmax(plain < 0.5))
    assert np.interp(-0.5, -plain[after - 1 : after + 1], f[after - 1 : after + 1]) == pytest.approx(0.149, abs=0.01)


def test_what_the_standard_of_2014_does_otherwise():
    says("At 5° the edge moves on by tan 5° = 0.087 px from row to row", "by a factor of 0.987 at half a cycle")
    assert [np.tan(np.radians(5)), np.sinc(1 / 16) ** 2] == pytest.approx([0.087, 0.987], abs=5e-4)
    says("At half a cycle per pixel it is 0.900.")
    wave = np.sin(np.pi * np.arange(400) / 4)
    assert np.abs(np.convolve(wave, [0.5, 0, -0.5], "valid") * 4).max() / np.pi == pytest.approx(0.900, abs=5e-4)


def test_the_standard_s_window_sharpens_what_is_narrow():
    """A Gaussian and a pixel: MTF50 is the root of a formula; the profile is the integral of normal distributions."""
    says("The truth has MTF50 at 0.180 cycles per pixel. In 48 pixels the recipe finds 0.181, and in 12 pixels 0.194")
    says("camviz's window, flat over the edge, finds 0.180.")
    found = [brentq(lambda f: np.sinc(f) * np.exp(-2 * (np.pi * f) ** 2) - 0.5, 0.1, 0.3)]
    for across in (48, 12):
        x = np.arange(-across / 2, across / 2 + 0.1, 0.25)
        profile = np.array([quad(norm.cdf, one - 0.5, one + 0.5)[0] for one in x])
        light = (profile[2:] - profile[:-2]) * np.hamming(len(x) - 2)

        def left(f, light=light):
            waves = light @ np.exp(-2j * np.pi * f * 0.25 * np.arange(len(light)))
            return abs(waves) / light.sum() / np.sinc(2 * f * 0.25) - 0.5

        found.append(brentq(left, 0.1, 0.3))
    assert found == pytest.approx([0.180, 0.181, 0.194], abs=5e-4)
    v, u = np.indices((80, 100))
    fine, lean = (np.arange(8) - 3.5) / 8, np.radians(5)
    edges = [norm.cdf((u + a - 50) * np.cos(lean) - (v + b - 40) * np.sin(lean)) for a in fine for b in fine]
    assert SlantedEdge.of(np.mean(edges, axis=0)).mtf50 == pytest.approx(0.180, abs=5e-4)


def test_the_picture_is_sharpest_where_both_discs_are_alike():
    says("It is largest near f/5.6, where both discs are about equally wide.")
    found = {N: mtf50(N, 0.04 / N, 0.004) for N in (1.4, 2, 2.8, 4, 5.6, 8, 11, 16, 32)}
    assert max(found, key=found.get) == 5.6
    view = SharpnessView(defocus_um=40.0, pitch_um=4.0)
    for N in (1.4, 5.6, 32):
        assert view.but(f_number=N).mtf50_per_mm == pytest.approx(found[N], rel=2e-3)
    says("Set **defocus** to 0: without aberrations, a larger opening is now always sharper.")
    assert np.all(np.diff([mtf50(N, 0, 0.004) for N in (1.4, 2.8, 5.6, 11, 22)]) < 0)
    says("until diffraction outgrows defocus and aberrations")


def test_diffraction_and_defocus_do_not_multiply():
    says("A grating of 100 cycles per mm, a perfect lens at f/8, pixels of 4 µm:")
    pixel = quad(lambda x: np.cos(2 * np.pi * 100 * x), 0, 0.002)[0] / 0.002
    assert [lens(100, 8), lens(100, 8) * pixel] == pytest.approx([0.458, 0.347], abs=5e-4)  # as the cells print
    says("their product is wrong: by up to 0.22 at half a wave of defocus")
    N, f = 8.0, np.linspace(1, 220, 110)
    c = 8 * N * 0.5 * GREEN
    exact = np.array([lens(one, N, c) for one in f])
    product = np.array([lens(one, N) for one in f]) * disc(f, c)
    assert np.abs(exact - product).max() == pytest.approx(0.22, abs=5e-3)
    system = SharpnessView(f_number=8.0, defocus_um=1000 * c * N).system(f)
    np.testing.assert_allclose(system, np.abs(exact * np.sinc(f * 0.004)), atol=1e-6)


def test_why_an_opening_s_overlap_with_its_copy_is_its_mtf():
    """Two slits before a screen, the pairs of points of a disc that stand so far apart, and two spheres' distance."""
    says("Two points of the opening draw stripes on the sensor, as two slits do: the farther apart they are, the finer")
    v, N, f = 50.0, 8.0, 100.0  # mm and cycles per mm
    apart, at = f * GREEN * v, np.linspace(0, 0.2, 2001)
    light = np.abs(sum(np.exp(2j * np.pi / GREEN * np.hypot(v, at - slit)) for slit in (-apart / 2, apart / 2))) ** 2
    assert np.argmax(np.abs(np.fft.rfft(light[:-1] - light[:-1].mean()))) / 0.2 == pytest.approx(f)
    y, x = np.mgrid[-1:1:801j, -1:1:801j] * v / N / 2
    inside, moved = (np.hypot(x - shift, y) <= v / N / 2 for shift in (0, apart))
    assert (inside & moved).sum() / inside.sum() == pytest.approx(lens(f, N), abs=2e-3)
    says("at the rim, by W = c/(8N) more than in the middle")
    radius, dz = 50 / 16, 0.02
    assert radius**2 / 2 / 50 - radius**2 / 2 / (50 + dz) == pytest.approx((dz / N) / (8 * N), rel=1e-3)


def through_a_thin_lens(start, direction, focal, n):
    """A ray through an equiconvex lens of nearly no thickness by Snell's law: where it is behind it, and its way."""
    radius, thick = 2 * (n - 1) * focal, 1e-4
    place = np.array([*start, -10.0])
    for middle, ratio in ((radius, 1 / n), (thick - radius, n)):
        away = place - [0, 0, middle]
        b = direction @ away
        root = np.sqrt(b * b - away @ away + radius**2)
        place = place + (-b - root if middle > 0 else -b + root) * direction
        normal = (place - [0, 0, middle]) / radius * np.sign(middle)
        cosine = -direction @ normal
        direction = ratio * direction + (ratio * cosine - np.sqrt(1 - ratio**2 * (1 - cosine**2))) * normal
    return place, direction


def test_the_two_bowls_of_a_thin_lens_by_traced_rays():
    says("a lens of 50 mm at f/16 blurs tangential lines 10 mm from there over 0.23 mm")
    n, h, focal = 1.5, 3.0, 50.0  # a small height: the formulas are the first terms of a series
    way = np.array([0.0, h / focal, 1.0]) / np.hypot(h / focal, 1)

    def focus(k):
        """How far in front of the sensor two near rays meet, that enter beside the chief ray along axis k."""
        aside = 0.02 * np.eye(2)[k]
        ends = [through_a_thin_lens([0, -10 * h / focal] + sign * aside, way, focal, n) for sign in (1, -1)]
        (p, s), (q, t) = ((place, d[k] / d[2]) for place, d in ends)
        return focal - (q[k] - p[k] + s * p[2] - t * q[2]) / (s - t)

    for k, formula in enumerate((1 + 1 / n, 3 + 1 / n)):
        assert focus(k) == pytest.approx(h**2 / (2 * focal) * formula, rel=0.03)
    assert 10**2 / (2 * focal * 16) * (3 + 1 / 1.52) == pytest.approx(0.23, abs=5e-3)


def test_the_corners():
    """The share of the aperture that the rim leaves open, counted point by point; and a hole's light, ray by ray."""
    says("At f/1.4 the corners of your pictures are much darker than the middle. You stop down to f/8")
    says("A rim of the barrel, 32 mm wide, stands 20 mm in front of the aperture.", "through a lens of 35 mm on full")
    says("At f/1.4 the corner gets 31 % of the light in the middle, and at f/8 it still gets only 52 %.")
    slope, (v, u) = np.hypot(36, 24) / 2 / 35, np.mgrid[-1:1:1201j, -1:1:1201j]

    def corner(N):
        seen = np.hypot(u * 35 / N / 2 - 20 * slope, v * 35 / N / 2) <= 16
        return np.mean(seen[u**2 + v**2 <= 1]) * np.cos(np.arctan(slope)) ** 4

    assert [100 * corner(N) for N in (1.4, 8)] == pytest.approx([31, 52], abs=0.5)
    assert corner(5.6) == pytest.approx(corner(8)) != pytest.approx(corner(4), rel=1e-3)
    drawn = ExposureView(f_number=1.4, vignetting="cos⁴ and rim").falloff(np.array(np.hypot(18, 12)))
    assert drawn == pytest.approx(0.31, abs=5e-3)
    says("Behind a small hole, light that comes at an angle θ is weaker by cos⁴ θ.")
    x, y = np.meshgrid(np.linspace(-0.01, 0.01, 41), np.linspace(-0.01, 0.01, 41))
    middle, beside = (np.sum((np.hypot(x, y) <= 0.01) / (1 + (a - x) ** 2 + y**2) ** 2) for a in (0, 1))
    assert beside / middle == pytest.approx(1 / 4, rel=1e-4)


def test_iso_multiplies_the_signal_after_the_exposure():
    says("You turn ISO from 100 to 1600.")
    says("**ISO is gain.** It multiplies the signal of the pixel's electrons, and with it all noise that comes before")
    says("Noise that comes after it is not lifted (lesson 14); the camera above has none of that kind.")
    says("it multiplies the signal after the exposure, with the noise that it has by then")
    rng = np.random.default_rng(3)
    light, before, after = rng.poisson(400, 40_000), rng.normal(0, 3, 40_000), rng.normal(0, 30, 40_000)
    once, often = (gain * (light + before) for gain in (1, 16))
    assert often.std() / once.std() == pytest.approx(16)
    assert (often + after).std() / 16 < 0.7 * (once + after).std()  # in electrons
    low, high = (ExposureView(iso=iso) for iso in (0.0, 4.0))
    assert low.electrons_of_white == pytest.approx(high.electrons_of_white)
    assert high.sensor.gain_dn_per_e / low.sensor.gain_dn_per_e == pytest.approx(16)
    says("Four pictures of equal brightness, each with a quarter of the light of the one before:")
    for iso, electrons, ratio in ((0, 5400, 73), (2, 1350, 37), (4, 338, 18), (6, 84, 9)):
        free = 0.18 * 30_000 * 2.0 ** (15 - np.log2(8.0**2 * 2.0 ** (9 + iso)))
        assert [free, free / np.sqrt(free + 9)] == pytest.approx([electrons, ratio], abs=0.5)
        assert ExposureView(iso=float(iso), shutter=-9.0 - iso).numbers()["18 % grey"] == f"{electrons:,} electrons"


def test_a_meter_s_greys():
    says("Yes: 18 % of white, whatever it is.", "it makes the mean of the picture 18 % of white")
    says("In full sun f/16 at 1/125 s is right for ISO 100: EV 15, the sunny 16 rule. f/8 at 1/500 s lets in the same")
    assert np.log2([16**2 * 125, 8**2 * 500]) == pytest.approx([15, 15], abs=0.05)
    says(
        "A surface metered as the mean comes out at 10/78 = 12.8 % of saturation.", "or 4096 cd/m²", "170 times darker"
    )
    assert pytest.approx([12.8, 4096], abs=0.05) == [10 / 0.78, 0.125 * 2**15]
    assert 2 ** (15 - np.log2(1.8**2 * 60)) == pytest.approx(170, abs=5)
    says("Middle grey, 18 % of white, is 2.5 stops below white. In an 8-bit sRGB picture it is the number 118.")
    says("five times as much as middle grey, and so it wants 2.3 stops more than the meter says")
    assert [-np.log2(0.18), np.log2(0.9 / 0.18)] == pytest.approx([2.5, 2.3], abs=0.05)
    assert encoded(0.18) == pytest.approx(118, abs=0.5)
    for subject in ("garden", "snow", "coal"):
        recorded = ExposureView(subject=subject, metering="average").recorded(draft=True)
        assert 100 * recorded.mean() == pytest.approx(18, abs=0.5)


def test_two_cameras_of_one_number():
    says("Both are ISO 100 by the standard output sensitivity. By saturation they differ by half a stop.")
    says("SOS, is 10/H, where H gives number 118 of 255 in the sRGB file, which is 18 % of white")
    linear = brentq(lambda x: encoded(x) - 118, 0.01, 1)
    assert 100 * linear == pytest.approx(18, abs=0.5)
    assert [10 / (0.552 * linear), 78 / 0.552, 78 / 0.78] == pytest.approx([100, 141, 100], abs=0.5)
    assert np.log2(0.78 / 0.552) == pytest.approx(0.5, abs=0.02)


def test_what_glass_sends_back():
    says("Yes. Each surface sends back about 4 % of the light.")
    says("has 20 surfaces. Without a coating each reflects 4 % or more", "20 surfaces make 190 pairs.")
    says("Six surfaces leave 78 % of it, and twenty leave 44 %.")
    assert pytest.approx(4) == 100 * ((1.5 - 1) / (1.5 + 1)) ** 2  # Fresnel, straight in
    assert pytest.approx([78, 44, 190], abs=0.5) == [96 * 0.96**5, 96 * 0.96**19, 20 * 19 / 2]
    assert pytest.approx([3.01, 2.10], abs=5e-3) == [2 / 0.96**10, 2 / 0.995**10]  # T-stops, as the cell prints


def test_a_veil_on_black():
    says("With g = 2 % and a mean of 18 % of white, what was black comes out 8.1 stops below white")
    light = np.array([0.0, 1.0])
    black, white = 0.98 * light + 0.02 * 0.18
    assert np.log2(white / black) == pytest.approx(8.1, abs=0.05)


def test_question_stop_down():
    says("the sensor stands 40 µm behind the sharp image. Its pixels are 4 µm wide.", "for green light of 550 nm")
    says("Out of focus by 40 µm, the cone of f/1.4 is 29 µm wide on the sensor: seven pixels.")
    says("The disc of the rays is 40 µm / N wide, the Airy disc 2.44 λ N. They are equally wide at N = 5.5")
    says("At f/32 the rays' disc is only 1.3 µm wide, and the Airy disc 43 µm.", "125 cycles per mm here")
    assert pytest.approx([29, 43, 125], abs=0.5) == [40 / 1.4, AIRY * 0.55 * 32, 0.5 / 0.004]
    assert pytest.approx([2.44, 1.25], abs=5e-3) == [AIRY, 40 / 32]
    assert np.sqrt(40 / (AIRY * 0.55)) == pytest.approx(5.5, abs=0.05)


def test_questions_mtf_and_causes():
    says(
        "come out with 30 % of their contrast", "Its mark is 0.6", "As stripes everywhere, with 60 % of their contrast."
    )
    says(
        "Yes: 0.25 cycles per pixel is one cycle in four pixels, and 0.3 of its contrast is left.",
        "Yes: 0.6 times 0.5.",
    )
    says("0.32: the camera takes its share", "and 0.8 of its contrast arrives there.", "0.55, their mean.")
    width = brentq(lambda w: np.sinc(w) - 0.4, 0, 1)  # of a pixel that leaves this much of one cycle
    seen = quad(lambda x: 0.8 * np.cos(2 * np.pi * x), -width / 2, width / 2)[0] / width
    assert [seen, 0.6 * 0.5, (0.6 + 0.5) / 2] == pytest.approx([0.32, 0.3, 0.55])


def test_questions_stops():
    says(
        "A picture is right at f/4, 1/60 s and ISO 400.",
        "f/8, 1/30 s, ISO 800",
        "This picture is four times as bright.",
    )
    says("At f/5.6, 1/50 s and ISO 200 a picture is right.", "f/2.8, 1/400 s, ISO 400", "comes out twice as bright.")

    def brightness(N, time, iso):
        return iso / time / N**2

    first = [brightness(*one) / brightness(4, 60, 400) for one in ((8, 60, 800), (8, 30, 800), (2.8, 30, 400))]
    assert first == pytest.approx([1 / 2, 1, 4], rel=0.03)
    second = [brightness(*one) / brightness(5.6, 50, 200) for one in ((8, 100, 200), (2.8, 200, 400), (2.8, 400, 400))]
    assert second == pytest.approx([1 / 4, 2, 1], rel=0.03)


def test_question_noise():
    says("The one of 1/10 s: it got more light.")
    says("once for 1/10 s at ISO 200, once for 1/160 s at ISO 3200", "Yes: 16 times the light.", "four times as strong")
    few, many = (np.random.default_rng(4).poisson(n, 40_000) for n in (500, 500 * 160 / 10))
    assert (many.mean() / many.std()) / (few.mean() / few.std()) == pytest.approx(4, rel=0.03)
    assert 160 / 10 == 3200 / 200
