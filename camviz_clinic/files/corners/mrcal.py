"""mrcal's corners.vnl, which mrgingham and mrcal-calibrate-cameras write: a line for each corner, row by row."""

from __future__ import annotations

from collections.abc import Sequence

from camviz_clinic.calibration.types import CalibrationError
from camviz_clinic.files.corners.format import CornerCollector, CornerFile, CornerFormat, Corners, Given
from camviz_clinic.files.trees import shown

LEGEND = ("filename", "x", "y")
WEIGHTS = ("level", "weight")  # of which mrcal has one, in the fourth column


def is_vnl(file: CornerFile) -> bool:
    """True where the first line of comment names the columns."""
    return bool(file.head) and _legend(file)[:3] == LEGEND


def read(files: Sequence[CornerFile], given: Given) -> Corners:
    """All pictures of one camera. A picture whose only line has no coordinates shows no board."""
    (file,) = files
    board = given.board()
    count, weight = board.columns * board.rows, (_legend(file)[3:] or ("level",))[0]
    sheet, found, done, reduced = CornerCollector(file), dict[str, int](), "", 0
    for line, text in file.lines:
        if text.startswith("#"):
            continue
        words = text.split()
        if len(words) not in (3, 4):
            raise sheet.complaint(line, f"expected filename x y, perhaps with a {weight}, got {shown(text)}")
        name = words[0]
        if name != done:
            if name in found:
                raise sheet.complaint(line, f"expected the corners of {shown(name)} together, it comes again")
            _refuse_incomplete(sheet, found, done, line, count, board.columns, board.rows)
            found[name], done = 0, name
            sheet.picture(name)
        place = found[name]
        found[name] += 1
        u, v = (sheet.number(line, word, axis) for word, axis in zip(words[1:3], "xy", strict=True))
        rated = sheet.number(line, words[3], weight) if len(words) == 4 else 0.0 if weight == "level" else 1.0
        if not (u >= 0 and v >= 0 and (rated >= 0 if weight == "level" else rated > 0)):
            continue  # mrcal too takes a negative number for "not seen"
        reduced += weight == "level" and rated > 0
        sheet.add(line, name, divmod(place, board.columns), (u, v))
    if not found:
        raise CalibrationError(f"{file.path}: expected a line for each corner, there are none")
    _refuse_incomplete(sheet, found, done, line, count, board.columns, board.rows)
    note = f"{reduced} corners were found in reduced pictures (level 1 and up); here all corners count alike."
    return sheet.corners(board, notes=(note,) if reduced else ())


def _refuse_incomplete(
    sheet: CornerCollector, found: dict[str, int], name: str, line: int, count: int, columns: int, rows: int
) -> None:
    """A picture has as many lines as the board has corners, or one without coordinates."""
    if name and found[name] != count and not (found[name] == 1 and not sheet.seen[name]):
        raise sheet.complaint(
            line,
            f"expected {count} lines for {shown(name)}, one for each corner of a board of {columns}×{rows}, got "
            f"{found[name]}",
        )


def _legend(file: CornerFile) -> tuple[str, ...]:
    """The names of the columns."""
    return tuple(file.head[0].lstrip("#").split()) if file.head[0].startswith("#") else ()


FORMAT = CornerFormat(
    name="mrcal",
    title="mrcal's corners.vnl",
    recognise=is_vnl,
    read=read,
    several=False,
    holds="neither board nor image size",
    says="filename x y, and level or weight, which are not used as weights; - or a negative number where no corner was "
    "seen; row by row; first pixel's centre at (0, 0)",
    source="mrcal 2.2, compute_chessboard_corners; mrgingham's manual",
    example={
        "corners.vnl": b"# filename x y level\n"
        + b"".join(
            b"view%d.png %.3f %.3f 0\n" % (view, 100 + 40 * column + 7 * view, 90 + 41 * row - 3 * view * column)
            for view in range(3)
            for row in range(3)
            for column in range(4)
        )
        + b"empty.png - - -\n"
    },
)
