"""The AprilGrid as Kalibr prints it: rows of AprilTags with small black squares between their corners.

The tags are of the family 36h11 with a black border two cells wide. Their numbers begin with 0 at the lower left and
go along the rows, which follow each other upward (`kalibr_create_target_pdf`). Kalibr counts the points from the lower
left, with y up; here they are counted from the upper left, with y down, as those of all other boards are. Its frame
comes from this one by half a turn about x and a shift by the height of the grid.
"""

from __future__ import annotations

from collections import Counter
from functools import cache
from typing import Any

import numpy as np

from camviz_clinic.calibration.boards.kind import Area, Array, BoardKind, Drawing, Gray, Shape, cells, millimetres

FAMILY = "DICT_APRILTAG_36h11"
TAGS = 587  # in that family
BORDER = 2  # cells of a tag's black border
CELLS = 6 + 2 * BORDER
FEWEST = 2  # tags
WINDOWS = (
    (3, 23, 10),
    (5, 45, 10),
)  # pixels: smallest, largest, step; the second where tags are missing
SAMPLES = 8  # to each cell and side, by which it is read; OpenCV's 4 loses small tags
SMALLEST = 0.01  # a tag's outline, in the picture's longer side
CLEAR = 0.15  # of a tag's side: a window this far to all sides of a corner holds nothing but that corner
LARGEST_WINDOW, LEAST_WINDOW = 11, 2  # pixels
STEPS, STILL = 30, 0.001


def tags(shape: Shape) -> tuple[int, int]:
    """The tags by columns and rows."""
    return shape.columns // 2, shape.rows // 2


