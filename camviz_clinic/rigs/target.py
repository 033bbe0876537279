"""Boards that keep their places to each other, as one target, and the adjustment that finds these places."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Self

import numpy as np
from numpy.typing import NDArray

from camviz.lenses.base import Array
from camviz.poses import RigidTransform
from camviz_clinic.calibration.adjustment import Adjustment, twisted
from camviz_clinic.calibration.jacobian import twist_jacobian
from camviz_clinic.calibration.problem import POSE
from camviz_clinic.calibration.types import Board
from camviz_clinic.rigs.adjustment import RigAdjustment, Seen

Indices = NDArray[np.intp]


@dataclass(frozen=True)
class Target(Board):
    """Several boards as one, such as the two sides of a plate or the markers on a wall: its points are all of theirs.

    Args:
        names: Of the boards.
        parts: The boards.
        places: target_from_board of each, in metres.

    >>> from camviz_clinic.calibration import Board
    >>> sides = Target.of(("front", "back"), (Board(9, 6, 0.03), Board(5, 4, 0.04)), RigidTransform.identity(2))
    >>> sides.corners.shape, sides.rows_of(1)
    ((74, 3), slice(54, 74, None))
    """

    names: tuple[str, ...] = ()
    parts: tuple[Board, ...] = ()
    places: RigidTransform = field(default_factory=RigidTransform.identity, compare=False)

    def __post_init__(self) -> None:
        """Each board has been checked by itself."""

    @classmethod
    def of(cls, names: Sequence[str], parts: Sequence[Board], places: RigidTransform) -> Self:
        """The target of these boards, the longest of which gives its size.

        Args:
            names: Of the boards.
            parts: The boards.
            places: target_from_board of each.

        Returns: Target.
        """
        count = sum(len(part.corners) for part in parts)
        size = max(part.square_size for part in parts)
        return cls(count, 1, size, names=tuple(names), parts=tuple(parts), places=places)

    @cached_property
    def _points(self) -> Array:
        """The points (points, 3) of all boards in the target's frame, in metres."""
        return np.concatenate([self.places[i].apply(part.corners) for i, part in enumerate(self.parts)])

    @property
    def length(self) -> float:
        """The longest side of its boards."""
        return max(part.length for part in self.parts)

    def rows_of(self, part: int) -> slice:
        """Where among the points those of a board are.

        Args:
            part: The board's number.

        Returns: slice.
        """
        counts = [len(each.corners) for each in self.parts[: part + 1]]
        return slice(sum(counts[:-1]), sum(counts))


@dataclass(frozen=True, eq=False)
class TargetAdjustment(RigAdjustment):
    """`RigAdjustment` of a target, in which boards move within it as well: six parameters for each that is `free`.

    A board's place moves by a twist in the target's frame. Boards that are `sized` have their size as a parameter too,
    the logarithm of how many times larger they are than they are said to be.
    """

    board: Target
    free: tuple[int, ...] = ()
    sized: tuple[int, ...] = ()

    @cached_property
    def parameters(self) -> tuple[str, ...]:
        """Those of the rig, and of the boards: "back.rotation_x" …, "back.size"."""
        places = [f"{self.board.names[part]}.{coordinate}" for part in self.free for coordinate in POSE]
        return (*super().parameters, *places, *(f"{self.board.names[part]}.size" for part in self.sized))

    def place_of_part(self, part: int) -> slice | None:
        """Where among `parameters` the twist of a board is; None for one that is not free."""
        if part not in self.free:
            return None
        start = len(self.parameters) - len(self.sized) - len(POSE) * (len(self.free) - self.free.index(part))
        return slice(start, start + len(POSE))

    def place_of_size(self, part: int) -> slice | None:
        """Where among `parameters` the size of a board is; None for one that is not sized."""
        if part not in self.sized:
            return None
        start = len(self.parameters) - len(self.sized) + self.sized.index(part)
        return slice(start, start + 1)

    @property
    def fewest(self) -> int:
        """Corners that a view of the smallest board has."""
        return min(super().fewest, *(len(part.corners) for part in self.board.parts))

    @property
    def boards(self) -> tuple[slice, ...]:
        """Where the corners of each board are."""
        return tuple(self.board.rows_of(part) for part in range(len(self.board.parts)))

    def jacobian(self, name: str) -> tuple[Array, Array]:
        """As `Linearisation.jacobian`, also by where the boards are and by their sizes."""
        by_shared, by_pose = super().jacobian(name)
        part, views = self.parts[name], np.any(self.used[name][self.posed], axis=1)
        extra = part.own >= len(self.parameters) - len(self.sized) - len(POSE) * len(self.free)
        changed = by_shared[views]
        changed[..., part.own[extra]] = part.by_own[..., extra].reshape(*changed.shape[:-1], int(extra.sum()))
        by_shared[views] = changed
        return by_shared, by_pose

    def _part(self, name: str) -> Seen:
        seen, used = super()._part(name), self.used[name]
        views = np.flatnonzero(used.any(axis=1))
        # The twist of a view moves a point by its last three columns as it is: by what a pixel moves with the point.
        by_first = seen.by_pose.reshape(len(views), used.shape[1], 2, len(POSE))[..., 3:]
        by_target = by_first @ self.first_from_board[views].rotation.as_matrix()[:, None]
        own, columns = [*seen.own], [seen.by_own]
        for part in range(len(self.board.parts)):
            rows = self.board.rows_of(part)
            points = self.corners[rows]
            grown = (points - self.board.places[part].translation)[..., None]
            for place, change in (
                (self.place_of_part(part), twist_jacobian(points)),
                (self.place_of_size(part), grown),
            ):
                if place and used[:, rows].any():
                    column = np.zeros((*by_target.shape[:-1], change.shape[-1]))
                    column[:, rows] = by_target[:, rows] @ change
                    own += range(len(self.parameters))[place]
                    columns.append(column.reshape(*seen.residuals.shape, -1))
        return replace(seen, own=np.array(own, dtype=int), by_own=np.concatenate(columns, axis=-1))

    def _moved(self, shared: Array, twists: Array) -> Adjustment | None:
        there = super()._moved(shared, twists)
        if there is None:
            return None
        steps, parts = np.zeros((len(self.board.parts), len(POSE))), list(self.board.parts)
        for part in self.free:
            steps[part] = shared[self.place_of_part(part)]
        for part in self.sized:
            parts[part] = scaled(parts[part], float(np.exp(shared[self.place_of_size(part)][0])))
        board = replace(self.board, parts=tuple(parts), places=twisted(self.board.places, steps))
        there = replace(there, board=board)
        kept = all(there.used[name][mask].all() for name, mask in self.used.items())
        return there if kept else None


def scaled(board: Board, factor: float) -> Board:
    """The board in another size.

    Args:
        board: Any.
        factor: How many times larger.

    Returns: Board of the same kind.

    >>> scaled(Board(9, 6, 0.025), 2.0).square_size
    0.05
    """
    marker = None if board.marker_size is None else board.marker_size * factor
    return replace(board, square_size=board.square_size * factor, marker_size=marker)
