"""Does OpenGL work here? Asked once, in a process of its own, because where it does not, asking can be fatal."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
from functools import cache
from importlib.util import find_spec
from typing import Any

REMEDY = "On Debian and Ubuntu, `apt install libegl1 libgl1` brings what it needs."


@cache
def opengl_works() -> tuple[bool, str]:
    """Whether solid pictures can be drawn here, and with what window or why not."""
    if find_spec("vtkmodules") is None:
        return False, "VTK is not installed; `pip install pyvista` brings it."
    reasons = []
    for window in _windows():
        reason = _rehearse(window)
        if not reason:
            return True, window
        reasons.append(f"{window}: {reason}")
    return False, f"OpenGL does not work here ({'; '.join(reasons)}). {REMEDY}"


def why_not_solid() -> str:
    """Why pictures in space are wireframes here, in a sentence; "" where they are solid."""
    if os.environ.get("CAMVIZ_RENDERER") == "wire":
        return "CAMVIZ_RENDERER=wire asks for wireframes."
    works, answer = opengl_works()
    return "" if works else answer


def why_not_pyvista() -> str:
    """Why a lesson draws its points in space with matplotlib here, in a sentence; "" where PyVista can draw them.

    Asks as `why_not_solid` does, and imports neither PyVista nor VTK: a kernel that drew with them weighs 330 MB more.
    """
    if find_spec("pyvista") is None:
        return "PyVista is not installed; `pip install pyvista` brings it."
    return why_not_solid().replace("asks for wireframes", "asks for pictures without OpenGL")


def pyvista_plotter() -> Any:
    """A `pyvista.Plotter` without a window on the screen, where `why_not_pyvista` gives no reason against it.

    VTK is told which of its windows works here; left alone it tries a display first, and complains on stderr.
    """
    import pyvista

    works, window = opengl_works()
    if works:
        os.environ["VTK_DEFAULT_OPENGL_WINDOW"] = window
    return pyvista.Plotter(off_screen=True)


def _windows() -> list[str]:
    """VTK's window classes in the order to try them; the plain one needs a display on Linux."""
    asked = os.environ.get("VTK_DEFAULT_OPENGL_WINDOW")
    if asked:
        return [asked]
    if not sys.platform.startswith("linux"):
        return ["vtkRenderWindow"]
    display = os.environ.get("DISPLAY") or os.environ.get("WAYLAND_DISPLAY")
    return [*(["vtkRenderWindow"] if display else []), "vtkEGLRenderWindow", "vtkOSOpenGLRenderWindow"]


def _rehearse(window: str) -> str:
    """Draw something with that window in another process; "" when it went well, otherwise what happened."""
    command = [sys.executable, "-c", f"from camviz.draw.solid import rehearse; rehearse({window!r})"]
    path = os.pathsep.join(filter(None, sys.path))
    try:
        run = subprocess.run(
            command, capture_output=True, timeout=30, env={**os.environ, "PYTHONPATH": path}, stdin=subprocess.DEVNULL
        )
    except subprocess.TimeoutExpired:
        return "no picture within 30 s"
    except OSError as error:
        return str(error)
    return "" if run.returncode == 0 else _ended(run.returncode)


def _ended(status: int) -> str:
    return f"ended by {signal.Signals(-status).name}" if status < 0 else f"ended with status {status}"
