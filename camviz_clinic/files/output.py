"""What the writers share: text with all digits."""

from __future__ import annotations

import json
from collections.abc import Mapping
from math import isfinite
from typing import Any

import numpy as np
import yaml

from camviz.lenses.base import Array
from camviz.poses import RigidTransform


def as_yaml(tree: dict[str, Any]) -> bytes:
    """A tree as YAML, with lists of numbers in one line."""
    return yaml.safe_dump(tree, default_flow_style=None, sort_keys=False, width=1000, allow_unicode=True).encode()


def as_json(tree: dict[str, Any] | list[Any]) -> bytes:
    """A tree as JSON, whose numbers are finite; ValueError for others, which no calibration may have."""
    return (json.dumps(tree, indent=2, ensure_ascii=False, allow_nan=False) + "\n").encode()


def json_text(tree: dict[str, Any] | list[Any]) -> str:
    """A tree of figures as strict JSON (RFC 8259): what is not finite, which JSON cannot say, is null.

    >>> json_text({"rms": float("nan"), "views": [1, float("inf")]}).split()
    ['{', '"rms":', 'null,', '"views":', '[', '1,', 'null', ']', '}']
    """
    return json.dumps(_finite(tree), indent=2, ensure_ascii=False, allow_nan=False)


def _finite(value: Any) -> Any:
    """The same with None in the place of NaN and infinities."""
    if isinstance(value, dict):
        return {key: _finite(each) for key, each in value.items()}
    if isinstance(value, list | tuple):
        return [_finite(each) for each in value]
    return None if isinstance(value, float) and not isfinite(value) else value


def as_rows(pose: RigidTransform) -> list[list[float]]:
    """A pose as the four rows of its matrix."""
    return [list(map(float, row)) for row in pose.as_matrix()]


def as_matrix(values: Array) -> dict[str, Any]:
    """A matrix (rows, columns) as ROS and EuRoC write it: rows, cols and all elements in one list."""
    return {"rows": values.shape[0], "cols": values.shape[1], "data": [float(x) for x in values.ravel()]}


def as_opencv(tree: Mapping[str, Any]) -> bytes:
    """OpenCV's YAML under any keys, those with dots too, which cv2.FileStorage does not write.

    Values are numbers, words, arrays (rows, columns) and mappings of numbers.
    """
    lines = ["%YAML:1.0", "---"]
    for key, value in tree.items():
        if isinstance(value, Mapping):
            lines += [f"{key}:", *(f"   {name}: {number!r}" for name, number in value.items())]
        elif isinstance(value, np.ndarray):
            rows, columns = value.shape
            numbers = ", ".join(repr(float(x)) for x in value.ravel())
            lines += [f"{key}: !!opencv-matrix", f"   rows: {rows}", f"   cols: {columns}", "   dt: d"]
            lines.append(f"   data: [ {numbers} ]")
        else:
            lines.append(f"{key}: {json.dumps(value, ensure_ascii=False)}")
    return ("\n".join(lines) + "\n").encode()
