"""The forms in which robots write a rotation: matrices, quaternions in either order, Euler angles, rotation vectors."""

from __future__ import annotations

import re
from collections.abc import Callable, Iterator
from itertools import permutations

import numpy as np
from numpy.typing import NDArray

from camviz.lenses.base import Array
from camviz.poses import Rotation
from camviz_clinic.calibration.motions import PoseError

FORMS = ("matrix", "xyzw", "wxyz", "rotvec", "euler-ORDER")
EULER = re.compile(r"euler-(xyz|xzy|yxz|yzx|zxy|zyx|XYZ|XZY|YXZ|YZX|ZXY|ZYX)")
QUATERNIONS = ("xyzw", "wxyz")
COUNTS = {"matrix": 9, "xyzw": 4, "wxyz": 4, "rotvec": 3}
ROUNDED = 0.02  # how far a quaternion's length, or a product of a matrix's columns, may be off by rounding
FULL_TURN = 2 * np.pi + 0.01  # no angle in radians is larger; 0.01 for rounding


def count(form: str) -> int:
    """How many numbers a form has."""
    return COUNTS.get(form, 3)


def is_form(text: str) -> bool:
    """Whether a word names a form of rotation."""
    return text in COUNTS or bool(EULER.fullmatch(text))


def says(form: str) -> str:
    """A form in words."""
    if form in QUATERNIONS:
        return f"quaternions {', '.join(form)}"
    if form == "rotvec":
        return "rotation vectors"
    if form == "matrix":
        return "matrices"
    order = form.removeprefix("euler-")
    axes = "the fixed axes" if order.islower() else "the moving axes"
    return f"Euler angles about {axes} {', '.join(order.lower())}, in this order"


def rotations(form: str, numbers: Array, degrees: bool) -> Rotation:
    """Rotations of numbers (n, `count(form)`) in a form; angles in radians unless they are in degrees.

    Raises: PoseError for a matrix or a quaternion that is no rotation; the sentence begins with the row, from 1.
    Source: Diebel, *Representing attitude: Euler angles, unit quaternions, and rotation vectors* (2006).

    >>> rotations("wxyz", np.array([[1.0, 0, 0, 0]]), degrees=False).magnitude()
    array([0.])
    """
    if form in QUATERNIONS:
        lengths = np.linalg.norm(numbers, axis=1)
        _refuse(np.abs(lengths - 1) > ROUNDED, lambda row: f"a quaternion has length 1, this one {lengths[row]:.3g}")
        return Rotation.from_quat(numbers, scalar_first=form == "wxyz")
    if form == "matrix":
        return _of_matrices(numbers.reshape(-1, 3, 3))
    if form == "rotvec":
        return Rotation.from_rotvec(numbers, degrees=degrees)
    return Rotation.from_euler(form.removeprefix("euler-"), numbers, degrees=degrees)


def other_readings(form: str, numbers: Array, degrees: bool) -> Iterator[tuple[str, Rotation]]:
    """The same numbers in other forms that have as many, each with what would ask for it."""
    if form == "matrix":
        yield "the rotations transposed", rotations(form, numbers, degrees).inv()
    elif form in QUATERNIONS:
        (other,) = set(QUATERNIONS) - {form}
        yield f"--rotation {other}", rotations(other, numbers, degrees)
    else:
        orders = ("".join(order) for order in permutations("xyz"))
        euler = [f"euler-{each}" for order in orders for each in (order, order.upper())]
        for other in ("rotvec", *euler):
            if other != form:
                yield f"--rotation {other}", rotations(other, numbers, degrees)
        if degrees or np.abs(numbers).max() <= FULL_TURN:
            yield f"--angles {'rad' if degrees else 'deg'}", rotations(form, numbers, not degrees)


def _of_matrices(matrices: Array) -> Rotation:
    squares = np.abs(np.swapaxes(matrices, 1, 2) @ matrices - np.eye(3)).max(axis=(1, 2))
    _refuse(squares > ROUNDED, lambda row: f"its 3 × 3 numbers are no rotation (RᵀR is off by {squares[row]:.2g})")
    _refuse(np.linalg.det(matrices) < 0, lambda row: "its 3 × 3 numbers are a mirror image, not a rotation")
    return Rotation.from_matrix(matrices)


def _refuse(wrong: NDArray[np.bool_], why: Callable[[int], str]) -> None:
    """PoseError for the first row that is wrong."""
    if wrong.any():
        row = int(np.argmax(wrong))
        raise PoseError(f"pose {row + 1}: {why(row)}")
