"""Boards of every kind: rendered, printed and found again; Kalibr's AprilGrid as Kalibr prints it."""

from dataclasses import replace

import cv2
import numpy as np
import pytest

from camviz.cameras import Camera, Intrinsics
from camviz.lenses import BrownConrady
from camviz.poses import RigidTransform, Rotation
from camviz_clinic.calibration import Board, Detections, calibrate, chessboards, detect, find_corners
from camviz_clinic.calibration.boards import kinds, markers
from camviz_clinic.calibration.boards.picture import whiteness
from camviz_clinic.calibration.chessboards import everywhere
from camviz_clinic.calibration.circle_grids import bias
from camviz_clinic.calibration.paper import black_discs, black_parts, fitted, pdf
from camviz_clinic.checks.photographs import photographed
from camviz_clinic.checks.virtual import spread_boards
from camviz_clinic.commands.command import main
from camviz_clinic.files import Calibration, CalibrationError, load, write
from camviz_clinic.files.target import read_target
from camviz_clinic.meshes import board as mesh
from camviz_clinic.rigs.start import board_poses
from camviz_clinic.views.chessboard import outline, printed

CAMERA = Camera(Intrinsics.from_fov(480, 360, 60), BrownConrady(-0.2, 0.05))
BOARDS = {
    "chessboard": Board(8, 5, 0.028),
    "charuco": Board(6, 4, 0.035, 0.026, "DICT_4X4_50"),
    "aprilgrid": Board.aprilgrid(4, 3, 0.04, 0.3),
    "circles": Board(7, 5, 0.03, kind="circles"),
    "asymmetric-circles": Board(4, 9, 0.02, kind="asymmetric-circles"),
    "markers": Board.marker_grid(4, 3, 0.04, "DICT_4X4_50"),
}
POSE = RigidTransform.from_components([-0.09, -0.05, 0.36], Rotation.from_rotvec([0.35, -0.3, 0.1]))


def off(board, pose, picture=None):
    """How far each point that was found is from the truth, in pixels; NaN for the others."""
    found = find_corners(photographed(CAMERA, board, pose) if picture is None else picture, board)
    assert found is not None
    return np.linalg.norm(found - CAMERA.project(pose.apply(board.corners)), axis=1)


def test_every_kind_has_a_board_here():
    assert set(BOARDS) == set(kinds())


@pytest.mark.parametrize("kind", BOARDS)
def test_the_points_of_a_tilted_board_are_found_within_a_tenth_of_a_pixel(kind):
    board = BOARDS[kind]
    distances = off(board, POSE)
    assert np.isfinite(distances).mean() > 0.8
    assert np.nanquantile(distances, 0.9) < 0.1
    assert np.nanmax(distances) < 0.15
    assert np.nanmedian(distances) < 0.05


@pytest.mark.parametrize("kind", BOARDS)
def test_a_printed_board_measures_what_it_says(kind):
    """Its points lie where black rectangles or discs have their corners or middles, as the paper has them."""
    board = BOARDS[kind]
    left, top = board.area[:2]
    points = 1000 * (board.corners[:, :2] - [left, top])
    x, y, wide, high = black_parts(board).T
    ends = np.concatenate([np.stack(each, -1) for each in ((x, y), (x + wide, y), (x, y + high), (x + wide, y + high))])
    ends = np.concatenate([ends, black_discs(board)[:, :2]])
    assert np.linalg.norm(points[:, None] - ends, axis=-1).min(axis=1).max() < 1e-9
    document = pdf(fitted(board, "a3"))
    words = b"\n".join(bytes.fromhex(line.split(b"<")[1].split(b">")[0].decode()) for line in document.split(b"\n")
                       if line.startswith(b"BT"))  # fmt: skip
    assert kinds()[kind].options(board).encode() in words


def test_kalibrs_tag_0_is_at_the_lower_left_with_the_bits_that_kalibr_prints():
    """Code 0xd5d628584 of 36h11: its bits from the lowest, row by row from the lower right corner, 1 is white."""
    board = Board.aprilgrid(3, 2, 0.1, 0.3)
    cells = whiteness(board, 13)  # one texel to a cell of a tag, three to the gap
    tag = cells[3 + 13 : 3 + 13 + 10, 3:13]
    assert not tag[:2].any()
    assert not tag[:, -2:].any()
    bits = np.rint(tag[2:8, 2:8]).astype(int)
    code = sum(int(bit) << place for place, bit in enumerate(bits[::-1, ::-1].ravel()))
    assert code == 0xD5D628584


