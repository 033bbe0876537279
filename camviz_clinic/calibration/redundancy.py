"""What a calibration file says twice, and whether the two agree as far as their digits are printed."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from camviz.lenses.base import Array
from camviz.poses import Rotation

FEWEST_DIGITS = 1e-3  # of the largest number: as coarse as the digits of an array are ever taken to be
ALIKE = 1e-6  # of any unit: what is no farther apart agrees, however it is printed
Difference = Mapping[str, Array]
"""By unit, such as "°", "mm", "px" and "%": a difference as a number or a vector."""


@dataclass(frozen=True)
class Redundancy:
    """`what` a file says, `beside` what it says the same in another place, and how far the two are `apart`, by unit.

    `printed` is how far apart the rounding to the digits in the file can put two that agree, by unit, at most.
    """

    what: str
    beside: str
    apart: Mapping[str, float]
    printed: Mapping[str, float]
    hint: str = ""  # a sentence on what would make them agree


def compared(
    what: str, beside: str, difference: Callable[..., Difference], *values: ArrayLike, hint: str = ""
) -> Redundancy:
    """How far apart the `values` of a file are, and how far their digits allow.

    `difference` takes the values as arrays. Each of their numbers is moved by half a unit of its last digit, and what
    that changes is added up, unless they agree in any case.

    >>> compared("f", "focal", lambda a, b: {"px": a - b}, 700.12, 700.1)
    Redundancy(what='f', beside='focal', apart={'px': 0.02}, printed={'px': 0.055}, hint='')
    """
    arrays = [np.asarray(value, dtype=float) for value in values]
    found = difference(*arrays)
    apart = {unit: _length(vector) for unit, vector in found.items()}
    printed = dict.fromkeys(found, 0.0)
    for index, array in enumerate(arrays if max(apart.values()) > ALIKE else ()):
        half = half_last_digit(array)
        for place in np.ndindex(array.shape):
            moved = array.copy()
            moved[place] += half[place]
            changed = difference(*arrays[:index], moved, *arrays[index + 1 :])
            for unit, was in found.items():
                printed[unit] += _length(changed[unit] - was)
    return Redundancy(what, beside, _rounded(apart), _rounded(printed), hint)


def half_last_digit(values: ArrayLike) -> Array:
    """Half a unit of the last printed digit of each number (…,) of an array.

    A program prints as many decimals of every number, or as many digits: the coarser of the two counts, for trailing
    zeros do not survive reading. A zero counts as exact: it stands where the form of the matrix has one.

    >>> half_last_digit([0.123456, -0.5, 12.345678, 0]).tolist()
    [5e-07, 5e-07, 5e-07, 0.0]
    """
    values = np.asarray(values, dtype=float)
    half = np.zeros_like(values)
    numbers = np.abs(values[values != 0])
    if not numbers.size:
        return half
    words = [np.format_float_scientific(number, trim="-").split("e") for number in numbers]
    digits = np.array([len(mantissa.replace(".", "")) for mantissa, _ in words])
    powers = np.array([int(power) for _, power in words])
    by_decimals = 10.0 ** np.min(powers - digits + 1)
    by_digits = 10.0 ** (powers - np.max(digits) + 1)
    half[values != 0] = np.minimum(np.maximum(by_decimals, by_digits) / 2, FEWEST_DIGITS * np.max(numbers))
    return half


def between_transforms(one: Array, other: Array) -> dict[str, Array]:
    """From one rigid transform (4, 4) to another: the rotation vector in degrees and the shift in millimetres.

    The shift is that of the origin which they place, from a translation in metres.
    """
    return {"°": between_rotations(one[:3, :3], other[:3, :3])["°"], "mm": 1000 * (one[:3, 3] - other[:3, 3])}


def between_rotations(one: Array, other: Array) -> dict[str, Array]:
    """The rotation vector (3,) in degrees from one rotation matrix (3, 3) to another."""
    return {"°": np.degrees((Rotation.from_matrix(one) * Rotation.from_matrix(other).inv()).as_rotvec())}


def between_directions(one: Array, other: Array) -> dict[str, Array]:
    """The rotation vector (3,) in degrees from one direction (3,) to another."""
    cross, cosine = np.cross(one, other), float(one @ other)
    sine = float(np.linalg.norm(cross))  # both times the lengths of the two
    angle = np.degrees(np.arctan2(sine, cosine))
    return {"°": np.asarray(cross * (angle / sine) if sine > 0 else [angle, 0.0, 0.0])}


def share(one: Any, other: Any) -> dict[str, Array]:
    """By how many percent one number is larger than another."""
    return {"%": np.asarray(100 * (one / other - 1))}


def _length(vector: Array) -> float:
    return float(np.linalg.norm(vector))


def _rounded(by_unit: dict[str, float]) -> dict[str, float]:
    return {unit: float(f"{value:.6g}") for unit, value in by_unit.items()}
