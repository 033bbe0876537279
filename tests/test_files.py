"""What a calibration file says is what its camera does: OpenCV, given the same file, projects to the same pixels."""

import json
import os
from pathlib import Path

import cv2
import numpy as np
import pytest
import yaml

import camviz_clinic
from camviz.cameras import transform
from camviz.lenses import BrownConrady, KannalaBrandt, UnifiedSphere

DATA = Path(__file__).parent / "data"
POINTS = np.random.default_rng(7).uniform([-0.3, -0.25, 0.9], [0.3, 0.25, 3.0], size=(50, 3))


def stored(path, *keys):
    """The matrices of a file as OpenCV's own reader gives them."""
    storage = cv2.FileStorage(str(path), cv2.FILE_STORAGE_READ)
    return [storage.getNode(key).mat() for key in keys]


def opencv_pixels(points, K, D, R=((1, 0, 0), (0, 1, 0), (0, 0, 1)), T=(0, 0, 0)):
    return cv2.projectPoints(points, cv2.Rodrigues(np.array(R, float))[0], np.array(T, float), K, D)[0].reshape(-1, 2)


def sample(name):
    folder = os.environ.get("CAMVIZ_SAMPLES")
    if not folder:
        pytest.skip("CAMVIZ_SAMPLES names no folder of sample data")
    return Path(folder) / "opencv-samples" / name


def write(path, **values):
    storage = cv2.FileStorage(str(path), cv2.FILE_STORAGE_WRITE)
    for key, value in values.items():
        storage.write(key, value)
    storage.release()
    return path


def test_one_opencv_camera_projects_as_opencv_does():
    camera = camviz_clinic.load(DATA / "opencv_mono.json").cameras["camera"]
    K, D = stored(DATA / "opencv_mono.json", "camera_matrix", "distortion_coefficients")
    assert (camera.intrinsics.width, camera.intrinsics.height) == (1280, 960)
    np.testing.assert_allclose(camera.project(POINTS), opencv_pixels(POINTS, K, D), rtol=0, atol=1e-9)


def test_both_cameras_of_an_opencv_pair_project_as_opencv_does():
    """X_right = R X_left + T, and the world is the left camera's frame."""
    path = DATA / "opencv_stereo.xml"
    cameras = camviz_clinic.load(path).cameras
    K1, D1, K2, D2, R, T = stored(path, "cameraMatrix1", "distCoeffs1", "cameraMatrix2", "distCoeffs2", "R", "T")
    np.testing.assert_allclose(cameras["left"].project(POINTS), opencv_pixels(POINTS, K1, D1), rtol=0, atol=1e-9)
    right = opencv_pixels(POINTS, K2, D2, R, T)
    np.testing.assert_allclose(cameras["right"].project(POINTS), right, rtol=0, atol=1e-9)


def test_the_right_camera_of_a_pair_stands_to_the_right():
    calibration = camviz_clinic.load(DATA / "opencv_stereo.xml")
    assert calibration.cameras["right"].centre[0] > 0.1
    assert calibration.rig.a_from_b("right", "left").translation[0] == pytest.approx(-0.12)


def test_opencvs_fisheye_is_kannala_brandt():
    """(1, 2, 5) lands on (576.882637, 652.696340), a published value of this lens."""
    camera = camviz_clinic.load(DATA / "opencv_fisheye.yml").cameras["camera"]
    assert isinstance(camera.lens, KannalaBrandt)
    np.testing.assert_allclose(camera.project([1, 2, 5]), [576.882637, 652.696340], atol=1e-6)


def test_opencvs_omnidir_is_the_unified_sphere():
    camera = camviz_clinic.load(DATA / "opencv_omnidir.yml").cameras["camera"]
    K, D = stored(DATA / "opencv_omnidir.yml", "camera_matrix", "distortion_coefficients")
    assert isinstance(camera.lens, UnifiedSphere)
    pixels = cv2.omnidir.projectPoints(POINTS[None], np.zeros(3), np.zeros(3), K, 0.85, D)[0].reshape(-1, 2)
    np.testing.assert_allclose(camera.project(POINTS), pixels, rtol=0, atol=1e-9)


