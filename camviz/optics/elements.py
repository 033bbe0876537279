"""Lenses of real elements, traced with 2 × 2 matrices near the axis.

A ray is (height y in mm, slope); every element is a matrix [[A, B], [C, D]], and a whole lens is the product
of them, the first one on the right (Hecht, "Optics", 5th ed. 2017, section 6.2.1; Gerrard & Burch 1975).
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import ArrayLike

from camviz.lenses.base import Array


def free_space(distance_mm: float) -> Array:
    """[[1, d], [0, 1]]: a ray gains height by its slope."""
    return np.array([[1.0, distance_mm], [0.0, 1.0]])


def ideal_lens(focal_mm: float) -> Array:
    """[[1, 0], [-1/f, 1]]: a ray loses slope in proportion to its height."""
    return np.array([[1.0, 0.0], [-1 / focal_mm, 1.0]])


def refraction(radius_mm: float, before: float, after: float) -> Array:
    """Snell's law for small angles at a sphere of radius R, positive where its centre lies behind it."""
    return np.array([[1.0, 0.0], [(before - after) / (radius_mm * after), before / after]])


@dataclass(frozen=True)
class Prescription:
    """A lens as its designer writes it: one row of `surfaces` for each surface, in the light's order.

    A row is (radius of curvature, distance to the next surface, refractive index behind it), in mm; a radius of
    infinity is flat, index 1 is air, and the distance behind the last surface is not used. Raises ValueError for
    other rows.
    """

    name: str
    surfaces: tuple[tuple[float, float, float], ...]

    def __post_init__(self) -> None:
        table = np.array(self.surfaces, dtype=float)
        if table.ndim != 2 or table.shape[1] != 3:
            raise ValueError(f"surfaces must be rows of radius, distance and index, got shape {table.shape}")
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

    def trace(self, height_mm: ArrayLike, slope: ArrayLike, reach_mm: float = 0.0) -> tuple[Array, Array]:
        """Rays through the lens: places z (n,) along the axis, and heights (n, ...) there, from `reach_mm` before the
        first surface, where they are given, to the back focal point."""
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
field", designed for 550 nm)."""

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
and so focal lengths to one per cent."""
