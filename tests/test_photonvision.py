"""PhotonVision's calibration JSON, in the layouts of 2023, 2024 and 2026; the corners are OpenCV's projections."""

import json

import cv2
import numpy as np
import pytest
from scipy.spatial.transform import Rotation

import camviz_clinic
from camviz.cameras import Camera, Intrinsics
from camviz.lenses import BrownConrady, Perspective
from camviz_clinic.calibration.types import Board
from camviz_clinic.commands import command
from camviz_clinic.files import Calibration, CalibrationError, write

K = np.array([[353.75, 0.0, 163.5], [0.0, 352.5, 119.75], [0.0, 0.0, 1.0]])
D = np.array([0.125, -0.25, 1e-3, -2e-3, 0.0625])
SQUARE, COLUMNS, ROWS = 0.0254, 7, 5
POINTS = np.array([[SQUARE * column, SQUARE * row, 0.0] for row in range(ROWS) for column in range(COLUMNS)])
TURNS = Rotation.from_rotvec([[0.4, 0.1, 0.0], [-0.3, 0.4, 0.1], [0.1, -0.5, -0.2], [0.5, 0.3, 0.3]])
PLACES = np.array([[-0.08, -0.05, 0.4], [-0.06, -0.06, 0.35], [-0.05, -0.04, 0.3], [-0.1, -0.05, 0.45]])
NOISE = np.random.default_rng(3).normal(0, 0.1, (4, COLUMNS * ROWS, 2))


def corners(view):
    pixels = cv2.projectPoints(POINTS, TURNS[view].as_rotvec(), PLACES[view], K, D)[0][:, 0]
    return pixels + NOISE[view]


def listed(points, names):
    return [dict(zip(names, map(float, point), strict=True)) for point in points]


def observation(view, **changes):
    x, y, z, w = TURNS[view].as_quat()
    place = dict(zip("xyz", map(float, PLACES[view]), strict=True))
    return {
        "locationInObjectSpace": listed(POINTS, "xyz"),
        "locationInImageSpace": listed(corners(view), "xy"),
        "reprojectionErrors": listed(-NOISE[view], "xy"),
        "optimisedCameraToObject": {
            "translation": place,
            "rotation": {"quaternion": {"W": w, "X": x, "Y": y, "Z": z}},
        },
        "cornersUsed": [True] * len(POINTS),
        "snapshotName": f"img{view}.png",
        "snapshotDataLocation": f"/there/img{view}.png",
    } | changes


def matrix(values):
    values = np.atleast_2d(values)
    return {"rows": values.shape[0], "cols": values.shape[1], "type": 6, "data": values.ravel().tolist()}


def whole(**changes):
    tree = {
        "resolution": {"width": 320.0, "height": 240.0},
        "cameraIntrinsics": matrix(K),
        "distCoeffs": matrix(D),
        "calobjectWarp": [],
        "observations": [observation(view) for view in range(4)],
        "calobjectSize": {"width": COLUMNS, "height": ROWS},
        "calobjectSpacing": SQUARE,
        "lensmodel": "LENSMODEL_OPENCV",
    } | changes
    return {key: value for key, value in tree.items() if value is not None}


@pytest.fixture
def loaded(tmp_path):
    """What is read of a file with changes."""

    def load(**changes):
        path = tmp_path / "calibration.json"
        path.write_text(json.dumps(whole(**changes)))
        return camviz_clinic.load(path)

    return load


def check(calibration, D=D):
    points = np.random.default_rng(5).uniform([-0.3, -0.2, 1.0], [0.3, 0.2, 3.0], size=(100, 3))
    expected = cv2.projectPoints(points, np.zeros(3), np.zeros(3), K, np.array(D))[0][:, 0]
    np.testing.assert_allclose(calibration.cameras["camera"].project(points), expected, rtol=0, atol=1e-9)


def test_camera_board_corners_poses_and_errors_are_read(loaded):
    calibration = loaded()
    check(calibration)
    assert calibration.board == Board(COLUMNS, ROWS, SQUARE)
    assert calibration.notes == ()
    np.testing.assert_array_equal(calibration.detections["camera"], np.stack([corners(view) for view in range(4)]))
    poses = calibration.cam_from_board["camera"]
    np.testing.assert_allclose(poses.translation, PLACES, rtol=0, atol=1e-15)
    np.testing.assert_allclose(poses.rotation.as_matrix(), TURNS.as_matrix(), rtol=0, atol=1e-12)
    expected = np.sqrt((NOISE**2).sum(axis=-1).mean(axis=-1))
    np.testing.assert_allclose(calibration.per_view_errors["camera"], expected, rtol=1e-12)
    assert calibration.pictures["camera"] == ("img0.png", "img1.png", "img2.png", "img3.png")
    assert not calibration.set_aside


