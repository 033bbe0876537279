"""What a hand on a view's picture does, learnt by trying: a page without a kernel cannot ask the view.

Every handle is pulled in Python, and what that does to the recorded axes becomes a small table. Handles that move
nothing recorded (a board in space, a point of an image) get none; a pointer there does nothing.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from itertools import pairwise
from math import isclose, nan
from typing import Any

import numpy as np

from camviz.draw.flow import Cell
from camviz.draw.picture import Picture
from camviz.views.base import View

PULLS = tuple(float(pull) for pull in np.linspace(-480, 480, 49))  # picture units, as far as a picture's middle
PLACES = (36, 24)  # columns and rows over a tile, at which the pointer is tried
KEYS = (("ArrowRight", "ArrowLeft"), ("ArrowUp", "ArrowDown"), ("+", "-"))

Read = Callable[[View], Mapping[str, Any]]
"""The recorded axes' values in a view."""


@dataclass(frozen=True)
class Reading:
    """What is tried, on which view, and how its axes are read."""

    view: View
    read: Read
    turning: tuple[str, ...] = ()
    """The axes that are angles, which begin anew after 360°."""

    def after(self, action: str, *what: Any) -> Mapping[str, Any]:
        """The axes after the view was "dragged" or "pressed"; as before where it refuses."""
        try:
            return self.read(getattr(self.view, action)(*what))
        except (ValueError, ArithmeticError, LookupError):
            return self.read(self.view)


def hands(trial: Reading, picture: Picture) -> dict[str, dict[str, Any]]:
    """What each handle of a view's picture does: `keys` step an axis on or back, `pulls` and `places` set values.

    `keys[key]` is {axis: ±1}. `pulls[axis]` is the direction ("x" or "y") and the values after PULLS. `places` is the
    tile's cell with columns and rows, and the values of each axis where the pointer alone decides (bars, charts).
    """
    found: dict[str, dict[str, Any]] = {}
    for tile in picture.tiles:
        for handle in tile.marks.handles:
            does = {"keys": _keys(trial, handle), "pulls": _pulls(trial, handle), **_places(trial, handle, tile.cell)}
            found[handle] = {name: one for name, one in does.items() if one}
    return {handle: does for handle, does in found.items() if does}


def _keys(trial: Reading, handle: str) -> dict[str, dict[str, int]]:
    """The axes that a key steps on or back; where one of two keys can do nothing more, the other one tells."""
    before, found = trial.read(trial.view), dict[str, dict[str, int]]()
    for key, other in KEYS:
        there, back = (_signs(before, trial.after("pressed", handle, one)) for one in (key, other))
        found[key] = {name: -sign for name, sign in back.items()} | there
        found[other] = {name: -sign for name, sign in there.items()} | back
    return {key: steps for key, steps in found.items() if steps}


def _signs(before: Mapping[str, Any], after: Mapping[str, Any]) -> dict[str, int]:
    return {
        name: 1 if after[name] > before[name] else -1
        for name in before
        if _is_number(before[name]) and after[name] != before[name]
    }


def _pulls(trial: Reading, handle: str) -> dict[str, list[Any]]:
    """For each axis that follows a pull without a jump: the direction, and the values after each of PULLS."""
    found: dict[str, list[Any]] = {}
    for direction in "xy":
        after = [trial.after("dragged", handle, nan, nan, *_pull(direction, pull)) for pull in PULLS]
        for name, first in trial.read(trial.view).items():
            values = [one[name] for one in after]
            if name in trial.turning:
                values = _unwrapped(values, first)
            if _is_number(first) and values[0] != values[-1] and _goes_one_way(values):
                found.setdefault(name, [direction, [round(float(one), 6) for one in values]])
    return found


def _unwrapped(degrees: list[float], first: float) -> list[float]:
    """Angles without their jumps, the middle one (of no pull) at the first value."""
    found = np.unwrap(degrees, period=360)
    return (found - found[len(found) // 2] + first).tolist()


def _pull(direction: str, pull: float) -> tuple[float, float]:
    return (pull, 0.0) if direction == "x" else (0.0, pull)


def _places(trial: Reading, handle: str, cell: Cell) -> dict[str, Any]:
    """The values of each axis where the pointer's place decides, whatever its move."""
    (left, top, width, height), (columns, rows) = cell, PLACES
    at = [
        (left + (i + 0.5) * width / columns, top + (j + 0.5) * height / rows)
        for j in range(rows)
        for i in range(columns)
    ]
    if trial.after("dragged", handle, *at[0], 0.0, 0.0) == trial.after("dragged", handle, *at[-1], 0.0, 0.0):
        return {}
    after = [trial.after("dragged", handle, x, y, 0.0, 0.0) for x, y in at]
    values = {name: [one[name] for one in after] for name in after[0]}
    moved = {
        name: [_short(one) for one in all_] for name, all_ in values.items() if any(one != all_[0] for one in all_)
    }
    return {"places": {"cell": list(cell), "size": [columns, rows], "values": moved}} if moved else {}


def _short(value: Any) -> Any:
    return round(float(value), 4) if _is_number(value) else value


def _is_number(value: Any) -> bool:
    return isinstance(value, int | float) and not isinstance(value, bool)


def _goes_one_way(values: list[float]) -> bool:
    steps = [b - a for a, b in pairwise(values) if not isclose(a, b)]
    return all(step > 0 for step in steps) or all(step < 0 for step in steps)
