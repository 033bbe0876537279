"""What lesson 13 says about white balance and colour, recomputed with colour-science, NumPy and OpenCV."""

import re
import warnings
from functools import lru_cache

import cv2
import numpy as np
import pytest
from quoting import LESSONS
from scipy.optimize import minimize

from camviz.colour import balance, spectra
from camviz.colour.spaces import delta_e_2000, to_lab
from camviz.scenes.photographs import photograph
from camviz_school.course import notebooks
from camviz_school.course.checks import judge
from camviz_school.course.exercises import exercise
from camviz_school.course.material import module
from camviz_school.views.colour import ColourView

lesson13 = module("13")

with warnings.catch_warnings():
    warnings.simplefilter("ignore")
    import colour

EXCEPTIONS: dict[str, str] = {}

NM = np.arange(380, 781, 5)
D65 = colour.xy_to_XYZ((0.3127, 0.3290))
BULB = 2850.0


# The virtual camera once more, of colour-science's tables ------------------------------------------------------------


def at_nm(spectrum):
    return np.interp(NM, spectrum.domain, spectrum.range, left=0, right=0)


def columns(several):
    return np.stack([at_nm(several.signals[label]) for label in several.labels], axis=-1)


EYE = columns(colour.MSDS_CMFS["CIE 1931 2 Degree Standard Observer"])
NIKON = columns(colour.MSDS_CAMERA_SENSITIVITIES["Nikon 5100 (NPL)"])
PATCHES = {name.partition(" (")[0]: at_nm(one) for name, one in colour.SDS_COLOURCHECKERS["cc_ohta"].items()}
NAMES, CHART = list(PATCHES), np.array(list(PATCHES.values()))
GREYS, COLOURED = np.s_[18:], np.s_[:18]
WHITE = NAMES.index("white 9.5")


def planckian(kelvin):
    return at_nm(colour.sd_blackbody(kelvin, colour.SpectralShape(380, 780, 5)))


def daylight(kelvin):
    """Weights of the CIE's daylight, not rounded as colour-science does by default."""
    x, y = colour.temperature.CCT_to_xy_CIE_D(kelvin)
    share = 0.0241 + 0.2562 * x - 0.7341 * y
    weights = (1, (-1.3515 - 1.7703 * x + 5.9114 * y) / share, (0.03 - 31.4424 * x + 30.0717 * y) / share)
    basis = colour.colorimetry.SDS_BASIS_FUNCTIONS_CIE_ILLUMINANT_D_SERIES
    return sum(weight * at_nm(basis[name]) for weight, name in zip(weights, ("S0", "S1", "S2"), strict=True))


def counted(light, sensor, surfaces=CHART):
    """Raw colours, at an exposure for which the green of a perfect white is 1."""
    return (light * surfaces) @ sensor / (light @ sensor)[1]


def seen(light, surfaces=CHART):
    """XYZ for an eye that has grown used to the light, under D65."""
    xyz, white = ((light * one) @ EYE / (light @ EYE[:, 1]) for one in (surfaces, np.ones(81)))
    return xyz @ colour.adaptation.matrix_chromatic_adaptation_VonKries(white, D65, transform="Bradford").T


def srgb_space():
    space = colour.RGB_COLOURSPACES["sRGB"].copy()
    space.use_derived_transformation_matrices(True)
    return space


SRGB = srgb_space()


def lab(xyz):
    return colour.XYZ_to_Lab(xyz, (0.3127, 0.3290))


def delta(rgb, truth):
    """ΔE2000 of linear sRGB from XYZ."""
    return colour.delta_E(lab(rgb @ SRGB.matrix_RGB_to_XYZ.T), lab(truth), method="CIE 2000")


def fitted(raw, target, white, white_target):
    """The M with the least Σ |M raw − target|² that takes white to its target, by Lagrange's multipliers."""
    system = np.block([[raw.T @ raw, white[:, None]], [white[None], np.zeros((1, 1))]])
    return np.linalg.solve(system, np.vstack([raw.T @ target, white_target]))[:3].T


def in_light(light):
    """Raw colours balanced on a perfect white, the matrix for the light, and the truth."""
    raw, white, truth = counted(light, NIKON), counted(light, NIKON, np.ones(81)), seen(light)
    balanced = raw * (white[1] / white)
    return balanced, fitted(balanced, truth @ SRGB.matrix_XYZ_to_RGB.T, np.ones(3), SRGB.matrix_XYZ_to_RGB @ D65), truth


@lru_cache
def shot(kelvin, patch=WHITE, kind="bulb", camera="Nikon"):
    """Raw colours, gains that make a patch grey, the matrix for the light, and the truth."""
    light = planckian(kelvin) if kind == "bulb" else daylight(kelvin)
    sensor = NIKON if camera == "Nikon" else EYE
    raw, white, truth = counted(light, sensor), counted(light, sensor, np.ones(81)), seen(light)
    balanced = raw * (white[1] / white)
    matrix = fitted(balanced, truth @ SRGB.matrix_XYZ_to_RGB.T, np.ones(3), SRGB.matrix_XYZ_to_RGB @ D65)
    gains = raw[patch, 1] / raw[patch] if patch is not None else white[1] / white
    return raw, gains, matrix, truth


def encoded(light):
    return colour.cctf_encoding(np.clip(light, 0, 1), function="sRGB")


def decoded(values):
    return colour.cctf_decoding(np.clip(values, 0, 1), function="sRGB")


def photographed(name, light):
    """Raw colours of surfaces that look like the photograph in daylight (Mallett and Yuksel 2019)."""
    picture = photograph(name)
    scale = 208 / max(picture.shape[:2])
    small = cv2.resize(picture, None, fx=scale, fy=scale, interpolation=cv2.INTER_AREA)
    primaries = columns(colour.recovery.MSDS_BASIS_FUNCTIONS_sRGB_MALLETT2019).T
    return decoded(small / 255) @ counted(light, NIKON, primaries)


