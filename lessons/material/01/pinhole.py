"""The pinhole visualizer: a box with a hole, the picture of the garden on its wall, and how sharp that can be.

A reader's own projection can draw the garden's outlines over that picture.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field, replace
from functools import cached_property, lru_cache
from typing import Any, ClassVar

import cv2
import numpy as np

from camviz import optics
from camviz.cameras import Camera, Intrinsics
from camviz.draw import svg
from camviz.draw.flow import rows
from camviz.draw.items import closed
from camviz.draw.panel import Panel, image_panel, placed_image
from camviz.draw.picture import Picture, jpeg
from camviz.draw.plot import axes, curve, logarithmic_grid, logs, plot_panel
from camviz.draw.readout import listed, readout, seconds
from camviz.draw.space import Dots, Face, Item, Label, Line, OrbitCamera, TexturedMesh, space_panel
from camviz.poses import RigidTransform
from camviz.scenes import render, snapshot, textured_scene, to_display
from camviz.views.base import Drawn, OrbitView, answered, positive, slider, step_of, switch

WALL_MM = np.array([36.0, 27.0])
PIXELS = 480  # across the wall: 75 µm each
WHITE_PHOTONS = 2000  # in a pixel that is just white
ENLARGED = 30  # the box beside the garden, or nobody would see it
TOWER = np.array([0.68, 0.67, 3.3])  # the middle of the crate and the globe on it, in the world
TOWER_M = 1.16
_POINTS_A_LINE = 33
_GRID = np.array([[0, 1], [3, 2]])  # of an outline's corners, as a picture hangs on them
_PANELS = ("box picture blur", "box picture", "picture yours")
_ABOVE = (330, {"box": 560, "picture on the wall": 400})
_LAYOUTS = {
    "box picture blur": rows(_ABOVE, (252, {"blur": 400}))
    | {"numbers": (400, 330, 290, 200), "similar triangles": (690, 330, 270, 136)},
    "box picture": rows(_ABOVE, (136, {"numbers": 290, "similar triangles": 270})),
    "picture yours": rows(
        (376, {"projected rightly": 480, "projected by you": 480}), (172, {"numbers": 290, "similar triangles": 270})
    ),
}
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

    `panels` names what is drawn: "box picture blur"; without blur, for readers who are to predict it; or "picture
    yours", the upright picture with the garden's outlines over it, once as they are projected, in yellow, and once in
    orange by `yours`, a reader's function of (points, f, cx, cy): points (..., 3) in camera coordinates to pixels
    (..., 2), with f, cx and cy in pixels.
    """

    title: ClassVar[str] = "Pinhole camera"
    layouts = _PANELS

    hole_mm: float = slider(0.3, 0.05, 2.0, 0.01, label="hole d", unit="mm", help="diameter of the hole")
    depth_mm: float = slider(50.0, 15.0, 120.0, 1.0, label="depth f", unit="mm", help="from the hole to the wall")
    object_m: float = slider(3.0, 1.0, 6.0, 0.05, label="distance Z", unit="m", help="from the hole to the globe")
    exposure_s: float = slider(1.0, 0.05, 10.0, 0.05, label="exposure", unit="s", help="how long the hole is open")
    match_exposure: bool = switch(False, label="match exposure", help="expose as long as the brightness needs")
    turn_picture: bool = switch(False, label="turn the picture", help="as it hangs on the wall, or upright")
    noise: bool = switch(True, label="photon noise", help="light arrives in photons: dim pictures are grainy")
    eye: OrbitCamera = OrbitCamera(
        distance=0.8, yaw_deg=46, pitch_deg=18
    )  # its distance counts in lengths of what there is to see
    panels: str = "box picture blur"
    yours: Callable[..., Any] | None = field(default=None, compare=False, repr=False)

    def __post_init__(self) -> None:
        super().__post_init__()
        positive(self, "hole_mm", "depth_mm", "object_m", "exposure_s")

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
            **(blur if "blur" in self.panels else {}),
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
        return (
            f"A hole of {self.hole_mm:g} mm, {self.depth_mm:g} mm before the wall, {self.object_m:g} m from the globe: "
            f"{figures}; the crate and globe, {TOWER_M} m tall, are {self._tower_image_mm:.1f} mm tall on the wall. "
            f"Picture shown {shown}."
        )

    @property
    def _upright(self) -> bool:
        return self.turn_picture or "yours" in self.panels  # pixels count in the upright picture

    def figure(self, *, draft: bool = False) -> Picture:
        upright = self.image(320 if draft else PIXELS)
        photographs = {"wall": jpeg(upright if self._upright else upright[::-1, ::-1].copy())}
        if "yours" in self.panels:
            parts = self._both_projections()
        else:
            box, more = self._box_panel(upright, draft)
            photographs |= more
            parts = {"box": box, "picture on the wall": self._picture_panel()}
            parts |= {"blur": self._blur_panel() if "blur" in self.panels else ""} | self._numbers()
        return self.tiled(_LAYOUTS[self.panels], parts, photographs)

    # The picture -----------------------------------------------------------------------------------------------------

    def image(self, width: int = PIXELS) -> np.ndarray:
        """The picture, upright, as sRGB bytes (3/4 width, width, 3)."""
        sharp = _sharp(self.depth_mm, self.object_m, width)
        kernel = optics.pinhole_kernel(WALL_MM[0] / width, self.hole_mm, self.depth_mm, 1000 * self.object_m)
        light = self.brightness * cv2.filter2D(sharp, -1, kernel, borderType=cv2.BORDER_REPLICATE)
        if self.noise:  # Poisson's: the variance of a count is its mean
            light += np.sqrt(np.maximum(light, 0) / WHITE_PHOTONS) * _grain(light.shape)
        return to_display(light)

    def _picture_panel(self) -> str:
        pixels = self.camera().intrinsics
        panel = image_panel("wall", 570, 34, 380, pixels.width, pixels.height)
        marks = "".join(
            svg.dots([panel.place(self._pixel(point))], f"{colour} ringed", 8) for colour, point in _POINTS.items()
        )
        ends = panel.place([self._pixel(_POINTS["blue"]), self._pixel(_POINTS["orange"])])
        title = "The picture, turned upright" if self._upright else "On the wall, from behind"
        content = (
            placed_image(panel, "wall", pixels.width, pixels.height) + svg.line(ends, "yellow dashed thin") + marks
        )
        return panel.show(content, title=title, note=f"{WALL_MM[0]:g} × {WALL_MM[1]:g} mm")

    def _pixel(self, point: tuple[float, float, float]) -> np.ndarray:
        """Where a point of the tower is in the picture shown."""
        pixels = self.camera().intrinsics
        uv = self.camera().project(TOWER + point)
        return uv if self._upright else np.array([pixels.width - 1, pixels.height - 1]) - uv

    # The reader's own projection -------------------------------------------------------------------------------------

    def _both_projections(self) -> dict[str, str]:
        """The picture twice, with the garden's outlines over it: as they are projected, and as the reader does it."""
        camera = self.camera()
        outlines = _garden_outlines() - camera.centre  # the box is not turned
        right = Camera(camera.intrinsics).project(outlines)
        yours, problem = self._your_pixels(outlines)
        words = svg.paragraph((14, 30), problem, 412) if problem else ""
        return {
            "projected rightly": self._outlined("right", 20, right, "yellow", "The picture, its outlines projected"),
            "projected by you": self._outlined("yours", 500, yours, "orange", "The same, by your function", words),
        } | self._pixel_numbers()

    def _your_pixels(self, points: np.ndarray) -> tuple[np.ndarray, str]:
        """Where the reader's function puts points (..., 3), and what is wrong with it."""
        pixels = self.camera().intrinsics
        return answered(self.yours, (points, pixels.fx, pixels.cx, pixels.cy), points[..., :2])

    def _outlined(self, name: str, x: float, lines: np.ndarray, colour: str, title: str, words: str = "") -> str:
        pixels = self.camera().intrinsics
        panel = image_panel(name, x, 34, 440, pixels.width, pixels.height)
        picture = "" if words else placed_image(panel, "wall", pixels.width, pixels.height)
        return panel.show(picture + svg.path(panel.place(lines), colour) + words, title=title)

    def _pixel_numbers(self) -> dict[str, str]:
        """What the function is given, under the pictures."""
        pixels, pitch_um = self.camera().intrinsics, 1000 * WALL_MM[0] / PIXELS
        given = [
            ("focal length", f"f = {self.depth_mm:g} mm / {pitch_um:g} µm = {pixels.fx:.1f} px"),
            ("principal point", f"cx = {pixels.cx:g} px, cy = {pixels.cy:g} px"),
            ("picture", f"{pixels.width} × {pixels.height} pixels, {WALL_MM[0]:g} × {WALL_MM[1]:g} mm"),
        ]
        title = svg.text((20, 398), "What your function is given", "title")
        numbers = title + readout(given, (20, 424), (0, 44), (0, 19))
        return {"numbers": numbers, "similar triangles": self._triangles(310, 398)}

    # The box ---------------------------------------------------------------------------------------------------------

    def _box_panel(self, upright: np.ndarray, draft: bool) -> Drawn:
        panel = space_panel("box", 10, 34, 540, 285)
        behind = ENLARGED * self.depth_mm / 1000
        extent = self.object_m + behind
        aim = (0.0, 0.0, (self.object_m - behind) / 2 - 0.08 * extent)
        eye = replace(self.eye, target=aim, distance=self.eye.distance * (extent + 2))
        label = "The box and the garden in space; drag or press the arrow keys to walk around"
        note = f"the box is drawn {ENLARGED} times as large"
        heading: dict[str, Any] = {"eye": eye, "note": note, "hint": "", "drag": "orbit"}
        return self.in_space(panel, self._box_items(upright), draft, "Light in a box", label, **heading)

    def _box_items(self, upright: np.ndarray) -> list[Item]:
        """The garden as a picture in its place, the rays through the hole, and the picture they make."""
        half, behind = ENLARGED * WALL_MM / 2000, ENLARGED * self.depth_mm / 1000
        wall = np.array([(half[0], half[1]), (-half[0], half[1]), (-half[0], -half[1]), (half[0], -half[1])])
        front, back = (np.insert(wall, 2, z, axis=1) for z in (0.0, -behind))
        stage = np.array([(-0.95, -0.72), (0.95, -0.72), (0.95, 0.72), (-0.95, 0.72)])
        scene = np.insert(stage, 2, self.object_m, axis=1)
        items: list[Item] = [
            TexturedMesh.over(scene[_GRID], _stage()),
            TexturedMesh.over(back[_GRID], upright),
            Line(closed(scene), "muted", 1.2),
            Face(front, "shade", 0.25),
            *(Line(closed(rim), "ink", 1.6) for rim in (front, back)),
            *(Line(np.array([a, b]), "ink", 1.4) for a, b in zip(front, back, strict=True)),
            Line(np.array([(0, 0, -behind), (0, 0, self.object_m)]), "muted dashed", 1.0),
            Dots(np.zeros(3), "ink", 7),
        ]
        for colour, point in _POINTS.items():
            start = np.array(point) + (0, 0, self.object_m)
            end = -start * _reach(start, half, behind)
            items += [Line(np.array([start, end]), colour, 1.9), Dots(np.array([start, end]), colour, 7)]
        return [
            *items,
            Label(np.array([0, -half[1] - 0.12, 0]), "hole"),
            Label(np.array([0, -0.9, self.object_m]), "scene"),
        ]

    # The blur --------------------------------------------------------------------------------------------------------

    @cached_property
    def _plot(self) -> Panel:
        return plot_panel("blur", 76, 364, 316, 166, logs(_HOLES), logs(_BLURS))

    def _blur_panel(self) -> str:
        panel = self._plot
        hole = np.geomspace(*_HOLES, 121)
        shadow = optics.geometric_blur_mm(hole, self.depth_mm, 1000 * self.object_m)
        airy = optics.diffraction_blur_mm(hole, self.depth_mm)
        total = optics.pinhole_blur_mm(hole, self.depth_mm, 1000 * self.object_m)
        lines = [(shadow, "orange dashed"), (airy, "green dashed"), (total, "blue thick")]
        right, left = (panel.place(logs((hole[i], y[i]))) for i, y in ((104, shadow), (2, airy)))
        content = (
            logarithmic_grid(panel, _HOLE_TICKS, _BLUR_TICKS)
            + "".join(curve(panel, np.log10(hole), np.log10(y), class_) for y, class_ in lines)
            + svg.text((panel.width - 10, right[1] + 36), "the hole's shadow", "orange halo end")
            + svg.text(left + (0, 34), "diffraction", "green halo")
            + svg.text(right + (-14, -8), "both together", "blue halo end")
            + self._best_mark(panel)
            + svg.dots([panel.place(logs((self.hole_mm, self.blur_mm)))], "red", 11)
        )
        label = "Blur against the hole's diameter; drag or press the arrow keys to change the hole"
        names = "hole diameter d [mm], logarithmic", "blur [µm]"
        return axes(panel, *names, _HOLE_TICKS, _BLUR_TICKS, aside=52) + panel.show(
            content, title="Blur on the wall", hint="drag to change the hole", drag="hole", label=label
        )

    def _best_mark(self, panel: Panel) -> str:
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

    def _numbers(self) -> dict[str, str]:
        left = 420 if "blur" in self.panels else 10
        figures = readout(self.numbers(), (left, 380), (0, 22), (122, 0))
        numbers = svg.text((left, 356), "This box", "title") + figures
        return {"numbers": numbers, "similar triangles": self._triangles(left + 290, 356)}

    def _triangles(self, x: float, y: float) -> str:
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


