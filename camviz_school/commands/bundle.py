"""`camviz bundle`: one zip from which a class installs camviz with no network."""

from __future__ import annotations

import argparse
import re
from importlib.util import find_spec
from pathlib import Path
from typing import Any

import camviz
from camviz_clinic.commands.common import LACKING, OK, Refusal, add_command, refuse_output, write_whole
from camviz_clinic.commands.terminal import say, tell
from camviz_school.teaching.platforms import PLATFORMS

BUNDLE = """\
Writes one zip for a USB stick: the wheels of the lock and camviz's own, the lessons, their photographs, the site where
it has been built, and start.py. A student unpacks it and runs `python start.py`, which installs from the zip alone:
no network is asked. The zip is for the platforms and the Pythons that you name; start.py says so to any other machine.

It is made in a checkout of the repository, and needs the network once. Every wheel is checked by the lock's hash.
"""
EPILOG = """\
examples:
  camviz bundle /media/stick                               for machines like this one
  camviz bundle class.zip --platform windows-x86_64 --python 3.12 --python 3.13
"""


def add(commands: Any) -> None:
    command = add_command(commands, "bundle", bundle, "write one zip that installs with no network", BUNDLE)
    command.epilog = EPILOG
    command.add_argument("out", metavar="FOLDER_OR_ZIP", type=Path, help="a folder that is there, or a name.zip")
    command.add_argument(
        "--platform",
        metavar="NAME",
        action="append",
        choices=tuple(PLATFORMS),
        help=f"{', '.join(PLATFORMS)}; may be repeated (default: this machine's)",
    )
    command.add_argument(
        "--python", metavar="3.N", action="append", type=release, help="may be repeated (default: this one's)"
    )
    command.add_argument(
        "--site", metavar="DIR", type=Path, help="the site (default: build/site, if it has been built)"
    )


def bundle(options: argparse.Namespace) -> int:
    """Write the zip whole, or nothing."""
    from camviz_school.commands.packing import BundleError, this_machine, write_bundle
    from camviz_school.course.material import built_site, checkout_lessons

    lessons = checkout_lessons()
    if lessons is None:
        raise Refusal(
            "a bundle is made in a checkout of the repository, which has the lock; this camviz was installed alone.",
            LACKING,
        )
    if missing := [name for name in ("pip", "hatchling") if find_spec(name) is None]:
        raise Refusal(f"{' and '.join(missing)} must be installed for this; `python start.py bundle` has it.", LACKING)
    if options.site and not (options.site / "index.html").is_file():
        raise Refusal(f"{options.site}: expected a folder with a built site, there is no index.html in it.")
    name, python = this_machine(lessons.parent)
    platforms, pythons = options.platform or [name], options.python or [python]
    if unknown := set(platforms) - set(PLATFORMS):
        raise Refusal(f"no bundle is made for {unknown.pop()}; --platform takes {', '.join(PLATFORMS)}.")
    target = _target(options.out, platforms, pythons)
    site = options.site or built_site()
    wheels: list[int] = []
    try:
        write_whole(
            target,
            lambda part: wheels.append(write_bundle(lessons.parent, part, platforms, pythons, site=site, say=say)),
            target.name,
        )
    except BundleError as error:
        raise Refusal(f"{error}.") from error
    size = target.stat().st_size / 1e6
    tell(f"{target} has {size:.0f} MB and {wheels[0]} wheels{'' if site else ', and no site: none has been built'}.")
    tell("A student unpacks it, and runs `python start.py lab --lesson 05` in the unpacked folder.")
    return OK


def _target(out: Path, platforms: list[str], pythons: list[str]) -> Path:
    if out.is_dir():
        out /= f"camviz-{camviz.__version__}-{'-'.join([*platforms, *pythons])}.zip"
    if out.suffix != ".zip":
        raise Refusal(f"{out}: expected a folder that is there, or a name that ends in .zip.")
    refuse_output(out, "zip")
    return out


def release(text: str) -> str:
    """3.12, as a Python is named."""
    match = re.fullmatch(r"3\.(\d{1,2})", text)
    if not match or int(match[1]) < 11:
        raise argparse.ArgumentTypeError(f"expected a Python from 3.11 on, such as 3.12, got {text!r}")
    return text
