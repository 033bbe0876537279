"""`camviz poses`: the poses and their ± against rendered truth and OpenCV, and what is refused."""

import csv
import json
from dataclasses import replace

import cv2
import numpy as np
import pytest
from commandline import main, refused

from camviz.cameras import Camera, Intrinsics
from camviz.lenses import BrownConrady
from camviz.poses import RigidTransform, Rotation
from camviz_clinic.calibration import Board, Detections, find_corners
from camviz_clinic.calibration.boards.picture import whiteness
from camviz_clinic.calibration.paper import as_printed, told_by_ruler
from camviz_clinic.calibration.types import Calibration
from camviz_clinic.checks.snapshots import SHARP, TEXELS, snapshot
from camviz_clinic.checks.virtual import spread_boards
from camviz_clinic.datasets import poses as module
from camviz_clinic.datasets.poses import NoPose, find_poses
from camviz_clinic.files.writing import write

CAMERA = Camera(Intrinsics(640, 480, 530, 531, 322, 238), BrownConrady(-0.2, 0.05))
CHESS, TAGS = Board(9, 6, 0.025), Board(9, 6, 0.025, 0.019, "DICT_5X5_100")
OPTIONS = ("--board", "9x6", "--square-mm", "25", "--charuco", "5X5_100", "--marker-mm", "19")


def detections(corners):
    return Detections(tuple(f"{view}.png" for view in range(len(corners))), np.array(corners), 640, 480)


def seen(poses, rng, sigma, camera=CAMERA, board=CHESS):
    points = np.stack([camera.project(pose.apply(board.corners)) for pose in poses])
    return detections(points + rng.normal(0, sigma, points.shape))


def in_sigmas(found, truth):
    """The six errors of each pose in their standard deviations, (pictures, 6)."""
    true = truth[list(found.places)]
    turn = (found.cam_from_board.rotation * true.rotation.inv()).as_rotvec()
    place = found.board_from_cam.translation - true.inv().translation
    return np.concatenate([place / found.place_sigma, turn / found.turn_sigma], axis=1)


@pytest.mark.thorough
def test_corners_with_noise_give_poses_within_3_sigmas_in_99_percent_and_the_sigmas_are_not_too_large():
    rng, off = np.random.default_rng(0), []
    for _ in range(8):
        truth = spread_boards(rng, (CAMERA,), CHESS, 20, (5, 40))
        off.append(in_sigmas(find_poses(CAMERA, CHESS, seen(truth, rng, 0.2)), truth))
    off = np.concatenate(off)
    assert (np.abs(off) < 3).mean() >= 0.99
    scatter = 1 / np.sqrt(2 * len(off))  # the standard error of an RMS that is 1
    assert np.sqrt(np.mean(off**2, axis=0)) == pytest.approx(np.ones(6), abs=3 * scatter)


@pytest.mark.thorough
def test_one_marker_gives_poses_within_3_sigmas_and_none_of_its_four_corners_is_set_aside():
    marker, rng, off = Board.marker_grid(1, 1, 0.1, "DICT_4X4_50"), np.random.default_rng(0), []
    for _ in range(4):
        truth = spread_boards(rng, (CAMERA,), marker, 40, (10, 45))
        found = find_poses(CAMERA, marker, seen(truth, rng, 0.1, board=marker))
        assert set(found.corners) == {4}
        off.append(in_sigmas(found, truth))
    assert sum(map(len, off)) >= 0.95 * 160  # few look alike from two places
    off = np.concatenate(off)
    assert (np.abs(off) < 3).mean() >= 0.99
    assert 0.85 < np.sqrt(np.mean(off**2)) < 1.1  # a view that scatters more by chance has a larger ±


def rendered(board, noise, finder="saddles"):
    """The errors in σ of some 70 poses; a chessboard may be found from its other end, but the truth begins at one."""
    pulls = []
    for seed in range(6):
        rng = np.random.default_rng(seed)
        truth = spread_boards(rng, (CAMERA,), board, 12, (15, 40))
        corners = [find_corners(snapshot(CAMERA, board, pose, rng, noise, SHARP), board, finder) for pose in truth]
        for view, (uv, pose) in enumerate(zip(corners, truth, strict=True)):
            if uv is None:  # no board was found
                corners[view] = np.full((len(board.corners), 2), np.nan)
            elif board is CHESS and np.linalg.norm(uv - CAMERA.project(pose.apply(board.corners)), axis=1).min() > 5:
                corners[view] = uv[::-1]
        pulls.append(in_sigmas(find_poses(CAMERA, board, detections(corners)), truth))
    return np.concatenate(pulls)


