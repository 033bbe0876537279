"""Files of the programs that engineers meet: each projects as the equations say that its program writes down.

The equations stand here once more, by themselves. A sample is in its program's own layout, with numbers made for it.
"""

import json
from pathlib import Path

import cv2
import numpy as np
import pytest
from scipy.spatial.transform import RigidTransform, Rotation

import camviz_clinic
from camviz.cameras import transform
from camviz_clinic.files import CalibrationError, formats
from camviz_clinic.files.models import same_camera

DATA = Path(__file__).parent / "data"
POINTS = np.random.default_rng(11).uniform([-0.6, -0.4, 1.0], [0.6, 0.4, 3.0], size=(100, 3))


def bent(x, y, k1=0.0, k2=0.0, p1=0.0, p2=0.0, k3=0.0, k4=0.0, k5=0.0, k6=0.0):
    """Brown and Conrady's distortion, rational where k4 k5 k6 are given, of points of the plane z = 1."""
    r2 = x * x + y * y
    radial = (1 + k1 * r2 + k2 * r2**2 + k3 * r2**3) / (1 + k4 * r2 + k5 * r2**2 + k6 * r2**3)
    dx = 2 * p1 * x * y + p2 * (r2 + 2 * x * x)
    dy = p1 * (r2 + 2 * y * y) + 2 * p2 * x * y
    return x * radial + dx, y * radial + dy


def pixels(fx, fy, cx, cy, x, y):
    return np.stack([fx * x + cx, fy * y + cy], axis=-1)


def radtan(points, fx, fy, cx, cy, *D):
    X, Y, Z = points.T
    return pixels(fx, fy, cx, cy, *bent(X / Z, Y / Z, *D))


def kannala_brandt(points, fx, fy, cx, cy, k1, k2, k3, k4):
    X, Y, Z = points.T
    R = np.sqrt(X * X + Y * Y)
    theta = np.arctan2(R, Z)
    r = theta + k1 * theta**3 + k2 * theta**5 + k3 * theta**7 + k4 * theta**9
    return pixels(fx, fy, cx, cy, r * X / R, r * Y / R)


def mei(points, xi, fx, fy, cx, cy, *D):
    """camodocal's CataCamera: onto the unit sphere, seen from xi behind its centre, then distorted."""
    X, Y, Z = (points / np.sqrt((points**2).sum(axis=1))[:, None]).T
    return pixels(fx, fy, cx, cy, *bent(X / (Z + xi), Y / (Z + xi), *D))


def fov(points, fx, fy, cx, cy, omega):
    X, Y, Z = points.T
    R = np.sqrt(X * X + Y * Y)
    r = np.arctan(2 * (R / Z) * np.tan(omega / 2)) / omega
    return pixels(fx, fy, cx, cy, r * X / R, r * Y / R)


def panorama(points, fx, fy, cx, cy):
    X, Y, Z = points.T
    return pixels(fx, fy, cx, cy, np.arctan2(X, Z), np.arctan2(Y, np.sqrt(X * X + Z * Z)))


def check(camera, expected):
    """The camera shows the points of its own frame within a thousand-millionth of a pixel."""
    np.testing.assert_allclose(camera.project(transform(camera.world_from_cam, POINTS)), expected, rtol=0, atol=1e-9)


def sample(name, folder):
    """The example of a format that is only read, as a file."""
    path = folder / "sample"
    path.write_bytes(formats()[name].example)
    return path


def camera_of(name, **options):
    (camera,) = camviz_clinic.load(DATA / name, **options).cameras.values()
    return camera


def test_camodocals_mei_is_the_unified_sphere():
    camera = camviz_clinic.load(DATA / "camodocal_mei.yaml").cameras["front"]
    check(camera, mei(POINTS, 1.6215, 730.5, 729.25, 318.75, 202.75, -0.25, 0.081, 1.25e-3, -6.5e-4))
    assert (camera.intrinsics.width, camera.intrinsics.height) == (640, 400)


def test_camodocals_k2_is_kannala_brandts_first():
    camera = camera_of("camodocal_kannala_brandt.yaml")
    check(camera, kannala_brandt(POINTS, 287.5, 286.25, 320.5, 238.75, -0.0125, 3.5e-3, -2.75e-3, 3e-4))


def test_kalibr2vins_puts_the_same_numbers_under_distortion_parameters(tmp_path):
    text = (DATA / "camodocal_kannala_brandt.yaml").read_text()
    lines = text.replace("projection_parameters:", "distortion_parameters:").replace(
        "   mu", "projection_parameters:\n   mu"
    )
    (tmp_path / "a.yaml").write_text(lines)
    (camera,) = camviz_clinic.load(tmp_path / "a.yaml").cameras.values()
    assert same_camera(camera, camera_of("camodocal_kannala_brandt.yaml"), 0)


def test_orbslam3s_pair_stands_by_the_transform_from_right_to_left():
    """x_left = T_c1_c2 x_right: the right camera's centre is the last column."""
    calibration = camviz_clinic.load(DATA / "orbslam3_fisheye.yaml")
    left, right = calibration.cameras["left"], calibration.cameras["right"]
    check(left, kannala_brandt(POINTS, 190.5, 190.25, 254.75, 256.5, 0.0035, 0.0007, -0.002, 0.0002))
    check(right, kannala_brandt(POINTS, 190.75, 190.5, 252.5, 254.25, 0.0034, 0.0018, -0.0027, 0.0003))
    np.testing.assert_allclose(right.centre, [0.101, 0.002, 0.001], rtol=0, atol=1e-12)
    assert right.world_from_cam.as_matrix()[1, 2] == pytest.approx(0.6)


def test_orbslams_camera_stands_at_the_last_column_from_the_imu():
    imu_from_world = camviz_clinic.load(DATA / "orbslam3_fisheye.yaml").world_from_imu.inv()
    np.testing.assert_allclose(transform(imu_from_world, [0, 0, 0]), [0.045, -0.07, -0.045], rtol=0, atol=1e-12)


