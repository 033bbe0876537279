"""camviz: one virtual camera, taken apart piece by piece.

The names below are imported when they are first used, so that `import camviz` costs next to nothing.
"""

import sys
from importlib import import_module
from typing import Any

__version__ = "0.1.0"
"""The version, as three numbers.

>>> import camviz
>>> camviz.__version__.count(".")
2
"""

_HOME = {
    "Calibration": "camviz_clinic.calibration",
    "Camera": "camviz.cameras",
    "Intrinsics": "camviz.cameras",
    "Rig": "camviz.cameras",
    "explore": "camviz.widgets",
    "inspect": "camviz_clinic.report.notebook",
    "join": "camviz_school.room.membership",
    "load": "camviz_clinic.files",
    "look_at": "camviz.cameras",
}

_PARTS = (
    "calibration",
    "cameras",
    "clinic",
    "colour",
    "distortion",
    "lenses",
    "lightfields",
    "meshes",
    "mosaics",
    "optics",
    "plots",
    "scenes",
    "sensors",
    "twoview",
)

__all__ = [
    *("Calibration", "Camera", "Intrinsics", "Rig", "__version__", "explore", "inspect", "join", "load", "look_at"),
    *_PARTS,
]


def __getattr__(name: str) -> Any:
    if name in _PARTS:
        return import_module(f"camviz.{name}")
    if name not in _HOME:
        raise AttributeError(f"module 'camviz' has no attribute {name!r}")
    return getattr(import_module(_HOME[name]), name)


def __dir__() -> list[str]:
    return sorted(__all__)


def _show_calibrations() -> None:
    """Have IPython, where it runs, show a bare calibration by `camviz_clinic.report.glance`, imported when it is wanted."""
    shell = sys.modules["IPython"].get_ipython() if "IPython" in sys.modules else None
    if shell is None:
        return
    formatters, calibration = shell.display_formatter.formatters, ("camviz_clinic.calibration.types", "Calibration")
    formatters["text/html"].for_type_by_name(
        *calibration, lambda shown: import_module("camviz_clinic.report.glance").html(shown)
    )
    formatters["text/plain"].for_type_by_name(
        *calibration, lambda shown, printer, _: printer.text(import_module("camviz_clinic.report.glance").text(shown))
    )


_show_calibrations()
