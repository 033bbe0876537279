"""What arrays, and numbers with a unit, are called throughout camviz: a name says shape and unit, once.

A name that ends in `Like` is of what a function takes: lists and tuples will do. Where the last axis has another length
than here, the function raises ValueError. `...` stands for any number of leading axes, which the result has as well.
NaN is what has no answer, such as the pixel of a point behind the camera. Below stands what is done with arrays often.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Annotated, Any, get_origin

import numpy as np
from numpy.typing import ArrayLike, NDArray

Array = NDArray[np.float64]


# Geometry
Points = Annotated[Array, "(..., 3), points in metres."]
PointsLike = Annotated[ArrayLike, "(..., 3), points in metres."]
Rays = Annotated[Array, "(..., 3), unit vectors: directions of length 1."]
Vectors = Annotated[Array, "(..., 3), vectors, of any length and unit."]
VectorsLike = Annotated[ArrayLike, "(..., 3), vectors, of any length and unit."]
RaysLike = Annotated[ArrayLike, "(..., 3), directions of any length and unit."]
UnitRaysLike = Annotated[ArrayLike, "(..., 3), unit vectors: directions of length 1."]
VectorLike = Annotated[ArrayLike, "(3,), one point or vector in metres."]
Pixels = Annotated[Array, "(..., 2), pixels (u, v), whose centres are integers."]
PixelsLike = Annotated[ArrayLike, "(..., 2), pixels (u, v), whose centres are integers."]
PixelsOfEachLike = Annotated[ArrayLike, "(cameras, ..., 2), pixels: the first of the first camera, and so on."]
ImagePoints = Annotated[Array, "(..., 2), points (x, y), distorted or ideal, in focal lengths."]
ImagePointsLike = Annotated[ArrayLike, "(..., 2), points (x, y), distorted or ideal, in focal lengths."]
Radii = Annotated[Array, "(...), radii in focal lengths."]
RadiiLike = Annotated[ArrayLike, "(...), radii in focal lengths."]
Jacobians = Annotated[Array, "(..., 2, 2), derivatives of an image point by an ideal one, without unit."]
Homogeneous = Annotated[Array, "(..., 3), homogeneous points in pixels, on any scale."]
Coordinates = Annotated[Array, "(n,), one coordinate of n points: in focal lengths on the image, of any unit in space."]
LinesLike = Annotated[ArrayLike, "(..., 3), lines a u + b v + c = 0 with a² + b² = 1, in pixels."]
MatrixLike = Annotated[ArrayLike, "(3, 3), a matrix; a fundamental or an essential one on any scale."]
Mask = Annotated[NDArray[np.bool_], "(...), True where it holds; a NaN that is asked about is False."]
DisparitiesLike = Annotated[ArrayLike, "(...), disparities u_left − u_right in pixels."]
Depths = Annotated[Array, "(...), depths or distances in metres."]
DepthsLike = Annotated[ArrayLike, "(...), depths or distances in metres."]
AnglesLike = Annotated[ArrayLike, "(...), angles in radians from the axis z, longitudes to the right of it."]

# Optics
Millimetres = Annotated[Array, "(...), lengths in mm."]
MillimetresLike = Annotated[ArrayLike, "(...), lengths in mm."]
NanometresLike = Annotated[ArrayLike, "(...), wavelengths λ in nanometres."]
SecondsLike = Annotated[ArrayLike, "(...), times in seconds."]
Ratios = Annotated[Array, "(...), ratios, such as f-numbers."]
RatiosLike = Annotated[ArrayLike, "(...), ratios, such as f-numbers."]
Shares = Annotated[Array, "(...), shares, 0 … 1."]
FrequenciesLike = Annotated[ArrayLike, "(...), frequencies of gratings in cycles per mm."]
RayMatrix = Annotated[Array, "(2, 2), the matrix that acts on rays (height in mm, slope)."]

# Light and what counts it
Electrons = Annotated[Array, "any shape, in electrons: signals, or standard deviations of them."]
ElectronsLike = Annotated[ArrayLike, "any shape, in electrons: signals, or standard deviations of them."]
Electrons32 = Annotated[NDArray[np.float32], "any shape, electrons, float32."]
Variances = Annotated[Array, "(...), variances in electrons²."]
Charges = Annotated[Array, "(height, width), charges in electrons; row 0 is the first to be read."]
ChargesLike = Annotated[ArrayLike, "(height, width), charges in electrons; row 0 is the first to be read."]
FrameLike = Annotated[ArrayLike, "(height, width), a frame in DN."]
MosaicLike = Annotated[ArrayLike, "(height, width), a mosaic of linear light."]
LinearPicture = Annotated[Array, "(height, width, 3), linear light, 1 for a white wall."]
LinearPictureLike = Annotated[ArrayLike, "(height, width, 3), linear light, 1 for a white wall."]
LinearPicture32 = Annotated[NDArray[np.float32], "(height, width, 3), linear light, float32."]
ScreenPictureLike = Annotated[ArrayLike, "(height, width, 3), as shown on a screen: sRGB 0 … 1, or bytes."]
ViewsLike = Annotated[ArrayLike, "(v, u, height, width, ...), the views of a light field, linear light."]
CelsiusLike = Annotated[ArrayLike, "(...), temperatures in °C."]
KelvinLike = Annotated[ArrayLike, "(...), temperatures above 0, in kelvin."]
SpectrumLike = Annotated[ArrayLike, "(..., 81), power at WAVELENGTHS_NM, in any unit."]
Xyz = Annotated[Array, "(..., 3), XYZ; Y = 1 is a perfect white unless they are relative to another."]
XyzLike = Annotated[ArrayLike, "(..., 3), XYZ; Y = 1 is a perfect white unless they are relative to another."]
WhiteLike = Annotated[ArrayLike, "(3,), XYZ of what looks white."]
LabLike = Annotated[ArrayLike, "(..., 3), CIELAB's L*, a*, b*."]
LinearColoursLike = Annotated[ArrayLike, "(..., 3), linear red, green and blue."]
Gains = Annotated[Array, "(3,), factors by which red, green and blue are multiplied."]

# Single numbers
Count = Annotated[int, "scalar, a whole number of pixels, columns, rows or samples."]
PixelLength = Annotated[float, "scalar, a length in pixels."]
FocalLengths = Annotated[float, "scalar, a length in focal lengths."]
Degrees = Annotated[float, "scalar, an angle in degrees."]
Share = Annotated[float, "scalar, a share, 0 … 1."]
Seconds = Annotated[float, "scalar, in seconds."]
Nanometres = Annotated[float, "scalar, the wavelength λ of the light in nanometres."]
Metres = Annotated[float, "scalar, in metres."]
Celsius = Annotated[float, "scalar, in °C."]

__all__ = [name for name, value in list(globals().items()) if get_origin(value) is Annotated]

ALONE = 1 << 17  # multiplications of a matrix product that OpenBLAS does without threads; they begin at twice as many
BLOCK = 16384  # points worked on at a time, so that the temporaries stay in the processor's cache


def blockwise(function: Callable[..., tuple[Array, ...]], points: Array, size: int) -> Array:
    """`function` of the coordinates of points (..., n), whose results become the coordinates of points (..., size).

    What has no answer is NaN without a warning: that is its meaning here.
    """
    flat = points.reshape(-1, points.shape[-1])
    result = np.empty((len(flat), size))
    with np.errstate(all="ignore"):
        for start in range(0, len(flat), BLOCK):
            block = slice(start, start + BLOCK)
            coordinates = function(*flat[block].T.copy())
            for i, coordinate in enumerate(coordinates):
                result[block, i] = coordinate
            whole = np.isfinite(sum(coordinates))
            if not whole.all():
                result[block][~whole] = np.nan
    return result.reshape(*points.shape[:-1], size)


def as_points(values: ArrayLike, size: int, name: str) -> Array:
    """`values` as float64 (..., size). Raises ValueError naming `name` when the last axis has another length."""
    points = np.asarray(values, dtype=np.float64)
    if points.ndim == 0 or points.shape[-1] != size:
        raise ValueError(f"{name} must have shape (..., {size}), got {points.shape}")
    return points


def as_point(values: ArrayLike, name: str, size: int = 3) -> Array:
    """`values` as float64 (size,). Raises ValueError naming `name` for any other shape."""
    point = np.asarray(values, dtype=np.float64)
    if point.shape != (size,):
        raise ValueError(f"{name} must have shape ({size},), got {point.shape}")
    return point


def on_plane(xy: Array) -> Array:
    """Directions (..., 3) through points (..., 2) of the plane z = 1."""
    return np.concatenate([xy, np.ones_like(xy[..., :1])], axis=-1)


def blocked_matmul(vectors: NDArray[Any], matrix: NDArray[Any]) -> NDArray[Any]:
    """The products vectors @ matrix, (..., n) times (n, m), some thousands of vectors at a time.

    For more at once OpenBLAS wakes threads, which afterwards wait in a busy loop for tens of milliseconds, on the very
    core where a browser wants to show the picture.
    """
    part = ALONE // matrix.size
    if vectors.ndim == 1 or vectors[..., 0].size <= part:
        return np.asarray(vectors @ matrix)
    flat = vectors.reshape(-1, vectors.shape[-1])
    product = np.empty((len(flat), matrix.shape[-1]), dtype=np.result_type(vectors, matrix))
    for start in range(0, len(flat), part):
        np.matmul(flat[start : start + part], matrix, out=product[start : start + part])
    return product.reshape(*vectors.shape[:-1], -1)


def unit(vectors: Array) -> Array:
    """Vectors (..., n) scaled to length 1; the zero vector has no direction and becomes NaN."""
    with np.errstate(invalid="ignore", divide="ignore"):
        return vectors / np.linalg.norm(vectors, axis=-1, keepdims=True)