def test_the_older_orbslam3_calls_the_left_camera_camera_and_writes_three_rows(tmp_path):
    text = (DATA / "orbslam3_fisheye.yaml").read_text().replace("Camera1.", "Camera.")
    text = (
        text.replace("Stereo.T_c1_c2", "Tlr")
        .replace("0.001,\n         0, 0, 0, 1.0]", "0.001]")
        .replace("IMU.T_b_c1", "Tbc")
    )
    (tmp_path / "old.yaml").write_text(
        text.replace("  rows: 4\n  cols: 4\n  dt: f\n  data: [1.0", "  rows: 3\n  cols: 4\n  dt: f\n  data: [1.0")
    )
    old, new = camviz_clinic.load(tmp_path / "old.yaml"), camviz_clinic.load(DATA / "orbslam3_fisheye.yaml")
    assert all(same_camera(old.cameras[name], new.cameras[name]) for name in ("left", "right"))


def test_orbslam2s_pair_is_read_as_it_was_before_rectification():
    """cv2.stereoRectify gave R and P: R_r x_r = R_l x_l + (P_r[0, 3] / fx, 0, 0), here 0.12 to the left."""
    left, right = camviz_clinic.load(DATA / "orbslam2_pair.yaml").rig
    check(left, radtan(POINTS, 420.5, 419.75, 321.25, 241.5, -0.275, 0.0725, 0.0002, 1.75e-05))
    check(right, radtan(POINTS, 421.5, 420.25, 330.0, 245.25, -0.28, 0.0745, -0.0001, -3.5e-05))
    left_turn = np.array([[0.6, 0, 0.8], [0, 1, 0], [-0.8, 0, 0.6]])
    right_turn = np.array([[1, 0, 0], [0, 0.8, 0.6], [0, -0.6, 0.8]])
    expected = (right_turn.T @ (POINTS @ left_turn.T + [-0.12, 0, 0]).T).T
    np.testing.assert_allclose(transform(right.cam_from_world, POINTS), expected, rtol=0, atol=1e-12)


def stereo_settings(folder, size, K, D, right_from_left, header="%YAML:1.0\n\n"):
    """ORB-SLAM2's settings for EuRoC, with other numbers: cv2.stereoRectify's R and P beside K and D."""
    R, t = right_from_left.rotation.as_matrix(), right_from_left.translation[:, None]
    *turned, left_P, right_P = cv2.stereoRectify(K[0], D[0], K[1], D[1], size, R, t, alpha=0)[:4]
    f, cx, cy = left_P[[0, 0, 1], [0, 2, 2]].tolist()
    lines = ['Camera.type: "PinHole"', f"Camera.fx: {f}", f"Camera.fy: {f}", f"Camera.cx: {cx}", f"Camera.cy: {cy}"]
    lines += ["Camera.k1: 0.0", "Camera.bFishEye: 0", f"Camera.width: {size[0]}", f"Camera.height: {size[1]}"]
    lines += [f"Camera.bf: {float(-right_P[0, 3])}", "Camera.RGB: 1", "ThDepth: 35"]
    for side, *matrices in zip(("LEFT", "RIGHT"), K, D, turned, (left_P, right_P), strict=True):
        lines += [f"{side}.height: {size[1]}", f"{side}.width: {size[0]}"]
        for name, matrix in zip("KDRP", map(np.atleast_2d, matrices), strict=True):
            rows, cols = matrix.shape
            lines += [f"{side}.{name}: !!opencv-matrix", f"   rows: {rows}", f"   cols: {cols}", "   dt: d"]
            lines += [f"   data:{matrix.ravel().tolist()}"]
    text = header + "\n".join([*lines, "Viewer.PointSize:2", ""])
    return written(folder / "EuRoC.yaml", text), turned, (left_P, right_P)


@pytest.mark.parametrize("header", ["%YAML:1.0\n\n", ""])
def test_orbslam2s_euroc_settings_show_what_opencvs_maps_take_their_rectified_pictures_from(tmp_path, header):
    """initUndistortRectifyMap: a rectified pixel looks along R⁻¹ P⁻¹ (u, v, 1) of the picture that was taken.

    A point at the depth Z is seen by the right camera -P_r[0, 3] / Z pixels further to the left.
    """
    size, K = (752, 480), np.array([np.diag([458.5, 457.25, 1]), np.diag([457.5, 456.0, 1])])
    K[:, :2, 2] = (367.25, 248.5), (380.0, 255.25)
    D = np.array([[-0.2834, 0.07396, 1.94e-4, 1.76e-5, 0], [-0.28368, 0.07451, -1.05e-4, -3.56e-5, 0]])
    stands = RigidTransform.from_components([-0.11, 0.0003, -0.0008], Rotation.from_rotvec([0.0143, -0.0022, -0.0023]))
    path, turned, P = stereo_settings(tmp_path, size, K, D, stands, header)
    rig, disparity = list(camviz_clinic.load(path).rig), 40
    uv = np.array([(u, v) for u in (150, 376, 640) for v in (60, 240, 400)])
    ahead = np.column_stack([(uv - P[0][:2, 2]) / P[0][0, 0], np.ones(len(uv))])
    points = -P[1][0, 3] / disparity * ahead @ turned[0]
    for camera, *side, shift in zip(rig, K, D, turned, P, (0, disparity), strict=True):
        maps = cv2.initUndistortRectifyMap(*side, size, cv2.CV_32FC1)
        taken = np.array([[each[v, u - shift] for each in maps] for u, v in uv])
        np.testing.assert_allclose(camera.project(points), taken, rtol=0, atol=1e-3)
    np.testing.assert_allclose(rig[1].cam_from_world.as_matrix(), stands.as_matrix(), rtol=0, atol=1e-12)


def test_orbslams_baseline_times_fx_is_a_note(tmp_path):
    text = "Camera.fx: 400.0\nCamera.fy: 400.0\nCamera.cx: 320.5\nCamera.cy: 240.25\nCamera.bf: 48.0\n"
    (tmp_path / "a.yaml").write_text(text + "Camera.width: 640\nCamera.height: 480\n")
    (note,) = camviz_clinic.load(tmp_path / "a.yaml").notes
    assert "0.12 m to the right" in note


