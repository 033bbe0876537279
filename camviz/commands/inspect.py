"""`camviz inspect`: what is wrong with a calibration, in plain words, as JSON or as a page."""

from __future__ import annotations

import argparse
import json
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

from camviz.commands.boards import add_board, given_board
from camviz.commands.calibrate import PICTURES, Bar, add_baseline, add_seconds, pictures
from camviz.commands.common import (
    FOUND,
    OK,
    REFUSED,
    Refusal,
    add_colour,
    add_command,
    loaded,
    metres,
    on_disk,
    refuse_output,
    size,
    write_whole,
)
from camviz.commands.terminal import say, tell, tell_json

if TYPE_CHECKING:
    from camviz.clinic import Inspection
    from camviz.files import Board, Calibration

PAINT = {
    "^Nothing wrong was found": "green",
    r"^\S+ fault\b": "red",
    r"^\S+ warning\b": "yellow",
    r"^\S+ note\b": "blue",
}

INSPECT = """\
Says what is wrong with a calibration: each finding in a plain sentence with the number that shows it, its likely causes
and what to do; then what was checked, and what could not be and why. Reads every format that `camviz show` reads, and
names the fault in files that other commands refuse. A folder of pictures, or pictures, are calibrated first. The more a
file holds (corners, poses of the board: `camviz calibrate` writes them), the more can be checked.

docs/clinic.md says what every finding means, what it is judged by, and how often it is wrong.
"""
EPILOG = """\
examples:
  camviz inspect camera.yml
  camviz inspect stereo.yml --size 640x480 --compare factory.yml
  camviz inspect camera.yml --images shots/ --board 9x6 --square-mm 25 --report report.html
  camviz inspect shots/ --board 9x6 --square-mm 25 --json

exit status:
  0  nothing worse than a note was found
  1  something was found
  2  a file cannot be read, or the command cannot be used; one sentence on stderr says why
  3  something is missing on this machine
"""


def add(commands: Any) -> None:
    command = add_command(commands, "inspect", inspect, "say what is wrong with a calibration", INSPECT)
    command.epilog = EPILOG
    command.add_argument(
        "files", metavar="FILE", nargs="+", help="calibrations (- is stdin), pictures or a folder of them"
    )
    command.add_argument("--images", metavar="IMAGES", nargs="+", help="pictures that the calibration is for")
    add_board(command, required=False, default=False)
    add_baseline(command)
    add_seconds(command)
    command.add_argument("--size", metavar="WxH", type=size, help="image size in pixels, where FILE does not hold it")
    command.add_argument("--compare", metavar="OTHER", type=Path, help="another calibration of the same cameras")
    command.add_argument("--at", metavar="METRES", type=metres, help="a distance at which to tell the error of a place")
    command.add_argument("--json", action="store_true", help="the same for programs")
    add_colour(command)
    command.add_argument("--report", metavar="OUT.html", type=Path, help="write a page with pictures as well")


def inspect(options: argparse.Namespace) -> int:
    """Inspect every file; an unreadable one is named and does not keep the others from being inspected."""
    named = list(_named(options.files))
    if options.report:
        if len(named) > 1:
            raise Refusal("--report writes a page about one calibration: give one FILE.")
        refuse_output(options.report, "page", *(Path(word) for word in options.files))
    board = given_board(options)
    compare = loaded(options.compare, options.size) if options.compare else None
    inspections: dict[str, Inspection] = {}
    unreadable = False
    for name, paths in named:
        try:
            inspections[name] = _inspected(paths, board, compare, options)
        except Refusal as refusal:
            if len(named) == 1:
                raise
            say(str(refusal))
            unreadable = True
    _print(inspections, len(named) > 1, options)
    if options.report:
        _report(next(iter(inspections.values())), options)
    if unreadable:
        return REFUSED
    return OK if all(inspection.healthy for inspection in inspections.values()) else FOUND