def grey_world(raw):
    mean = raw.reshape(-1, 3).mean(axis=0)
    return mean[1] / mean


def white_patch(raw):
    brightest = np.percentile(raw.reshape(-1, 3), 99, axis=0)  # the view leaves out one in a hundred
    return brightest[1] / brightest


# Part 1 --------------------------------------------------------------------------------------------------------------


def test_a_bulb_s_raw_picture_is_yellow(says):
    low, high = says("Pull **temperature** from the 2850 K of a bulb up to 12000 K")
    assert low == BULB
    view = ColourView(matrix="off", patch=18)
    assert view.kelvin == low.value
    assert view.controls()["kelvin"].high == high.value
    yellow, greenish, blue_green = says(
        "The white patch is counted yellow at 2850 K, greenish at 5000 K and blue-green at 12000 K."
    )
    red, green, blue = shot(yellow.value)[0][WHITE]
    assert red > green > 2 * blue
    red, green, blue = shot(greenish.value)[0][WHITE]
    assert green > 1.2 * max(red, blue)
    red, green, blue = shot(blue_green.value)[0][WHITE]
    assert min(green, blue) > 1.5 * red
    says("You would call it white in all of these lights.")
    for kelvin in (yellow, greenish, blue_green):
        assert np.hypot(*lab(shot(kelvin.value)[3])[WHITE, 1:]) < 3


def test_the_chart_of_twenty_four(says):
    (patches,) = says("takes the balanced colours of the 24 patches as near as possible to the truth")
    (raw,) = says("and the mean of its 24 raw colours")
    assert raw.value == len(shot(BULB)[0])
    (found,) = says("OpenCV can find the chart of 24 patches in a photograph")
    assert patches == len(CHART)
    assert found == len(CHART)
    (fitted_to,) = says("the matrix was fitted to those 24 spectra in that light")
    (again,) = says("The matrix was fitted to those 24 spectra.")
    (once_more,) = says("Nothing certain: the fit is to 24 spectra in one light.")
    assert fitted_to.value == again.value == once_more.value == len(CHART)


def test_balance_alone_brings_the_greys_home_and_not_the_colours(says):
    raw, gains, _, truth = shot(BULB)
    off = delta(raw * gains, truth)
    most, coloured, mean, green = says(
        "none is off by more than 0.51. The 18 coloured patches are still off by 9.4 on average, green by 12.6."
    )
    assert most == off[GREYS].max()
    assert coloured == len(off[COLOURED])
    assert mean == off[COLOURED].mean()
    assert green == off[NAMES.index("green")]
    assert off.argmax() == NAMES.index("green")
    patches, mean, green = says("The 18 coloured patches stay pale: they are off by 9.4 ΔE on average, green by 12.6.")
    assert patches == len(off[COLOURED])
    assert mean == off[COLOURED].mean()
    assert green == off.max()
    chroma = [np.hypot(*lab(xyz)[COLOURED, 1:].T) for xyz in ((raw * gains) @ SRGB.matrix_RGB_to_XYZ.T, truth)]
    assert (chroma[0] < 0.7 * chroma[1]).all()
    says("the colours are too pale, and some have the wrong hue")
    hues = [np.arctan2(*lab(xyz)[COLOURED, :0:-1].T) for xyz in ((raw * gains) @ SRGB.matrix_RGB_to_XYZ.T, truth)]
    assert np.abs(np.angle(np.exp(1j * (hues[0] - hues[1]))))[COLOURED].max() > np.radians(10)


def test_the_matrix_brings_the_mean_down_and_leaves_grey(says):
    raw, gains, matrix, truth = shot(BULB)
    patches, before, after = says("The matrix brings the mean ΔE of all 24 from 7.15 down to 0.96.")
    assert patches == len(CHART)
    assert before == delta(raw * gains, truth).mean()
    assert after == delta((raw * gains) @ matrix.T, truth).mean()
    (nearly,) = says("Gains and a matrix left a mean ΔE of 0.96 on the chart.")
    assert nearly.value == after.value
    says("It leaves a perfect grey as it is: each of its rows adds up to 1.")
    np.testing.assert_allclose(matrix @ np.ones(3), 1, atol=1e-9)


def test_a_matrix_for_daylight_is_worse_by_the_bulb(says):
    (off,) = says("The one that was fitted **for daylight** leaves 2.98 in the light of the bulb.")
    raw, gains, _, truth = shot(BULB)
    assert off == delta((raw * gains) @ in_light(at_nm(colour.SDS_ILLUMINANTS["D65"]))[1].T, truth).mean()


def test_the_gains_of_the_click(says):
    gains = shot(BULB)[1]
    percent, factor = says("Red falls by 6 %, blue rises by a factor of 2.2")
    assert percent == 100 * (1 - gains[0])
    assert factor == gains[2]
    assert gains[1] == 1


def test_a_red_patch_made_grey_spoils_the_others(says):
    says("What is red is now made grey, and all other colours are wrong for it.")
    raw, gains, matrix, truth = shot(BULB, NAMES.index("red"))
    assert delta((raw * gains) @ matrix.T, truth).min() > 5


def test_three_by_three(says):
    shape = shot(BULB)[2].shape
    for said in (
        says("sums over arrays, a 3 × 3 matrix, least squares"),
        says("A screen's red, green and blue are mixtures of X, Y, Z, another 3 × 3 matrix."),
        says("three gains cannot undo that: it takes the 3 × 3 matrix"),
        says("Why does a camera need a 3 × 3 matrix besides its white balance?"),
    ):
        assert tuple(one.value for one in said) == shape
    rows, columns_ = says("and a 3 × 3 matrix $M$")
    assert (rows.value, columns_.value) == shape


