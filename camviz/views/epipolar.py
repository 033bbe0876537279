"""The epipolar visualizer: one point, two cameras, and the line on which the second picture must show it."""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import cached_property, lru_cache
from typing import ClassVar

import cv2
import numpy as np
from scipy.spatial.transform import RigidTransform, Rotation

from camviz import twoview
from camviz.cameras import Camera, Intrinsics, transform
from camviz.draw import svg
from camviz.draw.panel import Panel, image_panel, photograph
from camviz.draw.picture import Picture, jpeg
from camviz.draw.space import Dots, Eye, Face, Item, Label, Line, camera_body, draw_space, space_panel
from camviz.lenses import BrownConrady, Equidistant, Lens, Perspective
from camviz.lenses.base import Array, unit
from camviz.scenes import render, textured_scene, to_display
from camviz.views.base import View, choice, slider, switch

_TURN = {"low": -40.0, "high": 40.0, "step": 0.5, "unit": "°"}
_STAND = RigidTransform.from_translation([-0.4, 0.0, 0.0])  # of the left camera in the garden
_CAMERAS = {
    "perspective": Camera(Intrinsics.from_fov(640, 480, 65), Perspective()),
    "barrel": Camera(Intrinsics.from_fov(640, 480, 75), BrownConrady(k1=-0.28, k2=0.07)),
    "fisheye": Camera(Intrinsics(640, 480, 240, 240, 319.5, 239.5), Equidistant()),
}
_DISTANCES = np.concatenate([np.geomspace(0.02, 400, 240), [np.inf]])
_NEAREST, _FARTHEST = 0.3, 30.0  # metres, of the chosen point
_PATCH = 48  # pixels on a side of the details that are compared
_PLANES = 48  # epipolar planes in a full turn around the baseline
_WIDTH = 455


