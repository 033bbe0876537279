"""An inspection names what is wrong with a calibration, with the number that shows it, and nothing else."""

import json
import math
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace

import cv2
import numpy as np
import pytest
import yaml
from test_files import sample, write

import camviz_clinic
from camviz.cameras import Camera, Intrinsics
from camviz.distortion import valid_region
from camviz.lenses import BrownConrady, Equidistant, KannalaBrandt, Orthographic, Perspective
from camviz.poses import RigidTransform
from camviz_clinic.calibration import Detections, calibrate, calibrate_pair, detect
from camviz_clinic.calibration.adjustment import Adjustment
from camviz_clinic.checks import Inspection, inspect, inspect_file, kinds
from camviz_clinic.checks.evidence import Evidence
from camviz_clinic.checks.fields import smooth_field, warp_columns
from camviz_clinic.checks.findings import lens as lens_findings
from camviz_clinic.checks.findings.boards import coverage, held_out_ratio
from camviz_clinic.checks.findings.pair import confused_units
from camviz_clinic.checks.observed import explained, parameter_columns
from camviz_clinic.checks.rig import fits_better
from camviz_clinic.checks.virtual import single
from camviz_clinic.commands.command import main
from camviz_clinic.files import Board, CalibrationError

DATA = Path(__file__).parent / "data"
BOARD = Board(9, 6, 0.025)
SIZES = {"kitti_calib.txt": (1242, 375)}


def ids(inspection: Inspection) -> set[str]:
    return {finding.id for finding in inspection.findings}


def one(inspection: Inspection, id: str, camera=None):
    """The one finding of this id (of this camera)."""
    (finding,) = [each for each in inspection.findings if each.id == id and camera in (None, each.camera)]
    return finding


def photographs(finder):
    paths = sorted(sample("left01.jpg").parent.glob("left*.jpg"))
    return detect(paths, BOARD, finder=finder)


@pytest.fixture(scope="module")
def left_corners():
    """The corners in them by the better finder."""
    return photographs("auto")


@pytest.fixture(scope="module")
def left_classic():
    """OpenCV's thirteen photographs of the left camera, by its classic finder, with nothing set aside."""
    return calibrate(photographs("classic"), BOARD, robust=False)


@pytest.fixture(scope="module")
def healthy():
    """A virtual camera, solved."""
    rng = np.random.default_rng(5)
    set_up = single(rng, views=14)
    return set_up, set_up.solved(set_up.observed(rng))


# The published files -------------------------------------------------------------------------------------------------


def test_both_published_cameras_fold_inside_their_image():
    """g(r) = r + k1 r³ + k2 r⁵ turns back where 1 + 3 k1 r² + 5 k2 r⁴ = 0; what matters is g there, not r.

    Camera 2 turns back at r = 0.9785, beyond the corner's 0.772, but its image reaches only 0.719: the corner pixels
    have no ray.
    """
    inspection = inspect_file(sample("intrinsics.yml"), size=(640, 480))
    for name, k1, k2 in (
        ("left", 0.29589439552724328, -1.0354662043042675),
        ("right", -0.16916358306948096, -0.11214173641213163),
    ):
        r = math.sqrt((-3 * k1 - math.sqrt(9 * k1**2 - 20 * k2)) / (10 * k2))
        finding = one(inspection, "fold", name)
        assert finding.value == pytest.approx(r, abs=1e-12)
        assert finding.severity == ("fault" if name == "left" else "note")  # the right one loses less than 1 %
        camera = inspection.calibration.cameras[name]
        reach = r + k1 * r**3 + k2 * r**5
        corners = camera.intrinsics.from_pixels([[0, 0], [639, 0], [0, 479], [639, 479]])
        assert np.linalg.norm(corners, axis=1).max() > reach
        assert np.isnan(camera.unproject([[0, 0]])).all()
    assert one(inspection, "fold", "left").value == pytest.approx(0.7304, abs=5e-5)
    assert one(inspection, "fold", "right").value == pytest.approx(0.9785, abs=5e-5)


def test_the_published_left_camera_has_one_bad_view_and_no_fold():
    inspection = inspect_file(sample("left_intrinsics.yml"))
    finding = one(inspection, "outlier-view")
    assert ids(inspection) == {"outlier-view"}
    assert (finding.value, finding.pictures) == (pytest.approx(1.1820482, abs=1e-7), (1,))
    assert "view 2" in finding.sentence
    assert "fold" in inspection.checked


