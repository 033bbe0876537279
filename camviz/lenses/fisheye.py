"""The classical fisheyes: lenses that see only the angle θ between a ray and the axis."""

from abc import abstractmethod
from dataclasses import dataclass
from math import pi, tan

import numpy as np
from numpy.typing import ArrayLike

from camviz.lenses.base import Array, Lens, check_parameters, check_range, up_to


class Fisheye(Lens):
    """A lens symmetric about its axis: a ray at θ = atan2(√(X² + Y²), Z) arrives `radial(θ)` from the image's centre.

    Rays beyond `max_angle` have no image; nor has the ray straight backwards, whose image would be a whole circle.
    """

    @property
    def max_angle(self) -> float:
        """The last angle in radians that has an image."""
        return pi

    @abstractmethod
    def radial(self, theta: ArrayLike) -> Array:
        """The distance from the image's centre, in focal lengths, of rays at `theta` radians from the axis."""

    @abstractmethod
    def angle(self, radius: Array) -> Array:
        """The inverse of `radial`, in radians; NaN where no ray arrives."""

    def image(self, x: Array, y: Array, z: Array) -> tuple[Array, Array]:
        off_axis = np.hypot(x, y)
        theta = np.arctan2(off_axis, z)
        scale = np.where(theta <= self.max_angle, self.radial(theta), np.nan) / off_axis
        on_axis = off_axis == 0
        scale[on_axis] = np.where(z[on_axis] > 0, 1, np.nan)
        return x * scale, y * scale

    def ray(self, x: Array, y: Array) -> tuple[Array, Array, Array]:
        radius = np.hypot(x, y)
        theta = self.angle(up_to(float(self.radial(self.max_angle)), radius))
        scale = np.sin(theta) / radius
        scale[radius == 0] = 1
        return x * scale, y * scale, np.cos(theta)


@dataclass(frozen=True)
class Equidistant(Fisheye):
    """r = θ: equal angles, equal distances.

    Source: J. Kannala & S. S. Brandt, IEEE PAMI 28 (2006), section 2.

    >>> Equidistant().radial(np.radians([30, 90, 180])).round(4)  # as many radians
    array([0.5236, 1.5708, 3.1416])
    """

    def radial(self, theta: ArrayLike) -> Array:
        return np.asarray(theta, dtype=float)

    def angle(self, radius: Array) -> Array:
        return radius


@dataclass(frozen=True)
class Equisolid(Fisheye):
    """r = 2 sin(θ/2): equal solid angles, equal areas.

    Source: J. Kannala & S. S. Brandt, IEEE PAMI 28 (2006), section 2.

    >>> round(float(Equisolid().radial(np.pi / 2)), 4)  # half a sphere of 2π sr: a disc of area 2π
    1.4142
    """

    def radial(self, theta: ArrayLike) -> Array:
        return 2 * np.sin(np.asarray(theta, dtype=float) / 2)

    def angle(self, radius: Array) -> Array:
        return 2 * np.arcsin(radius / 2)


@dataclass(frozen=True)
class Orthographic(Fisheye):
    """r = sin θ: the hemisphere seen from far above; nothing beyond 90°.

    Source: J. Kannala & S. S. Brandt, IEEE PAMI 28 (2006), section 2.

    >>> Orthographic().project([[1, 0, 1], [1, 0, -1]]).round(4)  # sin 45°, and a ray backwards
    array([[0.7071, 0.    ],
           [   nan,    nan]])
    """

    @property
    def max_angle(self) -> float:
        return pi / 2

    def radial(self, theta: ArrayLike) -> Array:
        return np.sin(np.asarray(theta, dtype=float))

    def angle(self, radius: Array) -> Array:
        return np.arcsin(radius)


@dataclass(frozen=True)
class Stereographic(Fisheye):
    """r = 2 tan(θ/2): circles on the sphere stay circles.

    Source: J. Kannala & S. S. Brandt, IEEE PAMI 28 (2006), section 2.

    >>> round(float(Stereographic().radial(np.pi / 2)), 4)  # 2 tan 45°
    2.0
    """

    def radial(self, theta: ArrayLike) -> Array:
        return 2 * np.tan(np.asarray(theta, dtype=float) / 2)

    def angle(self, radius: Array) -> Array:
        return 2 * np.arctan(radius / 2)

    # tan(θ/2) = R/(D + Z) = (D - Z)/R with R² = X² + Y², D² = R² + Z²: no digits lost looking backwards.
    def image(self, x: Array, y: Array, z: Array) -> tuple[Array, Array]:
        off_axis = np.hypot(x, y)
        distance = np.hypot(off_axis, z)
        scale = np.where(z > 0, 2 / (distance + z), 2 * (distance - z) / off_axis / off_axis)
        scale[(off_axis == 0) & (z <= 0)] = np.nan
        return x * scale, y * scale

    def ray(self, x: Array, y: Array) -> tuple[Array, Array, Array]:
        return 4 * x, 4 * y, 4 - (x * x + y * y)


@dataclass(frozen=True)
class FieldOfView(Fisheye):
    """r = atan(2 tan θ tan(ω/2)) / ω, continued behind 90° by atan2.

    Args:
        omega: ω, the field of view of an ideal fisheye in radians, between 0 and π.

    Raises: ValueError for an angle outside (0, π).
    Source: F. Devernay & O. Faugeras, *Straight lines have to be straight*, Machine Vision and Applications 13 (2001),
    eq. 13.

    >>> lens = FieldOfView(omega=1.0)
    >>> round(float(lens.radial(np.arctan(1 / (2 * np.tan(0.5))))), 4)  # atan 1 / ω
    0.7854
    """

    omega: float

    def __post_init__(self) -> None:
        check_parameters(self)
        check_range("omega", self.omega, 0 < self.omega < pi, "an angle between 0 and π radians")

    def radial(self, theta: ArrayLike) -> Array:
        return np.arctan2(2 * tan(self.omega / 2) * np.sin(theta), np.cos(theta)) / self.omega

    def angle(self, radius: Array) -> Array:
        bent = radius * self.omega
        return np.arctan2(np.sin(bent), 2 * tan(self.omega / 2) * np.cos(bent))
