"""`camviz calibrate`: from pictures of a board to a calibration file."""

from __future__ import annotations

import argparse
import re
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

from camviz_clinic.calibration.camera_models import MODELS
from camviz_clinic.commands.boards import add_board, board_of
from camviz_clinic.commands.common import (
    Refusal,
    add_command,
    add_megapixels,
    bounded,
    millimetres,
    narrator,
    pixels,
    refuse_output,
    size,
)
from camviz_clinic.commands.corners import add_corners, corners_of
from camviz_clinic.commands.films import FILMS, add_frames, as_pictures
from camviz_clinic.commands.gate import EPILOG as GATE
from camviz_clinic.commands.gate import add_gate, given_gate, refuse_junit
from camviz_clinic.commands.outcome import judged, refuse_parallel, stamped, written
from camviz_clinic.commands.pictures import Bar, pictures
from camviz_clinic.commands.rig import (
    RIG,
    add_rig,
    by_camera,
    format_of_rig,
    placed,
    refuse_mixed,
    rig_of_pictures,
    unknown_parameters_refused,
    usual_name,
)
from camviz_clinic.commands.rolling import ROLLING, add_rolling, calibrate_rolling, is_rolling
from camviz_clinic.commands.several import BOARDS, add_boards, calibrate_several, refuse_beside_boards
from camviz_clinic.commands.telling import report, worth

if TYPE_CHECKING:
    from camviz_clinic.calibration import CannotCalibrate, Detections
    from camviz_clinic.files import Board, Calibration
    from camviz_clinic.files.corners import LoadedCorners

CALIBRATE = """\
Finds a board (a chessboard, a ChArUco board, Kalibr's AprilGrid, a grid of circles) in pictures and solves for the
camera that took them, or with --right for a pair of cameras. IMAGES are files, folders, or patterns such as
'left*.jpg'. Pictures without the board, of another size, or that cannot be read are named and skipped. Corners and
whole views that contradict the rest are set aside, named, and kept in the file. The board's bend is solved for, too,
where the views agree on it; where they agree less clearly, it must foretell views that were held out better. What is
written is OpenCV's YAML, with all that a later inspection needs. With --report, or where a gate is given, the
calibration is inspected as well; findings make it fail only where there is a gate.

With --corners nothing is looked for in pictures: the corners come from files of other programs, which docs/formats.md
lists. --board, --square-mm and --size say what those files do not hold. IMAGES are then for the report alone, and
--right names the files of the right camera's corners.

The pictures of a pair belong together by their names (left/007.png and right/007.png), else by the last number in them
(left07.jpg and right07.jpg), else by their order. So do the views in files of corners, but not by their order.
"""
EXAMPLES = """\
examples:
  camviz calibrate left*.jpg --board 9x6 --square-mm 25 --report report.html
  camviz calibrate film.mp4 --frames 20 --board 9x6 --square-mm 25
  camviz calibrate film.mp4 --rolling-shutter estimate --board 9x6 --square-mm 25
  camviz calibrate --corners corners.vnl --board 9x6 --square-mm 25 --size 640x480
  camviz calibrate --corners left.vnl --right right.vnl --board 9x6 --square-mm 25 --size 640x480
  camviz calibrate left/ --right right/ --board 9x6 --square-mm 25 -o stereo.yaml
  camviz calibrate --rig cam0/ cam1/ cam2/ --board 9x6 --square-mm 50 --model-of cam2=fisheye -o rig.toml
  camviz calibrate --rig cam0/ cam1/ --boards plate.toml --places solved.toml -o rig.toml
  camviz calibrate --rig cam0.mp4 cam1.mp4 --boards plate.toml -o rig.toml
  camviz calibrate shots/ --board 10x7 --square-mm 18 --charuco 5X5_100 --marker-mm 13.5 --model fisheye
  camviz calibrate shots/ --board 9x6 --square-mm 25 --fail-on warning --limit rms-px=0.5 --junit clinic.xml
"""
STATUS = """\
exit status:
  0  the calibration is written, and passes the gate where there is one
  1  it is written, and the gate fails it
  2  it cannot be solved, or the command cannot be used; one sentence on stderr says why
  3  something is missing on this machine
"""
MOST_WORDS = 1000
BOARD_WARP = ("auto", "on", "off")
FINDERS = ("auto", "sectors", "classic", "saddles")