def test_the_classic_finder_loses_a_column_of_left02(left_classic):
    inspection = inspect(left_classic)
    line = one(inspection, "outlier-line")
    assert line.sentence.startswith("left02.jpg: column 1 ")
    assert line.value > 3
    assert {finding.pictures for finding in inspection.findings if finding.id == "outlier-view"} >= {(1,)}


def test_the_same_photographs_by_the_better_finder_are_healthy_and_a_note_names_the_column_that_was_set_aside(
    left_corners,
):
    inspection = inspect(calibrate(left_corners, BOARD))
    assert sorted(each.id for each in inspection.findings) == ["corners-set-aside", "views-disagree"]
    assert inspection.healthy
    note = one(inspection, "corners-set-aside")
    assert note.sentence.startswith("left07.jpg: 7 of 54 corners are set aside, 6 of them in column 9; ")


def test_a_shifted_principal_point_hides_from_the_error_but_not_from_held_out_corners(left_classic):
    """50 px: the error grows from 0.41 to 0.71 only, and corners that had no part in the pose are five times off."""
    camera = left_classic.cameras["camera"]
    shifted = replace(camera, intrinsics=replace(camera.intrinsics, cx=camera.intrinsics.cx + 50))
    wrong = replace(left_classic, cameras={"camera": shifted})
    poses = Adjustment.of(wrong).refined(only_poses=True)
    assert poses.rms == pytest.approx(0.71, abs=0.02)
    wrong = replace(wrong, cam_from_board={"camera": poses.first_from_board})
    evidence = Evidence(left_classic)
    assert held_out_ratio(evidence, evidence.observed["camera"]) < 2
    assert one(inspect(wrong), "pose-absorbs-error").value > 4


# The statistics underneath -------------------------------------------------------------------------------------------


def test_what_columns_explain_is_what_dense_least_squares_says(healthy):
    """The same sums of squares from one matrix of all parameters, poses and columns."""
    _, calibration = healthy
    best = Evidence(calibration).observed["camera"].best
    by_shared, by_pose = best.jacobian("camera")
    views, corners = best.used["camera"].shape
    poses = np.zeros((views, corners, 2, 6 * views))
    for view in range(views):
        poses[view, ..., 6 * view : 6 * view + 6] = by_pose[view]
    field, warp = smooth_field(best, "camera")[..., -4:], warp_columns(best, "camera")
    used, residuals = best.used["camera"], best.residuals["camera"][best.used["camera"]].ravel()

    def left(*groups):
        J = np.concatenate([group[used].reshape(len(residuals), -1) for group in groups], axis=1)
        J = J / np.linalg.norm(J, axis=0)
        solution, _, rank, _ = np.linalg.lstsq(J, residuals, rcond=1e-7)
        return float(np.sum((residuals - J @ solution) ** 2)), rank

    without, rank = left(by_shared, poses, field)
    bent, more = left(by_shared, poses, field, warp)
    F = (without - bent) / 2 / (bent / (len(residuals) - more))
    result = explained(best, "camera", warp, field)
    assert (result.count, more - rank) == (2, 2)
    assert pytest.approx(F, rel=1e-6) == result.F


def test_an_added_parameter_is_found_with_its_value_and_deviation():
    """With k1 left out of the lens of the solution, one step finds the true one within four deviations."""
    rng = np.random.default_rng(8)
    set_up = single(rng)
    set_up = replace(set_up, cameras=(replace(set_up.camera, lens=BrownConrady(k1=-0.01)),))
    solved = set_up.solved(set_up.observed(rng), fixed=("k1", "k2", "p1", "p2", "k3"))
    best = Adjustment.of(replace(solved, estimated={"camera": ("fx", "fy", "cx", "cy")})).refined()
    k1 = explained(best, "camera", parameter_columns(best, "camera", ["k1"]))
    assert abs(k1.values[0] + 0.01) < 4 * k1.sigmas[0]
    assert k1.sigmas[0] < 0.002


@pytest.mark.thorough
def test_noise_alone_explains_as_f_says():
    """Over 30 sets of nothing but noise the chances of the F-test are spread evenly (Kolmogorov's distance)."""
    chances = []
    for seed in range(30):
        rng = np.random.default_rng(seed)
        set_up = single(rng, views=8)
        best = Evidence(set_up.solved(set_up.observed(rng))).observed["camera"].best
        chances.append(explained(best, "camera", warp_columns(best, "camera")).chance)
    distance = np.abs(np.sort(chances) - (np.arange(30) + 0.5) / 30).max()
    assert distance < 1.63 / math.sqrt(30)  # 1 in 100


