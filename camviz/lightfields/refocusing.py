"""Refocusing: shear the light field, then sum over the aperture; or cut a slice out of its spectrum."""

from __future__ import annotations

from math import floor, isfinite
from typing import Any

import cv2
import numpy as np
from numpy.typing import ArrayLike, NDArray

from camviz.lenses.arrays import LinearPicture32, ViewsLike
from camviz.lenses.base import Array
from camviz.lightfields.field import LightField
from camviz.lightfields.plenoptic import grid_of
from camviz.scenes.light import to_linear

Floats = NDArray[np.float32]


def refocus(field: LightField, disparity: float, mask: ArrayLike | None = None) -> LinearPicture32:
    """The picture that is sharp where points move by a disparity: shift and sum.

    R(x, y) = Σ w_vu L_vu(x − d u, y − d v) / Σ w_vu, with u and v counted from the aperture's middle. Between pixels
    views are interpolated linearly, first along y and then along x; beyond its border a view goes on as it ends.

    Args:
        field: The views.
        disparity: In pixels a view; 0 is the focus of the field.
        mask: (rows, columns), the weights w ≥ 0 of the views, such as `aperture` gives; by default all share alike.

    Raises: ValueError for a mask of another shape or with no view in it, and a disparity that is not finite.
    Source: R. Ng, Fourier slice photography, ACM Trans. Graph. 24 (2005).

    A point that moves by one pixel a view is bright in focus, and spread over nine pixels out of focus:

    >>> views = np.zeros((3, 3, 5, 5, 3))
    >>> for v, u in np.ndindex(3, 3):
    ...     views[v, u, 3 - v, 3 - u] = 0.9
    >>> refocus(LightField(views), 1)[2, 2].round(3), refocus(LightField(views), 0)[2, 2].round(3)
    (array([0.9, 0.9, 0.9], dtype=float32), array([0.1, 0.1, 0.1], dtype=float32))
    """
    if not isfinite(disparity):
        raise ValueError(f"disparity must be a finite number of pixels, got {disparity}")
    weights = _weights(field, mask)
    table = linear_bytes() if field.views.dtype == np.uint8 else None
    down, right = field.steps()
    total = np.zeros(field.views.shape[2:], np.float32)
    for u in np.flatnonzero(weights.any(axis=0)):
        column = np.zeros_like(total)
        for v in np.flatnonzero(weights[:, u]):
            view = np.asarray(field.views[v, u], np.float32) if table is None else cv2.LUT(field.views[v, u], table)
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


def periodic_shift_and_sum(views: ViewsLike, disparity: float) -> Array:
    """Shift and sum of views that repeat at their borders, every view counting the same.

    Each view is shifted by d (u, v), whole pixels or not, by the phase of its own two-dimensional spectrum: exact for
    what `refocus` interpolates.

    Args:
        disparity: In pixels a view.

    Returns: (height, width, ...), linear light.
    Raises: ValueError for views of another shape.
    Source: R. Ng, Fourier slice photography, ACM Trans. Graph. 24 (2005).

    >>> views = np.random.default_rng(0).random((3, 3, 8, 8))
    >>> np.allclose(periodic_shift_and_sum(views, 0), views.mean(axis=(0, 1)))  # no shift: a plain mean
    True
    """
    views = np.asarray(views, dtype=float)
    rows, columns, height, width = grid_of(views)
    total = np.zeros(views.shape[2:])
    for v in range(rows):
        for u in range(columns):
            turn = np.exp(-2j * np.pi * disparity * (v - (rows - 1) / 2) * np.fft.fftfreq(height))[:, None] * np.exp(
                -2j * np.pi * disparity * (u - (columns - 1) / 2) * np.fft.fftfreq(width)
            )
            spectrum = np.fft.fft2(views[v, u], axes=(0, 1))
            total += np.fft.ifft2(spectrum * _alike(turn, spectrum), axes=(0, 1)).real
    return total / (rows * columns)


def fourier_slice(views: ViewsLike, disparity: float) -> Array:
    """The picture of `periodic_shift_and_sum` as a slice of the light field's spectrum, transformed back.

    The picture's frequencies k = (k_x, k_y), in cycles per pixel, are found in the four-dimensional spectrum at the
    angular frequencies d k, in cycles per view. Between the samples of the spectrum along u and v the interpolation is
    exact, by the kernel of a grid of so many views.

    Args:
        disparity: In pixels a view.

    Returns: (height, width, ...), linear light.
    Raises: ValueError for views of another shape.
    Source: R. Ng, Fourier slice photography, ACM Trans. Graph. 24 (2005).

    The theorem, tried:

    >>> views = np.random.default_rng(0).random((3, 3, 8, 8))
    >>> np.allclose(fourier_slice(views, 0.7), periodic_shift_and_sum(views, 0.7))
    True
    """
    views = np.asarray(views, dtype=float)
    rows, columns, height, width = grid_of(views)
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