def add(commands: Any) -> None:
    command = add_command(
        commands,
        "calibrate",
        calibrate,
        "calibrate a camera, a pair or a rig from pictures or films",
        f"{CALIBRATE}\n{FILMS}\n{ROLLING}\n{RIG}\n{BOARDS}",
    )
    models = "".join(f"  {name:11} {model.help}\n" for name, model in MODELS.items())
    command.epilog = f"models:\n{models}\n{EXAMPLES}\n{GATE}\n{STATUS}"
    command.add_argument("images", metavar="IMAGES", nargs="*", help="pictures, films, folders of them, or patterns")
    command.add_argument(
        "--right", metavar="IMAGES", nargs="+", help="those of the right camera, or files of its corners"
    )
    add_rig(command)
    add_boards(command)
    add_frames(command, "30, with --rolling-shutter 120")
    add_board(command, required=False, default=False)
    add_corners(command)
    add_baseline(command)
    command.add_argument("--size", metavar="WxH", type=size, help="image size in pixels, where FILES do not hold it")
    command.add_argument("--model", choices=list(MODELS), default="standard", help="which lens (default: standard)")
    command.add_argument("--fix", metavar="NAMES", default="", help="parameters not to solve for, such as k3 or p1,p2")
    command.add_argument(
        "--board-warp",
        choices=BOARD_WARP,
        default="auto",
        help="solve for the board's bend, as mrcal's calobject_warp: where the views agree on it, always, or never "
        "(default: auto)",
    )
    add_rolling(command)
    command.add_argument("--keep-outliers", action="store_true", help="set nothing aside")
    command.add_argument(
        "--finder", choices=FINDERS, help="how chessboards are found (default: auto; with --rolling-shutter saddles)"
    )
    command.add_argument("--workers", metavar="N", type=_count, help="processes (default: one for each processor)")
    add_seconds(command)
    command.add_argument(
        "-o", "--output", metavar="OUT", type=Path, help="(default: camera.yaml, of a rig rig with its format's ending)"
    )
    command.add_argument(
        "--conditions",
        metavar="TEXT",
        type=_remark,
        default="",
        help="what else it holds for, to be kept in OUT, such as 'focus taped at 2 m, binning 2x2, 21 °C'",
    )
    command.add_argument("--goal", metavar="PX", type=pixels, help="the largest expected error wanted (default: 1 px)")
    command.add_argument("--report", metavar="REPORT.html", type=Path, help="inspect it and write a page with pictures")
    add_megapixels(command)
    add_gate(command)


def add_baseline(command: argparse.ArgumentParser) -> None:
    command.add_argument(
        "--baseline-mm", metavar="MM", type=millimetres, help="the distance of a pair's cameras, to check the board by"
    )


def add_seconds(command: argparse.ArgumentParser) -> None:
    command.add_argument(
        "--seconds",
        metavar="S",
        type=bounded("a time in seconds", 0.1, 3600, "s"),
        help="how long to look for the board in one picture (default: 120 where several processes look)",
    )


def calibrate(options: argparse.Namespace) -> int:
    """Detect, solve and write the calibration, whole or not at all; inspect it where that is asked for."""
    _refuse_words(options)
    with as_pictures(
        options, {"model": options.model, "fixed": _how(options)["fixed"], "search": _search(options)}
    ) as said:
        return _of_stills(options, said)


