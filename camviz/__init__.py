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


def __getattr__(name: str) -> Any:
    if name in _PARTS:
        return import_module(f"camviz.{name}")
    if name in _HOME:
        return getattr(import_module(_HOME[name]), name)
    raise AttributeError(f"module 'camviz' has no attribute {name!r}")


def __dir__() -> list[str]:
    return sorted(__all__)