@pytest.mark.thorough
def test_rendered_tags_give_poses_within_3_sigmas_in_99_percent():
    pulls = rendered(TAGS, 6)
    assert len(pulls) > 65
    assert (np.abs(pulls) < 3).mean() >= 0.99


@pytest.mark.thorough
def test_rendered_chessboards_do_so_at_their_saddle_points_and_those_of_sectors_do_not():
    pulls = rendered(CHESS, 3)
    assert len(pulls) > 65
    assert (np.abs(pulls) < 3).mean() >= 0.99
    assert np.sqrt(np.mean(pulls**2)) < 1.2
    assert np.sqrt(np.mean(rendered(CHESS, 3, "sectors") ** 2)) > 1.3


def test_a_rendered_squares_edge_lies_between_texels_where_it_is_sharp():
    """An edge through a texel is drawn as a lopsided ramp, and corners are found 0.03 px beside it."""
    white = whiteness(CHESS, TEXELS, SHARP)
    assert (white * (1 - white)).max() < 1e-9


def test_the_pose_is_opencvs_of_the_same_corners():
    rng = np.random.default_rng(3)
    truth = spread_boards(rng, (CAMERA,), CHESS, 6, (10, 40))
    corners = seen(truth, rng, 0.1)
    found = find_poses(CAMERA, CHESS, corners)
    for pose, uv in zip(found.cam_from_board, corners.corners, strict=True):
        _, turn, place = cv2.solvePnP(
            CHESS.corners, uv, CAMERA.intrinsics.K, np.array([-0.2, 0.05, 0, 0]), flags=cv2.SOLVEPNP_ITERATIVE
        )
        turn, place = cv2.solvePnPRefineLM(
            CHESS.corners, uv, CAMERA.intrinsics.K, np.array([-0.2, 0.05, 0, 0]), turn, place
        )
        assert pose.translation == pytest.approx(np.ravel(place), abs=1e-6)
        assert pose.rotation.as_rotvec() == pytest.approx(np.ravel(turn), abs=1e-5)


def test_what_the_camera_is_uncertain_by_is_added():
    rng = np.random.default_rng(4)
    truth = spread_boards(rng, (CAMERA,), CHESS, 10, (15, 40))
    corners = seen(truth, rng, 0.05)
    off = replace(CAMERA, intrinsics=replace(CAMERA.intrinsics, fx=534, fy=535))
    exact = find_poses(off, CHESS, corners)
    known = find_poses(off, CHESS, corners, ("fx", "fy"), 16.0 * np.ones((2, 2)))
    assert not exact.camera_counted
    assert known.camera_counted
    assert np.abs(in_sigmas(exact, truth)).max() > 10
    assert np.abs(in_sigmas(known, truth)).max() < 4


@pytest.mark.thorough
def test_noise_that_neighbours_share_widens_the_sigmas_until_they_hold():
    rng = np.random.default_rng(5)
    truth = spread_boards(rng, (CAMERA,), CHESS, 40, (15, 40))
    row, column = np.divmod(np.arange(54), 9)
    R = 0.6 ** (np.abs(row[:, None] - row) + np.abs(column[:, None] - column))
    noise = np.einsum("cd,vdi->vci", np.linalg.cholesky(R), rng.normal(0, 0.2, (40, 54, 2)))
    corners = seen(truth, rng, 0)
    shared = replace(corners, corners=corners.corners + noise)
    found = find_poses(CAMERA, CHESS, shared)
    assert 0.3 < found.correlation < 0.65
    assert np.sqrt(np.mean(in_sigmas(found, truth) ** 2)) < 1.5
    alone = find_poses(CAMERA, CHESS, seen(truth, rng, 0.2))
    assert alone.correlation < 0.05