def test_a_charuco_board_printed_white_on_black_is_found_as_well():
    """caliscope prints it so, to save ink; four real films of such a board showed it."""
    picture = 255 - photographed(CAMERA, BOARDS["charuco"], POSE)
    distances = off(BOARDS["charuco"], POSE, picture)
    assert np.isfinite(distances).mean() > 0.8
    assert np.nanmax(distances) < 0.15


def test_a_part_of_an_aprilgrid_is_enough():
    board = BOARDS["aprilgrid"]
    picture = photographed(CAMERA, board, POSE)
    picture[:, 250:] = 120
    distances = off(board, POSE, picture).reshape(6, 8)
    assert np.isfinite(distances[:, :2]).all()
    assert np.isnan(distances[:, -2:]).all()
    assert np.nanmax(distances) < 0.1


def test_an_aprilgrid_upside_down_is_read_in_its_own_order():
    turned = POSE * RigidTransform.from_components([0.18, 0.13, 0], Rotation.from_rotvec([0, 0, np.pi]))
    assert np.nanmax(off(BOARDS["aprilgrid"], turned)) < 0.1


def test_a_calibration_from_photographs_of_an_aprilgrid_finds_the_camera():
    board = BOARDS["aprilgrid"]
    poses = spread_boards(np.random.default_rng(4), (CAMERA,), board, 6, (15, 35))
    found = [find_corners(photographed(CAMERA, board, pose), board) for pose in poses]
    seen = Detections(tuple(map(str, range(6))), np.array(found), 480, 360)
    solved = calibrate(seen, board, fixed=("p1", "p2")).cameras["camera"].intrinsics
    truth = CAMERA.intrinsics
    assert solved.fx == pytest.approx(truth.fx, rel=2e-3)
    assert (solved.cx, solved.cy) == pytest.approx((truth.cx, truth.cy), abs=0.5)


def test_a_marker_s_corner_is_not_where_opencv_ends_in_light_that_is_encoded():
    """Blur and sRGB draw OpenCV's corners half a pixel and more towards the middle, by each of its ways."""
    board = BOARDS["markers"]
    picture, truth = (
        photographed(CAMERA, board, POSE),
        CAMERA.project(POSE.apply(board.corners)).reshape(-1, 2, 4, 2, 2),
    )
    for way in ("NONE", "SUBPIX", "CONTOUR"):
        parameters = cv2.aruco.DetectorParameters()
        parameters.cornerRefinementMethod = getattr(cv2.aruco, f"CORNER_REFINE_{way}")
        detector = cv2.aruco.ArucoDetector(markers.marker_dictionary("DICT_4X4_50"), parameters)
        found = {int(number): four[0] for four, number in zip(*detector.detectMarkers(picture)[:2], strict=True)}
        corners = np.array([found[number][[0, 1, 3, 2]] for number in range(12)]).reshape(3, 4, 2, 2, 2)
        off = np.linalg.norm(corners - truth.transpose(0, 2, 1, 3, 4), axis=-1)
        assert np.median(off) > 0.5
    assert np.median(np.linalg.norm(find_corners(picture, board).reshape(truth.shape) - truth, axis=-1)) < 0.025


@pytest.mark.parametrize(("first_id", "border_bits"), [(0, 1), (7, 2)])
def test_one_marker_gives_the_camera_s_place(first_id, border_bits):
    board = Board.marker_grid(1, 1, 0.16, "DICT_5X5_100", first_id=first_id, border_bits=border_bits)
    pose = RigidTransform.from_components([-0.08, -0.07, 0.45], Rotation.from_rotvec([0.5, -0.4, 0.3]))
    picture = photographed(CAMERA, board, pose)
    found = find_corners(picture, board)
    assert found.shape == (4, 2)
    assert np.nanmax(np.linalg.norm(found - CAMERA.project(pose.apply(board.corners)), axis=1)) < 0.1
    poses, known = board_poses(CAMERA, board, found[None])
    assert known.all()
    assert np.linalg.norm(poses[0].inv().translation - pose.inv().translation) < 0.003  # of half a metre
    other = Board.marker_grid(1, 1, 0.16, "DICT_5X5_100", first_id=first_id + 1, border_bits=border_bits)
    assert find_corners(picture, other) is None


