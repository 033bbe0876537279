"""The command line `camviz`: open the lessons, look at a machine, make and look at a calibration."""

from __future__ import annotations

import argparse
import os
import signal
import sys
import warnings
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from importlib.metadata import entry_points
from types import ModuleType

import camviz
from camviz_clinic.commands import (
    board,
    calibrate,
    check,
    completion,
    convert,
    dataset,
    handeye,
    inspect,
    mtf,
    noise,
    poses,
    reproject,
    show,
    undistort,
)
from camviz_clinic.commands.common import INTERRUPTED, OK, REFUSED, Parser, Refusal, did_you_mean, refuse_exhausted
from camviz_clinic.commands.terminal import say

DESCRIPTION = """\
camviz is one virtual camera, taken apart piece by piece: lessons to do in JupyterLab,
and pictures of what a calibration file says about a real camera.
"""
EXAMPLES = """\
examples:
  camviz lab                                 do the lessons, in ./camviz-lessons
  camviz doctor                              see what this machine can do, and how to mend it
  camviz board -o board.pdf                  make a board to print
  camviz calibrate left*.jpg --board 9x6 --square-mm 25
                                             calibrate a camera from pictures of it, into camera.yaml
  camviz inspect camera.yml                  say what is wrong with a calibration, and what to do
  camviz check camera.yaml new/*.jpg         say whether it still holds, by new pictures of the board
  camviz handeye camera.yaml poses.csv new/*.jpg
                                             find where the camera sits on a robot, and what is wrong with its poses
  camviz poses camera.yaml photos/           say where the camera stood for each photograph of its board
  camviz undistort camera.yaml photos/ -o flat/
                                             take the distortion out of photographs
  camviz dataset photos/ --board 10x7 --square-mm 18 --charuco 5X5_100 -o scene/
                                             make a posed dataset of photographs, for nerfstudio, COLMAP and NumPy
  camviz show camera.yml                     write camera.html: open it in a browser, no network needed
  camviz show intrinsics.yml --size 640x480  the same, for a file that does not hold the image size
  camviz convert cam.yml model --to colmap   write the same camera for another program
  camviz reproject earth.jpg -o front.png --from equirectangular --to cube:front
                                             take a picture through another lens
  camviz noise shots/                        measure a sensor from its frames: gain, noise, patterns, dark current
  camviz mtf photo.png --roi 300,200,80,120  measure sharpness from a slanted edge
  camviz teacher for-me --slides             write the lessons with plans and keys, sheets and slides into ./for-me
  camviz class 05 --host 192.168.4.1         let a class vote on the lesson's questions, with telephones or notebooks
  camviz bundle /media/stick                 write one zip for a USB stick that installs with no network

A file called - is stdin, or stdout. Colour is for terminals; NO_COLOR and --color never turn it off.

exit status:
  0    done
  1    camviz inspect, check or handeye found something, or a project's gate fails what camviz calibrate wrote
  2    the command or the file it names cannot be used; one sentence on stderr says why
  3    something is missing on this machine; camviz doctor says what, and how to mend it
  4    camviz check cannot tell from these pictures
  130  interrupted (Ctrl-C); 143 ended by SIGTERM, 129 by a terminal that was closed
"""
COMMANDS = (
    board,
    calibrate,
    inspect,
    check,
    handeye,
    poses,
    undistort,
    dataset,
    show,
    convert,
    reproject,
    noise,
    mtf,
    completion,
)
"""The clinic's own. Other packages add theirs by an entry point of the group `camviz.commands`: a tuple of modules."""


class Ended(BaseException):
    """A signal that ends the command; what it was writing is removed on the way out."""


def main(words: Sequence[str] | None = None) -> int:
    """Run `camviz` with these words (default: those it was started with) and return its exit status."""
    if words is not None:
        return _status(list(words))
    with _ended_by_signals(), _quiet_libraries(sys.argv[1:2] == ["lab"]):
        return _status(sys.argv[1:])


