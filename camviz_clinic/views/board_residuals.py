"""Residuals gathered on the board: what every view agrees on is the board's fault, and may be its bend."""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import cached_property
from typing import Any, ClassVar

import numpy as np

from camviz.draw import svg
from camviz.draw.flow import Part, Sentences, rows
from camviz.draw.items import Item, Label, Line, TexturedMesh
from camviz.draw.marks import Marks
from camviz.draw.panel import Panel
from camviz.draw.picture import Picture
from camviz.draw.shades import Shades, bar
from camviz.draw.space import OrbitCamera, space_panel
from camviz.lenses.base import Array
from camviz.views.base import Drawn, OrbitView, slider
from camviz.views.marks import arrows
from camviz_clinic.calibration.adjustment import Adjustment
from camviz_clinic.calibration.board_warp import WarpTest, warp_test
from camviz_clinic.views.observations import Observations
from camviz_clinic.views.residuals import nice
from camviz_clinic.views.uncertainty import adjusted

_LAYOUT = rows((374, {"mean residuals": 480, "bend": 480}), (66, {"in words": 960}))


@dataclass(frozen=True)
class BoardResidualsView(OrbitView):
    """The mean over all views of every corner's residual, in the board's own frame, and how far the board is bent.

    The bend is the solution's where it has one; else what the residuals ask for, corner by corner: a corner off the
    plane is seen beside its place by all views that look at it aslant. `test` says whether that is more than noise.
    """

    title: ClassVar[str] = "Is the board flat?"

    observations: Observations = field(compare=False, repr=False)
    test: WarpTest | None = field(default=None, compare=False, repr=False)
    exaggeration: float = slider(20.0, 1, 200, 1, label="bend", unit="×", help="how much the bend is exaggerated")
    scale: float = slider(
        100.0, 1, 1000, 1, label="arrows", unit="×", help="how much longer the arrows are than the mean"
    )
    eye: OrbitCamera = OrbitCamera(yaw_deg=-35, pitch_deg=35)

    @classmethod
    def of(cls, calibration: Any, camera: str = "", **options: Any) -> BoardResidualsView:
        """The view of a calibration. Raises Missing where it holds no corners or poses."""
        return cls.about(Observations.of(calibration, camera, **options), tested(adjusted(calibration, camera)))

    @classmethod
    def about(cls, observations: Observations, test: WarpTest | None = None) -> BoardResidualsView:
        """The view with a bend and arrows that can be seen."""
        view, square = cls(observations), observations.board.square_size
        longest = float(np.nanmax(np.linalg.norm(view.means, axis=-1), initial=0))
        deepest = float(np.nanmax(np.abs(view.heights), initial=0))
        scale = float(np.clip(nice(0.5 * square / longest), 1, 1000)) if longest > 0 else 1.0
        bend = float(np.clip(nice(0.9 * square / deepest), 1, 200)) if deepest > 0 else 1.0
        return cls(observations, test, bend, scale)

    @cached_property
    def means(self) -> Array:
        """The mean (corners, 2) over the views, in metres on the board, of where the corners are seen less where they
        belong; NaN for a corner that fewer than three views show."""
        seen = self.observations
        off = np.where(seen.used[..., None], seen.on_board - seen.corners_board[:, :2], 0)
        count = seen.used.sum(axis=0)[:, None]
        return off.sum(axis=0) / np.where(count >= 3, count, np.nan)

    @cached_property
    def lifts(self) -> Array:
        """How far (corners,) in metres each corner lies behind the board as it is taken to be, as the views have it.

        A corner moved by h along the normal is seen h tan(slant) beside its place; the least squares of that over the
        views. The part that a shift or a tilt of the whole board explains is taken out, for the poses took it already.
        """
        seen = self.observations
        R, t = seen.cam_from_board.rotation.as_matrix(), seen.cam_from_board.translation
        centres = -np.einsum("vij,vi->vj", R, t)[:, None]
        rays = seen.corners_board - centres
        with np.errstate(invalid="ignore", divide="ignore"):  # of a view that shows no corner
            slope = -rays[..., :2] / rays[..., 2:]
        slope = np.where(seen.used[..., None], slope, 0)
        weight = np.where(
            seen.used[..., None], 1 / np.maximum(np.linalg.norm(rays, axis=-1, keepdims=True), 1e-12) ** 2, 0
        )
        off = np.where(seen.used[..., None], seen.on_board - seen.corners_board[:, :2], 0)
        with np.errstate(invalid="ignore", divide="ignore"):
            lift = np.sum(weight * slope * off, axis=(0, 2)) / np.sum(weight * slope**2, axis=(0, 2))
        known = np.isfinite(lift)
        if known.sum() < 4:
            return np.full(len(lift), np.nan)
        plane = np.column_stack([np.ones(known.sum()), seen.corners_board[known, :2]])
        lift[known] -= plane @ np.linalg.lstsq(plane, lift[known], rcond=None)[0]
        return lift

    @cached_property
    def heights(self) -> Array:
        """z (corners,) in metres of the bent board: the solution's bend, or what the residuals ask for."""
        seen = self.observations
        return seen.corners_board[:, 2] if seen.board_warp is not None else self.lifts

    def numbers(self) -> dict[str, float]:
        """The longest mean in mm, the depth of the bend in mm from lowest to highest, and the sagittas where solved."""
        warp = self.observations.board_warp
        known = np.isfinite(self.heights).any()
        return {
            "longest_mm": 1000 * float(np.nanmax(np.linalg.norm(self.means, axis=-1), initial=0)),
            "depth_mm": 1000 * float(np.nanmax(self.heights) - np.nanmin(self.heights)) if known else np.nan,
        } | (
            {}
            if warp is None
            else dict(zip(("along_rows_mm", "along_columns_mm"), (1000 * warp).tolist(), strict=True))
        )

    def _solved(self) -> str:
        n = self.numbers()
        if "along_rows_mm" in n:
            return (
                f"The solution bends the board by {n['along_rows_mm']:+.2f} mm along its rows and "
                f"{n['along_columns_mm']:+.2f} mm along its columns."
            )
        if not np.isfinite(n["depth_mm"]):
            return "Too few views show each corner to tell a bend."
        told = (
            f"The solution takes the board to be flat; the residuals ask for {n['depth_mm']:.2f} mm from its "
            "lowest to its highest corner."
        )
        if self.test is None:
            return told
        along_rows, along_columns = self.test.warp_mm
        chance = "more than noise" if self.test.bowed() else "no more than noise may do"
        return (
            f"{told}\nSolved with a bend it would be {along_rows:+.2f} mm along its rows and {along_columns:+.2f} "
            "mm along its "
            f"columns: {chance} (probability {self.test.probability:.2g} for a flat board)."
        )

    def description(self) -> str:
        return (
            f"{len(self.observations)} views: the mean residual of the worst corner is "
            f"{self.numbers()['longest_mm']:.3f} mm on the board. {self._solved()} Arrows {self.scale:g} times, bend "
            f"{self.exaggeration:g} times as large as they are."
        )

    def figure(self, *, draft: bool = False) -> Picture:
        space, sheets = self._bent(draft)
        parts: dict[str, Part] = {
            "mean residuals": self._means_panel(),
            "bend": space,
            "in words": Sentences(self._solved()),
        }
        return self.tiled(_LAYOUT, parts, sheets)

    def _means_panel(self) -> Marks:
        seen, board = self.observations, self.observations.board
        left, top, right, bottom = board.area
        scale = min(455 / (right - left), 320 / (bottom - top))
        panel = Panel("means", 20, 34, (right - left) * scale, (bottom - top) * scale, left, right, top, bottom)
        starts = panel.place(seen.corners_board[:, :2])
        ends = panel.place(seen.corners_board[:, :2] + self.scale * self.means)
        grid = starts.reshape(board.rows, board.columns, 2)
        content = svg.path([*grid, *grid.swapaxes(0, 1)], "grid")
        content += arrows(starts, ends, "orange") + svg.dots(starts, "green", 4)
        title, note = f"Mean residual on the board, × {self.scale:g}", f"longest {self.numbers()['longest_mm']:.2g} mm"
        return panel.show(content, title=title, note=note)

    def _bent(self, draft: bool) -> Drawn:
        board, heights = self.observations.board, self.heights
        panel = space_panel("bent", 495, 34, 360, 320)
        if not np.isfinite(heights).any():
            words = svg.paragraph((16, 30), "Too few views show each corner to tell a bend.", panel.width - 30, "label")
            return panel.show(words, title="The board’s bend"), {}
        reach = max(1000 * float(np.nanmax(np.abs(heights))), 1e-6)
        shades = Shades(-reach, reach, diverging=True)
        points = board.corners.copy()
        points[:, 2] = self.exaggeration * heights
        grid = points.reshape(board.rows, board.columns, 3)
        colours = shades.rgba(1000 * heights.reshape(board.rows, board.columns))[..., :3]
        flat = board.corners.reshape(board.rows, board.columns, 3)
        rim = np.concatenate([flat[0], flat[1:, -1], flat[-1, -2::-1], flat[-2::-1, 0]])
        items: list[Item] = [Line(line, "muted", 1.0) for line in [*grid, *grid.swapaxes(0, 1)]]
        items += [Line(rim, "muted dashed", 1.2), Label(flat[0, 0], "first corner", "note")]
        if min(board.rows, board.columns) > 1 and np.isfinite(grid).all():
            items.append(TexturedMesh.over(grid, np.repeat(np.repeat(colours, 8, 0), 8, 1), 0.9))
        middle = board.corners.mean(axis=0)
        size = float(np.linalg.norm(board.corners[-1]))
        eye = self.from_afar(middle, 1.75 * size)
        legend, bar_picture = bar(872, 64, 270, "bend-bar", shades, "mm")
        label = "The bent board in space; drag or press the arrow keys to walk around it"
        shown, attached = self.in_space(
            panel, items, draft, f"The board’s bend, × {self.exaggeration:g}", label, eye=eye
        )
        return shown + legend, attached | bar_picture


def tested(adjustment: Adjustment) -> WarpTest | None:
    """The test of a flat board, or None where the corners do not determine its solution."""
    try:
        return warp_test(adjustment)
    except (ValueError, np.linalg.LinAlgError):
        return None
