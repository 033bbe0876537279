"""Where distortions fold, how far they move pixels, and that undistortion takes them back; OpenCV is the oracle."""

from math import atan, inf, pi, sqrt, tan

import cv2
import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from camviz.cameras import Camera, Intrinsics
from camviz.distortion import (
    displacement,
    distort_maps,
    edge_of_field,
    fold_angle,
    fold_radius,
    ideal_image_radius,
    image_corner_radius,
    jacobian_determinant,
    pole_radius,
    remap,
    undistort_maps,
    undistorted_intrinsics,
    valid_region,
    weakest_denominator,
)
from camviz.lenses import (
    BrownConrady,
    DoubleSphere,
    Equidistant,
    KannalaBrandt,
    Perspective,
    Scaramuzza,
    UnifiedSphere,
)
from camviz.lenses.brown_conrady import MAX_CANCELLED_GAP

# The two cameras of OpenCV's samples/data/intrinsics.yml (M1 D1, M2 D2), pictures of 640×480.
PUBLISHED = {
    1: Camera(
        Intrinsics(
            640, 480, 5.3480326845051309e02, 5.3480326845051309e02, 3.3568643204394891e02, 2.4066183054066337e02
        ),
        BrownConrady(2.9589439552724328e-01, -1.0354662043042675e00),
    ),
    2: Camera(
        Intrinsics(
            640, 480, 5.3480326845051309e02, 5.3480326845051309e02, 3.3455744527912015e02, 2.4205324573376600e02
        ),
        BrownConrady(-1.6916358306948096e-01, -1.1214173641213163e-01),
    ),
}

COEFFICIENTS = (-0.28, 0.07, 1e-3, -5e-4, 0.01)
INTRINSICS = Intrinsics(640, 480, 530, 540, 335, 230)
CAMERA = Camera(INTRINSICS, BrownConrady.from_coefficients(COEFFICIENTS))
FISHEYE = Camera(Intrinsics(640, 480, 220, 220, 319.5, 239.5), KannalaBrandt(0.01, -0.002, 3e-4, -4e-4))


# Folds and poles


def test_barrel_distortion_folds_at_46_degrees():
    """g' = 1 + 3 k1 r² vanishes at r = 1/√0.9 for k1 = -0.3."""
    assert fold_radius(BrownConrady(-0.3)) == pytest.approx(1 / sqrt(0.9), rel=1e-14)
    assert round(fold_radius(BrownConrady(-0.3)), 4) == 1.0541


@pytest.mark.parametrize(
    "lens", [BrownConrady(-0.3), KannalaBrandt(-0.2), KannalaBrandt(0, -0.015), UnifiedSphere(0.8, -0.5)]
)
def test_a_radial_distance_grows_up_to_the_fold_angle_and_no_further(lens):
    angles = fold_angle(lens) + np.array([-2e-3, -1e-3, -1e-6, 1e-6])
    x = lens.project(np.stack([np.sin(angles), 0 * angles, np.cos(angles)], axis=-1))[:, 0]
    assert np.isfinite(x).tolist() == [True, True, True, False]
    assert 0 < x[2] - x[1] < x[1] - x[0] < 1e-4  # flatter and flatter


@pytest.mark.parametrize("lens", [Perspective(), Equidistant(), BrownConrady(0.3), UnifiedSphere(1), KannalaBrandt()])
def test_a_lens_that_always_grows_has_no_fold_angle(lens):
    assert fold_angle(lens) == inf


@pytest.mark.parametrize(("number", "fold"), [(1, 0.7305), (2, 0.9785)])
def test_the_published_calibration_folds_inside_its_picture(number, fold):
    """Both polynomials turn back before their images reach the corners, which then have no ray."""
    camera = PUBLISHED[number]
    k1, k2 = camera.lens.k1, camera.lens.k2
    by_hand = sqrt((-3 * k1 - sqrt(9 * k1**2 - 20 * k2)) / (10 * k2))  # 1 + 3 k1 s + 5 k2 s² = 0
    assert fold_radius(camera.lens) == pytest.approx(by_hand, rel=1e-13)
    assert fold_radius(camera.lens) == pytest.approx(fold, abs=1e-4)
    assert image_corner_radius(camera.intrinsics) == pytest.approx(0.772, abs=5e-4)
    assert camera.lens.radial(fold_radius(camera.lens)) < image_corner_radius(camera.intrinsics)
    valid = valid_region(camera)
    assert not valid[0, 0]
    assert valid[240, 320]


