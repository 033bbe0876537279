"""Colour filter arrays measure what they should, and demosaicing is as good as it is published to be."""

import warnings

import numpy as np
import pytest

from camviz.mosaics import (
    BAYER,
    BLUE,
    GREEN,
    MONOCHROME,
    PATTERNS,
    RED,
    RGBW,
    WHITE,
    XTRANS,
    Pattern,
    in_colour,
    mosaic,
)

with warnings.catch_warnings():
    warnings.simplefilter("ignore")  # it imports from where SciPy will not keep things
    import colour_demosaicing


@pytest.fixture
def picture():
    return np.random.default_rng(12).random((14, 19, 3))


@pytest.mark.parametrize("name", BAYER)
def test_a_bayer_mosaic_is_the_one_of_colour_demosaicing(picture, name):
    np.testing.assert_array_equal(mosaic(picture, BAYER[name]), colour_demosaicing.mosaicing_CFA_Bayer(picture, name))


def test_the_four_phases_are_named_by_their_first_two_rows():
    for name, pattern in BAYER.items():
        seen = pattern.channels(2, 2)
        assert "".join("RGB"[channel] for channel in seen.ravel()) == name


@pytest.mark.parametrize(
    ("pattern", "shares"),
    [
        (BAYER["GRBG"], (1 / 4, 1 / 2, 1 / 4, 0)),
        (XTRANS, (8 / 36, 20 / 36, 8 / 36, 0)),
        (RGBW, (1 / 8, 1 / 4, 1 / 8, 1 / 2)),
        (MONOCHROME, (0, 0, 0, 1)),
    ],
)
def test_the_filters_share_the_sensor_as_published(pattern, shares):
    assert [pattern.share(channel) for channel in (RED, GREEN, BLUE, WHITE)] == pytest.approx(shares)


def test_every_row_and_column_of_xtrans_has_all_three_colours():
    """What Fujifilm says of it, and what no Bayer array does."""
    tile = np.array(XTRANS.tile)
    assert all(set(line) == {RED, GREEN, BLUE} for line in (*tile, *tile.T))
    assert all(len(set(row)) == 2 for row in BAYER["RGGB"].tile)


@pytest.mark.parametrize("name", PATTERNS)
def test_every_pixel_measures_one_channel(name):
    masks = [PATTERNS[name].mask(channel, 13, 11) for channel in (RED, GREEN, BLUE, WHITE)]
    np.testing.assert_array_equal(np.sum(masks, axis=0), 1)


@pytest.mark.parametrize("name", PATTERNS)
@pytest.mark.parametrize(("x0", "y0"), [(1, 0), (0, 1), (1, 1), (2, 4), (5, 3)])
def test_a_cropped_mosaic_is_the_mosaic_of_the_cropped_picture_under_the_cropped_pattern(picture, name, x0, y0):
    pattern = PATTERNS[name]
    np.testing.assert_array_equal(
        mosaic(picture, pattern)[y0:, x0:], mosaic(picture[y0:, x0:], pattern.cropped(x0, y0))
    )


def test_an_odd_crop_turns_one_bayer_phase_into_another():
    rggb = BAYER["RGGB"]
    assert rggb.cropped(1, 0).name == "GRBG"
    assert rggb.cropped(0, 1).name == "GBRG"
    assert rggb.cropped(1, 1).name == "BGGR"
    assert rggb.cropped(2, 0) == rggb


def test_a_white_pixel_measures_the_mean_of_the_three_and_a_grey_one_looks_alike_to_all(picture):
    np.testing.assert_allclose(mosaic(picture, MONOCHROME), picture.mean(axis=-1), atol=1e-15)
    for pattern in PATTERNS.values():
        np.testing.assert_allclose(mosaic(np.full((7, 7, 3), 0.3), pattern), 0.3, atol=1e-15)


def test_the_mosaic_in_colour_shows_each_pixel_under_its_filter(picture):
    pattern = BAYER["RGGB"]
    shown = in_colour(mosaic(picture, pattern), pattern)
    assert shown[0, 0].tolist() == [picture[0, 0, 0], 0, 0]
    assert shown[0, 1].tolist() == [0, picture[0, 1, 1], 0]
    assert shown[1, 1].tolist() == [0, 0, picture[1, 1, 2]]


@pytest.mark.parametrize(
    ("make", "said"),
    [
        (lambda: Pattern("bad", ((0, 1), (1,))), "tile must hold rows of one length"),
        (lambda: Pattern("bad", ((0, 4),)), "tile must hold channels 0"),
        (lambda: Pattern.spelled("bad", "RG GX"), "letters R, G, B, W"),
        (lambda: mosaic(np.zeros((4, 4)), XTRANS), r"\(height, width, 3\), got \(4, 4\)"),
        (lambda: in_colour(np.zeros((4, 4, 3)), XTRANS), r"one number for each pixel: \(4, 4, 3\)"),
    ],
)
def test_what_is_no_pattern_or_no_picture_is_refused_by_name(make, said):
    with pytest.raises(ValueError, match=said):
        make()
