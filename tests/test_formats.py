"""Each format's conventions, held against the definition its own program gives, or against that program itself."""

import io
import json
from math import tan
from pathlib import Path

import numpy as np
import pytest
import scipy.io
from hypothesis import given
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

import camviz_clinic
from camviz.cameras import transform
from camviz.lenses import KannalaBrandt, Stereographic
from camviz_clinic.files import CalibrationError, matlab_binary
from camviz_clinic.files.colmap import MODELS
from camviz_clinic.files.models import same_camera

DATA = Path(__file__).parent / "data"
POINTS = np.random.default_rng(7).uniform([-0.3, -0.25, 0.9], [0.3, 0.25, 3.0], size=(50, 3))
PARAMETERS = {
    "f": 500.0, "fx": 500.0, "fy": 490.0, "cx": 321.0, "cy": 239.5, "omega": 0.9, "alpha": 0.6, "beta": 1.1,
    "k1": -0.1, "k2": 0.02, "p1": 1e-3, "p2": -2e-3, "k3": 3e-3, "k4": 4e-3, "k5": 5e-3, "k6": 6e-3,
    "sx1": 1e-3, "sy1": -2e-3,
}  # fmt: skip


def mat_of(variables, **options):
    file = io.BytesIO()
    scipy.io.savemat(file, variables, **options)
    return file.getvalue()


ONE_BY_ONE = b"\1\0\0\0\1\0\0\0"  # the size of a variable
FIELDS = st.text("abcXYZ_", min_size=1, max_size=20).filter(lambda name: not name.startswith("_"))
NUMBERS = st.floats(allow_nan=False) | st.integers(-(2**31), 2**31) | st.booleans()
ROWS = st.lists(st.lists(st.floats(-1e9, 1e9), min_size=2, max_size=2), min_size=2, max_size=4)
WORDS = st.text("abc äθ", min_size=1, max_size=9).filter(lambda words: words == words.strip())
TREES = st.recursive(
    NUMBERS | ROWS | WORDS,
    lambda inner: st.dictionaries(FIELDS, inner, min_size=1, max_size=4),
    max_leaves=8,
)


def _saved(tree):
    """A tree as scipy.io.savemat takes it."""
    if isinstance(tree, dict):
        return {name: _saved(value) for name, value in tree.items()}
    return np.array(tree) if isinstance(tree, list) else tree


def camera_of(name, **options):
    (camera,) = camviz_clinic.load(DATA / name, **options).cameras.values()
    return camera


def world(camera, points_cam):
    return transform(camera.world_from_cam, points_cam)


def reconstruction(model):
    """A model of two images by COLMAP itself."""
    pycolmap = pytest.importorskip("pycolmap")
    made = pycolmap.Reconstruction()
    params = [PARAMETERS[name] for name in model.names]
    made.add_camera_with_trivial_rig(
        pycolmap.Camera(model=model.name, width=640, height=480, params=params, camera_id=5)
    )
    for number in (1, 2):
        image = pycolmap.Image(name=f"{number}.jpg", camera_id=5, image_id=number)
        rotation = pycolmap.Rotation3d(Rotation.from_rotvec([0.1, -0.2, 0.3 * number]).as_quat())
        made.add_image_with_trivial_frame(image, pycolmap.Rigid3d(rotation, [0.5, -0.25, number]))
    return made


@pytest.mark.parametrize("form", ["text", "binary"])
@pytest.mark.parametrize("number", MODELS)
def test_a_colmap_model_projects_as_colmap_does(tmp_path, number, form):
    """The centre of the first pixel is (0.5, 0.5) there and (0, 0) here; poses are cam_from_world."""
    made = reconstruction(MODELS[number])
    getattr(made, f"write_{form}")(tmp_path)
    cameras = camviz_clinic.load(tmp_path).cameras
    for image in made.images.values():
        points = world(cameras[image.name], POINTS)
        np.testing.assert_allclose(points, image.cam_from_world().inverse() * POINTS, rtol=0, atol=1e-12)
        theirs = made.cameras[5].img_from_cam(POINTS)
        np.testing.assert_allclose(cameras[image.name].project(points) + 0.5, theirs, rtol=0, atol=1e-8)