SQUARE = np.array([[0.0, 0], [639, 0], [639, 479], [0, 479]])


@pytest.mark.parametrize(("corners", "share"), [(SQUARE, 1), (SQUARE * [0.5, 1], 0.5)])
def test_coverage_is_the_area_inside_the_outline(corners, share):
    assert coverage(corners[None], Camera(Intrinsics(640, 480, 500, 500, 320, 240), Perspective())) == pytest.approx(
        share, abs=0.03
    )


def ring(degrees, focal=297.0):
    """Corners (1, 60, 2) all around the middle of 1280 × 960 pixels, so far off the axis of an equidistant fisheye."""
    around = np.linspace(0, 2 * np.pi, 60, endpoint=False)
    return (focal * np.radians(degrees) * np.stack([np.cos(around), np.sin(around)], axis=-1) + [639.5, 479.5])[None]


@pytest.mark.parametrize("lens", [Equidistant(), KannalaBrandt()])
def test_coverage_leaves_out_what_lies_beyond_a_fisheyes_circle(lens):
    """A board seen up to 75° off the axis fills 39 % of the picture, and 54 % of what 110° come to."""
    fisheye = Camera(Intrinsics(1280, 960, 297, 297, 639.5, 479.5), lens)
    x, y = np.meshgrid(np.arange(1280) - 639.5, np.arange(960) - 479.5)
    off_axis = np.degrees(np.hypot(x, y) / 297)
    assert (off_axis < 75).mean() < 0.4 < (off_axis < 75).sum() / (off_axis < 110).sum()
    share = (off_axis < 75).sum() / (off_axis < 110).sum()
    assert coverage(ring(75), fisheye) == pytest.approx(share, abs=0.04)


def test_coverage_counts_corners_that_were_seen_beyond_the_circle_all_the_same():
    """The circle of an orthographic lens of 300 px is a disc of that radius, and the board was seen up to 400 px."""
    camera = Camera(Intrinsics(1280, 960, 300, 300, 639.5, 479.5), Orthographic())
    assert coverage(ring(np.degrees(240 / 297)), camera) == pytest.approx(0.64, abs=0.07)
    assert coverage(ring(np.degrees(400 / 297)), camera) == 1


@pytest.mark.parametrize("lens", [BrownConrady(-1 / 3), BrownConrady(k4=1.0), KannalaBrandt(-0.5)])
def test_a_fold_or_a_pole_hides_no_missing_views(lens):
    """Beyond either no ray arrives, in most of this picture; coverage is that of the whole of it all the same."""
    camera = Camera(Intrinsics(1280, 960, 297, 297, 639.5, 479.5), lens)
    assert valid_region(camera, 8).mean() < 0.6
    plain = Camera(camera.intrinsics, Perspective())
    assert coverage(ring(30), camera) == coverage(ring(30), plain)


# What an inspection is -----------------------------------------------------------------------------------------------


def test_every_id_has_a_check_and_words_and_is_either_checked_or_skipped_with_a_reason(healthy):
    assert all(kind.id == id and callable(kind.check) for id, kind in kinds().items())
    for source in [*DATA.glob("*.*"), DATA / "colmap"]:
        inspection = inspect_file(source, size=SIZES.get(source.name))
        of_rigs = {id for id, kind in kinds().items() if kind.asked_of}
        asked = set(kinds()) - (of_rigs if len(inspection.calibration.cameras) < 3 else {"rig-exchanged"})
        assert sorted([*inspection.checked, *(id for id, _ in inspection.skipped)]) == sorted(asked)
        assert all(why for _, why in inspection.skipped)
        assert ids(inspection) <= set(inspection.checked)
    _, calibration = healthy
    assert {id for id, _ in inspect(calibration).skipped} == {
        "models-differ", "contradiction", "near-pole", "baseline-sign", "rectified-black", "inverted-transform",
        "corner-order", "wrong-board", "interpolated-corners", "other-settings", "sides-exchanged",
    }  # fmt: skip


