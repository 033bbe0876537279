"""The calibration visualizer: boards in front of a camera, the estimate from their corners, and how far to trust it.

A reader's own function can find the focal lengths of each picture beside the right ones.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Any, ClassVar, Self

import numpy as np

from camviz.cameras import Camera, transform
from camviz.draw import svg
from camviz.draw.flow import Cell, Part, rows, shortened
from camviz.draw.panel import Panel, image_in, placed_image
from camviz.draw.picture import Picture, jpeg
from camviz.draw.readout import listed, signed
from camviz.draw.space import Item, Label, OrbitCamera, camera_body, space_panel
from camviz.lenses import BrownConrady
from camviz.lenses.base import Array
from camviz.poses import RigidTransform
from camviz.views.base import Drawn, OrbitView
from camviz_clinic.views.chessboard import outline, rim, squares
from camviz_school.views.board_photograph import behind, held_board
from camviz_school.views.board_pictures import FREE, TRUTH, middle_of, transform_each
from camviz_school.views.error_bars import number, percent
from camviz_school.views.estimate_numbers import EstimateNumbers, spread
from camviz_school.views.one_board import FromEach, from_each, panel_of_each

_CELLS = (16, 12)  # of the coverage map
_NORMAL = 0.07  # metres, the length of the handle that tilts a board
_CORNERS = "corners"  # a panel that is no tile: all corners found, where the picture else shows one board
_TILES = {  # of the panels
    "picture": "picture",
    "fit": "the fit",
    "yours": "each picture alone",
    "space": "boards in space",
    "estimate": "estimate",
    "sigma": "estimate ± σ",
    "errors": "errors",
    "each": "each board",
}
_EVERYTHING = "picture space corners estimate sigma errors each"
# Units of height: of what stands in a tile, of the first row, of each row below it.
_HIGH = {"the fit": 260, "estimate": 310, "estimate ± σ": 310, "errors": 190, "each board": 260}
_FIRST, _FURTHER = 350.0, 320.0
_WIDE: dict[int, tuple[float, ...]] = {1: (440,), 2: (440, 520), 3: (390, 285, 285)}  # by how many panels stand in it
_NARROW = ("estimate", "errors")  # beside one picture alone: a telephone shows the larger what is less wide
_SHARES = {"boards in space": 1.25, "estimate ± σ": 1.15}  # of a row below it, among others' 1
_MAGNIFIED = np.array([1, 2, 3, 5, 10, 20, 30, 50, 100, 200, 300, 500, 1000])


@dataclass(frozen=True)
class CalibrationView(OrbitView, EstimateNumbers):
    """Pictures of a board, the camera that is estimated from them against the true one, and two kinds of error.

    `panels` names what is drawn: the picture, and beside it any of fit, yours, space, estimate, sigma, errors and each.
    With "corners" the picture shows the corners of all boards and how far they are off. `yours` is a reader's function
    of (H, centre), a homography (3, 3) and (cx, cy), to the (fx, fy) of one picture; what it answers is orange.
    """

    title: ClassVar[str] = "Calibration"
    openable: ClassVar[Mapping[str, str]] = {
        "space": "boards in space",
        "estimate": "numbers",
        "sigma": "± σ",
        "errors": "two kinds of error",
        "each": "each board",
        _CORNERS: "all corners",
    }

    panels: str = _EVERYTHING
    yours: Callable[..., Any] | None = field(default=None, compare=False, repr=False)
    eye: OrbitCamera = OrbitCamera(distance=1.2, yaw_deg=-58, pitch_deg=26)

    def __post_init__(self) -> None:
        super().__post_init__()
        wanted = self.panels.split()
        if "picture" not in wanted or not set(wanted) <= {*_TILES, _CORNERS}:
            others = ", ".join([*list(_TILES)[1:], _CORNERS])
            raise ValueError(f"panels must be picture and any of {others} beside it, got {self.panels!r}")

    @classmethod
    def of_a_pinhole(cls, **state: Any) -> Self:
        """The view of a camera without distortion, of which fx, fy, cx and cy are estimated."""
        return cls(**{"truth": Camera(TRUTH.intrinsics, BrownConrady()), "free": "f, c", **state})

    # Words -----------------------------------------------------------------------------------------------------------

    def numbers(self) -> dict[str, str]:
        """The state's key figures, as text."""
        if self.adjustment is None:
            return {"estimate": "none: no board is seen"}
        figures = {name: self._written(name) for name in FREE[self.free]}
        figures["RMS"] = f"{self.adjustment.rms:.3f} px"
        if np.isfinite(self.held_out):
            figures["on unseen boards"] = f"{self.held_out:.3g} px"
        if self.used[self.index]:
            figures[f"correlation of fx with the distance of board {self.index + 1}"] = signed(self.correlation, 4)
        return figures

    def description(self) -> str:
        n = self.count
        boards = f"{n} board{'s' if n > 1 else ''}"
        if self.seen is None:
            boards += f" tilted by {self.tilt:g}° about {self.distance:g} m away, corners found to {self.noise:g} px"
        left_out = f", without board {self.index + 1}" if self.leave_out else ""
        figures = listed(self._told())
        return f"{boards}{left_out}; solved for {self.free}. {figures}."

    def _told(self) -> dict[str, str]:
        """The figures that the panels show."""
        figures = self.numbers()
        if self.adjustment is None:
            return figures
        told: dict[str, str] = {}
        if self._has("yours"):
            fx, fy = self.each.right[self.index]
            told[f"from board {self.index + 1} alone"] = f"fx {fx:.1f}, fy {fy:.1f}"
        if self._has("estimate") or self._has("sigma"):
            told |= {name: figures[name] for name in FREE[self.free]}
        if self._has("fit") or self._has("errors") or self._has("each"):
            told["RMS"] = figures["RMS"]
        if self._has("fit") and self.truth is not None:
            value, true = (number("fx", one) for one in (self.estimates["fx"][0], self.true["fx"]))
            told["focal length"] = f"off by {percent(self.off_percent)} %, {value} px in place of {true}"
        if self._has("errors") and "on unseen boards" in figures:
            told["on unseen boards"] = figures["on unseen boards"]
        if self._has("space"):
            told |= {name: value for name, value in figures.items() if name.startswith("correlation")}
        return told

    def _written(self, name: str) -> str:
        value, sigma = self.estimates[name]
        true = f" (true {number(name, self.true[name])})" if self.truth else ""
        return f"{number(name, value)} ± {spread(name, sigma)}{true}"

    # The picture -----------------------------------------------------------------------------------------------------

    def figure(self, *, draft: bool = False) -> Picture:
        view = self.but(coarse=True) if draft else self
        attached = {"photograph": jpeg(self.photographs[self.index])} if self.photographs else {}
        if self._shows_the_board:
            attached |= behind(self._true_camera)
        layout, parts = self._layout, dict[str, Part]()
        for name in self._tiles:
            tile = _TILES[name]
            if name == "picture":
                parts[tile] = view._image()
            elif name == "space":
                parts[tile], photographs = view._space(layout[tile], draft)
                attached = attached | photographs
            elif name == "yours":
                x, y, width, height = layout[tile]
                place = (x + 72, y + 34, width - 82, height - 140)
                parts[tile] = panel_of_each(view.each, view._known, self.index, place, self.yours is not None)
            else:
                draw = {"fit": view._fit, "estimate": view._estimates, "sigma": view._strip}
                draw |= {"errors": view._errors, "each": view._each_board}
                parts[tile] = draw[name](layout[tile])
        return self.tiled(layout, parts, attached, view.description())

    @property
    def _tiles(self) -> list[str]:
        return [name for name in self.panels.split() if name != _CORNERS]

    @cached_property
    def _layout(self) -> dict[str, Cell]:
        """Up to three panels in one row; else the first two, and the others below them, as many in each row."""
        names = [_TILES[name] for name in self._tiles]
        first = names[: 3 if len(names) == 3 else 2]
        others, lines = names[len(first) :], 1 + (len(names) > 6)
        high = 410.0 if _TILES["yours"] in first else 330.0 if len(first) == 3 else _FIRST
        wide = (440, 360) if len(first) == 2 and first[1] in _NARROW else _WIDE[len(first)]
        made = [(high, dict(zip(first, wide, strict=True)))]
        each = -(-len(others) // lines)
        for row in (others[i : i + each] for i in range(0, len(others), max(each, 1))):
            whole = sum(_SHARES.get(name, 1) for name in row)
            made.append((_FURTHER, {name: 960 * _SHARES.get(name, 1) / whole for name in row}))
        heights = _HIGH | {"the fit": 330 if self.your_rms else 260}
        return shortened(rows(*made), **{name: heights[name] for name in names if name in heights})

    # What the camera saw ---------------------------------------------------------------------------------------------

    @cached_property
    def _image_panel(self) -> Panel:
        return image_in(self._layout["picture"], "image", self.width, self.height)

    @property
    def _shows_the_board(self) -> bool:
        """Whether the picture is one of the virtual camera, which is taken here, and not all corners at once."""
        return not (self.photographs or self._has(_CORNERS) or self.seen is not None)

    def _image(self) -> svg.Marks:
        panel = self._image_panel
        others = np.delete(self.corners, self.index, axis=0)
        marks = svg.dots(panel.place(others), "muted", 2.6) + self._vectors(panel) + self._handle(panel)
        if self._shows_the_board:
            found = panel.place(self.corners[self.index])
            pose = self.cam_from_board[self.index]
            held = held_board(panel, self.board, pose, self._true_camera)
            content = held + svg.dots(found, "orange", 5) + self._handle(panel)
        elif self.photographs:
            content = placed_image(panel, "photograph", self.width, self.height) + self._outlined(panel) + marks
        else:
            content = self._coverage(panel) + self._outlined(panel) + marks
        note = f"errors drawn {self.magnified:g}×" if self.adjustment and not self._shows_the_board else ""
        words = "What the camera saw: drag a board, or move it with the arrow keys, plus and minus"
        drag = {"drag": "board", "label": words} if self.seen is None else {}
        one = self.photographs or self._shows_the_board
        title = f"Picture {self.index + 1} of {self.count}" if one else "What the camera saw"
        return panel.show(content, title=title, note=note, **drag)

    def _coverage(self, panel: Panel) -> svg.Marks:
        """Cells in which corners were seen, the darker the more."""
        uv = self.corners[self.used].reshape(-1, 2)
        uv = uv[np.isfinite(uv).all(axis=1)]
        cell = np.array([self.width, self.height]) / _CELLS
        inside = np.clip(((uv + 0.5) / cell).astype(int), 0, np.array(_CELLS) - 1)
        places, count = np.unique(inside, axis=0, return_counts=True)
        starts = panel.place(places * cell - 0.5)
        squared = starts[:, None] + np.array([(0, 0), (1, 0), (1, 1), (0, 1)]) * (cell * panel.scale)
        level = np.minimum(np.ceil(count / 4), 3)
        return svg.join(
            svg.path(squared[level == i], "fill-blue", closed=True, fill_opacity=0.09 * i, stroke="none")
            for i in (1, 2, 3)
        )

    def _outlined(self, panel: Panel) -> svg.Marks:
        """The picked board: its rows and columns of corners, in the order in which they are found."""
        uv = panel.place(self.corners[self.index]).reshape(self.board.rows, self.board.columns, 2)
        strength = " thin half" if self.photographs else "" if self.used[self.index] else " dashed"
        return svg.path([*uv, *uv.swapaxes(0, 1)], f"orange{strength}")

    @property
    def magnified(self) -> float:
        """How many times longer than they are the errors are drawn."""
        typical = self.adjustment.rms if self.adjustment else 1.0
        return float(_MAGNIFIED[np.abs(np.log(_MAGNIFIED * max(typical, 1e-3) / 9)).argmin()])

    def _vectors(self, panel: Panel) -> svg.Marks:
        """The residuals, magnified, from where the estimated camera projects a corner towards where it was detected."""
        if self.adjustment is None:
            return svg.NOTHING
        projected = self.corners - self.residuals
        starts, ends = panel.place(projected), panel.place(projected + self.magnified * self.residuals)
        others = np.arange(self.count) != self.index
        faint = svg.NOTHING if self.photographs else svg.segments(starts[others], ends[others], "red thin half")
        dots = svg.dots(panel.place(self.corners[self.index]), "orange", 4)
        return faint + dots + svg.segments(starts[self.index], ends[self.index], "red")

    @property
    def _grips(self) -> Array:
        """Pixels (2, 2): the middle of the picked board, and the tip of the handle that stands on it."""
        pose, middle = self.cam_from_board[self.index], middle_of(self.board)
        return self._true_camera.project(transform(pose, [middle, middle - (0, 0, _NORMAL)]))

    def _handle(self, panel: Panel) -> svg.Marks:
        if self.seen is not None:
            return svg.NOTHING
        middle, tip = panel.place(self._grips)
        tip = np.clip(np.where(np.isfinite(tip), tip, middle), 10, np.array([panel.width, panel.height]) - 10)
        words = "A stick upright on the board: drag it, or press the arrow keys, to tilt the board"
        hand = svg.circle(tip, 16, "card", fill_opacity=0)
        knob = hand + svg.dots([tip], "paper-dot", 15) + svg.dots([tip], "orange", 11)
        grip = svg.handle(knob, "tilt", words)
        return svg.line([middle, tip], "orange thick") + svg.dots([middle], "orange", 6) + grip

    # The boards in space ---------------------------------------------------------------------------------------------

    def _space(self, cell: Cell, draft: bool) -> Drawn:
        x, y, width, height = cell
        panel = space_panel("space", x + 10, y + 34, width - 20, height - 130)
        far = float(self._poses_shown.translation[:, 2].max())
        eye = replace(
            self.eye, target=(0.0, -0.04 * far, 0.62 * far), distance=self.eye.distance * max(far, 0.3) / 0.75
        )
        label = "The boards in space; drag or press the arrow keys to walk around, plus and minus to go nearer"
        note = "dashed: as estimated" if self.truth else ""
        shown, photographs = self.in_space(
            panel, self._items(), draft, "The boards in space", label, eye=eye, note=note, hint=""
        )
        return shown + self._facts(x + 14, y + height - 72), photographs

    @property
    def _poses_shown(self) -> RigidTransform:
        return self.cam_from_board if self.truth else self.estimated_poses

    def _items(self) -> list[Item]:
        camera = self._known
        items: list[Item] = [*camera_body(camera, 0.09, colour="blue", name="")]
        shown = transform_each(self._poses_shown, outline(self.board))
        items += [rim(corners, "muted", 1.2) for corners in np.delete(shown, self.index, axis=0)]
        if self.truth and self.adjustment:
            estimated = transform_each(self.adjustment.first_from_board, outline(self.board))
            items += [rim(corners, "red dashed", 1.4) for corners in estimated]
        picked = shown[self.index]
        items += [rim(picked, "orange", 2.2), squares(picked, self.board)]
        items.append(Label(picked[0], str(self.index + 1), "label orange"))
        return items

    # What each picture says alone ------------------------------------------------------------------------------------

    @cached_property
    def each(self) -> FromEach:
        """fx and fy from every picture alone, and by the reader's function."""
        return from_each(self.corners, self.board, self._known, self.yours)

    # Touch -----------------------------------------------------------------------------------------------------------

    def dragged(self, handle: str, x: float, y: float, dx: float, dy: float) -> Self:
        if handle == "tilt":
            return self.moved(self.index, turn=np.radians(0.5) * np.array([dy, -dx, 0]))
        if handle != "board":
            return super().dragged(handle, x, y, dx, dy)
        view = self if np.isnan(x) else self._with_board_at(x - dx, y - dy)
        centre = transform(view.cam_from_board[view.index], middle_of(self.board))
        du, dv = np.array([dx, dy]) / self._image_panel.scale
        pixels = self._true_camera.intrinsics
        return view.moved(view.index, shift=centre[2] * np.array([du / pixels.fx, dv / pixels.fy, 0]))

    def pressed(self, handle: str, key: str) -> Self:
        steps = {"+": -1, "=": -1, "-": 1}.get(key, 0)
        if handle == "board" and steps:
            centre = transform(self.cam_from_board[self.index], middle_of(self.board))
            return self.moved(self.index, shift=0.05 * steps * centre)
        return super().pressed(handle, key)

    def _with_board_at(self, x: float, y: float) -> Self:
        """With the board picked that is under the pointer; the one already picked has precedence."""
        panel = self._image_panel
        uv = panel.data(np.array([x, y]) - (panel.x, panel.y))
        middles = self._true_camera.project(transform_each(self.cam_from_board, middle_of(self.board)[None])[:, 0])
        away = np.linalg.norm(middles - uv, axis=1)
        reach = np.nanmax(np.linalg.norm(self.corners[self.index] - middles[self.index], axis=1), initial=20.0)
        return self if away[self.index] < reach else self.but(picked=int(np.nanargmin(away)) + 1)
