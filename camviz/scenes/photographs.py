"""Photographs that lie inside installed wheels: no network, and a licence for each."""

from importlib.resources import as_file, files

import cv2
import numpy as np
from numpy.typing import NDArray

_CREDITS = {
    "astronaut": "Astronaut Eileen Collins. NASA Great Images database; public domain.",
    "brick": "Brick wall. CC0Textures, Bricks25, after a perspective transform; CC0.",
    "camera": "Photographer with a camera. Lav Varshney; CC0.",
    "chelsea": "Chelsea the cat. Stéfan van der Walt; CC0.",
    "coffee": "Coffee cup. Rachel Michetti, courtesy of Pikolo Espresso Bar; CC0.",
    "grass": "Grass. Linolafett on DeviantArt, Grass-01; CC0.",
    "gravel": "Gravel. CC0Textures, Gravel04; CC0.",
    "rocket": "Launch of DSCOVR on a Falcon 9. SpaceX; public domain.",
}

PHOTOGRAPHS = tuple(_CREDITS)


def photograph(name: str) -> NDArray[np.uint8]:
    """A photograph (height, width, 3), uint8 sRGB; grey ones have three equal channels.

    `name` is one of PHOTOGRAPHS, ValueError otherwise. The files are those of scikit-image (`skimage/data`), read
    without importing it.
    """
    _require(name)
    suffix = "jpg" if name == "rocket" else "png"
    with as_file(files("skimage") / "data" / f"{name}.{suffix}") as path:
        picture = cv2.imread(str(path), cv2.IMREAD_COLOR)
    if picture is None:
        raise FileNotFoundError(f"scikit-image is installed without its photograph {name}.{suffix}: install it again")
    return np.ascontiguousarray(picture[..., ::-1])


def photograph_credit(name: str) -> str:
    """What the photograph shows, who made it, and its licence. ValueError for an unknown name."""
    _require(name)
    return f"{_CREDITS[name]} From scikit-image's data folder."


def _require(name: str) -> None:
    if name not in _CREDITS:
        raise ValueError(f"name must be one of {', '.join(PHOTOGRAPHS)}, got {name!r}")
