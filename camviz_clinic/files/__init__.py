"""Calibration files: `load(path)` reads what a dozen programs write into a `Calibration`, and `write` the way back.

Each format is a module here that exports FORMAT, a `Format`; nothing else lists the formats.
"""

from camviz_clinic.calibration.types import Board, Calibration, CalibrationError
from camviz_clinic.files.format import File, Format
from camviz_clinic.files.loading import format_of, load
from camviz_clinic.files.registry import formats
from camviz_clinic.files.writing import alone, from_first_camera, write

__all__ = [
    "Board",
    "Calibration",
    "CalibrationError",
    "File",
    "Format",
    "alone",
    "format_of",
    "formats",
    "from_first_camera",
    "load",
    "write",
]