def test_the_grid_of_wavelengths(says):
    low, high, step = says("camviz keeps spectra from 380 to 780 nm, every 5 nm")
    np.testing.assert_array_equal(np.arange(low.value, high.value + 1, step.value), NM)
    np.testing.assert_array_equal(spectra.WAVELENGTHS_NM, NM)


def test_bradfords_matrix_and_cielab_are_as_published(says):
    """Lam's matrix, and the CIE's formula, as colour-science has them."""
    entries = says(
        r"$$B = \\begin{pmatrix} 0.8951 & 0.2664 & -0.1614 \\\\ -0.7502 & 1.7135 & 0.0367 \\\\ 0.0389 & -0.0685 "
        r"& 1.0296 \\end{pmatrix}$$"
    )
    published = np.abs(colour.adaptation.CHROMATIC_ADAPTATION_TRANSFORMS["Bradford"]).ravel()
    assert [entry.value for entry in entries] == pytest.approx(published)
    (light_,) = says("$L^*$ is the lightness, 0 for black and 100 for the white.")
    assert light_.value == pytest.approx(lab(D65)[0])
    assert lab(0 * D65)[0] == pytest.approx(0)
    for xyz in (np.array([0.4, 0.3, 0.2]), 0.004 * D65):
        t = xyz / D65
        f = np.where(t > (6 / 29) ** 3, np.cbrt(t), (29 / 6) ** 2 * t / 3 + 4 / 29)
        by_formula = [116 * f[1] - 16, 500 * (f[0] - f[1]), 200 * (f[1] - f[2])]
        np.testing.assert_allclose(by_formula, lab(xyz), atol=1e-9)


def test_one_sum_by_hand_is_the_chart_s():
    cells = notebooks.read(LESSONS / "13_white_balance_and_colour.ipynb").cells
    printed = "".join(out.get("text", "") for cell in cells for out in cell.get("outputs", []))
    share = counted(planckian(BULB), NIKON)[NAMES.index("cyan"), 0] / counted(planckian(BULB), NIKON, np.ones(81))[0]
    assert f"as a share: {share:.3f}" in printed


# Part 3 --------------------------------------------------------------------------------------------------------------


def chart_off(gains, kelvin=6500.0):
    raw, _, matrix, truth = shot(kelvin, WHITE, "daylight")
    return delta((raw * gains) @ matrix.T, truth)


def test_grey_world_takes_the_coffee_for_brown_light(says):
    light = daylight(6500.0)
    gains = grey_world(photographed("coffee", light))
    blue, alone, off = says(
        "Blue is multiplied by 1.81, where daylight alone asks for 1.17. What is truly grey looks blue now, and the "
        "chart is off by 20 ΔE on average."
    )
    assert blue == gains[2]
    assert alone == shot(6500.0, None, "daylight")[1][2]
    assert off == chart_off(gains).mean()
    raw, _, matrix, _ = shot(6500.0, WHITE, "daylight")
    greys = lab((raw * gains) @ matrix.T @ SRGB.matrix_RGB_to_XYZ.T)[GREYS]
    assert (greys[:, 2] < -15).all()
    says("With grey world the chart turns blue beside the coffee. Take the rocket and it turns yellowish.")
    greys = lab((raw * grey_world(photographed("rocket", light))) @ matrix.T @ SRGB.matrix_RGB_to_XYZ.T)[GREYS]
    assert (greys[:, 2] > 5).all()


def test_white_patch_needs_a_white(says):
    light = daylight(6500.0)
    better, worse = says("white patch does better with the coffee: 2.89 in place of 20.36")
    assert better == chart_off(white_patch(photographed("coffee", light))).mean()
    assert worse == chart_off(grey_world(photographed("coffee", light))).mean()
    (off,) = says("The brightest things beside the rocket are yellow lamps, and the chart is off by 13.39.")
    assert off == chart_off(white_patch(photographed("rocket", light))).mean()
    linear = decoded(photograph("rocket") / 255)
    bright = linear[linear.mean(axis=-1) > np.percentile(linear.mean(axis=-1), 99)].mean(axis=0)
    assert bright[0] > bright[1] > 1.5 * bright[2]


def test_opencv_s_grey_world_scales_down_and_takes_whole_numbers_only(says):
    says("scales all channels down to the smallest one, so that the picture becomes darker")
    says("It takes whole numbers only, `uint8` or `uint16`; a picture in floating point stops it.")
    rgb = np.random.default_rng(8).uniform(0.1, 0.6, (50, 70, 3)) * [1.0, 1.4, 0.7]
    balancer = cv2.xphoto.createGrayworldWB()
    balancer.setSaturationThreshold(1.0)
    smallest = rgb.reshape(-1, 3).mean(axis=0).min()
    for kind, full in ((np.uint8, 255), (np.uint16, 65535)):
        result = balancer.balanceWhite(np.rint(full * rgb).astype(kind))
        assert result.dtype == kind
        np.testing.assert_allclose(result.reshape(-1, 3).mean(axis=0) / full, smallest, atol=0.01)
    for kind in (np.float32, np.float64):
        with pytest.raises(cv2.error):
            balancer.balanceWhite(rgb.astype(kind))


