"""The intrinsics visualizer: K beside the picture it numbers, the rays it picks out, and what no K can show.

A reader's own rays can be drawn beside the right ones.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace
from functools import cached_property, lru_cache
from typing import Any, ClassVar, Self

import numpy as np

from camviz.cameras import Camera, Intrinsics
from camviz.draw import svg
from camviz.draw.flow import WIDTH, Cell, rows
from camviz.draw.items import closed
from camviz.draw.matrix import intrinsic_matrix
from camviz.draw.panel import Panel, image_in, placed_image
from camviz.draw.picture import Picture, jpeg
from camviz.draw.readout import listed, readout
from camviz.draw.space import Item, Label, Line, OrbitCamera, camera_body, draw_space, scene_items, space_panel
from camviz.lenses.base import Array, unit
from camviz.poses import RigidTransform
from camviz.scenes import render, textured_scene, to_display
from camviz.scenes.balloon import BALLOON, balloon_in_sight, balloon_rim, balloon_scene, towards_balloon
from camviz.views.base import Control, Drawn, OrbitView, choice, slider, switch, without
from camviz.views.yours import is_unwritten, tried

GLOBE, GLOBE_RADIUS = np.array([0.68, 0.36, 3.3]), 0.27  # in the world; the camera stands before it on the z axis
BINS = 4
_NEAREST, _FARTHEST = 1.5, 12.0  # metres between camera and globe
_FOCAL: dict[str, Any] = {"low": 150.0, "high": 2000.0, "step": 1.0, "unit": "px"}
_LEAN_DRAWN = 3  # times
_YOURS_M = 2.8  # as deep as a reader's rays are drawn, twice as deep as the camera's own pyramid
_MAIN = ("picture", "rays")
_AFTER = "what becomes of it"
_ASIDE = ("K", "pixels", "numbers")
_SHARES = {"K": 265, _AFTER: 230, "pixels": 185, "numbers": 280}  # of the second row, where K takes two tiles
_MARKS = ("balloon", "globe", "centre", "corners")
# Of one row, by how many panels of either kind stand in it: its height at most and their widths.
_ONE_ROW: dict[tuple[int, int], tuple[float, tuple[float, ...]]] = {
    (1, 1): (440, (675, 285)),
    (1, 2): (390, (410, 285, 265)),
    (2, 0): (390, (480, 480)),
    (2, 1): (330, (345, 330, 285)),
}
_ALONE, _MOST_ACROSS = 330, 620  # units of height and width of a picture that stands alone
_TWO_ROWS = {1: (374, (960,)), 2: (374, (460, 500))}  # of the first: the second is as high as K needs
_MATRIX_HIGH = 222
_BELOW = 140  # picture units from one matrix to the other
_RAYS = "The rays it picks out"


@dataclass(frozen=True)
class IntrinsicsView(OrbitView):
    """Nine numbers, the picture they make of the garden and the rays they choose.

    The camera looks along z, `distance` metres in front of the globe. `focal_px`, `focal_mm` and `aspect` are no state
    of their own: they are read from fx, fy and the pixel pitch, and setting them with `but` sets fx and fy. Without
    `millimetres` the readings leave out what K alone cannot know.

    `panels` names what is drawn: the picture, and beside it any of rays, K, pixels and numbers. `marks` names what is
    marked in the picture, any of balloon, globe, centre and corners; where the balloon is not, the garden has none.
    `yours` is a reader's function of (uv, K), pixels (..., 2) to unit rays (..., 3) in camera coordinates; its rays are
    orange.
    """

    title: ClassVar[str] = "Intrinsics"
    openable: ClassVar[Mapping[str, str]] = {
        "rays": "rays in space",
        "K": "K",
        "pixels": "its pixels",
        "numbers": "numbers",
    }

    fx: float = slider(450.0, **_FOCAL, help="focal length in widths of a pixel")
    fy: float = slider(450.0, **_FOCAL, help="focal length in heights of a pixel")
    cx: float = slider(319.5, -100.0, 740.0, 0.5, unit="px", help="column of the principal point")
    cy: float = slider(239.5, -100.0, 580.0, 0.5, unit="px", help="row of the principal point")
    skew: float = slider(0.0, -150.0, 150.0, 1.0, unit="px", help="shear of the pixel axes; 0 in nearly every camera")
    distance: float = slider(3.0, _NEAREST, _FARTHEST, 0.05, unit="m", help="from the camera to the globe")
    dolly_zoom: bool = switch(False, label="dolly-zoom lock", help="move the camera so that the globe keeps its size")
    operation: str = choice("as taken", "cropped", "resized", "binned", help="what is done to the picture afterwards")
    x0: float = slider(256, 0, 320, 1, label="crop x0", unit="px", help="first column kept")
    y0: float = slider(96, 0, 240, 1, label="crop y0", unit="px", help="first row kept")
    scale: float = slider(0.5, 0.1, 2.0, 0.05, label="resize by", help="new width divided by old width")
    pitch_um: float = slider(6.0, 1.0, 12.0, 0.1, label="pixel width", unit="µm", help="K does not know it")
    width: int = 640
    height: int = 480
    millimetres: bool = True
    eye: OrbitCamera = OrbitCamera(distance=20.5, yaw_deg=-62, pitch_deg=34, vfov_deg=30)
    panels: str = "picture rays K pixels numbers"
    marks: str = "balloon globe centre corners"
    yours: Callable[..., Any] | None = field(default=None, compare=False, repr=False)

    def __post_init__(self) -> None:
        super().__post_init__()
        wanted = self.panels.split()
        if "picture" not in wanted or not set(wanted) <= {*_MAIN, *_ASIDE}:
            raise ValueError(
                f"panels must be picture and any of rays, {', '.join(_ASIDE)} beside it, got {self.panels!r}"
            )
        if not set(self.marks.split()) <= set(_MARKS):
            raise ValueError(f"marks must be any of {', '.join(_MARKS)}, got {self.marks!r}")

    @classmethod
    def alone(cls, **state: Any) -> Self:
        """One wide picture of 640 × 360 pixels, and nothing else open; `state` are fields of the view."""
        first: dict[str, Any] = {"height": 360, "cy": 179.5, "millimetres": False, "panels": "picture"}
        return cls(**{**first, **state})

    @classmethod
    def of(cls, camera: Camera, **state: Any) -> Self:
        """The view of a given camera's intrinsics, taking its picture in the garden; further fields by name."""
        K = camera.intrinsics
        return cls(K.fx, K.fy, K.cx, K.cy, K.skew, width=K.width, height=K.height, **state)

    @classmethod
    def controls(cls) -> dict[str, Control]:
        """The fields' controls, and those of the three readings that can be set."""
        zoom = Control("focal length", "px", _FOCAL["low"], _FOCAL["high"], 1.0, help="fx and fy together")
        lens = Control("focal length", "mm", 0.9, 12.0, 0.01, help="the lens: fx and fy together")
        shape = Control("pixel aspect", "", 0.5, 2.0, 0.01, help="width of a pixel / its height = fy / fx")
        return {**super().controls(), "focal_px": zoom, "focal_mm": lens, "aspect": shape}

    @property
    def focal_px(self) -> float:
        """Focal length in widths of a pixel, by which one zooms."""
        return self.fx

    @property
    def focal_mm(self) -> float:
        """Focal length in millimetres, which takes the width of a pixel to know."""
        return self.fx * self.pitch_um / 1000

    @property
    def aspect(self) -> float:
        """The width of a pixel divided by its height: fy / fx."""
        return self.fy / self.fx

    def but(self, **changes: Any) -> Self:
        """The same view with some fields changed; a focal length and `aspect` change fx and fy, the lock the rest."""
        controls = self.controls()
        for name in changes.keys() & {"focal_px", "focal_mm", "aspect"}:
            controls[name].checked(name, changes[name])
        zoom = changes.pop("focal_mm", self.focal_mm) / self.focal_mm * changes.pop("focal_px", self.fx) / self.fx
        aspect = changes.pop("aspect", None)
        changes = {"fx": zoom * self.fx, "fy": zoom * self.fy, **changes} if zoom != 1 else changes
        if aspect is not None:
            changes["fy"] = aspect * changes.get("fx", self.fx)
        changed = super().but(**changes)
        return self._locked(changed) if changed.dolly_zoom and aspect is None else changed

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
        return balloon_in_sight(self.camera.centre)

    # The words -------------------------------------------------------------------------------------------------------

    def numbers(self) -> dict[str, str]:
        """The state's key figures, as text; of the globe and the balloon where they are marked."""
        across, down = self.field_of_view_deg()
        pitch = self.pitch_um * self.taken.fx / self.intrinsics.fx
        lens = {"focal length": f"{self.focal_mm:.2f} mm, if a pixel is {pitch:.3g} µm wide"}
        globe = {"camera to globe": f"{self.distance:.2f} m; there, 1 m is {self.intrinsics.fx / self.distance:.0f} px"}
        balloon = {"red balloon": f"{100 * self.in_sight():.0f} % in sight"}
        return {
            "field of view": f"{across:.1f}° × {down:.1f}°",
            **(lens if self.millimetres else {}),
            "pixel width / height": f"{self.aspect:.3f}, axes at {self.axes_angle_deg():.1f}°",
            **(globe if self._marked("globe") or self._marked("balloon") else {}),
            **(balloon if self._marked("balloon") else {}),
        }

    def description(self) -> str:
        K = self.intrinsics
        figures = listed(self.numbers())
        return (
            f"{self.operation}, {K.width} × {K.height} pixels: fx = {K.fx:.2f}, fy = {K.fy:.2f}, cx = {K.cx:.2f}, "
            f"cy = {K.cy:.2f}, skew = {K.skew:.2f}; {figures}."
        ).capitalize()

    def rule(self) -> str:
        """What the operation does to K, with its numbers; "" for a picture as taken."""
        (x0, y0), s = self._corner, self.intrinsics.width / self.width
        return {
            "as taken": "",
            "cropped": f"c′ = c − ({x0}, {y0}); f and skew stay",
            "resized": f"f′ = {s:g} f,  c′ = {s:g} c {_signed((s - 1) / 2)}",
            "binned": f"f′ = f / {BINS},  c′ = c / {BINS} {_signed((s - 1) / 2)}",
        }[self.operation]

    # The picture -----------------------------------------------------------------------------------------------------

    def figure(self, *, draft: bool = False) -> Picture:
        draw = {"K": self._matrices, "pixels": self._lattice_panel, "numbers": self._numbers_column}
        parts, photographs = {"picture": self._picture_panel()}, {"camera": jpeg(self.image(draft=draft))}
        if self._has("rays"):
            parts["rays"], attached = self._space_panel(draft)
            photographs |= attached
        for name in _ASIDE:
            parts |= draw[name]() if self._has(name) else {}
        return self.tiled(self._layout, parts, photographs)

    @cached_property
    def _layout(self) -> dict[str, Cell]:
        """One row of up to three panels; else picture and rays in the first, and the others below them."""
        main, aside = [name for name in _MAIN if self._has(name)], [name for name in _ASIDE if self._has(name)]
        if len(main) + len(aside) == 1:  # as wide as its picture: a telephone shows all of it
            return rows((_ALONE, {"picture": min(_MOST_ACROSS, round((_ALONE - 44) * self.width / self.height + 20))}))
        if (len(main), len(aside)) in _ONE_ROW:
            height, widths = _ONE_ROW[len(main), len(aside)]
            return rows((height, dict(zip([*main, *aside], widths, strict=True))))
        height, widths = _TWO_ROWS[len(main)]
        tiles = [name for name in _SHARES if self._has("K" if name == _AFTER else name)]
        whole = sum(_SHARES[name] for name in tiles)
        second = {name: WIDTH * _SHARES[name] / whole for name in tiles}
        return rows((height, dict(zip(main, widths, strict=True))), (_MATRIX_HIGH, second))

    def _marked(self, name: str) -> bool:
        return name in self.marks.split()

    def image(self, *, draft: bool) -> np.ndarray:
        """The picture (height, width, 3); a crop is shown within the whole, so it shows the picture as taken."""
        K = self.taken if self.operation == "cropped" else self.intrinsics
        wide = min(K.width, 320 if draft else 440)
        grid = K if wide == K.width else K.resized(wide, max(1, round(wide * K.height / K.width)))
        return _photographed(grid, float(self.camera.centre[2]), max(1, round(320 / wide)), self._marked("balloon"))

    @cached_property
    def _picture(self) -> Panel:
        """In the pixels of the picture as taken."""
        return image_in(self._layout["picture"], "picture", self.width, self.height)

    def _picture_panel(self) -> str:
        panel, K = self._picture, self.intrinsics
        coarse = {"style": "image-rendering:pixelated"} if K.width < 200 else {}
        content = placed_image(panel, "camera", self.width, self.height, **coarse) + self._window()
        content += self._behind() if self._marked("balloon") else ""
        content += self._globe() if self._marked("globe") else ""
        content += self._principal_point() if self._marked("centre") else ""
        note = f"{K.width} × {K.height} pixels"
        title = "The picture" if self.operation == "as taken" else f"The picture, {self.operation}"
        return panel.show(content, title=title, note=note)

    def _window(self) -> str:
        """The corners' names in the picture's own pixels; around a crop, what it leaves out."""
        panel, K = self._picture, self.intrinsics
        (x0, y0), (x1, y1) = self._as_taken([(-0.5, -0.5), (K.width - 0.5, K.height - 0.5)])
        names = ""
        if self._marked("corners"):
            names = _tag((x0 + 8, y0 + 17), "(0, 0)") + _tag(
                (x1 - 8, y1 - 9), f"({K.width - 1}, {K.height - 1})", "end"
            )
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
        ends = at - np.diag((12, 12)), at + np.diag((12, 12))
        cross = svg.segments(*ends, "white", style="stroke:#fff;stroke-width:6px") + svg.segments(*ends, "orange thick")
        side, dx = ("end", -8) if at[0] > self._picture.width - 80 else ("", 8)
        inside = np.clip(at + (dx, 22), (8, 36), np.array([self._picture.width, self._picture.height]) - (8, 30))
        name = _tag(inside, "(cx, cy)", side)
        hand = svg.element("circle", cx=at[0], cy=at[1], r=16, fill_opacity=0, class_="card")
        label = f"Principal point at column {K.cx:.1f}, row {K.cy:.1f}; arrow keys move it"
        handle = {"data_drag": "principal", "tabindex": 0, "role": "group", "aria_label": label}
        return svg.group(hand + cross + name, **handle)

    def _behind(self) -> str:
        """Where the balloon is, whether or not it can be seen."""
        outline = self._seen(balloon_rim(self.camera.centre))
        hidden = self.in_sight() < 0.5
        top = outline[np.argmin(outline[:, 1])] - (0, 11)
        ring = svg.line(outline, "white", style="stroke:#fff;stroke-width:4.5px") if hidden else ""
        words = "a balloon, behind the wall" if hidden else "the balloon"
        return ring + svg.line(outline, f"red thick{' dotted' if hidden else ''}") + _tag(top, words, "middle")

    def _globe(self) -> str:
        """How wide the globe is, in the pixels of the picture after the operation."""
        ends = GLOBE + np.array([(-GLOBE_RADIUS, -GLOBE_RADIUS - 0.08, 0), (GLOBE_RADIUS, -GLOBE_RADIUS - 0.08, 0)])
        left, right = self._seen(ends)
        pixels = self.intrinsics.fx * 2 * GLOBE_RADIUS / self.distance
        half = np.array((0, 5))
        bar = svg.segments([left, left - half, right - half], [right, left + half, right + half], "green thick")
        return bar + _tag((left + right) / 2 - (0, 11), f"{pixels:.0f} px", "middle")

    def _seen(self, points: Array) -> Array:
        """Panel coordinates (..., 2) of points (..., 3) in the garden."""
        return self._as_taken(self.camera.project(points))

    # The rays --------------------------------------------------------------------------------------------------------

    def _space_panel(self, draft: bool) -> Drawn:
        x, _, across, high = self._layout["rays"]
        panel = space_panel("space", x + 10, 34, across - 20, high - 44)
        items = [*self._frustum(), *(self._line_of_sight() if self._marked("balloon") else [])]
        span = BALLOON[2] - self.camera.centre[2]  # the onlooker steps back so far as to see both its ends
        target = (0.0, 0.2, float(BALLOON[2] - 0.49 * span))
        eye = replace(self.eye, target=target, distance=self.eye.distance * (3 + span) / 14)
        scenery = scene_items(balloon_scene if self._marked("balloon") else textured_scene, "wire")
        yours, words, problem = self._your_rays() if self.yours else ([], "", "")
        if is_unwritten(problem):
            right, attached = draw_space(panel, items + yours, eye, draft=draft, renderer="wire", scenery=scenery)
            return without(panel, problem, _RAYS, right=right), attached
        label = "The camera, its rays and the garden in space; drag or press the arrow keys to walk around"
        seen: dict[str, Any] = {"eye": eye, "scenery": scenery, "over": words, "drag": "orbit"}
        return self.in_space(panel, items + yours, draft, _RAYS, label, **seen)

    def _frustum(self) -> list[Item]:
        items = camera_body(self.camera, 1.4, colour="blue")
        corners = self.intrinsics.border(1)
        items += [Line(_ray(self.camera, corner, 7.5), "blue faint", 1.0) for corner in corners]
        centre = np.array([self.intrinsics.cx, self.intrinsics.cy])
        items.append(Line(_ray(self.camera, centre, 2.2), "ink" if self.yours else "orange", 1.8, head=True))
        if self.operation == "cropped":
            whole = Camera(self.taken, world_from_cam=self._pose)
            items += [Line(_ray(whole, corner, 1.4), "muted dashed", 1.0) for corner in self.taken.border(1)]
        return items

    def _your_rays(self) -> tuple[list[Item], str, str]:
        """The rays of the picture's corners and border by the reader's function, as long as right ones to one depth,
        which are blue; words over them; and what is wrong with it. An unwritten one has right rays to wait for it.
        """
        assert self.yours is not None
        _, _, across, high = self._layout["rays"]
        uv = self.intrinsics.border(4)
        right = self.camera.unproject(uv)
        rays, problem = tried(self.yours, (uv, self.intrinsics.K), right)
        length = _YOURS_M / right[:, 2:]
        rim = self.camera.centre + length * right
        frame: list[Item] = [Line(closed(rim), "blue", 3.4)]
        if problem and not is_unwritten(problem):
            return frame, svg.paragraph((14, 24), problem, across - 48), problem
        ends = rim if problem else self.camera.centre + length * rays
        spokes = [Line(np.array([self.camera.centre, ends[i]]), "orange", 1.8) for i in range(0, len(uv), len(uv) // 4)]
        name = svg.text((14, high - 52), "orange: your rays of corners and border", "orange halo")
        return [*frame, *spokes, Line(closed(ends), "orange", 1.8)], name, problem

    def _line_of_sight(self) -> list[Item]:
        """To the balloon: broken where something stands in the way."""
        stopped, ends = towards_balloon(self.camera.centre), np.array([self.camera.centre, BALLOON])
        rim = balloon_rim(BALLOON - 6.0)
        balloon: list[Item] = [Line(rim, "red thick", 2.4), Label(BALLOON - (0, 0.4, 0), "balloon", "red halo")]
        if not np.isfinite(stopped).all():
            return [Line(ends, "red", 1.8), *balloon]
        to_wall, beyond = np.array([self.camera.centre, stopped]), np.array([stopped, BALLOON])
        return [Line(to_wall, "red", 1.8), Line(beyond, "red dotted", 1.4), *balloon]

    # The matrices ----------------------------------------------------------------------------------------------------

    def _matrices(self) -> dict[str, str]:
        """K, and what becomes of it: in a tile beside it, or in one narrow tile below it."""
        x, y, across, _ = self._layout["K"]
        x, y = x + 10, y + 48
        name = "K" if self.operation == "as taken" else "K, as taken"
        before = intrinsic_matrix(x, y, name, self.taken.K)
        if _AFTER not in self._layout:
            return {"K": before + self._afterwards(x, y + _BELOW, across - 30)}
        left, _, wide, _ = self._layout[_AFTER]
        return {"K": before, _AFTER: self._afterwards(left + 10, y, wide - 20)}

    def _afterwards(self, x: float, y: float, width: float) -> str:
        """What the operation makes of K, and by which rule; of a picture as taken, what K does."""
        K = self.intrinsics
        if self.operation == "as taken":
            u = f"u = {K.fx:.2f} x {_signed(K.skew)} y {_signed(K.cx)}"
            lines = [(u, "number"), (f"v = {K.fy:.2f} y {_signed(K.cy)}", "number"), ("with x = X/Z, y = Y/Z", "note")]
            return "".join(svg.text((x, y + 10 + 20 * i), *line) for i, line in enumerate(lines))
        changed = ~np.isclose(self.taken.K, K.K, rtol=0, atol=1e-9)
        after = intrinsic_matrix(x, y, f"K, {self.operation}", K.K, changed)
        return after + svg.paragraph((x, y + 98), self.rule(), width)

    def _lattice_panel(self) -> dict[str, str]:
        """A few pixels as they lie on the sensor, their lean drawn larger than it is."""
        K = replace(self.intrinsics, skew=_LEAN_DRAWN * self.intrinsics.skew)
        x, y, across, high = self._layout["pixels"]
        side = min(across - 20, high - 44)
        panel = Panel("lattice", x + 10, y + 34, side, side, -90, 90, -90, 90)
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
        return {"pixels": panel.show(content, title="Its pixels", note=note)}

    def _numbers_column(self) -> dict[str, str]:
        """All figures, and the shape of a pixel only beside K or pixels, or where millimetres count."""
        x, y, _, _ = self._layout["numbers"]
        figures = self.numbers()
        if not (self._has("K") or self._has("pixels") or self.millimetres):
            del figures["pixel width / height"]
        return {"numbers": readout(figures, (x + 10, y + 26), (0, 40), (0, 17))}

    # The hands -------------------------------------------------------------------------------------------------------

    def dragged(self, handle: str, x: float, y: float, dx: float, dy: float) -> Self:
        """The principal point and the crop follow the pointer on the picture; in space one walks around."""
        du, dv = np.array([dx, dy]) / self._picture.scale
        if handle == "principal":
            return self.but(cx=float(self.cx + du), cy=float(self.cy + dv))
        if handle == "window":
            column = min(max(self.x0 + du, 0), self.width - self.width // 2)
            return self.but(x0=float(column), y0=float(min(max(self.y0 + dv, 0), self.height - self.height // 2)))
        return super().dragged(handle, x, y, dx, dy)

    def pressed(self, handle: str, key: str) -> Self:
        """An arrow moves the principal point or the crop by eight pixels."""
        if handle not in ("principal", "window"):
            return super().pressed(handle, key)
        steps = {"ArrowLeft": (-8, 0), "ArrowRight": (8, 0), "ArrowUp": (0, -8), "ArrowDown": (0, 8)}
        dx, dy = np.array(steps.get(key, (0, 0))) * self._picture.scale
        return self.dragged(handle, float("nan"), float("nan"), float(dx), float(dy))


def _tag(at: Any, words: str, anchor: str = "") -> str:
    """Words on a photograph: white with a dark edge, whatever the theme."""
    edge = "fill:#fff;stroke:#10151c;stroke-width:4px;stroke-linejoin:round;paint-order:stroke"
    return svg.text(at, words, f"label {anchor}", style=edge)


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


@lru_cache(maxsize=4)
def _photographed(intrinsics: Intrinsics, z: float, supersample: int, balloon: bool) -> np.ndarray:
    camera = Camera(intrinsics, world_from_cam=RigidTransform.from_translation([0, 0, z]))
    picture = to_display(render(balloon_scene() if balloon else textured_scene(), camera, supersample))
    picture.flags.writeable = False
    return picture
