"""A camera's numbers, and what they mean: where its axis meets the picture, and how much it sees."""

from __future__ import annotations

from dataclasses import dataclass, field, fields
from math import atan2, degrees
from typing import Any, ClassVar

import numpy as np

from camviz.cameras import Camera
from camviz.draw import svg
from camviz.draw.flow import Sentences, rows
from camviz.draw.items import closed
from camviz.draw.panel import image_panel
from camviz.draw.picture import Picture
from camviz.draw.readout import listed, readout, true_minus
from camviz.views.base import View
from camviz.views.marks import cross


@dataclass(frozen=True)
class NumbersView(View):
    """What the file says of a camera, and the picture's middle against its principal point."""

    title: ClassVar[str] = "The numbers"

    camera: Camera = field(repr=False)
    name: str = "camera"
    rms: float | None = None

    @classmethod
    def of(cls, calibration: Any, camera: str = "") -> NumbersView:
        """The numbers of a camera of a calibration, the first unless named."""
        name = camera or next(iter(calibration.cameras))
        return cls(calibration.cameras[name], name, calibration.rms(name))

    def rows(self) -> list[tuple[str, str]]:
        """What is said and its value, in words."""
        k = self.camera.intrinsics
        lens: Any = self.camera.lens
        away = np.array([k.cx - (k.width - 1) / 2, k.cy - (k.height - 1) / 2])
        rows = [
            ("picture", f"{k.width} × {k.height} pixels"),
            ("focal lengths fx, fy", f"{k.fx:.6g}, {k.fy:.6g} px"),
            ("fx / fy", f"{k.fx / k.fy:.5f}"),
            ("principal point cx, cy", f"{k.cx:.6g}, {k.cy:.6g} px"),
            ("from the middle", f"{away[0]:+.1f}, {away[1]:+.1f} px"),
            ("that is of the diagonal", f"{100 * np.linalg.norm(away) / np.hypot(k.width, k.height):.1f} %"),
            ("field of view across, down", self._fields_of_view()),
        ]
        rows += [("skew", f"{k.skew:.6g}")] if k.skew else []
        rows += [] if self.rms is None else [("RMS of the fit", f"{self.rms:.4g} px")]
        moved = (f.name for f in fields(lens) if getattr(lens, f.name) != f.default)
        coefficients = [f"{name} {getattr(lens, name):.6g}" for name in moved]
        return [*rows, ("lens", f"{type(lens).__name__}: {', '.join(coefficients) or 'nothing but zeros'}")]

    def _fields_of_view(self) -> str:
        k = self.camera.intrinsics
        middle = [(k.width - 1) / 2, (k.height - 1) / 2]
        ends = [[(-0.5, middle[1]), (k.width - 0.5, middle[1])], [(middle[0], -0.5), (middle[0], k.height - 0.5)]]
        told = []
        for pair in ends:
            a, b = self.camera.lens.unproject(k.from_pixels(pair))
            told.append(
                f"{degrees(atan2(np.linalg.norm(np.cross(a, b)), a @ b)):.1f}°" if np.isfinite(a @ b) else "no ray"
            )
        return ", ".join(told)

    def description(self) -> str:
        return f"{self.name}: " + listed(self.rows()) + "."

    def figure(self, *, draft: bool = False) -> Picture:
        k = self.camera.intrinsics
        beyond = float(max(0.0, -k.cx, -k.cy, k.cx - k.width, k.cy - k.height))
        panel = image_panel(
            "picture", 20, 34, 330, k.width, k.height, margin=min(beyond * 1.2, 3 * k.width), tallest=240
        )
        rim = panel.place(k.border(1))
        middle, axis = panel.place([((k.width - 1) / 2, (k.height - 1) / 2), (k.cx, k.cy)])
        content = svg.polygon(rim, "wash fill-blue") + svg.path([closed(rim)], "muted")
        content += cross([middle], "muted", 7) + svg.dots([axis], "orange", 9)
        side = "end" if axis[0] > 0.75 * panel.width else "" if axis[0] < 0.25 * panel.width else "middle"
        content += svg.text(axis + (0, 24 if axis[1] < middle[1] else -12), "principal point", f"orange halo {side}")
        *told, (_, lens) = [(name, true_minus(value)) for name, value in self.rows()]
        layout = rows((max(290.0, 30 + 40 * len(told)), {"picture": 380, "numbers": 320}), (40, {"lens": 960}))
        shown = panel.show(content, title=f"{self.name}: its picture", note="cross: the middle")
        figures = readout(told, (392, 46), (0, 40), (0, 18))
        return self.tiled(layout, {"picture": shown, "numbers": figures, "lens": Sentences(lens)})
