"""The rectification visualizer: two pictures turned until matching points share a row, and the depth that follows.

A reader's own function can make the depths beside the right ones.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from functools import lru_cache
from typing import Any, ClassVar

import cv2
import numpy as np

from camviz.cameras import Camera
from camviz.draw import svg
from camviz.draw.flow import rows
from camviz.draw.panel import Panel, image_panel, placed_image
from camviz.draw.picture import Picture, jpeg
from camviz.draw.readout import listed, readout, true_minus
from camviz.draw.shades import heat_key, heat_map, heat_panel
from camviz.lenses.base import Array
from camviz.views.depth_wedge import metres, wedge_panel
from camviz.views.marks import clipped, on_photograph, ring
from camviz.views.yours import tried
from camviz_school.views import stereo_pair
from camviz_school.views.stereo_pair import WRONG, Source, seen_from_there
from camviz_school.views.turning_pair import TurningPair

_WIDTH, _TALLEST = 365, 274
_MAP_WIDTH, _MAP_TALLEST = 248, 186
_LAYOUT = rows(
    (314, {"left picture": 385, "right picture": 385, "numbers": 190}),
    (284, {"disparity map": 320, "second map": 320, "wedge": 320}),
)
_ROWS = 12  # epipolar lines in a picture's height


@dataclass(frozen=True)
class RectificationView(TurningPair):
    """A pair from as it was taken to rectified, drawn: both pictures, the disparities, the depths and the wedge.

    `panels` names what stands below the two pictures: the disparity map, the second map, and the wedge with its depth.
    `yours` is a reader's function of (d, f, B, doffs) that gives Z; then the first map shows the right depths, and the
    second those of that function.
    """

    title: ClassVar[str] = "Rectification, disparity and depth"

    panels: str = "disparity second wedge"
    yours: Callable[..., Any] | None = field(default=None, compare=False, repr=False)

    def __post_init__(self) -> None:
        super().__post_init__()
        if not self._shown <= {"disparity", "second", "wedge"}:
            raise ValueError(f"panels must be some of disparity, second, wedge, got {sorted(self._shown)}")

    @property
    def _shown(self) -> set[str]:
        return set(self.panels.split())

    # Words -----------------------------------------------------------------------------------------------------------

    def numbers(self, *, draft: bool = False) -> dict[str, str]:
        """The state's key figures, as text."""
        now, found, score = self.stage, self.disparity_map(draft=draft), self.score(draft=draft)
        f = now.left.intrinsics.fx
        shifted = abs(now.doffs) > 0.05
        second = true_minus(f"{now.doffs:.1f} px") if shifted else f"{now.pair.baseline:.3f} m"
        figures = {"f, doffs" if shifted else "f, B": f"{f:.0f} px, {second}"}
        figures["rows differ by"] = f"{self.rows_apart():.1f} px"
        if "wedge" in self._shown:
            figures["chosen, rectified"] = self._in_words(self.disparity, self.depth())
            figures["measured at the mark"] = self._with_depth(self._at_mark(found))
        if not score.compared:
            return {**figures, "no disparity": f"{100 * np.isnan(found).mean():.0f} % of the pixels"}
        if "wedge" in self._shown:
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

    def description(self) -> str:
        return self._described(self.numbers())

    def _described(self, numbers: dict[str, str]) -> str:
        way = "rectified" if self.rectify == 1 else f"{100 * self.rectify:.0f} % of the way to rectified"
        way = way if self.rectify else "as taken"
        figures = listed(numbers)
        matched = f"{self.method}, blocks of {self.block_size:g} px, {self.disparities:g} disparities"
        said = f"The pair {way}. {figures}. Matched by {matched}."
        if "wedge" not in self._shown:
            return said
        return f"{said} {self.equation()}; {self.interval()}." if self.worth else f"{said} {self.equation()}."

    # Hands -----------------------------------------------------------------------------------------------------------

    def dragged(self, handle: str, x: float, y: float, dx: float, dy: float) -> RectificationView:
        panel = {"left": self._left_panel, "right": self._right_panel}.get(handle)
        if panel is None:
            return self
        pair = self.stage.pair
        here, now, rectified = self.uv_right, self.stage.right, pair.right
        if handle == "left":
            here, now, rectified = self.uv_left, self.stage.left, pair.left
        at = panel.place(here) + (panel.x + dx, panel.y + dy) if np.isnan(x) else np.array([x, y])
        uv = seen_from_there(rectified, now, panel.data(at - (panel.x, panel.y)))
        if not np.isfinite(uv).all():
            return self
        size = rectified.intrinsics
        if handle == "left":
            column, row = np.clip(uv, 0, (size.width - 1, size.height - 1)).tolist()
            return self.but(column=column, row=row)
        return self.but(disparity=float(np.clip(self.column - uv[0], 0.25, size.width)))

    # The picture -----------------------------------------------------------------------------------------------------

    def figure(self, *, draft: bool = False) -> Picture:
        numbers = self.numbers(draft=draft)
        left, right = _photographs(*self._key(draft))
        attached = {"left": left, "right": right}
        maps, more = self._heat_maps() if self.yours is None else self._your_maps(draft)
        if self.yours is None:
            more |= dict(zip(("disparity", "second"), _maps(*self._matching(draft), self.show), strict=True))
        parts = {
            "left picture": self._picture_panel(self._left_panel),
            "right picture": self._picture_panel(self._right_panel),
            "numbers": readout(numbers, (782, 38), (0, 36.5), (0, 15.5)),
            **{f"{name} map": drawn for name, drawn in maps.items()},
            "wedge": self._wedge_panel() if "wedge" in self._shown else "",
        }
        attached |= {name: data for name, data in more.items() if name.split()[0] in maps}
        return self.tiled(_LAYOUT, parts, attached, self._described(numbers))

    # The two pictures ------------------------------------------------------------------------------------------------

    @property
    def _left_panel(self) -> Panel:
        size = self.stage.left.intrinsics
        return image_panel("left", 10, 34, _WIDTH, size.width, size.height, tallest=_TALLEST)

    @property
    def _right_panel(self) -> Panel:
        size = self.stage.right.intrinsics
        return image_panel("right", 395, 34, _WIDTH, size.width, size.height, tallest=_TALLEST)

    def _picture_panel(self, panel: Panel) -> str:
        now = self.stage.left if panel.name == "left" else self.stage.right
        size = now.intrinsics
        content = "".join([
            placed_image(panel, panel.name, size.width, size.height),
            self._pencil(panel, now),
            self._same_row(panel),
            on_photograph(self._epipolar(panel, now, np.array([self.row])), "green"),
            self._mark(panel),
        ])  # fmt: skip
        action = "move the mark" if panel.name == "left" else "change the disparity"
        label = f"The {panel.name} picture; drag or press the arrow keys to {action}"
        return panel.show(content, title=f"The {panel.name} picture", hint="drag", drag=panel.name, label=label)

    def _epipolar(self, panel: Panel, now: Camera, rows: Array) -> Array:
        """The epipolar lines (m, 2, 2) that the rectified pair has in `rows`, where this camera now sees them."""
        size = self.stage.pair.left.intrinsics
        u = np.linspace(-size.width, 2 * size.width, 40)
        uv = np.stack(np.broadcast_arrays(u, rows[:, None]), axis=-1)
        return clipped(panel, panel.place(seen_from_there(now, self.stage.pair.left, uv)))

    def _pencil(self, panel: Panel, now: Camera) -> str:
        height = self.stage.pair.left.intrinsics.height
        lines = self._epipolar(panel, now, np.linspace(-0.5, 1.5, 2 * _ROWS + 1) * height)
        return svg.segments(lines[:, 0], lines[:, 1], "yellow thin half")

    def _same_row(self, panel: Panel) -> str:
        """The left mark's row in both pictures: where a matcher looks, whether the partner is there or not."""
        v = panel.place(self.uv_left)[1]
        return on_photograph([[(0, v), (panel.width, v)]], "orange dashed")

    def _mark(self, panel: Panel) -> str:
        at = panel.place(self.uv_left if panel.name == "left" else self.uv_right)
        return ring(at, "red", 8) + svg.dots([at], "red", 5)

    # The maps --------------------------------------------------------------------------------------------------------

    @property
    def _second(self) -> tuple[str, str, float, float, str]:
        """Colours, title, limits and unit of the second map."""
        if self.show == "error":
            return "error", "Error", 0.0, 4.0, "px"
        low, high = stereo_pair.depth_limits(self.source)
        return "depth", "Depth" if self.show == "depth" else "True depth", low, high, "m"

    def _map_panels(self) -> tuple[Panel, Panel]:
        size = self.stage.left.intrinsics
        left, right = (
            image_panel(name, x, 348, _MAP_WIDTH, size.width, size.height, tallest=_MAP_TALLEST)
            for name, x in (("disparity", 10), ("second", 330))
        )
        return left, right

    def _heat_maps(self) -> tuple[dict[str, str], dict[str, bytes]]:
        """The maps that are shown, by name, and their keys."""
        size = self.stage.left.intrinsics
        left, right = self._map_panels()
        _, title, low, high, unit = self._second
        note = "" if self.source.photographs is None or self.source.distances is not None else "truth unknown"
        formula = "Z = fB / (d + doffs)" if abs(self.stage.doffs) > 0.05 else "Z = fB / d"
        marks = [ring(panel.place(self.uv_left), "red", 5) for panel in (left, right)]
        maps = {
            "disparity": heat_panel(left, size.width, size.height, 0, self.disparities, "px", marks[0],
                                    title="Disparity", note=self.method),
            "second": heat_panel(right, size.width, size.height, low, high, unit, marks[1],
                                 title=title, note=formula if self.show == "depth" else note),
        }  # fmt: skip
        maps["disparity"] += svg.text((left.x, left.y + left.height + 18), "hatched: no disparity", "note")
        keys = {"disparity key": heat_key("disparity"), "second key": heat_key(self._second[0])}
        return {name: drawn for name, drawn in maps.items() if name in self._shown}, keys

    def your_depth(self, *, draft: bool = False) -> tuple[np.ndarray, str]:
        """What the reader's function makes of the disparity map, and what is wrong with it."""
        found, now = self.disparity_map(draft=draft), self.stage
        if self.yours is None:
            return np.full(found.shape, np.nan), ""
        given = (found.astype(float), now.left.intrinsics.fx, now.pair.baseline, now.doffs)
        return tried(self.yours, given, found.astype(float))

    def _your_maps(self, draft: bool) -> tuple[dict[str, str], dict[str, bytes]]:
        """The right depths, and beside them those of the reader's function."""
        size, (left, right), limits = self.stage.left.intrinsics, self._map_panels(), self._limits
        depth, problem = self.your_depth(draft=draft)
        marks = [ring(panel.place(self.uv_left), "red", 5) for panel in (left, right)]
        right_map = heat_panel(left, size.width, size.height, *limits, "m", marks[0], title="Depth")
        words = svg.paragraph((right.x, right.y + right.height + 18), problem or self._at_your_mark(depth), right.width,
                              "note" if problem else "label orange")  # fmt: skip
        your_map = heat_panel(right, size.width, size.height, *limits, "m", marks[1], title="With your function")
        true = self.stage.depth(self.disparity_map(draft=draft))
        images = {"disparity": heat_map(_small(true), *limits, "depth")}
        images["second"] = heat_map(_small(depth), *limits, "depth")
        keys = dict.fromkeys(("disparity key", "second key"), heat_key("depth"))
        return {"disparity": right_map, "second": your_map + words}, images | keys

    def _at_your_mark(self, depth: np.ndarray) -> str:
        at_mark = self._at_mark(depth)
        return f"your Z at the mark: {metres(at_mark)}" if not np.isnan(at_mark) else "no Z of yours at the mark"

    @property
    def _limits(self) -> tuple[float, float]:
        return stereo_pair.depth_limits(self.source)

    def _wedge_panel(self) -> str:
        farthest = stereo_pair.depth_limits(self.source)[1]
        notes = (self.equation(), self.interval())
        place = (700, 348, 250, 186)
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
    scale = min(1.0, 1.5 * _MAP_WIDTH / values.shape[1])
    return cv2.resize(values, None, fx=scale, fy=scale, interpolation=cv2.INTER_NEAREST)


def _pixels(error: float) -> str:
    """An error in words: the decimals of a large one, of rows that do not match, depend on the machine."""
    if not np.isfinite(error):
        return "none found"
    return f"{error:.2f} px" if error < 10 else f"{error:.0f} px"