@pytest.mark.parametrize(
    "header", ["", "%YAML:1.0\n", "%YAML 1.0\n---\n", "# first\n\n%YAML:1.0\n---\n", "%YAML: 1.0 \r\n"]
)
def test_opencvs_yaml_is_read_whatever_its_header(tmp_path, header):
    (tmp_path / "a.yaml").write_text(
        header + "Camera.fx: 400.0\nCamera.fy: 410.0\nCamera.cx: 320.5\nCamera.cy: 240.25\n"
    )
    (camera,) = camviz_clinic.load(tmp_path / "a.yaml", size=(640, 480)).cameras.values()
    assert camera.intrinsics.fy == 410


def test_an_orbslam_type_that_is_not_known_is_named(tmp_path):
    (tmp_path / "a.yaml").write_text("Camera.type: Cylinder\nCamera.fx: 400.0\n")
    with pytest.raises(CalibrationError, match="PinHole or KannalaBrandt8 or Rectified, got 'Cylinder'"):
        camviz_clinic.load(tmp_path / "a.yaml", size=(640, 480))


def test_anipose_has_opencvs_order_and_poses_from_the_world():
    """x_cam = R x_world + t."""
    calibration = camviz_clinic.load(DATA / "caliscope_camera_array.toml")
    assert list(calibration.cameras) == ["cameras.0", "cameras.1"]
    camera = calibration.cameras["cameras.0"]
    world = (POINTS - [0.17, -0.03, 1.2]) @ np.array([[0, 0.6, -0.8], [1, 0, 0], [0, -0.8, -0.6]])
    expected = radtan(POINTS, 903.5, 907.75, 618.25, 394.125, -0.332, 0.0464, -0.0043, 0.0041, 0.0666)
    np.testing.assert_allclose(camera.project(world), expected, rtol=0, atol=1e-9)


def test_caliscopes_null_is_a_camera_whose_place_is_not_known(tmp_path):
    lines = (DATA / "caliscope_camera_array.toml").read_text().splitlines()
    lines = ['rotation = "null"' if line.startswith("rotation =") else line for line in lines]
    (tmp_path / "a.toml").write_text("\n".join(lines))
    calibration = camviz_clinic.load(tmp_path / "a.toml")
    assert "does not say where cameras.0, cameras.1 stands" in calibration.notes[1]


def test_aniposes_fisheye_is_kannala_brandt_and_its_rotation_a_vector(tmp_path):
    text = "[cam_0]\nname = 'A'\nsize = [640, 480]\nmatrix = [[300.0, 0, 320], [0, 301.0, 240], [0, 0, 1]]\n"
    text += "distortions = [0.01, -0.02, 0.003, -0.0004]\nrotation = [0.1, -0.2, 0.3]\ntranslation = [1.0, 2, 3]\n"
    (tmp_path / "a.toml").write_text(text + "fisheye = true\n[metadata]\nadjusted = false\n")
    camera = camviz_clinic.load(tmp_path / "a.toml").cameras["A"]
    check(camera, kannala_brandt(POINTS, 300, 301, 320, 240, 0.01, -0.02, 0.003, -0.0004))
    world = Rotation.from_rotvec([0.1, -0.2, 0.3]).inv().apply(POINTS - [1, 2, 3])
    np.testing.assert_allclose(transform(camera.cam_from_world, world), POINTS, rtol=0, atol=1e-12)


@pytest.mark.parametrize("line", ["a" + ".a" * 100000 + " = 1", "x = " + "[" * 5000, "x = " + "[" * 50 + "]" * 50])
def test_a_deep_toml_is_refused_soon(tmp_path, line):
    (tmp_path / "a.toml").write_text("matrix = [1]\n" + line)
    with pytest.raises(CalibrationError, match="nested more than 32 levels"):
        camviz_clinic.load(tmp_path / "a.toml")


def test_a_zed_is_read_as_zed_open_capture_rectifies_it(tmp_path):
    """cv2.stereoRectify turns both cameras alike by R = (RX, CV, RZ), T = (Baseline, TY, TZ) and by the pair read."""
    left, right = camviz_clinic.load(sample("zed", tmp_path)).rig
    check(left, radtan(POINTS, 534.25, 534.125, 639.5, 368.25, -0.059, 0.0358, -0.0003, -0.0001, -0.0145))
    check(right, radtan(POINTS, 533.5, 533.25, 631, 371.75, -0.064, 0.0436, -0.0004, -0.0006, -0.018))
    R, T = cv2.Rodrigues(np.array([0.0036, -0.003, -0.001]))[0], np.array([[120.0], [0.1], [-0.2]])
    K, D = [each.intrinsics.K for each in (left, right)], np.zeros((5, 1))
    theirs = cv2.stereoRectify(K[0], D, K[1], D, (1280, 720), R, T)
    pose = right.cam_from_world
    ours = cv2.stereoRectify(K[0], D, K[1], D, (1280, 720), pose.rotation.as_matrix(), pose.translation.reshape(3, 1))
    np.testing.assert_allclose(ours[0], theirs[0], rtol=0, atol=1e-12)
    np.testing.assert_allclose(ours[1], theirs[1], rtol=0, atol=1e-12)
    assert right.centre[0] == pytest.approx(0.12, abs=1e-5)


def test_a_zeds_size_chooses_among_its_resolutions(tmp_path):
    path = sample("zed", tmp_path)
    text = path.read_text()
    path.write_text(text + text.split("[STEREO]")[0].replace("_HD]", "_2K]").replace("fx=534.25", "fx=1068.5").rstrip())
    path.write_text(path.read_text().replace("[STEREO]", "[STEREO]\nRX_2K=0\nCV_2K=0\nRZ_2K=0"))
    assert camviz_clinic.load(path).cameras["left"].intrinsics.fx == 1068.5
    assert "1280×720 too" in camviz_clinic.load(path).notes[0]
    assert camviz_clinic.load(path, size=(1280, 720)).cameras["left"].intrinsics.fx == 534.25
    with pytest.raises(CalibrationError, match="expected one of 2208×1242, 1280×720, got 640×480"):
        camviz_clinic.load(path, size=(640, 480))


