"""Lesson 12, colour filter arrays: the mosaic, its phase after a crop, three guesses of green, and the false colour.

Tiles are arrays of channels (0 red, 1 green, 2 blue) that repeat from a mosaic's upper left pixel.
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
from numpy.typing import ArrayLike

from camviz.checks import SHAPES, Arguments, Array, Exercise
from camviz.mosaics import XTRANS

_RGGB = np.array([[0, 1], [1, 2]])
_TILES = (_RGGB, _RGGB[:, ::-1], np.array(XTRANS.tile), np.array([[0, 1, 2]]))


def mosaic(picture: Array, tile: Array) -> Array:
    """For each pixel, the one of its three numbers that the filter over it lets through."""
    height, width = picture.shape[:2]
    v, u = np.mgrid[:height, :width]
    return picture[v, u, tile[v % tile.shape[0], u % tile.shape[1]]]


def cropped_tile(tile: Array, x0: int, y0: int) -> Array:
    """The tile of a mosaic that lost its first x0 columns and y0 rows: rows up by y0, columns left by x0."""
    return np.roll(tile, (-y0, -x0), axis=(0, 1))


def malvar_green(around: Array) -> Array:
    """Green (...) in the middle of windows (..., 5, 5): the mean of four, plus half the Laplacian of what is there."""
    return _mean_of_four(around, 1) + (around[..., 2, 2] - _mean_of_four(around, 2)) / 2


def false_frequency(f: ArrayLike) -> Array:
    """How far f is from the nearest of ½, ½ ± 1, …: the frequency at which red and blue beat under Bayer's filters."""
    away = np.asarray(f, dtype=float) - 0.5
    return np.abs(away - np.rint(away))


def edge_green(around: Array) -> Array:
    """Green (...) in the middle of windows (..., 5, 5), along the way that changes less; the mean of both in a draw."""
    row, column = around[..., 2, :], around[..., :, 2]
    (across, by_row), (down, by_column) = _one_way(row), _one_way(column)
    return np.where(across < down, by_row, np.where(down < across, by_column, (by_row + by_column) / 2))


def _one_way(line: Array) -> tuple[Array, Array]:
    """Of lines (..., 5): how much they change, and green in their middle (Hamilton and Adams 1997)."""
    bend = 2 * line[..., 2] - line[..., 0] - line[..., 4]
    change = np.abs(line[..., 1] - line[..., 3]) + np.abs(bend)
    return change, (line[..., 1] + line[..., 3]) / 2 + bend / 4


def _mean_of_four(around: Array, distance: int) -> Array:
    """The mean (...) of the pixels above, below, left and right of the middle of windows (..., 5, 5)."""
    near, far = 2 - distance, 2 + distance
    return (around[..., near, 2] + around[..., far, 2] + around[..., 2, near] + around[..., 2, far]) / 4


# Fresh cases ---------------------------------------------------------------------------------------------------------


def _mosaic_cases(rng: np.random.Generator) -> Iterator[Arguments]:
    for tile, (height, width) in zip(_TILES, ((6, 8), (5, 7), (13, 9), (4, 7)), strict=True):
        yield (rng.random((height, width, 3)), tile)


def _tile_cases(rng: np.random.Generator) -> Iterator[Arguments]:
    for tile in _TILES[:3]:
        for x0, y0 in ((1, 0), (0, 1), rng.integers(1, 12, 2).tolist()):
            yield (tile, int(x0), int(y0))
    yield (np.array(XTRANS.tile), int(rng.choice([1, 2])), int(rng.choice([4, 5])))


def _window_cases(rng: np.random.Generator) -> Iterator[Arguments]:
    for shape in SHAPES:
        yield (rng.random((*shape, 5, 5)),)


def _edge_cases(rng: np.random.Generator) -> Iterator[Arguments]:
    yield from _window_cases(rng)
    steep = rng.random((4, 5, 5))
    steep[:2] += 2 * np.arange(5)  # an edge that runs down
    steep[2:] += 2 * np.arange(5)[:, None]  # and one that runs across
    yield (steep,)
    draw = rng.integers(0, 8, (6, 5, 5)) / 8
    draw[..., :, 2] = 2 * draw[..., 2, 2, None] - draw[..., 2, :]  # upside down, the column changes as much as the row
    yield (draw,)


def _frequency_cases(rng: np.random.Generator) -> Iterator[Arguments]:
    for shape in SHAPES:
        yield (rng.uniform(0.05, 0.95, shape),)
    yield (rng.uniform(1.05, 2.95, 6),)
    yield (np.array([0.0, 0.25, 0.5, 1.0]),)


