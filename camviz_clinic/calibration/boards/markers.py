"""A grid of ArUco markers, or one marker alone, as OpenCV prints them (`cv2.aruco.GridBoard`).

The markers are numbered row by row from the upper left. Nothing but white lies between them. Blur rounds such a corner
off, and a search for it (`cv2.cornerSubPix`) ends half a pixel inside. So each side is measured along its whole length,
where blur moves it to neither side, and a corner is where two sides meet. That holds for light: pictures are taken to
be sRGB, in which a blurred edge would seem nearer to the black.
"""

from __future__ import annotations

from collections import Counter
from typing import Any

import numpy as np
from numpy.typing import NDArray

from camviz_clinic.calibration.boards.aprilgrid import measures, points, tag_size, tags
from camviz_clinic.calibration.boards.charuco import check_printed, marker_dictionary, printed
from camviz_clinic.calibration.boards.kind import Area, Array, BoardKind, Drawing, Gray, Shape, cells, millimetres

QUIET = 0.25  # of a marker's side: the white around the outer ones
ENDS = 0.12  # of a side: so near its ends the next side is in the way
PROFILES = 24  # across each side
REACH = 0.45  # of a cell, to either side: as far there is nothing but the border's black and the paper's white
LEAST_REACH, MOST_REACH = 1.5, 8.0  # pixels
STEP = 0.25  # pixels
ROUNDS = 3  # each begins with the corners of the one before
LEAST_CONTRAST = 0.02  # of full scale, between paper and ink
FAR = 0.5  # of a cell, and 3 pixels at least: a corner that is moved further was none
LEAST_FAR = 3.0


