"""A part of a calibration file that knows where it stands in it, so that every error names its key and index."""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from math import prod
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from camviz.cameras import Intrinsics
from camviz.lenses.base import Array
from camviz.poses import RigidTransform, Rotation
from camviz_clinic.calibration.types import CalibrationError
from camviz_clinic.files.trees import MAX_NODES, Repeated, shown

LARGEST = 1e9  # larger magnitudes are damage, not metres or pixels
LARGEST_SIDE = 32768  # pixels
ROTATION_TOLERANCE = 1e-3  # of R Rᵀ = 1, for files written with few digits
Size = tuple[int, int]  # width and height in pixels
NOT_A_ROTATION, BAD_K, COUNT = "not-a-rotation", "bad-k", "coefficient-count"  # findings of the clinic
NOT_CALIBRATED, REVERSED_AXIS = "not-calibrated", "reversed-axis"  # these, too
REVERSED = {  # what negative focal lengths mean, and which coefficient changes its sign with them
    "fx": ("the x axis points left, or the camera looks along -z with y up (OpenGL)", "p2"),
    "fy": ("the y axis points up (OpenGL)", "p1"),
    "fx and fy": ("x points left and y up (PyTorch3D), or the picture is turned by 180°", "p1 and p2"),
}


class MissingSizeError(CalibrationError):
    """A file without an image size, which the caller has to give."""


