"""What is written says the same as what was read, in the other program's own terms; or it is not written, with why."""

import json
import os
import re
import shlex
from dataclasses import fields, replace
from pathlib import Path

import cv2
import numpy as np
import pytest
import yaml
from scipy.spatial.transform import RigidTransform, Rotation

import camviz_clinic
from camviz.cameras import Camera, Intrinsics, transform
from camviz.lenses import (
    BrownConrady,
    Cylindrical,
    DoubleSphere,
    Equidistant,
    Equirectangular,
    ExtendedUnified,
    FieldOfView,
    KannalaBrandt,
    Orthographic,
    Perspective,
    Stereographic,
    UnifiedSphere,
)
from camviz_clinic.commands import command
from camviz_clinic.files import Board, Calibration, CalibrationError, alone, from_first_camera, write, writing
from camviz_clinic.files.models import same_camera
from camviz_clinic.files.registry import written

DATA = Path(__file__).parent / "data"
POINTS = np.random.default_rng(7).uniform([-0.3, -0.25, 0.9], [0.3, 0.25, 3.0], size=(50, 3))
GRID = Intrinsics(640, 480, 1000 / 3, 1000 / 7, 321.1, 239.9)
SKEWED = replace(GRID, skew=1.3)
BROWN = (-0.11, 0.023, 1.1e-3, -2.3e-3, 3.7e-3, 4.1e-3, 5.3e-3, 6.7e-3, 7.1e-4, 8.3e-4, 9.7e-4, 1.1e-4, 0.013, -0.017)
LENSES = {
    "perspective": Perspective(),
    "brown4": BrownConrady(*BROWN[:4]),
    "brown5": BrownConrady(*BROWN[:5]),
    "brown8": BrownConrady(*BROWN[:8]),
    "brown12": BrownConrady(*BROWN[:12]),
    "brown14": BrownConrady(*BROWN),
    "fisheye": KannalaBrandt(0.0069, -0.0014, -0.00027, -0.00045),
    "equidistant": Equidistant(),
    "fov": FieldOfView(0.92),
    "mei": UnifiedSphere(1.7, -0.02, 0.004, 0.0003, -0.0001),
    "ucm": UnifiedSphere(0.85),
    "eucm": ExtendedUnified(0.6, 1.1),
    "ds": DoubleSphere(-0.2, 0.55),
    "stereographic": Stereographic(),
    "orthographic": Orthographic(),
    "lonlat": Equirectangular(),
    "cylindrical": Cylindrical(),
}
BROWN5 = {"perspective", "brown4", "brown5"}
HOLDS = {
    "opencv": {*BROWN5, "brown8", "brown12", "brown14", "fisheye", "equidistant", "mei", "ucm"},
    "ros": {*BROWN5, "brown8", "fisheye", "equidistant"},
    "kalibr": {"perspective", "brown4", "fisheye", "equidistant", "fov", "mei", "ucm", "eucm", "ds"},
    "colmap": {*BROWN5, "brown8", "fisheye", "equidistant", "fov", "ucm", "eucm"},
    "mrcal": {*BROWN5, "brown8", "brown12", "stereographic", "lonlat"},
    "nerfstudio": {*BROWN5, "fisheye", "equidistant"},
    "euroc": {"perspective", "brown4", "fisheye", "equidistant"},
    "basalt": {*BROWN5, "brown8", "fisheye", "equidistant", "fov", "ucm", "eucm", "ds"},
    "kitti": {"perspective"},
    "kitti-raw": BROWN5,
    "matlab": BROWN5,
    "metashape": {*BROWN5, "fisheye", "equidistant", "lonlat", "cylindrical"},
    "anipose": {*BROWN5, "brown8", "brown12", "brown14", "fisheye", "equidistant"},
    "stella": {*BROWN5, "fisheye", "equidistant"},
    "okvis": {*BROWN5, "brown8", "fisheye", "equidistant"},
    "opensfm": {*BROWN5, "fisheye", "equidistant"},
    "camodocal": {"perspective", "brown4", "brown5", "brown8", "fisheye", "equidistant", "mei", "ucm"},
    "orbslam": {*BROWN5, "fisheye", "equidistant"},
    "gyroflow": {*BROWN5, "brown8", "brown12", "fisheye", "mei", "ucm"},
    "photonvision": {*BROWN5, "brown8", "brown12"},
}
HOLDS["colmap-bin"] = HOLDS["colmap"]
POSE = RigidTransform.from_components([0.3, -0.2, 0.1], Rotation.from_rotvec([0.3, -1.2, 0.4]))
IMU = RigidTransform.from_components([0.05, 0.02, -0.01], Rotation.from_rotvec([-0.2, 0.1, 1.4]))
WORLDS = ("anipose", "opensfm", "colmap", "colmap-bin", "mrcal", "nerfstudio", "kitti-raw", "metashape")