def test_a_colmap_model_is_named_by_its_folder_or_any_file_of_it(tmp_path):
    reconstruction(MODELS[1]).write_binary(tmp_path)
    for path in (tmp_path, tmp_path / "cameras.bin", tmp_path / "images.bin"):
        assert list(camviz_clinic.load(path).cameras) == ["1.jpg", "2.jpg"]


def test_colmap_cameras_without_images_stand_at_the_origin(tmp_path):
    (tmp_path / "a.txt").write_text("# a comment\n1 PINHOLE 640 480 500 510 320 240\n")
    calibration = camviz_clinic.load(tmp_path / "a.txt")
    assert calibration.cameras["camera1"].intrinsics.cx == 319.5
    assert "no images file" in calibration.notes[0]


def test_a_colmap_image_may_see_no_points_and_have_a_name_with_spaces():
    """Every image has two lines, the second of which may be empty."""
    calibration = camviz_clinic.load(DATA / "colmap")
    assert list(calibration.cameras) == ["P1180141.JPG", "fisheye/a b.jpg", "P1180142.JPG"]
    np.testing.assert_allclose(calibration.cameras["fisheye/a b.jpg"].centre, [-0.5, 0, 0], atol=1e-15)
    assert "1 of the 3 cameras" in calibration.notes[1]


def test_mrcal_has_opencvs_order_and_a_pose_from_the_reference():
    """rt_cam_ref = [r t]: x_cam = R(r) x_ref + t; pixels have their centres at integers."""
    import cv2

    camera = camera_of("mrcal.cameramodel")
    r, t = np.array([0.02, -0.3, 0.1]), np.array([1.5, -0.25, 0.125])
    fx, fy, cx, cy = 1761.181055, 1761.250444, 1965.706996, 1087.518797
    D = [-0.01266096516, 0.03590794372, -0.0002547045941, 0.0005275929652]
    D += [0.01968883397, 0.01482863541, -0.0562239888, 0.0500223357]
    K = np.array([[fx, 0, cx], [0, fy, cy], [0, 0, 1]])
    points = world(camera, POINTS)
    pixels = cv2.projectPoints(points, r, t, K, np.array(D))[0].reshape(-1, 2)
    np.testing.assert_allclose(camera.project(points), pixels, rtol=0, atol=1e-9)
    assert (camera.intrinsics.width, camera.intrinsics.height) == (4000, 2200)


def test_mrcals_stereographic_lens_has_two_tangents_of_half_the_angle():
    camera = camera_of("mrcal_stereographic.cameramodel")
    assert camera.lens == Stereographic()
    theta = 1.2
    pixel = camera.project([np.sin(theta), 0, np.cos(theta)])
    np.testing.assert_allclose(pixel, [319.5 + 500 * 2 * tan(theta / 2), 239.5], rtol=0, atol=1e-9)


@pytest.mark.parametrize(
    "name", ["LENSMODEL_CAHVOR", "LENSMODEL_SPLINED_STEREOGRAPHIC_order=3_Nx=30", "LENSMODEL_LATLON"]
)
def test_a_lens_of_mrcals_that_is_not_here_is_named(tmp_path, name):
    text = (DATA / "mrcal_stereographic.cameramodel").read_text().replace("LENSMODEL_STEREOGRAPHIC", name)
    (tmp_path / "camera.cameramodel").write_text(text)
    with pytest.raises(CalibrationError, match=f"lensmodel: expected one of .* got '{name}'"):
        camviz_clinic.load(tmp_path / "camera.cameramodel")


def test_nerfstudio_looks_backwards_along_z_with_y_up():
    """OpenGL: a point in front of the camera has negative z, one above the axis positive y, and less v here."""
    path = DATA / "transforms.json"
    frames = json.loads(path.read_text())["frames"]
    for camera, frame in zip(camviz_clinic.load(path).cameras.values(), frames, strict=True):
        world_from_gl = np.array(frame["transform_matrix"])
        (u, v), (above_u, above_v) = camera.project([(world_from_gl @ p)[:3] for p in ([0, 0, -2, 1], [0, 0.1, -2, 1])])
        np.testing.assert_allclose([u, v], [960.5 - 0.5, 540.0 - 0.5], rtol=0, atol=1e-9)
        assert above_v < v
        assert above_u == pytest.approx(u, abs=0.5)


