"""The view of a chain of frames: where a reader's function puts the board in the camera's picture."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from functools import cached_property
from typing import Any, ClassVar

import numpy as np

from camviz.draw import svg
from camviz.draw.panel import Panel
from camviz.lenses.base import Array, unit
from camviz.scenes import board_corners
from camviz.views.frustum import FrustumView
from camviz.views.yours import is_unwritten, tried


@dataclass(frozen=True)
class ChainView(FrustumView):
    """The garden's board seen by a camera, its corners blue, and orange where a reader's chain puts them.

    `chain` takes (world_from_cam, world_from_board), each (4, 4), to cam_from_board.
    """

    title: ClassVar[str] = "A chain of frames"
    openable: ClassVar[Mapping[str, str]] = {"world": "the camera in its world"}
    panels: str = "picture"
    chain: Callable[..., Any] | None = field(default=None, compare=False, repr=False)

    @classmethod
    def on_the_world(cls, **state: Any) -> ChainView:
        """The camera's frame laid on the world's; `state` are fields of the view."""
        return cls(**{"x": 0.0, "y": 0.0, "z": 0.0, "yaw_deg": 0.0, "pitch_deg": 0.0, **state})

    @property
    def world_from_board(self) -> Array:
        """(4, 4): the origin is the first inner corner, x runs along the rows of corners, y along the columns."""
        grid = board_corners().reshape(6, 9, 3)
        right, down = unit(grid[0, 1] - grid[0, 0]), unit(grid[1, 0] - grid[0, 0])
        return np.vstack([np.column_stack([right, down, np.cross(right, down), grid[0, 0]]), [0, 0, 0, 1]])

    @cached_property
    def your_corners(self) -> tuple[Array, str]:
        """The board's corners (54, 3) in the camera's frame by the reader's chain, or a right one; what is wrong."""
        given = self.camera.world_from_cam.as_matrix(), self.world_from_board
        right = np.linalg.inv(given[0]) @ given[1]
        answer, problem = tried(self.chain, given, right) if self.chain else (right, "")
        on_board = np.column_stack([board_corners(), np.ones(54)]) @ np.linalg.inv(given[1]).T
        return (on_board @ (right if is_unwritten(problem) else answer).T)[:, :3], problem

    def _corners(self, panel: Panel) -> svg.Marks:
        return svg.dots(panel.place(self.camera.project(board_corners())), "blue", 4)

    def _your_corners(self, panel: Panel) -> svg.Marks:
        (corners, problem), k = self.your_corners, self.camera.intrinsics
        if self.chain is None or (problem and not is_unwritten(problem)):
            return svg.paragraph((14, 24), problem, panel.width - 28) if problem else svg.NOTHING
        x, y, z = np.where(corners[:, 2:] > 0, corners, np.nan).T
        uv = (np.stack([x / z, y / z, np.ones(54)], axis=-1) @ k.K.T)[:, :2]
        inside = panel.place(uv[k.contains(uv)])
        crosses = [svg.segments(inside - arm, inside + arm, "orange thick") for arm in ((3.5, 3.5), (3.5, -3.5))]
        words = "orange: by the program" if len(inside) else "by the program: not in the picture"
        return svg.join(crosses if len(inside) else []) + svg.text((14, 24), words, "label halo orange")
