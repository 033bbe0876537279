"""Lesson 12, colour filter arrays: mosaic, false colour, the phase after a crop, binning, and two guesses of green.

Tiles are arrays of channels (0 red, 1 green, 2 blue) that repeat from a mosaic's upper left pixel.
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
from numpy.typing import ArrayLike

from camviz.mosaics import XTRANS
from camviz_school.course.checks import SHAPES, Arguments, Array, Exercise

RGGB = np.array([[0, 1], [1, 2]])
X_TRANS = np.array(XTRANS.tile)
UNEVEN = np.array([[0, 1, 2, 1], [1, 1, 0, 2], [2, 0, 1, 0]])
"""A tile that nobody builds: not square, and none of its turns, shifts and mirror images is like another."""

# 1: any mosaic -------------------------------------------------------------------------------------------------------


def mosaic(picture: Array, tile: Array) -> Array:
    """For each pixel, the one of its three numbers that the filter over it lets through."""
    height, width = picture.shape[:2]
    v, u = np.mgrid[:height, :width]
    return picture[v, u, tile[v % tile.shape[0], u % tile.shape[1]]]


def _mosaic_cases(rng: np.random.Generator) -> Iterator[Arguments]:
    tiles = (RGGB, RGGB[:, ::-1], X_TRANS, np.array([[0, 1, 2]]), UNEVEN)
    for tile, (height, width) in zip(tiles, ((6, 8), (5, 7), (13, 9), (4, 7), (8, 11)), strict=True):
        yield (rng.normal(0.5, 1, (height, width, 3)), tile)


MOSAIC = Exercise(
    name="12.mosaic",
    reference=mosaic,
    cases=_mosaic_cases,
    hints=(
        "Which filter stands over the first pixel? Which one over the first pixel beyond the tile's right edge, and "
        "which below its bottom edge?",
        "The remainder `v % n` counts from 0 to n − 1 and begins again. So the tile repeats. `np.mgrid` gives the row "
        "and the column of every pixel at once, and an array indexed by three arrays of one shape gives one number "
        "for each of their elements.",
        "`return picture[v, u, tile[v % ___, u % ___]]`",
    ),
    praise="It works for Bayer's tile, for X-Trans, and for one that no one has built yet.",
)


@MOSAIC.right
def with_the_tile_laid_out(picture, tile):
    height, width = picture.shape[:2]
    seen = np.tile(tile, (height // tile.shape[0] + 1, width // tile.shape[1] + 1))[:height, :width]
    return np.take_along_axis(picture, seen[..., None], axis=-1)[..., 0]


@MOSAIC.wrong("Rows and columns of the tile have changed places: it is indexed [v, u], the row first.")
def tile_across(picture, tile):
    return mosaic(picture, tile.T)


@MOSAIC.wrong("This is right for RGGB, whatever tile is given: look the channel up in `tile`.")
def always_rggb(picture, tile):
    return mosaic(picture, RGGB)


@MOSAIC.wrong("Beyond the first tile you repeat its last row and column. The tile begins anew there.")
def held_at_the_end(picture, tile):
    v, u = np.mgrid[: picture.shape[0], : picture.shape[1]]
    return picture[v, u, tile[np.minimum(v, tile.shape[0] - 1), np.minimum(u, tile.shape[1] - 1)]]


@MOSAIC.wrong("Red and blue have changed places: channel 0 is red.")
def blue_first(picture, tile):
    return mosaic(picture[..., ::-1], tile)


@MOSAIC.wrong("You stretch one tile over the whole picture. A filter covers one pixel, and the tile repeats.")
def one_tile_stretched(picture, tile):
    height, width = picture.shape[:2]
    v, u = np.mgrid[:height, :width]
    return picture[v, u, tile[v * tile.shape[0] // height, u * tile.shape[1] // width]]


# 3: find the bug in the phase after a crop ---------------------------------------------------------------------------


def cropped_tile(tile: Array, x0: int, y0: int) -> Array:
    """The tile of a mosaic that lost its first x0 columns and y0 rows: rows up by y0, columns left by x0."""
    return np.roll(tile, (-y0, -x0), axis=(0, 1))


def cropped_tile_as_given(tile, x0, y0):
    return np.roll(tile, (x0, y0), axis=(0, 1))


def _tile_cases(rng: np.random.Generator) -> Iterator[Arguments]:
    for tile in (RGGB, X_TRANS, UNEVEN):
        for x0, y0 in ((0, 0), (1, 0), (0, 1), rng.integers(1, 12, 2).tolist()):
            yield tile, int(x0), int(y0)
    yield X_TRANS, int(rng.choice([1, 2])), 4
    yield UNEVEN, int(rng.choice([1, 5])), int(rng.choice([1, 4]))


CROPPED_TILE = Exercise(
    name="12.cropped_tile",
    reference=cropped_tile,
    cases=_tile_cases,
    as_given=cropped_tile_as_given,
    hints=(
        "Write down a tile of three by three letters and cut off the first column: which letter is the upper left one "
        "now? Then cut off the first row instead. Compare both with what the function gives.",
        "`np.roll` with a shift of +1 moves every element to the *next* index, and the last one to the front. Which "
        "axis do columns lie along, and which way does the tile move when the picture loses its first one?",
        "`return np.roll(tile, (___, ___), axis=(0, 1))`",
    ),
    praise="It keeps the phase for any tile, also where Bayer's would have hidden the sign.",
)


@CROPPED_TILE.right
def what_a_large_mosaic_shows(tile, x0, y0):
    height, width = tile.shape
    laid_out = np.tile(tile, (y0 // height + 2, x0 // width + 2))
    return laid_out[y0 : y0 + height, x0 : x0 + width]


@CROPPED_TILE.right
def by_remainders(tile, x0, y0):
    v, u = np.indices(tile.shape)
    return tile[(v + y0) % tile.shape[0], (u + x0) % tile.shape[1]]


@CROPPED_TILE.wrong(
    "The axes are right, which is enough for Bayer. X-Trans needs the sign: a crop moves the tile left and up."
)
def moved_right_and_down(tile, x0, y0):
    return np.roll(tile, (y0, x0), axis=(0, 1))


@CROPPED_TILE.wrong("The direction is right now, but x0 still moves rows: columns lie along axis 1.")
def axes_still_swapped(tile, x0, y0):
    return np.roll(tile, (-x0, -y0), axis=(0, 1))


@CROPPED_TILE.wrong("The columns are right now. Rows move the other way: row y0 becomes row 0.")
def rows_moved_down(tile, x0, y0):
    return np.roll(tile, (y0, -x0), axis=(0, 1))


@CROPPED_TILE.wrong("Even or odd decides for tiles of two by two only. A larger tile can begin in more than two ways.")
def even_or_odd(tile, x0, y0):
    return np.roll(tile, (-(y0 % 2), -(x0 % 2)), axis=(0, 1))


# 4: four pixels as one -----------------------------------------------------------------------------------------------


def binned(measured: Array) -> Array:
    """A mosaic (h, w) of the means of two by two pixels of a mosaic (2 h, 2 w)."""
    height, width = measured.shape
    return measured.reshape(height // 2, 2, width // 2, 2).mean(axis=(1, 3))


def _binned_cases(rng: np.random.Generator) -> Iterator[Arguments]:
    for shape in ((4, 4), (8, 4), (4, 12), (12, 8)):
        yield (rng.normal(0.5, 1, shape),)
    yield (rng.uniform(-2, -1, (8, 8)),)
    yield (rng.uniform(30, 90, (8, 12)),)


BINNED = Exercise(
    name="12.binned",
    reference=binned,
    cases=_binned_cases,
    tolerance=1e-6,
    hints=(
        "Write down the upper left eight by eight pixels of a quad-Bayer mosaic as letters. Which four of them become "
        "the first pixel of the new mosaic, and which four the one to its right?",
        "`measured[::2, ::2]` holds the upper left pixel of every square, and `measured[1::2, ::2]` the one below it. "
        "There are two more such arrays. Or give the mosaic four axes, `(h, 2, w, 2)`, and take the mean over two.",
        "`return measured.reshape(height // 2, 2, width // 2, 2).mean(axis=(___, ___))`",
    ),
    praise="Four pixels of one colour have become one, and the mosaic is an ordinary Bayer mosaic.",
)


@BINNED.right
def four_arrays(measured):
    return (measured[::2, ::2] + measured[1::2, ::2] + measured[::2, 1::2] + measured[1::2, 1::2]) / 4


@BINNED.right
def by_opencv_s_areas(measured):
    import cv2

    return cv2.resize(measured, None, fx=0.5, fy=0.5, interpolation=cv2.INTER_AREA)


@BINNED.wrong("You keep one pixel of four and drop the others. Their mean scatters less.")
def one_of_four(measured):
    return measured[::2, ::2]


@BINNED.wrong("You take the mean of two pixels in a row only. Those below them have the same colour.")
def binned_along_rows(measured):
    return (measured[::2, ::2] + measured[::2, 1::2]) / 2


@BINNED.wrong(
    "Your pixels are two apart. In quad-Bayer, neighbours have one colour: average each square of two by two."
)
def as_under_bayer(measured):
    wrapped = np.pad(measured, ((0, 2), (0, 2)), mode="wrap")
    return (wrapped[:-2:2, :-2:2] + wrapped[2::2, :-2:2] + wrapped[:-2:2, 2::2] + wrapped[2::2, 2::2]) / 4


@BINNED.wrong("You cut the answer off at 0 and 1. Noise below the dark level is negative: keep it.")
def binned_and_cut_off(measured):
    return np.clip(binned(measured), 0, 1)


# 5: green, with red's help -------------------------------------------------------------------------------------------


def malvar_green(around: Array) -> Array:
    """Green (...) in the middle of windows (..., 5, 5): the mean of four, plus half the Laplacian of what is there."""
    return mean_of_four(around, 1) + (around[..., 2, 2] - mean_of_four(around, 2)) / 2


def mean_of_four(around: Array, distance: int) -> Array:
    """The mean (...) of the pixels above, below, left and right of the middle of windows (..., 5, 5)."""
    near, far = 2 - distance, 2 + distance
    return (around[..., near, 2] + around[..., far, 2] + around[..., 2, near] + around[..., 2, far]) / 4


def _window_cases(rng: np.random.Generator) -> Iterator[Arguments]:
    for shape in SHAPES:
        yield (rng.normal(0.5, 1, (*shape, 5, 5)),)


def _malvar_cases(rng: np.random.Generator) -> Iterator[Arguments]:
    yield from _window_cases(rng)
    bright = rng.uniform(0.8, 1, (5, 5, 5))  # among greens of 0.8 and more, a red that stands out by as much
    bright[:, [0, 4], 2], bright[:, 2, [0, 4]] = rng.uniform(0, 0.2, (2, 5, 2))
    yield (bright,)
    yield (-bright,)


MALVAR_GREEN = Exercise(
    name="12.malvar_green",
    reference=malvar_green,
    cases=_malvar_cases,
    tolerance=1e-6,
    hints=(
        "Draw the window and write a letter in each square: R in the middle, then G and R in turn along its row and "
        "its column. Which four squares say what green is, and which four say how red the neighbourhood is?",
        "`around[..., 1, 2]` is the square above the middle and `around[..., 2, 4]` the last one to its right. Take "
        "the mean of the four near ones, then that of the four far ones. The middle minus the second mean is what red "
        "stands out by.",
        "`return green + (around[..., 2, 2] - ___) / ___`",
    ),
    praise="This is the first of the filters of Malvar, He and Cutler: a Laplacian of red sharpens green.",
)


@MALVAR_GREEN.right
def with_the_weights_of_the_paper(around):
    weights = np.array([[0, 0, -1, 0, 0], [0, 0, 2, 0, 0], [-1, 2, 4, 2, -1], [0, 0, 2, 0, 0], [0, 0, -1, 0, 0]]) / 8
    return np.sum(around * weights, axis=(-2, -1))


@MALVAR_GREEN.right
def in_single_precision(around):
    return malvar_green(around.astype(np.float32))


@MALVAR_GREEN.wrong("This is bilinear interpolation: it does not use red yet.")
def bilinear_green(around):
    return mean_of_four(around, 1)


@MALVAR_GREEN.wrong("You add the whole difference of the reds. Add half of it: the whole overshoots.")
def whole_laplacian(around):
    return mean_of_four(around, 1) + around[..., 2, 2] - mean_of_four(around, 2)


@MALVAR_GREEN.wrong("The sign is flipped: where red is above its neighbours, green is likely to be so too.")
def sign_flipped(around):
    return mean_of_four(around, 1) - (around[..., 2, 2] - mean_of_four(around, 2)) / 2


@MALVAR_GREEN.wrong("You compare red with its diagonal neighbours. Those are blue; the next reds are two pixels away.")
def compared_with_blue(around):
    diagonal = (around[..., 1, 1] + around[..., 1, 3] + around[..., 3, 1] + around[..., 3, 3]) / 4
    return mean_of_four(around, 1) + (around[..., 2, 2] - diagonal) / 2


@MALVAR_GREEN.wrong("You compare red with *green*. A red surface would then look greener: compare red with red.")
def compared_with_green(around):
    return mean_of_four(around, 1) + (around[..., 2, 2] - mean_of_four(around, 1)) / 2


# 2: what colour will the shirt be? -----------------------------------------------------------------------------------


def false_frequency(f: ArrayLike) -> Array:
    """How far f is from the nearest of ½, ½ ± 1, …: the frequency at which red and blue beat under Bayer's filters."""
    away = np.asarray(f, dtype=float) - 0.5
    return np.abs(away - np.rint(away))


