"""TOML and INI text as plain trees, by Python's own parsers, within bounds."""

from __future__ import annotations

import configparser
import re
import tomllib
from typing import Any

from camviz_clinic.calibration.types import CalibrationError
from camviz_clinic.files.trees import MAX_DEPTH, refuse_many_keys, scalar

MOST_CHARACTERS = 2**20
_DEEP_KEY = re.compile(  # tomllib takes a time that grows with the square of a key's parts
    rf"""(?<![\w-])(?:(?:[\w-]++|"[^"\n]*+"|'[^'\n]*+')[ \t]*+\.[ \t]*+){{{MAX_DEPTH}}}"""
)


def parse_toml(text: str) -> dict[str, Any]:
    """The tables of a TOML text; CalibrationError naming the line where it stops being one.

    >>> parse_toml("[cam_0]\\nsize = [640, 480]")
    {'cam_0': {'size': [640, 480]}}
    """
    _refuse_long(text, "TOML")
    try:
        if _DEEP_KEY.search(text):
            raise RecursionError
        tree = tomllib.loads(text)
        _refuse_deep(tree)
    except (tomllib.TOMLDecodeError, ValueError) as error:
        raise CalibrationError(f"not valid TOML: {error}") from None
    except RecursionError:
        raise CalibrationError(f"nested more than {MAX_DEPTH} levels deep, which no calibration is") from None
    return tree


def parse_ini(text: str) -> dict[str, dict[str, Any]]:
    """The sections of an INI text, all names in small letters; CalibrationError where it is no such text.

    >>> parse_ini("[LEFT_CAM_HD]\\nfx=534.25")
    {'left_cam_hd': {'fx': 534.25}}
    """
    _refuse_long(text, "INI")
    reader = configparser.ConfigParser(interpolation=None, default_section="")
    try:
        reader.read_string(text)
    except configparser.ParsingError as error:
        raise CalibrationError(f"not valid INI: expected key=value (line {_line(error)})") from None
    except (configparser.DuplicateSectionError, configparser.DuplicateOptionError) as error:
        what = getattr(error, "option", None) or error.section
        raise CalibrationError(f"not valid INI: {what[:60]!r} appears twice (line {error.lineno})") from None
    tree = {name.lower(): {key: scalar(word) for key, word in reader[name].items()} for name in reader.sections()}
    for part in (tree, *tree.values()):
        refuse_many_keys(len(part))
    return tree


def _line(error: configparser.ParsingError) -> int:
    return error.errors[0][0] if getattr(error, "errors", None) else getattr(error, "lineno", 1)


def _refuse_long(text: str, what: str) -> None:
    if len(text) > MOST_CHARACTERS:
        raise CalibrationError(f"expected {what} of at most {MOST_CHARACTERS:,} characters, got {len(text):,}")


def _refuse_deep(tree: Any) -> None:
    level = [tree]
    for _ in range(MAX_DEPTH):
        level = [value for each in level for value in (each.values() if isinstance(each, dict) else each)]
        level = [value for value in level if isinstance(value, (dict, list))]
        if not level:
            return
    raise RecursionError