def test_a_green_lamp_needs_a_tint(says):
    kelvin, tint = says("Put it back to 5100 K and move **set tint (Duv)** to about +0.018: the greys are grey.")
    light = daylight(5000.0) * 2 ** (0.5 * np.exp(-(((NM - 545) / 60) ** 2)))  # as ColourView's tint of ½
    bare = at_nm(colour.SDS_ILLUMINANTS["D65"])
    xyz_from_raw = fitted(counted(bare, NIKON), seen(bare), counted(bare, NIKON, np.ones(81)), D65)
    raw, white, truth = counted(light, NIKON), counted(light, NIKON, np.ones(81)), seen(light)
    target, to_white = truth @ SRGB.matrix_XYZ_to_RGB.T, SRGB.matrix_XYZ_to_RGB @ D65
    matrix = fitted(raw * (white[1] / white), target, np.ones(3), to_white)

    def greys(temperature, duv):
        """Their CIELAB when the balance is set by hand."""
        xy = colour.UCS_uv_to_xy(colour.temperature.CCT_to_uv_Ohno2013([temperature, duv]))
        made = np.linalg.solve(xyz_from_raw, colour.xy_to_XYZ(xy))
        return lab((raw * (made[1] / made)) @ matrix.T @ SRGB.matrix_RGB_to_XYZ.T)[GREYS]

    tints = np.arange(-0.03, 0.0301, 0.001)
    best = tints[np.argmin([np.abs(greys(kelvin.value, duv)[:, 1:]).max() for duv in tints])]
    assert tint.about(best, 0.12)
    (back,) = says("put it back to 5100 K, and move set tint (Duv)")
    assert back.value == kelvin.value
    assert np.abs(greys(kelvin.value, tint.value)[:, 1:]).max() < 4 < 14 < np.abs(greys(kelvin.value, 0)[:, 1:]).max()
    says("blue on one side, yellow on the other, and green in between")
    says("at the best setting a green cast is left")
    says("takes them away without a worse cast of yellow or blue")
    chroma = {t: np.hypot(*greys(t, 0)[:, 1:].T).max() for t in range(2000, 12001, 250)}
    nearest = min(chroma, key=chroma.get)
    a, b = greys(nearest, 0)[0, 1:]
    assert a < -10
    assert abs(b) < abs(a)
    assert greys(2000, 0)[0, 2] < -50
    assert greys(12000, 0)[0, 2] > 25
    uncast = min(chroma, key=lambda t: abs(greys(t, 0)[0, 1]))
    assert chroma[uncast] > 1.5 * chroma[nearest]
    own = colour.temperature.uv_to_CCT_Ohno2013(colour.xy_to_UCS_uv(colour.XYZ_to_xy(light @ EYE)))
    assert tint == own[1]


def test_daylight_lies_beside_the_line_of_black_bodies(says):
    (duv,) = says("fluorescent lamps and filtered light have some, and even daylight has +0.003")
    white = colour.xy_to_UCS_uv((0.3127, 0.3290))
    temperature, beside = colour.temperature.uv_to_CCT_Ohno2013(white)
    assert duv == beside
    not_it, near, beside_it = says(
        "D65 is not a black body at 6500 K: it is a table of numbers, near 6504 K, with Duv = +0.003."
    )
    assert near == temperature
    assert beside_it == beside
    d65 = colour.CCS_ILLUMINANTS["CIE 1931 2 Degree Standard Observer"]["D65"]
    body = colour.sd_blackbody(not_it.value, colour.SpectralShape(360, 830, 5))
    bars = colour.MSDS_CMFS["CIE 1931 2 Degree Standard Observer"]
    every = np.stack([np.interp(body.domain, bars.domain, bars.values[:, i]) for i in range(3)], axis=-1)
    assert np.abs(colour.XYZ_to_xy(body.range @ every) - d65).max() > 0.005


# Part 4 --------------------------------------------------------------------------------------------------------------


def test_the_count_of_equations(says):
    says("Three of the equations are those of one patch")
    before, of_them = says("It is fitted to the chart, 72 equations for 9 unknowns.")
    patches, equations, unknowns = says(
        "takes the balanced colours of the 24 patches as near as possible to the truth: 72 equations, 9 unknowns, "
        "least squares"
    )
    raw, _, matrix, _ = shot(BULB)
    assert patches == len(CHART)
    assert equations == raw.size
    assert unknowns == matrix.size
    assert (before.value, of_them.value) == (equations.value, unknowns.value)


def test_a_matrix_subtracts_and_makes_noise_stronger(says):
    says("The negative numbers subtract what one channel counted of another's light.")
    says("Noise does not subtract: the matrix makes that of red twice as strong.")
    matrix = shot(BULB)[2]
    assert (matrix < 0).sum() >= 5
    noise = np.random.default_rng(0).normal(size=(100_000, 3))
    assert (noise @ matrix.T).std(axis=0)[0] == pytest.approx(2, rel=0.05)


def test_opencv_s_matrix_is_transposed(says):
    says("`cv2.ccm` writes `rgb @ C`: its C is our M transposed")
    rng = np.random.default_rng(0)
    source = rng.uniform(0.3, 0.6, (24, 1, 3))
    target = source @ np.array([[1.5, -0.4, -0.1], [-0.2, 1.4, -0.2], [0.1, -0.5, 1.4]]).T
    model = cv2.ccm.ColorCorrectionModel(source, encoded(target), cv2.ccm.COLOR_SPACE_SRGB)
    model.setLinearization(cv2.ccm.LINEARIZATION_IDENTITY)
    model.setDistance(cv2.ccm.DISTANCE_RGBL)
    c = model.compute()
    raw, wanted = (np.reshape(one, (-1, 3)) for one in (model.getSrcLinearRGB(), model.getRefLinearRGB()))
    assert np.abs(raw @ c - wanted).max() < np.abs(raw @ c.T - wanted).max() / 3
    np.testing.assert_allclose(lesson13.fit_matrix(raw, wanted).T, np.linalg.lstsq(raw, wanted, rcond=None)[0])


# Part 5 --------------------------------------------------------------------------------------------------------------


def test_a_factor_before_and_after_gamma(says):
    power, again = says(
        "On values with a power of 1/2.2, multiplying by g multiplies the light by g to the power of 2.2."
    )
    assert again.value == power.value
    light = np.linspace(0.05, 0.4, 7)
    np.testing.assert_allclose((1.3 * light ** (1 / power.value)) ** power.value, 1.3**power.value * light)