@lru_cache(maxsize=1)
def _stage() -> np.ndarray:
    """The garden around the tower as it looks from three metres away: 1.9 × 1.44 m of it."""
    pixels = Intrinsics(380, 288, 600, 600, 189.5, 143.5)
    pose = RigidTransform.from_translation(TOWER - (0, 0, 3.0))
    return snapshot(textured_scene(), Camera(pixels, world_from_cam=pose))


@lru_cache(maxsize=1)
def _garden_outlines() -> np.ndarray:
    """The outlines (lines, points, 3) of what stands in the garden, in the world, all with as many points."""
    lines = [line for name, line in textured_scene().outlines() if name not in ("terrace", "lawn", "easel")]
    share = np.linspace(0, 1, _POINTS_A_LINE)
    along = [np.linspace(0, 1, len(line)) for line in lines]
    return np.array(
        [np.stack([np.interp(share, t, c) for c in line.T], axis=-1) for t, line in zip(along, lines, strict=True)]
    )


@lru_cache(maxsize=2)
def _grain(shape: tuple[int, ...]) -> np.ndarray:
    """One fixed draw of standard normal numbers, so that the grain holds still while something else moves."""
    return np.random.default_rng(1).standard_normal(shape, dtype=np.float32)


def _reach(start: np.ndarray, half: np.ndarray, behind: float) -> float:
    """How far a ray goes on behind the hole, as a share of the way before it: to the wall, or to the box's side."""
    sides = np.divide(half, np.abs(start[:2]), out=np.full(2, np.inf), where=start[:2] != 0)
    return float(min(behind / start[2], *sides))


_HOLE_TICKS = [(float(np.log10(d)), f"{d:g}") for d in (0.05, 0.1, 0.2, 0.5, 1, 2)]
_BLUR_TICKS = [(float(np.log10(b)), f"{1000 * b:g}") for b in (0.1, 0.2, 0.5, 1, 2, 4)]


def _times(factor: float) -> str:
    return f"{factor:#.2g} ×" if factor < 10 else f"{factor:.0f} ×"
