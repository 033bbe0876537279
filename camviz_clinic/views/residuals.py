"""The residuals of every view: a bar for each, and of the chosen one its photograph and its board."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from functools import cached_property
from math import log10
from pathlib import Path
from typing import Any, ClassVar

import numpy as np

from camviz.draw import plot, svg
from camviz.draw.flow import rows
from camviz.draw.marks import NOTHING, Marks
from camviz.draw.panel import Panel, image_panel, placed_image
from camviz.draw.picture import Picture, jpeg
from camviz.draw.readout import listed, readout
from camviz.draw.space import OrbitCamera, space_panel
from camviz.lenses.base import Array
from camviz.views.base import Drawn, OrbitView, slider
from camviz.views.marks import arrows, cross, shortened
from camviz.views.view_bars import (
    LABEL,
    NAMED,
    ViewChooser,
    bars_of,
    ceiling,
    figures_in,
    figures_on,
    names_below,
    places,
)
from camviz_clinic.views.board_poses import BoardPosesView
from camviz_clinic.views.observations import Observations, not_at_hand, short_names

ARROW = 26.0  # picture units that a view's 90th percentile residual is drawn long, by default
_LONGEST = 40.0  # picture units of an arrow from a corner that was set aside
_LAYOUT = rows(
    (206, {"errors": 960}), (378, {"picture": 480, "boards": 480}), (216, {"the board": 480, "numbers": 300})
)


@dataclass(frozen=True)
class ResidualsView(ViewChooser, OrbitView):
    """Every view's error, and where the chosen view has it: in its picture, in space, and in the board's frame.

    An arrow leads from where the calibration projects a corner towards where it was detected, `scale` times as long as
    in the picture. Corners that were set aside have red crosses. Click a bar, or drag along them, to choose a view.
    """

    title: ClassVar[str] = "Residuals, view by view"

    observations: Observations = field(compare=False, repr=False)
    view: int = slider(1, 1, 13, 1, help="which picture is shown; a click on its bar chooses it as well")
    scale: float = slider(
        50.0, 1, 300, 1, label="arrows", unit="×", help="how much longer the arrows are than the error"
    )
    eye: OrbitCamera = OrbitCamera(yaw_deg=-50, pitch_deg=20)

    @classmethod
    def of(cls, calibration: Any, camera: str = "", **options: Any) -> ResidualsView:
        """The view of a calibration, its worst picture first. Raises Missing where it holds no corners or poses."""
        return cls.about(Observations.of(calibration, camera, **options))

    @classmethod
    def about(cls, observations: Observations, view: int | None = None) -> ResidualsView:
        """The view of a picture (counted from 1), the worst unless given, with arrows of a length that can be seen."""
        return cls(observations, view or observations.worst + 1, arrow_scale(observations))

    @property
    def count(self) -> int:
        return len(self.observations)

    def numbers(self) -> dict[str, str]:
        """The chosen view's key figures, as text."""
        seen, i = self.observations, self.index
        lengths = np.where(seen.used[i] | seen.aside[i], seen.lengths[i], np.nan)
        figures = {"RMS": _pixels(seen.rms[i]), "corners used": f"{seen.used[i].sum()} of {len(lengths)}"}
        if seen.aside[i].any():
            figures["set aside"] = f"{seen.aside[i].sum()}; with them {_pixels(seen.rms_seen[i])}"
        if np.isfinite(lengths).any():
            worst = int(np.nanargmax(lengths))
            row, column = divmod(worst, seen.board.columns)
            figures["worst corner"] = f"{_pixels(lengths[worst])}, row {row + 1}, column {column + 1}"
        if seen.shown[i]:
            figures["board"] = f"{seen.distances[i]:.3g} m away, tilted {seen.tilts_deg[i]:.0f}°"
        return figures

    def description(self) -> str:
        seen, i = self.observations, self.index
        figures = listed(self.numbers())
        return (
            f"{len(seen)} views of {seen.name}, together {_pixels(seen.total_rms)} RMS; the largest is "
            f"{seen.picture(seen.worst)} with {_pixels(seen.rms_seen[seen.worst])}. "
            f"Shown: {seen.picture(i)}: {figures}. Arrows {self.scale:g} times their length."
        )

    # The picture -----------------------------------------------------------------------------------------------------

    def figure(self, *, draft: bool = False) -> Picture:
        image, attached = self.picture_panel(self._image_panel)
        space, sheets = self._poses.space(space_panel("boards", 490, 236, 450, 338), draft)
        bars, board = (
            self.bars_panel(self._bars, handle=True),
            self.board_panel(space_panel("board", 20, 610, 450, 180)),
        )
        parts = {
            "errors": bars,
            "picture": image,
            "boards": space,
            "the board": board,
            "numbers": self._numbers_block(),
        }
        return self.tiled(_LAYOUT, parts, attached | sheets)

    @property
    def _bars(self) -> Panel:
        return bars_panel(self.observations)

    @property
    def _image_panel(self) -> Panel:
        k = self.observations.camera.intrinsics
        return image_panel("picture", 20, 236, 450, k.width, k.height, tallest=338)

    def bars_panel(self, panel: Panel, *, handle: bool = False, links: Mapping[int, str] | None = None) -> Marks:
        """A bar per view, the chosen one orange; with `handle` for the pointer, or with `links` from views (from 0)."""
        seen, n = self.observations, len(self.observations)
        rms, all_seen = seen.rms, np.where(seen.rms_seen > np.nan_to_num(seen.rms) * 1.001, seen.rms_seen, np.nan)
        content = plot.grid(panel, xticks=[])
        content += plot.bars(panel, *places(n), all_seen, "wash fill-red")
        if links is None:
            content += bars_of(panel, rms, self.index)
        else:
            content += svg.join(self._linked_bar(panel, i, links.get(i)) for i in range(n))
        content += plot.level(panel, seen.total_rms, "ink dashed")
        content += figures_on(panel, np.fmax(rms, all_seen))
        content += figures_in(panel, np.where(np.isfinite(all_seen), rms, np.nan))
        touch = {"drag": "bars", "hint": "click a bar", "label": LABEL} if handle else {}
        shown = panel.show(content, title=f"RMS error of every view, {seen.name}", **touch)
        aside = "; blue: corners used, pale red: with those set aside" if np.isfinite(all_seen).any() else ""
        aside += "; broken: cut" if np.nanmax(seen.rms_seen, initial=0) > panel.top else ""
        words = f"dashed: all views, {_pixels(seen.total_rms)}{aside}"
        place = (panel.x + panel.width - (112 if handle else 0), panel.y - 8)
        return shown + svg.text(place, words, "note end") + plot.axes(panel, "", "RMS [px]", xticks=self._view_names())

    def _linked_bar(self, panel: Panel, i: int, link: str | None) -> Marks:
        """One bar, and all above it, as a link to its view; a bar whose view is not shown is none."""
        seen = self.observations
        left, right = places(self.count)
        drawn = plot.bars(
            panel, left[i : i + 1], right[i : i + 1], seen.rms[i : i + 1], "fill-blue" if link else "fill-muted"
        )
        if link is None:
            return drawn
        (x0, _), (x1, _) = panel.place([(i + 0.5, 0), (i + 1.5, 0)])
        target = svg.rectangle(x0, 0, x1 - x0, panel.height, "target")
        words = f"{seen.picture(i)}, {_pixels(seen.rms_seen[i])}"
        return svg.group(target + drawn, href=link, data_choose=i + 1, aria_label=words)

    def _view_names(self) -> list[tuple[float, str]]:
        numbers = range(self.count)
        few = self.count <= NAMED
        return names_below([Path(self.observations.picture(i)).stem[-9:] if few else f"{i + 1}" for i in numbers])

    def picture_panel(self, panel: Panel) -> Drawn:
        """The chosen view's picture with its corners and arrows, and the photographs it needs."""
        seen, i, k = self.observations, self.index, self.observations.camera.intrinsics
        image = seen.photographs(i)
        content, attached, missing = self._grid(panel), {}, not_at_hand(panel) if seen.pictures else NOTHING
        if image is not None:
            content, missing = placed_image(panel, "photograph", k.width, k.height), svg.NOTHING
            attached = {"photograph": jpeg(image)}
        detected, starts = panel.place(seen.detections[i]), panel.place(seen.projected[i])
        ends, used = panel.place(self.arrow_tips()), seen.used[i]
        content += arrows(starts[used], ends[used], "orange")
        content += svg.dots(detected[used], "paper-dot", 6) + svg.dots(detected[used], "green", 4)
        aside, cut = _set_aside(starts[seen.aside[i]], ends[seen.aside[i]])
        aside += cross(detected[seen.aside[i]], "red")
        title = f"{seen.picture(i)}: residuals × {self.scale:g}"
        note = "red: longer than drawn" if cut else "from projected to detected"
        return panel.show(content + aside + missing, title=title, note=note), attached

    def arrow_tips(self) -> Array:
        """Where (corners, 2) the chosen view's arrows end, in pixels: `scale` residuals from the projection."""
        seen, i = self.observations, self.index
        return seen.projected[i] + self.scale * seen.residuals[i]

    def _grid(self, panel: Panel) -> Marks:
        """The board's lines as projected, for want of a photograph."""
        seen = self.observations
        grid = panel.place(seen.projected[self.index]).reshape(seen.board.rows, seen.board.columns, 2)
        return svg.path([*grid, *grid.swapaxes(0, 1)], "muted thin")

    def board_panel(self, place: Panel) -> Marks:
        """The chosen view's residuals as seen on the board itself, in its own frame."""
        seen, i, board = self.observations, self.index, self.observations.board
        left, top, right, bottom = board.area
        wide, high = right - left, bottom - top
        scale = min(place.width / wide, place.height / high)
        left -= (place.width / scale - wide) / 2
        top -= (place.height / scale - high) / 2
        panel = replace(place, left=left, top=top, right=left + place.width / scale, bottom=top + place.height / scale)
        corners = seen.corners_board[:, :2]
        grid = panel.place(corners).reshape(board.rows, board.columns, 2)
        tips = corners + self.board_scale * (seen.on_board[i] - corners)
        content = svg.path([*grid, *grid.swapaxes(0, 1)], "grid")
        starts, ends = panel.place(corners), panel.place(tips)
        content += arrows(starts[seen.used[i]], ends[seen.used[i]], "orange") + svg.dots(
            starts[seen.used[i]], "green", 4
        )
        content += _set_aside(starts[seen.aside[i]], ends[seen.aside[i]])[0] + cross(starts[seen.aside[i]], "red", 4)
        off = np.linalg.norm(seen.on_board[i] - corners, axis=-1)[seen.used[i]]
        note = f"typically {1000 * np.median(off):.2g} mm on the board" if off.size else ""
        return panel.show(content, title=f"The same on the board, × {self.board_scale:.3g}", note=note)

    @property
    def board_scale(self) -> float:
        """How much longer the arrows on the board are than the error there: as `scale`, but in round board lengths."""
        seen, i = self.observations, self.index
        off = np.linalg.norm(seen.on_board[i] - seen.corners_board[:, :2], axis=-1)[seen.used[i]]
        default = nice(0.4 * seen.board.square_size / np.quantile(off, 0.9)) if off.size and off.max() > 0 else 1.0
        return default * self.scale / arrow_scale(seen)

    @cached_property
    def _poses(self) -> BoardPosesView:
        seen = self.observations
        eye = self.from_afar(np.array(self.eye.target), 1.75 * float(np.nanmedian(seen.distances)))
        hidden = frozenset(np.flatnonzero(~seen.shown).tolist())
        names = short_names(seen.pictures, len(seen))
        return BoardPosesView(
            seen.camera, seen.cam_from_board, seen.board, "camera", self.index + 1, eye=eye, hidden=hidden, names=names
        )

    def _numbers_block(self) -> Marks:
        return svg.text((490, 602), f"{self.observations.picture(self.index)}", "title") + readout(
            self.numbers(), (490, 628), (0, 22), (100, 0)
        )