def test_gains_on_encoded_values(says):
    raw, gains, matrix, truth = shot(BULB)
    (root,) = says("Encoded values are light to the power of about 1/2.2, so the same gains do far too much.")
    before, after = says("With the matrix after them, mean ΔE goes from 0.96 to 23.")
    assert root.about(np.log(0.2) / np.log(encoded(0.2)), 0.05)
    assert before == delta((raw * gains) @ matrix.T, truth).mean()
    assert after == delta(decoded((encoded(raw) * gains) @ matrix.T), truth).mean()
    says("Too strong a correction: the greys become bluish, and the brightest blues are cut off.")
    saved = encoded(raw) * gains
    assert (lab(decoded(saved) @ SRGB.matrix_RGB_to_XYZ.T)[GREYS, 2] < -5).all()
    assert (saved[:, 2] > 1).sum() >= 3
    assert (saved[:, :2] <= 1).all()


# Part 6 --------------------------------------------------------------------------------------------------------------


def test_no_matrix_leaves_less(says):
    by_fit, least = says("In the light of the bulb the matrix left a mean ΔE of 0.96. No matrix leaves less than 0.90.")
    raw, gains, matrix, truth = shot(BULB)
    balanced = raw * gains

    def mean(values):
        """By camviz's formula, which is faster; tests/test_colour.py holds it to colour-science's."""
        shown = (balanced @ values.reshape(3, 3).T) @ SRGB.matrix_RGB_to_XYZ.T
        return delta_e_2000(to_lab(shown, D65), to_lab(truth, D65)).mean()

    assert by_fit == delta(balanced @ matrix.T, truth).mean()
    best = matrix.ravel()
    for _ in range(3):
        best = minimize(mean, best, method="Nelder-Mead", options={"maxfev": 4000, "xatol": 1e-6, "fatol": 1e-7}).x
    assert least == delta(balanced @ best.reshape(3, 3).T, truth).mean()
    nudged = [mean(best + step) for step in np.random.default_rng(1).normal(0, 0.02, (200, 9))]
    assert min(nudged) > mean(best) - 1e-3


def test_a_camera_that_sees_as_the_eye_leaves_nothing(says):
    says("next to nothing is left. (What is left is there because the patch that was made grey is not perfectly grey.)")
    for patch, most in ((NAMES.index("neutral 6.5"), 0.2), (None, 1e-6)):
        raw, gains, matrix, truth = shot(BULB, patch, "bulb", "eye")
        assert delta((raw * gains) @ matrix.T, truth).mean() < most


def test_a_camera_that_sees_as_the_eye_needs_its_matrix_too(says):
    """The eye's own curves, white balanced in the light of the bulb, and shown without and with a matrix."""
    says(
        "A camera whose curves are mixtures of the eye's (Luther's condition) needs a matrix too, and then it is exact."
    )
    says(
        "Because its curves are not those that belong to the screen's red, green and blue: colours must be translated."
    )
    says("what the camera's three curves count is not the red, green and blue of a screen")
    raw, gains, matrix, truth = shot(BULB, None, "bulb", "eye")
    balanced = raw * gains
    assert delta(balanced, truth).mean() > 10
    assert delta(balanced @ matrix.T, truth).max() < 1e-6


def test_the_null_space(says):
    sums, unknowns, left = says(
        "what it does not notice lies in the null space of 3 equations in 81 unknowns, and 78 dimensions are left"
    )
    sensor = planckian(BULB)[:, None] * NIKON
    assert (unknowns.value, sums.value) == sensor.shape
    assert left == sensor.shape[0] - np.linalg.matrix_rank(sensor)


def test_metamers_are_equal_to_the_sensor_and_far_apart_to_the_eye(says):
    says("counted, × gains, × matrix: equal to the last digit. What the eye sees: not.")
    view = ColourView(light="daylight", kelvin=5000, method="chosen patch", patch=20, metamer=True)
    light, twins = daylight(5000.0), view.reflectances
    assert (twins >= 0).all()
    assert (twins <= 1).all()
    raw = counted(light, NIKON, twins)
    np.testing.assert_allclose(raw[0], raw[1], rtol=1e-5)  # the tables of colour-science have more digits
    (patches,) = says("what looks like one of the 24 to the camera may be off by more than ten")
    assert patches == len(CHART)
    one, other = (lab(xyz) for xyz in seen(light, twins))
    assert colour.delta_E(one, other, method="CIE 2000") > 10
    (made,) = says("one that was computed for this sensor in daylight of 5000 K")
    (at,) = says("At 5000 K, **counted, × gains, × matrix: equal to the last digit.")
    (alike,) = says("counted alike in daylight of 5000 K, and differently in the other lights that you set")
    assert made.value == at.value == alike.value == 5000
    says("In another light the sensor counts them differently, because the sums are others.")
    for other in (
        planckian(BULB),
        *map(daylight, (4000.0, 4500.0, 5500.0, 12000.0)),
        at_nm(colour.SDS_ILLUMINANTS["FL2"]),
    ):
        raw = counted(other, NIKON, twins)
        assert np.abs(raw[0] - raw[1]).max() > 0.003
    says("No such surface is found for it.")
    np.testing.assert_allclose(*view.but(camera="CIE observer").reflectances, atol=1e-9)
    sixteen, eight = says("More bits: with 16 in place of 8 the numbers would differ.")
    for bits in (sixteen.value, eight.value):
        digital = np.rint(view.shot.raw(twins) * (2**bits - 1))
        np.testing.assert_array_equal(digital[0], digital[1])


