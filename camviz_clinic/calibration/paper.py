"""A calibration board on paper: its black parts in millimetres, and a PDF that prints them at true scale."""

from __future__ import annotations

import re
from collections.abc import Iterable
from dataclasses import dataclass, replace
from math import floor

import numpy as np

from camviz.lenses.base import Array
from camviz_clinic.calibration.boards import kind_of
from camviz_clinic.calibration.types import Board

PAPERS = {"a4": (210.0, 297.0), "a3": (297.0, 420.0), "letter": (215.9, 279.4)}  # millimetres
MARGIN, STRIP = 8.0, 27.0  # millimetres: white around the board, and below it where the ruler and the words are
RULER = 100.0
BY_EYE = 0.35  # millimetres: how well a ruler is read
FITTED = (("A4", "Letter"), ("Letter", "A4"))
LARGEST = 5000.0  # millimetres; PDF ends at 200 inches
POINTS = 72 / 25.4  # per millimetre


@dataclass(frozen=True)
class PrintedBoard:
    """A board on a sheet of paper; all lengths in millimetres, x to the right and y up from the sheet's lower left.

    The board lies flat on the sheet with its first row of corners on top. Raises ValueError where it does not fit.
    """

    board: Board
    width: float
    height: float

    def __post_init__(self) -> None:
        wide, high = size_mm(self.board)
        if wide + 2 * MARGIN > self.width + 1e-9 or high + MARGIN + STRIP > self.height + 1e-9:
            raise ValueError(
                f"width and height must be at least {wide + 2 * MARGIN:g} × {high + MARGIN + STRIP:g} mm for this "
                f"board, got {self.width:g} × {self.height:g}"
            )
        if self.width < RULER + 2 * MARGIN:
            raise ValueError(f"width must be at least {RULER + 2 * MARGIN:g} mm for the ruler, got {self.width:g}")

    @property
    def corner(self) -> tuple[float, float]:
        """The board's upper left corner on the sheet."""
        wide, high = size_mm(self.board)
        return (self.width - wide) / 2, STRIP + (self.height - MARGIN - STRIP + high) / 2

    def black(self) -> Array:
        """The black rectangles of the board, (n, 4): x and y of the lower left, width, height."""
        x, y = self.corner
        parts = black_parts(self.board)
        return np.column_stack([x + parts[:, 0], y - parts[:, 1] - parts[:, 3], parts[:, 2], parts[:, 3]])

    def discs(self) -> Array:
        """The black discs of the board, (n, 3): x and y of the middle, diameter."""
        x, y = self.corner
        discs = black_discs(self.board)
        return np.column_stack([x + discs[:, 0], y - discs[:, 1], discs[:, 2]])

    def ruler(self) -> Array:
        """The black rectangles of the ruler, (n, 4): a line, and a tick every ten millimetres."""
        ticks = [[MARGIN + at - 0.1, 18.0, 0.2, 3.0 if at in (0, 50, RULER) else 2.0] for at in np.arange(0, 101, 10.0)]
        return np.array([[MARGIN - 0.1, 17.8, RULER + 0.2, 0.2], *ticks])

    def words(self) -> list[tuple[float, float, str]]:
        """What is printed, with x and y of where each line begins."""
        board = self.board
        kind = kind_of(board)
        said = kind.says(board)
        return [
            (MARGIN + RULER + 2, 17.8, "100 mm"),
            (MARGIN, 13.0, f"{said[0].upper()}{said[1:]}, {kind.measures(board)}"),
            (MARGIN, 9.5, f"camviz calibrate PICTURES {kind.options(board)}"),
            (MARGIN, 6.0, "Print at 100 %, not fitted to the page: the ruler must measure 100 mm. Keep it flat."),
        ]


def size_mm(board: Board) -> tuple[float, float]:
    """Width and height in millimetres of all that is printed of a board, with the white that its finder needs."""
    left, top, right, bottom = board.area
    return 1000 * (right - left), 1000 * (bottom - top)


def black_parts(board: Board) -> Array:
    """What is black of a board as rectangles (n, 4): x and y of the upper left, width, height, in millimetres.

    From the board's upper left, x to the right and y down.
    """
    left, top = board.area[:2]
    return np.asarray(1000 * (kind_of(board).drawn(board).rectangles - [left, top, 0, 0]))


def black_discs(board: Board) -> Array:
    """The same of what is black discs (n, 3): x and y of the middle, diameter."""
    left, top = board.area[:2]
    return np.asarray(1000 * (kind_of(board).drawn(board).discs - [left, top, 0]))


def fitted(board: Board, paper: str = "a4") -> PrintedBoard:
    """The board on a paper of PAPERS, or of a size such as "500x400-mm", whichever way round it fits.

    Raises ValueError saying what would fit.
    """
    short, long = sorted(paper_size(paper))
    wide, high = size_mm(board)
    ways = [(short, long), (long, short)] if wide <= high else [(long, short), (short, long)]
    for width, height in ways:
        if wide + 2 * MARGIN <= width + 1e-9 and high + MARGIN + STRIP <= height + 1e-9:
            return PrintedBoard(board, width, height)
    kind = kind_of(board)
    room = max(min((width - 2 * MARGIN) / wide, (height - MARGIN - STRIP) / high) for width, height in ways)
    largest = floor(10 * 1000 * kind.size(board) * room + 1e-9) / 10
    would = f"{kind.sized} of at most {largest:g} mm would fit, or" if largest >= 1 else "it would need"
    raise ValueError(
        f"a {kind.says(board)}, {kind.measures(board)}, is {wide:g} × {high:g} mm, too large for the paper {paper}: "
        f"{would} a paper of {_up(wide + 2 * MARGIN)}x{_up(high + MARGIN + STRIP)}-mm"
    )


