"""Colour: spaces, temperature, white balance and matrices, against published values and colour-science."""

from __future__ import annotations

import warnings

import cv2
import numpy as np
import pytest
from raw_charts import raw_chart

from camviz.colour import balance, charts, spaces, spectra, temperature
from camviz.scenes.light import to_encoded

with warnings.catch_warnings():
    warnings.simplefilter("ignore")
    import colour


# Spaces --------------------------------------------------------------------------------------------------------------

SHARMA = np.array(
    [
        (50.0000, 2.6772, -79.7751, 50.0000, 0.0000, -82.7485, 2.0425),
        (50.0000, 3.1571, -77.2803, 50.0000, 0.0000, -82.7485, 2.8615),
        (50.0000, 2.8361, -74.0200, 50.0000, 0.0000, -82.7485, 3.4412),
        (50.0000, -1.3802, -84.2814, 50.0000, 0.0000, -82.7485, 1.0000),
        (50.0000, -1.1848, -84.8006, 50.0000, 0.0000, -82.7485, 1.0000),
        (50.0000, -0.9009, -85.5211, 50.0000, 0.0000, -82.7485, 1.0000),
        (50.0000, 0.0000, 0.0000, 50.0000, -1.0000, 2.0000, 2.3669),
        (50.0000, -1.0000, 2.0000, 50.0000, 0.0000, 0.0000, 2.3669),
        (50.0000, 2.4900, -0.0010, 50.0000, -2.4900, 0.0009, 7.1792),
        (50.0000, 2.4900, -0.0010, 50.0000, -2.4900, 0.0010, 7.1792),
        (50.0000, 2.4900, -0.0010, 50.0000, -2.4900, 0.0011, 7.2195),
        (50.0000, 2.4900, -0.0010, 50.0000, -2.4900, 0.0012, 7.2195),
        (50.0000, -0.0010, 2.4900, 50.0000, 0.0009, -2.4900, 4.8045),
        (50.0000, -0.0010, 2.4900, 50.0000, 0.0010, -2.4900, 4.8045),
        (50.0000, -0.0010, 2.4900, 50.0000, 0.0011, -2.4900, 4.7461),
        (50.0000, 2.5000, 0.0000, 50.0000, 0.0000, -2.5000, 4.3065),
        (50.0000, 2.5000, 0.0000, 73.0000, 25.0000, -18.0000, 27.1492),
        (50.0000, 2.5000, 0.0000, 61.0000, -5.0000, 29.0000, 22.8977),
        (50.0000, 2.5000, 0.0000, 56.0000, -27.0000, -3.0000, 31.9030),
        (50.0000, 2.5000, 0.0000, 58.0000, 24.0000, 15.0000, 19.4535),
        (50.0000, 2.5000, 0.0000, 50.0000, 3.1736, 0.5854, 1.0000),
        (50.0000, 2.5000, 0.0000, 50.0000, 3.2972, 0.0000, 1.0000),
        (50.0000, 2.5000, 0.0000, 50.0000, 1.8634, 0.5757, 1.0000),
        (50.0000, 2.5000, 0.0000, 50.0000, 3.2592, 0.3350, 1.0000),
        (60.2574, -34.0099, 36.2677, 60.4626, -34.1751, 39.4387, 1.2644),
        (63.0109, -31.0961, -5.8663, 62.8187, -29.7946, -4.0864, 1.2630),
        (61.2901, 3.7196, -5.3901, 61.4292, 2.2480, -4.9620, 1.8731),
        (35.0831, -44.1164, 3.7933, 35.0232, -40.0716, 1.5901, 1.8645),
        (22.7233, 20.0904, -46.6940, 23.0331, 14.9730, -42.5619, 2.0373),
        (36.4612, 47.8580, 18.3852, 36.2715, 50.5065, 21.2231, 1.4146),
        (90.8027, -2.0831, 1.4410, 91.1528, -1.6435, 0.0447, 1.4441),
        (90.9257, -0.5406, -0.9208, 88.6381, -0.8985, -0.7239, 1.5381),
        (6.7747, -0.2908, -2.4247, 5.8714, -0.0985, -2.2286, 0.6377),
        (2.0776, 0.0795, -1.1350, 0.9033, -0.0636, -0.5514, 0.9082),
    ]
)
"""Test data of Sharma, Wu and Dalal (2005), table 1: two CIELAB colours and their ΔE2000."""