@pytest.mark.parametrize("all_listed", [False, True])
def test_a_corner_that_was_not_seen_or_not_used_is_told_apart(loaded, all_listed):
    """(-1, -1) was not seen; PhotonVision gives no error for a corner that it did not use, or one to leave out."""
    seen = corners(0)
    seen[3] = -1
    used = [index not in (3, 8) for index in range(len(POINTS))]
    first = observation(0, locationInImageSpace=listed(seen, "xy"), cornersUsed=used)
    off = np.where(np.array(used)[:, None], -NOISE[0], 50.0)
    first["reprojectionErrors"] = listed(off if all_listed else off[used], "xy")
    calibration = loaded(observations=[first, *(observation(view) for view in (1, 2, 3))])
    assert np.argwhere(np.isnan(calibration.detections["camera"]).any(axis=-1)).tolist() == [[0, 3]]
    assert np.argwhere(calibration.set_aside["camera"]).tolist() == [[0, 8]]
    expected = np.sqrt((NOISE[0][used] ** 2).sum(axis=-1).mean())
    assert calibration.per_view_errors["camera"][0] == pytest.approx(expected, rel=1e-12)


def test_corners_in_any_order_and_number_go_to_their_places(loaded):
    """A ChArUco board of 2024: each view lists what it saw."""
    order = np.random.default_rng(1).permutation(len(POINTS))[:20]
    some = observation(
        1,
        locationInObjectSpace=listed(POINTS[order], "xyz"),
        locationInImageSpace=listed(corners(1)[order], "xy"),
        reprojectionErrors=listed(-NOISE[1][order], "xy"),
        cornersUsed=None,
    )
    held = loaded(observations=[observation(0), some]).detections["camera"][1]
    np.testing.assert_array_equal(held[order], corners(1)[order])
    assert np.isfinite(held).all(axis=1).sum() == 20


def test_the_file_of_2023_has_errors_of_views_and_the_coefficients_under_another_key(loaded):
    old = dict.fromkeys(
        ["observations", "calobjectWarp", "calobjectSize", "calobjectSpacing", "lensmodel", "distCoeffs"]
    )
    calibration = loaded(**old, cameraExtrinsics=matrix(D), perViewErrors=[0.25, 0.5], standardDeviation=0.1)
    check(calibration)
    assert calibration.per_view_errors["camera"].tolist() == [0.25, 0.5]
    assert calibration.board is None


def test_mrcals_eight_coefficients_and_the_bend_of_the_board(loaded):
    eight = [*D, 0.01, -0.002, 1e-4]
    calibration = loaded(distCoeffs=matrix(eight), calobjectWarp=[4.5e-4, -1e-4])
    check(calibration, eight)
    np.testing.assert_array_equal(calibration.board_warp, [4.5e-4, -1e-4])
    assert loaded(calobjectWarp=[0.0, 0.0]).board_warp is None


@pytest.mark.parametrize(("shift", "kept"), [(0.0, True), (0.9, True), (1.1, False), (50.0, False)])
def test_poses_that_leave_corners_a_pixel_off_are_found_anew(loaded, shift, kept):
    """As in two files of PhotonVision's own tests, whose K was edited by hand; the noise is 0.1 px."""
    shifted = K + [[0, 0, shift], [0, 0, 0], [0, 0, 0]]
    calibration = loaded(cameraIntrinsics=matrix(shifted))
    assert ("camera" in calibration.cam_from_board) == kept
    assert bool(calibration.notes) != kept
    if not kept:
        assert calibration.notes[0].startswith("The poses of the board (optimisedCameraToObject) are left out: ")
    assert len(calibration.detections["camera"]) == 4


def test_poses_may_be_as_far_off_as_three_times_what_the_file_says(loaded):
    """Errors of 2 px are said of the worst view, 5 px are within three times of that, 7 px are not."""
    off = [[2.0, 0.0], *[[0.1, 0.0]] * 3]
    said = [observation(view, reprojectionErrors=listed([off[view]] * len(POINTS), "xy")) for view in range(4)]
    found = {}
    for shift in (5, 7):
        shifted = K + [[0, 0, shift], [0, 0, 0], [0, 0, 0]]
        found[shift] = "camera" in loaded(cameraIntrinsics=matrix(shifted), observations=said).cam_from_board
    assert found == {5: True, 7: False}


def test_a_picture_whose_name_cannot_be_printed_has_its_number(loaded):
    named = [observation(0, snapshotName="a\nb"), observation(1, snapshotName=""), observation(2)]
    assert loaded(observations=named).pictures["camera"] == ("view 1", "view 2", "img2.png")


