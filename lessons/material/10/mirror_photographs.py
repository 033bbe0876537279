"""What the camera under a mirror photographs of the garden, ray by ray."""

from __future__ import annotations

from functools import lru_cache

import numpy as np

from camviz.panoramas.mirrors import Catadioptric
from camviz.panoramas.mirrors import photograph as photographed
from camviz.poses import RigidTransform, Rotation
from camviz.scenes import textured_scene, to_display
from camviz_school.views.mirror_drawings import picture_pixels

UP = RigidTransform.from_rotation(Rotation.from_euler("x", -90, degrees=True))


@lru_cache(maxsize=2)
def traced(rig: Catadioptric, side: int) -> np.ndarray:
    """The garden in the mirror (side, side, 3), every ray followed from where it leaves the mirror."""
    return to_display(photographed(textured_scene(), rig, picture_pixels(side, rig.rim()), UP))
