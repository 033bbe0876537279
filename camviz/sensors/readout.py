"""How charge leaves the sensor: by bucket brigades (CCD), row after row (CMOS), or all at once.

Charges are electrons (height, width); row 0 is the first to be read.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from math import isfinite

import numpy as np
from numpy.typing import ArrayLike

from camviz.cameras import Camera
from camviz.lenses.arrays import Charges, ChargesLike, Count, LinearPicture32, Seconds
from camviz.lenses.base import Array, as_points
from camviz.poses import RigidTransform
from camviz.scenes.scene import Scene

FORGOTTEN = 1e-7  # the share of a charge below which the trail that it leaves is dropped


# CCD: charge is carried ------------------------------------------------------------------------------------------


@dataclass(frozen=True, eq=False)
class CcdRegister:
    """A bucket brigade at one moment: where all the charge is.

    Attributes:
        area: (height, width), electrons still on the light-sensitive area.
        register: (width,), electrons in the register.
        read: (n,), electrons read so far.

    >>> halted = bucket_brigade([[1, 2], [3, 4]], ticks=1)
    >>> halted.area.sum() + halted.register.sum() + halted.read.sum()  # none is lost
    np.float64(10.0)
    """

    area: Array
    register: Array
    read: Array


def bucket_brigade(electrons: ChargesLike, ticks: Count) -> CcdRegister:
    """The brigade of a CCD after the amplifier has read some pixels: rows shift into the register, which shifts along.

    A row enters the register when the one before has been read out, all with perfect transfer.

    Raises: ValueError for fewer than 0 or more than height · width ticks.
    Source: J. R. Janesick, Scientific Charge-Coupled Devices (2001), chapter 1.

    >>> bucket_brigade([[1, 2], [3, 4]], ticks=3)
    CcdRegister(area=array([[0., 0.],
           [0., 0.]]), register=array([4., 0.]), read=array([1., 2., 3.]))
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


