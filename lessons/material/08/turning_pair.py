"""The state of the rectification visualizer: two cameras on their way to common rows, and the disparities there."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import Any, Self

import numpy as np

from camviz import twoview
from camviz.cameras import Camera, Intrinsics
from camviz.lenses.base import Array
from camviz.poses import RigidTransform, Rotation
from camviz.views.base import View, choice, slider, switch
from camviz.views.depth_wedge import metres
from camviz_school.views import stereo_pair
from camviz_school.views.stereo_pair import COARSE, FINE, Source, Stage, seen_from_there

_GARDEN_CAMERA = Camera(Intrinsics.from_fov(480, 360, 62))
_GARDEN = Source(
    _GARDEN_CAMERA.at(RigidTransform.from_components([-0.3, 0, 0.3], Rotation.from_euler("YXZ", [3, -3, -2], True))),
    _GARDEN_CAMERA.at(
        RigidTransform.from_components([-0.3 + 0.25, 0.012, 0.31], Rotation.from_euler("YXZ", [-3, -1, 4], True))
    ),
)


@dataclass(frozen=True)
class TurningPair(View):
    """A pair from as it was taken (`rectify` 0) to rectified (1), its disparities, its depths, and what they are worth.

    (column, row) is a pixel of the *rectified* left picture and `disparity` a shift from there to the right one; both
    marks stay on their rays while the cameras turn. Matching runs along the rows of the pictures as they are at that
    moment. `source` is the garden, or a pair of photographs.
    """

    rectify: float = slider(1.0, 0, 1, 0.01, help="0: the pictures as taken; 1: rectified")
    row: float = slider(168.0, 0, 359, 1, unit="px", help="of the mark in the rectified left picture")
    column: float = slider(294.0, 0, 479, 1, unit="px", help="of the mark in the rectified left picture")
    disparity: float = slider(16.0, 1, 128, 0.25, unit="px", help="from the left mark to the right one")
    plus_minus: float = slider(0.5, 0.05, 2, 0.05, label="± error", unit="px", help="how well a match is found")
    method: str = choice("SGM", "BM", "SGM + WLS", help="how disparities are found along the rows")
    block_size: int = slider(7, 5, 25, 2, unit="px", help="side of the squares that are compared")
    disparities: int = slider(64, 16, 128, 16, label="number of disparities", help="how far along the row to look")
    baseline: float = slider(0.25, 0.05, 0.6, 0.01, unit="m", help="distance between the cameras")
    show: str = choice("depth", "true depth", "error", label="second map", help="what the second map shows")
    worth: bool = switch(True, label="show the error", help="what an error of the disparity makes of the depth")
    source: Source = _GARDEN

    @classmethod
    def of(
        cls,
        left: Camera,
        right: Camera,
        photographs: tuple[np.ndarray, np.ndarray] | None = None,
        depth: np.ndarray | None = None,
        **state: Any,
    ) -> Self:
        """The view of a calibrated pair, in the garden or with what it saw; further fields by name.

        `depth` (height, width) is the true Z in metres of the left photograph's pixels, NaN where unknown. Raises
        ValueError for cameras that cannot be rectified and for photographs of another size than theirs.
        """
        size = (left.intrinsics.height, left.intrinsics.width)
        arrays = {"left photograph": photographs and photographs[0], "right photograph": photographs and photographs[1]}
        for name, array in {**arrays, "depth": depth}.items():
            if array is not None and array.shape[:2] != size:
                raise ValueError(f"{name} must have the left camera's {size} rows and columns, got {array.shape[:2]}")
        if (right.intrinsics.height, right.intrinsics.width) != size:
            raise ValueError("both cameras must have pictures of one size")
        distances = None
        if depth is not None:
            along = left.lens.unproject(left.intrinsics.from_pixels(left.intrinsics.grid()))[..., 2]
            distances = np.asarray(depth / along, np.float32)
        pair = twoview.rectify(left, right)
        middle: dict[str, Any] = {"row": size[0] // 2, "column": size[1] // 2, "baseline": pair.baseline}
        return cls(**{**middle, **state}, source=Source(left, right, photographs, distances))

    @cached_property
    def stage(self) -> Stage:
        """The cameras at this moment."""
        return stereo_pair.stage(self.source, float(self.baseline), float(self.rectify))

    @cached_property
    def uv_left(self) -> Array:
        """The left mark (2,) in the left picture of this moment."""
        pair = self.stage.pair
        return seen_from_there(self.stage.left, pair.left, [self.column, self.row])

    @cached_property
    def uv_right(self) -> Array:
        """The right mark (2,) in the right picture of this moment."""
        pair = self.stage.pair
        return seen_from_there(self.stage.right, pair.right, [self.column - self.disparity, self.row])

    def depth(self) -> float:
        """Z = f B / d of the two marks, in metres."""
        return float(self.stage.pair.depth(self.disparity))

    def depth_interval(self) -> tuple[float, float]:
        """The nearest and farthest depths within the error of the disparity, in metres; the farthest may be inf."""
        pair = self.stage.pair
        near, far = twoview.depth_interval(self.depth(), pair.focal_length, pair.baseline, self.plus_minus)
        return float(near), float(far)

    def rows_apart(self) -> float:
        """By how many pixels rows differ, on average over the picture, between partners at the marks' disparity."""
        pair = self.stage.pair
        size = pair.left.intrinsics
        grid = np.stack(np.meshgrid(np.linspace(0, size.width, 9), np.linspace(0, size.height, 7)), axis=-1)
        left = seen_from_there(self.stage.left, pair.left, grid)
        right = seen_from_there(self.stage.right, pair.right, grid - (self.disparity, 0))
        seen = size.contains(left) & size.contains(right)
        return float(np.abs(left - right)[seen][:, 1].mean()) if seen.any() else float("nan")

    def disparity_map(self, *, draft: bool = False) -> np.ndarray:
        """What the matcher finds (rows, columns), in pixels of the full picture however coarse; NaN = none."""
        return stereo_pair.disparities(*self._matching(draft))

    def true_disparity_map(self, *, draft: bool = False) -> np.ndarray:
        """The truth on the same grid; NaN where it is unknown, and where the right picture does not show the point."""
        return stereo_pair.true_disparities(*self._key(draft))

    def score(self, *, draft: bool = False) -> twoview.MatchingScore:
        """The matcher's disparities against the truth: wrong is off by more than a pixel."""
        return stereo_pair.score(*self._matching(draft))

    def _key(self, draft: bool) -> tuple[Source, float, float, int]:
        """What the pictures depend on."""
        size = self.source.left.intrinsics
        side = min(COARSE if draft else FINE, max(size.width, size.height))
        return self.source, float(self.baseline), float(self.rectify), side

    def _matching(self, draft: bool) -> tuple[Source, float, float, int, str, int, int]:
        """What the disparities depend on."""
        return *self._key(draft), self.method, int(self.block_size), int(self.disparities)

    def _at_mark(self, values: np.ndarray) -> float:
        """The number of a map at the left mark; NaN outside."""
        size = self.stage.left.intrinsics
        if not size.contains(self.uv_left):
            return float("nan")
        height, width = values.shape
        u, v = np.rint((self.uv_left + 0.5) * (width / size.width, height / size.height) - 0.5).astype(int)
        return float(values[min(max(v, 0), height - 1), min(max(u, 0), width - 1)])

    def equation(self) -> str:
        """Z = f B / d with this state's numbers."""
        pair = self.stage.pair
        return f"Z = {pair.focal_length:.0f} · {pair.baseline:.3f} / {self.disparity:.2f} = {metres(self.depth())}"

    def interval(self) -> str:
        """What the error of the disparity leaves of that depth."""
        near, far = self.depth_interval()
        return f"±{self.plus_minus:g} px: {metres(near)} … {metres(far)}"
