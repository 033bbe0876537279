"""Cameras, boards, scenes and residuals as meshes of PyVista, for a plotter or a file of one's own.

Every mesh is in the world's frame, in metres, x right, y down, z forward, and has its colours at its points, as the
array "rgba": `plotter.add_mesh(mesh, rgb=True)` shows them, and `mesh.save("x.ply", texture="rgba")` keeps them.
PyVista is imported when the first mesh is made.

The pictures of the views are drawn from the same lines, faces and surfaces, which they hand to VTK themselves: PyVista
on their path would cost every kernel 80 MB and a second.
"""

from __future__ import annotations

import re
from collections.abc import Iterable, Mapping, Sequence
from typing import TYPE_CHECKING, TypeGuard

import numpy as np
from numpy.typing import ArrayLike, NDArray

from camviz.cameras import Camera, Rig, transform
from camviz.draw.items import Face, Item, Line, camera_body
from camviz.draw.shades import Shades
from camviz.draw.solid import COLOURS
from camviz.lenses.base import Array, as_points
from camviz.poses import RigidTransform
from camviz.scenes import Scene
from camviz.scenes.mesh import Mesh
from camviz_clinic.calibration.boards.picture import whiteness
from camviz_clinic.calibration.types import Board, Calibration
from camviz_clinic.views.observations import Observations

if TYPE_CHECKING:
    import pyvista

__all__ = ["board", "boards", "camera", "joined", "points", "residuals", "rig", "scene"]

_DETAILED = 26  # faces along `square_size` of a board that is no chessboard: two to a cell of Kalibr's tags
_BLACK, _WHITE = (28, 35, 48, 255), (255, 255, 255, 255)
Colours = NDArray[np.uint8]


def camera(camera: Camera, depth: float = 0.3, *, colour: str = "blue") -> pyvista.PolyData:
    """What a camera sees: its rim bends with the lens, a triangle marks its upper side.

    Args:
        camera: Where it stands.
        depth: How far the volume reaches, in metres.
        colour: A name such as "blue" or "orange", or "#rrggbb".

    Returns: Lines and faces in metres.
    Raises: ValueError for an unknown colour.

    >>> from camviz.cameras import Camera, Intrinsics
    >>> mesh = camera(Camera(Intrinsics.from_fov(640, 480, 90)), depth=2)
    >>> f"{mesh.bounds.x_min:.1f} … {mesh.bounds.x_max:.1f} m"  # 2 tan 45° to either side
    '-2.0 … 2.0 m'
    """
    return joined(_item(item) for item in camera_body(camera, depth, colour=colour) if _drawn(item))


def rig(
    cameras: Rig | Calibration | Mapping[str, Camera], depth: float = 0.3, *, colour: str = "blue"
) -> pyvista.MultiBlock:
    """The cameras of a rig or a calibration, each a block under its name.

    Args:
        cameras: Where they stand.
        depth: How far their volumes reach, in metres.
        colour: As of `camera`.

    Returns: Meshes of `camera`.

    >>> from camviz.poses import RigidTransform
    >>> from camviz.cameras import Camera, Intrinsics
    >>> one = Camera(Intrinsics.from_fov(640, 480, 90))
    >>> rig({"left": one, "right": one.at(RigidTransform.from_translation([0.1, 0, 0]))}).keys()
    ['left', 'right']
    """
    import pyvista

    named = cameras if isinstance(cameras, Mapping) else cameras.cameras
    return pyvista.MultiBlock({name: camera(one, depth, colour=colour) for name, one in named.items()})


def board(board: Board, world_from_board: RigidTransform | None = None) -> pyvista.PolyData:
    """A board with its squares, tags or circles, the first of its points at the board's origin.

    Args:
        board: What is drawn.
        world_from_board: Where it is, in metres; the board's own frame unless given.

    Returns: Faces in metres.

    >>> from camviz_clinic.calibration import Board
    >>> board(Board(9, 6, 0.025)).n_cells  # squares: 10 by 7
    70
    """
    texels = 1 if board.kind == "chessboard" else _DETAILED
    white, size = whiteness(board, texels).T, board.square_size / texels
    s, r = np.indices(white.shape).reshape(2, -1)
    corner = np.stack([size * s + board.area[0], size * r + board.area[1], np.zeros(s.size)], axis=-1)[:, None]
    outline = corner + size * np.array([(0, 0, 0), (1, 0, 0), (1, 1, 0), (0, 1, 0)])
    colours = np.where(white.reshape(-1, 1) > 0.5, _WHITE, _BLACK).repeat(4, axis=0)
    points = outline.reshape(-1, 3)
    if world_from_board is not None:
        points = transform(world_from_board, points)
    return _mesh(points, colours, faces=np.arange(len(points)).reshape(-1, 4))


