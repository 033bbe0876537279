"""What every lens is: a map between directions in front of the camera and points on its image, at focal length 1.

A lens is one file in this folder: a frozen dataclass under `Lens` that has `image` and `ray`. It knows optics only;
how programs write it stands with their formats. `camviz.lenses` finds the file.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Iterator
from dataclasses import dataclass, fields, replace
from math import isfinite
from typing import Any, ClassVar

import numpy as np
from numpy.polynomial import Polynomial

from camviz.lenses.arrays import (  # noqa: F401
    Array,
    Coordinates,
    ImagePoints,
    ImagePointsLike,
    Jacobians,
    Rays,
    RaysLike,
    Vectors,
    as_point,
    as_points,
    blocked_matmul,
    blockwise,
    on_plane,
    unit,
)

ROUNDING = 1e-12  # how far beyond the rim of its image a point may lie and still be a rounded point of the rim
STEP = np.finfo(float).eps ** (1 / 3)  # where a central difference is exact to STEP², about 4e-11
NO_DENOMINATOR = Polynomial([1.0])


@dataclass(frozen=True)
class Fold:
    """Where a lens's radial equation turns back: rays farther out would share their images with rays before it."""

    radius: float  # in the variable of the equation: r on the plane z = 1, or the angle θ
    angle: float  # in radians between the axis and the ray there; infinity where no ray gets there
    image: float  # in focal lengths from the principal point
    unit: str = "focal lengths"  # of the radius