def test_a_nerfstudio_frame_may_have_intrinsics_of_its_own():
    first, second = camviz_clinic.load(DATA / "transforms.json").cameras.values()
    assert (first.intrinsics.fx, second.intrinsics.fx, second.intrinsics.fy) == (1400.5, 1380.0, 1401.25)


def test_an_instant_ngp_angle_of_view_is_a_focal_length():
    """f = w / (2 tan(angle / 2)), here 90°; the principal point is the middle of the image."""
    camera = camera_of("transforms_fisheye.json")
    grid = camera.intrinsics
    assert (grid.fx, grid.fy, grid.cx, grid.cy) == pytest.approx((320, 320, 319.5, 239.5), abs=1e-12)
    assert camera.lens == KannalaBrandt(0.01, -0.002, 0.0003, -0.0001)


def test_nerfstudios_fourth_radial_coefficient_is_not_opencvs(tmp_path):
    """It is of the eighth power in the numerator; OpenCV's k4 is of the second in the denominator."""
    (tmp_path / "t.json").write_text((DATA / "transforms.json").read_text().replace('"k4": 0.0', '"k4": 0.5'))
    with pytest.raises(CalibrationError, match="k4: expected 0"):
        camviz_clinic.load(tmp_path / "t.json")


def test_eurocs_transform_takes_the_camera_to_the_body():
    """The IMU is the body: the camera's centre is at the last column of T_BS."""
    calibration = camviz_clinic.load(DATA / "euroc_sensor.yaml")
    imu_from_cam = calibration.world_from_imu.inv()
    np.testing.assert_allclose(transform(imu_from_cam, [0, 0, 0]), [-0.02, -0.06, 0.01], atol=1e-15)
    np.testing.assert_allclose(transform(imu_from_cam, [1, 0, 0]), [-0.02, 0.94, 0.01], atol=1e-12)
    assert calibration.cameras["camera"].intrinsics.cy == 248.375
    assert calibration.cameras["camera"].lens.p2 == 1.76187114e-05


def test_basalts_transforms_take_the_cameras_to_the_imu():
    """A quarter turn about z: the IMU's y axis is the camera's x axis, so 0.1 along y is 0.1 to the right."""
    calibration = camviz_clinic.load(DATA / "basalt.json")
    np.testing.assert_allclose(calibration.cameras["cam1"].centre, [0.1, 0, 0], atol=1e-12)
    imu_from_world = calibration.world_from_imu.inv()
    np.testing.assert_allclose(transform(imu_from_world, [0, 0, 0]), [0.05, 0.02, -0.01], atol=1e-15)


def test_basalts_lenses_project_where_they_are_published_to():
    """ucm and kb4 of (1, 2, 5): (291.022703, 329.003576) and (576.882637, 652.696340)."""
    cameras = camviz_clinic.load(DATA / "basalt.json").cameras
    for name, pixel in (("cam1", [291.022703, 329.003576]), ("cam2", [576.882637, 652.696340])):
        np.testing.assert_allclose(cameras[name].project(world(cameras[name], [1, 2, 5])), pixel, atol=1e-6)


def test_a_kitti_projection_matrix_is_applied_as_it_is():
    """u ~ P x for x in the rectified frame of camera 0; the baseline is -P1[0, 3] / fx = 0.537 m."""
    path = DATA / "kitti_calib.txt"
    cameras = camviz_clinic.load(path, size=(1242, 375)).cameras
    for line in path.read_text().splitlines()[:3]:
        name, *numbers = line.split()
        u = np.column_stack([POINTS, np.ones(50)]) @ np.array(numbers, float).reshape(3, 4).T
        np.testing.assert_allclose(cameras[name[:2]].project(POINTS), u[:, :2] / u[:, 2:], rtol=0, atol=1e-9)
    assert cameras["P1"].centre[0] == pytest.approx(387.5744 / 721.5377)


