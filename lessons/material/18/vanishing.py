"""The vanishing-point visualizer: a photograph on a sheet of paper, lines along its edges, and where they meet.

A reader drags the lines' ends, and a reader's own function says where they meet.
"""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from functools import cached_property
from typing import Any, ClassVar

import numpy as np

from camviz.cameras import Camera
from camviz.draw import svg
from camviz.draw.flow import Cell
from camviz.draw.panel import Panel, placed_image
from camviz.draw.picture import Picture
from camviz.draw.readout import decimal, listed, readout
from camviz.lenses.base import Array
from camviz.views import marks
from camviz.views.base import View, slider, switch
from camviz.views.yours import is_unwritten, tried
from camviz_school.views.house import HEIGHT, WIDTH, camera, edges, photographed

PAPER = Panel("paper", 10, 34, 600, 258, -380, 1020, -61, 541)
"""The paper, in pixels of the photograph."""
FAR = 1e5
"""Pixels from the middle beyond which a point counts as lying at infinity: two lines then part by 1/200 of a pixel."""
_PANELS = "paper", "above", "numbers"
_COLOURS = {"x": "blue", "z": "purple", "up": "green"}


@dataclass(frozen=True)
class VanishingView(View):
    """A house with two walls at a right angle, and a line along two edges of either wall (blue and purple).

    The lines are prolonged to where they meet. `moved` says how far in pixels a reader has dragged each end of the four
    lines off its edge. `panels` names what is drawn: the paper, and any of above and numbers. `yours` is a reader's
    function of two points of one line and two of the other, (2,) each, to the point (2,) where they meet.
    """

    title: ClassVar[str] = "Vanishing points"
    openable: ClassVar[Mapping[str, str]] = {"above": "from above", "numbers": "numbers"}
    arrow: ClassVar[float] = float(PAPER.scale[0])  # a pixel of the photograph

    turn_deg: float = slider(0.0, -25.0, 42.0, 1.0, label="turn", unit="°", help="of the camera, to the right")
    tilt_deg: float = slider(0.0, -10.0, 14.0, 0.5, label="tilt", unit="°", help="of the camera, upwards")
    hfov_deg: float = slider(75.0, 45.0, 90.0, 1.0, label="field of view", unit="°", help="from left to right")
    aside: float = slider(0.0, -3.0, 2.0, 0.1, label="step aside", unit="m", help="of the camera, to the right")
    upright: bool = switch(False, label="upright lines", help="lines along two upright edges, too")
    moved: tuple[tuple[float, float], ...] = ((0.0, 0.0),) * 8
    panels: str = " ".join(_PANELS)
    yours: Callable[..., Any] | None = field(default=None, compare=False, repr=False)

    def __post_init__(self) -> None:
        super().__post_init__()
        if "paper" not in (wanted := self.panels.split()) or not {*wanted} <= {*_PANELS}:
            raise ValueError(f"panels must be paper and any of {', '.join(_PANELS[1:])}, got {self.panels!r}")
        if np.shape(self.moved) != (8, 2) or not np.isfinite(self.moved).all():
            raise ValueError("moved must be 8 pairs of finite numbers, one for each end of the four lines")

    @cached_property
    def camera(self) -> Camera:
        return camera(self.turn_deg, self.tilt_deg, self.hfov_deg, self.aside)

    @cached_property
    def lines(self) -> dict[str, Array]:
        """Two lines (2, 2, 2) in pixels by the direction of their edges, as far as the photograph shows these, and as
        the reader has moved them; NaN where it does not show them."""
        shown = [name for name in _COLOURS if name != "up" or self.upright]
        seen = {name: _shown(self.camera.project(edges()[name])) for name in shown}
        moved = np.array(self.moved).reshape(2, 2, 2, 2)
        return seen | {"x": seen["x"] + moved[0], "z": seen["z"] + moved[1]}

    @cached_property
    def pixels(self) -> dict[str, Array]:
        """Where the lines of each direction meet, (2,) in pixels; NaN where they do not."""
        return {name: _meeting(both - self._centre) + self._centre for name, both in self.lines.items()}

    @property
    def focal(self) -> float:
        """The focal length in pixels by the two points of the walls; NaN where they give none."""
        product = -(self.pixels["x"] - self._centre) @ (self.pixels["z"] - self._centre)
        return float(np.sqrt(product)) if product > 0 else np.nan

    @property
    def horizon(self) -> tuple[float, float]:
        """Its row in the middle column, and its slope: through both points, or through the one that is not at infinity
        along the other's parallel lines; NaN where a wall is not seen."""
        a, b, c = np.cross(self._direction("x"), self._direction("z"))
        return (-(a * self._centre[0] + c) / b, -a / b) if b else (np.nan, np.nan)

    def _direction(self, name: str) -> Array:
        """Where both lines meet, in homogeneous coordinates (3,): the third is 0 where they are parallel."""
        at, line = self.pixels[name], self.lines[name][0]
        return np.append(at, 1.0) if np.isfinite(at).all() else np.append(line[1] - line[0], 0.0)

    @property
    def below(self) -> float:
        """How far in pixels the horizon is from the middle of the picture; positive below it."""
        row, slope = self.horizon
        return float((row - self._centre[1]) / np.hypot(1, slope))

    @property
    def tilt(self) -> float:
        """How far the camera is tilted upwards, in degrees, by the horizon's distance below the middle."""
        return float(np.degrees(np.arctan2(self.below, self.focal)))

    @property
    def _centre(self) -> Array:
        return np.array([self.camera.intrinsics.cx, self.camera.intrinsics.cy])

    def numbers(self) -> dict[str, str]:
        """The state's key figures, as text."""
        places = {n: f"({decimal(u, 0)}, {decimal(v, 0)})" for n, (u, v) in self.pixels.items() if np.isfinite(u)}
        seen = {name: np.isfinite(both).all() for name, both in self.lines.items()}
        found = {
            f"{_COLOURS[name]} lines meet": places.get(name, "at infinity" if seen[name] else "not in the picture")
            for name in seen
        }
        own = {"the camera's own": f"{self.camera.intrinsics.fx:.1f} px"}
        if np.isfinite(self.focal):
            return found | {"focal length": f"{self.focal:.1f} px"} | own | {"tilt": f"{decimal(self.tilt, 1)}°"}
        reason = "no right angle fits"
        if any(np.isnan(self.pixels[name]).any() for name in "xz"):
            reason = "a point is at infinity" if seen["x"] and seen["z"] else "a wall is not seen"
        return found | {"focal length": f"none: {reason}"} | own

    def description(self) -> str:
        stand = f"turned {decimal(self.turn_deg, 0)}° and tilted {decimal(self.tilt_deg, 1)}°"
        return f"A house, its corner in front of a camera {stand}: {listed(self.numbers())}."

    def figure(self, *, draft: bool = False) -> Picture:
        draw = {"paper": self._paper_panel, "above": self._above_panel, "numbers": self._numbers_column}
        parts = {name: draw[name](cell) for name, cell in self._layout.items()}
        return self.tiled(self._layout, parts, {"house": photographed(self.camera, draft)})

    @cached_property
    def _layout(self) -> dict[str, Cell]:
        """The paper, and on its right whatever else is drawn, one below the other."""
        high = {"paper": 310 + 30 * bool(self.yours), "above": 300, "numbers": 286}
        found, top = {"paper": (0.0, 0.0, 620.0, float(high["paper"]))}, 0.0
        for name in filter(self._has, ("above", "numbers")):
            found[name] = 640.0, top, 260.0, float(high[name])
            top += high[name]
        return found

    def _paper_panel(self, cell: Cell) -> svg.Marks:
        beyond, right = self._beyond()
        content = placed_image(PAPER, "house", WIDTH, HEIGHT) + self._horizon_line(right)
        yours, problem = self._your_points()
        content += svg.join(map(self._prolonged, self.lines)) + beyond + yours + svg.join(map(self._handle, range(8)))
        words = "yours appears here, as orange rings" if is_unwritten(problem) else problem
        shown = PAPER.show(content, title="The photograph on a sheet of paper", hint="drag the small dots")
        return shown + svg.paragraph((14, PAPER.y + PAPER.height + 20), words, PAPER.width - 10)

    def _horizon_line(self, right: bool) -> svg.Marks:
        row, slope = self.horizon
        u = np.array([PAPER.left, PAPER.right])
        at = PAPER.place(np.stack([u, row + slope * (u - self._centre[0])], axis=-1))
        place, side = (at[1] + (-8, 18), "end") if right else (at[0] + (8, 18), "")
        words = svg.text(place, "horizon", f"label halo {side}") if 0 < place[1] < PAPER.height - 4 else svg.NOTHING
        return marks.on_photograph([at], "yellow dashed") + words

    def _prolonged(self, name: str) -> svg.Marks:
        """Both lines, thick on their edges, and thin from there to where they meet."""
        both, at, colour = self.lines[name], self.pixels[name], _COLOURS[name]
        middle = both.mean(axis=1)
        far = np.where(np.isfinite(at), at, middle + 1e3 * (both[:, 1] - both[:, 0]))
        thin = marks.clipped(PAPER, PAPER.place(np.stack([middle, far], axis=1)))
        thick = marks.on_photograph(PAPER.place(both), f"{colour} thick") if np.isfinite(both).all() else svg.NOTHING
        return svg.segments(thin[:, 0], thin[:, 1], f"{colour} thin") + thick + svg.dots([PAPER.place(at)], colour, 12)

    def _beyond(self) -> tuple[svg.Marks, bool]:
        """At the paper's border, on which side a point lies beyond it, and whether the words are on the left alone."""
        drawn, lefts = svg.NOTHING, []
        for name in "xz":
            at, both = self.pixels[name], self.lines[name]
            if PAPER.left < at[0] < PAPER.right or np.isnan(both).any():
                continue
            side = 1 if (at[0] if np.isfinite(at[0]) else both[0, 1, 0]) > self._centre[0] else -1
            row = at[1] if np.isfinite(at[1]) else both[..., 1].mean()
            tip = PAPER.place((PAPER.right if side > 0 else PAPER.left, row))
            tip[1] = np.clip(tip[1], 34, PAPER.height - 30)
            words = "they meet farther on" if np.isfinite(at).all() else "the lines do not meet"
            drawn += svg.polygon(tip + np.array([(0, 0), (-14, -7), (-14, 7)]) * side, f"fill-{_COLOURS[name]}")
            drawn += svg.text(tip - (8 * side, 14), words, f"label halo {'end' if side > 0 else ''}")
            lefts.append(side < 0)
        return drawn, any(lefts)

    @cached_property
    def _grips(self) -> dict[str, Array]:
        """Pixels near the ends of the lines: where two lines end in one corner, a hand must tell them apart."""
        grips = {}
        for name, both in self.lines.items():
            inwards = both[:, ::-1] - both
            grips[name] = both + inwards * 30 / np.maximum(np.linalg.norm(inwards, axis=-1, keepdims=True), 240)
        return grips

    def _handle(self, index: int) -> svg.Marks:
        name, colour = ("x", "blue") if index < 4 else ("z", "purple")
        at = PAPER.place(self._grips[name].reshape(4, 2)[index % 4])
        if not np.isfinite(at).all():
            return svg.NOTHING
        hand = svg.circle(at, 13, "card", fill_opacity=0)
        words = f"End {index % 2 + 1} of {colour} line {index // 2 % 2 + 1}; arrow keys move it by a pixel"
        dot = svg.dots([at], "paper-dot", 10) + svg.dots([at], colour, 7)
        return svg.handle(hand + dot, f"end{index}", words)

    def _your_points(self) -> tuple[svg.Marks, str]:
        """Rings where the reader's function says that the lines meet, and the line that says why there are none."""
        drawn, said = svg.NOTHING, ""
        for name in "xz":
            if not self.yours:
                continue
            answer, problem = tried(self.yours, tuple(self.lines[name].reshape(4, 2)), self.pixels[name])
            at, said = PAPER.place(answer), said or problem
            drawn += marks.ring(at, "orange thick", 10) if (np.abs(at) < 2000).all() else svg.NOTHING
        return drawn, said

    def _above_panel(self, cell: Cell) -> svg.Marks:
        """The plane of the eye and the horizon: the eye, the picture as a line, and the two directions."""
        x, y, width, high = cell
        panel = Panel("above", x + 10, y + 34, width - 20, high - 60, -700, 700, -80, 1120)
        content = svg.line(panel.place([(-700, 0), (700, 0)]), "ink")
        if np.isfinite(f := self.focal):
            deep, slope = np.hypot(f, self.below), self.horizon[1]
            foot = self._centre + self.below * np.array([-slope, 1]) / np.hypot(1, slope)  # nearest to the middle
            eye = panel.place((0, deep))
            for name in "xz":
                away = self.pixels[name] - foot
                at = panel.place((np.copysign(np.hypot(*away), away[0]), 0))
                content += svg.line([eye, at], _COLOURS[name]) + svg.dots([at], _COLOURS[name], 10)
            content += svg.line([eye, panel.place((0, 0))], "muted dashed") + svg.dots([eye], "ink", 10)
            content += svg.text(eye + (0, 20), "eye", "label halo middle")
            content += svg.text(eye + (0, 38), f"{deep:.0f} px before the picture", "label halo middle")
        else:
            content += svg.text(panel.place((0, 500)), "f is not known here", "label middle")
        shown = panel.show(content, title="From above")
        return shown + svg.text((x + 14, panel.y + panel.height + 17), "across: picture; colours: walls", "note")

    def _numbers_column(self, cell: Cell) -> svg.Marks:
        x, y, _, _ = cell
        column = readout(self.numbers(), (x + 10, y + 54), (0, 40), (0, 17))
        return svg.text((x + 10, y + 26), "From these lines", "title") + column

    def dragged(self, handle: str, x: float, y: float, dx: float, dy: float) -> "VanishingView":
        """The end of a line follows the pointer."""
        if not handle.startswith("end"):
            return super().dragged(handle, x, y, dx, dy)
        moved, index = np.array(self.moved), int(handle[3:])
        moved[index] += (dx, dy) / PAPER.scale
        return self.but(moved=tuple(map(tuple, moved.tolist())))


def _meeting(lines: Array) -> Array:
    """Where two lines (2, 2, 2) through two points each meet, (2,), from the middle; NaN if farther away than FAR."""
    first, second = (np.cross([*line[0], 1.0], [*line[1], 1.0]) for line in lines)
    x, y, w = np.cross(first / np.linalg.norm(first[:2]), second / np.linalg.norm(second[:2]))
    return np.array([x, y]) / w if np.hypot(x, y) < FAR * abs(w) else np.full(2, np.nan)


def _shown(both: Array) -> Array:
    """Two edges (2, 2, 2) as far as they lie in the photograph, a little off its border; NaN where one does not."""
    panel = Panel("", 0, 0, WIDTH - 17, HEIGHT - 17, 8, WIDTH - 9, 8, HEIGHT - 9)
    parts = [marks.clipped(panel, panel.place(edge[None])) for edge in both]
    seen = all(len(part) and np.linalg.norm(part[0, 1] - part[0, 0]) > 24 for part in parts)
    return panel.data(np.concatenate(parts)) if seen else np.full((2, 2, 2), np.nan)
