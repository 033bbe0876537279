"""A printed board measures what it says, and is found again; one that does not fit the paper is refused."""

import re

import cv2
import numpy as np
import pytest

from camviz_clinic.calibration import find_corners
from camviz_clinic.calibration.paper import fitted, pdf
from camviz_clinic.commands.command import main
from camviz_clinic.files import Board

CHESSBOARD = Board(9, 6, 0.025)
CHARUCO = Board(7, 4, 0.03, 0.022, "DICT_4X4_50")
INCH = 25.4


def rectangles(document):
    """The filled rectangles (n, 4) of a PDF and the sides of its page, in millimetres, by its own operators."""
    scale = float(re.search(rb"\n([\d.]+) 0 0 \1 0 0 cm\n", document)[1]) * INCH / 72
    boxes = re.findall(rb"([\d.]+) ([\d.]+) ([\d.]+) ([\d.]+) re\n", document)
    width, height = re.search(rb"/MediaBox \[0 0 ([\d.]+) ([\d.]+)\]", document).groups()
    return scale * np.array(boxes, dtype=float), float(width) * INCH / 72, float(height) * INCH / 72


def rasterised(document, per_mm=8):
    """The page as an image, and how many pixels make a millimetre."""
    parts, width, height = rectangles(document)
    image = np.full((round(height * per_mm), round(width * per_mm)), 255, np.uint8)
    for x, y, w, h in parts:
        top, bottom = round((height - y - h) * per_mm), round((height - y) * per_mm)
        image[top:bottom, round(x * per_mm) : round((x + w) * per_mm)] = 0
    return cv2.GaussianBlur(image, None, 1.5)


@pytest.mark.parametrize("board", [CHESSBOARD, CHARUCO])
def test_the_squares_and_the_ruler_of_the_pdf_measure_what_they_say(board):
    parts, width, height = rectangles(pdf(fitted(board)))
    assert (width, height) == (pytest.approx(297, abs=1e-3), pytest.approx(210, abs=1e-3))
    side = 1000 * board.square_size
    squares = parts[np.isclose(parts[:, 2], side, atol=1e-3) & np.isclose(parts[:, 3], side, atol=1e-3)]
    assert len(squares) == ((board.columns + 1) * (board.rows + 1) + 1) // 2
    assert np.ptp(squares[:, 0]) + side <= side * (board.columns + 1) + 1e-3
    ticks = parts[np.isclose(parts[:, 2], 0.2, atol=1e-3) & (parts[:, 3] < 4)]
    assert np.ptp(ticks[:, 0]) == pytest.approx(100, abs=1e-3)
    assert len(ticks) == 11


@pytest.mark.parametrize("board", [CHESSBOARD, CHARUCO])
def test_the_printed_board_is_found_where_it_was_drawn(board):
    document = pdf(fitted(board))
    found = find_corners(rasterised(document), board)
    assert np.isfinite(found).all()
    grid = found.reshape(board.rows, board.columns, 2) / 8
    assert np.diff(grid[..., 0], axis=1).mean() == pytest.approx(1000 * board.square_size, abs=0.02)
    assert np.diff(grid[..., 1], axis=0).mean() == pytest.approx(1000 * board.square_size, abs=0.02)


def test_a_pdf_says_where_its_objects_are_and_how_long_its_content_is():
    document = pdf(fitted(CHESSBOARD))
    table = int(re.search(rb"startxref\n(\d+)\n%%EOF\n$", document)[1])
    assert document[table:].startswith(b"xref\n0 6\n")
    for number, place in enumerate(re.findall(rb"(\d{10}) 00000 n", document), 1):
        assert document[int(place) :].startswith(b"%d 0 obj\n" % number)
    length, content = re.search(rb"/Length (\d+) >>\nstream\n(.*)\nendstream", document, re.DOTALL).groups()
    assert len(content) == int(length)
    assert b"/PrintScaling /None" in document
    said = b"\n".join(bytes.fromhex(text.decode()) for text in re.findall(rb"<([0-9a-f]+)> Tj", document))
    assert b"--board 9x6 --square-mm 25" in said


def test_a_board_that_does_not_fit_is_refused_with_what_would():
    with pytest.raises(ValueError, match=r"squares of at most 25 mm would fit, or a paper of 276x217-mm") as refusal:
        fitted(Board(9, 6, 0.026))
    paper = str(refusal.value).split()[-1]
    assert fitted(Board(9, 6, 0.026), paper).width == 276
    assert fitted(Board(9, 6, 0.025)).width == 297
    assert fitted(Board(6, 9, 0.019)).width == 210
    with pytest.raises(ValueError, match="paper must be a4, a3, letter or a size"):
        fitted(CHESSBOARD, "a99")


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (["--square-mm", "40"], "squares of at most 25 mm would fit"),
        (["--board", "9"], "expected inner corners as COLUMNSxROWS"),
        (["--square-mm", "-3"], "expected a length in millimetres"),
        (["--charuco", "5X5_7"], "dictionary must be one of DICT_4X4_100"),
        (["--board", "30x30", "--square-mm", "5", "--charuco", "4X4_50"], "must have the 480 markers"),
        (["--board", "8x8", "--square-mm", "5", "--markers", "4X4_50"], "must have the 64 markers of this board"),
        (["--marker-mm", "10"], "--marker-mm is for a ChArUco board"),
        (["--charuco", "4X4_50", "--marker-mm", "30"], "marker_size must be a length below square_size"),
        (["-o", "gone/board.pdf"], "there is no directory gone"),
    ],
)
def test_the_command_refuses_in_one_sentence(words, said, capsys, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    assert main(["board", *words]) == 2
    out, err = capsys.readouterr()
    assert (out, err.count("\n")) == ("", 1)
    assert said in err
    assert list(tmp_path.iterdir()) == []


def test_the_command_writes_the_board(capsys, tmp_path):
    assert main(["board", "--paper", "letter", "-o", str(tmp_path / "b.pdf")]) == 0
    assert "see that its ruler measures 100 mm" in capsys.readouterr().out
    assert rectangles((tmp_path / "b.pdf").read_bytes())[1:] == pytest.approx((279.4, 215.9), abs=1e-3)
