"""What a lens declares of itself beside its equations, for formats, calibration, the clinic and the contract tests."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from types import MappingProxyType


@dataclass(frozen=True)
class Spelling:
    """How a program writes a lens in its files: the camera model's name, and the parameters in the program's order.

    `program` is the format's name in camviz. `parameters` are names of the lens and of `Intrinsics`, with f where one
    focal length serves as fx and fy. `fixed` are parameters that the program leaves out, and their values. `number` is
    the model's number, for a program that counts its models.
    """

    program: str
    model: str
    parameters: str
    fixed: Mapping[str, float] = field(default_factory=lambda: MappingProxyType({}))
    number: int = -1


@dataclass(frozen=True)
class CalibrationModel:
    """A choice of `camviz calibrate --model`: which parameters are solved for beside fx, fy, cx and cy, and how.

    `solver` is the function of OpenCV that solves first, with `flags` of its own. Without one the calibration begins
    with the lens of parameters `start`, at the focal length that fits the boards best. `regularised` are models whose
    denominator a prior keeps from 0 (`camviz_clinic.calibration.regularisation`).
    """

    name: str
    title: str
    parameters: str
    says: str  # one line of the command's help
    solver: str = ""
    flags: str = ""
    start: tuple[float, ...] = ()
    regularised: bool = False


@dataclass(frozen=True)
class Example:
    """Parameters with which the contract tests try a lens.

    With them it sees rays up to `widest_deg` degrees from its axis, in every direction or nearly.
    """

    label: str
    parameters: tuple[float, ...]
    widest_deg: float


@dataclass(frozen=True)
class Fold:
    """Where a lens's radial equation turns back: rays farther out would share their images with rays before it."""

    radius: float  # in the variable of the equation: r on the plane z = 1, or the angle θ
    angle: float  # in radians between the axis and the ray there; infinity where no ray gets there
    image: float  # in focal lengths from the principal point
    unit: str = "focal lengths"  # of the radius
