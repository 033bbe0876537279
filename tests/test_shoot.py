"""From a scene to a picture: photons by physics' constants, electrons by the sensor's, and a neutral white.

Random tests draw with a fixed seed; "false failure" is how often a correct camera would fail with another one.
"""

from dataclasses import replace

import colour
import numpy as np
import pytest
from scipy import constants

from camviz.cameras import Camera, Intrinsics
from camviz.mosaics import BAYER, BLUE, GREEN, MONOCHROME, RED, RGBW
from camviz.scenes import textured_scene, to_linear
from camviz.scenes.scene import Scene
from camviz.scenes.texture import Texture
from camviz.sensors import DigitalCamera, EfficiencyCurve, Sensor, quantise

SENSOR = Sensor(0.6, 12_000, 4, 0.3, 64, 12, dark_current_e_per_s=10, dsnu_e=1, prnu=0.005)
CAMERA = DigitalCamera(Camera(Intrinsics.from_fov(161, 121, 60)), SENSOR, scene_lux=1000)


def generator(seed):
    return np.random.Generator(np.random.SFC64(seed))


def grey(level):
    return np.full((121, 161, 3), level, np.float32)


def test_white_light_brings_the_photons_that_physics_counts():
    """Photons of 1 lux of D65 per second and µm², with colour-science's spectrum and observer and CODATA's h and c."""
    shape = colour.SpectralShape(380, 780, 1)
    d65 = colour.SDS_ILLUMINANTS["D65"].copy().align(shape).values
    eye = colour.MSDS_CMFS["CIE 1931 2 Degree Standard Observer"].copy().align(shape).values[:, 1]
    metres = shape.wavelengths * 1e-9
    watts = d65 / (683 * d65 @ eye)
    photons = watts @ metres / (constants.h * constants.c) * 1e-12
    assert CAMERA.channels.photons[3] == pytest.approx(photons, rel=2e-3)
    assert CAMERA.channels.electrons[3] == pytest.approx(0.6 * photons, rel=2e-3)


def test_filters_let_through_their_published_response_to_photons():
    """Of D65's photons the D5100's red lets s λ⁻¹ / max(s λ⁻¹) through: response to power, made one to photons."""
    shape = colour.SpectralShape(380, 780, 5)
    red = colour.MSDS_CAMERA_SENSITIVITIES["Nikon 5100 (NPL)"].copy().align(shape).values[:, 0] / shape.wavelengths
    photons = colour.SDS_ILLUMINANTS["D65"].copy().align(shape).values * shape.wavelengths
    share = np.trapezoid(photons * red / red.max()) / np.trapezoid(photons)
    assert CAMERA.channels.photons[RED] / CAMERA.channels.photons[3] == pytest.approx(share, rel=1e-3)


def test_illuminance_behind_the_lens_is_that_of_the_camera_equation():
    """A white wall under 1000 lx at f/4 through glass that passes 90 %: 1000 · .9 / 64 lx on the axis, cos⁴θ beside."""
    lux = CAMERA.take(grey(1.0), 1e-3, generator(0)).illuminance_lux
    assert lux[60, 80] == pytest.approx(1000 * 0.9 / 64)
    angle = np.arctan(np.hypot(60, 80) / CAMERA.camera.intrinsics.fx)
    assert lux[0, 0] / lux[60, 80] == pytest.approx(np.cos(angle) ** 4, rel=1e-5)
    stopped = replace(CAMERA, f_number=8.0).take(grey(1.0), 1e-3, generator(0)).illuminance_lux
    np.testing.assert_allclose(stopped * 4, lux, rtol=1e-6)


def test_each_pixel_gets_the_photons_of_its_own_filter():
    light = np.ones((121, 161, 3), np.float32) * (0.2, 0.5, 0.9)
    shot = CAMERA.take(light, 0.01, generator(1))
    for channel, level in ((RED, 0.2), (GREEN, 0.5), (BLUE, 0.9)):
        mask = BAYER["RGGB"].mask(channel, 121, 161)
        white = (1000 * 0.9 / 64) * 0.01 * 3.45**2 * CAMERA.channels.photons[channel]
        np.testing.assert_allclose(shot.photons[mask] / CAMERA._falloff[mask], level * white, rtol=1e-5)