@pytest.mark.parametrize(
    "lens", [Perspective(), BrownConrady(), BrownConrady(0.3), Equidistant(), KannalaBrandt(), UnifiedSphere(1)]
)
def test_most_lenses_never_fold(lens):
    assert fold_radius(lens) == inf
    assert pole_radius(lens) == inf


def test_the_fold_of_a_fisheye_polynomial_is_an_angle():
    """θ_d' = 1 + 3 k1 θ² vanishes at θ = 1/√0.9 for k1 = -0.3."""
    assert fold_radius(KannalaBrandt(-0.3)) == pytest.approx(1 / sqrt(0.9), rel=1e-14)
    theta = np.linspace(0, fold_radius(KannalaBrandt(-0.3)), 50)
    assert (KannalaBrandt(-0.3).slope(theta[:-1]) > 0).all()


def test_a_distorted_sphere_folds_on_its_own_plane():
    assert fold_radius(UnifiedSphere(0.9, k1=-0.3)) == fold_radius(BrownConrady(-0.3))


@pytest.mark.parametrize("lens", [BrownConrady(k1=-0.4, k2=0.1), BrownConrady(0.4, -0.1, k3=0.02, k4=0.6, k5=0.2)])
def test_the_fold_is_where_the_radial_curve_stops_rising(lens):
    r = np.linspace(1e-4, 4, 400_001)
    falling = np.diff(lens.radial(r)) < 0
    first = r[falling.argmax()] if falling.any() else inf
    assert fold_radius(lens) == pytest.approx(first, abs=2e-5)


def test_no_ray_gets_to_a_fold_beyond_a_pole():
    """g = r (1 - 0.28 r² + 0.07 r⁴)/(1 - r²) rises to infinity at r = 1; at 1.893 it turns, unseen."""
    lens = BrownConrady(-0.28, 0.07, k4=-1)
    assert lens.radial(1.893) > lens.radial([1.8, 2.0]).max()
    assert (fold_radius(lens), fold_angle(lens), pole_radius(lens)) == (inf, inf, 1)
    assert np.isfinite(lens.project([np.tan(np.pi / 4 - 1e-6), 0, 1])).all()


def test_a_pole_is_a_root_of_the_denominator_and_a_near_pole_almost_one():
    assert pole_radius(BrownConrady(k4=-0.25)) == pytest.approx(2)
    assert weakest_denominator(BrownConrady(k4=-0.25), 1) == pytest.approx((1, 0.75))
    # D = 1 - 2 s + 1.01 s² has no root; its least value is 1 - 1/1.01, at s = 1/1.01
    near_pole = BrownConrady(k4=-2, k5=1.01)
    assert pole_radius(near_pole) == inf
    assert weakest_denominator(near_pole, 3) == pytest.approx((sqrt(1 / 1.01), 1 - 1 / 1.01))
    assert weakest_denominator(near_pole, 0.5) == pytest.approx((0.5, 1 - 0.5 + 1.01 / 16))
    assert weakest_denominator(Perspective(), 3) == (0, 1)
    # D = 1 - 8 s + 20 s² is least at s = 0.2, close to the axis: 0.2 there
    assert weakest_denominator(BrownConrady(k4=-8, k5=20), 3) == pytest.approx((sqrt(0.2), 0.2))


CANCELLED = BrownConrady(
    *(-2.8247717583453804, -0.8007807076436804, -0.014595359484103326, 0.0018820998949700702, 1.9827795585249783),
    *(-2.7306773773930897, -1.217725820479524, 2.4052243546080136),
    *(-0.0020670359760441713, 3.466088079317406e-05, 0.014100351510458799, -3.093532973620761e-05),
)
"""A calibration that was reported as faulty: N and D have roots at r = 0.5910499 and 0.5910491."""


