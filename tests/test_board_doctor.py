"""The board doctor names what of a board is not as described, with the option that mends it, and nothing else."""

import threading
from dataclasses import replace

import cv2
import numpy as np
import pytest

from camviz_clinic.calibration import Board, CannotCalibrate, detect, find_corners
from camviz_clinic.calibration.boards.charuco import detector
from camviz_clinic.calibration.boards.picture import whiteness
from camviz_clinic.calibration.paper import fitted, pdf
from camviz_clinic.checks.doctor import Shown, diagnose, prescription, troubles
from camviz_clinic.checks.doctor.layout import likeliest, steps_of
from camviz_clinic.checks.doctor.symmetry import turned_views
from camviz_clinic.checks.findings.described import CHARUCO, smooth
from camviz_clinic.checks.snapshots import pictured
from camviz_clinic.checks.virtual import detections, pair
from camviz_clinic.commands.command import main
from camviz_clinic.files import Calibration, load, write

PRINTED = {
    "legacy": replace(CHARUCO, legacy=True),
    "border": replace(CHARUCO, border_bits=2),
    "first": replace(CHARUCO, first_id=7),
    "all": replace(CHARUCO, legacy=True, border_bits=2, first_id=3),
}
WORDS = ["--square-mm", "35", "--charuco", "4X4_50", "--marker-mm", "26"]


@pytest.fixture(scope="module")
def seen():
    """Two pictures of each board."""
    boards = {"plain": CHARUCO, **PRINTED}
    return {name: pictured(np.random.default_rng(4), board, 2) for name, board in boards.items()}


@pytest.mark.parametrize("name", PRINTED)
def test_a_board_is_drawn_as_opencv_draws_it(name):
    """But for the pixels along edges, which OpenCV rounds."""
    board = PRINTED[name]
    size = ((board.columns + 1) * 40, (board.rows + 1) * 40)
    theirs = detector(board).getBoard().generateImage(size, None, 0, board.border_bits)
    ours, other = (abs(whiteness(each, 40) - theirs / 255).mean() for each in (board, CHARUCO))
    assert ours < 0.03
    assert other > 2 * ours


@pytest.mark.parametrize(
    ("printed", "described", "options"),
    [
        ("legacy", {"legacy": False}, "--legacy"),
        ("plain", {"legacy": True}, "without --legacy"),
        ("border", {"border_bits": 1}, "--border-bits 2"),
        ("first", {"first_id": 0}, "--first-id 7"),
        ("plain", {"first_id": 7}, "--first-id 0"),
        ("plain", {"columns": 5, "rows": 6}, "--board 6x5"),
        ("all", {"legacy": False, "border_bits": 1, "first_id": 0}, "--border-bits 2 --first-id 3 --legacy"),
    ],
)
def test_what_is_not_as_described_is_named_with_the_option_that_mends_it(seen, printed, described, options):
    board = replace(seen[printed].board, **described)
    assert prescription(diagnose(Shown(board, seen[printed].pictures))).endswith(f": try {options}.")


@pytest.mark.parametrize("printed", ["plain", *PRINTED])
def test_nothing_is_named_where_the_board_is_as_described(seen, printed):
    shown = seen[printed]
    assert diagnose(Shown(shown.board, shown.pictures)) == ()
    corners = np.array([find_corners(picture, shown.board) for picture in shown.pictures.values()])
    off = np.linalg.norm(corners - shown.corners, axis=-1)
    assert np.nanmedian(off) < 0.1
    assert np.isfinite(off).mean() > 0.7


def test_a_part_of_the_board_is_enough_and_a_strange_marker_does_not_mislead(seen):
    pictures = {name: picture.copy() for name, picture in seen["first"].pictures.items()}
    strange = cv2.aruco.generateImageMarker(cv2.aruco.getPredefinedDictionary(cv2.aruco.DICT_4X4_50), 49, 24)
    for picture in pictures.values():
        picture[:, :160] = 120
        picture[4:36, 444:476] = 255
        picture[8:32, 448:472] = strange
    assert likeliest(CHARUCO, {1: steps_of(pictures.values(), CHARUCO, 1)}) == PRINTED["first"]


def test_a_board_of_other_kinds_and_pictures_that_cannot_be_read_are_passed_over(seen, tmp_path):
    (tmp_path / "text.png").write_text("no picture")
    paths = [tmp_path / "text.png", tmp_path / "gone.png"]
    assert diagnose(Shown.of(paths, CHARUCO)) == ()
    grid = Board.aprilgrid(4, 3, 0.04, 0.3)
    assert diagnose(Shown(grid, seen["border"].pictures)) == ()
    assert not Shown(replace(CHARUCO, columns=2), {}).has_markers


def test_corners_by_a_homography_are_told_from_those_of_a_finder():
    from camviz.lenses import BrownConrady

    shown = pictured(np.random.default_rng(2), CHARUCO, 2, BrownConrady(-0.3, 0.03))
    found = np.array([find_corners(picture, CHARUCO) for picture in shown.pictures.values()])
    for corners, named in ((found, []), ([smooth(CHARUCO, each) for each in shown.corners], ["interpolated corners"])):
        solved = Calibration(
            {"camera": shown.camera},
            "here",
            "virtual",
            CHARUCO,
            {"camera": np.array(corners)},
            pictures={"camera": tuple(shown.pictures)},
        )
        assert [each.trouble for each in diagnose(Shown(CHARUCO, shown.pictures, solved))] == named


