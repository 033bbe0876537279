"""The circle grid: black discs in rows and columns."""

from __future__ import annotations

import numpy as np

from camviz_clinic.calibration.boards.kind import (
    Area,
    Array,
    BoardKind,
    Drawing,
    Gray,
    Shape,
    millimetres,
    regular,
    side,
)

DIAMETER = 0.5  # of the distance between two centres, where the board does not say


def find(gray: Gray, shape: Shape, finder: str) -> Array | None:
    """The projections of all circles' centres, or None. Seen upside down, the grid looks the same."""
    from camviz_clinic.calibration.circle_grids import find_circles

    return find_circles(gray, shape, regular(shape), asymmetric=False)


def area(shape: Shape) -> Area:
    return around(regular(shape), diameter(shape, DIAMETER))


def drawn(shape: Shape) -> Drawing:
    return discs(regular(shape), diameter(shape, DIAMETER))


def diameter(shape: Shape, share: float) -> float:
    """A circle's diameter: the board's `marker_size`, or else this share of its `square_size`."""
    return shape.marker_size or share * shape.square_size


def around(points: Array, size: float) -> Area:
    """The area of discs of this diameter around points (n, 2), with as much white around it."""
    right, bottom = points.max(axis=0) + 1.5 * size
    return -1.5 * size, -1.5 * size, float(right), float(bottom)


def discs(points: Array, size: float) -> Drawing:
    """Discs of this diameter around points (n, 2)."""
    return Drawing(discs=np.column_stack([points, np.full(len(points), size)]))


def check(shape: Shape) -> None:
    if shape.dictionary is not None:
        raise ValueError(f"dictionary must be left out of a grid of circles, got {shape.dictionary!r}")
    if shape.marker_size is not None and not 0 < shape.marker_size < shape.square_size:
        raise ValueError(
            f"marker_size must be a circle's diameter, below square_size = {shape.square_size}, got {shape.marker_size}"
        )


def says(shape: Shape) -> str:
    return f"grid of {shape.columns}×{shape.rows} circles"


def measures(shape: Shape) -> str:
    return f"{millimetres(shape.square_size)} mm apart"


def options(shape: Shape) -> str:
    marked = f" --marker-mm {millimetres(shape.marker_size)}" if shape.marker_size else ""
    return (
        f"--kind {shape.kind} --board {shape.columns}x{shape.rows} --square-mm {millimetres(shape.square_size)}{marked}"
    )


KIND = BoardKind(
    name="circles",
    title="Circle grid",
    counts="circles",
    points=regular,
    area=area,
    drawn=drawn,
    find=find,
    check=check,
    says=says,
    options=options,
    measures=measures,
    sized="distances",
    size=side,
    advice="see that all circles are in the picture, dark on white",
)
