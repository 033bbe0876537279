"""The board doctor: what of a board is not as described, seen in its pictures, with the option that mends it.

A trouble is one file here that declares a Trouble: `camviz_clinic/checks/doctor/trouble.py` explains how. `camviz
calibrate` says what `diagnose` finds, and an inspection has it as `wrong-board`.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from functools import cache
from importlib import import_module
from pkgutil import iter_modules
from types import MappingProxyType

from camviz_clinic.checks.doctor.shown import Shown
from camviz_clinic.checks.doctor.trouble import Diagnosis, Trouble

__all__ = ["Diagnosis", "Shown", "Trouble", "diagnose", "prescription", "troubles"]


@cache
def troubles() -> Mapping[str, Trouble]:
    """Every trouble by its name, in alphabetical order of the files.

    Returns: One for each that a module of this package declares.

    >>> troubles()["legacy pattern"].cause[:15]
    'a ChArUco board'
    """
    modules = [import_module(f"{__name__}.{each.name}") for each in iter_modules(__path__)]
    found = [value for module in modules for value in vars(module).values() if isinstance(value, Trouble)]
    return MappingProxyType({each.name: each for each in found})


def diagnose(shown: Shown, finding: str | None = None) -> tuple[Diagnosis, ...]:
    """What of a board is not as described, as its pictures show it.

    Args:
        shown: The pictures, and the board as it was described.
        finding: Look only for what is this finding.

    Returns: Each with the option that mends it; empty where the pictures show nothing.

    >>> from dataclasses import replace
    >>> from camviz_clinic.calibration import Board
    >>> from camviz_clinic.calibration.boards.picture import whiteness
    >>> board = Board(7, 5, 0.04, marker_size=0.03, dictionary="DICT_5X5_100")
    >>> picture = (255 * whiteness(replace(board, legacy=True), 40, margin=1)).astype(np.uint8)
    >>> [each.option for each in diagnose(Shown(board, {"a.png": picture}))]
    ['--legacy']
    """
    asked = [each for each in troubles().values() if finding in (None, each.finding)]
    return tuple(diagnosis for each in asked for diagnosis in each.diagnoses(shown))


def prescription(diagnoses: Sequence[Diagnosis]) -> str:
    """What diagnoses say, in one line that ends with the options to try.

    Args:
        diagnoses: Of one board.

    Returns: One line; empty where there is none.

    >>> prescription([Diagnosis("sides swapped", "a slip", "The board has 8×5 inner corners.", "--board 8x5")])
    'The board has 8×5 inner corners: try --board 8x5.'
    """
    if not diagnoses:
        return ""
    said = " ".join(each.sentence for each in diagnoses)
    options = [each.option for each in diagnoses if not each.option.startswith("no ")]
    without = [each.option.removeprefix("no ") for each in diagnoses if each.option.startswith("no ")]
    tried = [*([" ".join(options)] if options else []), *(f"without {each}" for each in without)]
    return f"{said.removesuffix('.')}: try {', '.join(tried)}."
