"""The frustum visualizer: a camera in its world, the picture it takes, and the numbers that say where it stands.

A reader's own function can say where the camera stands; that camera is drawn beside the right one.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace
from functools import cached_property
from math import atan, degrees, radians, tan
from typing import Any, ClassVar, Self

import numpy as np

from camviz.cameras import Camera, Intrinsics, transform
from camviz.draw import svg
from camviz.draw.flow import Cell, Part, rows
from camviz.draw.marks import NOTHING, Marks
from camviz.draw.matrix import matrix
from camviz.draw.panel import Panel, image_panel, placed_image
from camviz.draw.picture import Picture
from camviz.draw.readout import decimal, readout, vector
from camviz.draw.space import (
    Dots,
    Item,
    Label,
    Line,
    OrbitCamera,
    axes_triad,
    camera_body,
    chosen_renderer,
    draw_space,
    scene_items,
    space_panel,
)  # fmt: skip
from camviz.lenses import Lens, Perspective
from camviz.lenses.base import Array, unit
from camviz.poses import RigidTransform, Rotation
from camviz.scenes import board_corners, textured_scene
from camviz.views import garden
from camviz.views.base import Drawn, OrbitView, choice, slider, switch, without
from camviz.views.marks import border_arrow, clipped
from camviz.views.yours import is_unwritten, tried

SUBJECT = (0.0, 0.3, 3.2)  # what the camera orbits: a point in the middle of the scene
_MAIN = ("world", "picture")
_BOTH, _ALONE = 344, 330  # heights of a row of both, and of one alone, whose controls fit a screen with it
_MOST_ACROSS = 560
_TILES = {"numbers": {"rotation": 220, "position": 280}, "K": {"intrinsics": 205}, "point": {"one point": 255}}
_WORLD = "The camera in its world"
_REACH = 0.7  # metres of the world's axes that are drawn


def _metres(default: float, help: str) -> Any:
    return slider(default, -6.0, 6.0, 0.05, unit="m", help=help)


def _degrees(default: float, reach: float, label: str, help: str) -> Any:
    return slider(default, -reach, reach, 1.0, label=label, unit="°", help=help)


@dataclass(frozen=True)
class FrustumView(OrbitView):
    """Where a camera stands, which way it looks, and what of the world it therefore sees.

    x, y, z are what `mode` says: the camera's centre C ("edit C"), the t of its extrinsics [R | t] ("edit t"), or where
    the camera has the middle of the scene ("orbit"). Changing the mode leaves the camera where it is.
    `panels` names what is drawn: the world, the picture or both, and below them any of numbers (R, t and C), K, and one
    point, step by step, with C's formula. `marks` names what `points` projects over the picture: corners and axes.
    `yours` is a reader's function of (R, t) that gives the centre (3,): the camera that stands there is orange, with
    what it would see of the board, and the right camera is blue.
    """

    title: ClassVar[str] = "A camera in its world"
    openable: ClassVar[Mapping[str, str]] = {
        "world": "the camera in its world",
        "picture": "what it sees",
        "numbers": "R, t and C",
        "K": "K",
        "point": "one point, step by step",
    }

    mode: str = choice("edit C", "edit t", "orbit", help="what x, y, z are: the centre C, the vector t, or the subject")
    x: float = _metres(-0.6, "right")
    y: float = _metres(-0.5, "down")
    z: float = _metres(0.2, "forward")
    yaw_deg: float = _degrees(12.0, 180.0, "yaw", "to the right, about y")
    pitch_deg: float = _degrees(-8.0, 90.0, "pitch", "up, about x")
    roll_deg: float = _degrees(0.0, 180.0, "roll", "clockwise, about z")
    hfov_deg: float = slider(60.0, 20.0, 120.0, 1.0, label="field of view", unit="°", help="2 atan(width / 2 fx)")
    near: float = slider(0.3, 0.1, 1.0, 0.05, unit="m", help="where the drawn volume begins")
    far: float = slider(1.2, 0.3, 6.0, 0.1, unit="m", help="where the drawn volume ends")
    seen_from: str = choice("world view", "camera view", label="seen from", help="what stands still: world or camera")
    points: bool = switch(True, help="the board's corners and the world's axes, projected over the picture")
    panels: str = "world picture numbers K point"
    marks: str = "corners axes"
    yours: Callable[..., Any] | None = field(default=None, compare=False, repr=False)
    intrinsics: Intrinsics = field(default_factory=lambda: Intrinsics.from_fov(640, 480, 60))
    lens: Lens = field(default_factory=Perspective)
    eye: OrbitCamera = OrbitCamera(target=(0.0, 0.3, 2.2), distance=8.0, yaw_deg=-38, pitch_deg=24)

    def __post_init__(self) -> None:
        super().__post_init__()
        if not 0 < self.hfov_deg < 180:
            raise ValueError(f"hfov_deg, the field of view, must lie between 0 and 180 degrees, got {self.hfov_deg:g}")
        wanted = set(self.panels.split())
        if not wanted & set(_MAIN) or not wanted <= {*_MAIN, *_TILES}:
            raise ValueError(
                f"panels must be world, picture or both, and any of {', '.join(_TILES)} below them, got {self.panels!r}"
            )
        if self.yours is not None and "world" not in wanted:
            raise ValueError("panels must have the world, where the camera of yours stands")
        if not set(self.marks.split()) <= {"corners", "axes"}:
            raise ValueError(f"marks must be any of corners, axes, got {self.marks!r}")

    @classmethod
    def of(cls, camera: Camera, **state: Any) -> Self:
        """The view of a given camera's intrinsics and lens, put where the view begins."""
        return cls(intrinsics=camera.intrinsics, lens=camera.lens, hfov_deg=_hfov_deg(camera.intrinsics), **state)

    @classmethod
    def held(cls, **state: Any) -> Self:
        """A camera that has the world's origin 1 m straight ahead, as its t says, and an onlooker near it.

        `state` are fields of the view.
        """
        first: dict[str, Any] = {"mode": "edit t", "x": 0.0, "y": 0.0, "z": 1.0, "yaw_deg": 0.0, "pitch_deg": 0.0}
        near = OrbitCamera(target=(0.0, 0.25, 0.9), distance=5.0, yaw_deg=-38, pitch_deg=24)
        return cls(**{**first, "far": 0.7, "panels": "world", "eye": near, **state})

    @cached_property
    def camera(self) -> Camera:
        """The camera shown."""
        rotation = Rotation.from_euler("YXZ", [self.yaw_deg, self.pitch_deg, self.roll_deg], degrees=True)
        p = np.array([self.x, self.y, self.z])
        centre = p if self.mode == "edit C" else self._pivot - rotation.apply(p)
        return Camera(self._zoomed(), self.lens, RigidTransform.from_components(centre, rotation))

    @cached_property
    def your_centre(self) -> tuple[Array, str]:
        """Where the reader's function has the camera, (3,), NaN where nowhere, and what is wrong with it.

        Where it is not written yet, it is where a right one would have it.
        """
        if self.yours is None:
            return np.full(3, np.nan), ""
        centre, problem = tried(self.yours, self.camera.extrinsics, self.camera.centre)
        if is_unwritten(problem):
            return self.camera.centre, problem
        if not problem and not np.isfinite(centre).all():
            problem = "The numbers of your centre are not all finite, so no camera stands there."
        return centre, problem

    @property
    def _your_camera(self) -> Camera | None:
        """The camera at the reader's centre, turned as the right one is; None where there is none."""
        centre, problem = self.your_centre
        if self.yours is None or (problem and not is_unwritten(problem)):
            return None
        return self.camera.at(RigidTransform.from_components(centre, self.camera.world_from_cam.rotation))

    @property
    def _pivot(self) -> Array:
        """The point that stays at (x, y, z) in the camera's frame: the world's origin, whose place there is t."""
        return np.array(SUBJECT if self.mode == "orbit" else (0.0, 0.0, 0.0))

    def _zoomed(self) -> Intrinsics:
        k = self.intrinsics
        zoom = tan(radians(_hfov_deg(k)) / 2) / tan(radians(self.hfov_deg) / 2)
        return k if abs(zoom - 1) < 1e-12 else replace(k, fx=zoom * k.fx, fy=zoom * k.fy, skew=zoom * k.skew)

    def but(self, **changes: Any) -> Self:
        """The same view with some fields changed; a change of mode alone rewrites x, y, z and moves nothing."""
        if changes.get("mode", self.mode) == self.mode or changes.keys() & {"x", "y", "z"}:
            return super().but(**changes)
        changed = super().but(mode=changes.pop("mode"))
        camera = self.camera
        p = camera.centre if changed.mode == "edit C" else transform(camera.cam_from_world, changed._pivot)
        x, y, z = (p.round(9) + 0.0).tolist()
        return super(FrustumView, changed).but(x=x, y=y, z=z).but(**changes)

    # The numbers -----------------------------------------------------------------------------------------------------

    def numbers(self) -> dict[str, Array]:
        """R (3, 3) and t (3,) of the extrinsics, the centre C (3,), and K (3, 3)."""
        R, t = self.camera.extrinsics
        return {"R": R, "t": t, "C": self.camera.centre, "K": self.camera.intrinsics.K}

    def description(self) -> str:
        n = self.numbers()
        seen = int(self.camera.sees(board_corners()).sum())
        return (
            f"The camera stands at C = {vector(n['C'], 2)} m, turned {decimal(self.yaw_deg, 0)}° right, "
            f"{decimal(self.pitch_deg, 0)}° up, {decimal(self.roll_deg, 0)}° clockwise; t = {vector(n['t'], 2)} m; "
            f"field of view {self.hfov_deg:.0f}°; it sees {seen} of the board's 54 corners. Mode: {self.mode}."
        )

    # The picture -----------------------------------------------------------------------------------------------------

    def figure(self, *, draft: bool = False) -> Picture:
        image, taken = garden.drafted(self.camera) if draft else garden.taken(self.camera, garden.FINE)
        parts: dict[str, Part] = {}
        photographs = {"camera": taken}
        if self._has("world"):
            parts["world"], attached = self._world_panel(image, draft)
            photographs |= attached
        if self._has("picture"):
            parts["picture"] = self._picture_panel()
        return self.tiled(self._layout, parts | self._numbers(), photographs)

    @cached_property
    def _layout(self) -> dict[str, Cell]:
        """World and picture side by side, or one as large as fits a screen; the numbers in a row below."""
        tiles = {name: wide for panel, widths in _TILES.items() if self._has(panel) for name, wide in widths.items()}
        if all(map(self._has, _MAIN)):
            return rows((_BOTH, {"world": 540, "picture": 420}), (110, tiles))
        k, high = self.camera.intrinsics, _ALONE - 44
        across = _MOST_ACROSS if self._has("world") else min(_MOST_ACROSS, round(high * k.width / k.height) + 20)
        return rows((_ALONE, {"world" if self._has("world") else "picture": across}), (110, tiles))

    def _world_panel(self, image: np.ndarray, draft: bool) -> Drawn:
        x, y, across, high = self._layout["world"]
        panel = space_panel("world", x + 10, y + 34, across - 20, high - 44)
        from_camera = self.seen_from == "camera view"
        frame = self.camera.world_from_cam if from_camera else None
        renderer = chosen_renderer(draft=draft)
        awaited = is_unwritten(self.your_centre[1])
        items, scenery = self._items(image), scene_items(textured_scene, renderer)
        items = [one for one in items if not (awaited and isinstance(one, Label))]  # what waits is too pale for words
        content, photographs = draw_space(
            panel, items, self.eye, draft=draft, renderer=renderer, frame=frame, scenery=scenery
        )
        title = "The world around the camera" if from_camera else _WORLD
        if awaited:
            return without(panel, self.your_centre[1], title, right=content), photographs
        label = "The scene in space; drag or press the arrow keys to walk around it, plus and minus to go nearer"
        content += self._whereabouts(panel, np.zeros(3) if from_camera else self.camera.centre)
        content += self._your_numbers(panel)
        return panel.show(content, title=title, hint="drag to turn", drag="eye", label=label), photographs

    def _whereabouts(self, panel: Panel, centre: Array) -> Marks:
        """An arrow towards the camera's centre (3,) where that is out of the panel."""
        onlooker = self.eye.camera(int(panel.width), int(panel.height))
        if onlooker.sees(centre):
            return NOTHING
        return border_arrow(panel, unit(transform(onlooker.cam_from_world, centre)[:2]), "the camera is this way")

    def _items(self, image: np.ndarray) -> list[Item]:
        near = self.near if self.near < self.far else 0
        colour = "orange" if self.yours is None else "blue"
        items = camera_body(self.camera, self.far, image=image, colour=colour, near=near)
        if self._your_camera is not None:
            items += camera_body(self._your_camera, self.far, colour="orange", near=near)
            items.append(Label(self._your_camera.centre - 0.55 * _up(self.camera), "yours", "label orange"))
        items += axes_triad(RigidTransform.identity(), _REACH, "world")
        items += axes_triad(self.camera.world_from_cam, 0.35)
        items.append(Label(self.camera.centre + 0.25 * _up(self.camera), "C", f"label {colour}"))
        if self.mode != "edit C":
            items.append(Line(np.array([self.camera.centre, self._pivot]), "purple dashed", 1.8))
            items.append(Dots(self._pivot, "purple", 8))
        return items

    def _picture_panel(self) -> Marks:
        (x, y, across, high), k = self._layout["picture"], self.camera.intrinsics
        panel = image_panel("picture", x + 10, y + 34, across - 20, k.width, k.height, tallest=high - 44)
        content = placed_image(panel, "camera", k.width, k.height) + (
            self._projected(panel) if self.points else NOTHING
        )
        label = "What the camera sees; drag it, or press the arrow keys, to turn the camera"
        return panel.show(content, title="What it sees", hint="drag to look around", drag="picture", label=label)

    def _projected(self, panel: Panel) -> Marks:
        marks = self.marks.split()
        corners = self._corners(panel) + self._your_corners(panel) if "corners" in marks else NOTHING
        return corners + (self._axes(panel) if "axes" in marks else NOTHING)

    def _corners(self, panel: Panel) -> Marks:
        uv = panel.place(self.camera.project(board_corners()))
        spacing = float(np.linalg.norm(uv[1] - uv[0]))
        return svg.dots(uv, "red", float(np.clip(0.35 * spacing, 1, 5)) if np.isfinite(spacing) else 4)

    def _axes(self, panel: Panel) -> Marks:
        """The world's axes where the camera sees them, each with its name at the last place in the picture."""
        lines, names = NOTHING, NOTHING
        for name, axis, colour in zip("XYZ", np.eye(3), ("orange", "green", "blue"), strict=True):
            line = panel.place(self.camera.project(np.linspace(0, _REACH, 33)[:, None] * axis))
            lines += svg.path(clipped(panel, line), f"{colour} thick")
            inside = line[((line > 20) & (line < (panel.width - 26, panel.height - 16))).all(axis=-1)]
            if len(inside) and np.linalg.norm(inside[-1] - inside[0]) > 24:  # not one that runs straight from the eye
                names += svg.text(inside[-1] + (8, -8), name, f"label halo {colour}")
        return lines + names

    def _your_corners(self, panel: Panel) -> Marks:
        """The board's corners where the reader's camera would see them."""
        if self._your_camera is None or self.your_centre[1]:
            return NOTHING
        uv = self._your_camera.project(board_corners())
        return svg.dots(panel.place(np.where(self.camera.intrinsics.contains(uv)[:, None], uv, np.nan)), "orange", 3.5)

    def _numbers(self) -> dict[str, Part]:
        """The tiles of numbers, by name."""
        n, from_sliders = self.numbers(), " ← x, y, z"
        corners = {name: (x + 10, y + 18) for name, (x, y, _, _) in self._layout.items()}
        parts: dict[str, Part] = {}
        if self._has("numbers"):
            centre = "C = −Rᵀt [m]" if self._has("point") else "C [m]"
            (x, y), held = corners["position"], self.mode
            t = matrix((x, y), "t [m]" + from_sliders * (held == "edit t"), n["t"][:, None], 3)
            C = matrix((x + 115, y), centre + from_sliders * (held == "edit C"), n["C"][:, None], 3)
            R = matrix(corners["rotation"], "R: the camera’s axes are its rows", n["R"], 3)
            parts |= {"rotation": R, "position": t + C}
        if self._has("K"):
            parts["intrinsics"] = matrix(corners["intrinsics"], "K, intrinsics [px]", n["K"], 1)
        if self._has("point"):
            parts["one point"] = self._chain(*corners["one point"])
        return parts

    def _your_numbers(self, panel: Panel) -> Marks:
        """The reader's centre and its distance from the right one, or why there is none, in a corner of the world."""
        if self.yours is None:
            return NOTHING
        (centre, problem), x, y = self.your_centre, 14, 24
        if problem:
            return svg.paragraph((x, y), problem, panel.width - 2 * x)
        away = float(np.linalg.norm(centre - self.camera.centre))
        where = svg.text((x, y), f"your C: {vector(centre, 2)} m", "label halo orange")
        return where + svg.text((x, y + 20), f"{away:.2f} m from the camera", "label halo orange")

    def _chain(self, x: float, y: float) -> Marks:
        """One point, step by step, from (x, y) on."""
        point = board_corners()[0]
        seen_at = self.camera.project(point)
        pixel = f"{vector(seen_at, 1)} px" if np.isfinite(seen_at).all() else "has no image"
        steps = [
            ("X, first corner of the board [m]", vector(point, 2)),
            ("R X + t, in the camera's frame [m]", vector(transform(self.camera.cam_from_world, point), 2)),
            ("through lens and K", pixel),
        ]
        return readout(steps, (x, y - 2), (0, 34), (0, 16), "number")

    # Touch -----------------------------------------------------------------------------------------------------------

    def dragged(self, handle: str, x: float, y: float, dx: float, dy: float) -> Self:
        if handle != "picture":
            return super().dragged(handle, x, y, dx, dy)
        turn = self.hfov_deg / 360
        return self._turned(-turn * dx, turn * dy)

    def pressed(self, handle: str, key: str) -> Self:
        if handle != "picture":
            return super().pressed(handle, key)
        turns = {"ArrowLeft": (-2, 0), "ArrowRight": (2, 0), "ArrowUp": (0, 2), "ArrowDown": (0, -2)}
        zooms = {"+": -2.0, "=": -2.0, "-": 2.0}
        if key in turns:
            return self._turned(*turns[key])
        return self.but(hfov_deg=min(120.0, max(20.0, self.hfov_deg + zooms[key]))) if key in zooms else self

    def _turned(self, right_deg: float, up_deg: float) -> Self:
        yaw = (self.yaw_deg + right_deg + 180) % 360 - 180
        return self.but(yaw_deg=round(yaw, 2), pitch_deg=round(min(90.0, max(-90.0, self.pitch_deg + up_deg)), 2))


def _up(camera: Camera) -> Array:
    return -camera.extrinsics[0][1]


def _hfov_deg(intrinsics: Intrinsics) -> float:
    return degrees(2 * atan(intrinsics.width / (2 * intrinsics.fx)))