def as_printed(board: Board, ruler_mm: float) -> Board:
    """The board of a sheet whose ruler measures `ruler_mm` in place of 100 mm."""
    scale = ruler_mm / RULER
    marker = None if board.marker_size is None else scale * board.marker_size
    return replace(board, square_size=scale * board.square_size, marker_size=marker)


def told_by_ruler(board: Board, ruler_mm: float) -> str:
    """What the ruler of a printed sheet tells of its printing, and of the board."""
    kind, printed = kind_of(board), as_printed(board, ruler_mm)
    if abs(ruler_mm - RULER) < BY_EYE:
        why = "it was printed at true scale"
    else:
        lengths = {pair: RULER * _fit(*(PAPERS[name.lower()] for name in pair)) for pair in FITTED}
        pairs = (pair for pair, length in lengths.items() if abs(ruler_mm - length) < BY_EYE)
        made = " and fitted to ".join(next(pairs, ()))
        why = f"the sheet was made for {made}" if made else "it was not printed at 100 %"
    return f"The ruler measures {ruler_mm:g} mm: {why}, and its {kind.sized} are {1000 * kind.size(printed):.4g} mm."


def _fit(sheet: tuple[float, float], paper: tuple[float, float]) -> float:
    """How much smaller a sheet is printed, to fit on another paper."""
    return min(paper[0] / sheet[0], paper[1] / sheet[1])


def paper_size(paper: str) -> tuple[float, float]:
    """Width and height of a paper in millimetres; ValueError for one that cannot be."""
    if paper.lower() in PAPERS:
        return PAPERS[paper.lower()]
    match = re.fullmatch(r"(\d+(?:\.\d+)?)[x×](\d+(?:\.\d+)?)-?mm", paper.strip().lower())
    if match is None:
        raise ValueError(f"paper must be {', '.join(PAPERS)} or a size such as 500x400-mm, got {paper!r}")
    width, height = float(match[1]), float(match[2])
    if not (RULER + 2 * MARGIN <= max(width, height) <= LARGEST and min(width, height) > 0):
        raise ValueError(f"paper must be from {RULER + 2 * MARGIN:g} to {LARGEST:g} mm long, got {paper!r}")
    return width, height


def _up(length: float) -> int:
    return int(np.ceil(length - 1e-9))


def pdf(sheet: PrintedBoard) -> bytes:
    """The sheet as a PDF of one page (PDF 1.7, ISO 32000-1), whose viewers are asked not to scale it."""
    lines = [f"{POINTS:.9f} 0 0 {POINTS:.9f} 0 0 cm", "0 g"]
    for rectangles in (sheet.black(), sheet.ruler()):
        lines += [" ".join(f"{x:.4f}" for x in rectangle) + " re" for rectangle in rectangles]
        lines.append("f")  # in one go, so that parts which touch have no seam
    for disc in sheet.discs():
        lines += _disc(*disc)
    for x, y, text in sheet.words():
        lines.append(f"BT /F1 2.9 Tf {x:.3f} {y:.3f} Td <{text.encode('cp1252').hex()}> Tj ET")
    content = "\n".join(lines).encode()
    width, height = sheet.width * POINTS, sheet.height * POINTS
    return _document(
        [
            b"<< /Type /Catalog /Pages 2 0 R /ViewerPreferences << /PrintScaling /None >> >>",
            b"<< /Type /Pages /Kids [3 0 R] /Count 1 >>",
            f"<< /Type /Page /Parent 2 0 R /MediaBox [0 0 {width:.4f} {height:.4f}] /Contents 4 0 R "
            "/Resources << /Font << /F1 5 0 R >> >> >>".encode(),
            f"<< /Length {len(content)} >>\nstream\n".encode() + content + b"\nendstream",
            b"<< /Type /Font /Subtype /Type1 /BaseFont /Helvetica /Encoding /WinAnsiEncoding >>",
        ]
    )


def _disc(x: float, y: float, diameter: float) -> list[str]:
    """A filled circle: four Bézier curves, which are round to 0.03 %."""
    radius = diameter / 2
    handle = radius * 4 / 3 * (np.sqrt(2) - 1)
    ends = radius * np.array([(1, 0), (0, 1), (-1, 0), (0, -1), (1, 0)])
    tangents = handle * np.array([(0, 1), (-1, 0), (0, -1), (1, 0), (0, 1)])
    lines = [f"{x + radius:.4f} {y:.4f} m"]
    for i in range(4):
        curve = np.concatenate([ends[i] + tangents[i], ends[i + 1] - tangents[i + 1], ends[i + 1]]) + [x, y] * 3
        lines.append(" ".join(f"{value:.4f}" for value in curve) + " c")
    return [*lines, "f"]


def _document(objects: Iterable[bytes]) -> bytes:
    """A PDF file of numbered objects, the first of which is the catalog."""
    file, places = b"%PDF-1.7\n%\xe2\xe3\xcf\xd3\n", []
    for number, held in enumerate(objects, 1):
        places.append(len(file))
        file += f"{number} 0 obj\n".encode() + held + b"\nendobj\n"
    table = "".join(f"{place:010d} 00000 n \n" for place in places)
    count = len(places) + 1
    trailer = f"xref\n0 {count}\n0000000000 65535 f \n{table}trailer\n<< /Size {count} /Root 1 0 R >>\n"
    return file + f"{trailer}startxref\n{len(file)}\n%%EOF\n".encode()
