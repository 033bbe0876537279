"""Pixels, poses and cameras, held to OpenCV and to what a resized, cropped or binned photograph really is."""

from math import pi

import cv2
import numpy as np
import pytest
from scipy.spatial.transform import RigidTransform, Rotation

from camviz.cameras import Camera, Intrinsics, Rig, look_at, rotate, transform
from camviz.lenses import BrownConrady, Equidistant, KannalaBrandt

INTRINSICS = Intrinsics(640, 480, 530, 540, 335, 230)
POSE = RigidTransform.from_components([0.3, -0.2, -1.5], Rotation.from_rotvec([0.1, -0.2, 0.3]))
POINTS = np.random.default_rng(0).uniform([-0.5, -0.4, 0.5], [0.5, 0.4, 2], size=(6, 5, 3))


def ramp(width, height):
    """An image whose value is a linear function of where its pixel is: bilinear resampling is then exact."""
    u, v = np.meshgrid(np.arange(width, dtype=float), np.arange(height, dtype=float))
    return 3 * u + 7 * v


@pytest.mark.parametrize(
    ("size", "within"), [((640, 480), (320, 240)), ((480, 640), (240, 320)), ((1, 4096), (1, 320))]
)
def test_a_grid_within_a_side_keeps_the_corners_of_the_view(size, within):
    large = Intrinsics(*size, 530, 540, 3.5, 7.0)
    small = large.within(320)
    assert (small.width, small.height) == within
    np.testing.assert_allclose(small.from_pixels(small.border(1)), large.from_pixels(large.border(1)), atol=1e-12)


# Projection


@pytest.mark.parametrize("coefficients", [(0, 0, 0, 0), (-0.2, 0.05, 1e-3, -2e-3, 0.01)])
def test_cameras_project_as_opencv_does(coefficients):
    """K ∘ lens ∘ cam_from_world for a camera with a pose, fx ≠ fy and an off-centre principal point, to 1e-9 px."""
    camera = Camera(INTRINSICS, BrownConrady.from_coefficients(coefficients), POSE)
    extrinsics = camera.cam_from_world
    expected = cv2.projectPoints(
        POINTS.reshape(-1, 3),
        extrinsics.rotation.as_rotvec(),
        extrinsics.translation,
        INTRINSICS.K,
        np.array(coefficients, float),
    )[0].reshape(6, 5, 2)
    np.testing.assert_allclose(camera.project(POINTS), expected, rtol=0, atol=1e-9)


def test_the_position_of_a_camera_is_not_t():
    """t = -R C, and the centre is the one point without an image."""
    camera = Camera(INTRINSICS, world_from_cam=POSE)
    np.testing.assert_allclose(camera.centre, [0.3, -0.2, -1.5])
    t, R = camera.cam_from_world.translation, camera.cam_from_world.rotation.as_matrix()
    np.testing.assert_allclose(t, -R @ camera.centre, atol=1e-15)
    assert np.isnan(camera.project(camera.centre)).all()


def test_a_pixel_s_ray_leads_back_to_the_point_it_shows():
    camera = Camera(INTRINSICS, KannalaBrandt(0.01, -0.002), POSE)
    rays = camera.unproject(camera.project(POINTS))
    distance = np.linalg.norm(POINTS - camera.centre, axis=-1, keepdims=True)
    np.testing.assert_allclose(camera.centre + distance * rays, POINTS, atol=1e-12)


def test_the_rays_of_all_pixels_are_those_of_each():
    camera = Camera(Intrinsics(20, 10, 15, 16, 9, 5), BrownConrady(-0.2), POSE)
    rays = camera.rays()
    assert rays.shape == (10, 20, 3)
    np.testing.assert_allclose(rays[7, 13], camera.unproject([13, 7]), atol=1e-15)
    rays[:] = 0  # what a caller does to his rays is his own affair
    np.testing.assert_allclose(camera.rays()[7, 13], camera.unproject([13, 7]), atol=1e-15)


def test_a_camera_sees_what_lies_before_it_and_inside_its_picture():
    camera = Camera(INTRINSICS)
    assert camera.sees([[0, 0, 1], [0, 0, -1], [5, 0, 1], [0, 0, 0]]).tolist() == [True, False, False, False]


def test_a_moved_camera_keeps_its_lens():
    moved = Camera(INTRINSICS, Equidistant()).at(POSE)
    assert moved.lens == Equidistant()
    np.testing.assert_array_equal(moved.centre, POSE.translation)


# Intrinsics


def test_skew_shears_the_pixel_axes():
    intrinsics = Intrinsics(640, 480, 500, 510, 320, 240, skew=3)
    homogeneous = intrinsics.K @ [0.1, 0.2, 1]
    np.testing.assert_allclose(intrinsics.to_pixels([0.1, 0.2]), homogeneous[:2])
    np.testing.assert_allclose(intrinsics.from_pixels(homogeneous[:2]), [0.1, 0.2])


