"""Lenses of real elements, traced with 2 × 2 matrices near the axis.

A ray is (height y in mm, slope); every element is a matrix [[A, B], [C, D]], and a whole lens is the product
of them, the first one on the right (Hecht, "Optics", 5th ed. 2017, section 6.2.1; Gerrard & Burch 1975).
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from camviz.lenses.arrays import MillimetresLike, RatiosLike, RayMatrix
from camviz.lenses.base import Array


def free_space(distance_mm: float) -> RayMatrix:
    """The matrix of a way through one medium, [[1, d], [0, 1]]: a ray gains height by its slope.

    Args:
        distance_mm: Along the axis.

    Source: E. Hecht, Optics (5th ed. 2017), section 6.2.1.

    >>> free_space(10) @ [1, 0.1]  # 1 mm high, rising by 1 in 10
    array([2. , 0.1])
    """
    return np.array([[1.0, distance_mm], [0.0, 1.0]])


def ideal_lens(focal_mm: float) -> RayMatrix:
    """The matrix of a thin lens, [[1, 0], [-1/f, 1]]: a ray loses slope in proportion to its height.

    Args:
        focal_mm: The focal length, negative for a lens that spreads light.

    Raises: ValueError for a focal length of 0.
    Source: E. Hecht, Optics (5th ed. 2017), section 6.2.1.

    Parallel light meets the axis one focal length behind the lens:

    >>> (free_space(50) @ ideal_lens(50) @ [10, 0]).round(9) + 0
    array([ 0. , -0.2])
    """
    if focal_mm == 0:
        raise ValueError("focal_mm must be a focal length other than 0")
    return np.array([[1.0, 0.0], [-1 / focal_mm, 1.0]])


def refraction(radius_mm: float, before: float, after: float) -> RayMatrix:
    """The matrix of a spherical surface: Snell's law for small angles.

    Args:
        radius_mm: Of the sphere, positive where its centre lies behind the surface, infinite for a flat one.
        before, after: The refractive indices on its two sides.

    Raises: ValueError for a radius of 0.
    Source: E. Hecht, Optics (5th ed. 2017), section 6.2.1.

    Behind a surface of 50 mm, in glass, parallel light meets after n R / (n - 1) = 150 mm:

    >>> (free_space(150) @ refraction(50, before=1.0, after=1.5) @ [3, 0]).round(9) + 0
    array([ 0.  , -0.02])
    """
    if radius_mm == 0:
        raise ValueError("radius_mm must be a radius other than 0, infinite for a flat surface")
    return np.array([[1.0, 0.0], [(before - after) / (radius_mm * after), before / after]])


@dataclass(frozen=True)
class Prescription:
    """A lens as its designer writes it, surface by surface, traced with 2 × 2 matrices near the axis.

    Args:
        name: For readers.
        surfaces: A row for each surface, in the light's order: radius of curvature in mm, distance to the next surface
            in mm, and refractive index behind it. An infinite radius is flat, index 1 is air; the last distance is not
            used.

    Raises: ValueError for other rows, a radius of 0, and an index below 1.
    Source: E. Hecht, Optics (5th ed. 2017), section 6.2.1.

    A flat side and one of 50 mm radius, in glass of index 1.5, have f = R / (n - 1) = 100 mm:

    >>> lens = Prescription("plano-convex", ((50, 5, 1.5), (np.inf, 0, 1.0)))
    >>> round(lens.focal_mm, 6), round(lens.back_focal_mm, 3)  # f less 5 mm / n
    (100.0, 96.667)
    """

    name: str
    surfaces: tuple[tuple[float, float, float], ...]

    def __post_init__(self) -> None:
        if not self.surfaces or any(len(row) != 3 for row in self.surfaces):
            raise ValueError(f"surfaces must be rows of radius, distance and index, got {self.surfaces}")
        table = np.array(self.surfaces, dtype=float)
        if (table[:, 0] == 0).any() or not (table[:, 2] >= 1).all():
            raise ValueError(f"surfaces must have radii other than 0 and indices of at least 1, got {self.surfaces}")

    @cached_property
    def matrix(self) -> Array:
        """[[A, B], [C, D]] from the first surface to the last."""
        total, before = np.eye(2), 1.0
        for i, (radius, distance, after) in enumerate(self.surfaces):
            total = refraction(radius, before, after) @ total
            if i < len(self.surfaces) - 1:
                total = free_space(distance) @ total
            before = after
        return total

    @property
    def focal_mm(self) -> float:
        """Effective focal length -1/C: that of the thin lens with the same effect far away."""
        return float(-1 / self.matrix[1, 0])

    @property
    def back_focal_mm(self) -> float:
        """Back focal distance -A/C, from the last surface to where parallel light meets."""
        return float(-self.matrix[0, 0] / self.matrix[1, 0])

    @property
    def length_mm(self) -> float:
        """From the first surface to the last."""
        return float(sum(distance for _, distance, _ in self.surfaces[:-1]))

    @property
    def front_principal_mm(self) -> float:
        """The first principal plane, (D - 1)/C behind the first surface: object distances count from it."""
        return float((self.matrix[1, 1] - 1) / self.matrix[1, 0])

    @property
    def rear_principal_mm(self) -> float:
        """The second principal plane, behind the *first* surface: image distances count from it."""
        return self.length_mm + self.back_focal_mm - self.focal_mm

    def trace(self, height_mm: MillimetresLike, slope: RatiosLike, reach_mm: float = 0.0) -> tuple[Array, Array]:
        """Rays through the lens, to the back focal point.

        Args:
            reach_mm: Where they start: so far before the first surface.

        Returns:
            z: (n,), places along the axis in mm, 0 at the first surface.
            heights: (n, ...), the rays' heights there in mm.
        """
        rays = np.stack(np.broadcast_arrays(np.asarray(height_mm, float), np.asarray(slope, float)))
        flat, z, before = rays.reshape(2, -1), [-reach_mm, 0.0], 1.0
        heights = [flat[0]]
        flat = free_space(reach_mm) @ flat
        heights.append(flat[0])
        steps = [distance for _, distance, _ in self.surfaces[:-1]] + [self.back_focal_mm]
        for (radius, _, after), step in zip(self.surfaces, steps, strict=True):
            flat = free_space(step) @ refraction(radius, before, after) @ flat
            z.append(z[-1] + step)
            heights.append(flat[0])
            before = after
        return np.array(z), np.array(heights).reshape(-1, *rays.shape[1:])


COOKE_TRIPLET = Prescription(
    "Cooke triplet, 50 mm f/5",
    (
        (22.01359, 3.25896, 1.622608),  # SK16; Schott's dispersion formula at 550 nm
        (-435.76044, 6.00755, 1.0),
        (-22.21328, 0.99997, 1.623655),  # F2
        (20.29192, 4.75041, 1.0),  # the stop
        (79.68360, 2.95208, 1.622608),
        (-18.39533, 0.0, 1.0),
    ),
)
"""The triplet form of H. D. Taylor (1893) as the 50 mm sample lens that optical design programs ship ("Cooke 40 degree
field", designed for 550 nm).

>>> round(COOKE_TRIPLET.focal_mm, 2), len(COOKE_TRIPLET.surfaces)
(50.0, 6)
"""

TELEPHOTO = Prescription(
    "Telephoto lens, 600 mm f/5.6",
    (
        (218.2, 13.5, 1.500),
        (-545.6, 0.3, 1.0),
        (189.3, 14.52, 1.500),
        (-337.0, 3.0, 1.750),
        (766.9, 105.11, 1.0),
        (-264.6, 6.0, 1.699),
        (-80.07, 1.998, 1.643),
        (226.6, 4.998, 1.0),
        (2142.0, 1.998, 1.697),
        (145.9, 16.662, 1.0),
        (-366.3, 4.998, 1.500),
        (-98.4, 0.0, 1.0),
    ),
)
"""United States patent 4,113,357, example 1 (Nikon, 600 mm f/5.6, internal focusing); its indices to three decimals,
and so focal lengths to one per cent. It is shorter than its focal length:

>>> round(TELEPHOTO.focal_mm), round(TELEPHOTO.length_mm + TELEPHOTO.back_focal_mm)
(605, 444)
"""