def mirrored_case(distance, sigma=0.3):
    """A small board straight ahead, tilted by 20°, which from far away looks like one that is tilted the other way."""
    turn = Rotation.from_rotvec([0, np.radians(20), 0])
    pose = RigidTransform.from_components([0, 0, distance] - turn.apply(CHESS.corners.mean(axis=0)), turn)
    return seen(RigidTransform.concatenate([pose]), np.random.default_rng(6), sigma)


def test_a_picture_that_two_poses_fit_is_refused_and_one_from_nearer_is_not():
    assert len(find_poses(CAMERA, CHESS, mirrored_case(0.6)).names) == 1
    with pytest.raises(NoPose, match="two poses fit the board nearly as well"):
        find_poses(CAMERA, CHESS, mirrored_case(4.0))


def test_the_threshold_of_two_poses_is_where_it_says(monkeypatch):
    """χ² of the worse pose beside the better, from residuals of both as OpenCV's IPPE finds them."""
    corners = mirrored_case(1.6)
    K, d = CAMERA.intrinsics.K, np.array([-0.2, 0.05, 0, 0])
    _, turns, places, _ = cv2.solvePnPGeneric(CHESS.corners, corners.corners[0], K, d, flags=cv2.SOLVEPNP_IPPE)
    squares = []
    for turn, place in zip(turns, places, strict=True):
        turn, place = cv2.solvePnPRefineLM(CHESS.corners, corners.corners[0], K, d, turn, place)
        uv = cv2.projectPoints(CHESS.corners, turn, place, K, d)[0].reshape(-1, 2)
        squares.append(float(np.sum((uv - corners.corners[0]) ** 2)))
    gained = (max(squares) - min(squares)) / (min(squares) / (108 - 6))
    assert gained > 1
    monkeypatch.setattr(module, "SURE", 0.98 * gained)
    assert find_poses(CAMERA, CHESS, corners).names == ("0.png",)
    monkeypatch.setattr(module, "SURE", 1.02 * gained)
    with pytest.raises(NoPose):
        find_poses(CAMERA, CHESS, corners)


def test_a_stray_corner_is_set_aside_and_a_picture_that_fits_no_pose_is_refused():
    rng = np.random.default_rng(7)
    truth = spread_boards(rng, (CAMERA,), CHESS, 8, (15, 40))
    corners = seen(truth, rng, 0.1)
    corners.corners[2, 11] += 30
    corners.corners[5] = rng.permutation(corners.corners[5])
    found = find_poses(CAMERA, CHESS, corners)
    assert dict(found.refused)["5.png"] == "its 54 corners do not fit one pose of the board before this camera"
    assert found.corners[2] == 53
    assert np.abs(in_sigmas(found, truth)).max() < 5


def test_the_ruler_tells_the_paper():
    """A4 on Letter is 279.4/297 as large, Letter on A4 210/215.9."""
    assert as_printed(CHESS, 94.1).square_size == pytest.approx(0.025 * 0.941)
    assert as_printed(TAGS, 94.1).marker_size == pytest.approx(0.019 * 0.941)
    for length, said in (
        (94.1, "made for A4 and fitted to Letter, and its squares are 23.53 mm"),
        (97.3, "made for Letter and fitted to A4, and its squares are 24.32 mm"),
        (100.3, "it was printed at true scale"),
        (96.0, "it was not printed at 100 %, and its squares are 24 mm"),
    ):
        assert said in told_by_ruler(CHESS, length)
    for near, other in ((94.4, 94.5), (93.8, 93.6)):
        assert "fitted to Letter" in told_by_ruler(CHESS, near)
        assert "not printed at 100 %" in told_by_ruler(CHESS, other)


# The command ---------------------------------------------------------------------------------------------------------


@pytest.fixture(scope="module")
def photos(tmp_path_factory):
    """A camera, and four photographs of tags from places that are known."""
    folder, rng = tmp_path_factory.mktemp("photos"), np.random.default_rng(8)
    truth = spread_boards(rng, (CAMERA,), TAGS, 4, (15, 40))
    for number, pose in enumerate(truth):
        cv2.imwrite(str(folder / f"{number}.png"), snapshot(CAMERA, TAGS, pose, rng, 4))
    return folder, truth