def find(gray: Gray, shape: Shape, finder: str) -> Array | None:
    """The four corners of every tag that is seen, NaN for the others; None where fewer than two tags are.

    A number that is seen twice, as where two grids are in the picture, is left out.
    """
    seen = np.full((shape.rows, shape.columns, 2), np.nan)
    across, up = tags(shape)
    for number, corners in _tags(gray, across * up):
        row, column = 2 * (up - 1 - number // across), 2 * (number % across)
        # OpenCV's tags are turned by 180° against Kalibr's: it begins at what is printed as the lower right corner.
        seen[[row + 1, row + 1, row, row], [column + 1, column, column, column + 1]] = _refined(gray, corners)
    if np.isfinite(seen).all(axis=-1).sum() < 4 * FEWEST:
        return None
    return seen.reshape(-1, 2)


def _tags(gray: Gray, count: int) -> list[tuple[int, Array]]:
    """Number and corners (4, 2) of the tags 0 … count - 1 that are seen, each once."""
    found: dict[int, Array] = {}
    twice: set[int] = set()
    for window in WINDOWS:
        corners, ids, _ = detector(window).detectMarkers(gray)
        numbers = [] if ids is None else np.ravel(ids).tolist()
        twice |= {number for number, times in Counter(numbers).items() if times > 1}
        for number, four in zip(numbers, corners, strict=False):
            if number < count:
                found.setdefault(number, np.reshape(four, (4, 2)))
        if len(found) == count:
            break
    return [(number, corners) for number, corners in found.items() if number not in twice]


@cache
def detector(window: tuple[int, int, int]) -> Any:
    """OpenCV's detector of these tags, for thresholds over windows of these sizes: smallest, largest, step."""
    import cv2

    parameters = cv2.aruco.DetectorParameters()
    parameters.markerBorderBits = BORDER
    parameters.minMarkerPerimeterRate = 4 * SMALLEST
    parameters.perspectiveRemovePixelPerCell = SAMPLES
    parameters.adaptiveThreshWinSizeMin, parameters.adaptiveThreshWinSizeMax, step = window
    parameters.adaptiveThreshWinSizeStep = step
    return cv2.aruco.ArucoDetector(_family(), parameters)


@cache
def _family() -> Any:
    import cv2

    return cv2.aruco.getPredefinedDictionary(getattr(cv2.aruco, FAMILY))


def _refined(gray: Gray, corners: Array) -> Array:
    """The corners (4, 2) of a tag to a fraction of a pixel, NaN where the picture's edge or another corner is near.

    With the small squares each is where two black and two white fields meet, so that blur moves it to no side.
    """
    import cv2

    side = np.linalg.norm(corners - np.roll(corners, 1, axis=0), axis=-1).min()
    window = int(np.clip(CLEAR * side, LEAST_WINDOW, LARGEST_WINDOW))
    start = np.ascontiguousarray(corners, dtype=np.float32).reshape(-1, 1, 2)
    criteria = (cv2.TERM_CRITERIA_EPS + cv2.TERM_CRITERIA_MAX_ITER, STEPS, STILL)
    moved = np.asarray(cv2.cornerSubPix(gray, start.copy(), (window, window), (-1, -1), criteria), dtype=float)
    moved = moved.reshape(-1, 2)
    room = np.array(gray.shape[::-1]) - 1 - window
    kept = (moved >= window).all(axis=-1) & (moved <= room).all(axis=-1)
    kept &= np.linalg.norm(moved - corners, axis=-1) <= window
    return np.where(kept[:, None], moved, np.nan)


def points(shape: Shape) -> Array:
    """Two points a tag along each side; tags are `square_size` from edge to edge of the next."""
    assert shape.marker_size is not None
    x, y = (
        np.arange(count) // 2 * shape.square_size + np.arange(count) % 2 * shape.marker_size
        for count in (shape.columns, shape.rows)
    )
    return np.stack(np.meshgrid(x, y), axis=-1).reshape(-1, 2)


def area(shape: Shape) -> Area:
    """The tags and the small squares around them."""
    gap, (across, up) = shape.square_size - tag_size(shape), tags(shape)
    return -gap, -gap, across * shape.square_size, up * shape.square_size


def drawn(shape: Shape) -> Drawing:
    """The tags, and between their corners the small squares, all around."""
    import cv2

    assert shape.marker_size is not None
    across, up = tags(shape)
    gap, pitch = shape.square_size - shape.marker_size, shape.square_size
    black = [(i * pitch - gap, j * pitch - gap, gap, gap) for j in range(up + 1) for i in range(across + 1)]
    for number in range(across * up):
        image = np.rot90(cv2.aruco.generateImageMarker(_family(), number, CELLS, borderBits=BORDER), 2)
        x, y = number % across * pitch, (up - 1 - number // across) * pitch
        black += cells(image, x, y, shape.marker_size / CELLS)
    return Drawing(np.array(black))


def check(shape: Shape) -> None:
    if shape.columns % 2 or shape.rows % 2:
        raise ValueError(f"columns and rows must be two points a tag, got {shape.columns} and {shape.rows}")
    if shape.dictionary != FAMILY:
        raise ValueError(f"dictionary must be {FAMILY} for an AprilGrid, got {shape.dictionary!r}")
    if shape.marker_size is None or not 0 < shape.marker_size < shape.square_size:
        raise ValueError(
            f"marker_size must be a tag's side, below square_size = {shape.square_size}, got {shape.marker_size}"
        )
    across, up = tags(shape)
    if across * up > TAGS:
        raise ValueError(f"an AprilGrid must have at most {TAGS} tags, got {across} × {up}")


def says(shape: Shape) -> str:
    across, up = tags(shape)
    return f"AprilGrid of {across}×{up} tags (36h11, a border of {BORDER} cells)"


def tag_size(shape: Shape) -> float:
    """A tag's side in metres."""
    assert shape.marker_size is not None
    return shape.marker_size


def measures(shape: Shape) -> str:
    gap = shape.square_size - tag_size(shape)
    return f"tags of {millimetres(tag_size(shape))} mm, {millimetres(round(gap, 9))} mm apart"


def options(shape: Shape) -> str:
    assert shape.marker_size is not None
    across, up = tags(shape)
    ratio = round(shape.square_size / shape.marker_size - 1, 6)
    return f"--kind aprilgrid --board {across}x{up} --square-mm {millimetres(shape.marker_size)} --spacing {ratio:g}"


KIND = BoardKind(
    name="aprilgrid",
    title="AprilGrid",
    counts="tags",
    points=points,
    area=area,
    drawn=drawn,
    find=find,
    check=check,
    says=says,
    options=options,
    measures=measures,
    sized="tags",
    size=tag_size,
    advice="see that its tags have a black border of two cells, as Kalibr prints them, and are not blurred",
    partial=True,
    per=2,
)