def test_views_whose_order_is_turned_are_counted_even_where_no_pair_can_be_solved():
    """Of eight views three are turned in the right camera."""
    set_up = pair(np.random.default_rng(7), views=8)
    board = Board(columns=9, rows=7, square_size=0.02)
    set_up = replace(set_up, board=board)
    left, right = set_up.observed(np.random.default_rng(8))
    right[[1, 4, 6]] = right[[1, 4, 6], ::-1]
    assert turned_views(board, set_up.cameras, (left, right)) == [1, 4, 6]
    both = (detections(set_up.cameras[0], left), detections(set_up.cameras[1], right))
    (told,) = diagnose(Shown(board, {}, both=both))
    assert "in 3 views" in told.sentence
    assert told.option == "--board 9x6"
    assert diagnose(Shown(replace(board, rows=6), {}, both=both)) == ()


@pytest.mark.parametrize(("factor", "said"), [(1000, "--square-mm 25"), (0.001, "--square-mm 25")])
def test_squares_in_metres_or_micrometres_are_a_wrong_unit(factor, said):
    set_up = pair(np.random.default_rng(3), views=6)
    set_up = replace(set_up, board=Board(columns=9, rows=6, square_size=0.025))
    solved = set_up.solved(set_up.observed(np.random.default_rng(1)), square=factor)
    (told,) = diagnose(Shown(solved.board, {}, solved))
    assert (told.trouble, told.option) == ("wrong unit", said)


def test_a_known_baseline_tells_inches_from_millimetres():
    set_up = pair(np.random.default_rng(3), views=6)
    length = float(np.linalg.norm(set_up.cameras[1].centre))
    for square, named in ((1, 0), (1 / 25.4, 1)):
        solved = set_up.solved(set_up.observed(np.random.default_rng(1)), square=square)
        told = diagnose(Shown(solved.board, {}, solved, length))
        assert len(told) == named
    assert "Inches were taken for millimetres." in told[0].sentence
    assert told[0].option == f"--square-mm {1000 * set_up.board.square_size:g}"


@pytest.mark.thorough
def test_a_search_that_does_not_end_is_ended_and_its_picture_named(tmp_path):
    """In the second picture, full of squares, the search takes 15 s; the process that takes over finds the third's."""
    board = Board(columns=9, rows=6, square_size=0.02)
    paths = [tmp_path / name for name in ("a.png", "b.png", "c.png")]
    noise = np.random.default_rng(1).integers(0, 2, (500, 700), dtype=np.uint8) * 255
    squares = cv2.resize(noise, None, fx=8, fy=8, interpolation=cv2.INTER_NEAREST)
    first, last = pictured(np.random.default_rng(4), board, 2).pictures.values()
    for path, picture in zip(paths, (first, squares, last), strict=True):
        cv2.imwrite(str(path), picture)
    threads = threading.active_count()
    found = detect(paths, board, seconds=3)
    assert found.pictures == ("a.png", "c.png")
    assert found.skipped == (("b.png", "the search for the board did not end within 3 s"),)
    assert threading.active_count() <= threads
    with pytest.raises(CannotCalibrate, match=r"did not end within 0\.2 s \(b\.png\)"):
        detect(paths[1:2], board, seconds=0.2)


# The commands --------------------------------------------------------------------------------------------------------


@pytest.fixture
def shots(seen, tmp_path, monkeypatch):
    """A folder with pictures of the legacy board."""
    monkeypatch.chdir(tmp_path)
    (tmp_path / "shots").mkdir()
    for name, picture in seen["legacy"].pictures.items():
        cv2.imwrite(str(tmp_path / "shots" / name), picture)
    return tmp_path


def test_calibrate_says_what_to_try_where_no_board_is_found(shots, capsys):
    assert main(["calibrate", "shots", "--board", "6x5", *WORDS]) == 2
    told = capsys.readouterr().err
    assert told.endswith("as OpenCV before 4.6 drew it: try --legacy.\n")
    assert told.count("try") == 1
    assert main(["calibrate", "shots", "--board", "6x5", *WORDS, "--legacy"]) == 2
    assert "at least 3 views" in capsys.readouterr().err


def test_inspect_makes_a_finding_of_it(shots, capsys):
    assert main(["inspect", "shots", "--board", "6x5", *WORDS]) == 1
    told = capsys.readouterr().out
    assert "✗ fault wrong-board: The ChArUco board has a white square at its upper left" in told
    assert "remedy: Try --legacy." in told


def test_the_options_say_which_board_it_is_and_the_file_keeps_it(shots, capsys):
    assert main(["board", "--board", "6x5", "--square-mm", "20", "--legacy", "--paper", "a4", "-o", "b.pdf"]) == 2
    assert "--legacy, --first-id and --border-bits are for a ChArUco board" in capsys.readouterr().err
    words = ["--board", "6x5", "--square-mm", "20", "--charuco", "4X4_50"]
    assert main(["board", *words, "--legacy", "--first-id", "3", "--border-bits", "2", "-o", "b.pdf"]) == 0
    board = replace(PRINTED["all"], square_size=0.02, marker_size=0.015)
    assert (shots / "b.pdf").read_bytes() == pdf(fitted(board, "a4"))
    assert main(["board", *words, "--first-id", "48", "-o", "b.pdf"]) == 2
    assert "must have the 69 markers of this board, DICT_4X4_50 has 50" in capsys.readouterr().err
    camera = pair(np.random.default_rng(1), views=1).cameras[0]
    write(Calibration({"camera": camera}, "", "", board), shots / "camera.yml", "opencv")
    assert load(shots / "camera.yml").board == board


def test_every_trouble_says_what_it_comes_from():
    assert len(troubles()) == 7
    assert all(each.cause and each.cause[0].islower() and not each.cause.endswith(".") for each in troubles().values())


def test_a_board_without_markers_has_none_of_their_fields():
    with pytest.raises(ValueError, match="must be left out of all boards but a ChArUco board"):
        Board(columns=9, rows=6, square_size=0.025, legacy=True)
