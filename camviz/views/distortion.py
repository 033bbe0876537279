"""The distortion visualizer: one lens seen four ways, as picture, displacement field, radial curve and bent frustum."""

from __future__ import annotations

from dataclasses import dataclass, field, fields
from functools import cached_property
from math import atan, atan2, cos, degrees, hypot, inf, isfinite, pi, sin, tan
from typing import Any, ClassVar

import cv2
import numpy as np
from contourpy import contour_generator

from camviz import distortion
from camviz.cameras import Camera, Intrinsics
from camviz.draw import plot, svg
from camviz.draw.panel import Panel, image_panel, photograph
from camviz.draw.picture import Picture, jpeg
from camviz.draw.space import Eye, Item, Line, axes_triad, draw_space, space_panel
from camviz.lenses import BrownConrady, Lens
from camviz.lenses.base import on_plane, unit
from camviz.poses import RigidTransform
from camviz.scenes import snapshot, textured_scene
from camviz.views import garden
from camviz.views.base import View, choice, slider, switch

_RADIAL: dict[str, Any] = {"low": -1.0, "high": 1.0, "step": 0.005}
_SIDE: dict[str, Any] = {"low": -0.1, "high": 0.1, "step": 0.001}
_LEVELS = np.array([1, 2, 5, 10, 20, 40, 80, 160, 320])
_WIDTH, _TALLEST = 380, 300