def test_the_json_has_the_form_that_the_documentation_gives(left_classic):
    tree = json.loads(inspect(left_classic).as_json())
    assert list(tree) == ["verdict", "cameras", "accuracy", "task", "findings", "checked", "skipped", "ignored"]
    assert list(tree["cameras"][0]) == ["name", "model", "width", "height", "fx", "fy", "cx", "cy", "distortion", "rms"]
    keys = ["id", "severity", "sentence", "value", "unit", "camera", "view", "causes", "remedy"]
    keys += ["consequence_of", "count"]
    assert all(list(finding) == keys for finding in tree["findings"])
    assert all(list(each) == ["id", "why"] for each in tree["skipped"])
    assert tree["cameras"][0]["rms"] == pytest.approx(0.4087, abs=1e-3)
    assert tree["cameras"][0]["distortion"]["k1"] == left_classic.cameras["camera"].lens.k1


def test_the_worst_comes_first_and_a_healthy_calibration_says_what_was_checked(healthy):
    _, calibration = healthy
    said = inspect(calibration).as_text()
    assert said.startswith("Good to ±")
    assert "No problem found; 31 checks ran, 11 could not because the file holds one camera" in said
    assert "\nNext: " in said
    assert "\nChecked: assumed-coefficients, assumed-reading, not-a-rotation, bad-k" in said
    K = calibration.cameras["camera"]
    wide = replace(K, intrinsics=replace(K.intrinsics, fx=2 * K.intrinsics.fx), lens=BrownConrady(k1=-0.3, k2=-0.5))
    found = inspect(replace(calibration, cameras={"camera": wide})).findings
    severities = [finding.severity for finding in found if not finding.consequence_of]
    assert severities == sorted(severities, key=["fault", "warning", "note"].index)
    assert severities[0] == "fault"


def test_a_calibration_inspects_itself(healthy):
    _, calibration = healthy
    assert camviz_clinic.inspect(calibration).checked == inspect(calibration).checked


# Files that other commands refuse ------------------------------------------------------------------------------------

EDITS = [
    ("kalibr_chain.yaml", "[1.0, 0.0, 0.0, -0.11]", "[-1.0, 0.0, 0.0, -0.11]", "not-a-rotation", -1),
    ("kalibr_chain.yaml", "[1.0, 0.0, 0.0, -0.11]", "[1.1, 0.0, 0.0, -0.11]", "not-a-rotation", 0.21),
    ("kalibr_chain.yaml", "- [0.0, 0.0, 0.0, 1.0]", "- [0.0, 0.0, 0.0, 2.0]", "not-a-rotation", 1),
    ("euroc_sensor.yaml", "[0.0, -1.0,", "[0.0, 1.0,", "not-a-rotation", -1),
    ("basalt.json", '"qw": 0.7071067811865476', '"qw": 0.8', "not-a-rotation", 1.0677),
    ("colmap/images.txt", "2 1 0 0 0 ", "2 1.5 0 0 0 ", "not-a-rotation", 1.5),
    ("transforms.json", "[0.0, 0.0, -1.0, 2.0]", "[0.0, 0.0, -1.2, 2.0]", "not-a-rotation", 0.44),
    ("metashape_cameras.xml", "1 0 0 10 0 -1 0 20", "1 0 0 10 0 1 0 20", "not-a-rotation", -1),
    ("kitti_cam_to_cam.txt", "R_00: 1.000000e+00", "R_00: 1.100000e+00", "not-a-rotation", 0.21),
    ("ros_file.yaml", "0.999989", "0.9", "not-a-rotation", 0.19),
    ("opencv_stereo.xml", "0. 641.5 0. 906.5 352.75 0. 0. 1.", "0. 0. 0. 906.5 0. 641.5 352.75 1.", "bad-k", 641.5),
    ("opencv_stereo.xml", "906.5 352.75 0. 0. 1.", "906.5 352.75 0. 0. 2.", "bad-k", 2),
    ("matlab_parameters.json", "[0.25,712.5,0],[321.5,241.25,1]", "[0.25,712.5,0],[321.5,241.25,2]", "bad-k", 2),
    ("kitti_calib.txt", "1.000000e+00 0.000000e+00\nP1", "4.000000e+00 0.000000e+00\nP1", "bad-k", 4),
    ("kalibr_chain.yaml", "1.76187114e-05]", "1.76187114e-05, 0.01]", "coefficient-count", 5),
    ("euroc_sensor.yaml", "1.76187114e-05]", "1.76187114e-05, 0.01]", "coefficient-count", 5),
    ("matlab_parameters.json", "[-0.31,0.12]", "[-0.31,0.12,0.1,0.2]", "coefficient-count", 4),
    ("kitti_cam_to_cam.txt", "D_00: -3.728755e-01", "D_00:", "coefficient-count", 4),
    ("ros_file.yaml", "plumb_bob", "rational_polynomial", "coefficient-count", 5),
    ("ros2_message.yaml", "rational_polynomial", "plumb_bob", "coefficient-count", 8),
    ("mrcal.cameramodel", "LENSMODEL_OPENCV8", "LENSMODEL_OPENCV5", "coefficient-count", 12),
]


