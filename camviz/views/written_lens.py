"""A lens whose equation a reader wrote: the tracer photographs the garden through it as through any other."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from camviz.lenses.arrays import ImagePointsLike, Rays
from camviz.lenses.base import Array, Lens, as_points, on_plane, unit

_ROUNDS = 10
_LONGEST = 0.5  # focal lengths, of one of Newton's steps
_STEP = 1e-5  # focal lengths, over which the function's slopes are taken
_NEAR = 1e-4  # focal lengths: less than a tenth of a pixel of any picture here


@dataclass(frozen=True, eq=False)
class WrittenLens(Lens):
    """The lens that bends ideal points as `bend` does: (..., 2) to (..., 2), in focal lengths, NaN without an answer.

    `like` is the lens that the reader was to describe: from its answers the search for the inverse begins.
    """

    bend: Callable[[Array], Array]
    like: Lens

    def unproject(self, xy: ImagePointsLike) -> Rays:
        """The rays of image points, all in one call of the function: it may have been written for all at once."""
        return unit(on_plane(self.straightened(as_points(xy, 2, "xy"))))

    def straightened(self, xy: Array) -> Array:
        """The ideal points (..., 2) of distorted ones; NaN where the function has none before a fold."""
        rays = self.like.unproject(xy)
        return straightened(self.bend, xy, rays[..., :2] / rays[..., 2:])

    def image(self, x: Array, y: Array, z: Array) -> tuple[Array, Array]:
        """Where the function puts the directions' points of the plane z = 1."""
        ahead = np.where(z > 0, z, np.nan)
        bent = self.bend(np.stack([x / ahead, y / ahead], axis=-1))
        return bent[..., 0], bent[..., 1]

    def ray(self, x: Array, y: Array) -> tuple[Array, Array, Array]:
        """The function read backwards."""
        ideal = self.straightened(np.stack([x, y], axis=-1))
        return ideal[..., 0], ideal[..., 1], np.ones_like(x)


def straightened(bend: Callable[[Array], Array], xy: Array, guess: Array | None = None) -> Array:
    """The ideal points (..., 2) that `bend` takes to `xy`, by Newton's method from a `guess`; NaN where it finds none.

    A point counts where the function leads back to `xy` and, as before any fold, does not mirror its surroundings.
    """
    wanted = xy.reshape(-1, 2)
    ideal = np.array(wanted if guess is None else np.where(np.isfinite(guess), guess, xy).reshape(-1, 2))
    found, left = np.full_like(ideal, np.nan), np.arange(len(ideal))
    with np.errstate(all="ignore"):
        for _ in range(_ROUNDS):
            missed, (a, b, c, d) = _missed_and_slopes(bend, ideal[left], wanted[left])
            arrived = np.abs(missed).max(axis=-1) < _NEAR
            before_a_fold = arrived & (a * d - b * c > 0)
            found[left[before_a_fold]] = ideal[left[before_a_fold]]
            turned = np.stack([d * missed[:, 0] - b * missed[:, 1], a * missed[:, 1] - c * missed[:, 0]], axis=-1)
            step = turned / (a * d - b * c)[:, None]
            ideal[left] -= np.clip(step, -_LONGEST, _LONGEST)
            left = left[~arrived & np.isfinite(step).all(axis=-1)]
            if not left.size:
                break
    return found.reshape(xy.shape)


def _missed_and_slopes(
    bend: Callable[[Array], Array], xy: Array, wanted: Array
) -> tuple[Array, tuple[Array, Array, Array, Array]]:
    """How far (n, 2) the function of points (n, 2) is from where it should be; ∂x_d/∂x, ∂x_d/∂y, ∂y_d/∂x, ∂y_d/∂y."""
    bent, *beside = (bend((xy + step)[:, None])[:, 0] for step in (0, *(_STEP * np.eye(2))))  # a column of points
    along, down = ((one - bent) / _STEP for one in beside)
    return bent - wanted, (along[:, 0], down[:, 0], along[:, 1], down[:, 1])