def cancelling(pole, gap, extra=0.1):
    """N/D = (1 - s/((1 + gap) pole²)) (1 + extra s) / (1 - s/pole²): a pole that a root of N almost cancels."""
    zero = 1 / ((1 + gap) * pole**2)
    return BrownConrady(k1=extra - zero, k2=-extra * zero, k4=-1 / pole**2)


def test_the_first_root_of_several_is_that_of_numpy():
    """Of a cubic in r² with three positive roots, and of the reported calibration."""
    a, b, c = 0.9, 0.35, 2.0
    D = np.polynomial.polynomial.polyfromroots([a, b, c])
    assert pole_radius(BrownConrady(*[0] * 5, *(D[1:] / D[0]))) == pytest.approx(sqrt(b), rel=1e-12)
    roots = np.roots([2.4052243546080136, -1.217725820479524, -2.7306773773930897, 1])
    assert pole_radius(CANCELLED) == pytest.approx(sqrt(roots[roots > 0].min()), rel=1e-12)
    assert pole_radius(CANCELLED) == pytest.approx(0.5910491, abs=1e-7)
    twice = BrownConrady(k1=-1, k2=0.3, k3=-0.01)  # falls, rises and falls again
    slope = np.poly1d([-0.07, 1.5, -3, 1])
    assert fold_radius(twice) == pytest.approx(sqrt(slope.roots.real.min()), rel=1e-12)
    assert (slope.roots > 0).sum() == 3


@pytest.mark.parametrize(("gap", "ends"), [(0.99 * MAX_CANCELLED_GAP, True), (1.01 * MAX_CANCELLED_GAP, False)])
def test_a_cancelled_pole_ends_a_lens_before_it(gap, ends):
    lens = cancelling(0.6, gap)
    assert (lens.cancelled_radius < inf) == ends
    assert lens.limit_radius == (lens.cancelled_radius if ends else lens.pole_radius)


@pytest.mark.parametrize("gap", [1e-8, 1e-6, 1e-4])
def test_a_cancelled_pole_doubles_the_slope_where_it_ends(gap):
    """Of log g by log r, against its smooth continuation 1 + 0.1 s; up to there g follows the continuation."""
    lens, smooth = cancelling(0.6, gap), BrownConrady(k1=0.1)
    end = lens.cancelled_radius
    r = end * (1 + np.array([-1e-7, 1e-7]))
    steeper = np.diff(np.log(lens.radial(r)))[0] - np.diff(np.log(smooth.radial(r)))[0]
    assert steeper / 2e-7 == pytest.approx(1, rel=3 * sqrt(gap) + 1e-3)
    assert lens.radial(end) / smooth.radial(end) - 1 == pytest.approx(sqrt(gap / 2), rel=0.05)


ENDING = {
    "cancelled": CANCELLED,
    "cancelled early": cancelling(0.3, 1e-5),
    "zero before the pole": cancelling(0.5, -1e-5),
    "pole": BrownConrady(0.1, 0, 0, 0, 0, -0.8),
    "folds and returns": BrownConrady(k1=-1, k2=0.3, k3=-0.01),
    "folds and returns, tangential": BrownConrady(k1=-1, k2=0.9, k3=-0.01, p1=0.01, p2=-0.02),
    "thin prism": BrownConrady(-0.2, 0.1, 1e-3, -2e-3, 0.01, 0.1, 0, 0, 1e-2, -2e-3, -4e-3, 3e-3),
    "fisheye folds and returns": KannalaBrandt(-0.3, 0.1, -0.01),
    "Scaramuzza": Scaramuzza(0.3, -0.6, 0.3),
}