def written(path, text):
    path.write_text(text)
    return path


STELLA = """
Camera:
  name: "made"
  setup: "monocular"
  model: "{model}"
  fx: 441.75
  fy: 442.5
  cx: 480.25
  cy: 275.5
  k1: -3.0e-02
  k2: -3.25e-03
  {three}
  fps: 30.0
  cols: 960
  rows: 540
  color_order: "RGB"
"""


@pytest.mark.parametrize("dotted", [False, True])
def test_stellas_models_are_opencvs_and_its_fisheye(tmp_path, dotted):
    """Since its fork the keys are in a mapping; OpenVSLAM had them with dots."""
    made = {"perspective": ("p1: 0.001\n  p2: -0.002\n  k3: 0.0005", radtan, (0.001, -0.002, 0.0005))}
    made["fisheye"] = ("k3: -2.5e-03\n  k4: 6.0e-04", kannala_brandt, (-2.5e-3, 6e-4))
    for model, (three, equation, numbers) in made.items():
        text = STELLA.format(model=model, three=three)
        text = text.replace("Camera:\n", "").replace("\n  ", "\nCamera.") if dotted else text
        camera = camviz_clinic.load(written(tmp_path / "a.yaml", text)).cameras["made"]
        check(camera, equation(POINTS, 441.75, 442.5, 480.25, 275.5, -0.03, -3.25e-3, *numbers))


def test_stellas_panorama_goes_round_over_its_columns(tmp_path):
    """x = cols (1/2 + longitude/2π), y = rows (1/2 - latitude/π)."""
    text = (
        "Camera: {name: a, setup: monocular, model: equirectangular, fps: 30, cols: 1920, rows: 960, color_order: RGB}"
    )
    camera = camviz_clinic.load(written(tmp_path / "a.yaml", text)).cameras["a"]
    check(camera, panorama(POINTS, 1920 / (2 * np.pi), 960 / np.pi, 960, 480))


OKVIS = """%YAML:1.0
cameras:
     - {T_SC:
        [ 0.0, -1.0, 0.0, -0.0216,
          1.0, 0.0, 0.0, -0.0647,
          0.0, 0.0, 1.0, 0.0098,
           0.0, 0.0, 0.0, 1.0],
        image_dimension: [752, 480],
        distortion_coefficients: [-0.283, 0.074, 0.0002, 1.75e-05],
        distortion_type: radialtangential,
        focal_length: [458.5, 457.25],
        principal_point: [367.25, 248.5]}
     - {T_SC:
        [ 0.0, -1.0, 0.0, -0.0198,
          1.0, 0.0, 0.0, 0.0454,
          0.0, 0.0, 1.0, 0.0079,
           0.0, 0.0, 0.0, 1.0],
        image_dimension: [752, 480],
        distortion_coefficients: [-0.01, 0.02, -0.003, 0.0004],
        distortion_type: equidistant,
        focal_length: [457.5, 456.25],
        principal_point: [380.0, 255.25]}
camera_params:
    camera_rate: 20 # comments stand behind numbers
"""


def test_okviss_cameras_stand_by_their_places_on_the_imu(tmp_path):
    """T_SC turns by a quarter about z: what is +y on the IMU is +x in the first camera."""
    calibration = camviz_clinic.load(written(tmp_path / "a.yaml", OKVIS))
    first, second = calibration.cameras.values()
    check(first, radtan(POINTS, 458.5, 457.25, 367.25, 248.5, -0.283, 0.074, 0.0002, 1.75e-05))
    check(second, kannala_brandt(POINTS, 457.5, 456.25, 380, 255.25, -0.01, 0.02, -0.003, 0.0004))
    np.testing.assert_allclose(second.centre, [0.0454 + 0.0647, -(-0.0198 + 0.0216), 0.0079 - 0.0098], atol=1e-12)
    imu_from_world = calibration.world_from_imu.inv()
    np.testing.assert_allclose(transform(imu_from_world, [0, 0, 0]), [-0.0216, -0.0647, 0.0098], rtol=0, atol=1e-12)


def test_svos_cameras_stand_by_their_places_on_the_body(tmp_path):
    calibration = camviz_clinic.load(sample("svo", tmp_path))
    camera = calibration.cameras["cam0"]
    check(camera, radtan(POINTS, 458.5, 457.25, 320.5, 248.25, -0.28, 0.074, 0.0002, 1.75e-05))
    imu_from_world = calibration.world_from_imu.inv()
    np.testing.assert_allclose(transform(imu_from_world, [0, 0, 0]), [-0.02, -0.06, 0.01], rtol=0, atol=1e-12)


def test_vikits_camera_may_stand_alone(tmp_path):
    text = "type: pinhole\nimage_width: 640\nimage_height: 480\nintrinsics: [300, 301, 320, 240]\n"
    text += "distortion: {type: equidistant, parameters: [0.1, -0.02, 0.003, -0.0004]}\n"
    (camera,) = camviz_clinic.load(written(tmp_path / "a.yaml", text)).cameras.values()
    check(camera, kannala_brandt(POINTS, 300, 301, 320, 240, 0.1, -0.02, 0.003, -0.0004))


def test_rpg_svos_atan_is_in_fractions_of_the_image(tmp_path):
    """vikit's ATANCamera: fx = width cam_fx, cx = cam_cx width - 0.5; d0 is PTAM's angle."""
    text = "cam_model: ATAN\ncam_width: 752\ncam_height: 480\ncam_fx: 0.51\ncam_fy: 0.80\n"
    text += "cam_cx: 0.47\ncam_cy: 0.55\ncam_d0: 0.93"
    (camera,) = camviz_clinic.load(written(tmp_path / "a.yaml", text)).cameras.values()
    check(camera, fov(POINTS, 0.51 * 752, 0.80 * 480, 0.47 * 752 - 0.5, 0.55 * 480 - 0.5, 0.93))


VIKIT = "cam_width: 640\ncam_height: 480\ncam_fx: {}\ncam_fy: {}\ncam_cx: {}\ncam_cy: {}\n"


