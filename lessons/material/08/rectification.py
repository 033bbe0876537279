"""The rectification visualizer: two pictures turned until matching points share a row, and the depth that follows.

A reader's own function can make the depths beside the right ones.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from functools import cached_property, lru_cache
from typing import Any, ClassVar

import cv2
import numpy as np

from camviz.cameras import Camera
from camviz.draw import svg
from camviz.draw.flow import Cell, Part, rows
from camviz.draw.panel import Panel, image_in, placed_image
from camviz.draw.picture import Picture, jpeg
from camviz.draw.readout import listed, readout, true_minus
from camviz.draw.shades import heat_key, heat_map, heat_panel
from camviz.lenses.base import Array
from camviz.views.base import answered
from camviz.views.depth_wedge import metres, wedge_panel
from camviz.views.marks import clipped, on_photograph, ring
from camviz.views.yours import YOURS_HERE, is_unwritten
from camviz_school.views import stereo_pair
from camviz_school.views.stereo_pair import WRONG, Source, seen_from_there
from camviz_school.views.turning_pair import TurningPair

_TILES = {  # of the panels
    "left": "left picture",
    "right": "right picture",
    "numbers": "numbers",
    "disparity": "disparity map",
    "second": "second map",
    "wedge": "rays from above",
}
# The first row: its height, and how wide its tiles are, by how many panels stand in it.
_FIRST = {1: (330.0, (440.0,)), 2: (392.0, (480.0, 480.0)), 3: (314.0, (385.0, 385.0, 190.0))}
_ROWS = 12  # epipolar lines in a picture's height


@dataclass(frozen=True)
class RectificationView(TurningPair):
    """A pair from as it was taken to rectified, drawn: both pictures, the disparities, the depths and the wedge.

    `panels` names what is drawn: any of left, right, numbers, disparity, second (map) and wedge, the rays from above.
    `yours` is a reader's function of (d, f, B, doffs) that gives Z; then the first map shows the right depths, and the
    second those of that function.
    """

    title: ClassVar[str] = "Rectification, disparity and depth"
    openable: ClassVar[Mapping[str, str]] = _TILES

    panels: str = " ".join(_TILES)
    yours: Callable[..., Any] | None = field(default=None, compare=False, repr=False)

    def __post_init__(self) -> None:
        super().__post_init__()
        if not self._panels.split() or not set(self._panels.split()) <= _TILES.keys():
            raise ValueError(f"panels must be some of {', '.join(_TILES)}, got {self.panels!r}")

    # Words -----------------------------------------------------------------------------------------------------------

    def numbers(self, *, draft: bool = False) -> dict[str, str]:
        """The state's key figures, as text."""
        now, found, score = self.stage, self.disparity_map(draft=draft), self.score(draft=draft)
        f = now.left.intrinsics.fx
        shifted = abs(now.doffs) > 0.05
        second = true_minus(f"{now.doffs:.1f} px") if shifted else f"{now.pair.baseline:.3f} m"
        figures = {"f, doffs" if shifted else "f, B": f"{f:.0f} px, {second}"}
        figures["rows differ by"] = f"{self.rows_apart():.1f} px"
        if self._has("wedge"):
            figures["chosen, rectified"] = self._in_words(self.disparity, self.depth())
            figures["measured at the mark"] = self._with_depth(self._at_mark(found))
        if not score.compared:
            return {**figures, "no disparity": f"{100 * np.isnan(found).mean():.0f} % of the pixels"}
        if self._has("wedge"):
            figures["true at the mark"] = self._with_depth(self._at_mark(self.true_disparity_map(draft=draft)))
        return {
            **figures,
            "no disparity": f"{100 * score.missing:.0f} % of the pixels",
            f"off by more than {WRONG:g} px": f"{100 * (score.bad - score.missing):.1f} %",
            "mean error": _pixels(score.mean_error),
        }

    def _with_depth(self, disparity: float) -> str:
        """A disparity of this moment's pictures in words, with what Z = f B / (d + doffs) makes of it."""
        return self._in_words(disparity, float(self.stage.depth(disparity))) if np.isfinite(disparity) else "none"

    @staticmethod
    def _in_words(disparity: float, depth: float) -> str:
        return true_minus(f"{disparity:.1f} px: {metres(depth)}")

    def description(self, *, draft: bool = False) -> str:
        """What the panels that are drawn say, and no more."""
        way = "rectified" if self.rectify == 1 else f"{100 * self.rectify:.0f} % of the way to rectified"
        said = f"The pair {way if self.rectify else 'as taken'}."
        if self._has("numbers"):
            said += f" {listed(self.numbers(draft=draft))}."
        elif self._has("left") or self._has("right"):
            said += f" Rows differ by {self.rows_apart():.1f} px."
        if self._has("disparity") or self._has("second"):
            said += f" Matched by {self.method}, blocks of {self.block_size:g} px, {self.disparities:g} disparities."
        if self._has("wedge"):
            said += f" {self.equation()}; {self.interval()}." if self.worth else f" {self.equation()}."
        return said

    # Hands -----------------------------------------------------------------------------------------------------------

    def dragged(self, handle: str, x: float, y: float, dx: float, dy: float) -> RectificationView:
        if handle not in ("left", "right"):
            return self
        panel, here, now = self._image_panel(handle), getattr(self, f"uv_{handle}"), getattr(self.stage, handle)
        rectified = getattr(self.stage.pair, handle)
        at = panel.place(here) + (panel.x + dx, panel.y + dy) if np.isnan(x) else np.array([x, y])
        uv = seen_from_there(rectified, now, panel.data(at - (panel.x, panel.y)))
        if not np.isfinite(uv).all():
            return self
        size = rectified.intrinsics
        if handle == "right":
            return self.but(disparity=float(np.clip(self.column - uv[0], 0.25, size.width)))
        column, row = np.clip(uv, 0, (size.width - 1, size.height - 1)).tolist()
        return self.but(column=column, row=row)

    # The picture -----------------------------------------------------------------------------------------------------

    def figure(self, *, draft: bool = False) -> Picture:
        shown = self._panels.split()
        drawn, attached = dict[str, Part](), dict[str, bytes]()
        if self._has("left") or self._has("right"):
            attached |= zip(("left", "right"), _photographs(*self._key(draft)), strict=True)
            drawn = {name: self._picture_panel(name) for name in ("left", "right") if name in shown}
        if self._has("disparity") or self._has("second"):
            maps, images = self._heat_maps(draft) if self.yours is None else self._your_maps(draft)
            drawn, attached = drawn | maps, attached | images
        if self._has("numbers"):
            x, y, *_ = self._layout["numbers"]
            drawn["numbers"] = readout(self.numbers(draft=draft), (x + 12, y + 38), (0, 36.5), (0, 15.5))
        if self._has("wedge"):
            drawn["wedge"] = self._wedge_panel()
        attached = {name: data for name, data in attached.items() if name.split()[0] in shown}
        words = self.description(draft=draft)
        return self.tiled(self._layout, {_TILES[one]: drawn[one] for one in shown}, attached, words)

    @cached_property
    def _layout(self) -> dict[str, Cell]:
        """Two panels in the first row, or three if the third is the numbers; below, up to three in each row."""
        names = [_TILES[name] for name in self._panels.split()]
        count = min(len(names), 3 if names[2:3] == ["numbers"] else 2)
        (high, wide), others = _FIRST[count], names[count:]
        made = [(high, dict(zip(names[:count], wide, strict=True)))]
        made += [(284.0, dict.fromkeys(others[i : i + 3], 320.0)) for i in range(0, len(others), 3)]
        return rows(*made)

    # The two pictures ------------------------------------------------------------------------------------------------

    def _image_panel(self, name: str) -> Panel:
        """The panel of a picture in its tile; a map has its colours beside it, and a line below."""
        (x, y, width, height), size = self._layout[_TILES[name]], self.stage.left.intrinsics
        beside, below = (76, 24) if name in ("disparity", "second") else (0, 0)
        return image_in((x, y, width - beside, height - below), name, size.width, size.height)

    def _picture_panel(self, name: str) -> svg.Marks:
        panel, now = self._image_panel(name), getattr(self.stage, name)
        content = svg.join([
            placed_image(panel, name, now.intrinsics.width, now.intrinsics.height),
            self._pencil(panel, now),
            self._same_row(panel),
            on_photograph(self._epipolar(panel, now, np.array([self.row])), "green"),
            self._mark(panel),
        ])  # fmt: skip
        action = "move the mark" if name == "left" else "change the disparity"
        label = f"The {name} picture; drag or press the arrow keys to {action}"
        title = "Left picture" if name == "left" else f"Right picture: rows differ by {self.rows_apart():.1f} px"
        return panel.show(content, title=title, hint="drag", drag=name, label=label)

    def _epipolar(self, panel: Panel, now: Camera, rows: Array) -> Array:
        """The epipolar lines (m, 2, 2) that the rectified pair has in `rows`, where this camera now sees them."""
        size = self.stage.pair.left.intrinsics
        u = np.linspace(-size.width, 2 * size.width, 40)
        uv = np.stack(np.broadcast_arrays(u, rows[:, None]), axis=-1)
        return clipped(panel, panel.place(seen_from_there(now, self.stage.pair.left, uv)))

    def _pencil(self, panel: Panel, now: Camera) -> svg.Marks:
        height = self.stage.pair.left.intrinsics.height
        lines = self._epipolar(panel, now, np.linspace(-0.5, 1.5, 2 * _ROWS + 1) * height)
        return svg.segments(lines[:, 0], lines[:, 1], "yellow thin half")

    def _same_row(self, panel: Panel) -> svg.Marks:
        """The left mark's row in both pictures: where a matcher looks, whether the partner is there or not."""
        v = panel.place(self.uv_left)[1]
        return on_photograph([[(0, v), (panel.width, v)]], "orange dashed")

    def _mark(self, panel: Panel) -> svg.Marks:
        at = panel.place(self.uv_left if panel.name == "left" else self.uv_right)
        return ring(at, "red", 8) + svg.dots([at], "red", 5)

    # The maps --------------------------------------------------------------------------------------------------------

    @property
    def _second(self) -> tuple[str, str, float, float, str]:
        """Colours, title, limits and unit of the second map."""
        if self.show == "error":
            return "error", "Error", 0.0, 4.0, "px"
        title = "Depth" if self.show == "depth" else "True depth"
        return "depth", title, *stereo_pair.depth_limits(self.source), "m"

    def _map(self, name: str, low: float, high: float, unit: str, awaited: bool = False, **heading: str) -> svg.Marks:
        """The map that is attached by that name, where it is shown, and below it what the hatching means."""
        if not self._has(name):
            return svg.NOTHING
        panel, size = self._image_panel(name), self.stage.left.intrinsics
        mark = ring(panel.place(self.uv_left), "red", 5) * bool({"left", "right"} & {*self._panels.split()})
        hatched = svg.text((panel.x, panel.y + panel.height + 18), "hatched: nothing found", "note")
        return heat_panel(panel, size.width, size.height, low, high, unit, mark, awaited=awaited, **heading) + hatched

    def _heat_maps(self, draft: bool) -> tuple[dict[str, Part], dict[str, bytes]]:
        """The maps that are shown, by name, and what is attached to them."""
        colours, title, low, high, unit = self._second
        note = "" if self.source.photographs is None or self.source.distances is not None else "truth unknown"
        if self.show == "depth":
            formula = "Z = fB / (d + doffs)" if abs(self.stage.doffs) > 0.05 else "Z = fB / d"
            note = formula if self._has("disparity") else ""
        drawn: dict[str, Part] = {
            "disparity": self._map("disparity", 0, self.disparities, "px", title="Disparity", note=self.method),
            "second": self._map("second", low, high, unit, title=title, note=note),
        }
        images = dict(zip(("disparity", "second"), _maps(*self._matching(draft), self.show), strict=True))
        return drawn, images | {"disparity key": heat_key("disparity"), "second key": heat_key(colours)}

    def your_depth(self, *, draft: bool = False) -> tuple[np.ndarray, str]:
        """What the reader's function makes of the disparity map, and what is wrong with it."""
        found, now = self.disparity_map(draft=draft), self.stage
        given = (found.astype(float), now.left.intrinsics.fx, now.pair.baseline, now.doffs)
        return answered(self.yours, given, found)

    def _your_maps(self, draft: bool) -> tuple[dict[str, Part], dict[str, bytes]]:
        """The right depths, and beside them those of the reader's function: the right ones, greyed, until it is."""
        limits, right = stereo_pair.depth_limits(self.source), self.stage.depth(self.disparity_map(draft=draft))
        depth, problem = self.your_depth(draft=draft)
        waits = is_unwritten(problem)
        own = self._map("second", *limits, "m", awaited=waits, title="With your function")
        if own:
            panel = self._image_panel("second")
            if waits:
                depth, middle = right, (panel.x + panel.width / 2, panel.y + panel.height / 2)
                own += svg.text(middle, YOURS_HERE, "title halo middle")
            elif problem:
                own += svg.paragraph((panel.x + 12, panel.y + 26), problem, panel.width - 24, "note halo")
            elif np.isfinite(self._at_mark(depth)):
                at = (panel.x + panel.width, panel.y + panel.height + 18)
                own += svg.text(at, f"at the mark: {metres(self._at_mark(depth))}", "orange end")
        images = {"disparity": heat_map(_small(right), *limits, "depth")}
        images["second"] = heat_map(_small(depth), *limits, "depth")
        drawn: dict[str, Part] = {"disparity": self._map("disparity", *limits, "m", title="Depth"), "second": own}
        return drawn, images | dict.fromkeys(("disparity key", "second key"), heat_key("depth"))

    def _wedge_panel(self) -> svg.Marks:
        farthest = stereo_pair.depth_limits(self.source)[1]
        notes = (self.equation(), self.interval())
        x, y, width, height = self._layout[_TILES["wedge"]]
        place = (x + 60, y + 34, width - 70, height - 98)
        return wedge_panel(place, self.stage.pair, self.disparity, self.plus_minus, farthest, notes, worth=self.worth)


