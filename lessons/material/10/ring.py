"""The ring visualizer: cameras that look outwards, their stitched panorama, and the parallax it cannot hide."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property, lru_cache
from math import pi
from typing import ClassVar

import numpy as np

from camviz.draw import plot, svg
from camviz.draw.flow import Cell, rows
from camviz.draw.panel import Panel, image_panel, placed_image
from camviz.draw.picture import Picture, jpeg
from camviz.draw.readout import listed, signed
from camviz.lenses import Equirectangular
from camviz.lenses.base import Array
from camviz.panoramas.ring import Ring, all_round
from camviz.scenes import textured_scene, to_display
from camviz.views.base import View, slider, switch

_DRAFT, _FINE = 144, 640  # pixels around the panorama
_UP_DEG = 42.0
_WIDE = {"seam": 320, "above": 270, "curve": 370}
_COUNTED = 4000  # pixels around the panorama whose parallax is told
_LOUPE_DEG, _LOUPE_DOWN_DEG = 44.0, 3.0  # across the enlarged part, and of its middle below the horizon


@dataclass(frozen=True)
class RingView(View):
    """`cameras` on a circle in the garden, 1.25 m above the terrace, and the panorama that is stitched from theirs.

    The panorama is right for what is `stitched_m` metres away. The ring is turned by `turn_deg`, so that a seam can be
    laid across a thing. `overlap` fades neighbours into each other instead of cutting; `one_viewpoint` is the panorama
    of a single camera that turns about its own centre. `panels` names what is drawn: the seam ahead, and any of
    panorama, above and curve.
    """

    title: ClassVar[str] = "A ring of cameras"
    openable: ClassVar[Mapping[str, str]] = {"panorama": "panorama", "above": "from above", "curve": "curve"}

    cameras: int = slider(6, 2, 12, 1, help="how many look outwards")
    radius_m: float = slider(0.25, 0.0, 0.5, 0.01, label="ring's radius", unit="m")
    stitched_m: float = slider(30.0, 1.0, 30.0, 0.1, label="stitched for", unit="m", help="where the panorama is right")
    turn_deg: float = slider(-18.0, -45.0, 45.0, 0.5, label="turn the ring", unit="°", help="lays the seams elsewhere")
    overlap: float = slider(0.0, 0.0, 0.6, 0.05, help="0 cuts at the seams, more fades neighbours into each other")
    one_viewpoint: bool = switch(False, label="one viewpoint", help="all the cameras in the middle: a radius of 0")
    panels: str = "panorama above seam curve"

    def __post_init__(self) -> None:
        super().__post_init__()
        if not {"seam"} <= set(self.panels.split()) <= {"panorama", *_WIDE}:
            raise ValueError(f"panels must be seam and any of panorama, above, curve, got {self.panels!r}")
        _ = self.ring
        if not self.stitched_m > 0.5:
            raise ValueError(f"stitched_m must be more than 0.5 m, got {self.stitched_m}")

    # What is true ----------------------------------------------------------------------------------------------------

    @cached_property
    def ring(self) -> Ring:
        """The cameras."""
        radius = 0.0 if self.one_viewpoint else self.radius_m
        return Ring(int(self.cameras), radius, self.overlap, np.radians(self.turn_deg))

    @property
    def seams_deg(self) -> Array:
        """The longitudes (n,) of the seams in the panorama, in degrees."""
        return np.rad2deg(self.ring.seams)

    @property
    def seam_deg(self) -> float:
        """The seam nearest to straight ahead."""
        return float(min(self.seams_deg, key=abs))

    def parallax_px(self, distance: Array | float) -> Array:
        """How far apart (...) the images of a point at a seam are, in pixels of a panorama 4000 pixels around."""
        return self.ring.parallax(distance, self.stitched_m) * _COUNTED / (2 * pi)

    @cached_property
    def distance_m(self) -> float:
        """How far away the garden is, level with the ring, straight out at the seam nearest ahead; NaN in the sky."""
        direction = Equirectangular().unproject([np.radians(self.seam_deg), np.radians(8)])
        return float(textured_scene().trace(np.zeros(3), direction)[1])

    def numbers(self) -> dict[str, str]:
        """The state's key figures, as text."""
        seen = self.distance_m
        there = f"at the seam ahead, {seen:.1f} m away" if np.isfinite(seen) else "at the seam ahead, the sky"
        known = seen if np.isfinite(seen) else 1e6
        return {
            "neighbours apart": f"{100 * self.ring.baseline:.1f} cm",
            **{f"parallax at {z:g} m": _pixels(self.parallax_px(z)) for z in (1.0, 3.0, 10.0)},
            there: _pixels(self.parallax_px(known)),
        }

    def description(self) -> str:
        figures = listed(self.numbers())
        joined = f"faded over {self.overlap:.0%} of each part" if self.overlap else "cut at the seams"
        return (
            f"{self.cameras} cameras on a ring of {self.ring.radius:g} m, stitched for {self.stitched_m:g} m, "
            f"{joined}: {figures} (of {_COUNTED} pixels around). The seam ahead is at {self.seam_deg:.1f}°."
        )

    # The panels ------------------------------------------------------------------------------------------------------

    def panorama(self, *, draft: bool = False) -> np.ndarray:
        """The stitched panorama, uint8 RGB."""
        return _panorama(self.ring, self.stitched_m, self._coarse(_DRAFT if draft else _FINE))

    def _coarse(self, pixels: int) -> int:
        """How wide a picture is traced: where two cameras' pictures are mixed, every ray is two."""
        return round(pixels / (1 + 0.8 * self.overlap))

    def figure(self, *, draft: bool = False) -> Picture:
        photographs = {"loupe": jpeg(self.loupe(draft=draft), 90)}
        if self._has("panorama"):
            photographs["panorama"] = jpeg(self.panorama(draft=draft), 90)
        parts = {name: getattr(self, f"_{name}_panel")() for name in self.panels.split()}
        return self.tiled(self._layout, {name: parts[name] for name in self._layout}, photographs)

    @cached_property
    def _layout(self) -> dict[str, Cell]:
        """The panorama in a row of its own, the others below it; the seam alone is larger."""
        wide = {name: _WIDE[name] for name in self.panels.split() if name in _WIDE}
        below = (264, wide) if len(wide) > 1 else (317, {"seam": 392})
        return rows(*([(258, {"panorama": 960})] if self._has("panorama") else []), below)

    def _slot(self, name: str) -> Cell:
        """Where the panel of a cell stands: left, top, width and height."""
        x, y, width, height = self._layout[name]
        return x + 10, y + 34, width - 20, height - 44

    def _panorama_panel(self) -> svg.Marks:
        pixels = all_round(_FINE, _UP_DEG)
        panel = image_panel("panorama", 20, 34, 920, pixels.width, pixels.height)
        at = panel.place(np.stack([self._column(self.seams_deg), 0 * self.seams_deg], axis=-1))
        ends = at + (0, panel.height)
        lines = svg.segments(at, ends, "paper-line") + svg.segments(at, ends, "orange thin dashed")
        ahead = panel.place((float(self._column(np.array(self.seam_deg))), 0))
        half = _LOUPE_DEG / 360 * panel.width * np.array([0.5, 0.5 * 220 / 300])
        middle = ahead + (0, panel.height * (0.5 + 0.5 * _LOUPE_DOWN_DEG / _UP_DEG))
        corners = middle + half * [(-1, -1), (1, -1), (1, 1), (-1, 1), (-1, -1)]
        seen = placed_image(panel, "panorama", pixels.width, pixels.height)
        return panel.show(
            seen + lines + svg.line(corners, "yellow"),
            title="The stitched panorama",
            hint="drag to turn the ring",
            drag="seams",
            label="The panorama; drag or press the arrow keys to turn the ring and lay its seams elsewhere",
        )

    def _column(self, longitude_deg: Array) -> Array:
        return (longitude_deg + 180) / 360 * _FINE - 0.5

    def loupe(self, *, draft: bool = False) -> np.ndarray:
        """The part around the seam ahead, traced as finely as it is shown."""
        across = (96, 440) if self._slot("seam")[2] > 320 else (66, 300)
        return _detail(self.ring, self.stitched_m, self.seam_deg, self._coarse(across[not draft]))

    def _seam_panel(self) -> svg.Marks:
        panel = Panel("loupe", *self._slot("seam"), 0, 300, 0, 220)
        w, h = panel.width, panel.height
        seam = svg.join(svg.segments([(w / 2, y)], [(w / 2, y + 14)], "orange thick") for y in (0, h - 14))
        there, shift = list(self.numbers().items())[-1]
        words = f"{there.removeprefix('at the seam ahead, ')}: {shift}"
        return panel.show(svg.image("loupe", 0, 0, w, h) + seam, title="At the seam ahead", note=words)

    def _above_panel(self) -> svg.Marks:
        reach = 1.9
        panel = Panel("plan", *self._slot("above"), -reach, reach, reach * 0.88 + 0.9, -reach * 0.88 + 0.9)
        centres = self.ring.centres[:, ::2]
        around = np.linspace(0, 2 * pi, 121)
        circle = np.stack([np.sin(around), np.cos(around)], axis=-1)
        seam = np.radians(self.seam_deg)
        out = np.array([np.sin(seam), np.cos(seam)])
        two = np.argsort(-(centres @ out), kind="stable")[:2] if self.ring.radius else np.array([0, 1])
        post = 1.5 * out
        drawn = svg.line(panel.place(self.ring.radius * circle), "muted")
        if self.stitched_m < 4:
            drawn += svg.line(panel.place(self.stitched_m * circle), "green dashed")
        drawn += svg.line(panel.place(np.stack([0 * out, 4 * out])), "orange thin dashed")
        for i in two:
            far = centres[i] + 4 * (post - centres[i]) / np.linalg.norm(post - centres[i])
            drawn += svg.line(panel.place(np.stack([centres[i], far])), "blue")
        drawn += svg.dots(panel.place(centres), "ink", 7) + svg.dots([panel.place(post)], "red", 9)
        side = "end" if post[0] > 1 else ""
        drawn += svg.text(panel.place(post) + (-10 if side else 10, 4), "1.5 m", f"label red halo {side}")
        return panel.show(drawn, title="From above", note=f"{100 * self.ring.baseline:.1f} cm apart")

    def _curve_panel(self) -> svg.Marks:
        low, high = np.log10(0.7), np.log10(30)
        z = np.logspace(low, high, 161)
        px = self.parallax_px(z)
        tall = 120.0
        x, y, width, _ = self._slot("curve")
        panel = plot.plot_panel("parallax", x + 56, y, width - 56, 180, (low, high), (-tall, tall))
        xticks = plot.logarithmic(low, high)
        shown = np.log10(self.distance_m) if 0.7 < self.distance_m < 30 else np.nan
        mark = svg.dots([panel.place((shown, float(self.parallax_px(10**shown))))], "red", 9)
        body = plot.grid(panel, xticks) + plot.curve(panel, np.log10(z), px, "blue thick")
        body += plot.upright(panel, float(np.log10(self.stitched_m)), "green dashed") + mark
        drawn = panel.show(body, title="Stitching parallax", note=f"of {_COUNTED} px around")
        return plot.axes(panel, "distance in m", "px apart at a seam", xticks) + drawn

    # The hands -------------------------------------------------------------------------------------------------------

    def dragged(self, handle: str, x: float, y: float, dx: float, dy: float) -> RingView:
        turned = self.turn_deg + 360 * dx / 920
        return self.but(turn_deg=round(float(min(45, max(-45, turned))), 1))

    def pressed(self, handle: str, key: str) -> RingView:
        return self.dragged(handle, 0, 0, {"ArrowLeft": -5, "ArrowRight": 5}.get(key, 0), 0)


def _pixels(px: Array | float) -> str:
    return f"{signed(float(px), 1)} px"


@lru_cache(maxsize=2)
def _panorama(ring: Ring, stitched: float, width: int) -> np.ndarray:
    return to_display(ring.panorama(textured_scene(), all_round(width, _UP_DEG), stitched))


@lru_cache(maxsize=2)
def _detail(ring: Ring, stitched: float, seam_deg: float, across: int) -> np.ndarray:
    """The part of a panorama around a seam, `across` pixels wide."""
    per_degree = across / _LOUPE_DEG
    whole, height = all_round(round(360 * per_degree), 85), round(across * 220 / 300)
    left = round((seam_deg + 180) * per_degree - across / 2)
    top = round(whole.cy + _LOUPE_DOWN_DEG * per_degree - height / 2)
    return to_display(ring.panorama(textured_scene(), whole.cropped(left, top, across, height), stitched))