@pytest.mark.parametrize("known", range(5))
def test_vikits_pinhole_has_zeros_for_the_coefficients_that_are_not_there(tmp_path, known):
    """camera_loader.h: getParam(ns + "/cam_d0", 0.0). OpenCV's order: k1 k2 p1 p2. `scale` shrinks what it works on."""
    D = [-0.28, 0.074, 0.0002, 1.75e-05]
    text = "cam_model: Pinhole\nscale: 0.5\n" + VIKIT.format(458.5, 457.25, 320.5, 248.25)
    text += "".join(f"cam_d{index}: {value}\n" for index, value in enumerate(D[:known]))
    (camera,) = camviz_clinic.load(written(tmp_path / "a.yaml", text)).cameras.values()
    check(camera, radtan(POINTS, 458.5, 457.25, 320.5, 248.25, *D[:known]))


def test_vikits_equidistant_camera_has_opencvs_fisheye(tmp_path):
    """EquidistantCamera of FAST-LIVO2's vikit: θ (1 + k1 θ² + k2 θ⁴ + k3 θ⁶ + k4 θ⁸)."""
    text = "cam_model: EquidistantCamera\nk1: 0.1\nk2: -0.02\nk3: 0.003\nk4: -0.0004\n"
    text += VIKIT.format(300, 301, 320, 240)
    (camera,) = camviz_clinic.load(written(tmp_path / "a.yaml", text)).cameras.values()
    check(camera, kannala_brandt(POINTS, 300, 301, 320, 240, 0.1, -0.02, 0.003, -0.0004))


@pytest.mark.parametrize("words", ["cam_model: Pinhole\ncam_d1: 0.1", "cam_model: EquidistantCamera\nk1: 0\nk2: 0.1"])
def test_vikit_leaves_out_a_distortion_whose_first_coefficient_is_zero(tmp_path, words):
    """distortion_ = fabs(d0) > 0.0000001, of PinholeCamera and of EquidistantCamera."""
    text = words + "\n" + VIKIT.format(300, 301, 320, 240)
    (camera,) = camviz_clinic.load(written(tmp_path / "a.yaml", text)).cameras.values()
    check(camera, radtan(POINTS, 300, 301, 320, 240))


def test_vikits_atan_is_straight_where_its_angle_is_zero(tmp_path):
    """ATANCamera: distortion_ = s != 0."""
    text = "cam_model: ATAN\ncam_d0: 0.0 # 0.9320\n" + VIKIT.format(0.5, 0.8, 0.45, 0.51)
    (camera,) = camviz_clinic.load(written(tmp_path / "a.yaml", text)).cameras.values()
    check(camera, radtan(POINTS, 320, 384, 287.5, 244.3))


def test_vikits_atan_without_its_angle_is_refused(tmp_path):
    """camera_loader.h has no default for it."""
    with pytest.raises(CalibrationError, match="cam_d0: expected a number, the key is missing"):
        camviz_clinic.load(written(tmp_path / "a.yaml", "cam_model: ATAN\n" + VIKIT.format(0.5, 0.8, 0.45, 0.51)))


def test_a_vikit_file_that_names_ocamcalibs_is_refused_with_the_file_to_give(tmp_path):
    text = "cam_model: Ocam\ncam_calib_file: /home/me/calib_results.txt\n"
    with pytest.raises(CalibrationError, match=r"Ocam has .* OCamCalib's calib_results\.txt"):
        camviz_clinic.load(written(tmp_path / "a.yaml", text))


EXTRINSICS = """%YAML:1.0
---
names:
  - "01"
R_01: !!opencv-matrix
  rows: 3
  cols: 1
  dt: d
  data: [0.000, 0.644, 0.000]
Rot_01: !!opencv-matrix
  rows: 3
  cols: 3
  dt: d
  data: [0.8, 0.0, 0.6, 0.0, 1.0, 0.0, -0.6, 0.0, 0.8]
T_01: !!opencv-matrix
  rows: 3
  cols: 1
  dt: d
  data: [0.500, -1.000, 3.000]
"""


@pytest.mark.parametrize("asked", ["intri.yml", "extri.yml"])
def test_easymocaps_two_files_are_one_calibration(tmp_path, asked):
    (tmp_path / "intri.yml").write_bytes(formats()["easymocap"].example)
    (tmp_path / "extri.yml").write_text(EXTRINSICS)
    camera = camviz_clinic.load(tmp_path / asked).cameras["01"]
    check(camera, radtan(POINTS, 880.5, 881.25, 512.25, 510.75, -0.26, 0.08, 0.001, -0.002, 0.01))
    world = (POINTS - [0.5, -1, 3]) @ np.array([[0.8, 0, 0.6], [0, 1, 0], [-0.6, 0, 0.8]])
    np.testing.assert_allclose(transform(camera.cam_from_world, world), POINTS, rtol=0, atol=1e-12)


def test_easymocaps_extri_alone_is_refused_by_its_name(tmp_path):
    with pytest.raises(CalibrationError, match=r"intri\.yml: dist_01: expected"):
        camviz_clinic.load(written(tmp_path / "extri.yml", EXTRINSICS), size=(640, 480))


def opensfm(**camera):
    shot = {"rotation": [0.1, -0.2, 0.3], "translation": [1.0, 2.0, 3.0], "camera": "c"}
    made = {"cameras": {"c": {"width": 1200, "height": 800, **camera}}, "shots": {"a.jpg": shot}, "points": {}}
    return json.dumps([made])


OPENSFM = {
    "perspective": ({"focal": 0.85, "k1": -0.1, "k2": 0.02}, radtan, (1020, 1020, 599.5, 399.5, -0.1, 0.02)),
    "brown": (
        {"focal_x": 0.85, "focal_y": 0.86, "c_x": 0.01, "c_y": -0.02}
        | {"k1": -0.1, "k2": 0.02, "k3": 0.003, "p1": 0.001, "p2": -0.002},
        radtan,
        (1020, 1032, 611.5, 375.5, -0.1, 0.02, 0.001, -0.002, 0.003),
    ),
    "fisheye": ({"focal": 0.5, "k1": -0.03, "k2": 0.002}, kannala_brandt, (600, 600, 599.5, 399.5, -0.03, 0.002, 0, 0)),
    "spherical": ({}, panorama, (1200 / (2 * np.pi), 1200 / (2 * np.pi), 599.5, 399.5)),
}