def test_a_marker_whose_side_is_at_the_picture_s_border_is_left_out():
    board = BOARDS["markers"]
    picture, whole = photographed(CAMERA, board, POSE), CAMERA.project(POSE.apply(board.corners)).reshape(6, 8, 2)
    border = int(whole[:, 3, 0].max()) + 2  # a pixel of white beside the second column
    found = find_corners(np.ascontiguousarray(picture[:, :border]), board).reshape(6, 8, 2)
    assert np.isfinite(found[:, :2]).all()
    assert np.isnan(found[:, 2:4]).all(axis=(1, 2)).any()
    assert np.nanmax(np.linalg.norm(found - whole, axis=-1)) < 0.1


def test_the_middle_of_a_tilted_circle_is_not_where_its_centre_is_seen():
    """Large discs, close and tilted: 0.1 px and more, which `bias` knows to a hundredth, by the discs' areas alone."""
    pose = RigidTransform.from_components([-0.09, -0.06, 0.25], Rotation.from_rotvec([0.7, 0, 0]))
    points = BOARDS["circles"].corners
    around = np.linspace(0, 2 * np.pi, 400, endpoint=False)
    rims = points[:, None] + 0.01 * np.stack([np.cos(around), np.sin(around), 0 * around], axis=-1)
    pinhole = Camera(CAMERA.intrinsics)
    seen = pinhole.project(pose.apply(rims.reshape(-1, 3))).reshape(*rims.shape[:2], 2)
    moments = [cv2.moments(rim.astype(np.float32)) for rim in seen]
    middles = np.array([[m["m10"] / m["m00"], m["m01"] / m["m00"]] for m in moments])
    truth = middles - pinhole.project(pose.apply(points))
    assert np.linalg.norm(truth, axis=1).max() > 0.1
    assert bias(points[:, :2], middles, np.array([m["m00"] for m in moments])) == pytest.approx(truth, abs=0.01)


@pytest.mark.parametrize(
    ("text", "board"),
    [
        ("target_type: 'aprilgrid' #gridtype\ntagCols: 6\ntagRows: 5\ntagSize: 0.088 #[m]\ntagSpacing: 0.3\n",
         Board.aprilgrid(6, 5, 0.088, 0.3)),
        ("target_type: 'checkerboard'\ntargetCols: 6\ntargetRows: 7\nrowSpacingMeters: 0.06\ncolSpacingMeters: 0.06\n",
         Board(6, 7, 0.06)),
        ("target_type: 'circlegrid'\ntargetCols: 6\ntargetRows: 7\nspacingMeters: 0.02\nasymmetricGrid: False\n",
         Board(6, 7, 0.02, kind="circles")),
        ("target_type: 'circlegrid'\ntargetCols: 4\ntargetRows: 11\nspacingMeters: 0.02\nasymmetricGrid: True\n",
         Board(4, 11, 0.02, kind="asymmetric-circles")),
    ],
)  # fmt: skip
def test_kalibrs_target_files_are_read(text, board, tmp_path):
    (tmp_path / "target.yaml").write_text(text)
    assert read_target(tmp_path / "target.yaml") == board


def test_a_target_that_is_none_is_refused_in_one_sentence(tmp_path, capsys):
    path = tmp_path / "target.yaml"
    path.write_text("target_type: 'checkerboard'\ntargetCols: 6\ntargetRows: 7\nrowSpacingMeters: 0.06\n"
                    "colSpacingMeters: 0.05\n")  # fmt: skip
    with pytest.raises(CalibrationError, match=r"expected squares, 0\.05 as colSpacingMeters, got 0\.06"):
        read_target(path)
    path.write_text("cam0: {camera_model: pinhole}\n")
    assert main(["board", "--board", str(path), "-o", str(tmp_path / "b.pdf")]) == 2
    assert "expected Kalibr's target_type" in capsys.readouterr().err
    assert (
        main(["board", "--kind", "aprilgrid", "--board", "6x5", "--square-mm", "20", "-o", str(tmp_path / "b.pdf")])
        == 0
    )


