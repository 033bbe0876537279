"""How charge leaves the sensor: by bucket brigades (CCD), row after row (CMOS), or all at once.

Charges are electrons (height, width); row 0 is the first to be read.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from math import isfinite

import numpy as np
from numpy.typing import ArrayLike, NDArray

from camviz.cameras import Camera
from camviz.lenses.base import Array
from camviz.poses import RigidTransform
from camviz.scenes.scene import Scene

FORGOTTEN = 1e-7  # the share of a charge below which the trail that it leaves is dropped


# CCD: charge is carried ------------------------------------------------------------------------------------------


@dataclass(frozen=True, eq=False)
class CcdRegister:
    """A bucket brigade: charge still on the area (height, width), in the register (width,), and read so far."""

    area: Array
    register: Array
    read: Array


def bucket_brigade(electrons: ArrayLike, ticks: int) -> CcdRegister:
    """The brigade after the amplifier has read `ticks` pixels: rows shift into the register, which shifts along.

    A row enters the register when the one before has been read out, all with perfect transfer. Raises ValueError for
    fewer than 0 or more than height · width ticks.
    """
    charge = _charge(electrons)
    height, width = charge.shape
    if not 0 <= ticks <= charge.size:
        raise ValueError(f"ticks must lie between 0 and the {charge.size} pixels, got {ticks}")
    rows, along = divmod(ticks, width)
    area, register = np.zeros_like(charge), np.zeros(width)
    loaded = min(rows + (along > 0), height)  # rows that have left the area
    area[: height - loaded] = charge[loaded:]
    if along:
        register[: width - along] = charge[rows, along:]
    return CcdRegister(area, register, charge.ravel()[:ticks])


def transferred(electrons: ArrayLike, efficiency: float, overscan: int = 0) -> Array:
    """Charges (height + overscan, width) as they reach the register, when each shift moves only `efficiency` of them.

    Row i needs n = i + 1 shifts; what is left behind k times comes k rows later, a share C(n+k-1, k) c^n (1-c)^k: the
    negative binomial law. `overscan` further shifts, of empty rows, show the trail of the last row.
    """
    charge = _charge(electrons)
    if not 0.5 < efficiency <= 1:
        raise ValueError(f"efficiency must be a share of charge moved, above 0.5 and at most 1, got {efficiency}")
    height = len(charge)
    arrived = np.zeros((height + overscan, charge.shape[1]))
    shifts = np.arange(1.0, height + 1)
    share = efficiency**shifts
    for k in range(height + overscan):
        rows = min(height, height + overscan - k)
        arrived[k : k + rows] += share[:rows, None] * charge[:rows]
        share = share * (shifts + k) / (k + 1) * (1 - efficiency)
        if share.max() < FORGOTTEN:
            break
    return arrived


def smeared(electrons: ArrayLike, exposure_s: float, row_shift_s: float) -> Array:
    """Charges when light still falls while rows shift: each row passes, for `row_shift_s`, under every row's light.

    q + t_shift/t_exposure · (sum of its column): half of it gathered on the way in, half on the way out. That is a CCD
    without a shutter or a shielded storage; the stripe runs through the whole column of anything bright.
    """
    charge = _charge(electrons)
    for name, value in (("exposure_s", exposure_s), ("row_shift_s", row_shift_s)):
        if not (isfinite(value) and value >= 0):
            raise ValueError(f"{name} must be zero seconds or more, got {value}")
    if exposure_s == 0:
        raise ValueError("exposure_s must be more than zero: smear is a share of the light gathered in it")
    stripe = charge.sum(axis=0) * (row_shift_s / exposure_s)
    return np.asarray(charge + stripe, dtype=np.float64)


def bloomed(electrons: ArrayLike, full_well_e: float) -> Array:
    """Charges when full wells spill along their columns, half of the surplus either way, until there is room.

    Channel stops keep columns apart; what reaches the column's end is lost. An anti-blooming drain instead is `fill`.
    """
    charge = _charge(electrons)
    surplus = np.maximum(charge - full_well_e, 0)
    held = charge - surplus
    for rows in (range(len(charge)), range(len(charge) - 1, -1, -1)):
        carried = np.zeros(charge.shape[1])
        for v in rows:
            carried += surplus[v] / 2
            kept = np.minimum(carried, full_well_e - held[v])
            held[v] += kept
            carried -= kept
    return held


# CMOS: every row at its own time -------------------------------------------------------------------------------------


def row_times(height: int, row_s: float, exposure_s: float = 0.0) -> Array:
    """When each of `height` rows is in the middle of its exposure, in seconds; row 0 begins at 0.

    A global shutter is the case row_s = 0.
    """
    return exposure_s / 2 + row_s * np.arange(height, dtype=np.float64)


def rolling_rays(camera: Camera, poses: RigidTransform) -> tuple[Array, Array]:
    """Origins (height, 1, 3) and unit directions (height, width, 3) of a camera's rays, each row at its own pose.

    `poses` holds one world_from_cam for each row.
    """
    matrices = poses.as_matrix()
    height = camera.intrinsics.height
    if matrices.shape != (height, 4, 4):
        raise ValueError(
            f"poses must hold one for each of the {height} rows, got {matrices.shape[:-2] or 'a single one'}"
        )
    rays = camera.lens.unproject(camera.intrinsics.from_pixels(camera.intrinsics.grid()))
    return matrices[:, None, :3, 3], rays @ np.swapaxes(matrices[:, :3, :3], 1, 2)


def rolling_picture(
    scene: Scene, camera: Camera, motion: Callable[[Array], RigidTransform], row_s: float, exposure_s: float = 0.0
) -> NDArray[np.float32]:
    """The picture (height, width, 3), linear light, of a moving camera whose rows are exposed one after the other.

    `motion` gives the poses world_from_cam at times (n,) in seconds. Each row is traced at the middle of its exposure,
    so the picture is distorted and not blurred.
    """
    poses = motion(row_times(camera.intrinsics.height, row_s, exposure_s))
    origins, directions = rolling_rays(camera, poses)
    spread = float(np.nanmedian(np.linalg.norm(np.diff(directions[::8], axis=1), axis=-1)))
    return scene.trace(np.broadcast_to(origins, directions.shape), directions, spread)[0]


def gliding(camera: Camera, velocity_m_per_s: ArrayLike) -> Callable[[Array], RigidTransform]:
    """The motion of a camera that starts where it stands, and moves with that velocity (3,) in the world."""
    velocity = np.asarray(velocity_m_per_s, dtype=float)
    start, rotation = camera.centre, camera.world_from_cam.rotation

    def motion(times: Array) -> RigidTransform:
        return RigidTransform.from_components(start + np.outer(times, velocity), rotation)

    return motion


def _charge(electrons: ArrayLike) -> Array:
    charge = np.array(electrons, dtype=float)
    if charge.ndim != 2:
        raise ValueError(f"electrons must be one number for each pixel, (height, width), got shape {charge.shape}")
    return charge
