"""`camviz check`: whether a calibration that is in use still holds, by new pictures of a board."""

from __future__ import annotations

import argparse
from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

from camviz_clinic.commands.boards import add_board, given_board
from camviz_clinic.commands.calibrate import FINDERS, add_seconds
from camviz_clinic.commands.common import (
    FOUND,
    OK,
    Refusal,
    add_colour,
    add_command,
    add_megapixels,
    loaded,
    pixels,
    size,
)
from camviz_clinic.commands.films import as_pictures, take_films_alone
from camviz_clinic.commands.gate import EPILOG as GATE
from camviz_clinic.commands.gate import add_gate, given_gate, refuse_junit, write_junit
from camviz_clinic.commands.pictures import Bar, pictures
from camviz_clinic.commands.terminal import tell, tell_json

if TYPE_CHECKING:
    from camviz.cameras import Camera
    from camviz_clinic.calibration import Detections
    from camviz_clinic.checks.gate import Gate
    from camviz_clinic.files import Board, Calibration

INCONCLUSIVE = 4
STATUS = {"pass": OK, "warn": FOUND, "fail": FOUND, "inconclusive": INCONCLUSIVE}
PAINT = {
    "^pass:": "green",
    "^fail:": "red",
    "^warn:": "yellow",
    "^inconclusive:": "blue",
    "^Gate.*: passed": "green",
    "^Gate.*: failed": "red",
}

CHECK = """\
Says whether a calibration still describes its camera, by new pictures of a board. The calibration is held as it is, the
board's poses are free. The verdict is one of

  pass          it is surely (99 %) off by less than the limit
  warn          it is surely off by more than half of the limit; or it holds for pictures of another size
  fail          it is surely off by more than the limit
  inconclusive  the pictures do not tell; what would settle it is said

"Off" is how far points far away are displaced over the image (RMS), once a turn of the whole camera is taken out. With
--right the calibration is of a pair: rows, depths and the baseline against the board are judged, too. A film may stand
for pictures; a pair has one of each camera, and they begin at the same moment.

docs/clinic.md says how the verdict comes about, and how often it is wrong.
"""
EPILOG = """\
examples:
  camviz check camera.yaml new/*.jpg
  camviz check camera.yml new/ --board 9x6 --square-mm 25 --limit-px 0.5
  camviz check stereo.yaml new/left/ --right new/right/ --json
  camviz check camera.yaml new.mp4
  camviz check camera.yaml new/ --fail-on fault --limit change-px=0.5 --junit check.xml

{gate}  Here a verdict of fail is as a fault, and warn as a warning; ids of findings do not concern it.

exit status:
  0  pass, or nothing that the gate fails on
  1  warn or fail
  2  a file cannot be read, or the command cannot be used; one sentence on stderr says why
  3  something is missing on this machine
  4  inconclusive
"""


def add(commands: Any) -> None:
    command = add_command(commands, "check", check, "say whether a calibration still holds", CHECK)
    command.epilog = EPILOG.format(gate=GATE)
    command.add_argument("calibration", metavar="CALIBRATION", type=Path, help="the calibration in use (- is stdin)")
    command.add_argument(
        "images", metavar="IMAGES", nargs="+", help="new pictures, folders of them, patterns, or a film"
    )
    command.add_argument("--right", metavar="IMAGES", nargs="+", help="those of the right camera; IMAGES is the left")
    command.add_argument("--camera", metavar="NAME", help="the camera that took IMAGES, where CALIBRATION has several")
    add_board(command, required=False, default=False)
    command.add_argument("--finder", choices=FINDERS, default="auto", help="how chessboards are found")
    add_seconds(command)
    take_films_alone(command)
    command.add_argument("--limit-px", metavar="PX", type=pixels, help="how far it may be off (default: 1)")
    command.add_argument("--size", metavar="WxH", type=size, help="image size, where CALIBRATION does not hold it")
    command.add_argument("--json", action="store_true", help="the same for programs")
    add_megapixels(command)
    add_colour(command)
    add_gate(command)