def test_the_twin_of_a_grey_card(says):
    share, apart = says("A right twin counts 0.5 in all three channels, to the last digit. The eye sees it at ΔE 4.7")
    sensor, wavy = planckian(BULB)[:, None] * NIKON, np.sin(np.linspace(0, 6 * np.pi, 81))
    basis = np.linalg.qr(sensor)[0]
    black = wavy - basis @ (basis.T @ wavy)
    twin = 0.5 + 0.3 * black / np.abs(black).max()
    np.testing.assert_allclose(twin @ sensor / sensor.sum(axis=0), share.value, rtol=1e-12)
    one, other = (lab(xyz) for xyz in seen(planckian(BULB), np.stack([np.full(81, 0.5), twin])))
    assert apart == colour.delta_E(one, other, method="CIE 2000")


# Part 7 --------------------------------------------------------------------------------------------------------------


def test_without_an_ir_cut_filter_colours_fade(says):
    """Planck's law and Kodak's four figures of the KAF-0400, red, green and blue as clear as at 550 nm."""
    low, high, table_end = says("From 785 to 1000 nm all three channels count alike")[:2] + says(
        "Each patch reflects there as it does at 780 nm."
    )
    nm = np.arange(low.value, high.value + 1, 5)
    assert table_end == NM[-1]
    (thousands,) = says("that Kodak published of the KAF-0400")
    assert thousands.about(768 * 512 / 1000, 0.03)  # of pixels: what its name says
    bulb, clear = planckian(BULB), np.interp(nm, (400, 550, 700, 1000), (0.03, 0.33, 0.40, 0.08)) * nm / (0.33 * 550)
    glow = colour.sd_blackbody(BULB, colour.SpectralShape(low.value, high.value, 5)).values
    scale = bulb[NM == 560] / colour.sd_blackbody(BULB, colour.SpectralShape(560, 561, 1)).values[0]
    infrared = np.sum(scale * glow * clear)
    truth = seen(bulb)
    off = {}
    for name, extra in (("filter", 0.0), ("none", infrared)):
        shares = (bulb * CHART) @ NIKON + extra * CHART[:, -1:]
        shares = shares / (bulb @ NIKON + extra)
        matrix = fitted(shares, truth @ SRGB.matrix_XYZ_to_RGB.T, np.ones(3), np.ones(3))
        off[name] = delta(shares @ matrix.T, truth)
    without, with_it = says("the mean ΔE stays at 10.3, where the filter allows 0.9")
    assert without == off["none"].mean()
    assert with_it == off["filter"].mean()
    (foliage,) = says("Foliage, which reflects much infrared, is off by 35.6.")
    assert foliage == off["none"][NAMES.index("foliage")]
    assert off["none"].argmax() == NAMES.index("foliage")
    assert CHART[NAMES.index("foliage"), -1] > 2 * CHART[NAMES.index("foliage")].min()
    (red,) = says("comes out as a middle grey, 0.53 of white in red")
    cloth = (0.04 * (bulb @ NIKON) + 0.6 * infrared) / (bulb @ NIKON + infrared)
    assert red == cloth[0]
    says("A bulb has most of its light in the infrared")
    every = colour.sd_blackbody(BULB, colour.SpectralShape(300, 4000, 5))
    assert every.values[every.wavelengths > 780].sum() > every.values.sum() / 2
    end, seen_to = says("Silicon counts photons up to 1100 nm; the eye sees nearly nothing beyond 700.")
    assert end.about(1239.84 / 1.12, 0.02)  # the band gap of silicon in eV
    (again,) = says("Silicon counts photons up to 1100 nm, and a bulb sends out most of its light beyond the red.")
    assert again.value == end.value
    eye = colour.MSDS_CMFS["CIE 1931 2 Degree Standard Observer"]
    assert eye.values[eye.wavelengths > seen_to.value, 1].sum() < 0.002 * eye.values[:, 1].sum()
    (beyond,) = says("A white LED emits next to nothing beyond 780 nm")
    led = colour.SDS_ILLUMINANTS["LED-B3"]
    assert led[beyond.value] < 0.02 * led.values.max()


# Exercises, real data, quiz ------------------------------------------------------------------------------------------


def cases(name):
    return list(exercise(name).cases(np.random.default_rng(5)))


def test_response_is_camviz_s_beside_a_perfect_white():
    for light, reflectance, sensitivity in cases("13.response"):
        white = balance.response(light, 1, sensitivity)
        expected = balance.response(light, reflectance, sensitivity) / white
        np.testing.assert_allclose(lesson13.response(light, reflectance, sensitivity), expected)


def test_grey_world_is_camviz_s():
    for (raw,) in cases("13.grey_world"):
        np.testing.assert_allclose(lesson13.grey_world(raw), balance.grey_world(raw))


def test_developing_multiplies_as_opencv_does():
    for raw, gains, matrix in cases("13.develop"):
        linear = cv2.transform(np.reshape(raw * gains, (-1, 1, 3)), matrix).reshape(raw.shape)
        np.testing.assert_allclose(lesson13.develop(raw, gains, matrix), np.clip(linear, 0, 1) ** (1 / 2.2))


def test_the_matrix_is_that_of_opencv_s_solver():
    for raw, target in cases("13.fit_matrix"):
        solved, m = cv2.solve(raw, target, flags=cv2.DECOMP_SVD)
        assert solved
        np.testing.assert_allclose(lesson13.fit_matrix(raw, target), m.T, atol=1e-9)


def test_what_is_unseen_is_orthogonal_to_the_sensor_and_the_rest_is_a_mixture_of_it():
    for change, sensor in cases("13.unseen"):
        left = lesson13.unseen(change, sensor)
        np.testing.assert_allclose(left @ sensor, 0, atol=1e-9)
        assert np.linalg.matrix_rank(np.column_stack([sensor, change - left]), tol=1e-8) == 3


@pytest.mark.parametrize(
    ("name", "wrong"),
    [
        ("13.response", lambda light, reflectance, sensitivity: np.full(3, 0.5)),
        ("13.grey_world", lambda raw: np.array([1.2, 1.0, 1.4])),
        ("13.develop", lambda raw, gains, matrix: raw),
        ("13.fit_matrix", lambda raw, target: np.eye(3)),
    ],
)
def test_constants_and_what_does_nothing_do_not_pass(name, wrong):
    assert judge(exercise(name), wrong, np.random.default_rng(3), 1).status == "wrong"