def calibration(*cameras, imu=None, **fields):
    named = {f"cam{index}": camera for index, camera in enumerate(cameras)}
    return Calibration(named, Path("made.yml"), "made", world_from_imu=imu, **fields)


def pair(lens=LENSES["brown4"]):
    return calibration(Camera(GRID, lens), Camera(replace(GRID, fx=350.1), lens, POSE))


def assert_same(first, second):
    assert len(first.cameras) == len(second.cameras)
    for a, b in zip(first.cameras.values(), second.cameras.values(), strict=True):
        assert same_camera(a, b, 1e-12)
        seen, back = a.project(transform(a.world_from_cam, POINTS)), b.project(transform(a.world_from_cam, POINTS))
        np.testing.assert_allclose(back, seen, rtol=0, atol=1e-8)
        assert np.isfinite(seen).all()


@pytest.mark.parametrize("lens", LENSES)
@pytest.mark.parametrize("name", written())
def test_a_lens_is_written_whole_or_refused(tmp_path, name, lens):
    """One camera by its IMU: what the format has a model for is read back to 1e-12, the rest gets a sentence."""
    made = calibration(Camera(GRID, LENSES[lens]), imu=IMU)
    path = tmp_path / "out"
    if lens in HOLDS[name]:
        write(made, path, name)
        assert_same(made, camviz_clinic.load(path, size=(640, 480)))
    else:
        with pytest.raises(CalibrationError, match=r"has no (place for|[A-Z][a-zA-Z]+ lens)") as caught:
            write(made, path, name)
        assert "\n" not in str(caught.value)
        assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize("name", written())
def test_skew_is_kept_or_refused(tmp_path, name):
    """KITTI's and MATLAB's matrices and Metashape's b2 have a place for it; the others' models have none."""
    made = calibration(Camera(SKEWED), imu=IMU)
    if name in ("kitti", "matlab", "metashape"):
        write(made, tmp_path / "out", name)
        assert_same(made, camviz_clinic.load(tmp_path / "out", size=(640, 480)))
    else:
        with pytest.raises(CalibrationError, match="no place for skew of cam0"):
            write(made, tmp_path / "out", name)


@pytest.mark.parametrize("name", ["opencv", "kalibr", "basalt", "orbslam", "okvis", *sorted({*WORLDS} - {"mrcal"})])
def test_two_cameras_keep_their_places(tmp_path, name):
    made = replace(pair(), world_from_imu=IMU)
    write(made, tmp_path / "out", name)
    assert_same(made, camviz_clinic.load(tmp_path / "out"))


@pytest.mark.parametrize("name", written())
def test_a_world_of_ones_own_is_kept_or_refused(tmp_path, name):
    made = calibration(Camera(GRID, Perspective(), POSE), imu=IMU)
    if name in WORLDS:
        write(made, tmp_path / "out", name)
        assert_same(made, camviz_clinic.load(tmp_path / "out"))
    else:
        with pytest.raises(CalibrationError, match=r"--first-as-world|all turned alike"):
            write(made, tmp_path / "out", name)
        write(from_first_camera(made), tmp_path / "out", name)


@pytest.mark.parametrize("name", ["mrcal", "euroc", "matlab"])
def test_a_format_of_one_camera_asks_which(tmp_path, name):
    with pytest.raises(CalibrationError, match="choose one of cam0, cam1"):
        write(pair(), tmp_path / "out", name)
    assert write(alone(pair(), "cam0"), tmp_path / "out", name) is not None


@pytest.mark.parametrize("name", ["kalibr", "basalt", "euroc"])
def test_the_imu_stays_where_it_is(tmp_path, name):
    write(calibration(Camera(GRID, LENSES["brown4"]), imu=IMU), tmp_path / "out", name)
    back = camviz_clinic.load(tmp_path / "out").world_from_imu
    np.testing.assert_allclose(back.as_matrix(), IMU.as_matrix(), rtol=0, atol=1e-12)


