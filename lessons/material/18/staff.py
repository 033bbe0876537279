"""The height visualizer: a staff on the lawn, the horizon, and what one known height tells of another.

A reader's own function measures the staff.
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
from camviz.draw.panel import Panel, image_panel, placed_image
from camviz.draw.picture import Picture
from camviz.draw.readout import decimal, listed, readout
from camviz.lenses.base import Array
from camviz.views import marks
from camviz.views.base import View, positive, slider
from camviz.views.garden import DRAFT, FINE
from camviz.views.yours import is_unwritten, tried
from camviz_school.views.house import DOOR, DOOR_EDGE, EYE, HEIGHT, WIDTH, camera, photographed

TURN_DEG, HFOV_DEG = 24.0, 66.0  # so that door, lamps and staff are seen
X = 0.6  # of the staff, metres to the right of the camera
_WIDE = {"picture": 620, "numbers": 240}


@dataclass(frozen=True)
class StaffView(View):
    """A staff of `staff_m` on level ground, `distance_m` in front of a camera that is `EYE` metres above the ground.

    Its length is measured by the door, which is `DOOR` metres tall. `panels` names what is drawn: the picture, and
    numbers. `yours` is a reader's function that measures the staff: of rows (foot, top, horizon, door_foot, door_top,
    door_height), or, where `tilted`, of pixels (2,), a line and a point (3,): (foot, top, door_foot, door_top,
    door_height, horizon, vertical).
    """

    title: ClassVar[str] = "Heights"
    openable: ClassVar[Mapping[str, str]] = {"numbers": "numbers"}

    distance_m: float = slider(6.0, 5.0, 40.0, 0.5, label="distance", unit="m", help="of the staff")
    staff_m: float = slider(1.6, 0.5, 3.0, 0.1, label="staff", unit="m", help="its height")
    tilt_deg: float = slider(0.0, -6.0, 6.0, 0.5, label="tilt", unit="°", help="of the camera, upwards")
    tilted: bool = False
    panels: str = " ".join(_WIDE)
    yours: Callable[..., Any] | None = field(default=None, compare=False, repr=False)

    def __post_init__(self) -> None:
        super().__post_init__()
        positive(self, "distance_m", "staff_m")
        if "picture" not in (wanted := self.panels.split()) or not {*wanted} <= {*_WIDE}:
            raise ValueError(f"panels must be picture and perhaps numbers, got {self.panels!r}")

    # What is true -----------------------------------------------------------------------------------------------------

    @cached_property
    def camera(self) -> Camera:
        return camera(TURN_DEG, self.tilt_deg, HFOV_DEG)

    @cached_property
    def staff(self) -> Array:
        """Its foot and top (2, 2) in pixels."""
        return self._seen([0.0, self.staff_m])

    @cached_property
    def door(self) -> Array:
        """Foot and top (2, 2) of the nearer side of the door, in pixels."""
        return self.camera.project(DOOR_EDGE)

    @cached_property
    def horizon(self) -> Array:
        """The line (3,) of all points of the picture that are as high as the camera: level directions."""
        first, second = (self._image(direction) for direction in ((1.0, 0, 0), (0, 0, 1.0)))
        return np.cross(first, second)

    @cached_property
    def vertical(self) -> Array:
        """The point (3,) where upright lines meet; its last number is 0 for a level camera."""
        return self._image((0, -1.0, 0))

    def _image(self, direction: tuple[float, float, float]) -> Array:
        R, _ = self.camera.extrinsics
        return np.where(np.abs(found := self.camera.intrinsics.K @ R @ direction) < 1e-9, 0.0, found)

    def _seen(self, above: list[float]) -> Array:
        """Pixels (n, 2) of places so many metres above the staff's foot."""
        y = EYE - np.asarray(above)
        return self.camera.project(np.stack([np.full_like(y, X), y, np.full_like(y, self.distance_m)], axis=-1))

    @property
    def horizon_row(self) -> float:
        """The horizon's row in the middle of the picture."""
        a, b, c = self.horizon
        return float(-(a * self.camera.intrinsics.cx + c) / b)

    def numbers(self) -> dict[str, str]:
        """The state's key figures, as text."""
        (_, foot), (_, top) = self.staff
        (_, low), (_, high) = self.door
        figures = {
            "foot of the staff": f"row {decimal(foot, 1)}",
            "top of the staff": f"row {decimal(top, 1)}",
            "horizon": f"row {self.horizon_row:.1f}",
            "door's edge": f"rows {low:.1f} to {high:.1f}, {DOOR:g} m",
        }
        if self.yours is None:
            return figures
        answer, _ = self._answer
        return figures | {"the staff, by yours": f"{decimal(answer, 2)} m" if np.isfinite(answer) else "–"}

    @cached_property
    def _answer(self) -> tuple[float, str]:
        """What the reader's function says, and what is wrong with it."""
        (foot, top), (low, high) = self.staff, self.door
        given = (foot[1], top[1], self.horizon_row, low[1], high[1], DOOR)
        if self.tilted:
            given = (foot, top, low, high, DOOR, self.horizon, self.vertical)
        assert self.yours
        answer, problem = tried(self.yours, given, self.staff_m)
        return float(answer), problem

    def description(self) -> str:
        stand = f"{self.distance_m:g} m away, in a picture tilted {decimal(self.tilt_deg, 1)}°"
        return f"A staff of {self.staff_m:g} m, {stand}: {listed(self.numbers())}."

    # What it looks like -----------------------------------------------------------------------------------------------

    def figure(self, *, draft: bool = False) -> Picture:
        _, photograph = photographed(self.camera, DRAFT if draft else FINE)
        draw = {"picture": self._picture_panel, "numbers": self._numbers_column}
        parts = {name: draw[name](cell) for name, cell in self._layout.items()}
        return self.tiled(self._layout, parts, {"house": photograph})

    @cached_property
    def _layout(self) -> dict[str, Cell]:
        high = {"picture": 438 + 40 * bool(self.yours), "numbers": 70 + 40 * len(self.numbers())}
        return shortened(rows((high["picture"], {name: w for name, w in _WIDE.items() if self._has(name)})), **high)

    def _picture_panel(self, cell: Cell) -> str:
        panel = image_panel("picture", 45, 34, 530, WIDTH, HEIGHT)
        a, b, c = self.horizon
        u = np.array([panel.left, panel.right])
        line = panel.place(np.stack([u, -(a * u + c) / b], axis=-1))
        content = placed_image(panel, "house", WIDTH, HEIGHT) + marks.on_photograph([line], "yellow dashed")
        content += svg.text(line[0] + (8, -8), "horizon", "label halo")
        content += self._measured(panel, self.door, "green", f"{DOOR:g} m")
        words, problem = "", ""
        if self.yours:
            answer, problem = self._answer
            words = f"yours: {decimal(answer, 2)} m" if np.isfinite(answer) else ""
        content += self._measured(panel, self.staff, "orange", words) + self._half_metres(panel)
        said = "yours appears here, beside the staff" if is_unwritten(problem) else problem
        shown = panel.show(content, title=f"A staff of {self.staff_m:g} m, {self.distance_m:g} m away")
        return shown + svg.paragraph((49, panel.y + panel.height + 22), said, panel.width - 10)

    def _measured(self, panel: Panel, ends: Array, colour: str, words: str) -> str:
        """A line from foot to top with a dot at either end, and words on its right."""
        at = panel.place(ends)
        name = svg.text(np.clip(at.mean(axis=0) + (10, 26), 16, panel.height - 10), words, "label halo")
        return marks.on_photograph([at], f"{colour} thick") + svg.dots(at, colour, 9) + name

    def _half_metres(self, panel: Panel) -> str:
        """Marks across the staff, one for each half metre."""
        at = panel.place(self._seen(np.arange(0.5, self.staff_m + 0.01, 0.5).tolist()))
        half = np.array([5.0, 0.0])
        return svg.segments(at - half, at + half, "paper-line") + svg.segments(at - half, at + half, "ink")

    def _numbers_column(self, cell: Cell) -> str:
        column = readout(self.numbers(), (cell[0] + 10, 54), (0, 40), (0, 17))
        return svg.text((cell[0] + 10, 26), "Measured in the picture", "title") + column
