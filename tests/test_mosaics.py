"""Colour filter arrays measure what they should, and demosaicing is as good as it is published to be."""

import warnings

import cv2
import numpy as np
import pytest

from camviz.mosaics import (
    ALGORITHMS,
    ANY_PATTERN,
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
    bilinear,
    demosaic,
    edge_aware,
    green_windows,
    in_colour,
    malvar,
    menon,
    mosaic,
    opencv,
    with_green,
)
from camviz.scenes.photographs import photograph

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


# Demosaicing ---------------------------------------------------------------------------------------------------------


@pytest.fixture(scope="module")
def astronaut():
    """As stored: encoded for the screen, for that is what the published figures were taken of."""
    return photograph("astronaut") / 255


def decibels(picture, truth):
    error = (np.clip(picture, 0, 1) - truth)[10:-10, 10:-10]
    return -10 * np.log10(np.mean(error**2))


@pytest.mark.parametrize(("algorithm", "published"), [(bilinear, 30.44), (malvar, 34.49), (menon, 36.10)])
def test_the_astronaut_comes_back_as_well_as_it_is_known_to(astronaut, algorithm, published):
    pattern = BAYER["RGGB"]
    assert decibels(algorithm(mosaic(astronaut, pattern), pattern), astronaut) == pytest.approx(published, abs=0.05)


@pytest.mark.parametrize(("method", "published"), [("bilinear", 30.44), ("EA", 30.56), ("VNG", 34.72)])
def test_opencv_brings_the_astronaut_back_as_well_as_it_is_known_to(astronaut, method, published):
    pattern = BAYER["RGGB"]
    measured = np.rint(255 * mosaic(astronaut, pattern)).astype(np.uint8)
    assert decibels(opencv(measured, pattern, method) / 255, astronaut) == pytest.approx(published, abs=0.05)


def test_looking_where_the_edge_runs_beats_every_fixed_filter(astronaut):
    """Hamilton and Adams lies between Malvar's linear filter and Menon's refinement of it."""
    pattern = BAYER["RGGB"]
    measured = mosaic(astronaut, pattern)
    linear, edges, refined = (decibels(one(measured, pattern), astronaut) for one in (malvar, edge_aware, menon))
    assert linear + 0.5 < edges < refined - 0.3


@pytest.mark.parametrize("name", BAYER)
@pytest.mark.parametrize(
    ("ours", "theirs"),
    [
        (bilinear, colour_demosaicing.demosaicing_CFA_Bayer_bilinear),
        (malvar, colour_demosaicing.demosaicing_CFA_Bayer_Malvar2004),
        (menon, colour_demosaicing.demosaicing_CFA_Bayer_Menon2007),
    ],
)
def test_our_pictures_are_those_of_colour_demosaicing(astronaut, name, ours, theirs):
    """To 1e-9, but for a border where it mirrors the mosaic out of phase. The noise breaks draws between directions,
    which rounding would else decide one way here and the other way there."""
    measured = mosaic(astronaut[100:260, 150:330], BAYER[name]) + 1e-4 * np.random.default_rng(5).random((160, 180))
    inside = np.s_[8:-8, 8:-8]
    np.testing.assert_allclose(ours(measured, BAYER[name])[inside], theirs(measured, name)[inside], atol=1e-9)


@pytest.mark.parametrize("name", BAYER)
def test_our_bilinear_is_opencvs_to_its_rounding(astronaut, name):
    measured = np.rint(255 * mosaic(astronaut, BAYER[name])).astype(np.uint8)
    difference = bilinear(measured, BAYER[name]) - opencv(measured, BAYER[name])
    assert np.abs(difference[1:-1, 1:-1]).max() <= 0.5


def test_opencvs_older_names_are_shifted_by_a_pixel_each_way(astronaut):
    """COLOR_BayerBG2RGB is for the tile RGGB, and gives for BGGR a picture with red and blue exchanged."""
    measured = np.rint(255 * mosaic(astronaut, BAYER["RGGB"])).astype(np.uint8)
    assert cv2.COLOR_BayerRGGB2RGB == cv2.COLOR_BayerBG2RGB
    right, wrong = (cv2.cvtColor(measured, code) / 255 for code in (cv2.COLOR_BayerBG2RGB, cv2.COLOR_BayerRG2RGB))
    assert decibels(right, astronaut) > 30
    assert decibels(wrong, astronaut) < 18
    assert decibels(wrong[..., ::-1], astronaut) > 30


def combinations():
    return [
        (pattern, algorithm)
        for pattern in PATTERNS.values()
        for algorithm in ALGORITHMS
        if algorithm in ANY_PATTERN or pattern.is_bayer
    ]