def test_the_shapes_that_the_exercises_name(says):
    sensitivity = cases("13.response")[2][-1]
    (curves,) = says("`light` (n,), `reflectance` (..., n), `sensitivity` (n, 3).")
    assert curves == sensitivity.shape[1]
    gains, colours = says("Return the gains (3,) for raw colours (..., 3), green's gain being 1.")
    (raw,) = cases("13.grey_world")[0]
    assert gains == len(lesson13.grey_world(raw))
    assert colours == raw.shape[-1]
    (channels,) = says("This is to develop raw colours (..., 3).")
    assert channels == raw.shape[-1]
    rows, columns_ = says("Find the M (3, 3) with the least Σ |M raw − target|² over n colours.")
    assert (rows.value, columns_.value) == lesson13.fit_matrix(*cases("13.fit_matrix")[1]).shape
    rows, columns_ = says("Write `between` for a light of any temperature: the mixture (3, 3) of the matrices")
    assert (rows.value, columns_.value) == lesson13.between(*cases("13.between")[0]).shape
    (channels,) = says("Given any change of a spectrum (n,) and the sensor's curves (n, 3)")
    assert channels == cases("13.unseen")[0][1].shape[1]


def mixed(kelvin, warm, cold, of=lambda kelvin: 1 / kelvin):
    """The mixture of two matrices that is linear in `of` the temperature."""
    return warm + (cold - warm) * np.interp(of(kelvin), *zip(*sorted([(of(2856), 0.0), (of(6504), 1.0)]), strict=True))


def test_between_two_matrices(says):
    """Fitted by Lagrange's multipliers in A and in D65, of colour-science's tables."""
    body, day = says("the light of a bulb (the CIE's illuminant A, 2856 K) and in daylight (D65, 6504 K)")
    for name, kelvin in {"A": body, "D65": day}.items():
        uv = colour.xy_to_UCS_uv(colour.CCS_ILLUMINANTS["CIE 1931 2 Degree Standard Observer"][name])
        assert kelvin.about(colour.temperature.uv_to_CCT_Ohno2013(uv)[0], 0.001)  # A: 2855.5 by the constants of today
    (low, high), (shown,) = says("Below 2856 K and above 6504 K it stays at 1 or at 0."), says("For 4000 K:")
    assert [low.value, high.value] == [body.value, day.value]
    bulb_s, day_s, below, above, again = (
        says("What share of the warm matrix is needed at 2856 K, and what share at 6504 K?")
        + says("Below 2856 K and above 6504 K it stays where it is.")
        + says("The two matrices have changed places: at 2856 K the warm one is right.")
    )
    assert bulb_s.value == below.value == again.value == body.value
    assert day_s.value == above.value == day.value
    warm, cold = (in_light(at_nm(colour.SDS_ILLUMINANTS[name]))[1] for name in ("A", "D65"))
    for kelvin, first, second in (arguments for arguments in cases("13.between")):
        np.testing.assert_allclose(lesson13.between(kelvin, first, second), mixed(kelvin, first, second))
    assert shown.value == 4000
    at, bulbs, daylights = says("At 4000 K the bulb's matrix leaves a mean ΔE of 1.78 and daylight's 1.68.")
    balanced, own, truth = in_light(planckian(at.value))

    def left(matrix):
        return delta(balanced @ matrix.T, truth).mean()

    assert bulbs == left(warm)
    assert daylights == left(cold)
    mixture, best = says("The mixture leaves 0.95, hardly more than the 0.88 of a matrix fitted there.")
    assert mixture == left(mixed(at.value, warm, cold))
    assert best == left(own)
    (evenly,) = says("Mixed evenly with the temperature itself it would be 1.15.")
    assert evenly == left(mixed(at.value, warm, cold, of=lambda kelvin: kelvin))
    low, high, middle, mean = says("so the middle between 2856 K and 6504 K is near 3970 K and not at 4680 K")
    assert middle.about(2 / (1 / low.value + 1 / high.value), 0.001)
    assert mean == (low.value + high.value) / 2


def test_a_temperature_does_not_say_all_about_a_lamp(says):
    kelvin, mixture, own = says(
        "near 4224 K, is no glowing body: the mixture leaves 1.66, where its own matrix leaves 0.81."
    )
    light = at_nm(colour.SDS_ILLUMINANTS["FL2"])
    nearest = colour.temperature.uv_to_CCT_Ohno2013(colour.xy_to_UCS_uv(colour.XYZ_to_xy(light @ EYE)))[0]
    assert kelvin.about(nearest, 0.001)
    warm, cold = (in_light(at_nm(colour.SDS_ILLUMINANTS[name]))[1] for name in ("A", "D65"))
    balanced, matrix, truth = in_light(light)
    assert mixture == delta(balanced @ mixed(nearest, warm, cold).T, truth).mean()
    assert own == delta(balanced @ matrix.T, truth).mean()


def test_adobe_s_matrix_suits_the_virtual_nikon(says):
    """What dcraw has for the D5100, beside the curves that the National Physical Laboratory measured."""
    says("leave nearly the same errors")
    balanced, own, truth = in_light(at_nm(colour.SDS_ILLUMINANTS["D65"]))
    raw_from_xyz = np.array([[0.8198, -0.2239, -0.0724], [-0.4871, 1.2389, 0.2798], [-0.1043, 0.2050, 0.7181]])
    white = raw_from_xyz @ D65
    xyz = np.linalg.solve(raw_from_xyz, (balanced * white).T).T
    errors = [delta(rgb, truth).mean() for rgb in (xyz @ SRGB.matrix_XYZ_to_RGB.T, balanced @ own.T)]
    assert errors[1] < errors[0] < errors[1] + 0.1