@dataclass(frozen=True)
class DistortionView(View):
    """What a lens does to straight lines, and where its model stops being one.

    The coefficients are those of Brown and Conrady in OpenCV's order; with `lens` set, that lens is shown instead.
    With `photograph` (height, width, 3) uint8 the camera's picture is that photograph, else it is the virtual scene.
    """

    title: ClassVar[str] = "Lens distortion"

    k1: float = slider(-0.28, **_RADIAL, help="radial, r²: below zero is barrel, above zero is pincushion")
    k2: float = slider(0.07, **_RADIAL, help="radial, r⁴")
    k3: float = slider(0.0, **_RADIAL, help="radial, r⁶")
    p1: float = slider(0.0, **_SIDE, help="tangential: decentred elements, vertical")
    p2: float = slider(0.0, **_SIDE, help="tangential: decentred elements, horizontal")
    k4: float = slider(0.0, **_RADIAL, help="rational: r² in the denominator")
    k5: float = slider(0.0, **_RADIAL, help="rational: r⁴ in the denominator")
    k6: float = slider(0.0, **_RADIAL, help="rational: r⁶ in the denominator")
    s1: float = slider(0.0, **_SIDE, help="thin prism: r² in x")
    s2: float = slider(0.0, **_SIDE, help="thin prism: r⁴ in x")
    s3: float = slider(0.0, **_SIDE, help="thin prism: r² in y")
    s4: float = slider(0.0, **_SIDE, help="thin prism: r⁴ in y")
    show: str = choice("distorted", "undistorted", help="the camera's picture, or that picture straightened")
    hide_fold: bool = switch(True, label="hide what folds", help="leave out what the model maps twice")
    intrinsics: Intrinsics = field(default_factory=lambda: Intrinsics.from_fov(640, 480, 90))
    lens: Lens | None = None
    photograph: np.ndarray | None = field(default=None, compare=False, repr=False)
    eye: Eye = Eye(target=(0.0, 0.0, 0.45), distance=2.5, yaw_deg=-35, pitch_deg=25)

    @classmethod
    def of(cls, camera: Camera, photograph: np.ndarray | None = None) -> DistortionView:
        """The view of a given camera; a Brown–Conrady lens without tilt can then be moved by the sliders."""
        lens = camera.lens
        if isinstance(lens, BrownConrady) and not (lens.tau_x or lens.tau_y):
            names = [name for name in cls.controls() if hasattr(lens, name)]
            coefficients = {name: getattr(lens, name) for name in names}
            return cls(intrinsics=camera.intrinsics, photograph=photograph, **coefficients)
        aside = lens.unproject(camera.intrinsics.from_pixels(camera.intrinsics.border(4)))[:, 2]
        eye = cls.eye if np.min(aside) > 0.25 else Eye(distance=3.7, yaw_deg=-35, pitch_deg=25)  # NaN stands back too
        return cls(intrinsics=camera.intrinsics, lens=lens, photograph=photograph, eye=eye)

    @cached_property
    def camera(self) -> Camera:
        """The camera shown, at the origin."""
        lens = self.lens or BrownConrady(
            *(self.k1, self.k2, self.p1, self.p2, self.k3, self.k4, self.k5, self.k6),
            *(self.s1, self.s2, self.s3, self.s4),
        )
        return Camera(self.intrinsics, lens)

    def numbers(self) -> dict[str, str]:
        """The state's key figures, as text."""
        corner = distortion.image_corner_radius(self.intrinsics)
        pole = distortion.pole_radius(self.camera.lens)
        lost = "beyond the pole" if pole <= corner else "folded away"
        moved, folds = self.moved(self.intrinsics.border(1)), isfinite(self._fold_angle)
        return {
            "image corner": f"r = {_with_angle(corner)}" if not self.lens else f"r = {corner:.4g}, {self._widest()}",
            "corner moves": f"{np.max(moved):.1f} px" if np.isfinite(moved).all() else lost,
            "fold": self._fold_in_words() if folds else _none_but(pole),
            "farthest a ray lands": f"r = {np.hypot(*self._fold_rim(1)[0]):.4f}" if folds else "no limit",
        }

    def _widest(self) -> str:
        """The angle of the ray that arrives at the corner farthest from the axis."""
        corners = self.intrinsics.from_pixels(self.intrinsics.border(1))
        ray = self.camera.lens.unproject(corners[np.linalg.norm(corners, axis=-1).argmax()])
        return f"{degrees(atan2(hypot(*ray[:2]), ray[2])):.1f}°" if np.isfinite(ray).all() else "no ray"

    @cached_property
    def _fold_angle(self) -> float:
        return distortion.fold_angle(self.camera.lens)

    @property
    def _fold(self) -> float:
        """The radius of the fold on the plane z = 1; infinity also where it lies beside the camera or behind it."""
        return tan(self._fold_angle) if self._fold_angle < pi / 2 else inf

    def _fold_in_words(self) -> str:
        return (
            f"r = {_with_angle(self._fold)}" if isfinite(self._fold) else f"{degrees(self._fold_angle):.1f}° off axis"
        )

    def _fold_rim(self, samples: int) -> np.ndarray:
        """Where the lens puts the rays of its fold, all around: image points (samples, 2) in focal lengths."""
        around = _circle(samples)
        if isinstance(self.camera.lens, BrownConrady):
            return self.camera.lens.distort(self._fold * around)
        angle = self._fold_angle * (1 - 1e-9)  # of the last ray that has an image
        return self.camera.lens.project(np.hstack([sin(angle) * around, np.full((samples, 1), cos(angle))]))

    def equation(self) -> str:
        """The radial polynomial with this state's coefficients filled in."""
        if self.lens:
            return type(self.lens).__name__
        above, below = (_polynomial(self.k1, self.k2, self.k3), _polynomial(self.k4, self.k5, self.k6))
        return "g(r) = r" + (f" ({above})" if above != "1" else "") + (f" / ({below})" if below != "1" else "")

    def description(self) -> str:
        """The state in words and numbers."""
        figures = "; ".join(f"{name} {value}" for name, value in self.numbers().items())
        return f"{self._name()}: {figures}. Picture shown {self.show}."

    def figure(self, *, draft: bool = False) -> Picture:
        lens_panel, photographs = self._frustum_panel(draft)
        body = "".join(
            [
                svg.rectangle(0, 0, 960, 602, "paper"),
                self._picture_panel(draft),
                self._field_panel(draft),
                self.curve_panel(70, 370, 420, 180),
                lens_panel,
                self._numbers_column(),
            ]
        )
        photographs["camera"] = jpeg(self.image(draft=draft))
        return Picture(body, 960, 602, self.title, self.description(), photographs)

    def _name(self) -> str:
        if self.lens:
            return type(self.lens).__name__
        return (
            ", ".join(f"{name} = {value:g}" for name, value in self._coefficients().items() if value) or "no distortion"
        )

    def _coefficients(self) -> dict[str, float]:
        if self.lens:
            parameters = fields(self.lens)  # type: ignore[arg-type]
            return {parameter.name: getattr(self.lens, parameter.name) for parameter in parameters}
        return {name: getattr(self, name) for name in type(self).controls() if hasattr(BrownConrady, name)}

    # The picture -----------------------------------------------------------------------------------------------------

    def image(self, *, draft: bool) -> np.ndarray:
        small = Camera(self.intrinsics.within(garden.DRAFT if draft else garden.FINE), self.camera.lens)
        if self.photograph is None:
            picture = garden.glimpse(small) if draft else snapshot(textured_scene(), small)
        else:
            picture = cv2.resize(
                self.photograph, (small.intrinsics.width, small.intrinsics.height), interpolation=cv2.INTER_AREA
            )
        return picture if self.show == "distorted" else self._straightened(picture, small)

    def _straightened(self, picture: np.ndarray, camera: Camera) -> np.ndarray:
        """Undistorting an image evaluates the forward model at every output pixel."""
        xy = camera.intrinsics.from_pixels(camera.intrinsics.grid())
        uv = camera.intrinsics.to_pixels(self._bend(xy)).astype(np.float32)
        return cv2.remap(picture, np.nan_to_num(uv, nan=-9), None, cv2.INTER_LINEAR, borderValue=(38, 44, 54))

    def _bend(self, xy: np.ndarray) -> np.ndarray:
        """Distorted lens coordinates (..., 2) of ideal ones: the lens, or its bare polynomial where folds are shown."""
        if self.hide_fold or not isinstance(self.camera.lens, BrownConrady):
            return self.camera.lens.project(on_plane(xy))
        return self.camera.lens.distort(xy)

    def _picture_panel(self, draft: bool) -> str:
        width, height = self.intrinsics.width, self.intrinsics.height
        panel = image_panel("picture", 20, 34, _WIDTH, width, height, tallest=_TALLEST)
        straight = _grid_lines(self.intrinsics, 33 if draft else 65)
        lines = self._bend(straight) if self.show == "distorted" else straight
        drawn = svg.path(panel.place(self.intrinsics.to_pixels(lines)), "yellow thin")
        title = "What the camera sees" if self.show == "distorted" else "Straightened"
        seen = photograph(panel, "camera", width, height)
        return panel.show(seen + drawn + self._fold_circle(panel, bent=self.show == "distorted"), title=title)

    def _fold_circle(self, panel: Panel, *, bent: bool) -> str:
        """Where the radial curve turns back, among ideal points or, `bent`, where the lens puts them."""
        if not isfinite(self._fold_angle if bent else self._fold):
            return ""
        rim = self._fold_rim(90) if bent else self._fold * _circle(90)
        return svg.line(panel.place(self.intrinsics.to_pixels(np.vstack([rim, rim[:1]]))), "red dashed")

    # The displacement ------------------------------------------------------------------------------------------------

    def moved(self, uv: np.ndarray) -> np.ndarray:
        """How far, in pixels (...,), the lens moves ideal pixels (..., 2)."""
        return np.linalg.norm(self._distorted(uv) - uv, axis=-1)

    def _distorted(self, uv: np.ndarray) -> np.ndarray:
        return self.intrinsics.to_pixels(self._bend(self.intrinsics.from_pixels(uv)))

    def _field_panel(self, draft: bool) -> str:
        width, height = self.intrinsics.width, self.intrinsics.height
        panel = image_panel("field", 420, 34, _WIDTH, width, height, tallest=_TALLEST)
        starts = _pixel_grid(self.intrinsics, 13).reshape(-1, 2)
        ends = self._distorted(starts)
        arrows = svg.segments(panel.place(starts), panel.place(ends), "blue") + svg.dots(panel.place(ends), "blue", 4.5)
        content = (
            self._folded_area(panel)
            + arrows
            + self._contours(panel, 33 if draft else 65)
            + self._fold_circle(panel, bent=False)
        )
        return panel.show(content, title="Where each point goes", note="contours: shift in px")

    def _contours(self, panel: Panel, samples: int) -> str:
        uv = _pixel_grid(self.intrinsics, samples)
        contours = contour_generator(uv[..., 0], uv[..., 1], np.ma.masked_invalid(self.moved(uv)))
        lines = {level: [panel.place(line) for line in contours.lines(level)] for level in _LEVELS}
        names = [
            svg.text(line[int((0.1 + 0.07 * i) * len(line))], f"{level}", "tick halo middle")
            for i, (level, drawn) in enumerate(lines.items())
            for line in drawn[:1]
        ]
        return svg.path([line for drawn in lines.values() for line in drawn], "muted thin") + "".join(names)

    def _folded_area(self, panel: Panel) -> str:
        uv = _pixel_grid(self.intrinsics, 97)
        xy = self.intrinsics.from_pixels(uv)
        folded = ~np.isfinite(self.camera.lens.project(on_plane(xy))[..., 0])
        outlines = contour_generator(uv[..., 0], uv[..., 1], folded.astype(float)).filled(0.5, 1.5)
        return "".join(svg.polygon(panel.place(outline), "wash fill-red") for outline in outlines[0])

    # The radial curve ------------------------------------------------------------------------------------------------

    def curve_panel(self, x: float, y: float, width: float, height: float, *, equation: bool = True) -> str:
        """The radial curve g(r), where it folds and where the picture ends; `x` and `y` are its plot's corner."""
        corner = distortion.image_corner_radius(self.intrinsics) or 1.0  # a single pixel on the axis has none
        top = 1.5 * corner
        panel = plot.plot_panel("curve", x, y, width, height, (0, top), (0, 1.2 * corner))
        r = np.linspace(0, top, 241)
        fold = self._fold
        curve, beyond = self._radial(np.where(r <= fold, r, np.nan)), self._radial(np.where(r >= fold, r, np.nan))
        lines = (
            plot.band(panel, min(fold, top), top, "fill-red")
            + plot.grid(panel)
            + plot.curve(panel, r, r, "muted dashed")
            + plot.curve(panel, r, curve, "blue thick")
            + plot.curve(panel, r, beyond, "red thick dotted")
            + svg.line(panel.place([(corner, 0), (corner, corner), (0, corner)]), "green dashed")
        )
        return plot.axes(panel, "r, ideal (tangent of the ray's angle)", "r, distorted") + panel.show(
            lines
            + self._fold_mark(panel, fold)
            + svg.text(panel.place((corner, 0)) + (-6, -8), "image corner", "green end halo"),
            title="The radial curve",
            note=self.equation() if equation else "",
        )

    def _radial(self, r: np.ndarray) -> np.ndarray:
        lens = self.camera.lens
        if isinstance(lens, BrownConrady):
            return lens.radial(r)
        return lens.project(np.stack([r, 0 * r, np.ones_like(r)], axis=-1))[..., 0]

    def _fold_mark(self, panel: Panel, fold: float) -> str:
        if not fold < panel.right:
            return ""
        at = panel.place([fold, float(self._radial(np.array(fold)))])
        side = "end" if at[0] > panel.width / 2 else ""
        words = f"folds at r = {_with_angle(fold)}"
        return svg.dots([at], "red", 9) + svg.text(at + (-8 if side else 8, -12), words, f"red halo {side}")

    # The frustum -----------------------------------------------------------------------------------------------------

    def _frustum_panel(self, draft: bool) -> tuple[str, dict[str, bytes]]:
        panel = space_panel("frustum", 545, 370, 255, 180)
        content, photographs = draw_space(panel, self._bent_frustum(), self.eye, draft=draft, renderer="wire")
        label = "The rays of the image in space; drag or press the arrow keys to walk around"
        return panel.show(
            content, title="Its rays in space", hint="drag to turn", drag="orbit", label=label
        ), photographs

    def _bent_frustum(self) -> list[Item]:
        """The rays of a grid of pixels, a metre long, beside those of a pinhole with the same intrinsics."""
        pinhole = self.camera.intrinsics.from_pixels(self.intrinsics.border(8))
        rim = unit(on_plane(pinhole))
        reach = self.camera.unproject(_pixel_grid(self.intrinsics, 25))
        mesh = [*reach[::3], *np.swapaxes(reach[:, ::4], 0, 1)]
        spokes = [np.stack([np.zeros(3), corner]) for corner in reach[[0, 0, -1, -1], [0, -1, -1, 0]]]
        return [
            Line(np.vstack([rim, rim[:1]]), "muted dashed", 1.3),
            *(Line(line, "blue", 1.3) for line in mesh),
            *(Line(spoke, "blue", 1.6) for spoke in spokes),
            *axes_triad(RigidTransform.identity(), 0.4),
        ]

    def dragged(self, handle: str, x: float, y: float, dx: float, dy: float) -> DistortionView:
        return self.but(eye=self.eye.orbited(dx, dy))

    def pressed(self, handle: str, key: str) -> DistortionView:
        return self.but(eye=self.eye.key(key))

    # The numbers -----------------------------------------------------------------------------------------------------

    def _numbers_column(self) -> str:
        x = 822
        rows = [svg.text((x, 26), "This lens", "title")]
        for i, (name, value) in enumerate(self._coefficients().items()):  # the lens's own, where one is given
            class_ = "number" if value else "number faint"
            rows.append(svg.text((x, 50 + 18 * i), f"{name} {value:+.4f}".replace("-", "−"), class_))
        for i, (name, figure) in enumerate(self.numbers().items()):
            rows.append(svg.text((x, 296 + 40 * i), name, "note"))
            rows.append(svg.text((x, 313 + 40 * i), figure, "label"))
        return "".join(rows)