WHITE_D65, WHITE_D50 = (spaces.from_chromaticity(xy) for xy in (spaces.D65_XY, spaces.D50_XY))


def test_difference_is_that_of_the_papers_table():
    np.testing.assert_allclose(spaces.delta_e_2000(SHARMA[:, :3], SHARMA[:, 3:6]), SHARMA[:, 6], atol=5e-5)
    np.testing.assert_allclose(spaces.delta_e_2000(SHARMA[:, 3:6], SHARMA[:, :3]), SHARMA[:, 6], atol=5e-5)


def test_difference_is_that_of_colour_science():
    rng = np.random.default_rng(5)
    lab1 = rng.uniform([0, -100, -100], [100, 100, 100], (20_000, 3))
    lab2 = lab1 + rng.choice([1, 30], (20_000, 1)) * rng.normal(size=(20_000, 3))
    np.testing.assert_allclose(
        spaces.delta_e_2000(lab1, lab2), colour.delta_E(lab1, lab2, method="CIE 2000"), atol=1e-10
    )


def test_difference_of_equals_is_zero():
    lab = np.array([[50, 0, 0], [0, 0, 0], [70, 30, -20]], dtype=float)
    np.testing.assert_array_equal(spaces.delta_e_2000(lab, lab), 0)


def charts_xyz(name, shape):
    """What colour-science makes of the chart in a light, with the observer sampled so."""
    chart, cmfs = colour.SDS_COLOURCHECKERS["cc_ohta"].values(), colour.MSDS_CMFS["CIE 1931 2 Degree Standard Observer"]
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", colour.utilities.ColourRuntimeWarning)  # it speaks of aligning shapes
        light, cmfs = colour.SDS_ILLUMINANTS[name], cmfs.copy().align(shape)
        return np.array([colour.sd_to_XYZ(sd, cmfs, light, method="Integration") for sd in chart]) / 100


@pytest.mark.parametrize("name", spectra.ILLUMINANTS)
def test_the_chart_has_the_tristimulus_values_of_colour_science(name):
    ours = spaces.tristimulus(spectra.illuminant(name), spectra.reflectances())
    np.testing.assert_allclose(ours, charts_xyz(name, colour.SpectralShape(380, 780, 5)), atol=1e-6)


@pytest.mark.parametrize("name", ["A", "D50", "D65"])
def test_steps_of_five_nanometres_are_fine_enough_for_smooth_lights(name):
    """The observer as it is published, every nanometre from 360 to 830. Lamps with lines are defined every 5 only."""
    ours = spaces.tristimulus(spectra.illuminant(name), spectra.reflectances())
    theirs = charts_xyz(name, colour.SpectralShape(360, 830, 1))
    np.testing.assert_allclose(ours[:, :2], theirs[:, :2], atol=1e-4)
    np.testing.assert_allclose(ours[:, 2], theirs[:, 2], atol=5e-4)  # z̄ goes on a little below 380 nm


@pytest.mark.parametrize(
    ("name", "white"),
    [("A", (0.44758, 0.40745)), ("D65", (0.31272, 0.32903)), ("D50", (0.34567, 0.35850)), ("FL11", (0.3805, 0.3769))],
)
def test_whites_have_the_chromaticities_the_cie_published(name, white):
    np.testing.assert_allclose(spaces.chromaticity(spaces.tristimulus(spectra.illuminant(name))), white, atol=5e-5)


def test_chromaticity_and_back():
    xyz = np.random.default_rng(1).uniform(0.1, 1, (4, 5, 3))
    np.testing.assert_allclose(spaces.from_chromaticity(spaces.chromaticity(xyz), xyz[..., 1]), xyz, rtol=1e-12)
    assert np.isnan(spaces.chromaticity([0, 0, 0])).all()


