"""The camera models that can be calibrated: the choices of `camviz calibrate --model`. Imports no solver."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

from camviz import lenses

PIXELS = ("fx", "fy", "cx", "cy")


@dataclass(frozen=True)
class CameraModel:
    """A lens, and which of its parameters are solved for beside fx, fy, cx and cy, and how.

    `solver` is the function of OpenCV that solves first, with `flags` of its own. Without one the calibration begins
    with the lens of parameters `start`, at the focal length that fits the boards best. `regularised` are models whose
    denominator a prior keeps from 0 (`camviz_clinic.calibration.regularisation`).
    """

    lens: type[Any]
    title: str
    coefficients: str  # of the lens, by their names
    help: str  # one line of the command's
    solver: str = ""
    flags: str = ""
    start: tuple[float, ...] = ()
    regularised: bool = False

    @property
    def parameters(self) -> tuple[str, ...]:
        """All that are solved for."""
        return (*PIXELS, *self.coefficients.split())


MODELS: dict[str, CameraModel] = {
    "standard": CameraModel(
        lenses.BrownConrady,
        "Brown-Conrady",
        "k1 k2 p1 p2 k3",
        "k1 k2 p1 p2 k3: most cameras",
        "calibrateCamera",
    ),
    "rational": CameraModel(
        lenses.BrownConrady,
        "Brown-Conrady, rational",
        "k1 k2 p1 p2 k3 k4 k5 k6",
        "and k4 k5 k6, kept from poles by a prior: wide angles, with many views up to the image's corners",
        "calibrateCamera",
        "CALIB_RATIONAL_MODEL",
        regularised=True,
    ),
    "thin-prism": CameraModel(
        lenses.BrownConrady,
        "Brown-Conrady with thin prisms",
        "k1 k2 p1 p2 k3 s1 s2 s3 s4",
        "and s1 s2 s3 s4 beside the standard ones: tilted or decentred lenses",
        "calibrateCamera",
        "CALIB_THIN_PRISM_MODEL",
    ),
    "fisheye": CameraModel(
        lenses.KannalaBrandt,
        "Kannala-Brandt",
        "k1 k2 k3 k4",
        "k1 k2 k3 k4 of Kannala and Brandt, as cv2.fisheye has it",
        "fisheye.calibrate",
    ),
    "omni": CameraModel(
        lenses.UnifiedSphere,
        "unified sphere",
        "xi k1 k2 p1 p2",
        "xi k1 k2 p1 p2 of the unified sphere, as cv2.omnidir has it",
        "omnidir.calibrate",
    ),
}
"""By the names that `camviz calibrate --model` takes.

>>> MODELS["fisheye"].parameters
('fx', 'fy', 'cx', 'cy', 'k1', 'k2', 'k3', 'k4')
"""
