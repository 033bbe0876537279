"""Cameras by the names of their projections: "equirectangular", "fisheye:equisolid", "cube:up" and the like."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from difflib import get_close_matches
from math import degrees, pi, radians

import numpy as np

from camviz.cameras import Camera, Intrinsics
from camviz.lenses import Cylindrical, Equidistant, Equirectangular, Equisolid, Lens, Orthographic, Stereographic
from camviz.lenses.arrays import Count
from camviz.lenses.fisheye import Fisheye
from camviz.panoramas.cubemap import FACES, Layout, cubemap_camera, face_camera


@dataclass(frozen=True)
class Projection:
    """A kind of picture: how it is made for a size and a field of view, and what is usual.

    Attributes:
        make: Makes the camera of a width and height in pixels and a field in degrees.
        hfov_deg: The usual horizontal field.
        widest_deg: The widest field; 0 where the field cannot be chosen.
        closed: Whether the widest itself is allowed.
        aspect: The usual width : height.

    >>> fisheye = projection("fisheye:equidistant")
    >>> fisheye.hfov_deg, fisheye.widest_deg
    (180, 360)
    """

    make: Callable[[int, int, float], Camera]
    hfov_deg: float
    widest_deg: float
    closed: bool
    aspect: float

    def camera(self, width: Count, height: Count, hfov_deg: float | None = None) -> Camera:
        """The camera of a size, looking ahead.

        Args:
            hfov_deg: The horizontal field; by default the usual one.

        Returns: Camera at the origin.
        Raises: ValueError for a size or field that it does not take, saying which it does.
        """
        if hfov_deg is None:
            return self.make(width, height, self.hfov_deg)
        if not self.widest_deg:
            raise ValueError("a cube map has no field of view to choose: it shows everything")
        if not (0 < hfov_deg < self.widest_deg or (self.closed and hfov_deg == self.widest_deg)):
            most = f"at most {self.widest_deg:g}" if self.closed else f"below {self.widest_deg:g}"
            raise ValueError(f"its field of view is above 0 and {most} degrees, got {hfov_deg:g}")
        return self.make(width, height, hfov_deg)


def projection(name: str) -> Projection:
    """The projection of a name.

    Args:
        name: "perspective", "equirectangular", "cylindrical", "fisheye:equidistant", "fisheye:equisolid",
            "fisheye:stereographic", "fisheye:orthographic", "cube", "cube:strip", or a face of the cube such as
            "cube:up".

    Returns: What makes its cameras.
    Raises: ValueError with the names there are, and the nearest, for any other.

    A fisheye's half field of 90° reaches the edge of its picture, at 180 - 0.5:

    >>> projection("fisheye:equidistant").camera(180, 180).project([0, 1, 0]).round(6)
    array([ 89.5, 179.5])
    """
    if name not in PROJECTIONS:
        near = get_close_matches(name, [*PROJECTIONS, *_ENDINGS], n=1, cutoff=0.6)
        meant = f" (did you mean {_ENDINGS.get(near[0], near[0])}?)" if near else ""
        raise ValueError(f"{name!r} is none of {', '.join(PROJECTIONS)}{meant}")
    return PROJECTIONS[name]


def across_deg(camera: Camera) -> float:
    """The field of view in degrees, from edge to edge through the middle row; NaN where an edge has no ray."""
    pixels = camera.intrinsics
    u = np.linspace(-0.5, pixels.width - 0.5, 65)
    rays = camera.lens.unproject(pixels.from_pixels(np.stack([u, np.full(65, (pixels.height - 1) / 2)], axis=-1)))
    return degrees(float(np.arccos(np.clip((rays[1:] * rays[:-1]).sum(axis=-1), -1, 1)).sum()))


def _perspective(width: int, height: int, hfov_deg: float) -> Camera:
    return Camera(Intrinsics.from_fov(width, height, hfov_deg))


def _panorama(lens: Lens) -> Callable[[int, int, float], Camera]:
    def make(width: int, height: int, hfov_deg: float) -> Camera:
        f = width / radians(hfov_deg)
        if isinstance(lens, Equirectangular) and hfov_deg == 360 and width != 2 * height:
            raise ValueError(f"a whole equirectangular picture is twice as wide as high, got {width} × {height} pixels")
        if isinstance(lens, Equirectangular) and height > pi * f * (1 + 1e-9):
            raise ValueError(
                f"{width} × {height} pixels that are {hfov_deg:g}° wide would be more than 180° high, "
                f"and an equirectangular picture ends at the poles"
            )
        return _centred(width, height, f, lens)

    return make


def _fisheye(lens: Fisheye) -> Callable[[int, int, float], Camera]:
    def make(width: int, height: int, hfov_deg: float) -> Camera:
        return _centred(width, height, width / (2 * float(lens.radial(radians(hfov_deg) / 2))), lens)

    return make


def _cube(layout: Layout) -> Callable[[int, int, float], Camera]:
    def make(width: int, height: int, hfov_deg: float) -> Camera:
        side = height // layout.rows
        if (width, height) != (layout.columns * side, layout.rows * side):
            raise ValueError(
                f"a cube map as a {layout.name.lower()} is {layout.columns} faces wide and {layout.rows} high, "
                f"got {width} × {height} pixels"
            )
        return cubemap_camera(side, layout)

    return make


def _face(face: str) -> Callable[[int, int, float], Camera]:
    def make(width: int, height: int, hfov_deg: float) -> Camera:
        if width != height:
            raise ValueError(f"a face of a cube is square, got {width} × {height} pixels")
        return replace(face_camera(face, width), intrinsics=Intrinsics.from_fov(width, height, hfov_deg))

    return make


def _centred(width: int, height: int, f: float, lens: Lens) -> Camera:
    return Camera(Intrinsics(width, height, f, f, (width - 1) / 2, (height - 1) / 2), lens)


PROJECTIONS = {
    "perspective": Projection(_perspective, 90, 180, False, 4 / 3),
    "equirectangular": Projection(_panorama(Equirectangular()), 360, 360, True, 2),
    "cylindrical": Projection(_panorama(Cylindrical()), 360, 360, True, 2),
    "fisheye:equidistant": Projection(_fisheye(Equidistant()), 180, 360, True, 1),
    "fisheye:equisolid": Projection(_fisheye(Equisolid()), 180, 360, True, 1),
    "fisheye:stereographic": Projection(_fisheye(Stereographic()), 180, 360, False, 1),
    "fisheye:orthographic": Projection(_fisheye(Orthographic()), 180, 180, True, 1),
    "cube": Projection(_cube(Layout.CROSS), 360, 0, False, 4 / 3),
    "cube:strip": Projection(_cube(Layout.STRIP), 540, 0, False, 6),
    **{f"cube:{face}": Projection(_face(face), 90, 180, False, 1) for face in FACES},
}
_ENDINGS = {name.split(":")[1]: name for name in PROJECTIONS if ":" in name}
