"""The command line `camviz`: open the lessons, look at a machine, make and look at a calibration."""

from __future__ import annotations

import argparse
import os
import sys
from collections.abc import Sequence

import camviz
from camviz.commands import board, calibrate, convert, doctor, inspect, lab, mtf, noise, reproject, show, teacher
from camviz.commands.common import INTERRUPTED, OK, REFUSED, Parser, Refusal, say

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
  camviz show camera.yml                     write camera.html: open it in a browser, no network needed
  camviz show intrinsics.yml --size 640x480  the same, for a file that does not hold the image size
  camviz convert cam.yml model --to colmap   write the same camera for another program
  camviz reproject earth.jpg -o front.png --from equirectangular --to cube:front
                                             take a picture through another lens
  camviz noise shots/                        measure a sensor from its frames: gain, noise, patterns, dark current
  camviz mtf photo.png --roi 300,200,80,120  measure sharpness from a slanted edge
  camviz teacher for-me --slides             write the lessons with plans and keys, sheets and slides into ./for-me

exit status:
  0    done
  1    something is missing on this machine (camviz doctor says what, and how to mend it); or, of camviz inspect,
       something was found
  2    the command or the file it names cannot be used; one sentence on stderr says why
  130  interrupted
"""


def main(words: Sequence[str] | None = None) -> int:
    """Run `camviz` with these words (default: those it was started with) and return its exit status."""
    words, beyond = _split(sys.argv[1:] if words is None else list(words))
    try:
        options = parser().parse_args(words)
        if beyond and options.run is not lab.lab:
            raise Refusal("only `camviz lab` passes on what follows --.")
        return int(options.run(options, beyond) if options.run is lab.lab else options.run(options))
    except Refusal as refusal:
        return _say(str(refusal), refusal.status)
    except BrokenPipeError:
        sys.stdout = open(os.devnull, "w")  # noqa: SIM115 - for the interpreter's last flush
        return OK
    except OSError as error:
        return _say(f"{error.filename}: {error.strerror}" if error.filename else str(error), REFUSED)
    except KeyboardInterrupt:
        return INTERRUPTED


def parser() -> argparse.ArgumentParser:
    """All of the command line. A new subcommand is one function here and one that does it."""
    everything = Parser(
        "camviz", description=DESCRIPTION, epilog=EXAMPLES, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    everything.add_argument("--version", action="version", version=f"camviz {camviz.__version__}")
    commands = everything.add_subparsers(title="commands", metavar="COMMAND", required=True, parser_class=Parser)
    for subcommand in (lab, doctor, board, calibrate, inspect, show, convert, reproject, noise, mtf, teacher):
        subcommand.add(commands)
    return everything


def _split(words: list[str]) -> tuple[list[str], list[str]]:
    """What comes before -- and what comes after it."""
    at = words.index("--") if "--" in words else len(words)
    return words[:at], words[at + 1 :]


def _say(sentence: str, status: int) -> int:
    """One line on stderr, whatever a file name or a key may hold."""
    say(sentence)
    return status