@pytest.fixture
def words(photos, room):
    write(Calibration({"camera": CAMERA}, room, "virtual"), room / "camera.yaml", "opencv")
    return ("poses", "camera.yaml", str(photos[0]), *OPTIONS)


def test_a_table_and_a_tree_say_where_the_camera_stood(words, photos, room, capsys):
    assert main(words) == 0
    assert "4 pictures have a pose; their corners are 0.0" in capsys.readouterr().out
    assert main((*words, "-o", "poses.json")) == 0
    with (room / "poses.csv").open(encoding="utf-8") as file:
        rows = list(csv.DictReader(file))
    tree = json.loads((room / "poses.json").read_text(encoding="utf-8"))
    for row, each, pose in zip(rows, tree["pictures"], photos[1], strict=True):
        place = np.array([float(row[key]) for key in ("x_m", "y_m", "z_m")])
        sigma = np.array([float(row[f"sigma_{axis}_m"]) for axis in "xyz"])
        assert (np.abs(place - pose.inv().translation) < 5 * sigma).all()
        assert (sigma < 0.001).all()
        turn = Rotation.from_quat([float(row[key]) for key in ("qx", "qy", "qz", "qw")])
        assert (turn * pose.rotation).magnitude() < 0.003
        matrix = np.array(each["board_from_cam"])
        assert matrix[:3, 3] == pytest.approx(place)
        assert np.allclose(matrix @ each["cam_from_board"], np.eye(4))
        assert each["sigma_m"] == pytest.approx(sigma)
        assert np.sqrt(np.diag(each["covariance"])[:3]) == pytest.approx(np.radians(each["sigma_deg"]))
        assert each["picture"] == row["picture"]


def test_chessboards_are_found_at_their_saddle_points_unless_another_finder_is_named(room):
    rng = np.random.default_rng(9)
    pose = spread_boards(rng, (CAMERA,), CHESS, 1, (25, 25))[0]
    picture = snapshot(CAMERA, CHESS, pose, rng, 3)
    cv2.imwrite(str(room / "0.png"), picture)
    write(Calibration({"camera": CAMERA}, room, "virtual"), room / "camera.yaml", "opencv")
    command = ("poses", "camera.yaml", "0.png", "--board", "9x6", "--square-mm", "25", "-o", "poses.json")
    for finder, more in (("saddles", ()), ("sectors", ("--finder", "sectors"))):
        assert main((*command, *more)) == 0
        there = json.loads((room / "poses.json").read_text(encoding="utf-8"))["pictures"][0]["board_from_cam"]
        expected = find_poses(CAMERA, CHESS, detections([find_corners(picture, CHESS, finder)])).board_from_cam
        assert np.array(there) == pytest.approx(expected.as_matrix()[0], abs=1e-8)


def test_the_ruler_scales_the_places(words, room):
    assert main(words) == main((*words, "--ruler-mm", "94.1", "-o", "other.csv")) == 0
    first, second = (
        np.genfromtxt(room / name, delimiter=",", skip_header=1)[:, 1:4] for name in ("poses.csv", "other.csv")
    )
    assert second == pytest.approx(0.941 * first, rel=1e-6)


def test_bad_input_is_one_sentence_and_leaves_nothing_behind(words, photos, room, capsys):
    (room / "bad.jpg").write_bytes(b"\xff\xd8\xff")
    assert "ends in .csv or .json" in refused(capsys, room, *words, "-o", "poses.txt")
    assert "say which board" in refused(capsys, room, *words[:3])
    assert "none of the pictures can be used" in refused(capsys, room, *words[:2], "bad.jpg", *OPTIONS)
    assert "there is no such picture" in refused(capsys, room, *words[:2], "none", *OPTIONS)
    assert "from 50 to 200" in refused(capsys, room, *words, "--ruler-mm", "10")
    text = (room / "camera.yaml").read_text(encoding="utf-8").replace("640", "650")
    (room / "larger.yaml").write_text(text, encoding="utf-8")
    larger = refused(capsys, room, "poses", "larger.yaml", *words[2:])
    assert "have 640×480 pixels, the calibration has 650×480" in larger
