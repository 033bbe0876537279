"""Spectra: lights, the observer, charts and cameras are as published; black bodies obey Planck."""

from __future__ import annotations

import warnings

import numpy as np
import pytest

from camviz.colour import spectra

with warnings.catch_warnings():
    warnings.simplefilter("ignore")
    import colour


def published_at(spectrum):
    """A spectrum of colour-science at those of camviz's wavelengths where it was measured, and which these are."""
    known = np.isin(spectra.WAVELENGTHS_NM, spectrum.domain)
    return np.array([spectrum[nm] for nm in spectra.WAVELENGTHS_NM[known]]), known


@pytest.mark.parametrize("name", spectra.ILLUMINANTS)
def test_illuminants_are_as_published(name):
    values, known = published_at(colour.SDS_ILLUMINANTS[name])
    np.testing.assert_allclose(spectra.illuminant(name)[known], values, rtol=1e-6)
    assert known.all()


def test_the_observer_is_as_published():
    cmfs = colour.MSDS_CMFS["CIE 1931 2 Degree Standard Observer"]
    np.testing.assert_allclose(spectra.observer(), cmfs[spectra.WAVELENGTHS_NM], rtol=1e-6, atol=1e-12)


def test_the_chart_is_as_published():
    chart = colour.SDS_COLOURCHECKERS["cc_ohta"]
    for one, name, sd in zip(spectra.reflectances(), spectra.patch_names(), chart.values(), strict=True):
        np.testing.assert_allclose(one, sd[spectra.WAVELENGTHS_NM], rtol=1e-6, err_msg=name)
    assert [name.partition(" (")[0] for name in chart] == list(spectra.patch_names())


@pytest.mark.parametrize(
    ("camera", "its"), [("Nikon D5100", "Nikon 5100 (NPL)"), ("Sigma SD1 Merrill", "Sigma SDMerill (NPL)")]
)
def test_cameras_are_as_published(camera, its):
    theirs = colour.MSDS_CAMERA_SENSITIVITIES[its]
    known = np.isin(spectra.WAVELENGTHS_NM, theirs.domain)
    np.testing.assert_allclose(spectra.sensitivities(camera)[known], theirs[spectra.WAVELENGTHS_NM[known]], atol=2e-7)
    assert spectra.sensitivities(camera).min() >= 0


def test_a_black_body_obeys_planck():
    nm = colour.SpectralShape(380, 780, 5)
    for kelvin in (1000, 2856, 6500, 20000):
        theirs = colour.sd_blackbody(kelvin, nm)
        np.testing.assert_allclose(spectra.planckian(kelvin), 100 * theirs.values / theirs[560], rtol=1e-6)


@pytest.mark.parametrize("kelvin", [4000, 5003, 6504, 7000, 12000, 25000])
def test_daylight_follows_the_cie(kelvin):
    """The oracle is told not to round its weights either."""
    xy = colour.temperature.CCT_to_xy_CIE_D(kelvin)
    np.testing.assert_allclose(spectra.daylight_xy(kelvin), xy, atol=1e-12)
    theirs = colour.sd_CIE_illuminant_D_series(xy, M1_M2_rounding=False)
    np.testing.assert_allclose(spectra.daylight(kelvin), theirs[spectra.WAVELENGTHS_NM], rtol=1e-6)


def test_the_tabulated_daylight_is_that_of_its_temperature():
    """D65 is daylight of 6500 K times 1.4388/1.4380, since the constant c2 was measured better after it was named."""
    np.testing.assert_allclose(spectra.daylight(6500 * 1.4388 / 1.4380), spectra.illuminant("D65"), rtol=2e-3)


def test_resampling_keeps_what_it_meets_and_is_dark_outside():
    light = spectra.illuminant("D65")
    np.testing.assert_array_equal(
        spectra.resampled(light, [375, 380, 382.5, 780, 790])[[0, 1, 3, 4]], [0, light[0], light[-1], 0]
    )
    assert spectra.resampled(light, 382.5) == pytest.approx((light[0] + light[1]) / 2)
    assert spectra.resampled(spectra.observer(), np.arange(400, 701, 10)).shape == (31, 3)


def test_tables_cannot_be_written_to():
    with pytest.raises(ValueError, match="read-only"):
        spectra.illuminant("A")[0] = 1


@pytest.mark.parametrize(
    ("call", "words"),
    [
        (lambda: spectra.illuminant("D66"), "illuminant must be one of A, D50"),
        (lambda: spectra.sensitivities("phone"), "camera must be one of Nikon"),
        (lambda: spectra.planckian(0), "kelvin must be above 0"),
        (lambda: spectra.daylight(3000), r"kelvin must be 4000 … 25000 for daylight, got 3000"),
        (lambda: spectra.daylight(float("nan")), "kelvin must be"),
    ],
)
def test_what_has_no_spectrum_is_refused_by_name(call, words):
    with pytest.raises(ValueError, match=words):
        call()