def test_srgb_has_the_matrix_of_its_standard():
    """IEC 61966-2-1:1999 gives four decimals."""
    published = [[0.4124, 0.3576, 0.1805], [0.2126, 0.7152, 0.0722], [0.0193, 0.1192, 0.9505]]
    np.testing.assert_allclose(spaces.XYZ_FROM_SRGB, published, atol=5.1e-5)
    np.testing.assert_allclose(spaces.from_srgb([1, 1, 1]), WHITE_D65, rtol=1e-12)


def test_xyz_to_encoded_srgb_is_that_of_colour_science():
    rgb = np.random.default_rng(2).uniform(0, 1, (50, 3))
    space = colour.RGB_COLOURSPACES["sRGB"].copy()
    space.use_derived_transformation_matrices(True)
    theirs = colour.XYZ_to_RGB(spaces.from_srgb(rgb), space, apply_cctf_encoding=True)
    np.testing.assert_allclose(to_encoded(spaces.to_srgb(spaces.from_srgb(rgb))), theirs, atol=1e-9)


def test_lab_is_that_of_colour_science_and_goes_back():
    xyz = np.random.default_rng(3).uniform(0, 1, (500, 3)) ** 3
    lab = spaces.to_lab(xyz, WHITE_D50)
    np.testing.assert_allclose(lab, colour.XYZ_to_Lab(xyz, spaces.D50_XY), atol=1e-9)
    np.testing.assert_allclose(spaces.from_lab(lab, WHITE_D50), xyz, atol=1e-12)


def test_bradford_adaptation_is_as_published():
    adapted = spaces.adaptation(WHITE_D65, WHITE_D50) @ (0.20654008, 0.12197225, 0.05136952)
    np.testing.assert_allclose(adapted, (0.21666003, 0.12604777, 0.03855068), atol=5e-9)


@pytest.mark.parametrize(
    ("method", "its"), [("Bradford", "Bradford"), ("von Kries", "Von Kries"), ("XYZ", "XYZ Scaling")]
)
def test_adaptation_is_that_of_colour_science(method, its):
    theirs = colour.adaptation.matrix_chromatic_adaptation_VonKries(WHITE_D65, WHITE_D50, transform=its)
    ours = spaces.adaptation(WHITE_D65, WHITE_D50, method)
    np.testing.assert_allclose(ours, theirs, atol=1e-6)
    np.testing.assert_allclose(ours @ WHITE_D65, WHITE_D50, rtol=1e-12)


def test_an_unknown_adaptation_is_refused_by_name():
    with pytest.raises(ValueError, match="method must be one of Bradford, von Kries, XYZ, got 'CAT02'"):
        spaces.adaptation(WHITE_D65, WHITE_D50, "CAT02")


# Temperature ---------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("kelvin", "xy"), [(2000, (0.52668, 0.41330)), (4000, (0.38044, 0.37675)), (6500, (0.31353, 0.32363))]
)
def test_black_bodies_have_the_published_chromaticities(kelvin, xy):
    np.testing.assert_allclose(temperature.locus_xy(kelvin), xy, atol=6e-6)


def test_d65_is_not_a_black_body_of_6500_kelvin():
    kelvin, duv = temperature.temperature(spaces.D65_XY)
    assert kelvin == pytest.approx(6504, abs=1)
    assert duv == pytest.approx(0.0032, abs=1e-4)
    assert np.linalg.norm(temperature.locus_xy(6500) - spaces.D65_XY) > 0.005