def test_kittis_raw_cameras_project_as_opencv_does():
    """x_i = R_i x_0 + T_i, D in OpenCV's order."""
    import cv2

    path = DATA / "kitti_cam_to_cam.txt"
    held = {key.rstrip(":"): v for key, *v in map(str.split, path.read_text().splitlines()) if key != "calib_time:"}
    K, D, R, T = (np.array(held[f"{key}_01"], float) for key in "KDRT")
    pixels = cv2.projectPoints(POINTS, cv2.Rodrigues(R.reshape(3, 3))[0], T, K.reshape(3, 3), D)[0].reshape(-1, 2)
    camera = camviz_clinic.load(path).cameras["01"]
    np.testing.assert_allclose(camera.project(POINTS), pixels, rtol=0, atol=1e-3)  # its R has seven digits
    assert (camera.intrinsics.width, camera.intrinsics.height) == (1392, 512)


def test_matlab_counts_pixels_from_one_and_transposes():
    """[u v 1] ~ [X Y Z] IntrinsicMatrix, and the first pixel's centre is (1, 1)."""
    camera = camera_of("matlab_parameters.json")
    held = json.loads((DATA / "matlab_parameters.json").read_text())
    ray = np.array([0.1, -0.2, 1])
    r2 = ray[0] ** 2 + ray[1] ** 2
    (k1, k2), (p1, p2) = held["RadialDistortion"], held["TangentialDistortion"]
    x, y = ray[:2] * (1 + k1 * r2 + k2 * r2**2)
    x += 2 * p1 * ray[0] * ray[1] + p2 * (r2 + 2 * ray[0] ** 2)
    y += p1 * (r2 + 2 * ray[1] ** 2) + 2 * p2 * ray[0] * ray[1]
    u, v, _ = np.array([x, y, 1]) @ np.array(held["IntrinsicMatrix"])
    np.testing.assert_allclose(camera.project(ray), [u - 1, v - 1], rtol=0, atol=1e-10)
    assert (camera.intrinsics.width, camera.intrinsics.height) == (640, 480)


def test_matlabs_intrinsics_object_is_read_as_well():
    camera = camera_of("matlab_intrinsics.json")
    assert (camera.intrinsics.cx, camera.intrinsics.cy, camera.lens.k3) == (320.5, 240.25, 0.01)


def test_matlabs_pair_multiplies_rows_in_the_boards_unit(tmp_path):
    """x2 = x1 RotationOfCamera2 + TranslationOfCamera2, in WorldUnits (stereoParameters, MATLAB R2014a on)."""
    one = json.loads((DATA / "matlab_parameters.json").read_text())
    R = Rotation.from_rotvec([0.02, -0.3, 0.1]).as_matrix()
    tree = {
        "CameraParameters1": one,
        "CameraParameters2": {**one, "RadialDistortion": [0.0, 0.0], "TangentialDistortion": [0.0, 0.0]},
        "RotationOfCamera2": R.tolist(),
        "TranslationOfCamera2": [-120.0, 3.0, 8.0],
    }
    path, content = tmp_path / "pair.json", json.dumps(tree)
    path.write_text(content)
    first, second = camviz_clinic.load(path).cameras.values()
    assert same_camera(first, camera_of("matlab_parameters.json"), 0.0)
    points = POINTS @ R + np.array([-0.12, 0.003, 0.008])
    pixels = points @ np.array(one["IntrinsicMatrix"])
    np.testing.assert_allclose(second.project(POINTS), pixels[:, :2] / pixels[:, 2:] - 1, rtol=0, atol=1e-9)
    path.write_text(content.replace('"mm"', '"in"'))
    np.testing.assert_allclose(camviz_clinic.load(path).cameras["camera2"].centre, second.centre * 25.4, rtol=1e-12)
    for was, becomes, said in [
        ('"mm"', '"feet"', r"WorldUnits: expected .*mm.*, got 'feet'"),
        ("TranslationOfCamera2", "Translation", "TranslationOfCamera2"),
        (json.dumps(R.tolist()), json.dumps((2 * R).tolist()), "RotationOfCamera2"),
    ]:
        path.write_text(content.replace(was, becomes))
        with pytest.raises(CalibrationError, match=said):
            camviz_clinic.load(path)


