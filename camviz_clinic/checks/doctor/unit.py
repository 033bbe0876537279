"""The side of a square in another unit than the one that was asked for."""

from __future__ import annotations

from collections.abc import Iterator

from camviz_clinic.checks.doctor.shown import Shown
from camviz_clinic.checks.doctor.trouble import trouble
from camviz_clinic.checks.evidence import Evidence, NotChecked
from camviz_clinic.checks.findings.pair import UNITS, baseline_scale, confused_units


@trouble("wrong unit", cause="the side of a square in metres or inches taken for millimetres", finding="baseline-scale")
def wrong_unit(shown: Shown) -> Iterator[tuple[str, str]]:
    """The squares, the baseline of a pair or its measured length are out of proportion."""
    if shown.calibration is None:
        return
    try:
        found = list(baseline_scale.check(Evidence(shown.calibration, baseline=shown.baseline)))
    except NotChecked:
        return
    own = [finding for finding in found if finding.unit == "m" or shown.baseline is not None]  # not turned orders
    for finding in own[:1]:
        board = shown.calibration.board
        right = _side_mm(finding.value, finding.unit, board.square_size) if board and finding.value else None
        yield finding.sentence, "--square-mm" + (f" {right:.4g}" if right else "")


def _side_mm(value: float, unit: str, side: float) -> float:
    """What the side of a square should be, in millimetres."""
    if unit == "times":
        units = confused_units(value)
        return 1000 * side / (UNITS[units[1]] / UNITS[units[0]] if units else value)
    return side if value > 1 else 1e6 * side
