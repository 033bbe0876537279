"""Colour filter arrays: which colour each pixel of a sensor measures, and the mosaic that it measures so."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from camviz.lenses.arrays import Count, LinearPicture, LinearPictureLike, MosaicLike, Share
from camviz.lenses.base import Array

RED = 0
"""The channel red, of a `Pattern` and of a picture (height, width, 3).

>>> np.array([0.9, 0.5, 0.1])[RED]
np.float64(0.9)
"""
GREEN = 1
"""The channel green, of a `Pattern` and of a picture (height, width, 3).

>>> np.array([0.9, 0.5, 0.1])[GREEN]
np.float64(0.5)
"""
BLUE = 2
"""The channel blue, of a `Pattern` and of a picture (height, width, 3).

>>> np.array([0.9, 0.5, 0.1])[BLUE]
np.float64(0.1)
"""
WHITE = 3
"""The channel of a pixel without a filter, of a `Pattern`.

>>> RGBW.share(WHITE)
0.5
"""
LETTERS = "RGBW"

Rows = tuple[tuple[int, ...], ...]


@dataclass(frozen=True)
class Pattern:
    """A colour filter array: a tile of channels that repeats across the sensor, from its upper left pixel.

    Args:
        name: For readers.
        tile: tuple of tuple of int, rows of RED, GREEN, BLUE and WHITE; a WHITE pixel has no filter (it is also called
            panchromatic).

    Raises: ValueError for rows of different lengths, and for other channels.

    >>> Pattern("stripes", ((RED, GREEN, BLUE),)).channels(2, 5)
    array([[0, 1, 2, 0, 1],
           [0, 1, 2, 0, 1]], dtype=uint8)
    """

    name: str
    tile: Rows

    def __post_init__(self) -> None:
        lengths = {len(row) for row in self.tile}
        if not self.tile or lengths == {0} or len(lengths) != 1:
            raise ValueError(f"tile must hold rows of one length, got {self.tile!r}")
        if not {channel for row in self.tile for channel in row} <= set(range(len(LETTERS))):
            raise ValueError(f"tile must hold channels 0 (red) to {WHITE} (white), got {self.tile!r}")

    @classmethod
    def spelled(cls, name: str, rows: str) -> Pattern:
        """The pattern whose tile is written as letters.

        Args:
            name: For readers.
            rows: The tile's rows with blanks between them: "RG GB".

        Raises: ValueError for letters other than R, G, B and W, and rows of different lengths.
        """
        if not rows.split() or set(rows) - set(LETTERS + " "):
            raise ValueError(f"rows must be written with the letters {', '.join(LETTERS)} and blanks, got {rows!r}")
        return cls(name, tuple(tuple(LETTERS.index(letter) for letter in row) for row in rows.split()))

    @property
    def letters(self) -> str:
        """The tile as letters: "RG GB"."""
        return " ".join("".join(LETTERS[channel] for channel in row) for row in self.tile)

    @property
    def height(self) -> int:
        """Of the tile, in pixels."""
        return len(self.tile)

    @property
    def width(self) -> int:
        """Of the tile, in pixels."""
        return len(self.tile[0])

    @property
    def present(self) -> tuple[int, ...]:
        """The channels that some pixel measures, in the order of RED, GREEN, BLUE, WHITE."""
        return tuple(sorted({channel for row in self.tile for channel in row}))

    @property
    def is_bayer(self) -> bool:
        """Whether it is one of the four phases of Bayer's array."""
        return self.tile in {pattern.tile for pattern in BAYER.values()}

    def share(self, channel: int) -> Share:
        """The share of pixels that measure a channel.

        Args:
            channel: RED, GREEN, BLUE or WHITE.
        """
        return sum(row.count(channel) for row in self.tile) / (self.height * self.width)

    def channels(self, height: Count, width: Count) -> NDArray[np.uint8]:
        """The channel that each pixel of a sensor measures.

        Returns: (height, width), RED, GREEN, BLUE or WHITE, uint8.
        """
        tile = np.array(self.tile, dtype=np.uint8)
        repeats = (-(-height // self.height), -(-width // self.width))
        return np.tile(tile, repeats)[:height, :width]

    def mask(self, channel: int, height: Count, width: Count) -> NDArray[np.bool_]:
        """Whether each pixel of a sensor measures a channel.

        Args:
            channel: RED, GREEN, BLUE or WHITE.

        Returns: (height, width), True where it does.
        """
        return self.channels(height, width) == channel

    def cropped(self, x0: int, y0: int) -> Pattern:
        """The pattern of a mosaic whose first columns and rows were cut off.

        An odd number changes the phase of a Bayer array: RGGB without its first column is GRBG.

        Args:
            x0, y0: How many columns, and how many rows.

        Returns: One of PATTERNS where the tile is known.
        """
        rolled = np.roll(np.array(self.tile), (-y0, -x0), axis=(0, 1))
        tile = tuple(tuple(int(channel) for channel in row) for row in rolled)
        known = (pattern for pattern in PATTERNS.values() if pattern.tile == tile)
        return next(known, Pattern(f"{self.name} from ({x0}, {y0})", tile))


def mosaic(picture: LinearPictureLike, pattern: Pattern) -> Array:
    """What a sensor under a pattern measures of a picture: one channel a pixel.

    A white pixel answers (R + G + B)/3: all channels are scaled so that white light reads the same in each. (On a real
    sensor it gathers about three times as many photons, which is why it is there.)

    Returns: (height, width), linear light; float32 if the picture is, otherwise float64.
    Raises: ValueError for a picture of another shape.
    Source: Szeliski (2022), section 2.3.2, color filter arrays.

    >>> mosaic([[(1, 2, 3), (4, 5, 6)], [(7, 8, 9), (10, 11, 12)]], BAYER["RGGB"])
    array([[ 1.,  5.],
           [ 8., 12.]])
    """
    light = as_picture(picture)
    measured = np.empty(light.shape[:2], light.dtype)
    rows, columns = np.shape(pattern.tile)
    for (row, column), channel in np.ndenumerate(np.array(pattern.tile)):
        alike = np.s_[row::rows, column::columns]
        measured[alike] = light[alike].mean(axis=-1) if channel == WHITE else light[alike][..., channel]
    return measured


def in_colour(values: MosaicLike, pattern: Pattern) -> LinearPicture:
    """A mosaic as a picture: each pixel in its filter's colour, white ones grey.

    >>> in_colour([[0.1, 0.2], [0.3, 0.4]], BAYER["RGGB"])[0]  # red, and green
    array([[0.1, 0. , 0. ],
           [0. , 0.2, 0. ]])
    """
    measured = as_mosaic(values)
    seen = pattern.channels(*measured.shape)
    return measured[..., None] * np.vstack([np.eye(3), np.ones(3)])[seen]


def as_picture(picture: ArrayLike) -> Array:
    """The picture (height, width, 3) as float, in single precision if it has no more. ValueError for another shape."""
    light = np.asarray(picture)
    light = np.asarray(light, dtype=np.float32 if light.dtype == np.float32 else float)
    if light.ndim != 3 or light.shape[2] != 3:
        raise ValueError(f"picture must have the shape (height, width, 3), got {light.shape}")
    return light


def as_mosaic(values: ArrayLike) -> Array:
    """The mosaic as float (height, width). ValueError for another shape."""
    measured = np.asarray(values, dtype=float)
    if measured.ndim != 2:
        raise ValueError(f"a mosaic must have the shape (height, width), one number for each pixel: {measured.shape}")
    return measured


BAYER = {name: Pattern.spelled(name, f"{name[:2]} {name[2:]}") for name in ("RGGB", "BGGR", "GRBG", "GBRG")}
"""The four phases of Bayer's array by their tiles (B. E. Bayer, US patent 3,971,065, 1976).

>>> list(BAYER), BAYER["RGGB"].letters
(['RGGB', 'BGGR', 'GRBG', 'GBRG'], 'RG GB')
"""
XTRANS = Pattern.spelled("X-Trans", "GGRGGB GGBGGR BRGRBG GGBGGR GGRGGB RBGBRG")
"""Fujifilm's array (2012), in which every row and every column holds all three colours.

>>> round(XTRANS.share(GREEN), 3)  # 20 of 36
0.556
"""
RGBW = Pattern.spelled("RGBW", "GWRW WGWR BWGW WBWG")
"""Kodak's TRUESENSE Sparse array (J. T. Compton and J. F. Hamilton, US patent 8,139,130), half of it without filters.

>>> RGBW.letters
'GWRW WGWR BWGW WBWG'
"""
MONOCHROME = Pattern.spelled("monochrome", "W")
"""A sensor without colour filters.

>>> MONOCHROME.share(WHITE)
1.0
"""

PATTERNS = {pattern.name: pattern for pattern in (*BAYER.values(), XTRANS, RGBW, MONOCHROME)}
"""Every pattern here by its name.

>>> list(PATTERNS)
['RGGB', 'BGGR', 'GRBG', 'GBRG', 'X-Trans', 'RGBW', 'monochrome']
"""
