"""A camera in a light, and how its raw colours are developed: gains, then a matrix, then the curve of the screen."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import ArrayLike

from camviz.colour.balance import WHITE, fit_matrix, neutral, response, seen
from camviz.colour.spaces import SRGB_FROM_XYZ, delta_e_2000, from_srgb, to_lab, to_srgb
from camviz.colour.spectra import illuminant, reflectances, sensitivities, srgb_primaries
from camviz.lenses.arrays import LinearColoursLike
from camviz.lenses.base import Array, as_points
from camviz.scenes.light import to_encoded, to_linear


@dataclass(frozen=True, eq=False)
class CameraInLight:
    """A camera, one of `camviz.colour.spectra.CAMERAS`, in a light of relative power (81,).

    Exposure is such that a perfect white gives green 1.
    """

    camera: str
    light: Array

    @cached_property
    def sensitivity(self) -> Array:
        """The camera's (81, 3)."""
        return sensitivities(self.camera)

    @cached_property
    def _exposure(self) -> float:
        return 1 / float(response(self.light, 1.0, self.sensitivity)[1])

    def raw(self, reflectance: ArrayLike) -> Array:
        """What the sensor counts of surfaces (..., 81): (..., 3)."""
        return self._exposure * response(self.light, reflectance, self.sensitivity)

    @cached_property
    def white(self) -> Array:
        """The raw colour (3,) of a perfect white."""
        return self.raw(1.0)

    @cached_property
    def raw_chart(self) -> Array:
        """The raw colours (24, 3) of the chart."""
        return self.raw(reflectances())

    @cached_property
    def raw_from_srgb(self) -> Array:
        """The matrix (3, 3) that takes a photograph's linear sRGB to the raw colours of surfaces that look like it."""
        return self.raw(srgb_primaries()).T

    @cached_property
    def true_chart(self) -> Array:
        """XYZ (24, 3) of the chart for an eye used to the light, brought to D65."""
        return seen(self.light, reflectances())

    @cached_property
    def matrix(self) -> Array:
        """Linear sRGB from balanced raw (3, 3), fitted to the chart in this light, white staying white."""
        truth = to_srgb(self.true_chart)
        return fit_matrix(self.raw_chart * neutral(self.white), truth, (np.ones(3), SRGB_FROM_XYZ @ WHITE))


def in_daylight(camera: str) -> CameraInLight:
    """The camera in D65, where cameras are calibrated."""
    return CameraInLight(camera, illuminant("D65"))


def xyz_from_raw(camera: str) -> Array:
    """The matrix (3, 3) from raw colours as they are, unbalanced, to XYZ, fitted in D65, whose white is kept."""
    shot = in_daylight(camera)
    return fit_matrix(shot.raw_chart, shot.true_chart, (shot.white, WHITE))


def developed(raw: LinearColoursLike, gains: ArrayLike, matrix: ArrayLike, *, encoded: bool = False) -> Array:
    """Linear sRGB of raw colours: the gains, then the matrix.

    Args:
        gains: (3,), factors of white balance.
        matrix: (3, 3), from the balanced raw colour to sRGB; it acts on columns.
        encoded: Whether both act on values that the screen's curve has bent already, which is the common mistake.

    Returns: (..., 3), linear; values outside 0 … 1 are kept, unless `encoded`.
    Raises: ValueError for raw colours of another shape.
    Source: Szeliski (2022), section 2.3.2.

    Gains turn a grey card's raw colour grey, but not once the curve has bent it:

    >>> raw, gains = (0.1, 0.2, 0.16), (2, 1, 1.25)
    >>> developed(raw, gains, np.eye(3)), developed(raw, gains, np.eye(3), encoded=True).round(2)
    (array([0.2, 0.2, 0.2]), array([0.45, 0.2 , 0.26]))
    """
    values = to_encoded(as_points(raw, 3, "raw")) if encoded else as_points(raw, 3, "raw")
    result = values * np.asarray(gains, dtype=float) @ np.asarray(matrix, dtype=float).T
    return np.asarray(to_linear(np.clip(result, 0, 1)) if encoded else result, dtype=np.float64)


def errors(rgb: ArrayLike, true_xyz: ArrayLike) -> Array:
    """ΔE2000 (...) between linear sRGB colours and true XYZ under D65, each (..., 3)."""
    return delta_e_2000(to_lab(from_srgb(rgb), WHITE), to_lab(true_xyz, WHITE))