def boards(calibration: Calibration, camera: str = "") -> pyvista.MultiBlock:
    """The board at every pose from which a camera saw it.

    Args:
        calibration: With a board and its poses.
        camera: The first unless named.

    Returns: A block for each view.
    Raises: ValueError where the calibration holds no board or no poses.

    >>> from camviz_clinic.checks import virtual
    >>> calibration = virtual.healthy(np.random.default_rng(1))
    >>> boards(calibration).n_blocks == len(calibration.detections["camera"])
    True
    """
    import pyvista

    name = camera or next(iter(calibration.cameras))
    if calibration.board is None or name not in calibration.cam_from_board:
        raise ValueError(f"calibration must hold a board and its poses before {name}, got neither or one of the two")
    world_from_board = calibration.cameras[name].world_from_cam * calibration.cam_from_board[name]
    corners = calibration.detections.get(name, np.zeros((len(world_from_board), 1, 2)))
    views = np.flatnonzero(np.isfinite(corners).any(axis=(1, 2))).tolist()  # others were seen by other cameras alone
    return pyvista.MultiBlock({f"view {i + 1}": board(calibration.board, world_from_board[i]) for i in views})


def scene(scene: Scene, detail: int = 128) -> pyvista.MultiBlock:
    """The surfaces of a scene with the colours of their pictures, each a block under its name and its place.

    A surface is cut finer, so that its points carry its picture. The sky is not among them.

    Args:
        scene: What is drawn.
        detail: About so many quadrilaterals along each side of a surface.

    Returns: Faces in metres.

    >>> from camviz.scenes import Rectangle, Scene, Texture
    >>> wall = Rectangle((0, 0, 2), (4, 0, 0), (0, 3, 0), Texture.plain((0.2, 0.5, 0.2)), name="wall")
    >>> scene(Scene([wall]), detail=8)[0].n_cells
    64
    """
    import pyvista

    return pyvista.MultiBlock({f"{i} {mesh.name}": _painted(mesh, detail) for i, mesh in enumerate(scene.faces())})


def residuals(calibration: Calibration, camera: str = "", *, scale: float = 100) -> pyvista.PolyData:
    """A line on the board for every used corner: from its place to where the detected corner seems to lie.

    The lines are coloured by the residual in pixels, which stands in the array "pixels".

    Args:
        calibration: With corners and poses.
        camera: The first unless named.
        scale: How many times as long as the residuals the lines are.

    Returns: Lines in metres.

    Raises:
        Missing: A ValueError, where the calibration holds no corners or poses.

    >>> from camviz_clinic.checks import virtual
    >>> calibration = virtual.healthy(np.random.default_rng(1))
    >>> residuals(calibration).n_cells == calibration.used("camera").sum()
    np.True_
    """
    seen = Observations.of(calibration, camera)
    world_from_board = calibration.cameras[seen.name].world_from_cam * seen.cam_from_board
    view, corner = np.nonzero(seen.used)
    starts = seen.corners_board[corner]
    ends = starts.copy()
    ends[:, :2] += scale * (seen.on_board[view, corner] - starts[:, :2])
    matrix = world_from_board.as_matrix()[view]
    pairs = np.einsum("nij,nkj->nki", matrix[:, :3, :3], np.stack([starts, ends], axis=1)) + matrix[:, None, :3, 3]
    pixels = seen.lengths[view, corner].repeat(2)
    shades = Shades(0.0, max(float(np.quantile(pixels, 0.98)), 1e-9))
    mesh = _mesh(pairs.reshape(-1, 3), shades.rgba(pixels), lines=np.arange(2 * len(view)).reshape(-1, 2))
    mesh.point_data["pixels"] = pixels
    mesh.set_active_scalars("rgba")
    return mesh


def points(positions: ArrayLike, colours: ArrayLike | None = None) -> pyvista.PolyData:
    """A cloud of points.

    Args:
        positions: (n, 3), points in metres.
        colours: (n, 3), RGB, 0 to 255; grey unless given.

    Returns: Vertices in metres.
    Raises: ValueError where a position has not 3 coordinates, or colours are not one for each position.

    >>> points([[0, 0, 1], [0, 0, 2]], colours=[[255, 0, 0], [0, 0, 255]])["rgba"].tolist()
    [[255, 0, 0, 255], [0, 0, 255, 255]]
    """
    positions = as_points(positions, 3, "positions").reshape(-1, 3)
    rgb = np.full((len(positions), 3), 120) if colours is None else as_points(colours, 3, "colours").reshape(-1, 3)
    if len(rgb) != len(positions):
        raise ValueError(f"colours must be one for each of {len(positions)} positions, got {len(rgb)}")
    return _mesh(positions, np.column_stack([rgb, np.full(len(rgb), 255)]))


