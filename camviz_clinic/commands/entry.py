"""Where the command `camviz` begins: it looks whether the package `camviz` is this one before it imports any of it.

Other projects have the same name, such as TRI's viewer for depth estimation. Their package hides this one.
"""

from __future__ import annotations

from importlib.metadata import packages_distributions
from importlib.util import find_spec
from pathlib import Path

from camviz_clinic.commands.common import LACKING
from camviz_clinic.commands.terminal import say

OURS = Path(__file__).resolve().parents[2] / "camviz"
REMEDY = (
    "give each an environment of its own (python -m venv), or run `pip uninstall camviz` until none is left and "
    "install this one anew"
)


def main() -> int:
    """The command line, or one sentence where `import camviz` would find another project."""
    if other := other_package():
        say(f"another project's package of the same name is imported, {other}: {REMEDY}.")
        return LACKING
    from camviz_clinic.commands.command import main as command

    return command()


def other_package() -> str:
    """Where the package `camviz` is that Python finds, if it is none of this project; empty where all is well."""
    spec = find_spec("camviz")
    places = [Path(place).resolve() for place in (spec.submodule_search_locations or ())] if spec else []
    if OURS in places:
        return ""
    return str(places[0] if places else spec.origin if spec else "nowhere")


def other_distributions() -> list[str]:
    """The distributions beside this one whose files go into a package `camviz`, too."""
    return sorted({name for name in packages_distributions().get("camviz", ()) if name.lower() != "camviz"})