def test_the_plain_power(says):
    (power,) = says("(Gamma is the plain power 1/2.2 here.)")
    grey = lesson13.develop(np.full(3, 0.3), np.ones(3), np.eye(3))
    np.testing.assert_allclose(grey**power.value, 0.3)
    (about,) = says(
        "A screen wants values that follow a curve, [gamma](00_start_here.ipynb#gamma), about the power 1/2.2 of light."
    )
    assert about.about(np.log(0.2) / np.log(encoded(0.2)), 0.05)


def test_the_factor_on_encoded_values(says):
    gamma, factor, again, power, light = says(
        "Gamma is a power, about 1/2.2. A factor of 2.2 on encoded values is a factor of 2.2 to the power of 2.2, "
        "nearly 6, on light."
    )
    assert gamma.about(np.log(0.2) / np.log(encoded(0.2)), 0.05)
    assert factor == shot(BULB)[1][2]
    assert light.about(again.value**power.value, 0.06)


def test_grey_world_on_the_three_photographs(says):
    says(
        "With right gains the cup turns bluish, the astronaut's background greenish, and the evening sky over the "
        "rocket loses half its blue."
    )
    looked_at = {"coffee": np.s_[45:60, 300:330], "astronaut": np.s_[60:100, 330:360], "rocket": np.s_[20:120, 250:400]}
    changed = {}
    for name, part in looked_at.items():
        linear = decoded(photograph(name) / 255)
        both = [
            lab((one @ SRGB.matrix_RGB_to_XYZ.T)[part]).mean(axis=(0, 1))
            for one in (linear, linear * grey_world(linear))
        ]
        changed[name] = both
    assert changed["coffee"][0][2] > -5 > -10 > changed["coffee"][1][2]
    assert changed["astronaut"][0][1] > -3 > changed["astronaut"][1][1]
    assert changed["rocket"][0][2] < -20
    assert changed["rocket"][1][2] == pytest.approx(changed["rocket"][0][2] / 2, rel=0.1)


def test_opencv_s_chart_finder_gives_an_object_where_there_is_none(says):
    says("when nothing is found, `getBestColorChecker()` still gives you an object")
    detector = cv2.mcc.CCheckerDetector.create()
    detector.setColorChartType(cv2.mcc.MCC24)
    assert not detector.process(np.full((200, 300, 3), 128, np.uint8), 1)
    assert detector.getBestColorChecker() is not None


def test_the_quiz_about_a_small_error(says):
    raw, gains, matrix, truth = shot(BULB)
    off = delta((raw * gains) @ matrix.T, truth)
    (mean,) = says("A matrix leaves ΔE2000 = 0.96 on average over the chart.")
    (too,) = says("It will be off by about 0.96 as well.")
    (red,) = says("It is a mean: red is off by 3.3 here.")
    here, everywhere = says("| ΔE 0.96 on the chart is ΔE 0.96 everywhere |")
    assert mean == off.mean()
    assert too.value == here.value == everywhere.value == mean.value
    assert red == off[NAMES.index("red")]


# Before a question ---------------------------------------------------------------------------------------------------


def above(question):
    """All prose and saved text above a question."""
    cells = notebooks.read(LESSONS / "13_white_balance_and_colour.ipynb").cells
    at = next(i for i, cell in enumerate(cells) if cell.source == f'ask("{question}")')
    outputs = [str(out.get("data", {}).get("text/plain", "")) for cell in cells[:at] for out in cell.get("outputs", [])]
    return " ".join([*(cell.source for cell in cells[:at]), *outputs])


@pytest.mark.parametrize(
    ("question", "words"),
    [
        ("13.white", r"greys come right|chosen patch,|pale|needs a matrix"),
        ("13.grey_world", r"brown|turns \*blue|scene=|\.mean\(axis"),
        ("13.tint", r"not enough|two dimensions|is one number|green side|beside the line"),
        ("13.gamma", r"encoded as a rule|linear values|\*\*linear|before the balance"),
        ("13.metamer", r"no matrix|cannot be told|twin|Luther|below about"),
        ("13.infrared", r"IR-cut|fade towards|near infrared"),
    ],
)
def test_nothing_above_a_question_answers_it(question, words):
    assert re.search(words, above(question), re.IGNORECASE) is None


# Before the lesson ---------------------------------------------------------------------------------------------------


def test_before_the_lesson_a_mean_hides_a_red(says):
    raw, gains, matrix, truth = shot(BULB)
    off = delta((raw * gains) @ matrix.T, truth)
    mean, red = says("a mean of 0.96 goes with a red patch that is off by 3.3")
    assert mean == off.mean()
    assert red == off[NAMES.index("red")]
    left, patches = says("A camera's colours are off by 0.8 on average over the 24 patches of a chart.")
    (claimed,) = says("They are right to about 0.8.")
    assert claimed.value == left.value < 1
    same, spectra_, surfaces = (
        says("in other ways than the 24 patches")
        + says("was fitted to those 24 spectra")
        + says("The chart has 24 surfaces.")
    )
    assert all(one == len(CHART) for one in (patches, same, spectra_, surfaces))


def test_before_the_lesson_a_matrix_has_nine_numbers(says):
    rows, columns_ = says("The maker of a camera has measured a 3 × 3 matrix")
    says("the best translation that nine numbers can give")
    assert rows.value * columns_.value == shot(BULB)[2].size == 9


def test_the_sum_that_a_teacher_does_on_the_board(says):
    middle, *change = says("a sensor whose only curve is 1, 2, 1 does not notice a change by 0.5, −0.2, −0.1")
    curve = np.array([1, middle.value, 1])
    assert curve @ [one.value for one in change] == pytest.approx(0, abs=1e-12)
