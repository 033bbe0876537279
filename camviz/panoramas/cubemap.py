"""The cube map: six square pictures, 90° each, laid out on one. It is a `Lens` with gaps in its image."""

from __future__ import annotations

from dataclasses import dataclass
from enum import Enum
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from camviz.cameras import Camera, Intrinsics
from camviz.lenses.arrays import Count
from camviz.lenses.base import Array, Lens
from camviz.poses import RigidTransform, Rotation

FACES = ("front", "right", "back", "left", "up", "down")

# Each face's axes in the camera's frame (x right, y down, z forward): to its right, down, and straight out.
_AXES = np.array(
    [
        [(1, 0, 0), (0, 1, 0), (0, 0, 1)],
        [(0, 0, -1), (0, 1, 0), (1, 0, 0)],
        [(-1, 0, 0), (0, 1, 0), (0, 0, -1)],
        [(0, 0, 1), (0, 1, 0), (-1, 0, 0)],
        [(1, 0, 0), (0, 0, 1), (0, -1, 0)],
        [(1, 0, 0), (0, 0, -1), (0, 1, 0)],
    ],
    dtype=float,
)


_INSIDE = 1 - 1e-12  # a ray along an edge of the cube stays inside its face, not in what lies beside that in the layout


class Layout(Enum):
    """Where the faces of a cube map lie.

    CROSS is the cube unfolded around its front, four faces wide and three high, every joint of up and down with the
    front whole; STRIP is all six in a row: front, right, back, left, up, down.

    Faces are counted in that order, -1 is a gap:

    >>> Layout.CROSS.faces
    array([[-1,  4, -1, -1],
           [ 3,  0,  1,  2],
           [-1,  5, -1, -1]])
    """

    CROSS = (4, 3, ((1, 1), (2, 1), (3, 1), (0, 1), (1, 0), (1, 2)))
    STRIP = (6, 1, ((0, 0), (1, 0), (2, 0), (3, 0), (4, 0), (5, 0)))

    @property
    def columns(self) -> int:
        """How many faces wide it is."""
        return self.value[0]

    @property
    def rows(self) -> int:
        """How many faces high it is."""
        return self.value[1]

    @property
    def places(self) -> NDArray[np.intp]:
        """The column and row of each face (6, 2)."""
        return np.array(self.value[2])

    @property
    def faces(self) -> NDArray[np.intp]:
        """Which face (rows, columns) lies where; -1 in a gap."""
        faces = np.full((self.rows, self.columns), -1)
        faces[self.places[:, 1], self.places[:, 0]] = range(len(FACES))
        return faces


@dataclass(frozen=True)
class Cubemap(Lens):
    """The faces of a cube around the camera, as perspective pictures of 90° each: a lens with gaps in its image.

    Its image is measured in focal lengths, half the side of a face; the origin is the middle of the front face. A gap
    of the layout has no ray; every direction has an image. On an edge of the cube the first face of the layout's order
    is taken.

    Args:
        layout: Where the faces lie.

    Source: N. Greene, Environment mapping and other applications of world projections, IEEE Comput. Graph. Appl. 6
    (1986).

    The middles of the front, the right and the lower face:

    >>> Cubemap().project([[0, 0, 1], [1, 0, 0], [0, 1, 0]])
    array([[0., 0.],
           [2., 0.],
           [0., 2.]])
    """

    layout: Layout = Layout.CROSS

    def image(self, x: Array, y: Array, z: Array) -> tuple[Array, Array]:
        along = np.tensordot(_AXES[:, 2], np.stack([x, y, z]), axes=1)
        face = np.argmax(along, axis=0)
        right, down, _ = _AXES[face].transpose(1, 2, 0)
        depth = np.take_along_axis(along, face[None], axis=0)[0]
        depth = np.where(depth > 0, depth, np.nan)
        across, below = ((axis[0] * x + axis[1] * y + axis[2] * z) / depth for axis in (right, down))
        column, row = (self.layout.places[face] - self.layout.places[0]).T
        return np.clip(across, -_INSIDE, _INSIDE) + 2 * column, np.clip(below, -_INSIDE, _INSIDE) + 2 * row

    def ray(self, x: Array, y: Array) -> tuple[Array, Array, Array]:
        column, row = self._place(x, 0), self._place(y, 1)
        inside = np.isfinite(x + y) & (column >= 0) & (column < self.layout.columns)
        inside &= (row >= 0) & (row < self.layout.rows)
        face = np.where(inside, self.layout.faces[row * inside, column * inside], -1)
        right, down, out = _AXES[face].transpose(1, 2, 0)
        across = x - 2 * (column - self.layout.places[0, 0])
        below = y - 2 * (row - self.layout.places[0, 1])
        ray = np.where(face >= 0, across * right + below * down + out, np.nan)
        return ray[0], ray[1], ray[2]

    def _place(self, x: Array, axis: int) -> NDArray[np.intp]:
        """The column (axis 0) or row (axis 1) in which an image coordinate lies; the last edge belongs to the last."""
        size = (self.layout.columns, self.layout.rows)[axis]
        place = (np.nan_to_num(x, nan=-9e9) + 1) / 2 + self.layout.places[0, axis]
        last = (place >= size) & (place < size + 1e-9)
        return np.where(last, size - 1, np.floor(place)).clip(-1, size).astype(np.intp)


