"""What the writers share: what a format asks of a calibration, and text with all digits."""

from __future__ import annotations

import json
from typing import Any

import numpy as np
import yaml

from camviz.calibration.types import Calibration, CalibrationError
from camviz.cameras import Camera
from camviz.poses import RigidTransform


def only_camera(calibration: Calibration, title: str) -> tuple[str, Camera]:
    """The name and camera of a calibration of one; CalibrationError where there are more."""
    if len(calibration.cameras) > 1:
        names = ", ".join(list(calibration.cameras)[:4]) + ", …" * (len(calibration.cameras) > 4)
        raise CalibrationError(
            f"{title} holds one camera, this calibration has {len(calibration.cameras)}: choose one of {names} "
            "(--camera NAME)"
        )
    return next(iter(calibration.cameras.items()))


def refuse_own_world(calibration: Calibration, title: str) -> None:
    """CalibrationError unless the first camera's frame is the world, in formats that know no other."""
    name, first = next(iter(calibration.cameras.items()))
    if not np.allclose(first.world_from_cam.as_matrix(), np.eye(4), rtol=0, atol=1e-12):
        place = ", ".join(f"{x:.3g}" for x in first.centre)
        raise CalibrationError(
            f"{title} has no world but its first camera's frame, and {name} stands at ({place}) or is turned: "
            "make its frame the world (--first-as-world)"
        )


def as_yaml(tree: dict[str, Any]) -> bytes:
    """YAML with lists of numbers in one line."""
    return yaml.safe_dump(tree, default_flow_style=None, sort_keys=False, width=1000, allow_unicode=True).encode()


def as_json(tree: dict[str, Any]) -> bytes:
    return (json.dumps(tree, indent=2, ensure_ascii=False) + "\n").encode()


def rows_of(pose: RigidTransform) -> list[list[float]]:
    """A pose as the four rows of its matrix."""
    return [list(map(float, row)) for row in pose.as_matrix()]