@pytest.mark.parametrize(("name", "old", "new", "id", "value"), EDITS)
def test_a_file_that_is_refused_is_inspected_and_says_why(tmp_path, name, old, new, id, value):
    for path in (DATA / name).parent.iterdir():  # COLMAP's files stand beside each other
        if path.is_file() and "/" in name:
            (tmp_path / path.name).write_bytes(path.read_bytes())
    path = tmp_path / Path(name).name
    text = (DATA / name).read_text()
    assert old in text
    path.write_text(text.replace(old, new, 1))
    with pytest.raises(CalibrationError) as refused:
        camviz_clinic.load(path, size=SIZES.get(path.name))
    assert refused.value.id == id
    inspection = inspect_file(path, size=SIZES.get(path.name))
    finding = one(inspection, id)
    assert finding.severity == "fault"
    assert finding.value == pytest.approx(value, abs=5e-4)
    assert not inspection.healthy


def test_a_transposed_k_is_read_on_as_the_camera_that_was_meant(tmp_path):
    K = np.array([[500.0, 0, 320], [0, 500, 240], [0, 0, 1]])
    for name, matrix in (("transposed", K.T), ("scaled", 4 * K)):
        path = write(tmp_path / f"{name}.yml", image_width=640, image_height=480, K=matrix, D=np.full((1, 5), 1e-3))
        inspection = inspect_file(path)
        assert ids(inspection) == {"bad-k"}
        np.testing.assert_allclose(inspection.calibration.cameras["camera"].intrinsics.K, K)


@pytest.mark.parametrize(
    ("focal", "id", "meaning"),
    [
        ((500, -500), "reversed-axis", "the y axis points up (OpenGL)"),
        ((-500, 500), "reversed-axis", "the x axis points left, or the camera looks along -z"),
        ((-500, -500), "reversed-axis", "x points left and y up (PyTorch3D)"),
        ((0, 500), "not-calibrated", "fx = 0: the camera is not calibrated"),
        ((500, 0), "not-calibrated", "fy = 0: the camera is not calibrated"),
    ],
)
def test_a_focal_length_that_is_not_positive_says_why(tmp_path, focal, id, meaning):
    """In OpenCV's matrix and in Kalibr's list of four numbers; nothing is left to look at."""
    (fx, fy), asked = focal, sum(not kind.asked_of for kind in kinds().values())
    K = np.array([[fx, 0, 320.0], [0, fy, 240], [0, 0, 1]])
    opencv = write(tmp_path / "k.yml", image_width=640, image_height=480, K=K, D=np.zeros((1, 5)))
    part = {"camera_model": "pinhole", "intrinsics": [fx, fy, 320, 240], "distortion_model": "none"}
    kalibr = tmp_path / "chain.yaml"
    kalibr.write_text(yaml.safe_dump({"cam0": {**part, "distortion_coeffs": [], "resolution": [640, 480]}}))
    for path in opencv, kalibr:
        inspection = inspect_file(path)
        assert (inspection.calibration, ids(inspection), len(inspection.skipped)) == (None, {id}, asked - 1)
        assert meaning in one(inspection, id).sentence


def test_a_camera_matrix_of_zeros_is_not_calibrated(tmp_path):
    """ROS 2 publishes one until a camera is calibrated."""
    message = {"height": 720, "width": 1280, "distortion_model": "", "d": [], "k": [0.0] * 9, "p": [0.0] * 12}
    (tmp_path / "ros.yaml").write_text(yaml.safe_dump(message))
    assert ids(inspect_file(tmp_path / "ros.yaml")) == {"not-calibrated"}