@pytest.mark.parametrize(
    "changes",
    [
        {"calobjectSpacing": 0.02},
        {"calobjectSpacing": 0.0},
        {"calobjectSpacing": None},
        {"calobjectSpacing": 1e-300},
        {"calobjectSpacing": SQUARE / 1e6},
        {"observations": [observation(0, locationInObjectSpace=[], locationInImageSpace=[], cornersUsed=[])]},
        {"observations": [observation(0, locationInObjectSpace=listed(POINTS - [SQUARE, 0, 0], "xyz"))]},
        {"observations": [observation(0, locationInObjectSpace=listed(POINTS * [1, 0, 0], "xyz"))]},
    ],
)
def test_points_of_no_board_are_named_as_dropped(loaded, changes):
    calibration = loaded(**changes)
    check(calibration)
    assert not calibration.detections
    assert calibration.notes == ("The observations are left out: their points are no grid of a board's squares.",)


REFUSED = {
    "lensmodel: expected LENSMODEL_OPENCV, got 'LENSMODEL_STERIOGRAPHIC'": {"lensmodel": "LENSMODEL_STERIOGRAPHIC"},
    "lensmodel: .* got 'LENSMODEL_SPLINED_STERIOGRAPHIC'": {"lensmodel": "LENSMODEL_SPLINED_STERIOGRAPHIC"},
    "isFisheye: expected false": {"isFisheye": True},
    "distCoeffs: expected 4, 5, 8, 12 or 14 numbers": {"distCoeffs": matrix(D[:3])},
    "distCoeffs.data: expected 1×5 = 5 numbers, got 3": {"distCoeffs": {"rows": 1, "cols": 5, "data": [1, 2, 3]}},
    r"observations\[0\].locationInImageSpace: expected 35 points": {
        "observations": [observation(0, locationInImageSpace=listed(corners(0)[:9], "xy"))]
    },
    r"observations\[0\].cornersUsed: expected true or false for each of 35": {
        "observations": [observation(0, cornersUsed=[True])]
    },
    r"observations\[0\].locationInObjectSpace: expected each point of the board once": {
        "observations": [observation(0, locationInObjectSpace=listed([*POINTS[:-1], POINTS[0]], "xyz")), observation(1)]
    },
    "expected a quaternion of length 1": {
        "observations": [
            observation(
                0,
                optimisedCameraToObject={
                    "translation": {"x": 0, "y": 0, "z": 1},
                    "rotation": {"quaternion": {"W": 0, "X": 0, "Y": 0, "Z": 0}},
                },
            )
        ]
    },
    "got fx = -353.75 and fy = 352.5 px: the x axis points left": {
        "cameraIntrinsics": matrix(K * [[-1, 1, 1], [1, 1, 1], [1, 1, 1]])
    },
}


@pytest.mark.parametrize("sentence", REFUSED)
def test_what_cannot_be_read_is_refused_in_one_sentence(loaded, sentence):
    with pytest.raises(CalibrationError, match=sentence) as caught:
        loaded(**REFUSED[sentence])
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize(
    ("lens", "count"),
    [
        (Perspective(), 5),
        (BrownConrady(*D), 5),
        (BrownConrady(*D, 0.01, -0.002, 1e-4), 8),
        (BrownConrady(*D, 0.0, 0.0, 0.0, 1e-3, 2e-4, -1e-3, 3e-4), 12),
    ],
)
def test_what_is_written_is_read_back_and_what_is_not_is_named(tmp_path, loaded, lens, count):
    camera = Camera(Intrinsics(320, 240, 353.75, 352.5, 163.5, 119.75), lens)
    path = tmp_path / "written.json"
    lost = write(Calibration({"camera": camera}, path, "made", board=loaded().board), path, "photonvision")
    pinhole = ["the mark of a pinhole (its distortion coefficients are zeros)"] * (lens == Perspective())
    assert lost == (*pinhole, "the board")
    tree = json.loads(path.read_text())
    assert (tree["distCoeffs"]["cols"], len(tree["distCoeffs"]["data"]), tree["distCoeffs"]["type"]) == (
        count,
        count,
        6,
    )
    assert (tree["calobjectSize"], tree["calobjectSpacing"]) == ({"width": COLUMNS, "height": ROWS}, SQUARE)
    back = camviz_clinic.load(path).cameras["camera"]
    assert back.intrinsics == camera.intrinsics
    assert back.lens == (lens if isinstance(lens, BrownConrady) else BrownConrady())


def test_inspect_reckons_with_the_corners(tmp_path, capsys):
    path = tmp_path / "calibration.json"
    path.write_text(json.dumps(whole()))
    command.main(["inspect", str(path)])
    said = capsys.readouterr().out
    assert "4 of 4 pictures used" in said
    assert "outlier-view" in said.split("Checked: ")[1].splitlines()[0]
