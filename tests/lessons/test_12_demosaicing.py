"""What lesson 12 says about colour filter arrays, recomputed with NumPy, SciPy, OpenCV and colour-science."""

import re
import sys
import types
import warnings

import cv2
import numpy as np
import pytest
from quoting import LESSONS
from scipy.ndimage import convolve

from camviz import mosaics
from camviz.mosaics import BAYER, PATTERNS
from camviz.scenes.photographs import photograph
from camviz_school.course import notebooks
from camviz_school.course.checks import judge
from camviz_school.course.exercises import exercise
from camviz_school.course.material import module
from camviz_school.views.demosaicing import DemosaicingView

lesson12 = module("12")

with warnings.catch_warnings():
    warnings.simplefilter("ignore")  # it imports from where SciPy will not keep things
    import colour
    import colour_demosaicing

EXCEPTIONS: dict[str, str] = {}

JUST_NOTICEABLE = 2.3
"""ΔE*ab that a person notices (M. Mahy, L. Van Eycken and A. Oosterlinck, Color Research and Application 19, 1994)."""
RGGB = np.array([[0, 1], [1, 2]])
X_TRANS = np.array(
    [
        [1, 1, 0, 1, 1, 2],  # GGRGGB
        [1, 1, 2, 1, 1, 0],  # GGBGGR
        [2, 0, 1, 0, 2, 1],  # BRGRBG
        [1, 1, 2, 1, 1, 0],  # GGBGGR
        [1, 1, 0, 1, 1, 2],  # GGRGGB
        [0, 2, 1, 2, 0, 1],  # RBGBRG
    ]
)
RGBW = np.array([[1, 3, 0, 3], [3, 1, 3, 0], [2, 3, 1, 3], [3, 2, 3, 1]])  # GWRW WGWR BWGW WBWG