# Known mistakes ------------------------------------------------------------------------------------------------------


def _with_tile_across(picture: Array, tile: Array) -> Array:
    v, u = np.mgrid[: picture.shape[0], : picture.shape[1]]
    return picture[v, u, tile.T[v % tile.shape[1], u % tile.shape[0]]]


def _blue_first(picture: Array, tile: Array) -> Array:
    return mosaic(picture[..., ::-1], tile)


def _kept_in_three(picture: Array, tile: Array) -> Array:
    v, u = np.mgrid[: picture.shape[0], : picture.shape[1]]
    seen = tile[v % tile.shape[0], u % tile.shape[1]]
    return picture * (seen[..., None] == np.arange(3))


def _across_the_edge(around: Array) -> Array:
    (across, by_row), (down, by_column) = _one_way(around[..., 2, :]), _one_way(around[..., :, 2])
    return np.where(across > down, by_row, np.where(down > across, by_column, (by_row + by_column) / 2))


def _edge_without_bend(around: Array) -> Array:
    row, column = around[..., 2, :], around[..., :, 2]
    (across, _), (down, _) = _one_way(row), _one_way(column)
    by_row, by_column = (row[..., 1] + row[..., 3]) / 2, (column[..., 1] + column[..., 3]) / 2
    return np.where(across < down, by_row, np.where(down < across, by_column, (by_row + by_column) / 2))


def _draw_by_column(around: Array) -> Array:
    (across, by_row), (down, by_column) = _one_way(around[..., 2, :]), _one_way(around[..., :, 2])
    return np.where(across < down, by_row, by_column)


def _draw_by_row(around: Array) -> Array:
    (across, by_row), (down, by_column) = _one_way(around[..., 2, :]), _one_way(around[..., :, 2])
    return np.where(across <= down, by_row, by_column)


MOSAIC = Exercise(
    name="12.mosaic",
    reference=mosaic,
    cases=_mosaic_cases,
    hints=(
        "Row v and column u of the tile repeat: the filter over pixel (v, u) is "
        "`tile[v % tile.shape[0], u % tile.shape[1]]`.",
        "`v, u = np.mgrid[:height, :width]` gives every row and column at once, and `picture[v, u, channel]` picks one "
        "number for each of them.",
    ),
    praise="It works for Bayer's tile, for X-Trans, and for one that no one has built yet.",
)

MOSAIC.wrong("Rows and columns of the tile have changed places: it is indexed [v, u].")(_with_tile_across)


MOSAIC.wrong("Red and blue have changed places: channel 0 is red.")(_blue_first)


MOSAIC.wrong(
    "Two of your three numbers are always 0. A mosaic has *one* number for each pixel: its shape is (height, width)."
)(_kept_in_three)


@MOSAIC.wrong("This is the mean of all three, as without filters.")
def _(picture, tile):
    return picture.mean(axis=-1)


CROPPED_TILE = Exercise(
    name="12.cropped_tile",
    reference=cropped_tile,
    cases=_tile_cases,
    bug=True,
    hints=(
        "x0 counts *columns*, and columns are axis 1. And which way does the tile move when the picture loses its "
        "first column?",
        "After cutting, what was in column x0 is in column 0: everything moves *left* and *up*. For 2 × 2 tiles one "
        "does not see the difference; for X-Trans one does.",
    ),
    praise="It keeps the phase for any tile, also where 2 × 2 would have hidden the sign.",
)


@CROPPED_TILE.wrong(
    "Two mistakes are in it: x0 counts columns, which are axis 1, and cutting moves the tile left and up, not "
    "right and down."
)
def _(tile, x0, y0):
    return np.roll(tile, (x0, y0), axis=(0, 1))


@CROPPED_TILE.wrong(
    "The axes are right now, and every 2 × 2 tile is too. X-Trans is not: cutting moves the tile left and up."
)
def _(tile, x0, y0):
    return np.roll(tile, (y0, x0), axis=(0, 1))


@CROPPED_TILE.wrong("The direction is right now, but x0 still moves rows: columns are axis 1.")
def _(tile, x0, y0):
    return np.roll(tile, (-x0, -y0), axis=(0, 1))


@CROPPED_TILE.wrong("This cuts the tile. It is the mosaic that is cut; the tile repeats.")
def _(tile, x0, y0):
    return tile[y0:, x0:]


