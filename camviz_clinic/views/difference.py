"""Where two calibrations of one camera disagree, and which motion they disagree about besides."""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import cached_property, lru_cache
from typing import Any, ClassVar

import numpy as np

from camviz.cameras import Camera
from camviz.draw import svg
from camviz.draw.flow import rows
from camviz.draw.marks import Marks
from camviz.draw.panel import Panel, image_panel
from camviz.draw.picture import Picture
from camviz.draw.readout import readout
from camviz.draw.shades import Shades, bar, contours, heat
from camviz.views.base import View, choice, slider
from camviz.views.marks import arrows
from camviz_clinic.calibration.difference import Difference, difference
from camviz_clinic.views.observations import Missing
from camviz_clinic.views.residuals import nice
from camviz_clinic.views.uncertainty import DISTANCES, place_of

LARGE_TURN_DEG, LARGE_SHIFT = 0.5, 0.02  # degrees, and metres per metre of distance
_LAYOUT = rows((470, {"difference": 680, "numbers": 280}))


@dataclass(frozen=True)
class DifferenceView(View):
    """How far apart, in pixels, two calibrations of a camera put the same points, the implied motion taken out.

    The motion is the one after which the two agree best; where it is large, the intrinsics of one of them make up for
    its poses, and the two must not be exchanged for one another.
    """

    title: ClassVar[str] = "The difference of two calibrations"

    first: Camera = field(repr=False)
    second: Camera = field(repr=False)
    names: tuple[str, str] = ("the first", "the second")
    distance: str = choice(*DISTANCES, help="how far away the points are that are compared")
    scale: float = slider(
        10.0, 1, 500, 1, label="arrows", unit="×", help="how much longer the arrows are than the difference"
    )

    @classmethod
    def of(cls, calibration: Any, other: Any, camera: str = "") -> DifferenceView:
        """The camera of one calibration against that of another. Raises Missing where they have none alike."""
        name = camera or next(iter(calibration.cameras))
        if other is None:
            raise Missing("There is no second calibration to compare this one with: name one with --compare.")
        if name not in other.cameras and len(other.cameras) != len(calibration.cameras):
            raise Missing(f"The other calibration has no camera {name}: it has {', '.join(other.cameras)}.")
        place = list(calibration.cameras).index(name)
        second = other.cameras.get(name, list(other.cameras.values())[place])
        return cls.about(calibration.cameras[name], second, (calibration.source.name, other.source.name))

    @classmethod
    def about(
        cls, first: Camera, second: Camera, names: tuple[str, str] = ("the first", "the second")
    ) -> DifferenceView:
        """The view with arrows that can be seen. Raises Missing where the two cannot be compared."""
        try:
            shift = np.linalg.norm(_difference(first, second, "infinity", 15, 10).shift, axis=-1)
        except ValueError as error:
            raise Missing(f"The two calibrations cannot be compared: {error}.") from error
        typical = float(np.nanquantile(shift, 0.8)) if np.isfinite(shift).any() else 0.0
        per_pixel = 500 / first.intrinsics.width
        scale = float(np.clip(nice(26 / (typical * per_pixel)), 1, 500)) if typical > 1e-9 else 1.0
        return cls(first, second, names, scale=scale)

    def compared(self, columns: int = 45, rows: int = 30) -> Difference:
        """The difference on a grid of pixels."""
        return _difference(self.first, self.second, self.distance, columns, rows)

    @cached_property
    def _numbers(self) -> dict[str, float]:
        found = self.compared(15, 10)
        length = found.length
        known = np.isfinite(length).any()
        motion = found.second_from_first
        return {
            "median": float(np.nanmedian(length)) if known else np.nan,
            "worst": float(np.nanmax(length)) if known else np.nan,
            "turn_deg": float(np.degrees(motion.rotation.magnitude())),
            "shift_m": float(np.linalg.norm(motion.translation)),
        }

    def numbers(self) -> dict[str, float]:
        """The median and the largest difference in pixels, and the implied motion in degrees and metres."""
        return dict(self._numbers)

    @property
    def warning(self) -> str:
        """What to say of the implied motion where it is large."""
        n, d = self.numbers(), DISTANCES[self.distance]
        if n["turn_deg"] < LARGE_TURN_DEG and (np.isinf(d) or n["shift_m"] < LARGE_SHIFT * d):
            return ""
        return (
            "That motion is large: with one of the two, poses and intrinsics make up for each other. Do not mix them."
        )

    def description(self) -> str:
        n = self.numbers()
        moved = f" and moved by {1000 * n['shift_m']:.2g} mm" if self.distance != "infinity" else ""
        return (
            f"{self.names[0]} against {self.names[1]}, points {place_of(self.distance)}: typically {n['median']:.3g} "
            f"px apart, at most {n['worst']:.3g} px, after the second camera was turned by {n['turn_deg']:.3g}°{moved} "
            f"to agree best. {self.warning}"
        ).strip()

    def figure(self, *, draft: bool = False) -> Picture:
        found, k = self.compared(*((15, 10) if draft else (45, 30))), self.first.intrinsics
        panel = image_panel("difference", 20, 34, 560, k.width, k.height, tallest=420)
        length = np.maximum(found.length, 1e-6)
        # Along a line the two agree, and the logarithm would spend its colours on zero.
        floor = float(np.nanquantile(length, 0.03)) if np.isfinite(length).any() else 1e-6
        shades = Shades.around(np.maximum(length, floor))
        colours, attached = heat(panel, "colours", length, shades)
        content = colours + self._arrows(panel) + contours(panel, length, shades, " px", strong=1.0)
        legend, bar_picture = bar(panel.x + panel.width + 14, 64, panel.height - 60, "bar", shades, "px")
        shown = panel.show(content, title=f"Points {place_of(self.distance)}", note=f"arrows × {self.scale:g}")
        parts = {"difference": shown + legend, "numbers": self._words(690)}
        return self.tiled(_LAYOUT, parts, attached | bar_picture)

    def _arrows(self, panel: Panel) -> Marks:
        found = self.compared(15, 10)
        starts = found.uv[1:-1:2, 1:-1:2].reshape(-1, 2)
        ends = starts + self.scale * found.shift[1:-1:2, 1:-1:2].reshape(-1, 2)
        return arrows(panel.place(starts), panel.place(ends), "ink", 7)

    def _words(self, x: float) -> Marks:
        n = self.numbers()
        rows = [
            ("typically apart", f"{n['median']:.3g} px"),
            ("at most", f"{n['worst']:.3g} px"),
            ("the second is turned by", f"{n['turn_deg']:.3g}°"),
        ]
        if self.distance != "infinity":
            rows.append(("and moved by", f"{1000 * n['shift_m']:.3g} mm"))
        words = readout(rows, (x, 60), (0, 40), (0, 18))
        told = "Turn and move are what the two sets of intrinsics imply; they are taken out, for a pose takes them up."
        words += svg.paragraph((x, 236), f"{self.names[0]} against {self.names[1]}.", 950 - x)
        words += svg.paragraph((x, 290), told, 950 - x)
        return words + svg.paragraph((x, 380), self.warning, 950 - x, "label red")


@lru_cache(maxsize=24)
def _difference(first: Camera, second: Camera, distance: str, columns: int, rows: int) -> Difference:
    return difference(first, second, DISTANCES[distance], (columns, rows))
