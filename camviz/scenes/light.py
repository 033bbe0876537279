"""Light: linear radiance inside, sRGB only at the screen, and the one sun that shades the scenes."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray

from camviz.lenses.arrays import Shares
from camviz.lenses.base import Array

SUN = np.array([-0.48, -0.72, -0.50])  # towards the sun: from the left, above and behind a camera at the origin
SKYLIGHT = 0.42  # the share of light that comes from everywhere, and reaches the shade


def to_linear(encoded: ArrayLike) -> NDArray[np.floating]:
    """Linear light of sRGB values: what the screen's curve makes of them.

    Args:
        encoded: any shape, sRGB values 0 … 1, or uint8 bytes 0 … 255.

    Returns: any shape, linear, 0 … 1; float32 for bytes.
    Source: IEC 61966-2-1:1999, section 5.2.

    Half of the values is a fifth of the light:

    >>> to_linear([0.0, 0.5, 1.0]).round(3)
    array([0.   , 0.214, 1.   ])
    """
    c = np.asarray(encoded)
    if c.dtype == np.uint8:
        return to_linear(np.arange(256) / 255).astype(np.float32)[c]
    return np.where(c <= 0.04045, c / 12.92, ((np.maximum(c, 0) + 0.055) / 1.055) ** 2.4)


def to_encoded(linear: ArrayLike) -> Shares:
    """sRGB values of linear light: the inverse of `to_linear`.

    Args:
        linear: any shape, linear light 0 … 1.

    Source: IEC 61966-2-1:1999, section 5.2.

    A grey card of 18 % is not far from the middle of the values:

    >>> to_encoded(0.18).round(3)  # 1.055 · 0.18^(1/2.4) - 0.055
    np.float64(0.461)
    """
    c = np.asarray(linear, dtype=np.float64)
    return np.where(c <= 0.0031308, 12.92 * c, 1.055 * np.maximum(c, 0) ** (1 / 2.4) - 0.055)


def to_display(radiance: ArrayLike) -> NDArray[np.uint8]:
    """sRGB bytes of linear radiance.

    Args:
        radiance: any shape, linear; 1 is white, what is brighter is cut off, and NaN is black.

    Returns: any shape, 0 … 255, uint8.
    Source: IEC 61966-2-1:1999, section 5.2.

    >>> to_display([0, 0.18, 1, 2, np.nan])
    array([  0, 118, 255, 255,   0], dtype=uint8)
    """
    steps = np.multiply(radiance, _STEPS - 1, dtype=np.float32)
    np.fmin(np.fmax(steps, 0, out=steps), _STEPS - 1, out=steps)
    steps += 0.5
    return _BYTES[steps.astype(np.uint16)]


def sunlight(normals: ArrayLike) -> Array:
    """How brightly (...) the open sky and the sun light a matt surface with unit normals (..., 3): Lambert's law."""
    direct = np.maximum(np.asarray(normals, dtype=np.float64) @ (SUN / np.linalg.norm(SUN)), 0)
    return SKYLIGHT + (1 - SKYLIGHT) * direct


_STEPS = 1 << 16
_BYTES = np.rint(255 * to_encoded(np.arange(_STEPS) / (_STEPS - 1))).astype(np.uint8)
_BYTES.flags.writeable = False