@dataclass(frozen=True)
class Section:
    """A mapping of the file and the path of keys that leads to it. All readers raise CalibrationError.

    Where `mended` is a list, what can be read in spite of a fault is read, and the error goes into the list.
    """

    values: Mapping[str, Any]
    path: str = ""
    mended: list[CalibrationError] | None = None

    def __contains__(self, key: str) -> bool:
        return self.values.get(key) is not None

    def where(self, key: str) -> str:
        """The path of keys that leads to this one."""
        return f"{self.path}.{key}" if self.path else key

    def error(
        self, key: str, expected: str, got: Any, id: str = "", value: float | None = None, remedy: str = ""
    ) -> CalibrationError:
        """What is wrong under a key: what was expected there and what came."""
        return CalibrationError(f"{self.where(key)}: expected {expected}, got {got}", id, value, remedy)

    def mend(self, error: CalibrationError) -> None:
        """Notes the error where this file is to be read in spite of it; otherwise raises it."""
        if self.mended is None:
            raise error
        self.mended.append(error)

    def part(self, values: Mapping[str, Any], where: str) -> Section:
        """Values of the same file, from another place in it."""
        return Section(values, where, self.mended)

    def get(self, key: str, expected: str) -> Any:
        """The value of a key that must be there."""
        if key not in self:
            raise CalibrationError(f"{self.where(key)}: expected {expected}, the key is missing")
        return self.values[key]

    def section(self, key: str) -> Section:
        """A mapping."""
        value = self.get(key, "a mapping")
        if not isinstance(value, dict):
            raise self.error(key, "a mapping", shown(value))
        return self.part(value, self.where(key))

    def sections(self, key: str) -> list[Section]:
        """The mappings of a list."""
        held = self.get(key, "a list")
        if not isinstance(held, list) or not all(isinstance(part, dict) for part in held):
            raise self.error(key, "a list of mappings", shown(held))
        return [self.part(part, self.where(f"{key}[{index}]")) for index, part in enumerate(held)]

    def repeated(self, key: str) -> list[Section]:
        """The XML elements of a name, however many there are."""
        held = self.values.get(key)
        parts = held if isinstance(held, Repeated) else [] if held is None else [held]
        if not all(isinstance(value, dict) for value in parts):
            raise self.error(key, "elements with attributes", shown(held))
        return [self.part(value, self.where(f"{key}[{index}]")) for index, value in enumerate(parts)]

    def text(self, key: str) -> str:
        """A word."""
        value = self.get(key, "a word")
        if not isinstance(value, str):
            raise self.error(key, "a word", shown(value))
        return value

    def choice(self, key: str, known: Sequence[str]) -> str:
        """A word that is one of those known."""
        value = self.text(key)
        if value not in known:
            raise self.error(key, " or ".join(known), shown(value))
        return value

    def number(self, key: str) -> float:
        """One finite number, bare or as a matrix of one element."""
        value = self.get(key, "a number")
        values = self.array(key) if isinstance(value, (list, dict)) else _as_array(value, self.where(key))
        if values.size != 1:
            raise self.error(key, "one number", f"{values.size}")
        _refuse_damage(values, self.where(key))
        return float(values.flat[0])

    def whole(self, key: str, largest: int) -> int:
        """A whole number from 1 to the largest."""
        value = self.number(key)
        if value != int(value) or not 1 <= value <= largest:
            raise self.error(key, f"a whole number from 1 to {largest}", f"{value:g}")
        return int(value)

    def sides(self, wide: str, high: str) -> Size | None:
        """Width and height from a key each; None where the file has neither."""
        if wide not in self and high not in self:
            return None
        return self.whole(wide, LARGEST_SIDE), self.whole(high, LARGEST_SIDE)

    def size(self, key: str, order: str = "width height") -> Size | None:
        """Width and height from two numbers under one key, in this order; None where the file has no such key."""
        if key not in self:
            return None
        sides = dict(zip(order.split(), self.vector(key, [2], order), strict=True))
        return as_size(sides["width"], sides["height"], self.where(key))

    def array(self, key: str, damaged: bool = False) -> Array:
        """Numbers in the shape the file gives them; NaN passes only where `damaged` allows it."""
        value, where = self.get(key, "numbers"), self.where(key)
        array = _as_matrix(Section(value, where)) if isinstance(value, dict) else _as_array(value, where)
        if not damaged:
            _refuse_damage(array, where)
        return array

    def vector(self, key: str, lengths: Sequence[int], meaning: str, id: str = "") -> list[float]:
        """As many numbers as one of `lengths` says, as a row or a column; the error for another count has `id`."""
        values = np.atleast_1d(self.array(key))
        if values.size not in lengths or max(values.shape, default=0) != values.size:
            takes = " or ".join(filter(None, [", ".join(map(str, lengths[:-1])), str(lengths[-1])]))
            remedy = without_zeros(values.ravel(), lengths) if id == COUNT else ""
            raise self.error(key, f"{takes} numbers ({meaning})", _shape(values), id, values.size, remedy)
        return [float(value) for value in values.ravel()]

    def coefficients(self, key: str, lengths: Sequence[int], meaning: str, others: Sequence[int] = ()) -> list[float]:
        """Distortion coefficients, whose number is one of `lengths`; one of `others` can be mended."""
        try:
            return self.vector(key, lengths, meaning, COUNT)
        except CalibrationError as error:
            values = self.array(key).ravel()
            if error.id != COUNT or values.size not in others:
                raise
            self.mend(error)
            return [float(value) for value in values]

    def matrix(self, key: str, rows: int, columns: int) -> Array:
        """Numbers as rows × columns, nested or in one row-major list."""
        values = self.array(key)
        if values.shape not in {(rows, columns), (rows * columns,)}:
            raise self.error(key, f"{rows}×{columns} numbers", _shape(values))
        return values.reshape(rows, columns)

    def rotation(self, key: str) -> Rotation:
        """The rotation of 3×3 numbers."""
        return self._rotation(self.matrix(key, 3, 3), key)

    def transform(self, key: str) -> RigidTransform:
        """A rigid transform [R t; 0 1], 4×4."""
        matrix = self.matrix(key, 4, 4)
        if not _is_bottom(matrix[3]):
            row = " ".join(f"{x:g}" for x in matrix[3])
            off = float(np.abs(matrix[3] - [0, 0, 0, 1]).max())
            self.mend(self.error(key, "0 0 0 1 in the bottom row of a rigid transform", row, NOT_A_ROTATION, off))
            matrix = matrix.T if _is_bottom(matrix[:, 3]) else matrix
        return RigidTransform.from_components(matrix[:3, 3], self._rotation(matrix[:3, :3], key))

    def quaternion(self, quaternion: ArrayLike, where: str, scalar_first: bool = False) -> Rotation:
        """The rotation of four numbers, which must have length 1."""
        length = float(np.linalg.norm(quaternion))
        if not abs(length - 1) < ROTATION_TOLERANCE:
            text = f"{where}: expected a quaternion of length 1, got length {length:g}"
            error = CalibrationError(text, NOT_A_ROTATION, length)
            if not length > 0:
                raise error
            self.mend(error)
        return Rotation.from_quat(quaternion, scalar_first=scalar_first)

    def intrinsics(self, K: Array, where: str, size: Size) -> Intrinsics:
        """Those of K (3, 3), upper triangular with K[2, 2] = 1; mended by transposing and by dividing."""
        with explained(where, BAD_K):
            refuse_zero(K[0, 0], K[1, 1], where)
            if not _is_camera_matrix(K):
                good, error = _good_camera_matrix(K), _bad_camera_matrix(K, where)
                if good is None:
                    raise error
                self.mend(error)
                K = good
            refuse_focal_lengths(K[0, 0], K[1, 1], where)
            return Intrinsics.from_matrix(K, *size)

    def _rotation(self, matrix: Array, key: str) -> Rotation:
        try:
            return as_rotation(matrix, self.where(key))
        except CalibrationError as error:
            U, singular, Vt = np.linalg.svd(matrix)
            if not singular[1] > 0.1 * singular[0]:  # nothing like a rotation is left in it
                raise
            self.mend(error)
            return Rotation.from_matrix(U @ np.diag([1, 1, np.sign(np.linalg.det(U @ Vt))]) @ Vt)


