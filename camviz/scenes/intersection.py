"""Where rays meet planes, circles and spheres."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from camviz.scenes.rays import Floats

FAR, HALF = np.float32(np.inf), np.float32(0.5)


class Hit(NamedTuple):
    """Where n rays meet a surface: the distance (n,) along each, inf on a miss, and `place` (3, n) in its own frame."""

    depth: Floats
    place: Floats


def intersect_plane(start: Floats, step: Floats) -> Hit:
    """Where rays from `start` along `step`, (3, ...) in the frame of a plane, meet that plane, z = 0: at t = -z₀ / ż.

    The frame's third axis is a unit normal. The third row of `place` is not z, which is 0, but the cosine of the angle
    between ray and normal. `step` is used up.
    """
    depth = -start[2] / step[2]
    step[:2] *= depth
    step[:2] += start[:2]
    np.abs(step[2], out=step[2])
    return Hit(depth, step)


def intersect_square(start: Floats, step: Floats) -> Hit:
    """As `intersect_plane` does, where 0 ≤ x, y ≤ 1."""
    at = intersect_plane(start, step)
    inside = (np.abs(at.place[0] - HALF) <= HALF) & (np.abs(at.place[1] - HALF) <= HALF) & (at.depth > 0)
    return at._replace(depth=np.where(inside, at.depth, FAR))


def intersect_circle(start: Floats, step: Floats) -> tuple[Floats, Floats]:
    """Both distances (n,) to the unit circle or sphere about 0, near one first; NaN where a ray passes it by.

    From the point m of the ray that is nearest to the centre it is sqrt(1 - m²) either way; taking m first keeps the
    digits that the textbook's b² - 4ac would lose.
    """
    squared = (step * step).sum(axis=0)
    middle = -(start * step).sum(axis=0) / squared
    nearest = start + middle * step
    half = np.sqrt((1 - (nearest * nearest).sum(axis=0)) / squared)
    return middle - half, middle + half


def texels(depth: Floats, cosine: Floats, density: ArrayLike) -> Floats:
    """Texels between neighbouring rays; a slanted look stretches them by 1 / cos, of which the square root is taken as
    a compromise between too sharp along the slope and too soft across it."""
    return np.multiply(depth / np.sqrt(cosine), density, dtype=np.float32)