@pytest.mark.parametrize("lens", ENDING.values(), ids=ENDING)
def test_the_inverse_follows_one_branch_from_the_centre(lens):
    """Along image rays: no jump, no hole before its end, det J > 0, and where it is radial the dense table's branch."""
    radius = np.linspace(0, 1.5, 3001)[:, None, None]
    azimuth = np.linspace(0.1, 2 * pi, 12)
    rays = lens.unproject(radius * np.stack([np.cos(azimuth), np.sin(azimuth)], axis=-1))
    seen = np.isfinite(rays[..., 0])
    assert (np.diff(seen.astype(int), axis=0) <= 0).all()
    assert seen[100].all()
    steps = np.linalg.norm(np.diff(rays, axis=0), axis=-1)
    assert np.nanmax(steps) < 0.03
    ideal = rays[..., :2] / np.where(rays[..., 2:] > 0.05, rays[..., 2:], np.nan)
    determinant = jacobian_determinant(lens, ideal[np.isfinite(ideal[..., 0])])
    assert not (determinant < -1e-9).any()  # NaN next to the end, where it is by differences
    if isinstance(lens, BrownConrady) and not any((lens.p1, lens.p2, lens.s1)):
        r = np.linspace(0, 3, 1_000_001)
        rising = np.concatenate([[True], np.diff(lens.radial(r)) > 0]) & (r < lens.pole_radius)
        end = len(r) if rising.all() else int((~rising).argmax())
        table = np.interp(radius[:, 0, 0], lens.radial(r[:end]), r[:end])
        at = seen[:, 0]
        np.testing.assert_allclose(np.linalg.norm(ideal[at, 0], axis=-1), table[at], rtol=0, atol=3e-5)


def test_a_cancelled_pole_has_no_rays_behind_it():
    """Pixels (0, 0) and (10, 10) of the reported calibration: by the hairline branch they would be 10 px inwards."""
    grid = Intrinsics(1440, 1080, 1570.8956145992222, 1570.3494207432338, 744.873376467274, 575.5508745633753)
    rays = CANCELLED.unproject(grid.from_pixels([[0, 0], [10, 10], [50, 50]]))
    assert np.isnan(rays[:2]).all()
    assert np.isfinite(rays[2]).all()


def test_the_edge_of_the_field_is_the_fold_or_the_published_limit():
    azimuth = np.linspace(0, 2 * pi, 9)
    np.testing.assert_allclose(edge_of_field(BrownConrady(-0.3), azimuth), atan(1 / sqrt(0.9)), rtol=1e-10)
    np.testing.assert_allclose(edge_of_field(UnifiedSphere(0.5), azimuth), np.radians(120), rtol=1e-10)
    np.testing.assert_allclose(edge_of_field(Equidistant(), azimuth), pi, rtol=1e-10)
    assert edge_of_field(Perspective(), 0).shape == ()


# Jacobian


@pytest.mark.parametrize("lens", [BrownConrady(*COEFFICIENTS), KannalaBrandt(-0.05, 0.01), DoubleSphere(-0.2, 0.6)])
def test_the_jacobian_determinant_is_the_ratio_of_areas(lens):
    """A small square of the plane z = 1 and the area of its image, by the shoelace formula."""
    xy = np.random.default_rng(0).uniform(-0.8, 0.8, size=(20, 2))
    side = 1e-3
    square = xy[:, None] + side * (np.array([[0, 0], [1, 0], [1, 1], [0, 1]]) - 0.5)
    x, y = np.moveaxis(lens.project(np.concatenate([square, np.ones((20, 4, 1))], axis=-1)), -1, 0)
    area = (x * np.roll(y, -1, axis=1) - y * np.roll(x, -1, axis=1)).sum(axis=1) / 2
    np.testing.assert_allclose(jacobian_determinant(lens, xy), area / side**2, rtol=1e-5)


def test_beyond_a_fold_the_picture_is_mirrored():
    lens = BrownConrady(-0.3)
    assert jacobian_determinant(lens, [1.05, 0]) > 0
    assert jacobian_determinant(lens, [1.06, 0]) < 0
    assert np.isnan(jacobian_determinant(KannalaBrandt(-0.3), [5, 0]))


