"""The intrinsics visualizer: K beside the picture it numbers, the rays it picks out, and what no K can show."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cache, cached_property, lru_cache
from typing import Any, ClassVar, Self

import numpy as np
from scipy.spatial.transform import RigidTransform

from camviz.cameras import Camera, Intrinsics
from camviz.draw import svg
from camviz.draw.panel import Panel, image_panel, photograph
from camviz.draw.picture import Picture, jpeg
from camviz.draw.space import Eye, Item, Label, Line, camera_body, draw_space, scene_items, space_panel
from camviz.lenses.base import Array, unit
from camviz.scenes import Column, Scene, Sphere, Texture, paint, render, textured_scene, to_display
from camviz.views.base import Control, View, choice, slider, switch

GLOBE = np.array([0.68, 0.36, 3.3])  # the subject, in the world; the camera stands before it on the z axis
BALLOON, BALLOON_RADIUS = np.array([1.75, -1.1, 11.6]), 0.22
BINS = 4
_NEAREST, _FARTHEST = 1.5, 12.0  # metres between camera and globe
_FOCAL = {"low": 150.0, "high": 2000.0, "step": 1.0, "unit": "px"}
_LEAN_DRAWN = 3


@dataclass(frozen=True)
class IntrinsicsView(View):
    """Nine numbers, the picture they make of the garden and the rays they choose.

    The camera looks along z, `distance` metres from the globe. `focal_mm` and `aspect` are no state of their own: they
    are read from fx, fy and the pixel pitch, and setting them with `but` sets fx and fy.
    """

    title: ClassVar[str] = "Intrinsics"

    fx: float = slider(450.0, **_FOCAL, help="focal length in widths of a pixel")
    fy: float = slider(450.0, **_FOCAL, help="focal length in heights of a pixel")
    cx: float = slider(319.5, -100.0, 740.0, 0.5, unit="px", help="column of the principal point")
    cy: float = slider(239.5, -100.0, 580.0, 0.5, unit="px", help="row of the principal point")
    skew: float = slider(0.0, -150.0, 150.0, 1.0, unit="px", help="shear of the pixel axes; 0 in nearly every camera")
    distance: float = slider(3.0, _NEAREST, _FARTHEST, 0.05, label="camera distance", unit="m", help="to the globe")
    dolly_zoom: bool = switch(False, label="dolly-zoom lock", help="move the camera so that the globe keeps its size")
    operation: str = choice("as taken", "cropped", "resized", "binned", help="what is done to the picture afterwards")
    x0: float = slider(256, 0, 320, 1, label="crop x0", unit="px", help="first column kept")
    y0: float = slider(96, 0, 240, 1, label="crop y0", unit="px", help="first row kept")
    scale: float = slider(0.5, 0.1, 2.0, 0.05, label="resize by", help="new width divided by old width")
    pitch_um: float = slider(6.0, 1.0, 12.0, 0.1, label="pixel width", unit="µm", help="K does not know it")
    width: int = 640
    height: int = 480
    eye: Eye = Eye(target=(-0.3, 0.4, 2.6), distance=17.0, yaw_deg=-62, pitch_deg=34, vfov_deg=30)

    @classmethod
    def of(cls, camera: Camera, **state: Any) -> Self:
        """The view of a given camera's intrinsics, taking its picture in the garden; further fields by name."""
        K = camera.intrinsics
        return cls(K.fx, K.fy, K.cx, K.cy, K.skew, width=K.width, height=K.height, **state)

    @classmethod
    def controls(cls) -> dict[str, Control]:
        """The fields' controls, and those of the two readings that can be set."""
        lens = Control("focal length", "mm", 0.9, 12.0, 0.01, help="the lens: fx and fy together")
        shape = Control("pixel aspect", "", 0.5, 2.0, 0.01, help="width of a pixel / its height = fy / fx")
        return {"focal_mm": lens, "aspect": shape, **super().controls()}

    @property
    def focal_mm(self) -> float:
        """Focal length in millimetres, which takes the width of a pixel to know."""
        return self.fx * self.pitch_um / 1000

    @property
    def aspect(self) -> float:
        """The width of a pixel divided by its height: fy / fx."""
        return self.fy / self.fx

    def but(self, **changes: Any) -> Self:
        """The same view with some fields changed; `focal_mm` and `aspect` change fx and fy, the lock the rest."""
        controls = self.controls()
        for name in changes.keys() & {"focal_mm", "aspect"}:
            controls[name].checked(name, changes[name])
        zoom = changes.pop("focal_mm", self.focal_mm) / self.focal_mm
        aspect = changes.pop("aspect", None)
        if zoom != 1:
            changes = {"fx": zoom * self.fx, "fy": zoom * self.fy, **changes}
        if aspect is not None:
            changes["fy"] = aspect * changes.get("fx", self.fx)
        changed = super().but(**changes)
        return self._locked(changed) if self.dolly_zoom and changed.dolly_zoom and aspect is None else changed

    def _locked(self, changed: Self) -> Self:
        """fx / distance stays: whichever of the two was changed, the other follows, within the garden."""
        wanted = changed.distance / self.distance
        if wanted == 1:
            wanted = changed.fx / self.fx if changed.fx != self.fx else changed.fy / self.fy
        if wanted == 1:
            return changed
        distance = min(max(wanted * self.distance, _NEAREST), _FARTHEST)
        zoom = distance / self.distance
        return replace(changed, distance=distance, fx=zoom * self.fx, fy=zoom * self.fy)

    # The camera ------------------------------------------------------------------------------------------------------

    @cached_property
    def taken(self) -> Intrinsics:
        """The intrinsics of the picture as it was taken."""
        return Intrinsics(self.width, self.height, self.fx, self.fy, self.cx, self.cy, self.skew)

    @cached_property
    def intrinsics(self) -> Intrinsics:
        """The intrinsics of the picture after the operation."""
        K = self.taken
        if self.operation == "cropped":
            return K.cropped(*self._corner, K.width // 2, K.height // 2)
        if self.operation == "resized":
            return K.resized(max(1, round(self.scale * K.width)), max(1, round(self.scale * K.height)))
        return K.binned(BINS) if self.operation == "binned" else K

    @property
    def _corner(self) -> tuple[int, int]:
        """The first pixel that a crop keeps."""
        column = min(max(round(self.x0), 0), self.width - self.width // 2)
        return column, min(max(round(self.y0), 0), self.height - self.height // 2)

    @property
    def _pose(self) -> RigidTransform:
        return RigidTransform.from_translation([0, 0, GLOBE[2] - self.distance])

    @cached_property
    def camera(self) -> Camera:
        """The camera, with the intrinsics of the picture after the operation."""
        return Camera(self.intrinsics, world_from_cam=self._pose)

    def field_of_view_deg(self) -> tuple[float, float]:
        """The angles from edge to edge of the picture along the row and the column of the principal point."""
        K = self.intrinsics
        row = np.array([(-0.5, K.cy), (K.width - 0.5, K.cy)])
        column = np.array([(K.cx, -0.5), (K.cx, K.height - 0.5)])
        return _angle_deg(*self.camera.unproject(row)), _angle_deg(*self.camera.unproject(column))

    def axes_angle_deg(self) -> float:
        """The angle between the rows and the columns of pixels on the sensor."""
        corner, along_u, along_v = self.intrinsics.from_pixels([(0, 0), (1, 0), (0, 1)])
        return _angle_deg(unit(along_u - corner), unit(along_v - corner))

    def in_sight(self) -> float:
        """The share of the balloon that nothing stands before: a matter of the camera's place, not of K."""
        return _share_in_sight(float(self.camera.centre[2]))

    # The words -------------------------------------------------------------------------------------------------------

    def numbers(self) -> dict[str, str]:
        """The state's key figures, as text."""
        across, down = self.field_of_view_deg()
        pitch = self.pitch_um * self.taken.fx / self.intrinsics.fx
        return {
            "field of view": f"{across:.1f}° × {down:.1f}°",
            "focal length": f"{self.focal_mm:.2f} mm, if a pixel is {pitch:.3g} µm wide",
            "pixel width / height": f"{self.aspect:.3f}, axes at {self.axes_angle_deg():.1f}°",
            "camera to globe": f"{self.distance:.2f} m; there, 1 m is {self.intrinsics.fx / self.distance:.0f} px",
            "red balloon": f"{100 * self.in_sight():.0f} % in sight",
        }

    def description(self) -> str:
        """The state in words and numbers."""
        K = self.intrinsics
        figures = "; ".join(f"{name} {value}" for name, value in self.numbers().items())
        return (
            f"{self.operation}, {K.width} × {K.height} pixels: fx = {K.fx:.2f}, fy = {K.fy:.2f}, cx = {K.cx:.2f}, "
            f"cy = {K.cy:.2f}, skew = {K.skew:.2f}; {figures}."
        ).capitalize()

    def rule(self) -> str:
        """What the operation does to K, with its numbers."""
        (x0, y0), s = self._corner, self.intrinsics.width / self.width
        return {
            "as taken": "K turns directions into pixels; its inverse turns pixels into directions.",
            "cropped": f"cropped: c′ = c − (x0, y0) = c − ({x0}, {y0}); f and skew stay",
            "resized": f"resized by {s:g}: f′ = {s:g} f,  c′ = {s:g} c {_signed((s - 1) / 2)}",
            "binned": f"binned {BINS} × {BINS}: f′ = f / {BINS},  c′ = c / {BINS} {_signed((s - 1) / 2)}",
        }[self.operation]

    # The picture -----------------------------------------------------------------------------------------------------

    def figure(self, *, draft: bool = False) -> Picture:
        picture = self.image(draft=draft)
        space, photographs = self._space_panel(draft)
        body = "".join(
            [
                svg.rectangle(0, 0, 960, 604, "paper"),
                self._picture_panel(),
                space,
                self._matrices(20, 414),
                self._lattice_panel(),
                self._numbers_column(724, 398),
            ]
        )
        return Picture(body, 960, 604, self.title, self.description(), {**photographs, "camera": jpeg(picture)})

    def image(self, *, draft: bool) -> np.ndarray:
        """The picture (height, width, 3); a crop is shown within the whole, so it shows the picture as taken."""
        K = self.taken if self.operation == "cropped" else self.intrinsics
        wide = min(K.width, 320 if draft else 480)
        grid = K if wide == K.width else K.resized(wide, max(1, round(wide * K.height / K.width)))
        return _photographed(grid, float(self.camera.centre[2]), max(1, round(320 / wide)))

    @cached_property
    def _picture(self) -> Panel:
        """In the pixels of the picture as taken."""
        width = min(440.0, 330 * self.width / self.height)
        return image_panel("picture", 20, 34, width, self.width, self.height)

    def _picture_panel(self) -> str:
        panel, K = self._picture, self.intrinsics
        coarse = {"style": "image-rendering:pixelated"} if K.width < 200 else {}
        content = photograph(panel, "camera", self.width, self.height, **coarse) + self._window() + self._behind()
        note = f"{K.width} × {K.height} pixels"
        return panel.show(content + self._principal_point(), title=f"The picture, {self.operation}", note=note)

    def _window(self) -> str:
        """The corners' names in the picture's own pixels; around a crop, what it leaves out."""
        panel, K = self._picture, self.intrinsics
        (x0, y0), (x1, y1) = self._as_taken([(-0.5, -0.5), (K.width - 0.5, K.height - 0.5)])
        names = svg.text((x0 + 5, y0 + 15), "(0, 0)", "number halo")
        names += svg.text((x1 - 5, y1 - 7), f"({K.width - 1}, {K.height - 1})", "number halo end")
        if self.operation != "cropped":
            return names
        hole = f"M0,0H{panel.width:g}V{panel.height:g}H0ZM{x0:.1f},{y0:.1f}V{y1:.1f}H{x1:.1f}V{y0:.1f}Z"
        shade = svg.element("path", d=hole, style="fill:#000;fill-opacity:.55;stroke:none")
        label = f"The cropped window, from column {self._corner[0]} and row {self._corner[1]}; arrow keys move it"
        handle = {"data_drag": "window", "tabindex": 0, "role": "group", "aria_label": label}
        frame = svg.polygon([(x0, y0), (x1, y0), (x1, y1), (x0, y1)], "orange thick")
        hand = svg.rectangle(x0, y0, x1 - x0, y1 - y0, "card", fill_opacity=0)
        return shade + svg.group(hand + frame + names, **handle)

    def _as_taken(self, uv: Any) -> Array:
        """Panel coordinates (..., 2) of pixels (..., 2) of the picture after the operation: the same rays."""
        return self._picture.place(self.taken.to_pixels(self.intrinsics.from_pixels(uv)))

    def _principal_point(self) -> str:
        K = self.intrinsics
        at = self._as_taken((K.cx, K.cy))
        arms = np.array([(12, 0), (0, 12)])
        cross = svg.segments(at - arms, at + arms, "paper-line") + svg.segments(at - arms, at + arms, "orange thick")
        side = " end" if at[0] > 300 else ""
        name = svg.text(at + (-14 if side else 14, -9), f"(cx, cy) = ({K.cx:.2f}, {K.cy:.2f})", f"orange halo{side}")
        hand = svg.element("circle", cx=at[0], cy=at[1], r=16, fill_opacity=0, class_="card")
        label = f"Principal point at column {K.cx:.1f}, row {K.cy:.1f}; arrow keys move it"
        handle = {"data_drag": "principal", "tabindex": 0, "role": "group", "aria_label": label}
        return svg.group(hand + cross + name, **handle)

    def _behind(self) -> str:
        """Where the balloon is, whether or not it can be seen."""
        rim = self.taken.to_pixels(Camera(self.taken, world_from_cam=self._pose).lens.project(self._rim_cam()))
        outline = self._picture.place(rim)
        words = "balloon" if self.in_sight() > 0.5 else "a balloon, behind the wall"
        top = outline[np.argmin(outline[:, 1])] - (0, 6)
        return svg.line(outline, "red dashed") + svg.text(top, words, "red halo middle")

    def _rim_cam(self) -> Array:
        return _rim(self.camera.centre) - self.camera.centre

    # The rays --------------------------------------------------------------------------------------------------------

    def _space_panel(self, draft: bool) -> tuple[str, dict[str, bytes]]:
        panel = space_panel("space", 480, 34, 460, 330)
        items = [*scene_items(_garden(), "wire"), *self._frustum(), *self._line_of_sight()]
        content, photographs = draw_space(panel, items, self.eye, draft=draft, renderer="wire")
        label = "The camera, its rays and the garden in space; drag or press the arrow keys to walk around"
        return panel.show(
            content, title="The rays it picks out", note="drag to turn", drag="orbit", label=label
        ), photographs

    def _frustum(self) -> list[Item]:
        items = camera_body(self.camera, 1.4, colour="blue")
        corners = self.intrinsics.border(1)
        items += [Line(_ray(self.camera, corner, 7.5), "blue faint", 1.0) for corner in corners]
        centre = np.array([self.intrinsics.cx, self.intrinsics.cy])
        items.append(Line(_ray(self.camera, centre, 2.2), "orange", 1.8, head=True))
        if self.operation == "cropped":
            whole = Camera(self.taken, world_from_cam=self._pose)
            items += [Line(_ray(whole, corner, 1.4), "muted dashed", 1.0) for corner in self.taken.border(1)]
        return items

    def _line_of_sight(self) -> list[Item]:
        """To the balloon: broken where something stands in the way."""
        stopped = _stopped(float(self.camera.centre[2]))
        ends = np.array([self.camera.centre, BALLOON])
        if stopped is None:
            return [Line(ends, "red", 1.8), *_balloon_drawn("")]
        wall = np.array([self.camera.centre, stopped])
        return [Line(wall, "red", 1.8), Line(np.array([stopped, BALLOON]), "red dotted", 1.4), *_balloon_drawn(" hidden")]

    # The matrices ----------------------------------------------------------------------------------------------------

    def _matrices(self, x: float, y: float) -> str:
        before, after = self.taken.K, self.intrinsics.K
        same = np.zeros((3, 3), dtype=bool)
        left = _matrix(x, y, "K, as taken" if self.operation != "as taken" else "K", before, same)
        if self.operation == "as taken":
            right = _matrix(x + 248, y, "K⁻¹ × 1000", 1000 * np.linalg.inv(before), same)
        else:
            changed = ~np.isclose(before, after, rtol=0, atol=1e-9)
            right = _matrix(x + 248, y, f"K, {self.operation}", after, changed)
        K = self.intrinsics
        u = f"u = {K.fx:.2f} x {_signed(K.skew)} y {_signed(K.cx)}"
        v = f"v = {K.fy:.2f} y {_signed(K.cy)}"
        lines = [(128, u, "number"), (147, f"{v}     with x = X/Z, y = Y/Z", "number"), (173, self.rule(), "label")]
        return left + right + "".join(svg.text((x, y + dy), words, class_) for dy, words, class_ in lines)

    def _lattice_panel(self) -> str:
        """A few pixels as they lie on the sensor, their lean drawn larger than it is."""
        K = replace(self.intrinsics, skew=_LEAN_DRAWN * self.intrinsics.skew)
        panel = Panel("lattice", 520, 400, 180, 180, -90, 90, -90, 90)
        scale = 30 * np.sqrt(K.fx * K.fy)

        def place(uv: Any) -> Array:
            return panel.place(scale * K.from_pixels(np.asarray(uv) + (K.cx, K.cy)))

        s = np.arange(-6, 7)
        rows = [place([(-6, v), (6, v)]) for v in s]
        columns = [place([(u, -6), (u, 6)]) for u in s]
        u, v = place([(0, 0), (2, 0)]), place([(0, 0), (0, 2)])
        upright = panel.place([(0, 0), (0, 80)])
        content = (
            svg.path([*rows, *columns], "muted thin")
            + svg.line(upright, "ink dotted")
            + svg.line(u, "orange thick")
            + svg.line(v, "green thick")
            + svg.text(u[1] + (6, 4), "u", "orange halo")
            + svg.text(v[1] + (6, 6), "v", "green halo")
        )
        note = f"lean drawn {_LEAN_DRAWN} ×" if K.skew else ""
        return panel.show(content, title="Its pixels", note=note)

    def _numbers_column(self, x: float, y: float) -> str:
        rows = []
        for i, (name, value) in enumerate(self.numbers().items()):
            rows.append(svg.text((x, y + 40 * i), name, "note"))
            rows.append(svg.text((x, y + 17 + 40 * i), value, "label"))
        return "".join(rows)

    # The hands -------------------------------------------------------------------------------------------------------

    def dragged(self, handle: str, x: float, y: float, dx: float, dy: float) -> Self:
        """The principal point and the crop follow the pointer on the picture; in space one walks around."""
        du, dv = np.array([dx, dy]) / self._picture.scale
        if handle == "principal":
            return self.but(cx=float(self.cx + du), cy=float(self.cy + dv))
        if handle == "window":
            column = min(max(self.x0 + du, 0), self.width - self.width // 2)
            return self.but(x0=float(column), y0=float(min(max(self.y0 + dv, 0), self.height - self.height // 2)))
        return self.but(eye=self.eye.orbited(dx, dy))

    def pressed(self, handle: str, key: str) -> Self:
        """An arrow moves the principal point or the crop by eight pixels."""
        if handle == "orbit":
            return self.but(eye=self.eye.key(key))
        steps = {"ArrowLeft": (-8, 0), "ArrowRight": (8, 0), "ArrowUp": (0, -8), "ArrowDown": (0, 8)}
        dx, dy = np.array(steps.get(key, (0, 0))) * self._picture.scale
        return self.dragged(handle, float("nan"), float("nan"), float(dx), float(dy))


def _matrix(x: float, y: float, title: str, values: Array, changed: np.ndarray) -> str:
    """A 3×3 matrix in brackets, 208 wide, its changed entries marked."""
    parts = [svg.text((x, y - 22), title, "title")]
    for (row, column), value in np.ndenumerate(values):
        right, base = x + 66 + 66 * column, y + 26 * row + 10
        if changed[row, column]:
            parts.append(svg.rectangle(right - 58, base - 16, 62, 23, "wash fill-orange", rx=3))
        structural = (row, column) in ((1, 0), (2, 0), (2, 1), (2, 2))
        class_ = "number end orange" if changed[row, column] else f"number end{' half' if structural else ''}"
        parts.append(svg.text((right, base), _plain(value) if not structural else f"{round(value / values[2, 2])}", class_))
    for edge, inward in ((x, 6), (x + 208, -6)):
        parts.append(svg.line([(edge + inward, y - 10), (edge, y - 10), (edge, y + 72), (edge + inward, y + 72)], "ink"))
    return "".join(parts)


def _plain(value: float) -> str:
    return f"{value + 0.0:.2f}".replace("-", "−")


def _signed(value: float) -> str:
    number = f"{abs(value):.4f}".rstrip("0").rstrip(".") if abs(value) < 1 else f"{abs(value):.2f}"
    return f"{'−' if value < 0 else '+'} {number}"


def _angle_deg(a: Array, b: Array) -> float:
    """Between unit vectors, accurate for small angles too (Kahan)."""
    return float(np.degrees(2 * np.arctan2(np.linalg.norm(a - b), np.linalg.norm(a + b))))


def _ray(camera: Camera, uv: Array, length: float) -> Array:
    """From the centre along the ray of a pixel (2,), as a line (2, 3) that ends `length` metres deep."""
    ray = camera.unproject(uv)
    return camera.centre + np.array([0 * ray, length * ray / ray[2]])


# The garden with a balloon behind its wall ---------------------------------------------------------------------------


@cache
def _garden() -> Scene:
    skin = Texture(paint.lit_round(paint.plain(32, 64, (0.85, 0.08, 0.12))))
    string = Texture(paint.lit_round(paint.plain(1, 32, (0.3, 0.3, 0.3)), upright=True))
    balloon = Sphere(BALLOON, BALLOON_RADIUS, skin, "balloon")
    foot = np.array([BALLOON[0], 1.25, BALLOON[2]])
    garden = textured_scene()
    return Scene([*garden.surfaces, balloon, Column(foot, 1.25 - BALLOON[1], 0.012, string, "balloon")], garden.sky)


def _rim(eye: Array, size: float = 1.0, samples: int = 48) -> Array:
    """The outline (samples, 3) of the balloon as seen from `eye` (3,), or a smaller circle within it."""
    towards = BALLOON - eye
    distance = np.linalg.norm(towards)
    sine = BALLOON_RADIUS / distance
    across = unit(np.cross(towards, (0.0, 1.0, 0.0)))
    turn = np.linspace(0, 2 * np.pi, samples)[:, None]
    around = np.cos(turn) * across + np.sin(turn) * unit(np.cross(across, towards))
    return eye + (1 - sine**2) * towards + size * BALLOON_RADIUS * np.sqrt(1 - sine**2) * around


@lru_cache(maxsize=256)
def _share_in_sight(z: float) -> float:
    """How much of the balloon's disc nothing hides from (0, 0, z): rings of rays, each for an equal area."""
    eye = np.array([0.0, 0.0, z])
    rings = np.concatenate([_rim(eye, np.sqrt((i + 0.5) / 8), 33)[:-1] for i in range(8)])
    _, depth = textured_scene().trace(eye, unit(rings - eye))
    return float(np.mean(~(depth < np.linalg.norm(rings - eye, axis=-1))))


@lru_cache(maxsize=256)
def _stopped(z: float) -> tuple[float, float, float] | None:
    """Where the line from (0, 0, z) to the balloon's middle meets something before it, if it does."""
    eye = np.array([0.0, 0.0, z])
    towards = unit(BALLOON - eye)
    _, depth = textured_scene().trace(eye, towards)
    x, y, z = (eye + float(depth) * towards).tolist()
    return (x, y, z) if depth < np.linalg.norm(BALLOON - eye) else None


@lru_cache(maxsize=4)
def _photographed(intrinsics: Intrinsics, z: float, supersample: int) -> np.ndarray:
    picture = to_display(
        render(_garden(), Camera(intrinsics, world_from_cam=RigidTransform.from_translation([0, 0, z])), supersample)
    )
    picture.flags.writeable = False
    return picture


def _balloon_drawn(hidden: str) -> list[Item]:
    eye = np.array([BALLOON[0] - 6, BALLOON[1] - 6, BALLOON[2] - 6])
    return [Line(_rim(eye), "red thick", 2.4), Label(BALLOON - (0, 0.4, 0), f"balloon{',' if hidden else ''}{hidden}", "red halo")]
