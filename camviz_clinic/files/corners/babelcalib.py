"""The corner files of BabelCalib and the Deltille detector: .orpc for each picture, .dsc for the boards."""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from camviz_clinic.calibration.types import CalibrationError
from camviz_clinic.files.corners.format import CornerCollector, CornerFile, CornerFormat, Corners, Given
from camviz_clinic.files.trees import shown

KEYS = ("filename", "width", "height", "num_corners", "encoding")
HEADER = re.compile(r"[0-9]+,[0-9]+,[0-9]+,[0-9.eE+-]+")
TAGS = re.compile(r"\w+,[0-9.eE+-]+")
POSES = "#calibration date"  # how a .tp begins
EVEN = 1e-3  # of a square
MILLIMETRES = 1e-3  # the side of a square in the header of a board
CENTIMETRES = 1e-2  # the places of its corners
LARGEST_SIDE = 100_000  # pixels


@dataclass(frozen=True, eq=False)
class Plane:
    """One board of a .dsc: for each corner by its number its (column, row), in metres the side of a square."""

    places: dict[int, tuple[int, int]]
    shape: tuple[int, int]
    square_size: float


def is_ours(file: CornerFile) -> bool:
    """True for .orpc, .dsc and .tp, by their first lines."""
    return _is_corners(file) or _is_boards(file) or _is_poses(file)


def _is_corners(file: CornerFile) -> bool:
    return [line.split(":")[0] for line in file.head] == list(KEYS)


def _is_boards(file: CornerFile) -> bool:
    return len(file.head) > 1 and bool(HEADER.fullmatch(file.head[0]) and TAGS.fullmatch(file.head[1]))


def _is_poses(file: CornerFile) -> bool:
    return file.path.suffix == ".tp" or bool(file.head and file.head[0].startswith(POSES))


