"""What a drawing in space consists of: lines, faces, pictures, dots and labels, with no renderer in sight.

A colour is a name from the style sheet ("blue"), which follows the theme, or "#rrggbb", which does not.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from camviz.cameras import Camera, transform
from camviz.lenses import Perspective
from camviz.lenses.arrays import Share, VectorLike
from camviz.lenses.base import Array, as_point, as_points
from camviz.poses import RigidTransform


@dataclass(frozen=True, eq=False)
class Line:
    """A line through points in space; NaN interrupts it.

    Args:
        points: (n, 3), points in metres.
        class_: Its colour, a name from the style sheet.
        width: In picture units.
        head: Makes it an arrow.

    Raises: ValueError where the last axis has not 3 coordinates.

    >>> Line([(0, 0, 0), (1, 0, 0)]).points.shape
    (2, 3)
    """

    points: Array
    class_: str = "ink"
    width: float = 1.6
    head: bool = False

    def __post_init__(self) -> None:
        object.__setattr__(self, "points", as_points(self.points, 3, "points").reshape(-1, 3))


@dataclass(frozen=True, eq=False)
class Face:
    """A convex outline, filled: a fan of triangles around its first vertex. Not drawn when a vertex is NaN.

    Args:
        vertices: (n, 3), points in metres.
        colour: A name from the style sheet, or "#rrggbb".
        opacity: From 0 to 1.

    Raises: ValueError for another opacity, and where the last axis has not 3 coordinates.

    >>> Face(np.eye(3), opacity=2)
    Traceback (most recent call last):
    ValueError: opacity must lie between 0 and 1, got 2
    """

    vertices: Array
    colour: str = "blue"
    opacity: float = 1.0

    def __post_init__(self) -> None:
        object.__setattr__(self, "vertices", as_points(self.vertices, 3, "vertices"))
        if not 0 <= self.opacity <= 1:
            raise ValueError(f"opacity must lie between 0 and 1, got {self.opacity}")


@dataclass(frozen=True, eq=False)
class TexturedMesh:
    """A picture stretched over quadrilaterals.

    A quad with a NaN vertex is left out. A flat quad shows the picture in exact perspective.

    Args:
        vertices: (n, 3), points in metres.
        quads: (m, 4) of int, indices of vertices.
        uv: (n, 2), where the vertices lie on the picture, 0 … 1, u to the right and v upwards.
        picture: (height, width, 3) of uint8, RGB.
        opacity: From 0 to 1.

    Raises: ValueError where `uv` is not one for each vertex, and for a picture of another form.

    >>> grid = np.stack([*np.meshgrid([0, 1, 2], [0, 1]), np.ones((2, 3))], axis=-1)  # 2 × 3 points of a wall
    >>> TexturedMesh.over(grid, np.zeros((4, 4, 3), np.uint8)).quads
    array([[0, 1, 4, 3],
           [1, 2, 5, 4]])
    """

    vertices: Array
    quads: NDArray[np.intp]
    uv: Array
    picture: NDArray[np.uint8]
    opacity: float = 1.0

    def __post_init__(self) -> None:
        object.__setattr__(self, "vertices", as_points(self.vertices, 3, "vertices"))
        object.__setattr__(self, "uv", as_points(self.uv, 2, "uv"))
        if len(self.uv) != len(self.vertices):
            raise ValueError(f"uv must be one for each of {len(self.vertices)} vertices, got {len(self.uv)}")
        if self.picture.ndim != 3 or self.picture.shape[2] != 3 or self.picture.dtype != np.uint8:
            raise ValueError(f"picture must be uint8 (height, width, 3), got {self.picture.dtype} {self.picture.shape}")

    @classmethod
    def over(cls, points: ArrayLike, picture: NDArray[np.uint8], opacity: Share = 1.0) -> TexturedMesh:
        """The picture over a grid of points, whose rows follow the picture's.

        Args:
            points: (m, n, 3), at least 2 × 2, in metres.
            picture: (height, width, 3) of uint8, RGB.

        Returns: TexturedMesh of (m - 1) × (n - 1) quads.
        Raises: ValueError for points that are no grid.
        """
        points = as_points(points, 3, "points")
        if points.ndim != 3 or min(points.shape[:2]) < 2:
            raise ValueError(f"points must be a grid (m, n, 3) of at least 2 × 2, got {points.shape}")
        m, n = points.shape[:2]
        u, v = np.meshgrid(np.linspace(0, 1, n), np.linspace(1, 0, m))
        a = (np.arange(m - 1)[:, None] * n + np.arange(n - 1)).reshape(-1)
        quads = np.stack([a, a + 1, a + n + 1, a + n], axis=-1)
        return cls(points.reshape(-1, 3), quads, np.stack([u, v], axis=-1).reshape(-1, 2), picture, opacity)


@dataclass(frozen=True, eq=False)
class Dots:
    """Round marks at points.

    Args:
        points: (n, 3), points in metres.
        class_: Their colour, a name from the style sheet.
        diameter: In picture units.

    Raises: ValueError where the last axis has not 3 coordinates.

    >>> Dots((0, 0, 1)).points  # one point is a list of one
    array([[0., 0., 1.]])
    """

    points: Array
    class_: str = "ink"
    diameter: float = 6.0

    def __post_init__(self) -> None:
        object.__setattr__(self, "points", as_points(self.points, 3, "points").reshape(-1, 3))


@dataclass(frozen=True, eq=False)
class Label:
    """Words beside a point.

    Args:
        point: (3,), in metres.
        words: What stands there.
        class_: A name from the style sheet.

    Raises: ValueError where the point has not 3 coordinates.

    >>> Label((0, 0, 1), "C").words
    'C'
    """

    point: Array
    words: str
    class_: str = "label"

    def __post_init__(self) -> None:
        object.__setattr__(self, "point", as_point(self.point, "point"))


SIDE = 16  # points along each side of a camera's rim

Item = Line | Face | TexturedMesh | Dots | Label
"""What is drawn in space."""


def axes_triad(world_from_frame: RigidTransform, length: float, name: str = "") -> list[Item]:
    """The axes of a frame as arrows: x orange, y green, z blue, each with its letter.

    Args:
        world_from_frame: Where the frame is, in metres.
        length: Of the arrows, in metres.
        name: Of the frame. With one, as the world beside a camera, it has capital letters.

    Returns: Lines and labels.

    >>> from camviz.poses import RigidTransform
    >>> [item.words for item in axes_triad(RigidTransform.identity(), 1) if isinstance(item, Label)]
    ['x', 'y', 'z']
    """
    origin, *tips = transform(world_from_frame, np.vstack([np.zeros(3), length * np.eye(3)]))
    items: list[Item] = []
    for letter, colour, tip in zip("XYZ" if name else "xyz", ("orange", "green", "blue"), tips, strict=True):
        items.append(Line(np.array([origin, tip]), colour, 2.4, head=True))
        items.append(Label(origin + 1.12 * (tip - origin), letter, f"label {colour}"))
    return [*items, Label(1.3 * origin - 0.3 * tips[1], name, "note")] if name else items


def camera_body(
    camera: Camera,
    depth: float,
    *,
    image: NDArray[np.uint8] | None = None,
    colour: str = "blue",
    name: str = "",
    near: float = 0,
) -> list[Item]:
    """A camera as seen from outside: its centre, the volume it sees, its up side, its picture.

    The rim is where the rays of the image's border reach `depth`, so it bends with the lens; rays of one lens that all
    point well forward end on a plane, as a pinhole's image does, those of a wider lens on a sphere.

    Args:
        depth: How far the volume reaches, in metres.
        image: (height, width, 3) of uint8, RGB, shown at the rim.
        colour: A name from the style sheet.
        name: A label at the centre.
        near: Adds a second rim at this distance in metres.

    Returns: The rim first.

    >>> from camviz.cameras import Camera, Intrinsics
    >>> rim, *_ = camera_body(Camera(Intrinsics.from_fov(640, 480, 90)), depth=2)
    >>> rim.points[0]  # the image's upper left: tan 45° to the left, 3/4 of that up
    array([-2. , -1.5,  2. ])
    """
    reach = _reach(camera, camera.intrinsics.border(SIDE))
    rim = camera.centre + depth * reach
    corners = rim[::SIDE]
    items: list[Item] = [Line(closed(rim), colour, 2.2), Dots(camera.centre, colour, 8)]
    items += [Line(np.array([camera.centre, corner]), colour, 1.5) for corner in corners]
    items += [Face(np.vstack([camera.centre, side]), colour, 0.10) for side in _sides(closed(rim))]
    if near > 0:
        items.append(Line(closed(camera.centre + near * reach), colour, 1.2))
    if image is not None:
        mesh = _mesh(camera, 2, 2) if isinstance(camera.lens, Perspective) else _mesh(camera, 10, 13)
        items.append(TexturedMesh.over(camera.centre + depth * _reach(camera, mesh), image))
    items.append(_up_marker(camera, rim[SIDE // 2], depth, colour))
    return [*items, Label(camera.centre, name, f"label {colour}")] if name else items


def grid_lines(centre: VectorLike, size: float, step: float, class_: str = "grid") -> list[Item]:
    """A ground: lines in the plane y = const.

    Args:
        size: How far it reaches to each side, in metres.
        step: Distance of the lines in metres.
        class_: Their colour, a name from the style sheet.

    Returns: One Line, with NaN between its parts.
    Raises: ValueError for a step that is not positive, and where the centre has not 3 coordinates.

    >>> (lines,) = grid_lines((0, 1, 0), size=2, step=1)
    >>> int(np.isnan(lines.points).any(axis=1).sum())  # five lines each way
    10
    """
    x, y, z = as_point(centre, "centre")
    if not step > 0:
        raise ValueError(f"step must be a positive number of metres, got {step}")
    s = np.arange(-size, size + step / 2, step)
    ends = np.array([-size, size, np.nan])
    across, along = np.broadcast_arrays(ends, s[:, None])
    lines = np.concatenate([np.stack([across, along], -1), np.stack([along, across], -1)]).reshape(-1, 2)
    return [Line(np.stack([x + lines[:, 0], np.full(len(lines), y), z + lines[:, 1]], axis=-1), class_, 1.1)]


def _reach(camera: Camera, uv: Array) -> Array:
    """Vectors from the centre along the rays of pixels `uv`, to z = 1 or, for a wide lens, to the unit sphere."""
    rays = camera.unproject(uv)
    forward = camera.extrinsics[0][2]
    z = camera.unproject(camera.intrinsics.border(SIDE)) @ forward
    flat = np.isfinite(z).all() and z.min() > 0.25
    return rays / (rays @ forward)[..., None] if flat else rays


def _mesh(camera: Camera, rows: int, columns: int) -> Array:
    u = np.linspace(-0.5, camera.intrinsics.width - 0.5, columns)
    v = np.linspace(-0.5, camera.intrinsics.height - 0.5, rows)
    return np.stack(np.meshgrid(u, v), axis=-1)


def _up_marker(camera: Camera, top: Array, depth: float, colour: str) -> Item:
    """A small triangle above the middle of the rim's upper edge."""
    right, down, _ = 0.1 * depth * camera.extrinsics[0]
    return Face(top - [0.2 * down + right, 0.2 * down - right, 1.5 * down], colour, 0.9)


def closed(outline: Array) -> Array:
    """The outline (n, d) with its first point again at last, (n + 1, d)."""
    return np.vstack([outline, outline[:1]])


def _sides(outline: Array) -> list[Array]:
    return [outline[i : i + SIDE + 1] for i in range(0, len(outline) - 1, SIDE)]
