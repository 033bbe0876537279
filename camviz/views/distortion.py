"""The distortion visualizer, in one file because its panels draw one state: picture, field, curve and frustum.

A reader's own function can bend a picture beside the right one.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
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
from camviz.draw.flow import Cell, Part, rows, shortened
from camviz.draw.items import closed
from camviz.draw.marks import NOTHING, Marks
from camviz.draw.panel import Panel, image_in, placed_image
from camviz.draw.picture import Picture, jpeg
from camviz.draw.readout import listed, readout, true_minus
from camviz.draw.space import Item, Line, OrbitCamera, axes_triad, space_panel
from camviz.lenses import BrownConrady, Lens
from camviz.lenses.base import on_plane, unit
from camviz.poses import RigidTransform
from camviz.scenes import snapshot, textured_scene
from camviz.scenes.wall import wall_scene
from camviz.views import garden
from camviz.views.base import Drawn, OrbitView, answered, choice, one_of, slider, switch, without
from camviz.views.written_lens import WrittenLens
from camviz.views.yours import is_unwritten

_RADIAL: dict[str, Any] = {"low": -1.0, "high": 1.0, "step": 0.005}
_SIDE: dict[str, Any] = {"low": -0.1, "high": 0.1, "step": 0.001}
_SAMPLES = {True: 25, False: 65}  # of a line of the grid and a side of the contours' grid: in drafts, in fine pictures
_LEVELS = np.array([1, 2, 5, 10, 20, 40, 80, 160, 320])
_BRIGHT = {"stroke": "#f2c94c"}  # on a photograph, in every theme
_TILES = {  # of the panels
    "picture": "the picture",
    "yours": "with your function",
    "curve": "radial curve",
    "field": "displacements",
    "rays": "rays in space",
    "numbers": "numbers",
}
_GRID = "grid"  # a panel that is no tile: lines over the pictures
_NUMBERS = "numbers"
_MOST = 4  # panels beside the numbers
_ALONE, _MOST_ACROSS = 330, 620  # units of height and width of a panel that stands alone
_LEAST = 240  # units of height: a curve needs them, and numbers do
# Of the first row, by how many panels stand there and whether the numbers do: its height at most and their widths.
_FIRST: dict[tuple[int, bool], tuple[float, tuple[float, ...]]] = {
    (1, True): (480, (700, 260)),
    (2, False): (390, (480, 480)),
    (2, True): (320, (380, 380, 200)),
}
_SECOND: dict[int, tuple[float, tuple[float, ...]]] = {1: (270, (960,)), 2: (270, (560, 400))}


@dataclass(frozen=True)
class DistortionView(OrbitView):
    """What a lens does to straight lines, and where its model stops being one.

    The coefficients are those of Brown and Conrady in OpenCV's order; with `lens` set, that lens is shown instead.
    With `photograph` (height, width, 3) uint8 the camera's picture is that photograph, else it is a virtual scene: the
    garden, or at the `place` "wall" a wall of it from near (`by_the_wall`). `panels` names what is drawn: up to four of
    picture, yours, curve, field and rays, and beside them the grid over the pictures and the numbers. `yours` is a
    reader's function of (xy, k1, k2, k3), ideal points (..., 2) to distorted ones, in focal lengths; what it does is
    orange.
    """

    title: ClassVar[str] = "Lens distortion"
    openable: ClassVar[Mapping[str, str]] = {
        _GRID: "grid",
        **{name: _TILES[name] for name in ("curve", "field", "rays", _NUMBERS)},
    }

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
    panels: str = "picture grid field numbers curve rays"
    place: str = "garden"
    yours: Callable[..., Any] | None = field(default=None, compare=False, repr=False)
    intrinsics: Intrinsics = field(default_factory=lambda: Intrinsics.from_fov(640, 480, 90))
    lens: Lens | None = None
    photograph: np.ndarray | None = field(default=None, compare=False, repr=False)
    eye: OrbitCamera = OrbitCamera(target=(0.0, 0.0, 0.45), distance=2.5, yaw_deg=-35, pitch_deg=25)

    def __post_init__(self) -> None:
        super().__post_init__()
        one_of("place", self.place, ("garden", "wall"))
        if not set(self.panels.split()) <= {*_TILES, _GRID} or not 1 <= len(self._beside_the_numbers) <= _MOST:
            raise ValueError(
                f"panels must be one to {_MOST} of picture, yours, curve, field, rays, and grid or numbers beside "
                f"them, got {self.panels!r}"
            )

    @classmethod
    def by_the_wall(cls, **state: Any) -> DistortionView:
        """One picture of a wall from near, its coping along the upper border, by a camera that sees 90° across.

        All coefficients are 0 at first, and nothing but the picture is open; `state` are fields of the view.
        """
        first: dict[str, Any] = {"k1": 0.0, "k2": 0.0, "panels": "picture", "place": "wall"}
        return cls(**{**first, "intrinsics": Intrinsics.from_fov(640, 360, 90), **state})

    @classmethod
    def of(cls, camera: Camera, photograph: np.ndarray | None = None) -> DistortionView:
        """The view of a given camera; a Brown–Conrady lens without tilt can then be moved by the sliders."""
        lens = camera.lens
        if isinstance(lens, BrownConrady) and not (lens.tau_x or lens.tau_y):
            names = [name for name in cls.controls() if hasattr(lens, name)]
            coefficients = {name: getattr(lens, name) for name in names}
            return cls(intrinsics=camera.intrinsics, photograph=photograph, **coefficients)
        aside = lens.unproject(camera.intrinsics.from_pixels(camera.intrinsics.border(4)))[:, 2]
        eye = (
            cls.eye if np.min(aside) > 0.25 else OrbitCamera(distance=3.7, yaw_deg=-35, pitch_deg=25)
        )  # NaN stands back too
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

    def _told(self) -> dict[str, str]:
        """The figures that the panels speak of: the fold's only where the curve or the rays show it."""
        figures = self.numbers()
        if self._has("curve") or self._has("rays"):
            return figures
        return {name: figures[name] for name in ("image corner", "corner moves")}

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
        off_axis = f"{degrees(self._fold_angle):.1f}° off axis"
        return f"r = {_with_angle(self._fold)}" if isfinite(self._fold) else off_axis

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
        figures = listed(self._told())
        return f"{self._name()}: {figures}. Picture shown {self.show}."

    def figure(self, *, draft: bool = False) -> Picture:
        draw = {
            "picture": self._picture_panel,
            "field": self._field_panel,
            "yours": self._your_panel,
            "curve": self._curve_with_axes,
            "rays": self._frustum_panel,
            _NUMBERS: self._numbers_column,
        }
        layout = self._layout()
        parts, photographs = dict[str, Part](), dict[str, bytes]()
        for name in (*self._beside_the_numbers, *([_NUMBERS] if self._has(_NUMBERS) else [])):
            tile = _TILES[name]
            parts[tile], attached = draw[name](layout[tile], draft=draft)
            photographs |= attached
        return self.tiled(layout, {tile: parts[tile] for tile in layout}, photographs)

    @property
    def _beside_the_numbers(self) -> list[str]:
        return [name for name in self.panels.split() if name not in (_GRID, _NUMBERS)]

    def _layout(self) -> dict[str, Cell]:
        """The first two panels beside the numbers, and the others below them."""
        names = [_TILES[name] for name in self._beside_the_numbers]
        first, below = names[:2], names[2:]
        aspect = self.intrinsics.width / self.intrinsics.height
        if len(first) == 1 and not self._has(_NUMBERS):  # as wide as its picture: a telephone shows all of it
            return rows((_ALONE, {first[0]: min(_MOST_ACROSS, round(aspect * (_ALONE - 44) + 20))}))
        height, widths = _FIRST[len(first), self._has(_NUMBERS)]
        height = min(height, max(_LEAST, round(widths[0] / aspect + 35)))
        columns = [*first, _NUMBERS][: len(widths)]
        found = [(height, dict(zip(columns, widths, strict=True)))]
        if below:
            height, widths = _SECOND[len(below)]
            found.append((height, dict(zip(below, widths, strict=True))))
        return shortened(rows(*found), numbers=320)

    def _name(self) -> str:
        if self.lens:
            return type(self.lens).__name__
        told = [f"{name} = {value:g}" for name, value in self._coefficients().items() if value]
        return ", ".join(told) or "no distortion"

    def _coefficients(self) -> dict[str, float]:
        if self.lens:
            parameters = fields(self.lens)  # type: ignore[arg-type]
            return {parameter.name: getattr(self.lens, parameter.name) for parameter in parameters}
        return {name: getattr(self, name) for name in type(self).controls() if hasattr(BrownConrady, name)}

    # The picture -----------------------------------------------------------------------------------------------------

    def image(self, *, draft: bool) -> np.ndarray:
        picture = self._taken(draft)
        return picture if self.show == "distorted" else self._fetched(picture, self._bend)

    @cached_property
    def photographs(self) -> dict[tuple[str, bool], np.ndarray]:
        """What was taken so far, by whose lens it was ("camera" or "yours") and whether it is a draft."""
        return {}

    def _taken(self, draft: bool, whose: str = "camera") -> np.ndarray:
        """What the camera takes with its own lens or the reader's: kept, for a panel that opens shows the same."""
        if (whose, draft) not in self.photographs:
            lens = self._your_lens if whose == "yours" else self.camera.lens
            small = Camera(self.intrinsics.within(garden.DRAFT if draft else garden.FINE), lens)
            self.photographs[whose, draft] = self._scene_taken(small, draft)
        return self.photographs[whose, draft]

    def _scene_taken(self, camera: Camera, draft: bool) -> np.ndarray:
        """The given photograph in the camera's size, or a picture of the virtual scene."""
        if self.photograph is None and self.place == "wall":
            return snapshot(wall_scene(), camera)
        if self.photograph is None:
            return garden.glimpse(camera) if draft else snapshot(textured_scene(), camera)
        size = (camera.intrinsics.width, camera.intrinsics.height)
        return cv2.resize(self.photograph, size, interpolation=cv2.INTER_AREA)

    def _fetched(self, picture: np.ndarray, bend: Callable[[np.ndarray], np.ndarray]) -> np.ndarray:
        """The straight picture: undistorting evaluates the forward model at every output pixel."""
        pixels = self.intrinsics.resized(*picture.shape[1::-1])
        uv = pixels.to_pixels(bend(pixels.from_pixels(pixels.grid())))
        uv = np.nan_to_num(uv, nan=-9, posinf=-9, neginf=-9).astype(np.float32)
        return cv2.remap(picture, uv, None, cv2.INTER_LINEAR, borderValue=(38, 44, 54))

    def _bend(self, xy: np.ndarray) -> np.ndarray:
        """Distorted lens coordinates (..., 2) of ideal ones: the lens, or its bare polynomial where folds are shown."""
        if self.hide_fold or not isinstance(self.camera.lens, BrownConrady):
            return self.camera.lens.project(on_plane(xy))
        return self.camera.lens.distort(xy)

    def _picture_panel(self, cell: Cell, *, draft: bool) -> Drawn:
        panel = self._image_panel("picture", cell)
        straight = _grid_lines(self.intrinsics, _SAMPLES[draft])
        lines = self._bend(straight) if self.show == "distorted" else straight
        drawn = self._over(panel, lines, "thin", **_BRIGHT)
        title = "What the camera sees" if self.show == "distorted" else "Straightened"
        fold = self._fold_circle(panel, bent=self.show == "distorted") if self._has(_GRID) else NOTHING
        shown = self._photograph(panel, "camera") + drawn + fold
        return panel.show(shown, title=title), {"camera": jpeg(self.image(draft=draft))}

    def _over(self, panel: Panel, lines: np.ndarray, kind: str, **style: Any) -> Marks:
        """The lines of the grid over a picture, where the grid is open."""
        return svg.path(panel.place(self.intrinsics.to_pixels(lines)), kind, **style) if self._has(_GRID) else NOTHING

    def _image_panel(self, name: str, cell: Cell) -> Panel:
        return image_in(cell, name, self.intrinsics.width, self.intrinsics.height)

    def _photograph(self, panel: Panel, attached: str) -> Marks:
        return placed_image(panel, attached, self.intrinsics.width, self.intrinsics.height)

    # The reader's own function ---------------------------------------------------------------------------------------

    def _your_bend(self, xy: np.ndarray) -> tuple[np.ndarray, str]:
        """Where the reader's function puts ideal points (..., 2), and what is wrong with it."""
        return answered(self.yours, (xy, self.k1, self.k2, self.k3), xy)

    def _your_panel(self, cell: Cell, *, draft: bool) -> Drawn:
        """The same picture, bent or straightened by the reader's function."""
        panel = self._image_panel("yours", cell)
        straight, pictured = _grid_lines(self.intrinsics, _SAMPLES[draft]), self._photograph(panel, "yours")
        bent, problem = self._your_bend(straight)
        if problem:
            awaited = {"yours": jpeg(self.image(draft=draft))} if is_unwritten(problem) else {}
            return without(panel, problem, "With your function", right=pictured), awaited
        drawn = self._over(panel, straight if self.show == "undistorted" else bent, "orange thin")
        title = "Straightened by your function" if self.show == "undistorted" else "Bent by your function"
        return panel.show(pictured + drawn, title=title), {"yours": jpeg(self._your_picture(draft))}

    @property
    def _your_lens(self) -> WrittenLens:
        return WrittenLens(lambda xy: self._your_bend(xy)[0], self.camera.lens)

    def _your_picture(self, draft: bool) -> np.ndarray:
        """What a camera takes whose lens is the reader's function, or the camera's picture straightened by it.

        A given photograph is bent as the lens bent it: straightened by the lens, it is bent again by the function.
        """
        written = self._your_lens
        if self.show == "undistorted":
            return self._fetched(self._taken(draft), written.bend)
        if self.photograph is None:
            return self._taken(draft, "yours")
        return self._fetched(self._taken(draft), lambda xy: self._bend(written.straightened(xy)))

    def _fold_circle(self, panel: Panel, *, bent: bool) -> Marks:
        """Where the radial curve turns back, among ideal points or, `bent`, where the lens puts them."""
        if not isfinite(self._fold_angle if bent else self._fold):
            return NOTHING
        rim = self._fold_rim(90) if bent else self._fold * _circle(90)
        return svg.line(panel.place(self.intrinsics.to_pixels(closed(rim))), "red dashed")

    # The displacement ------------------------------------------------------------------------------------------------

    def moved(self, uv: np.ndarray) -> np.ndarray:
        """How far, in pixels (...,), the lens moves ideal pixels (..., 2)."""
        return np.linalg.norm(self._distorted(uv) - uv, axis=-1)

    def _distorted(self, uv: np.ndarray) -> np.ndarray:
        return self.intrinsics.to_pixels(self._bend(self.intrinsics.from_pixels(uv)))

    def _field_panel(self, cell: Cell, *, draft: bool) -> Drawn:
        panel = self._image_panel("field", cell)
        starts = _pixel_grid(self.intrinsics, 13).reshape(-1, 2)
        ends = self._distorted(starts)
        arrows = svg.segments(panel.place(starts), panel.place(ends), "blue") + svg.dots(panel.place(ends), "blue", 4.5)
        content = (
            self._folded_area(panel, 49 if draft else 97)
            + arrows
            + self._contours(panel, _SAMPLES[draft])
            + self._fold_circle(panel, bent=False)
        )
        return panel.show(content, title="Each point goes to its dot", note="contours: px"), {}

    def _contours(self, panel: Panel, samples: int) -> Marks:
        uv = _pixel_grid(self.intrinsics, samples)
        contours = contour_generator(uv[..., 0], uv[..., 1], np.ma.masked_invalid(self.moved(uv)))
        lines = {level: [panel.place(line) for line in contours.lines(level)] for level in _LEVELS}
        names = [
            svg.text(line[int((0.1 + 0.07 * i) * len(line))], f"{level}", "tick halo middle")
            for i, (level, drawn) in enumerate(lines.items())
            for line in drawn[:1]
        ]
        return svg.path([line for drawn in lines.values() for line in drawn], "muted thin") + svg.join(names)

    def _folded_area(self, panel: Panel, samples: int) -> Marks:
        uv = _pixel_grid(self.intrinsics, samples)
        xy = self.intrinsics.from_pixels(uv)
        folded = ~np.isfinite(self.camera.lens.project(on_plane(xy))[..., 0])
        outlines = contour_generator(uv[..., 0], uv[..., 1], folded.astype(float)).filled(0.5, 1.5)
        return svg.join(svg.polygon(panel.place(outline), "wash fill-red") for outline in outlines[0])

    # The radial curve ------------------------------------------------------------------------------------------------

    def _curve_with_axes(self, cell: Cell, *, draft: bool) -> Drawn:
        x, y, width, height = cell
        return self.curve_panel(x + 62, y + 34, width - 76, height - 84, samples=81 if draft else 241), {}

    def curve_panel(
        self, x: float, y: float, width: float, height: float, *, equation: bool = True, samples: int = 241
    ) -> Marks:
        """The radial curve g(r), where it folds and where the picture ends; `x` and `y` are its plot's corner."""
        corner = distortion.image_corner_radius(self.intrinsics) or 1.0  # a single pixel on the axis has none
        top = 1.5 * corner
        panel = plot.plot_panel("curve", x, y, width, height, (0, top), (0, 1.2 * corner))
        r = np.linspace(0, top, samples)
        fold = self._fold
        curve, beyond = self._radial(np.where(r <= fold, r, np.nan)), self._radial(np.where(r >= fold, r, np.nan))
        lines = (
            plot.band(panel, min(fold, top), top, "fill-red")
            + plot.grid(panel)
            + plot.curve(panel, r, r, "muted dashed")
            + plot.curve(panel, r, curve, "blue thick")
            + plot.curve(panel, r, beyond, "red thick dotted")
            + self._your_curve(panel, r)
            + svg.line(panel.place([(corner, 0), (corner, corner), (0, corner)]), "green dashed")
        )
        return plot.axes(panel, "r, ideal: the tangent of the angle", "r, distorted") + panel.show(
            lines
            + self._fold_mark(panel, fold)
            + svg.text(panel.place((0, corner)) + (8, 15), "image corner", "green halo"),
            title="Radial curve",
            note=self.equation() if equation else "",
        )

    def _your_curve(self, panel: Panel, r: np.ndarray) -> Marks:
        if self.yours is None:
            return NOTHING
        distorted, _ = self._your_bend(np.stack([r, np.zeros_like(r)], axis=-1))
        return plot.curve(panel, r, distorted[..., 0], "orange dashed")

    def _radial(self, r: np.ndarray) -> np.ndarray:
        lens = self.camera.lens
        if isinstance(lens, BrownConrady):
            return lens.radial(r)
        return lens.project(np.stack([r, 0 * r, np.ones_like(r)], axis=-1))[..., 0]

    def _fold_mark(self, panel: Panel, fold: float) -> Marks:
        if not fold < panel.right:
            return NOTHING
        at = panel.place([fold, float(self._radial(np.array(fold)))])
        free = (np.clip(at[0] - 8, 165, 0.68 * panel.width), 17)  # at the top, left of the line of no distortion
        return svg.dots([at], "red", 9) + svg.text(free, f"folds at r = {_with_angle(fold)}", "red end halo")

    # The frustum -----------------------------------------------------------------------------------------------------

    def _frustum_panel(self, cell: Cell, *, draft: bool) -> Drawn:
        x, y, width, height = cell
        panel = space_panel("frustum", x + 10, y + 34, width - 20, height - 44)
        label = "The rays of the image in space; drag or press the arrow keys to walk around"
        return self.in_space(panel, self._bent_frustum(), draft, "Its rays in space", label, drag="orbit")

    def _bent_frustum(self) -> list[Item]:
        """The rays of a grid of pixels, a metre long, beside those of a pinhole with the same intrinsics."""
        pinhole = self.camera.intrinsics.from_pixels(self.intrinsics.border(8))
        rim = unit(on_plane(pinhole))
        reach = self.camera.unproject(_pixel_grid(self.intrinsics, 25))
        mesh = [*reach[::3], *np.swapaxes(reach[:, ::4], 0, 1)]
        spokes = [np.stack([np.zeros(3), corner]) for corner in reach[[0, 0, -1, -1], [0, -1, -1, 0]]]
        return [
            Line(closed(rim), "muted dashed", 1.3),
            *(Line(line, "blue", 1.3) for line in mesh),
            *(Line(spoke, "blue", 1.6) for spoke in spokes),
            *axes_triad(RigidTransform.identity(), 0.4),
        ]

    # The numbers -----------------------------------------------------------------------------------------------------

    def _numbers_column(self, cell: Cell, *, draft: bool) -> Drawn:
        """The coefficients and key figures: all of them beside four panels, else those that the panels speak of."""
        coefficients = self._coefficients()  # the lens's own, where one is given
        if len(self._beside_the_numbers) < _MOST:
            coefficients = {name: value for name, value in coefficients.items() if value or name == "k1"}
        (x, y), half = cell[:2], (len(coefficients) + 1) // 2
        drawn = [svg.text((x + 10, y + 26), "This lens", "title")]
        for i, (name, value) in enumerate(coefficients.items()):
            at = (x + 10 + 96 * (i // half), y + 50 + 18 * (i % half))
            drawn.append(svg.text(at, true_minus(f"{name} {value:+.4f}"), "number" if value else "number fill-muted"))
        return svg.join(drawn) + readout(self._told(), (x + 10, y + 64 + 18 * half), (0, 36), (0, 16)), {}


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