def _of_stills(options: argparse.Namespace, of_films: tuple[str, ...]) -> int:
    """The same of pictures, with what is to be said of the films that they are from."""
    from camviz_clinic.calibration import CannotCalibrate

    left, right = pictures(options.images) if options.images else [], _right(options)
    single = {"camera": left} if options.boards else {"left": left, "right": right}
    cameras = by_camera(options.rig, pictures) if options.rig else single
    shots = [path for paths in cameras.values() for path in paths]
    sources = [*shots, *(options.corners or [])]
    form = format_of_rig(options) if options.rig else "opencv"
    options.output = options.output or Path(usual_name(form) if options.rig else "camera.yaml")
    refuse_output(options.output, "calibration", *sources)
    if options.report:
        refuse_output(options.report, "page", options.output, *sources)
    if options.places:
        refuse_output(options.places, "file", options.output, *sources)
    gate = given_gate(options)
    refuse_junit(options, options.output, *([options.report] if options.report else []), *sources)
    given = list(cameras.values()) if not options.corners else [left or options.corners, right]
    folders = dict(zip(cameras, (each[0].parent for each in given if each), strict=False))
    if options.boards:
        look = partial(_looked, options=options)
        return calibrate_several(cameras, folders, options, form, gate, look, _how(options), of_films)
    try:
        calibration = _of_corners(left, right, options) if options.corners else _of_pictures(cameras, options)
    except CannotCalibrate as error:
        raise Refusal(_complaint(error, shots, options)) from error
    refuse_parallel(calibration)
    calibration = replace(calibration, notes=(*of_films, *calibration.notes))
    calibration = stamped(calibration, calibration, list(cameras.values()), options)
    left_out = written(calibration, options, form)
    calibration = replace(calibration, source=options.output)
    told = narrator(options.output)
    for sentence in [*report(calibration), *(placed(calibration) if options.rig else [])]:
        told(sentence)
    for sentence in worth(calibration, options.goal):
        told(sentence)
    if doctored := "" if options.rig or is_rolling(options) else _prescribed(shots, options, calibration):
        told(f"Is the board as described? {doctored}")
    told(f"{options.output}: written{left_out}.")
    return judged(calibration, dict(zip(calibration.cameras, folders.values(), strict=True)), options, gate)


def _refuse_words(options: argparse.Namespace) -> None:
    """Refuses a command that lacks what it works on, or that says it twice."""
    square = options.square_mm or isinstance(options.board, Path)
    refuse_mixed(options)
    refuse_beside_boards(options)
    needed = {"IMAGES": options.images or options.rig, "--board": options.board, "--square-mm": square}
    if options.boards:
        needed = {"IMAGES": options.images or options.rig}
    missing = [word for word, given in needed.items() if not given]
    if missing and not options.corners:
        raise Refusal(f"the following arguments are required: {', '.join(missing)}; see `camviz calibrate --help`.")
    if options.size and not options.corners:
        raise Refusal("--size is for --corners: pictures have a size of their own.")


def _right(options: argparse.Namespace) -> list[Path]:
    """The right camera's pictures, or with --corners the files of its corners."""
    words = options.right or []
    return [Path(word) for word in words] if options.corners else pictures(words)


def _of_corners(paths: list[Path], right: list[Path], options: argparse.Namespace) -> Calibration:
    """The camera or the pair of the corners in files."""
    from camviz_clinic.calibration import calibrate

    found = corners_of(options, paths)
    if right:
        return _pair_of_corners(found, corners_of(options, [], files=right), options)
    told = found.detections.skipped
    calibration = _solved(lambda: calibrate(found.detections, found.board, options.model, **_how(options)), told)
    return replace(calibration, notes=found.notes + calibration.notes)


def _pair_of_corners(left: LoadedCorners, right: LoadedCorners, options: argparse.Namespace) -> Calibration:
    """The pair of two cameras' corners, whose views find each other by their names."""
    from camviz_clinic.calibration import calibrate_pair
    from camviz_clinic.calibration.pairing import paired_detections

    if left.board != right.board:
        described = (
            f"{each.columns}×{each.rows} inner corners, {1000 * each.square_size:.6g} mm apart"
            for each in (left.board, right.board)
        )
        raise Refusal(
            f"{options.right[0]}: expected the board of {options.corners[0]} ({next(described)}), got "
            f"{next(described)}."
        )
    both = paired_detections(left.detections, right.detections)
    skipped = both[0].skipped + both[1].skipped
    calibration = _solved(lambda: calibrate_pair(*both, left.board, options.model, **_how(options)), skipped)
    return replace(calibration, notes=tuple(dict.fromkeys(left.notes + right.notes)) + calibration.notes)


def _of_pictures(cameras: Mapping[str, list[Path]], options: argparse.Namespace) -> Calibration:
    """The camera, the pair or the rig that took pictures."""
    board = board_of(options)
    if options.rig:
        return rig_of_pictures(cameras, board, options, lambda paths: _looked(paths, board, options), _how(options))
    left, right = cameras.values()
    return _pair(left, right, board, options) if right else _single(left, board, options)


