"""What the subcommands share: refusals, exit statuses, files that are written whole."""

from __future__ import annotations

import argparse
import errno
import math
import os
import re
import shutil
import sys
from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager
from dataclasses import replace
from difflib import get_close_matches
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import TYPE_CHECKING, Any

from camviz_clinic.commands.terminal import say, tell

if TYPE_CHECKING:
    import numpy as np

    from camviz.cameras import Camera
    from camviz_clinic.calibration.types import Calibration

OK, FOUND, REFUSED, LACKING, INTERRUPTED = 0, 1, 2, 3, 130
STREAM = Path("-")  # stdin or stdout in place of a file
LARGEST = 2**28  # bytes read from stdin
EXHAUSTED = (errno.EMFILE, errno.ENFILE, errno.ENOMEM, errno.EAGAIN)  # the machine's limits, whatever the file


class Refusal(Exception):  # noqa: N818 - said to a person, not raised at a programmer
    """What a command cannot do, in one sentence."""

    def __init__(self, sentence: str, status: int = REFUSED) -> None:
        super().__init__(sentence)
        self.status = status


class Parser(argparse.ArgumentParser):
    """A parser whose errors are one sentence, with what may have been meant.

    `listing` makes what its help says beside, when it is asked for.
    """

    listing: Callable[[], str] | None = None

    def format_help(self) -> str:
        """The help, with the listing before the examples."""
        if self.listing:
            self.epilog, self.listing = "\n\n".join(filter(None, [self.listing(), self.epilog])), None
        return super().format_help()

    def error(self, message: str) -> Any:
        raise Refusal(f"{message}; see `{self.prog} --help`.")

    def _check_value(self, action: argparse.Action, value: Any) -> None:
        try:
            super()._check_value(action, value)
        except argparse.ArgumentError as error:
            raise argparse.ArgumentError(
                action, f"{error.message}{did_you_mean(value, action.choices or ())}"
            ) from None


def did_you_mean(word: object, known: Iterable[object]) -> str:
    """ "; did you mean inspect?", where a known word is near; numbers, too, are taken as they are written."""
    near = get_close_matches(str(word), map(str, known), 1)
    return f"; did you mean {near[0]}?" if near else ""


def add_colour(command: argparse.ArgumentParser) -> None:
    command.add_argument(
        "--color", choices=("auto", "always", "never"), default="auto", help="auto: on a terminal, without NO_COLOR"
    )


def add_megapixels(command: argparse.ArgumentParser) -> None:
    """The option that says how large a picture may be; `camviz_clinic.commands.command` heeds it."""
    command.add_argument(
        "--megapixels",
        metavar="N",
        type=bounded("a number of megapixels", 0.01, 1000),
        help="the largest picture that is read (default: 64, or what CAMVIZ_MEGAPIXELS says)",
    )


