"""camviz_clinic: what is wrong with a calibration, and what to do about it. It stands on camviz.

    calibration   boards found in pictures, and the camera that saw them
    measuring     how sharp a camera is, and how noisy its sensor
    rigs          many cameras that saw a board in any of the frames, solved for together
    files         calibrations read from what other programs write, and written for them
    checks        the findings: what an inspection looks for, and how sure it is
    views         residuals, coverage, uncertainty: a picture for each finding
    report        one page, or one cell of a notebook, that says it all
    live          a webcam calibrated in a notebook, guided: `capture(board)`
    plots         the same curves on matplotlib's axes
    meshes        cameras and boards for pyvista
    commands      the command line

The names below are imported when they are first used.
"""

import sys
from importlib import import_module
from typing import Any

import camviz  # noqa: F401 - it answers whoever imports what has moved

_HOME = {
    "Calibration": "camviz_clinic.calibration",
    "capture": "camviz_clinic.live.widget",
    "inspect": "camviz_clinic.report.notebook",
    "load": "camviz_clinic.files",
}

_PARTS = ("calibration", "checks", "meshes", "plots", "rigs")

__all__ = ["Calibration", "capture", "inspect", "load", *_PARTS]


def __getattr__(name: str) -> Any:
    if name in _PARTS:
        return import_module(f"camviz_clinic.{name}")
    if name not in _HOME:
        raise AttributeError(f"module 'camviz_clinic' has no attribute {name!r}")
    return getattr(import_module(_HOME[name]), name)


def __dir__() -> list[str]:
    return sorted(__all__)


def _show_calibrations() -> None:
    """Have IPython, where it runs, show a bare calibration by `report.glance`, imported when it is wanted."""
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
