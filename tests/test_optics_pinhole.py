"""The pinhole: shadow, diffraction, exposure and field of view, against geometry, Bessel functions and brute force."""

import numpy as np
import pytest
from scipy.optimize import minimize_scalar
from scipy.special import j1, jn_zeros

from camviz import optics
from camviz.cameras import Intrinsics

HOLES = (0.05, 0.15, 0.26, 0.33, 0.6, 1.0)


def light_within(radius_mm, hole_mm, focal_mm, object_mm=np.inf):
    """The share of a point's light inside a circle, by summing rings."""
    r = np.linspace(0, radius_mm, 1500)
    return np.trapezoid(optics.pinhole_spread(r, hole_mm, focal_mm, object_mm) * 2 * np.pi * r, r)


@pytest.mark.parametrize("object_mm", [200.0, 1000.0, 1e9])
def test_the_shadow_of_the_hole_is_as_wide_as_straight_rays_past_its_rim_make_it(object_mm):
    point, wall = np.array([3.0, object_mm]), -50.0
    rims = np.array([[-0.2, 0.0], [0.2, 0.0]])
    steps = rims - point
    ends = rims[:, 0] + steps[:, 0] * (wall / steps[:, 1])
    assert optics.geometric_blur_mm(0.4, 50, object_mm) == pytest.approx(abs(np.diff(ends)[0]), rel=1e-9)


def test_the_first_dark_ring_is_the_first_zero_of_the_bessel_function_j1():
    assert pytest.approx(2 * jn_zeros(1, 1)[0] / np.pi, abs=1e-3) == optics.AIRY
    # golden: Airy radius 2.684 µm at f/4 and 10.736 µm at f/16, 550 nm
    assert 500 * optics.diffraction_blur_mm(12.5, 50) == pytest.approx(2.684, abs=5e-4)
    assert 500 * optics.diffraction_blur_mm(3.125, 50) == pytest.approx(10.736, abs=5e-4)


def test_a_narrow_hole_makes_airys_pattern():
    hole, focal = 0.02, 100.0  # Fresnel number 0.002
    r = np.linspace(0.01, 10, 300)
    x = np.pi * hole * r / (550e-6 * focal)
    airy = (2 * j1(x) / x) ** 2 * np.pi * hole**2 / 4 / (550e-6 * focal) ** 2
    np.testing.assert_allclose(optics.pinhole_spread(r, hole, focal), airy, rtol=0, atol=1e-5 * airy.max())


@pytest.mark.parametrize("zones", [0.5, 1.0, 2.0, 3.0, 4.0])
def test_on_the_axis_the_light_comes_and_goes_with_the_number_of_zones(zones):
    """4 sin²(πN/2) times the light without a screen: bright for one zone, dark for two (Born & Wolf 1999, 8.2)."""
    hole = 2 * np.sqrt(zones * 550e-6 * 50)
    assert optics.fresnel_number(hole, 50) == pytest.approx(zones)
    on_axis = optics.pinhole_spread(np.zeros(1), hole, 50)[0] * np.pi * hole**2 / 4
    assert on_axis == pytest.approx(4 * np.sin(np.pi * zones / 2) ** 2, abs=1e-9)


@pytest.mark.parametrize("object_mm", [500.0, np.inf])
def test_the_spread_is_huygens_waves_from_all_over_the_hole(object_mm):
    """Brute force: waves from 400 000 places in the hole, whose paths differ by (ρ² - 2 ρ·r) / 2f + ρ² / 2Z."""
    hole, focal, wave = 0.4, 50.0, 550e-6
    side = (np.arange(800) + 0.5) / 800 * hole - hole / 2
    x, y = np.meshgrid(side, side)
    open_ = x**2 + y**2 < hole**2 / 4
    x, y = x[open_], y[open_]
    for r in (0.0, 0.08, 0.21, 0.35):
        path = ((x - r) ** 2 + y**2) / (2 * focal) + (x**2 + y**2) / (2 * object_mm)
        amplitude = np.mean(np.exp(2j * np.pi * path / wave)) * np.pi * hole**2 / 4
        light = np.abs(amplitude) ** 2 / (wave * focal) ** 2 / (np.pi * hole**2 / 4)
        spread = optics.pinhole_spread(np.array([r]), hole, focal, object_mm)[0]
        assert spread == pytest.approx(light, abs=0.01)  # the brightest is some 20 per mm²


