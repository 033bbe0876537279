"""The omnidirectional visualizer: a camera in a mirror, its doughnut of a picture, unrolled, and a window in it.

A reader's own projection can bend the grid on the picture and cut the window out of it, beside the right ones.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from functools import cached_property
from math import degrees, isfinite
from typing import Any, ClassVar, Self

import cv2
import numpy as np

from camviz.cameras import Camera
from camviz.draw import svg
from camviz.draw.flow import WIDTH, Cell, rows, shortened
from camviz.draw.items import closed
from camviz.draw.panel import Panel, image_in, placed_image
from camviz.draw.picture import Picture, jpeg
from camviz.draw.readout import listed, readout, true_minus
from camviz.draw.space import OrbitCamera, space_panel
from camviz.lenses import Lens, UnifiedSphere
from camviz.lenses.base import Array
from camviz.panoramas.cubemap import cubemap_camera
from camviz.panoramas.mirrors import Catadioptric, MirrorLens, direction_error, miss
from camviz.panoramas.reprojection import equirectangular_camera, reproject, window
from camviz.views import garden
from camviz.views.base import Drawn, OrbitView, answered, choice, slider, without
from camviz.views.marks import on_photograph
from camviz_school.views.mirror_drawings import in_space, mirror_camera, picture_pixels, section, sphere, viewpoint
from camviz_school.views.mirror_photographs import UP, traced

BLIND_DEG = 14.0  # around the axis, where the mirror shows the camera itself
_DRAFT, _FINE = 160, 640  # pixels across the doughnut
_COUNTED = 400  # pixels across the picture whose focal length is told
_OF_THE_WINDOW = {"yaw_deg", "pitch_deg", "hfov_deg", "unroll", "model", "eye"}  # the mirror stands still
_OF_THE_MIRROR = {"rig", "central", "lens", "rim_angle_deg", "missed_mm", "_doughnuts"}
_WIDE = {"doughnut": 330, "window": 430, "yours": 430, "section": 400, "numbers": 200, "unrolled": 440, "space": 270}
"""How wide each panel is in picture units; the section has less beside the unrolled picture."""
_PAIR, _PAIR_HIGH, _BESIDE = 310, 264, 250  # the size of each of two windows beside the doughnut; the section's width
_TALL, _LOW = 354, 300  # a row with photographs, and one without
_GROUND = 1.2  # metres from the viewpoint down to the grid of the reader's own
_AWAY = 2.5  # metres to what a window shows, for a function that takes its distance for 1


@dataclass(frozen=True)
class OmnidirectionalView(OrbitView):
    """A camera that looks up into a mirror in the garden, and what can be made of its picture.

    A hyperbolic mirror has the shape that goes with `xi`; at 0 it is flat, at 1 it is the parabolic one. The camera
    stands in its second focus, or `shift_mm` below. The middle of the picture is straight down, its top ahead.
    `panels` names what is drawn: the doughnut, and any of window, yours, section, numbers, unrolled and space.
    `yours` is a reader's function of (points, ξ), points (..., 3) in the picture's frame, z towards its middle, to
    image points (..., 2) in focal lengths; what it does is orange.
    """

    title: ClassVar[str] = "Omnidirectional camera"
    openable: ClassVar[Mapping[str, str]] = {
        "section": "cut along the axis",
        "window": "window",
        "unrolled": "unrolled",
        "space": "in space",
        "numbers": "numbers",
    }

    xi: float = slider(0.92, 0.0, 1.0, 0.01, label="ξ", help="0 is a flat mirror, a pinhole; 1 a paraboloid")
    mirror: str = choice("hyperbolic", "parabolic", "spherical", help="only the first two have a single viewpoint")
    rim_deg: float = slider(112.0, 70.0, 125.0, 1.0, label="rim", unit="°", help="how far from the axis it shows")
    shift_mm: float = slider(
        0.0, -25.0, 60.0, 1.0, label="camera moved", unit="mm", help="away from the mirror, out of its second focus"
    )
    yaw_deg: float = slider(20.0, -180.0, 180.0, 1.0, label="look to the right", unit="°")
    pitch_deg: float = slider(-14.0, -70.0, 30.0, 1.0, label="look up", unit="°")
    hfov_deg: float = slider(64.0, 20.0, 120.0, 1.0, label="zoom: field of view", unit="°")
    unroll: str = choice("equirectangular", "cube map", help="the same picture, rolled out or folded")
    model: str = choice("mirror", "sphere", label="drawn as", help="cut along the axis: the mirror, or the sphere")
    panels: str = "doughnut window numbers unrolled section space"
    yours: Callable[..., Any] | None = field(default=None, compare=False, repr=False)
    eye: OrbitCamera = OrbitCamera(target=(0.0, 0.3, 0.0), distance=2.7, yaw_deg=75, pitch_deg=12)

    def __post_init__(self) -> None:
        super().__post_init__()
        if not {"doughnut"} <= set(self.panels.split()) <= {*_WIDE}:
            others = ", ".join(list(_WIDE)[1:])
            raise ValueError(f"panels must be doughnut and any of {others} beside it, got {self.panels!r}")

    def but(self, **changes: Any) -> Self:
        """The same view with some fields changed; what depends on the mirror alone is kept while the window turns."""
        changed = super().but(**changes)
        if not changes.keys() - _OF_THE_WINDOW:
            vars(changed).update({name: made for name, made in vars(self).items() if name in _OF_THE_MIRROR})
        return changed

    # What is true ----------------------------------------------------------------------------------------------------

    @cached_property
    def rig(self) -> Catadioptric:
        """The mirror and its camera."""
        return mirror_camera(self.mirror, self.xi, self.rim_deg, self.shift_mm)

    @cached_property
    def central(self) -> bool:
        """Whether all rays pass through one point."""
        return self.mirror != "spherical" and (self.shift_mm == 0 or not isfinite(self.rig.distance))

    @cached_property
    def lens(self) -> Lens:
        """The lens of a calibration that takes all rays to pass through one point."""
        return UnifiedSphere(self.rig.unified[0]) if self.central else MirrorLens(self.rig)

    @property
    def _xi(self) -> float:
        return 1.0 if self.mirror == "parabolic" else self.xi

    @cached_property
    def rim_angle_deg(self) -> float:
        """The angle from the axis at the mirror's rim."""
        return degrees(MirrorLens(self.rig).max_angle)

    def camera(self, side: int) -> Camera:
        """The camera that has a single viewpoint, `side` pixels across its doughnut."""
        scale = self.rig.unified[1] if self.central else 1.0
        return Camera(picture_pixels(side, self.rig.rim() / scale), self.lens, UP)

    def window(self, width: int = 320) -> Camera:
        """The virtual pan-tilt-zoom camera."""
        return window(width, width * 3 // 4, self.hfov_deg, yaw_deg=self.yaw_deg, pitch_deg=self.pitch_deg)

    @cached_property
    def looking(self) -> Array:
        """The direction (3,) of the window's middle, in the viewpoint's frame."""
        return np.asarray(UP.inv().as_matrix()[:3, :3] @ self.window().extrinsics[0][2], dtype=float)

    @cached_property
    def missed_mm(self) -> float:
        """How far the rays pass from the best single viewpoint, root mean square."""
        xs = np.linspace(0.02, 0.98, 60) * self.rig.rim()
        points, directions = self.rig.trace(np.stack([xs, 0 * xs], axis=-1))
        misses = miss(points, directions, (0, 0, viewpoint(self.rig)))
        return float(1000 * np.sqrt(np.nanmean(misses**2)))

    def numbers(self) -> dict[str, str]:
        """The state's key figures, as text."""
        f = self.camera(_COUNTED).intrinsics.fx
        model = {"f/(1 + ξ)": f"{f / (1 + self._xi):.1f} px", "f": f"{f:.1f} px"} if self.central else {}
        error = [degrees(direction_error(self.missed_mm / 1000, z)) for z in (0.3, 3.0)]
        missed = {
            "rays miss one point by": f"{self.missed_mm:.1f} mm",
            "wrong at 0.3 m by": f"{error[0]:.2f}°",
            "wrong at 3 m by": f"{error[1]:.3f}°",
        }
        return {
            "mirror": self._shape(),
            "rim": f"{self.rim_angle_deg:.0f}° from the axis",
            **model,
            **({"viewpoint": "single"} if self.central else missed),
            "window looks": true_minus(f"{self.yaw_deg:g}° right, {self.pitch_deg:g}° up"),
            "window is": f"{self.hfov_deg:g}° wide",
        }

    def _shape(self) -> str:
        e = self.rig.mirror.eccentricity
        if self.mirror == "spherical":
            return "sphere"
        if e == 1:
            return "paraboloid, ξ = 1"
        return "flat, ξ = 0" if self.xi == 0 else f"e = {e:.3f}, ξ = {self.xi:g}"

    def _told(self) -> dict[str, str]:
        figures = self.numbers()
        shown = {True: self._has("window") or not self._has("section"), False: self._has("section")}
        return {name: text for name, text in figures.items() if shown[name.startswith("window")]}

    def description(self) -> str:
        figures = listed(self._told())
        kind = f"{self.mirror} mirror" if self._has("section") else "mirror"
        unrolled = f" The picture is unrolled as {self.unroll}." if self._has("unrolled") else ""
        return f"A camera looks up into a {kind}: {figures}.{unrolled}"

    # The pictures ----------------------------------------------------------------------------------------------------

    def doughnut(self, side: int = _FINE, *, draft: bool = False) -> np.ndarray:
        """What the camera photographs (side, side, 3), left and right put right, the camera itself in the middle."""
        if (side, draft) not in self._doughnuts:
            self._doughnuts[side, draft] = self._photographed(side, draft)
        return self._doughnuts[side, draft]

    @cached_property
    def _doughnuts(self) -> dict[tuple[int, bool], np.ndarray]:
        return {}

    def _photographed(self, side: int, draft: bool) -> np.ndarray:
        camera = self.camera(side)
        if draft or self.central:
            picture = garden.glimpse(camera) if draft else garden.taken(camera, side)[0].copy()
        else:
            picture = traced(self.rig, side).copy()
        rim, blind = (side / 2 * self._share(angle) for angle in (self.rim_angle_deg, BLIND_DEG))
        y, x = np.ogrid[:side, :side]
        r2 = (x - (side - 1) / 2) ** 2 + (y - (side - 1) / 2) ** 2
        picture[(r2 > rim**2) | (r2 < blind**2)] = garden.NOTHING
        picture.flags.writeable = False
        return picture

    def _share(self, angle_deg: float) -> float:
        """Where an angle from the axis is in the picture, in radii of its rim."""
        camera, angle = self.camera(2), np.radians(angle_deg)
        x = camera.lens.project([np.sin(angle), 0, np.cos(angle)])[0]
        return float(x * camera.intrinsics.fx)

    def figure(self, *, draft: bool = False) -> Picture:
        side = _DRAFT if draft else _FINE
        picture, camera = self.doughnut(side, draft=draft), self.camera(side)
        photographs = {"doughnut": jpeg(picture)}
        parts = {"doughnut": self._doughnut_panel()}
        if self._has("space"):
            parts["space"], attached = self._space_panel(picture, draft)
            photographs |= attached
        for name, seen in {"window": self._seen, "unrolled": self._unrolled}.items():
            if self._has(name) or (name == "window" and self._has("yours")):
                photographs[name] = jpeg(np.asarray(reproject(picture, camera, seen(draft), antialias=not draft)))
        if self._has("yours"):
            parts["yours"], attached = self._your_panel(picture, draft)
            photographs |= attached
        plain = {name: getattr(self, f"_{name}_panel") for name in ("window", "section", "unrolled", "numbers")}
        parts |= {name: draw() for name, draw in plain.items() if self._has(name)}
        return self.tiled(self._layout, {name: parts[name] for name in self._layout}, photographs)

    @cached_property
    def _layout(self) -> dict[str, Cell]:
        """As many panels in a row as it has room for, in their order."""
        pair = {"window": _PAIR, "yours": _PAIR} if self._has("window") and self._has("yours") else {}
        widths = _WIDE | pair | ({"section": _BESIDE} if self._has("unrolled") else {})
        lines: list[dict[str, float]] = [{}]
        for name in self.panels.split():
            if sum(lines[-1].values()) + widths[name] > WIDTH:
                lines.append({})
            lines[-1][name] = widths[name]
        cells = rows(*((_TALL if {"doughnut", "window", "yours"} & {*line} else _LOW, line) for line in lines))
        return shortened(cells, **dict.fromkeys(pair, _PAIR_HIGH))

    def _slot(self, name: str) -> Cell:
        """Where the panel of a cell stands: left, top, width and height."""
        x, y, width, height = self._layout[name]
        return x + 10, y + 34, width - 20, height - 44

    def _seen(self, draft: bool) -> Camera:
        return self.window(112 if draft else 320)

    def _unrolled(self, draft: bool) -> Camera:
        if self.unroll == "cube map":
            return cubemap_camera(40 if draft else 120)
        return equirectangular_camera(160 if draft else 480, 80 if draft else 240)

    # The panels ------------------------------------------------------------------------------------------------------

    def _space_panel(self, picture: np.ndarray, draft: bool) -> Drawn:
        panel = space_panel("space", *self._slot("space"))
        small = cv2.resize(picture, (128, 128), interpolation=cv2.INTER_AREA)
        items = in_space(self.rig, small, self.looking, draft=draft)
        label = "Mirror and camera in space; drag or press the arrow keys to walk around"
        return self.in_space(panel, items, draft, "Mirror and camera", label, drag="orbit")

    @property
    def _doughnut_box(self) -> Panel:
        return image_in(self._layout["doughnut"], "doughnut", _FINE, _FINE)

    def _doughnut_panel(self) -> svg.Marks:
        panel, camera = self._doughnut_box, self.camera(_FINE)
        frame, colour = self.window(), "yellow thick" if self.yours else "orange"
        outline = frame.unproject(frame.intrinsics.border(12))
        uv = camera.project(closed(outline))
        turn = np.linspace(-np.pi, np.pi, 73)
        horizon = camera.project(np.stack([np.sin(turn), 0 * turn, np.cos(turn)], axis=-1))
        seen = placed_image(panel, "doughnut", _FINE, _FINE)
        words = svg.text((panel.width / 2, panel.height / 2 + 4), "camera", "note halo middle")
        if not self._has("window"):
            horizon_line = svg.line(panel.place(horizon), "yellow dashed thin")
            return panel.show(seen + horizon_line + words, title="What it photographs", note="dashed: the horizon")
        marks = self._grid_lines(panel) if self.yours else svg.line(panel.place(horizon), "yellow dashed thin")
        marks += on_photograph([panel.place(uv)], colour)
        dot = svg.dots([panel.place(camera.project(frame.extrinsics[0][2]))], colour.split()[0], 8)
        return panel.show(
            seen + marks + words + dot,
            title="What it photographs",
            hint="drag to look around",
            drag="doughnut",
            label="The doughnut picture; drag or press the arrow keys to turn the window",
        )

    def _window_panel(self) -> svg.Marks:
        panel = image_in(self._layout["window"], "window", 320, 240)
        label = "The virtual pan-tilt-zoom window; drag or press the arrow keys to look around, + and - to zoom"
        seen = placed_image(panel, "window", 320, 240)
        return panel.show(seen, title="A window in it", hint="drag to look around", drag="window", label=label)

    def _section_panel(self) -> svg.Marks:
        angle = degrees(np.arctan2(np.hypot(*self.looking[:2]), self.looking[2]))
        if self.model == "sphere" and self.central:
            panel = self._section_box(2.1, -1.9)
            return panel.show(sphere(panel, self._xi, self.rim_angle_deg, angle), title="The same, as a sphere")
        panel = self._section_box(84.3, -30.0)
        note = "" if self.model == "mirror" else "no sphere without one viewpoint"
        return panel.show(section(panel, self.rig, angle), title="Cut along the axis", note=note)

    def _section_box(self, lowest: float, highest: float) -> Panel:
        """The section's panel, downwards from `highest` to `lowest`, as wide as its shape makes it."""
        x, y, width, height = self._slot("section")
        half = (lowest - highest) * width / height / 2
        return Panel("section", x, y, width, height, -half, half, highest, lowest)

    def _unrolled_panel(self) -> svg.Marks:
        camera = self._unrolled(False)
        width, height = camera.intrinsics.width, camera.intrinsics.height
        panel = image_in(self._layout["unrolled"], "unrolled", width, height)
        frame = self.window()
        outline = frame.unproject(frame.intrinsics.border(24))
        uv = panel.place(camera.project(closed(outline)))
        jump = np.linalg.norm(np.diff(uv, axis=0), axis=-1) > 40
        uv[1:][jump] = np.nan  # from one edge of the picture to another
        title = "Unrolled: longitude and latitude" if self.unroll == "equirectangular" else "Folded out: a cube map"
        return panel.show(placed_image(panel, "unrolled", width, height) + svg.line(uv, "orange"), title=title)

    def _numbers_panel(self) -> svg.Marks:
        x = self._layout["numbers"][0] + 10
        title = svg.text((x, 26), "This camera" if self._has("section") else "This window", "title")
        return title + readout(self._told(), (x, 50), (0, 38), (0, 17))

    # The reader's own function ---------------------------------------------------------------------------------------

    def _your_pixels(self, garden_points: Array) -> tuple[Array, str]:
        """Where the reader's function puts points (..., 3) of the garden in the doughnut, and what is wrong with it."""
        points = garden_points @ np.asarray(UP.inv().as_matrix()[:3, :3]).T
        xy, problem = answered(self.yours, (points, self._xi), points[..., :2])
        uv = self.camera(_FINE).intrinsics.to_pixels(xy)
        return np.where(np.abs(uv) < 5 * _FINE, uv, np.nan), problem

    def _grid_lines(self, panel: Panel) -> svg.Marks:
        """A square grid on level ground, and circles above it: where they land, and by the reader's function."""
        along = np.linspace(-4, 4, 61)
        across = [np.stack([along, 0 * along + _GROUND, 0 * along + z], axis=-1) for z in range(-4, 5, 2)]
        lines = across + [line[:, ::-1] for line in across]  # x and z change places
        turn = np.linspace(-np.pi, np.pi, 61)
        rings = np.radians([90.0, self.rim_angle_deg - 6])
        lines += [
            np.stack([np.sin(a) * np.sin(turn), 0 * turn + np.cos(a), np.sin(a) * np.cos(turn)], -1) for a in rings
        ]
        yours, _ = self._your_pixels(np.array(lines))
        right = self.camera(_FINE).project(np.array(lines))
        return svg.path(panel.place(right), "yellow thin") + svg.path(panel.place(yours), "orange dashed")

    def _your_panel(self, picture: np.ndarray, draft: bool) -> Drawn:
        """The window once more, every pixel of it looked up where the reader's function says."""
        panel = image_in(self._layout["yours"], "yours", 320, 240)
        uv, problem = self._your_pixels(_AWAY * self._seen(draft).rays())
        if problem:
            right = placed_image(panel, "window", 320, 240)
            return without(panel, problem, "Cut by your function", right=right), {}
        cut = garden.looked_up(picture, uv, _FINE)
        return panel.show(placed_image(panel, "yours", 320, 240), title="Cut by your function"), {"yours": jpeg(cut)}

    # The hands -------------------------------------------------------------------------------------------------------

    def dragged(self, handle: str, x: float, y: float, dx: float, dy: float) -> Self:
        if handle not in ("window", "doughnut"):
            return super().dragged(handle, x, y, dx, dy)
        if handle == "window" or np.isnan(x):
            per_unit = self.hfov_deg / (self._slot("window")[2] if self._has("window") else 330)
            return self._looking(self.yaw_deg - per_unit * dx, self.pitch_deg + per_unit * dy)
        panel = self._doughnut_box
        ahead = self.camera(_FINE).unproject(panel.data((x - panel.x, y - panel.y)))
        if not np.isfinite(ahead).all():
            return self
        yaw, pitch = np.arctan2(ahead[0], ahead[2]), np.arctan2(-ahead[1], np.hypot(ahead[0], ahead[2]))
        return self._looking(degrees(yaw), degrees(pitch))

    def pressed(self, handle: str, key: str) -> Self:
        if handle not in ("window", "doughnut"):
            return super().pressed(handle, key)
        zoom = {"+": -4, "=": -4, "-": 4, "_": 4}.get(key, 0)
        turns = {"ArrowLeft": (-4, 0), "ArrowRight": (4, 0), "ArrowUp": (0, 4), "ArrowDown": (0, -4)}
        right, up = turns.get(key, (0, 0))
        wider = float(min(120, max(20, self.hfov_deg + zoom)))
        return self.but(hfov_deg=wider)._looking(self.yaw_deg + right, self.pitch_deg + up)

    def _looking(self, yaw_deg: float, pitch_deg: float) -> Self:
        yaw = (yaw_deg + 180) % 360 - 180
        return self.but(yaw_deg=round(float(yaw), 1), pitch_deg=round(float(min(30, max(-70, pitch_deg))), 1))