def joined(meshes: Iterable[pyvista.PolyData]) -> pyvista.PolyData:
    """Several meshes as one: for a file that holds one mesh, such as PLY.

    Args:
        meshes: At least one, such as the blocks of a scene.

    Returns: pyvista.PolyData with the colours of all.
    Raises: ValueError without a mesh.

    >>> joined([points([[0, 0, 1]]), points([[0, 0, 2]])]).n_points
    2
    """
    blocks = list(meshes)
    if not blocks:
        raise ValueError("meshes must be at least one, got none")
    first, *others = blocks
    whole = first.append_polydata(*others)
    whole.set_active_scalars("rgba")
    return whole


# From what the views draw ---------------------------------------------------------------------------------------------


def _drawn(item: Item) -> TypeGuard[Line | Face]:
    """Whether an item is a line, or a face all of whose vertices are known: a lens may fold before the border."""
    return isinstance(item, Line) or (isinstance(item, Face) and bool(np.isfinite(item.vertices).all()))


def _item(item: Line | Face) -> pyvista.PolyData:
    if isinstance(item, Face):
        return _mesh(item.vertices, _colour(item.colour, item.opacity), faces=np.arange(len(item.vertices))[None])
    there = np.asarray(np.isfinite(item.points).all(axis=-1))
    lines = np.flatnonzero(there[1:] & there[:-1])[:, None] + (0, 1)
    return _mesh(np.where(there[:, None], item.points, 0), _colour(item.class_, 1), lines=lines)


def _colour(name: str, opacity: float) -> Sequence[int]:
    rgb = COLOURS.get(name, name)
    if not re.fullmatch("#[0-9a-fA-F]{6}", rgb):
        raise ValueError(f"colour must be #rrggbb or one of {', '.join(COLOURS)}, got {name!r}")
    return [*bytes.fromhex(rgb.removeprefix("#")), round(255 * opacity)]


def _painted(mesh: Mesh, detail: int) -> pyvista.PolyData:
    """A surface cut finer, with the colours of its picture at its points."""
    count = max(1, round(detail / np.sqrt(len(mesh.quads))))
    t = np.linspace(0, 1, count + 1)
    s, r = (grid[..., None] for grid in np.meshgrid(t, t))
    a, b, c, d = (np.column_stack([mesh.vertices, mesh.uv])[corner][:, None, None] for corner in mesh.quads.T)
    fine = ((1 - s) * (1 - r) * a + s * (1 - r) * b + s * r * c + (1 - s) * r * d).reshape(-1, 5)
    cell = (np.arange(count)[:, None] * (count + 1) + np.arange(count)).reshape(-1, 1) + (0, 1, count + 2, count + 1)
    cells = (np.arange(len(mesh.quads))[:, None, None] * (count + 1) ** 2 + cell).reshape(-1, 4)
    return _mesh(fine[:, :3], _sampled(mesh.picture, fine[:, 3:]), faces=cells)


def _sampled(picture: NDArray[np.uint8], uv: Array) -> Colours:
    """The picture's colours (n, 4) at uv (n, 2), which go on from the other side beyond 0 … 1."""
    height, width = picture.shape[:2]
    u, v = uv.T
    column = np.where(u == 1, width - 1, u % 1 * width).astype(int)
    row = np.where(v == 0, height - 1, (1 - v) % 1 * height).astype(int)
    rgb = picture[row, column]
    return np.column_stack([rgb, np.full(len(rgb), 255, np.uint8)])


def _mesh(
    points: Array, colours: ArrayLike, *, faces: NDArray[np.intp] | None = None, lines: NDArray[np.intp] | None = None
) -> pyvista.PolyData:
    """Points (n, 3) with colours (n, 4) or (4,), and faces or lines (m, k) of their indices."""
    import pyvista

    mesh = pyvista.PolyData(np.ascontiguousarray(points, dtype=float), faces=_counted(faces), lines=_counted(lines))
    mesh.point_data["rgba"] = np.broadcast_to(np.asarray(colours, dtype=np.uint8), (len(points), 4)).copy()
    mesh.set_active_scalars("rgba")
    return mesh


def _counted(indices: NDArray[np.intp] | None) -> NDArray[np.intp] | None:
    """Cells (m, k) as VTK lists them: each as its number of points and their indices."""
    return None if indices is None else np.column_stack([np.full(len(indices), indices.shape[1]), indices]).ravel()
