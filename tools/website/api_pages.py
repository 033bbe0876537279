"""The pages of the API reference: one for each part of the package that says what it offers."""

from __future__ import annotations

import re
from importlib import import_module
from inspect import getdoc
from pathlib import Path
from types import GenericAlias, ModuleType
from typing import Annotated, get_origin

import camviz

ROOT = Path(camviz.__file__).parents[1]
PACKAGES = ("camviz", "camviz_clinic", "camviz_school")


def parts() -> list[str]:
    """Every module of the three packages that says what it offers, by `__all__`."""
    every = [path for package in PACKAGES for path in (ROOT / package).rglob("*.py")]
    saying = [path for path in every if re.search(r"^__all__\b", path.read_text("utf-8"), re.MULTILINE)]
    ways = (path.relative_to(ROOT).with_suffix("").parts for path in saying)
    return sorted(".".join(way).removesuffix(".__init__") for way in ways)


PARTS = tuple(parts())


def api_pages() -> dict[str, str]:
    """The reference's contents and the page of each part, by their names."""
    pages = {f"api/{name}.md": _part(name) for name in PARTS}
    rows = "\n".join(f"| [{name}]({name}.md) | {_first_line(name)} |" for name in PARTS)
    toctree = "\n".join(PARTS)
    pages["api/index.md"] = (
        "# API reference\n\nWhat each part of the packages offers. Arrays have shapes such as (..., 2): any number of "
        "leading axes. Symbols mean the same [everywhere](../lessons/conventions.md).\n\n"
        f"| Part | What it is for |\n|---|---|\n{rows}\n\n```{{toctree}}\n:hidden:\n\n{toctree}\n```\n"
    )
    return pages


def _first_line(name: str) -> str:
    return (getdoc(import_module(name)) or "").split("\n\n")[0].replace("\n", " ").replace("|", "\\|")


def offered(name: str) -> list[str]:
    """The names that a part offers: not its parts, and not names for types, which Sphinx cannot show."""
    module = import_module(name)
    names = getattr(module, "__all__", None) or [
        key for key, value in vars(module).items() if key[0] != "_" and getattr(value, "__module__", "") == name
    ]
    hidden = (ModuleType, GenericAlias)
    shown = [one for one in names if one[0] != "_" and one not in aliases(name)]
    return [one for one in shown if not isinstance(getattr(module, one), hidden)]


def aliases(name: str) -> dict[str, str]:
    """The names for arrays that a part offers, and what each says of shape and unit.

    >>> aliases("camviz.lenses.arrays")["Points"]
    '(..., 3), points in metres.'
    """
    module = import_module(name)
    values = {one: getattr(module, one) for one in getattr(module, "__all__", ())}
    return {one: value.__metadata__[0] for one, value in values.items() if get_origin(value) is Annotated}


def home(name: str, one: str) -> str:
    """The part on whose page a name that `name` offers is explained: the one that defines it, if that offers it."""
    module = getattr(getattr(import_module(name), one), "__module__", None) or name
    defining = [part for part in PARTS if f"{module}.".startswith(f"{part}.") and one in offered(part)]
    return max(defining, key=len, default=name)


def _part(name: str) -> str:
    """The page of a part: what it says of itself, and each name that it offers with the first line of its own page."""
    homes = {one: home(name, one) for one in offered(name)}
    own = [one for one, place in homes.items() if place == name]
    elsewhere = [f"~{place}.{one}" for one, place in homes.items() if place != name]
    rst = [f".. currentmodule:: {name}", f".. automodule:: {name}\n   :no-members:\n   :no-index:"]
    rst += [_summary(own, "   :toctree: generated\n")] * bool(own) + [_summary(elsewhere)] * bool(elsewhere)
    rows = "".join(f"| `{one}` | {said} |\n" for one, said in aliases(name).items())
    table = f"\n| Name | Shape and unit |\n|---|---|\n{rows}" if rows else ""
    return f"# {name}\n\n```{{eval-rst}}\n" + "\n\n".join(rst) + f"\n```\n{table}"


def _summary(names: list[str], toctree: str = "") -> str:
    return f".. autosummary::\n{toctree}   :nosignatures:\n\n" + "\n".join(f"   {one}" for one in names)
