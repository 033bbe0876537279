"""`camviz calibrate --boards`: cameras before several boards, and where these are."""

from __future__ import annotations

import argparse
import shlex
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

from camviz_clinic.commands.board_notes import board_sentences
from camviz_clinic.commands.boards import add_board, board_of
from camviz_clinic.commands.common import Parser, Refusal, narrator, write_whole
from camviz_clinic.commands.outcome import judged, stamped, written
from camviz_clinic.commands.rig import held_of, models_of, pm, unknown_parameters_refused
from camviz_clinic.commands.rolling import is_rolling

if TYPE_CHECKING:
    from camviz.poses import RigidTransform
    from camviz_clinic.calibration.detection import Detections
    from camviz_clinic.calibration.types import Board
    from camviz_clinic.checks.gate import Gate
    from camviz_clinic.rigs.boards import SolvedBoards

BOARDS = """\
With --boards FILE.toml several boards are in the pictures: the two sides of a plate, boards on the walls of a room,
loose markers. FILE has a line for each, its name and its options in quotes:
  front = "--board 9x6 --square-mm 30"
  back = "--board 5x4 --square-mm 40 --charuco 5X5_100"
  door = "--markers 4X4_50 --board 1x1 --first-id 7 --square-mm 80"
They are fixed to each other, and where is solved for; those that somebody moves alone stand in a line of their own:
  apart = [["door"], ["front", "back"]]
A place that is known is written as camviz writes it with --places: door = {board = "...", place = [[...], ...]}.
"""
APART = "apart"


@dataclass(frozen=True, eq=False)
class BoardsFile:
    """What a file says of several boards."""

    boards: dict[str, Board]
    words: dict[str, str]
    apart: tuple[tuple[str, ...], ...]
    known: dict[str, RigidTransform]


def add_boards(command: argparse.ArgumentParser) -> None:
    """The options of several boards."""
    command.add_argument("--boards", metavar="FILE.toml", type=Path, help="which boards, where there are several")
    command.add_argument(
        "--places", metavar="OUT.toml", type=Path, help="write the boards with their places, as --boards reads them"
    )


def refuse_beside_boards(options: argparse.Namespace) -> None:
    """Refuses what does not go with several boards."""
    if options.boards is None:
        if options.places:
            raise Refusal("--places is for several boards: name them with --boards.")
        return
    others = {
        "--board": options.board,
        "--square-mm": options.square_mm,
        "--right": options.right,
        "--corners": options.corners,
        "--rolling-shutter": is_rolling(options),
        "--board-warp on": options.board_warp == "on",
    }
    given = [word for word, value in others.items() if value]
    if given:
        raise Refusal(f"--boards says which boards there are, all flat: leave {' and '.join(given)} out.")


def read_boards(path: Path) -> BoardsFile:
    """The boards of a file; Refusal for one that does not say them."""
    from camviz_clinic.calibration.types import CalibrationError
    from camviz_clinic.files.format import File
    from camviz_clinic.files.tables import parse_toml

    try:
        tree = parse_toml(File(path).text)
    except CalibrationError as error:
        raise Refusal(f"{path}: {error}") from error
    apart = tree.pop(APART, [])
    boards, words, known = {}, {}, {}
    for name, said in tree.items():
        said = said if isinstance(said, Mapping) else {"board": said}
        if not isinstance(said.get("board"), str) or set(said) - {"board", "place"}:
            raise Refusal(f'{path}: {name}: expected options in quotes, such as "--board 9x6 --square-mm 30".')
        words[name] = said["board"]
        boards[name] = _board(f"{path}: {name}", said["board"])
        if "place" in said:
            known[name] = _place(f"{path}: {name}", said["place"])
    if len(boards) < 2:
        raise Refusal(f"{path}: expected at least two boards, got {len(boards)}.")
    return BoardsFile(boards, words, _apart(path, apart, boards), known)


def calibrate_several(
    cameras: Mapping[str, list[Path]],
    folders: Mapping[str, Path],
    options: argparse.Namespace,
    form: str,
    gate: Gate,
    look: Callable[[list[Path], Board], Detections],
    how: Mapping[str, Any],
    of_films: tuple[str, ...],
) -> int:
    """Solve, write and tell; what is inspected is what the largest board shows."""
    from camviz_clinic.calibration import CannotCalibrate

    file = read_boards(options.boards)
    try:
        solved = several_of_pictures(cameras, file, options, look, how)
    except CannotCalibrate as error:
        raise Refusal(f"{error}.") from error
    inspected = solved.through(solved.largest)
    noted = replace(solved.calibration, notes=(*of_films, *solved.calibration.notes, *board_sentences(solved)))
    calibration = stamped(noted, inspected, list(cameras.values()), options)
    left_out, told = written(calibration, options, form), narrator(options.output)
    for sentence in [*told_of(solved, file), *calibration.notes]:
        told(sentence)
    told(f"{options.output}: written{left_out}.")
    if options.places:
        write_whole(options.places, lambda path: path.write_text(places_toml(solved, file), encoding="utf-8"))
        told(f"{options.places}: written; --boards reads it.")
    inspected = replace(inspected, stamps=calibration.stamps, source=options.output, notes=calibration.notes)
    return judged(inspected, folders, options, gate)


