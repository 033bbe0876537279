"""Where to hold the board next: the poses that would lessen the projection uncertainty most."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import dataclass, replace
from itertools import product
from math import inf

import numpy as np
from numpy.typing import ArrayLike

from camviz.cameras import Camera, transform
from camviz.lenses.base import Array, as_points
from camviz.poses import RigidTransform, Rotation
from camviz_clinic.calibration.adjustment import Adjustment
from camviz_clinic.calibration.arrowhead import inverse
from camviz_clinic.calibration.difference import pixel_grid
from camviz_clinic.calibration.problem import moved
from camviz_clinic.calibration.types import Board
from camviz_clinic.calibration.uncertainty import projection_jacobian, worst_deviation

POSITIONS = (0.1, 0.3, 0.5, 0.7, 0.9)  # of the board's middle, in the image's width and height
SIZES = (0.25, 0.4, 0.6, 0.85)  # of the board, held straight, in the image's width
TILTS = (25.0, 45.0)  # degrees, beside 0; beyond these corners are no longer found well
AXES = 8  # directions to tilt the board in
RIM = 0.06  # of the picture's width, that the board stays away from its rim: a hand that is off keeps it whole


@dataclass(frozen=True, eq=False)
class Candidate:
    """A pose to hold the board in, and the mean projection uncertainty in pixels before and after a picture of it."""

    cam_from_board: RigidTransform
    tilt_deg: float  # of the board's normal against the ray to its middle
    before: float
    after: float


def next_board_poses(
    adjustment: Adjustment,
    candidates: RigidTransform | None = None,
    *,
    uv: ArrayLike | None = None,
    distance: float = inf,
    camera: str | None = None,
) -> tuple[Candidate, ...]:
    """Candidate poses, best first: those after which the mean `projection_uncertainty` of pixels uv (n, 2) is least.

    `candidates` are poses cam_from_board; by default tilts, sizes and places in the picture of camera `camera` (the
    first) that show it the whole board. The pixels are by default a grid over the picture. Every camera of a rig adds
    what it would see. Foretold from the present solution, without detecting or solving anything: one view more says
    A - B C⁻¹ Bᵀ of the shared parameters (`Arrowhead`), its own pose being free. It is taken to differ from the others
    as these do: the scatter of the views is the same multiple of the corners' noise as before. The boards
    that the pixel's point stays with are those there are already, so that before and after the same thing is measured.
    """
    name = next(iter(adjustment.cameras)) if camera is None else camera
    seen_by = adjustment.cameras[name]
    if candidates is None:
        candidates = candidate_poses(seen_by, adjustment.board)
    elif not (whole := shows_whole(seen_by, adjustment.board, candidates)).all():
        hidden = np.flatnonzero(~whole).tolist()
        raise ValueError(f"candidates must show the whole board in the picture of {name}; numbers {hidden} do not")
    pixels = pixel_grid(seen_by.intrinsics, (12, 9)).reshape(-1, 2) if uv is None else as_points(uv, 2, "uv")
    jacobian = projection_jacobian(adjustment, pixels, distance, name)
    jacobian = jacobian[np.isfinite(jacobian).all(axis=(1, 2))]
    before = _mean_uncertainty(jacobian, adjustment.mean_twist_covariance)
    more = before / _mean_uncertainty(jacobian, adjustment.by_corners.mean_twist_covariance)
    changed = _with_one_more(adjustment, seen_by.world_from_cam * candidates)
    tilts = tilt_deg(candidates, adjustment.board)
    after = [more * _mean_uncertainty(jacobian, covariance) for covariance in changed]
    return tuple(Candidate(candidates[i], float(tilts[i]), before, after[i]) for i in np.argsort(after))


def instruction(adjustment: Adjustment, candidate: Candidate, camera: str) -> str:
    """How to hold the board, as a clause: "hold the board on the left, at the top, 0.4 m away, tilted by 25°"."""
    seen_by, board = adjustment.cameras[camera], adjustment.board
    points = transform(candidate.cam_from_board, board.corners)
    k = seen_by.intrinsics
    middle = k.to_pixels(seen_by.lens.project(points)).mean(axis=0)
    across = ("on the left", "in the middle", "on the right")[int(np.clip(3 * (middle[0] + 0.5) / k.width, 0, 2))]
    down = ("at the top", "half way down", "at the bottom")[int(np.clip(3 * (middle[1] + 0.5) / k.height, 0, 2))]
    away = float(np.linalg.norm(points.mean(axis=0)))
    return f"hold the board {across}, {down}, {away:.2g} m away, tilted by {candidate.tilt_deg:.0f}°"


def tilt_deg(cam_from_board: RigidTransform, board: Board) -> Array:
    """The angles (n,) between the boards' normals and the rays to their middles."""
    middle = moved(cam_from_board, board.corners.mean(axis=0, keepdims=True))[:, 0]
    cosine = np.einsum("ni,ni->n", cam_from_board.rotation.as_matrix()[:, :, 2], middle)
    return np.degrees(np.arccos(np.clip(cosine / np.linalg.norm(middle, axis=-1), -1, 1)))


def candidate_poses(camera: Camera, board: Board) -> RigidTransform:
    """Poses cam_from_board from all over the picture, near and far, straight and tilted, that show the whole board.

    The whole of it, with the squares around the outer corners. Raises ValueError where no pose does.
    """
    k = camera.intrinsics
    places = [(x * k.width, y * k.height, size) for x, y in product(POSITIONS, POSITIONS) for size in SIZES]
    return _whole_at(camera, board, places)


