"""One camera's picture as another camera in the same place would have taken it, by the ray of every pixel."""

from __future__ import annotations

from dataclasses import replace
from functools import lru_cache
from math import pi
from typing import Any

import cv2
import numpy as np
from numpy.typing import ArrayLike, NDArray

from camviz.cameras import Camera, Intrinsics
from camviz.lenses import Cylindrical, Equirectangular
from camviz.lenses.arrays import Count, Degrees
from camviz.lenses.base import Array, blocked_matmul
from camviz.panoramas.cubemap import Cubemap, cells, joined
from camviz.poses import RigidTransform, Rotation

Picture = NDArray[Any]
Floats = NDArray[np.float32]

NOTHING = 0.27  # of full scale, where no ray arrives: the grey of the virtual camera's own gaps
STEP = 4  # pixels between the nodes of a map, which is exact there
TOLERANCE = 0.02  # of a source pixel: how far a map may be from exact between its nodes
FINEST = 16  # samples along each side of a pixel, at most
STRIP = 1 << 20  # samples taken at a time
LONGEST = 32_000  # pixels along a side, at most: OpenCV's remap counts in 16 bits
_LOST = -9.0  # a place outside every picture
_KINDS = ("uint8", "uint16", "int16", "float32", "float64")


def reproject(
    picture: ArrayLike, source: Camera, target: Camera, *, nothing: ArrayLike | None = NOTHING, antialias: bool = True
) -> Picture:
    """The picture that one camera would take of what another one in the same place took.

    Every pixel's ray is followed from `target` into `source`, whose picture is interpolated there, bilinear, in the
    picture's own values. Of the poses only the directions count: the scene is taken to be far away. A panorama that
    goes all the way round is joined at ±180° and across its poles, a cube map along its edges.

    Where a pixel of the target covers several of the source, n × n samples spread evenly over it are averaged, n being
    how many it covers along a side, rounded, at most 16. That is the box filter of the new pixel.

    Args:
        picture: (height, width) or (height, width, channels), what `source` took, 1 to 4 channels of any unit, as
            integers of up to 16 bits or floats.
        source, target: Whose picture it is, and whose is wanted.
        nothing: scalar or (channels,), what a pixel shows that has no ray, or whose ray `source` does not see: a share
            of full scale (1 for floats). With None the result has one channel more, alpha: 0 there, full elsewhere.
        antialias: Without it one sample is taken at the centre of each pixel.

    Returns: array (height, width) or (height, width, channels), of the target's size and the picture's kind.
    Raises: ValueError for a picture that is not of the source's size, or of a kind that cannot be interpolated.
    Source: Szeliski (2022), sections 3.6.1 and 8.2.6.

    A panorama whose right half is white, seen straight ahead:

    >>> panorama = np.zeros((180, 360))
    >>> panorama[:, 180:] = 1
    >>> reproject(panorama, equirectangular_camera(360, 180), window(4, 2, hfov_deg=90))
    array([[0., 0., 1., 1.],
           [0., 0., 1., 1.]])
    """
    pixels = _checked(np.asarray(picture), source.intrinsics)
    full = float(np.iinfo(pixels.dtype).max) if pixels.dtype.kind in "iu" else 1.0
    fill = full * np.resize(0.0 if nothing is None else np.asarray(nothing, dtype=float), 4)
    if nothing is None:
        colours = pixels.reshape(*pixels.shape[:2], -1)
        pixels = np.concatenate([colours, np.full_like(colours[..., :1], full)], axis=-1)
    n = samples_a_side(source, target) if antialias else 1
    bordered = _bordered(pixels, source)
    width, height = target.intrinsics.width, target.intrinsics.height
    result = np.empty((height, width, *pixels.shape[2:]), pixels.dtype)
    rows = max(1, STRIP // (width * n * n))
    for top in range(0, height, rows):
        strip = target.intrinsics.cropped(0, top, width, min(rows, height - top))
        fine = replace(target, intrinsics=strip.resized(n * width, n * strip.height))
        seen = cv2.remap(bordered, places(source, fine), None, cv2.INTER_LINEAR, borderValue=fill.tolist())
        if n > 1:
            seen = cv2.resize(seen, (width, strip.height), interpolation=cv2.INTER_AREA)
        result[top : top + strip.height] = seen.reshape(strip.height, *result.shape[1:])
    return result


@lru_cache(maxsize=8)
def window(
    width: Count, height: Count, hfov_deg: Degrees, *, yaw_deg: float = 0, pitch_deg: float = 0, roll_deg: float = 0
) -> Camera:
    """A virtual pan-tilt-zoom camera: perspective, turned to the right, then up, then clockwise.

    The axes are those of the frustum view: Y X Z, each in the frame turned so far.

    Args:
        yaw_deg, pitch_deg, roll_deg: To the right, up and clockwise, in degrees.

    Returns: Camera at the origin.
    Raises: ValueError for a field outside (0, 180) degrees.

    Turned by 90° its middle sees what lies to the right:

    >>> window(640, 480, hfov_deg=60, yaw_deg=90).project([1, 0, 0])
    array([319.5, 239.5])
    """
    return Camera(Intrinsics.from_fov(width, height, hfov_deg), world_from_cam=turned(yaw_deg, pitch_deg, roll_deg))


def turned(yaw_deg: float, pitch_deg: float, roll_deg: float) -> RigidTransform:
    """The pose of a camera at the origin that looks `yaw_deg` to the right and `pitch_deg` up, rolled clockwise."""
    turn = Rotation.from_euler("YXZ", [yaw_deg, pitch_deg, roll_deg], degrees=True)
    return RigidTransform.from_components(np.zeros(3), turn)


def equirectangular_camera(width: int, height: int) -> Camera:
    """The camera whose picture is the whole sphere.

    Longitudes -180° … 180° lie over the width, and the poles at both edges.

    Args:
        width, height: In pixels; twice as wide as high for square pixels.

    Returns: Camera at the origin.
    Raises: ValueError for a width or height that is no whole number, or below 1.
    Source: Szeliski (2022), section 8.2.6.

    One pixel a degree: what lies at right angles is 90 pixels beside the middle:

    >>> equirectangular_camera(360, 180).project([[0, 0, 1], [1, 0, 0]])
    array([[179.5,  89.5],
           [269.5,  89.5]])
    """
    pixels = Intrinsics(width, height, width / (2 * pi), height / pi, (width - 1) / 2, (height - 1) / 2)
    return Camera(pixels, Equirectangular())


# Where a pixel comes from --------------------------------------------------------------------------------------------


def source_pixels(source: Camera, target: Camera, uv: Array) -> Array:
    """The pixels (..., 2) of `source` that belong at pixels `uv` (..., 2) of `target`; NaN where it sees nothing."""
    pixels = source.intrinsics
    seen = pixels.to_pixels(source.lens.project(blocked_matmul(target.unproject(uv), source.extrinsics[0].T)))
    if _goes_round(source):
        seen[..., 0] = (seen[..., 0] + 0.5) % pixels.width - 0.5
    seen[~pixels.contains(seen)] = np.nan
    return seen


def covered(source: Camera, target: Camera) -> Floats:
    """How many pixels of the source a pixel of the target covers along a side, sampled over the picture (n,).

    The lesser singular value of the map's derivative: a panorama's rows near its poles hold the same few directions
    many times, and are not to be blurred for it.
    """
    pixels = target.intrinsics
    u, v = (np.linspace(0, size - 1, 24) for size in (pixels.width, pixels.height))
    uv = np.stack(np.meshgrid(u, v), axis=-1)
    around = source_pixels(source, target, uv[..., None, :] + 0.5 * np.array([(1, 0), (-1, 0), (0, 1), (0, -1)]))
    J = np.stack([around[..., 0, :] - around[..., 1, :], around[..., 2, :] - around[..., 3, :]], axis=-1)
    J = J[np.isfinite(J).all(axis=(-2, -1))]
    return np.linalg.svd(J, compute_uv=False)[..., -1].astype(np.float32)


def samples_a_side(source: Camera, target: Camera) -> int:
    """Over how many samples along each of its sides a target pixel is averaged: enough for nine tenths of them."""
    sizes = covered(source, target)
    wanted = round(float(np.percentile(sizes, 90))) if sizes.size else 1
    return max(1, min(wanted, FINEST, LONGEST // target.intrinsics.width))


def places(source: Camera, target: Camera) -> Floats:
    """For every pixel of `target` its place (height, width, 2) in the bordered picture of `source`.

    A lens bends smoothly, so that the map is computed at every STEP-th pixel and interpolated in between; where that
    could err by more than TOLERANCE (at rims, poles and seams), every pixel is computed. A sliver of the source's
    picture that is too narrow to hold a node anywhere near may be missed.
    """

    def exact(uv: Array) -> Floats:
        return _in_bordered(source, source_pixels(source, target, uv)).astype(np.float32)

    width, height = target.intrinsics.width, target.intrinsics.height
    u, v = (np.arange(-3, -(-size // STEP) + 3) * STEP + (STEP - 1) / 2 for size in (width, height))
    at = np.stack(np.meshgrid(u, v), axis=-1)
    nodes = exact(at)
    faces = cells(target, at) if isinstance(target.lens, Cubemap) else 0  # at a cube's edge the map has a kink
    smooth = _smooth(nodes + np.float32(100) * faces)
    map_uv = _between(np.nan_to_num(nodes[1:-1, 1:-1], nan=_LOST))[:height, :width]
    row, column = np.nonzero(np.repeat(np.repeat(~smooth, STEP, axis=0), STEP, axis=1)[:height, :width])
    map_uv[row, column] = np.nan_to_num(exact(np.stack([column, row], axis=-1)), nan=_LOST)
    return map_uv


def _smooth(nodes: Floats) -> NDArray[np.bool_]:
    """Of a map's nodes (m + 6, n + 6, 2): True (m, n) where the pixels around a node can be had from `_between`.

    That errs by no more than 1/16 of the largest third difference along each axis.
    """
    below, across = (np.abs(np.diff(nodes, 3, axis=axis)) for axis in (0, 1))
    below, across = below[:, 2:-2], across[2:-2]
    third = np.maximum(below[1:], below[:-1]) + np.maximum(across[:, 1:], across[:, :-1])
    rough = ~(np.maximum(third[..., 0], third[..., 1]) <= 16 * TOLERANCE)  # NaN is rough ...
    near = cv2.dilate(rough.astype(np.uint8), np.ones((5, 5), np.uint8)) > 0
    lost = np.isnan(nodes[..., 0]).astype(np.uint8)
    alone = cv2.erode(lost, np.ones((5, 5), np.uint8))[2:-2, 2:-2] > 0  # ... unless there is nothing around
    alone[[1, -2]] = alone[:, [1, -2]] = False  # at the picture's edge, where nodes outside may have no ray
    return np.asarray((~near | alone)[1:-1, 1:-1])


def _between(nodes: Floats) -> Floats:
    """Nodes (m + 4, n + 4, 2) made STEP times as dense: (STEP · m, STEP · n, 2) around the inner ones.

    Linear, bent by the second differences δ²: u = (1 - t) u₀ + t u₁ + ½ t (t - 1) δ² (Bessel's formula).
    """
    t = (np.arange(-STEP, STEP * (max(nodes.shape[:2]) - 3)) + (1 - STEP) / 2) / STEP % 1
    bend = (t * (t - 1) / 2).astype(np.float32)
    bent = _denser(nodes[1:-1, 1:-1])
    below = _denser(np.diff(nodes, 2, axis=0)[:, 1:-1])
    below *= bend[: len(bent), None, None]
    bent += below
    across = _denser(np.diff(nodes, 2, axis=1)[1:-1])
    across *= np.repeat(bend[: bent.shape[1]], 2).reshape(-1, 2)
    bent += across
    return bent[STEP:-STEP, STEP:-STEP]


def _denser(nodes: Floats) -> Floats:
    return np.asarray(cv2.resize(nodes, None, fx=STEP, fy=STEP, interpolation=cv2.INTER_LINEAR), dtype=np.float32)


# Borders -------------------------------------------------------------------------------------------------------------


def _goes_round(camera: Camera) -> bool:
    """True of a panorama whose first and last columns are neighbours."""
    pixels = camera.intrinsics
    round_ = isinstance(camera.lens, Equirectangular | Cylindrical)
    return round_ and abs(2 * pi * pixels.fx - pixels.width) < 1e-6 * pixels.width


def _has_poles(camera: Camera) -> bool:
    """True of a panorama that ends in both poles, so that its first row goes on half a turn away."""
    pixels = camera.intrinsics
    whole = _goes_round(camera) and isinstance(camera.lens, Equirectangular)
    return whole and bool(np.allclose((pi * pixels.fy, pixels.cy), (pixels.height, (pixels.height - 1) / 2)))


def _bordered(picture: Picture, source: Camera) -> Picture:
    """The picture inside a border of one pixel, so that all it shows, out to -0.5 and size - 0.5, can be interpolated.

    The border shows what lies beyond the edge: the other edge of a panorama, another face of a cube; else the same.
    """
    if isinstance(source.lens, Cubemap):
        return joined(picture, source.lens.layout)
    bordered = cv2.copyMakeBorder(picture, 1, 1, 1, 1, cv2.BORDER_REPLICATE)
    bordered = bordered.reshape(*bordered.shape[:2], *picture.shape[2:])
    if _has_poles(source):
        half = picture.shape[1] // 2
        bordered[0, 1:-1], bordered[-1, 1:-1] = np.roll(picture[0], half, 0), np.roll(picture[-1], half, 0)
    if _goes_round(source):
        bordered[:, 0], bordered[:, -1] = bordered[:, -2], bordered[:, 1]
    return bordered


def _in_bordered(source: Camera, uv: Array) -> Array:
    """Where pixels (..., 2) of the source lie in its bordered picture."""
    if isinstance(source.lens, Cubemap):
        return uv + 1 + 2 * (cells(source, uv) + source.lens.layout.places[0])
    return uv + 1


def _checked(picture: Picture, pixels: Intrinsics) -> Picture:
    if picture.shape[:2] != (pixels.height, pixels.width) or picture.ndim not in (2, 3):
        raise ValueError(
            f"picture must have shape ({pixels.height}, {pixels.width}) or ({pixels.height}, {pixels.width}, channels) "
            f"like its camera, got {picture.shape}"
        )
    if picture.ndim == 3 and not 1 <= picture.shape[2] <= 4:
        raise ValueError(f"picture must have 1 to 4 channels, got {picture.shape[2]}")
    if picture.dtype.name not in _KINDS:
        raise ValueError(f"picture must hold one of {', '.join(_KINDS)}, got {picture.dtype.name}")
    if max(picture.shape[:2]) > LONGEST:
        raise ValueError(f"picture must be at most {LONGEST} pixels wide and high, got {picture.shape[:2]}")
    return picture
