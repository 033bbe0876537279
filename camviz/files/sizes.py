"""The size of the image: from the file, or as given where the file is silent."""

from __future__ import annotations

from camviz.calibration.types import CalibrationError
from camviz.files.section import LARGEST_SIDE, Section


def agreed_size(held: tuple[int, int] | None, given: tuple[int, int] | None, keys: str) -> tuple[int, int]:
    """Width and height from the file, or as given where the file is silent; never one against the other."""
    if held and given and held != given:
        raise CalibrationError(
            f"the file says {held[0]}×{held[1]} pixels, the size given is {given[0]}×{given[1]}: leave the size out"
        )
    if size := held or given:
        return size
    raise CalibrationError(
        f"the file holds no image size ({keys}): add --size WIDTHxHEIGHT, such as --size 640x480 "
        "(in Python size=(640, 480))"
    )


def pair_of_sides(section: Section, key: str, order: str = "width height") -> tuple[int, int]:
    """Width and height from two numbers under one key, in this order."""
    sides = dict(zip(order.split(), section.vector(key, [2], order), strict=True))
    pair = Section(sides, section.where(key))
    return pair.whole("width", LARGEST_SIDE), pair.whole("height", LARGEST_SIDE)


def two_sides(section: Section, wide: str, high: str) -> tuple[int, int] | None:
    """Width and height from a key each; None where the file has neither."""
    if wide not in section and high not in section:
        return None
    return section.whole(wide, LARGEST_SIDE), section.whole(high, LARGEST_SIDE)