@pytest.mark.parametrize("suffix", ["yml", "xml", "json"])
@pytest.mark.parametrize("count", [4, 5, 8, 12, 14])
def test_whatever_opencv_writes_is_read_back_to_the_last_digit(tmp_path, suffix, count):
    K = np.array([[1000 / 3, 0, 321.1], [0, 1000 / 7, 239.9], [0, 0, 1]])
    D = np.random.default_rng(count).normal(size=(1, count)) * 1e-6
    path = write(tmp_path / f"camera.{suffix}", image_width=640, image_height=480, camera_matrix=K, dist_coeffs=D)
    camera = camviz_clinic.load(path).cameras["camera"]
    np.testing.assert_array_equal(camera.intrinsics.K, K)
    assert camera.lens == BrownConrady.from_coefficients(D.ravel())


@pytest.mark.parametrize("suffix", ["yml", "xml", "json"])
def test_detections_and_board_poses_keep_their_shape(tmp_path, suffix):
    """Where OpenCV finds board poses by solvePnP, its board points land on the detections."""
    given = camviz_clinic.load(DATA / "opencv_mono.json")
    K, D, extrinsics = stored(
        DATA / "opencv_mono.json", "camera_matrix", "distortion_coefficients", "extrinsic_parameters"
    )
    board = np.array([[0, 0, 0], [0.025, 0, 0], [0.05, 0.025, 0]])
    pixels = [cv2.projectPoints(board, view[:3], view[3:], K, D)[0].astype(np.float32) for view in extrinsics]
    points = np.stack(pixels).reshape(2, 3, 1, 2)[:, :, 0]
    path = write(
        tmp_path / f"views.{suffix}",
        image_width=1280,
        image_height=960,
        camera_matrix=K,
        distortion_coefficients=D,
        extrinsic_parameters=extrinsics,
        image_points=np.ascontiguousarray(points),
    )
    calibration = camviz_clinic.load(path)
    camera, poses = calibration.cameras["camera"], calibration.cam_from_board["camera"]
    for view, detected in enumerate(calibration.detections["camera"]):
        np.testing.assert_allclose(camera.project(transform(poses[view], board)), detected, atol=1e-3)
    assert len(given.cam_from_board["camera"]) == len(given.per_view_errors["camera"]) == 2
    assert given.detections["camera"].shape == (2, 3, 2)


@pytest.mark.parametrize(
    ("matrix", "distortion"),
    [
        ("camera_matrix", "distortion_coefficients"),
        ("Camera_Matrix", "Distortion_Coefficients"),
        ("cameraMatrix", "distCoeffs"),
        ("K", "D"),
        ("mtx", "dist"),
    ],
)
def test_the_usual_spellings_name_the_same_camera(tmp_path, matrix, distortion):
    values = {matrix: np.diag([500.0, 510, 1]), distortion: np.array([0.1, 0.2, 0, 0, 0])}
    camera = camviz_clinic.load(write(tmp_path / "camera.yml", image_Width=640, image_Height=480, **values)).cameras[
        "camera"
    ]
    assert (camera.intrinsics.fx, camera.intrinsics.fy, camera.lens.k2) == (500, 510, 0.2)


@pytest.mark.parametrize(("left", "right"), [("1", "2"), ("0", "1"), ("_left", "_right"), ("L", "R"), ("_1", "_2")])
def test_left_is_the_first_of_the_usual_pairs(tmp_path, left, right):
    values = {f"K{left}": np.diag([500.0, 500, 1]), f"K{right}": np.diag([600.0, 600, 1])}
    values |= {f"D{side}": np.zeros(5) for side in (left, right)}
    cameras = camviz_clinic.load(write(tmp_path / "pair.yml", **values), size=(640, 480)).cameras
    assert (cameras["left"].intrinsics.fx, cameras["right"].intrinsics.fx) == (500, 600)


def test_a_pair_without_a_pose_says_so():
    calibration = camviz_clinic.load(sample("intrinsics.yml"), size=(640, 480))
    assert "no R and T" in calibration.notes[0]


def test_four_coefficients_say_how_they_were_read(tmp_path):
    values = {"K": np.diag([500.0, 500, 1]), "D": np.zeros(4)}
    calibration = camviz_clinic.load(write(tmp_path / "four.yml", **values), size=(640, 480))
    assert any("cv2.fisheye" in note for note in calibration.notes)


def test_the_published_mono_calibration_is_all_there():
    calibration = camviz_clinic.load(sample("left_intrinsics.yml"))
    assert (calibration.board.columns, calibration.board.rows) == (9, 6)
    assert calibration.board.square_size == pytest.approx(0.025)
    errors = calibration.per_view_errors["camera"]
    assert len(calibration.cam_from_board["camera"]) == len(errors) == 13
    assert errors.argmax() == 1
    assert errors[1] == pytest.approx(1.18204820)


