"""The garden as cameras see it: pictures kept until the camera changes, and points to match between pictures."""

from __future__ import annotations

from functools import lru_cache

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import RigidTransform, Rotation

from camviz.cameras import Camera, Intrinsics
from camviz.draw.picture import jpeg
from camviz.lenses import Lens
from camviz.lenses.base import Array
from camviz.scenes import snapshot, textured_scene

Pose = tuple[float, ...]


def taken(camera: Camera, side: int) -> tuple[np.ndarray, bytes]:
    """The picture that a camera takes of the garden, `side` pixels on its longer side, uint8 RGB, and it as JPEG."""
    return _taken(camera.intrinsics.within(side), camera.lens, _pose(camera))


def distances(camera: Camera, side: int) -> NDArray[np.float32]:
    """How far (height, width) in metres along its ray every pixel of such a picture sees; NaN in the sky."""
    return _distances(camera.intrinsics.within(side), camera.lens, _pose(camera))


def landmarks(camera: Camera) -> Array:
    """Points (n, 3) of the garden's surfaces, none farther than 12 m, all over a camera's picture."""
    return _landmarks(camera.intrinsics, camera.lens, _pose(camera))


@lru_cache(maxsize=4)
def _taken(intrinsics: Intrinsics, lens: Lens, pose: Pose) -> tuple[np.ndarray, bytes]:
    image = snapshot(textured_scene(), Camera(intrinsics, lens, _placed(pose)))
    image.flags.writeable = False
    return image, jpeg(image)


@lru_cache(maxsize=4)
def _distances(intrinsics: Intrinsics, lens: Lens, pose: Pose) -> NDArray[np.float32]:
    camera = Camera(intrinsics, lens, _placed(pose))
    _, distance = textured_scene().trace(camera.centre, camera.rays())
    distance.flags.writeable = False
    return distance


@lru_cache(maxsize=4)
def _landmarks(intrinsics: Intrinsics, lens: Lens, pose: Pose) -> Array:
    camera = Camera(intrinsics, lens, _placed(pose))
    pixels = np.random.default_rng(11).uniform(0.03, 0.97, (800, 2)) * (intrinsics.width, intrinsics.height)
    rays = camera.unproject(pixels)
    _, distance = textured_scene().trace(camera.centre, rays)
    return (camera.centre + distance[:, None] * rays)[distance < 12]


def _pose(camera: Camera) -> Pose:
    return (*camera.world_from_cam.translation.tolist(), *camera.world_from_cam.rotation.as_quat().tolist())


def _placed(pose: Pose) -> RigidTransform:
    return RigidTransform.from_components(pose[:3], Rotation.from_quat(pose[3:]))
