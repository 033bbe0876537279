"""Which formats there are: every module of this package that has a FORMAT."""

from __future__ import annotations

from collections.abc import Mapping
from importlib import import_module
from pkgutil import iter_modules
from types import MappingProxyType

from camviz_clinic.files.format import Format


def formats() -> Mapping[str, Format]:
    """The formats by name, in alphabetical order.

    Returns: One for each module of `camviz_clinic.files` that has a FORMAT.
    Raises: ValueError where two modules use one name.

    >>> [name for name in formats() if name.startswith("co")]
    ['colmap', 'colmap-bin']
    """
    package = import_module("camviz_clinic.files")
    modules = [import_module(f"camviz_clinic.files.{module.name}") for module in iter_modules(package.__path__)]
    found = [module.FORMAT for module in modules if isinstance(getattr(module, "FORMAT", None), Format)]
    by_name = {format.name: format for format in sorted(found, key=lambda format: format.name)}
    if len(by_name) < len(found):
        names = [format.name for format in found]
        raise ValueError(f"two formats are named {', '.join(sorted({n for n in names if names.count(n) > 1}))}")
    return MappingProxyType(by_name)


def written() -> Mapping[str, Format]:
    """Those of the formats that can be written."""
    return MappingProxyType({name: format for name, format in formats().items() if format.write})


def titles() -> str:
    """The programs and files that are read, in one line."""
    return ", ".join(sorted({format.title for format in formats().values()}, key=str.lower))


def listing() -> str:
    """The formats that can be written, one a line, for `camviz convert --help`."""
    lines = [f"  {name:<10}  {_line(format)}" for name, format in written().items()]
    return "\n".join(["formats:", *lines])


def _line(format: Format) -> str:
    file = "" if format.file in format.title else f" ({format.file})"
    return format.title + file + f", {format.holds}" * bool(format.holds)