def _complaint(error: CannotCalibrate, paths: list[Path], options: argparse.Namespace) -> str:
    """Why there is no calibration; and what of the board is not as described, in place of a guess at what it is."""
    from camviz_clinic.calibration.detection import NoBoard

    doctored = _prescribed(paths, options)
    said = error.said if doctored and isinstance(error, NoBoard) else str(error)
    return f"{said}. {doctored}".rstrip()


def _prescribed(paths: list[Path], options: argparse.Namespace, calibration: Calibration | None = None) -> str:
    """What the pictures show that is not as the board is described, and what to try; empty where nothing is."""
    from camviz_clinic.checks.doctor import Shown, diagnose, prescription

    if options.corners or options.boards:
        return ""
    shown = Shown.of(paths, board_of(options))
    baseline = None if options.baseline_mm is None else options.baseline_mm / 1000
    return prescription(diagnose(replace(shown, calibration=calibration, baseline=baseline)))


def _single(paths: list[Path], board: Board, options: argparse.Namespace) -> Calibration:
    from camviz_clinic.calibration import calibrate

    detections = _looked(paths, board, options)
    if is_rolling(options):
        return _solved(lambda: calibrate_rolling(detections, board, options, _how(options)), detections.skipped)
    return _solved(lambda: calibrate(detections, board, options.model, **_how(options)), detections.skipped)


def _looked(paths: list[Path], board: Board, options: argparse.Namespace) -> Detections:
    from camviz_clinic.calibration import detect

    with Bar() as bar:
        return detect(paths, board, progress=bar, **_search(options))


def _pair(left: list[Path], right: list[Path], board: Board, options: argparse.Namespace) -> Calibration:
    from camviz_clinic.calibration import CannotCalibrate, calibrate_pair, detect_pair
    from camviz_clinic.calibration.pairing import paired
    from camviz_clinic.checks.doctor import Shown, diagnose, prescription

    pairs = paired(left, right)
    with Bar() as bar:
        both = detect_pair(pairs.left, pairs.right, board, progress=bar, **_search(options))
    skipped = both[0].skipped + both[1].skipped + pairs.lonely
    try:
        calibration = _solved(lambda: calibrate_pair(*both, board, options.model, **_how(options)), skipped)
    except CannotCalibrate as error:
        if turned := prescription(diagnose(Shown(board, {}, both=both), "corner-order")):
            raise Refusal(f"{error}. {turned}") from error
        raise
    return replace(calibration, skipped=calibration.skipped + pairs.lonely)


def _solved(solve: Callable[[], Calibration], skipped: Sequence[tuple[str, str]]) -> Calibration:
    """The solution; where there is none, the complaint names the pictures that are missing in it."""
    from camviz_clinic.calibration import CannotCalibrate

    try:
        with unknown_parameters_refused():
            return solve()
    except CannotCalibrate as error:
        named = ", ".join(f"{picture} ({why})" for picture, why in skipped[:3])
        more = f" and {len(skipped) - 3} more" * (len(skipped) > 3)
        raise CannotCalibrate(f"{error}{'; skipped: ' * bool(skipped)}{named}{more}") from error


def _search(options: argparse.Namespace) -> dict[str, Any]:
    """Saddles for a film in bursts: what sectors are off by lasts from frame to frame, and is not in the ±."""
    finder = options.finder or ("saddles" if is_rolling(options) else "auto")
    return {"finder": finder, "workers": options.workers, "seconds": options.seconds}


def _how(options: argparse.Namespace) -> dict[str, Any]:
    fixed = tuple(re.findall(r"[^,\s]+", options.fix))
    return {"fixed": fixed, "robust": not options.keep_outliers, "board_warp": options.board_warp}


def _remark(text: str) -> str:
    words = " ".join(text.split())
    if len(words) > MOST_WORDS:
        raise argparse.ArgumentTypeError(f"expected at most {MOST_WORDS} characters, got {len(words)}")
    return words


def _count(text: str) -> int:
    if not re.fullmatch("[0-9]{1,3}", text) or int(text) < 1:
        raise argparse.ArgumentTypeError(f"expected a number of processes from 1 to 999, got {text!r}")
    return int(text)