def transferred(electrons: ChargesLike, efficiency: float, overscan: int = 0) -> Array:
    """Charges as they reach the register, when each shift leaves some behind.

    Row i needs n = i + 1 shifts; what is left behind k times comes k rows later, a share C(n+k-1, k) c^n (1-c)^k: the
    negative binomial law.

    Args:
        efficiency: The share of a charge that a shift moves, c, above 0.5 and at most 1.
        overscan: Further shifts, of empty rows, that show the trail of the last row.

    Returns: (height + overscan, width), in electrons.
    Raises: ValueError for an efficiency outside (0.5, 1].
    Source: J. R. Janesick, Scientific Charge-Coupled Devices (2001), chapter 5.

    A trail of 0.9 · 0.1^k behind a single charge:

    >>> transferred([[1000], [0], [0]], efficiency=0.9)[:, 0].round(6)
    array([900.,  90.,   9.])
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


def smeared(electrons: ChargesLike, exposure_s: Seconds, row_shift_s: float) -> Charges:
    """Charges when light still falls while the rows of a CCD shift: each row passes under every row's light.

    q + t_shift/t_exposure · (sum of its column): half of it gathered on the way in, half on the way out. That is a CCD
    without a shutter or a shielded storage; the stripe runs through the whole column of anything bright.

    Args:
        row_shift_s: How long a row stays under the next one's light, in seconds.

    Raises: ValueError for times below zero, and an exposure of no time.
    Source: J. R. Janesick, Scientific Charge-Coupled Devices (2001), chapter 5.

    With shifts a hundredth of the exposure long, a lamp adds 1 % of its charge to its whole column:

    >>> smeared([[0], [1000], [0]], exposure_s=0.01, row_shift_s=0.0001)[:, 0]
    array([  10., 1010.,   10.])
    """
    charge = _charge(electrons)
    for name, value in (("exposure_s", exposure_s), ("row_shift_s", row_shift_s)):
        if not (isfinite(value) and value >= 0):
            raise ValueError(f"{name} must be zero seconds or more, got {value}")
    if exposure_s == 0:
        raise ValueError("exposure_s must be more than zero: smear is a share of the light gathered in it")
    stripe = charge.sum(axis=0) * (row_shift_s / exposure_s)
    return np.asarray(charge + stripe, dtype=np.float64)


def bloomed(electrons: ChargesLike, full_well_e: float) -> Charges:
    """Charges when full wells spill along their columns, half of the surplus either way, until there is room.

    Channel stops keep columns apart; what reaches the column's end is lost. An anti-blooming drain instead is `fill`.

    Args:
        full_well_e: What a well holds.

    Raises: ValueError for a full well that is not above 0.
    Source: J. R. Janesick, Scientific Charge-Coupled Devices (2001), chapter 4.

    >>> bloomed([[0], [0], [100], [0], [0]], full_well_e=40)[:, 0]
    array([ 0., 30., 40., 30.,  0.])
    """
    if not full_well_e > 0:
        raise ValueError(f"full_well_e must be above 0 electrons, got {full_well_e}")
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


def row_times(height: Count, row_s: float, exposure_s: Seconds = 0.0) -> Array:
    """When each row of a rolling shutter is in the middle of its exposure; row 0 begins at 0.

    Args:
        row_s: From one row to the next, in seconds; 0 is a global shutter.

    Returns: (height,), in seconds.

    >>> row_times(4, row_s=0.001, exposure_s=0.010)
    array([0.005, 0.006, 0.007, 0.008])
    """
    return exposure_s / 2 + row_s * np.arange(height, dtype=np.float64)


def rolling_rays(camera: Camera, poses: RigidTransform) -> tuple[Array, Array]:
    """A camera's rays, each row at its own pose.

    Args:
        camera: Its own pose does not count.
        poses: One world_from_cam for each row.

    Returns:
        origins: (height, 1, 3), in metres.
        directions: (height, width, 3), unit vectors; NaN where there is no ray.

    Raises: ValueError unless there is one pose for each row.

    A camera that glides to the right at 1 m/s, rows 0.1 s apart:

    >>> from camviz.cameras import Camera
    >>> from camviz import Intrinsics
    >>> camera = Camera(Intrinsics.from_fov(4, 3, 90))
    >>> origins, directions = rolling_rays(camera, gliding(camera, (1, 0, 0))(row_times(3, row_s=0.1)))
    >>> origins[:, 0, 0]
    array([0. , 0.1, 0.2])
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
    scene: Scene, camera: Camera, motion: Callable[[Array], RigidTransform], row_s: Seconds, exposure_s: Seconds = 0.0
) -> LinearPicture32:
    """The picture of a moving camera whose rows are exposed one after the other.

    Each row is traced at the middle of its exposure, so the picture is distorted and not blurred.

    Args:
        camera: Its own pose does not count.
        motion: Gives the poses world_from_cam at times (n,) in seconds.

    Raises: ValueError unless the motion gives one pose for each row.
    Source: E. Ringaby and P.-E. Forssén, Efficient video rectification and stabilisation for cell-phones, Int. J.
    Comput. Vis. 96 (2012).

    An upright edge leans when the camera glides to the left, by f / z · 0.5 m = 1 pixel a row:

    >>> from camviz.cameras import Camera
    >>> from camviz import Intrinsics
    >>> from camviz.scenes import Rectangle, Scene, Texture
    >>> wall = Rectangle((0, -9, 2), (9, 0, 0), (0, 18, 0), Texture.plain((1, 1, 1)))
    >>> scene, camera = Scene([wall], sky=Texture.plain((0, 0, 0))), Camera(Intrinsics.from_fov(8, 3, 90))
    >>> rolling_picture(scene, camera, gliding(camera, (-1, 0, 0)), row_s=0.5)[..., 0]
    array([[0., 0., 0., 0., 1., 1., 1., 1.],
           [0., 0., 0., 0., 0., 1., 1., 1.],
           [0., 0., 0., 0., 0., 0., 1., 1.]], dtype=float32)
    """
    poses = motion(row_times(camera.intrinsics.height, row_s, exposure_s))
    origins, directions = rolling_rays(camera, poses)
    spread = float(np.nanmedian(np.linalg.norm(np.diff(directions[::8], axis=1), axis=-1)))
    return scene.trace(np.broadcast_to(origins, directions.shape), directions, spread)[0]


def gliding(camera: Camera, velocity_m_per_s: ArrayLike) -> Callable[[Array], RigidTransform]:
    """The motion of a camera that starts where it stands, and moves with a constant velocity.

    Args:
        camera: Where it starts and looks.
        velocity_m_per_s: (3,), in the world, in metres per second.

    Returns: Gives the poses world_from_cam at times (n,) in seconds.
    Raises: ValueError for another shape.

    >>> from camviz.cameras import Camera
    >>> from camviz import Intrinsics
    >>> motion = gliding(Camera(Intrinsics.from_fov(4, 3, 90)), (0, 0, 2))
    >>> motion(np.array([0, 0.5])).translation
    array([[0., 0., 0.],
           [0., 0., 1.]])
    """
    velocity = as_points(velocity_m_per_s, 3, "velocity_m_per_s")
    start, rotation = camera.centre, camera.world_from_cam.rotation

    def motion(times: Array) -> RigidTransform:
        return RigidTransform.from_components(start + np.outer(times, velocity), rotation)

    return motion


def _charge(electrons: ArrayLike) -> Array:
    charge = np.array(electrons, dtype=float)
    if charge.ndim != 2:
        raise ValueError(f"electrons must be one number for each pixel, (height, width), got shape {charge.shape}")
    return charge
