"""Refocusing: shear the light field, then sum over the aperture; or cut a slice out of its spectrum."""

from __future__ import annotations

from math import floor
from typing import Any

import cv2
import numpy as np
from numpy.typing import ArrayLike, NDArray

from camviz.lenses.base import Array
from camviz.lightfields.field import LightField
from camviz.scenes.light import to_linear

Floats = NDArray[np.float32]


def refocus(field: LightField, disparity: float, mask: ArrayLike | None = None) -> Floats:
    """The picture (height, width, 3), linear light, that is sharp where points move by `disparity` pixels a view.

    Shift and sum: R(x, y) = Σ w_vu L_vu(x − d u, y − d v) / Σ w_vu, with u and v counted from the aperture's middle
    (Ng 2005). `mask` (rows, columns) are the weights w ≥ 0, by default all ones. Between pixels views are
    interpolated linearly, first along y and then along x; beyond its border a view goes on as it ends.
    Raises ValueError for a mask of another shape, or with no view in it.
    """
    weights = _weights(field, mask)
    table = linear_bytes() if field.views.dtype == np.uint8 else None
    down, right = field.steps()
    total = np.zeros(field.views.shape[2:], np.float32)
    for u in np.flatnonzero(weights.any(axis=0)):
        column = np.zeros_like(total)
        for v in np.flatnonzero(weights[:, u]):
            view = field.views[v, u] if table is None else cv2.LUT(field.views[v, u], table)
            _add_shifted(column, view, -disparity * down[v], weights[v, u], axis=0)
        _add_shifted(total, column, -disparity * right[u], 1.0, axis=1)
    return total


def _weights(field: LightField, mask: ArrayLike | None) -> Array:
    weights = np.ones((field.rows, field.columns)) if mask is None else np.asarray(mask, dtype=float)
    if weights.shape != (field.rows, field.columns):
        raise ValueError(f"mask must have shape {(field.rows, field.columns)}, got {weights.shape}")
    if not (weights.min() >= 0 and 0 < weights.sum() < np.inf):
        raise ValueError("mask must hold weights that are not negative, and at least one that is positive")
    return weights / weights.sum()


def linear_bytes() -> Floats:
    """The linear light (256,) of each sRGB byte."""
    return np.asarray(to_linear(np.arange(256, dtype=np.uint8)), dtype=np.float32)


def _add_shifted(total: Floats, picture: NDArray[np.floating], shift: float, weight: float, axis: int) -> None:
    """total(x) += weight · picture(x + shift) along one axis, between pixels by a straight line."""
    whole = floor(shift)
    part = shift - whole
    near = _moved(picture, whole, axis)
    if part == 0:
        cv2.scaleAdd(near, weight, total, dst=total)
        return
    far = _moved(picture, whole + 1, axis)
    cv2.scaleAdd(near, weight * (1 - part), total, dst=total)
    cv2.scaleAdd(far, weight * part, total, dst=total)


def _moved(picture: NDArray[np.floating], shift: int, axis: int) -> NDArray[np.floating]:
    """picture(x + shift) along an axis; its border goes on for ever."""
    if shift == 0:
        return picture
    size = picture.shape[axis]
    return picture.take(np.clip(np.arange(size) + shift, 0, size - 1), axis=axis)


# With periodic borders the same thing is exact, in two ways ----------------------------------------------------------


def periodic_shift_and_sum(views: ArrayLike, disparity: float) -> Array:
    """Shift and sum of views (v, u, height, width, ...) that repeat at their borders, every view counting the same.

    Each view is shifted by d (u, v), whole pixels or not, by the phase of its own two-dimensional spectrum.
    """
    views = np.asarray(views, dtype=float)
    rows, columns, height, width = views.shape[:4]
    total = np.zeros(views.shape[2:])
    for v in range(rows):
        for u in range(columns):
            turn = np.exp(-2j * np.pi * disparity * (v - (rows - 1) / 2) * np.fft.fftfreq(height))[:, None] * np.exp(
                -2j * np.pi * disparity * (u - (columns - 1) / 2) * np.fft.fftfreq(width)
            )
            spectrum = np.fft.fft2(views[v, u], axes=(0, 1))
            total += np.fft.ifft2(spectrum * _alike(turn, spectrum), axes=(0, 1)).real
    return total / (rows * columns)


def fourier_slice(views: ArrayLike, disparity: float) -> Array:
    """The same picture as a slice: a plane through the origin of the four-dimensional spectrum, transformed back.

    The picture's frequencies k = (k_x, k_y), in cycles per pixel, are found in the light field's spectrum at the
    angular frequencies d k, in cycles per view (Ng 2005, "Fourier slice photography"). Between the
    samples of the spectrum along u and v the interpolation is exact, by the kernel of a grid of so many views.
    """
    views = np.asarray(views, dtype=float)
    rows, columns, height, width = views.shape[:4]
    spectrum = np.fft.fftn(views, axes=(0, 1, 2, 3))
    across = _angular_kernel(columns, disparity * np.fft.fftfreq(width))
    down = _angular_kernel(rows, disparity * np.fft.fftfreq(height))
    plane = np.einsum("vy,ux,vuyx...->yx...", down, across, spectrum)
    return np.fft.ifft2(plane, axes=(0, 1)).real


def _angular_kernel(count: int, frequency: NDArray[np.floating]) -> NDArray[np.complexfloating]:
    """Weights (count, n) that make of `count` samples F_m of a spectrum its mean value at `frequency` (n,).

    L_j = Σ F_m e^{2πi mj/N} / N; put into Σ L_j e^{−2πi ω (j − c)} / N, this is Σ F_m W_m(ω).
    """
    j, m = np.arange(count), np.arange(count)
    places = np.exp(2j * np.pi * np.outer(m, j) / count)
    return places @ np.exp(-2j * np.pi * np.outer(j - (count - 1) / 2, frequency)) / count**2


def _alike(plane: NDArray[Any], picture: NDArray[Any]) -> NDArray[Any]:
    """A plane (height, width) with as many axes as the picture (height, width, ...)."""
    return plane.reshape(plane.shape + (1,) * (picture.ndim - 2))
