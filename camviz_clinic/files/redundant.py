"""Matrices as the digits of a file have them, for what it says twice."""

from __future__ import annotations

import numpy as np

from camviz.lenses.base import Array
from camviz_clinic.calibration.types import CalibrationError
from camviz_clinic.files.section import ROTATION_TOLERANCE, Section, as_rotation


def rigid(*places: tuple[Section, str]) -> list[Array] | None:
    """The 4×4 transforms under keys of sections; None where one is not rigid, which is a fault of its own."""
    found = [section.matrix(key, 4, 4) for section, key in places]
    good = all(np.allclose(each[3], [0, 0, 0, 1], rtol=0, atol=ROTATION_TOLERANCE) for each in found)
    return found if good and all(is_rotation(each[:3, :3]) for each in found) else None


def is_rotation(matrix: Array) -> bool:
    """Whether a matrix (3, 3) is one, as far as a file of few digits can hold it."""
    try:
        as_rotation(matrix, "")
    except CalibrationError:
        return False
    return True