def _grid_lines(intrinsics: Intrinsics, samples: int) -> np.ndarray:
    """Straight lines (m, samples, 2) across and beyond the image, in lens coordinates."""
    corners = intrinsics.from_pixels([(-0.5, -0.5), (intrinsics.width - 0.5, intrinsics.height - 0.5)])
    (left, top), (right, bottom) = 1.6 * corners
    along = np.linspace(0, 1, samples)
    rows = [
        np.stack([left + (right - left) * along, np.full(samples, y)], axis=-1) for y in np.linspace(top, bottom, 13)
    ]
    columns = [
        np.stack([np.full(samples, x), top + (bottom - top) * along], axis=-1) for x in np.linspace(left, right, 17)
    ]
    return np.array(rows + columns)


def _polynomial(*coefficients: float) -> str:
    terms = [f"{c:+.3g} r{power}" for c, power in zip(coefficients, "²⁴⁶", strict=True) if c]
    return "1" + "".join(f" {term[0]} {term[1:]}" for term in terms).replace("-", "−")


def _circle(samples: int) -> np.ndarray:
    """Points (samples, 2) around the unit circle."""
    turn = 2 * pi * np.arange(samples) / samples
    return np.stack([np.cos(turn), np.sin(turn)], axis=-1)


def _none_but(pole: float) -> str:
    return f"none; pole {pole:.4f}" if isfinite(pole) else "none"


def _with_angle(r: float) -> str:
    return f"{r:.4f} ({degrees(atan(r)):.1f}°)" if r < 100 else f"{r:.3g} ({degrees(atan(r)):.1f}°)"


def _pixel_grid(intrinsics: Intrinsics, most: int) -> np.ndarray:
    """An even grid of pixels (rows, columns, 2) from edge to edge of the image, `most` along its longer side."""
    aspect = intrinsics.width / intrinsics.height
    columns, rows = (max(2, round(most * min(1, side))) for side in (aspect, 1 / aspect))
    u = np.linspace(-0.5, intrinsics.width - 0.5, columns)
    v = np.linspace(-0.5, intrinsics.height - 0.5, rows)
    return np.stack(np.meshgrid(u, v), axis=-1)
