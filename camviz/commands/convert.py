"""`camviz convert`: a calibration for another program."""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import Any

from camviz.commands.common import (
    OK,
    Refusal,
    add_command,
    did_you_mean,
    loaded,
    narrator,
    size,
    write_calibration,
)

CONVERT = """\
Writes a calibration for another program. Pixels, lens and poses are carried from one set of conventions to the other
(half pixels, axes, order of coefficients, which way a transform goes), and what is written is read back and compared
before it takes its name: it says the same, or it is not written. A format that has no place for something in the
cameras is refused with the reason; what it cannot hold beside them (corners, board poses, names) is named and left
out. The format of IN is told by its content. A COLMAP model is a folder.
"""

EXAMPLES = """\
examples:
  camviz convert camera.yml camera.cameramodel --to mrcal
  camviz convert - - --to ros < camera.yml > camera.yaml
  camviz convert stereo.yml chain.yaml --to kalibr --size 640x480
  camviz convert sparse/0 left.yml --to opencv --camera left.jpg --first-as-world
"""


def add(commands: Any) -> None:
    command = add_command(commands, "convert", convert, "write a calibration for another program", CONVERT)
    command.epilog, command.listing = EXAMPLES, _listing
    command.add_argument("file", metavar="IN", type=Path, help="the calibration, or the folder of a COLMAP model")
    command.add_argument("output", metavar="OUT", type=Path, help="the file to write; for COLMAP a new folder")
    command.add_argument("--to", metavar="FORMAT", required=True, help="one of the formats below")
    command.add_argument("--size", metavar="WxH", type=size, help="image size in pixels, where IN does not hold it")
    command.add_argument("--camera", metavar="NAME", help="only this one of the cameras")
    command.add_argument(
        "--first-as-world", action="store_true", help="make the first camera's frame the world, as some formats must"
    )


def _listing() -> str:
    from camviz.files.registry import listing

    return listing()


def convert(options: argparse.Namespace) -> int:
    """Write a calibration in another format, whole or not at all."""
    calibration = loaded(options.file, options.size)
    if options.output.exists() and options.output.samefile(options.file):
        raise Refusal(f"{options.output}: this would overwrite the calibration; choose another name.")
    from camviz.files import CalibrationError
    from camviz.files.registry import written
    from camviz.files.writing import alone, from_first_camera

    known = written()
    if options.to not in known:
        near = did_you_mean(options.to, known)
        raise Refusal(f"format: expected one of {', '.join(known)}, got {options.to!r}{near}.")

    try:
        if options.camera is not None:
            calibration = alone(calibration, options.camera)
        if options.first_as_world:
            calibration = from_first_camera(calibration)
        left_out = write_calibration(calibration, options.output, options.to)
    except CalibrationError as error:
        raise Refusal(str(error)) from error
    told = narrator(options.output)
    for sentence in (*calibration.notes, *left_out):
        told(sentence)
    told(f"{options.output}: written from {calibration.format}, read back and found the same.")
    return OK
