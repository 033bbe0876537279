"""What came out of a calibration, in sentences."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from camviz_clinic.files import Calibration


def report(calibration: Calibration) -> list[str]:
    """What came out, in sentences."""
    from camviz_clinic.checks.summary import Summary

    summary = Summary.of(calibration)
    said = [f"{picture}: skipped, {why}." for picture, why in calibration.skipped]
    said += calibration.notes
    for name, camera in calibration.cameras.items():
        deviations = np.sqrt(np.diag(calibration.intrinsics_covariance[name]))
        undecided = summary.undecided(name)
        of = {
            key: "not known" if key in undecided else f"{deviation:.2f}"
            for key, deviation in zip(calibration.estimated[name], deviations, strict=True)
        }
        grid = camera.intrinsics
        values = [
            f"{key} = {getattr(grid, key):.2f}" + (f" ± {of[key]}" if key in of else "")
            for key in ("fx", "fy", "cx", "cy")
        ]
        used = calibration.used(name)
        views = int(used.any(axis=1).sum())
        said.append(
            f"{name}: {', '.join(values)} px; RMS error {calibration.rms(name):.3f} px over {used.sum()} corners in "
            f"{views} views."
        )
    said += summary.withheld
    if bend := summary.bend_sentence:
        said.append(bend)
    if "right" in calibration.cameras:
        x, y, z = 1000 * calibration.cameras["right"].centre
        length = np.sqrt(x * x + y * y + z * z)
        said.append(f"right stands {length:.2f} mm from left: x = {x:.2f}, y = {y:.2f}, z = {z:.2f} mm in its frame.")
    return said


def worth(calibration: Calibration, goal: float | None) -> list[str]:
    """What it is worth to a task, and whether there are enough pictures."""
    from camviz_clinic.checks.summary import GOOD, Summary

    summary = Summary.of(calibration, goal=goal or GOOD)
    return [*(each.sentence for each in summary.task), summary.guidance]
