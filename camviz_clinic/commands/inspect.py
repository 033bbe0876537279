"""`camviz inspect`: what is wrong with a calibration, in plain words, as JSON or as a page."""

from __future__ import annotations

import argparse
from collections.abc import Callable, Iterator
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

from camviz_clinic.commands.boards import add_board, given_board
from camviz_clinic.commands.calibrate import add_baseline, add_seconds
from camviz_clinic.commands.common import (
    FOUND,
    OK,
    REFUSED,
    Refusal,
    add_colour,
    add_command,
    add_megapixels,
    loaded,
    metres,
    on_disk,
    refuse_output,
    size,
    write_whole,
)
from camviz_clinic.commands.corners import add_corners, corners_of
from camviz_clinic.commands.gate import EPILOG as GATE
from camviz_clinic.commands.gate import add_gate, given_gate, refuse_junit, write_junit
from camviz_clinic.commands.pictures import PICTURES, Bar, pictures
from camviz_clinic.commands.terminal import say, tell, tell_json

if TYPE_CHECKING:
    from camviz_clinic.calibration import Detections
    from camviz_clinic.checks import Inspection
    from camviz_clinic.checks.gate import Outcome
    from camviz_clinic.files import Board, Calibration

PAINT = {
    "^.*No problem found": "green",
    r"^\S+ fault\b": "red",
    r"^\S+ warning\b": "yellow",
    r"^\S+ note\b": "blue",
    "^Gate.*: passed": "green",
    "^Gate.*: failed": "red",
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
  camviz inspect camera.yml --corners corners.vnl --board 9x6 --square-mm 25
  camviz inspect shots/ --board 9x6 --square-mm 25 --json
  camviz inspect calibration/*.yaml --fail-on fault,low-coverage --ignore aspect --junit clinic.xml

{gate}
exit status:
  0  nothing worse than a note was found, or nothing that the gate fails on
  1  something was found
  2  a file cannot be read, or the command cannot be used; one sentence on stderr says why
  3  something is missing on this machine
"""


def add(commands: Any) -> None:
    command = add_command(commands, "inspect", inspect, "say what is wrong with a calibration", INSPECT)
    command.epilog = EPILOG.format(gate=GATE)
    command.add_argument(
        "files", metavar="FILE", nargs="+", help="calibrations (- is stdin), pictures or a folder of them"
    )
    command.add_argument("--images", metavar="IMAGES", nargs="+", help="pictures that the calibration is for")
    add_board(command, required=False, default=False)
    add_corners(command)
    add_baseline(command)
    add_seconds(command)
    command.add_argument("--size", metavar="WxH", type=size, help="image size in pixels, where FILE does not hold it")
    command.add_argument("--compare", metavar="OTHER", type=Path, help="another calibration of the same cameras")
    command.add_argument("--at", metavar="METRES", type=metres, help="a distance at which to tell the error of a place")
    command.add_argument("--json", action="store_true", help="the same for programs")
    add_colour(command)
    command.add_argument("--report", metavar="OUT.html", type=Path, help="write a page with pictures as well")
    add_megapixels(command)
    add_gate(command)


def inspect(options: argparse.Namespace) -> int:
    """Inspect every file; an unreadable one is named and does not keep the others from being inspected."""
    named = list(_named(options.files))
    if options.report:
        if len(named) > 1:
            raise Refusal("--report writes a page about one calibration: give one FILE.")
        refuse_output(options.report, "page", *(Path(word) for word in options.files))
    gate = given_gate(options)
    refuse_junit(options, *(Path(word) for word in options.files), *([options.report] if options.report else []))
    board = None if options.corners else given_board(options)
    compare = loaded(options.compare, options.size) if options.compare else None
    outcomes: dict[str, Outcome] = {}
    unreadable: dict[str, str] = {}
    for name, paths in named:
        try:
            outcomes[name] = gate.judge(_inspected(paths, board, compare, options))
        except Refusal as refusal:
            unreadable[name] = str(refusal)
            if len(named) == 1:
                write_junit(options, unreadable)
                raise
            say(str(refusal))
    _print(outcomes, len(named) > 1, options)
    if options.report:
        _report(next(iter(outcomes.values())).inspection, options)
    write_junit(options, {name: outcomes.get(name) or unreadable[name] for name, _ in named})
    if unreadable:
        return REFUSED
    return OK if all(outcome.passed for outcome in outcomes.values()) else FOUND


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
    from camviz_clinic.files import CalibrationError, File, format_of

    try:
        format_of(File(folder))
    except CalibrationError:
        return False
    return True


def _inspected(
    paths: list[Path], board: Board | None, compare: Calibration | None, options: argparse.Namespace
) -> Inspection:
    from camviz_clinic.checks import Inspection, inspect, inspect_file
    from camviz_clinic.files import CalibrationError

    images = pictures(options.images) if options.images else []
    baseline = None if options.baseline_mm is None else options.baseline_mm / 1000
    known: dict[str, Any] = {"compare": compare, "board": board, "at": options.at, "baseline": baseline}
    known["pictures"] = _sizes(images)
    if PICTURES.fullmatch(paths[0].suffix):
        calibrated = _calibrated(paths, board, options.seconds)
        if isinstance(calibrated, Inspection):
            return calibrated
        return inspect(calibrated, photographs=paths, **known)
    add = _adding(images, board, options)
    with on_disk(paths[0]) as file:
        try:
            return inspect_file(file, size=options.size, photographs=images, prepare=add, **known)
        except CalibrationError as error:
            raise Refusal(str(error)) from error


def _adding(
    images: list[Path], board: Board | None, options: argparse.Namespace
) -> Callable[[Calibration], Calibration] | None:
    """What adds corners to a calibration that holds none: from files, or else from pictures of a known board."""
    if options.corners:
        return lambda calibration: _with_file(calibration, images, options)
    if board is None or not images:
        return None
    return lambda calibration: _with_corners(calibration, images, board, options.seconds)


def _with_file(calibration: Calibration, images: list[Path], options: argparse.Namespace) -> Calibration:
    """The calibration of one camera with the corners of --corners, in place of any that it holds."""
    from camviz_clinic.checks.pictures import with_detections

    if len(calibration.cameras) != 1:
        raise Refusal(f"--corners is for a calibration of one camera, this has {len(calibration.cameras)}.")
    (camera,) = calibration.cameras.values()
    ours = camera.intrinsics.width, camera.intrinsics.height
    found = corners_of(options, images, None if images else ours)
    theirs = found.detections.width, found.detections.height
    if theirs != ours:
        raise Refusal(
            f"{options.corners[0]}: these corners are of pictures of {theirs[0]}×{theirs[1]} pixels, and the "
            f"calibration is for {ours[0]}×{ours[1]}."
        )
    return replace(with_detections(calibration, found.detections, found.board), notes=calibration.notes + found.notes)


def _sizes(images: list[Path]) -> dict[str, tuple[int, int]]:
    """The pictures' sizes; a picture that is none is named and left out."""
    from camviz.colour.picture_files import PictureError
    from camviz_clinic.checks.pictures import sizes_of

    try:
        return sizes_of(images, lambda error: say(f"{error}; left out."))
    except PictureError as error:
        raise Refusal(f"{error}.") from error


def _calibrated(paths: list[Path], board: Board | None, seconds: float | None) -> Calibration | Inspection:
    """The calibration of a folder of pictures; or what is wrong with the board as described, where there is none."""
    if board is None:
        raise Refusal(
            f"{paths[0].parent}: these are pictures, which are calibrated first: say which board they show, such as "
            "--board 9x6 --square-mm 25."
        )
    from camviz_clinic.calibration import CannotCalibrate, calibrate
    from camviz_clinic.checks.inspection import inspect_board

    try:
        solved = calibrate(_detected(paths, board, seconds), board, board_warp="auto")
        return replace(solved, source=paths[0].parent)
    except CannotCalibrate as error:
        if found := inspect_board(paths, board, paths[0].parent):
            return found
        raise Refusal(f"{error}.") from error


def _with_corners(calibration: Calibration, images: list[Path], board: Board, seconds: float | None) -> Calibration:
    """The calibration with the corners of the board in the pictures, if it is one camera's and has none."""
    from camviz_clinic.calibration import CannotCalibrate
    from camviz_clinic.checks.inspection import inspect_board
    from camviz_clinic.checks.pictures import with_detections

    if len(calibration.cameras) != 1 or calibration.detections:
        return calibration
    try:
        return with_detections(calibration, _detected(images, board, seconds), board)
    except CannotCalibrate as error:
        if inspect_board(images, board):
            return calibration  # the inspection says why there are no corners
        raise Refusal(f"{error}.") from error


def _detected(paths: list[Path], board: Board, seconds: float | None) -> Detections:
    """The board's corners in pictures; those that are left out are named."""
    from camviz_clinic.calibration import detect

    with Bar() as bar:
        detections = detect(paths, board, progress=bar, seconds=seconds)
    for picture, why in detections.skipped:
        say(f"{picture}: skipped, {why}.")
    return detections


def _print(outcomes: dict[str, Outcome], several: bool, options: argparse.Namespace) -> None:
    if options.json:
        from camviz_clinic.files.output import json_text

        trees = [({"file": name} if several else {}) | each.as_tree() for name, each in outcomes.items()]
        tell_json(json_text(trees if several else trees[0]))
        return
    for name, outcome in outcomes.items():
        said = "\n".join([outcome.inspection.as_text(), *outcome.lines()])
        tell(f"{name}\n" * several + said + "\n" * several, PAINT, options.color)


def _report(inspection: Inspection, options: argparse.Namespace) -> None:
    from camviz_clinic.report.inspection import write_report

    first = Path((options.images or options.files)[0])
    folder = first if first.is_dir() else first.parent
    held = folder if options.images or PICTURES.fullmatch(first.suffix) or first.is_dir() else None
    write_whole(options.report, lambda path: write_report(inspection, path, images=held))
    if not options.json:
        tell(f"{options.report}: open it in a browser.")
