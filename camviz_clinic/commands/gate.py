"""The gate of a project's CI: its options, and the file that holds them for all who work on the project."""

from __future__ import annotations

import argparse
import math
import re
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any

from camviz_clinic.commands.common import STREAM, Refusal, did_you_mean, refuse_output, write_whole

if TYPE_CHECKING:
    from camviz_clinic.checks.gate import Audit, Gate, Outcome

SETTINGS, PROJECT, TABLE = "camviz.toml", "pyproject.toml", "camviz"
NAMES, LIMITS = ("fail-on", "ignore"), "limits"
LARGEST = 1e6

EPILOG = """\
gate:
  --fail-on takes ids of findings and severities (fault, warning, note), which mean themselves and what is worse.
  A project keeps its gate in camviz.toml, or in pyproject.toml under [tool.camviz]: fail-on = ["fault", "fold"],
  ignore = ["aspect"], [limits] rms-px = 0.5, expected-error-px = 1, change-px = 1 (of camviz check). It is looked for
  in the working directory and above it, up to the repository's root. What the command line says wins.
"""


def add_gate(command: argparse.ArgumentParser) -> None:
    """The options that say what makes a calibration fail, and the file for a CI server."""
    command.add_argument(
        "--fail-on", metavar="ID,…", type=names, action="extend", help="what decides the exit status (default: warning)"
    )
    command.add_argument(
        "--ignore", metavar="ID,…", type=names, action="extend", help="findings to leave out of verdict and exit status"
    )
    command.add_argument(
        "--limit",
        metavar="NAME=PX,…",
        type=limits,
        action="extend",
        help="rms-px, expected-error-px, of a check change-px: fail above",
    )
    command.add_argument("--junit", metavar="OUT.xml", type=Path, help="write JUnit XML for a CI server as well")


def names(text: str) -> list[str]:
    """ "fold,aspect" as a list."""
    found = re.findall(r"[^,\s]+", text)
    if not found:
        raise argparse.ArgumentTypeError(f"expected names with commas between, such as fold,aspect, got {text!r}")
    return found


def limits(text: str) -> list[tuple[str, float]]:
    """ "rms-px=0.5" as pairs of a name and a number."""
    pairs = [word.partition("=") for word in names(text)]
    try:
        return [(name, _positive(float(value))) for name, _, value in pairs]
    except ValueError:
        raise argparse.ArgumentTypeError(
            f"expected NAME=NUMBER, such as rms-px=0.5, above 0 and up to {LARGEST:g}, got {text!r}"
        ) from None


def _positive(value: float) -> float:
    if not (math.isfinite(value) and 0 < value <= LARGEST):
        raise ValueError
    return value


def given_gate(options: argparse.Namespace) -> Gate:
    """The gate of the options, and of the project's file where they are silent."""
    file, held = project_settings(Path.cwd())
    told = {"fail-on": options.fail_on, "ignore": options.ignore}
    given: dict[str, Any] = {key: tuple(value) for key, value in told.items() if value is not None}
    if options.limit:
        given[LIMITS] = dict(options.limit)
    _gate(given, "--")
    sources = [*([file.name] if file and held else []), *(["options"] if given else [])]
    limited = held.get(LIMITS, {}) | given.get(LIMITS, {})
    return _gate({**held, **given, LIMITS: limited, "source": ", ".join(sources)}, "")


def _gate(values: Mapping[str, Any], where: str) -> Gate:
    """The gate of some values; refuses a name that means nothing, with what may have been meant."""
    from camviz_clinic.checks.gate import Gate, UnknownName

    try:
        return Gate(**{key.replace("-", "_"): value for key, value in values.items()})
    except UnknownName as error:
        near = did_you_mean(error.name, error.known) or "; docs/clinic.md lists them"
        option = str(error).replace(f"{LIMITS}:", "limit:", 1) if where == "--" else str(error)
        raise Refusal(f"{where}{option}{near}{'.' * (not near.endswith('?'))}") from None