def test_electrons_are_photons_times_efficiency():
    """Mean of photoelectrons over photons, .6 at all wavelengths; standard error 3.5e-4 by counting.

    Within 5 of them and the pattern's (0.5 % / 140): false failure 6e-7.
    """
    shot = CAMERA.take(grey(0.5), 0.02, generator(2))
    total = shot.photons.sum(dtype=float)
    error = 0.6 * ((0.6 * total) ** -0.5 + 0.005 / shot.photons.size**0.5)
    assert shot.exposure.photoelectrons.sum(dtype=float) / total == pytest.approx(0.6, abs=5 * error)
    np.testing.assert_array_equal(shot.raw, quantise(shot.exposure.voltage_dn, 12))


def test_the_exposure_for_white_fills_the_share_asked_for():
    """Green pixels near the axis hold 70 % of saturation; 5 standard errors of 1681/2 counts and the pattern."""
    exposure_s = CAMERA.white_exposure_s(0.7)
    shot = CAMERA.take(grey(1.0), exposure_s, generator(3))
    middle = np.zeros((121, 161), bool)
    middle[55:66, 75:86] = True
    green = shot.exposure.charge_e[middle & BAYER["RGGB"].mask(GREEN, 121, 161)] - 10 * exposure_s
    falloff = float(CAMERA._falloff[55:66, 75:86].mean())
    expected = 0.7 * SENSOR.saturation_e * falloff
    assert float(green.mean()) == pytest.approx(
        expected, abs=5 * np.hypot(expected**0.5, 0.005 * expected) / green.size**0.5
    )


@pytest.mark.parametrize("lamp", ["D65", "A", "FL11"])
@pytest.mark.parametrize("pattern", [BAYER["GBRG"], RGBW], ids=lambda one: one.name)
def test_white_and_grey_become_neutral_under_any_lamp(lamp, pattern):
    """Channel means of a picture of a grey wall agree to 5 standard errors (64 000 samples, some 2 % noise: 0.05 %)."""
    camera = replace(CAMERA, illuminant=lamp, pattern=pattern)
    picture = camera.take(grey(0.6), camera.white_exposure_s(0.8), generator(4)).balanced
    means = picture.reshape(-1, 3).mean(axis=0)
    np.testing.assert_allclose(means / means.mean(), 1, atol=2e-3)
    levels = picture[50:70, 70:90].mean(axis=(0, 1))
    np.testing.assert_allclose(levels, 0.6 * 0.8, rtol=0.02)


def test_a_bulb_fills_red_where_daylight_fills_green():
    bulb, day = (replace(CAMERA, illuminant=one).channels.electrons for one in ("A", "D65"))
    assert bulb[RED] > bulb[BLUE] * 2
    assert day[GREEN] == max(day[:3])


def test_without_filters_a_pixel_counts_the_mean_of_the_colours():
    camera = replace(CAMERA, pattern=MONOCHROME)
    shot = camera.take(np.ones((121, 161, 3), np.float32) * (0.3, 0.6, 0.9), 1e-3, generator(5))
    expected = 0.6 * 1000 * 0.9 / 64 * 1e-3 * 3.45**2 * camera.channels.photons[3]
    assert shot.photons[60, 80] == pytest.approx(expected, rel=1e-5)
    assert np.ptp(shot.picture, axis=-1).max() == 0


def test_a_curve_of_efficiency_weighs_the_channels():
    """A sensor blind beyond 500 nm, under daylight, fills blue first, where others fill green."""
    blind = replace(SENSOR, quantum_efficiency=EfficiencyCurve((380, 499, 500), (0.5, 0.5, 0.0)), measured_at_nm=450)
    freed = replace(CAMERA, sensor=blind).channels.electrons
    assert freed[BLUE] > 2 * freed[GREEN] > 8 * freed[RED]


def test_shooting_is_tracing_and_taking():
    sky = Scene([], Texture.plain((0.5, 0.5, 0.5)))
    shot = CAMERA.shoot(sky, 0.01, generator(6))
    np.testing.assert_allclose(shot.light, to_linear(0.5), atol=0.01)
    garden = CAMERA.shoot(textured_scene(), CAMERA.white_exposure_s(), generator(6)).balanced / 0.8
    traced = CAMERA.shoot(textured_scene(), CAMERA.white_exposure_s(), generator(6)).light * CAMERA._falloff[..., None]
    assert np.abs(garden - traced).mean() < 0.03  # noise of some 2 %, and what interpolation loses


def test_a_camera_that_cannot_be_is_refused():
    with pytest.raises(ValueError, match="f_number must be positive"):
        replace(CAMERA, f_number=0)
    with pytest.raises(ValueError, match="transmittance"):
        replace(CAMERA, transmittance=1.2)
    with pytest.raises(ValueError, match=r"light must have shape \(121, 161, 3\)"):
        CAMERA.take(np.ones((4, 4, 3)), 1, generator(0))
