"""Which formats of corner files there are: every module of this package that has a FORMAT."""

from __future__ import annotations

from collections.abc import Mapping
from importlib import import_module
from pkgutil import iter_modules
from types import MappingProxyType

from camviz_clinic.files.corners.format import CornerFormat


def corner_formats() -> Mapping[str, CornerFormat]:
    """The formats by name, in alphabetical order.

    Returns: One for each module of this package that has a FORMAT.

    >>> list(corner_formats())
    ['babelcalib', 'csv', 'mrcal']
    """
    package = import_module("camviz_clinic.files.corners")
    modules = [import_module(f"{package.__name__}.{module.name}") for module in iter_modules(package.__path__)]
    found = [module.FORMAT for module in modules if isinstance(getattr(module, "FORMAT", None), CornerFormat)]
    return MappingProxyType({each.name: each for each in sorted(found, key=lambda each: each.name)})


def corner_titles() -> str:
    """The files that are read, in one line."""
    return ", ".join(each.title for each in corner_formats().values())
