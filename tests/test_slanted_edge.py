"""The modulation transfer function of one edge, held to edges whose blur is known analytically.

A pixel's value is the light on its square: an edge's profile, averaged over a square that lies askew to the edge by θ.
That average is a second difference of the profile's second antiderivative, with steps cos θ and sin θ, so no sampling
is involved; and the MTF of pixel and blur together is MTF_blur(f) · sinc(f cos θ) · sinc(f sin θ).
"""

import re
from collections.abc import Callable
from functools import cache

import numpy as np
import pytest
from scipy.interpolate import CubicSpline
from scipy.optimize import brentq
from scipy.special import j1, ndtr

from camviz_clinic.measuring.sharpness.slanted_edge import SlantedEdge

ANGLES_DEG = (2, 3, 5, 7, 10, 12, 15)
BLURS = [
    ("gauss", 0.3), ("gauss", 0.5), ("gauss", 1.0), ("gauss", 2.0), ("gauss", 3.0),
    ("pixel", 0.0), ("disc", 0.7), ("disc", 1.5), ("disc", 3.0), ("disc", 5.0),
]  # fmt: skip


def second_antiderivative(blur: str, size: float) -> Callable[[np.ndarray], np.ndarray]:
    """Of the profile of an edge blurred by a Gaussian (σ), disc (radius), diffraction (λN) or nothing, in pixels."""
    if blur == "airy":
        return _of_airy(size)
    if blur == "pixel":
        return lambda d: np.where(d > 0, d**2 / 2, 0)
    if blur == "gauss":
        bell = np.sqrt(2 * np.pi)
        return lambda d: (d**2 + size**2) / 2 * ndtr(d / size) + d * size / 2 * np.exp(-(d**2) / 2 / size**2) / bell
    x = np.linspace(-size, size, 20001)
    profile = 0.5 + (np.arcsin(x / size) + x / size * np.sqrt(1 - (x / size) ** 2)) / np.pi
    once = np.concatenate([[0], np.cumsum((profile[1:] + profile[:-1]) / 2)]) * (x[1] - x[0])
    twice = np.concatenate([[0], np.cumsum((once[1:] + once[:-1]) / 2)]) * (x[1] - x[0])

    def of_disc(d: np.ndarray) -> np.ndarray:
        beyond = d - size
        return np.where(d <= size, np.interp(d, x, twice, left=0), twice[-1] + once[-1] * beyond + beyond**2 / 2)

    return of_disc


@cache
def _of_airy(size: float) -> Callable[[np.ndarray], np.ndarray]:
    """From the MTF M by Fourier's integral, d²/4 + ∫ M(f) (2πfd - sin 2πfd) / (4 π³ f³) df up to the cut-off 1/size."""
    nodes, weights = np.polynomial.legendre.leggauss(3000)
    f, df = (nodes + 1) / 2 / size, weights / 2 / size
    places = np.arange(-260, 260, 0.05)
    turns = 2 * np.pi * f
    whole = [
        np.sum(df * diffraction(f * size) * (turns * d - np.sin(turns * d)) / (4 * np.pi**3 * f**3)) for d in places
    ]
    spline = CubicSpline(places, whole)
    return lambda d: d**2 / 4 + spline(d)


def diffraction(s):
    """A round opening's MTF at s times the cut-off (Goodman, "Introduction to Fourier Optics", 6.3)."""
    s = np.minimum(s, 1)
    return 2 / np.pi * (np.arccos(s) - s * np.sqrt(1 - s**2))


def photograph(blur, size, angle_deg, shape=(80, 100), dark=0.1, contrast=0.8):
    theta = np.radians(angle_deg)
    c, s = np.cos(theta), np.sin(theta)
    v, u = np.indices(shape)
    d = (u - shape[1] / 2 - 0.37) * c - (v - shape[0] / 2) * s
    G = second_antiderivative(blur, size)
    square = G(d + (c + s) / 2) - G(d + (c - s) / 2) - G(d - (c - s) / 2) + G(d - (c + s) / 2)
    return dark + contrast * square / (c * s)


def true_mtf(blur, size, angle_deg, f):
    theta = np.radians(angle_deg)
    pixel = np.sinc(f * np.cos(theta)) * np.sinc(f * np.sin(theta))
    if blur == "gauss":
        return np.exp(-2 * (np.pi * size * f) ** 2) * pixel
    if blur == "airy":
        return diffraction(f * size) * pixel
    return pixel if blur == "pixel" else 2 * j1(2 * np.pi * size * f) / (2 * np.pi * size * f) * pixel


def true_mtf50(blur, size, angle_deg):
    end = 0.6 / size if blur == "disc" else 0.99 / size if blur == "airy" else 0.95
    return brentq(lambda f: true_mtf(blur, size, angle_deg, f) - 0.5, 1e-6, min(end, 0.95))


@pytest.mark.sampled(14)
@pytest.mark.parametrize(("blur", "size"), BLURS)
@pytest.mark.parametrize("angle_deg", ANGLES_DEG)
def test_mtf50_is_within_one_percent_without_noise(blur, size, angle_deg):
    edge = SlantedEdge.of(photograph(blur, size, angle_deg))
    assert edge.angle_deg == pytest.approx(angle_deg, abs=0.05)
    assert edge.mtf50 == pytest.approx(true_mtf50(blur, size, angle_deg), rel=0.01)


