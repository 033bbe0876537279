"""What one picture keeps for the next while somebody moves a slider: some megabytes, made anew in milliseconds."""

from __future__ import annotations

from collections.abc import Callable
from functools import _lru_cache_wrapper, lru_cache
from typing import Any, TypeVar

T = TypeVar("T")
_caches: list[_lru_cache_wrapper[Any]] = []


def kept(maxsize: int) -> Callable[[Callable[..., T]], _lru_cache_wrapper[T]]:
    """Keep a function's last `maxsize` answers, as lru_cache does, until `forget`."""

    def keep(function: Callable[..., T]) -> _lru_cache_wrapper[T]:
        cache = lru_cache(maxsize)(function)
        _caches.append(cache)
        return cache

    return keep


def forget() -> None:
    """Free all that functions have `kept`."""
    for cache in _caches:
        cache.cache_clear()