def as_size(width: float, height: float, where: str) -> Size:
    """Two numbers as width and height; CalibrationError where they are no numbers of pixels."""
    sides = Section({"width": width, "height": height}, where)
    return sides.whole("width", LARGEST_SIDE), sides.whole("height", LARGEST_SIDE)


def agreed_size(held: Size | None, given: Size | None, keys: str) -> Size:
    """Width and height from the file, or as given where the file is silent; never one against the other."""
    if held and given and held != given:
        raise CalibrationError(
            f"the file says {held[0]}×{held[1]} pixels, the size given is {given[0]}×{given[1]}: leave the size out"
        )
    if size := held or given:
        return size
    raise MissingSizeError(
        f"the file holds no image size ({keys}): add --size WIDTHxHEIGHT, such as --size 640x480 "
        "(in Python size=(640, 480))"
    )


@contextmanager
def named(where: object) -> Iterator[None]:
    """Puts the name of a file, or of a part of it, before what is wrong in it."""
    try:
        yield
    except CalibrationError as error:
        raise type(error)(f"{where}: {error}", error.id, error.value, error.remedy) from error.__cause__


@contextmanager
def explained(where: str, id: str = "") -> Iterator[None]:
    """Turns the ValueError of a constructor into a CalibrationError that names the place in the file."""
    try:
        yield
    except CalibrationError:
        raise
    except ValueError as error:
        raise CalibrationError(f"{where}: {error}", id) from error


def without_zeros(values: Array, lengths: Sequence[int]) -> str:
    """The remedy for too many coefficients whose last are 0, in a sentence; empty where it leads to no length."""
    used = len(np.trim_zeros(values, "b"))
    fitting = [length for length in sorted(lengths) if used <= length < len(values)]
    extra = len(values) - fitting[0] if fitting else 0
    which = f"the last {extra} numbers, which are" if extra > 1 else "the last number, which is"
    return f"Delete {which} 0: the camera stays the same." if fitting else ""


def refuse_focal_lengths(fx: float, fy: float, where: str) -> None:
    """Raise CalibrationError for a focal length in pixels that is 0 or negative, saying what that means."""
    refuse_zero(fx, fy, where)
    negative = " and ".join(name for name, f in (("fx", fx), ("fy", fy)) if f < 0)
    if negative:
        meaning, tangential = REVERSED[negative]
        text = f"{where}: expected positive focal lengths, got fx = {fx:g} and fy = {fy:g} px: {meaning}"
        remedy = f"Write {negative} without the minus, and change the sign of {tangential} (Brown's lens). "
        raise CalibrationError(text, REVERSED_AXIS, min(fx, fy), f"{remedy}Reverse the same axes in its poses.")


def refuse_zero(fx: float, fy: float, where: str) -> None:
    """Raise CalibrationError for a focal length of 0, which a camera has before it is calibrated."""
    if zero := [name for name, f in (("fx", fx), ("fy", fy)) if f == 0]:
        raise CalibrationError(f"{where}: {' = '.join(zero)} = 0: the camera is not calibrated", NOT_CALIBRATED, 0.0)


def as_rotation(matrix: Array, where: str) -> Rotation:
    """The rotation a 3×3 matrix is; CalibrationError when it is none, with the number that shows it."""
    off = np.abs(matrix @ matrix.T - np.eye(3)).max()
    if off > ROTATION_TOLERANCE:
        text = f"{where}: expected a rotation, but R Rᵀ differs from the identity by {off:.3g}"
        raise CalibrationError(text, NOT_A_ROTATION, float(off))
    if np.linalg.det(matrix) < 0:
        text = f"{where}: expected a rotation, but this is a reflection (its determinant is -1)"
        raise CalibrationError(text, NOT_A_ROTATION, -1.0)
    return Rotation.from_matrix(matrix)