def read(files: Sequence[CornerFile], given: Given) -> Corners:
    """The corners of all .orpc; every plane of a target in a picture is a view of its own.

    Without a .dsc the corners are numbered row by row on one board, which the caller gives. What a .tp says, where the
    planes stand on each other, is not used.
    """
    pictures = [file for file in files if _is_corners(file)]
    if not pictures:
        raise CalibrationError(f"{files[0].path}: expected the .orpc files with the corners too, this holds none")
    planes = _planes([file for file in files if _is_boards(file)])
    shapes = sorted({(plane.shape, plane.square_size) for plane in planes.values()})
    if len(shapes) > 1:
        (first, side), (second, other), *_ = shapes
        raise CalibrationError(
            f"expected boards of one kind, got {first[0]}×{first[1]} corners {1000 * side:g} mm apart and "
            f"{second[0]}×{second[1]} corners {1000 * other:g} mm apart"
        )
    board = given.board(*shapes[0]) if shapes else given.board()
    if not planes:
        numbered = range(board.columns * board.rows)
        everywhere = {number: (number % board.columns, number // board.columns) for number in numbered}
        planes = {0: Plane(everywhere, (board.columns, board.rows), board.square_size)}
    found = [_read_picture(file, planes, len(planes) > 1) for file in pictures]
    sizes = {size for _, size in found}
    if len(sizes) > 1:
        (path, first), (other_path, second) = _two_that_differ(
            [(file.path, s) for file, (_, s) in zip(pictures, found, strict=True)]
        )
        raise CalibrationError(
            f"{other_path}: expected pictures of {first[0]}×{first[1]} pixels as in {path}, got {second[0]}×{second[1]}"
        )
    parts = [sheet.corners(board) for sheet, _ in found]
    names = [name for part in parts for name in part.pictures]
    for name in names:
        if names.count(name) > 1:
            raise CalibrationError(f"expected each picture in one .orpc, {shown(name)} is in several")
    return Corners(
        board,
        {name: part.pictures[name] for part in parts for name in part.pictures},
        {name: part.lines[name] for part in parts for name in part.lines},
        {name: part.files[name] for part in parts for name in part.files},
        sizes.pop(),
    )


def _two_that_differ(sizes: list[tuple[object, tuple[int, int]]]) -> tuple[tuple[object, tuple[int, int]], ...]:
    """The first, and the first that has another size."""
    return sizes[0], next(each for each in sizes if each[1] != sizes[0][1])


def _read_picture(file: CornerFile, planes: dict[int, Plane], several: bool) -> tuple[CornerCollector, tuple[int, int]]:
    """The corners of one .orpc, each plane under a name of its own where there are several; and the picture's size."""
    sheet, lines = CornerCollector(file), list(file.lines)
    values = {key: line.split(":", 1)[1].strip() for key, (_, line) in zip(KEYS, lines, strict=False)}
    numbered = {key: number for key, (number, _) in zip(KEYS, lines, strict=False)}
    width, height = (sheet.count(numbered[key], values[key], key, LARGEST_SIDE) for key in ("width", "height"))
    if not width or not height:
        raise sheet.complaint(numbered["width"], f"expected the size of a picture, got {width}×{height}")
    if values["encoding"] != "ascii":
        raise sheet.complaint(numbered["encoding"], f"expected encoding: ascii, got {shown(values['encoding'])}")
    count = sheet.count(numbered["num_corners"], values["num_corners"], "num_corners")
    name = re.split(r"[/\\]", values["filename"])[-1] or file.path.name
    if len(lines) - len(KEYS) != count:
        raise sheet.complaint(
            numbered["num_corners"],
            f"expected {count} lines of corners as num_corners says, got {len(lines) - len(KEYS)}",
        )
    if not several:
        sheet.picture(name)
    for line, text in lines[len(KEYS) :]:
        words = [word.strip() for word in text.split(",")]
        if len(words) != 5:
            raise sheet.complaint(line, f"expected board,corner,ordered,x,y, got {shown(text)}")
        plane = sheet.count(line, words[0], "the board's number")
        corner = sheet.count(line, words[1], "the corner's number")
        u, v = (sheet.number(line, word, axis) for word, axis in zip(words[3:], "xy", strict=True))
        if plane not in planes:
            raise sheet.complaint(line, f"expected a board of the .dsc ({_listed(planes)}), got {plane}")
        if corner not in planes[plane].places:
            last = max(planes[plane].places)
            raise sheet.complaint(line, f"expected a corner from 0 to {last} of board {plane}, got {corner}")
        column, row = planes[plane].places[corner]
        if words[2] == "1" and np.isfinite(u) and np.isfinite(v):
            sheet.add(line, f"{name} board {plane}" if several else name, (row, column), (u, v))
    return sheet, (width, height)


def _listed(planes: dict[int, Plane]) -> str:
    return ", ".join(map(str, planes))


def _planes(files: Sequence[CornerFile]) -> dict[int, Plane]:
    """The boards of a .dsc by their numbers; none without one."""
    if len(files) > 1:
        raise CalibrationError(f"{files[1].path}: expected one .dsc, {files[0].path} is another")
    planes: dict[int, Plane] = {}
    for file in files:
        sheet, lines, at = CornerCollector(file), list(file.lines), 0
        while at < len(lines):
            number, plane, at = _read_plane(sheet, lines, at)
            if number in planes:
                raise sheet.complaint(lines[at - 1][0], f"expected each board once, board {number} comes again")
            planes[number] = plane
    return planes


def _read_plane(sheet: CornerCollector, lines: list[tuple[int, str]], at: int) -> tuple[int, Plane, int]:
    """The board whose header stands at a line, its number, and where the next one begins.

    A header has the board's number, its squares by rows and columns (no columns: a board of triangles) and the side of
    a square in millimetres. After a line with the family of its tags comes one for each corner: tag, column, row from
    below, X, Y, Z in centimetres.
    """
    line, text = lines[at]
    if not HEADER.fullmatch(text):
        raise sheet.complaint(line, f"expected board,rows,columns,side, got {shown(text)}")
    words = text.split(",")
    number, rows, columns = (sheet.count(line, word, "a number of squares", 200) for word in words[:3])
    side = sheet.number(line, words[3], "the side of a square")
    if not columns:
        raise sheet.complaint(line, "expected a board of squares, this is one of triangles, which are not read")
    if min(rows, columns) < 3 or not side > 0:
        raise sheet.complaint(line, f"expected 3 squares and more each way and their side, got {shown(text)}")
    count = (rows - 1) * (columns - 1)
    body = lines[at + 2 : at + 2 + count]
    if len(body) < count:
        raise sheet.complaint(line, f"expected {count} corners of board {number} below, got {len(body)}")
    table = np.array([_corner(sheet, *each) for each in body])
    nodes = table[:, :2].astype(int)
    width, height = (int(most) for most in nodes.max(axis=0) + 1)
    if width * height != count or len({tuple(node) for node in nodes}) != count:
        raise sheet.complaint(line, f"expected {count} corners that fill a grid, got {width} columns and {height} rows")
    flat = table[:, 2:] - table[0, 2:]
    expected = np.column_stack([nodes - nodes[0], np.zeros(count)]) * side * MILLIMETRES / CENTIMETRES
    off = np.abs(flat - expected).max(axis=1)
    if off.max() > EVEN * side * MILLIMETRES / CENTIMETRES:
        worst = int(np.argmax(off))
        raise sheet.complaint(
            body[worst][0],
            f"expected a corner on a flat grid of squares of {side:g} mm, it is {10 * off[worst]:.3g} mm off",
        )
    places = {index: (int(x), height - 1 - int(y)) for index, (x, y) in enumerate(nodes)}
    return number, Plane(places, (width, height), side * MILLIMETRES), at + 2 + count


def _corner(sheet: CornerCollector, line: int, text: str) -> list[float]:
    """Column, row from below, X, Y and Z of a corner."""
    words = text.split(",")
    if len(words) != 6:
        raise sheet.complaint(line, f"expected tag,column,row,X,Y,Z of a corner, got {shown(text)}")
    column, row = (sheet.count(line, word, what, 200) for word, what in zip(words[1:3], ("column", "row"), strict=True))
    place = [sheet.number(line, word, axis) for word, axis in zip(words[3:], "XYZ", strict=True)]
    if not np.isfinite(place).all():
        raise sheet.complaint(line, f"expected the place of a corner, got {shown(text)}")
    return [column, row, *place]


def _example() -> dict[str, bytes]:
    """A board of 4 × 3 corners, and three pictures of it."""
    nodes = [(column, row) for row in (2, 1, 0) for column in range(4)]
    board = "0,4,5,40\nt36h11,2\n" + "".join(f"-1,{x},{y},{4 * x + 4},{4 * y + 4},0\n" for x, y in nodes)
    files = {"board.dsc": board}
    for view in range(3):
        lines = [
            f"filename: view{view}.png",
            "width: 640",
            "height: 480",
            f"num_corners: {len(nodes)}",
            "encoding: ascii",
        ]
        lines += [
            f"0,{index},1,{100 + 40 * x + 7 * view},{90 + 41 * (2 - y) - 3 * view * x}"
            for index, (x, y) in enumerate(nodes)
        ]
        files[f"view{view}.orpc"] = "\n".join(lines) + "\n"
    return {name: text.encode() for name, text in files.items()}


FORMAT = CornerFormat(
    name="babelcalib",
    title="BabelCalib's .orpc with a .dsc",
    recognise=is_ours,
    read=read,
    several=True,
    holds="image size; the board in the .dsc",
    says="Deltille's; a file for each picture; Y of the board is up; each plane of a target is a view of its own; "
    "the .tp that says how they stand is passed over; boards of triangles are refused; first pixel's centre at (0, 0)",
    source="github.com/ylochman/babelcalib, core/feature; github.com/zang09/deltille_detector, apps",
    example=_example(),
)