@pytest.mark.parametrize("kind", OPENSFM)
def test_opensfms_lengths_are_shares_of_the_longer_side(tmp_path, kind):
    """pixel = share · max(w, h) + (w - 1)/2, of x_cam = R x_world + t."""
    held, equation, numbers = OPENSFM[kind]
    camera = camviz_clinic.load(written(tmp_path / "a.json", opensfm(projection_type=kind, **held))).cameras["a.jpg"]
    check(camera, equation(POINTS, *numbers))
    world = Rotation.from_rotvec([0.1, -0.2, 0.3]).inv().apply(POINTS - [1, 2, 3])
    np.testing.assert_allclose(transform(camera.cam_from_world, world), POINTS, rtol=0, atol=1e-12)


def test_a_lens_of_opensfms_that_is_not_here_is_named(tmp_path):
    path = written(tmp_path / "a.json", opensfm(projection_type="fisheye624", focal=0.5))
    with pytest.raises(CalibrationError, match=r"projection_type: expected perspective or brown.* got 'fisheye624'"):
        camviz_clinic.load(path)


def test_openmvgs_centre_is_where_the_camera_stands(tmp_path):
    """x_cam = R (x - C); disto_t2 has k1 k2 k3 before the two of the tangents."""
    camera = camviz_clinic.load(sample("openmvg", tmp_path)).cameras["a.jpg"]
    check(camera, radtan(POINTS, 500.5, 500.5, 321.25, 238.5, -0.1, 0.02, 0.001, -0.002, -0.003))
    R, C = np.array([[0.6, 0, 0.8], [0, 1, 0], [-0.8, 0, 0.6]]), np.array([0.5, -1, 2])
    world = POINTS @ R + C
    np.testing.assert_allclose(transform(camera.cam_from_world, world), POINTS, rtol=0, atol=1e-12)


def test_bal_looks_along_minus_z_with_y_up(tmp_path):
    """P = R X + t, p = -P / P_z, p' = f (1 + k1 |p|² + k2 |p|⁴) p; the image's y axis points up."""
    cameras = camviz_clinic.load(sample("bal", tmp_path), size=(640, 480)).cameras
    R, t, (f, k1, k2) = Rotation.from_rotvec([0.1, -0.2, 0.3]).as_matrix(), [0.5, -1.0, -2.0], (500.5, -0.01, 0.002)
    world = (POINTS * [1, 1, -1] - t) @ R
    P = world @ R.T + t
    p = -P[:, :2] / P[:, 2:]
    r2 = (p**2).sum(axis=1, keepdims=True)
    theirs = f * (1 + k1 * r2 + k2 * r2**2) * p
    expected = [319.5, 239.5] + theirs * [1, -1]
    np.testing.assert_allclose(cameras["camera0"].project(world), expected, rtol=0, atol=1e-9)


def test_a_bal_problem_may_have_empty_lines_between_its_parts(tmp_path):
    """GTSAM's problems have them after the counts, the observations and each camera."""
    path = sample("bal", tmp_path)
    before = camviz_clinic.load(path, size=(640, 480)).cameras
    counts, *observed, numbers = path.read_text().split("\n", 3)
    path.write_text(f"{counts}\n\n" + "\n".join(observed) + "\n\n" + numbers.replace("0.002\n", "0.002\n\n"))
    after = camviz_clinic.load(path, size=(640, 480)).cameras
    assert all(same_camera(after[name], before[name], 0) for name in ("camera0", "camera1"))


def test_an_ost_is_opencvs_order_and_four_numbers_are_a_fisheye(tmp_path):
    path = sample("ost", tmp_path)
    camera = camviz_clinic.load(path).cameras["narrow_stereo"]
    check(camera, radtan(POINTS, 500.5, 499.75, 321.25, 238.5, -0.21, 0.13, 0.0015, -0.0005, 0.01))
    path.write_text(path.read_text().replace("-0.0005 0.01", "-0.0005"))
    calibration = camviz_clinic.load(path)
    check(
        calibration.cameras["narrow_stereo"],
        kannala_brandt(POINTS, 500.5, 499.75, 321.25, 238.5, -0.21, 0.13, 0.0015, -0.0005),
    )
    assert "fisheye" in calibration.notes[0]


def test_an_ini_tells_the_baseline_as_ost_does(tmp_path):
    path = sample("ost", tmp_path)
    path.write_text("# Camera intrinsics\n" + path.read_text().replace("320.0 0.0\n", "320.0 -57.6\n"))
    assert "pair, 0.12 m to the right" in camviz_clinic.load(path).notes[0]


def qtm(world, numbers):
    """Qualisys: r (x - C) has y up and looks along -z; lengths on the sensor are 1/64 px; then the window's corner."""
    r, C, lengths, D, corner = numbers
    X, Y, Z = ((world * 1000 - C) @ np.reshape(r, (3, 3)).T * [1, -1, -1]).T
    fu, fv, cu, cv, skew = lengths
    x, y = bent(X / Z, Y / Z, *D)
    return np.stack([(fu * x + skew * y + cu) / 64, (fv * y + cv) / 64], axis=-1) - corner


def test_qualisys_lengths_are_64ths_of_a_pixel_in_the_window_of_the_sensor(tmp_path):
    calibration = camviz_clinic.load(sample("qualisys", tmp_path))
    (camera,) = calibration.cameras.values()
    r, C = (0.8, 0.6, 0, -0.36, 0.48, 0.8, 0.48, -0.64, 0.6), np.array([1500, -2000, 1750])
    lengths, D = (107584, 107592, 60848, 34176, 16), (-0.046, 0.14, 0.0006, -0.0004, 0.003)
    world = transform(camera.world_from_cam, POINTS)
    np.testing.assert_allclose(camera.project(world), qtm(world, (r, C, lengths, D, [64, 32])), rtol=0, atol=1e-9)
    np.testing.assert_allclose(camera.centre, C / 1000, rtol=0, atol=1e-12)
    assert (camera.intrinsics.width, camera.intrinsics.height) == (1792, 1024)
    assert any("21002 was not calibrated" in note for note in calibration.notes)