def _frequency_cases(rng: np.random.Generator) -> Iterator[Arguments]:
    for shape in SHAPES:
        yield (rng.uniform(0.05, 0.95, shape),)
    yield (rng.uniform(1.05, 2.95, 6),)
    yield (rng.uniform(3, 40, 12),)
    yield (np.array([0.0, 0.25, 0.3, 0.5, 0.7, 0.9, 1.0, 1.4, 1.5, 2.0, 2.2, 2.5]),)


FALSE_FREQUENCY = Exercise(
    name="12.false_frequency",
    reference=false_frequency,
    cases=_frequency_cases,
    shown=((0.45,),),
    hints=(
        "Red's filters stand in every second column and blue's in the others. What does each of them see of stripes of "
        "half a cycle per pixel? How does their difference change when the stripes are a little finer, or coarser?",
        "At half a cycle per pixel red and blue differ evenly: the frequency of the false colour is 0. So look how far "
        "f lies from ½, or from the nearest of …, −½, ½, 1½, …. `np.rint` gives the nearest whole number.",
        "With `away` for how far f lies above ½: `return np.abs(away - ___)`",
    ),
    praise="Now you can say what colour a striped shirt will have before you take its picture.",
)


@FALSE_FREQUENCY.right
def from_a_cosine(f):
    return np.arccos(-np.cos(2 * np.pi * np.asarray(f))) / (2 * np.pi)