def test_the_field_of_view_runs_from_edge_to_edge():
    intrinsics = Intrinsics.from_fov(640, 480, 90)
    assert intrinsics.fx == intrinsics.fy == pytest.approx(320)
    left, right = Camera(intrinsics).unproject([[-0.5, 239.5], [639.5, 239.5]])
    assert np.degrees(np.arccos(left @ right)) == pytest.approx(90)


def test_a_sensor_in_millimetres_is_a_focal_length_in_pixels():
    intrinsics = Intrinsics.from_sensor(4000, 3000, focal_mm=8, pitch_um=2)
    assert (intrinsics.fx, intrinsics.fy, intrinsics.cx, intrinsics.cy) == (4000, 4000, 1999.5, 1499.5)


def test_resizing_samples_the_same_picture():
    """cv2.resize of a ramp: the value found at a resized pixel is that of the ray's pixel before."""
    small = INTRINSICS.resized(320, 160)
    image = cv2.resize(ramp(640, 480), (320, 160), interpolation=cv2.INTER_LINEAR)
    uv = np.array([[100, 50], [200, 120]])
    before = INTRINSICS.to_pixels(small.from_pixels(uv))
    np.testing.assert_allclose(image[uv[:, 1], uv[:, 0]], before @ [3, 7], atol=1e-9)
    assert small.cx == pytest.approx(0.5 * 335 - 0.25)
    np.testing.assert_allclose(small.resized(640, 480).K, INTRINSICS.K)


def test_cropping_moves_only_the_principal_point():
    window = INTRINSICS.cropped(40, 30, 200, 100)
    assert window == Intrinsics(200, 100, 530, 540, 295, 200)
    np.testing.assert_allclose(window.to_pixels([0.1, 0.1]), INTRINSICS.to_pixels([0.1, 0.1]) - [40, 30])


def test_a_binned_pixel_looks_where_the_mean_of_its_block_looked():
    binned = Intrinsics(641, 482, 530, 540, 335, 230).binned(4)
    assert (binned.width, binned.height) == (160, 120)
    block = np.stack(np.meshgrid(np.arange(40, 44), np.arange(80, 84)), axis=-1).reshape(-1, 2)
    np.testing.assert_allclose(binned.from_pixels([10, 20]), INTRINSICS.from_pixels(block).mean(axis=0), atol=1e-15)


def test_the_image_reaches_half_a_pixel_beyond_the_outer_centres():
    inside = INTRINSICS.contains([[-0.5, -0.5], [639.5, 479.5], [-0.51, 0], [0, 479.6], [np.nan, 0]])
    assert inside.tolist() == [True, True, False, False, False]


def test_the_border_runs_clockwise_around_the_whole_image():
    border = INTRINSICS.border(4)
    assert border.shape == (16, 2)
    np.testing.assert_array_equal(border[::4], [[-0.5, -0.5], [639.5, -0.5], [639.5, 479.5], [-0.5, 479.5]])
    x, y = border.T
    area = (x * np.roll(y, -1) - y * np.roll(x, -1)).sum() / 2
    assert area == pytest.approx(640 * 480)  # positive: clockwise, with y downwards


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ((0, 480, 1, 1, 0, 0), "width must be a whole number of pixels, at least 1, got 0"),
        ((640, 4.5, 1, 1, 0, 0), "height must be a whole number of pixels, at least 1, got 4.5"),
        ((np.inf, 480, 1, 1, 0, 0), "width must be a whole number of pixels, at least 1, got inf"),
        ((640, np.nan, 1, 1, 0, 0), "height must be a whole number of pixels, at least 1, got nan"),
        ((640, 480, 0, 1, 0, 0), "fx must be a positive focal length in pixels, got 0"),
        ((640, 480, 1, np.nan, 0, 0), "fy must be a positive focal length in pixels, got nan"),
        ((640, 480, 1, 1, np.inf, 0), "cx must be a finite number of pixels, got inf"),
    ],
)
def test_impossible_intrinsics_are_refused_by_name(arguments, message):
    with pytest.raises(ValueError, match=message):
        Intrinsics(*arguments)


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (lambda: Intrinsics.from_fov(640, 480, 180), "hfov_deg must lie between 0 and 180 degrees, got 180"),
        (lambda: Intrinsics.from_sensor(640, 480, 8, 0), "pitch_um must be a positive distance in micrometres, got 0"),
        (lambda: Intrinsics.from_matrix(np.eye(4), 640, 480), r"K must have shape \(3, 3\), got \(4, 4\)"),
        (lambda: Intrinsics.from_matrix(INTRINSICS.K.T, 640, 480), "K must be upper triangular"),
        (lambda: INTRINSICS.binned(0), "factor must be a whole number, at least 1, got 0"),
        (lambda: INTRINSICS.to_pixels([1, 2, 3]), r"xy must have shape \(\.\.\., 2\), got \(3,\)"),
    ],
)
def test_what_makes_no_sense_is_refused(make, message):
    with pytest.raises(ValueError, match=message):
        make()


