"""What the subcommands share: refusals, exit statuses, files that are written whole."""

from __future__ import annotations

import argparse
import os
import re
import sys
from collections.abc import Callable
from contextlib import suppress
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    import numpy as np

    from camviz.calibration.types import Board, Calibration

OK, LACKING, REFUSED, INTERRUPTED = 0, 1, 2, 130


class Refusal(Exception):  # noqa: N818 - said to a person, not raised at a programmer
    """What a command cannot do, in one sentence."""

    def __init__(self, sentence: str, status: int = REFUSED) -> None:
        super().__init__(sentence)
        self.status = status


def say(sentence: str) -> None:
    """One line on stderr, whatever a file name or a key may hold."""
    printable = "".join(c if c.isprintable() else " " for c in sentence)
    with suppress(OSError):
        print(f"camviz: {' '.join(printable.split())}", file=sys.stderr)


class Parser(argparse.ArgumentParser):
    """A parser whose errors are one sentence; `listing` makes what its help says beside, when it is asked for."""

    listing: Callable[[], str] | None = None

    def format_help(self) -> str:
        """The help, with the listing before the examples."""
        if self.listing:
            self.epilog, self.listing = "\n\n".join(filter(None, [self.listing(), self.epilog])), None
        return super().format_help()

    def error(self, message: str) -> Any:
        raise Refusal(f"{message}; see `{self.prog} --help`.")


def add_command(commands: Any, name: str, run: Callable[..., int], what: str, description: str) -> Parser:
    command: Parser = commands.add_parser(
        name, help=what, description=description, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    command.set_defaults(run=run)
    return command


def loaded(path: Path, size: tuple[int, int] | None) -> Calibration:
    from camviz.files import CalibrationError, load

    try:
        return load(path, size=size)
    except CalibrationError as error:
        raise Refusal(str(error)) from error


def write_whole(path: Path, write: Callable[[Path], object]) -> None:
    """Write a file by way of another beside it, so that there is never half a file under its name."""
    target = path.resolve()  # a link is followed, not replaced
    try:
        with TemporaryDirectory(dir=target.parent, prefix=".camviz-") as beside:
            temporary = Path(beside) / "page.part"
            write(temporary)
            os.replace(temporary, target)
    except OSError as error:  # whose file name is that of the part
        raise Refusal(f"{path}: cannot be written ({error.strerror or error}).") from error


def refuse_output(output: Path, what: str, *sources: Path) -> None:
    """Refuses a name that `what` (a page, a calibration …) cannot be written under, or that one of `sources` has."""
    if "\0" in str(output):
        raise Refusal(f"{str(output)!r} is not a file name.")
    if output.is_dir():
        raise Refusal(f"{output}: expected the name of a {what} to write, this is a directory.")
    if output.exists() and not output.is_file():  # a device or a pipe, which would be replaced
        raise Refusal(f"{output}: expected the name of a {what} to write, this is not a regular file.")
    parent = (output.resolve() if output.is_symlink() else output).parent
    if not parent.is_dir():
        raise Refusal(f"{output}: there is no directory {parent} to write into.")
    if not os.access(parent, os.W_OK):
        raise Refusal(f"{output}: cannot be written (the directory {parent} is not yours to write into).")
    for source in sources:
        if output.exists() and source.exists() and output.samefile(source):
            raise Refusal(f"{output}: this would overwrite {source}; choose another name with -o.")


def read_picture(path: Path) -> np.ndarray:
    """The picture as it is in the file: grey, BGR or BGRA."""
    import cv2
    import numpy as np

    from camviz.panoramas.reprojection import LONGEST

    if not path.is_file():
        raise Refusal(f"{path}: there is no such picture." if not path.exists() else f"{path}: this is not a file.")
    data = np.frombuffer(path.read_bytes(), np.uint8)
    log = cv2.utils.logging
    level = log.setLogLevel(log.LOG_LEVEL_SILENT)  # what is wrong with a picture is said here, once
    try:
        picture = cv2.imdecode(data, cv2.IMREAD_UNCHANGED) if data.size else None
    except cv2.error:
        picture = None
    finally:
        log.setLogLevel(level)
    if picture is None:
        raise Refusal(f"{path}: expected a picture (PNG, JPEG, TIFF, WebP …), this cannot be read as one.")
    if max(picture.shape[:2]) > LONGEST:
        raise Refusal(f"{path}: expected at most {LONGEST} pixels a side, got {picture.shape[1]} × {picture.shape[0]}.")
    return np.asarray(picture)


def numbers(text: str) -> tuple[int, int]:
    """9x6 as (9, 6)."""
    match = re.fullmatch(r"([0-9]{1,3})\s*[xX×*,]\s*([0-9]{1,3})", text.strip())
    if not match or not (2 <= int(match[1]) <= 200 and 2 <= int(match[2]) <= 200):
        raise argparse.ArgumentTypeError(f"expected inner corners as COLUMNSxROWS, such as 9x6, got {text!r}")
    return int(match[1]), int(match[2])


def millimetres(text: str) -> float:
    """A length of 0.1 mm to 10 m."""
    try:
        length = float(text)
    except ValueError:
        length = 0.0
    if not 0.1 <= length <= 10_000:
        raise argparse.ArgumentTypeError(f"expected a length in millimetres, from 0.1 to 10000, got {text!r}")
    return length


def add_board(command: argparse.ArgumentParser, required: bool = True, default: bool = True) -> None:
    """The options that say which board it is; one of 9x6 and 25 mm, or none, where they are not required."""
    corners, side = (" (default: 9x6)", " (default: 25)") if default and not required else ("", "")
    command.add_argument(
        "--board",
        metavar="9x6",
        type=numbers,
        required=required,
        default=(9, 6) if default else None,
        help="inner corners, where four squares meet, by columns and rows" + corners,
    )
    command.add_argument(
        "--square-mm",
        metavar="MM",
        type=millimetres,
        required=required,
        default=25.0 if default else None,
        help="the side of a square" + side,
    )
    command.add_argument(
        "--charuco", metavar="DICT", help="a ChArUco board with markers of this dictionary, such as 5X5_100"
    )
    command.add_argument("--marker-mm", metavar="MM", type=millimetres, help="the side of a marker (default: 3/4)")


def board_of(options: argparse.Namespace) -> Board:
    """The board of the options."""
    from camviz.calibration.finding import charuco_dictionary
    from camviz.calibration.types import Board

    if options.marker_mm is not None and options.charuco is None:
        raise Refusal("--marker-mm is for a ChArUco board: name its dictionary with --charuco.")
    columns, rows = options.board
    try:
        if options.charuco is None:
            return Board(columns, rows, options.square_mm / 1000)
        marker = options.marker_mm or 0.75 * options.square_mm
        name = "DICT_" + options.charuco.removeprefix("DICT_")
        board = Board(columns, rows, options.square_mm / 1000, marker / 1000, name)
        charuco_dictionary(board)
    except ValueError as error:
        raise Refusal(f"{error}.") from error
    return board


def size(text: str) -> tuple[int, int]:
    """640x480 as (640, 480)."""
    match = re.fullmatch(r"([0-9]{1,6})\s*[xX×*,]\s*([0-9]{1,6})", text.strip())
    if not match:
        raise argparse.ArgumentTypeError(f"expected WIDTHxHEIGHT in pixels, such as 640x480, got {text!r}")
    return int(match[1]), int(match[2])
