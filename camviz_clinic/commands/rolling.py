"""`camviz calibrate FILM --rolling-shutter`: the camera of a film whose rows are read one after the other."""

from __future__ import annotations

import argparse
import re
from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any

from camviz_clinic.commands.common import Refusal
from camviz_clinic.commands.pictures import Bar

if TYPE_CHECKING:
    from camviz_clinic.calibration import Board, Calibration, Detections

OFF, ESTIMATE = "off", "estimate"
FRAMES = 120
MOST_US = 1000.0  # from row to row: 480 of them take half a second
ROLLING = """\
With --rolling-shutter the rows of a film are read one after the other, so many µs apart, or as far apart as the film
tells (estimate). Bursts of its frames that follow one another are used, and the board's path in time is solved for
with the camera. The delay is only estimated where rows clearly explain the film better than columns and diagonals.
"""


def add_rolling(command: argparse.ArgumentParser) -> None:
    command.add_argument(
        "--rolling-shutter",
        metavar="DELAY",
        type=_delay,
        default=OFF,
        help="of a film: 'estimate' the time from one row to the next, or hold it at so many µs; below 0 where the "
        "bottom row is read first (default: off)",
    )


def _delay(text: str) -> str | float:
    """off, estimate, or seconds."""
    if text in (OFF, ESTIMATE):
        return text
    number = text.removesuffix("us").removesuffix("µs").strip()
    if not re.fullmatch(r"[-+]?[0-9]*\.?[0-9]+", number) or abs(float(number)) > MOST_US:
        raise argparse.ArgumentTypeError(
            f"expected estimate, off, or the µs from row to row, up to {MOST_US:g}, got {text!r}"
        )
    return float(number) / 1e6


def is_rolling(options: argparse.Namespace) -> bool:
    """Whether a rolling shutter is asked for."""
    return bool(options.rolling_shutter != OFF)


def refuse_no_film(options: argparse.Namespace, films: int, others: int) -> None:
    """Refuses a rolling shutter of anything but one film."""
    given = {"--rig": options.rig, "--right": options.right, "--corners": options.corners}
    if named := [word for word, value in given.items() if value]:
        raise Refusal(f"--rolling-shutter is for the film of one camera: leave {' and '.join(named)} out.")
    if others or films != 1:
        raise Refusal(
            "--rolling-shutter is for one film, whose frames have times: "
            + (f"got {films} films." if not others else "pictures have none.")
        )


def film_in_bursts(path: Path, room: Path, options: argparse.Namespace) -> tuple[list[Path], tuple[str, ...]]:
    """The frames as pictures, and what is to be said of the film; their times are kept in the options."""
    from camviz_clinic.films import FilmError
    from camviz_clinic.films.bursts import bursts

    with Bar("frames read") as reading:
        try:
            taken = bursts(path, room, options.frames or FRAMES, reading)
        except FilmError as error:
            raise Refusal(f"{error}.") from error
    options.times = {each.name: time for each, time in zip(taken.pictures, taken.times_s, strict=True)}
    return list(taken.pictures), taken.notes


def calibrate_rolling(
    detections: Detections, board: Board, options: argparse.Namespace, how: Mapping[str, Any]
) -> Calibration:
    """The camera; raises CannotCalibrate, and Refusal where the film tells no rolling shutter."""
    import numpy as np

    from camviz_clinic.calibration import calibrate
    from camviz_clinic.calibration.rolling_solving import NotByRows, with_rolling_shutter
    from camviz_clinic.rigs.start import MOST_ALONE, varied

    some = detections.only(varied(detections.corners, MOST_ALONE))
    start = calibrate(some, board, options.model, fixed=how["fixed"], robust=False)
    times = np.array([options.times[picture] for picture in detections.pictures])
    held = None if options.rolling_shutter == ESTIMATE else float(options.rolling_shutter)
    try:
        return with_rolling_shutter(start, detections, times, held, robust=how["robust"], board_warp=how["board_warp"])
    except NotByRows as error:
        raise Refusal(f"{error}. Leave --rolling-shutter out, or say the µs from row to row.") from error
