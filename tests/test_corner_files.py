"""Corners that other programs found are read as they are, or refused in one sentence that names file and line."""

import re
from dataclasses import replace
from pathlib import Path
from runpy import run_path

import cv2
import numpy as np
import pytest
from commandline import refused
from hypothesis import given, settings
from hypothesis import strategies as st
from test_calibrate_command import main_captured
from test_files import sample
from test_files_fuzzed import overwritten, reworded

import camviz_clinic
from camviz_clinic.calibration import Board, calibrate, calibrate_pair, detect
from camviz_clinic.calibration.boards.charuco import FEWEST
from camviz_clinic.checks.virtual import detections, pair, single
from camviz_clinic.commands.command import main
from camviz_clinic.files import CalibrationError
from camviz_clinic.files.corners import corner_formats, load_corners
from camviz_clinic.files.writing import write

PAGE = Path(__file__).parents[1] / "docs" / "formats.md"
GIVEN = {"shape": (4, 3), "square_size": 0.04, "size": (640, 480)}  # what the examples show
ROW, COLUMN = np.divmod(np.arange(12), 4)


def corner(view):
    """Where the examples have the corners of a view, (12, 2)."""
    return np.column_stack([100 + 40 * COLUMN + 7 * view, 90 + 41 * ROW - 3 * view * COLUMN])


def written(folder, files):
    """Files in a folder."""
    paths = [folder / name for name in files]
    for path, content in zip(paths, files.values(), strict=True):
        path.write_bytes(content if isinstance(content, bytes) else content.encode())
    return paths


def vnl(found, corners, *, skip=()):
    """A .vnl of corners (views, corners, 2); those to `skip`, by (view, corner), have no coordinates."""
    lines = ["# filename x y level"]
    for view, name in enumerate(found):
        for place, (u, v) in enumerate(corners[view]):
            lines.append(f"{name} - - -" if (view, place) in skip else f"{name} {u!r} {v!r} 0")
    return re.sub(r"np\.float64\((.*?)\)", r"\1", "\n".join(lines) + "\n")


# What every format must do ------------------------------------------------------------------------------------------


@pytest.mark.parametrize("name", corner_formats())
def test_the_example_of_a_format_has_the_same_corners_in_the_order_of_the_board(name, tmp_path):
    found = load_corners(written(tmp_path, corner_formats()[name].example), **GIVEN)
    assert found.board == Board(4, 3, 0.04)
    assert [Path(picture).stem for picture in found.detections.pictures] == ["view0", "view1", "view2"]
    assert (found.detections.width, found.detections.height) == (640, 480)
    np.testing.assert_allclose(found.detections.corners, [corner(view) for view in range(3)], atol=1e-9)


@pytest.mark.parametrize("name", corner_formats())
def test_each_format_knows_its_own_files_alone(name, tmp_path):
    from camviz_clinic.files.corners import CornerFile

    for path in written(tmp_path, corner_formats()[name].example):
        assert [each.name for each in corner_formats().values() if each.recognise(CornerFile(path))] == [name]


def test_the_documentations_table_is_made_from_the_formats():
    text = PAGE.read_text(encoding="utf-8")
    renewed = run_path(str(PAGE.parents[1] / "tools/docs/formats.py"))["renewed"]
    assert renewed(text.replace("| mrcal's corners.vnl |", "| old |")) == text


@pytest.mark.parametrize("words", [["calibrate"], ["inspect"]])
def test_the_help_lists_every_format(words, capsys):
    with pytest.raises(SystemExit):
        main([*words, "--help"])
    listed = capsys.readouterr().out.split("corners:\n")[1].split("\n\n")[0]
    assert [line.strip() for line in listed.splitlines()] == [each.title for each in corner_formats().values()]


