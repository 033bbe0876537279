"""What a page asks an explorer for, checked at the widget's edge: whoever holds the page can send anything."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from reprlib import repr as short
from typing import Any

_MOST = 200  # drags, keys or values in one message: a page merges them, and sends a few
_FARTHEST = 1e5  # picture units: a hundred pictures away
_LARGEST = 20  # picture units a CSS pixel: a picture of 960 units on 48 pixels
_LONGEST = 100  # letters, of a handle's name
_KEYS = ("ArrowLeft", "ArrowRight", "ArrowUp", "ArrowDown", "+", "-")


@dataclass(frozen=True)
class ChangeRequest:
    """In this order: the first state if `reset`, `values` set, `panels` opened or closed, drags, keys pressed.

    A drag is (handle, x, y, dx, dy).

    `units` says how many picture units make a CSS pixel in the tile of a name.
    """

    draft: bool
    reset: bool
    values: Mapping[str, Any]
    panels: Mapping[str, bool]
    drags: tuple[tuple[str, float, float, float, float], ...]
    keys: tuple[tuple[str, str], ...]
    units: Mapping[str, float]

    @classmethod
    def of(cls, message: object) -> ChangeRequest:
        """The request in a message; ValueError says in a sentence what a message has."""
        if not isinstance(message, Mapping):
            raise ValueError(f"a message must be a dict, got {short(message)}")
        values, units = message.get("values") or {}, message.get("units") or {}
        panels = message.get("panels") or {}
        if not isinstance(values, Mapping) or len(values) > _MOST:
            raise ValueError(f"values must be a dict of at most {_MOST} controls, got {short(values)}")
        if not isinstance(panels, Mapping) or len(panels) > _MOST or not all(map(_is_switch, panels.items())):
            raise ValueError(f"panels must be a dict of at most {_MOST} names and true or false, got {short(panels)}")
        if not isinstance(units, Mapping) or len(units) > _MOST or not all(map(_is_unit, units.values())):
            raise ValueError(
                f"units must be a dict of at most {_MOST} numbers from 1 to {_LARGEST}, got {short(units)}"
            )
        drags = tuple(_drag(one) for one in _listed(message, "drags"))
        keys = tuple(_key(one) for one in _listed(message, "keys"))
        return cls(bool(message.get("draft")), bool(message.get("reset")), values, panels, drags, keys, units)


def number_of(message: object) -> int:
    """The number by which a page knows the answer to its message; 0, which answers none, where there is none."""
    number = message.get("id") if isinstance(message, Mapping) else 0
    return number if isinstance(number, int) else 0


def _listed(message: Mapping[str, Any], name: str) -> list[Any]:
    found = message.get(name) or []
    if not isinstance(found, list) or len(found) > _MOST:
        raise ValueError(f"{name} must be a list of at most {_MOST}, got {short(found)}")
    return found


def _drag(drag: Any) -> tuple[str, float, float, float, float]:
    if isinstance(drag, list) and len(drag) == 5 and _is_handle(drag[0]) and all(map(_is_near, drag[1:])):
        return (drag[0], *drag[1:])
    raise ValueError(f"a drag must be a handle and x, y, dx, dy within {_FARTHEST:g} units, got {short(drag)}")


def _key(key: Any) -> tuple[str, str]:
    if isinstance(key, list) and len(key) == 2 and _is_handle(key[0]) and key[1] in _KEYS:
        return (key[0], key[1])
    raise ValueError(f"a key must be a handle and one of {', '.join(_KEYS)}, got {short(key)}")


def _is_switch(panel: tuple[Any, Any]) -> bool:
    return _is_handle(panel[0]) and isinstance(panel[1], bool)


def _is_handle(name: Any) -> bool:
    return isinstance(name, str) and len(name) <= _LONGEST


def _is_near(value: Any) -> bool:
    return _is_number(value) and abs(value) <= _FARTHEST  # no NaN is


def _is_unit(value: Any) -> bool:
    return _is_number(value) and 1 <= value <= _LARGEST


def _is_number(value: Any) -> bool:
    return isinstance(value, int | float) and not isinstance(value, bool)
