"""Colour filter arrays: patterns and mosaics, demosaicing, and measures of what it gets wrong."""

from camviz.mosaics.patterns import (
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

__all__ = [
    "BAYER",
    "BLUE",
    "GREEN",
    "MONOCHROME",
    "PATTERNS",
    "RED",
    "RGBW",
    "WHITE",
    "XTRANS",
    "Pattern",
    "in_colour",
    "mosaic",
]
