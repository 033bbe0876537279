"""Where in the picture a ray arrives at all, and how near the lens's polynomial is to folding or to a pole."""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import lru_cache
from math import atan, degrees, isfinite
from typing import Any, ClassVar

import numpy as np
from contourpy import contour_generator

from camviz import distortion
from camviz.cameras import Camera
from camviz.draw import plot, svg
from camviz.draw.flow import Part, Sentences, rows
from camviz.draw.items import closed
from camviz.draw.marks import NOTHING, Marks
from camviz.draw.panel import Panel, image_panel
from camviz.draw.picture import Picture
from camviz.draw.shades import Shades, bar, contours, heat
from camviz.lenses.base import Array
from camviz.views.base import Drawn, View, slider
from camviz.views.distortion import DistortionView

_WEAK = 0.2  # a denominator below this multiplies what is wrong with the numerator by five
_LAYOUT = rows((428, {"resolution": 510, "curves": 450}), (92, {"in words": 960}))


@dataclass(frozen=True)
class FoldView(View):
    """The pixels that have a ray, with how many pixels the lens gives a degree; its curve g(r), its denominator D(r²).

    Where the map folds, pixels beyond have no ray; towards the fold the pixels for a degree go to zero. A denominator
    near zero throws the picture about although nothing folds.
    """

    title: ClassVar[str] = "Folds and poles"

    camera: Camera = field(repr=False)
    name: str = "camera"
    margin: float = slider(
        0.0, 0, 40, 1, label="look beyond the border", unit="%", help="of the picture's width, on every side"
    )

    @classmethod
    def of(cls, calibration: Any, camera: str = "") -> FoldView:
        """The view of a camera of a calibration, the first unless named."""
        name = camera or next(iter(calibration.cameras))
        return cls(calibration.cameras[name], name)

    def numbers(self) -> dict[str, float]:
        """Share of pixels without a ray, the fold's angle in °, the pole's radius, the least D(r²) and where."""
        return dict(_numbers(self.camera))

    @property
    def _rational(self) -> bool:
        return distortion.is_rational(self.camera.lens)

    def sentences(self) -> list[str]:
        """What the numbers mean, in words."""
        n = self.numbers()
        ends = "has a pole" if isfinite(n["pole_radius"]) and not isfinite(n["fold_deg"]) else "folds"
        told = [
            f"{100 * n['without_ray']:.2g} % of the picture's pixels have no ray: the polynomial {ends} before it "
            "reaches them."
            if n["without_ray"] > 0
            else "Every pixel of the picture has a ray: nothing folds inside it."
        ]
        if isfinite(n["fold_deg"]):
            told.append(f"It folds {n['fold_deg']:.1f}° off the axis (r = {n['fold_radius']:.3f}).")
        if isfinite(n["pole_radius"]):
            told.append(
                f"It has a pole at r = {n['pole_radius']:.3f}, {degrees(atan(n['pole_radius'])):.1f}° off the axis."
            )
        if self._rational:
            near = " That is a near-pole: small errors are thrown far." if n["weakest"] < _WEAK else ""
            told.append(f"The denominator is least at r = {n['weakest_at']:.3f}: D = {n['weakest']:.3g}.{near}")
        return told

    def description(self) -> str:
        return f"{self.name}: " + " ".join(self.sentences())

    def figure(self, *, draft: bool = False) -> Picture:
        shown, attached = self._map((24, 18) if draft else (80, 60))
        curves = DistortionView.of(self.camera).curve_panel(570, 34, 370, 170, equation=False) + self._denominator()
        parts: dict[str, Part] = {
            "resolution": shown,
            "curves": curves,
            "in words": Sentences("\n".join(self.sentences())),
        }
        return self.tiled(_LAYOUT, parts, attached)

    def resolution(self, columns: int, rows: int) -> tuple[Array, Array]:
        """Pixels (rows, columns, 2) from edge to edge, and how many pixels a degree has there (rows, columns).

        The geometric mean over all directions: √(1/Ω), Ω being a pixel's solid angle. NaN where there is no ray.
        """
        k = self.camera.intrinsics
        beyond = self.margin / 100 * k.width
        u = np.linspace(-0.5 - beyond, k.width - 0.5 + beyond, columns)
        v = np.linspace(-0.5 - beyond, k.height - 0.5 + beyond, rows)
        uv = np.stack(np.meshgrid(u, v), axis=-1)
        rays = self.camera.unproject(uv)
        down, right = np.gradient(rays, v, u, axis=(0, 1))
        with np.errstate(divide="ignore"):
            return uv, np.radians(1) / np.sqrt(np.linalg.norm(np.cross(right, down), axis=-1))

    def _map(self, size: tuple[int, int]) -> Drawn:
        k = self.camera.intrinsics
        panel = image_panel("folds", 20, 34, 420, k.width, k.height, margin=self.margin / 100 * k.width, tallest=360)
        uv, values = self.resolution(*size)
        known = values[np.isfinite(values)]
        top = float(np.quantile(known, 0.99)) if known.size else 1.0
        shades = Shades(0.0, 1.02 * top)
        colours, attached = heat(panel, "resolution", np.minimum(values, top), shades)
        content = colours + contours(panel, values, shades) + self._without_ray(panel, uv, values)
        if self.margin:
            rim = panel.place(k.border(2))
            content += svg.path([closed(rim)], "ink thick")
        legend, bar_picture = bar(panel.x + panel.width + 12, 62, panel.height - 50, "resolution-bar", shades, "px/°")
        words = "red: no ray arrives" if not np.isfinite(values).all() else "a ray arrives everywhere"
        return panel.show(
            content, title=f"{self.name}: pixels for a degree", note=words
        ) + legend, attached | bar_picture

    def _without_ray(self, panel: Panel, uv: Array, values: Array) -> Marks:
        none = ~np.isfinite(values)
        if not none.any():
            return NOTHING
        generator = contour_generator(uv[..., 0], uv[..., 1], none.astype(float))
        outlines, rims = generator.filled(0.5, 1.5)[0], generator.lines(0.5)
        filled = svg.join(svg.polygon(panel.place(outline), "wash fill-red") for outline in outlines)
        return filled + svg.path([panel.place(rim) for rim in rims], "red thick")

    def _denominator(self) -> Marks:
        """D(r²) out to beyond the picture, where the model has one."""
        if not self._rational:
            words = (
                "The model has no denominator, so it can have no pole: only the numerator of g(r), above, can "
                "turn back."
            )
            return (
                svg.rectangle(570, 282, 370, 120, "card")
                + svg.rectangle(570, 282, 370, 120, "frame")
                + svg.paragraph((586, 312), words, 340)
            )
        n = self.numbers()
        r = np.linspace(0, 1.5 * n["ideal_radius"], 241)
        D = self.camera.lens.denominator(r**2)
        inside = D[r <= n["ideal_radius"]]
        limits = min(-0.1, 1.1 * float(inside.min())), min(1.5, 1.15 * float(inside.max()))
        panel = plot.plot_panel("denominator", 570, 282, 370, 100, (0, float(r[-1])), limits)
        content = svg.rectangle(0, panel.place((0, _WEAK))[1], panel.width, panel.height, "wash fill-red")
        content += plot.curve(panel, r, D, "blue thick") + plot.upright(panel, n["ideal_radius"], "green dashed")
        at = panel.place((n["weakest_at"], n["weakest"]))
        content += svg.dots([at], "red", 9) + svg.text(at + (8, -8), f"D = {n['weakest']:.3g}", "red halo")
        note = "red: too weak"
        return plot.plotted(panel, content, "r, ideal", "D", title="The denominator D(r²)", note=note)


@lru_cache(maxsize=8)
def _numbers(camera: Camera) -> dict[str, float]:
    """What `FoldView.numbers` says, kept while its controls move."""
    lens, k = camera.lens, camera.intrinsics
    # How far out on the plane z = 1 the picture looks; the distorted radius where its border has no ray.
    radius = distortion.ideal_image_radius(camera)
    radius = min(radius, 10.0) if isfinite(radius) else distortion.image_corner_radius(k)
    weakest_at, weakest = distortion.weakest_denominator(lens, radius)
    step = max(1, max(k.width, k.height) // 240)
    return {
        "without_ray": float(1 - distortion.valid_region(camera, step).mean()),
        "fold_deg": degrees(distortion.fold_angle(lens)),
        "fold_radius": distortion.fold_radius(lens),
        "pole_radius": distortion.pole_radius(lens),
        "weakest": weakest,
        "weakest_at": weakest_at,
        "ideal_radius": radius,
    }
