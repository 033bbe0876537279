"""The light field visualizer: rays on microlenses, all views, one slice, and a picture focused where you click.

A reader's own slope of a depth can draw the line in the slice, the curve, and a picture beside the right one.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from dataclasses import field as dataclass_field
from functools import cached_property
from typing import Any, ClassVar, Self

import numpy as np

from camviz.draw import plot, svg
from camviz.draw.flow import WIDTH, Cell, rows, shortened
from camviz.draw.panel import Panel, image_panel, placed_image
from camviz.draw.picture import Picture, jpeg, png
from camviz.draw.readout import listed, readout, signed
from camviz.draw.shades import heat_key, heat_map, heat_panel
from camviz.lenses.base import Array
from camviz.lightfields import refocus, to_microlens_image
from camviz.scenes import to_display
from camviz.views.base import answered, step_of, without
from camviz.views.depth_wedge import metres
from camviz.views.marks import on_photograph, ring
from camviz_school.views import garden_field, microlens_diagram
from camviz_school.views.refocused_field import RefocusedField

_WIDE = {
    "picture": 400, "yours": 400, "views": 400, "slice": 480, "rays": 480, "depth": 400, "sensor": 220, "numbers": 330
}  # fmt: skip
"""The panels in their order, and how wide each is in picture units."""
_IMAGES, _OTHERS = 332, 224  # the height of a row with pictures, and of one without
_STEEPEST = 40.0  # pixels a view: a shear beyond it leaves the picture


@dataclass(frozen=True)
class LightFieldView(RefocusedField):
    """A light field, drawn: the picture focused at a slope, all views, the slice, the rays, the sensor and the depths.

    `panels` names what is drawn: the picture, and any of yours, views, slice, rays, depth, sensor and numbers beside
    it. `yours` is a reader's function of (z, b, f, z_f), depths (...) to slopes (...); what it does is orange.
    """

    title: ClassVar[str] = "Light field"
    openable: ClassVar[Mapping[str, str]] = {
        "views": "views",
        "slice": "slice",
        "depth": "slope and depth",
        "rays": "rays",
        "sensor": "sensor",
        "numbers": "numbers",
    }

    panels: str = "picture views slice rays depth sensor numbers"
    yours: Callable[..., Any] | None = dataclass_field(default=None, compare=False, repr=False)

    def __post_init__(self) -> None:
        super().__post_init__()
        wanted = self.panels.split()
        if "picture" not in wanted or not set(wanted) <= {*_WIDE}:
            others = ", ".join(list(_WIDE)[1:])
            raise ValueError(f"panels must be picture and any of {others} beside it, got {self.panels!r}")

    def _told(self) -> dict[str, str]:
        """The figures that the panels speak of."""
        slopes, lens, pixels = "slice depth numbers", "rays numbers", "views sensor numbers"
        spoken = {"slope": slopes, "in": slopes, "α": lens, "a": lens, "sensor": pixels, "each": pixels}  # first words
        named = ((name, spoken.get(name.split()[0], "picture")) for name in self.numbers())
        told = {name for name, by in named if any(map(self._has, by.split()))}
        return {name: figure for name, figure in self.numbers().items() if name in told}

    @cached_property
    def _layout(self) -> dict[str, Cell]:
        """As many panels in a row as it has room for, in their order."""
        lines: list[dict[str, float]] = [{}]
        for name, width in _WIDE.items():
            if self._has(name) and sum(lines[-1].values()) + width > WIDTH:
                lines.append({})
            lines[-1] |= {name: width} if self._has(name) else {}
        cells = rows(*((_IMAGES if {"picture", "views"} & {*line} else _OTHERS, line) for line in lines))
        return shortened(cells, rays=_OTHERS, sensor=_OTHERS, numbers=_OTHERS)

    def _slot(self, name: str) -> tuple[float, float, float, float]:
        """Where the panel of a cell stands: left, top, width and height."""
        x, y, width, height = self._layout[name]
        return (
            (x + 60, y + 34, width - 70, height - 84) if name == "depth" else (x + 10, y + 34, width - 20, height - 44)
        )

    def description(self) -> str:
        figures = listed(self._told())
        shown = (
            "the slope of every pixel" if self.show == "slopes" else f"the picture for slope {signed(self.slope, 2)} px"
        )
        fence = " behind a fence" if self.fence and self.field is None else ""
        what = "A light field" if self.field else f"The garden{fence} as a light field"
        return (
            f"{what}; shown: {shown}, aperture {self.aperture}, view u = {self.u}, v = {self.v}; "
            f"mark at column {self.column}, row {self.row}. {figures}."
        )

    def figure(self, *, draft: bool = False) -> Picture:
        attached: dict[str, bytes] = {}
        parts = {"picture": self._picture_panel(attached)}
        if self._has("slice"):
            attached["slice"] = png(_bytes(self.light_field.views[self.v, :, self._slice_row]))
        if self._has("rays"):
            x, y, _, _ = self._slot("rays")
            given = (self.slope_here, self.slope, self.mask[self.v], self.u, self.opening)
            parts["rays"] = microlens_diagram.drawn(x + 10, y, *given)
        if self._has("views"):
            attached["views"] = garden_field.all_views(self.light_field)
        if self._has("sensor"):
            attached["sensor"] = png(self._under_the_microlenses())
        if self._has("yours"):
            parts["yours"] = self._your_panel(attached)
        plain = {
            "slice": self._slice_panel,
            "views": self._views_panel,
            "sensor": self._sensor_panel,
            "depth": self._depth_panel,
            "numbers": self._numbers,
        }
        parts |= {name: draw() for name, draw in plain.items() if self._has(name)}
        return self.tiled(self._layout, {name: parts[name] for name in self._layout}, attached)

    # The picture and its slice ---------------------------------------------------------------------------------------

    @cached_property
    def _image_panel(self) -> Panel:
        height, width = self.views.shape[2:4]
        x, y, across, tallest = self._slot("picture")
        key = 60 if self.show == "slopes" else 0  # the room it takes
        return image_panel("picture", x, y, across - key, width, height, tallest=tallest)

    def _picture_panel(self, attached: dict[str, bytes]) -> svg.Marks:
        panel, (height, width) = self._image_panel, self.views.shape[2:4]
        across = panel.place([(panel.left, self.row), (panel.right, self.row)])
        here = panel.place((self.column, self.row))
        marks = ring(here, "yellow", 7)
        if self._has("slice"):
            marks = on_photograph([across], "yellow thin") + marks + self._row_handle(across[0])
        label = "The picture; click or press the arrow keys to focus on what is there"
        heading: dict[str, Any] = {"hint": "click: focus there", "drag": "focus", "label": label}
        if self.show == "slopes":
            attached["picture"] = heat_map(self.slopes, *self.limits, "depth")
            attached["picture key"] = heat_key("depth")
            title = "Slope measured at every pixel"
            low, high = self.limits
            return heat_panel(panel, width, height, low, high, "px", marks, title=title, **heading)
        attached["picture"] = jpeg(self.image(), quality=90)
        title = "One view" if self.aperture == "pinhole" else self._focus
        return panel.show(placed_image(panel, "picture", width, height) + marks, title=title, **heading)

    @property
    def _focus(self) -> str:
        far = float(self.light_field.depth(self.slope))
        return f"Focused at {metres(far)}" if far > 0 else "Focused by the slope"

    def _row_handle(self, left_end: Array) -> svg.Marks:
        grip = svg.rectangle(left_end[0], left_end[1] - 9, 16, 18, "paper half") + svg.polygon(
            left_end + np.array([(2, 0), (13, -8), (13, 8)]), "fill-yellow"
        )
        label = "The slice's row; drag or press the arrow keys to move it"
        return svg.handle(grip, "row", label)

    @property
    def _slice_row(self) -> int:
        """Where the mark's row is in the views of row v: as far up as its slope takes it."""
        rows, height = self.views.shape[0], self.views.shape[2]
        return int(np.clip(round(self.row - self.slope_here * (self.v - (rows - 1) / 2)), 0, height - 1))

    def _slice_panel(self) -> svg.Marks:
        width, columns = self.views.shape[3], self.views.shape[1]
        x, y, across, height = self._slot("slice")
        panel = Panel("slice", x, y, across, height, -0.5, width - 0.5, -0.5, columns - 0.5)
        seen = svg.image("slice", 0, 0, panel.width, panel.height, image_rendering="pixelated")
        u = np.array([-0.5, columns - 0.5])
        steps = u - (columns - 1) / 2
        found, sheared = (
            panel.place(np.stack([self.column - slope * steps, u], axis=-1)) for slope in (self.slope_here, self.slope)
        )
        lines = on_photograph([found], "yellow") + on_photograph([sheared], "red dashed")
        if self.yours:
            own = panel.place(np.stack([self.column - self._your_slope * steps, u], axis=-1))
            lines += on_photograph([own], "orange thick dotted")
        chosen = panel.place([(-0.5, self.u), (2.5, self.u)])
        title = f"Slice: row {self._slice_row}, v = {self.v}"
        note = "line: mark; dashed: shear; dotted: yours" if self.yours else "line: the mark's; dashed: the shear"
        return panel.show(seen + lines + svg.line(chosen, "purple thick"), title=title, note=note)

    # The views -------------------------------------------------------------------------------------------------------

    @cached_property
    def _mosaic_panel(self) -> Panel:
        rows, columns, height, width = self.views.shape[:4]
        x, y, across, tallest = self._slot("views")
        return image_panel("views", x, y, across, columns * width, rows * height, tallest=tallest)

    def _views_panel(self) -> svg.Marks:
        panel = self._mosaic_panel
        rows, columns = self.views.shape[:2]
        cell = np.array([panel.width / columns, panel.height / rows])
        closed = [
            svg.rectangle(u * cell[0], v * cell[1], cell[0], cell[1], "fill-shade half")
            for v, u in np.argwhere(self.mask == 0)
        ]
        x, y = cell * (self.u, self.v)
        chosen = svg.line([(x, y), (x + cell[0], y), cell + (x, y), (x, y + cell[1]), (x, y)], "purple thick")
        seen = svg.image("views", 0, 0, panel.width, panel.height)
        label = "All views; click or press the arrow keys to choose one"
        dark = "" if self.mask.all() else "dark: not summed"
        return panel.show(seen + svg.join(closed) + chosen, title="All views", note=dark, drag="viewpoint", label=label)

    def _window(self) -> tuple[slice, slice]:
        """The rows and columns of microlenses drawn, around the mark."""
        height, width = self.views.shape[2:4]
        tall, wide = min(9, height), min(12, width)
        top, left = np.clip((self.row - tall // 2, self.column - wide // 2), 0, (height - tall, width - wide))
        return slice(top, top + tall), slice(left, left + wide)

    def _under_the_microlenses(self) -> np.ndarray:
        down, across = self._window()
        return to_microlens_image(_bytes(self.light_field.views[:, :, down, across]))

    def _sensor_panel(self) -> svg.Marks:
        down, across = self._window()
        x, y, width, _ = self._slot("sensor")
        edges = (across.start - 0.5, across.stop - 0.5, down.start - 0.5, down.stop - 0.5)
        panel = Panel("sensor", x, y, width, 0.75 * width, *edges)
        seen = svg.image("sensor", 0, 0, panel.width, panel.height, image_rendering="pixelated")
        upright = [[(x - 0.5, panel.top), (x - 0.5, panel.bottom)] for x in range(across.start, across.stop)]
        level = [[(panel.left, y - 0.5), (panel.right, y - 0.5)] for y in range(down.start, down.stop)]
        rims = svg.path([panel.place(line) for line in upright + level], "grid")
        x, y = self.column, self.row
        corners = [(x - 0.5, y - 0.5), (x + 0.5, y - 0.5), (x + 0.5, y + 0.5), (x - 0.5, y + 0.5), (x - 0.5, y - 0.5)]
        return panel.show(seen + rims + on_photograph([panel.place(corners)], "yellow"), title="Sensor at the mark")

    # Slope and depth -------------------------------------------------------------------------------------------------

    @cached_property
    def _plot(self) -> Panel:
        return plot.plot_panel("depth", *self._slot("depth"), self.limits, (1.0, 12.0))

    def _depth_panel(self) -> svg.Marks:
        panel, field = self._plot, self.light_field
        slopes = np.linspace(*self.limits, 139)
        within = lambda slope: (slope, np.clip(np.nan_to_num(field.depth(slope), nan=99), 1.3, 11.6))  # noqa: E731
        curve = plot.curve(panel, slopes, field.depth(slopes), "blue thick")
        if np.isnan(field.baseline * field.focal_length):
            curve = svg.text((panel.width / 2, 60), "baseline and focal length are not known", "note middle")
        here, now = panel.place([within(self.slope_here), within(self.slope)])
        marks = curve + self._your_curve(panel) + ring(here, "yellow", 8) + svg.dots([now], "red", 10)
        label = "Depth against slope; drag or press the arrow keys to change the slope"
        content = self._exact_range() + plot.grid(panel) + plot.upright(panel, self.slope, "red dashed") + marks
        named = plot.axes(panel, "slope d, pixels a view", "depth, m")
        return named + panel.show(content, title="Slope is depth", note=self.equation(), drag="slope", label=label)

    def _exact_range(self) -> svg.Marks:
        """The slopes at which no view is blurred by more than a pixel, where openings bound them."""
        panel, bound = self._plot, 1 / self.opening if self.opening else np.inf
        left, right = (float(np.clip(end, *self.limits)) for end in (-bound, bound))
        if (left, right) == self.limits:
            return svg.NOTHING
        x = panel.place([(left, panel.top), (right, panel.top)])[:, 0]
        words = svg.text((x.mean(), panel.height - 8), "exact: |d| ≤ 1 px", "note fill-ink middle")
        return svg.rectangle(x[0], 0, x[1] - x[0], panel.height, "wash fill-green") + words * (self.opening == 1)

    def _numbers(self) -> svg.Marks:
        x, y, _, _ = self._layout["numbers"]
        heading = svg.text((x + 10, y + 26), "This picture, and its light field", "title")
        return heading + readout(self._told(), (x + 10, y + 52), (0, 21), (145, 0))

    # The reader's own function ---------------------------------------------------------------------------------------

    @cached_property
    def _your_slopes(self) -> tuple[Array, Array, str]:
        """Depths (n,), at last where the picture is focused; the reader's slopes; what is wrong with them."""
        field = self.light_field
        depths = np.append(np.geomspace(1.3, 60, 80), field.depth(self.slope))
        given = (depths, field.baseline, field.focal_length, field.focus_distance)
        return (depths, *answered(self.yours, given, depths))

    @property
    def _your_slope(self) -> float:
        return float(self._your_slopes[1][-1])

    def _your_curve(self, panel: Panel) -> svg.Marks:
        if not self.yours:
            return svg.NOTHING
        depths, slopes, _ = self._your_slopes
        lines = [("blue thick", "right"), ("orange dashed", "yours")]
        drawn = np.stack([np.clip(slopes[:-1], -99, 99), depths[:-1]], axis=-1)
        return svg.line(panel.place(drawn), "orange thick dashed") + plot.legend(panel, lines, "top right")

    def _your_panel(self, attached: dict[str, bytes]) -> svg.Marks:
        """The picture once more, sheared by the slope that the reader's function gives for the same depth."""
        x, y, across, tallest = self._slot("yours")
        height, width = self.views.shape[2:4]
        panel = image_panel("yours", x, y, across, width, height, tallest=tallest)
        problem, slope = self._your_slopes[2], self._your_slope
        if not problem and not abs(slope) < _STEEPEST:
            steep = f"{signed(slope, 2)} px a view: so steep a shear leaves the picture."
            problem = f"Your slope for this depth is {steep if np.isfinite(slope) else 'not a finite number.'}"
        if problem:
            right = placed_image(panel, "picture", width, height)
            return without(panel, problem, "Focused by your slope", right=right)
        attached["yours"] = jpeg(to_display(refocus(self.light_field, slope, self.mask)), quality=90)
        note = f"sheared by {signed(slope, 2)} px"
        return panel.show(placed_image(panel, "yours", width, height), title="Focused by your slope", note=note)

    # Under the pointer -----------------------------------------------------------------------------------------------

    def dragged(self, handle: str, x: float, y: float, dx: float, dy: float) -> Self:
        if handle == "slope":
            return self.but(slope=float(np.clip(self.slope + dx / self._plot.scale[0], *self.limits)))
        if handle == "viewpoint":
            return self._with_view(x, y, dx, dy)
        panel = self._image_panel
        at = panel.place((self.column, self.row)) + (panel.x + dx, panel.y + dy) if np.isnan(x) else np.array([x, y])
        column, row = np.rint(panel.data(at - (panel.x, panel.y)))
        row = int(np.clip(row, 0, self.views.shape[2] - 1))
        if handle == "row":
            return self.but(row=row)
        moved = self.but(row=row, column=int(np.clip(column, 0, self.views.shape[3] - 1)))
        return moved.but(slope=float(np.clip(round(moved.slope_here, 2), *self.limits)))

    def _with_view(self, x: float, y: float, dx: float, dy: float) -> Self:
        panel, (rows, columns) = self._mosaic_panel, self.views.shape[:2]
        if np.isnan(x):
            u, v = self.u + np.sign(dx), self.v + np.sign(dy)
        else:
            u, v = (x - panel.x) / panel.width * columns, (y - panel.y) / panel.height * rows
        return self.but(u=int(np.clip(u, 0, columns - 1)), v=int(np.clip(v, 0, rows - 1)))

    def pressed(self, handle: str, key: str) -> Self:
        if handle == "slope":
            return self.dragged("slope", 0, 0, 5.5 * step_of(key), 0)
        return super().pressed(handle, key)


def _bytes(views: np.ndarray) -> np.ndarray:
    return np.ascontiguousarray(views) if views.dtype == np.uint8 else to_display(views)