@pytest.mark.thorough
@pytest.mark.parametrize("size", [0.5, 2.0])
def test_the_wide_feet_of_diffraction_are_cut_off_and_read_as_up_to_three_percent_sharper(size):
    """Its line spread falls with 1/x² only; no window holds all of it, and the standard's holds less."""
    edge = SlantedEdge.of(photograph("airy", size, 5))
    assert 0 < edge.mtf50 / true_mtf50("airy", size, 5) - 1 < 0.03


@pytest.mark.sampled(8)
@pytest.mark.parametrize(("blur", "size"), BLURS)
@pytest.mark.parametrize("angle_deg", [2, 5, 10, 15])
def test_mtf50_is_within_three_percent_with_two_percent_noise(blur, size, angle_deg):
    """Of an edge 400 pixels long: chance falls with the root of the length, and leaves up to 7 % at 80 rows."""
    sharp = photograph(blur, size, angle_deg, shape=(400, 140))
    noisy = sharp + np.random.default_rng(angle_deg).normal(0, 0.02 * 0.8, sharp.shape)
    assert SlantedEdge.of(noisy).mtf50 == pytest.approx(true_mtf50(blur, size, angle_deg), rel=0.03)


@pytest.mark.thorough
@pytest.mark.parametrize(
    ("blur", "size", "angle_deg", "rows", "noise"),
    [
        ("gauss", 1.0, 5, 80, 0.02),
        pytest.param("gauss", 0.5, 2, 80, 0.02, marks=pytest.mark.thorough),
        pytest.param("pixel", 0.0, 10, 80, 0.02, marks=pytest.mark.thorough),
        pytest.param("disc", 3.0, 5, 80, 0.02, marks=pytest.mark.thorough),
        ("gauss", 1.0, 5, 30, 0.01),
        pytest.param("gauss", 2.0, 15, 200, 0.005, marks=pytest.mark.thorough),
    ],
)
def test_the_standard_error_is_how_far_chance_moves_mtf50(blur, size, angle_deg, rows, noise):
    """60 noisy photographs of one edge. False failure: 2e-3 each (a deviation of 60 is known to 9 %)."""
    sharp, rng = photograph(blur, size, angle_deg, (rows, 100)), np.random.default_rng(7)
    noisy = [SlantedEdge.of(sharp + rng.normal(0, noise * 0.8, sharp.shape)) for _ in range(60)]
    found, errors = np.array([(edge.mtf50, edge.mtf50_error) for edge in noisy]).T
    assert np.mean(errors) == pytest.approx(found.std(), rel=0.3)
    off = np.abs(found - true_mtf50(blur, size, angle_deg))
    assert 0.85 <= np.mean(off < 2 * errors) <= 1.0
    assert 0.5 <= np.mean(off < errors) <= 0.85


@pytest.mark.thorough
def test_noise_that_grows_with_the_light_is_counted_where_it_is():
    """Photons: the bright side is noisier. Error and scatter of 60 photographs agree to a third, as above."""
    rng = np.random.default_rng(3)
    electrons = 2000 * photograph("gauss", 1.0, 5, (120, 100), dark=0.02, contrast=0.9)
    noisy = [SlantedEdge.of(rng.poisson(electrons).astype(float)) for _ in range(60)]
    found, errors = np.array([(edge.mtf50, edge.mtf50_error) for edge in noisy]).T
    assert np.mean(errors) == pytest.approx(found.std(), rel=0.3)
    noise = noisy[0].residual_noise
    assert np.median(noise[-100:]) > 3 * np.median(noise[:100])


@pytest.mark.parametrize(("blur", "size"), [("gauss", 0.7), ("disc", 2.0)])
def test_the_whole_curve_is_the_true_one(blur, size):
    edge = SlantedEdge.of(photograph(blur, size, 5))
    f = np.linspace(0.01, 0.5, 50)
    np.testing.assert_allclose(edge.mtf(f), np.abs(true_mtf(blur, size, 5, f)), atol=0.01)
    assert edge.mtf(0.0) == pytest.approx(1)


def test_the_same_edge_turned_mirrored_and_dimmed_has_the_same_sharpness():
    image = photograph("gauss", 1.0, 5)
    sharpness = SlantedEdge.of(image).mtf50
    for other in (image.T, image[:, ::-1], image[::-1], 1 - image, 40 + 200 * image, -image.T):
        assert SlantedEdge.of(other).mtf50 == pytest.approx(sharpness, rel=1e-3)


def test_rise_and_contrast_are_those_of_the_profile():
    """A Gaussian edge rises from 10 to 90 % over 2.563 σ; the pixel adds a twelfth to the variance."""
    edge = SlantedEdge.of(photograph("gauss", 2.0, 5))
    assert edge.contrast == pytest.approx(0.8, rel=1e-3)
    assert edge.rise == pytest.approx(2.5631 * np.sqrt(4 + 1 / 12), rel=0.005)


@pytest.mark.parametrize(
    ("image", "words"),
    [
        (np.ones((40, 40)), "no edge"),
        (np.random.default_rng(1).normal(0.5, 0.1, (60, 60)), "no edge"),
        (photograph("gauss", 1.0, 0.3), "leans by 0.3°"),
        (photograph("gauss", 1.0, 5)[:10], "at least 16 × 16 pixels, got 100 × 10"),
        (photograph("gauss", 1.0, 2, shape=(20, 80)), "crosses less than one pixel"),
        (np.ones((4, 4, 3)), "shape (4, 4, 3)"),
        (np.full((40, 40), np.nan), "finite"),
    ],
)
def test_what_holds_no_such_edge_is_refused_in_one_sentence(image, words):
    with pytest.raises(ValueError, match=re.escape(words)):
        SlantedEdge.of(image)