@FALSE_FREQUENCY.right
def the_rest_up_to_a_half(f):
    return 0.5 - np.abs(np.asarray(f) - np.rint(f))


@FALSE_FREQUENCY.wrong("This is the alias of the stripes themselves. Red and blue beat with the distance from ½.")
def alias_of_the_stripes(f):
    return np.abs(np.asarray(f) - np.rint(f))


@FALSE_FREQUENCY.wrong("This is right for f below 1. Pixels cannot tell f from f + 1: take the *nearest* of ½, 1½, ….")
def first_carrier_only(f):
    return np.abs(np.asarray(f) - 0.5)


@FALSE_FREQUENCY.wrong("½ − f is right below ½ only. Finer stripes beat too: take the distance from ½, 1½, ….")
def coarser_stripes_only(f):
    return 0.5 - np.asarray(f)


@FALSE_FREQUENCY.wrong("The sizes are right. A frequency is not negative: bands to the left or right of ½ look alike.")
def signed(f):
    return np.asarray(f) - 0.5 - np.rint(np.asarray(f) - 0.5)


@FALSE_FREQUENCY.wrong("This is one colour's own alias. Red *against* blue beats with the distance from ½.")
def alias_of_one_colour(f):
    return np.abs(2 * np.asarray(f) - np.rint(2 * np.asarray(f))) / 2


