"""The vanishing-point visualizer: a photograph on a sheet of paper, lines along its edges, and where they meet.

A reader drags the lines' ends, and a reader's own function says where they meet.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from functools import cached_property
from typing import Any, ClassVar

import numpy as np

from camviz.cameras import Camera
from camviz.draw import svg
from camviz.draw.flow import Cell, rows, shortened
from camviz.draw.panel import Panel, placed_image
from camviz.draw.picture import Picture
from camviz.draw.readout import decimal, listed, readout
from camviz.lenses.base import Array
from camviz.views import marks
from camviz.views.base import View, slider, switch
from camviz.views.garden import DRAFT, FINE
from camviz.views.yours import is_unwritten, tried
from camviz_school.views.house import HEIGHT, WIDTH, camera, edges, photographed

Offsets = tuple[tuple[float, float], ...]
_PAPER = (-380.0, 1020.0, -130.0, 620.0)  # left, right, top and bottom of the paper, in pixels of the photograph
_WIDE = {"paper": 700, "above": 260, "numbers": 260}
_COLOURS = {"x": "blue", "z": "purple", "up": "green"}
FAR = 1e5
"""Pixels from the middle beyond which a meeting point counts as lying at infinity: 1/200 of a pixel over a line."""


@dataclass(frozen=True)
class VanishingView(View):
    """A house with two walls at a right angle, and a line along two edges of either wall (blue and purple).

    The lines are prolonged to where they meet. `moved` (four lines' ends, two each) says how far in pixels a reader has
    dragged them off the edges. `panels` names what is drawn: the paper, and any of above and numbers. `yours` is a
    reader's function of two points of one line and two of the other, (2,) each, to the point (2,) where they meet.
    """

    title: ClassVar[str] = "Vanishing points"
    openable: ClassVar[Mapping[str, str]] = {"above": "from above", "numbers": "numbers"}

    turn_deg: float = slider(0.0, -25.0, 42.0, 1.0, label="turn", unit="°", help="of the camera, to the right")
    tilt_deg: float = slider(0.0, -10.0, 14.0, 0.5, label="tilt", unit="°", help="of the camera, upwards")
    hfov_deg: float = slider(75.0, 45.0, 90.0, 1.0, label="field of view", unit="°", help="from left to right")
    aside: float = slider(0.0, -3.0, 2.0, 0.1, label="step aside", unit="m", help="of the camera, to the right")
    upright: bool = switch(False, label="upright lines", help="lines along two upright edges, too")
    moved: Offsets = ((0.0, 0.0),) * 8
    panels: str = " ".join(_WIDE)
    yours: Callable[..., Any] | None = field(default=None, compare=False, repr=False)

    def __post_init__(self) -> None:
        super().__post_init__()
        if "paper" not in (wanted := self.panels.split()) or not {*wanted} <= {*_WIDE}:
            raise ValueError(f"panels must be paper and any of {', '.join([*_WIDE][1:])}, got {self.panels!r}")
        if np.shape(self.moved) != (8, 2) or not np.isfinite(self.moved).all():
            raise ValueError("moved must be 8 pairs of finite numbers, one for each end of the four lines")

    # What is true -----------------------------------------------------------------------------------------------------

    @cached_property
    def camera(self) -> Camera:
        return camera(self.turn_deg, self.tilt_deg, self.hfov_deg, self.aside)

    @cached_property
    def lines(self) -> dict[str, Array]:
        """Two lines (2, 2, 2) in pixels by the direction of their edges, as far as the photograph shows them, and as
        the reader has moved them; NaN where it does not show them."""
        seen = {name: _shown(self.camera.project(both)) for name, both in edges().items()}
        offsets = np.array(self.moved).reshape(2, 2, 2, 2)
        seen["x"], seen["z"] = seen["x"] + offsets[0], seen["z"] + offsets[1]
        return seen if self.upright else {name: seen[name] for name in ("x", "z")}

    @cached_property
    def points(self) -> dict[str, Array]:
        """Where the lines meet, (3,) of unit length: (u, v, 1) in pixels from the principal point, up to scale."""
        return {name: _meeting(lines - self._centre) for name, lines in self.lines.items()}

    def pixel(self, name: str) -> Array:
        """Where the lines of a direction meet, (2,) in pixels; NaN where they do not."""
        x, y, w = self.points[name]
        return self._centre + (np.array([x, y]) / w if np.hypot(x, y) < FAR * abs(w) else np.full(2, np.nan))

    @property
    def focal(self) -> float:
        """The focal length in pixels by the two points of the walls; NaN where they give none."""
        product = -(self.pixel("x") - self._centre) @ (self.pixel("z") - self._centre)
        return float(np.sqrt(product)) if product > 0 else float("nan")

    @property
    def horizon(self) -> Array:
        """The line (3,) through both points, a u + b v + c = 0 from the principal point, with a² + b² = 1."""
        line = np.cross(self.points["x"], self.points["z"])
        size = np.hypot(*line[:2])
        return line / size * (1 if line[1] > 0 else -1) if size > 1e-9 else np.full(3, np.nan)

    @property
    def tilt(self) -> float:
        """How far the camera is tilted upwards, in degrees, by the horizon's distance below the middle."""
        return float(np.degrees(np.arctan2(-self.horizon[2], self.focal)))

    @property
    def _centre(self) -> Array:
        return np.array([self.camera.intrinsics.cx, self.camera.intrinsics.cy])

    def numbers(self) -> dict[str, str]:
        """The state's key figures, as text."""
        found = {f"{_COLOURS[name]} lines meet": _place(self.pixel(name)) for name in self.lines}
        f, tilt = self.focal, self.tilt
        if not np.isfinite(f):
            reason = "none: no right angle fits"
            if any(np.isnan(self.pixel(name)).any() for name in ("x", "z")):
                unseen = any(np.isnan(self.lines[name]).any() for name in ("x", "z"))
                reason = "none: a wall is not seen" if unseen else "none: a point is at infinity"
            return found | {"focal length": reason, "the camera's own": f"{self.camera.intrinsics.fx:.1f} px"}
        return found | {
            "focal length": f"{f:.1f} px",
            "the camera's own": f"{self.camera.intrinsics.fx:.1f} px",
            "tilt": f"{decimal(tilt, 1)}°",
        }

    def description(self) -> str:
        stand = f"turned {decimal(self.turn_deg, 0)}° and tilted {decimal(self.tilt_deg, 1)}°"
        return f"A house, its corner in front of a camera {stand}: {listed(self.numbers())}."

    # What it looks like -----------------------------------------------------------------------------------------------

    def figure(self, *, draft: bool = False) -> Picture:
        _, photograph = photographed(self.camera, DRAFT if draft else FINE)
        draw = {"paper": self._paper_panel, "above": self._above_panel, "numbers": self._numbers_column}
        parts = {name: draw[name](cell) for name, cell in self._layout.items()}
        return self.tiled(self._layout, parts, {"house": photograph})

    @cached_property
    def _layout(self) -> dict[str, Cell]:
        high = {"paper": 418 + 44 * bool(self.yours), "above": 300, "numbers": 286 if not self._has("above") else 126}
        first = {name: _WIDE[name] for name in ("paper", "above") if self._has(name)}
        if not self._has("numbers"):
            return shortened(rows((high["paper"], first)), **high)
        if len(first) == 1:
            return shortened(rows((high["paper"], first | {"numbers": 260})), **high)
        return shortened(rows((high["paper"], first), (high["numbers"], {"numbers": 600})), **high)

    @cached_property
    def _paper(self) -> Panel:
        left, right, top, bottom = _PAPER
        width = _WIDE["paper"] - 20
        return Panel("paper", 10, 34, width, width * (bottom - top) / (right - left), left, right, top, bottom)

    def _paper_panel(self, cell: Cell) -> str:
        panel = self._paper
        content = placed_image(panel, "house", WIDTH, HEIGHT)
        beyond, taken = self._beyond(panel)
        content += self._horizon_line(panel, taken) + "".join(self._prolonged(panel, name) for name in self.lines)
        yours, problem = self._your_points(panel)
        content += beyond + yours + "".join(self._handles(panel))
        shown = panel.show(content, title="The photograph on a sheet of paper", hint="drag the dots")
        words = "yours appears here, as orange rings" if is_unwritten(problem) else problem
        return shown + svg.paragraph((14, panel.y + panel.height + 22), words, panel.width - 10)

    def _horizon_line(self, panel: Panel, taken: str) -> str:
        a, b, c = self.horizon
        if not np.isfinite(a) or abs(b) < 0.05:
            return ""
        u = np.array([panel.left, panel.right])
        v = self._centre[1] - (c + a * (u - self._centre[0])) / b
        at = panel.place(np.stack([u, v], axis=-1))
        place, side = (at[0] + (8, 18), "") if "left" not in taken else (at[1] + (-8, 18), "end")
        words = svg.text(place, "horizon", f"label halo {side}") if 0 < place[1] < panel.height - 4 else ""
        return marks.on_photograph([at], "yellow dashed") + words

    def _prolonged(self, panel: Panel, name: str) -> str:
        """Both lines, thick on their edges, and thin from there to where they meet."""
        both, at, colour = self.lines[name], self.pixel(name), _COLOURS[name]
        if not np.isfinite(both).all():
            return ""
        middle, along = both.mean(axis=1), both[:, 1] - both[:, 0]
        far = np.where(np.isfinite(at), at - middle, along * 1e3)
        drawn = svg.segments(
            *np.moveaxis(marks.clipped(panel, panel.place(np.stack([middle, middle + far], axis=1))), 1, 0),
            f"{colour} thin",
        )
        return (
            drawn + marks.on_photograph(panel.place(both), f"{colour} thick") + svg.dots([panel.place(at)], colour, 12)
        )

    def _beyond(self, panel: Panel) -> tuple[str, str]:
        """At the paper's border, on which side a point lies beyond it, and "right" where the right side has words."""
        drawn, taken = "", ""
        for name in ("x", "z"):
            at, both = self.pixel(name), self.lines[name]
            if panel.left < at[0] < panel.right or np.isnan(both).any():
                continue
            right = (at[0] if np.isfinite(at[0]) else both[0, 1, 0] - self._centre[0]) > 0
            middle = both.mean(axis=(0, 1))
            tip = panel.place((panel.right if right else panel.left, np.nan_to_num(at[1], nan=middle[1])))
            tip[1] = np.clip(tip[1], 20, panel.height - 30)
            back = tip + np.array([[0, 0], [-14, -7], [-14, 7]]) * (1 if right else -1)
            words = "they meet farther on" if np.isfinite(at).all() else "the lines do not meet"
            drawn += svg.polygon(back, f"fill-{_COLOURS[name]}")
            drawn += svg.text(tip + (-8 if right else 8, -14), words, f"label halo {'end' if right else ''}")
            taken += "right" if right else "left"
        return drawn, taken

    def _handles(self, panel: Panel) -> list[str]:
        found = []
        for index, end in enumerate(np.concatenate([self.lines["x"], self.lines["z"]]).reshape(-1, 2)):
            if not np.isfinite(at := panel.place(end)).all():
                continue
            colour = "blue" if index < 4 else "purple"
            hand = svg.element("circle", cx=float(at[0]), cy=float(at[1]), r=13, fill_opacity=0, class_="card")
            words = f"End {index % 2 + 1} of {colour} line {index // 2 % 2 + 1}; arrow keys move it"
            handle = {"data_drag": f"end{index}", "tabindex": 0, "role": "group", "aria_label": words}
            dot = svg.dots([at], "paper-dot", 10) + svg.dots([at], colour, 7)
            found.append(svg.group(hand + dot, **handle))
        return found

    def _your_points(self, panel: Panel) -> tuple[str, str]:
        """Rings where the reader's function says that the lines meet, or the line that says why there are none."""
        if self.yours is None:
            return "", ""
        drawn, said = "", ""
        for name in ("x", "z"):
            ends = tuple(self.lines[name].reshape(-1, 2))
            answer, problem = tried(self.yours, ends, self.pixel(name))
            said = said or problem
            at = panel.place(answer)
            known = np.isfinite(at).all() and (np.abs(at) < 2000).all()
            drawn += marks.ring(at, "orange thick", 10) if known else ""
        return drawn, said

    def _above_panel(self, cell: Cell) -> str:
        """The plane of the eye and the horizon: the eye, the picture as a line, and the two directions."""
        x, y, width, high = cell
        panel = Panel("above", x + 10, y + 34, width - 20, high - 60, -700, 700, -80, 1120)
        f = self.focal
        a, b, c = self.horizon
        content = svg.line(panel.place([(-700, 0), (700, 0)]), "ink")
        if np.isfinite(f):
            deep, along = np.hypot(f, c), np.array([b, -a])
            eye = panel.place((0, deep))
            for name in ("x", "z"):
                at = panel.place((along @ (self.pixel(name) - self._centre), 0))
                content += svg.line([eye, at], _COLOURS[name]) + svg.dots([at], _COLOURS[name], 10)
            content += svg.line([eye, panel.place((0, 0))], "muted dashed") + svg.dots([eye], "ink", 10)
            content += svg.text(eye + (0, 20), "eye", "label halo middle")
            content += svg.text(eye + (0, 38), f"{deep:.0f} px before the picture", "label halo middle")
        note = "" if np.isfinite(f) else "no right angle here"
        shown = panel.show(content, title="From above", note=note)
        return shown + svg.text((x + 14, panel.y + panel.height + 17), "black: the picture; colours: the walls", "note")

    def _numbers_column(self, cell: Cell) -> str:
        """One below the other beside the paper, in two rows below it."""
        x, y, _, _ = cell
        figures = [*self.numbers().items()]
        parts = [(figures, (0, 40))] if x else [(figures[:3], (190, 0)), (figures[3:], (190, 0))]
        drawn = [readout(some, (x + 10, y + 54 + 42 * row), step, (0, 17)) for row, (some, step) in enumerate(parts)]
        return svg.text((x + 10, y + 26), "From these lines", "title") + "".join(drawn)

    # The hands -------------------------------------------------------------------------------------------------------

    def dragged(self, handle: str, x: float, y: float, dx: float, dy: float) -> VanishingView:
        """The end of a line follows the pointer."""
        if not handle.startswith("end"):
            return super().dragged(handle, x, y, dx, dy)
        index, step = int(handle[3:]), np.array([dx, dy]) / self._paper.scale
        moved = [*self.moved]
        moved[index] = tuple((np.array(moved[index]) + step).tolist())
        return self.but(moved=tuple(moved))

    def pressed(self, handle: str, key: str) -> VanishingView:
        """An arrow moves the end of a line by one pixel of the photograph."""
        steps = {"ArrowLeft": (-1, 0), "ArrowRight": (1, 0), "ArrowUp": (0, -1), "ArrowDown": (0, 1)}
        dx, dy = np.array(steps.get(key, (0, 0))) * self._paper.scale
        return self.dragged(handle, float("nan"), float("nan"), float(dx), float(dy))


def _meeting(lines: Array) -> Array:
    """Where two lines (2, 2, 2) through two points each meet, (3,) of unit length; its sign is that of w or of u."""
    first, second = (np.cross([*line[0], 1.0], [*line[1], 1.0]) for line in lines)
    both = np.cross(first / np.linalg.norm(first[:2]), second / np.linalg.norm(second[:2]))
    size = np.linalg.norm(both)
    return both / size if size > 0 else np.full(3, np.nan)


def _shown(both: Array) -> Array:
    """Two edges (2, 2, 2) as far as they lie in the photograph, a little off its border; NaN where one does not."""
    panel = Panel("", 0, 0, WIDTH - 17, HEIGHT - 17, 8, WIDTH - 9, 8, HEIGHT - 9)
    parts = [marks.clipped(panel, panel.place(edge[None])) for edge in both]
    seen = all(len(part) and np.linalg.norm(part[0, 1] - part[0, 0]) > 24 for part in parts)
    return panel.data(np.concatenate(parts)) if seen else np.full((2, 2, 2), np.nan)


def _place(at: Array) -> str:
    """A pixel in words."""
    return f"({decimal(at[0], 0)}, {decimal(at[1], 0)})" if np.isfinite(at).all() else "at infinity"
