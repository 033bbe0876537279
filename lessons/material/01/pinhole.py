"""The pinhole visualizer: a box with a hole, the picture of the garden on its wall, and how sharp that can be.

A reader's own projection can draw the garden's outlines over that picture.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace
from functools import cached_property, lru_cache
from typing import Any, ClassVar

import cv2
import numpy as np

from camviz import optics
from camviz.cameras import Camera, Intrinsics
from camviz.draw import svg
from camviz.draw.flow import Cell, Part, rows
from camviz.draw.panel import Panel, image_in, placed_image
from camviz.draw.picture import Picture, jpeg
from camviz.draw.plot import axes, curve, logarithmic_grid, logs, plot_panel
from camviz.draw.readout import listed, readout, seconds
from camviz.draw.space import OrbitCamera, space_panel
from camviz.poses import RigidTransform
from camviz.scenes import render, textured_scene, to_display
from camviz.views.base import Drawn, OrbitView, answered, positive, slider, step_of, switch, without
from camviz_school.views.box_in_space import ENLARGED, TOWER, TOWER_M, WALL_MM, box_and_garden, garden_outlines

PIXELS = 480  # across the wall: 75 µm each
WHITE_PHOTONS = 2000  # in a pixel that is just white
_WIDTHS = {"box": 560, "picture": 400, "yours": 400, "blur": 560}  # of the panels, where they stand alone
_NUMBERS: dict[str, float] = {"numbers": 290, "similar triangles": 270}
_TILES = {"picture": "picture on the wall", "yours": "projected by you"}  # of panels that are not called as they are
LAMP_PX = np.array([40.0, 30.0])  # where the lamp is seen, from the principal point of the upright picture
_HOLES, _BLURS = (0.05, 2.0), (0.1, 4.0)  # the plot's range, mm
_POINTS = {  # of the tower, from its middle, metres: what the rays start from
    "blue": (0.0, -TOWER_M / 2, 0.0),
    "orange": (0.0, TOWER_M / 2, 0.0),
    "green": (-0.27, -TOWER_M / 2 + 0.27, 0.0),
    "red": (0.27, -TOWER_M / 2 + 0.27, 0.0),
}


@dataclass(frozen=True)
class PinholeView(OrbitView):
    """A light-tight box with a hole, `object_m` metres from a crate with a globe on it.

    The picture is ray-traced, blurred by what waves make of the hole in green light, dimmed by the exposure and, with
    `noise`, counted in photons. `match_exposure` exposes for as long as it takes instead of `exposure_s`. On the wall
    the picture is turned by 180°, seen from behind; `turn_picture` puts it upright.

    `lamp_m` metres from the hole, on the ray of one pixel, hangs a yellow lamp; at 0 there is none.

    `panels` names what is drawn, one to four of box, picture, yours and blur, and the numbers beside them. `yours` is
    the upright picture with the garden's outlines over it, in orange, as they are projected by a reader's function of
    (points, f, cx, cy): points (..., 3) in camera coordinates to pixels (..., 2), with f, cx and cy in pixels. Beside
    it the picture is upright, too, and its outlines are yellow.
    """

    title: ClassVar[str] = "Pinhole camera"
    openable: ClassVar[Mapping[str, str]] = {
        "box": "box in space",
        "picture": "picture",
        "blur": "blur curve",
        "numbers": "numbers",
    }

    hole_mm: float = slider(0.3, 0.05, 2.0, 0.01, label="hole d", unit="mm", help="diameter of the hole")
    depth_mm: float = slider(50.0, 15.0, 120.0, 1.0, label="depth f", unit="mm", help="from the hole to the wall")
    object_m: float = slider(3.0, 1.0, 6.0, 0.05, label="distance Z", unit="m", help="from the hole to the globe")
    exposure_s: float = slider(1.0, 0.05, 10.0, 0.05, label="exposure", unit="s", help="how long the hole is open")
    match_exposure: bool = switch(False, label="match exposure", help="expose as long as the brightness needs")
    turn_picture: bool = switch(False, label="turn the picture", help="as it hangs on the wall, or upright")
    lamp_m: float = slider(0.0, 0.0, 6.0, 0.05, label="lamp s", unit="m", help="from the hole, on one pixel's ray")
    noise: bool = switch(True, label="photon noise", help="light arrives in photons: dim pictures are grainy")
    eye: OrbitCamera = OrbitCamera(
        distance=0.8, yaw_deg=46, pitch_deg=18
    )  # its distance counts in lengths of what there is to see
    panels: str = "box picture blur numbers"
    yours: Callable[..., Any] | None = field(default=None, compare=False, repr=False)

    def __post_init__(self) -> None:
        super().__post_init__()
        positive(self, "hole_mm", "depth_mm", "object_m", "exposure_s")
        if self.lamp_m < 0:
            raise ValueError(f"lamp_m must not be below zero, got {self.lamp_m}")
        if not self._drawn or not set(self.panels.split()) <= {*_WIDTHS, "numbers"}:
            raise ValueError(
                f"panels must be one or more of {', '.join(_WIDTHS)}, and numbers beside them, got {self.panels!r}"
            )

    # What is true ----------------------------------------------------------------------------------------------------

    @property
    def shadow_mm(self) -> float:
        """Diameter of the hole's shadow on the wall."""
        return float(optics.geometric_blur_mm(self.hole_mm, self.depth_mm, 1000 * self.object_m))

    @property
    def airy_mm(self) -> float:
        """Diameter of the Airy disc on the wall."""
        return float(optics.diffraction_blur_mm(self.hole_mm, self.depth_mm))

    @property
    def blur_mm(self) -> float:
        """Diameter of a point's image on the wall."""
        return float(optics.pinhole_blur_mm(self.hole_mm, self.depth_mm, 1000 * self.object_m))

    @property
    def exposed_s(self) -> float:
        """How long the hole is open."""
        matched = 1 / float(optics.sunny_exposure(self.hole_mm, self.depth_mm, 1.0))
        return matched if self.match_exposure else self.exposure_s

    @property
    def brightness(self) -> float:
        """Light gathered, 1 being a correct exposure."""
        return float(optics.sunny_exposure(self.hole_mm, self.depth_mm, self.exposed_s))

    def camera(self, width: int = PIXELS) -> Camera:
        """The box as a camera: its wall `width` pixels across, `object_m` in front of the globe."""
        pixels = Intrinsics.from_sensor(width, width * 3 // 4, self.depth_mm, 1000 * WALL_MM[0] / width)
        return Camera(pixels, world_from_cam=RigidTransform.from_translation(TOWER - (0, 0, self.object_m)))

    @cached_property
    def _tower_image_mm(self) -> float:
        return self.depth_mm * TOWER_M / self.object_m

    def numbers(self) -> dict[str, str]:
        """The state's key figures, as text."""
        pitch_mm = WALL_MM[0] / PIXELS
        blur = {
            "hole's shadow": f"{1000 * self.shadow_mm:.0f} µm",
            "Airy disc": f"{1000 * self.airy_mm:.0f} µm",
            "blur on the wall": f"{1000 * self.blur_mm:.0f} µm = {self.blur_mm / pitch_mm:.1f} px",
        }
        return {
            "f-number": f"f/{float(optics.f_number(self.hole_mm, self.depth_mm)):.0f}",
            "field of view": f"{optics.field_of_view_deg(WALL_MM[0], self.depth_mm):.1f}° across",
            **(blur if self._has("blur") else {}),
            "exposure": seconds(self.exposed_s),
            "brightness": f"{_times(self.brightness)} correct",
        }

    def equation(self) -> str:
        """Similar triangles, with this state's numbers."""
        given = f"{self.depth_mm:g} mm · {TOWER_M:g} m / {self.object_m:.2f} m"
        return f"h = f H / Z = {given} = {self._tower_image_mm:.1f} mm"

    def description(self) -> str:
        figures = listed(self.numbers())
        shown = "upright" if self._upright else "upside down, as on the wall"
        lamp = f" A lamp hangs {self.lamp_m:g} m from the hole." if self.lamp_m else ""
        return (
            f"A hole of {self.hole_mm:g} mm, {self.depth_mm:g} mm before the wall, {self.object_m:g} m from the globe: "
            f"{figures}; the crate and globe, {TOWER_M} m tall, are {self._tower_image_mm:.1f} mm tall on the wall. "
            f"Picture shown {shown}.{lamp}"
        )

    @property
    def _upright(self) -> bool:
        return self.turn_picture or self._has("yours")  # pixels count in the upright picture

    @property
    def _drawn(self) -> list[str]:
        """The panels beside the numbers, in their order."""
        return [name for name in self.panels.split() if name != "numbers"]

    def figure(self, *, draft: bool = False) -> Picture:
        upright = self.image(320 if draft else PIXELS)
        parts, photographs = dict[str, Part](), dict[str, bytes]()
        layout = self._layout
        for name in self._drawn:
            if name == "box":
                parts[name], more = self._box_panel(layout[name], upright, draft)
                photographs |= more
            else:
                draw = {"picture": self._picture_panel, "yours": self._your_panel, "blur": self._blur_panel}[name]
                parts[name] = draw(layout[name])
        if self._has("picture") or self._has("yours"):
            photographs["wall"] = jpeg(upright if self._upright else upright[::-1, ::-1].copy())
        if self._has("numbers"):
            parts |= self._numbers(layout)
        tiles = {_TILES.get(name, name): cell for name, cell in layout.items()}
        return self.tiled(tiles, {_TILES.get(name, name): part for name, part in parts.items()}, photographs)

    @cached_property
    def _layout(self) -> dict[str, Cell]:
        """Two panels in the first row, the others below them, and the numbers where there is room."""
        first, below = self._drawn[:2], self._drawn[2:]
        across = _WIDTHS[first[0]] if len(first) == 1 else 960
        height = 374 if set(first) == {"picture", "yours"} else 330
        found = [(height, _shared(first, across))]
        numbers = _NUMBERS if self._has("numbers") else dict[str, float]()
        tall = 200 if self._has("blur") else 172 if self._has("yours") else 136
        if numbers and len(below) == 1:
            found.append((252, {**_shared(below, 400), **numbers}))
        else:
            found += [(252, _shared(below, 960))] if below else []
            found += [(tall, numbers)] if numbers else []
        cells = rows(*found)
        heights = {name: tall if name == "numbers" else min(tall, 172) for name in numbers}
        return {name: (x, y, width, heights.get(name, height)) for name, (x, y, width, height) in cells.items()}

    # The picture -----------------------------------------------------------------------------------------------------

    def image(self, width: int = PIXELS) -> np.ndarray:
        """The picture, upright, as sRGB bytes (3/4 width, width, 3)."""
        sharp = _sharp(self.depth_mm, self.object_m, width)
        kernel = optics.pinhole_kernel(WALL_MM[0] / width, self.hole_mm, self.depth_mm, 1000 * self.object_m)
        light = self.brightness * cv2.filter2D(sharp, -1, kernel, borderType=cv2.BORDER_REPLICATE)
        if self.noise:  # Poisson's: the variance of a count is its mean
            light += np.sqrt(np.maximum(light, 0) / WHITE_PHOTONS) * _grain(light.shape)
        return to_display(light)

    def _picture_panel(self, cell: Cell) -> svg.Marks:
        panel, picture = self._image_panel("wall", cell)
        if self._has("yours"):
            lines = Camera(self.camera().intrinsics).project(self._outlines)
            outlines = svg.path(panel.place(lines), "yellow")
            return panel.show(picture + outlines, title="The picture, its outlines projected")
        title = "The picture, as a display shows it" if self._upright else "On the wall, from behind"
        size = f"{WALL_MM[0]:g} × {WALL_MM[1]:g} mm" if self._has("numbers") else ""
        return panel.show(picture + self._marks(panel), title=title, note=size)

    def _image_panel(self, name: str, cell: Cell) -> tuple[Panel, svg.Marks]:
        """A panel of the picture in a tile, and the picture in it."""
        pixels = self.camera().intrinsics
        panel = image_in(cell, name, pixels.width, pixels.height)
        return panel, placed_image(panel, "wall", pixels.width, pixels.height)

    def _marks(self, panel: Panel) -> svg.Marks:
        """Where the rays that the box shows meet the wall."""
        if self.lamp_m:
            middle = (np.array([PIXELS, PIXELS * 3 // 4]) - 1) / 2
            return svg.dots([panel.place(middle + (LAMP_PX if self._upright else -LAMP_PX))], "yellow ringed", 10)
        if not self._has("box"):
            return svg.NOTHING
        ends = panel.place([self._pixel(_POINTS["blue"]), self._pixel(_POINTS["orange"])])
        return svg.line(ends, "yellow dashed thin") + svg.join(
            svg.dots([panel.place(self._pixel(point))], f"{colour} ringed", 8) for colour, point in _POINTS.items()
        )

    def _pixel(self, point: tuple[float, float, float]) -> np.ndarray:
        """Where a point of the tower is in the picture shown."""
        pixels = self.camera().intrinsics
        uv = self.camera().project(TOWER + point)
        return uv if self._upright else np.array([pixels.width - 1, pixels.height - 1]) - uv

    # The reader's own projection -------------------------------------------------------------------------------------

    @property
    def _outlines(self) -> np.ndarray:
        """The garden's outlines in camera coordinates; the box is not turned."""
        return garden_outlines() - self.camera().centre

    def _your_panel(self, cell: Cell) -> svg.Marks:
        """The picture with the garden's outlines over it as the reader's function projects them."""
        panel, picture = self._image_panel("yours", cell)
        pixels, points = self.camera().intrinsics, self._outlines
        lines, problem = answered(self.yours, (points, pixels.fx, pixels.cx, pixels.cy), points[..., :2])
        title = "The same, by your function"
        if problem:
            right = Camera(pixels).project(points)
            return without(panel, problem, title, right=picture + svg.path(panel.place(right), "yellow"))
        return panel.show(picture + svg.path(panel.place(lines), "orange"), title=title)

    def _pixel_numbers(self, x: float, y: float) -> svg.Marks:
        """What the reader's function is given, from a place on."""
        pixels, pitch_um = self.camera().intrinsics, 1000 * WALL_MM[0] / PIXELS
        given = [
            ("focal length", f"f = {self.depth_mm:g} mm / {pitch_um:g} µm = {pixels.fx:.1f} px"),
            ("principal point", f"cx = {pixels.cx:g} px, cy = {pixels.cy:g} px"),
            ("picture", f"{pixels.width} × {pixels.height} pixels, {WALL_MM[0]:g} × {WALL_MM[1]:g} mm"),
        ]
        return svg.text((x, y), "What your function is given", "title") + readout(given, (x, y + 26), (0, 44), (0, 19))

    # The box ---------------------------------------------------------------------------------------------------------

    def _box_panel(self, cell: Cell, upright: np.ndarray, draft: bool) -> Drawn:
        x, y, width, height = cell
        panel = space_panel("box", x + 10, y + 34, width - 20, height - 45)
        behind = ENLARGED * self.depth_mm / 1000
        extent = self.object_m + behind
        aim = (0.0, 0.0, (self.object_m - behind) / 2 - 0.08 * extent)
        eye = replace(self.eye, target=aim, distance=self.eye.distance * (extent + 2))
        label = "The box and the garden in space; drag or press the arrow keys to walk around"
        note = f"the box is drawn {ENLARGED} times as large"
        heading: dict[str, Any] = {"eye": eye, "note": note, "hint": "", "drag": "orbit"}
        items = box_and_garden(upright, self.depth_mm, self.object_m, self._ray_starts(), lamp=self.lamp_m > 0)
        return self.in_space(panel, items, draft, "Light in a box", label, **heading)

    def _ray_starts(self) -> dict[str, np.ndarray]:
        """Where the rays start that the box shows, by their colours, from the hole: at the tower, or at the lamp."""
        if self.lamp_m:
            along = np.append(LAMP_PX, self.camera().intrinsics.fx)
            return {"yellow": self.lamp_m * along / np.linalg.norm(along)}
        return {colour: np.array(point) + (0, 0, self.object_m) for colour, point in _POINTS.items()}

    # The blur --------------------------------------------------------------------------------------------------------

    @cached_property
    def _plot(self) -> Panel:
        x, y, width, height = self._layout["blur"]
        return plot_panel("blur", x + 76, y + 34, width - 84, height - 86, logs(_HOLES), logs(_BLURS))

    def _blur_panel(self, cell: Cell) -> svg.Marks:
        panel = self._plot
        hole = np.geomspace(*_HOLES, 121)
        shadow = optics.geometric_blur_mm(hole, self.depth_mm, 1000 * self.object_m)
        airy = optics.diffraction_blur_mm(hole, self.depth_mm)
        total = optics.pinhole_blur_mm(hole, self.depth_mm, 1000 * self.object_m)
        lines = [(shadow, "orange dashed"), (airy, "green dashed"), (total, "blue thick")]
        right, left = (panel.place(logs((hole[i], y[i]))) for i, y in ((104, shadow), (2, airy)))
        content = (
            logarithmic_grid(panel, _HOLE_TICKS, _BLUR_TICKS)
            + svg.join(curve(panel, np.log10(hole), np.log10(y), class_) for y, class_ in lines)
            + svg.text((panel.width - 10, right[1] + 62), "the hole's shadow", "orange halo end")
            + svg.text(left + (0, 50), "diffraction", "green halo")
            + svg.text(right + (-14, -8), "both together", "blue halo end")
            + self._best_mark(panel)
            + svg.dots([panel.place(logs((self.hole_mm, self.blur_mm)))], "red", 11)
        )
        label = "Blur against the hole's diameter; drag or press the arrow keys to change the hole"
        names = "hole diameter d [mm], logarithmic", "blur [µm]"
        return axes(panel, *names, _HOLE_TICKS, _BLUR_TICKS, aside=52) + panel.show(
            content, title="Blur on the wall", hint="drag to change the hole", drag="hole", label=label
        )

    def _best_mark(self, panel: Panel) -> svg.Marks:
        """Where the blur is least, and the holes that Rayleigh and Young recommend."""
        best = float(optics.best_hole_mm(self.depth_mm))
        young = float(optics.best_hole_mm(self.depth_mm, constant=optics.YOUNG))
        left, right = (panel.place((np.log10(d), 0))[0] for d in (best, young))
        words = f"sharpest: {best:.2f} to {young:.2f} mm"
        at, side = ((left - 6, 16), "end") if right > panel.width / 2 else ((right + 6, 16), "")
        band = svg.rectangle(left, 0, right - left, panel.height, "wash fill-blue")
        return band + svg.text(at, words, f"blue halo {side}")

    def dragged(self, handle: str, x: float, y: float, dx: float, dy: float) -> PinholeView:
        if handle != "hole":
            return super().dragged(handle, x, y, dx, dy)
        log = np.log10(self.hole_mm) + dx / self._plot.scale[0]
        return self.but(hole_mm=float(np.clip(10**log, *_HOLES)))

    def pressed(self, handle: str, key: str) -> PinholeView:
        if handle != "hole":
            return super().pressed(handle, key)
        return self.dragged(handle, 0, 0, 8 * step_of(key), 0)

    # The numbers -----------------------------------------------------------------------------------------------------

    def _numbers(self, layout: Mapping[str, Cell]) -> dict[str, svg.Marks]:
        (x, y), (right, top) = ((layout[name][0] + 20, layout[name][1] + 26) for name in _NUMBERS)
        numbers = svg.text((x, y), "This box", "title") + readout(self.numbers(), (x, y + 24), (0, 22), (122, 0))
        numbers = self._pixel_numbers(x, y) if self._has("yours") else numbers
        return {"numbers": numbers, "similar triangles": self._triangles(right, top)}

    def _triangles(self, x: float, y: float) -> svg.Marks:
        """How tall the crate and globe are on the wall, from a place on."""
        similar = self.equation().replace(" = ", "\n= ").replace("\n", " ", 1)
        words = svg.paragraph((x, y + 24), f"The crate and globe on the wall:\n{similar}", 250, "label")
        return svg.text((x, y), "By similar triangles", "title") + words


@lru_cache(maxsize=2)
def _sharp(depth_mm: float, object_m: float, width: int) -> np.ndarray:
    """What an ideal point for a hole would see: linear light."""
    light = render(textured_scene(), PinholeView(depth_mm=depth_mm, object_m=object_m).camera(width))
    light.flags.writeable = False
    return light


@lru_cache(maxsize=2)
def _grain(shape: tuple[int, ...]) -> np.ndarray:
    """One fixed draw of standard normal numbers, so that the grain holds still while something else moves."""
    return np.random.default_rng(1).standard_normal(shape, dtype=np.float32)


def _shared(names: list[str], across: float) -> dict[str, float]:
    """The widths of some panels that fill a row together."""
    return {name: across * _WIDTHS[name] / sum(_WIDTHS[one] for one in names) for name in names}


_HOLE_TICKS = [(float(np.log10(d)), f"{d:g}") for d in (0.05, 0.1, 0.2, 0.5, 1, 2)]
_BLUR_TICKS = [(float(np.log10(b)), f"{1000 * b:g}") for b in (0.1, 0.2, 0.5, 1, 2, 4)]


def _times(factor: float) -> str:
    return f"{factor:#.2g} ×" if factor < 10 else f"{factor:.0f} ×"
