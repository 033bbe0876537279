"""A picture and the same undistorted, between cutting it down to what is full and keeping every pixel."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any, ClassVar

import cv2
import numpy as np
from numpy.typing import NDArray

from camviz import distortion
from camviz.cameras import Camera, Intrinsics
from camviz.draw import svg
from camviz.draw.flow import Part, Sentences, rows
from camviz.draw.marks import NOTHING, Marks
from camviz.draw.panel import Panel, image_panel, placed_image
from camviz.draw.picture import Picture, jpeg
from camviz.lenses.base import on_plane
from camviz.views import garden
from camviz.views.base import View, slider, switch
from camviz.views.marks import on_photograph

_SIDE = 480


@dataclass(frozen=True)
class UndistortedView(View):
    """What cv2.getOptimalNewCameraMatrix and cv2.undistort make of a picture, for every alpha.

    `image` (height, width, 3) uint8 is the camera's picture; without one it sees the virtual garden.
    """

    title: ClassVar[str] = "Undistorted"

    camera: Camera = field(repr=False)
    name: str = "camera"
    alpha: float = slider(0.0, 0, 1, 0.01, help="0: no black borders; 1: every pixel of the photograph is kept")
    lines: bool = switch(True, label="straight lines", help="a grid that is straight in the undistorted picture")
    image: NDArray[np.uint8] | None = field(default=None, compare=False, repr=False)

    @classmethod
    def of(cls, calibration: Any, camera: str = "", image: NDArray[np.uint8] | None = None) -> UndistortedView:
        """The view of a camera of a calibration, the first unless named."""
        name = camera or next(iter(calibration.cameras))
        return cls(calibration.cameras[name], name, image=image)

    def target(self) -> tuple[Intrinsics, tuple[int, int, int, int]] | str:
        """The undistorted picture's intrinsics and the rectangle without black, or in words why there is none."""
        try:
            return distortion.undistorted_intrinsics(self.camera, self.alpha)
        except ValueError as error:
            return f"This picture cannot be undistorted: {error}."

    def description(self) -> str:
        found = self.target()
        if isinstance(found, str):
            return found
        k, (x0, y0, width, height) = found
        share = 100 * width * height / (k.width * k.height)
        return (
            f"{self.name} at alpha = {self.alpha:g}: new fx = {k.fx:.1f}, fy = {k.fy:.1f}, cx = {k.cx:.1f}, cy = "
            f"{k.cy:.1f}; the "
            f"rectangle without black starts at ({x0}, {y0}) and is {width} × {height} pixels, {share:.0f}\u00a0% of "
            "the picture."
        )

    def figure(self, *, draft: bool = False) -> Picture:
        k = self.camera.intrinsics
        before = image_panel("before", 15, 34, 450, k.width, k.height, tallest=360)
        after = image_panel("after", 495, 34, 450, k.width, k.height, tallest=360)
        small = Camera(k.within(256 if draft else _SIDE), self.camera.lens)
        taken = self._taken(small)
        found, attached = self.target(), {"before": jpeg(taken)}
        shown = before.show(
            placed_image(before, "before", k.width, k.height) + self._bent(before, found),
            title=f"{self.name}: as taken",
        )
        if isinstance(found, str):
            straightened = after.show(svg.paragraph((16, 34), found, after.width - 30, "label"), title="Undistorted")
        else:
            target, roi = found
            straight = distortion.remap(
                taken, distortion.undistort_maps(small, target.resized(small.intrinsics.width, small.intrinsics.height))
            )
            attached["after"] = jpeg(straight)
            content = placed_image(after, "after", k.width, k.height) + self._straight(after) + _rectangle(after, roi)
            straightened = after.show(
                content, title=f"Undistorted, alpha = {self.alpha:g}", note="yellow: without black"
            )
        both = {"as taken": 480.0, "undistorted": 480.0}
        layout = rows((max(before.height, after.height) + 44, both), (38, {"in words": 960}))
        parts: dict[str, Part] = {
            "as taken": shown,
            "undistorted": straightened,
            "in words": Sentences(self.description()),
        }
        return self.tiled(layout, parts, attached)

    def _taken(self, small: Camera) -> NDArray[np.uint8]:
        if self.image is None:
            return garden.taken(small, max(small.intrinsics.width, small.intrinsics.height))[0]
        return cv2.resize(self.image, (small.intrinsics.width, small.intrinsics.height), interpolation=cv2.INTER_AREA)

    def _straight(self, panel: Panel) -> Marks:
        return on_photograph(panel.place(_grid(self.camera.intrinsics)), "sky thin") if self.lines else NOTHING

    def _bent(self, panel: Panel, found: tuple[Intrinsics, tuple[int, int, int, int]] | str) -> Marks:
        """The grid of the undistorted picture where it lies in the photograph."""
        if isinstance(found, str) or not self.lines:
            return NOTHING
        rays = on_plane(found[0].from_pixels(_grid(self.camera.intrinsics)))
        bent = self.camera.intrinsics.to_pixels(self.camera.lens.project(rays))
        return on_photograph(panel.place(bent), "sky thin")


def _grid(k: Intrinsics) -> NDArray[np.float64]:
    """Straight lines (n, 49, 2) in pixels of a picture."""
    u, v = np.linspace(-0.5, k.width - 0.5, 49), np.linspace(-0.5, k.height - 0.5, 49)
    rows = [np.stack([u, np.full(49, y)], -1) for y in np.linspace(-0.5, k.height - 0.5, 7)[1:-1]]
    columns = [np.stack([np.full(49, x), v], -1) for x in np.linspace(-0.5, k.width - 0.5, 9)[1:-1]]
    return np.array(rows + columns)


def _rectangle(panel: Panel, roi: tuple[int, int, int, int]) -> Marks:
    x0, y0, width, height = roi
    corners = np.array([(x0, y0), (x0 + width, y0), (x0 + width, y0 + height), (x0, y0 + height), (x0, y0)]) - 0.5
    return on_photograph([panel.place(corners)], "yellow thick")