# Pixels


def test_the_valid_region_of_a_folding_lens_is_a_disc():
    intrinsics = Intrinsics(641, 481, 400, 400, 320, 240)
    valid = valid_region(Camera(intrinsics, BrownConrady(-0.5)))
    radius = np.linalg.norm(intrinsics.from_pixels(intrinsics.grid()), axis=-1)
    np.testing.assert_array_equal(valid, radius < 2 / 3 / sqrt(1.5))
    assert valid_region(Camera(intrinsics, BrownConrady(-0.5)), step_px=10).shape == (49, 65)


def test_displacements_lead_from_ideal_pixels_to_where_opencv_puts_them():
    ideal, vectors = displacement(CAMERA, 40)
    assert ideal.shape == vectors.shape == (12, 16, 2)
    np.testing.assert_allclose(ideal.reshape(-1, 2).mean(axis=0), [319.5, 239.5])
    points = np.concatenate([INTRINSICS.from_pixels(ideal), np.ones((12, 16, 1))], axis=-1).reshape(-1, 3)
    expected = cv2.projectPoints(points, np.zeros(3), np.zeros(3), INTRINSICS.K, np.array(COEFFICIENTS))[0]
    np.testing.assert_allclose((ideal + vectors).reshape(-1, 2), expected.reshape(-1, 2), atol=1e-9)


def test_without_distortion_nothing_is_displaced():
    _, vectors = displacement(Camera(INTRINSICS), 32)
    np.testing.assert_allclose(vectors, 0, atol=1e-12)


def test_the_ideal_radius_of_a_picture_is_the_tangent_of_its_widest_ray():
    assert ideal_image_radius(Camera(INTRINSICS)) == pytest.approx(image_corner_radius(INTRINSICS), rel=1e-12)
    narrow = Camera(Intrinsics(101, 101, 50, 50, 50, 50), Equidistant())
    assert ideal_image_radius(narrow) == pytest.approx(tan(sqrt(2)))


# Undistortion


@pytest.mark.parametrize("rotation", [None, Rotation.from_rotvec([0.05, -0.1, 0.02])])
@pytest.mark.parametrize(
    "lens", [CAMERA.lens, BrownConrady(*COEFFICIENTS, 0.05, 0.01, 0, 1e-3, 0, 0, 1e-3, 0.02, 0.01)]
)
def test_undistortion_maps_are_opencvs(lens, rotation):
    target = Intrinsics(500, 400, 450, 460, 240, 210)
    coefficients = np.array([getattr(lens, name) for name in lens.__dataclass_fields__])
    expected = cv2.initUndistortRectifyMap(
        INTRINSICS.K, coefficients, rotation and rotation.as_matrix(), target.K, (500, 400), cv2.CV_32FC1
    )
    maps = undistort_maps(Camera(INTRINSICS, lens), target, target_from_cam=rotation)
    np.testing.assert_allclose(maps, expected, rtol=0, atol=1e-4)  # float32 has 3e-5 px at 640
    assert maps[0].dtype == np.float32


def test_undistortion_maps_of_a_fisheye_are_opencvs():
    target = Intrinsics(500, 400, 200, 210, 240, 210)
    lens = FISHEYE.lens
    expected = cv2.fisheye.initUndistortRectifyMap(
        FISHEYE.intrinsics.K,
        np.array([lens.k1, lens.k2, lens.k3, lens.k4]),
        np.eye(3),
        target.K,
        (500, 400),
        cv2.CV_32FC1,
    )
    np.testing.assert_allclose(undistort_maps(FISHEYE, target), expected, rtol=0, atol=1e-4)


def test_distortion_maps_invert_undistortion_maps():
    """The ideal pixel of a distorted pixel, distorted, is that pixel."""
    for camera in (CAMERA, FISHEYE):
        source = Intrinsics(640, 480, 300, 310, 320, 240)
        ideal = np.stack(distort_maps(camera, source), axis=-1)
        back = camera.intrinsics.to_pixels(camera.lens.project(Perspective().unproject(source.from_pixels(ideal))))
        seen = np.isfinite(back[..., 0])
        assert seen.mean() > 0.9
        np.testing.assert_allclose(back[seen], camera.intrinsics.grid()[seen], rtol=0, atol=1e-3)  # float32 maps