def _set_aside(starts: Array, ends: Array) -> tuple[Marks, bool]:
    """Arrows between places (n, 2) for corners that were set aside, and whether any is shortened."""
    ends, cut = shortened(starts, ends, _LONGEST)
    return arrows(starts, ends, "red dotted"), bool(cut.any())


def bars_panel(seen: Observations, x: float = 70, y: float = 34, width: float = 870, height: float = 140) -> Panel:
    """Where the bars go: views 1 … n to the right, pixels upwards."""
    return plot.plot_panel("bars", x, y, width, height, (0.5, len(seen) + 0.5), (0, ceiling(seen.rms_seen)))


def arrow_scale(seen: Observations) -> float:
    """A round factor by which the arrows of most views can be seen: the 90th percentile is ARROW picture units long."""
    lengths = seen.lengths[seen.used]
    typical = float(np.quantile(lengths, 0.9)) if lengths.size else 0.0
    per_pixel = 450 / seen.camera.intrinsics.width
    return float(np.clip(nice(ARROW / (typical * per_pixel)), 1, 300)) if typical > 0 else 1.0


def nice(value: float) -> float:
    """The nearest 1, 2 or 5 times a power of ten."""
    power = 10.0 ** np.floor(log10(value))
    return float(min((1 * power, 2 * power, 5 * power, 10 * power), key=lambda nice: abs(np.log(nice / value))))


def _pixels(value: float) -> str:
    return f"{value:.3g} px" if np.isfinite(value) else "none"
