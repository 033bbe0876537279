"""Memory: kept from one picture to the next, given back after every cell, for a classroom has a kernel per student."""

from __future__ import annotations

import ctypes
import gc
import sys
from typing import Protocol
from weakref import WeakSet

from IPython import get_ipython

from camviz.scenes.scene import forget_rays
from camviz.views import garden

_c = ctypes.CDLL(None) if sys.platform == "linux" else None
_trim, _mallopt = getattr(_c, "malloc_trim", None), getattr(_c, "mallopt", None)  # glibc's
_TRIM_THRESHOLD, _MMAP_THRESHOLD = -1, -3  # malloc.h
_KEPT = 64 << 20  # bytes
_MANY = 1  # times that Python has looked through its younger objects, each after some 7,000 new ones


class Holder(Protocol):
    """Who keeps what can be worked out again."""

    def forget(self) -> None:
        """Free it."""


_holders: WeakSet[Holder] = WeakSet()


def give_back(*_: object) -> None:
    """Return to the system what pictures and cells needed while they were made, where the C library can.

    Matplotlib's closed figures are circles of objects. Python alone looks for such circles only when a quarter of all
    objects are new, and keeps some 10 MB of them till then. To look takes 50 ms: cells that made little are spared.
    """
    forget_rays()
    garden.forget()
    for holder in _holders:
        holder.forget()
    if gc.get_count()[2] >= _MANY:
        gc.collect()
    if _trim:
        _trim(0)


def keep_between_pictures() -> None:
    """Let the process keep what it frees, up to some 60 MB, until `give_back`, where the C library is glibc.

    Left to itself it returns every array of more than 100 kB at once, and then gets the next one page by cleared page:
    a quarter of the time that a fine picture takes. Arrays of more than a megabyte still go back, for what OpenCV's
    threads keep of them nobody can return.
    """
    if _mallopt:
        _mallopt(_TRIM_THRESHOLD, _KEPT)
        _mallopt(_MMAP_THRESHOLD, 1 << 20)


def give_back_after_cells(*holders: Holder) -> None:
    """`give_back` after every cell of this notebook, with what these hold for as long as they live."""
    _holders.update(holders)
    if (shell := get_ipython()) and give_back not in shell.events.callbacks["post_run_cell"]:
        shell.events.register("post_run_cell", give_back)
