"""Giving memory back: a classroom's server holds a kernel for every student, and each keeps what it once needed."""

from __future__ import annotations

import ctypes
import sys

from IPython import get_ipython

from camviz.scenes.scene import forget_rays

_trim = getattr(ctypes.CDLL(None), "malloc_trim", None) if sys.platform == "linux" else None  # glibc's


def give_back(*_: object) -> None:
    """Return to the system what pictures and cells needed while they were made, where the C library can."""
    forget_rays()
    if _trim:
        _trim(0)


def give_back_after_cells() -> None:
    """Do so after every cell of this notebook."""
    if (shell := get_ipython()) and give_back not in shell.events.callbacks["post_run_cell"]:
        shell.events.register("post_run_cell", give_back)