def test_colour_temperature_is_that_of_colour_science():
    """Ohno (2013) by a table and a parabola, and a search for the least distance."""
    rng = np.random.default_rng(4)
    for kelvin, duv in zip(np.geomspace(1800, 20_000, 12), rng.uniform(-0.02, 0.02, 12), strict=True):
        uv = temperature.uv_of_xy(temperature.xy_of_temperature(kelvin, duv))
        theirs = colour.temperature.uv_to_CCT_Ohno2013(uv)
        assert theirs[0] == pytest.approx(kelvin, rel=5e-4)
        assert theirs[1] == pytest.approx(duv, abs=1e-4)
        assert colour.temperature.uv_to_CCT_Planck1900(uv) == pytest.approx(kelvin, rel=5e-4)


@pytest.mark.parametrize("duv", [-0.04, -0.01, 0.0, 0.01, 0.04])
def test_temperature_and_tint_come_back(duv):
    for kelvin in (1500, 2856, 4000, 6504, 10_000, 25_000):
        back = temperature.temperature(temperature.xy_of_temperature(kelvin, duv))
        assert back == (pytest.approx(kelvin, rel=1e-4), pytest.approx(duv, abs=1e-8))


def test_green_lies_above_the_locus():
    assert temperature.temperature((0.34, 0.38))[1] > 0 > temperature.temperature((0.34, 0.33))[1]


def test_a_strong_colour_has_no_temperature():
    assert np.isnan(temperature.temperature((0.64, 0.33))).all()
    assert np.isnan(temperature.temperature((0.2, 0.1))).all()


def test_uv_and_back():
    xy = np.random.default_rng(6).uniform(0.2, 0.5, (7, 2))
    np.testing.assert_allclose(temperature.xy_of_uv(temperature.uv_of_xy(xy)), xy, rtol=1e-12)
    np.testing.assert_allclose(temperature.uv_of_xy(xy), colour.xy_to_UCS_uv(xy), rtol=1e-12)


# Balance and matrix --------------------------------------------------------------------------------------------------

PHYSICAL = [camera for camera in spectra.CAMERAS if camera != "CIE observer"]
LIGHTS = ["D65", "A", "FL11"]


def delta_e(xyz1, xyz2):
    return spaces.delta_e_2000(spaces.to_lab(xyz1, balance.WHITE), spaces.to_lab(xyz2, balance.WHITE))


def test_the_response_is_the_integral_that_colour_science_takes():
    sd, light = colour.SDS_COLOURCHECKERS["cc_ohta"]["dark skin"], colour.SDS_ILLUMINANTS["D65"]
    sensitivity = colour.MSDS_CAMERA_SENSITIVITIES["Nikon 5100 (NPL)"]
    nm = spectra.WAVELENGTHS_NM
    theirs = np.trapezoid((sd[nm] * light[nm])[:, None] * sensitivity[nm], nm, axis=0)
    ours = balance.response(spectra.illuminant("D65"), spectra.reflectances()[0], spectra.sensitivities("Nikon D5100"))
    np.testing.assert_allclose(ours, theirs, rtol=1e-4)  # the trapezoid's ends count half


def test_what_an_eye_sees_is_adapted_to_d65():
    for name in LIGHTS:
        np.testing.assert_allclose(balance.seen(spectra.illuminant(name), np.ones(81)), balance.WHITE, rtol=1e-12)
    np.testing.assert_allclose(
        balance.seen(spectra.illuminant("D65"), spectra.reflectances()), charts.published_xyz(), atol=3e-4
    )  # the table's white and the rounded (0.3127, 0.3290) differ by so much


def test_every_balance_makes_grey_what_it_takes_for_grey():
    rgb = np.random.default_rng(7).uniform(0.05, 0.9, (40, 60, 3)) * (0.9, 0.6, 0.3)
    np.testing.assert_allclose(np.ptp((rgb * balance.grey_world(rgb)).mean(axis=(0, 1))), 0, atol=1e-12)
    np.testing.assert_allclose(np.ptp((rgb * balance.white_patch(rgb)).max(axis=(0, 1))), 0, atol=1e-12)
    np.testing.assert_allclose(np.ptp(rgb[3, 4] * balance.neutral(rgb[3, 4])), 0, atol=1e-12)
    assert balance.grey_world(rgb)[1] == balance.white_patch(rgb)[1] == balance.neutral(rgb[0, 0])[1] == 1


