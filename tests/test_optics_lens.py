"""The thin lens and what is behind it: published values, and geometry worked out again by other means."""

import numpy as np
import pytest

from camviz import optics


def test_object_and_image_are_where_two_rays_from_the_object_s_tip_cross_again():
    """The ray along the axis leaves through the focal point; the ray through the middle goes straight on."""
    f, u, h = 50.0, 180.0, 10.0
    v = (h - -0.0) / (h / f - h / u)  # h - h z/f = -h z/u, solved for z
    assert optics.image_distance_mm(f, u) == pytest.approx(v)
    assert optics.magnification(f, u) == pytest.approx((h / u * v) / h)


def test_focusing_at_one_metre_moves_the_sensor_back_and_narrows_the_field():
    v = optics.image_distance_mm(50, 1000)
    assert v == pytest.approx(52.63, abs=5e-3)
    assert optics.image_distance_mm(50, np.inf) == 50
    assert optics.field_of_view_deg(36, v) == pytest.approx(np.degrees(2 * np.arctan(18 / 52.6316)), abs=1e-4)
    assert optics.field_of_view_deg(36, v) < optics.field_of_view_deg(36, 50)


def test_the_lens_equation_is_its_own_inverse_and_knows_virtual_images():
    u = np.array([60.0, 75.0, 400.0, 1e5])
    np.testing.assert_allclose(optics.object_distance_mm(50, optics.image_distance_mm(50, u)), u, rtol=1e-9)
    assert optics.image_distance_mm(50, 50) == np.inf
    assert optics.image_distance_mm(50, 25) == pytest.approx(-50)  # a magnifying glass: twice as large, upright


def test_hyperfocal_distance_and_limits_have_their_published_values():
    assert optics.hyperfocal_mm(50, 8, 0.03) == pytest.approx(10466.67, abs=5e-3)
    H = optics.hyperfocal_mm(50, 8, 0.03)
    assert optics.near_limit_mm(50, 8, H, 0.03) == pytest.approx(5233.33, abs=5e-3)
    assert optics.far_limit_mm(50, 8, H, 0.03) == np.inf
    assert optics.near_limit_mm(50, 8, H / 2, 0.03) == pytest.approx(3494.48, abs=5e-3)
    assert optics.far_limit_mm(50, 8, H / 2, 0.03) == pytest.approx(10416.67, abs=5e-3)


def test_where_no_blur_is_allowed_only_the_focus_is_sharp():
    for limit in (optics.near_limit_mm, optics.far_limit_mm):
        np.testing.assert_array_equal(limit(50, 8, [400.0, 5000.0, np.inf], 0), [400, 5000, np.inf])
        assert limit(50, 8, 5000.0, 1e-9) == pytest.approx(5000, rel=1e-6)  # the limit of ever smaller circles


@pytest.mark.parametrize(("f", "N", "s", "c"), [(50, 8, 5233.3, 0.03), (100, 1.4, 900, 0.02), (24, 22, 400, 0.005)])
def test_at_the_limits_the_blur_is_the_circle_allowed(f, N, s, c):
    for limit in (optics.near_limit_mm(f, N, s, c), optics.far_limit_mm(f, N, s, c)):
        assert optics.circle_of_confusion_mm(f, N, s, limit) == pytest.approx(c, rel=1e-9)


def test_the_blur_of_a_point_is_where_the_sensor_cuts_the_cone_of_its_rays():
    """Traced: rays from an axis point through the aperture's rim, with matrices, to the sensor of a focused camera."""
    f, N, s = 85.0, 2.0, 1500.0
    v = optics.image_distance_mm(f, s)
    for u in (600.0, 1400.0, 4000.0, 1e6):
        rim = f / N / 2
        ray = optics.free_space(v) @ optics.ideal_lens(f) @ np.array([rim, rim / u])
        assert optics.circle_of_confusion_mm(f, N, s, u) == pytest.approx(2 * abs(ray[0]), rel=1e-9)
    assert optics.circle_of_confusion_mm(f, N, s, s) == 0
    assert optics.circle_of_confusion_mm(f, N, s, np.inf) == pytest.approx(f**2 / (N * (s - f)))


def test_a_lens_focused_at_infinity_is_the_limit_of_one_focused_ever_farther():
    """Near limit H - f, no far limit, and blur f² / (N u), without a warning; against a focus of 1000 km."""
    f, N, c, far = 50.0, 8.0, 0.03, 1e9
    H = optics.hyperfocal_mm(f, N, c)
    assert optics.near_limit_mm(f, N, np.inf, c) == H - f
    assert optics.near_limit_mm(f, N, far, c) == pytest.approx(H - f, rel=1e-4)
    assert optics.far_limit_mm(f, N, np.inf, c) == np.inf
    u = np.array([500.0, 4000.0, np.inf])
    blur = optics.circle_of_confusion_mm(f, N, np.inf, u)
    np.testing.assert_allclose(blur, [f**2 / (N * 500), f**2 / (N * 4000), 0], rtol=1e-12)
    np.testing.assert_allclose(optics.circle_of_confusion_mm(f, N, far, u[:2]), blur[:2], rtol=1e-4)
    limits = optics.far_limit_mm(f, N, [H / 2, H, np.inf], c)  # finite and infinite in one array
    np.testing.assert_allclose(limits, [optics.far_limit_mm(f, N, H / 2, c), np.inf, np.inf])


