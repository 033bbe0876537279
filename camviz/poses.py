"""Rotations and rigid transforms, which are SciPy's, without what SciPy brings along and never uses.

SciPy copies all of NumPy's names into a module of its own, and so loads numpy.f2py, numpy.testing and more: a third of
the time of importing it, and 11 MB in each kernel of a classroom. While it is imported here, NumPy does not list them;
whoever asks NumPy for one of them gets it as ever.
"""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

import numpy as np

_UNUSED = {"ctypeslib", "f2py", "ma", "polynomial", "rec", "testing"}


@contextmanager
def _unlisted() -> Iterator[None]:
    numpy: Any = np
    listed, directory = numpy.__all__, numpy.__dir__
    numpy.__all__ = [name for name in listed if name not in _UNUSED]
    numpy.__dir__ = lambda: [name for name in directory() if name not in _UNUSED]
    try:
        yield
    finally:
        numpy.__all__, numpy.__dir__ = listed, directory


with _unlisted():
    from scipy.spatial.transform import RigidTransform, Rotation

__all__ = ["RigidTransform", "Rotation"]