@pytest.mark.parametrize(("focal", "flip"), [((500, -510), [1, -1, 1]), ((-500, 510), [-1, 1, 1])])
def test_the_remedy_for_a_reversed_axis_is_the_same_camera(focal, flip):
    """OpenCV projects the points of reversed axes through both: f positive, and p1 (y) or p2 (x) negated."""
    points = np.array([[0.1, 0.2, 1.0], [-0.3, 0.15, 1.2], [0.25, -0.3, 0.9]])
    D = np.array([-0.2, 0.05, 2e-3, -3e-3, 0.01])
    turned = D * ([1, 1, -1, 1, 1] if flip[1] < 0 else [1, 1, 1, -1, 1])
    K = [np.array([[fx, 0, 320.0], [0, fy, 240], [0, 0, 1]]) for fx, fy in (focal, np.abs(focal))]
    here, there = (
        cv2.projectPoints(each, np.zeros(3), np.zeros(3), k, d)[0]
        for each, k, d in ((points, K[0], D), (points * flip, K[1], turned))
    )
    np.testing.assert_allclose(here, there, atol=1e-10)


def test_a_rotation_that_is_mended_is_the_nearest_one(tmp_path):
    """UVᵀ of the singular value decomposition (Golub & Van Loan, 12.4.1): a scaled rotation gives the rotation back."""
    tree = yaml.safe_load((DATA / "kalibr_chain.yaml").read_text())
    R = np.array(camviz_clinic.load(DATA / "kalibr_chain.yaml").cameras["cam1"].cam_from_world.rotation.as_matrix())
    tree["cam1"]["T_cn_cnm1"] = np.vstack([np.column_stack([1.2 * R, [0.1, 0, 0]]), [0, 0, 0, 1]]).tolist()
    path = tmp_path / "chain.yaml"
    path.write_text(yaml.safe_dump(tree))
    mended = inspect_file(path).calibration.cameras["cam1"].cam_from_world
    np.testing.assert_allclose(mended.rotation.as_matrix(), R, atol=1e-12)


@pytest.mark.parametrize(
    ("as_it_is", "changed", "better"),
    [
        (0.101, 0.02, True),
        (0.099, 0.02, False),  # less than five times nearer
        (2.0, 0.199, True),
        (2.0, 0.201, False),  # not near
    ],
)
def test_another_reading_of_a_transform_must_be_five_times_nearer_and_near(as_it_is, changed, better):
    """Distances in lengths of the transform that is known."""
    known, ours, other = (RigidTransform.from_translation([0.1 * (1 + off), 0, 0]) for off in (0, as_it_is, changed))
    assert fits_better(ours, known, lambda _: other) == better


def test_a_positive_p03_of_ros_is_a_baseline_of_the_wrong_sign(tmp_path):
    """P[0, 3] = -fx B."""
    text = (DATA / "ros_file.yaml").read_text()
    assert "-26.507895" in text
    (tmp_path / "ros.yaml").write_text(text.replace("-26.507895", "26.507895"))
    assert one(inspect_file(tmp_path / "ros.yaml"), "baseline-sign").value == pytest.approx(-26.507895 / 295.53402)


# Beside other evidence -----------------------------------------------------------------------------------------------


def test_the_pictures_size_is_held_against_the_camera():
    calibration = camviz_clinic.load(DATA / "ros_file.yaml")
    assert "wrong-size" not in ids(inspect(calibration, pictures={"a.png": (640, 480)}))
    finding = one(inspect(calibration, pictures={"a.png": (1280, 960)}), "wrong-size")
    assert finding.value == 2


def test_a_focal_length_in_millimetres_is_no_focal_length(tmp_path):
    K = np.array([[3.6, 0, 320], [0, 3.6, 240], [0, 0, 1]])
    path = write(tmp_path / "k.yml", image_width=640, image_height=480, K=K, D=np.array([[-0.1, 0, 0, 0, 0]]))
    assert "millimetres" in one(inspect_file(path), "wrong-size").sentence


def test_the_measured_board_is_held_against_the_files():
    calibration = camviz_clinic.load(sample("left_intrinsics.yml"))
    finding = one(inspect(calibration, board=Board(9, 6, 0.03)), "baseline-scale")
    assert finding.value == pytest.approx(25 / 30)