@pytest.mark.parametrize(("pattern", "algorithm"), combinations())
def test_a_grey_surface_stays_grey_to_the_border(pattern, algorithm):
    flat = np.full((13, 17, 3), 0.4)
    np.testing.assert_allclose(demosaic(mosaic(flat, pattern), pattern, algorithm), 0.4, atol=1e-12)


@pytest.mark.parametrize(("pattern", "algorithm"), combinations())
def test_a_coloured_surface_keeps_its_colour(pattern, algorithm):
    colour = np.array([0.7, 0.4, 0.2]) if pattern != MONOCHROME else np.full(3, 0.4)
    flat = np.broadcast_to(colour, (16, 18, 3))
    shown = demosaic(mosaic(flat, pattern), pattern, algorithm)
    np.testing.assert_allclose(shown, flat, atol=1e-12)


@pytest.mark.parametrize(("pattern", "algorithm"), combinations())
def test_what_a_pixel_measured_is_left_as_it_is(pattern, algorithm, picture):
    measured = mosaic(picture, pattern)
    again = mosaic(demosaic(measured, pattern, algorithm), pattern)
    untouched = pattern.channels(*measured.shape) == WHITE if pattern == RGBW else np.ones_like(measured, bool)
    np.testing.assert_allclose(again[untouched], measured[untouched], atol=1e-12)


@pytest.mark.parametrize("algorithm", ["bilinear", "Malvar", "edge-aware", "Menon"])
@pytest.mark.parametrize("name", BAYER)
def test_a_smooth_slope_is_interpolated_exactly_inside(name, algorithm):
    v, u = np.mgrid[:24, :28] / 40
    slope = np.stack([0.1 + u, 0.1 + u + 0.3 * v, 0.5 - v], axis=-1)
    shown = demosaic(mosaic(slope, BAYER[name]), BAYER[name], algorithm)
    np.testing.assert_allclose(shown[8:-8, 8:-8], slope[8:-8, 8:-8], atol=1e-12)


@pytest.mark.parametrize(
    ("make", "said"),
    [
        (lambda: malvar(np.zeros((8, 8)), XTRANS), "Bayer patterns only, got X-Trans; nearest and bilinear take any"),
        (lambda: menon(np.zeros((3, 8)), BAYER["RGGB"]), r"at least 4 × 4 pixels, got \(3, 8\)"),
        (lambda: demosaic(np.zeros((8, 8)), XTRANS, "magic"), "algorithm must be one of nearest"),
        (lambda: opencv(np.zeros((8, 8)), BAYER["RGGB"]), "values must be uint8 or uint16"),
        (lambda: opencv(np.zeros((8, 8), np.uint16), BAYER["RGGB"], "VNG"), "values must be uint8"),
        (lambda: opencv(np.zeros((8, 8), np.uint8), RGBW), "Bayer patterns only, got RGBW"),
        (lambda: opencv(np.zeros((8, 8), np.uint8), BAYER["RGGB"], "best"), "method must be one of bilinear, EA, VNG"),
    ],
)
def test_what_cannot_be_demosaiced_is_refused_in_one_sentence(make, said):
    with pytest.raises(ValueError, match=said):
        make()


@pytest.mark.parametrize("name", BAYER)
def test_green_from_windows_completes_the_pictures_of_the_algorithms(picture, name):
    """With Malvar's green, a fixed filter of 5 × 5, and with that of any algorithm, its own picture comes out."""
    measured = mosaic(picture, BAYER[name])
    windows = green_windows(measured, BAYER[name])
    weights = np.array([[0, 0, -1, 0, 0], [0, 0, 2, 0, 0], [-1, 2, 4, 2, -1], [0, 0, 2, 0, 0], [0, 0, -1, 0, 0]]) / 8
    filled = with_green(measured, BAYER[name], np.sum(windows * weights, axis=(1, 2)), "Malvar")
    np.testing.assert_allclose(filled, malvar(measured, BAYER[name]), atol=1e-12)
    elsewhere = ~BAYER[name].mask(GREEN, *measured.shape)
    for algorithm in ("nearest", "bilinear", "edge-aware"):
        right = demosaic(measured, BAYER[name], algorithm)
        filled = with_green(measured, BAYER[name], right[elsewhere, GREEN], algorithm)
        np.testing.assert_allclose(filled, right, atol=1e-12)


def test_green_from_windows_takes_bayers_patterns_only():
    with pytest.raises(ValueError, match="Bayer patterns only"):
        green_windows(np.zeros((12, 12)), XTRANS)
