"""The garden all round from one place: a picture in which what a camera sees from there is looked up."""

from __future__ import annotations

from functools import lru_cache

import cv2
import numpy as np
from numpy.typing import NDArray

from camviz.cameras import Camera, Intrinsics
from camviz.lenses import Equirectangular
from camviz.poses import RigidTransform
from camviz.scenes.scene import snapshot
from camviz.scenes.standard import opened, textured_scene

Place = tuple[float, ...]
ORIGIN: Place = (0.0, 0.0, 0.0)
KEPT = "around"
"""The picture from the origin, where most views begin, as `camviz.scenes.bake` has traced it: tracing takes 0.1 s."""


@lru_cache(maxsize=2)
def all_round(place: Place) -> tuple[Camera, NDArray[np.uint8]]:
    """A camera at the origin that sees every way, and the picture it takes at a place, its edges joined behind it."""
    picture = opened(KEPT) if place == ORIGIN else traced_all_round(place)
    height, width = picture.shape[:2]
    intrinsics = _intrinsics(width).cropped(-1, -1, width + 2, height + 2)
    joined = cv2.copyMakeBorder(picture, 1, 1, 1, 1, cv2.BORDER_WRAP)
    return Camera(intrinsics, Equirectangular()), np.asarray(joined, dtype=np.uint8)


def traced_all_round(place: Place) -> NDArray[np.uint8]:
    """The picture, sRGB bytes (height, 2 · height, 3); a little coarser from places other than the origin."""
    camera = Camera(_intrinsics(1024 if place == ORIGIN else 768), Equirectangular())
    return snapshot(textured_scene(), camera.at(RigidTransform.from_translation(place)))


def _intrinsics(width: int) -> Intrinsics:
    f, height = width / (2 * np.pi), width // 2
    return Intrinsics(width, height, f, f, (width - 1) / 2, (height - 1) / 2)