def test_basalt_invents_no_imu(tmp_path):
    with pytest.raises(CalibrationError, match="this calibration holds none"):
        write(pair(), tmp_path / "out", "basalt")


def test_moving_the_world_into_the_first_camera_keeps_what_they_see_of_each_other():
    made = calibration(Camera(GRID, Perspective(), IMU), Camera(GRID, Perspective(), POSE), imu=POSE)
    moved = from_first_camera(made)
    before, after = made.rig.a_from_b("cam1", "cam0"), moved.rig.a_from_b("cam1", "cam0")
    np.testing.assert_allclose(after.as_matrix(), before.as_matrix(), atol=1e-14)
    imu_from_cam = [each.world_from_imu.inv() * each.cameras["cam1"].world_from_cam for each in (made, moved)]
    np.testing.assert_allclose(imu_from_cam[1].as_matrix(), imu_from_cam[0].as_matrix(), atol=1e-14)


@pytest.mark.parametrize("suffix", [".yml", ".xml", ".json"])
def test_opencv_keeps_all_that_it_knows_of_the_views(tmp_path, suffix):
    made = camviz_clinic.load(DATA / "opencv_mono.json")
    assert write(made, tmp_path / f"out{suffix}", "opencv") == ()
    back = camviz_clinic.load(tmp_path / f"out{suffix}")
    assert back.board == made.board
    for field in ("detections", "per_view_errors"):
        np.testing.assert_array_equal(getattr(back, field)["camera"], getattr(made, field)["camera"])
    poses = [each.cam_from_board["camera"].as_matrix() for each in (back, made)]
    np.testing.assert_allclose(*poses, rtol=0, atol=1e-12)


def test_what_a_format_does_not_hold_beside_the_cameras_is_said(tmp_path):
    lens = LENSES["brown4"]
    made = calibration(Camera(GRID, lens), board=Board(9, 6, 0.025), per_view_errors={"cam0": np.ones(3)}, imu=IMU)
    lost = write(made, tmp_path / "out", "mrcal")
    assert lost == ("the name cam0 (now camera)", "the board", "the errors of the views", "the place of the IMU")


def test_every_field_of_a_calibration_is_compared():
    """But for what is no record of the cameras: where it was read, and what was found in reading."""
    compared = {"cameras", *writing.KINDS}
    others = {"source", "format", "notes", "faults", "redundant", "undecided"}
    assert {field.name for field in fields(Calibration)} == compared | others


def test_a_record_that_comes_back_changed_is_named(tmp_path, monkeypatch):
    made = calibration(Camera(GRID, LENSES["brown5"]), board=Board(9, 6, 0.025), board_warp=np.array([1e-3, 2e-3]))
    other = replace(made, board=Board(9, 6, 0.024), board_warp=made.board_warp + 1e-8)
    monkeypatch.setattr(writing, "load", lambda *_, **__: other)
    assert write(made, tmp_path / "out.yml", "opencv") == ("part of the board", "part of the bend of the board")
    monkeypatch.setattr(writing, "load", lambda *_, **__: replace(made, board_warp=made.board_warp + 1e-13))
    assert write(made, tmp_path / "out.yml", "opencv") == ()


def test_an_image_size_that_a_format_does_not_hold_is_named(tmp_path):
    assert write(calibration(Camera(GRID)), tmp_path / "calib.txt", "kitti") == (
        "the image size (640×480 px)",
        "the name cam0 (now P0)",
    )


# Pairs and rigs.


ASIDE = RigidTransform.from_components([0.06, 0.002, -0.003], Rotation.from_rotvec([0.01, -0.02, 0.005]))
RIGS = {
    "pair": pair(LENSES["brown4"]).cameras,
    "side by side": {
        "cam0": Camera(GRID),
        "cam1": Camera(GRID, world_from_cam=RigidTransform.from_translation([0.1, 0, 0])),
    },
    "rig": {
        "cam0": Camera(GRID, LENSES["brown4"]),
        "cam1": Camera(GRID, LENSES["fisheye"], ASIDE),
        "cam2": Camera(replace(GRID, fx=400.5), LENSES["ds"], POSE),
    },
}
WHY = r"holds (one camera|a pair|rectified)|has no .* lens|no place for|one camera model"


