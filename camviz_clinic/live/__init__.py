"""Guided calibration of a live camera: `capture(board)` in a notebook, and the `Session` behind it.

The names below are imported when they are first used: a session needs no notebook.
"""

from importlib import import_module
from typing import Any

_HOME = {"FrameAnswer": "session", "CaptureWidget": "widget", "Session": "session", "capture": "widget"}

__all__ = ["CaptureWidget", "FrameAnswer", "Session", "capture"]


def __getattr__(name: str) -> Any:
    if name not in _HOME:
        raise AttributeError(f"module 'camviz_clinic.live' has no attribute {name!r}")
    return getattr(import_module(f"camviz_clinic.live.{_HOME[name]}"), name)