def add_command(commands: Any, name: str, run: Callable[..., int], what: str, description: str) -> Parser:
    command: Parser = commands.add_parser(
        name, help=what, description=description, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    command.set_defaults(run=run, parser=command)
    return command


def loaded(path: Path, size: tuple[int, int] | None) -> Calibration:
    """The calibration of a file, or of stdin where the file is called -."""
    from camviz_clinic.files import CalibrationError, load

    with on_disk(path) as file:
        try:
            return replace(load(file, size=size), source=path)
        except CalibrationError as error:
            raise Refusal(str(error)) from error


def chosen_camera(calibration: Calibration, options: argparse.Namespace) -> Camera:
    """The camera that --camera names, or the only one of the calibration."""
    names = list(calibration.cameras)
    if options.camera is None and len(names) > 1:
        raise Refusal(
            f"{options.calibration}: the cameras are {', '.join(names)}: say with --camera which one took the pictures."
        )
    name = options.camera or names[0]
    if name not in names:
        raise Refusal(f"{options.calibration}: expected --camera to be one of {', '.join(names)}, got {name}.")
    return calibration.cameras[name]


@contextmanager
def whole_folder(output: Path) -> Iterator[Path]:
    """A folder to write into, which takes the name `output` when all is done; of a failure nothing stays.

    Raises Refusal where the name is that of something else than an empty folder, or cannot be had.
    """
    refuse_folder(output)
    target = output.resolve()
    with _refused(output), TemporaryDirectory(dir=target.parent, prefix=".camviz-") as room:
        part = Path(room) / "part"
        part.mkdir()
        yield part
        if target.exists():
            target.rmdir()
        os.replace(part, target)


@contextmanager
def _refused(output: Path) -> Iterator[None]:
    """Tells what the system cannot write as of `output`: the error's own file name is that of a part of it."""
    try:
        yield
    except BrokenPipeError:
        raise
    except OSError as error:
        refuse_exhausted(error)
        raise Refusal(f"{output}: cannot be written ({error.strerror or error}).") from error


@contextmanager
def on_disk(path: Path) -> Iterator[Path]:
    """The file itself; for - what stdin holds, in a file of its own as long as it is needed."""
    if path != STREAM:
        yield path
        return
    with TemporaryDirectory() as room:
        held = Path(room) / "stdin"
        data = sys.stdin.buffer.read(LARGEST + 1)
        if len(data) > LARGEST:
            raise Refusal(f"stdin: expected at most {LARGEST >> 20} MB.")
        held.write_bytes(data)
        try:
            yield held
        except Refusal as refusal:
            raise Refusal(str(refusal).replace(str(held), "stdin"), refusal.status) from refusal


def narrator(output: Path) -> Callable[[str], object]:
    """What says how it went: on stdout, or on stderr where stdout is the output."""
    return say if output == STREAM else tell


def write_whole(path: Path, write: Callable[[Path], object], name: str = "page.part") -> None:
    """Write a file by way of another beside it, so that there is never half a file under its name; - is stdout.

    A file that is replaced keeps its permissions. `name` is what `write` sees, where the ending matters to it.
    """
    target = path.resolve()  # a link is followed, not replaced
    place = None if path == STREAM else target.parent
    with _refused(path), TemporaryDirectory(dir=place, prefix=".camviz-") as beside:
        temporary = Path(beside) / name
        write(temporary)
        if path == STREAM:
            sys.stdout.flush()
            sys.stdout.buffer.write(temporary.read_bytes())
            return
        if target.exists():
            shutil.copymode(target, temporary)
        os.replace(temporary, target)


def write_calibration(
    calibration: Calibration, output: Path, form: str, whole: Calibration | None = None
) -> tuple[str, ...]:
    """Write a calibration to a file or to stdout; what of it, or of the `whole`, is lost: see `files.write`."""
    from camviz_clinic.files.registry import written
    from camviz_clinic.files.writing import write

    if output != STREAM:
        return write(calibration, output, form, whole)
    if form in written() and written()[form].is_folder(calibration):
        raise Refusal(f"-: {written()[form].title} is a folder, which stdout cannot hold: name one.")
    lost: list[str] = []
    write_whole(output, lambda path: lost.extend(write(calibration, path, form, whole)), "camera.yml")
    return tuple(lost)


def refuse_exhausted(error: OSError) -> None:
    """Where a limit of this machine is the reason, blame the limit and not the file at which it showed."""
    if error.errno in EXHAUSTED:
        limit = " (`ulimit -n` says how many this process may open)" if error.errno == errno.EMFILE else ""
        raise Refusal(f"this machine gives no more: {error.strerror}{limit}.", LACKING) from error


def refuse_output(output: Path, what: str, *sources: Path) -> None:
    """Refuses a name that `what` (a page, a calibration …) cannot be written under, or that one of `sources` has."""
    if output == STREAM:
        return
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


def refuse_folder(output: Path) -> None:
    """Refuses a name under which no new folder can be written."""
    if "\0" in str(output):
        raise Refusal(f"{str(output)!r} is not a file name.")
    if output == STREAM:
        raise Refusal("-: a folder is written, which stdout cannot hold; name it with -o.")
    if output.exists() and not (output.is_dir() and not any(output.iterdir())):
        raise Refusal(f"{output}: expected the name of a new folder, or of an empty one.")
    parent = output.resolve().parent
    if not parent.is_dir():
        raise Refusal(f"{output}: there is no directory {parent} to write into.")
    if not os.access(parent, os.W_OK):
        raise Refusal(f"{output}: cannot be written (the directory {parent} is not yours to write into).")


def read_picture(path: Path) -> np.ndarray:
    """The picture as it is in the file: grey, BGR or BGRA."""
    from camviz.colour.picture_files import PictureError
    from camviz.colour.picture_files import read_picture as read
    from camviz.panoramas.reprojection import LONGEST

    with on_disk(path) as file:
        try:
            picture = read(file)
        except PictureError as error:
            raise Refusal(f"{error}.") from error
    if max(picture.shape[:2]) > LONGEST:
        raise Refusal(f"{path}: expected at most {LONGEST} pixels a side, got {picture.shape[1]} × {picture.shape[0]}.")
    return picture


def bounded(what: str, low: float, high: float, unit: str = "") -> Callable[[str], float]:
    """Reads an option's number within bounds; its unit may stand behind it."""

    def number(text: str) -> float:
        try:
            value = float(text.removesuffix(unit))
        except ValueError:
            value = math.nan
        if not low <= value <= high:
            raise argparse.ArgumentTypeError(f"expected {what}, from {low:g} to {high:.0f}, got {text!r}")
        return value

    return number


millimetres = bounded("a length in millimetres", 0.1, 10_000)
metres = bounded("a distance in metres", 0.01, 10_000, "m")
pixels = bounded("a number of pixels", 0.01, 100, "px")


def size(text: str) -> tuple[int, int]:
    """640x480 as (640, 480)."""
    match = re.fullmatch(r"([0-9]{1,6})\s*[xX×*,]\s*([0-9]{1,6})", text.strip())
    if not match:
        raise argparse.ArgumentTypeError(f"expected WIDTHxHEIGHT in pixels, such as 640x480, got {text!r}")
    return int(match[1]), int(match[2])