def converted(source, out, name, *words):
    """The status of `camviz convert`."""
    return command.main(["convert", str(source), str(out), "--to", name, *words])


def beside(cameras, a, b):
    """What the sentence says of where camera b stands beside camera a."""
    pose = cameras[a].cam_from_world * cameras[b].world_from_cam
    length, angle = 1000 * np.linalg.norm(pose.translation), np.degrees(pose.rotation.magnitude())
    return f"baseline {length:.4g} mm, rotation {angle:.2f}°"


@pytest.mark.parametrize("rig", RIGS)
@pytest.mark.parametrize("name", written())
def test_a_baseline_comes_back_or_its_loss_is_named(tmp_path, capsys, name, rig):
    """Through the command: all cameras at once, and each of them alone with its frame as the world."""
    made = Calibration(RIGS[rig], Path("made"), "made", world_from_imu=IMU)
    write(made, tmp_path / "chain.yaml", "kalibr")
    status = converted(tmp_path / "chain.yaml", tmp_path / "whole", name)
    assert rig != "pair" or (status == 0) == (written()[name].most_cameras != 1 and name != "kitti")
    if status == 0:
        back = camviz_clinic.load(tmp_path / "whole", size=(640, 480))
        for a, b in zip(list(made.cameras), list(made.cameras)[1:], strict=False):
            places = [list(made.cameras).index(each) for each in (a, b)]
            read = [list(back.cameras.values())[place] for place in places]
            np.testing.assert_allclose(
                (read[0].cam_from_world * read[1].world_from_cam).as_matrix(),
                made.rig.a_from_b(a, b).as_matrix(),
                rtol=0,
                atol=1e-9,
            )
    else:
        assert re.search(WHY, capsys.readouterr().err)
    for one in made.cameras:
        capsys.readouterr()
        status = converted(tmp_path / "chain.yaml", tmp_path / one, name, "--camera", one, "--first-as-world")
        printed = capsys.readouterr()
        text = next((line for line in printed.out.splitlines() if ": written from " in line), printed.err)
        others = [other for other in made.cameras if other != one]
        if status == 0 and one == "cam0" and written()[name].own_world:  # the others' files say where they stand
            assert "(baseline " not in text
        elif status == 0 or (name == "ros" and len(others) == 1):
            assert [other for other in others if f"{other} ({beside(made.cameras, other, one)})" not in text] == []
        else:
            assert re.search(WHY, text)
        assert (tmp_path / one).exists() == (status == 0)


def test_a_camera_of_a_world_says_that_it_leaves_it(tmp_path):
    made = calibration(Camera(GRID, LENSES["brown4"], POSE))
    (lost,) = write(from_first_camera(made), tmp_path / "out.yml", "opencv", made)[:1]
    assert lost == "the pose of cam0 in its world (distance 374.2 mm, rotation 74.48°)"  # √0.14 m, 1.3 rad
    assert write(made, tmp_path / "model", "colmap") == ()


# A pair for ROS.


