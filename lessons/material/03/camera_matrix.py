"""The state of the intrinsics visualizer: nine numbers, what is done to their picture, and the camera they make."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any, Self

import numpy as np

from camviz.cameras import Camera, Intrinsics
from camviz.lenses.base import Array, unit
from camviz.poses import RigidTransform
from camviz.views.base import Control, OrbitView, choice, slider, switch
from camviz_school.views.balloon import balloon_in_sight

GLOBE, GLOBE_RADIUS = np.array([0.68, 0.36, 3.3]), 0.27  # in the world; the camera stands before it on the z axis
BINS = 4
_NEAREST, _FARTHEST = 1.5, 12.0  # metres between camera and globe
_FOCAL: dict[str, Any] = {"low": 150.0, "high": 2000.0, "step": 1.0, "unit": "px"}


@dataclass(frozen=True)
class CameraMatrix(OrbitView):
    """Nine numbers, and the camera before the garden's globe that they make.

    The camera looks along z, `distance` metres in front of the globe. `focal_px`, `focal_mm` and `aspect` are no state
    of their own: they are read from fx, fy and the pixel pitch, and setting them with `but` sets fx and fy.
    """

    fx: float = slider(450.0, **_FOCAL, help="focal length in widths of a pixel")
    fy: float = slider(450.0, **_FOCAL, help="focal length in heights of a pixel")
    cx: float = slider(319.5, -100.0, 740.0, 0.5, unit="px", help="column of the principal point")
    cy: float = slider(239.5, -100.0, 580.0, 0.5, unit="px", help="row of the principal point")
    skew: float = slider(0.0, -150.0, 150.0, 1.0, unit="px", help="shear of the pixel axes; 0 in nearly every camera")
    distance: float = slider(3.0, _NEAREST, _FARTHEST, 0.05, unit="m", help="from the camera to the globe")
    dolly_zoom: bool = switch(False, label="dolly-zoom lock", help="move the camera so that the globe keeps its size")
    operation: str = choice("as taken", "cropped", "resized", "binned", help="what is done to the picture afterwards")
    x0: float = slider(256, 0, 320, 1, label="crop x0", unit="px", help="first column kept")
    y0: float = slider(96, 0, 240, 1, label="crop y0", unit="px", help="first row kept")
    scale: float = slider(0.5, 0.1, 2.0, 0.05, label="resize by", help="new width divided by old width")
    pitch_um: float = slider(6.0, 1.0, 12.0, 0.1, label="pixel width", unit="µm", help="K does not know it")
    width: int = 640
    height: int = 480

    @classmethod
    def of(cls, camera: Camera, **state: Any) -> Self:
        """The view of a given camera's intrinsics, taking its picture in the garden; further fields by name."""
        K = camera.intrinsics
        return cls(K.fx, K.fy, K.cx, K.cy, K.skew, width=K.width, height=K.height, **state)

    @classmethod
    def controls(cls) -> dict[str, Control]:
        """The fields' controls, and those of the three readings that can be set."""
        zoom = Control("focal length", "px", _FOCAL["low"], _FOCAL["high"], 1.0, help="fx and fy together")
        lens = Control("focal length", "mm", 0.9, 12.0, 0.01, help="the lens: fx and fy together")
        shape = Control("pixel aspect", "", 0.5, 2.0, 0.01, help="width of a pixel / its height = fy / fx")
        return {**super().controls(), "focal_px": zoom, "focal_mm": lens, "aspect": shape}

    @property
    def focal_px(self) -> float:
        """Focal length in widths of a pixel, by which one zooms."""
        return self.fx

    @property
    def focal_mm(self) -> float:
        """Focal length in millimetres, which takes the width of a pixel to know."""
        return self.fx * self.pitch_um / 1000

    @property
    def aspect(self) -> float:
        """The width of a pixel divided by its height: fy / fx."""
        return self.fy / self.fx

    def but(self, **changes: Any) -> Self:
        """The same view with some fields changed; a focal length and `aspect` change fx and fy, the lock the rest."""
        controls = self.controls()
        for name in changes.keys() & {"focal_px", "focal_mm", "aspect"}:
            controls[name].checked(name, changes[name])
        zoom = changes.pop("focal_mm", self.focal_mm) / self.focal_mm * changes.pop("focal_px", self.fx) / self.fx
        aspect = changes.pop("aspect", None)
        changes = {"fx": zoom * self.fx, "fy": zoom * self.fy, **changes} if zoom != 1 else changes
        if aspect is not None:
            changes["fy"] = aspect * changes.get("fx", self.fx)
        changed = super().but(**changes)
        return self._locked(changed) if changed.dolly_zoom and aspect is None else changed

    def _locked(self, changed: Self) -> Self:
        """fx / distance stays: whichever of the two was changed, the other follows, within the garden."""
        wanted = changed.distance / self.distance
        if wanted == 1:
            wanted = changed.fx / self.fx if changed.fx != self.fx else changed.fy / self.fy
        if wanted == 1:
            return changed
        distance = min(max(wanted * self.distance, _NEAREST), _FARTHEST)
        zoom = distance / self.distance
        return replace(changed, distance=distance, fx=zoom * self.fx, fy=zoom * self.fy)

    @cached_property
    def taken(self) -> Intrinsics:
        """The intrinsics of the picture as it was taken."""
        return Intrinsics(self.width, self.height, self.fx, self.fy, self.cx, self.cy, self.skew)

    @cached_property
    def intrinsics(self) -> Intrinsics:
        """The intrinsics of the picture after the operation."""
        K = self.taken
        if self.operation == "cropped":
            return K.cropped(*self._corner, K.width // 2, K.height // 2)
        if self.operation == "resized":
            return K.resized(max(1, round(self.scale * K.width)), max(1, round(self.scale * K.height)))
        return K.binned(BINS) if self.operation == "binned" else K

    @property
    def _corner(self) -> tuple[int, int]:
        """The first pixel that a crop keeps."""
        column = min(max(round(self.x0), 0), self.width - self.width // 2)
        return column, min(max(round(self.y0), 0), self.height - self.height // 2)

    @property
    def _pose(self) -> RigidTransform:
        return RigidTransform.from_translation([0, 0, GLOBE[2] - self.distance])

    @cached_property
    def camera(self) -> Camera:
        """The camera, with the intrinsics of the picture after the operation."""
        return Camera(self.intrinsics, world_from_cam=self._pose)

    def field_of_view_deg(self) -> tuple[float, float]:
        """The angles from edge to edge of the picture along the row and the column of the principal point."""
        K = self.intrinsics
        row = np.array([(-0.5, K.cy), (K.width - 0.5, K.cy)])
        column = np.array([(K.cx, -0.5), (K.cx, K.height - 0.5)])
        return _angle_deg(*self.camera.unproject(row)), _angle_deg(*self.camera.unproject(column))

    def axes_angle_deg(self) -> float:
        """The angle between the rows and the columns of pixels on the sensor."""
        corner, along_u, along_v = self.intrinsics.from_pixels([(0, 0), (1, 0), (0, 1)])
        return _angle_deg(unit(along_u - corner), unit(along_v - corner))

    def in_sight(self) -> float:
        """The share of the balloon that nothing stands before: a matter of the camera's place, not of K."""
        return balloon_in_sight(self.camera.centre)

    def rule(self) -> str:
        """What the operation does to K, with its numbers; "" for a picture as taken."""
        (x0, y0), s = self._corner, self.intrinsics.width / self.width
        return {
            "as taken": "",
            "cropped": f"c′ = c − ({x0}, {y0}); f and skew stay",
            "resized": f"f′ = {s:g} f,  c′ = {s:g} c {added((s - 1) / 2)}",
            "binned": f"f′ = f / {BINS},  c′ = c / {BINS} {added((s - 1) / 2)}",
        }[self.operation]


def added(value: float) -> str:
    """A summand with its sign: + 0.5, − 12.00."""
    number = f"{abs(value):.4f}".rstrip("0").rstrip(".") if abs(value) < 1 else f"{abs(value):.2f}"
    return f"{'−' if value < 0 else '+'} {number}"


def _angle_deg(a: Array, b: Array) -> float:
    """Between unit vectors, accurate for small angles too (Kahan)."""
    return float(np.degrees(2 * np.arctan2(np.linalg.norm(a - b), np.linalg.norm(a + b))))