def filters(shape, tile):
    """The channel that each pixel measures."""
    return np.tile(tile, [size // n + 1 for size, n in zip(shape, tile.shape, strict=True)])[: shape[0], : shape[1]]


def sampled(light, tile):
    return np.take_along_axis(light, filters(light.shape[:2], tile)[..., None], axis=-1)[..., 0]


def spread(values, seen):
    """The mean of the pixels around that were seen, the nearer ones counting more; what was seen stays."""
    tent = np.outer([1, 2, 1], [1, 2, 1])
    near = convolve(seen.astype(float), tent, mode="constant")
    mean = convolve(values * seen, tent, mode="constant") / np.where(near > 0, near, np.inf)  # 0 in a corner without
    return np.where(seen, values, mean)


def bilinear(measured, tile):
    return np.stack([spread(measured, filters(measured.shape, tile) == channel) for channel in range(3)], axis=-1)


def hamilton_adams(measured):
    """Green along the way that changes less, then bilinear interpolation of the differences to green; RGGB."""
    padded = np.pad(measured, 2, mode="reflect")
    windows = np.lib.stride_tricks.sliding_window_view(padded, (5, 5))
    seen = filters(measured.shape, RGGB)
    row, column = windows[..., 2, :], windows[..., :, 2]
    bends = [2 * line[..., 2] - line[..., 0] - line[..., 4] for line in (row, column)]
    across, down = (
        np.abs(line[..., 1] - line[..., 3]) + np.abs(bend) for line, bend in zip((row, column), bends, strict=True)
    )
    ways = [(line[..., 1] + line[..., 3]) / 2 + bend / 4 for line, bend in zip((row, column), bends, strict=True)]
    chosen = np.where(across < down, ways[0], np.where(down < across, ways[1], sum(ways) / 2))
    green = np.where(seen == 1, measured, chosen)
    return np.stack([green + spread(measured - green, seen == c) if c != 1 else green for c in range(3)], axis=-1)


def zone_plate(size, highest):
    """Rings whose frequency grows evenly to `highest` at the sides, each pixel the mean over four by four points."""
    fine = (np.arange(4 * size) + 0.5) / 4 - size / 2
    rings = 0.5 + 0.5 * np.cos(2 * np.pi * highest / size * (fine[:, None] ** 2 + fine**2))
    return np.repeat(rings.reshape(size, 4, size, 4).mean(axis=(1, 3))[..., None], 3, axis=-1)


def behind_quartz(light, d):
    """Four spots d apart: cos(π d f) of each frequency, in a picture that is mirrored at its borders."""
    mirrored = np.concatenate([light, light[::-1]])
    mirrored = np.concatenate([mirrored, mirrored[:, ::-1]], axis=1)
    kept = [np.cos(np.pi * d * np.fft.fftfreq(n)) for n in mirrored.shape[:2]]
    passed = np.fft.ifft2(np.fft.fft2(mirrored, axes=(0, 1)) * np.outer(*kept)[..., None], axes=(0, 1)).real
    return passed[: light.shape[0], : light.shape[1]]


def encoded(light):
    """sRGB bytes of linear light."""
    return np.rint(255 * colour.cctf_encoding(np.clip(light, 0, 1), function="sRGB")).astype(np.uint8)


def decoded(picture):
    return colour.cctf_decoding(picture / 255, function="sRGB")


def decibels(picture, truth):
    return -10 * np.log10(np.mean((picture / 255 - truth / 255) ** 2))


def false_colour(picture, truth):
    """The mean distance in the a*b* plane of CIELAB."""
    labs = [colour.XYZ_to_Lab(colour.sRGB_to_XYZ(one / 255)) for one in (picture, truth)]
    return np.hypot(*np.moveaxis(np.subtract(*labs)[..., 1:], -1, 0)).mean()


def strength(tile, fu, fv):
    """How colourful the means of the red, green and blue pixels become by a grey grating of height 1."""
    v, u = np.mgrid[: tile.shape[0], : tile.shape[1]]
    wave = np.exp(2j * np.pi * (fu * u + fv * v))
    added = np.array([wave[tile == channel].mean() for channel in range(3)])
    return np.linalg.norm(added - added.mean())


def strengths(tile):
    """By frequency (fu, fv) of the tile's own, all that are not zero, one of f and −f."""
    height, width = tile.shape
    found = {}
    for row, column in np.ndindex(height, width):
        mirror = (-row % height, -column % width)
        if (row, column) <= mirror and strength(tile, column / width, row / height) > 1e-9:
            found[column / width, row / height] = strength(tile, column / width, row / height)
    return found


def stripes(f, height=16, width=400):
    return np.broadcast_to((0.5 + 0.4 * np.cos(2 * np.pi * f * np.arange(width)))[None, :, None], (height, width, 3))


def beat(f):
    """The strongest frequency of red − blue in stripes of f under RGGB, interpolated bilinearly."""
    shown = bilinear(sampled(stripes(f), RGGB), RGGB)[8]
    spectrum = np.abs(np.fft.rfft(shown[:, 0] - shown[:, 2]))
    return np.fft.rfftfreq(400)[spectrum.argmax()]


@pytest.fixture(scope="module")
def plate():
    return zone_plate(256, 0.6)


@pytest.fixture(scope="module")
def astronaut():
    """In linear light, averaged two by two pixels."""
    light = decoded(photograph("astronaut"))
    return light.reshape(256, 2, 256, 2, 3).mean(axis=(1, 3))


# Part 1 --------------------------------------------------------------------------------------------------------------


def test_two_thirds_of_a_photograph_are_interpolated(says):
    pixels, again, numbers = says(
        "A camera of 12 megapixels gives you a colour photograph: 12 million pixels with red, green and blue, 36 "
        "million numbers."
    )
    assert pixels == again.value
    assert numbers == 3 * pixels.value
    (all_of_them,) = says("All 36 million: every pixel measures three colours.")
    assert all_of_them == numbers.value
    (one_each,) = says("12 million: one of each pixel's three numbers.")
    assert one_each == sampled(np.zeros((300, 400, 3)), RGGB).size / 120_000 * pixels.value
    says("two thirds of every photograph are interpolated")
    says("half of the pixels measure green, a quarter red, a quarter blue")
    assert [np.mean(channel == RGGB) for channel in range(3)] == [1 / 4, 1 / 2, 1 / 4]


def test_four_pixels_in_one_would_be_a_quarter_of_the_pixels(says):
    (nine,) = says("9 million: four pixels, red, green, green and blue, make one.")
    (three,) = says("That would make 3 million pixels of three numbers each")
    megapixels, measured, made_up = says(
        "But a camera of 12 megapixels counts its single filters, and gives a full colour to each: it measures 12 "
        "million numbers and makes up 24 million."
    )
    assert three == megapixels.value / 4
    assert nine == 3 * three.value
    assert measured == megapixels.value
    assert made_up == 3 * megapixels.value - measured.value


def test_grey_stripes_come_out_blue_under_the_loupe_and_orange_with_the_filters_moved(says, plate):
    says("Through the filters RGGB the loupe comes out blue there.")
    says("It becomes orange.")
    says("The bright stripes fell on the blue pixels, and now they fall on the red ones.")
    says("In the middle of its coloured spot at the right side, the rings are upright stripes")
    u, v = DemosaicingView().at
    assert DemosaicingView().frequency == pytest.approx((0.5, 0), abs=0.003)
    assert np.ptp(plate[v, u]) == 0
    for tile, kind in ((RGGB, 1), (RGGB[:, ::-1], -1)):  # RG GB, and GR BG
        red, green, blue = bilinear(sampled(plate, tile), tile)[v - 7 : v + 7, u - 7 : u + 7].mean(axis=(0, 1))
        assert kind * blue > kind * green > kind * red
        seen, near = filters(plate.shape[:2], tile), np.s_[v - 3 : v + 3, u - 3 : u + 3]
        assert kind * (plate[near][seen[near] == 2].mean() - plate[near][seen[near] == 0].mean()) > 0.3


def test_the_spots_walk_with_the_fineness_of_the_rings_and_leave_with_coarse_ones(says):
    says("Every ring in this picture is grey. The colours came out of a camera.")
    says("Pull **finest rings** to the left, slowly, and watch where the colours go.")
    says("they belong to a fineness, not to a place on the sensor")
    finest, control = DemosaicingView().highest, DemosaicingView.controls()["highest"]
    spots = [(fu, fv) for fu in (-0.5, 0, 0.5) for fv in (-0.5, 0, 0.5) if fu or fv]
    assert np.abs(spots).max() <= finest
    assert all(max(map(abs, spot)) > control.low for spot in spots)
    blurred, fine = {}, {}
    for highest in (finest, 0.4, control.low):
        shown = bilinear(sampled(zone_plate(256, highest), RGGB), RGGB)
        tint = shown - shown.mean(axis=-1, keepdims=True)
        blurred[highest] = np.abs(cv2.GaussianBlur(tint, (0, 0), 3)[20:-20, 20:-20]).max()
        fine[highest] = np.abs(tint).mean()
    assert blurred[0.4] < blurred[finest] / 4
    assert fine[control.low] < fine[finest] / 2


def test_the_two_kinds_of_false_colour(says):
    says("the stripes come out orange or blue")
    says("In the corners green stands against magenta")
    v, u = np.mgrid[:16, :16]
    for phase in (1, -1):
        across, both = (
            (0.5 + 0.4 * phase * wave)[..., None].repeat(3, -1) for wave in ((-1.0) ** u, (-1.0) ** (u + v))
        )
        red, green, blue = bilinear(sampled(across, RGGB), RGGB)[4:12, 4:12].mean(axis=(0, 1))
        assert phase * red > phase * green > phase * blue  # orange, or the blue of the sky
        red, green, blue = bilinear(sampled(both, RGGB), RGGB)[4:12, 4:12].mean(axis=(0, 1))
        assert phase * red > phase * green
        assert red == pytest.approx(blue)


def test_what_a_person_notices(says):
    (about,) = says("A person notices about 2.")
    assert about.about(JUST_NOTICEABLE, 0.15)
    (threshold,) = says("whose contrast to that neighbour changed by more than a person notices, 2.3 units of CIELAB")
    assert threshold == JUST_NOTICEABLE


# Part 2 --------------------------------------------------------------------------------------------------------------


def test_the_channels_of_a_tile(says):
    (blue,) = says("The tile of filters is a small array of channels (0 red, 1 green, 2 blue).")
    assert blue == "RGB".index("B")
    (channels,) = says("arrays of shape (height, width, 3), a cosine")
    assert channels == photograph("astronaut").shape[2]
    (own,) = says("Any picture, as bytes of shape (height, width, 3)")
    assert own == channels.value


def test_the_pixel_taken_by_hand_is_green_and_its_tile_begins_again_after_two(says):
    row, column = says("Take one pixel, in row 100 and column 241:")
    next_row, next_column = says(
        "Row 102 or column 243 would do the same, because the tile begins again after two pixels."
    )
    seen = filters((300, 300), RGGB)
    place = int(row.value), int(column.value)
    assert seen[place] == seen[int(next_row.value), place[1]] == seen[place[0], int(next_column.value)] == 1
    assert (next_row.value - row.value, next_column.value - column.value) == RGGB.shape
    v, u = says("Green first, for one pixel: (100, 240) has a red filter.")
    assert seen[int(v.value), int(u.value)] == 0


def test_red_helps_the_green_that_is_guessed_by_hand(says):
    rows, columns = says(
        "Here are 5 × 5 pixels of her eye's mosaic, in per cent of white, with a red pixel in the middle"
    )
    light = decoded(photograph("astronaut")[:240, :320])
    window = 100 * sampled(light, RGGB)[104:109, 244:249]
    assert window.shape == (rows.value, columns.value)
    assert filters((300, 300), RGGB)[106, 246] == 0
    says("Red is darker here than around, so green is likely to be darker too.")
    says("Half of what red stands out by brings the guess nearer to the truth.")
    greens = np.mean([window[1, 2], window[3, 2], window[2, 1], window[2, 3]])
    reds = np.mean([window[0, 2], window[4, 2], window[2, 0], window[2, 4]])
    truth = 100 * light[106, 246, 1]
    assert window[2, 2] < reds
    assert abs(greens + (window[2, 2] - reds) / 2 - truth) < abs(greens - truth)
    np.testing.assert_array_equal(np.rint(window)[[1, 2, 2, 3], [2, 1, 3, 2]], [3, 16, 9, 33])  # as the cell has them
    np.testing.assert_array_equal(np.rint(window)[[0, 2, 2, 4, 2], [2, 0, 4, 2, 2]], [2, 45, 19, 58, 17])


def test_the_highlight_in_her_eye_turns_blue(says):
    says("Her eye is brown.")
    says("the highlight in her eye turns blue")
    light = decoded(photograph("astronaut")[:240, :320])
    eye = np.s_[90:124, 222:272]
    pupil = np.s_[100:106, 244:249]
    truth, shown = light[eye], bilinear(sampled(light, RGGB), RGGB)[eye]
    assert (
        (shown[..., 2] - shown[..., :2].max(axis=-1)).max()
        > 0.2
        > 0.1
        > (truth[..., 2] - truth[..., :2].max(axis=-1)).max()
    )
    red, green, blue = light[pupil].mean(axis=(0, 1))
    assert red > green > blue


def test_opencv_copies_the_next_row_at_the_border(says):
    says("there the difference may be half a step, and no more")
    measured = np.random.default_rng(1).integers(0, 256, (20, 26)).astype(np.uint8)
    theirs = cv2.cvtColor(measured, cv2.COLOR_BayerRGGB2RGB)
    np.testing.assert_array_equal(theirs[0], theirs[1])
    np.testing.assert_array_equal(theirs[:, -1], theirs[:, -2])
    assert np.abs(bilinear(measured.astype(float), RGGB) - theirs)[1:-1, 1:-1].max() <= 0.5


def test_opencvs_old_names_spell_the_second_row(says):
    says("OpenCV's old names spell the *second* row's second and third pixels.")
    says("OpenCV's `RG` is for a mosaic that begins BGGR.")
    says("Red and blue are exchanged; greys are right.")
    tiles = {"RGGB": "BG", "BGGR": "RG", "GRBG": "GB", "GBRG": "GR"}
    for tile, old in tiles.items():
        assert getattr(cv2, f"COLOR_Bayer{tile}2RGB") == getattr(cv2, f"COLOR_Bayer{old}2RGB")
        second_row = 2 * tile[2:]
        assert second_row[1:3] == old
    colours = np.broadcast_to(np.uint8([200, 120, 40]), (12, 12, 3))
    taken = cv2.cvtColor(np.ascontiguousarray(sampled(colours, RGGB)), cv2.COLOR_BayerRG2RGB)
    assert taken[5, 5].tolist() == [40, 120, 200]


def test_a_phase_off_by_one_row_mixes_up_green(says):
    says("That comes about when the phase is off by one column or one row: then green pixels are read as red and blue.")
    grey = np.uint8([[[200, 120, 40]]]).repeat(12, 0).repeat(12, 1)
    taken = cv2.cvtColor(np.ascontiguousarray(sampled(grey, RGGB)), cv2.COLOR_BayerGRBG2RGB)
    assert 120 in taken[5:7, 5:7, 0]
    assert 120 in taken[5:7, 5:7, 2]
    assert {40, 200} & set(taken[5:7, 5:7, 1].ravel().tolist())


# Part 3 --------------------------------------------------------------------------------------------------------------


def test_stripes_of_half_a_cycle_are_orange_to_red_and_blue_but_not_to_green(says):
    says("So all red pixels see bright stripes and all blue ones dark stripes, or the other way round.")
    says("the stripes come out orange or blue")
    says("on an orange surface they would all be alike, and here they are bright in one row and dark in the next")
    measured = sampled(stripes(0.5), RGGB)
    assert np.ptp(measured[::2, ::2]) < 1e-12
    assert np.ptp(measured[1::2, 1::2]) < 1e-12
    assert measured[0, 0] > measured[1, 1]
    assert measured[1, 0] > measured[0, 1] + 0.5  # green
    for moved, kind in ((0, 1), (1, -1)):
        shown = bilinear(sampled(np.roll(stripes(0.5), moved, axis=1), RGGB), RGGB)[4:12, 4:12].mean(axis=(0, 1))
        assert (np.diff(shown) * kind < 0).all()


def test_a_grey_chessboard_is_an_even_magenta_to_the_sensor(says):
    says("a grey chessboard of single pixels is bright at all red and all blue pixels, and dark at all green ones")
    says("An evenly magenta surface gives the very same numbers.")
    v, u = np.mgrid[:12, :12]
    board = np.repeat(np.where((u + v) % 2 == 0, 0.9, 0.1)[..., None], 3, axis=-1)
    magenta = np.broadcast_to([0.9, 0.1, 0.9], (12, 12, 3))
    np.testing.assert_array_equal(sampled(board, RGGB), sampled(magenta, RGGB))


def test_the_equation_and_the_mask(says):
    first, second = says("The mask of the red filters is ¼ (1 + (−1)ᵘ)(1 + (−1)ᵛ): 1 at even u and v, else 0.")
    v, u = np.mgrid[:6, :8]
    np.testing.assert_array_equal(0.25 * (1 + first.value**u) * (1 + second.value**v), (u % 2 == 0) & (v % 2 == 0))
    (base,) = says("(−1)ᵘ is cos(2π · ½ · u), a wave of ½ cycle per pixel")
    np.testing.assert_allclose(base.value**u, np.cos(np.pi * u), atol=1e-12)
    R, G, B = np.moveaxis(np.random.default_rng(3).random((6, 8, 3)), -1, 0)
    m = (R + 2 * G + B) / 4 + (R - B) / 4 * ((-1.0) ** u + (-1.0) ** v) + (R - 2 * G + B) / 4 * (-1.0) ** (u + v)
    np.testing.assert_allclose(m, sampled(np.stack([R, G, B], axis=-1), RGGB), atol=1e-12)


def test_the_numbers_under_taken_for_colour(says):
    (green,) = says("It adds (1, −1, 1) to what the red, green and blue pixels measure.")
    added = np.array([1, green.value, 1])
    assert added.mean() == pytest.approx(1 / 3)
    minus_one, length = says("What is left, (⅔, −1⅓, ⅔), is colour, and its length is the 1.63 of the list.")
    left = added - added.mean()
    np.testing.assert_allclose(left, [2 / 3, minus_one.value - 1 / 3, 2 / 3])
    assert length == np.linalg.norm(left)
    assert length == strength(RGGB, 0.5, 0.5)
    blue, length = says("Vertical stripes add (1, 0, −1), which has no grey part: their length is 1.41.")
    assert length == np.linalg.norm([1, 0, blue.value])
    assert length == strength(RGGB, 0.5, 0)
    listed = re.findall(r">(\(.{1,2}, .{1,2}\))</text><text[^>]*>(\d\.\d\d)</text>", DemosaicingView().figure().svg())
    assert listed == [("(½, ½)", "1.63"), ("(½, 0)", "1.41"), ("(0, ½)", "1.41")]


def test_the_beat_is_the_distance_from_the_carrier(says):
    f, half, again, period = says(
        "So stripes of 0.45 cycles per pixel should give bands of colour that repeat every 1 / (0.5 − 0.45) = 20 "
        "pixels."
    )
    assert f.value == again.value
    assert 1 / (half.value - again.value) == pytest.approx(period.value)
    assert 1 / beat(f.value) == pytest.approx(period.value)


def test_the_quiz_about_the_shirt(says):
    (f,) = says("A shirt has vertical stripes, 0.48 cycles per pixel on a Bayer sensor.")
    (wide,) = says("Bands of orange and blue, about 50 pixels wide from orange to orange.")
    (too,) = says("Bands of green and magenta, about 50 pixels wide.")
    half, minus, away, width = says("Yes: 0.5 − 0.48 = 0.02 cycles per pixel, one band in 50 pixels")
    assert minus.value == f.value
    assert away == half.value - f.value
    assert width == 1 / beat(f.value)
    assert wide == width.value
    assert too == width.value
    (fine,) = says("Colours that change every 2 pixels, as fine as the stripes.")
    assert fine == 1 / f.value
    frequency, period = says(
        "It beats with the distance from the carrier: 0.02 cycles per pixel, a period of 50 pixels."
    )
    assert frequency == beat(f.value)
    assert period == 1 / beat(f.value)


def test_the_quiz_about_the_crop(says):
    says("Yes: the second row, G B, is first now, and R G follows.")
    says("That is without the first column.")
    laid_out = np.tile(RGGB, (2, 2))
    letters = np.array(list("RGB"))
    assert "".join(letters[laid_out[1:3, :2]].ravel()) == "GBRG"
    assert "".join(letters[laid_out[:2, 1:3]].ravel()) == "GRBG"


# Part 4 --------------------------------------------------------------------------------------------------------------


def test_at_the_four_sides_menon_finds_grey_and_not_in_the_corners(says, plate):
    says("At the four sides the colours are gone")
    says("In the corners the colours stay, because no number speaks against them.")
    measured = sampled(plate, RGGB)
    tint = {}
    for name, shown in (
        ("bilinear", bilinear(measured, RGGB)),
        ("Menon", colour_demosaicing.demosaicing_CFA_Bayer_Menon2007(measured, "RGGB")),
        ("ours", mosaics.menon(measured, BAYER["RGGB"])),
    ):
        smooth = cv2.GaussianBlur(np.ptp(shown, axis=-1), (0, 0), 2)
        side, corner = round(127.5 + 0.5 * 256 / 1.2), round(127.5 - 0.5 * 256 / 1.2)
        tint[name] = smooth[128, side], smooth[corner, corner]
    for name in ("Menon", "ours"):
        assert tint[name][0] < tint["bilinear"][0] / 5
        assert tint[name][1] > tint["bilinear"][1] / 2


def test_the_better_green_is_another_one_on_another_picture(says, plate, astronaut):
    fixed, looked, fixed_too, looked_too = says(
        "On the zone plate Malvar's green leaves less false colour than the edge-aware one, ΔC of 13.9 against 18.6. "
        "On the astronaut it leaves more, 3.9 against 3.0."
    )
    weights = np.array([[0, 0, -1, 0, 0], [0, 0, 2, 0, 0], [-1, 2, 4, 2, -1], [0, 0, 2, 0, 0], [0, 0, -1, 0, 0]]) / 8
    for picture, by_malvar, by_edges in ((plate, fixed, looked), (astronaut, fixed_too, looked_too)):
        measured, truth = sampled(picture, RGGB), encoded(picture)
        seen = filters(measured.shape, RGGB)
        green = np.where(seen == 1, measured, convolve(measured, weights, mode="mirror"))
        whole = np.stack([green + spread(measured - green, seen == c) if c != 1 else green for c in range(3)], axis=-1)
        assert by_malvar == false_colour(encoded(whole), truth)
        assert by_edges == false_colour(encoded(hamilton_adams(measured)), truth)


def test_opencvs_edge_aware_is_little_better_than_bilinear(says):
    says("It is so in green only, and little better than bilinear.")
    (border,) = says("the photograph as it is stored, RGGB, 10 pixels of border left out")
    stored = photograph("astronaut")
    measured = np.ascontiguousarray(sampled(stored, RGGB))
    inside = np.s_[int(border.value) : -int(border.value), int(border.value) : -int(border.value)]
    names = ("COLOR_BayerRGGB2RGB", "COLOR_BayerRGGB2RGB_EA", "COLOR_BayerRGGB2RGB_VNG")
    plain, aware, vng = (
        decibels(cv2.cvtColor(measured, getattr(cv2, name))[inside], stored[inside].astype(float)) for name in names
    )
    assert 0 < aware - plain < 0.2 < 3 < vng - plain
    pictures = [cv2.cvtColor(measured, getattr(cv2, name)) for name in names[:2]]
    green = [np.any(picture[..., 1] != pictures[0][..., 1]) for picture in pictures]
    assert green == [False, True]
    shown = "".join(out.get("text", "") for cell in lesson().cells for out in cell.get("outputs", []))
    assert f"OpenCV EA        {aware:.2f} dB" in shown  # the table left out the same border


def test_the_order_changes_from_one_picture_to_the_next(says, astronaut):
    menon, edge_aware = says("There Menon reaches 30.85 dB and edge-aware 31.05 dB: the order has changed.")
    truth, measured = encoded(astronaut), sampled(astronaut, RGGB)
    assert edge_aware == decibels(encoded(hamilton_adams(measured)), truth)
    theirs = colour_demosaicing.demosaicing_CFA_Bayer_Menon2007(measured, "RGGB")
    ours = mosaics.menon(measured, BAYER["RGGB"])
    assert menon == decibels(encoded(ours), truth)
    assert decibels(encoded(theirs)[4:-4, 4:-4], truth[4:-4, 4:-4]) == pytest.approx(
        decibels(encoded(ours)[4:-4, 4:-4], truth[4:-4, 4:-4]), abs=0.05
    )
    stored = photograph("astronaut") / 255
    ours, other = mosaics.menon(sampled(stored, RGGB), BAYER["RGGB"]), hamilton_adams(sampled(stored, RGGB))
    assert np.mean((ours - stored) ** 2) < np.mean((other - stored) ** 2)


def test_a_picture_that_was_interpolated_holds_less_that_is_hard_to_guess(says, astronaut):
    says("so it holds little that is hard to guess")
    interpolated, smoothed = bilinear(sampled(astronaut, RGGB), RGGB), cv2.GaussianBlur(astronaut, (0, 0), 0.7)
    reached = []
    for picture in (astronaut, interpolated, smoothed):
        again = bilinear(sampled(picture, RGGB[:, ::-1]), RGGB[:, ::-1])  # by another phase
        reached.append(decibels(encoded(again), encoded(picture)))
    assert reached[1] > reached[0] + 1
    assert reached[2] > reached[0] + 4


def test_the_filters_of_malvar_are_five_pixels_wide(says):
    rows, columns = says("It is one filter of 5 × 5 pixels for each case, the same everywhere, without decisions.")
    again, once_more = says("Windows of 5 × 5 pixels of a Bayer mosaic")
    others, too = says("You get windows of 5 × 5 pixels of a Bayer mosaic, each centred on a red or a blue pixel.")
    assert (others.value, too.value) == (again.value, once_more.value)
    point = np.zeros((21, 21))
    point[10, 10] = 1.0
    reach = np.argwhere(np.abs(colour_demosaicing.demosaicing_CFA_Bayer_Malvar2004(point, "RGGB")).sum(axis=-1) > 1e-9)
    assert np.ptp(reach, axis=0).tolist() == [rows.value - 1, columns.value - 1]
    assert (again.value, once_more.value) == (rows.value, columns.value)


def test_what_decibels_say(says):
    (factor,) = says(
        "The usual measure is the peak signal-to-noise ratio (PSNR), 10 log₁₀(1 / mean squared error), in dB."
    )
    noisy = np.clip(np.full((40, 40, 3), 100) + np.random.default_rng(0).integers(-9, 10, (40, 40, 3)), 0, 255)
    flat = np.full((40, 40, 3), 100, np.uint8)
    assert factor.value * np.log10(255**2 / np.mean((noisy - 100.0) ** 2)) == pytest.approx(
        cv2.PSNR(noisy.astype(np.uint8), flat)
    )
    good, one_in = says("is 36 dB good? It is a mean squared error of 1/4000")
    assert one_in.about(10 ** (good.value / 10), 0.01)


# Part 5 --------------------------------------------------------------------------------------------------------------


def test_xtrans_has_more_and_weaker_carriers(says, plate):
    (period,) = says("repeats after 6 pixels, and every row and column holds all three colours")
    assert X_TRANS.shape == (period.value, period.value)
    assert all(set(line) == {0, 1, 2} for line in (*X_TRANS, *X_TRANS.T))
    np.testing.assert_array_equal(X_TRANS, PATTERNS["X-Trans"].tile)
    says("It has six carriers in place of Bayer's three")
    carriers = strengths(X_TRANS)
    assert len(carriers) == 6
    assert len(strengths(RGGB)) == 3
    strongest, bayer = says("the strongest has 1.06, where Bayer's has 1.63")
    assert strongest == max(carriers.values())
    assert bayer == max(strengths(RGGB).values())
    (third,) = says("Vertical stripes of ½ cycle per pixel do no harm now; those of ⅓ do a little, 0.37.")
    assert third == strength(X_TRANS, 1 / 3, 0)
    assert strength(X_TRANS, 0.5, 0) < 1e-12
    x_trans, rggb = says("ΔC is 27.9 on average, under RGGB 25.5")
    truth = encoded(plate)
    for said, tile in ((x_trans, X_TRANS), (rggb, RGGB)):
        shown = bilinear(sampled(plate, tile), tile)
        assert said == false_colour(encoded(shown), truth)


def test_rgbw_has_an_eighth_of_red_and_carriers_at_a_quarter(says):
    says("gives half of its pixels no filter at all")
    says("There remain an eighth of the pixels for red and an eighth for blue.")
    np.testing.assert_array_equal(RGBW, PATTERNS["RGBW"].tile)
    assert [np.mean(channel == RGBW) for channel in (0, 2, 3)] == [1 / 8, 1 / 8, 1 / 2]
    (strongest,) = says("The strongest carrier is as strong as Bayer's, 1.63, and lies at ¼ cycle per pixel")
    found = strengths(RGBW)
    (fu, fv), most = max(found.items(), key=lambda item: item[1])
    assert strongest == most
    assert most == pytest.approx(strength(RGGB, 0.5, 0.5))
    assert {min(f, 1 - f) for f in (fu, fv)} == {0.25}


def test_the_four_phases_differ_in_phase_only(says, plate):
    says("where the filters are moved by one column, orange and blue change places")
    truth, at = encoded(plate), round(127.5 + 0.5 * 256 / 1.2)
    figures, spots = [], []
    for tile in (RGGB, RGGB[:, ::-1], RGGB[::-1], RGGB[::-1, ::-1]):
        shown = bilinear(sampled(plate, tile), tile)
        figures.append(round(false_colour(encoded(shown), truth), 1))
        spots.append(np.sign(np.diff(shown[122:134, at - 6 : at + 6].mean(axis=(0, 1))))[0])
    assert len(set(figures)) == 1
    assert set(spots) == {-1.0, 1.0}


# Part 6 --------------------------------------------------------------------------------------------------------------


def test_quartz_takes_false_colour_and_detail(says, plate):
    (end,) = says("Move **blur before sampling** from 0 to 1 and on to 1.5.")
    assert end.value == DemosaicingView().controls()["spots_px"].high
    before, after, at = says("It falls from 25.5 to 6.3 at 1 px.")
    says("The fine rings fade as well: the blur takes detail too.")
    truth, tint, contrast = encoded(plate), {}, {}
    for d in (0, 1, end.value):
        shown = bilinear(sampled(behind_quartz(plate, d), RGGB), RGGB)
        tint[d] = false_colour(encoded(shown), truth)
        contrast[d] = shown.mean(axis=-1)[100:156, 200:220].std()
    assert before == tint[0]
    assert after == tint[at.value]
    assert contrast[1] < contrast[0] / 2


def quad(tile=RGGB):
    return np.kron(tile, np.ones((2, 2), int))


def test_quad_bayer_has_its_carriers_at_a_quarter(says):
    (strongest,) = says(
        "Stripes of ½ cycle per pixel do no harm, but all its carriers lie at ¼: the strongest has 1.00."
    )
    says("has each of Bayer's filters over two by two pixels")
    found = strengths(quad())
    assert strongest == max(found.values())
    assert {min(f, 1 - f) for place in found for f in place} == {0, 0.25}
    assert strength(quad(), 0.5, 0) < 1e-12


def test_four_pixels_as_one(says):
    """The sensor is Sony's IMX586 (press release of 23 July 2018: 48 effective megapixels, 0.8 µm)."""
    pixels, wide = says("Sony's quad-Bayer sensor of 2018 has 48 million pixels, each 0.8 µm wide.")
    assert (pixels.value, wide.value) == (48, 0.8)
    (left,) = says("and 12 million pixels remain, which form an ordinary Bayer mosaic")
    assert left == pixels.value / 4
    counted, again, root = says("A pixel that counts 25 electrons scatters by √25 = 5 of them, one fifth (lesson 15).")
    assert counted.value == again.value
    says("The mean of four such pixels scatters by half as much, one tenth.")
    light = np.random.default_rng(0).poisson(counted.value, (400, 400))
    means = lesson12.binned(light)
    assert root == np.sqrt(counted.value)
    assert light.std() == pytest.approx(root.value, rel=0.02)
    assert light.std() / light.mean() == pytest.approx(1 / 5, rel=0.02)
    assert means.std() / means.mean() == pytest.approx(1 / 10, rel=0.02)
    (brightest,) = says("Here is her face in dim light, at most 25 electrons a pixel, from a quad-Bayer sensor.")
    assert brightest.value == counted.value


def test_the_binned_mosaic_is_bayers(says):
    (width,) = says("from a quad-Bayer mosaic (2 h, 2 w) the Bayer mosaic (h, w)")  # the other 2 is a coefficient
    flat = np.broadcast_to([0.9, 0.5, 0.2], (12, 16, 3))
    made = lesson12.binned(sampled(flat, quad()))
    assert made.shape == (12 / width.value, 16 / width.value)
    np.testing.assert_allclose(made, sampled(flat, RGGB)[:6, :8])
    says("One pixel farther to the right, each would mix two colours.")
    mixed = lesson12.binned(np.roll(sampled(flat, quad()), -1, axis=1))
    assert not set(np.round(mixed.ravel(), 9)) <= {0.9, 0.5, 0.2}


def test_binning_blurs_before_the_larger_pixels_are_sampled(says):
    (kept,) = says("the mean of two pixels keeps cos(π · ¼) = 0.71 of stripes of ¼ cycle per pixel")
    assert kept == np.abs(np.exp(2j * np.pi / 4 * np.arange(2)).mean()) == pytest.approx(np.cos(np.pi / 4))
    says("So false colour becomes weaker there, and does not go.")
    f = 0.24
    plain = bilinear(sampled(stripes(2 * f), RGGB), RGGB)  # by pixels twice as large that see one line each
    small = np.repeat(stripes(f, 32, 800)[..., :1], 3, axis=-1)
    shown = bilinear(lesson12.binned(sampled(small, quad())), RGGB)
    swings = [np.ptp((one[..., 0] - one[..., 2])[4:12, 8:-8]) for one in (plain, shown)]
    assert 0.5 * swings[0] < swings[1] < 0.85 * swings[0]


def test_binning_the_dim_face_takes_noise_away(says):
    says("The noise is weaker, and the detail coarser.")
    light = decoded(photograph("astronaut")[:240, :320])[20:180, 140:300]
    clean, dim = sampled(light, quad()), np.random.default_rng(12).poisson(25 * sampled(light, quad())) / 25
    errors = [np.std(one) for one in (dim - clean, lesson12.binned(dim) - lesson12.binned(clean))]
    assert errors[1] == pytest.approx(errors[0] / 2, rel=0.05)


def spots(*plates):
    """Where unpolarised light lands, and how much of it, behind plates: (how far, the axis' angle), or (None, …)."""
    landed = {}
    for field in ([1, 0], [0, 1]):  # unpolarised: both, without interference
        rays = {(0.0, 0.0): np.array(field, dtype=complex)}
        for distance, angle in plates:
            axis, across = np.array([np.cos(angle), np.sin(angle)]), np.array([-np.sin(angle), np.cos(angle)])
            split = {}
            for place, one in rays.items():
                if distance is None:  # a quarter wave later along the axis
                    parts = [(place, 1j * (one @ axis) * axis + (one @ across) * across)]
                else:
                    aside = tuple(np.round(np.array(place) + distance * axis, 9) + 0.0)
                    parts = [(aside, (one @ axis) * axis), (place, (one @ across) * across)]
                for where, part in parts:
                    split[where] = split.get(where, 0) + part
            rays = split
        for place, one in rays.items():
            landed[place] = landed.get(place, 0) + np.sum(np.abs(one) ** 2) / 2
    return {place: share for place, share in landed.items() if share > 1e-9}


def test_two_crossed_plates_make_two_spots_and_a_quarter_wave_plate_between_them_four(says):
    """By the field of each ray, plate after plate (Jones)."""
    says("One plate of quartz splits light into two rays, which are polarised across each other.")
    assert spots((1, 0)) == pytest.approx({(1, 0): 0.5, (0, 0): 0.5})
    (turn,) = says("A second plate, turned by 90°, would move only one of them: two spots still.")
    crossed = np.radians(turn.value)
    assert len(spots((1, 0), (1, crossed))) == 2
    says("So a quarter-wave plate stands between the two")
    says("Then the second plate splits both, and four spots stand in a square, d pixels wide.")
    square = spots((1, 0), (None, np.pi / 4), (1, crossed))
    assert square == pytest.approx({(0, 0): 0.25, (1, 0): 0.25, (0, 1): 0.25, (1, 1): 0.25})
    says("a stack of thin plates of quartz, which splits every point of light into four")


def test_blurring_afterwards_does_nothing(says):
    wide, f = says("has made bands 50 pixels wide of stripes of 0.48 cycles per pixel")
    says("The same blur takes nearly all of the colour away before the sampling, and nothing after it.")
    assert wide == 1 / beat(f.value)
    plain = bilinear(sampled(stripes(f.value, 64), RGGB), RGGB)
    before = bilinear(sampled(behind_quartz(stripes(f.value, 64), 1.0), RGGB), RGGB)
    after = behind_quartz(plain, 1.0)
    swings = [np.ptp((one[..., 0] - one[..., 2])[8:-8, 8:-8]) for one in (plain, before, after)]
    assert swings[1] < swings[0] / 10
    assert swings[2] > 0.99 * swings[0]
    says("what is left of a frequency is cos(π f), and at ½ that is nothing")
    two_spots = stripes(0.5)[:, 1:] + stripes(0.5)[:, :-1]
    assert np.ptp(two_spots) < 1e-12
    assert np.cos(np.pi * 0.5) == pytest.approx(0, abs=1e-12)


# Exercises and part 8 ------------------------------------------------------------------------------------------------


def windows_on_red(measured):
    """Every 5 × 5 window (rows, columns, 5, 5) whose middle is red, but for those at the border."""
    return np.lib.stride_tricks.sliding_window_view(measured, (5, 5))[::2, ::2]


@pytest.mark.parametrize("name", [name for name in PATTERNS if name not in ("RGBW", "monochrome")])
def test_the_mosaic_asked_for_is_that_of_camviz(name):
    pattern, picture = PATTERNS[name], np.random.default_rng(1).random((11, 14, 3))
    np.testing.assert_array_equal(lesson12.mosaic(picture, np.array(pattern.tile)), mosaics.mosaic(picture, pattern))


def test_the_cropped_tile_asked_for_is_that_of_camviz():
    for tile, x0, y0 in exercise("12.cropped_tile").cases(np.random.default_rng(2)):
        cropped = mosaics.Pattern("any", tuple(map(tuple, tile.tolist()))).cropped(x0, y0)
        np.testing.assert_array_equal(lesson12.cropped_tile(tile, x0, y0), np.array(cropped.tile))


def test_the_fault_of_the_crop_hides_where_rows_and_columns_are_alike(says):
    says("For Bayer's tiles it is right when x0 = y0, and so it passed its only test.")
    says("With tiles of two by two the sign never shows; with X-Trans it does.")
    for n in range(4):
        np.testing.assert_array_equal(lesson12.cropped_tile_as_given(RGGB, n, n), lesson12.cropped_tile(RGGB, n, n))
    assert (lesson12.moved_right_and_down(RGGB, 1, 2) == lesson12.cropped_tile(RGGB, 1, 2)).all()
    assert (lesson12.moved_right_and_down(X_TRANS, 1, 2) != lesson12.cropped_tile(X_TRANS, 1, 2)).any()


@pytest.mark.parametrize(
    ("answer", "algorithm"), [(lesson12.malvar_green, mosaics.malvar), (lesson12.edge_green, mosaics.edge_aware)]
)
def test_the_greens_asked_for_are_those_of_the_algorithms(answer, algorithm):
    measured = np.random.default_rng(3).random((24, 30))
    green = algorithm(measured, BAYER["RGGB"])[..., 1]
    np.testing.assert_allclose(answer(windows_on_red(measured)), green[2:-2:2, 2:-2:2], atol=1e-12)


def test_malvars_green_is_that_of_colour_demosaicing():
    measured = np.random.default_rng(4).random((24, 30))
    green = colour_demosaicing.demosaicing_CFA_Bayer_Malvar2004(measured, "RGGB")[..., 1]
    np.testing.assert_allclose(lesson12.malvar_green(windows_on_red(measured)), green[2:-2:2, 2:-2:2], atol=1e-12)


def test_edge_green_of_the_test_s_own_algorithm():
    measured = np.random.default_rng(5).random((24, 30))
    np.testing.assert_allclose(
        lesson12.edge_green(windows_on_red(measured)), hamilton_adams(measured)[2:-2:2, 2:-2:2, 1], atol=1e-12
    )


def test_the_share_of_the_bend(says):
    """Green along a line of five, as J. F. Hamilton and J. E. Adams have it (US patent 5,629,734, 1997)."""
    published = np.array([-1, 2, 2, 2, -1]) / 4
    (four,) = says("green = (b + d)/2 + bend/4; the same for the middle column")
    (lacking,) = says("The green along it lacks bend/4.")
    (quarter,) = says("Half of the bend is too much: green is (b + d)/2 + bend/4.")
    for each in (four, lacking, quarter):
        assert -published[0] == 1 / each.value
        assert published[2] == 2 / each.value  # the bend holds 2 c
    assert published[1] == 1 / 2


@pytest.mark.parametrize("f", [0.3, 0.45, 0.55, 0.95, 1.4, 2.48])
def test_the_false_frequency_is_what_the_spectrum_shows(f):
    red, blue = (sampled(stripes(f), RGGB)[row, row::2] for row in (0, 1))
    difference = red - np.interp(np.arange(0, 400, 2), np.arange(1, 400, 2), blue)
    columns = np.fft.rfftfreq(200, 2)  # red stands in every second column: it knows f to the nearest ½
    found = columns[np.abs(np.fft.rfft(difference - difference.mean())).argmax()]
    predicted = lesson12.false_frequency(f)
    assert found == pytest.approx(min(predicted, 0.5 - predicted), abs=2 / 400)


def test_the_stripes_of_the_solution(says):
    f, answer, bands = says("For f = 0.45 it is 0.05: bands of 20 pixels.")
    assert answer == beat(f.value)
    assert bands == 1 / beat(f.value)
    f, answer, alias = says("For f = 0.95 it is 0.45: on pixels those stripes look like coarse ones of 0.05")
    assert answer == min(abs(f.value - n - 0.5) for n in range(-1, 2))
    np.testing.assert_allclose(stripes(f.value), stripes(alias.value), atol=1e-12)
    says("Red and blue see them nearly alike")
    shown = bilinear(sampled(stripes(f.value), RGGB), RGGB)[4:12, 4:-4]
    coarse = bilinear(sampled(stripes(0.45), RGGB), RGGB)[4:12, 4:-4]
    assert np.ptp(shown[..., 0] - shown[..., 2]) < 0.1 * np.ptp(coarse[..., 0] - coarse[..., 2])


def test_equal_channels_prove_a_grey_file_only(says, samples):
    says("Equal channels prove that the file is grey, and no more.")
    picture = cv2.imread(str(samples / "left01.jpg"))
    assert np.ptp(picture, axis=-1).max() == 0
    turned = cv2.imread(str(samples / "left01.jpg"), cv2.IMREAD_GRAYSCALE)
    coloured = cv2.cvtColor(photograph("coffee"), cv2.COLOR_RGB2GRAY)  # a colour camera took that
    assert np.ptp(np.repeat(coloured[..., None], 3, axis=-1), axis=-1).max() == 0
    np.testing.assert_array_equal(picture[..., 0], turned)


def test_edge_aware_leaves_false_colour_at_the_corners_of_a_board(says, samples):
    says("false colour lies along all edges. Edge-aware leaves it at the corners of the squares")
    grey = cv2.imread(str(samples / "left01.jpg"))[100:356, 240:496]
    _, corners = cv2.findChessboardCornersSB(cv2.imread(str(samples / "left01.jpg"), cv2.IMREAD_GRAYSCALE), (9, 6))
    at = np.rint(corners.reshape(-1, 2)).astype(int) - (240, 100)
    near = np.zeros(grey.shape[:2])
    for u, v in at[(at > 8).all(axis=-1) & (at < 248).all(axis=-1)]:
        near[v - 4 : v + 5, u - 4 : u + 5] = 1
    inside = np.s_[20:200, 20:236]  # the board alone
    share = {}
    for name, shown in (("bilinear", bilinear), ("edge-aware", lambda measured, _: hamilton_adams(measured))):
        labs = colour.XYZ_to_Lab(colour.sRGB_to_XYZ(encoded(shown(sampled(decoded(grey), RGGB), RGGB)) / 255))
        tint = np.hypot(labs[..., 1], labs[..., 2])[inside]
        share[name] = tint[near[inside] > 0].sum() / tint.sum()
    assert share["edge-aware"] > 2 * share["bilinear"]
    assert share["edge-aware"] > 0.3


def test_the_lines_for_a_raw_file_take_the_dark_to_zero_and_a_full_pixel_to_one(monkeypatch, says):
    (largest,) = says("larger ones are averaged down to 256 pixels in linear light")
    shown = DemosaicingView(photograph=np.zeros((300, 500, 3), np.uint8)).truth
    assert largest == max(shown.shape)
    (code,) = re.findall(
        r"```python\n(import rawpy.*?)```", "\n".join(cell.source for cell in lesson().cells), re.DOTALL
    )
    raw = types.SimpleNamespace(
        color_desc=b"RGBG",
        raw_pattern=np.array([[0, 1], [3, 2]]),
        black_level_per_channel=[512] * 4,
        white_level=16383,
        raw_image_visible=np.full((6, 8), 512, np.uint16),
    )
    raw.raw_image_visible[2, 3] = 16383
    monkeypatch.setitem(sys.modules, "rawpy", types.SimpleNamespace(imread=lambda name: raw))
    names = {"mosaics": mosaics}
    exec(code, names)
    assert names["mosaic"].min() == 0
    assert names["mosaic"].max() == 1
    assert names["picture"].shape == (6, 8, 3)


def lesson():
    return notebooks.read(LESSONS / "12_demosaicing.ipynb")


def test_a_constant_and_a_function_that_does_nothing_do_not_pass():
    for name, function in (
        ("12.mosaic", lambda picture, tile: picture[..., 1]),
        ("12.malvar_green", lambda around: around[..., 2, 2]),
        ("12.malvar_green", lambda around: 0.5),
        ("12.false_frequency", lambda f: 0.05),
        ("12.false_frequency", lambda f: 0.5 - np.asarray(f)),
        ("12.edge_green", lambda around: np.sort(around[..., 2, :])[..., 2]),
    ):
        for seed in range(10):
            assert judge(exercise(name), function, np.random.default_rng(seed)).status == "wrong"


def test_a_tile_of_xtrans_is_among_the_fresh_cases():
    """Else a sign that 2 × 2 tiles hide would pass."""
    tiles = [tile.shape for tile, *_ in exercise("12.cropped_tile").cases(np.random.default_rng(0))]
    assert tiles.count((6, 6)) > 1


def above(question):
    """All prose and saved text above a question."""
    cells = lesson().cells
    at = next(i for i, cell in enumerate(cells) if cell.source == f'ask("{question}")')
    outputs = [str(out.get("data", {}).get("text/plain", "")) for cell in cells[:at] for out in cell.get("outputs", [])]
    return " ".join([*(cell.source for cell in cells[:at]), *outputs])


@pytest.mark.parametrize(
    ("question", "words"),
    [
        ("12.measured", r"two thirds|interpolat|one of|each pixel|guess"),
        ("12.shifted", r"becomes orange|change places|which colour sees|other columns"),
        ("12.names", r"BGGR|second row|exchanged|Bayer(RG|BG)2"),
        ("12.blur", r"too late|low-pass|four spots 0|coarse and soft|afterwards"),
    ],
)
def test_nothing_above_a_question_answers_it(question, words):
    assert re.search(words, above(question)) is None


# Before the lesson ---------------------------------------------------------------------------------------------------


def test_before_the_lesson_the_jacket(says):
    pairs, pixels = says("46 pairs of a light and a dark one lie side by side on 100 pixels")
    f = pairs.value / pixels.value
    (wide,) = says("Bands of orange and blue, about 25 pixels from orange to orange.")
    (too,) = says("Bands of green and magenta, about 25 pixels from green to green.")
    half, minus, away, width = says("Yes: 0.5 − 0.46 = 0.04 cycles per pixel, a band in 25 pixels.")
    assert minus.value == f
    assert away == half.value - f
    assert width == 1 / beat(f)
    assert wide.value == too.value == width.value
    (fine,) = says("Coloured stripes as fine as those of the jacket, about 2 pixels each.")
    assert fine == 1 / f
    (middle,) = says("the nearer to 0.5, the wider its bands")
    assert middle.value == half.value
    assert beat(0.48) < beat(f) < beat(0.44)


def test_before_the_lesson_the_first_column_cut_off(says):
    says("R G R G becomes G R G, and below it G B G B becomes B G B")
    says("That comes of cutting off the first row.")
    laid_out, letters = np.tile(RGGB, (2, 2)), np.array(list("RGB"))
    assert "".join(letters[laid_out[:2, 1:3]].ravel()) == "GRBG"
    assert "".join(letters[laid_out[1:3, :2]].ravel()) == "GBRG"
    assert "".join(letters[laid_out[0]]) == "RGRG"
    assert "".join(letters[laid_out[1]]) == "GBGB"


def test_before_the_lesson_the_red_light(says):
    megapixels, pixels = says("A camera of 20 megapixels takes a colour photograph of 20 million pixels.")
    assert megapixels.value == pixels.value
    (everywhere,) = says("In 20 million: at every pixel.")
    assert everywhere.value == pixels.value
    (third,) = says("In 6.7 million: at every third pixel.")
    assert third == pixels.value / 3
    (quarter,) = says("In 5 million: at every fourth pixel.")
    assert quarter == pixels.value * np.mean(RGGB == 0)


def test_the_quiz_about_the_green_numbers(says):
    of, again = says(
        "A sensor of 48 megapixels under Bayer's filters takes a photograph. How many of its 48 million green numbers "
        "were guessed?"
    )
    assert of.value == again.value
    (green,) = says("24 million.")
    assert green == of.value * np.mean(RGGB != 1)
    (others,) = says("Of red and blue, 36 million each are guessed.")
    assert others == of.value * np.mean(RGGB != 0) == of.value * np.mean(RGGB != 2)
    (all_alike,) = says("32 million: two thirds.")
    assert all_alike == of.value * 2 / 3


def test_algorithms_differ_on_upright_stripes_but_not_on_a_chessboard(says):
    """Beside colour_demosaicing's bilinear and Menon: 1.59 and 0, and equal mosaics of grey and magenta."""
    f, by_bilinear = says(
        "For vertical stripes of 0.48 cycles per pixel, red − blue swings by 1.59 with bilinear interpolation, and by "
        "0 with the edge-aware and Menon's algorithm."
    )
    says("from a chessboard of single pixels none can")
    rggb = mosaics.BAYER["RGGB"]
    one_row = 0.5 + 0.4 * np.cos(2 * np.pi * f.value * np.arange(400))
    measured = np.tile(one_row, (64, 1))  # grey, so that every filter sees the same

    def swing(rebuilt):
        return np.ptp((rebuilt[..., 0] - rebuilt[..., 2])[8:-8, 8:-8])

    assert by_bilinear == swing(colour_demosaicing.demosaicing_CFA_Bayer_bilinear(measured, "RGGB"))
    assert by_bilinear == swing(mosaics.demosaic(measured, rggb, "bilinear"))
    assert swing(colour_demosaicing.demosaicing_CFA_Bayer_Menon2007(measured, "RGGB")) < 1e-6
    for name in ("edge-aware", "Menon"):
        assert swing(mosaics.demosaic(measured, rggb, name)) == pytest.approx(0, abs=1e-6)
    chessboard, magenta = np.indices((8, 8)).sum(axis=0) % 2 == 0, np.broadcast_to([0.9, 0.1, 0.9], (8, 8, 3))
    np.testing.assert_allclose(mosaics.mosaic(magenta, rggb), np.where(chessboard, 0.9, 0.1))
    says("The raw file holds the same mosaic, and the same algorithm makes the same bands of it.")
