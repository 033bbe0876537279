"""A part of a calibration file that remembers where it stands, so that every complaint names its key and index."""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from math import prod
from typing import Any

import numpy as np
from scipy.spatial.transform import RigidTransform, Rotation

from camviz.files.calibration import CalibrationError
from camviz.files.trees import MAX_NODES, shown
from camviz.lenses.base import Array

LARGEST = 1e9  # larger magnitudes are damage, not metres or pixels
LARGEST_SIDE = 32768  # pixels
ROTATION_TOLERANCE = 1e-3  # of R Rᵀ = 1, for files written with few digits


@dataclass(frozen=True)
class Section:
    """A mapping of the file and the path of keys that leads to it. All readers raise CalibrationError."""

    values: Mapping[str, Any]
    path: str = ""

    def __contains__(self, key: str) -> bool:
        return self.values.get(key) is not None

    def where(self, key: str) -> str:
        return f"{self.path}.{key}" if self.path else key

    def error(self, key: str, expected: str, got: Any) -> CalibrationError:
        return CalibrationError(f"{self.where(key)}: expected {expected}, got {got}")

    def get(self, key: str, expected: str) -> Any:
        if key not in self:
            raise CalibrationError(f"{self.where(key)}: expected {expected}, the key is missing")
        return self.values[key]

    def section(self, key: str) -> Section:
        value = self.get(key, "a mapping")
        if not isinstance(value, dict):
            raise self.error(key, "a mapping", shown(value))
        return Section(value, self.where(key))

    def text(self, key: str) -> str:
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
        value = self.get(key, "a number")
        values = self.array(key) if isinstance(value, (list, dict)) else _as_array(value, self.where(key))
        if values.size != 1:
            raise self.error(key, "one number", f"{values.size}")
        _refuse_damage(values, self.where(key))
        return float(values.flat[0])

    def whole(self, key: str, largest: int) -> int:
        value = self.number(key)
        if value != int(value) or not 1 <= value <= largest:
            raise self.error(key, f"a whole number from 1 to {largest}", f"{value:g}")
        return int(value)

    def array(self, key: str, damaged: bool = False) -> Array:
        """Numbers in the shape the file gives them; NaN passes only where `damaged` allows it."""
        value, where = self.get(key, "numbers"), self.where(key)
        array = _as_matrix(Section(value, where)) if isinstance(value, dict) else _as_array(value, where)
        if not damaged:
            _refuse_damage(array, where)
        return array

    def vector(self, key: str, lengths: Sequence[int], meaning: str) -> list[float]:
        """As many numbers as one of `lengths` says, as a row or a column."""
        values = np.atleast_1d(self.array(key))
        if values.size not in lengths or max(values.shape, default=0) != values.size:
            takes = " or ".join(filter(None, [", ".join(map(str, lengths[:-1])), str(lengths[-1])]))
            raise self.error(key, f"{takes} numbers ({meaning})", _shape(values))
        return [float(value) for value in values.ravel()]

    def matrix(self, key: str, rows: int, columns: int) -> Array:
        """Numbers as rows × columns, nested or in one row-major list."""
        values = self.array(key)
        if values.shape not in {(rows, columns), (rows * columns,)}:
            raise self.error(key, f"{rows}×{columns} numbers", _shape(values))
        return values.reshape(rows, columns)

    def rotation(self, key: str) -> Rotation:
        return as_rotation(self.matrix(key, 3, 3), self.where(key))

    def transform(self, key: str) -> RigidTransform:
        """A rigid transform [R t; 0 1], 4×4."""
        matrix = self.matrix(key, 4, 4)
        if not np.allclose(matrix[3], [0, 0, 0, 1], rtol=0, atol=ROTATION_TOLERANCE):
            raise self.error(
                key, "0 0 0 1 in the bottom row of a rigid transform", " ".join(f"{x:g}" for x in matrix[3])
            )
        return RigidTransform.from_components(matrix[:3, 3], as_rotation(matrix[:3, :3], self.where(key)))


@contextmanager
def explained(where: str) -> Iterator[None]:
    """What a constructor complains about, said with the place in the file."""
    try:
        yield
    except CalibrationError:
        raise
    except ValueError as error:
        raise CalibrationError(f"{where}: {error}") from error


def as_rotation(matrix: Array, where: str) -> Rotation:
    """The rotation a 3×3 matrix is; CalibrationError when it is none, with the number that shows it."""
    off = np.abs(matrix @ matrix.T - np.eye(3)).max()
    if off > ROTATION_TOLERANCE:
        raise CalibrationError(f"{where}: expected a rotation, but R Rᵀ differs from the identity by {off:.3g}")
    if np.linalg.det(matrix) < 0:
        raise CalibrationError(f"{where}: expected a rotation, but this is a reflection (its determinant is -1)")
    return Rotation.from_matrix(matrix)


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