class Lens(ABC):
    """A lens bends directions: `project` sends a direction to the image, `unproject` brings it back.

    A lens knows neither pixels nor poses. Its image is measured in focal lengths from the principal point, x to the
    right and y down; `Intrinsics` turns that into pixels. It acts on rays rather than on the plane z = 1, so that a
    fisheye may look behind itself. A direction without an image and an image point without a direction are NaN.

    A subclass is a frozen dataclass whose fields are its parameters. It writes its two equations, `image` and `ray`,
    on coordinates (n,), and declares the rest where the default does not hold.

    >>> from camviz.lenses import Equidistant
    >>> fisheye = Equidistant()  # r = θ: a ray to the side, at 90°, lands at π/2
    >>> fisheye.project([1, 0, 0]).round(4)
    array([1.5708, 0.    ])
    >>> fisheye.unproject([np.pi / 2, 0]).round(4)
    array([1., 0., 0.])
    """

    plain: ClassVar[type[Lens] | None] = None  # the lens without parameters that it is where all of its own are 0
    goes_round: ClassVar[bool] = False  # true of a panorama, which sees straight behind itself
    denominator_terms: ClassVar[tuple[str, ...]] = ()  # the parameters a, b … of its `denominator` 1 + a s + b s² + …
    may_mirror: ClassVar[bool] = False  # true where part of the image may be mirrored without a radial fold

    def project(self, points_cam: RaysLike) -> ImagePoints:
        """The images of camera-frame points."""
        return blockwise(self.image, as_points(points_cam, 3, "points_cam"), 2)

    def unproject(self, xy: ImagePointsLike) -> Rays:
        """The rays of image points."""
        return blockwise(self._unit_ray, as_points(xy, 2, "xy"), 3)

    @abstractmethod
    def image(self, x: Coordinates, y: Coordinates, z: Coordinates) -> tuple[Coordinates, Coordinates]:
        """The equation from directions to x and y on the image, on coordinates; readers ask `project`."""

    @abstractmethod
    def ray(self, x: Coordinates, y: Coordinates) -> tuple[Coordinates, Coordinates, Coordinates]:
        """The equation from the image to x, y, z of a ray of any length; readers ask `unproject`."""

    def _unit_ray(self, x: Array, y: Array) -> tuple[Array, Array, Array]:
        x, y, z = self.ray(x, y)
        scale = 1 / np.sqrt(x * x + y * y + z * z)
        return x * scale, y * scale, z * scale

    # What else it is called

    @classmethod
    def parameters(cls) -> tuple[str, ...]:
        """The names of the lens's own parameters, in the order of the constructor."""
        return tuple(each.name for each in fields(cls))  # type: ignore[arg-type]

    def same_as(self) -> Iterator[tuple[Lens, float]]:
        """The same lens under names that this class itself knows; `same_lenses` knows all.

        Yields:
            other: A lens of another class with the same image, up to its scale.
            factor: From this lens's focal lengths to the other's.
        """
        if self.plain is not None and self == type(self)():
            yield self.plain(), 1.0

    @property
    def is_distorted(self) -> bool:
        """False for a perspective lens, also where it is written as another kind with all its coefficients at rest."""
        return True

    # Where it ends

    @property
    def can_fold(self) -> bool:
        """True where the lens has a polynomial, or another equation, that could turn back."""
        return False

    @property
    def fold(self) -> Fold | None:
        """Where the lens folds; None where it never does, or has a pole before."""
        return None

    @property
    def denominator(self) -> Polynomial:
        """D(s), s = r², at whose roots the lens has its poles; 1 for a lens without a denominator."""
        return NO_DENOMINATOR

    # Its derivatives. A lens with a closed form overrides the central differences here.

    def project_unchecked(self, rays: Vectors) -> ImagePoints:
        """As `project`, also beyond a fold if the equation goes on there: quicker to ask."""
        return self.project(rays)

    def jacobian(self, xy: ImagePointsLike) -> Jacobians:
        """The derivative of the map from the plane z = 1 to the image, good to 1e-9."""
        xy = as_points(xy, 2, "xy")
        step = 6e-6 * (1 + np.linalg.norm(xy, axis=-1))[..., None, None] * np.eye(2)
        ahead, behind = (self.project(on_plane(xy[..., None, :] + sign * step)) for sign in (1, -1))
        return np.swapaxes((ahead - behind) / (2 * step.max(axis=-1, keepdims=True)), -1, -2)

    def ray_jacobian(self, rays: Rays) -> Array:
        """The derivative ∂xy/∂ray.

        Returns: (..., 2, 3), in focal lengths.
        """
        moved = STEP * np.eye(3)
        columns = [(self.project_unchecked(rays + to) - self.project_unchecked(rays - to)) / (2 * STEP) for to in moved]
        return np.stack(columns, axis=-1)

    def parameter_jacobian(self, name: str, rays: Rays) -> Array:
        """The derivative ∂xy/∂name; from one side at the end of what the parameter may be.

        Args:
            name: One of `parameters()`.

        Returns: (..., 2), in focal lengths per unit of the parameter.
        """
        value = getattr(self, name)
        step = STEP * max(1.0, abs(value))
        lower, higher = self._with(name, value - step), self._with(name, value + step)
        width = getattr(higher, name) - getattr(lower, name)
        return (higher.project_unchecked(rays) - lower.project_unchecked(rays)) / width

    def _with(self, name: str, value: float) -> Lens:
        """The lens with another value of a parameter; as it was where it does not take that value."""
        lens: Any = self
        try:
            return replace(lens, **{name: value})
        except ValueError:
            return self


# What lenses are written with


def up_to(limit: float, values: Array) -> Array:
    """`values` as far as `limit`, at which they may arrive rounded; NaN beyond it."""
    return np.where(values <= limit * (1 + ROUNDING), np.minimum(values, limit), np.nan)


def check_parameters(lens: Lens, limit: float = 1e15) -> None:
    """Raises ValueError naming the first parameter of a lens that is not a number of sensible size."""
    for name in lens.parameters():
        value = getattr(lens, name)
        if not (isfinite(value) and abs(value) <= limit):
            raise ValueError(f"{name} must be a finite number, at most {limit:g} in size, got {value}")


def check_range(name: str, value: float, inside: bool, takes: str) -> None:
    """Raises ValueError saying what the parameter `name` takes, unless its value is `inside`."""
    if not inside:
        raise ValueError(f"{name} must be {takes}, got {value}")