def test_qualisys_without_a_window_has_the_whole_sensor(tmp_path):
    path = sample("qualisys", tmp_path)
    window = '<fov_video left="64" top="32" right="1855" bottom="1055"/>'
    (camera,) = camviz_clinic.load(written(path, path.read_text().replace(window, ""))).cameras.values()
    assert (camera.intrinsics.width, camera.intrinsics.height) == (1920, 1088)
    assert camera.intrinsics.cx == pytest.approx(60848 / 64, abs=1e-12)


def test_a_qualisys_camera_on_its_side_is_said(tmp_path):
    path = sample("qualisys", tmp_path)
    text = path.read_text().replace('viewrotation="0">', 'viewrotation="90">')
    assert any("viewrotation 90" in note for note in camviz_clinic.load(written(path, text)).notes)


def test_theias_calibration_is_no_qualisys_though_its_elements_have_the_same_names(tmp_path):
    """Theia writes pixels and p_cam = R p + t: read as 1/64 px, its cameras would see nothing but a point."""
    path = sample("qualisys", tmp_path)
    text = path.read_text().replace('sensorMaxU="122879.0"', 'sensorMaxU="7680"')
    with pytest.raises(CalibrationError, match=r"sensorMaxU: expected 1/64 px.*Theia.* got 7680"):
        camviz_clinic.load(written(path, text))


def test_a_semicolon_begins_a_remark_in_an_ini(tmp_path):
    """As camera_calibration_parsers of ROS has it in its own test."""
    path = sample("ost", tmp_path)
    remarked = written(tmp_path / "a.ini", path.read_text().replace("height\n", "; comment\nheight\n"))
    assert same_camera(*(camviz_clinic.load(each).cameras["narrow_stereo"] for each in (path, remarked)), 0)


def test_intrinsics_that_librealsenses_examples_save_have_no_coefficients(tmp_path):
    numbers = {"fx": 610.0, "fy": 608.75, "ppx": 318.5, "ppy": 247.5, "height": 480, "width": 640, "depth_scale": 0.001}
    calibration = camviz_clinic.load(written(tmp_path / "a.json", json.dumps(numbers)))
    check(calibration.cameras["camera"], radtan(POINTS, 610, 608.75, 318.5, 247.5))
    assert calibration.notes == ("The file holds no coeffs of camera: it is read without distortion.",)


def test_easymocaps_cameras_of_which_extri_does_not_tell_are_left_out(tmp_path):
    first = formats()["easymocap"].example.decode()
    names, rest = first.split('  - "01"\n')
    both = f'{names}  - "00"\n  - "01"\n{rest}{rest.replace("_01", "_00")}'
    written(tmp_path / "intri.yml", both)
    written(tmp_path / "extri.yml", EXTRINSICS)
    calibration = camviz_clinic.load(tmp_path / "intri.yml")
    assert list(calibration.cameras) == ["01"]
    assert calibration.notes == ("extri.yml does not say where 00 stood: left out.",)


def test_bf_of_a_camera_with_depth_is_no_second_picture(tmp_path):
    """ORB-SLAM2's TUM1.yaml: Camera.bf is fx times the projector's distance, and the picture is not rectified."""
    text = (
        "%YAML:1.0\nCamera.fx: 517.25\nCamera.fy: 516.5\nCamera.cx: 318.75\nCamera.cy: 255.25\nCamera.k1: 0.25\n"
        "Camera.width: 640\nCamera.height: 480\nCamera.bf: 40.0\n"
    )
    assert "rectified" in camviz_clinic.load(written(tmp_path / "a.yaml", text)).notes[0]
    assert camviz_clinic.load(written(tmp_path / "b.yaml", f"{text}DepthMapFactor: 5000.0\n")).notes == ()


def librealsenses_modified(points, fx, fy, cx, cy, *coeffs):
    """rs2_project_point_to_pixel of librealsense 2.56, line by line, of one point after another."""
    found = []
    for X, Y, Z in points.tolist():
        x, y = X / Z, Y / Z
        r2 = x * x + y * y
        f = 1 + coeffs[0] * r2 + coeffs[1] * r2 * r2 + coeffs[4] * r2 * r2 * r2
        x *= f
        y *= f
        dx = x + 2 * coeffs[2] * x * y + coeffs[3] * (r2 + 2 * x * x)
        dy = y + 2 * coeffs[3] * x * y + coeffs[2] * (r2 + 2 * y * y)
        found.append([dx * fx + cx, dy * fy + cy])
    return np.array(found)


REALSENSE = {
    "modified_brown_conrady": (librealsenses_modified, [0.125, -0.25, 0.001, -0.002, 0.0625]),
    "brown_conrady": (radtan, [0.125, -0.25, 0.001, -0.002, 0.0625]),
    "kannala_brandt4": (kannala_brandt, [0.125, -0.25, 0.001, -0.002, 0.0]),
    "ftheta": (fov, [0.93, 0, 0, 0, 0]),
}


@pytest.mark.parametrize("model", REALSENSE)
def test_a_realsense_stream_has_librealsenses_model(tmp_path, model):
    path = sample("realsense", tmp_path)
    equation, numbers = REALSENSE[model]
    text = (
        path.read_text().replace("brown_conrady", model).replace("[0.125, -0.25, 0.001, -0.002, 0.0625]", str(numbers))
    )
    camera = camviz_clinic.load(written(path, text)).cameras["color"]
    count = {"kannala_brandt4": 4, "ftheta": 1}.get(model, 5)
    check(camera, equation(POINTS, 608.75, 609.5, 318.5, 241.25, *numbers[:count]))