@pytest.mark.parametrize("kind", BOARDS)
def test_a_calibration_file_keeps_its_board(kind, tmp_path):
    board = replace(BOARDS[kind], marker_size=0.011) if kind == "circles" else BOARDS[kind]
    write(Calibration({"camera": CAMERA}, tmp_path, "", board=board), tmp_path / "camera.yml", "opencv")
    assert load(tmp_path / "camera.yml").board == board


@pytest.mark.parametrize("kind", BOARDS)
def test_views_draw_what_is_printed(kind):
    """As much of the picture is black as of the paper, and the mesh shows the same."""
    board = BOARDS[kind]
    left, top, right, bottom = board.area
    assert outline(board)[[0, 2], :2].tolist() == [[left, top], [right, bottom]]
    rectangles, discs = black_parts(board) / 1000, black_discs(board) / 1000
    black = (rectangles[:, 2] * rectangles[:, 3]).sum() + np.pi / 4 * (discs[:, 2] ** 2).sum()
    share = black / ((right - left) * (bottom - top))
    picture = (245 - printed(board)[..., 0].astype(float)) / 205
    assert picture.mean() == pytest.approx(share, rel=0.02)
    faces = mesh(board).point_data["rgba"][::4, 0]
    assert (faces < 128).mean() == pytest.approx(share, rel=0.1)


@pytest.mark.parametrize(
    ("fields", "said"),
    [
        ((5, 4, 0.03, 0.02, "DICT_APRILTAG_36h11", "aprilgrid"), "two points a tag, got 5 and 4"),
        ((4, 4, 0.03, 0.02, "DICT_4X4_50", "aprilgrid"), "dictionary must be DICT_APRILTAG_36h11"),
        ((60, 60, 0.03, 0.02, "DICT_APRILTAG_36h11", "aprilgrid"), "at most 587 tags, got 30 × 30"),
        ((4, 4, 0.03, 0.04, None, "circles"), "a circle's diameter, below"),
        ((4, 4, 0.03, None, None, "hexagons"), "kind must be one of chessboard, aprilgrid"),
    ],
)
def test_a_board_that_cannot_be_is_refused(fields, said):
    with pytest.raises(ValueError, match=said):
        Board(*fields)


def test_a_grid_with_more_markers_than_its_dictionary_is_not_looked_for():
    with pytest.raises(ValueError, match="dictionary must have the 51 markers of this board, DICT_4X4_50 has 50"):
        detect(["none.png"], Board.marker_grid(1, 1, 0.06, "DICT_4X4_50", first_id=50))


def test_a_chessboard_with_a_short_side_is_not_looked_for():
    assert find_corners(np.full((60, 80), 128, np.uint8), Board(2, 5, 0.03)) is None


def test_a_large_photograph_is_searched_at_full_size_only_where_the_board_is(monkeypatch):
    """The corners are those that the whole picture gives, from less than half of its pixels."""
    board, camera = BOARDS["chessboard"], Camera(Intrinsics(960, 720, 560, 560, 479.5, 359.5), BrownConrady(-0.2, 0.05))
    pose = POSE * RigidTransform.from_translation([0.0, 0.0, 0.15])
    picture = photographed(camera, board, pose)
    whole = chessboards.everywhere(picture, board)
    looked = []

    def noted(gray, board):
        looked.append(gray.size)
        return everywhere(gray, board)

    monkeypatch.setattr(chessboards, "everywhere", noted)
    found = find_corners(picture, board)
    assert len(looked) == 1
    assert looked[0] < picture.size / 2
    assert np.linalg.norm(found - camera.project(pose.apply(board.corners)), axis=1).max() < 0.1
    assert min(np.abs(found - each).max() for each in (whole, whole[::-1])) < 0.1


def test_a_board_that_the_smaller_copy_does_not_show_is_found_all_the_same(monkeypatch):
    board = BOARDS["chessboard"]
    picture = cv2.resize(photographed(CAMERA, board, POSE), (960, 720))
    found = find_corners(picture, board)
    monkeypatch.setattr(chessboards, "_rough", lambda gray, board: None)
    assert np.abs(find_corners(picture, board) - found).max() < 0.2
