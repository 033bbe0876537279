"""Patterns that residuals may follow: smooth over the image, or bent with the board."""

from __future__ import annotations

import numpy as np

from camviz.lenses.base import Array
from camviz_clinic.calibration.adjustment import Adjustment
from camviz_clinic.calibration.jacobian import pixel_jacobian
from camviz_clinic.calibration.linearisation import sagittas

DEGREE = 5  # of the smooth field over the image, in u and in v
FARTHER = (7, 9, 11)  # powers of the radius beyond it


def smooth_field(adjustment: Adjustment, name: str) -> Array:
    """Vector fields (views, corners, 2, f): polynomials of u and v up to a degree, and higher powers of the radius."""
    grid = adjustment.cameras[name].intrinsics
    centred = adjustment.projected(name) - [grid.cx, grid.cy]  # the detections' noise must not explain itself
    x, y = np.moveaxis(centred / np.hypot(grid.width, grid.height) * 2, -1, 0)
    terms = [x**i * y**j for i in range(DEGREE + 1) for j in range(DEGREE + 1 - i)]
    zero = np.zeros_like(x)
    columns = [np.stack(pair, axis=-1) for term in terms for pair in ((term, zero), (zero, term))]
    columns += [np.stack([x, y], axis=-1) * np.hypot(x, y)[..., None] ** (power - 1) for power in FARTHER]
    return np.nan_to_num(np.stack(columns, axis=-1))


def warp_columns(adjustment: Adjustment, name: str) -> Array:
    """∂pixel/∂(the board's two sagittas), (views, corners, 2, 2)."""
    camera = adjustment.cameras[name]
    points = np.stack([pose.apply(adjustment.corners) for pose in adjustment.first_from_board])
    _, by_point, _ = pixel_jacobian(camera, points, ())
    normals = adjustment.first_from_board.rotation.as_matrix()[:, None, :, 2:]
    return np.nan_to_num((by_point @ normals) * sagittas(adjustment.board)[:, None, :])
