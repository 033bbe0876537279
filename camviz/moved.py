"""One sentence for a name that stood in camviz before it became three packages: where it stands now."""

from __future__ import annotations

import sys
from collections.abc import Sequence
from types import ModuleType

CLINIC = ("Calibration", "calibration", "clinic", "commands", "files", "inspect", "load", "meshes", "plots", "report")
SCHOOL = ("course", "join", "record", "room", "samples", "server", "teaching")
NEW_NAMES = {"clinic": "checks"}


def sentence(name: str) -> str:
    """Where a name of camviz stands now; empty for one that never stood here.

    >>> sentence("load")
    'camviz.load is now camviz_clinic.load'
    """
    package = "camviz_clinic" if name in CLINIC else "camviz_school" if name in SCHOOL else ""
    return package and f"camviz.{name} is now {package}.{NEW_NAMES.get(name, name)}"


class Moved:
    """Python's import asks it last: whoever imports a module that has moved learns where it is."""

    @staticmethod
    def find_spec(name: str, path: Sequence[str] | None = None, target: ModuleType | None = None) -> None:
        """Raises ImportError for a module that has moved, and leaves every other to Python."""
        house, _, rest = name.partition(".")
        words = sentence(rest.partition(".")[0]) if house == "camviz" and rest else ""
        if words:
            raise ImportError(words)


if Moved not in sys.meta_path:
    sys.meta_path.append(Moved)
