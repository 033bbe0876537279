"""Rays by the hundred thousand: kept in short runs of neighbours, so that whole runs can be ruled out at once."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import RigidTransform

from camviz.lenses.base import Array

Floats = NDArray[np.float32]
RUN = 32
Ball = tuple[Array, float, Array]  # centre, radius, normal
_ROUNDING = np.float32(1e-5)


@dataclass(frozen=True)
class Bounds:
    """Balls around surfaces, `centre` (n, 3) and `radius` (n,), and a unit `normal` (n, 3): 0 where it is not flat.

    Each surface has those from its `first` (surfaces,) on.
    """

    centre: Floats
    radius: Floats
    normal: Floats
    first: NDArray[np.intp]

    @classmethod
    def around(cls, surfaces: Sequence[Sequence[Ball]]) -> Bounds:
        """From the balls of each surface."""
        rows = [[*centre, radius, *normal] for balls in surfaces for centre, radius, normal in balls]
        table = np.array(rows, dtype=np.float32).reshape(-1, 7)
        counts = np.array([len(balls) for balls in surfaces], dtype=np.intp)
        return cls(table[:, :3], table[:, 3], table[:, 4:], np.cumsum(counts) - counts)


@dataclass(frozen=True)
class Runs:
    """Rays in runs of RUN neighbours, each run inside a cone.

    `directions` (3, runs, RUN) are unit vectors, zero where there is no ray; `origins` are (3, 1, 1) or
    (3, runs, RUN). The cones: unit `axis` (3, runs), cosine and sine of the half angle (runs,), all origins of a
    run within `slack` metres of `centre` (3, runs) or (3, 1).
    """

    origins: Array
    directions: Floats
    axis: Floats
    cosine: Floats
    sine: Floats
    centre: Array
    slack: Array

    @classmethod
    def gather(cls, origins: Array, directions: Array) -> Runs:
        """Runs of rays (n, 3) from origins (1, 3) or (n, 3); a NaN direction is no ray."""
        directions_in_runs = _in_runs(directions)
        np.nan_to_num(directions_in_runs, copy=False, nan=0.0)
        origins_in_runs = np.asarray(_in_runs(origins) if len(origins) > 1 else origins.T[..., None], dtype=float)
        axis = directions_in_runs.sum(axis=2)
        axis /= np.maximum(np.sqrt((axis * axis).sum(axis=0)), np.float32(1e-6))
        along = (axis[..., None] * directions_in_runs).sum(axis=0)
        cosine = np.minimum(along.min(axis=1), np.float32(1))
        sine = np.sqrt(1 - cosine * cosine)
        cosine[~directions_in_runs.any(axis=(0, 2))] = np.inf  # no ray at all, which nothing needs to meet
        centre = origins_in_runs.mean(axis=2)
        slack = np.sqrt(((origins_in_runs - centre[..., None]) ** 2).sum(axis=0).max(axis=1))
        return cls(
            origins_in_runs, directions_in_runs, axis, cosine, sine, centre.astype(np.float32), slack.astype(np.float32)
        )

    @property
    def count(self) -> int:
        """How many rays there are, those included that only fill up the last run."""
        return self.directions[0].size

    def moved(self, world_from_cam: RigidTransform) -> Runs:
        """The same rays of a camera whose centre was the origin, where the camera stands now."""
        turn = world_from_cam.as_matrix()[:3, :3].astype(np.float32)
        centre = np.asarray(world_from_cam.translation, dtype=float)[:, None]
        directions = (turn @ self.directions.reshape(3, -1)).reshape(self.directions.shape)
        return replace(
            self,
            origins=centre[..., None],
            directions=directions,
            axis=turn @ self.axis,
            centre=centre.astype(np.float32),
        )

    def pick(self, runs: NDArray[np.intp]) -> tuple[Array, Floats]:
        """Origins (3, 1, 1) or (3, p, RUN) and directions (3, p, RUN) of p runs."""
        origins = self.origins.take(runs, axis=1) if self.origins.shape[1] > 1 else self.origins
        return origins, self.directions.take(runs, axis=1)

    def may_meet(self, bounds: Bounds) -> NDArray[np.bool_]:
        """False (surfaces, runs) where no ray of the run can meet the surface.

        A ray whose origin moves by the slack passes a ball by at most that much less; so the ball grows by it, and a
        cone of half angle α meets a ball of angular radius β only if their axes are no more than α + β apart. It meets
        a plane only if some ray of the cone comes nearer to it.
        """
        x, y, z = (bounds.centre[:, i, None] - self.centre[i] for i in range(3))
        distance = np.sqrt(x * x + y * y + z * z)
        grown = bounds.radius[:, None] + self.slack
        sine = np.minimum(grown / distance, 1)
        along = x * self.axis[0] + y * self.axis[1] + z * self.axis[2]
        limit = self.cosine * np.sqrt(1 - sine * sine) - self.sine * sine - _ROUNDING
        ball = (distance <= grown) | (along >= limit * distance)
        height = bounds.normal[:, :1] * -x + bounds.normal[:, 1:2] * -y + bounds.normal[:, 2:] * -z
        towards = -np.sign(height) * (bounds.normal @ self.axis)
        plane = (np.abs(height) <= self.slack) | (towards >= -self.sine - _ROUNDING)
        return (self.cosine <= 0) | np.logical_or.reduceat(ball & plane, bounds.first, axis=0)


def _in_runs(vectors: Array) -> Floats:
    """(n, 3) as float32 (3, runs, RUN), filled up with NaN-free copies of the last one."""
    runs = -(-len(vectors) // RUN)
    out = np.empty((3, runs * RUN), dtype=np.float32)
    out[:, : len(vectors)] = vectors.T
    out[:, len(vectors) :] = vectors[-1:].T
    return out.reshape(3, runs, RUN)
