"""Colour filter arrays: which colour each pixel of a sensor measures, and the mosaic that it measures so."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from camviz.lenses.base import Array

RED, GREEN, BLUE, WHITE = range(4)
LETTERS = "RGBW"

Rows = tuple[tuple[int, ...], ...]


@dataclass(frozen=True)
class Pattern:
    """A colour filter array: a tile of channels that repeats across the sensor, from its upper left pixel.

    `tile` holds rows of RED, GREEN, BLUE and WHITE; a WHITE pixel has no filter (it is also called panchromatic).
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
        """The pattern whose tile is written as letters, its rows separated by blanks: "RG GB"."""
        if not rows.split() or set(rows) - set(LETTERS + " "):
            raise ValueError(f"rows must be written with the letters {', '.join(LETTERS)} and blanks, got {rows!r}")
        return cls(name, tuple(tuple(LETTERS.index(letter) for letter in row) for row in rows.split()))

    @property
    def letters(self) -> str:
        """The tile as letters: "RG GB"."""
        return " ".join("".join(LETTERS[channel] for channel in row) for row in self.tile)

    @property
    def height(self) -> int:
        return len(self.tile)

    @property
    def width(self) -> int:
        return len(self.tile[0])

    @property
    def present(self) -> tuple[int, ...]:
        """The channels that some pixel measures, in the order of RED, GREEN, BLUE, WHITE."""
        return tuple(sorted({channel for row in self.tile for channel in row}))

    @property
    def is_bayer(self) -> bool:
        """Whether it is one of the four phases of Bayer's array (US patent 3,971,065, 1976)."""
        return self.tile in {pattern.tile for pattern in BAYER.values()}

    def share(self, channel: int) -> float:
        """The share of pixels that measure a channel, 0…1."""
        return sum(row.count(channel) for row in self.tile) / (self.height * self.width)

    def channels(self, height: int, width: int) -> NDArray[np.uint8]:
        """The channel (height, width) that each pixel of a sensor measures."""
        tile = np.array(self.tile, dtype=np.uint8)
        repeats = (-(-height // self.height), -(-width // self.width))
        return np.tile(tile, repeats)[:height, :width]

    def mask(self, channel: int, height: int, width: int) -> NDArray[np.bool_]:
        """Whether each pixel (height, width) measures the channel."""
        return self.channels(height, width) == channel

    def cropped(self, x0: int, y0: int) -> Pattern:
        """The pattern of a mosaic whose first `x0` columns and `y0` rows were cut off.

        An odd number changes the phase of a Bayer array: RGGB without its first column is GRBG.
        """
        rolled = np.roll(np.array(self.tile), (-y0, -x0), axis=(0, 1))
        tile = tuple(tuple(int(channel) for channel in row) for row in rolled)
        known = (pattern for pattern in PATTERNS.values() if pattern.tile == tile)
        return next(known, Pattern(f"{self.name} from ({x0}, {y0})", tile))


def mosaic(picture: ArrayLike, pattern: Pattern) -> Array:
    """What a sensor under the pattern measures (height, width) of a picture (height, width, 3) in linear light.

    A white pixel answers (R + G + B)/3: all channels are scaled so that white light reads the same in each. (On a real
    sensor it gathers about three times as many photons, which is why it is there.) ValueError for another shape.
    """
    light = as_picture(picture)
    measured = np.empty(light.shape[:2], light.dtype)
    rows, columns = np.shape(pattern.tile)
    for (row, column), channel in np.ndenumerate(np.array(pattern.tile)):
        alike = np.s_[row::rows, column::columns]
        measured[alike] = light[alike].mean(axis=-1) if channel == WHITE else light[alike][..., channel]
    return measured


def in_colour(values: ArrayLike, pattern: Pattern) -> Array:
    """A mosaic (height, width) as a picture (height, width, 3): each pixel in its filter's colour, white ones grey."""
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
XTRANS = Pattern.spelled("X-Trans", "GGRGGB GGBGGR BRGRBG GGBGGR GGRGGB RBGBRG")  # Fujifilm, 2012
RGBW = Pattern.spelled("RGBW", "GWRW WGWR BWGW WBWG")  # Kodak's TRUESENSE Sparse (Compton and Hamilton, US 8,139,130)
MONOCHROME = Pattern.spelled("monochrome", "W")

PATTERNS = {pattern.name: pattern for pattern in (*BAYER.values(), XTRANS, RGBW, MONOCHROME)}