@pytest.mark.parametrize("lens", ["brown5", "fisheye"])
@pytest.mark.parametrize("exchanged", [False, True])
def test_a_pair_for_ros_is_stereo_rectified(tmp_path, lens, exchanged):
    """By OpenCV's function, and by sensor_msgs/CameraInfo's definition: (u, v, w) = P (R x, 1) in both pictures."""
    places = [RigidTransform.identity(), ASIDE]
    cameras = [Camera(replace(GRID, fx=fx), LENSES[lens], at) for fx, at in zip((350.0, 352.0), places, strict=True)]
    named = dict(zip(("left", "right"), cameras, strict=True))
    made = Calibration({name: named[name] for name in sorted(named, reverse=exchanged)}, Path("made"), "made")
    write(from_first_camera(made), tmp_path / "out", "ros")
    trees = [yaml.safe_load((tmp_path / "out" / f"{name}.yaml").read_text()) for name in named]
    R = [np.reshape(tree["rectification_matrix"]["data"], (3, 3)) for tree in trees]
    P = [np.reshape(tree["projection_matrix"]["data"], (3, 4)) for tree in trees]
    K = [np.reshape(tree["camera_matrix"]["data"], (3, 3)) for tree in trees]
    D = [np.array(tree["distortion_coefficients"]["data"]) for tree in trees]
    f, base = P[0][0, 0], np.linalg.norm(ASIDE.translation)
    assert P[0][0, 3] == 0
    assert P[1][0, 3] == pytest.approx(-f * base, rel=1e-12)

    to_right = ASIDE.inv()
    pose = to_right.rotation.as_matrix(), to_right.translation.reshape(3, 1)
    if lens == "fisheye":
        theirs = cv2.fisheye.stereoRectify(K[0], D[0], K[1], D[1], (640, 480), *pose, cv2.CALIB_ZERO_DISPARITY)
    else:
        theirs = cv2.stereoRectify(K[0], D[0], K[1], D[1], (640, 480), *pose, alpha=0)
    for ours, other in zip((*R, *P), theirs[:4], strict=True):
        np.testing.assert_allclose(ours, other, rtol=0, atol=1e-9)

    rectified = [P[i] @ np.column_stack([POINTS @ R[0].T, np.ones(len(POINTS))]).T for i in (0, 1)]
    rectified = [(each[:2] / each[2]).T for each in rectified]
    undistorted = cv2.fisheye.undistortPoints if lens == "fisheye" else cv2.undistortPoints
    fine = (cv2.TERM_CRITERIA_EPS | cv2.TERM_CRITERIA_MAX_ITER, 200, 1e-12)
    for i, camera in enumerate(cameras):
        words = {"criteria": fine} if lens == "fisheye" else {}
        found = undistorted(camera.project(POINTS)[:, None], K[i], D[i], R=R[i], P=P[i][:, :3], **words)[:, 0]
        np.testing.assert_allclose(rectified[i], found, rtol=0, atol=0.02)
    np.testing.assert_allclose(rectified[0][:, 1], rectified[1][:, 1], rtol=0, atol=1e-9)
    depth = f * base / (rectified[0] - rectified[1])[:, 0]
    np.testing.assert_allclose(depth, (POINTS @ R[0].T)[:, 2], rtol=1e-9)

    back = camviz_clinic.load(tmp_path / "out")
    assert list(back.cameras) == ["left", "right"]
    found, true = back.rig.a_from_b("right", "left").as_matrix(), to_right.as_matrix()
    np.testing.assert_allclose(found, true, rtol=0, atol=1e-12)