def test_metashape_measures_from_the_middle_and_swaps_the_tangential_pair():
    """The frame camera of the Metashape manual, "Camera models", with its 0.5 at the first pixel's centre."""
    camera = camera_of("metashape_calibration.xml")
    f, cx, cy, b1, b2, k1, k2, k3, p1, p2 = 3200.5, 12.25, -7.5, 1.5, -0.75, -0.05, 0.02, -0.004, 0.0011, -0.0007
    x, y = POINTS[:, 0] / POINTS[:, 2], POINTS[:, 1] / POINTS[:, 2]
    r2 = x * x + y * y
    radial = 1 + k1 * r2 + k2 * r2**2 + k3 * r2**3
    bent_x = x * radial + p1 * (r2 + 2 * x * x) + 2 * p2 * x * y
    bent_y = y * radial + p2 * (r2 + 2 * y * y) + 2 * p1 * x * y
    u, v = 4000 / 2 + cx + bent_x * f + bent_x * b1 + bent_y * b2, 3000 / 2 + cy + bent_y * f
    np.testing.assert_allclose(camera.project(POINTS), np.stack([u, v], axis=-1) - 0.5, rtol=0, atol=1e-9)


def test_metashapes_cameras_stand_where_their_transforms_put_them():
    calibration = camviz_clinic.load(DATA / "metashape_cameras.xml")
    first, fish = calibration.cameras.values()
    assert list(calibration.cameras) == ["0001", "fish & eye"]
    np.testing.assert_allclose(first.centre, [10, 20, 30], atol=1e-12)
    np.testing.assert_allclose(first.project([10, 20, 25]), [1999.5, 1499.5], atol=1e-9)  # looks down -z
    assert (first.intrinsics.fx, fish.lens) == (2345.5, KannalaBrandt(k4=0.001))
    assert "1 cameras that were not aligned" in calibration.notes[1]


@pytest.mark.parametrize(
    ("name", "old", "new", "what"),
    [
        ("colmap/cameras.txt", "PINHOLE 640 480", "SIMPLE_DIVISION 640 480", "camera model 'SIMPLE_DIVISION'"),
        ("colmap/cameras.txt", "7 PINHOLE 640 480 500 510 320 240", "7 PINHOLE 640 480 5", r"line 6.params: expected"),
        ("colmap/cameras.txt", "3 OPENCV", "1 OPENCV", "line 5: the camera 1 appears twice"),
        ("colmap/images.txt", "2 1 0 0 0 0.5", "2 1 1 0 0 0.5", "quaternion of length 1, got length 1.41"),
        ("colmap/images.txt", "0 4 1 P11", "0 4 9 P11", "got camera 9"),
        ("colmap/images.txt", "P1180142", "P1180141", "different names"),
        ("mrcal.cameramodel", "-0.01266096516, ", "", r"intrinsics: expected 12 numbers .* got 11"),
        ("mrcal.cameramodel", "(4000", "__import__('os')", "line 14: expected a Python literal"),
        ("mrcal.cameramodel", "(4000", "(__import__('os')", "line 14: expected a number, a string"),
        ("mrcal.cameramodel", "(4000", "-(4000", "line 14: expected a number, a string"),
        ("mrcal.cameramodel", "2200)", "2200]", r"line 14: expected a Python literal \(.*'\]' does not match"),
        ("transforms.json", "[0.0, 0.0, -1.0, 2.0]", "[0.0, 0.0, -1.5, 2.0]", r"frames\[0\].transform_matrix: "),
        ("transforms.json", "frame_00002", "frame_00001", r"frames\[1\].file_path: expected images of different names"),
        ("transforms.json", '"OPENCV"', '"EQUIRECTANGULAR"', "camera_model: .* got 'EQUIRECTANGULAR'"),
        ("euroc_sensor.yaml", "radial-tangential", "fov", "distortion_model: expected radial-tangential or"),
        ("basalt.json", '"ds"', '"thin"', r"value0.intrinsics\[0\].camera_type: expected pinhole or"),
        ("basalt.json", '"qw": 0.7071067811865476', '"qw": 0.5', r"value0.T_imu_cam\[0\]: expected a quaternion"),
        ("kitti_cam_to_cam.txt", "9.842439e+02", "0", "K_00: fx = 0: the camera is not calibrated"),
        ("matlab_parameters.json", "[713.5,0,0],[0.25,712.5,0],[321.5,241.25,1]", "[713.5,0,321],[0,712.5,241],[0,0,1]",
         "IntrinsicMatrix transposed: K must be upper triangular"),
        ("metashape_calibration.xml", "</p2>", "</p2><k4>0.1</k4>", "k4: expected 0, the frame lens here has no k4"),
        ("metashape_calibration.xml", "frame", "rpc", "projection: expected frame or fisheye"),
        ("metashape_cameras.xml", 'sensor_id="1"', 'sensor_id="5"', "sensor_id: expected one that the file has"),
    ],
)  # fmt: skip
def test_a_damaged_file_names_the_key_and_what_it_got(tmp_path, name, old, new, what):
    original = DATA / name
    for path in original.parent.glob("*.txt") if "/" in name else [original]:
        (tmp_path / path.name).write_text(path.read_text())
    text = original.read_text()
    assert old in text
    (tmp_path / original.name).write_text(text.replace(old, new, 1))
    with pytest.raises(CalibrationError, match=what) as caught:
        camviz_clinic.load(tmp_path / original.name)
    assert original.name in str(caught.value)
    assert "\n" not in str(caught.value)