@dataclass(frozen=True)
class EpipolarView(View):
    """Where a point of the left picture can appear in the right one, and what a fundamental matrix knows of it.

    The point lies at pixel (u, v) of the left picture, `depth` metres along its ray. The right camera stands at
    (right_x, right_y, right_z) in the left one's frame and is turned by yaw about y, then pitch about x, then roll
    about z. With `noise` the fundamental matrix is estimated from that many pixels' worth of error in `matches` points.
    `pair` replaces the two cameras (their poses are the sliders'), `photographs` (two of (height, width, 3) uint8) what
    they see.
    """

    title: ClassVar[str] = "Epipolar geometry"

    right_x: float = slider(0.7, -1.5, 1.5, 0.01, label="right camera x", unit="m", help="to the right of the left one")
    right_y: float = slider(0.0, -1.0, 1.0, 0.01, label="right camera y", unit="m", help="below the left one")
    right_z: float = slider(0.0, -1.0, 1.5, 0.01, label="right camera z", unit="m", help="in front of the left one")
    yaw: float = slider(-10.0, **_TURN, help="of the right camera: positive turns it to the right")
    pitch: float = slider(0.0, **_TURN, help="of the right camera: positive turns it up")
    roll: float = slider(0.0, **_TURN, help="of the right camera about its axis")
    u: float = slider(204.0, 0, 639, 1, label="point u", unit="px", help="column of the point in the left picture")
    v: float = slider(258.0, 0, 479, 1, label="point v", unit="px", help="row of the point in the left picture")
    depth: float = slider(2.0, 0.4, 12, 0.01, unit="m", help="how far along the left camera's ray the point lies")
    noise: float = slider(0.0, 0, 4, 0.05, unit="px", help="standard deviation of each match's coordinates")
    matches: int = slider(20, 8, 100, 1, help="how many corresponding points F is estimated from")
    normalised: bool = switch(True, label="normalise", help="centre and scale the points before solving for F")
    truth: bool = switch(False, label="show the truth", help="mark where the scene's surface really is")
    lens: str = choice("perspective", "barrel", "fisheye", help="of both cameras")
    pair: tuple[Camera, Camera] | None = None
    photographs: tuple[np.ndarray, np.ndarray] | None = field(default=None, compare=False, repr=False)
    eye: Eye = Eye(target=(0.1, 0.1, 1.5), distance=5.2, yaw_deg=-38, pitch_deg=33, vfov_deg=30)

    @classmethod
    def of(cls, *cameras: Camera, photographs: tuple[np.ndarray, np.ndarray] | None = None) -> EpipolarView:
        """The view of a calibrated pair, left and right, such as `of(*camviz.load(path).rig)`.

        Raises ValueError unless there are two, in different places.
        """
        if len(cameras) != 2:
            raise ValueError(f"an epipolar view takes two cameras, left and right, got {len(cameras)}")
        left, right = cameras
        left_from_right = twoview.right_from_left(right, left)
        x, y, z = left_from_right.translation.tolist()
        if not (x or y or z):
            raise ValueError(
                "the two cameras stand in the same place: does this calibration lack the pose of the right camera?"
            )
        yaw, pitch, roll = left_from_right.rotation.as_euler("YXZ", degrees=True).tolist()
        middle = {"u": (left.intrinsics.width - 1) / 2, "v": (left.intrinsics.height - 1) / 2}
        placed = {"right_x": x, "right_y": y, "right_z": z, "yaw": yaw, "pitch": pitch, "roll": roll}
        return cls(pair=(left, right), photographs=photographs, **placed, **middle)

    # The geometry ----------------------------------------------------------------------------------------------------

    @cached_property
    def left(self) -> Camera:
        """The left camera, in the garden."""
        return (self.pair[0] if self.pair else _CAMERAS[self.lens]).at(_STAND)

    @cached_property
    def right(self) -> Camera:
        """The right camera, where the sliders put it."""
        turn = Rotation.from_euler("YXZ", [self.yaw, self.pitch, self.roll], degrees=True)
        left_from_right = RigidTransform.from_components([self.right_x, self.right_y, self.right_z], turn)
        return (self.pair[1] if self.pair else _CAMERAS[self.lens]).at(_STAND * left_from_right)

    @cached_property
    def baseline(self) -> float:
        """The distance between the two centres in metres."""
        return float(np.linalg.norm(self.right.centre - self.left.centre))

    @cached_property
    def point(self) -> Array:
        """The chosen point (3,) in the world."""
        return self.left.centre + self.depth * self.left.unproject([self.u, self.v])

    @cached_property
    def uv_right(self) -> Array:
        """Where the right camera sees the chosen point, (2,); NaN where it does not."""
        return self.right.project(self.point)

    @cached_property
    def F(self) -> Array | None:  # noqa: N802
        """The fundamental matrix (3, 3) of unit norm; None without a baseline or where a lens bends lines."""
        straight = isinstance(self.left.lens, Perspective) and isinstance(self.right.lens, Perspective)
        if not straight or not self.baseline:
            return None
        F = twoview.fundamental(self.left, self.right)
        return F / np.linalg.norm(F)

    @cached_property
    def line(self) -> Array:
        """The epipolar line (3,) in the right picture; NaN where there is none."""
        return np.full(3, np.nan) if self.F is None else twoview.epipolar_lines(self.F, [self.u, self.v])

    @cached_property
    def surface(self) -> Array:
        """The point (3,) of the scene that the left picture shows at (u, v); NaN in the sky or in a photograph."""
        if self.photographs is not None:
            return np.full(3, np.nan)
        ray = self.left.unproject([self.u, self.v])
        _, distance = textured_scene().trace(self.left.centre, ray)
        return self.left.centre + float(distance) * ray

    @cached_property
    def pairs(self) -> tuple[Array, Array]:
        """Points of the scene that lie in both pictures: true pixels (n, 2) in the left and in the right one."""
        points = _landmarks(self.left.intrinsics, self.left.lens)
        points = points[self.right.sees(points)][: int(self.matches)]
        return self.left.project(points), self.right.project(points)

    @cached_property
    def noisy_pairs(self) -> tuple[Array, Array]:
        """The same pixels as a detector with errors would report them."""
        rng = np.random.default_rng(7)
        errors = rng.normal(size=(100, 2, 2))[: len(self.pairs[0])] * self.noise
        return self.pairs[0] + errors[:, 0], self.pairs[1] + errors[:, 1]

    @cached_property
    def estimate(self) -> Array | None:
        """F (3, 3) from the noisy pairs by the eight-point algorithm; None where they do not determine it."""
        if self.F is None or not self.noise or len(self.pairs[0]) < 8:
            return None
        return twoview.eight_point(*self.noisy_pairs, normalised=self.normalised)

    @cached_property
    def estimate_error(self) -> float:
        """Mean symmetric distance in pixels of the *true* pairs from the estimate's epipolar lines."""
        if self.estimate is None:
            return float("nan")
        return float(twoview.symmetric_distance(self.estimate, *self.pairs).mean())

    @cached_property
    def epipole_error(self) -> float:
        """The angle in degrees between the directions of the right picture's true and estimated epipoles."""
        if self.F is None or self.estimate is None:
            return float("nan")
        back = np.linalg.inv(self.right.intrinsics.K)
        true, found = (unit(back @ twoview.epipoles(F)[1]) for F in (self.F, self.estimate))
        return float(np.degrees(np.arctan2(np.linalg.norm(np.cross(true, found)), abs(true @ found))))

    # Words -----------------------------------------------------------------------------------------------------------

    def numbers(self) -> dict[str, str]:
        """The state's key figures, as text."""
        figures = {
            "baseline": f"{self.baseline:.3f} m",
            "left epipole": _pixel(_epipole(self.left, self.right)),
            "right epipole": _pixel(_epipole(self.right, self.left)),
            "point, right": _pixel(self.uv_right) + ("" if self.right.sees(self.point) else " (outside)"),
        }
        if self.F is not None:
            figures["off its line"] = f"{twoview.line_distance(self.line, self.uv_right):.2f} px"
        if self.estimate is not None:
            figures["estimated lines"] = f"off by {self.estimate_error:.3g} px"
            figures["its epipole"] = f"turned by {self.epipole_error:.3g}°"
        return figures

    def equation(self) -> str:
        """x_rightᵀ (F x_left) = 0 with this state's epipolar line filled in."""
        if not self.baseline:
            return "no baseline: no epipolar line"
        if self.F is None:
            return "a lens that bends: no F, a curve"
        a, b, c = self.line
        return (
            f"{a:+.3f} u {b:+.3f} v {c:+.1f} = 0".replace("-", "−") if np.isfinite(a) else "the left epipole: no line"
        )

    def description(self) -> str:
        """The state in words and numbers."""
        where = f"The point at ({self.u:.0f}, {self.v:.0f}) in the left picture lies {self.depth:.2f} m along its ray"
        figures = "; ".join(f"{name} {value}" for name, value in self.numbers().items())
        return f"{where}. {figures}. Right epipolar line: {self.equation()}."

    # Hands -----------------------------------------------------------------------------------------------------------

    def dragged(self, handle: str, x: float, y: float, dx: float, dy: float) -> EpipolarView:
        if handle == "left":
            return self._with_point(self._left_panel, x, y, dx, dy)
        if handle == "right":
            return self._with_depth(self._right_panel, x, y, dx, dy)
        return self.but(eye=self.eye.orbited(dx, dy))

    def pressed(self, handle: str, key: str) -> EpipolarView:
        if handle == "left":
            return super().pressed(handle, key)
        if handle == "right":
            farther = {"ArrowRight": 1, "ArrowUp": 1, "+": 1, "ArrowLeft": -1, "ArrowDown": -1, "-": -1}.get(key, 0)
            return self.but(depth=float(np.clip(self.depth * 1.05**farther, _NEAREST, _FARTHEST)))
        return self.but(eye=self.eye.key(key))

    def _with_point(self, panel: Panel, x: float, y: float, dx: float, dy: float) -> EpipolarView:
        """The point under the pointer, or moved by (dx, dy) where there is no pointer."""
        at = panel.place([self.u, self.v]) + (panel.x + dx, panel.y + dy) if np.isnan(x) else np.array([x, y])
        u, v = panel.data(at - (panel.x, panel.y))
        size = self.left.intrinsics
        return self.but(u=float(np.clip(u, 0, size.width - 1)), v=float(np.clip(v, 0, size.height - 1)))

    def _with_depth(self, panel: Panel, x: float, y: float, dx: float, dy: float) -> EpipolarView:
        """The depth whose image in the right picture is nearest to the pointer."""
        depths = np.geomspace(_NEAREST, _FARTHEST, 1500)
        curve = panel.place(twoview.epipolar_curve(self.left, self.right, [self.u, self.v], depths))
        away = np.linalg.norm(curve + (panel.x, panel.y) - (x, y), axis=-1)
        return self.but(depth=float(depths[np.nanargmin(away)])) if np.isfinite(away).any() else self

    # The picture -----------------------------------------------------------------------------------------------------

    def figure(self, *, draft: bool = False) -> Picture:
        images, attached = self._pictures(draft)
        space, sheets = self._space_panel(images, draft)
        details, crops = self._details(images)
        panels = [
            self._picture_panel(self._left_panel, self.left, self.right, "drag the point", "move the point"),
            self._picture_panel(self._right_panel, self.right, self.left, self.equation(), "move it along its ray"),
        ]
        body = "".join([svg.rectangle(0, 0, 960, 622, "paper"), *panels, space, self._numbers_block(), details])
        return Picture(body, 960, 622, self.title, self.description(), attached | sheets | crops)

    def _pictures(self, draft: bool) -> tuple[dict[str, np.ndarray], dict[str, bytes]]:
        """What the two cameras see, as pixels and as JPEG."""
        if self.photographs is None:
            cameras = {"left": self.left, "right": self.right}
            taken = {name: _taken(*_key(camera, 320 if draft else 480)) for name, camera in cameras.items()}
        else:
            taken = {
                name: (image, jpeg(image)) for name, image in zip(("left", "right"), self.photographs, strict=True)
            }
        return {name: image for name, (image, _) in taken.items()}, {name: data for name, (_, data) in taken.items()}

    # The two pictures ------------------------------------------------------------------------------------------------

    @property
    def _left_panel(self) -> Panel:
        return image_panel("left", 20, 34, _WIDTH, self.left.intrinsics.width, self.left.intrinsics.height)

    @property
    def _right_panel(self) -> Panel:
        return image_panel("right", 485, 34, _WIDTH, self.right.intrinsics.width, self.right.intrinsics.height)

    def _picture_panel(self, panel: Panel, camera: Camera, other: Camera, note: str, action: str) -> str:
        content = "".join(
            [
                photograph(panel, panel.name, camera.intrinsics.width, camera.intrinsics.height),
                self._pencil(panel, camera),
                self._match_dots(panel),
                self._own_line(panel, camera),
                self._estimated_line(panel, camera),
                _camera_outline(panel, camera, other),
                self._epipole_mark(panel, camera, other),
                self._point_mark(panel, camera),
            ]
        )
        label = f"The {panel.name} picture; drag or press the arrow keys to {action}"
        return panel.show(content, title=f"The {panel.name} picture", note=note, drag=panel.name, label=label)

    def _pencil(self, panel: Panel, camera: Camera) -> str:
        """Epipolar lines all around the baseline: the images of planes that meet in it."""
        if not self.baseline:
            return ""
        forward = self.left.world_from_cam.rotation.as_matrix()
        along, first = self._plane_axes(forward[:, 2] if abs(self._along @ forward[:, 2]) < 0.9 else forward[:, 0])
        turn = np.arange(_PLANES) * (2 * np.pi / _PLANES)
        across = np.cos(turn)[:, None] * first + np.sin(turn)[:, None] * np.cross(along, first)
        lines = camera.project(camera.centre + _half_planes(along, across, 40))
        return svg.path(panel.place(lines), "yellow thin half")

    def _own_line(self, panel: Panel, camera: Camera) -> str:
        """The epipolar line of the chosen point, and in the right picture strong where its ray can be seen."""
        if not self.baseline:
            return ""
        along, across = self._plane_axes(self.point - self.left.centre)
        whole = camera.project(camera.centre + _half_planes(along, np.stack([across, -across]), 160))
        lines = svg.path(panel.place(whole), "green", style="stroke-width:1.4")
        if panel.name == "right":
            ray = panel.place(twoview.epipolar_curve(self.left, self.right, [self.u, self.v], _DISTANCES))
            lines += _on_photograph([ray], "green") + _infinity(panel, ray[-1])
        return lines

    def _estimated_line(self, panel: Panel, camera: Camera) -> str:
        if self.estimate is None:
            return ""
        F, uv = (self.estimate, [self.u, self.v]) if panel.name == "right" else (self.estimate.T, self.uv_right)
        line = panel.place(twoview.clip_lines(twoview.epipolar_lines(F, uv), camera.intrinsics))
        epipole = panel.place(twoview.from_homogeneous(twoview.epipoles(F)[1]))
        return _on_photograph([line], "purple dashed") + svg.dots([epipole], "purple", 9)

    def _match_dots(self, panel: Panel) -> str:
        if not self.noise:
            return ""
        seen = self.noisy_pairs[panel.name == "right"]
        return svg.dots(panel.place(seen), "paper-dot", 7) + svg.dots(panel.place(seen), "purple", 5)

    def _epipole_mark(self, panel: Panel, camera: Camera, other: Camera) -> str:
        if not self.baseline:
            return ""
        uv = _epipole(camera, other)
        at = panel.place(uv)
        if camera.intrinsics.contains(uv):
            words = "epipole: the other camera’s centre"
            side = "end" if at[0] > panel.width / 2 else ""
            return _ring(at, "yellow", 8) + svg.text(at + (-14 if side else 14, -8), words, f"yellow halo {side}")
        toward = at - (panel.width / 2, panel.height / 2) if np.isfinite(uv).all() else _heading(camera, other)
        return _border_arrow(panel, unit(toward), f"epipole {_far(uv, camera)}")

    def _point_mark(self, panel: Panel, camera: Camera) -> str:
        at = panel.place([self.u, self.v] if panel.name == "left" else self.uv_right)
        marks = _ring(at, "red", 8) + svg.dots([at], "red", 5)
        if self.truth and np.isfinite(self.surface).all():
            true = panel.place(camera.project(self.surface))
            marks = _ring(true, "sky", 13) + svg.text(true + (17, 5), "the surface", "sky halo") + marks
        return marks

    @cached_property
    def _along(self) -> Array:
        """The direction (3,) of the baseline, from the left camera to the right one."""
        return unit(self.right.centre - self.left.centre)

    def _plane_axes(self, toward: Array) -> tuple[Array, Array]:
        """Unit axes (3,) of the epipolar plane that holds the direction `toward`: along the baseline and across it."""
        return self._along, unit(toward - (toward @ self._along) * self._along)

    # The space -------------------------------------------------------------------------------------------------------

    def _space_panel(self, images: dict[str, np.ndarray], draft: bool) -> tuple[str, dict[str, bytes]]:
        panel = space_panel("space", 20, 409, 500, 200)
        content, sheets = draw_space(panel, self._space_items(images), self.eye, draft=draft, renderer="wire")
        label = "The two cameras and the epipolar plane in space; drag or press the arrow keys to walk around"
        shown = panel.show(content, title="The epipolar plane", note="drag to turn", drag="orbit", label=label)
        return shown, sheets

    def _space_items(self, images: dict[str, np.ndarray]) -> list[Item]:
        left, right, point = self.left.centre, self.right.centre, self.point
        ray = np.array([left, left + max(8.0, self.depth) * self.left.unproject([self.u, self.v])])
        return [
            *(Line(line, "muted", 1.0) for line in _outlines()),
            *camera_body(self.left, 0.5, image=images["left"], colour="blue", name="left"),
            *camera_body(self.right, 0.5, image=images["right"], colour="orange", name="right"),
            Face(np.array([left, right, point]), "green", 0.3),
            Line(ray, "blue", 1.8),
            Line(np.array([right, point]), "orange", 1.8),
            Line(np.array([left, right]), "green", 2.6),
            Dots(point, "red", 9),
            Label((left + right) / 2, f"baseline {self.baseline:.2f} m", "label green halo"),
        ]

    # The numbers -----------------------------------------------------------------------------------------------------

    def _numbers_block(self) -> str:
        x, y = 540, 401
        rows = [svg.text((x, y), "F, of unit norm" if self.F is not None else "No F here", "title")]
        for i, row in enumerate(self.F if self.F is not None else ()):
            rows.append(svg.text((x, y + 22 + 18 * i), "".join(f"{f:+11.2e}" for f in row).replace("-", "−"), "number"))
        for i, (name, value) in enumerate(self.numbers().items()):
            rows.append(svg.text((x, y + 92 + 19 * i), name, "note"))
            rows.append(svg.text((x + 112, y + 92 + 19 * i), value, "label"))
        return "".join(rows)

    def _details(self, images: dict[str, np.ndarray]) -> tuple[str, dict[str, bytes]]:
        """What the pictures show around the point, side by side: alike where the depth is that of the surface."""
        drawn, crops = "", {}
        for i, (name, camera, uv) in enumerate(
            (("left", self.left, np.array([self.u, self.v])), ("right", self.right, self.uv_right))
        ):
            panel = Panel(f"{name} detail", 796 + 75 * i, 409, 69, 69, 0, 69, 0, 69)
            content = svg.text((34, 38), "outside", "note middle")
            if camera.intrinsics.contains(uv):
                crops[panel.name] = jpeg(_crop(images[name], camera.intrinsics, uv))
                content = svg.image(panel.name, 0, 0, 69, 69) + _ring(np.array([34.5, 34.5]), "red", 5)
            drawn += panel.show(content) + svg.text((panel.x + 34, 494), f"{name}, here", "note middle")
        return svg.text((796, 401), "Do they match?", "title") + drawn, crops


