"""Lines in space, for drawings of the same world that the tracer photographs."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from camviz.lenses.base import Array, as_points


@dataclass(frozen=True, eq=False)
class Wireframe:
    """Lines in space, for drawings of the world that the tracer photographs.

    Args:
        lines: tuple of (n, 3), polylines in metres.
        names: What each line belongs to: "ground", "house", ...

    Raises: ValueError when there are not as many names as lines, or a line is not (n, 3).

    Two drawings added:

    >>> beam = Wireframe((np.array([[0, 0, 1], [1, 0, 1]]),), ("beam",))
    >>> mast = Wireframe((np.array([[0, 0, 1], [0, -1, 1]]),), ("mast",))
    >>> [name for name, line in beam + mast]
    ['beam', 'mast']
    """

    lines: tuple[Array, ...]
    names: tuple[str, ...]

    def __post_init__(self) -> None:
        if len(self.lines) != len(self.names):
            raise ValueError(f"names must be one for each of {len(self.lines)} lines, got {len(self.names)}")
        lines = tuple(as_points(line, 3, "lines") for line in self.lines)
        for line in lines:
            if line.ndim != 2:
                raise ValueError(f"each of lines must have shape (n, 3), got {line.shape}")
        object.__setattr__(self, "lines", lines)

    def __iter__(self) -> Iterator[tuple[str, Array]]:
        return iter(zip(self.names, self.lines, strict=True))

    def __add__(self, other: Wireframe) -> Wireframe:
        return Wireframe(self.lines + other.lines, self.names + other.names)

    def only(self, *names: str) -> Wireframe:
        """The lines with some names.

        Args:
            *names: Those that are kept.

        Returns: The others are left out.
        """
        kept = [(name, line) for name, line in self if name in names]
        return Wireframe(tuple(line for _, line in kept), tuple(name for name, _ in kept))

    def subdivided(self, max_length: float) -> Wireframe:
        """The same lines with more points, so that a lens can bend them; all corners are kept.

        Args:
            max_length: Points are no more than so many metres apart.

        Raises: ValueError unless `max_length` is positive.
        """
        if not max_length > 0:
            raise ValueError(f"max_length must be a positive length in metres, got {max_length}")
        return Wireframe(tuple(_subdivided(line, max_length) for line in self.lines), self.names)


def _subdivided(line: Array, max_length: float) -> Array:
    if len(line) < 2:
        return line
    lengths = np.linalg.norm(np.diff(line, axis=0), axis=1)
    pieces = np.maximum(np.ceil(lengths / max_length - 1e-9), 1).astype(int)
    knots = np.concatenate([[0], np.cumsum(pieces)])
    fine = np.arange(knots[-1] + 1)
    return np.stack([np.interp(fine, knots, coordinate) for coordinate in line.T], axis=-1)