def check(options: argparse.Namespace) -> int:
    """Find the board, judge, and say the verdict."""
    gate = given_gate(options)
    refuse_junit(options, options.calibration, *map(Path, [*options.images, *(options.right or [])]))
    calibration = loaded(options.calibration, options.size)
    board = given_board(options) or calibration.board
    if board is None:
        raise Refusal(
            f"{options.calibration}: the file does not say which board was used: say which one the pictures show, such "
            "as --board 9x6 --square-mm 25."
        )
    names = _cameras(calibration, options)
    with as_pictures(options, _how_chosen(calibration.cameras[names[0]], board, options)) as of_films:
        return _judged(calibration, names, board, options, gate, of_films)


def _how_chosen(camera: Camera, board: Board, options: argparse.Namespace) -> dict[str, Any]:
    """By which model, and of which board, a film's frames are chosen."""
    from camviz.lenses import KannalaBrandt

    model = "fisheye" if isinstance(camera.lens, KannalaBrandt) else "standard"
    return {"board": board, "model": model, "search": {"finder": options.finder, "seconds": options.seconds}}


def _judged(
    calibration: Calibration,
    names: tuple[str, ...],
    board: Board,
    options: argparse.Namespace,
    gate: Gate,
    of_films: tuple[str, ...],
) -> int:
    """Find the board, judge, and say the verdict, and before it what is to be said of films."""
    from camviz_clinic.calibration import CannotCalibrate
    from camviz_clinic.calibration.stamp import Stamp
    from camviz_clinic.checks import check as judge
    from camviz_clinic.checks.deployed import LIMIT_PX
    from camviz_clinic.checks.gate import CHANGE
    from camviz_clinic.files.output import json_text

    try:
        with Bar() as bar:
            found = _found(names, board, options, bar)
    except CannotCalibrate as error:
        raise Refusal(f"{error}.") from error
    limit = options.limit_px or gate.limits.get(CHANGE, LIMIT_PX)
    words = dict(zip(names, (options.images, options.right), strict=False))
    taken = {name: Stamp.of(pictures(words[name])) for name in names}
    said = judge(calibration, found, board, limit, taken)
    audit = gate.audit(replace(said, notes=(*of_films, *said.notes)))
    if options.json:
        tell_json(json_text(audit.as_tree()))
    else:
        tell("\n".join([audit.check.as_text(), *audit.lines()]), PAINT, options.color)
    write_junit(options, {str(options.calibration): audit})
    return STATUS[audit.verdict]


def _cameras(calibration: Calibration, options: argparse.Namespace) -> tuple[str, ...]:
    """The names of the cameras that took the pictures: one, or the left and the right one."""
    from camviz_clinic.checks.rig import pairs

    names = tuple(calibration.cameras)
    if options.right:
        found = pairs(calibration)
        if len(found) != 1:
            raise Refusal(
                f"{options.calibration}: --right is for a calibration of one pair, this has the cameras "
                f"{', '.join(names)}."
            )
        return found[0].left, found[0].right
    if options.camera is None and len(names) > 1:
        raise Refusal(
            f"{options.calibration}: the cameras are {', '.join(names)}: say with --camera which one took the pictures,"
            " or give those of the right one with --right."
        )
    name = options.camera or names[0]
    if name not in names:
        raise Refusal(f"{options.calibration}: expected --camera to be one of {', '.join(names)}, got {name}.")
    return (name,)


def _found(names: tuple[str, ...], board: Board, options: argparse.Namespace, bar: Bar) -> Mapping[str, Detections]:
    """The board's corners in the pictures of one camera or of both."""
    from camviz_clinic.calibration import detect, detect_pair
    from camviz_clinic.calibration.pairing import paired

    left = pictures(options.images)
    if len(names) == 1:
        return {names[0]: detect(left, board, finder=options.finder, progress=bar, seconds=options.seconds)}
    moments = paired(left, pictures(options.right))
    both = detect_pair(moments.left, moments.right, board, finder=options.finder, progress=bar, seconds=options.seconds)
    first = replace(both[0], skipped=both[0].skipped + moments.lonely)
    return dict(zip(names, (first, both[1]), strict=True))