def _half_planes(along: Array, across: Array, samples: int) -> Array:
    """Directions (n, samples, 3) in the half planes that start at the line `along` (3,) towards `across` (n, 3)."""
    angle = np.linspace(0, np.pi, samples)[:, None]
    return np.cos(angle) * along + np.sin(angle) * across[:, None, :]


def _epipole(camera: Camera, other: Camera) -> Array:
    """The pixel (2,) at which `camera` sees the centre of `other`, or the point opposite; NaN where it sees neither."""
    seen, opposite = camera.project([other.centre, 2 * camera.centre - other.centre])
    return seen if np.isfinite(seen).all() else opposite


def _heading(camera: Camera, other: Camera) -> Array:
    """The direction (2,) in the picture in which the other camera lies, though it has no image."""
    towards = transform(camera.cam_from_world, other.centre)[:2]
    return towards if np.any(towards) else np.array([1.0, 0.0])


def _far(uv: Array, camera: Camera) -> str:
    middle = np.array([camera.intrinsics.width, camera.intrinsics.height]) / 2
    away = float(np.linalg.norm(uv - middle))
    return f"{away:,.0f} px this way" if away < 1e6 else "at infinity, this way"


def _border_arrow(panel: Panel, toward: Array, words: str) -> str:
    """An arrow at the panel's border that points out of it, and what lies there."""
    half = np.array([panel.width, panel.height]) / 2 - 14
    with np.errstate(divide="ignore"):
        tip = half + 14 + toward * np.min(half / np.abs(toward))
    across = np.array([-toward[1], toward[0]])
    arrow = svg.polygon([tip + 8 * toward, tip - 6 * toward + 7 * across, tip - 6 * toward - 7 * across], "fill-yellow")
    side = "end" if toward[0] > 0.5 else "" if toward[0] < -0.5 else "middle"
    below = -12 if tip[1] > half[1] else 22
    return arrow + svg.text(tip + (-14 * np.sign(toward[0]) * (side != "middle"), below), words, f"yellow halo {side}")