def test_a_camera_matrix_goes_in_and_comes_out():
    np.testing.assert_array_equal(Intrinsics.from_matrix(INTRINSICS.K, 640, 480).K, INTRINSICS.K)


# Frusta and poses


def test_the_frustum_of_a_pinhole_has_straight_edges_through_the_image_s_corners():
    camera = Camera(INTRINSICS, world_from_cam=POSE)
    near, far = camera.frustum(0.5, 2, samples=4)
    np.testing.assert_allclose(np.linalg.norm(far - camera.centre, axis=-1), 2)
    np.testing.assert_allclose(camera.project(near), INTRINSICS.border(4), atol=1e-9)
    np.testing.assert_allclose(camera.project(far), INTRINSICS.border(4), atol=1e-9)


def test_the_frustum_of_a_barrel_lens_bends_outwards():
    """Its corners look further aside than a pinhole's of the same K, and the rim still lands on the image's border."""
    camera = Camera(INTRINSICS, BrownConrady(-0.2))
    _, far = camera.frustum(1, 2)
    _, straight = Camera(INTRINSICS).frustum(1, 2)
    assert (far[::16, 2] < straight[::16, 2]).all()
    np.testing.assert_allclose(camera.project(far), INTRINSICS.border(16), atol=1e-9)


def test_a_camera_looks_at_its_target_with_y_downwards():
    eye, target = np.array([2.0, -1.0, -3.0]), np.array([0.0, 0.5, 1.0])
    camera = Camera(INTRINSICS, world_from_cam=look_at(eye, target))
    np.testing.assert_allclose(camera.centre, eye)
    np.testing.assert_allclose(camera.project(target), [335, 230], atol=1e-9)
    below = camera.project(target + np.array([0, 0.1, 0]))
    assert below[0] == pytest.approx(335)
    assert below[1] > 230
    R = camera.world_from_cam.rotation.as_matrix()
    np.testing.assert_allclose(R.T @ R, np.eye(3), atol=1e-15)
    assert np.linalg.det(R) == pytest.approx(1)


def test_looking_along_z_is_the_identity():
    np.testing.assert_allclose(look_at([0, 0, 0], [0, 0, 5]).as_matrix(), np.eye(4), atol=1e-15)


@pytest.mark.parametrize(
    ("eye", "target", "down"),
    [
        ([1, 2, 3], [1, 2, 3], [0, 1, 0]),
        ([0, 0, 0], [0, 1, 0], [0, 1, 0]),
        ([0, 0, 0], [0.1, 0.7, 0.3], [-0.3, -2.1, -0.9]),  # parallel but for rounding
        ([0, 0, 0], [0, 0, 1], [0, 0, 0]),
        ([0, 0, np.nan], [0, 0, 1], [0, 1, 0]),
    ],
)
def test_a_direction_that_is_none_is_refused(eye, target, down):
    with pytest.raises(ValueError, match="cannot look from"):
        look_at(eye, target, down)


def test_looking_works_at_any_scale():
    pose = look_at([0, 0, 0], [1e-12, 0, 1e-12], down=[0, 1e-12, 0])
    np.testing.assert_allclose(rotate(pose.rotation, [0, 0, 1]), [np.sqrt(0.5), 0, np.sqrt(0.5)])


def test_transforms_take_points_of_any_shape_as_scipy_takes_rows():
    np.testing.assert_allclose(transform(POSE, POINTS).reshape(-1, 3), POSE.apply(POINTS.reshape(-1, 3)), atol=1e-15)
    assert transform(POSE, np.zeros((0, 3))).shape == (0, 3)
    assert transform(POSE, [1, 2, 3]).shape == (3,)


def test_a_rig_keeps_its_cameras_apart():
    """For a left and a right camera, right_from_left has t.x < 0."""
    left = Camera(INTRINSICS)
    right = left.at(RigidTransform.from_components([0.1, 0, 0], Rotation.from_rotvec([0, 0.02 * pi, 0])))
    rig = Rig({"left": left, "right": right})
    right_from_left = rig.a_from_b("right", "left")
    assert right_from_left.translation[0] < 0
    assert np.linalg.norm(right_from_left.translation) == pytest.approx(0.1)
    np.testing.assert_allclose(
        INTRINSICS.to_pixels(right.lens.project(transform(right_from_left, POINTS))), right.project(POINTS), atol=1e-9
    )
    assert list(rig) == [left, right]
