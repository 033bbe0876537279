"""What lesson 12 claims about colour filters, recomputed with colour-demosaicing, colour-science, OpenCV and NumPy."""

import warnings

import cv2
import numpy as np
import pytest
from claims import claims
from scipy.ndimage import convolve

from camviz import mosaics
from camviz.mosaics import BAYER, PATTERNS
from camviz.scenes.photographs import photograph
from camviz_school.course.material import module

with warnings.catch_warnings():
    warnings.simplefilter("ignore")  # it imports from where SciPy will not keep things
    import colour
    import colour_demosaicing

says = claims("12")
lesson12 = module("12")

RGGB = np.array([[0, 1], [1, 2]])
QUAD = np.kron(RGGB, np.ones((2, 2), int))
X_TRANS = np.array(
    [["RGB".index(one) for one in row] for row in ("GGRGGB", "GGBGGR", "BRGRBG", "GGBGGR", "GGRGGB", "RBGBRG")]
)
RGBW = np.array([["RGBW".index(one) for one in row] for row in ("GWRW", "WGWR", "BWGW", "WBWG")])


def filters(shape, tile):
    """The channel that each pixel measures."""
    return np.tile(tile, [size // n + 1 for size, n in zip(shape, tile.shape, strict=True)])[: shape[0], : shape[1]]


def sampled(light, tile=RGGB):
    return np.take_along_axis(light, filters(light.shape[:2], tile)[..., None], axis=-1)[..., 0]


def spread(values, seen):
    """The mean of the pixels around that were seen, the nearer ones counting more; what was seen stays."""
    tent = np.outer([1, 2, 1], [1, 2, 1])
    near, total = (convolve(one, tent, mode="constant") for one in (seen.astype(float), values * seen))
    return np.where(seen, values, total / np.where(near > 0, near, np.inf))


def by_green(measured, green):
    seen = filters(measured.shape, RGGB)
    return np.stack([green + spread(measured - green, seen == c) if c != 1 else green for c in range(3)], axis=-1)


def bilinear(measured, tile=RGGB):
    return np.stack([spread(measured, filters(measured.shape, tile) == channel) for channel in range(3)], axis=-1)


def hamilton_adams(measured):
    """Green along the way that changes less, then bilinear interpolation of the differences to green; RGGB."""
    windows = np.lib.stride_tricks.sliding_window_view(np.pad(measured, 2, mode="reflect"), (5, 5))
    lines = windows[..., 2, :], windows[..., :, 2]
    bends = [2 * line[..., 2] - line[..., 0] - line[..., 4] for line in lines]
    across, down = (np.abs(line[..., 1] - line[..., 3]) + np.abs(b) for line, b in zip(lines, bends, strict=True))
    ways = [(line[..., 1] + line[..., 3]) / 2 + bend / 4 for line, bend in zip(lines, bends, strict=True)]
    chosen = np.where(across < down, ways[0], np.where(down < across, ways[1], sum(ways) / 2))
    return by_green(measured, np.where(filters(measured.shape, RGGB) == 1, measured, chosen))


def behind_quartz(light, d):
    """Four spots d apart: cos(π d f) of each frequency, in a picture that is mirrored at its borders."""
    mirrored = np.concatenate([light, light[::-1]])
    mirrored = np.concatenate([mirrored, mirrored[:, ::-1]], axis=1)
    kept = np.outer(*(np.cos(np.pi * d * np.fft.fftfreq(n)) for n in mirrored.shape[:2]))
    passed = np.fft.ifft2(np.fft.fft2(mirrored, axes=(0, 1)) * kept[..., None], axes=(0, 1)).real
    return passed[: light.shape[0], : light.shape[1]]


def encoded(light):
    return np.rint(255 * colour.cctf_encoding(np.clip(light, 0, 1), function="sRGB")).astype(np.uint8)


def decibels(light, truth):
    return -10 * np.log10(np.mean((encoded(light) / 255 - encoded(truth) / 255) ** 2))


def false_colour(light, truth):
    """The mean distance in the a*b* plane of CIELAB."""
    labs = [colour.XYZ_to_Lab(colour.sRGB_to_XYZ(encoded(one) / 255)) for one in (light, truth)]
    return np.hypot(*np.moveaxis(np.subtract(*labs)[..., 1:], -1, 0)).mean()


def strengths(tile):
    """How colourful a grey grating of height 1 makes the channels' means, by (fu, fv): one of f and −f, none of 0."""
    (height, width), found = tile.shape, {}
    v, u = np.indices(tile.shape)
    for row, column in np.ndindex(height, width):
        wave = np.exp(2j * np.pi * (column / width * u + row / height * v))
        added = np.array([wave[tile == channel].mean() for channel in range(3)])
        if (row, column) <= (-row % height, -column % width):
            found[column / width, row / height] = np.linalg.norm(added - added.mean())
    return {f: size for f, size in found.items() if size > 1e-9}


def stripes(f, height=16, width=400):
    return np.broadcast_to((0.5 + 0.4 * np.cos(2 * np.pi * f * np.arange(width)))[None, :, None], (height, width, 3))


def swing(rebuilt):
    return np.ptp((rebuilt[..., 0] - rebuilt[..., 2])[8:-8, 8:-8])


def beat(f):
    """The strongest frequency of red − blue in stripes of f under RGGB, interpolated bilinearly."""
    shown = bilinear(sampled(stripes(f)))[8]
    return np.fft.rfftfreq(400)[np.abs(np.fft.rfft(shown[:, 0] - shown[:, 2])).argmax()]


@pytest.fixture(scope="module")
def plate():
    """Rings to 0.6 cycles per pixel at the sides, each pixel the mean over four by four points."""
    fine = (np.arange(1024) + 0.5) / 4 - 128
    rings = 0.5 + 0.5 * np.cos(2 * np.pi * 0.6 / 256 * (fine[:, None] ** 2 + fine**2))
    return np.repeat(rings.reshape(256, 4, 256, 4).mean(axis=(1, 3))[..., None], 3, axis=-1)


@pytest.fixture(scope="module")
def astronaut():
    light = colour.cctf_decoding(photograph("astronaut") / 255, function="sRGB")
    return light.reshape(256, 2, 256, 2, 3).mean(axis=(1, 3))


def test_the_equation_and_the_mask():
    says("The mask of the red filters is ¼ (1 + (−1)ᵘ)(1 + (−1)ᵛ)", "(−1)ᵘ is cos(2π · ½ · u), a wave of ½ cycle per")
    v, u = np.indices((6, 8))
    R, G, B = np.moveaxis(np.random.default_rng(3).random((6, 8, 3)), -1, 0)
    m = (R + 2 * G + B) / 4 + (R - B) / 4 * ((-1.0) ** u + (-1.0) ** v) + (R - 2 * G + B) / 4 * (-1.0) ** (u + v)
    light = np.stack([R, G, B], axis=-1)
    np.testing.assert_allclose(m, sampled(light), atol=1e-12)
    np.testing.assert_allclose(m, lesson12.mosaic(light, RGGB), atol=1e-12)
    says("What is left, (⅔, −1⅓, ⅔), is colour, and its length is the 1.63 of the list.")
    says("Vertical stripes add (1, 0, −1), which has no grey part: their length is 1.41.")
    carriers = strengths(RGGB)
    sizes = [carriers[f] for f in ((0.5, 0.5), (0.5, 0), (0, 0.5))]
    assert sizes == pytest.approx([1.63, 1.41, 1.41], abs=5e-3)


def test_carriers_of_other_tiles(plate):
    says("It has six carriers in place of Bayer's three", "the strongest has 1.06, where Bayer's has 1.63")
    says("Vertical stripes of ½ cycle per pixel do no harm now; those of ⅓ do a little, 0.37.")
    for name, tile in (("X-Trans", X_TRANS), ("RGBW", RGBW)):
        np.testing.assert_array_equal(tile, PATTERNS[name].tile)
    found = strengths(X_TRANS)
    assert (len(found), len(strengths(RGGB)), (0.5, 0) in found) == (6, 3, False)
    assert [max(found.values()), found[1 / 3, 0]] == pytest.approx([1.06, 0.37], abs=5e-3)
    says("ΔC is 27.9 on average, under RGGB 25.5")
    tints = [false_colour(bilinear(sampled(plate, tile), tile), plate) for tile in (X_TRANS, RGGB)]
    assert tints == pytest.approx([27.9, 25.5], abs=0.05)
    says("The strongest carrier is as strong as Bayer's, 1.63, and lies at ¼ cycle per pixel")
    at, most = max(strengths(RGBW).items(), key=lambda item: item[1])
    assert ({min(f, 1 - f) for f in at}, most) == ({0.25}, pytest.approx(1.63, abs=5e-3))


def test_quad_bayer_has_its_carriers_at_a_quarter():
    says("Stripes of ½ cycle per pixel do no harm, but all its carriers lie at ¼: the strongest has 1.00.")
    found = strengths(QUAD)
    assert max(found.values()) == pytest.approx(1.00, abs=5e-3)
    assert {min(f, 1 - f) for place in found for f in place} == {0, 0.25}


def test_the_beat_is_the_distance_from_the_carrier():
    says("should give bands of colour that repeat every 1 / (0.5 − 0.45) = 20 pixels.")
    assert 1 / beat(0.45) == pytest.approx(20)
    for f in (0.3, 0.45, 0.48):
        assert lesson12.false_frequency(f) == pytest.approx(beat(f))


def test_better_algorithms_remove_what_stripes_make():
    says(
        "For vertical stripes of 0.48 cycles per pixel, red − blue swings by 1.59 with bilinear interpolation, and by 0"
    )
    says("with the edge-aware and Menon's algorithm.")
    says("from a chessboard of single pixels none can")
    measured = sampled(stripes(0.48, 64))
    assert swing(colour_demosaicing.demosaicing_CFA_Bayer_bilinear(measured, "RGGB")) == pytest.approx(1.59, abs=5e-3)
    assert swing(colour_demosaicing.demosaicing_CFA_Bayer_Menon2007(measured, "RGGB")) < 1e-6
    swings = [swing(mosaics.demosaic(measured, BAYER["RGGB"], one)) for one in ("bilinear", "edge-aware", "Menon")]
    assert swings == pytest.approx([1.59, 0, 0], abs=5e-3)
    chessboard = np.indices((8, 8)).sum(axis=0) % 2 == 0
    np.testing.assert_array_equal(sampled(np.full((8, 8, 3), (0.9, 0.1, 0.9))), np.where(chessboard, 0.9, 0.1))


def test_blur_helps_before_sampling_only(plate):
    says("has made bands 50 pixels wide of stripes of 0.48 cycles per pixel", "It falls from 25.5 to 6.3 at 1 px.")
    assert 1 / beat(0.48) == pytest.approx(50)
    tints = [false_colour(bilinear(sampled(behind_quartz(plate, d))), plate) for d in (0, 1)]
    assert tints == pytest.approx([25.5, 6.3], abs=0.05)
    fine = stripes(0.48, 64)
    plain = bilinear(sampled(fine))
    before, after = bilinear(sampled(behind_quartz(fine, 1.0))), behind_quartz(plain, 1.0)
    assert swing(before) < swing(plain) / 10 < 0.99 * swing(plain) < swing(after)


def test_malvars_green_is_that_of_colour_demosaicing(plate, astronaut):
    measured = np.random.default_rng(4).random((24, 30))
    windows = np.lib.stride_tricks.sliding_window_view(measured, (5, 5))[::2, ::2]
    theirs = colour_demosaicing.demosaicing_CFA_Bayer_Malvar2004(measured, "RGGB")[..., 1]
    np.testing.assert_allclose(lesson12.malvar_green(windows), theirs[2:-2:2, 2:-2:2], atol=1e-12)
    np.testing.assert_allclose(lesson12.edge_green(windows), hamilton_adams(measured)[2:-2:2, 2:-2:2, 1], atol=1e-12)
    says("less false colour than the edge-aware one, ΔC of 13.9 against 18.6.", "it leaves more, 3.9 against 3.0.")
    weights = np.array([[0, 0, -1, 0, 0], [0, 0, 2, 0, 0], [-1, 2, 4, 2, -1], [0, 0, 2, 0, 0], [0, 0, -1, 0, 0]]) / 8
    tints = []
    for light in (plate, astronaut):
        mosaic = sampled(light)
        green = np.where(filters(mosaic.shape, RGGB) == 1, mosaic, convolve(mosaic, weights, mode="mirror"))
        tints += [false_colour(one, light) for one in (by_green(mosaic, green), hamilton_adams(mosaic))]
    assert tints == pytest.approx([13.9, 18.6, 3.9, 3.0], abs=0.05)


def test_the_order_changes_from_picture_to_picture(astronaut):
    says("There Menon reaches 30.85 dB and edge-aware 31.05 dB: the order has changed.")
    measured = sampled(astronaut)
    menon = mosaics.menon(measured, BAYER["RGGB"])
    found = [decibels(one, astronaut) for one in (menon, hamilton_adams(measured))]
    assert found == pytest.approx([30.85, 31.05], abs=5e-3)
    theirs = colour_demosaicing.demosaicing_CFA_Bayer_Menon2007(measured, "RGGB")
    np.testing.assert_allclose(theirs[8:-8, 8:-8], menon[8:-8, 8:-8], atol=0.02)


def test_four_pixels_as_one():
    says(
        "has 48 million pixels, each 0.8 µm wide.", "and 12 million pixels remain, which form an ordinary Bayer mosaic"
    )
    says("A pixel that counts 25 electrons scatters by √25 = 5 of them, one fifth", "half as much, one tenth.")
    light = np.random.default_rng(0).poisson(25, (400, 400))
    means = lesson12.binned(light)
    assert [light.std() / 25, means.std() / 25] == pytest.approx([1 / 5, 1 / 10], rel=0.02)
    flat = np.broadcast_to([0.9, 0.5, 0.2], (12, 16, 3))
    np.testing.assert_allclose(lesson12.binned(sampled(flat, QUAD)), sampled(flat)[:6, :8])
    says("the mean of two pixels keeps cos(π · ¼) = 0.71 of stripes of ¼ cycle per pixel")
    assert np.abs(np.exp(2j * np.pi / 4 * np.arange(2)).mean()) == pytest.approx(0.71, abs=5e-3)


def test_question_names():
    says("OpenCV's name spells the second row's second and third pixels: for RGGB that is `BG`.")
    says("OpenCV's `RG` is for a mosaic that begins BGGR.")
    for tile, old in {"RGGB": "BG", "BGGR": "RG", "GRBG": "GB", "GBRG": "GR"}.items():
        assert getattr(cv2, f"COLOR_Bayer{tile}2RGB") == getattr(cv2, f"COLOR_Bayer{old}2RGB")
        assert (2 * tile[2:])[1:3] == old
    taken = sampled(np.broadcast_to(np.uint8([200, 120, 40]), (12, 12, 3)))
    assert cv2.cvtColor(taken, cv2.COLOR_BayerRG2RGB)[5, 5].tolist() == [40, 120, 200]


def test_questions_measured():
    says("A camera of 12 megapixels gives you", "A sensor of 48 megapixels under", "A camera of 20 megapixels takes")
    says("12 million: one of each pixel's three numbers.", "That would make 3 million pixels of three numbers each")
    says("it measures 12 million numbers and makes up 24 million.", "of its 48 million green numbers", "24 million.")
    says("Of red and blue, 36 million each are guessed.", "In 5 million: at every fourth pixel.")
    red, green, blue = (np.mean(channel == RGGB) for channel in range(3))
    assert (12 * (red + green + blue), 12 / 4, 3 * 12 - 12) == (12, 3, 24)
    assert (48 * (1 - green), 48 * (1 - red), 48 * (1 - blue), 20 * red) == (24, 36, 36, 5)


def test_questions_carriers():
    says("0.48 cycles per pixel on a Bayer sensor.", "Bands of orange and blue, about 50 pixels wide from orange to")
    says("Yes: 0.5 − 0.48 = 0.02 cycles per pixel, one band in 50 pixels", "Colours that change every 2 pixels")
    says("46 pairs of a light and a dark one lie side by side on 100 pixels", "about 25 pixels from orange to orange.")
    says("Yes: 0.5 − 0.46 = 0.04 cycles per pixel, a band in 25 pixels.")
    assert [beat(0.48), beat(0.46)] == pytest.approx([0.02, 0.04])