def _camera_outline(panel: Panel, camera: Camera, other: Camera) -> str:
    """The other camera's body, where it is in the picture."""
    _, rim = other.frustum(0, 0.12, 1)
    spokes = [np.linspace(other.centre, corner, 2) for corner in rim]
    lines = [panel.place(camera.project(line)) for line in (*spokes, np.vstack([rim, rim[:1]]))]
    return _on_photograph(lines, "orange" if panel.name == "left" else "blue")


def _on_photograph(lines: list[Array], class_: str) -> str:
    """Lines with a light edge, to stand out from any photograph."""
    return svg.path(lines, "paper-line") + svg.path(lines, class_)


def _ring(at: Array, class_: str, radius: float) -> str:
    turn = np.linspace(0, 2 * np.pi, 33)
    return _on_photograph([at + radius * np.stack([np.cos(turn), np.sin(turn)], axis=-1)], class_)


def _infinity(panel: Panel, at: Array) -> str:
    return svg.dots([at], "green", 8) + svg.text(at + (0, -9), "∞", "green halo middle")


def _pixel(uv: Array) -> str:
    if not np.isfinite(uv).all() or np.abs(uv).max() > 1e6:
        return "none: at infinity or behind"
    return f"({uv[0]:.1f}, {uv[1]:.1f})".replace("-", "−")


