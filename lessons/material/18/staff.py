"""The height visualizer: a staff on the lawn, the horizon, and a door of known height; a reader's function measures."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from functools import cached_property
from typing import Any, ClassVar

import numpy as np

from camviz.cameras import Camera
from camviz.draw import svg
from camviz.draw.flow import Cell, rows, shortened
from camviz.draw.panel import image_panel, placed_image
from camviz.draw.picture import Picture
from camviz.draw.readout import decimal, listed, readout
from camviz.lenses.base import Array
from camviz.views import marks
from camviz.views.base import View, slider
from camviz.views.yours import is_unwritten, tried
from camviz_school.views.house import DOOR, DOOR_EDGE, EYE, HEIGHT, WIDTH, camera, photographed

_X = 0.6  # of the staff, metres to the right of the camera
_PANEL = image_panel("picture", 20, 34, 380, WIDTH, HEIGHT)
_WIDE = {"picture": 430, "numbers": 240}


@dataclass(frozen=True)
class StaffView(View):
    """A staff of `staff_m` on level ground, `distance_m` in front of a camera that is `EYE` metres above the ground.

    `panels` names what is drawn: the picture, and perhaps numbers. `yours` is a reader's function that measures: of the
    rows (foot, top, horizon, door_foot, door_top, door_height), or, where `tilted`, of pixels (2,), a line and a point
    (3,): (foot, top, door_foot, door_top, door_height, horizon, vertical).
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
        if "picture" not in (wanted := self.panels.split()) or not {*wanted} <= {*_WIDE}:
            raise ValueError(f"panels must be picture and perhaps numbers, got {self.panels!r}")

    @cached_property
    def camera(self) -> Camera:
        return camera(24.0, self.tilt_deg, 66.0)  # so that door, lamps and staff are seen

    @cached_property
    def staff(self) -> Array:
        """Its foot and top (2, 2) in pixels."""
        return self._above([0.0, self.staff_m])

    @cached_property
    def door(self) -> Array:
        """Foot and top (2, 2) of the nearer side of the door, in pixels."""
        return self.camera.project(DOOR_EDGE)

    @cached_property
    def _directions(self) -> Array:
        """The points (3, 3) where lines along x, up and along z meet; w is 0 where these are parallel."""
        found = (self.camera.intrinsics.K @ self.camera.extrinsics[0]).T * [[1], [-1], [1]]
        return np.where(np.abs(found) < 1e-9, 0.0, found)

    @property
    def horizon_row(self) -> float:
        """The horizon's row, for this camera is not rolled."""
        return float(self._directions[2, 1] / self._directions[2, 2])

    def _above(self, metres: Any) -> Array:
        """Pixels (n, 2) of places so many metres above the staff's foot."""
        return self.camera.project([(_X, EYE - one, self.distance_m) for one in metres])

    def numbers(self) -> dict[str, str]:
        """The state's key figures, as text."""
        found = {"foot of the staff": self.staff[0, 1], "top of the staff": self.staff[1, 1]}
        found |= {"horizon": self.horizon_row, "foot of the door": self.door[0, 1], "top of the door": self.door[1, 1]}
        figures = {name: f"row {decimal(row, 1)}" for name, row in found.items()}
        return figures | ({"the staff, by yours": self._words or "–"} if self.yours else {})

    @cached_property
    def _answer(self) -> tuple[float, str]:
        """What the reader's function says, and what is wrong with it."""
        assert self.yours
        given = (*self.staff[:, 1], self.horizon_row, *self.door[:, 1], DOOR)
        if self.tilted:
            x, vertical, z = self._directions
            given = (*self.staff, *self.door, DOOR, np.cross(x, z), vertical)
        answer, problem = tried(self.yours, given, self.staff_m)
        return float(answer), problem

    @property
    def _words(self) -> str:
        return f"{decimal(self._answer[0], 2)} m" if self.yours and np.isfinite(self._answer[0]) else ""

    def description(self) -> str:
        stand = f"{self.distance_m:g} m away, in a picture tilted {decimal(self.tilt_deg, 1)}°"
        return f"A staff of {self.staff_m:g} m, {stand}: {listed(self.numbers())}."

    def figure(self, *, draft: bool = False) -> Picture:
        draw = {"picture": self._picture_panel, "numbers": self._numbers_column}
        parts = {name: draw[name](cell) for name, cell in self._layout.items()}
        return self.tiled(self._layout, parts, {"house": photographed(self.camera, draft)})

    @cached_property
    def _layout(self) -> dict[str, Cell]:
        high = {"picture": 329 + 30 * bool(self.yours), "numbers": 70 + 40 * len(self.numbers())}
        return shortened(rows((high["picture"], {name: w for name, w in _WIDE.items() if self._has(name)})), **high)

    def _picture_panel(self, cell: Cell) -> svg.Marks:
        line = _PANEL.place([(_PANEL.left, self.horizon_row), (_PANEL.right, self.horizon_row)])
        content = placed_image(_PANEL, "house", WIDTH, HEIGHT) + marks.on_photograph([line], "yellow dashed")
        content += svg.text(line[0] + (8, -8), "horizon", "label halo") + _measured(self.door, "green", f"{DOOR:g} m")
        content += _measured(self.staff, "purple", self._words and f"yours: {self._words}", "orange")
        at, half = _PANEL.place(self._above(np.arange(0.5, self.staff_m + 0.01, 0.5))), np.array([5.0, 0.0])
        content += svg.join(svg.segments(at - half, at + half, class_) for class_ in ("paper-line", "ink"))
        problem = self._answer[1] if self.yours else ""
        said = "yours appears here, beside the staff" if is_unwritten(problem) else problem
        shown = _PANEL.show(content, title=f"A staff of {self.staff_m:g} m, {self.distance_m:g} m away")
        return shown + svg.paragraph((_PANEL.x, _PANEL.y + _PANEL.height + 20), said, _PANEL.width)

    def _numbers_column(self, cell: Cell) -> svg.Marks:
        column = readout(self.numbers(), (cell[0] + 10, 54), (0, 40), (0, 17))
        return svg.text((cell[0] + 10, 26), "Measured in the picture", "title") + column


def _measured(ends: Array, colour: str, words: str, class_: str = "label") -> svg.Marks:
    """A line from foot to top (2, 2) in pixels with a dot at either end, and words on its right."""
    at = _PANEL.place(ends)
    aside, side = (-10, "end") if class_ == "orange" else (10, "")  # on the left where the picture soon ends
    place = np.clip(at.mean(axis=0) + (aside, 26), 16, (_PANEL.width - 60, _PANEL.height - 10))
    name = svg.text(place, words, f"{class_} halo {side}")
    return marks.on_photograph([at], f"{colour} thick") + svg.dots(at, colour, 9) + name
