"""The two pictures of a pair as rectification makes them: what belongs together must lie in one row."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from functools import cached_property, lru_cache
from typing import Any, ClassVar

import cv2
import numpy as np
from numpy.typing import NDArray

from camviz import twoview
from camviz.cameras import Camera
from camviz.draw import svg
from camviz.draw.flow import Part, Sentences, rows
from camviz.draw.marks import Marks
from camviz.draw.panel import Panel, image_panel, placed_image
from camviz.draw.picture import Picture, jpeg
from camviz.lenses.base import Array
from camviz.poses import RigidTransform
from camviz.views import garden
from camviz.views.base import Control, slider
from camviz.views.marks import on_photograph
from camviz.views.view_bars import ViewChooser
from camviz_clinic.views.observations import Missing
from camviz_clinic.views.pairs import SharedViews, pair_of

_SIDE = 480
_STAND = RigidTransform.from_translation([-0.4, 0.0, 0.0])  # of the left camera in the garden


@dataclass(frozen=True)
class RectifiedView(ViewChooser):
    """A pair's two pictures after rectification, with rows across both, and how far apart the rows of corners are.

    Without photographs the pair stands in the virtual garden. `shared` holds the corners, where there are any.
    """

    title: ClassVar[str] = "Rectified"

    left: Camera = field(repr=False)
    right: Camera = field(repr=False)
    shared: SharedViews | None = field(default=None, compare=False, repr=False)
    view: int = slider(1, 1, 13, 1, help="which pair of pictures is shown")
    rows: int = slider(12, 2, 40, 1, label="lines", help="how many rows are drawn across both pictures")

    @classmethod
    def of(cls, calibration: Any, **options: Any) -> RectifiedView:
        """The view of a calibrated pair. Raises Missing where there is none."""
        left, right = pair_of(calibration)
        try:
            shared: SharedViews | None = SharedViews.of(calibration, **options)
        except Missing:
            shared = None
        return cls(left, right, shared)

    def offered(self) -> dict[str, Control]:
        return super().offered() if self.count > 1 else {"rows": self.controls()["rows"]}

    @property
    def count(self) -> int:
        return len(self.shared) if self.shared else 1

    @cached_property
    def pair(self) -> twoview.RectifiedPair | str:
        """The rectified pair, or in words why there is none."""
        try:
            return twoview.rectify(self.left, self.right)
        except ValueError as error:
            return f"The pair cannot be rectified: {error}."

    @cached_property
    def row_differences(self) -> Array | None:
        """v_left − v_right (views, corners) in rectified pixels; None without corners or without a rectified pair."""
        if self.shared is None or isinstance(self.pair, str):
            return None
        pair = self.pair
        left, right = (
            turned.project(turned.centre + camera.unproject(uv))
            for turned, camera, uv in zip(
                (pair.left, pair.right), (self.left, self.right), self.shared.detections, strict=True
            )
        )
        return left[..., 1] - right[..., 1]

    def sentences(self) -> list[str]:
        """What can be said of the pair, in words."""
        if isinstance(self.pair, str):
            return [self.pair]
        told = [f"f = {self.pair.focal_length:.1f} px, baseline {self.pair.baseline:.4g} m."]
        if self.row_differences is not None:
            d = self.row_differences
            told.append(
                f"Corners of one view are {np.sqrt(np.nanmean(d**2)):.3g} px RMS apart in their rows over all "
                f"views; here {_rms(d[self.index])}."
            )
        else:
            told.append("The file holds no corners of shared views, so only the picture can be judged.")
        empty = self._empty
        if empty > 0.4:
            told.append(
                f"{100 * empty:.0f} % of the two pictures is black: the cameras may be swapped, or a lens folds."
            )
        return told

    @cached_property
    def _empty(self) -> float:
        """The share of the rectified pictures behind which the originals have nothing."""
        if isinstance(self.pair, str):
            return 1.0
        step = max(1, self.left.intrinsics.width // 80)
        missing = []
        for turned, camera in ((self.pair.left, self.left), (self.pair.right, self.right)):
            uv = turned.intrinsics.within(turned.intrinsics.width // step).grid() * step
            missing.append(~camera.intrinsics.contains(camera.project(camera.centre + turned.unproject(uv))))
        return float(np.mean(missing))

    def description(self) -> str:
        return " ".join(self.sentences())

    def figure(self, *, draft: bool = False) -> Picture:
        parts, attached, bottom = dict[str, Part](), {}, 34.0
        for side, camera in enumerate((self.left, self.right)):
            turned = camera if isinstance(self.pair, str) else (self.pair.left, self.pair.right)[side]
            k = turned.intrinsics
            panel = image_panel(f"rectified {side}", 15 + 480 * side, 34, 450, k.width, k.height, tallest=380)
            name = f"rectified{side}"
            title = f"{('left', 'right')[side]}, {'as taken' if turned is camera else 'rectified'}"
            content = placed_image(panel, name, k.width, k.height) + self._marks(panel, side, turned, camera)
            parts[("left", "right")[side]] = panel.show(content, title=title)
            attached[name] = jpeg(self._rectified(side, turned, camera, 240 if draft else _SIDE))
            bottom = max(bottom, panel.y + panel.height)
        parts["in words"] = Sentences("\n".join(self.sentences()))
        said = (10 + 20 * len(self.sentences()), {"in words": 960.0})
        return self.tiled(rows((bottom + 10, {"left": 480, "right": 480}), said), parts, attached)

    def _rectified(self, side: int, turned: Camera, camera: Camera, size: int) -> NDArray[np.uint8]:
        source = replace(camera, intrinsics=camera.intrinsics.within(size))
        taken = self._taken(side, source)
        if turned is camera:
            return taken
        return cv2.remap(taken, *_maps(self.left, self.right, side, size), cv2.INTER_LINEAR)

    def _taken(self, side: int, source: Camera) -> NDArray[np.uint8]:
        image = self.shared.photographs[side](self.index) if self.shared else None
        if image is None:
            in_garden = _STAND * self.left.cam_from_world * source.world_from_cam
            return garden.taken(source.at(in_garden), max(source.intrinsics.width, source.intrinsics.height))[0]
        return cv2.resize(image, (source.intrinsics.width, source.intrinsics.height), interpolation=cv2.INTER_AREA)

    def _marks(self, panel: Panel, side: int, turned: Camera, camera: Camera) -> Marks:
        k = turned.intrinsics
        rows = (np.arange(round(self.rows)) + 0.5) * k.height / round(self.rows) - 0.5
        content = on_photograph([panel.place([(-0.5, v), (k.width - 0.5, v)]) for v in rows], "sky thin")
        if self.shared is not None and self.shared.photographs[side](self.index) is not None:
            uv = turned.project(turned.centre + camera.unproject(self.shared.detections[side][self.index]))
            content += svg.dots(panel.place(uv), "paper-dot", 6) + svg.dots(panel.place(uv), "red", 4)
        return content


@lru_cache(maxsize=8)
def _maps(left: Camera, right: Camera, side: int, size: int) -> tuple[NDArray[np.float32], NDArray[np.float32]]:
    """The pixels behind those of a rectified picture whose longer side has `size`; kept while the view changes."""
    pair = twoview.rectify(left, right)
    turned, camera = (pair.left, left) if side == 0 else (pair.right, right)
    small, source = (replace(c, intrinsics=c.intrinsics.within(size)) for c in (turned, camera))
    uv = source.project(source.centre + small.rays()).astype(np.float32)
    return np.ascontiguousarray(uv[..., 0]), np.ascontiguousarray(uv[..., 1])


def _rms(values: Array) -> str:
    return f"{np.sqrt(np.nanmean(values**2)):.3g} px" if np.isfinite(values).any() else "not seen by both"