def _named(words: list[str]) -> Iterator[tuple[str, list[Path]]]:
    """The calibrations by their names, and all pictures together under the name of the first."""
    shown: list[Path] = []
    for word in words:
        path = Path(word)
        if PICTURES.fullmatch(path.suffix) or ("\0" not in word and path.is_dir() and not _is_model(path)):
            shown += pictures([word])
        else:
            yield word, [path]
    if shown:
        yield str(shown[0].parent), shown


def _is_model(folder: Path) -> bool:
    from camviz.files import CalibrationError, File, format_of

    try:
        format_of(File(folder))
    except CalibrationError:
        return False
    return True


def _inspected(
    paths: list[Path], board: Board | None, compare: Calibration | None, options: argparse.Namespace
) -> Inspection:
    from camviz.clinic import Inspection, inspect, inspect_file
    from camviz.clinic.pictures import sizes_of
    from camviz.files import CalibrationError

    images = pictures(options.images) if options.images else []
    baseline = None if options.baseline_mm is None else options.baseline_mm / 1000
    if PICTURES.fullmatch(paths[0].suffix):
        calibrated = _calibrated(paths, board, options.seconds)
        if isinstance(calibrated, Inspection):
            return calibrated
        return inspect(
            calibrated,
            compare=compare,
            pictures=sizes_of(images),
            board=board,
            at=options.at,
            baseline=baseline,
            photographs=paths,
        )
    add = (
        None
        if board is None or not images
        else lambda calibration: _with_corners(calibration, images, board, options.seconds)
    )
    with on_disk(paths[0]) as file:
        try:
            return inspect_file(
                file,
                size=options.size,
                compare=compare,
                pictures=sizes_of(images),
                board=board,
                at=options.at,
                baseline=baseline,
                photographs=images,
                prepare=add,
            )
        except CalibrationError as error:
            raise Refusal(str(error)) from error


def _calibrated(paths: list[Path], board: Board | None, seconds: float | None) -> Calibration | Inspection:
    """The calibration of a folder of pictures; or what is wrong with the board as described, where there is none."""
    if board is None:
        raise Refusal(
            f"{paths[0].parent}: these are pictures, which are calibrated first: say which board they show, such as "
            "--board 9x6 --square-mm 25."
        )
    from camviz.calibration import CannotCalibrate, calibrate, detect
    from camviz.clinic.inspection import inspect_board

    try:
        with Bar() as bar:
            detections = detect(paths, board, progress=bar, seconds=seconds)
        return replace(calibrate(detections, board), source=paths[0].parent)
    except CannotCalibrate as error:
        if found := inspect_board(paths, board, paths[0].parent):
            return found
        raise Refusal(f"{error}.") from error


def _with_corners(calibration: Calibration, images: list[Path], board: Board, seconds: float | None) -> Calibration:
    """The calibration with the corners of the board in the pictures, if it is one camera's and has none."""
    from camviz.calibration import CannotCalibrate, detect
    from camviz.clinic.inspection import inspect_board
    from camviz.clinic.pictures import with_detections

    if len(calibration.cameras) != 1 or calibration.detections:
        return calibration
    try:
        with Bar() as bar:
            return with_detections(calibration, detect(images, board, progress=bar, seconds=seconds), board)
    except CannotCalibrate as error:
        if inspect_board(images, board):
            return calibration  # the inspection says why there are no corners
        raise Refusal(f"{error}.") from error


def _print(inspections: dict[str, Inspection], several: bool, options: argparse.Namespace) -> None:
    if options.json:
        trees = [({"file": name} if several else {}) | each.as_tree() for name, each in inspections.items()]
        tell_json(json.dumps(trees if several else trees[0], indent=2, ensure_ascii=False))
        return
    for name, inspection in inspections.items():
        tell(f"{name}\n" * several + inspection.as_text() + "\n" * several, PAINT, options.color)


def _report(inspection: Inspection, options: argparse.Namespace) -> None:
    from camviz.report.inspection import write_report

    first = Path((options.images or options.files)[0])
    folder = first if first.is_dir() else first.parent
    held = folder if options.images or PICTURES.fullmatch(first.suffix) or first.is_dir() else None
    write_whole(options.report, lambda path: write_report(inspection, path, images=held))
    if not options.json:
        tell(f"{options.report}: open it in a browser.")