def test_grey_world_is_that_of_opencv_but_for_its_scale():
    """OpenCV scales down to the smallest channel, and takes whole numbers only."""
    rgb = np.random.default_rng(8).integers(10, 200, (50, 70, 3)).astype(np.uint8)
    balancer = cv2.xphoto.createGrayworldWB()
    balancer.setSaturationThreshold(1.0)
    theirs = balancer.balanceWhite(np.ascontiguousarray(rgb[..., ::-1]))[..., ::-1]
    gains = balance.grey_world(rgb)
    np.testing.assert_allclose(theirs, rgb * gains / gains.max(), atol=1.5)
    with pytest.raises(cv2.error):
        balancer.balanceWhite(rgb.astype(np.float32))


def test_grey_world_fails_where_the_world_is_not_grey():
    """A lawn in white light: the balance takes the green for the light's and turns the lawn grey."""
    lawn = np.random.default_rng(9).uniform(0.5, 1, (100, 1)) * (0.1, 0.3, 0.05)
    np.testing.assert_allclose(np.ptp((lawn * balance.grey_world(lawn)).mean(axis=0)), 0, atol=1e-12)


@pytest.mark.parametrize("duv", [-0.01, 0.0, 0.01])
def test_temperature_and_tint_find_the_gains_of_a_camera_that_sees_as_the_eye(duv):
    xy = temperature.xy_of_temperature(3500, duv)
    np.testing.assert_allclose(balance.from_white_xy(xy, np.eye(3)), balance.neutral(spaces.from_chromaticity(xy)))


@pytest.mark.parametrize("camera", PHYSICAL)
@pytest.mark.parametrize("name", LIGHTS)
def test_the_matrix_is_the_best_and_keeps_white(camera, name):
    raw, white = raw_chart(camera, name)
    raw, truth = raw * balance.neutral(white), balance.seen(spectra.illuminant(name), spectra.reflectances())
    free = balance.fit_matrix(raw, truth)
    np.testing.assert_allclose(free, colour.matrix_colour_correction(raw, truth, method="Cheung 2004"), atol=1e-9)
    kept = balance.fit_matrix(raw, truth, (np.ones(3), balance.WHITE))
    np.testing.assert_allclose(kept @ np.ones(3), balance.WHITE, rtol=1e-12)
    nudged = [kept + step for step in 1e-4 * np.random.default_rng(0).normal(size=(50, 3, 3)) @ across_white()]
    assert min(np.sum((raw @ m.T - truth) ** 2) for m in nudged) > np.sum((raw @ kept.T - truth) ** 2)


def across_white():
    """Takes from each row of a matrix what would change the image of white."""
    return np.eye(3) - np.ones((3, 3)) / 3


@pytest.mark.parametrize(("camera", "most"), [("Nikon D5100", 1.0), ("Sigma SD1 Merrill", 2.0)])
def test_a_matrix_leaves_the_differences_that_the_camera_is_known_for(camera, most):
    """Some ΔE2000 of mean difference is what cameras have after a matrix; before it they have many times that."""
    raw, white = raw_chart(camera, "D65")
    raw, truth = raw * balance.neutral(white), balance.seen(spectra.illuminant("D65"), spectra.reflectances())
    m = balance.fit_matrix(raw, truth, (np.ones(3), balance.WHITE))
    assert 0.5 < delta_e(raw @ m.T, truth).mean() < most
    assert delta_e(spaces.from_srgb(raw), truth).mean() > 6 * delta_e(raw @ m.T, truth).mean()


@pytest.mark.parametrize("name", LIGHTS)
def test_a_camera_that_sees_as_the_eye_is_right_in_every_light(name):
    """The condition of Luther (1927): sensitivities that are mixtures of the eye's."""
    raw, white = raw_chart("CIE observer", name)
    raw, truth = raw * balance.neutral(white), balance.seen(spectra.illuminant(name), spectra.reflectances())
    assert delta_e(raw @ balance.fit_matrix(raw, truth).T, truth).max() < 1e-9


