"""What came out of a calibration, in sentences."""

from __future__ import annotations

from collections.abc import Collection, Mapping
from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from camviz.cameras import Intrinsics
    from camviz_clinic.files import Calibration

_SHOWN = ("fx", "fy", "cx", "cy")


def report(calibration: Calibration) -> list[str]:
    """What came out, in sentences."""
    from camviz_clinic.checks.summary import Summary

    summary = Summary.of(calibration)
    said = [f"{picture}: skipped, {why}." for picture, why in calibration.skipped]
    said += calibration.notes
    for name, camera in calibration.cameras.items():
        deviations = np.sqrt(np.diag(calibration.intrinsics_covariance[name]))
        of = dict(zip(calibration.estimated[name], deviations, strict=True))
        undecided = summary.undecided(name)
        said.append(
            camera_line(name, camera.intrinsics, of, undecided, rms=calibration.rms(name), used=calibration.used(name))
        )
    said += summary.withheld
    if bend := summary.bend_sentence:
        said.append(bend)
    if "right" in calibration.cameras:
        x, y, z = 1000 * calibration.cameras["right"].centre
        length = np.sqrt(x * x + y * y + z * z)
        said.append(f"right stands {length:.2f} mm from left: x = {x:.2f}, y = {y:.2f}, z = {z:.2f} mm in its frame.")
    return said


def camera_line(
    name: str,
    grid: Intrinsics,
    deviations: Mapping[str, float],
    undecided: Collection[str] = (),
    *,
    rms: float | None,
    used: np.ndarray,
) -> str:
    """One camera in a sentence: what was estimated with its ±, and `used`, its corners as booleans (views, corners)."""
    of = {key: "not known" if key in undecided else f"{deviation:.2f}" for key, deviation in deviations.items()}
    values = [f"{key} = {getattr(grid, key):.2f}" + (f" ± {of[key]}" if key in of else "") for key in _SHOWN]
    error = "not known" if rms is None else f"{rms:.3f} px"
    return (
        f"{name}: {', '.join(values)} px; RMS error {error} over {used.sum()} corners in "
        f"{int(used.any(axis=1).sum())} views."
    )


def worth(calibration: Calibration, goal: float | None) -> list[str]:
    """What it is worth to a task, and whether there are enough pictures."""
    from camviz_clinic.checks.summary import GOOD, Summary

    summary = Summary.of(calibration, goal=goal or GOOD)
    said = [summary.accuracy.sentence, *summary.worth, summary.guidance]
    return [sentence for sentence in said if sentence]