def test_a_photograph_survives_being_distorted_and_undistorted():
    u, v = np.moveaxis(INTRINSICS.grid(), -1, 0)
    photograph = (127 + 60 * np.sin(u / 25) + 60 * np.cos(v / 31)).astype(np.float32)
    returned = remap(remap(photograph, distort_maps(CAMERA, INTRINSICS)), undistort_maps(CAMERA, INTRINSICS))
    assert np.abs(returned - photograph)[60:-60, 80:-80].max() < 1.5


def test_what_a_lens_does_not_show_is_black():
    camera = Camera(INTRINSICS, BrownConrady(-1.2))
    picture = remap(np.full((480, 640), 200, np.uint8), distort_maps(camera, INTRINSICS))
    assert picture[0, 0] == 0
    assert picture[230, 335] == 200


# The undistorted picture's intrinsics


@pytest.mark.parametrize("alpha", [0, 0.3, 1])
@pytest.mark.parametrize("coefficients", [(-0.28, 0.07, 1e-3, -5e-4, 0.01), (0.2, -0.05, 0, 0, 0), (0, 0, 0, 0, 0)])
def test_undistorted_intrinsics_are_opencvs(alpha, coefficients):
    """To 0.2 %: OpenCV looks at 9 points of each side and inverts in a few iterations."""
    result, roi = undistorted_intrinsics(Camera(INTRINSICS, BrownConrady(*coefficients)), alpha)
    K, cv_roi = cv2.getOptimalNewCameraMatrix(INTRINSICS.K, np.array(coefficients), (640, 480), alpha)
    np.testing.assert_allclose(result.K, K, rtol=2e-3, atol=0)
    np.testing.assert_allclose(roi, cv_roi, atol=2)
    assert (result.width, result.height) == (640, 480)


@pytest.mark.parametrize("camera", [CAMERA, PUBLISHED[1], PUBLISHED[2], FISHEYE], ids=["5", "yml1", "yml2", "fisheye"])
def test_alpha_0_leaves_no_black_and_the_roi_is_the_part_without(camera):
    target, roi = undistorted_intrinsics(camera, 0)
    inside = camera.intrinsics.contains(np.stack(undistort_maps(camera, target), axis=-1))
    assert roi == (0, 0, 640, 480)
    assert inside.all()
    target, (x0, y0, width, height) = undistorted_intrinsics(camera, 1)
    inside = camera.intrinsics.contains(np.stack(undistort_maps(camera, target), axis=-1))
    assert inside[y0 : y0 + height, x0 : x0 + width].all()
    assert not inside.all()


def test_alpha_1_keeps_every_pixel_of_the_photograph():
    target, _ = undistorted_intrinsics(CAMERA, 1)
    ideal = np.stack(distort_maps(CAMERA, target), axis=-1)
    assert target.contains(ideal).all()


def test_without_distortion_every_alpha_gives_the_same_picture():
    for alpha in (0, 0.5, 1):
        result, roi = undistorted_intrinsics(Camera(INTRINSICS), alpha)
        np.testing.assert_allclose(result.K, INTRINSICS.K, rtol=1e-12)
        assert roi == (0, 0, 640, 480)


def test_alpha_outside_0_to_1_is_refused():
    with pytest.raises(ValueError, match=r"alpha must lie between 0 .* and 1 .*, got 1.5"):
        undistorted_intrinsics(CAMERA, 1.5)


def test_a_folding_picture_beside_the_axis_cannot_be_undistorted():
    camera = Camera(Intrinsics(640, 480, 100, 100, 5000, 240), BrownConrady(-0.5))
    with pytest.raises(ValueError, match="its axis is not in the picture"):
        undistorted_intrinsics(camera, 0)