def test_the_published_pair_holds_the_published_coefficients():
    left, right = camviz_clinic.load(sample("intrinsics.yml"), size=(640, 480)).rig
    assert (left.lens.k1, right.lens.k1) == pytest.approx((0.29589439552724328, -0.16916358306948096), abs=0)


def test_a_size_in_the_file_is_not_overruled():
    with pytest.raises(camviz_clinic.files.CalibrationError, match="1280×960"):
        camviz_clinic.load(DATA / "opencv_mono.json", size=(640, 480))


def test_a_ros_file_projects_as_opencv_does():
    """plumb_bob is OpenCV's model with five coefficients (sensor_msgs/CameraInfo)."""
    tree = yaml.safe_load((DATA / "ros_file.yaml").read_text())
    K = np.reshape(tree["camera_matrix"]["data"], (3, 3)).astype(float)
    D = np.array(tree["distortion_coefficients"]["data"], dtype=float)
    camera = camviz_clinic.load(DATA / "ros_file.yaml").cameras["narrow_stereo/right"]
    np.testing.assert_allclose(camera.project(POINTS), opencv_pixels(POINTS, K, D), rtol=0, atol=1e-9)


def test_a_ros_projection_matrix_tells_the_baseline():
    """P[0, 3] = -fx B: 26.507895 / 295.53402 = 0.0897 m."""
    (note,) = camviz_clinic.load(DATA / "ros_file.yaml").notes
    assert "pair, 0.08969 m to the right" in note


def test_a_ros_2_message_projects_as_opencv_does():
    """The message has k and d in small letters and ends with the --- that `ros2 topic echo` prints."""
    camera = camviz_clinic.load(DATA / "ros2_message.yaml").cameras["camera"]
    K = np.array([[610.5, 0, 641.25], [0, 609.75, 362.5], [0, 0, 1]])
    D = np.array([0.31, -0.52, 0.001, -2e-4, 0.11, 0.62, -0.44, 0.02])
    np.testing.assert_allclose(camera.project(POINTS), opencv_pixels(POINTS, K, D), rtol=0, atol=1e-9)


def test_ros_equidistant_is_kannala_brandt():
    camera = camviz_clinic.load(DATA / "ros_equidistant.yaml").cameras["camera"]
    np.testing.assert_allclose(camera.project([1, 2, 5]), [576.882637, 652.696340], atol=1e-6)


def test_a_kalibr_chain_places_each_camera_beside_the_one_before():
    """cam_n from world is the product of the T_cn_cnm1 up to n."""
    path = DATA / "kalibr_chain.yaml"
    tree, rig = yaml.safe_load(path.read_text()), camviz_clinic.load(path).rig
    first, second = (np.array(tree[name]["T_cn_cnm1"]) for name in ("cam1", "cam2"))
    np.testing.assert_allclose(rig["cam0"].cam_from_world.as_matrix(), np.eye(4), atol=1e-12)
    np.testing.assert_allclose(rig["cam1"].cam_from_world.as_matrix(), first, atol=1e-12)
    np.testing.assert_allclose(rig["cam2"].cam_from_world.as_matrix(), second @ first, atol=1e-12)


def test_kalibr_radtan_projects_as_opencv_does():
    camera = camviz_clinic.load(DATA / "kalibr_chain.yaml").cameras["cam0"]
    K = np.array([[458.654, 0, 367.215], [0, 457.296, 248.375], [0, 0, 1]])
    D = np.array([-0.28340811, 0.07395907, 0.00019359, 1.76187114e-05])
    np.testing.assert_allclose(camera.project(POINTS), opencv_pixels(POINTS, K, D), rtol=0, atol=1e-9)


def test_kalibr_equidistant_projects_as_opencvs_fisheye_does():
    camera = camviz_clinic.load(DATA / "kalibr_chain.yaml").cameras["cam1"]
    points = transform(camera.world_from_cam, POINTS)
    K = np.array([[460.5, 0, 375.0], [0, 459.25, 241.5], [0, 0, 1]])
    D = np.array([-0.0128, 0.0047, -0.0031, 0.0006])
    pixels = cv2.fisheye.projectPoints(POINTS[None], np.zeros(3), np.zeros(3), K, D)[0].reshape(-1, 2)
    np.testing.assert_allclose(camera.project(points), pixels, rtol=0, atol=1e-9)