def _status(words: list[str]) -> int:
    try:
        try:
            return _run(words)
        except OSError as error:
            refuse_exhausted(error)
            raise
    except Refusal as refusal:
        return _say(str(refusal), refusal.status)
    except BrokenPipeError:
        sys.stdout = open(os.devnull, "w")  # noqa: SIM115 - for the interpreter's last flush
        return OK
    except OSError as error:
        return _say(f"{error.filename}: {error.strerror}" if error.filename else str(error), REFUSED)
    except KeyboardInterrupt:
        return INTERRUPTED
    except Ended as ended:
        return 128 + int(ended.args[0])


def _run(words: list[str]) -> int:
    everything = parser()
    if not words:
        everything.print_help()
        return OK
    passing = {name for each in commands() for name in getattr(each, "PASSES_ON", ())}
    given = words[0]
    words, beyond = _split(words) if words[0] in passing else (words, [])
    options, unknown = everything.parse_known_args(words)
    if unknown:
        near = did_you_mean(unknown[0], options.parser._option_string_actions)
        raise Refusal(f"unrecognized arguments: {' '.join(unknown)}{near}; see `{options.parser.prog} --help`.")
    with _pictures_allowed(getattr(options, "megapixels", None)):
        return int(options.run(options, beyond) if given in passing else options.run(options))


@contextmanager
def _pictures_allowed(megapixels: float | None) -> Iterator[None]:
    """Pictures as large as --megapixels says; without it nothing is imported."""
    if megapixels is None:
        yield
        return
    from camviz.colour.picture_files import allowing

    with allowing(megapixels):
        yield


@contextmanager
def _ended_by_signals() -> Iterator[None]:
    """SIGTERM, and SIGHUP where it is not ignored, end the command as Ctrl-C does: nothing half written stays."""

    def end(number: int, _: object) -> None:
        raise Ended(number)

    numbers = [getattr(signal, name) for name in ("SIGTERM", "SIGHUP") if hasattr(signal, name)]
    held = [number for number in numbers if signal.getsignal(number) is signal.SIG_DFL]
    for number in held:
        signal.signal(number, end)
    try:
        yield
    finally:
        for number in held:
            signal.signal(number, signal.SIG_DFL)


@contextmanager
def _quiet_libraries(heard: bool) -> Iterator[None]:
    """What libpng, libjpeg and NumPy mutter about a picture is not said beside the command's own sentence."""
    if heard or sys.warnoptions:
        yield
        return
    warnings.simplefilter("ignore")
    try:
        aside = os.dup(2)
    except OSError:  # closed
        yield
        return
    nowhere = os.open(os.devnull, os.O_WRONLY)
    os.dup2(nowhere, 2)
    os.close(nowhere)
    sys.stderr = open(aside, "w", encoding=sys.stderr.encoding, errors="backslashreplace", buffering=1)  # noqa: SIM115
    yield
    sys.stderr.flush()
    os.dup2(aside, 2)


def commands() -> list[ModuleType]:
    """The module of every command: what other packages bring first, then the clinic's own."""
    found = {each.name: each for each in entry_points(group="camviz.commands")}
    return [*(module for name in sorted(found) for module in found[name].load()), *COMMANDS]


def parser() -> argparse.ArgumentParser:
    """All of the command line."""
    everything = Parser(
        "camviz", description=DESCRIPTION, epilog=EXAMPLES, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    everything.add_argument("--version", action="version", version=f"camviz {camviz.__version__}")
    subparsers = everything.add_subparsers(title="commands", metavar="COMMAND", required=True, parser_class=Parser)
    for subcommand in commands():
        subcommand.add(subparsers)
    return everything


def _split(words: list[str]) -> tuple[list[str], list[str]]:
    """What comes before -- and what comes after it."""
    at = words.index("--") if "--" in words else len(words)
    return words[:at], words[at + 1 :]


def _say(sentence: str, status: int) -> int:
    """One line on stderr, whatever a file name or a key may hold."""
    say(sentence)
    return status