# 6: look before you average ------------------------------------------------------------------------------------------


def edge_green(around: Array) -> Array:
    """Green (...) in the middle of windows (..., 5, 5), along the way that changes less; the mean of both in a draw."""
    return _decided(_along(around[..., 2, :]), _along(around[..., :, 2]))


def _along(line: Array) -> tuple[Array, Array]:
    """Of lines (..., 5): how much they change, and green in their middle (Hamilton and Adams 1997)."""
    a, b, c, d, e = np.moveaxis(line, -1, 0)
    bend = 2 * c - a - e
    return np.abs(b - d) + np.abs(bend), (b + d) / 2 + bend / 4


def _decided(row: tuple[Array, Array], column: tuple[Array, Array]) -> Array:
    """The green of the way with the smaller change, of (change, green) along the row and along the column."""
    (across, by_row), (down, by_column) = row, column
    return np.where(across < down, by_row, np.where(down < across, by_column, (by_row + by_column) / 2))


def _edge_cases(rng: np.random.Generator) -> Iterator[Arguments]:
    yield from _window_cases(rng)
    steep = rng.random((4, 5, 5))
    steep[:2] += 2 * np.arange(5)  # brighter from left to right: the column is the better way
    steep[2:] += 2 * np.arange(5)[:, None]  # brighter from above to below: the row is
    yield (steep,)
    yield (steep - 20,)  # below zero, as after the black level is taken off
    peaked = rng.uniform(0, 0.1, (4, 5, 5))  # along the row only the bend tells, along the column only the slope does
    peaked[:, 2, :] = (0, 0.5, 1, 0.5, 0)
    peaked[:, :, 2] = (1, 0.4, 1, 0.6, 1)
    peaked[2:] = np.swapaxes(peaked[2:], 1, 2)
    yield (peaked + rng.uniform(0, 0.02, peaked.shape),)
    draw = rng.integers(-8, 8, (6, 5, 5)) / 8
    draw[..., :, 2] = 2 * draw[..., 2, 2, None] - draw[..., 2, :]  # upside down, the column changes as much as the row
    yield (draw,)
    yield (draw - 4,)
    nearly = draw.copy()
    nearly[..., :, 2] += rng.choice([-0.004, 0.004], (6, 1)) * (draw[..., :, 2] - draw[..., 2, 2, None])
    yield (nearly,)


