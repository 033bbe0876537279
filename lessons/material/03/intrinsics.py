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
from camviz.draw.flow import WIDTH, Cell, rows, shortened
from camviz.draw.items import closed
from camviz.draw.matrix import intrinsic_matrix
from camviz.draw.panel import Panel, image_in, placed_image
from camviz.draw.picture import Picture, jpeg
from camviz.draw.readout import listed, readout
from camviz.draw.space import Item, Label, Line, OrbitCamera, camera_body, draw_space, scene_items, space_panel
from camviz.lenses.base import Array
from camviz.poses import RigidTransform
from camviz.scenes import render, textured_scene, to_display
from camviz.views.base import Drawn, without
from camviz.views.yours import is_unwritten, tried
from camviz_school.views.balloon import BALLOON, balloon_rim, balloon_scene, towards_balloon
from camviz_school.views.camera_matrix import GLOBE, GLOBE_RADIUS, CameraMatrix, added

_LEAN_DRAWN = 3  # times
_YOURS_M = 2.8  # as deep as a reader's rays are drawn, twice as deep as the camera's own pyramid
_MAIN = ("picture", "rays")
_AFTER = "what becomes of it"
_ASIDE = ("K", "pixels", "numbers")
_SHARES = {"K": 265, _AFTER: 230, "pixels": 185, "numbers": 280}  # of the second row, where K takes two tiles
_MARKS = ("balloon", "globe", "centre", "corners")
# Of one row, by how many panels of either kind stand in it: its height at most and their widths.
_ONE_ROW: dict[tuple[int, int], tuple[float, tuple[float, ...]]] = {
    (1, 1): (440, (620, 340)),
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
class IntrinsicsView(CameraMatrix):
    """Nine numbers, the picture they make of the garden and the rays they choose.

    Without `millimetres` the readings leave out what K alone cannot know.

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
            return shortened(rows((height, dict(zip([*main, *aside], widths, strict=True)))), K=310, numbers=230)
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

    def _picture_panel(self) -> svg.Marks:
        panel, K = self._picture, self.intrinsics
        coarse = {"style": "image-rendering:pixelated"} if K.width < 200 else {}
        content = placed_image(panel, "camera", self.width, self.height, **coarse) + self._window()
        content += self._behind() if self._marked("balloon") else svg.NOTHING
        content += self._globe() if self._marked("globe") else svg.NOTHING
        content += self._principal_point() if self._marked("centre") else svg.NOTHING
        note = f"{K.width} × {K.height} pixels"
        title = "The picture" if self.operation == "as taken" else f"The picture, {self.operation}"
        return panel.show(content, title=title, note=note)

    def _window(self) -> svg.Marks:
        """The corners' names in the picture's own pixels; around a crop, what it leaves out."""
        panel, K = self._picture, self.intrinsics
        (x0, y0), (x1, y1) = self._as_taken([(-0.5, -0.5), (K.width - 0.5, K.height - 0.5)])
        names = svg.NOTHING
        if self._marked("corners"):
            names = _tag((x0 + 8, y0 + 17), "(0, 0)") + _tag(
                (x1 - 8, y1 - 9), f"({K.width - 1}, {K.height - 1})", "end"
            )
        if self.operation != "cropped":
            return names
        around = [(0, 0), (panel.width, 0), (panel.width, panel.height), (0, panel.height)]
        hole = [(x0, y0), (x0, y1), (x1, y1), (x1, y0)]
        shade = svg.path([around, hole], "", closed=True, fill="#000", fill_opacity=0.55, stroke="none")
        label = f"The cropped window, from column {self._corner[0]} and row {self._corner[1]}; arrow keys move it"
        frame = svg.polygon([(x0, y0), (x1, y0), (x1, y1), (x0, y1)], "orange thick")
        hand = svg.rectangle(x0, y0, x1 - x0, y1 - y0, "card", fill_opacity=0)
        return shade + svg.handle(hand + frame + names, "window", label)

    def _as_taken(self, uv: Any) -> Array:
        """Panel coordinates (..., 2) of pixels (..., 2) of the picture after the operation: the same rays."""
        return self._picture.place(self.taken.to_pixels(self.intrinsics.from_pixels(uv)))

    def _principal_point(self) -> svg.Marks:
        K = self.intrinsics
        at = self._as_taken((K.cx, K.cy))
        ends = at - np.diag((12, 12)), at + np.diag((12, 12))
        cross = svg.segments(*ends, "white", stroke="#fff", stroke_width=6) + svg.segments(*ends, "orange thick")
        side, dx = ("end", -8) if at[0] > self._picture.width - 80 else ("", 8)
        inside = np.clip(at + (dx, 22), (8, 36), np.array([self._picture.width, self._picture.height]) - (8, 30))
        before, after = "← " if at[0] < 0 else "", " →" if at[0] > self._picture.width else ""
        name = _tag(inside, f"{before}(cx, cy){after}", side)
        hand = svg.circle(at, 16, "card", fill_opacity=0)
        label = f"Principal point at column {K.cx:.1f}, row {K.cy:.1f}; arrow keys move it"
        return svg.handle(hand + cross + name, "principal", label)

    def _behind(self) -> svg.Marks:
        """Where in the picture the balloon is, whether or not it can be seen."""
        outline = self._seen(balloon_rim(self.camera.centre))
        if not self._in_picture(outline):
            return svg.NOTHING
        hidden = self.in_sight() < 0.5
        top = outline[np.argmin(outline[:, 1])] - (0, 11)
        ring = svg.line(outline, "white", stroke="#fff", stroke_width=4.5) if hidden else svg.NOTHING
        words = "a balloon, behind the wall" if hidden else "the balloon"
        return ring + svg.line(outline, f"red thick{' dotted' if hidden else ''}") + _tag(top, words, "middle")

    def _globe(self) -> svg.Marks:
        """How wide the globe is, in the pixels of the picture after the operation."""
        ends = GLOBE + np.array([(-GLOBE_RADIUS, -GLOBE_RADIUS - 0.08, 0), (GLOBE_RADIUS, -GLOBE_RADIUS - 0.08, 0)])
        left, right = self._seen(ends)
        if not self._in_picture((left, right)):
            return svg.NOTHING
        pixels = self.intrinsics.fx * 2 * GLOBE_RADIUS / self.distance
        half = np.array((0, 5))
        bar = svg.segments([left, left - half, right - half], [right, left + half, right + half], "green thick")
        return bar + _tag((left + right) / 2 - (0, 11), f"{pixels:.0f} px", "middle")

    def _seen(self, points: Array) -> Array:
        """Panel coordinates (..., 2) of points (..., 3) in the garden."""
        return self._as_taken(self.camera.project(points))

    def _in_picture(self, at: Any) -> bool:
        """Whether any of the panel coordinates (n, 2) is."""
        size = self._picture.width, self._picture.height
        return bool(np.any(np.all((np.array(at) >= 0) & (np.array(at) <= size), axis=-1)))

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

    def _your_rays(self) -> tuple[list[Item], svg.Marks, str]:
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

    def _matrices(self) -> dict[str, svg.Marks]:
        """K, and what becomes of it: in a tile beside it, or in one narrow tile below it."""
        x, y, across, _ = self._layout["K"]
        x, y = x + 10, y + 48
        name = "K" if self.operation == "as taken" else "K, as taken"
        before = intrinsic_matrix(x, y, name, self.taken.K)
        if _AFTER not in self._layout:
            return {"K": before + self._afterwards(x, y + _BELOW, across - 30)}
        left, _, wide, _ = self._layout[_AFTER]
        return {"K": before, _AFTER: self._afterwards(left + 10, y, wide - 20)}

    def _afterwards(self, x: float, y: float, width: float) -> svg.Marks:
        """What the operation makes of K, and by which rule; of a picture as taken, what K does."""
        K = self.intrinsics
        if self.operation == "as taken":
            u = f"u = {K.fx:.2f} x {added(K.skew)} y"
            equations = [u, added(K.cx)] if K.skew else [f"{u} {added(K.cx)}"]
            equations.append(f"v = {K.fy:.2f} y {added(K.cy)}")
            lines = [*((line, "number") for line in equations), ("with x = X/Z, y = Y/Z", "note")]
            return svg.join(svg.text((x, y + 10 + 20 * i), *line) for i, line in enumerate(lines))
        changed = ~np.isclose(self.taken.K, K.K, rtol=0, atol=1e-9)
        after = intrinsic_matrix(x, y, f"K, {self.operation}", K.K, changed)
        return after + svg.paragraph((x, y + 98), self.rule(), width)

    def _lattice_panel(self) -> dict[str, svg.Marks]:
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
            + svg.text(np.clip(u[1] - (0, 8), 14, side - 8), "u", "orange halo middle")
            + svg.text(np.clip(v[1] + (6, 6), 14, side - 14), "v", "green halo")
        )
        note = f"lean drawn {_LEAN_DRAWN} ×" if K.skew else ""
        return {"pixels": panel.show(content, title="Its pixels", note=note)}

    def _numbers_column(self) -> dict[str, svg.Marks]:
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


def _tag(at: Any, words: str, anchor: str = "") -> svg.Marks:
    """Words on a photograph: white with a dark edge, whatever the theme."""
    return svg.text(at, words, f"label halo {anchor}", fill="#fff", stroke="#10151c", stroke_width=4)


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
