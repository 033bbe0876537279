"""False colour lies where the tile's spectrum says, a birefringent filter takes it away, and the measures see it."""

import warnings
from itertools import pairwise

import cv2
import numpy as np
import pytest

from camviz.mosaics import (
    BAYER,
    MONOCHROME,
    PATTERNS,
    XTRANS,
    bilinear,
    carriers,
    compare,
    demosaic,
    false_colour,
    low_pass,
    mosaic,
    psnr,
    zipper,
    zone_plate,
)
from camviz.mosaics.measures import lab
from camviz.scenes import to_display
from camviz.scenes.photographs import photograph

with warnings.catch_warnings():
    warnings.simplefilter("ignore")
    import colour

RGGB = BAYER["RGGB"]


def grating(fu, fv, size=48):
    v, u = np.mgrid[:size, :size]
    return np.repeat((0.5 + 0.4 * np.cos(2 * np.pi * (fu * u + fv * v)))[..., None], 3, axis=-1)


# Aliasing ------------------------------------------------------------------------------------------------------------


def test_bayers_carriers_are_those_of_alleysson():
    """Red against blue at (½, 0) and (0, ½), green against both at (½, ½)."""
    found = {(one.fu, one.fv): np.real(one.colour).tolist() for one in carriers(RGGB)}
    assert found == {(0.5, 0.5): [1, -1, 1], (0.5, 0): [1, 0, -1], (0, 0.5): [1, 0, -1]}
    assert carriers(MONOCHROME) == ()


def test_xtrans_carries_less_colour_and_nowhere_on_bayers_frequencies():
    """What it was made for: its strongest carrier is weaker than each of Bayer's."""
    places = {(abs(one.fu), abs(one.fv)) for one in carriers(XTRANS)}
    assert not places & {(0.5, 0.5), (0.5, 0), (0, 0.5)}
    assert carriers(XTRANS)[0].strength < min(one.strength for one in carriers(RGGB))


@pytest.mark.parametrize("name", [name for name in PATTERNS if name != "monochrome"])
def test_a_grey_grating_at_a_carrier_is_taken_for_one_even_colour(name):
    """Every red pixel sees the same, and so on: what they see is ½ + 0.4 times the carrier's colour, on average."""
    pattern = PATTERNS[name]
    for carrier in carriers(pattern):
        measured = mosaic(grating(carrier.fu, carrier.fv), pattern)
        seen = [measured[pattern.mask(channel, *measured.shape)].mean() for channel in range(3)]
        np.testing.assert_allclose(seen, 0.5 + 0.4 * np.real(carrier.colour), atol=1e-12)


@pytest.mark.parametrize("distance", [1 / 24, 1 / 12, 1 / 8])
def test_false_colour_beats_at_the_distance_from_the_carrier(distance):
    """Stripes of 0.5 − d cycles/pixel: red − blue of the demosaiced picture has its strongest frequency at d."""
    shown = bilinear(mosaic(grating(0.5 - distance, 0), RGGB), RGGB)
    red_blue = (shown[..., 0] - shown[..., 2])[24]
    spectrum = np.abs(np.fft.rfft(red_blue))
    assert np.fft.rfftfreq(48)[spectrum.argmax()] == pytest.approx(distance, abs=1e-9)


def test_even_patches_of_false_colour_lie_on_the_zone_plate_where_the_carriers_do():
    """Elsewhere false colour beats, and a blur takes it away. Which of the rings around a carrier is the brightest, the
    phase there decides: the first one's radius is sqrt(2 · highest / size) = 0.068 cycles/pixel."""
    plate = zone_plate(256, 0.6)
    shown = np.moveaxis(lab(to_display(bilinear(mosaic(plate, RGGB), RGGB))), 0, -1)
    even = np.linalg.norm(cv2.GaussianBlur(shown, (0, 0), 3)[..., 1:], axis=-1)
    for quarter in (np.s_[120:136, 128:], np.s_[128:, 120:136], np.s_[192:, 192:]):
        v, u = np.argwhere(even == even[quarter].max())[0]
        frequency = (np.array([u, v]) - 127.5) * 2 * 0.6 / 256
        assert min(np.linalg.norm(np.abs(frequency) - (one.fu, one.fv)) for one in carriers(RGGB)) < 0.068
    assert even[100:156, 100:156].max() < even.max() / 6


def test_the_zone_plate_is_the_mean_over_each_pixels_area():
    plate = zone_plate(32, 0.5)[..., 0]
    fine = (np.arange(32 * 40) + 0.5) / 40 - 16
    squared = fine[:, None] ** 2 + fine**2
    rings = 0.5 + 0.5 * np.cos(2 * np.pi * 0.5 / 32 * squared)
    np.testing.assert_allclose(plate, rings.reshape(32, 40, 32, 40).mean(axis=(1, 3)), atol=0.02)


