"""What goes wrong where a mosaic samples light: carriers of false colour, a zone plate that shows them, a remedy.

Frequencies are in cycles per pixel, along u (right) and v (down).
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from scipy.fft import dctn, idctn

from camviz.lenses.arrays import LinearPicture32, LinearPictureLike
from camviz.lenses.base import Array
from camviz.mosaics.patterns import BLUE, GREEN, RED, Pattern, as_picture


@dataclass(frozen=True)
class Carrier:
    """A frequency at which a grey grating moves the means of the channels' pixels as a colour would.

    Args:
        fu, fv: In cycles per pixel, along u (right) and v (down).
        colour: What the grating's crest, of height 1 on the first pixel, adds to the means of the red, green and blue
            pixels; its imaginary part belongs to a grating moved by a quarter of its period.

    Stripes one pixel wide fall on all red pixels of a Bayer array, and miss all blue ones:

    >>> round(Carrier(0.5, 0.0, (1, 0, -1)).strength, 3)  # √2
    1.414
    """

    fu: float
    fv: float
    colour: tuple[complex, complex, complex]

    @property
    def strength(self) -> float:
        """How colourful that is: the length of what of the colour is not grey."""
        return float(np.linalg.norm(np.array(self.colour) - np.mean(self.colour)))


@lru_cache(maxsize=16)
def carriers(pattern: Pattern) -> tuple[Carrier, ...]:
    """The frequencies that a pattern mistakes for colour.

    The spectrum of a mosaic holds that of the picture's brightness and, moved to these frequencies, those of its
    colours; so fine detail that lies there is taken for colour. A grating at f shows as false colour of the frequency
    f − carrier. For any tile they follow from its discrete Fourier transform.

    Returns: The strongest first, one of f and −f; none for a pattern without colours.
    Source: D. Alleysson, S. Süsstrunk and J. Hérault, Linear demosaicing inspired by the human visual system, IEEE
    Trans. Image Process. 14 (2005).

    >>> [(one.fu, one.fv) for one in carriers(BAYER["RGGB"])]
    [(0.5, 0.5), (0.5, 0.0), (0.0, 0.5)]
    """
    if not {RED, GREEN, BLUE} <= set(pattern.present):
        return ()
    tile = np.array(pattern.tile)
    spectra = [np.fft.fft2(tile == channel) / (tile == channel).sum() for channel in (RED, GREEN, BLUE)]
    found = []
    for row, column in np.ndindex(*tile.shape):
        if (row, column) <= (-row % pattern.height, -column % pattern.width):  # of f and −f, the first
            red, green, blue = (complex(spectrum[row, column]) for spectrum in spectra)
            found.append(Carrier(_folded(column / pattern.width), _folded(row / pattern.height), (red, green, blue)))
    coloured = (one for one in found if one.strength > 1e-9)
    return tuple(sorted(coloured, key=lambda one: -round(one.strength, 9)))


def _folded(frequency: float) -> float:
    """The frequency between −½, left out, and ½ that looks the same on whole pixels."""
    return frequency - 1 if frequency > 0.5 + 1e-12 else frequency


@lru_cache(maxsize=4)
def zone_plate(size: int = 256, highest: float = 0.5) -> Array:
    """Grey rings, ever finer from the middle outwards, on which every frequency is found at one place.

    The frequency (fu, fv), in cycles per pixel, lies (fu, fv) · size / (2 highest) pixels from the middle. Each pixel
    takes the mean over its area, as a sensor's pixel does.

    Args:
        size: Width and height in pixels, at least 8.
        highest: The frequency at the middles of the sides, in cycles per pixel.

    Returns: (size, size, 3), linear light 0 … 1; read-only.
    Raises: ValueError for a smaller size, or a highest frequency that is not above 0.

    White in the middle, and black √128 pixels beside it, where 128 · 0.5 / 128 makes half a turn:

    >>> zone_plate(128)[64, [64, 75], 0].round(1)
    array([1., 0.])
    """
    if size < 8 or not highest > 0:
        raise ValueError(f"size must be at least 8 pixels and highest above 0, got {size} and {highest}")
    points = (np.arange(4 * size) + 0.5) / 4 - size / 2
    phase = 2 * np.pi * highest / size * points**2
    # cos(a + b) = cos a cos b − sin a sin b, and the mean over an area is a mean of a mean.
    cos, sin = (part.reshape(size, 4).mean(axis=1) for part in (np.cos(phase), np.sin(phase)))
    rings = 0.5 + 0.5 * (np.outer(cos, cos) - np.outer(sin, sin))
    plate = np.repeat(rings[..., None], 3, axis=-1)
    plate.flags.writeable = False
    return plate


def low_pass(picture: LinearPictureLike, spots_px: float) -> LinearPicture32:
    """A picture behind a birefringent filter: each point becomes four spots.

    Two plates of quartz do this, one splitting the light to the right and left, one up and down, with a quarter-wave
    plate between them, without which the second would split neither ray of the first. What is left of a frequency is
    cos(π d fu) cos(π d fv), nothing at 1/(2d): with d = 1 nothing at the carriers of Bayer's pattern. The picture is
    taken as mirrored at its borders, and as having no detail finer than its pixels.

    Args:
        spots_px: How far apart the spots are, d, in pixels; 0 for no filter.

    Raises: ValueError for a picture of another shape, or a distance below 0.
    Source: J. E. Greivenkamp, Color dependent optical prefilter for the suppression of aliasing artifacts, Appl. Opt.
    29 (1990).

    Of a grating of 1/4 cycle per pixel, cos(π/4) = 71 % is left:

    >>> grating = np.cos(np.pi * (np.arange(8) + 0.5) / 2)[None, :, None] * np.ones(3)
    >>> (low_pass(grating, spots_px=1) / grating)[0, :3, 0].round(2)
    array([0.71, 0.71, 0.71])
    """
    light = as_picture(picture).astype(np.float32)
    if not spots_px >= 0:
        raise ValueError(f"spots_px must be a distance of 0 or more pixels, got {spots_px}")
    if spots_px == 0:
        return light
    passed = [np.cos(np.pi * spots_px * np.arange(count) / (2 * count)) for count in light.shape[:2]]
    spectrum = dctn(light, axes=(0, 1))
    spectrum *= np.outer(*passed)[..., None]
    return idctn(spectrum, axes=(0, 1), overwrite_x=True)