def test_a_kitti_file_asks_for_the_size_it_never_holds():
    with pytest.raises(CalibrationError, match="--size WIDTHxHEIGHT"):
        camviz_clinic.load(DATA / "kitti_calib.txt")


@pytest.mark.parametrize("name", ["matlab_parameters", "matlab_intrinsics"])
def test_a_mat_file_says_what_its_json_says(name):
    """The .mat files were written by scipy, one of them compressed, from what the JSON files hold."""
    assert same_camera(camera_of(f"{name}.mat"), camera_of(f"{name}.json"), 0.0)


@pytest.mark.parametrize("compressed", [False, True])
@given(tree=TREES)
def test_a_mat_file_is_the_tree_that_was_saved(compressed, tree):
    """Structs, cells, words, numbers of every kind, in either order of bytes, as scipy.io writes them."""
    file = io.BytesIO()
    scipy.io.savemat(file, {"s": _saved(tree)}, do_compression=compressed, long_field_names=True)
    assert matlab_binary.parse(file.getvalue())["s"] == tree


@pytest.mark.parametrize(
    ("content", "what"),
    [
        (b"MATLAB 7.3 MAT-file, Platform: GLNXA64", "-v7"),
        (b"MATLAB 5.0 MAT-file, Platform: GLNXA64", "header is broken"),
        (mat_of({"a": 1.0}), r"expected one struct with RadialDistortion.*toStruct"),
        (mat_of({"a": {"K": np.eye(3), "FocalLength": 1.0}, "b": {"FocalLength": 1.0}}), r"got 2 among 'a', 'b'"),
        (mat_of({"zeros": np.zeros(3 * 2**20)}, do_compression=True), "at most 16 MB, they unfold to more"),
        (mat_of({"a": {"b": 1.0}}).replace(ONE_BY_ONE, b"\xff\xff\xff\x7f" * 2), "at most 1,000,000 values"),
    ],
    ids=["new", "header", "others", "two", "bomb", "announced"],
)
def test_a_mat_file_that_holds_no_camera_is_refused_in_a_sentence(tmp_path, content, what):
    (tmp_path / "p.mat").write_bytes(content)
    with pytest.raises(CalibrationError, match=what) as caught:
        camviz_clinic.load(tmp_path / "p.mat")
    assert "p.mat: " in str(caught.value)
    assert "\n" not in str(caught.value)
