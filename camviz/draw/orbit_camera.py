"""The onlooker's camera, which one walks around what it looks at."""

from __future__ import annotations

from dataclasses import dataclass, replace
from math import cos, exp, radians, sin, tan

import numpy as np

from camviz.cameras import Camera, Intrinsics, look_at
from camviz.lenses.arrays import Count


@dataclass(frozen=True)
class OrbitCamera:
    """The onlooker, who looks at a target and can walk around it.

    At yaw 0 and pitch 0 it looks along z, as a camera in the identity pose does; pitch raises it above the target.

    Args:
        target: What it looks at, in metres.
        distance: From the target, in metres.
        yaw_deg, pitch_deg: Where it stands, in degrees; the pitch from -89 to 89.
        vfov_deg: Vertical field of view in degrees.

    Raises: ValueError for a distance that is not positive, and angles out of range.

    >>> OrbitCamera(distance=4, yaw_deg=0, pitch_deg=0).camera(200, 100).centre  # 4 m before the origin
    array([ 0.,  0., -4.])
    """

    target: tuple[float, float, float] = (0.0, 0.0, 0.0)
    distance: float = 5.0
    yaw_deg: float = 30.0
    pitch_deg: float = 20.0
    vfov_deg: float = 35.0

    def __post_init__(self) -> None:
        if not self.distance > 0:
            raise ValueError(f"distance must be a positive number of metres, got {self.distance}")
        if not 0 < self.vfov_deg < 180:
            raise ValueError(f"vfov_deg must lie between 0 and 180 degrees, got {self.vfov_deg}")
        if not -89 <= self.pitch_deg <= 89:
            raise ValueError(f"pitch_deg must lie between -89 and 89 degrees, got {self.pitch_deg}")

    def camera(self, width: Count, height: Count) -> Camera:
        """The pinhole camera through which it sees."""
        yaw, pitch = radians(self.yaw_deg), radians(self.pitch_deg)
        outward = np.array([-sin(yaw) * cos(pitch), -sin(pitch), -cos(yaw) * cos(pitch)])
        f = height / (2 * tan(radians(self.vfov_deg) / 2))
        intrinsics = Intrinsics(width, height, f, f, (width - 1) / 2, (height - 1) / 2)
        return Camera(intrinsics, world_from_cam=look_at(self.target + self.distance * outward, self.target))

    def orbited(self, dx: float, dy: float) -> OrbitCamera:
        """After a drag: what is near follows the pointer.

        Args:
            dx, dy: The drag in picture units.

        Returns: 0.4° further for each unit.
        """
        yaw = (self.yaw_deg + 0.4 * dx + 180) % 360 - 180
        return replace(self, yaw_deg=yaw, pitch_deg=min(85.0, max(-85.0, self.pitch_deg + 0.4 * dy)))

    def zoomed(self, steps: float) -> OrbitCamera:
        """Nearer by a tenth for every positive step.

        Args:
            steps: How many; negative ones lead away.
        """
        return replace(self, distance=min(1e4, max(0.05, self.distance * exp(-0.1 * steps))))

    def key(self, key: str) -> OrbitCamera:
        """After a key: arrows walk around by 5°, + and - (or page up and down) walk nearer and back.

        Args:
            key: As browsers name it.

        Returns: The same for another key.
        """
        turns = {"ArrowLeft": (-12.5, 0), "ArrowRight": (12.5, 0), "ArrowUp": (0, -12.5), "ArrowDown": (0, 12.5)}
        steps = {"+": 1, "=": 1, "PageUp": 1, "-": -1, "_": -1, "PageDown": -1}
        if key in turns:
            return self.orbited(*turns[key])
        return self.zoomed(steps[key]) if key in steps else self
