"""The fisheye visualizer: five projections side by side, the picture one of them makes, and a window cut out of it.

A reader's own projection can draw its curve, its grid and the window beside the right ones.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from functools import cached_property, lru_cache
from math import asin, atan2, cos, degrees, pi, radians, sin
from typing import Any, ClassVar, Self

import numpy as np

from camviz.cameras import Camera, Intrinsics
from camviz.draw import plot, svg
from camviz.draw.flow import WIDTH, Cell, rows, shortened
from camviz.draw.items import Dots, Item, Line, axes_triad, closed
from camviz.draw.panel import Panel, image_in, placed_image
from camviz.draw.picture import Picture, jpeg
from camviz.draw.readout import listed, readout, true_minus
from camviz.draw.space import OrbitCamera, space_panel
from camviz.lenses import Equidistant, Equisolid, Lens, Orthographic, Perspective, Stereographic
from camviz.lenses.base import Array
from camviz.panoramas.reprojection import reproject, window
from camviz.views import garden
from camviz.views.base import Drawn, OrbitView, answered, choice, slider, without
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
_FAR = 5 * SIDE  # pixels: what a reader's function puts farther out is not drawn
_WIDE = {"picture": 310, "window": 430, "yours": 430, "numbers": 190, "curves": 430, "rays": 300}
"""The panels in their order, and how wide each is in picture units."""
_PAIR, _PAIR_HIGH = 310, 264  # the size of each of two windows, which stand beside the picture
_IMAGES, _OTHERS = 332, 260  # the height of a row with images, and of one without


@dataclass(frozen=True)
class FisheyeView(OrbitView):
    """What a fisheye does to the angle of a ray, and that a straight picture can be cut out of its round one.

    `panels` names what is drawn: the picture, and beside it any of window, yours, numbers, curves and rays. `yours` is
    a reader's function of (points, f, cx, cy), camera-frame points (..., 3) to pixels (..., 2); what it does is orange.
    """

    title: ClassVar[str] = "Fisheye"
    openable: ClassVar[Mapping[str, str]] = {
        "curves": "curves",
        "window": "window",
        "rays": "rays in space",
        "numbers": "numbers",
    }

    projection: str = choice(*LENSES, help="how the angle θ of a ray becomes a distance r from the picture's middle")
    f: float = slider(
        150.0, 60.0, 400.0, 5.0, unit="px", label="focal length", help="r for a small angle of one radian"
    )
    yaw_deg: float = slider(35.0, -180.0, 180.0, 1.0, label="window yaw", unit="°", help="to the right")
    pitch_deg: float = slider(-20.0, -90.0, 90.0, 1.0, label="window pitch", unit="°", help="up")
    hfov_deg: float = slider(80.0, 20.0, 120.0, 1.0, label="window's field", unit="°", help="of the perspective window")
    panels: str = "picture window numbers curves rays"
    yours: Callable[..., Any] | None = field(default=None, compare=False, repr=False)
    eye: OrbitCamera = OrbitCamera(target=(0.0, 0.0, 0.2), distance=4.4, yaw_deg=-40, pitch_deg=22)

    def __post_init__(self) -> None:
        super().__post_init__()
        wanted = self.panels.split()
        if "picture" not in wanted or not set(wanted) <= {*_WIDE}:
            others = ", ".join(list(_WIDE)[1:])
            raise ValueError(f"panels must be picture and any of {others} beside it, got {self.panels!r}")

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

    def _told(self) -> dict[str, str]:
        """The figures that the panels speak of."""
        spoken = {"a ray": "curves numbers", "pixels": "numbers", "window": "window"}  # by how a figure's name begins
        silent = tuple(start for start, by in spoken.items() if not any(map(self._has, by.split())))
        return {name: figure for name, figure in self.numbers().items() if not name.startswith(silent)}

    def description(self) -> str:
        figures = listed(self._told())
        window = (
            f" The window looks {self.yaw_deg:.0f}° to the right and {self.pitch_deg:.0f}° up "
            f"and is {self.hfov_deg:.0f}° wide."
        )
        words = f"{self.projection}, {EQUATIONS[self.projection]}, f = {self.f:g} px: {figures}."
        return true_minus(words + window * self._has("window"))

    # The picture -----------------------------------------------------------------------------------------------------

    def figure(self, *, draft: bool = False) -> Picture:
        image, taken = _photographed(self.camera, garden.DRAFT if draft else garden.FINE)
        photographs = {"fisheye": taken}
        parts = {"picture": self._picture_panel()}
        if self._has("window") or self._has("yours"):
            photographs["window"] = jpeg(self._cut(image, draft))
        if self._has("yours"):
            parts["yours"], attached = self._your_panel(image, draft)
            photographs |= attached
        if self._has("rays"):
            parts["rays"], attached = self._dome_panel(draft)
            photographs |= attached
        plain = {"window": self._window_panel, "numbers": self._numbers, "curves": self._curves_panel}
        parts |= {name: draw() for name, draw in plain.items() if self._has(name)}
        return self.tiled(self._layout, {name: parts[name] for name in self._layout}, photographs)

    @cached_property
    def _layout(self) -> dict[str, Cell]:
        """As many panels in a row as it has room for, in their order."""
        pair = {"window": _PAIR, "yours": _PAIR} if self._has("window") and self._has("yours") else {}
        lines: list[dict[str, float]] = [{}]
        for name, width in (_WIDE | pair).items():
            if self._has(name) and sum(lines[-1].values()) + width > WIDTH:
                lines.append({})
            lines[-1] |= {name: width} if self._has(name) else {}
        cells = rows(*((_IMAGES if {"picture", "window", "yours"} & {*line} else _OTHERS, line) for line in lines))
        return shortened(cells, **dict.fromkeys(pair, _PAIR_HIGH))

    def _cut(self, image: np.ndarray, draft: bool) -> np.ndarray:
        """The window's picture, cut out of the fisheye's `image`, which is as small as a draft is."""
        small = Camera(self.camera.intrinsics.within(image.shape[1]), self.camera.lens)
        return np.asarray(reproject(image, small, self._seen(draft), antialias=False))

    def _seen(self, draft: bool) -> Camera:
        seen = self.window
        return Camera(seen.intrinsics.resized(160, 120), seen.lens, seen.world_from_cam) if draft else seen

    @cached_property
    def _panel(self) -> Panel:
        return image_in(self._layout["picture"], "fisheye", SIDE, SIDE)

    def _picture_panel(self) -> svg.Marks:
        panel = self._panel
        content = placed_image(panel, "fisheye", SIDE, SIDE)
        content += self._grid_lines(panel) if self.yours else self._beside(panel)
        title = f"The {self.projection} lens"
        if not self._has("window"):
            return panel.show(content, title=title)
        outline = self.camera.project(self.window.unproject(self.window.intrinsics.border(16)))
        edges = closed(outline)
        far = np.linalg.norm(np.diff(edges, axis=0, append=edges[:1]), axis=-1) > SIDE / 2  # once round the back
        edges[far] = np.nan
        content += on_photograph([panel.place(edges)], "yellow thick")
        label = "The fisheye's picture; drag it, or press the arrow keys, to move the window; plus and minus zoom"
        return panel.show(content, title=title, hint="drag the window", drag="window", label=label)

    def _window_panel(self) -> svg.Marks:
        panel = image_in(self._layout["window"], "cut", 320, 240)
        note = f"perspective, {self.hfov_deg:.0f}° wide"
        return panel.show(placed_image(panel, "window", 320, 240), title="The window cut out of it", note=note)

    def _curves_panel(self) -> svg.Marks:
        x, y, width, height = self._layout["curves"]
        around = x + 60, y + 34, width - 70, height - 82
        panel = plot.plot_panel("curves", *around, (0, 180), (-1.8 if self.yours else 0, _TOP))
        edge = SIDE / 2 / self.f
        drawn = plot.grid(panel) + plot.upright(panel, 90, "muted dashed")
        drawn += svg.line(panel.place([(0, edge), (180, edge)]), "green dashed") if edge < _TOP else svg.NOTHING
        names = sorted(LENSES, key=lambda name: name == self.projection) if not self.yours else [self.projection]
        for name in names:
            theta = np.linspace(0, _LAST[name], 181)
            radius = self.radius(np.radians(theta), name)
            drawn += plot.curve(panel, theta, radius, f"{_COLOURS[name]} {self._weight(name)}")
        drawn += self._your_curve(panel) if self.yours else svg.join(self._name(panel, name) for name in names)
        if edge < 0.92 * _TOP and not self.yours:
            drawn += svg.text(panel.place((2, edge)) + (0, -6), "edge of the picture", "green halo")
        return plot.axes(panel, "θ, angle from the axis [°]", "r / f") + panel.show(
            drawn, title="How far from the middle", note=EQUATIONS[self.projection]
        )

    def _beside(self, panel: Panel) -> svg.Marks:
        """The circle of the rays from beside the camera, where the picture has it."""
        c, r = (SIDE - 1) / 2, self.f * float(self.radius(np.array(pi / 2)))
        if not r < c:
            return svg.NOTHING
        turn = np.linspace(0, 2 * pi, 121)
        ring = panel.place(c + r * np.stack([np.cos(turn), np.sin(turn)], axis=-1))
        return on_photograph([ring], "yellow dashed") + svg.text(
            panel.place((c, c - r)) + (0, 16), "90°", "yellow halo middle"
        )

    # The reader's own function ---------------------------------------------------------------------------------------

    def _your_pixels(self, points: Array) -> tuple[Array, str]:
        """Where the reader's function puts camera-frame points (..., 3), and what is wrong with it."""
        k = self.camera.intrinsics
        uv, problem = answered(self.yours, (points, k.fx, k.cx, k.cy), points[..., :2])
        return np.where(np.abs(uv) < _FAR, uv, np.nan), problem

    def _grid_lines(self, panel: Panel) -> svg.Marks:
        """Circles every 30° around the axis, and twelve lines out from it: where they land, and by the reader's own."""
        turn = np.linspace(0.01, 2 * pi + 0.01, 73)
        reach = np.radians(np.linspace(2, min(self.half_field_deg(), 150), 73))
        circle = np.stack([np.cos(turn), np.sin(turn)], axis=-1)
        lines = np.array(
            [_ring(circle, radians(theta)) for theta in (30, 60, 90)]
            + [_meridian(reach, around) for around in np.linspace(0.01, 2 * pi + 0.01, 13)[:-1]]
        )
        yours, _ = self._your_pixels(lines)
        right = svg.path(panel.place(self.camera.project(lines)), "yellow thin")
        return right + svg.path(panel.place(yours), "orange dashed")

    def _your_curve(self, panel: Panel) -> svg.Marks:
        """r/f by the reader's function, of rays to the right, and what the lines are."""
        theta = np.linspace(1, 179, 179)  # neither on the axis nor straight behind, where no direction is told
        entries = [(_COLOURS[self.projection], self.projection), ("orange dashed", "yours"), ("green dashed", "edge")]
        uv, _ = self._your_pixels(_meridian(np.radians(theta), 0.0))
        radius = (uv[..., 0] - self.camera.intrinsics.cx) / self.f
        return plot.curve(panel, theta, radius, "orange dashed thick") + plot.legend(panel, entries)

    def _your_panel(self, image: np.ndarray, draft: bool) -> Drawn:
        """The window once more, every pixel of it looked up where the reader's function says."""
        panel = image_in(self._layout["yours"], "yours", 320, 240)
        seen = self._seen(draft)
        uv, problem = self._your_pixels(seen.rays())
        if problem:
            right = placed_image(panel, "window", 320, 240)
            return without(panel, problem, "Cut by your function", right=right), {}
        cut = garden.looked_up(image, uv, SIDE)
        return panel.show(placed_image(panel, "yours", 320, 240), title="Cut by your function"), {"yours": jpeg(cut)}

    def _weight(self, name: str) -> str:
        return "thick" if name == self.projection else "half"

    def _name(self, panel: Panel, name: str) -> svg.Marks:
        places = {
            "perspective": (69, 2.95, "end"),
            "stereographic": (117, 2.95, ""),
            "equidistant": (178, 2.25, "end"),
            "equisolid": (176, 1.72, "end"),
            "orthographic": (92, 0.72, ""),
        }
        x, y, side = places[name]
        return svg.text(panel.place((x, y)), name, f"{_COLOURS[name]} halo {side}", font_weight=self._boldness(name))

    def _boldness(self, name: str) -> int:
        return 600 if name == self.projection else 400

    # The dome --------------------------------------------------------------------------------------------------------

    def _dome_panel(self, draft: bool) -> Drawn:
        x, y, width, height = self._layout["rays"]
        panel = space_panel("dome", x + 10, y + 34, width - 20, height - 44)
        label = "The rays in space; drag or press the arrow keys to walk around"
        return self.in_space(panel, self._rays(), draft, "Its rays", label)

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
        items.append(Line(closed(rim), "yellow", 2.6))
        items += [Line(np.stack([np.zeros(3), corner]), "yellow", 1.4) for corner in rim[::6]]
        return [*items, Dots(np.zeros(3), "ink", 7), *axes_triad(self.camera.world_from_cam, 0.5)]

    # The numbers -----------------------------------------------------------------------------------------------------

    def _numbers(self) -> svg.Marks:
        x = self._layout["numbers"][0] + 10
        law = svg.text((x, 50), EQUATIONS[self.projection]) + svg.text((x, 70), f"f = {self.f:g} px")
        return svg.text((x, 26), "This lens", "title") + law + readout(self._told(), (x, 104), (0, 42), (0, 17))

    # Touch -----------------------------------------------------------------------------------------------------------

    def dragged(self, handle: str, x: float, y: float, dx: float, dy: float) -> Self:
        if handle != "window":
            return super().dragged(handle, x, y, dx, dy)
        here = self.camera.project(_direction(self.yaw_deg, self.pitch_deg))
        return self._looking_at(here + (dx, dy) / self._panel.scale)

    def pressed(self, handle: str, key: str) -> Self:
        zooms = {"+": -5.0, "=": -5.0, "-": 5.0, "_": 5.0}
        if handle == "window" and key in zooms:
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