def test_one_camera_of_a_pair_is_refused_for_ros_with_a_command_that_works(tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    cameras = {"left": Camera(GRID, LENSES["brown5"]), "right": Camera(GRID, LENSES["brown5"], ASIDE)}
    write(Calibration(cameras, Path("made"), "made"), "my pair.yml", "opencv")
    for words in (["--camera", "right", "--first-as-world"], ["--camera", "right"], ["--camera", "left"]):
        assert converted("my pair.yml", "one.yaml", "ros", *words) == 2
        err = capsys.readouterr().err
        assert f"({beside(cameras, 'left', 'right')})" in err
    assert converted("my pair.yml", "left.yaml", "ros") == 2
    assert "expected the name of a new folder for left.yaml and right.yaml, such as ros" in capsys.readouterr().err
    assert converted("my pair.yml", "-", "ros") == 2
    assert [path.name for path in tmp_path.iterdir()] == ["my pair.yml"]
    assert command.main(shlex.split(err.split("`")[1])[1:]) == 0
    assert "ros: written from OpenCV FileStorage, stereo, read back and found the same." in capsys.readouterr().out
    assert_same(camviz_clinic.load("my pair.yml"), camviz_clinic.load("ros"))


@pytest.mark.parametrize(
    ("place", "other", "why"),
    [
        ([0, 0.1, 0], GRID, "stand one above the other"),
        ([0, 0, 0], GRID, "stand in the same place"),
        ([0, 0, 0.1], GRID, "stand in line"),
        ([0.1, 0, 0], replace(GRID, width=320), "have different image sizes"),
    ],
)
def test_a_pair_that_ros_cannot_rectify_is_refused(tmp_path, place, other, why):
    made = calibration(Camera(GRID), Camera(other, world_from_cam=RigidTransform.from_translation(place)))
    with pytest.raises(CalibrationError, match=why):
        write(made, tmp_path / "out", "ros")


def test_a_pair_under_45_degrees_is_still_side_by_side(tmp_path):
    """As cv2.stereoRectify has it: the longer way decides."""
    for y, is_written in ((0.0999, True), (0.1001, False)):
        made = calibration(Camera(GRID), Camera(GRID, world_from_cam=RigidTransform.from_translation([0.1, y, 0])))
        if is_written:
            write(made, tmp_path / "out", "ros")
            assert_same(made, camviz_clinic.load(tmp_path / "out"))
        else:
            with pytest.raises(CalibrationError, match="one above the other"):
                write(made, tmp_path / "other", "ros")


def test_the_rectification_of_a_ros_file_is_kept_or_named(tmp_path):
    made = camviz_clinic.load(DATA / "ros_file.yaml")
    assert write(made, tmp_path / "again.yaml", "ros") == ()
    both = [yaml.safe_load(path.read_text()) for path in (DATA / "ros_file.yaml", tmp_path / "again.yaml")]
    assert both[0] == both[1]
    assert "the rectification R and P" in write(made, tmp_path / "camera.yml", "opencv")


def test_two_ros_files_without_a_baseline_are_no_pair(tmp_path):
    (tmp_path / "two").mkdir()
    for name in ("left", "right"):
        write(Calibration({name: Camera(GRID)}, Path("made"), "made"), tmp_path / "two" / f"{name}.yaml", "ros")
    with pytest.raises(CalibrationError, match=r"expected P\[0, 3\] = 0 for the left camera and .*, got 0 and 0"):
        camviz_clinic.load(tmp_path / "two")


# Independent readers.


def test_opencv_reads_what_is_written_and_projects_the_same(tmp_path):
    made = pair(LENSES["brown14"])
    write(made, tmp_path / "pair.yml", "opencv")
    storage = cv2.FileStorage(str(tmp_path / "pair.yml"), cv2.FILE_STORAGE_READ)
    K, D, R, T = (storage.getNode(key).mat() for key in ("M2", "D2", "R", "T"))
    pixels = cv2.projectPoints(POINTS, cv2.Rodrigues(R)[0], T, K, D)[0].reshape(-1, 2)
    mine = made.cameras["cam1"].project(POINTS)
    seen = np.isfinite(mine).all(axis=1)
    assert seen.sum() > 5
    np.testing.assert_allclose(mine[seen], pixels[seen], rtol=0, atol=1e-9)


@pytest.mark.parametrize("name", ["colmap", "colmap-bin"])
@pytest.mark.parametrize("lens", sorted(HOLDS["colmap"]))
def test_colmap_reads_what_is_written_and_projects_the_same(tmp_path, name, lens):
    pycolmap = pytest.importorskip("pycolmap")
    made = calibration(Camera(GRID, LENSES[lens], IMU), Camera(GRID, LENSES[lens], POSE))
    write(made, tmp_path / "model", name)
    model = pycolmap.Reconstruction(tmp_path / "model")
    assert len(model.cameras) == 1
    for image in model.images.values():
        camera = made.cameras[image.name]
        world = transform(camera.world_from_cam, POINTS)
        np.testing.assert_allclose(image.cam_from_world() * world, POINTS, rtol=0, atol=1e-12)
        pixels = model.cameras[image.camera_id].img_from_cam(POINTS)
        np.testing.assert_allclose(camera.project(world) + 0.5, pixels, rtol=0, atol=1e-8)


@pytest.mark.parametrize(("name", "lens"), [("kalibr", "brown4"), ("ros", "brown5"), ("euroc", "brown4")])
def test_yaml_is_read_with_all_digits_by_another_reader(tmp_path, name, lens):
    """Numbers such as 1e-05 need a point to be numbers to PyYAML."""
    small = replace(LENSES[lens], p1=1e-5, p2=1e-7)
    write(calibration(Camera(GRID, small)), tmp_path / "out", name)
    tree = yaml.safe_load((tmp_path / "out").read_text())
    tree = tree.get("cam0", tree)
    values = tree.get("distortion_coeffs") or tree["distortion_coefficients"]
    values = values["data"] if isinstance(values, dict) else values
    assert values[:4] == [small.k1, small.k2, 1e-5, 1e-7]
    K = tree["camera_matrix"]["data"] if name == "ros" else tree["intrinsics"]
    focal_lengths = [K[0], K[4]] if name == "ros" else K[:2]
    assert focal_lengths == [GRID.fx, GRID.fy]


def test_a_kalibr_chain_goes_from_each_camera_to_the_next(tmp_path):
    """T_cn_cnm1 takes points of the camera before, T_cam_imu those of the IMU."""
    made = replace(pair(), world_from_imu=IMU)
    write(made, tmp_path / "chain.yaml", "kalibr")
    cam1 = yaml.safe_load((tmp_path / "chain.yaml").read_text())["cam1"]
    np.testing.assert_allclose(cam1["T_cn_cnm1"], POSE.inv().as_matrix(), atol=1e-14)
    np.testing.assert_allclose(cam1["T_cam_imu"], (POSE.inv() * IMU).as_matrix(), atol=1e-14)


def test_nerfstudios_columns_are_right_up_and_backward(tmp_path):
    write(calibration(Camera(GRID, Perspective(), POSE)), tmp_path / "out.json", "nerfstudio")
    tree = json.loads((tmp_path / "out.json").read_text())
    right, down, forward = POSE.rotation.as_matrix().T
    columns = np.array(tree["frames"][0]["transform_matrix"])[:3].T
    np.testing.assert_allclose(columns, [right, -down, -forward, POSE.translation], atol=1e-14)
    assert (tree["cx"], tree["cy"]) == (GRID.cx + 0.5, GRID.cy + 0.5)


def test_matlabs_matrix_is_transposed_and_counts_from_one(tmp_path):
    write(calibration(Camera(SKEWED, LENSES["brown5"])), tmp_path / "out.json", "matlab")
    tree = json.loads((tmp_path / "out.json").read_text())
    K = np.transpose(tree["IntrinsicMatrix"])
    np.testing.assert_allclose(K - SKEWED.K, [[0, 0, 1], [0, 0, 1], [0, 0, 0]], atol=1e-12)
    assert (tree["RadialDistortion"], tree["TangentialDistortion"]) == ([-0.11, 0.023, 3.7e-3], [1.1e-3, -2.3e-3])
    assert tree["ImageSize"] == [480, 640]


def test_metashape_is_written_with_its_tangential_pair_swapped(tmp_path):
    from xml.etree import ElementTree

    write(calibration(Camera(SKEWED, LENSES["brown5"])), tmp_path / "out.xml", "metashape")
    held = {each.tag: each.text for each in ElementTree.parse(tmp_path / "out.xml").getroot()}
    assert (float(held["p1"]), float(held["p2"])) == (-2.3e-3, 1.1e-3)
    expected = [GRID.fy, GRID.fx - GRID.fy, 1.3, GRID.cx + 0.5 - 320, GRID.cy + 0.5 - 240]
    np.testing.assert_allclose([float(held[key]) for key in ("f", "b1", "b2", "cx", "cy")], expected, atol=1e-12)


def test_mrcals_literal_is_one_to_python(tmp_path):
    from ast import literal_eval

    write(calibration(Camera(GRID, LENSES["brown12"], POSE)), tmp_path / "out.cameramodel", "mrcal")
    held = literal_eval((tmp_path / "out.cameramodel").read_text())
    inverse = POSE.inv()
    np.testing.assert_allclose(held["extrinsics"], [*inverse.rotation.as_rotvec(), *inverse.translation], atol=1e-14)
    assert held["intrinsics"] == [GRID.fx, GRID.fy, GRID.cx, GRID.cy, *BROWN[:12]]


def test_kittis_first_row_holds_the_baseline(tmp_path):
    right = Camera(GRID, Perspective(), RigidTransform.from_translation([0.54, 0, 0]))
    write(calibration(Camera(GRID), right), tmp_path / "calib.txt", "kitti")
    P1 = (tmp_path / "calib.txt").read_text().splitlines()[1].split()
    assert P1[0] == "P1:"
    assert -float(P1[4]) / float(P1[1]) == pytest.approx(0.54, abs=1e-15)


def test_basalts_quaternions_end_with_their_real_part(tmp_path):
    write(calibration(Camera(GRID, LENSES["ds"]), imu=IMU), tmp_path / "out.json", "basalt")
    held = json.loads((tmp_path / "out.json").read_text())["value0"]["T_imu_cam"][0]
    inverse = IMU.inv()
    np.testing.assert_allclose([held[f"q{axis}"] for axis in "xyzw"], inverse.rotation.as_quat(), atol=1e-15)
    np.testing.assert_allclose([held[f"p{axis}"] for axis in "xyz"], inverse.translation, atol=1e-15)


# Whole or not at all.


@pytest.mark.parametrize("name", ["kalibr", "colmap"])
def test_a_write_that_is_interrupted_leaves_nothing(tmp_path, monkeypatch, name):
    def interrupted(*_):
        raise KeyboardInterrupt

    monkeypatch.setattr(os, "replace", interrupted)
    with pytest.raises(KeyboardInterrupt):
        write(pair(), tmp_path / "out", name)
    assert list(tmp_path.iterdir()) == []


def test_what_is_not_read_back_the_same_is_not_written(tmp_path, monkeypatch):
    """Half a pixel would be noticed before the file has its name."""
    (tmp_path / "out").write_text("as it was")
    elsewhere = calibration(Camera(replace(GRID, cx=GRID.cx + 0.5)))
    monkeypatch.setattr(writing, "load", lambda *_, **__: elsewhere)
    with pytest.raises(CalibrationError, match="not read back as the same cameras"):
        write(calibration(Camera(GRID)), tmp_path / "out", "mrcal")
    assert [path.read_text() for path in tmp_path.iterdir()] == ["as it was"]


def test_a_folder_with_something_in_it_is_left_alone(tmp_path):
    (tmp_path / "model").mkdir()
    write(pair(), tmp_path / "model", "colmap")
    with pytest.raises(CalibrationError, match="a new folder, or of an empty one"):
        write(pair(), tmp_path / "model", "colmap")


@pytest.mark.parametrize(
    ("path", "name", "what"),
    [
        ("nowhere/out", "kalibr", "no directory"),
        ("", "kalibr", "this is a directory"),
        ("out", "word", "expected one of"),
    ],
)
def test_a_place_or_format_that_cannot_be_is_refused(tmp_path, path, name, what):
    with pytest.raises(CalibrationError, match=what):
        write(pair(), tmp_path / path, name)


# The command.


def test_convert_writes_what_load_reads(tmp_path, capsys):
    out = tmp_path / "model"
    assert command.main(["convert", str(DATA / "kalibr_chain.yaml"), str(out), "--to", "colmap"]) == 0
    assert_same(camviz_clinic.load(DATA / "kalibr_chain.yaml"), camviz_clinic.load(out))
    assert capsys.readouterr().out.endswith("read back and found the same, but without the place of the IMU.\n")


def test_convert_takes_one_camera_and_makes_it_the_world(tmp_path):
    words = ["convert", str(DATA / "kalibr_chain.yaml"), str(tmp_path / "o.yml"), "--to", "opencv", "--camera", "cam1"]
    assert command.main(words) == 2
    assert command.main([*words, "--first-as-world"]) == 0
    assert camviz_clinic.load(tmp_path / "o.yml").cameras["cam1"].lens == KannalaBrandt(
        -0.0128, 0.0047, -0.0031, 0.0006
    )


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (["opencv_mono.json", "out", "--to", "kalibr"], "no place for k3, k4, k5, k6 of camera"),
        (["opencv_mono.json", "out", "--to", "exif"], "expected one of anipose, basalt"),
        (["opencv_mono.json", "out"], "--to"),
        (["kitti_calib.txt", "out", "--to", "colmap"], "--size 640x480"),
        (
            ["opencv_mono.json", "out", "--to", "ros", "--camera", "left"],
            "expected one of the cameras camera, got 'left'",
        ),
        (["missing.yml", "out", "--to", "ros"], "no such file"),
    ],
)
def test_convert_refuses_in_one_sentence_and_writes_nothing(tmp_path, monkeypatch, capsys, words, said):
    monkeypatch.chdir(tmp_path)
    assert command.main(["convert", str(DATA / words[0]), *words[1:]]) == 2
    err = capsys.readouterr().err
    assert said in err
    assert err.count("\n") == 1
    assert list(tmp_path.iterdir()) == []


def test_convert_does_not_overwrite_what_it_reads(tmp_path, capsys):
    path = tmp_path / "camera.json"
    path.write_bytes((DATA / "opencv_mono.json").read_bytes())
    assert command.main(["convert", str(path), str(path), "--to", "colmap"]) == 2
    assert "would overwrite" in capsys.readouterr().err
    assert path.read_bytes() == (DATA / "opencv_mono.json").read_bytes()
