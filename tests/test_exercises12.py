"""The answers of lesson 12's exercises are those of the algorithms, and each wrong answer is told what is wrong."""

import numpy as np
import pytest

from camviz import mosaics
from camviz.checks import judge
from camviz.exercises import exercise, lesson12
from camviz.mosaics import BAYER, GREEN, PATTERNS, RED, XTRANS

RGGB = BAYER["RGGB"]


def windows_on_red(measured):
    """Every 5 × 5 window (rows, columns, 5, 5) whose middle is red, but for those at the border."""
    windows = np.lib.stride_tricks.sliding_window_view(measured, (5, 5))
    return windows[::2, ::2]


@pytest.mark.parametrize("name", PATTERNS)
def test_the_mosaic_is_that_of_camviz(name):
    pattern = PATTERNS[name]
    if mosaics.WHITE in pattern.present:
        pytest.skip("the exercise knows red, green and blue")
    picture = np.random.default_rng(1).random((11, 14, 3))
    np.testing.assert_array_equal(lesson12.mosaic(picture, np.array(pattern.tile)), mosaics.mosaic(picture, pattern))


def test_the_cropped_tile_is_that_of_camviz():
    for tile, x0, y0 in exercise("12.cropped_tile").cases(np.random.default_rng(2)):
        cropped = mosaics.Pattern("any", tuple(map(tuple, tile.tolist()))).cropped(x0, y0)
        np.testing.assert_array_equal(lesson12.cropped_tile(tile, x0, y0), np.array(cropped.tile))


@pytest.mark.parametrize(
    ("answer", "algorithm"), [(lesson12.malvar_green, mosaics.malvar), (lesson12.edge_green, mosaics.edge_aware)]
)
def test_the_greens_are_those_of_the_algorithms(answer, algorithm):
    measured = np.random.default_rng(3).random((24, 30))
    green = algorithm(measured, RGGB)[..., GREEN]
    at_red = green[2:-2:2, 2:-2:2]
    np.testing.assert_allclose(answer(windows_on_red(measured)), at_red, atol=1e-12)
    assert (RGGB.channels(24, 30)[2:-2:2, 2:-2:2] == RED).all()


@pytest.mark.parametrize("f", [0.3, 0.45, 0.55, 0.95, 1.4, 2.48])
def test_the_false_frequency_is_what_the_spectrum_shows(f):
    stripes = np.broadcast_to((0.5 + 0.4 * np.cos(2 * np.pi * f * np.arange(400)))[None, :, None], (8, 400, 3))
    red, blue = (mosaics.mosaic(stripes, RGGB)[row, row::2] for row in (0, 1))
    difference = red - np.interp(np.arange(0, 400, 2), np.arange(1, 400, 2), blue)
    columns = np.fft.rfftfreq(200, 2)  # red stands in every second column: it knows f to the nearest ½
    found = columns[np.abs(np.fft.rfft(difference - difference.mean())).argmax()]
    predicted = lesson12.false_frequency(f)
    assert found == pytest.approx(min(predicted, 0.5 - predicted), abs=2 / 400)


WRONG = [
    ("12.mosaic", lambda picture, tile: picture[..., 1], ""),
    ("12.mosaic", lambda picture, tile: lesson12.mosaic(picture, np.array([[0, 1], [1, 2]])), ""),
    ("12.mosaic", lambda picture, tile: picture.mean(axis=-1), "mean of all three"),
    ("12.cropped_tile", lambda tile, x0, y0: tile, ""),
    ("12.cropped_tile", lambda tile, x0, y0: np.roll(tile, (x0, y0), axis=(0, 1)), "Two mistakes"),
    ("12.cropped_tile", lambda tile, x0, y0: np.roll(tile, (y0, x0), axis=(0, 1)), "X-Trans is not"),
    ("12.malvar_green", lambda around: around[..., 2, 2], ""),
    ("12.malvar_green", lambda around: 0.5, "same number"),
    ("12.malvar_green", lambda around: around[..., 1:4, 1:4].mean(axis=(-2, -1)), ""),
    ("12.false_frequency", lambda f: abs(f - 0.5), "nearest"),
    ("12.false_frequency", lambda f: 0.05, ""),
    ("12.false_frequency", lambda f: 0.5 - np.asarray(f), ""),
    ("12.edge_green", lesson12.malvar_green, "Malvar"),
    ("12.edge_green", lambda around: np.sort(around[..., 2, :])[..., 2], ""),
]


@pytest.mark.parametrize(("name", "function", "words"), WRONG)
def test_a_wrong_answer_fails_and_is_told_why(name, function, words):
    for seed in range(10):
        verdict = judge(exercise(name), function, np.random.default_rng(seed))
        assert verdict.status == "wrong"
        assert words in verdict.message + verdict.hint, verdict.message


def test_another_way_of_writing_edge_green_is_right_too():
    def edge_green(around):
        out = np.empty(around.shape[:-2])
        for at in np.ndindex(out.shape):
            a, c = around[at][2], around[at][:, 2]
            row = abs(a[1] - a[3]) + abs(2 * a[2] - a[0] - a[4])
            column = abs(c[1] - c[3]) + abs(2 * c[2] - c[0] - c[4])
            greens = [0.5 * (x[1] + x[3]) + 0.25 * (2 * x[2] - x[0] - x[4]) for x in (a, c)]
            out[at] = greens[0] if row < column else greens[1] if column < row else sum(greens) / 2
        return out

    assert all(judge(exercise("12.edge_green"), edge_green, np.random.default_rng(seed)).correct for seed in range(10))


def test_a_tile_of_xtrans_is_among_the_fresh_cases():
    """Else a sign that 2 × 2 tiles hide would pass."""
    tiles = [tile.shape for tile, *_ in exercise("12.cropped_tile").cases(np.random.default_rng(0))]
    assert tiles.count((XTRANS.height, XTRANS.width)) > 1
