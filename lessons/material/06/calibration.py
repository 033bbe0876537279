"""The calibration visualizer: boards in front of a camera, the estimate from their corners, and how far to trust it.

A reader's own function can find the focal lengths of each picture beside the right ones.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Any, ClassVar, Self

import numpy as np

from camviz.cameras import Camera, transform
from camviz.draw import svg
from camviz.draw.flow import rows, shortened
from camviz.draw.panel import Panel, image_in, placed_image
from camviz.draw.picture import Picture, jpeg
from camviz.draw.readout import listed, signed
from camviz.draw.space import Item, Label, OrbitCamera, camera_body, space_panel
from camviz.lenses import BrownConrady
from camviz.lenses.base import Array
from camviz.poses import RigidTransform
from camviz.views.base import Drawn, OrbitView
from camviz_clinic.views.chessboard import outline, rim, squares
from camviz_school.views.board_pictures import FREE, INTRINSICS, middle_of, transform_each
from camviz_school.views.error_bars import NOTHING, PIXELS, ErrorBars, number
from camviz_school.views.one_board import FromEach, from_each, panel_of_each

_MAGNIFIED = np.array([1, 2, 3, 5, 10, 20, 30, 50, 100, 200, 300, 500, 1000])
_CELLS = (16, 12)  # of the coverage map
_REACH = 300.0  # pixels at the ends of the strip
_NORMAL = 0.07  # metres, the length of the handle that tilts a board
_EVERYTHING = "picture space estimate errors"
_LAYOUTS = {
    "picture fit": shortened(rows((464, {"picture": 620, "estimate": 340})), estimate=350),
    "picture yours": rows((426, {"picture": 480, "each picture alone": 480})),
    _EVERYTHING: shortened(
        rows(
            (382, {"picture": 480, "boards in space": 480}),
            (318, {"estimate": 310, "estimate ± σ": 310, "errors": 340}),
        ),
        **{"estimate": 256, "estimate ± σ": 290},
    ),
}
_ROW = 22  # units, from one estimate to the next
_STRIP = Panel("estimates", 356, 428, 254, _ROW * len(INTRINSICS), -1, 1, 0, len(INTRINSICS))


@dataclass(frozen=True)
class CalibrationView(OrbitView, ErrorBars):
    """Corners and their residuals, the boards in space, the estimate ± σ against the truth, and two kinds of error.

    `panels` says what is drawn: everything; "picture fit", the corners with the estimate and its RMS error alone; or
    "picture yours", the corners and the focal lengths that each picture gives alone. `yours` is a reader's function of
    (H, centre) for those, a homography (3, 3) and (cx, cy) to (fx, fy); what it answers is orange.
    """

    title: ClassVar[str] = "Calibration"
    layouts = _LAYOUTS

    panels: str = _EVERYTHING
    yours: Callable[..., Any] | None = field(default=None, compare=False, repr=False)
    eye: OrbitCamera = OrbitCamera(distance=1.2, yaw_deg=-58, pitch_deg=26)

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
        if self.panels == _EVERYTHING or self.adjustment is None:
            return figures
        if self.panels == "picture yours":
            fx, fy = self.each.right[self.index]
            return {f"from board {self.index + 1} alone": f"fx {fx:.1f}, fy {fy:.1f}"}
        estimated = {
            name: figures[name].replace(f" ± {_spread(name, self.estimates[name][1])}", "") for name in FREE[self.free]
        }
        return {**estimated, "RMS": figures["RMS"]}

    def _written(self, name: str) -> str:
        value, sigma = self.estimates[name]
        true = f" (true {number(name, self.true[name])})" if self.truth else ""
        return f"{number(name, value)} ± {_spread(name, sigma)}{true}"

    # The picture -----------------------------------------------------------------------------------------------------

    def figure(self, *, draft: bool = False) -> Picture:
        view = self.but(coarse=True) if draft else self
        attached = {"photograph": jpeg(self.photographs[self.index])} if self.photographs else {}
        parts = {"picture": view._image()}
        if self.panels == "picture fit":
            parts["estimate"] = view._fit()
        elif self.panels == "picture yours":
            place = (552, 34, 398, 286)
            parts["each picture alone"] = panel_of_each(
                view.each, view._known, self.index, place, self.yours is not None
            )
        else:
            parts["boards in space"], photographs = view._space(draft)
            parts |= {"estimate": view._estimates(), "estimate ± σ": view._strip(), "errors": view._errors()}
            attached = attached | photographs
        return self.tiled(_LAYOUTS[self.panels], parts, attached, view.description())

    # What the camera saw ---------------------------------------------------------------------------------------------

    @cached_property
    def _image_panel(self) -> Panel:
        return image_in(_LAYOUTS[self.panels]["picture"], "image", self.width, self.height)

    def _image(self) -> str:
        panel = self._image_panel
        others = np.delete(self.corners, self.index, axis=0)
        marks = svg.dots(panel.place(others), "muted", 2.6) + self._vectors(panel) + self._handle(panel)
        if self.photographs:
            content = placed_image(panel, "photograph", self.width, self.height) + self._outlined(panel) + marks
        else:
            content = self._coverage(panel) + self._outlined(panel) + marks
        note = f"errors drawn {self.magnified:g}×" if self.adjustment else ""
        words = "What the camera saw: drag a board, or move it with the arrow keys, plus and minus"
        drag = {"drag": "board", "label": words} if self.seen is None else {}
        title = f"Picture {self.index + 1} of {self.count}" if self.photographs else "What the camera saw"
        return panel.show(content, title=title, note=note, **drag)

    def _coverage(self, panel: Panel) -> str:
        """Cells in which corners were seen, the darker the more."""
        uv = self.corners[self.used].reshape(-1, 2)
        uv = uv[np.isfinite(uv).all(axis=1)]
        cell = np.array([self.width, self.height]) / _CELLS
        inside = np.clip(((uv + 0.5) / cell).astype(int), 0, np.array(_CELLS) - 1)
        places, count = np.unique(inside, axis=0, return_counts=True)
        starts = panel.place(places * cell - 0.5)
        squared = starts[:, None] + np.array([(0, 0), (1, 0), (1, 1), (0, 1)]) * (cell * panel.scale)
        level = np.minimum(np.ceil(count / 4), 3)
        return "".join(
            svg.path(squared[level == i], "fill-blue", closed=True, style=f"fill-opacity:{0.09 * i:g};stroke:none")
            for i in (1, 2, 3)
        )

    def _outlined(self, panel: Panel) -> str:
        """The picked board: its rows and columns of corners, in the order in which they are found."""
        uv = panel.place(self.corners[self.index]).reshape(self.board.rows, self.board.columns, 2)
        strength = " thin half" if self.photographs else "" if self.used[self.index] else " dashed"
        return svg.path([*uv, *uv.swapaxes(0, 1)], f"orange{strength}")

    @property
    def magnified(self) -> float:
        """How many times longer than they are the errors are drawn."""
        typical = self.adjustment.rms if self.adjustment else 1.0
        return float(_MAGNIFIED[np.abs(np.log(_MAGNIFIED * max(typical, 1e-3) / 9)).argmin()])

    def _vectors(self, panel: Panel) -> str:
        """The residuals, magnified, from where the estimated camera would see a corner towards where it was found."""
        if self.adjustment is None:
            return ""
        residuals, found = self.residuals, self.corners
        starts, ends = panel.place(found), panel.place(found + self.magnified * residuals)
        others = np.arange(self.count) != self.index
        faint = "" if self.photographs else svg.segments(starts[others], ends[others], "red thin half")
        here = svg.dots(starts[self.index], "orange", 4) + svg.segments(starts[self.index], ends[self.index], "red")
        return faint + here

    @property
    def _grips(self) -> Array:
        """Pixels (2, 2): the middle of the picked board, and the tip of the handle that stands on it."""
        pose, middle = self.cam_from_board[self.index], middle_of(self.board)
        return self._true_camera.project(transform(pose, [middle, middle - (0, 0, _NORMAL)]))

    def _handle(self, panel: Panel) -> str:
        if self.seen is not None:
            return ""
        middle, tip = panel.place(self._grips)
        tip = np.clip(np.where(np.isfinite(tip), tip, middle), 10, np.array([panel.width, panel.height]) - 10)
        words = "A stick upright on the board: drag it, or press the arrow keys, to tilt the board"
        hand = svg.element("circle", cx=tip[0], cy=tip[1], r=16, fill_opacity=0, class_="card")
        knob = hand + svg.dots([tip], "paper-dot", 15) + svg.dots([tip], "orange", 11)
        grip = svg.group(knob, data_drag="tilt", tabindex=0, role="group", aria_label=words)
        return svg.line([middle, tip], "orange thick") + svg.dots([middle], "orange", 6) + grip

    # The boards in space ---------------------------------------------------------------------------------------------

    def _space(self, draft: bool) -> Drawn:
        panel = space_panel("space", 490, 34, 460, 338)
        far = float(self._poses_shown.translation[:, 2].max())
        eye = replace(
            self.eye, target=(0.0, -0.04 * far, 0.62 * far), distance=self.eye.distance * max(far, 0.3) / 0.75
        )
        label = "The boards in space; drag or press the arrow keys to walk around, plus and minus to go nearer"
        note = "dashed: as estimated" if self.truth else ""
        return self.in_space(panel, self._items(), draft, "The boards in space", label, eye=eye, note=note, hint="")

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

    @property
    def _known(self) -> Camera:
        """The camera whose lens and principal point are taken as known: the true one, or that which was estimated."""
        return self.truth or self.camera or self._true_camera

    @cached_property
    def each(self) -> FromEach:
        """fx and fy from every picture alone, and by the reader's function."""
        return from_each(self.corners, self.board, self._known, self.yours)

    # The estimate ----------------------------------------------------------------------------------------------------

    def _fit(self) -> str:
        """The estimated numbers against the truth, and the error of the fit: what a report of a calibration says."""
        x = (640, 780, 890)
        heads = ("", "true" if self.truth else "", "estimate")
        parts = [svg.text((x[0], 26), "The estimate" + (", against the truth" if self.truth else ""), "title")]
        parts += [svg.text((at, 54), words, "note end") for at, words in zip(x, heads, strict=True)]
        for row, name in enumerate(FREE[self.free] if self.estimates else ()):
            y = 80 + 24 * row
            true = number(name, self.true[name]) if self.truth else ""
            words = (true, number(name, self.estimates[name][0]))
            parts.append(svg.text((x[0], y), name, "number"))
            parts += [svg.text((at, y), one, "number end") for at, one in zip(x[1:], words, strict=True)]
        if self.adjustment is None:
            return "".join(parts) + svg.paragraph((x[0], 80), NOTHING, 300, "label")
        return "".join(parts) + self._bar(
            x[0], 80 + 24 * len(FREE[self.free]) + 20, "RMS error of all its corners", self.adjustment.rms, "fill-blue"
        )

    def _estimates(self) -> str:
        x = (10, 120, 212, 300)
        heads = ("", "true" if self.truth else "", "estimate", "± σ")
        parts = [svg.text((10, 402), "The estimate" + (", against the truth" if self.truth else ""), "title")]
        parts += [svg.text((at, 420), words, "note end") for at, words in zip(x, heads, strict=True)]
        for row, name in enumerate(INTRINSICS):
            y = _STRIP.y + _ROW * row + 15
            free = name in FREE[self.free]
            value, sigma = self.estimates.get(name, (np.nan, np.nan))
            class_ = "number" if free else "number fill-muted"
            parts.append(svg.text((x[0], y), name, class_))
            words = (
                number(name, self.true[name]) if self.truth else "",
                number(name, value) if np.isfinite(value) else "",
                _spread(name, sigma) if free else "held",
            )
            parts += [svg.text((at, y), one, f"{class_} end") for at, one in zip(x[1:], words, strict=True)]
        return "".join(parts)

    def _strip(self) -> str:
        """Every estimate's distance from the truth with ± σ and ± 2σ, in pixels on a scale that is linear near 0."""
        marks = np.array([-100, -10, -1, 0, 1, 10, 100])
        xs = _STRIP.place(np.stack([_squeezed(marks), 0 * marks], axis=-1))[:, 0]
        lines = [
            svg.line([(x, 0), (x, _STRIP.height)], "grid" if m else "axis") for x, m in zip(xs, marks, strict=True)
        ]
        dots = [self._dot(name, row) for row, name in enumerate(INTRINSICS)]
        below = _STRIP.y + _STRIP.height
        ticks = [
            svg.text((_STRIP.x + x, below + 15), signed(m, 0) if m else "0", "tick middle")
            for x, m in zip(xs, marks, strict=True)
        ]
        names = [
            svg.text((_STRIP.x - 10, _STRIP.y + _ROW * row + 15), name, "label end")
            for row, name in enumerate(INTRINSICS)
        ]
        note = svg.text((_STRIP.x + _STRIP.width, below + 36), "k and p: at the image’s corner", "note end")
        title = svg.text((320, 402), "Estimate less truth ± σ, px" if self.truth else "σ and 2σ, px", "title")
        return title + _STRIP.show("".join(lines + dots)) + "".join(names + ticks) + note

    def _dot(self, name: str, row: int) -> str:
        value, sigma = self.estimates.get(name, (np.nan, np.nan))
        unit = self._pixels_per[name]
        error = (value - self.true[name]) * unit if self.truth else 0.0
        free = name in FREE[self.free]
        if not np.isfinite(error) or (not free and not self.truth):
            return ""
        reach = _squeezed(error + np.array([-2, 2, -1, 1, 0]) * sigma * unit)
        (a, y), (b, _), (c, _), (d, _), at = _STRIP.place(np.stack([reach, np.full(5, row + 0.5)], axis=-1))
        if not free:
            return svg.dots([at], "muted", 6)
        spread = svg.line([(a, y), (b, y)], "blue thin") + svg.line([(c, y), (d, y)], "blue thick")
        if 0 < at[0] < _STRIP.width:
            return spread + svg.dots([at], "blue", 9)
        edge, inward = (_STRIP.width - 2, -11) if at[0] > 0 else (2, 11)
        return spread + svg.polygon([(edge, y), (edge + inward, y - 6), (edge + inward, y + 6)], "fill-blue")

    @cached_property
    def _pixels_per(self) -> dict[str, float]:
        """How far, in pixels, the image's corner moves when a coefficient changes by 1; 1 for fx, fy, cx and cy."""
        camera = self._known
        at = camera.intrinsics.from_pixels((-0.5, -0.5))
        ray = camera.lens.unproject(at)
        ideal = ray[:2] / ray[2] if np.isfinite(ray).all() else at  # the corner may lie beyond a fold
        moved = {name: BrownConrady(**{name: 1.0}).distort(ideal) - ideal for name in INTRINSICS if name not in PIXELS}
        scaled = {name: float(camera.intrinsics.fx * np.linalg.norm(shift)) for name, shift in moved.items()}
        return dict.fromkeys(PIXELS, 1.0) | scaled

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


def _squeezed(pixels: np.ndarray | float) -> np.ndarray:
    """-1 … 1 for pixels from -_REACH to _REACH: linear below a pixel, logarithmic above."""
    return np.clip(np.arcsinh(2 * np.asarray(pixels)) / np.arcsinh(2 * _REACH), -1.1, 1.1)


def _spread(name: str, sigma: float) -> str:
    """Two significant digits, as metrology asks (GUM, 7.2.6): where little is known, rounding decides the third."""
    if sigma >= (1e4 if name in PIXELS else 1e3):
        return "unknown"
    return f"{sigma:.4f}" if name not in PIXELS and sigma < 1 else f"{float(f'{sigma:.2g}'):g}"