def test_the_photographed_pair_is_healthy_and_its_corners_set_aside_are_a_note(left_corners):
    """|T| = 0.0836 m; left13's corner is 1.5 px off by any solution, and is set aside: that is no warning."""
    folder = sample("left01.jpg").parent
    right = detect(sorted(folder.glob("right*.jpg")), BOARD)
    calibration = calibrate_pair(left_corners, right, BOARD)
    assert calibration.set_aside["left"][11].any()
    found = [(each.id, each.severity) for each in inspect(calibration).findings]
    assert sorted(set(found)) == [("corners-set-aside", "note"), ("views-disagree", "note")]  # the board bends


def test_a_view_without_corners_is_no_reason_to_stop(healthy):
    set_up, _ = healthy
    (corners,) = set_up.observed(np.random.default_rng(1))
    corners[3, 2 * set_up.board.columns :] = np.nan
    grid = set_up.camera.intrinsics
    names = tuple(f"{view}.png" for view in range(len(corners)))
    solved = calibrate(Detections(names, corners, grid.width, grid.height), set_up.board)
    solved.detections["camera"][3] = np.nan
    inspect(solved)


# The command ---------------------------------------------------------------------------------------------------------


def test_the_exit_status_is_a_gate(capsys, tmp_path):
    assert main(["inspect", str(DATA / "ros_file.yaml")]) == 0
    assert capsys.readouterr().out.startswith("No problem found, 1 note below. ")
    assert main(["inspect", str(DATA / "opencv_fisheye.yml")]) == 0  # a note
    assert "note fold" in capsys.readouterr().out
    bad = tmp_path / "bad.yaml"
    bad.write_text((DATA / "ros_file.yaml").read_text().replace("plumb_bob", "rational_polynomial"))
    assert main(["inspect", str(bad)]) == 1
    assert "coefficient-count" in capsys.readouterr().out
    bad.write_text("nothing")
    assert main(["inspect", str(bad)]) == 2
    assert "plain text" in capsys.readouterr().err


def test_several_files_are_inspected_each_and_an_unreadable_one_is_named(capsys, tmp_path):
    (tmp_path / "no.yml").write_text("nothing")
    words = [str(DATA / "ros_file.yaml"), str(tmp_path / "no.yml"), str(DATA / "colmap")]
    assert main(["inspect", "--json", *words]) == 2
    captured = capsys.readouterr()
    assert [each["file"] for each in json.loads(captured.out)] == [words[0], words[2]]
    assert "no.yml" in captured.err


def test_pictures_are_calibrated_first_and_the_board_is_asked_for(capsys):
    folder = sample("left01.jpg").parent
    some = [str(folder / f"left{number:02}.jpg") for number in (1, 3, 4, 5, 6, 7)]
    assert main(["inspect", *some]) == 2
    assert "--board 9x6 --square-mm 25" in capsys.readouterr().err
    status = main(["inspect", *some, "--board", "9x6", "--square-mm", "25", "--json"])
    tree = json.loads(capsys.readouterr().out)
    assert tree["cameras"][0]["fx"] == pytest.approx(535, abs=5)
    assert status == (1 if any(each["severity"] != "note" for each in tree["findings"]) else 0)


def test_corners_in_pictures_are_found_for_a_file_without_them(capsys):
    """The published K, judged by the better finder's corners: healthy."""
    folder = sample("left01.jpg").parent
    words = ["inspect", str(sample("left_intrinsics.yml")), "--images", str(folder / "left*.jpg")]
    assert main([*words, "--board", "9x6", "--square-mm", "25", "--json"]) == 0
    tree = json.loads(capsys.readouterr().out)
    assert "pose-absorbs-error" in tree["checked"]


CANCELLED_YML = """%YAML:1.0
---
image_width: 1440
image_height: 1080
camera_matrix: !!opencv-matrix
   rows: 3
   cols: 3
   dt: d
   data: [1570.8956145992222, 0.0, 744.873376467274, 0.0, 1570.3494207432338, 575.5508745633753, 0.0, 0.0, 1.0]
distortion_coefficients: !!opencv-matrix
   rows: 12
   cols: 1
   dt: d
   data: [-2.8247717583453804, -0.8007807076436804, -0.014595359484103326, 0.0018820998949700702, 1.9827795585249783,
      -2.7306773773930897, -1.217725820479524, 2.4052243546080136, -0.0020670359760441713, 3.466088079317406e-05,
      0.014100351510458799, -3.093532973620761e-05]
"""