def cubemap_camera(side: Count, layout: Layout = Layout.CROSS) -> Camera:
    """The camera whose picture is a whole cube map.

    Args:
        layout: Where the faces lie.

    Returns: Camera at the origin, its front looking along z.
    Raises: ValueError for a side that is no whole number, or below 1.
    Source: N. Greene, Environment mapping and other applications of world projections, IEEE Comput. Graph. Appl. 6
    (1986).

    Straight ahead is the middle of the second face in the second row, to the right of it what is at right angles:

    >>> cubemap_camera(100).project([[0, 0, 1], [1, 0, 0]])
    array([[149.5, 149.5],
           [249.5, 149.5]])
    """
    f, (column, row) = side / 2, layout.places[0].tolist()
    cx, cy = (column * side + (side - 1) / 2, row * side + (side - 1) / 2)
    return Camera(Intrinsics(layout.columns * side, layout.rows * side, f, f, cx, cy), Cubemap(layout))


def face_camera(face: str, side: Count) -> Camera:
    """The perspective camera of 90° that takes one face of a cube map.

    Args:
        face: {"front", "right", "back", "left", "up", "down"}, where it looks.

    Returns: Camera at the origin.
    Raises: ValueError for any other word, naming these.

    >>> face_camera("up", 101).project([0, -1, 0])  # y points down
    array([50., 50.])
    """
    if face not in FACES:
        raise ValueError(f"face must be one of {', '.join(FACES)}, got {face!r}")
    turn = Rotation.from_matrix(_AXES[FACES.index(face)].T)
    pose = RigidTransform.from_components(np.zeros(3), turn)
    return Camera(Intrinsics(side, side, side / 2, side / 2, (side - 1) / 2, (side - 1) / 2), world_from_cam=pose)


def cells(camera: Camera, uv: Array) -> Array:
    """The column and row (..., 2), counted from the front face, of the face in which pixels (..., 2) of a cube lie."""
    pixels = camera.intrinsics
    return np.floor((uv - (pixels.cx, pixels.cy)) / (2 * pixels.fx, 2 * pixels.fy) + 0.5)


def split(cube: NDArray[Any], layout: Layout = Layout.CROSS) -> dict[str, NDArray[Any]]:
    """The faces, by name, of a picture (rows × side, columns × side, ...); ValueError where it has another shape."""
    side = cube.shape[0] // layout.rows
    if side < 1 or cube.shape[:2] != (layout.rows * side, layout.columns * side):
        raise ValueError(
            f"cube must be {layout.columns} faces wide and {layout.rows} high, "
            f"got {cube.shape[1]} × {cube.shape[0]} pixels"
        )
    places = zip(FACES, layout.places.tolist(), strict=True)
    return {face: cube[r * side : (r + 1) * side, c * side : (c + 1) * side] for face, (c, r) in places}


def joined(cube: NDArray[Any], layout: Layout) -> NDArray[Any]:
    """The same layout, each face inside a border of one pixel that shows what its neighbours on the cube show there.

    Interpolation can then cross an edge of the cube.
    """
    faces = split(cube, layout)
    side = cube.shape[0] // layout.rows
    bordered = np.zeros((layout.rows * (side + 2), layout.columns * (side + 2), *cube.shape[2:]), cube.dtype)
    for (face, picture), ring in zip(split(bordered, layout).items(), _rings(side, layout), strict=True):
        picture[1:-1, 1:-1] = faces[face]
        u, v = ring.astype(np.float32).T
        picture[_ring(side)] = cv2.remap(cube, u[None], v[None], cv2.INTER_LINEAR).reshape(len(ring), *cube.shape[2:])
    return bordered


def _ring(side: int) -> tuple[NDArray[np.intp], ...]:
    ring = np.ones((side + 2, side + 2), dtype=bool)
    ring[1:-1, 1:-1] = False
    return np.nonzero(ring)


def _rings(side: int, layout: Layout) -> Array:
    """For each face, where in the layout (6, n, 2) the pixels just outside it lie, inside the face that shows them."""
    v, u = (np.asarray(index) - 1.0 for index in _ring(side))
    cube = cubemap_camera(side, layout)
    rays = np.stack([face_camera(face, side).unproject(np.stack([u, v], axis=-1)) for face in FACES])
    uv = cube.project(rays)
    first = (cells(cube, uv) + layout.places[0]) * side
    return np.asarray(np.clip(uv, first, first + side - 1))