@pytest.mark.parametrize("hole", HOLES)
def test_no_light_is_lost_between_hole_and_wall(hole):
    airy = float(optics.diffraction_blur_mm(hole, 50))
    assert 0.96 < light_within(hole / 2 + 6 * airy, hole, 50) < 1.0005


@pytest.mark.parametrize("hole", HOLES)
def test_the_rule_of_thumb_holds_the_share_of_light_of_an_airy_disc(hole):
    share = light_within(float(optics.pinhole_blur_mm(hole, 50)) / 2, hole, 50)
    assert 0.78 < share < 1.0
    if hole < 0.4:  # up to the best hole and beyond; a shadow and an Airy disc added as lengths would hold 0.86 to 0.91
        assert share == pytest.approx(0.838, abs=0.02)


@pytest.mark.parametrize("focal", [15.0, 50.0, 120.0])
def test_the_best_hole_is_where_the_blur_is_least(focal):
    found = minimize_scalar(lambda d: float(optics.pinhole_blur_mm(d, focal)), bounds=(0.01, 2), method="bounded")
    assert optics.best_hole_mm(focal) == pytest.approx(found.x, rel=1e-4)


def test_the_published_best_holes_at_50_mm_in_green_light():
    assert optics.best_hole_mm(50) == pytest.approx(0.2590, abs=1e-4)
    assert optics.best_hole_mm(50, constant=optics.RAYLEIGH) == pytest.approx(0.3151, abs=1e-4)
    assert optics.best_hole_mm(50, constant=optics.YOUNG) == pytest.approx(0.3317, abs=1e-4)


def test_youngs_hole_is_one_fresnel_zone_wide():
    young = float(optics.best_hole_mm(80, constant=optics.YOUNG))
    assert optics.fresnel_number(young, 80) == pytest.approx(1)


@pytest.mark.parametrize(("hole", "focal"), [(0.05, 120), (0.05, 15), (0.3, 50), (1.0, 50), (2.0, 15), (0.01, 15)])
def test_a_kernel_keeps_the_light_and_its_middle(hole, focal):
    kernel = optics.pinhole_kernel(0.075, hole, focal, 3000)
    steps = np.arange(len(kernel)) - len(kernel) // 2
    assert kernel.shape == (len(steps), len(steps))
    assert len(steps) % 2 == 1
    assert kernel.sum() == pytest.approx(1)
    assert kernel.min() >= 0
    assert kernel.sum(axis=0) @ steps == pytest.approx(0, abs=1e-9)


def test_a_wide_holes_kernel_has_the_spread_of_a_disc():
    """A disc of diameter D has the standard deviation D/4 along any axis."""
    kernel = optics.pinhole_kernel(0.075, 2.0, 50, 1000)
    steps = 0.075 * (np.arange(len(kernel)) - len(kernel) // 2)
    assert np.sqrt(kernel.sum(axis=0) @ steps**2) == pytest.approx(2.0 * 1.05 / 4, rel=0.01)


def test_fringes_and_plain_shadow_blur_alike_where_the_kernel_changes_over():
    waves = optics.pinhole_kernel(0.075, 1.15, 50, many=1e9)
    plain = optics.pinhole_kernel(0.075, 1.15, 50, many=0)
    pad = (len(waves) - len(plain)) // 2
    assert np.abs(waves - np.pad(plain, pad)).sum() / 2 < 0.12  # the share of the light that lands elsewhere


def test_light_grows_with_the_hole_squared_and_falls_with_the_box_squared():
    once = optics.sunny_exposure(0.3, 50, 1)
    assert optics.sunny_exposure(0.6, 50, 1) == pytest.approx(4 * once)
    assert optics.sunny_exposure(0.3, 100, 1) == pytest.approx(once / 4)
    assert optics.sunny_exposure(50 / 16, 50, 0.01) == pytest.approx(1)  # the sunny 16 rule


def test_the_field_of_view_is_that_of_the_same_box_as_a_camera():
    pixels = Intrinsics.from_sensor(480, 360, focal_mm=50, pitch_um=75)
    angle = optics.field_of_view_deg(36, 50)
    assert angle == pytest.approx(39.5978, abs=1e-4)
    assert Intrinsics.from_fov(480, 360, float(angle)).fx == pytest.approx(pixels.fx)