def _crop(image: np.ndarray, intrinsics: Intrinsics, uv: Array) -> np.ndarray:
    """The surroundings of a pixel, 138 × 138."""
    scale = image.shape[1] / intrinsics.width
    s = scale * _PATCH / 138
    u, v = scale * (np.asarray(uv) + 0.5) - 0.5 - s * 68.5
    inverse = np.array([[s, 0, u], [0, s, v]])
    return cv2.warpAffine(image, inverse, (138, 138), flags=cv2.INTER_LINEAR | cv2.WARP_INVERSE_MAP)


def _key(camera: Camera, width: int) -> tuple[Intrinsics, Lens, tuple[float, ...]]:
    pose = camera.world_from_cam
    height = width * camera.intrinsics.height // camera.intrinsics.width
    return camera.intrinsics.resized(width, height), camera.lens, (*pose.translation, *pose.rotation.as_quat())


@lru_cache(maxsize=8)
def _taken(intrinsics: Intrinsics, lens: Lens, pose: tuple[float, ...]) -> tuple[np.ndarray, bytes]:
    """The picture that a camera takes of the garden, and the same as JPEG."""
    where = RigidTransform.from_components(pose[:3], Rotation.from_quat(pose[3:]))
    image = to_display(render(textured_scene(), Camera(intrinsics, lens, where)))
    return image, jpeg(image)


@lru_cache(maxsize=4)
def _landmarks(intrinsics: Intrinsics, lens: Lens) -> Array:
    """Points (n, 3) of the scene's surfaces that the left camera sees, all over its picture."""
    left = Camera(intrinsics, lens, _STAND)
    size = np.array([intrinsics.width, intrinsics.height])
    rays = left.unproject(np.random.default_rng(11).uniform(0.03, 0.97, (800, 2)) * size)
    _, distance = textured_scene().trace(left.centre, rays)
    points = left.centre + distance[:, None] * rays
    return points[distance < 12]


@lru_cache(maxsize=1)
def _outlines() -> tuple[Array, ...]:
    names = ("board", "crate", "globe", "ball", "picture", "wall", "pot", "bush", "easel")
    return textured_scene().outlines().only(*names).lines
