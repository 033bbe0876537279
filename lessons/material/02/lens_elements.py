"""What is behind the thin lens: a real one cut open, its rays, and where the thin lens that replaces it would stand."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import ClassVar

import numpy as np

from camviz import optics
from camviz.draw import svg
from camviz.draw.flow import rows
from camviz.draw.panel import Panel
from camviz.draw.picture import Picture
from camviz.draw.readout import listed, readout
from camviz.lenses.base import Array
from camviz.views.base import View, choice, slider

_LENSES = {"triplet": (optics.COOKE_TRIPLET, 5.0), "telephoto": (optics.TELEPHOTO, 5.6)}
_BEFORE = 0.35  # of the focal length, that is drawn before the first surface
_EDGE = 1.12  # how much wider the glass is than the light
_WIDE, _TALL = 600, 290  # of the section, in picture units
_LAYOUT = rows((_TALL + 44, {"section": 620, "numbers": 340}))
_HIGHEST_MM = 15.0  # image
_LINES = "Blue: through the glass. Dashed: to the plane H, and on from H', as by one thin lens."


@dataclass(frozen=True)
class LensElementsView(View):
    """A published lens and parallel light through it, which meets `image_mm` from the axis.

    `opening` is the share of the full aperture that the rays fill. They are traced by matrices, as if all angles were
    small; the dashed lines are where one thin lens would send them, its front at the first principal plane H and its
    back at the second one, H'.
    """

    title: ClassVar[str] = "Behind the thin lens"

    lens: str = choice("triplet", "telephoto", label="lens", help="50 mm f/5, or 600 mm f/5.6")
    opening: float = slider(1.0, 0.1, 1.0, 0.05, label="opening", help="share of the full aperture that the rays fill")
    image_mm: float = slider(0.0, 0.0, _HIGHEST_MM, 0.5, label="image height", unit="mm", help="where the light meets")

    def __post_init__(self) -> None:
        super().__post_init__()
        if not 0 < self.opening <= 1:
            raise ValueError(f"opening must be a share above 0, at most 1, got {self.opening}")

    @property
    def prescription(self) -> optics.Prescription:
        """The lens's surfaces."""
        return _LENSES[self.lens][0]

    @property
    def heights_mm(self) -> Array:
        """Where the rays cross the first surface's plane, (5,)."""
        f, number = self.prescription.focal_mm, _LENSES[self.lens][1]
        return f / number / 2 * self.opening * np.linspace(-1, 1, 5)

    def numbers(self) -> dict[str, str]:
        """The lens's key figures, as text."""
        lens = self.prescription
        return {
            "effective focal length": f"{lens.focal_mm:.1f} mm",
            "back focal distance": f"{lens.back_focal_mm:.1f} mm",
            "glass, first to last": f"{lens.length_mm:.1f} mm",
            "first principal plane H": _behind(lens.front_principal_mm),
            "second principal plane H'": _behind(lens.rear_principal_mm),
        }

    def description(self) -> str:
        figures = listed(self.numbers())
        return (
            f"{self.prescription.name}, {len(self.prescription.surfaces)} surfaces, light through "
            f"{100 * self.opening:.0f} % of its opening to {self.image_mm:g} mm from the axis. {figures}."
        )

    def figure(self, *, draft: bool = False) -> Picture:
        numbers = readout(self.numbers(), (630, 52), (0, 42), (0, 17)) + svg.paragraph((630, 272), _LINES, 310)
        return self.tiled(_LAYOUT, {"section": self._section(), "numbers": numbers})

    @cached_property
    def _panel(self) -> Panel:
        """Millimetres along the axis, and as many across: to scale."""
        lens = self.prescription
        end = lens.length_mm + lens.back_focal_mm
        left, right = min(-_BEFORE * lens.focal_mm, lens.front_principal_mm - 0.06 * end), 1.06 * end
        half = max((right - left) * _TALL / _WIDE / 2, 1.1 * _HIGHEST_MM)
        return Panel("section", 10, 34, _WIDE, _TALL, right - 2 * half * _WIDE / _TALL, right, half, -half)

    def _section(self) -> svg.Marks:
        panel, lens = self._panel, self.prescription
        slope = self.image_mm / lens.focal_mm
        end = lens.length_mm + lens.back_focal_mm
        z, y = lens.trace(self.heights_mm, slope, reach_mm=-panel.left)
        y[0], y[1] = self.heights_mm + slope * panel.left, self.heights_mm
        rays = [np.stack([z, one], axis=-1) for one in lens.trace(y[0], slope, reach_mm=-panel.left)[1].T]
        planes = lens.front_principal_mm, lens.rear_principal_mm
        thin = [[one[0], *((plane, self._bent(one)) for plane in planes), one[-1]] for one in rays]
        content = (
            svg.line(panel.place([(panel.left, 0), (panel.right, 0)]), "muted dashed thin")
            + svg.path([panel.place(np.array(line)) for line in thin], "purple dashed thin")
            + svg.join(svg.polygon(panel.place(glass), "wash fill-sky") for glass in self._glasses())
            + svg.path([panel.place(glass) for glass in self._glasses()], "sky thin", closed=True)
            + svg.path([panel.place(ray) for ray in rays], "blue")
            + self._plane(planes[0], "H", 1 if planes[0] > planes[1] else -1)
            + self._plane(planes[1], "H'", 1 if planes[1] > planes[0] else -1)
            + svg.line(panel.place([(end, 16.0), (end, -16.0)]), "red thick")
        )
        return panel.show(content, title=lens.name, note="to scale")

    def _bent(self, ray: Array) -> float:
        """Height at which the ray's two ends, prolonged, are at the second principal plane."""
        (z0, y0), (z1, y1) = ray[-2:]
        return float(y1 + (self.prescription.rear_principal_mm - z1) * (y1 - y0) / (z1 - z0))

    def _plane(self, z: float, name: str, side: int) -> svg.Marks:
        panel = self._panel
        top, bottom = panel.place([(z, 0.86 * panel.top), (z, 0.86 * panel.bottom)])
        side = -side if not 30 < top[0] < panel.width - 30 else side  # where the border would cut the name
        return svg.line([top, bottom], "purple") + svg.text(top + (6 * side, 2), name, f"purple halo {_ANCHOR[side]}")

    def _glasses(self) -> list[Array]:
        """The outline of every element, as wide as the light that fills the whole opening needs."""
        lens, number = self.prescription, _LENSES[self.lens][1]
        z, heights = lens.trace(lens.focal_mm / number / 2, 0.0)
        half, places = _EDGE * np.abs(heights[1:-1]), z[1:-1]
        outlines = []
        for i, (radius, _, index) in enumerate(lens.surfaces):
            if index > 1:
                reach = max(half[i], half[i + 1])
                front = _arc(places[i], radius, reach)
                outlines.append(np.concatenate([front, _arc(places[i + 1], lens.surfaces[i + 1][0], reach)[::-1]]))
        return outlines


def _behind(z_mm: float) -> str:
    return f"{abs(z_mm):.1f} mm {'behind' if z_mm >= 0 else 'before'} the first surface"


_ANCHOR = {-1: "end", 1: ""}


def _arc(vertex: float, radius: float, reach: float) -> Array:
    """A surface in section (n, 2), from -reach to +reach across."""
    y = np.linspace(-reach, reach, 21)
    sag = radius - np.sign(radius) * np.sqrt(radius**2 - y**2)
    return np.stack([vertex + sag, y], axis=-1)
