"""What two calibrated cameras say of the views they share: their epipolar lines, and how far corners are off them."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import TYPE_CHECKING, Any, ClassVar

import numpy as np

from camviz import twoview
from camviz.cameras import Camera
from camviz.draw import plot, svg
from camviz.draw.flow import Sentences, rows
from camviz.draw.marks import NOTHING, Marks
from camviz.draw.panel import Panel, image_panel, placed_image
from camviz.draw.picture import Picture, jpeg
from camviz.lenses import Perspective
from camviz.lenses.base import Array
from camviz.views.base import Drawn, slider
from camviz.views.marks import arrows, clipped, on_photograph
from camviz.views.view_bars import LABEL, ViewChooser, bars_of, ceiling, figures_on, names_below
from camviz_clinic.calibration.problem import rms_by_view
from camviz_clinic.views.observations import Missing, Photographs, no_photographs, not_at_hand, short_names
from camviz_clinic.views.residuals import nice

if TYPE_CHECKING:
    from camviz_clinic.files import Calibration

_DISTANCES = np.concatenate([np.geomspace(0.1, 1000, 90), [np.inf]])
_LAYOUT = rows((178, {"distances": 960}), (384, {"left": 480, "right": 480}), (38, {"in words": 960}))


@dataclass(frozen=True, eq=False)
class SharedViews:
    """Two cameras in their places, and the corners (views, corners, 2) that each detected, NaN where it did not."""

    left: Camera
    right: Camera
    detections: tuple[Array, Array]
    columns: int
    names: tuple[str, str] = ("left", "right")
    pictures: tuple[str, ...] = ()
    photographs: tuple[Photographs, Photographs] = (no_photographs, no_photographs)

    @classmethod
    def of(
        cls, calibration: Calibration, photographs: tuple[Photographs, Photographs] = (no_photographs, no_photographs)
    ) -> SharedViews:
        """The first two cameras of a calibration. Raises Missing where it has no pair, or no views that both saw."""
        names = tuple(calibration.cameras)[:2]
        left, right = pair_of(calibration)
        if calibration.board is None or any(name not in calibration.detections for name in names):
            raise Missing(f"The file does not hold the corners that {names[0]} and {names[1]} saw.")
        seen = [np.array(calibration.detections[name], dtype=float) for name in names]
        for i, name in enumerate(names):
            if name in calibration.set_aside:
                seen[i][calibration.set_aside[name]] = np.nan
        if len(seen[0]) != len(seen[1]):
            raise Missing(
                f"The two cameras have {len(seen[0])} and {len(seen[1])} views: which belong together is not known."
            )
        pictures = calibration.pictures.get(names[0], ())
        corners, columns = (seen[0], seen[1]), calibration.board.columns
        found = cls(left, right, corners, columns, (names[0], names[1]), pictures, photographs)
        if not np.isfinite(found.distances[0]).any():
            raise Missing(f"No corner was seen by {names[0]} and {names[1]} in one view.")
        return found

    def __len__(self) -> int:
        return len(self.detections[0])

    @cached_property
    def ideal(self) -> tuple[Camera, Camera]:
        """The two cameras without their lenses: perspective ones, of the same matrices and places."""
        return replace(self.left, lens=Perspective()), replace(self.right, lens=Perspective())

    @cached_property
    def straightened(self) -> tuple[Array, Array]:
        """The corners (views, corners, 2) as the ideal cameras would have them."""
        cameras = (self.left, self.right)
        rays = [c.lens.unproject(c.intrinsics.from_pixels(uv)) for c, uv in zip(cameras, self.detections, strict=True)]
        left, right = (i.intrinsics.to_pixels(i.lens.project(r)) for i, r in zip(self.ideal, rays, strict=True))
        return left, right

    @cached_property
    def offsets(self) -> tuple[Array, Array]:
        """From the nearest point of its epipolar line to each corner, (views, corners, 2) ideal pixels, by picture."""
        F = twoview.fundamental(*self.ideal)
        left, right = self.straightened
        return _from_line(twoview.epipolar_lines(F.T, right), left), _from_line(twoview.epipolar_lines(F, left), right)

    @cached_property
    def distances(self) -> tuple[Array, Array]:
        """How far (views, corners) each corner is off its epipolar line in either picture, in ideal pixels."""
        left, right = (np.linalg.norm(offset, axis=-1) for offset in self.offsets)
        return left, right

    @cached_property
    def rms(self) -> Array:
        """The RMS (views,) in pixels of these distances in both pictures; NaN for a view that the two do not share."""
        return rms_by_view(np.concatenate([d**2 for d in self.distances], axis=1))

    @property
    def total_rms(self) -> float:
        """The RMS in pixels over all views."""
        return float(np.sqrt(np.nanmean(np.concatenate([d**2 for d in self.distances], axis=1))))

    def picture(self, view: int) -> str:
        """What a view is called."""
        return self.pictures[view] if view < len(self.pictures) else f"view {view + 1}"


@dataclass(frozen=True)
class EpipolarPairsView(ViewChooser):
    """Every shared view's distance from its epipolar lines, and the chosen view's two pictures with some of the lines.

    Arrows lead from its line towards each corner, `scale` times as long. The arrow along the first row tells in which
    order the corners were found: it must start at the same corner of the board in both.
    """

    title: ClassVar[str] = "Epipolar lines, pair by pair"

    shared: SharedViews = field(compare=False, repr=False)
    view: int = slider(1, 1, 13, 1, help="which pair is shown; a click on its bar chooses it as well")
    scale: float = slider(
        50.0, 1, 300, 1, label="arrows", unit="×", help="how much longer the arrows are than the distance"
    )

    @classmethod
    def of(cls, calibration: Any, **options: Any) -> EpipolarPairsView:
        """The view of a calibrated pair, its worst view first. Raises Missing where there is none."""
        return cls.about(SharedViews.of(calibration, **options))

    @classmethod
    def about(cls, shared: SharedViews) -> EpipolarPairsView:
        """The view of the worst pair, with arrows that can be seen."""
        worst = int(np.nanargmax(shared.rms))
        typical = float(np.nanquantile(shared.distances[1], 0.9))
        per_pixel = 455 / shared.right.intrinsics.width
        return cls(
            shared, worst + 1, float(np.clip(nice(26 / (typical * per_pixel)), 1, 300)) if typical > 1e-9 else 1.0
        )

    @property
    def count(self) -> int:
        return len(self.shared)

    def description(self) -> str:
        shared, i = self.shared, self.index
        told = f"{shared.rms[i]:.3g} px" if np.isfinite(shared.rms[i]) else "not seen by both"
        return (
            f"{np.isfinite(shared.rms).sum()} views that {' and '.join(shared.names)} share, "
            f"{shared.total_rms:.3g} px RMS off their "
            f"epipolar lines. Shown: {shared.picture(i)}: {told}. Arrows {self.scale:g} times as long as the distance."
        )

    def figure(self, *, draft: bool = False) -> Picture:
        parts, attached = {"distances": self._bars_panel()}, dict[str, bytes]()
        for side, camera in enumerate((self.shared.left, self.shared.right)):
            parts[("left", "right")[side]], pictures = self._side(side, camera)
            attached |= pictures
        words = (
            "Green: the line on which the other picture puts a corner. Blue arrow: the first row, from the first "
            "corner on."
        )
        return self.tiled(_LAYOUT, parts | {"in words": Sentences(words)}, attached)

    @property
    def _bars(self) -> Panel:
        return plot.plot_panel("pairs", 70, 34, 870, 110, (0.5, len(self.shared) + 0.5), (0, ceiling(self.shared.rms)))

    def _bars_panel(self) -> Marks:
        shared, panel = self.shared, self._bars
        content = plot.grid(panel, xticks=[]) + bars_of(panel, shared.rms, self.index)
        content += plot.level(panel, shared.total_rms, "ink dashed") + figures_on(panel, shared.rms)
        ticks = names_below(short_names(shared.pictures, len(shared)))
        label, title = LABEL.replace("per view", "per shared view"), "Distance from the epipolar lines"
        shown = panel.show(content, title=title, drag="bars", hint="click a bar", label=label)
        return shown + plot.axes(panel, "", "RMS [px]", xticks=ticks)

    def _side(self, side: int, camera: Camera) -> Drawn:
        shared, i, k = self.shared, self.index, camera.intrinsics
        panel = image_panel(shared.names[side], 20 + 470 * side, 206, 450, k.width, k.height, tallest=350)
        image = shared.photographs[side](i)
        content, attached = svg.NOTHING, {}
        if image is not None:
            name = f"pair{side}"
            content, attached = placed_image(panel, name, k.width, k.height), {name: jpeg(image)}
        content += self._lines(panel, side)
        corners, offsets = shared.detections[side][i], shared.offsets[side][i]
        starts, on_line = panel.place(corners), corners - offsets
        content += arrows(panel.place(on_line), panel.place(on_line + self.scale * offsets), "orange")
        content += svg.dots(starts, "paper-dot", 6) + svg.dots(starts, "red", 4)
        row = starts[: shared.columns][np.isfinite(starts[: shared.columns, 0])]
        if len(row) > 1:
            content += arrows(row[:1], row[-1:], "blue thick", 12) + svg.text(
                row[0] + (-4, -10), "1", "blue halo middle"
            )
        content += not_at_hand(panel) if image is None and shared.pictures else svg.NOTHING
        return panel.show(content, title=f"{shared.names[side]}: arrows × {self.scale:g}"), attached

    def _lines(self, panel: Panel, side: int) -> Marks:
        """The other picture's rays of a few corners, as this camera sees them."""
        shared, i = self.shared, self.index
        cameras = (shared.left, shared.right)
        count = shared.detections[0].shape[1]
        chosen = np.unique(np.linspace(0, count - 1, 8).astype(int))
        other = shared.detections[1 - side][i][chosen]
        other = other[np.isfinite(other[:, 0])]
        if not len(other):
            return NOTHING
        curves = twoview.epipolar_curve(cameras[1 - side], cameras[side], other, _DISTANCES)
        return on_photograph(clipped(panel, panel.place(curves)), "green thin")


def pair_of(calibration: Calibration) -> tuple[Camera, Camera]:
    """The first two cameras of a calibration. Raises Missing where there are none, or not in two places."""
    cameras = list(calibration.cameras.values())[:2]
    if len(cameras) < 2:
        raise Missing("The file holds one camera; this needs a pair.")
    if not np.linalg.norm(cameras[1].centre - cameras[0].centre) > 0:
        raise Missing("The file does not say how one camera stands to the other.")
    return cameras[0], cameras[1]


def _from_line(lines: Array, uv: Array) -> Array:
    """From the nearest point of normalised lines (..., 3) to points (..., 2)."""
    signed = np.sum(lines * twoview.to_homogeneous(uv), axis=-1, keepdims=True)
    return signed * lines[..., :2]