def test_kalibr_omni_projects_as_opencvs_omnidir_does():
    camera = camviz_clinic.load(DATA / "kalibr_wide.yaml").cameras["cam0"]
    K = np.array([[515.38, 0, 254.96], [0, 515.37, 256.88], [0, 0, 1]])
    D = np.array([-0.02, 0.004, 0.0003, -0.0001])
    pixels = cv2.omnidir.projectPoints(POINTS[None], np.zeros(3), np.zeros(3), K, 1.6962, D)[0].reshape(-1, 2)
    np.testing.assert_allclose(camera.project(POINTS), pixels, rtol=0, atol=1e-9)


def test_kalibr_eucm_reads_alpha_and_beta_before_the_focal_lengths():
    """With beta = 1 it is the unified model, for which (1, 2, 5) → (291.022703, 329.003576) is published."""
    camera = camviz_clinic.load(DATA / "kalibr_wide.yaml").cameras["cam1"]
    np.testing.assert_allclose(camera.project(np.add(camera.centre, [1, 2, 5])), [291.022703, 329.003576], atol=1e-6)


def test_kalibr_ds_reads_xi_and_alpha_before_the_focal_lengths():
    """Double sphere after Usenko et al. 2018, eq. 40-42, at one point by hand."""
    camera = camviz_clinic.load(DATA / "kalibr_wide.yaml").cameras["cam2"]
    x, y, z, xi, alpha = 1.0, 2.0, 5.0, -0.2, 0.55
    d1 = np.sqrt(x * x + y * y + z * z)
    d2 = np.sqrt(x * x + y * y + (xi * d1 + z) ** 2)
    scale = 1 / (alpha * d2 + (1 - alpha) * (xi * d1 + z))
    expected = [210.5 * x * scale + 255.5, 210.25 * y * scale + 256.5]
    np.testing.assert_allclose(camera.project(np.add(camera.centre, [x, y, z])), expected, rtol=0, atol=1e-9)


def test_kalibr_fov_is_devernays_lens():
    """r_d = atan(2 r tan(w/2)) / w (Devernay & Faugeras 2001, eq. 13)."""
    camera = camviz_clinic.load(DATA / "kalibr_wide.yaml").cameras["cam3"]
    r = np.arctan(2 * 0.5 * np.tan(0.92 / 2)) / 0.92
    pixel = camera.project(np.add(camera.centre, [0.5, 0, 1]))
    np.testing.assert_allclose(pixel, [300 * r + 255.5, 256.5], rtol=0, atol=1e-9)


def test_cameras_tied_by_their_imu_stand_apart():
    """T_imu_cam holds the camera's place in the IMU's frame, and cam0 is at the IMU here."""
    calibration = camviz_clinic.load(DATA / "kalibr_wide.yaml")
    np.testing.assert_allclose(calibration.cameras["cam1"].centre, [0.1, 0, 0], atol=1e-12)
    np.testing.assert_allclose(calibration.cameras["cam2"].centre, [0.2, 0, 0], atol=1e-12)
    assert "cam3" in calibration.notes[0]


def test_openvins_writes_the_inverse_of_kalibrs_imu_transform():
    """(R, p) = T_imu_cam means that the camera's centre is p in the IMU's frame."""
    calibration = camviz_clinic.load(DATA / "openvins_chain.yaml")
    imu_from_world = calibration.world_from_imu.inv()
    np.testing.assert_allclose(transform(imu_from_world, [0, 0, 0]), [0.05, 0.02, -0.01], atol=1e-12)


def test_what_is_loaded_cannot_be_overwritten():
    with pytest.raises(ValueError, match="read-only"):
        camviz_clinic.load(DATA / "opencv_mono.json").detections["camera"][0] = 0


@pytest.mark.parametrize("focal_length", [1e-300, 1e-4])
def test_a_focal_length_that_no_camera_has_is_refused(tmp_path, focal_length):
    file = tmp_path / "camera.json"
    fields = {"fl_x": focal_length, "fl_y": 500.0, "cx": 320, "cy": 240, "w": 640, "h": 480, "frames": []}
    file.write_text(json.dumps(fields))
    with pytest.raises(camviz_clinic.files.CalibrationError, match=r"expected fx from 0.001 to 1e9 pixels"):
        camviz_clinic.load(file)
