"""camviz: one virtual camera, taken apart piece by piece. This is the map of the house, in reading order.

    cameras      intrinsics, a lens and a pose: the virtual camera, and several of them in a rig
    lenses       from a ray to the image and back, a dozen ways; `lenses.arrays`: what `Points`, `Pixels`, `Rays` are
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


_MEASURED_EDGES = "SlantedEdge slanted_edge edge_error edge_line edge_profile edge_refusal edge_rows edge_sides"
_MEASURED_NOISE = (
    "Level Measurement Recording RecordingError measure read_recording checks ends estimate estimates hidden "
    "measurement neighbours readings recording scale transfer trust"
)
_CALIBRATIONS = "board_pictures calibration fault_lab focal_xi_ambiguity one_board"
_BESIDE_LESSONS = (
    "colour demosaicing depth_of_field exposure fisheye garden_field image_sensor intrinsics lens_diagram "
    "lens_elements light_field microlens_diagram mirror_drawings noise omnidirectional pinhole readout rectification "
    f"ring rotation sharpness stereo_pair swatches {_CALIBRATIONS}"
)
_MOVED = (
    (
        "camviz",
        "camviz_clinic",
        "Calibration calibration clinic:checks commands files inspect load meshes plots report",
    ),
    ("camviz", "camviz_school", "course join record room samples server teaching"),
    ("camviz.optics", "camviz_clinic.measuring.sharpness", _MEASURED_EDGES),
    ("camviz.sensors", "camviz_clinic.measuring.noise", _MEASURED_NOISE),
    ("camviz.scenes", "camviz_school.views", "aperture balloon parallax walk"),
    ("camviz.views", "camviz_clinic.views", "measured_edge measured_noise"),
    ("camviz.views", "camviz_school.views", _BESIDE_LESSONS),
    ("camviz_clinic.calibration", "camviz_school.views", "focal_xi_ambiguity zhang"),
    ("camviz_clinic.calibration", "camviz_clinic.calibration", "residual_statistics:problem"),
    ("camviz_clinic.checks", "camviz_school.views", "laboratory"),
    ("camviz_clinic.views", "camviz_school.views", _CALIBRATIONS),
)
"""What once stood elsewhere: the old place, the new one, and the names; `old:new` where that is another one."""


def _where(name: str) -> str:
    """Where a full name that has moved, such as "camviz.load", stands now; empty for every other."""
    for old, new, names in _MOVED:
        for before, _, after in (each.partition(":") for each in names.split()):
            if name == f"{old}.{before}":
                return f"{name} is now {new}.{after or before}"
    return ""


class _Moved:
    """Python's import asks it last: whoever imports a module that has moved learns where it is."""

    @staticmethod
    def find_spec(name: str, path: Any = None, target: Any = None) -> None:
        if where := _where(name):
            raise ImportError(where)


sys.meta_path.append(_Moved)


def _answering(part: str) -> Callable[[str], Any]:
    """The `__getattr__` of a part from which names have moved."""

    def answer(name: str) -> Any:
        raise AttributeError(_where(f"camviz.{part}.{name}") or f"module 'camviz.{part}' has no attribute {name!r}")

    return answer


def __getattr__(name: str) -> Any:
    if name in _PARTS:
        return import_module(f"camviz.{name}")
    if name in _HOME:
        return getattr(import_module(_HOME[name]), name)
    raise AttributeError(_where(f"camviz.{name}") or f"module 'camviz' has no attribute {name!r}")


def __dir__() -> list[str]:
    return sorted(__all__)
