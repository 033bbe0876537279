"""Two cameras and a point: the state behind the epipolar visualizer, and what two-view geometry says of it."""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import cached_property
from typing import Any, Self

import numpy as np

from camviz import twoview
from camviz.cameras import Camera, Intrinsics
from camviz.lenses import BrownConrady, Equidistant, Perspective
from camviz.lenses.base import Array, unit
from camviz.poses import RigidTransform, Rotation
from camviz.scenes import textured_scene
from camviz.views import garden
from camviz.views.base import View, choice, slider, switch

_TURN: dict[str, Any] = {"low": -40.0, "high": 40.0, "step": 0.5, "unit": "°"}
_OF_THE_POINT = {"u", "v", "depth", "noise", "matches", "normalised", "truth", "eye"}  # the cameras stand still
_OF_THE_CAMERAS = {"left", "right", "baseline", "F", "your_F", "drawn"}
_STAND = RigidTransform.from_translation([-0.4, 0.0, 0.0])  # of the left camera in the garden
_CAMERAS = {
    "perspective": Camera(Intrinsics.from_fov(640, 480, 65), Perspective()),
    "barrel": Camera(Intrinsics.from_fov(640, 480, 75), BrownConrady(k1=-0.28, k2=0.07)),
    "fisheye": Camera(Intrinsics(640, 480, 240, 240, 319.5, 239.5), Equidistant()),
}


@dataclass(frozen=True)
class TwoCameras(View):
    """A point of the left picture, the right camera's pose, and the fundamental matrix, true and estimated.

    The point lies at pixel (u, v) of the left picture, `depth` metres along its ray. The right camera stands at
    (right_x, right_y, right_z) in the left one's frame and is turned by yaw about y, then pitch about x, then roll
    about z. With `noise` the fundamental matrix is estimated from `matches` points with that much error in pixels.
    `pair` replaces the two cameras (their poses are the sliders'), `photographs` (two of (height, width, 3) uint8) what
    they see.
    """

    right_x: float = slider(0.7, -1.5, 1.5, 0.01, label="right x", unit="m", help="to the right of the left camera")
    right_y: float = slider(0.0, -1.0, 1.0, 0.01, label="right y", unit="m", help="below the left camera")
    right_z: float = slider(0.0, -1.0, 1.5, 0.01, label="right z", unit="m", help="in front of the left camera")
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

    @classmethod
    def of(cls, *cameras: Camera, photographs: tuple[np.ndarray, np.ndarray] | None = None) -> Self:
        """The view of a calibrated pair, left and right, such as `of(*camviz_clinic.load(path).rig)`.

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
        middle: dict[str, Any] = {"u": (left.intrinsics.width - 1) / 2, "v": (left.intrinsics.height - 1) / 2}
        placed: dict[str, Any] = {"right_x": x, "right_y": y, "right_z": z, "yaw": yaw, "pitch": pitch, "roll": roll}
        return cls(pair=(left, right), photographs=photographs, **placed, **middle)

    def but(self, **changes: Any) -> Self:
        """The same view with some fields changed; cameras that nobody moves are kept, and what was drawn of them."""
        changed = super().but(**changes)
        if not changes.keys() - _OF_THE_POINT:
            vars(changed).update({name: made for name, made in vars(self).items() if name in _OF_THE_CAMERAS})
        return changed

    @cached_property
    def drawn(self) -> dict[Any, Any]:
        """What a view has drawn of the two cameras alone, under names of its own."""
        return {}

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
    def F(self) -> Array | None:
        """The fundamental matrix (3, 3) of unit norm; None without a baseline or where a lens bends lines."""
        if self.left.lens.is_distorted or self.right.lens.is_distorted or not self.baseline:
            return None
        F = twoview.fundamental(self.left, self.right)
        return F / np.linalg.norm(F)

    @cached_property
    def line(self) -> Array:
        """The epipolar line (3,) in the right picture; NaN where there is none."""
        return np.full(3, np.nan) if self.F is None else twoview.epipolar_lines(self.F, [self.u, self.v])

    @cached_property
    def residual(self) -> float:
        """x_rightᵀ F x_left of the chosen point; NaN without an F or an image."""
        if self.F is None:
            return float("nan")
        left, right = twoview.to_homogeneous(np.array([[self.u, self.v], self.uv_right]))
        return abs(float(right @ self.F @ left))

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
        """Points of the scene that lie in both pictures: true pixels (n, 2) in the left and in the right one.

        None in photographs, where nobody knows them.
        """
        if self.photographs is not None:
            return np.empty((0, 2)), np.empty((0, 2))
        points = garden.landmarks(self.left)
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