MALVAR_GREEN = Exercise(
    name="12.malvar_green",
    reference=malvar_green,
    cases=_window_cases,
    hints=(
        "Above, below, left and right of the middle, one pixel away, is green; two pixels away is the middle's own "
        "colour. Take the mean of each four.",
        "`around[..., 1, 2]` is above the middle, `around[..., 2, 3]` right of it. Green = mean of the four near "
        "ones + (middle − mean of the four far ones)/2.",
    ),
    praise="This is the first of the three filters of Malvar, He and Cutler: a Laplacian of red sharpens green.",
)


@MALVAR_GREEN.wrong("This is bilinear: red's say is missing.")
def _(around):
    return _mean_of_four(around, 1)


@MALVAR_GREEN.wrong("Half of the Laplacian is enough: the whole of it overshoots.")
def _(around):
    return _mean_of_four(around, 1) + around[..., 2, 2] - _mean_of_four(around, 2)


@MALVAR_GREEN.wrong("The sign is flipped: where red stands out above its neighbours, green is likely to do so too.")
def _(around):
    return _mean_of_four(around, 1) - (around[..., 2, 2] - _mean_of_four(around, 2)) / 2


@MALVAR_GREEN.wrong("You take the *sum* of the four far pixels; it is their mean that the middle is compared with.")
def _(around):
    return _mean_of_four(around, 1) + (around[..., 2, 2] - 4 * _mean_of_four(around, 2)) / 2


FALSE_FREQUENCY = Exercise(
    name="12.false_frequency",
    reference=false_frequency,
    cases=_frequency_cases,
    shown=((0.45,),),
    hints=(
        "Red's filters stand in every second column. What do they see of stripes of half a cycle per pixel? And of "
        "stripes a little finer, or coarser?",
        "The distance of f from ½. And because pixels cannot tell f from f + 1, from the nearest of ½, 1½, −½ …: "
        "subtract ½, then subtract the nearest whole number with `np.rint`.",
    ),
    praise="Now you can say what colour a striped shirt will have before you take its picture.",
)


@FALSE_FREQUENCY.wrong(
    "This is the frequency that the stripes themselves seem to have on pixels, their alias. Colour beats with "
    "the distance from ½."
)
def _(f):
    return np.abs(np.asarray(f) - np.rint(f))


@FALSE_FREQUENCY.wrong(
    "For stripes below one cycle per pixel this is right. Pixels cannot tell f from f + 1: take the distance "
    "from the *nearest* of ½, 1½, …."
)
def _(f):
    return np.abs(np.asarray(f) - 0.5)


@FALSE_FREQUENCY.wrong("A frequency is not negative.")
def _(f):
    return np.asarray(f) - 0.5 - np.rint(np.asarray(f) - 0.5)


@FALSE_FREQUENCY.wrong(
    "This is the alias on every second pixel, for each colour by itself: at f near 0 red and blue have it too, "
    "but together, and then nothing is coloured. Red *against* blue beats with the distance from ½."
)
def _(f):
    return np.abs(2 * np.asarray(f) - np.rint(2 * np.asarray(f))) / 2


EDGE_GREEN = Exercise(
    name="12.edge_green",
    reference=edge_green,
    cases=_edge_cases,
    hints=(
        "Look at the middle row and the middle column by themselves. Each gives a change and a green; keep the green "
        "of the one that changes less.",
        "For a line a, b, c, d, e: bend = 2c − a − e, change = |b − d| + |bend|, green = (b + d)/2 + bend/4. Then "
        "`np.where`, twice, for the draw.",
    ),
    praise="It looks before it averages: this is the green of Hamilton and Adams, and half of Menon's.",
)

EDGE_GREEN.wrong("You take the way that changes *more*: across the edge, where the mean mixes both sides.")(
    _across_the_edge
)


EDGE_GREEN.wrong("The way is right. The green along it lacks bend/4.")(_edge_without_bend)


EDGE_GREEN.wrong("Right but for a draw: where both ways change as much, green is the mean of both, not the column's.")(
    _draw_by_column
)


EDGE_GREEN.wrong("Right but for a draw: where both ways change as much, green is the mean of both, not the row's.")(
    _draw_by_row
)


EDGE_GREEN.wrong("This is Malvar's green, the same filter everywhere. Here the window decides.")(malvar_green)


EXERCISES = (MOSAIC, CROPPED_TILE, MALVAR_GREEN, FALSE_FREQUENCY, EDGE_GREEN)