# What is kept once made ----------------------------------------------------------------------------------------------


@lru_cache(maxsize=4)
def _photographs(source: Source, baseline: float, rectify: float, side: int) -> tuple[bytes, bytes]:
    seen = stereo_pair.pictures(source, baseline, rectify, side)
    return jpeg(seen.left), jpeg(seen.right)


@lru_cache(maxsize=4)
def _maps(
    source: Source, baseline: float, rectify: float, side: int, method: str, block: int, count: int, show: str
) -> tuple[bytes, bytes]:
    """The disparities and the second map, as PNG."""
    found = stereo_pair.disparities(source, baseline, rectify, side, method, block, count)
    now = stereo_pair.stage(source, baseline, rectify)
    first = heat_map(_small(found), 0, count, "disparity")
    if show == "depth":
        return first, heat_map(_small(now.depth(found)), *stereo_pair.depth_limits(source), "depth")
    truth = stereo_pair.true_disparities(source, baseline, rectify, side)
    if show == "true depth":
        return first, heat_map(_small(now.depth(truth)), *stereo_pair.depth_limits(source), "depth")
    return first, heat_map(_small(np.abs(found - truth)), 0, 4, "error")


def _small(values: np.ndarray) -> np.ndarray:
    """A map no finer than a screen shows it, which keeps a saved notebook light."""
    scale = min(1.0, 400 / values.shape[1])
    return cv2.resize(values, None, fx=scale, fy=scale, interpolation=cv2.INTER_NEAREST)


def _pixels(error: float) -> str:
    """An error in words: the decimals of a large one, of rows that do not match, depend on the machine."""
    if not np.isfinite(error):
        return "none found"
    return f"{error:.2f} px" if error < 10 else f"{error:.0f} px"
