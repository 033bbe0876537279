"""The garden as cameras see it: pictures kept until the camera changes, and points to match between pictures."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from functools import lru_cache
from itertools import count

import cv2
import numpy as np
from numpy.typing import NDArray

from camviz.cameras import Camera, Intrinsics
from camviz.draw.picture import jpeg
from camviz.lenses import Lens
from camviz.lenses.base import Array
from camviz.poses import RigidTransform
from camviz.scenes import snapshot, textured_scene, to_display
from camviz.scenes.all_round import ORIGIN, Place, all_round
from camviz.scenes.scene import NEUTRAL

NOTHING = (69, 69, 69)  # the grey of what a picture does not show
DRAFT, FINE = 136, 400  # pixels on the longer side; the tracer takes a fine picture at 4:3 as one block of rays

Pose = tuple[float, ...]


def taken(camera: Camera, side: int) -> tuple[np.ndarray, bytes]:
    """The picture that a camera takes of the garden, `side` pixels on its longer side, uint8 RGB, and it as JPEG."""
    return _taken(camera.intrinsics.within(side), camera.lens, _pose(camera))


def distances(camera: Camera, side: int) -> NDArray[np.float32]:
    """How far (height, width) in metres along its ray every pixel of such a picture sees; NaN in the sky."""
    return _distances(camera.intrinsics.within(side), camera.lens, _pose(camera))


def drafted(camera: Camera) -> tuple[np.ndarray, bytes]:
    """What `taken` takes as a draft; at the origin, and once the camera only turns or zooms elsewhere, a glimpse."""
    place = _place(camera)
    if place != ORIGIN and next(_drafts_from(place)) == 0:
        return taken(camera, DRAFT)
    image = glimpse(replace(camera, intrinsics=camera.intrinsics.within(DRAFT)))
    return image, jpeg(image)


@lru_cache(maxsize=1)
def _drafts_from(place: Place) -> Iterator[int]:
    """Counts the drafts taken from one place without any from another in between."""
    return count()


def glimpse(camera: Camera) -> np.ndarray:
    """What a camera sees, looked up in one all-round picture from its place: softer, in a third of the time."""
    around, picture = all_round(_place(camera))
    nothing = to_display(np.full(3, NEUTRAL, np.float32)).tolist()  # the colour of no ray
    uv = np.nan_to_num(around.project(camera.rays()), nan=-9).astype(np.float32)
    return cv2.remap(picture, uv, None, cv2.INTER_LINEAR, borderValue=nothing)


def looked_up(picture: np.ndarray, uv: Array, side: float) -> np.ndarray:
    """What a square picture, `side` pixels wide in full size, has at pixels (height, width, 2) of that size."""
    places = (np.nan_to_num(uv, nan=-9.0) + 0.5) * (picture.shape[1] / side) - 0.5
    return cv2.remap(picture, places.astype(np.float32), None, cv2.INTER_LINEAR, borderValue=NOTHING)


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


def _place(camera: Camera) -> Place:
    return tuple(camera.centre.tolist())


def _pose(camera: Camera) -> Pose:
    return tuple(camera.world_from_cam.as_matrix().ravel().tolist())


def _placed(pose: Pose) -> RigidTransform:
    return RigidTransform.from_matrix(np.reshape(pose, (4, 4)))
