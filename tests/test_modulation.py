"""What a lens and a pixel leave of a grating, held to integrals over the opening and to published values."""

import numpy as np
import pytest
from scipy.integrate import dblquad, quad
from scipy.special import j0

from camviz import optics

GREEN = 550.0


def pupil_overlap(s, waves):
    """The transfer function of a round pupil with `waves` of defocus at its rim, summed over a fine grid of it.

    By definition: the pupil against its copy, moved by 2 s radii, with the phases' difference; nothing else is assumed.
    """
    n = 1601
    y, x = np.meshgrid(np.linspace(-1, 1, n), np.linspace(-1, 1, n))
    left, right = (x + s) ** 2 + y**2, (x - s) ** 2 + y**2
    both = (left <= 1) & (right <= 1)
    phase = 2 * np.pi * waves * (left - right)
    return np.sum(np.cos(phase) * both) * (2 / (n - 1)) ** 2 / np.pi


@pytest.mark.sampled(5)
@pytest.mark.parametrize("s", [0.05, 0.2, 0.5, 0.8])
@pytest.mark.parametrize("waves", [0.0, 0.25, 0.5, 1.0, 3.0])
def test_a_lens_passes_what_its_pupil_has_in_common_with_its_moved_copy(s, waves):
    N = 8.0
    frequency = s / (550e-6 * N)
    disc = 8 * N * waves * 550e-6  # the width of the rays' disc for so many waves of defocus
    assert optics.lens_transfer(frequency, N, GREEN, disc) == pytest.approx(pupil_overlap(s, waves), abs=2e-3)


def test_diffraction_alone_is_the_fourier_transform_of_the_airy_pattern():
    """Hankel transform of the formula gives (2 J1(x)/x)², at its first dark ring zero: 1.22 λ N (Airy 1835)."""
    N, cut = 5.6, 1 / (550e-6 * 5.6)

    def spread(r):
        return quad(lambda f: optics.diffraction_transfer(f, N, GREEN) * j0(2 * np.pi * f * r) * f, 0, cut)[0]

    assert spread(1.2197 / cut) == pytest.approx(0, abs=1e-4 * spread(0))
    assert optics.cutoff_per_mm(N, GREEN) == pytest.approx(cut)
    assert optics.diffraction_transfer(1.01 * cut, N, GREEN) == 0


def test_the_mtf_of_a_perfect_lens_at_two_places():
    """2/π (π/3 - √3/4) = 0.391 at half the cut-off; half of the contrast is left at 0.404 of it."""
    assert optics.diffraction_transfer(0.5, 1e3, 1e3) == pytest.approx(0.3910, abs=1e-4)
    assert optics.diffraction_transfer(0.404, 1e3, 1e3) == pytest.approx(0.5, abs=1e-3)


def test_a_disc_and_a_square_are_averaged_over_their_areas():
    f, c = 37.0, 0.02
    disc = dblquad(
        lambda y, x: np.cos(2 * np.pi * f * x), -c / 2, c / 2, lambda x: -np.sqrt(max(c**2 / 4 - x**2, 0)),
        lambda x: np.sqrt(max(c**2 / 4 - x**2, 0)),
    )[0] / (np.pi * c**2 / 4)  # fmt: skip
    assert optics.disc_transfer(f, c) == pytest.approx(disc, abs=1e-6)
    assert optics.disc_transfer(0.0, c) == 1
    square = quad(lambda x: np.cos(2 * np.pi * f * x), -0.002, 0.002)[0] / 0.004
    assert optics.pixel_transfer(f, 0.004) == pytest.approx(square)
    assert optics.pixel_transfer(250, 0.004) == pytest.approx(0, abs=1e-12)


def test_the_lens_is_diffraction_in_focus_and_a_disc_far_out_of_it():
    f = np.linspace(0, 400, 81)
    np.testing.assert_allclose(optics.lens_transfer(f, 5.6), optics.diffraction_transfer(f, 5.6), atol=1e-6)
    low = np.linspace(0, 40, 41)
    np.testing.assert_allclose(
        optics.lens_transfer(low, 1.4, GREEN, 0.1), optics.disc_transfer(low, 0.1), atol=0.02
    )  # 16 waves


def test_diffraction_and_defocus_do_not_multiply():
    """At half a wave of defocus the product is 0.22 too low: both happen in one opening."""
    N, c = 8.0, 8 * 8.0 * 0.5 * 550e-6
    f = np.linspace(1, 220, 220)
    product = optics.diffraction_transfer(f, N) * optics.disc_transfer(f, c)
    assert np.max(optics.lens_transfer(f, N, GREEN, c) - product) == pytest.approx(0.22, abs=0.01)


@pytest.mark.parametrize("angle_deg", [0, 5, 15, 25, 31.7, 60])
@pytest.mark.parametrize("aperture", [4.0, 17.5, 25.0, 40.0])
def test_what_a_rim_leaves_of_the_aperture_is_counted_point_by_point(angle_deg, aperture):
    rim, distance = 32.0, 20.0
    y, x = np.meshgrid(np.linspace(-1, 1, 801), np.linspace(-1, 1, 801))
    disc = x**2 + y**2 <= 1
    aside = distance * np.tan(np.radians(angle_deg))
    seen = np.hypot(x * aperture / 2 - aside, y * aperture / 2) <= rim / 2
    share = optics.unvignetted_share(np.radians(angle_deg), aperture, rim, distance)
    assert share == pytest.approx((disc & seen).sum() / disc.sum(), abs=3e-3)


def test_exposure_values_of_the_sunny_16_rule():
    """Full sun is EV 15 at ISO 100: f/16 at 1/125 s, within a twentieth of a stop."""
    assert optics.exposure_value(16, 1 / 125) == pytest.approx(15, abs=0.05)
    assert optics.exposure_value(1, 1) == 0
    assert optics.exposure_value(2.0, 1 / 500) - optics.exposure_value(4.0, 1 / 125) == pytest.approx(0)
