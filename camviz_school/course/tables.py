"""TOML tables held against the keys that they must have. One sentence says what is wrong with a table, and where."""

from __future__ import annotations

import tomllib
from collections.abc import Collection, Mapping
from typing import Any


def table_of(toml: str, where: str) -> dict[str, Any]:
    """The table in a TOML text. Raises ValueError, beginning with `where`, for a text that is not TOML."""
    try:
        return tomllib.loads(toml)
    except tomllib.TOMLDecodeError as error:
        raise ValueError(f"{where} is not TOML: {error}") from error


def shaped(table: object, kinds: Mapping[str, type], where: str, optional: Collection[str] = ()) -> dict[str, Any]:
    """The table, when it has the keys of `kinds` and no other, each with a value of its kind.

    Only the `optional` keys may be missing. Raises ValueError, beginning with `where`, for any other table.

    >>> shaped({"title": "Fisheye"}, {"title": str, "picture": str}, "lesson 09", optional={"picture"})
    {'title': 'Fisheye'}
    >>> shaped({"title": 9}, {"title": str}, "lesson 09")
    Traceback (most recent call last):
    ValueError: lesson 09: title must be given as str, got 9
    """
    if not isinstance(table, dict):
        raise ValueError(f"{where}: expected a table, got {table!r}")
    unknown = sorted(set(table) - set(kinds))
    if unknown:
        raise ValueError(f"{where}: knows {', '.join(kinds)}, got {', '.join(unknown)}")
    for key, kind in kinds.items():
        if not isinstance(table.get(key), kind) and (key in table or key not in optional):
            raise ValueError(f"{where}: {key} must be given as {kind.__name__}, got {table.get(key)!r}")
    return table