@pytest.mark.parametrize(
    "word", ["Inverse Brown Conrady", "distortion.inverse_brown_conrady", "RS2_DISTORTION_INVERSE_BROWN_CONRADY"]
)
def test_realsenses_inverse_is_the_modified_model_and_older_versions_are_a_note(tmp_path, word):
    path = sample("realsense", tmp_path)
    text = path.read_text().replace("distortion.brown_conrady", word)
    calibration = camviz_clinic.load(written(path, text))
    numbers = (608.75, 609.5, 318.5, 241.25, 0.125, -0.25, 0.001, -0.002, 0.0625)
    check(calibration.cameras["color"], librealsenses_modified(POINTS, *numbers))
    assert "Older versions of librealsense straightened pixels with them." in calibration.notes[0]
    assert np.abs(librealsenses_modified(POINTS, *numbers) - radtan(POINTS, *numbers)).max() > 0.01
    zeros = camviz_clinic.load(
        written(path, text.replace("[0.125, -0.25, 0.001, -0.002, 0.0625]", "[0.0, 0.0, 0.0, 0.0, 0.0]"))
    )
    check(zeros.cameras["color"], radtan(POINTS, 608.75, 609.5, 318.5, 241.25))
    assert zeros.notes == ()


def test_an_oaks_extrinsics_go_from_a_camera_to_the_socket_it_names(tmp_path):
    """x_C = R x_B + t, t in centimetres; the world is the frame of the first socket, CAM_B."""
    cameras = camviz_clinic.load(sample("oak", tmp_path)).cameras
    assert list(cameras) == ["CAM_B", "CAM_C"]
    check(cameras["CAM_B"], kannala_brandt(POINTS, 398.5, 398.75, 330.25, 192, 0.01, -0.002, 0.003, -0.0004))
    D = (-4.5, 9.25, 0.001, -0.0005, 3.5, -4.625, 9.75, 2.25)
    check(cameras["CAM_C"], radtan(POINTS, 399.5, 399.75, 331.25, 191, *D))
    R = np.array([[1, 0, 0], [0, 0.8, -0.6], [0, 0.6, 0.8]])
    expected = POINTS @ R.T + [-0.075, 0.0025, 0.00125]
    np.testing.assert_allclose(transform(cameras["CAM_C"].cam_from_world, POINTS), expected, rtol=0, atol=1e-12)


LOOKS = {
    "TOML": "[rig]\nfocal = [1.0, 2.0]\nname = 'x'\n",
    "INI": "[rig]\nfocal=1.0\nname=x\n",
    "OpenCV's YAML": "%YAML:1.0\n---\nfocal: [1.0, 2.0\nname: x\n",
    "XML of another program (<sensors>)": "<?xml version='1.0'?>\n<sensors><camera f='1'/></sensors>\n",
    "a page of HTML": "<!DOCTYPE html><html><body>Not found</body></html>",
    "JSON": '{"focal": 1.0, "name": "x"}',
    "YAML": "focal: 1.0\nname: x\n",
    "a table of numbers": "1.0 2.0 3.0\n4.0 5.0 6.0\n",
    "a program's source": "import numpy as np\nK = np.eye(3)\n",
}


@pytest.mark.parametrize("kind", LOOKS)
def test_a_file_that_is_no_format_is_told_what_it_looks_like_and_what_is_read(tmp_path, kind):
    with pytest.raises(CalibrationError) as caught:
        camviz_clinic.load(written(tmp_path / "a.cfg", LOOKS[kind]))
    sentence = str(caught.value)
    assert f"(this looks like {kind}; what is read: anipose, bal," in sentence
    assert "--size" not in sentence
    assert all(name in sentence for name in formats())


def test_the_size_is_asked_for_last(tmp_path):
    """A matrix without distortion is no camera, whatever its size: the size is not asked for before that is settled."""
    path = written(tmp_path / "a.yml", "camera_matrix: [[500, 0, 320], [0, 500, 240], [0, 0, 1]]\n")
    with pytest.raises(CalibrationError, match="expected distortion coefficients"):
        camviz_clinic.load(path)
    path.write_text(path.read_text() + "distortion_coefficients: [0, 0, 0, 0, 0]\n")
    with pytest.raises(CalibrationError, match="add --size"):
        camviz_clinic.load(path)


VOXL = """%YAML:1.0
---
M: !!opencv-matrix
   rows: 3
   cols: 3
   dt: d
   data: [ 275.5, 0., 320.25, 0., 275.75, 238.5, 0., 0., 1. ]
D: !!opencv-matrix
   rows: 4
   cols: 1
   dt: d
   data: [ 0.005, 0.021, -0.03, 0.012 ]
reprojection_error: 1.75e-01
width: 640
height: 480
distortion_model: fisheye
calibration_time: "2022-04-01 12:00:00"
"""


def test_voxls_distortion_model_tells_the_fisheye(tmp_path):
    calibration = camviz_clinic.load(written(tmp_path / "a.yml", VOXL))
    check(
        calibration.cameras["camera"], kannala_brandt(POINTS, 275.5, 275.75, 320.25, 238.5, 0.005, 0.021, -0.03, 0.012)
    )
    assert calibration.notes == ()
    plumb = written(tmp_path / "a.yml", VOXL.replace("fisheye", "plumb_bob"))
    check(
        camviz_clinic.load(plumb).cameras["camera"],
        radtan(POINTS, 275.5, 275.75, 320.25, 238.5, 0.005, 0.021, -0.03, 0.012),
    )


def test_ocamcalibs_polynomial_is_cam2world(tmp_path):
    """cam2world of the toolbox: (row, column) = A (x, y) + centre, and the ray is (x, y, f(ρ)) of the first line."""
    camera = camviz_clinic.load(sample("ocamcalib", tmp_path)).cameras["camera"]
    seen = np.random.default_rng(3).uniform([20, 20], [620, 460], size=(100, 2))
    A = np.array([[1.001, -0.0008], [0.0003, 1.0]])
    x, y = np.linalg.solve(A, (seen[:, ::-1] - [241.5, 318.25]).T)
    rho = np.sqrt(x * x + y * y)
    z = -275 + 1.25e-3 * rho**2 - 2.5e-7 * rho**3 + 1.5e-9 * rho**4
    rays = np.stack([y, x, -z], axis=-1)  # columns to the right, rows down, forward
    np.testing.assert_allclose(camera.project(rays), seen, rtol=0, atol=1e-9)
