"""`camviz doctor`: what this machine can do."""

from __future__ import annotations

import argparse
from typing import Any

from camviz_clinic.commands.common import LACKING, OK, add_colour, add_command
from camviz_clinic.commands.terminal import tell, tell_json

DOCTOR = """\
Says what camviz finds on this machine, line by line: what works, what works less well, what is missing, and what to
do about it. Solid 3D is tried in a process of its own, so that asking cannot do harm.
"""


def add(commands: Any) -> None:
    command = add_command(commands, "doctor", doctor, "say what this machine can do, and how to mend it", DOCTOR)
    command.add_argument("--json", action="store_true", help="the same for programs")
    add_colour(command)


def doctor(options: argparse.Namespace) -> int:
    """Print what was found; the status tells whether something that is needed is missing."""
    from camviz_school.commands import machine as examination

    findings = examination.examine()
    if options.json:
        tell_json(examination.as_json(findings))
    else:
        tell(examination.as_text(findings), {"^ok": "green", "^warn": "yellow", "^missing": "red"}, options.color)
    return LACKING if any(finding.status == "missing" for finding in findings) else OK