def _is_bottom(row: Array) -> bool:
    return np.allclose(row, [0, 0, 0, 1], rtol=0, atol=ROTATION_TOLERANCE)


def _is_camera_matrix(K: Array) -> bool:
    return np.array_equal(K[[1, 2, 2, 2], [0, 0, 1, 2]], [0, 0, 0, 1])


def _bad_camera_matrix(K: Array, where: str) -> CalibrationError:
    turned = " (its transpose is)" if _is_camera_matrix(K.T) else ""
    text = f"{where}: K must be upper triangular with K[2, 2] = 1{turned}, got {K.tolist()}"
    off = K[2, 2] if K[2, 2] != 1 else K[2, 0] or K[2, 1] or K[1, 0]
    return CalibrationError(text, BAD_K, float(off), _good_form(K))


def _good_form(K: Array) -> str:
    """What makes a camera matrix of K, in a sentence; empty where nothing does."""
    steps = ["Transpose K"] * bool(K[2, :2].any()) + [f"divide K by K[2, 2] = {K[2, 2]:g}"] * bool(K[2, 2] != 1)
    done = " and ".join(steps)
    return f"{done[0].upper()}{done[1:]}." if _good_camera_matrix(K) is not None else ""


def _good_camera_matrix(K: Array) -> Array | None:
    with np.errstate(invalid="ignore", divide="ignore"):
        return next((form for form in (K.T, K / K[2, 2], K.T / K[2, 2]) if _is_camera_matrix(form)), None)


def _as_matrix(section: Section) -> Array:
    """The matrices of OpenCV and ROS: rows and cols (or OpenCV's `sizes`), data, and `dt`: channels, letter."""
    dt = section.text("dt") if "dt" in section else "d"
    if not (match := re.fullmatch(r"([1-9]?)([a-zA-Z])", dt)):
        raise section.error("dt", "an element type such as d, f or 2f", shown(dt))
    shape = _matrix_shape(section) + ((int(match[1]),) if match[1] else ())
    values = section.array("data", damaged=True).ravel() if "data" in section else np.empty(0)
    if values.size != prod(shape):
        raise section.error("data", f"{'×'.join(map(str, shape))} = {prod(shape)} numbers", f"{values.size}")
    return values.reshape(shape)


def _matrix_shape(section: Section) -> tuple[int, ...]:
    sides = section.array("sizes").ravel() if "sizes" in section else [section.number(key) for key in ("rows", "cols")]
    if len(sides) > 4 or not all(side == int(side) and 0 <= side <= MAX_NODES for side in sides):
        raise section.error("sizes", f"up to 4 whole numbers from 0 to {MAX_NODES}", shown(list(map(float, sides))))
    return tuple(int(side) for side in sides)


def _as_array(value: Any, where: str) -> Array:
    if isinstance(value, list):
        rows = [
            _as_array(item, f"{where}[{index}]") if isinstance(item, list) else item for index, item in enumerate(value)
        ]
        if any(isinstance(row, np.ndarray) for row in rows):
            return _stacked(rows, where)
    numbers = value if isinstance(value, list) else [value]
    for index, number in enumerate(numbers):
        if isinstance(number, bool) or not isinstance(number, (int, float)):
            place = f"{where}[{index}]" if isinstance(value, list) else where
            raise CalibrationError(f"{place}: expected a number, got {shown(number)}")
    return np.array(value, dtype=np.float64)


def _stacked(rows: list[Any], where: str) -> Array:
    shapes = {row.shape if isinstance(row, np.ndarray) else () for row in rows}
    if len(shapes) > 1:
        raise CalibrationError(f"{where}: expected rows of equal length")
    return np.stack(rows)


def _refuse_damage(values: Array, where: str) -> None:
    bad = np.argwhere(~(np.abs(values) <= LARGEST))
    if len(bad):
        index = ", ".join(map(str, bad[0]))
        place = f"{where}[{index}]" if index else where
        raise CalibrationError(f"{place}: expected a finite number below {LARGEST:g}, got {values[tuple(bad[0])]:g}")


def _shape(values: Array) -> str:
    return "×".join(map(str, values.shape)) if values.ndim > 1 else f"{values.size}"
