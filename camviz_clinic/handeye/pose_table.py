"""Robot poses in a table of text: which columns they are in, and in which form and unit."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from math import isnan, nan
from os import PathLike
from pathlib import Path

import numpy as np

from camviz.lenses.base import Array
from camviz.poses import RigidTransform
from camviz_clinic.calibration.motions import PoseError
from camviz_clinic.calibration.types import CalibrationError
from camviz_clinic.files.text import read_bytes, text_of
from camviz_clinic.handeye import turn_forms
from camviz_clinic.handeye.turn_forms import FULL_TURN

REACH_M = 20.0  # no robot on a base reaches further: larger numbers are millimetres
MOST_ROWS = 10_000
NAMES = ("picture", "image", "file", "filename", "name", "frame")
TIMES = ("time", "timestamp", "stamp", "t", "seconds")
PLACES = (
    *(("x", "y", "z"), ("tx", "ty", "tz"), ("px", "py", "pz"), ("posx", "posy", "posz")),
    *(("positionx", "positiony", "positionz"), ("translationx", "translationy", "translationz")),
)
TURNS: Mapping[tuple[str, ...], str] = {
    ("qx", "qy", "qz", "qw"): "xyzw",
    ("quatx", "quaty", "quatz", "quatw"): "xyzw",
    ("orientationx", "orientationy", "orientationz", "orientationw"): "xyzw",
    ("ox", "oy", "oz", "ow"): "xyzw",
    ("q1", "q2", "q3", "q4"): "wxyz",  # ABB
    ("rx", "ry", "rz"): "rotvec",  # Universal Robots
    ("rotvecx", "rotvecy", "rotvecz"): "rotvec",
    ("roll", "pitch", "yaw"): "euler-xyz",  # ROS: about fixed axes
    ("a", "b", "c"): "euler-ZYX",  # KUKA
    ("w", "p", "r"): "euler-xyz",  # FANUC
    tuple(f"r{row}{column}" for row in "123" for column in "123"): "matrix",
    tuple(f"r{row}{column}" for row in "012" for column in "012"): "matrix",
}
IN_DEGREES = (("a", "b", "c"), ("w", "p", "r"))
HEAD = re.compile(r"(?P<word>.+?)(?:\s*[\[(]\s*(?P<inside>mm|m|deg|°|rad|s)\s*[\])]|[ _](?P<behind>mm|m|deg|rad))?")


@dataclass(frozen=True, eq=False)
class RobotPoses:
    """Where a robot's hand stood, row by row, and how the table was read.

    Args:
        base_from_hand: One pose a row, in metres.
        names: The pictures that the rows name; empty where they name none.
        times: (rows,), seconds; None where the table has none.
        assumed: What was assumed in reading, in sentences.
        others: The same numbers read in other forms, by the option that asks for it.

    >>> from camviz.poses import RigidTransform
    >>> poses = RobotPoses(RigidTransform.from_translation([[0, 0, 0.5], [0, 0.1, 0.5]]))
    >>> len(poses.base_from_hand), poses.names
    (2, ())
    """

    base_from_hand: RigidTransform
    names: tuple[str, ...] = ()
    times: Array | None = None
    assumed: tuple[str, ...] = ()
    others: Mapping[str, RigidTransform] = field(default_factory=dict, repr=False)


@dataclass(frozen=True)
class _Columns:
    """Where in a row its parts are; `degrees` and `millimetres` are None where the header does not tell.

    `bottom` are the last four of a matrix's 16 numbers.
    """

    place: tuple[int, ...]
    turn: tuple[int, ...]
    form: str
    name: int | None = None
    time: int | None = None
    degrees: bool | None = None
    millimetres: bool | None = None
    told: str = ""
    bottom: tuple[int, ...] = ()


def read_poses(
    path: str | PathLike[str], *, rotation: str | None = None, angles: str | None = None, unit: str | None = None
) -> RobotPoses:
    r"""Read robot poses from a table of text: commas, semicolons, tabs or blanks, with or without a header.

    A header names the columns, such as `x_mm,y_mm,z_mm,qx,qy,qz,qw`; it may have a column `picture` and one `time` in
    seconds. Without one, 12 or 16 numbers are a matrix row by row and 8 are TUM's time, place and quaternion.

    Args:
        path: The table.
        rotation: {"matrix", "xyzw", "wxyz", "rotvec", "euler-ORDER"}, the form of the rotation. In ORDER small letters
            are fixed axes, capital ones moving axes, in the order of the columns, as SciPy has them.
        angles: {"deg", "rad"}, of Euler angles and rotation vectors; unless given, as the header says, else degrees
            where one is larger than 2π.
        unit: {"mm", "m"}; unless given, as the header says, else millimetres where one is larger than 20.

    Returns: The poses in metres, with what was assumed.
    Raises: PoseError for what is no such table. It is a ValueError, and its message is one sentence.

    >>> from pathlib import Path
    >>> _ = Path("poses.csv").write_text("x,y,z,qw,qx,qy,qz\n400,0,300,1,0,0,0\n400,50,300,1,0,0,0\n")
    >>> read_poses("poses.csv").base_from_hand.translation[1]
    array([0.4 , 0.05, 0.3 ])
    >>> read_poses("poses.csv").assumed[0]
    'Lengths were read as millimetres, because one is larger than 20.'
    """
    path = Path(path)
    if rotation is not None and not turn_forms.is_form(rotation):
        raise ValueError(f"rotation must be one of {', '.join(turn_forms.FORMS)} such as euler-ZYX, got {rotation!r}")
    try:
        rows = _rows(text_of(read_bytes(path, what="table of poses"), "a table of poses", " (CSV)"))
        return _read(rows, rotation, angles, unit)
    except (CalibrationError, PoseError) as error:
        raise PoseError(f"{path}: {error}") from error


def _rows(text: str) -> list[list[str]]:
    """The words of every line that is neither empty nor a remark."""
    lines = [line.strip() for line in text.splitlines()]
    lines = [line for line in lines if line and not line.startswith("#")]
    if len(lines) > MOST_ROWS:
        raise PoseError(f"expected at most {MOST_ROWS:,} poses, got {len(lines):,}")
    if not lines:
        raise PoseError("expected a table of poses, there is none")
    divider = next((each for each in (";", "\t", ",") if each in lines[0]), None)
    rows = [[word.strip().strip('"') for word in line.split(divider)] for line in lines]
    if divider == ";":
        rows = [[word.replace(",", ".") for word in row] for row in rows]
    for number, row in enumerate(rows, 1):
        if len(row) != len(rows[0]):
            raise PoseError(f"line {number} has {len(row)} columns, the first has {len(rows[0])}")
    return rows


def _read(rows: list[list[str]], rotation: str | None, angles: str | None, unit: str | None) -> RobotPoses:
    headed = all(isnan(_number(word)) for word in rows[0])
    columns = _by_header(rows[0], rotation) if headed else _by_count(rows[0], rotation)
    body = rows[1:] if headed else rows
    if not body:
        raise PoseError("expected poses below the header, there are none")
    if columns.bottom:
        columns = _upright(columns, body)
    numbers = _numbers(body, (*columns.place, *columns.turn, *([] if columns.time is None else [columns.time])))
    place, turn = numbers[:, :3], numbers[:, 3 : 3 + len(columns.turn)]
    millimetres, length_said = _millimetres(place, columns, unit)
    degrees, angle_said = _degrees(turn, columns, angles)
    metres = place / 1000 if millimetres else place
    poses = RigidTransform.from_components(metres, turn_forms.rotations(columns.form, turn, degrees))
    others = {
        asked: RigidTransform.from_components(metres, other)
        for asked, other in turn_forms.other_readings(columns.form, turn, degrees)
    }
    return RobotPoses(
        poses,
        () if columns.name is None else tuple(row[columns.name] for row in body),
        None if columns.time is None else numbers[:, -1],
        (length_said, f"Rotations were read{columns.told} as {turn_forms.says(columns.form)}{angle_said}."),
        others,
    )


def _by_header(words: Sequence[str], rotation: str | None) -> _Columns:
    heads = [HEAD.fullmatch(word.lower()) for word in words]
    plain = [re.sub(r"[^a-z0-9]", "", head["word"]) if head else "" for head in heads]
    units = [(head["inside"] or head["behind"]) if head else None for head in heads]
    place = next((each for each in PLACES if set(each) <= set(plain)), None)
    turn = next((each for each in TURNS if set(each) <= set(plain)), None)
    name = next((plain.index(each) for each in NAMES if each in plain), None)
    time = next((plain.index(each) for each in TIMES if each in plain), None)
    if place is None or turn is None:
        left = [index for index in range(len(words)) if index not in (name, time)]
        if len(left) in (12, 16):
            return _matrix(left, name, time)
        raise PoseError(
            f"the header names no {'place, such as x, y, z' if place is None else 'rotation, such as qx, qy, qz, qw'}; "
            f"it has {', '.join(words[:16])}"
        )
    form = TURNS[turn] if rotation is None else rotation
    if turn_forms.count(form) != len(turn):
        raise PoseError(f"{form} has {turn_forms.count(form)} numbers, the header names {', '.join(turn)}")
    of_turn, of_place = {units[plain.index(each)] for each in turn}, {units[plain.index(each)] for each in place}
    degrees = True if of_turn & {"deg", "°"} or (turn in IN_DEGREES and rotation is None) else None
    return _Columns(
        tuple(plain.index(each) for each in place),
        tuple(plain.index(each) for each in turn),
        form,
        name,
        time,
        False if "rad" in of_turn else degrees,
        True if "mm" in of_place else False if "m" in of_place else None,
        "" if rotation else f", by their columns' names {', '.join(turn)},",
    )


def _by_count(row: Sequence[str], rotation: str | None) -> _Columns:
    """The columns of a table without a header, by how many numbers a row has."""
    words = [index for index, word in enumerate(row) if isnan(_number(word))]
    if words not in ([], [0]):
        raise PoseError(f"expected a header, or numbers behind at most one name, got {', '.join(row[:16])}")
    left, name = [index for index in range(len(row)) if index not in words], words[0] if words else None
    if len(left) in (12, 13, 16, 17) and rotation in (None, "matrix"):
        time = left.pop(0) if len(left) in (13, 17) else None
        return _matrix(left, name, time)
    form, told = rotation, ""
    if form is None and len(left) == 8:
        form, told = "xyzw", ", as TUM's files of eight columns have them,"
    if form is None:
        raise PoseError(
            f"{len(left)} numbers a row without a header do not tell the form of the rotation: name the columns, or "
            f"say --rotation with one of {', '.join(turn_forms.FORMS)}"
        )
    needed = 3 + turn_forms.count(form)
    if len(left) not in (needed, needed + 1):
        raise PoseError(f"a row has a place and {form}, {needed} numbers (or a time before them), got {len(left)}")
    time = left.pop(0) if len(left) > needed else None
    return _Columns(tuple(left[:3]), tuple(left[3:]), form, name, time, told=told)


def _matrix(left: Sequence[int], name: int | None, time: int | None) -> _Columns:
    """[R | t] row by row in 12 or 16 columns."""
    place, turn = (3, 7, 11), (0, 1, 2, 4, 5, 6, 8, 9, 10)
    return _Columns(
        tuple(left[i] for i in place),
        tuple(left[i] for i in turn),
        "matrix",
        name,
        time,
        bottom=tuple(left[12:16]),
    )


def _upright(columns: _Columns, body: Sequence[Sequence[str]]) -> _Columns:
    """The columns of 16 numbers whose last row, or else last column, is 0, 0, 0, 1."""
    below = _numbers(body, columns.bottom)
    if np.allclose(below, [0, 0, 0, 1], atol=1e-6):
        return columns
    beside = _numbers(body, (*columns.place, columns.bottom[3]))
    if not np.allclose(beside, [0, 0, 0, 1], atol=1e-6):
        raise PoseError("of a pose's 16 numbers the last row is 0, 0, 0, 1, here neither it nor the last column is")
    turn = tuple(columns.turn[i] for i in (0, 3, 6, 1, 4, 7, 2, 5, 8))
    told = ", column by column because the last column is 0, 0, 0, 1,"
    return replace(columns, place=columns.bottom[:3], turn=turn, told=told)


def _numbers(body: Sequence[Sequence[str]], columns: Sequence[int]) -> Array:
    numbers = np.array([[_number(row[column]) for column in columns] for row in body])
    for pose, (row, values) in enumerate(zip(body, numbers, strict=True), 1):
        if not np.isfinite(values).all():
            word = row[columns[int(np.argmin(np.isfinite(values)))]]
            raise PoseError(f"pose {pose}: expected a number, got {word[:40]!r}")
    return numbers


def _number(word: str) -> float:
    """The number of a word; NaN where it is none."""
    try:
        return float(word) if "_" not in word else nan
    except ValueError:
        return nan


def _millimetres(place: Array, columns: _Columns, unit: str | None) -> tuple[bool, str]:
    if unit is not None:
        return unit == "mm", f"Lengths were read as {'millimetres' if unit == 'mm' else 'metres'}, as asked."
    if columns.millimetres is not None:
        return columns.millimetres, (
            f"Lengths were read as {'millimetres' if columns.millimetres else 'metres'}, by their columns' names."
        )
    if np.abs(place).max() > REACH_M:
        return True, f"Lengths were read as millimetres, because one is larger than {REACH_M:g}."
    return False, f"Lengths were read as metres, because none is larger than {REACH_M:g}."


def _degrees(turn: Array, columns: _Columns, angles: str | None) -> tuple[bool, str]:
    if columns.form in (*turn_forms.QUATERNIONS, "matrix"):
        return False, ""
    if angles is not None:
        return angles == "deg", f" in {'degrees' if angles == 'deg' else 'radians'}, as asked"
    if columns.degrees is not None:
        return columns.degrees, f" in {'degrees' if columns.degrees else 'radians'}"
    if np.abs(turn).max() > FULL_TURN:
        return True, " in degrees, because one is larger than 2π"
    return False, " in radians, because none is larger than 2π"