@pytest.mark.parametrize("camera", PHYSICAL)
@pytest.mark.parametrize("name", LIGHTS)
def test_metamers_are_equal_to_the_sensor_and_unequal_to_the_eye(camera, name):
    light, sensitivity = spectra.illuminant(name), spectra.sensitivities(camera)
    white = balance.response(light, 1, sensitivity)
    for one in spectra.reflectances():
        other = balance.metamer(one, light[:, None] * sensitivity, light[:, None] * spectra.observer())
        counted = [balance.response(light, spectrum, sensitivity) / white for spectrum in (one, other)]
        np.testing.assert_allclose(counted[0], counted[1], atol=1e-12)
        assert delta_e(balance.seen(light, one), balance.seen(light, other)) > 0.9
        assert other.min() >= 0
        assert other.max() <= 1


def test_no_matrix_can_tell_metamers_apart():
    """Any matrix at all: the same numbers go in."""
    light, sensitivity = spectra.illuminant("D65"), spectra.sensitivities("Nikon D5100")
    one = spectra.reflectances()[5]
    other = balance.metamer(one, light[:, None] * sensitivity, light[:, None] * spectra.observer())
    m = np.random.default_rng(10).normal(size=(3, 3))
    mapped = [m @ (balance.response(light, r, sensitivity) / 1e3) for r in (one, other)]
    np.testing.assert_allclose(mapped[0], mapped[1], atol=1e-12)


def test_the_eyes_own_sensitivities_have_no_metamers():
    light = spectra.illuminant("A")[:, None] * spectra.observer()
    for one in spectra.reflectances():
        np.testing.assert_array_equal(balance.metamer(one, light, light), one)


def test_a_metamer_pair_of_the_eye_is_told_apart_by_a_camera():
    light = spectra.illuminant("D65")[:, None]
    eye, sensor = light * spectra.observer(), light * spectra.sensitivities("Nikon D5100")
    one = spectra.reflectances()[20]
    other = balance.metamer(one, eye, sensor)
    np.testing.assert_allclose((other - one) @ eye / eye.sum(axis=0), 0, atol=1e-12)
    assert np.abs((other - one) @ sensor / sensor.sum(axis=0)).max() > 0.01


def test_srgb_primaries_look_like_srgb_primaries():
    xyz = spaces.tristimulus(spectra.illuminant("D65"), spectra.srgb_primaries())
    np.testing.assert_allclose(xyz.T, spaces.XYZ_FROM_SRGB, atol=5e-4)
    np.testing.assert_allclose(spectra.srgb_primaries().sum(axis=0), 1, atol=2e-5)


def test_a_gel_tints_and_its_opposite_undoes_it():
    light = spectra.illuminant("D65")
    duv = [
        temperature.temperature(spaces.chromaticity(spaces.tristimulus(light * spectra.gel(s))))[1]
        for s in (-0.5, 0, 0.5)
    ]
    assert duv[0] < duv[1] < duv[2]
    np.testing.assert_allclose(spectra.gel(0.7) * spectra.gel(-0.7), 1, rtol=1e-12)


@pytest.mark.parametrize(
    ("call", "words"),
    [
        (lambda: balance.neutral([0.5, 0.2, 0.0]), "three channels above 0"),
        (lambda: balance.grey_world(np.zeros((4, 4, 3))), "three channels above 0"),
        (lambda: balance.neutral([np.nan, 1, 1]), "three channels above 0"),
        (lambda: balance.fit_matrix(np.ones((5, 3)), np.ones((5, 3))), "three independent colours"),
        (lambda: balance.fit_matrix(np.eye(3), np.ones((4, 3))), r"must both be \(n, 3\), got \(3, 3\) and \(4, 3\)"),
    ],
)
def test_what_cannot_be_balanced_or_fitted_is_refused_in_words(call, words):
    with pytest.raises(ValueError, match=words):
        call()