EDGE_GREEN = Exercise(
    name="12.edge_green",
    reference=edge_green,
    cases=_edge_cases,
    tolerance=1e-6,
    hints=(
        "Write a function for one line of five pixels first: its change and its green. The middle row and the middle "
        "column are two such lines.",
        "The middle row is `around[..., 2, :]`, the middle column `around[..., :, 2]`. Each window decides by itself: "
        "`np.where(condition, this, that)`, with another one inside it for what is left.",
        "`return np.where(across < down, row, np.where(down < across, ___, ___))`",
    ),
    praise="It looks before it averages: this is the green of Hamilton and Adams, and half of Menon's.",
)


@EDGE_GREEN.right
def by_weights(around):
    (across, row), (down, column) = _along(around[..., 2, :]), _along(around[..., :, 2])
    weight = 0.5 + 0.5 * np.sign(down - across)
    return weight * row + (1 - weight) * column


@EDGE_GREEN.right
def in_single_precision_too(around):
    return edge_green(around.astype(np.float32))


@EDGE_GREEN.wrong("You take the way that changes *more*: across the edge, where the mean mixes both sides.")
def across_the_edge(around):
    (across, row), (down, column) = _along(around[..., 2, :]), _along(around[..., :, 2])
    return _decided((down, row), (across, column))


@EDGE_GREEN.wrong("The way is right. The green along it lacks bend/4.")
def green_without_bend(around):
    row, column = around[..., 2, :], around[..., :, 2]
    return _decided(*((_along(one)[0], (one[..., 1] + one[..., 3]) / 2) for one in (row, column)))


@EDGE_GREEN.wrong("Only ties are wrong: where both ways change as much, green is the mean of both, not the column's.")
def draw_by_column(around):
    (across, row), (down, column) = _along(around[..., 2, :]), _along(around[..., :, 2])
    return np.where(across < down, row, column)


@EDGE_GREEN.wrong("This is the mean of both ways everywhere, Malvar's green. Here each window decides.")
def never_decided(around):
    return malvar_green(around)


@EDGE_GREEN.wrong("You decide by |b − d| alone. A line that rises and falls again has b = d: add its |bend|.")
def decided_without_bend(around):
    row, column = around[..., 2, :], around[..., :, 2]
    return _decided(*((np.abs(one[..., 1] - one[..., 3]), _along(one)[1]) for one in (row, column)))


EXERCISES = (MOSAIC, FALSE_FREQUENCY, CROPPED_TILE, BINNED, MALVAR_GREEN, EDGE_GREEN)
