"""Calibration files: `load(path)` reads what a dozen programs write into a `Calibration`, and `write` the way back."""

from typing import Any

from camviz.calibration.types import Board, Calibration, CalibrationError
from camviz.files.loading import load

__all__ = ["FORMATS", "Board", "Calibration", "CalibrationError", "alone", "from_first_camera", "load", "write"]


def __getattr__(name: str) -> Any:
    if name not in __all__:
        raise AttributeError(f"module 'camviz.files' has no attribute {name!r}")
    from camviz.files import writing

    return getattr(writing, name)
