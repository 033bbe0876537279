"""What the writers share: text with all digits."""

from __future__ import annotations

import json
from typing import Any

import yaml

from camviz.lenses.base import Array
from camviz.poses import RigidTransform


def as_yaml(tree: dict[str, Any]) -> bytes:
    """A tree as YAML, with lists of numbers in one line."""
    return yaml.safe_dump(tree, default_flow_style=None, sort_keys=False, width=1000, allow_unicode=True).encode()


def as_json(tree: dict[str, Any]) -> bytes:
    """A tree as JSON."""
    return (json.dumps(tree, indent=2, ensure_ascii=False) + "\n").encode()


def as_rows(pose: RigidTransform) -> list[list[float]]:
    """A pose as the four rows of its matrix."""
    return [list(map(float, row)) for row in pose.as_matrix()]


def as_matrix(values: Array) -> dict[str, Any]:
    """A matrix (rows, columns) as ROS and EuRoC write it: rows, cols and all elements in one list."""
    return {"rows": values.shape[0], "cols": values.shape[1], "data": [float(x) for x in values.ravel()]}