def find(gray: Gray, shape: Shape, finder: str) -> Array | None:
    """The four corners of every marker that is seen, NaN for the others; None where none is.

    A number that is seen twice, as where two sheets are in the picture, is left out.
    """
    from camviz.scenes.light import to_linear

    across, down = tags(shape)
    corners, ids, _ = detector(shape).detectMarkers(gray)
    numbers = [] if ids is None else np.ravel(ids).tolist()
    times = Counter(numbers)
    light, count = to_linear(gray).astype(np.float32), cells_of(shape)
    seen = np.full((shape.rows, shape.columns, 2), np.nan)
    for number, four in zip(numbers, corners, strict=False):
        place = number - shape.first_id
        if times[number] == 1 and 0 <= place < across * down:
            row, column = 2 * (place // across), 2 * (place % across)
            corners_there = [row, row, row + 1, row + 1], [column, column + 1, column + 1, column]
            seen[corners_there] = _refined(light, np.reshape(four, (4, 2)).astype(float), count)
    return seen.reshape(-1, 2) if np.isfinite(seen).any() else None


def grid_dictionary(shape: Shape) -> Any:
    """OpenCV's dictionary of a grid's markers; ValueError for one that it does not have or that is too small."""
    across, down = tags(shape)
    return marker_dictionary(shape.dictionary, shape.first_id + across * down)


def cells_of(shape: Shape) -> int:
    """How many cells a marker has along a side, its black border among them."""
    return int(grid_dictionary(shape).markerSize) + 2 * shape.border_bits


def _refined(light: NDArray[np.float32], corners: Array, count: int) -> Array:
    """The corners (4, 2) of a marker where its measured sides meet; NaN where one cannot be measured."""
    moved = corners
    for _ in range(ROUNDS):
        sides = [_side(light, moved[i], moved[(i + 1) % 4], moved.mean(axis=0), count) for i in range(4)]
        moved = np.array([np.cross(sides[i - 1][1], sides[i][0]) for i in range(4)])
        with np.errstate(divide="ignore", invalid="ignore"):
            moved = moved[:, :2] / moved[:, 2:]
        if not np.isfinite(moved).all():
            return np.full((4, 2), np.nan)
    cell = np.linalg.norm(corners - np.roll(corners, 1, axis=0), axis=1).mean() / count
    far = np.linalg.norm(moved - corners, axis=1) > max(FAR * cell, LEAST_FAR)
    return np.where(far[:, None], np.nan, moved)


def _side(light: NDArray[np.float32], start: Array, end: Array, middle: Array, count: int) -> Array:
    """The lines (2, 3) that touch a marker's side at its ends, a x + b y + c = 0, by profiles from black to white.

    A lens bends a side, which is therefore a parabola.

    Where an edge is follows from how much of its profile is white, which blur leaves alone that is the same to both
    sides. NaN where the picture's border is too near, or a profile is not darker inside than outside.
    """
    import cv2

    length = float(np.linalg.norm(end - start))
    along = (end - start) / length
    out = np.array([along[1], -along[0]])
    out *= np.sign(out @ (start - middle))
    reach = float(np.clip(REACH * length / count, LEAST_REACH, MOST_REACH))
    offsets = np.arange(-reach, reach + STEP / 2, STEP)
    places = start + np.linspace(ENDS, 1 - ENDS, PROFILES)[:, None] * (end - start)
    samples = (places[:, None] + offsets[:, None] * out).astype(np.float32)
    high = np.array(light.shape[::-1]) - 1
    if (samples < 0).any() or (samples > high).any():
        return np.full((2, 3), np.nan)
    profiles = cv2.remap(light, samples[..., 0], samples[..., 1], cv2.INTER_LINEAR)
    fifth = max(len(offsets) // 5, 1)
    black, white = profiles[:, :fifth].mean(axis=1), profiles[:, -fifth:].mean(axis=1)
    if (white - black < LEAST_CONTRAST).any():
        return np.full((2, 3), np.nan)
    share = ((profiles - black[:, None]) / (white - black)[:, None]).mean(axis=1)
    edge = offsets[-1] + STEP / 2 - share * STEP * len(offsets)
    curve = np.polynomial.Polynomial.fit(np.linspace(ENDS, 1 - ENDS, PROFILES), edge, 2)
    touching = []
    for at in (0.0, 1.0):
        point = start + at * (end - start) + curve(at) * out
        touching.append(np.cross([*point, 1], [*(point + along + curve.deriv()(at) / length * out), 1]))
    return np.array(touching)


def detector(shape: Shape) -> Any:
    """OpenCV's detector of these markers."""
    import cv2

    parameters = cv2.aruco.DetectorParameters()
    parameters.markerBorderBits = shape.border_bits
    return cv2.aruco.ArucoDetector(grid_dictionary(shape), parameters)


def area(shape: Shape) -> Area:
    """The markers and the white around them."""
    (across, down), quiet = tags(shape), QUIET * tag_size(shape)
    gap = shape.square_size - tag_size(shape)
    return -quiet, -quiet, across * shape.square_size - gap + quiet, down * shape.square_size - gap + quiet


def drawn(shape: Shape) -> Drawing:
    """The black cells of the markers."""
    import cv2

    (across, down), dictionary = tags(shape), grid_dictionary(shape)
    count, black = dictionary.markerSize + 2 * shape.border_bits, []
    for place in range(across * down):
        image = cv2.aruco.generateImageMarker(dictionary, shape.first_id + place, count, borderBits=shape.border_bits)
        x, y = place % across * shape.square_size, place // across * shape.square_size
        black += cells(image, x, y, tag_size(shape) / count)
    return Drawing(np.array(black))


def check(shape: Shape) -> None:
    if shape.columns % 2 or shape.rows % 2:
        raise ValueError(f"columns and rows must be two points a marker, got {shape.columns} and {shape.rows}")
    if shape.dictionary is None:
        raise ValueError("dictionary must be given for a grid of markers, such as 'DICT_4X4_50', got None")
    if shape.marker_size is None or not 0 < shape.marker_size < shape.square_size:
        raise ValueError(
            f"marker_size must be a marker's side, below square_size = {shape.square_size}, got {shape.marker_size}"
        )
    check_printed(shape)


def says(shape: Shape) -> str:
    across, down = tags(shape)
    if across * down == 1:
        return f"marker {shape.first_id} of {shape.dictionary}"
    return f"grid of {across}×{down} markers of {shape.dictionary}"


def options(shape: Shape) -> str:
    across, down = tags(shape)
    ratio = round(shape.square_size / tag_size(shape) - 1, 6)
    return (
        f"--markers {shape.dictionary} --board {across}x{down} --square-mm {millimetres(tag_size(shape))} "
        f"--spacing {ratio:g}{printed(shape)}"
    )


KIND = BoardKind(
    name="markers",
    title="grid of markers",
    counts="markers",
    points=points,
    area=area,
    drawn=drawn,
    find=find,
    check=check,
    says=says,
    options=options,
    measures=measures,
    sized="markers",
    size=tag_size,
    advice="see that the markers are of this dictionary, have white around them, and are not blurred",
    partial=True,
    per=2,
)
