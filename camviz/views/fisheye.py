"""The fisheye visualizer: five projections side by side, the picture one of them makes, and a window cut out of it."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property, lru_cache
from math import asin, atan2, cos, degrees, pi, radians, sin
from typing import ClassVar, Self

import numpy as np

from camviz.cameras import Camera, Intrinsics
from camviz.draw import plot, svg
from camviz.draw.items import Dots, Item, Line, axes_triad
from camviz.draw.panel import Panel, image_panel, photograph
from camviz.draw.picture import Picture, jpeg
from camviz.draw.space import Eye, draw_space, space_panel
from camviz.lenses import Equidistant, Equisolid, Lens, Orthographic, Perspective, Stereographic
from camviz.lenses.base import Array
from camviz.reprojection import reproject, window
from camviz.views import garden
from camviz.views.base import View, choice, slider
from camviz.views.marks import on_photograph

SIDE = 480  # pixels of the picture, which is square

LENSES: dict[str, Lens] = {
    "equidistant": Equidistant(),
    "equisolid": Equisolid(),
    "stereographic": Stereographic(),
    "orthographic": Orthographic(),
    "perspective": Perspective(),
}
EQUATIONS = {
    "equidistant": "r = f θ",
    "equisolid": "r = 2f sin(θ/2)",
    "stereographic": "r = 2f tan(θ/2)",
    "orthographic": "r = f sin θ",
    "perspective": "r = f tan θ",
}
_COLOURS = {
    "equidistant": "blue",
    "equisolid": "green",
    "stereographic": "orange",
    "orthographic": "purple",
    "perspective": "red",
}
_LAST = {"equidistant": 180.0, "equisolid": 180.0, "stereographic": 180.0, "orthographic": 90.0, "perspective": 90.0}
_TOP = 3.4  # focal lengths shown by the curves
_INFINITE = 1e6  # focal lengths: tan 90° as rounded numbers have it


@dataclass(frozen=True)
class FisheyeView(View):
    """What a fisheye does to the angle of a ray, and that a straight picture can be cut out of its round one."""

    title: ClassVar[str] = "Fisheye"

    projection: str = choice(*LENSES, help="how the angle θ of a ray becomes a distance r from the picture's middle")
    f: float = slider(
        150.0, 60.0, 400.0, 5.0, unit="px", label="focal length", help="r for a small angle of one radian"
    )
    yaw_deg: float = slider(35.0, -180.0, 180.0, 1.0, label="window yaw", unit="°", help="to the right")
    pitch_deg: float = slider(-20.0, -90.0, 90.0, 1.0, label="window pitch", unit="°", help="up")
    hfov_deg: float = slider(80.0, 20.0, 120.0, 1.0, label="window's field", unit="°", help="of the perspective window")
    eye: Eye = Eye(target=(0.0, 0.0, 0.2), distance=4.4, yaw_deg=-40, pitch_deg=22)

    # Cameras ---------------------------------------------------------------------------------------------------------

    @cached_property
    def camera(self) -> Camera:
        """The fisheye, at the origin, looking ahead."""
        c = (SIDE - 1) / 2
        return Camera(Intrinsics(SIDE, SIDE, self.f, self.f, c, c), LENSES[self.projection])

    @cached_property
    def window(self) -> Camera:
        """The perspective camera whose picture is cut out of the fisheye's."""
        return window(320, 240, self.hfov_deg, yaw_deg=self.yaw_deg, pitch_deg=self.pitch_deg)

    def radius(self, theta: Array, projection: str = "") -> Array:
        """r/f (...) of rays `theta` (...) radians from the axis; NaN where there is no image."""
        rays = np.stack([np.sin(theta), np.zeros_like(theta), np.cos(theta)], axis=-1)
        r = LENSES[projection or self.projection].project(rays)[..., 0]
        return np.where(r < _INFINITE, r, np.nan)

    def half_field_deg(self) -> float:
        """The angle in degrees of the farthest ray along the picture's middle row."""
        ray = self.camera.unproject([SIDE - 0.5, (SIDE - 1) / 2])
        return degrees(atan2(abs(ray[0]), ray[2])) if np.isfinite(ray).all() else _LAST[self.projection]

    def pixels_a_degree(self, theta_deg: float) -> float:
        """How many pixels, along the radius, a degree gets at an angle from the axis; NaN where nothing is seen."""
        step = 0.01
        near, far = self.radius(np.radians([theta_deg - step, theta_deg + step]))
        return float(self.f * (far - near) / (2 * step))

    def numbers(self) -> dict[str, str]:
        """The state's key figures, as text."""
        at_90 = float(self.radius(np.array(pi / 2)))
        u, v = self.camera.project(self.window.unproject([159.5, 119.5]))
        return {
            "across the picture": f"{2 * self.half_field_deg():.0f}°",
            "a ray at 90° lands at": f"r = {self.f * at_90:.0f} px" if np.isfinite(at_90) else "nowhere: tan 90° = ∞",
            "pixels a degree, 0°": f"{self.pixels_a_degree(0.02):.2f}",
            "pixels a degree, 80°": f"{self.pixels_a_degree(80):.2f}",
            "window's middle": f"({u:.0f}, {v:.0f}) px" if np.isfinite([u, v]).all() else "has no image",
        }

    def description(self) -> str:
        """The state in words and numbers."""
        figures = "; ".join(f"{name} {value}" for name, value in self.numbers().items())
        return (
            f"{self.projection}, {EQUATIONS[self.projection]}, f = {self.f:g} px: {figures}. The window looks "
            f"{self.yaw_deg:.0f}° to the right and {self.pitch_deg:.0f}° up and is {self.hfov_deg:.0f}° wide."
        ).replace("-", "−")

    # The picture -----------------------------------------------------------------------------------------------------

    def figure(self, *, draft: bool = False) -> Picture:
        side = garden.DRAFT if draft else garden.FINE
        image, taken = _photographed(self.camera, side)
        small = Camera(self.camera.intrinsics.within(side), self.camera.lens)
        seen = (
            self.window
            if not draft
            else Camera(self.window.intrinsics.resized(160, 120), self.window.lens, self.window.world_from_cam)
        )
        cut = reproject(image, small, seen, antialias=False)
        dome, photographs = self._dome_panel(draft)
        body = "".join(
            [
                svg.rectangle(0, 0, 960, 610, "paper"),
                self._picture_panel(),
                self._window_panel(),
                self._curves_panel(),
                dome,
                self._numbers_column(),
            ]
        )
        photographs |= {"fisheye": taken, "window": jpeg(cut)}
        return Picture(body, 960, 610, self.title, self.description(), photographs)

    @cached_property
    def _panel(self) -> Panel:
        return image_panel("fisheye", 20, 34, 320, SIDE, SIDE)

    def _picture_panel(self) -> str:
        panel = self._panel
        outline = self.camera.project(self.window.unproject(self.window.intrinsics.border(16)))
        edges = np.vstack([outline, outline[:1]])
        far = np.linalg.norm(np.diff(edges, axis=0, append=edges[:1]), axis=-1) > SIDE / 2  # once round the back
        edges[far] = np.nan
        content = photograph(panel, "fisheye", SIDE, SIDE) + on_photograph([panel.place(edges)], "yellow thick")
        label = "The fisheye's picture; drag it, or press the arrow keys, to move the window; plus and minus zoom"
        title = f"Through the {self.projection} lens"
        return panel.show(content, title=title, hint="drag the window", drag="window", label=label)

    def _window_panel(self) -> str:
        panel = image_panel("cut", 365, 34, 360, 320, 240)
        note = f"perspective, {self.hfov_deg:.0f}° wide"
        return panel.show(photograph(panel, "window", 320, 240), title="The window cut out of it", note=note)

    def _curves_panel(self) -> str:
        panel = plot.plot_panel("curves", 70, 400, 400, 160, (0, 180), (0, _TOP))
        edge = SIDE / 2 / self.f
        drawn = plot.grid(panel) + plot.upright(panel, 90, "muted dashed")
        drawn += svg.line(panel.place([(0, edge), (180, edge)]), "green dashed") if edge < _TOP else ""
        for name in sorted(LENSES, key=lambda name: name == self.projection):
            theta = np.linspace(0, _LAST[name], 181)
            drawn += plot.curve(
                panel, theta, self.radius(np.radians(theta), name), f"{_COLOURS[name]} {self._weight(name)}"
            )
        drawn += "".join(self._name(panel, name) for name in LENSES)
        drawn += (
            svg.text(panel.place((2, edge)) + (0, -6), "edge of the picture", "green halo")
            if edge < 0.92 * _TOP
            else ""
        )
        return plot.axes(panel, "θ, angle from the axis [°]", "r / f") + panel.show(
            drawn, title="How far from the middle", note=EQUATIONS[self.projection]
        )

    def _weight(self, name: str) -> str:
        return "thick" if name == self.projection else "half"

    def _name(self, panel: Panel, name: str) -> str:
        places = {
            "perspective": (71, 2.95, "end"),
            "stereographic": (117, 2.95, ""),
            "equidistant": (178, 2.25, "end"),
            "equisolid": (176, 1.72, "end"),
            "orthographic": (92, 0.72, ""),
        }
        x, y, side = places[name]
        strong = "" if name == self.projection else "half"
        return svg.text(panel.place((x, y)), name, f"{_COLOURS[name]} halo {side} {strong}")

    # The dome --------------------------------------------------------------------------------------------------------

    def _dome_panel(self, draft: bool) -> tuple[str, dict[str, bytes]]:
        panel = space_panel("dome", 500, 370, 250, 220)
        content, photographs = draw_space(panel, self._rays(), self.eye, draft=draft, renderer="wire")
        label = "The rays in space; drag or press the arrow keys to walk around"
        return panel.show(content, title="Its rays", hint="drag to turn", drag="eye", label=label), photographs

    def _rays(self) -> list[Item]:
        """Where circles equally far apart in the picture come from, on a sphere around the camera; and the window."""
        turn = np.linspace(0, 2 * pi, 49)
        circle = np.stack([np.cos(turn), np.sin(turn)], axis=-1)
        items: list[Item] = [Line(_ring(circle, pi / 2), "muted dashed", 1.2)]
        for i in range(1, 7):
            rays = self.camera.lens.unproject(circle * (i * SIDE / 12 / self.f))
            items.append(Line(rays, _COLOURS[self.projection], 2.2 if i == 6 else 1.3))
        reach = min(self.half_field_deg(), 179.0)
        for around in np.linspace(0, 2 * pi, 13)[:-1]:
            theta = np.radians(np.linspace(0, reach, 17))
            items.append(Line(_meridian(theta, around), "muted", 0.8))
        rim = self.window.unproject(self.window.intrinsics.border(6))
        items.append(Line(np.vstack([rim, rim[:1]]), "yellow", 2.6))
        items += [Line(np.stack([np.zeros(3), corner]), "yellow", 1.4) for corner in rim[::6]]
        return [*items, Dots(np.zeros(3), "ink", 7), *axes_triad(self.camera.world_from_cam, 0.5)]

    # The numbers -----------------------------------------------------------------------------------------------------

    def _numbers_column(self) -> str:
        x = 775
        rows = [svg.text((x, 26), "This lens", "title"), svg.text((x, 50), EQUATIONS[self.projection], "label")]
        rows.append(svg.text((x, 70), f"f = {self.f:g} px", "label"))
        for i, (name, value) in enumerate(self.numbers().items()):
            rows.append(svg.text((x, 104 + 42 * i), name, "note"))
            rows.append(svg.text((x, 121 + 42 * i), value, "label"))
        rows.append(svg.text((x, 394), "r / f at 30°, 60°, 90°", "title"))
        for i, name in enumerate(LENSES):
            values = self.radius(np.radians([30.0, 60.0, 90.0]), name)
            words = " ".join(f"{value:.3f}" if np.isfinite(value) else "    ∞" for value in values)
            strong = "" if name == self.projection else " half"
            rows.append(svg.text((x, 420 + 36 * i), name, f"{_COLOURS[name]}{strong}"))
            rows.append(svg.text((x, 436 + 36 * i), words, f"number{strong}"))
        return "".join(rows)

    # Touch -----------------------------------------------------------------------------------------------------------

    def dragged(self, handle: str, x: float, y: float, dx: float, dy: float) -> Self:
        if handle == "eye":
            return self.but(eye=self.eye.orbited(dx, dy))
        return self._looking_at(
            self.camera.project(_direction(self.yaw_deg, self.pitch_deg)) + (dx, dy) / self._panel.scale
        )

    def pressed(self, handle: str, key: str) -> Self:
        if handle == "eye":
            return self.but(eye=self.eye.key(key))
        zooms = {"+": -5.0, "=": -5.0, "-": 5.0, "_": 5.0}
        if key in zooms:
            return self.but(hfov_deg=min(120.0, max(20.0, self.hfov_deg + zooms[key])))
        return super().pressed(handle, key)

    def _looking_at(self, uv: Array) -> Self:
        """The window turned to what the fisheye has at a pixel (2,); unchanged where it has nothing."""
        x, y, z = self.camera.unproject(uv)
        if not (np.isfinite(x) and self.camera.intrinsics.contains(uv)):
            return self if np.isfinite(x) or not np.isnan(uv).any() else self.but(yaw_deg=0.0, pitch_deg=0.0)
        yaw, pitch = degrees(atan2(x, z)), degrees(asin(max(-1.0, min(1.0, -y))))
        return self.but(yaw_deg=round(yaw, 2), pitch_deg=round(pitch, 2))


@lru_cache(maxsize=4)
def _pictured(intrinsics: Intrinsics, lens: Lens) -> tuple[np.ndarray, bytes]:
    image = garden.glimpse(Camera(intrinsics, lens))
    image.flags.writeable = False
    return image, jpeg(image)


def _photographed(camera: Camera, side: int) -> tuple[np.ndarray, bytes]:
    """The garden through the fisheye and it as JPEG: traced when fine, looked up in an all-round picture as a draft."""
    if side == garden.DRAFT:
        return _pictured(camera.intrinsics.within(side), camera.lens)
    return garden.taken(camera, side)


def _direction(yaw_deg: float, pitch_deg: float) -> Array:
    yaw, pitch = radians(yaw_deg), radians(pitch_deg)
    return np.array([cos(pitch) * sin(yaw), -sin(pitch), cos(pitch) * cos(yaw)])


def _ring(circle: Array, theta: float) -> Array:
    """The rays (n, 3) at an angle from the axis, all around."""
    return np.hstack([sin(theta) * circle, np.full((len(circle), 1), cos(theta))])


def _meridian(theta: Array, around: float) -> Array:
    return np.stack([np.sin(theta) * cos(around), np.sin(theta) * sin(around), np.cos(theta)], axis=-1)
