"""Every kind of finding there is, each declared in a module of this folder beside the faults that must lead to it.

To add one, put a module here. To add one from a folder of your own, extend this package's path:

    camviz_clinic.checks.findings.__path__.append("my_checks")
"""

from __future__ import annotations

from collections.abc import Mapping
from functools import lru_cache
from importlib import import_module
from pkgutil import iter_modules
from types import MappingProxyType
from typing import Any

from camviz_clinic.checks.registry import Fault, Kind

ORDER = (
    *("compare", "assumed", "file", "impossible", "contradiction", "size", "settings", "lens"),
    *("corners", "set_aside", "boards", "unidentifiable", "moving", "model", "scatter", "pair", "frames", "described"),
)
"""The modules in the order of their checks; others come after them, by name. Within one the order is as written."""


def kinds() -> Mapping[str, Kind]:
    """Every kind of finding by its id, in the order of the checks.

    Returns: With the words of each and its check.

    >>> kinds()["fold"].severity
    'fault'
    """
    return MappingProxyType({each.id: each for each in _declared(tuple(__path__)) if isinstance(each, Kind)})


def faults() -> Mapping[str, Fault]:
    """Every fault that can be put into a virtual calibration, by its name.

    Returns: Each with the id of the finding that must name it.

    >>> faults()["warped board"].finding
    'board-warp'
    """
    return MappingProxyType({each.name: each for each in _declared(tuple(__path__)) if isinstance(each, Fault)})


@lru_cache
def _declared(folders: tuple[str, ...]) -> list[Any]:
    """What the modules in these folders declare."""
    names = sorted(module.name for module in iter_modules(folders))
    ordered = [*(name for name in ORDER if name in names), *(name for name in names if name not in ORDER)]
    return [value for name in ordered for value in vars(import_module(f"{__name__}.{name}")).values()]