@pytest.mark.parametrize("focus", [30.0, 50.0, 0.0, -900.0, [900.0, 40.0, np.inf]])
def test_a_focus_inside_the_focal_length_is_refused_by_name(focus):
    """There the lens makes no real image, wherever the sensor stands."""
    got = 40 if isinstance(focus, list) else focus
    said = f"focus_mm must be greater than the focal length, 50 mm, for a real image; got {got:g}"
    for call in (optics.circle_of_confusion_mm, optics.near_limit_mm, optics.far_limit_mm):
        with pytest.raises(ValueError, match=said):
            call(50.0, 8.0, focus, 0.03)


def test_the_airy_disc_of_a_lens_focused_near_is_that_of_its_working_f_number():
    """Diffraction at the aperture, f/N wide, seen at the image's distance v: sin θ = 1.22 λ N / f, radius v sin θ."""
    f, N, u, wavelength_mm = 50.0, 8.0, 120.0, 550e-6
    radius_mm = optics.image_distance_mm(f, u) * 1.22 * wavelength_mm * N / f
    working = optics.working_f_number(N, optics.magnification(f, u))
    assert optics.airy_radius_um(working, 550) == pytest.approx(1e3 * radius_mm, rel=1e-12)


def test_airy_discs_have_their_published_radii():
    np.testing.assert_allclose(optics.airy_radius_um([4, 16], 550), [2.684, 10.736], atol=5e-4)
    lens = 500 * optics.diffraction_blur_mm(50 / 8, 50)  # the hole's formula, for a lens focused far away
    assert optics.airy_radius_um(8) == pytest.approx(lens, rel=1e-12)


def test_a_sensor_sees_less_light_the_closer_the_lens_is_focused_and_towards_its_corners():
    m = optics.magnification(50, 100)
    assert m == pytest.approx(1)
    assert optics.working_f_number(4, m) == pytest.approx(8)  # life size costs two stops
    assert optics.relative_illumination(np.radians(45)) == pytest.approx(0.25)
    assert optics.relative_illumination(np.radians([90.001, 115, 180])).tolist() == [0, 0, 0]


def test_the_cooke_triplet_has_the_focal_length_it_was_designed_for():
    """50 mm at 550 nm, by the programs that ship it."""
    assert optics.COOKE_TRIPLET.focal_mm == pytest.approx(50.0, abs=2e-4)
    assert np.linalg.det(optics.COOKE_TRIPLET.matrix) == pytest.approx(1)  # air to air


def test_the_telephoto_lens_is_shorter_than_its_focal_length():
    """600 mm by its patent; the indices' three decimals allow for one per cent."""
    lens = optics.TELEPHOTO
    assert lens.focal_mm == pytest.approx(600, rel=1e-2)
    assert lens.length_mm + lens.back_focal_mm == pytest.approx(173.1 + 269.3, rel=1e-2)
    assert lens.rear_principal_mm < 0  # the thin lens it replaces would hang in the air before it


@pytest.mark.parametrize("lens", [optics.COOKE_TRIPLET, optics.TELEPHOTO], ids=["triplet", "telephoto"])
def test_between_its_principal_planes_a_lens_is_a_thin_one(lens):
    """M = T(from second plane) · thin lens · T(to first plane)."""
    to_first = optics.free_space(lens.front_principal_mm)
    from_second = optics.free_space(lens.length_mm - lens.rear_principal_mm)
    thin = from_second @ optics.ideal_lens(lens.focal_mm) @ to_first
    np.testing.assert_allclose(thin, lens.matrix, atol=1e-9 * lens.focal_mm)


def test_exact_rays_through_the_triplet_near_its_axis_meet_where_the_matrices_say():
    """Snell's law in full, surface by surface."""
    lens, y, slope, n, z = optics.COOKE_TRIPLET, 0.01, 0.0, 1.0, 0.0
    angle = 0.0
    for radius, distance, after in lens.surfaces:
        centre = z + radius
        # the ray's distance from the centre of the sphere gives the angle of incidence
        reach = (y + (centre - z) * np.tan(angle)) * np.cos(angle)
        into = np.arcsin(reach / radius)
        out = np.arcsin(n / after * np.sin(into))
        polar = into - angle  # of the place where it meets the sphere
        hit_z, hit_y = centre - radius * np.cos(polar), radius * np.sin(polar)
        angle = out - polar
        z, y, n = z + distance, hit_y + (z + distance - hit_z) * np.tan(angle), after
    slope = np.tan(angle)
    assert -y / slope == pytest.approx(lens.back_focal_mm, rel=1e-5)


def test_parallel_light_is_traced_to_the_back_focal_point():
    lens = optics.COOKE_TRIPLET
    z, heights = lens.trace([-4.0, 1.0, 4.0], 0.0, reach_mm=10)
    assert z[0] == -10
    np.testing.assert_allclose(heights[-1], 0, atol=1e-12)
    assert z[-1] == pytest.approx(lens.length_mm + lens.back_focal_mm)
    np.testing.assert_allclose(heights[1], [-4, 1, 4])


@pytest.mark.parametrize("rows", [((50.0, 1.0),), ((0.0, 1.0, 1.5),), ((50.0, 1.0, 0.9),)])
def test_a_prescription_that_makes_no_sense_is_refused(rows):
    with pytest.raises(ValueError, match="surfaces must"):
        optics.Prescription("bad", rows)
