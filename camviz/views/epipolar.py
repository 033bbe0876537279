"""The epipolar visualizer, in one file because its panels draw one state: a point, two cameras, and its line.

A reader's own F can draw its line beside the right one, and a reader's own lines can make the star.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Any, ClassVar

import numpy as np

from camviz import twoview
from camviz.cameras import Camera, transform
from camviz.draw import svg
from camviz.draw.flow import Cell, rows, shortened
from camviz.draw.marks import NOTHING, Marks
from camviz.draw.panel import Panel, image_panel, placed_image
from camviz.draw.picture import Picture, jpeg
from camviz.draw.readout import listed, readout, true_minus
from camviz.draw.space import Dots, Face, Item, Label, Line, OrbitCamera, camera_body, scene_items, space_panel
from camviz.lenses.base import Array, unit
from camviz.scenes import textured_scene
from camviz.views import garden
from camviz.views.base import Drawn, OrbitView, step_of
from camviz.views.marks import border_arrow, camera_outline, clipped, crop, on_photograph, ring
from camviz.views.two_cameras import TwoCameras
from camviz.views.yours import YOURS_HERE, is_unwritten, tried

_DISTANCES = np.concatenate([np.geomspace(0.02, 400, 120), [np.inf]])
_NEAREST, _FARTHEST = 0.3, 30.0  # metres, of the chosen point
_PATCH = 48  # pixels on a side of the details that are compared
_PLANES = 40  # epipolar planes in a full turn around the baseline
_WIDTH, _TALLEST = 460, 345
_TILES = {"right": "right picture", "space": "space", "numbers": "numbers", "match": "details"}
_PANELS = {*_TILES, "epipoles", "F"}  # the last two are no tiles: lines in the pictures, and a matrix over the numbers
_HIGH = 388  # units of height of the pictures
_LOW = 236  # of the cameras in space below them
_DETAIL = {True: 69, False: 100}  # units on a side of each detail, beside two others and else
_STARRED = np.stack(np.meshgrid(np.linspace(0.05, 0.95, 5), [0.12, 0.38, 0.88]), axis=-1).reshape(-1, 2)


@dataclass(frozen=True)
class EpipolarView(OrbitView, TwoCameras):
    """Where a point of the left picture can appear in the right one, and what a fundamental matrix knows of it.

    `panels` names what is shown with the left picture: right (the other picture, with the line), space (the cameras
    from outside), match (the two details), epipoles (they and all lines through them), numbers and F. `yours` is a
    reader's function of (K_left, K_right, R, t) for the motion right_from_left = [R | t], which gives an F (3, 3); the
    line and the epipole of that F are orange. So are the lines (n, 3) that the reader's `your_lines` gives for an F and
    left pixels (n, 2).
    """

    title: ClassVar[str] = "Epipolar geometry"

    openable: ClassVar[Mapping[str, str]] = {
        "right": "the right picture",
        "space": "the cameras in space",
        "match": "do they match?",
        "epipoles": "all lines",
        "numbers": "numbers",
        "F": "F",
    }

    panels: str = "right space match epipoles numbers F"
    yours: Callable[..., Any] | None = field(default=None, compare=False, repr=False)
    your_lines: Callable[..., Any] | None = field(default=None, compare=False, repr=False)
    eye: OrbitCamera = OrbitCamera(target=(-0.1, 0.25, 1.7), distance=4.6, yaw_deg=-62, pitch_deg=22, vfov_deg=30)

    def __post_init__(self) -> None:
        super().__post_init__()
        if not set(self.panels.split()) <= _PANELS:
            raise ValueError(f"panels must be some of {', '.join(self.openable)}, got {self.panels!r}")

    # Words -----------------------------------------------------------------------------------------------------------

    def numbers(self) -> dict[str, str]:
        """The state's key figures, as text."""
        return dict(self._figures)

    @cached_property
    def _figures(self) -> dict[str, str]:
        nowhere = "none" if not self.baseline else "at infinity" if self.F is not None else "beyond the lens’s field"
        figures = {"baseline": f"{self.baseline:.3f} m"}
        if self._has("epipoles"):
            figures["left epipole"] = _pixel(_epipole(self.left, self.right), nowhere)
            figures["right epipole"] = _pixel(_epipole(self.right, self.left), nowhere)
        outside = "" if self.right.sees(self.point) else ", outside"
        figures["point, right"] = _pixel(self.uv_right, "no image") + outside
        if self.F is not None and np.isfinite(self.residual):
            figures["xᵀFx"] = f"{self.residual:.3f}"
        if self.estimate is not None:
            figures["estimated lines"] = f"off by {self.estimate_error:.3g} px"
            figures["estimated from"] = f"{len(self.pairs[0])} matches"
            figures["its epipole"] = f"turned by {self.epipole_error:.3g}°"
        elif self.F is not None and self.noise:
            figures["no estimate"] = f"only {len(self.pairs[0])} points in both"
        return figures

    def equation(self) -> str:
        """x_rightᵀ (F x_left) = 0 with this state's epipolar line filled in."""
        if not self.baseline:
            return "no baseline: no epipolar line"
        if self.F is None:
            return "a lens that bends: no F, a curve"
        a, b, c = self.line
        return true_minus(f"{a:+.3f} u {b:+.3f} v {c:+.1f} = 0") if np.isfinite(a) else "the left epipole: no line"

    def description(self) -> str:
        where = f"The point at ({self.u:.0f}, {self.v:.0f}) in the left picture lies {self.depth:.2f} m along its ray"
        told = [listed(self._told()), f"Right epipolar line: {self.equation()}" if self._has("numbers") else ""]
        return ". ".join([where, *filter(None, told)]) + "."

    def _told(self) -> dict[str, str]:
        return self.numbers() if self._has("numbers") else {}

    # The reader's own F ----------------------------------------------------------------------------------------------

    @cached_property
    def your_F(self) -> tuple[Array, str]:
        """The F (3, 3) of the reader's function, NaN where it has none, and what is wrong with it."""
        if self.yours is None or self.F is None:
            return np.full((3, 3), np.nan), ""
        motion = twoview.right_from_left(self.left, self.right)
        K_left, K_right = self.left.intrinsics.K, self.right.intrinsics.K
        arguments = (K_left, K_right, motion.rotation.as_matrix(), motion.translation)
        return tried(self.yours, arguments, self.F)

    @cached_property
    def your_line(self) -> Array:
        """The epipolar line (3,) that the reader's F gives for the point; NaN where there is none."""
        F, _ = self.your_F
        return twoview.epipolar_lines(F, [self.u, self.v]) if np.isfinite(F).all() else np.full(3, np.nan)

    def _your_figure(self) -> str:
        """How far the point's right pixel lies from the reader's line."""
        away = float(twoview.line_distance(self.your_line, self.uv_right))
        return f"{away:.1f} px from the point" if np.isfinite(away) else "no line"

    def _your_marks(self, panel: Panel) -> Marks:
        """What the reader's functions draw: in the right picture lines and the place where they meet, dots on the left.

        Where they are not written yet, the right lines wait there in grey.
        """
        if self.F is None:
            return NOTHING
        if panel.name == "left":
            pixels = panel.place(self._starred)
            return (
                NOTHING if self.your_lines is None else svg.dots(pixels, "paper-dot", 8) + svg.dots(pixels, "orange", 6)
            )
        drawn = self._marks_of_F(panel) if self.yours is not None else NOTHING
        return drawn + (self._star(panel) if self.your_lines is not None else NOTHING)

    def _marks_of_F(self, panel: Panel) -> Marks:
        F, problem = self.your_F
        if is_unwritten(problem):
            return self._waiting(panel, self.line[None])
        if problem:
            return _notice(panel, problem)
        if not np.isfinite(F).all():
            return _notice(panel, "The numbers of your F are not all finite, so it has no line.")
        line = panel.place(twoview.clip_lines(self.your_line, self.right.intrinsics))
        e = np.linalg.svd(F)[0][:, 2]  # Fᵀ e = 0, as nearly as a matrix of any rank can
        epipole = panel.place(_inside(self.right, twoview.from_homogeneous(e)))
        return on_photograph([line], "orange dashed") + svg.dots([epipole], "orange", 9)

    @property
    def _starred(self) -> Array:
        """Pixels (n, 2) all over the left picture, whose lines a reader computes."""
        size = self.left.intrinsics
        return _STARRED * (size.width - 1, size.height - 1)

    def _star(self, panel: Panel) -> Marks:
        """The lines of the reader's own function."""
        assert self.your_lines is not None
        assert self.F is not None
        right = twoview.epipolar_lines(self.F, self._starred)
        lines, problem = tried(self.your_lines, (self.F, self._starred), right)
        if is_unwritten(problem):
            return self._waiting(panel, right)
        if problem:
            return _notice(panel, problem)
        is_a_line = np.isfinite(lines).all(axis=-1) & lines[:, :2].any(axis=-1)
        return on_photograph(panel.place(twoview.clip_lines(lines[is_a_line], self.right.intrinsics)), "orange dashed")

    def _waiting(self, panel: Panel, lines: Array) -> Marks:
        """The right lines in grey, where the reader's will be."""
        drawn = on_photograph(panel.place(twoview.clip_lines(lines, self.right.intrinsics)), "muted dashed")
        return drawn + svg.text((panel.width / 2, 0.14 * panel.height), YOURS_HERE, "title halo middle")

    # Hands -----------------------------------------------------------------------------------------------------------

    def dragged(self, handle: str, x: float, y: float, dx: float, dy: float) -> EpipolarView:
        if handle == "left":
            return self._with_point(self._left_panel, x, y, dx, dy)
        if handle == "right":
            return self._with_depth(self._right_panel, x, y)
        return super().dragged(handle, x, y, dx, dy)

    def pressed(self, handle: str, key: str) -> EpipolarView:
        if handle == "right":
            return self.but(depth=float(np.clip(self.depth * 1.05 ** step_of(key), _NEAREST, _FARTHEST)))
        return super().pressed(handle, key)

    def _with_point(self, panel: Panel, x: float, y: float, dx: float, dy: float) -> EpipolarView:
        """The point under the pointer, or moved by (dx, dy) where there is no pointer."""
        at = panel.place([self.u, self.v]) + (panel.x + dx, panel.y + dy) if np.isnan(x) else np.array([x, y])
        u, v = panel.data(at - (panel.x, panel.y))
        size = self.left.intrinsics
        return self.but(u=float(np.clip(u, 0, size.width - 1)), v=float(np.clip(v, 0, size.height - 1)))

    def _with_depth(self, panel: Panel, x: float, y: float) -> EpipolarView:
        """The depth whose image in the right picture is nearest to the pointer."""
        depths = np.geomspace(_NEAREST, _FARTHEST, 1500)
        curve = panel.place(twoview.epipolar_curve(self.left, self.right, [self.u, self.v], depths))
        away = np.linalg.norm(curve + (panel.x, panel.y) - (x, y), axis=-1)
        return self.but(depth=float(depths[np.nanargmin(away)])) if np.isfinite(away).any() else self

    # The picture -----------------------------------------------------------------------------------------------------

    def figure(self, *, draft: bool = False) -> Picture:
        images, attached = self._pictures(draft)
        parts = {"left picture": self._picture_panel(self._left_panel, self.left, self.right, "move the point")}
        if self._has("right"):
            along = "move it along its ray"
            parts["right picture"] = self._picture_panel(self._right_panel, self.right, self.left, along)
        else:
            attached = {"left": attached["left"]}
        if self._has("space"):
            parts["space"], sheets = self._space_panel(images, draft)
            attached |= sheets
        if self._tells:
            parts["numbers"] = self._numbers_block()
        if self._has("match"):
            parts["details"], crops = self._details(images)
            attached |= crops
        return self.tiled(self._layout, parts, attached)

    @cached_property
    def _layout(self) -> dict[str, Cell]:
        """The pictures, or the left one and the cameras in space; and below them what else is open."""
        wide = {"space": 960.0, "numbers": 280.0, "details": 180.0 if self._has("space") else 340.0}
        shown = {"space": self._has("space"), "numbers": self._tells, "details": self._has("match")}
        below = {name: width for name, width in wide.items() if shown[name]}
        beside = "right picture" if self._has("right") else "space" if self._has("space") else ""
        below.pop(beside, None)
        if "space" in below:
            below["space"] -= sum(below.values()) - 960
        lines = 3 + 2 * self._has("epipoles") + 3 * bool(self.noise) + (self.yours is not None)
        high = {"space": _LOW, "numbers": 26 + 19 * lines * self._has("numbers") + 92 * self._has("F")}
        high = {name: high.get(name, self._detail + 47) for name in below}
        first = {"left picture": 480.0, beside: 480.0} if beside else {"left picture": 480.0}
        return shortened(rows((_HIGH, first), (max(high.values(), default=0), below)), **high)

    @property
    def _tells(self) -> bool:
        return self._has("numbers") or self._has("F")

    @property
    def _detail(self) -> int:
        """Units on a side of each of the two details."""
        return _DETAIL[self._has("right") and self._has("space")]

    def _pictures(self, draft: bool) -> tuple[dict[str, np.ndarray], dict[str, bytes]]:
        """What the two cameras see, as pixels and as JPEG."""
        if self.photographs is None:
            side = garden.DRAFT if draft else garden.FINE
            taken = [garden.taken(camera, side) for camera in (self.left, self.right)]
        else:
            taken = [(image, jpeg(image)) for image in self.photographs]
        (left, left_jpeg), (right, right_jpeg) = taken
        return {"left": left, "right": right}, {"left": left_jpeg, "right": right_jpeg}

    # The two pictures ------------------------------------------------------------------------------------------------

    @property
    def _left_panel(self) -> Panel:
        size = self.left.intrinsics
        return image_panel("left", 10, 34, _WIDTH, size.width, size.height, tallest=_TALLEST)

    @property
    def _right_panel(self) -> Panel:
        size = self.right.intrinsics
        return image_panel("right", 490, 34, _WIDTH, size.width, size.height, tallest=_TALLEST)

    def _picture_panel(self, panel: Panel, camera: Camera, other: Camera, action: str) -> Marks:
        content = placed_image(panel, panel.name, camera.intrinsics.width, camera.intrinsics.height)
        if self._has("right"):
            content += (
                self._pencil(panel, camera)
                + self._match_dots(panel)
                + self._own_line(panel, camera)
                + self._estimated_line(panel, camera)
                + self._your_marks(panel)
                + self._other_camera(panel, camera, other)
                + self._epipole_mark(panel, camera, other)
            )
        content += self._point_mark(panel, camera)
        label = f"The {panel.name} picture; drag or press the arrow keys to {action}"
        equation = panel.name == "right" and self._has("numbers")
        said = {"note": self.equation()} if equation else {"hint": f"drag to {action}"}
        return panel.show(content, title=f"The {panel.name} picture", drag=panel.name, label=label, **said)

    def _pencil(self, panel: Panel, camera: Camera) -> Marks:
        """Epipolar lines all around the baseline: the images of planes that meet in it."""
        if not self.baseline or not self._has("epipoles"):
            return NOTHING
        if panel.name not in self.drawn:
            axes = self.left.extrinsics[0]
            along, first = self._plane_axes(axes[2] if abs(self._along @ axes[2]) < 0.9 else axes[0])
            turn = np.arange(_PLANES) * (2 * np.pi / _PLANES)
            across = np.cos(turn)[:, None] * first + np.sin(turn)[:, None] * np.cross(along, first)
            lines = clipped(panel, panel.place(camera.project(camera.centre + _half_planes(along, across, 40))))
            self.drawn[panel.name] = svg.segments(lines[:, 0], lines[:, 1], "yellow thin half")
        return self.drawn[panel.name]

    def _own_line(self, panel: Panel, camera: Camera) -> Marks:
        """The epipolar line of the chosen point, and in the right picture strong where its ray can be seen."""
        if not self.baseline:
            return NOTHING
        along, across = self._plane_axes(self.point - self.left.centre)
        whole = camera.project(camera.centre + _half_planes(along, np.stack([across, -across]), 90))
        lines = on_photograph(clipped(panel, panel.place(whole)), "green thin")
        if panel.name == "right":
            ray = twoview.epipolar_curve(self.left, self.right, [self.u, self.v], _DISTANCES)
            lines += on_photograph(clipped(panel, panel.place(ray)), "green thick")
            lines += _infinity(panel.place(_inside(camera, ray[-1])))
        return lines

    def _estimated_line(self, panel: Panel, camera: Camera) -> Marks:
        if self.estimate is None:
            return NOTHING
        F, uv = (self.estimate, [self.u, self.v]) if panel.name == "right" else (self.estimate.T, self.uv_right)
        line = panel.place(twoview.clip_lines(twoview.epipolar_lines(F, uv), camera.intrinsics))
        epipole = panel.place(_inside(camera, twoview.from_homogeneous(twoview.epipoles(F)[1])))
        return on_photograph([line], "purple dashed") + svg.dots([epipole], "purple", 9)

    def _match_dots(self, panel: Panel) -> Marks:
        if not self.noise:
            return NOTHING
        seen = self.noisy_pairs[panel.name == "right"]
        return svg.dots(panel.place(seen), "paper-dot", 7) + svg.dots(panel.place(seen), "purple", 5)

    def _epipole_mark(self, panel: Panel, camera: Camera, other: Camera) -> Marks:
        if not self.baseline or not self._has("epipoles"):
            return NOTHING
        uv = _epipole(camera, other)
        at = panel.place(uv)
        if camera.intrinsics.contains(uv):
            side = "end" if at[0] > panel.width - 110 else ""
            return ring(at, "yellow", 8) + svg.text(at + (-30 if side else 30, -9), "epipole", f"label halo {side}")
        toward = at - (panel.width / 2, panel.height / 2) if np.isfinite(uv).all() else _heading(camera, other)
        return border_arrow(panel, unit(toward), f"epipole {_far(uv, camera)}".rstrip())

    def _other_camera(self, panel: Panel, camera: Camera, other: Camera) -> Marks:
        if not self.baseline or not camera.sees(other.centre):
            return NOTHING
        depth = min(0.12, self.baseline / 4)
        return camera_outline(panel, camera, other, depth, "orange" if panel.name == "left" else "blue")

    def _point_mark(self, panel: Panel, camera: Camera) -> Marks:
        at = panel.place([self.u, self.v] if panel.name == "left" else _inside(camera, self.uv_right))
        marks = ring(at, "red", 8) + svg.dots([at], "red", 5)
        if self.truth and np.isfinite(self.surface).all():
            true = panel.place(_inside(camera, camera.project(self.surface)))
            marks = ring(true, "sky", 13) + svg.text(true + (17, 5), "the surface", "label halo") + marks
        return marks

    @cached_property
    def _along(self) -> Array:
        """The direction (3,) of the baseline, from the left camera to the right one."""
        return unit(self.right.centre - self.left.centre)

    def _plane_axes(self, toward: Array) -> tuple[Array, Array]:
        """Unit axes (3,) of the epipolar plane that holds the direction `toward`: along the baseline and across it."""
        return self._along, unit(toward - (toward @ self._along) * self._along)

    # The space -------------------------------------------------------------------------------------------------------

    def _space_panel(self, images: dict[str, np.ndarray], draft: bool) -> Drawn:
        x, y, width, height = self._layout["space"]
        panel = space_panel("space", x + 10, y + 34, width - 20, height - 44)
        scenery = () if self.photographs else scene_items(textured_scene, "wire")
        scenery += self._bodies(images, draft)
        label = "The two cameras and the epipolar plane in space; drag or press the arrow keys to walk around"
        seen: dict[str, Any] = {"eye": self._onlooker, "scenery": scenery}
        title = "The epipolar plane" if self._has("right") else "The left camera in space"
        return self.in_space(panel, self._space_items(), draft, title, label, drag="orbit", **seen)

    @property
    def _nearness(self) -> float:
        """1 in the garden; smaller for a calibrated pair with a short baseline."""
        return min(1.0, max(0.05, self.baseline / 0.3)) if self.pair else 1.0

    @property
    def _onlooker(self) -> OrbitCamera:
        """The eye, as near to a small rig as it is to a large one."""
        left, s = self.left.centre, self._nearness
        target = tuple((left + s * (np.array(self.eye.target) - left)).tolist())
        back = 1.0 if self._has("right") else 1.3  # from a panel that is less wide
        return replace(self.eye, target=target, distance=back * s * self.eye.distance)

    def _bodies(self, images: dict[str, np.ndarray], draft: bool) -> tuple[Item, ...]:
        """The two cameras; the same objects again until one of them moves."""
        both = self._has("right")
        if (draft, both) not in self.drawn:
            s = self._nearness
            left = camera_body(self.left, 0.6 * s, image=images["left"], colour="blue")
            right = camera_body(self.right, 0.6 * s, image=images["right"], colour="orange") if both else ()
            self.drawn[draft, both] = (*left, *right)
        return self.drawn[draft, both]

    def _space_items(self) -> list[Item]:
        left, right, point, s = self.left.centre, self.right.centre, self.point, self._nearness
        ray = np.array([left, left + max(8.0 * s, self.depth) * self.left.unproject([self.u, self.v])])
        seen: list[Item] = [
            Label(left - (0, 0.3 * s, 0), "left", "label blue"),
            Line(ray, "blue", 1.8),
            Dots(point, "red", 9),
        ]
        if not self._has("right"):
            return seen
        return [
            *seen,
            Label(right + (0, 0.22 * s, 0), "right", "label orange"),
            Face(np.array([left, right, point]), "green", 0.3),
            Line(np.array([right, point]), "orange", 1.8),
            Line(np.array([left, right]), "green", 2.6),
        ]

    # The numbers -----------------------------------------------------------------------------------------------------

    def _numbers_block(self) -> Marks:
        x, y, rows = self._layout["numbers"][0] + 22, self._layout["numbers"][1] + 18, list[Marks]()
        if self._has("F"):
            rows.append(svg.text((x, y), "F, of unit norm" if self.F is not None else "No F here", "title"))
            for i, row in enumerate(self.F if self.F is not None else ()):
                rows.append(svg.text((x, y + 22 + 18 * i), _row(row), "number"))
            y += 92
        figures = self._told()
        rows.append(readout(figures, (x, y), (0, 19), (112, 0)))
        if self.yours is not None and self.F is not None and figures:
            yours, below = {"your line": self._your_figure()}, y + 19 * len(figures)
            rows.append(readout(yours, (x, below), (0, 0), (112, 0), "label orange"))
        return svg.join(rows)

    def _details(self, images: dict[str, np.ndarray]) -> Drawn:
        """What the pictures show around the point, side by side: alike where the depth is that of the surface."""
        (left, top, *_), side = self._layout["details"], self._detail
        drawn, crops = svg.text((left + 16, top + 18), "Do they match?", "title"), {}
        for i, (name, camera, uv) in enumerate(
            (("left", self.left, np.array([self.u, self.v])), ("right", self.right, self.uv_right))
        ):
            middle = side / 2
            panel = Panel(f"{name} detail", left + 16 + (side + 6) * i, top + 26, side, side, 0, side, 0, side)
            content = svg.text((middle, middle + 4), "outside", "note middle")
            if camera.intrinsics.contains(uv):
                crops[panel.name] = jpeg(crop(images[name], camera.intrinsics, uv, _PATCH))
                content = svg.image(panel.name, 0, 0, side, side) + ring(np.array([middle, middle]), "red", 5)
            drawn += panel.show(content) + svg.text((panel.x + middle, top + side + 41), f"{name}, here", "note middle")
        return drawn, crops


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
    """Where a pixel is that lies on no plane of pixels; "" for one that is only outside the picture."""
    if np.abs(uv).max() < 1e6:
        return ""
    return "beyond the lens’s field" if camera.lens.is_distorted else "at infinity"


def _infinity(at: Array) -> Marks:
    return svg.dots([at], "green", 8) + svg.text(at + (0, -9), "∞", "green halo middle")


def _notice(panel: Panel, words: str) -> Marks:
    """Words over a photograph, on a ground of the paper's colour."""
    ground = svg.rectangle(8, 8, panel.width - 16, 60, "paper")
    return ground + svg.paragraph((18, 28), words, panel.width - 36)


def _inside(camera: Camera, uv: Array) -> Array:
    """A pixel (2,), or NaN where it is not in the camera's picture."""
    return np.where(camera.intrinsics.contains(uv), uv, np.nan)


def _row(entries: Array) -> str:
    """Numbers in columns; rounding errors of zero as zero."""
    return "  ".join(f"{entry:+.2e}" if abs(entry) > 1e-12 else "        0" for entry in entries).replace("-", "−")


def _pixel(uv: Array, missing: str) -> str:
    if not np.isfinite(uv).all() or np.abs(uv).max() > 1e6:
        return missing
    return true_minus(f"({uv[0]:.1f}, {uv[1]:.1f})")