def several_of_pictures(
    cameras: Mapping[str, list[Path]],
    file: BoardsFile,
    options: argparse.Namespace,
    look: Callable[[list[Path], Board], Detections],
    how: Mapping[str, Any],
) -> SolvedBoards:
    """Detected, paired and solved for; raises CannotCalibrate and Refusal."""
    from camviz_clinic.calibration import CannotCalibrate
    from camviz_clinic.calibration.detection import NoBoard
    from camviz_clinic.rigs import calibrate_boards, synchronised

    models, held = models_of(cameras, options), held_of(cameras, options)
    frames = synchronised(cameras) if len(cameras) > 1 else {name: range(len(paths)) for name, paths in cameras.items()}
    found: dict[str, dict[str, Detections]] = {}
    for name, paths in cameras.items():
        found[name] = {}
        for board in file.boards:
            try:
                seen = look(paths, file.boards[board])
            except NoBoard:
                continue
            except CannotCalibrate as error:
                raise CannotCalibrate(f"{name}, {board}: {error}") from error
            found[name][board] = replace(seen, places=tuple(frames[name][place] for place in seen.places))
        if not found[name]:
            raise CannotCalibrate(
                f"{name}: none of the boards {', '.join(file.boards)} is in its {len(paths)} pictures"
            )
    how = {key: value for key, value in how.items() if key != "board_warp"}
    with unknown_parameters_refused():
        return calibrate_boards(found, file.boards, models, apart=file.apart, known=file.known, held=held, **how)


def told_of(solved: SolvedBoards, file: BoardsFile) -> list[str]:
    """What came out, in sentences."""
    import numpy as np

    from camviz_clinic.checks.summary import Summary
    from camviz_clinic.commands.telling import camera_line
    from camviz_clinic.rigs import relative_pose

    adjustment, calibration = solved.adjustment, solved.calibration
    summary = Summary.of(solved.through(solved.largest))
    said = [f"{name}: in no picture, left out." for name in file.boards if name not in solved.boards]
    for name, camera in calibration.cameras.items():
        of = dict(
            zip(calibration.estimated[name], np.sqrt(np.diag(calibration.intrinsics_covariance[name])), strict=True)
        )
        used = adjustment.used[name]
        rms = float(np.sqrt(np.mean(np.sum(adjustment.residuals[name][used] ** 2, axis=-1))))
        said.append(camera_line(name, camera.intrinsics, of, summary.undecided(name), rms=rms, used=used))
    said += summary.withheld
    first = next(iter(calibration.cameras))
    beside = [relative_pose(adjustment, name, first) for name in calibration.cameras if name != first]
    beside += [solved.place(name) for group in solved.groups for name in group[1:]]
    for each in beside:
        x, y, z = (f"{1000 * value:.2f}".replace("-", "−") for value in each.pose.translation)
        if each.covariance.any():
            said.append(
                f"{each.of} stands {pm(1000 * each.distance, 1000 * each.distance_deviation)} mm from {each.seen_from} "
                f"at x = {x}, y = {y}, z = {z} mm, turned by "
                f"{pm(np.degrees(each.angle), np.degrees(each.angle_deviation))}°."
            )
    for group in solved.groups[1:]:
        said.append(f"{' and '.join(group)} {'moves' if len(group) == 1 else 'move'} apart from {solved.groups[0][0]}.")
    return said


def places_toml(solved: SolvedBoards, file: BoardsFile) -> str:
    """The boards with their places, as a file that `read_boards` reads."""
    lines = [f"{APART} = [{', '.join(_list(group) for group in file.apart)}]"] if file.apart else []
    firsts = {group[0] for group in solved.groups}
    for name, pose in solved.boards.items():
        words = f'"{file.words[name]}"'
        rows = ", ".join("[" + ", ".join(f"{value:.9g}" for value in row) + "]" for row in pose.as_matrix()[:3])
        lines.append(f"{name} = {words if name in firsts else f'{{board = {words}, place = [{rows}]}}'}")
    return "\n".join(lines) + "\n"


def _list(group: Sequence[str]) -> str:
    return "[" + ", ".join(f'"{name}"' for name in group) + "]"


def _board(where: str, words: str) -> Board:
    """The board of these options."""
    parser = Parser(prog="camviz board", add_help=False, allow_abbrev=False)
    add_board(parser, required=False, default=False)
    try:
        options, unknown = parser.parse_known_args(shlex.split(words))
        if unknown or options.board is None:
            raise Refusal("a board has both: --board COLUMNSxROWS (inner corners) and --square-mm MM.")
        return board_of(options)
    except (Refusal, ValueError) as error:
        raise Refusal(f"{where}: {error}") from error


def _place(where: str, rows: object) -> RigidTransform:
    import numpy as np

    from camviz.poses import RigidTransform

    try:
        matrix = np.array(rows, dtype=float)
        turn = matrix[:, :3]
        if matrix.shape != (3, 4) or not np.allclose(turn @ turn.T, np.eye(3), atol=1e-4) or np.linalg.det(turn) < 0:
            raise ValueError
    except (ValueError, TypeError, IndexError):
        raise Refusal(f"{where}: expected place to be three rows of four numbers, a rotation and metres.") from None
    return RigidTransform.from_matrix(np.vstack([matrix, [0, 0, 0, 1]]))


def _apart(path: Path, groups: object, boards: Mapping[str, Board]) -> tuple[tuple[str, ...], ...]:
    right = isinstance(groups, list) and all(
        isinstance(group, list) and all(isinstance(name, str) and name in boards for name in group) for group in groups
    )
    names = [name for group in groups for name in group] if right and isinstance(groups, list) else []
    if not right or len(set(names)) < len(names):
        raise Refusal(f"{path}: expected {APART} to be lists of the boards {', '.join(boards)}, each named once.")
    return tuple(tuple(group) for group in groups) if isinstance(groups, list) else ()
