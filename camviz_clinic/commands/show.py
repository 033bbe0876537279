"""`camviz show`: a page that shows a calibration."""

from __future__ import annotations

import argparse
import os
from pathlib import Path
from textwrap import fill
from typing import Any

from camviz_clinic.commands.common import OK, Refusal, add_command, loaded, narrator, refuse_output, size, write_whole

SHOW = """\
Writes one HTML page that shows the cameras of a calibration: what `camviz inspect` says of them, where they stand and
what they see, how their lenses bend straight lines, and how their pictures are tied together. The page holds
everything it needs and opens offline.

Reads the formats below; the content of the file tells which it is. The file is only read: nothing in it is run, and it
is not changed.
"""


def add(commands: Any) -> None:
    command = add_command(commands, "show", show, "write a page that shows a calibration", SHOW)
    command.listing = _listing
    command.add_argument("file", metavar="FILE", type=Path, help="the calibration; - is stdin")
    command.add_argument("-o", "--output", metavar="OUT.html", type=Path, help="the page (default: FILE's name, .html)")
    command.add_argument("--size", metavar="WxH", type=size, help="image size in pixels, where FILE does not hold it")


def _listing() -> str:
    from camviz_clinic.files.registry import titles

    return fill(f"formats: {titles()}", 110, subsequent_indent="  ", break_on_hyphens=False)


def show(options: argparse.Namespace) -> int:
    """Write the page of a calibration, whole or not at all."""
    refuse_renderer()
    calibration = loaded(options.file, options.size)
    output = options.output or Path(options.file.stem + ".html")
    refuse_output(output, "page", options.file)
    from camviz_clinic.checks import inspect
    from camviz_clinic.report.page import write_page

    inspection = inspect(calibration)
    write_whole(output, lambda path: write_page(inspection, path))
    told = narrator(output)
    told(inspection.verdict)
    for note in calibration.notes:
        told(note)
    told(f"{output}: open it in a browser.")
    return OK


def refuse_renderer() -> None:
    asked = os.environ.get("CAMVIZ_RENDERER")
    if asked not in (None, "", "solid", "wire"):
        raise Refusal(f"CAMVIZ_RENDERER: {asked!r} is no renderer; set it to solid or wire, or not at all.")
