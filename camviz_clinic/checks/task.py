"""What a calibration is worth to its task: directions in degrees, places in millimetres, and the depths of a pair.

All of it is one standard deviation, as `Adjustment.covariance` has it. What is wrong alike in all views is not in it.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from math import inf, isfinite

import numpy as np
from numpy.typing import ArrayLike

from camviz.cameras import Intrinsics
from camviz.lenses.base import Array, as_points
from camviz_clinic.calibration.adjustment import Adjustment
from camviz_clinic.calibration.jacobian import pixel_jacobian
from camviz_clinic.calibration.stereo_depth import depth_uncertainty
from camviz_clinic.calibration.uncertainty import projection_covariance, worst_deviation
from camviz_clinic.checks.evidence import Evidence
from camviz_clinic.checks.rig import pairs

DEPTHS = (1.0, 2.0, 5.0, 10.0)  # metres, of which a pair's depth error is told
ANYWHERE_DEG = 90.0  # of a direction that may be any
MATCHING_PX = 0.25  # the standard deviation of a match that is taken for granted; its part of the error grows with it


@dataclass(frozen=True)
class TaskError:
    """One thing that a task may ask of a calibration: its cameras, the sentence, and the numbers in it."""

    cameras: tuple[str, ...]
    sentence: str
    values: dict[str, float]


def direction_deviation(
    adjustment: Adjustment, uv: ArrayLike, distance: float = inf, camera: str | None = None
) -> Array:
    """The standard deviation (...,) in radians of the direction to the point that pixel uv (..., 2) shows.

    In its worst direction. `distance` is the point's, in metres: times it, the deviation is the error in metres across
    the ray. It is `projection_covariance`, carried from the picture to the ray: δq = J δr for the ray's two directions.
    """
    name = next(iter(adjustment.cameras)) if camera is None else camera
    seen_by = adjustment.cameras[name]
    rays = seen_by.lens.unproject(seen_by.intrinsics.from_pixels(as_points(uv, 2, "uv")))
    _, by_ray, _ = pixel_jacobian(seen_by, rays, ())
    sideways = np.swapaxes(np.linalg.svd(np.nan_to_num(rays)[..., None, :])[2][..., 1:, :], -1, -2)  # (..., 3, 2)
    by_angle = by_ray @ sideways
    covariance = projection_covariance(adjustment, uv, distance, name)
    good = np.isfinite(by_angle).all(axis=(-2, -1)) & np.isfinite(covariance).all(axis=(-2, -1))
    inverse = np.linalg.inv(np.where(good[..., None, None], by_angle, np.eye(2)))
    return np.where(good, worst_deviation(inverse @ covariance @ np.swapaxes(inverse, -1, -2)), np.nan)


def task_errors(evidence: Evidence, at: float | None = None, names: Iterable[str] = ()) -> tuple[TaskError, ...]:
    """What each camera, and each pair, is worth to a task; nothing of those whose corners the file does not hold.

    `at` is a distance in metres at which the error of a place is told too; `names` are the cameras, all by default.
    """
    found = []
    for name in names or evidence.cameras:
        try:
            found.append(_of_camera(evidence.adjustment(name), name, at))
        except (ValueError, np.linalg.LinAlgError):  # no corners or poses, or too few to solve from
            continue
    for pair in pairs(evidence.calibration):
        try:
            found.append(_of_pair(evidence.adjustment(pair.left, pair.right), pair.left, pair.right))
        except (ValueError, np.linalg.LinAlgError):
            continue
    return tuple(each for each in found if each.values)


def image_corners(intrinsics: Intrinsics) -> Array:
    """The centres (4, 2) of the pixels in the corners of an image."""
    right, bottom = intrinsics.width - 1, intrinsics.height - 1
    return np.array([(0.0, 0.0), (right, 0), (0, bottom), (right, bottom)])


def _of_camera(adjustment: Adjustment, name: str, at: float | None) -> TaskError:
    corners = image_corners(adjustment.cameras[name].intrinsics)
    pixels = np.vstack([corners.mean(axis=0), corners])

    def middle_and_worst(distance: float) -> tuple[float, float]:
        deviations = direction_deviation(adjustment, pixels, distance, name)
        return float(deviations[0]), float(np.max(deviations[1:]))

    middle, worst = np.degrees(middle_and_worst(inf))
    if not np.isfinite(middle):
        return TaskError((name,), "", {})
    if middle > ANYWHERE_DEG:
        return TaskError((name,), f"{name}: the direction error is not known.", {"angle_centre_deg": float(middle)})
    known = "not known in the worst corner" if worst > ANYWHERE_DEG else f"±{worst:.2g}° in the worst corner"
    known = known if np.isfinite(worst) else "a corner has no ray"
    said = f"{name}: direction error ±{middle:.2g}° at the centre, {known}"
    values = {"angle_centre_deg": middle, "angle_corner_deg": worst}
    if at is not None:
        here, there = at * np.array(middle_and_worst(at))
        corner = f" and ±{length(there)}" if np.isfinite(there) else ""
        said += f"; at {at:g} m that is ±{length(here)}{corner}"
        values |= {"at_m": at, "centre_mm": 1000 * here, "corner_mm": 1000 * there}
    return TaskError((name,), f"{said}.", {key: float(value) for key, value in values.items() if np.isfinite(value)})


def _of_pair(adjustment: Adjustment, left: str, right: str) -> TaskError:
    found = depth_uncertainty(adjustment, DEPTHS, MATCHING_PX, left=left, right=right)
    told: list[str] = []
    values: dict[str, float] = {}
    for z, total, own in zip(DEPTHS, found.total, found.from_calibration, strict=True):
        if np.isfinite(total):
            told.append(
                f"±{length(total)} ({100 * total / z:.2g} %) at {z:g} m, of it {length(own)} by the calibration"
            )
            values |= {f"depth_{z:g}m_mm": 1000 * float(total), f"calibration_{z:g}m_mm": 1000 * float(own)}
    said = f"{left}, {right}: depth in the middle of the picture is known to {'; '.join(told)}."
    said += f" Matches are taken to be within ±{MATCHING_PX:g} px."
    return TaskError((left, right), said, values)


def length(metres: float) -> str:
    """A length to two digits, in the unit that suits it; "unknown" where it is not finite.

    >>> length(0.00042), length(0.0467), length(0.776), length(123.45), length(float("inf"))
    ('0.42 mm', '47 mm', '0.78 m', '120 m', 'unknown')
    """
    if not isfinite(metres):
        return "unknown"
    value, unit = (metres, "m") if metres >= 0.1 else (1000 * metres, "mm")
    return f"{float(f'{value:.2g}'):g} {unit}"