def test_the_zone_plates_rings_are_as_fine_as_promised_at_the_sides():
    """From the middle of a side to the next pixel the phase grows by 2π · highest, less what the circle bends."""
    plate = zone_plate(1024, 0.25)[512, :, 0]
    crossings = np.flatnonzero(np.diff(np.signbit(plate - 0.5)))
    last = np.diff(crossings[-9:]).mean()
    assert 1 / (2 * last) == pytest.approx(0.25, rel=0.03)


# The optical low-pass filter -----------------------------------------------------------------------------------------


def test_four_spots_are_the_mean_of_four_pictures():
    picture = np.random.default_rng(3).random((20, 26, 3))
    four = sum(np.roll(picture, shift, axis=(0, 1)) for shift in ((1, 1), (1, -1), (-1, 1), (-1, -1))) / 4
    np.testing.assert_allclose(low_pass(picture, 2)[1:-1, 1:-1], four[1:-1, 1:-1], atol=1e-6)


@pytest.mark.parametrize("spots", [0.3, 0.7, 1.0])
@pytest.mark.parametrize("frequency", [1 / 8, 1 / 4, 3 / 8])
def test_a_grating_keeps_the_cosine_of_its_contrast(spots, frequency):
    u = np.arange(64) + 0.5  # mirrored at its borders, the grating goes on
    stripes = np.broadcast_to(np.cos(2 * np.pi * frequency * u)[None, :, None], (64, 64, 3))
    np.testing.assert_allclose(low_pass(stripes, spots), np.cos(np.pi * spots * frequency) * stripes, atol=1e-5)


def test_spots_one_pixel_apart_take_bayers_false_colour_away():
    plate = zone_plate(256, 0.5)
    sharp, filtered = (
        false_colour(to_display(bilinear(mosaic(low_pass(plate, spots), RGGB), RGGB)), to_display(plate))
        for spots in (0, 1)
    )
    assert filtered < sharp / 2.5


# Measures ------------------------------------------------------------------------------------------------------------


@pytest.fixture(scope="module")
def pair():
    truth = photograph("astronaut")[:96, 180:300]
    shown = np.clip(255 * bilinear(mosaic(truth / 255, RGGB), RGGB), 0, 255).astype(np.uint8)
    return shown, truth


def test_psnr_is_opencvs(pair):
    assert psnr(*pair) == pytest.approx(cv2.PSNR(*pair), abs=1e-4)
    assert psnr(pair[1], pair[1]) == np.inf


def test_lab_is_that_of_colour_science(pair):
    white = colour.CCS_ILLUMINANTS["CIE 1931 2 Degree Standard Observer"]["D65"]
    theirs = colour.XYZ_to_Lab(colour.sRGB_to_XYZ(pair[0] / 255), white)
    np.testing.assert_allclose(np.moveaxis(lab(pair[0]), 0, -1), theirs, atol=0.05)


def test_false_colour_is_blind_to_brightness_and_sees_a_tint():
    grey = np.full((20, 20, 3), 0.5)
    assert false_colour(grey + 0.2, grey) < 1e-3
    assert false_colour(grey + (0.05, 0, 0), grey) > 2


def test_zipper_is_what_lu_and_tan_say(pair):
    """Pixel by pixel, from the definition."""
    given, true = (np.moveaxis(lab(one / 255), 0, -1) for one in pair)
    height, width = true.shape[:2]
    counted = 0
    for v in range(height):
        for u in range(width):
            around = [
                (v + dv, u + du)
                for dv in (-1, 0, 1)
                for du in (-1, 0, 1)
                if (dv or du) and 0 <= v + dv < height and 0 <= u + du < width
            ]
            likest = min(around, key=lambda at: np.linalg.norm(true[at] - true[v, u]))
            before, after = (np.linalg.norm(one[likest] - one[v, u]) for one in (true, given))
            counted += abs(after - before) > 2.3
    assert zipper(*pair) == pytest.approx(counted / (height * width), abs=0.002)  # where two neighbours are as like


def test_better_algorithms_are_better_by_every_measure(pair):
    truth = pair[1]
    measured = mosaic(truth / 255, RGGB)
    order = [compare(demosaic(measured, RGGB, one), truth) for one in ("nearest", "bilinear", "Malvar", "Menon")]
    for worse, better in pairwise(order):
        assert better.psnr_db > worse.psnr_db
        assert better.false_colour < worse.false_colour
        assert better.zipper < worse.zipper
    found = compare(*pair)
    assert (found.psnr_db, found.false_colour, found.zipper) == (psnr(*pair), false_colour(*pair), zipper(*pair))


@pytest.mark.parametrize(
    ("make", "said"),
    [
        (lambda: psnr(np.zeros((4, 4)), np.zeros((4, 4))), "must have the shape"),
        (lambda: zipper(np.zeros((4, 4, 3)), np.zeros((4, 5, 3))), "must be of one size"),
        (lambda: low_pass(np.zeros((4, 4, 3)), -1), "spots_px"),
        (lambda: zone_plate(4, 0.5), "size must be at least 8"),
        (lambda: zone_plate(64, 0), "highest"),
    ],
)
def test_what_cannot_be_measured_is_refused_by_name(make, said):
    with pytest.raises(ValueError, match=said):
        make()
