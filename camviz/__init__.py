"""camviz: one virtual camera, taken apart piece by piece. This is the map of the house, in reading order.

    cameras      intrinsics, a lens and a pose: the virtual camera, and several of them in a rig
    lenses       from a ray to the image and back, a dozen ways
    poses        where a camera stands
    distortion   what a polynomial bends, and where it folds
    twoview      what two cameras know of each other: epipolar geometry, triangulation, rectification
    scenes       what there is to photograph, and how it is traced
    optics       pinholes, thin lenses, sharpness
    sensors      from light to numbers, with noise
    colour, mosaics, lightfields, panoramas   what pictures hold beside brightness
    draw         scalable pictures out of points and words
    views        one visualizer each: a frozen state, and its picture
    widgets      `explore`: sliders for a view

Beside it stand two packages: the clinic, which looks at real calibrations, and the school, which runs the lessons.
The names below are imported when they are first used, so that `import camviz` costs next to nothing.
"""

import sys
from collections.abc import Callable
from importlib import import_module
from typing import Any

__version__ = "0.1.0"
"""The version, as three numbers.

>>> import camviz
>>> camviz.__version__.count(".")
2
"""

_HOME = {
    "Camera": "camviz.cameras",
    "Intrinsics": "camviz.cameras",
    "Rig": "camviz.cameras",
    "explore": "camviz.widgets",
    "look_at": "camviz.cameras",
}

_PARTS = (
    "cameras",
    "colour",
    "distortion",
    "lenses",
    "lightfields",
    "mosaics",
    "optics",
    "scenes",
    "sensors",
    "twoview",
)

__all__ = ["Camera", "Intrinsics", "Rig", "__version__", "explore", "look_at", *_PARTS]


_MOVED = (
    ("", "camviz_clinic", "Calibration calibration clinic:checks commands files inspect load meshes plots report"),
    ("", "camviz_school", "course join record room samples server teaching"),
    ("optics.", "camviz_clinic.measuring.sharpness", "SlantedEdge slanted_edge edge_error edge_line edge_profile"),
    (
        "optics.",
        "camviz_clinic.measuring.sharpness",
        "edge_refusal edge_rows edge_sides",
    ),
    ("sensors.", "camviz_clinic.measuring.noise", "Level Measurement Recording RecordingError measure read_recording"),
    ("sensors.", "camviz_clinic.measuring.noise", "checks ends estimate estimates hidden measurement neighbours"),
    ("sensors.", "camviz_clinic.measuring.noise", "readings recording scale transfer trust"),
    ("views.", "camviz_clinic.views", "measured_edge measured_noise"),
)
"""What stood in camviz once: in which part, where it is now, and its names; `old:new` where that is another one."""


def _where(name: str) -> str:
    """Where a name that has moved, such as "load" or "optics.SlantedEdge", stands now; empty for every other."""
    for part, home, names in _MOVED:
        for old, _, new in (each.partition(":") for each in names.split()):
            if part + old == name:
                return f"camviz.{name} is now {home}.{new or old}"
    return ""


class _Moved:
    """Python's import asks it last: whoever imports a module that has moved learns where it is."""

    @staticmethod
    def find_spec(name: str, path: Any = None, target: Any = None) -> None:
        house, _, rest = name.partition(".")
        if house == "camviz" and (where := _where(rest)):
            raise ImportError(where)


sys.meta_path.append(_Moved)


def _answering(part: str) -> Callable[[str], Any]:
    """The `__getattr__` of a part from which names have moved."""

    def answer(name: str) -> Any:
        raise AttributeError(_where(f"{part}.{name}") or f"module 'camviz.{part}' has no attribute {name!r}")

    return answer


def __getattr__(name: str) -> Any:
    if name in _PARTS:
        return import_module(f"camviz.{name}")
    if name in _HOME:
        return getattr(import_module(_HOME[name]), name)
    raise AttributeError(_where(name) or f"module 'camviz' has no attribute {name!r}")


def __dir__() -> list[str]:
    return sorted(__all__)
