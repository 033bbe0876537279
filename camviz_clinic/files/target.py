"""Kalibr's target files: which board was seen."""

from __future__ import annotations

from pathlib import Path

from camviz_clinic.calibration.types import Board, CalibrationError
from camviz_clinic.files.format import File
from camviz_clinic.files.section import Section, explained

SQUARE = 1e-6  # relative: what rows and columns of a chessboard may differ by
MOST = 200  # things along a side


def read_target(path: Path) -> Board:
    """The board of a file with `target_type` aprilgrid, checkerboard or circlegrid, as Kalibr reads it.

    Raises CalibrationError, one sentence, where the file is not such a one.
    """
    section = File(path).section
    if "target_type" not in section:
        raise CalibrationError(f"{path}: expected Kalibr's target_type with aprilgrid, checkerboard or circlegrid")
    read = {"aprilgrid": _aprilgrid, "checkerboard": _checkerboard, "circlegrid": _circlegrid}
    try:
        kind = section.choice("target_type", list(read))
        with explained("target"):
            return read[kind](section)
    except CalibrationError as error:
        raise CalibrationError(f"{path}: {error}") from error


def _aprilgrid(section: Section) -> Board:
    columns, rows = section.whole("tagCols", MOST), section.whole("tagRows", MOST)
    return Board.aprilgrid(columns, rows, section.number("tagSize"), section.number("tagSpacing"))


def _checkerboard(section: Section) -> Board:
    across, down = section.number("colSpacingMeters"), section.number("rowSpacingMeters")
    if abs(across - down) > SQUARE * abs(across):
        raise section.error("rowSpacingMeters", f"squares, {across:g} as colSpacingMeters", f"{down:g}")
    return Board(section.whole("targetCols", MOST), section.whole("targetRows", MOST), across)


def _circlegrid(section: Section) -> Board:
    asymmetric = section.values.get("asymmetricGrid", False)
    if not isinstance(asymmetric, (bool, int)):
        raise section.error("asymmetricGrid", "true or false", str(asymmetric))
    kind = "asymmetric-circles" if asymmetric else "circles"
    columns, rows = section.whole("targetCols", MOST), section.whole("targetRows", MOST)
    return Board(columns, rows, section.number("spacingMeters"), kind=kind)
