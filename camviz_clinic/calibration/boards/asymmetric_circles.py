"""The asymmetric circle grid: every second row is shifted by half the distance of its circles.

As OpenCV counts it: `columns` circles a row, 2 `square_size` apart; rows `square_size` apart.
"""

from __future__ import annotations

import numpy as np

from camviz_clinic.calibration.boards import circles
from camviz_clinic.calibration.boards.kind import Area, Array, BoardKind, Drawing, Gray, Shape, side

DIAMETER = 0.7  # of `square_size`, where the board does not say: half the distance of two neighbours, √2 square_size


def points(shape: Shape) -> Array:
    """Row by row, those of the rows 1, 3, 5 … shifted by one `square_size`."""
    column, row = np.meshgrid(np.arange(shape.columns, dtype=float), np.arange(shape.rows, dtype=float))
    return np.stack([2 * column + row % 2, row], axis=-1).reshape(-1, 2) * shape.square_size


def find(gray: Gray, shape: Shape, finder: str) -> Array | None:
    """The projections of all circles' centres, or None."""
    from camviz_clinic.calibration.circle_grids import find_circles

    return find_circles(gray, shape, points(shape), asymmetric=True)


def area(shape: Shape) -> Area:
    return circles.around(points(shape), circles.diameter(shape, DIAMETER))


def drawn(shape: Shape) -> Drawing:
    return circles.discs(points(shape), circles.diameter(shape, DIAMETER))


def says(shape: Shape) -> str:
    return f"asymmetric grid of {shape.columns}×{shape.rows} circles"


KIND = BoardKind(
    name="asymmetric-circles",
    title="Asymmetric circle grid",
    counts="circles",
    points=points,
    area=area,
    drawn=drawn,
    find=find,
    check=circles.check,
    says=says,
    options=circles.options,
    measures=circles.measures,
    sized="distances",
    size=side,
    advice="count the circles of one row and the rows, and see that all circles are in the picture, dark on white",
)