def rim_poses(camera: Camera, board: Board) -> RigidTransform:
    """`candidate_poses` that reach the picture's rim and corners in every size: nine places for each.

    The middles of those lie on one grid, so that a small board stays away from the rim.
    """
    k, shape = camera.intrinsics, (board.area[3] - board.area[1]) / (board.area[2] - board.area[0])
    places = []
    for size in SIZES:
        left, top = (0.5 * size + RIM) * k.width, (0.5 * size * shape + RIM) * k.width
        xs, ys = (left, k.width / 2, k.width - left), (top, k.height / 2, k.height - top)
        places += [(x, y, size) for x, y in product(xs, ys)]
    return _whole_at(camera, board, places)


def _whole_at(camera: Camera, board: Board, places: Iterable[tuple[float, float, float]]) -> RigidTransform:
    poses = RigidTransform.concatenate(list(_poses(camera, board, places)))
    whole = shows_whole(camera, board, poses)
    if not whole.any():
        raise ValueError(f"no pose of a board of {board.columns} × {board.rows} corners is whole in the picture")
    return poses[whole]


def _poses(camera: Camera, board: Board, places: Iterable[tuple[float, float, float]]) -> Iterator[RigidTransform]:
    """The board in all its tilts, with its middle at pixels (x, y) and of that size, for each (x, y, size)."""
    pixels, middle = camera.intrinsics, board.corners.mean(axis=0)
    azimuth = np.arange(AXES) * 2 * np.pi / AXES
    axes = np.stack([np.cos(azimuth), np.sin(azimuth), 0 * azimuth], axis=-1)
    turns = [np.zeros((1, 3)), *(np.radians(tilt) * axes for tilt in TILTS)]
    tilted = Rotation.from_rotvec(np.concatenate(turns))
    width = board.area[2] - board.area[0]
    for x, y, size in places:
        ray = camera.lens.unproject(pixels.from_pixels([x - 0.5, y - 0.5]))
        if np.isfinite(ray).all():
            turned = Rotation.align_vectors(ray, [0, 0, 1])[0] * tilted
            distance = pixels.fx * width / (size * pixels.width)
            yield RigidTransform.from_components(distance * ray - turned.apply(middle), turned)


def shows_whole(camera: Camera, board: Board, cam_from_board: RigidTransform) -> np.ndarray:
    """True (n,) for poses in which the board, with the squares around its outer corners, lies within the picture."""
    uv = camera.intrinsics.to_pixels(camera.lens.project(moved(cam_from_board, outline(board))))
    return np.all(camera.intrinsics.contains(uv), axis=1)


def outline(board: Board) -> Array:
    """Points (n, 3) along the board's edge, of a chessboard the corners of its outermost squares."""
    left, top, right, bottom = board.area
    x, y = np.linspace(left, right, board.columns + 2), np.linspace(top, bottom, board.rows + 2)
    across = [(i, j) for i in x for j in (y[0], y[-1])]
    down = [(i, j) for i in (x[0], x[-1]) for j in y[1:-1]]
    return np.array([(*point, 0) for point in across + down], dtype=float)


def _with_one_more(adjustment: Adjustment, first_from_board: RigidTransform) -> Iterator[Array]:
    """`by_corners.mean_twist_covariance`, (s + 6, s + 6), with one more view, each of the boards in turn."""
    normal = adjustment.normal_equations
    shared, border, blocks = _seen_at(adjustment, first_from_board)
    gained = shared - border @ inverse(blocks) @ np.swapaxes(border, 1, 2)
    for covariance in inverse(normal.information + gained):
        yield adjustment.joined_with_mean_twist(adjustment.sigma**2 * covariance)


def _seen_at(adjustment: Adjustment, first_from_board: RigidTransform) -> tuple[Array, Array, Array]:
    """A (n, s, s), B (n, s, 6) and C (n, 6, 6) of `Arrowhead`, of every board by itself, in all cameras that see it."""
    held = replace(
        adjustment,
        first_from_board=first_from_board,
        detections={name: np.zeros((len(first_from_board), len(adjustment.corners), 2)) for name in adjustment.cameras},
        set_aside={},
    )
    blocks = [_blocks(held, name) for name in held.cameras]
    shared, border, own = (sum(parts[1:], start=parts[0]) for parts in zip(*blocks, strict=True))
    return shared, border, own


def _blocks(held: Adjustment, name: str) -> tuple[Array, Array, Array]:
    """What camera `name` alone contributes to each view's A, B and C: by the corners that lie in its picture."""
    seen = held.cameras[name].intrinsics.contains(held.projected(name))[..., None, None]
    by_shared, by_pose = (
        np.where(seen, jacobian, 0).reshape(held.views, 2 * seen.shape[1], -1) for jacobian in held.jacobian(name)
    )
    transposed = np.swapaxes(by_shared, 1, 2)
    return transposed @ by_shared, transposed @ by_pose, np.swapaxes(by_pose, 1, 2) @ by_pose


def _mean_uncertainty(jacobian: Array, covariance: Array) -> float:
    return float(np.mean(worst_deviation(jacobian @ covariance @ np.swapaxes(jacobian, 1, 2))))
