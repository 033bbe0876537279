"""Two cameras and points before them, for the tests of two-view geometry."""

from dataclasses import dataclass

import numpy as np
from hypothesis import strategies as st
from scipy.spatial.transform import RigidTransform, Rotation

from camviz.cameras import Camera, Intrinsics
from camviz.lenses import Lens

LEFT_PIXELS = Intrinsics(640, 480, 520.0, 540.0, 300.0, 250.0, skew=1.5)
RIGHT_PIXELS = Intrinsics(800, 600, 610.0, 600.0, 410.0, 290.0)


@dataclass(frozen=True)
class Equidistant(Lens):
    """r = θ: enough of a fisheye to hold what is said of any lens."""

    def image(self, x, y, z):
        r = np.hypot(x, y)
        scale = np.where(r > 0, np.arctan2(r, z) / np.where(r > 0, r, 1), 1 / z)
        return x * scale, y * scale

    def ray(self, x, y):
        theta = np.hypot(x, y)
        return x * np.sinc(theta / np.pi), y * np.sinc(theta / np.pi), np.cos(theta)


def stereo(lens=None, baseline=(0.5, 0.05, -0.08), turn=(0.03, -0.12, 0.05)):
    """A generic rig: other intrinsics on either side, a little verged, standing askew in the world."""
    world_from_left = RigidTransform.from_components([2, -1, 3], Rotation.from_rotvec([0.2, -0.4, 0.1]))
    left_from_right = RigidTransform.from_components(baseline, Rotation.from_rotvec(turn))
    lens = {} if lens is None else {"lens": lens}
    left = Camera(LEFT_PIXELS, world_from_cam=world_from_left, **lens)
    return left, Camera(RIGHT_PIXELS, world_from_cam=world_from_left * left_from_right, **lens)


def points_before(camera, rng, n=50, near=2.0, far=8.0):
    """World points (n, 3) spread over the middle of a camera's picture and over depths."""
    size = np.array([camera.intrinsics.width, camera.intrinsics.height])
    uv = size * rng.uniform(0.25, 0.75, (n, 2))
    return camera.centre + rng.uniform(near, far, (n, 1)) * camera.unproject(uv)


def seen(left, right, seed=0, n=50):
    points = points_before(left, np.random.default_rng(seed), n)
    return points, left.project(points), right.project(points)


def same_up_to_scale(A, B, tolerance):
    A, B = A / np.linalg.norm(A), B / np.linalg.norm(B)
    return min(np.abs(A - B).max(), np.abs(A + B).max()) < tolerance


def small(limit):
    return st.tuples(*[st.floats(-limit, limit)] * 3)


rigs = st.builds(
    lambda side, turn: stereo(baseline=(0.4 + abs(side[0]), side[1], side[2]), turn=turn), small(0.2), small(0.15)
)