# The project's file.


def project_settings(start: Path) -> tuple[Path | None, dict[str, Any]]:
    """The nearest file and what it says: "fail-on" and "ignore" as tuples of words, "limits" as a dict of numbers.

    It is camviz.toml or [tool.camviz] of pyproject.toml in the folder `start` or above it, up to the repository's
    root. Outside of a repository only `start` is looked at. Refuses what such a file cannot hold.
    """
    for folder in _folders(start):
        own, project = folder / SETTINGS, folder / PROJECT
        if own.is_file():
            return own, _checked(_parsed(_text(own), own), str(own))
        if project.is_file() and TABLE in (text := _text(project)):
            tool = _parsed(text, project).get("tool")
            if isinstance(tool, dict) and TABLE in tool:
                return project, _checked(tool[TABLE], f"{project}: [tool.{TABLE}]")
    return None, {}


def _folders(start: Path) -> Iterator[Path]:
    above = [start, *start.parents]
    root = next((index for index, folder in enumerate(above) if (folder / ".git").exists()), 0)
    yield from above[: root + 1]


def _text(path: Path) -> str:
    try:
        return path.read_text(encoding="utf-8")
    except OSError as error:
        raise Refusal(f"{path}: cannot be read ({error.strerror}).") from error
    except UnicodeDecodeError as error:
        raise Refusal(f"{path}: expected text in UTF-8, byte {error.start} is not.") from error


def _parsed(text: str, path: Path) -> dict[str, Any]:
    from camviz_clinic.files import CalibrationError
    from camviz_clinic.files.tables import parse_toml

    try:
        return parse_toml(text)
    except CalibrationError as error:
        raise Refusal(f"{path}: {error}.") from error


def _checked(held: Any, where: str) -> dict[str, Any]:
    if not isinstance(held, dict):
        raise Refusal(f"{where}: expected a table, got {held!r}.")
    known = (*NAMES, LIMITS)
    for key in held:
        if key not in known:
            near = did_you_mean(key, known)
            raise Refusal(f"{where}: expected the keys {', '.join(known)}, got {key!r}{near}{'.' * (not near)}")
    settings: dict[str, Any] = {key: _words(held[key], key, where) for key in NAMES if key in held}
    if LIMITS in held:
        settings[LIMITS] = _numbers(held[LIMITS], where)
    _gate(settings, f"{where}: ")
    return settings


def _words(value: Any, key: str, where: str) -> tuple[str, ...]:
    if not isinstance(value, list) or not all(isinstance(word, str) for word in value):
        raise Refusal(f'{where}: {key}: expected a list of names, such as ["fold"], got {value!r}.')
    return tuple(value)


def _numbers(value: Any, where: str) -> dict[str, float]:
    if not isinstance(value, dict):
        raise Refusal(f"{where}: {LIMITS}: expected a table of numbers, got {value!r}.")
    for name, number in value.items():
        plain = isinstance(number, (int, float)) and not isinstance(number, bool)
        if not (plain and math.isfinite(number) and 0 < number <= LARGEST):
            raise Refusal(f"{where}: {LIMITS}.{name}: expected a number above 0 and up to {LARGEST:g}, got {number!r}.")
    return {name: float(number) for name, number in value.items()}


# JUnit.


def refuse_junit(options: argparse.Namespace, *others: Path) -> None:
    """Refuses a name that JUnit's XML cannot be written under."""
    if options.junit is None:
        return
    if options.junit == STREAM:
        raise Refusal("--junit: expected the name of a file, for stdout has what people read.")
    refuse_output(options.junit, "JUnit file", *others)


def write_junit(options: argparse.Namespace, outcomes: Mapping[str, Outcome | Audit | str]) -> None:
    """Write JUnit's XML where it is asked for."""
    from camviz_clinic.report.junit import junit

    if options.junit is not None:
        text = junit(outcomes)
        write_whole(options.junit, lambda path: path.write_text(text, encoding="utf-8"))