def test_a_near_pole_is_named_at_the_first_zero(tmp_path, monkeypatch, capsys):
    """Of the denominator of a reported file, at 0.5910; the image ends beyond, at 0.5993. The tables say so too."""
    monkeypatch.chdir(tmp_path)
    Path("cancel.yml").write_text(CANCELLED_YML, encoding="utf-8")
    (found,) = inspect_file(Path("cancel.yml")).findings
    assert found.id == "near-pole"
    assert "is 0, which is a pole, at r = 0.5910 focal lengths. The image reaches to 0.5993." in found.sentence
    assert "Beyond it less than 1 % of the pixels have no ray." in found.sentence
    assert main(["convert", "cancel.yml", "tables.npz", "--to", "lut"]) == 0
    assert "warning: camera: 0.05 % of the pixels have no ray; `rays` is NaN there." in capsys.readouterr().out


@pytest.mark.parametrize(("lost", "severity"), [(0.1, "note"), (0.1001, "fault")])
def test_a_fold_of_a_tenth_of_the_image_is_a_fault(lost, severity, monkeypatch):
    """Though no board was seen beyond it."""
    camera = Camera(Intrinsics(640, 480, 500, 500, 320, 240), BrownConrady(k1=-3.0))
    middle = np.tile([320.0, 240.0], (1, 54, 1))
    monkeypatch.setattr(lens_findings, "_lost", lambda camera: lost)
    evidence = SimpleNamespace(
        cameras={"camera": camera}, calibration=SimpleNamespace(detections={"camera": middle}), observed={}
    )
    (found,) = lens_findings.fold.check(evidence)
    assert found.severity == severity


def test_sides_are_exchanged_where_the_principal_point_fits_so():
    """The middles of 480×640 and 640×480 are 80√2 px apart: at two thirds of the way the second is half as far."""
    for by, id in ((1 - 1e-9, "principal-point"), (1 + 1e-9, "wrong-size")):
        off = 80 * 2 / 3 * by
        camera = Camera(Intrinsics(480, 640, 535.0, 535.0, 239.5 + off, 319.5 - off), Perspective())
        assert ids(inspect(camviz_clinic.Calibration({"c": camera}, Path("made"), "made"))) == {id}


def test_two_baselines_differ_in_millimetres_and_in_depth():
    """B 2.1 % longer: at one disparity Z = f B / d is 2.1 % deeper, 21 mm at 1 m and 63 mm at 3 m; 1000 times is mm."""
    camera = Camera(Intrinsics(640, 480, 535.0, 535.0, 319.5, 239.5), Perspective())

    def pair(baseline):
        right = camera.at(RigidTransform.from_translation([baseline, 0, 0]))
        return camviz_clinic.Calibration({"left": camera, "right": right}, Path("made"), "made")

    for at, mm in ((None, 21), (3.0, 63)):
        inspection = inspect(pair(0.08 * 1.021), compare=pair(0.08), at=at)
        (apart,) = inspection.pair_differences
        assert apart.baseline_mm - apart.other_mm == pytest.approx(1.68)
        assert apart.depth_mm == pytest.approx(mm, rel=1e-6)
        finding = one(inspection, "baseline-scale")
        assert "1.7 mm (2.1%) longer than the 80 mm" in finding.sentence
        assert f"At {at or 1:g} m their depths differ by {mm} mm" in finding.sentence
        assert "metres taken" not in " ".join(finding.causes)
    assert one(inspect(pair(80.0), compare=pair(0.08)), "baseline-scale").causes == ("millimetres taken for metres",)
    near = (math.exp(0.02 * 0.999), math.exp(0.02 * 1.001))
    assert ["baseline-scale" in ids(inspect(pair(0.08 * r), compare=pair(0.08))) for r in near] == [False, True]


@pytest.mark.parametrize(
    ("ratio", "units"),
    [
        (1000, ("millimetres", "metres")),
        (100, ("centimetres", "metres")),
        (1 / 0.0254, ("inches", "metres")),
        (1 / 0.3048, ("feet", "metres")),
        (1 / 25.4, ("inches", "millimetres")),
    ],
)
def test_confused_units_are_named_within_two_percent(ratio, units):
    """A metre has 1/0.0254 inches and 1/0.3048 feet (international yard and pound agreement of 1959)."""
    assert confused_units(ratio * math.exp(0.0199)) == confused_units(ratio * math.exp(-0.0199)) == units
    assert confused_units(ratio * math.exp(0.0201)) is None