@pytest.mark.parametrize("name", corner_formats())
@settings.get_profile("damage")
@given(data=st.data())
def test_whatever_is_done_to_a_file_it_is_read_or_refused_in_one_sentence(tmp_path_factory, name, data):
    example = dict(corner_formats()[name].example)
    spoilt = data.draw(st.sampled_from(sorted(example)))
    damage = data.draw(st.sampled_from([overwritten, reworded, lambda data, text: text[: len(text) // 2]]))
    example[spoilt] = damage(data, example[spoilt])
    folder = tmp_path_factory.mktemp("fuzz")
    try:
        found = load_corners(written(folder, example), **GIVEN)
    except CalibrationError as error:
        said, known = str(error), np.empty(0)
    else:
        said, known = str(folder), found.detections.corners[np.isfinite(found.detections.corners)]
    assert said.startswith(str(folder))
    assert "\n" not in said
    assert ((known >= -2) & (known <= 641)).all()


# What comes of them -------------------------------------------------------------------------------------------------


@pytest.fixture(scope="module")
def virtual():
    """A virtual camera, and its corners with noise."""
    rng = np.random.default_rng(5)
    set_up = single(rng, views=8)
    return set_up, set_up.observed(rng)[0]


def options(set_up):
    board, grid = set_up.board, set_up.camera.intrinsics
    return {
        "shape": (board.columns, board.rows),
        "square_size": board.square_size,
        "size": (grid.width, grid.height),
    }


def test_a_vnl_is_solved_as_its_corners_are(virtual, tmp_path):
    """The numbers are written with all their digits; the solution is the same but for the order of sums."""
    set_up, corners = virtual
    found = detections(set_up.camera, corners)
    (path,) = written(tmp_path, {"corners.vnl": vnl(found.pictures, corners)})
    read = load_corners([path], **options(set_up))
    np.testing.assert_array_equal(read.detections.corners, corners)
    ours, theirs = (calibrate(each, set_up.board).cameras["camera"] for each in (read.detections, found))
    np.testing.assert_allclose(ours.intrinsics.K, theirs.intrinsics.K, rtol=1e-9)
    for name in ours.lens.parameters():
        assert getattr(ours.lens, name) == pytest.approx(getattr(theirs.lens, name), abs=1e-9)


def test_corners_that_were_not_seen_are_left_out_and_the_camera_is_the_same(virtual, tmp_path):
    """A third of the corners is missing at random; one view keeps a row alone, another five corners, a third none."""
    set_up, corners = virtual
    columns, count = set_up.board.columns, corners.shape[1]
    gone = np.random.default_rng(1).random(corners.shape[:2]) < 1 / 3
    gone[0], gone[1], gone[2] = np.arange(count) >= columns, np.arange(count) >= FEWEST - 1, True
    skip = {tuple(map(int, place)) for place in np.argwhere(gone)}
    names = detections(set_up.camera, corners).pictures
    (path,) = written(tmp_path, {"corners.vnl": vnl(names, corners, skip=skip)})
    read = load_corners([path], **options(set_up))
    assert dict(read.detections.skipped) == {
        names[0]: "its corners lie on one line of the board",
        names[1]: "5 of its corners are known, 6 are needed",
        names[2]: "none of its corners are known, 6 are needed",
    }
    assert read.detections.places == tuple(range(3, 8))
    np.testing.assert_array_equal(np.isnan(read.detections.corners[..., 0]), gone[3:])
    solved = calibrate(read.detections, set_up.board, fixed=("k3",))
    sigma = np.sqrt(np.diag(solved.intrinsics_covariance["camera"]))[0]
    assert abs(solved.cameras["camera"].intrinsics.fx - set_up.camera.intrinsics.fx) < 4 * sigma


@pytest.fixture(scope="module")
def two():
    """A virtual pair, and the corners of both cameras with noise."""
    rng = np.random.default_rng(7)
    set_up = pair(rng, views=8)
    return set_up, set_up.observed(rng)


@pytest.fixture
def one_thread():
    """OpenCV adds up in one order, and not in that of its threads."""
    threads = cv2.getNumThreads()
    cv2.setNumThreads(1)
    yield
    cv2.setNumThreads(threads)


def pair_words(set_up, left="left.vnl", right="right.vnl"):
    board, grid = set_up.board, set_up.camera.intrinsics
    words = f"calibrate --corners {left} --right {right} --board {board.columns}x{board.rows} "
    return [*words.split(), "--square-mm", repr(1000 * board.square_size), "--size", f"{grid.width}x{grid.height}"]


def test_a_pair_is_solved_from_two_files_as_from_the_same_corners(two, room, capsys, one_thread):
    """To the last digit. The right file has its views in another order, one too few, and one of no partner's number."""
    set_up, (left, right) = two
    shuffled = [6, 2, 0, 7, 3, 5, 1]  # without view 4
    written(room, {"left.vnl": vnl([f"left{view:02}.png" for view in range(8)], left)})
    written(
        room,
        {"right.vnl": vnl([*(f"right{view}.png" for view in shuffled), "right9.png"], [*right[shuffled], right[4]])},
    )
    assert main(pair_words(set_up)) == 0
    out = capsys.readouterr().out
    assert "left04.png: skipped, it has no partner among the pictures of the right camera." in out
    assert "right9.png: skipped, it has no partner among the pictures of the left camera." in out
    ours, kept = camviz_clinic.load("camera.yaml"), [0, 1, 2, 3, 5, 6, 7]
    both = zip(set_up.cameras, (left, right), strict=True)
    seen = [detections(camera, np.ascontiguousarray(each[kept])) for camera, each in both]
    solved = calibrate_pair(*seen, replace(set_up.board, square_size=1000 * set_up.board.square_size / 1000))
    write(solved, room / "theirs.yaml", "opencv")
    theirs = camviz_clinic.load("theirs.yaml")
    for name in ("left", "right"):
        np.testing.assert_array_equal(ours.cameras[name].intrinsics.K, theirs.cameras[name].intrinsics.K)
        assert ours.cameras[name].lens == theirs.cameras[name].lens
        np.testing.assert_array_equal(ours.detections[name], theirs.detections[name])
    np.testing.assert_array_equal(ours.cameras["right"].centre, theirs.cameras["right"].centre)
    assert ours.pictures["right"] == tuple(f"right{view}.png" for view in kept)


def test_views_whose_names_do_not_tell_their_partners_are_refused(two, room, capsys):
    """There are as many of one camera as of the other; pictures would be paired by their order, corners are not."""
    set_up, (left, right) = two
    letters = "abcdefgh"
    written(room, {"left.vnl": vnl([f"{each}.png" for each in letters], left)})
    written(room, {"right.vnl": vnl([f"r{each}.png" for each in letters], right)})
    assert "their names do not tell the pairs" in refused(capsys, room, *pair_words(set_up))


def test_two_files_of_other_boards_are_no_pair(room, capsys):
    for folder, side in (("one", b"40"), ("two", b"50")):
        (room / folder).mkdir()
        example = corner_formats()["babelcalib"].example
        scale = int(side) / 40
        lines = example["board.dsc"].decode().splitlines()
        board = [lines[0].replace("40", side.decode()), lines[1]]
        for line in lines[2:]:
            tag, column, row, *place = line.split(",")
            board.append(",".join([tag, column, row, *(f"{scale * float(each):g}" for each in place)]))
        written(room / folder, {**example, "board.dsc": "\n".join(board)})
    said = refused(capsys, room, "calibrate", "--corners", "one", "--right", "two")
    assert "two: expected the board of one (4×3 inner corners, 40 mm apart), got 4×3 inner corners, 50 mm apart" in said


def test_the_photographs_and_their_corners_in_a_file_give_the_same_camera(room, capsys):
    """Every other one of OpenCV's photographs; the pictures' size is that of the picture that the file names."""
    paths = sorted(sample("left01.jpg").parent.glob("left*.jpg"))[::2]
    found = detect(paths, Board(9, 6, 0.025))
    written(room, {"left.vnl": vnl([str(path) for path in paths], found.corners)})
    assert main(["calibrate", "--corners", "left.vnl", "--board", "9x6", "--square-mm", "25"]) == 0
    ours, theirs = camviz_clinic.load("camera.yaml"), calibrate(found, Board(9, 6, 0.025), board_warp="auto")
    K = theirs.cameras["camera"].intrinsics.K
    np.testing.assert_allclose(ours.cameras["camera"].intrinsics.K, K, rtol=1e-8)
    np.testing.assert_array_equal(ours.set_aside["camera"], theirs.set_aside["camera"])
    capsys.readouterr()
    words = ["--corners", "left.vnl", "--board", "9x6", "--square-mm", "25"]
    assert main(["inspect", str(sample("left_intrinsics.yml")), *words]) in (0, 1)
    assert "7 of 7 pictures used" in capsys.readouterr().out


def test_the_three_tables_say_the_same(tmp_path):
    """By row and column, by number, and by place in millimetres or in metres."""
    heads = {
        "image,row,column,u,v": lambda i: f"{ROW[i]},{COLUMN[i]}",
        "image,index,u,v": lambda i: f"{i}",
        "image,X,Y,Z,u,v": lambda i: f"{40 * COLUMN[i]},{40 * ROW[i]},0",
        "v,u,image,z,y,x": None,
    }
    for head, place in heads.items():
        lines = [head.replace("image,", "image, ")]
        for view in range(3):
            for i, (u, v) in enumerate(corner(view)):
                last = f"{v},{u},a{view},0,{0.04 * ROW[i]},{0.04 * COLUMN[i]}"
                lines.append(last if place is None else f"a{view},{place(i)},{u},{v}")
        (path,) = written(tmp_path, {"corners.csv": "\n".join(lines)})
        said = {**GIVEN, "shape": None if "index" not in head else (4, 3)}
        found = load_corners([path], **said | ({"square_size": None} if place is None else {}))
        assert found.board.square_size == pytest.approx(0.04)
        assert (found.board.columns, found.board.rows) == (4, 3)
        np.testing.assert_allclose(found.detections.corners, [corner(view) for view in range(3)])


def test_the_planes_of_a_target_are_views_of_their_own(tmp_path):
    """Two boards in one picture; Y of the .dsc is up, so its last row is our first."""
    files = dict(corner_formats()["babelcalib"].example)
    second = files["board.dsc"].replace(b"0,4,5,40", b"3,4,5,40")
    head = b"filename: cube.pgm\nwidth: 640\nheight: 480\nnum_corners: 24\nencoding: ascii\n"
    body = files["view0.orpc"].split(b"ascii\n")[1]
    cube = head + body + re.sub(rb"(?m)^0,", b"3,", body)
    files = {"board.dsc": files["board.dsc"] + second, "cube.orpc": cube, "board.tp": b"0\n1 0 0 0"}
    found = load_corners(written(tmp_path, files))
    assert found.detections.pictures == ("cube.pgm board 0", "cube.pgm board 3")
    np.testing.assert_allclose(found.detections.corners, [corner(0), corner(0)])
    assert load_corners([tmp_path]).detections.pictures == found.detections.pictures  # the folder of them


def test_reduced_levels_are_said_and_negative_ones_were_not_seen(tmp_path):
    text = corner_formats()["mrcal"].example["corners.vnl"].decode()
    text = text.replace("180.000 90.000 0", "180.000 90.000 2").replace("140.000 90.000 0", "140.000 90.000 -1")
    found = load_corners(written(tmp_path, {"corners.vnl": text}), **GIVEN)
    assert found.notes == ("1 corners were found in reduced pictures (level 1 and up); here all corners count alike.",)
    assert np.argwhere(np.isnan(found.detections.corners[..., 0])).tolist() == [[0, 1]]


def test_the_size_is_that_of_a_picture_the_file_names(tmp_path):
    (path,) = written(tmp_path, corner_formats()["mrcal"].example)
    said = GIVEN | {"size": None}
    with pytest.raises(CalibrationError, match="it does not hold the size of the pictures"):
        load_corners([path], **said)
    cv2.imwrite(str(tmp_path / "view1.png"), np.zeros((500, 700), np.uint8))
    assert load_corners([path], **said).detections.width == 700


# What is refused ----------------------------------------------------------------------------------------------------

VNL, CSV, ORPC, DSC = (
    corner_formats()[name].example[file].decode()
    for name, file in (
        ("mrcal", "corners.vnl"),
        ("csv", "corners.csv"),
        ("babelcalib", "view0.orpc"),
        ("babelcalib", "board.dsc"),
    )
)
REFUSED = [
    (VNL.replace("view1.png 107", "view1.png x107", 1), "line 14: expected x as a number, or - where"),
    (VNL.replace("view1.png 107.000 90.000 0\n", "", 1), "line 25: expected 12 lines for 'view1.png'"),
    (VNL + "view0.png 1 2 0\n", "line 39: expected the corners of 'view0.png' together, it comes again"),
    (VNL.replace("107.000", "907.000", 1), "line 14: expected a corner inside a picture of 640×480"),
    (VNL.replace("107.000 90.000 0", "107", 1), "line 14: expected filename x y, perhaps with a level, got"),
    ("# filename x y\n", "expected a line for each corner, there are none"),
    (CSV + "view0.png,2,3,5,6\n", "line 38: expected each corner once, 'view0.png' has row 2, column 3 in line 13"),
    (CSV + "v,3,0,5,6\n", "line 38: expected a corner of a board of 4×3 inner corners, got row 3, column 0"),
    (CSV + "view0,1.5,0,5,6\n", "line 38: expected row as a whole number from 0 to 999, got '1.5'"),
    (CSV + "view0,1,0,5\n", "line 38: expected 5 values as in the header, got 4"),
    (CSV.replace("row,", "rows,"), "line 1: expected one of the headers image,row,column,u,v or"),
    ("image,X,Y,Z,u,v\na,0,0,0,1,1\na,1,0,0,1,1\na,0.3,0.5,0,1,1\n", "line 3: expected X and Y on a grid"),
    ("image,X,Y,Z,u,v\na,0,0,1,1,1\n", "line 2: expected a flat board with Z = 0, got Z = 1"),
    (ORPC.replace("0,3,1", "0,12,1"), "line 9: expected a corner from 0 to 11 of board 0, got 12"),
    (ORPC.replace("num_corners: 12", "num_corners: 13"), "line 4: expected 13 lines of corners"),
    (ORPC.replace("ascii", "binary"), "line 5: expected encoding: ascii, got 'binary'"),
    (DSC, "expected the .orpc files with the corners too, this holds none"),
    ("nothing of the kind", "line 1: expected BabelCalib's .orpc with a .dsc, a table"),
    ("", "expected corners, the file is empty"),
    (b"\x89PNG", "expected corners as text, this is a PNG picture"),
]


@pytest.mark.parametrize(("content", "said"), REFUSED)
def test_what_cannot_be_is_refused_with_its_line(tmp_path, content, said):
    (path,) = written(tmp_path, {"corners": content})
    with pytest.raises(CalibrationError) as caught:
        load_corners([path], **GIVEN)
    assert str(caught.value).startswith(f"{path}: {said}")


@pytest.mark.parametrize(
    ("board", "said"),
    [
        (DSC.replace("0,4,5,40", "0,4,0,40"), "line 1: expected a board of squares, this is one of triangles"),
        (DSC.replace("-1,3,2,16,12,0", "-1,3,2,16.1,12,0"), "line 6: expected a corner on a flat grid"),
        (DSC + DSC, "line 28: expected each board once, board 0 comes again"),
        (DSC.replace("0,4,5,40", "0,5,5,40"), "line 1: expected 16 corners of board 0 below, got 12"),
    ],
)
def test_a_board_that_cannot_be_is_refused_with_its_line(tmp_path, board, said):
    paths = written(tmp_path, {"board.dsc": board, "view0.orpc": ORPC})
    with pytest.raises(CalibrationError) as caught:
        load_corners(paths)
    assert str(caught.value).startswith(f"{paths[0]}: {said}")


def test_a_board_counted_otherwise_is_refused_with_the_right_one(virtual, tmp_path):
    set_up, corners = virtual
    columns, rows = set_up.board.columns, set_up.board.rows
    (path,) = written(tmp_path, {"corners.vnl": vnl(detections(set_up.camera, corners).pictures, corners)})
    with pytest.raises(CalibrationError, match=f"they lie in rows of {columns}: give --board {columns}x{rows}$"):
        load_corners([path], **options(set_up) | {"shape": (rows, columns)})


@pytest.mark.parametrize(
    ("words", "said"),
    [
        ([], "the following arguments are required: IMAGES, --board, --square-mm"),
        (["--corners", "view0.orpc", "board.dsc", "--right", "b.vnl"], "b.vnl: there is no such file"),
        (["a.png", "--board", "9x6", "--square-mm", "25", "--size", "9x9"], "--size is for --corners"),
        (["--corners", "gone.vnl"], "gone.vnl: there is no such file"),
        (["--corners", "empty"], "there are no .orpc or .dsc files in this folder"),
        (["--corners", "corners.vnl"], "it does not hold the board's inner corners: give --board"),
        (["--corners", "corners.vnl", "--board", "4x3"], "it does not hold the board's side of a square"),
        (["--corners", "board.dsc", "view0.orpc", "--board", "3x4"], "inner corners as 4×3, and --board says 3×4"),
        (["--corners", "view0.orpc", "corners.vnl"], "corners.vnl: expected BabelCalib's .orpc"),
        (["--corners", "corners.vnl", "-o", "corners.vnl"], "this would overwrite corners.vnl"),
    ],
)
def test_a_command_that_lacks_something_says_what(room, words, said):
    written(room, {"corners.vnl": VNL, "board.dsc": DSC, "view0.orpc": ORPC})
    (room / "empty").mkdir()
    result = main_captured(["calibrate", *words])
    assert said in result.err
    assert (result.status, result.out, result.err.count("\n")) == (2, "", 1)


def test_corners_in_a_file_take_the_place_of_those_that_a_calibration_holds(room, virtual, capsys):
    """Eight views, of which some corners were set aside, are inspected with three views of the same camera."""
    set_up, corners = virtual
    spoilt = corners.copy()
    spoilt[2, :4] += 30
    camviz_clinic.files.write(set_up.solved((spoilt,)), Path("camera.yaml"), "opencv")
    names = detections(set_up.camera, corners).pictures[:3]
    written(room, {"corners.vnl": vnl(names, corners)})
    said = options(set_up)
    words = ["--board", "x".join(map(str, said["shape"])), "--square-mm", f"{1000 * said['square_size']:g}"]
    assert main(["inspect", "camera.yaml", "--corners", "corners.vnl", *words]) in (0, 1)
    out = capsys.readouterr().out
    assert "3 of 3 pictures used" in out
    assert "note corners-set-aside" not in out
    written(room, {"board.dsc": DSC, "view0.orpc": ORPC})
    result = main_captured(["inspect", "camera.yaml", "--corners", "board.dsc", "view0.orpc"])
    grid = set_up.camera.intrinsics
    assert result.err == (
        "camviz: board.dsc: these corners are of pictures of 640×480 pixels, and the calibration is for "
        f"{grid.width}×{grid.height}.\n"
    )


def test_corners_are_for_one_camera_alone(room):
    written(room, {"corners.vnl": VNL})
    pair = Path(__file__).parent / "data" / "opencv_stereo.xml"
    result = main_captured(["inspect", str(pair), "--corners", "corners.vnl"])
    assert (result.status, result.err) == (2, "camviz: --corners is for a calibration of one camera, this has 2.\n")
