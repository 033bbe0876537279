"""Quick pictures of a flat board by a virtual camera: no tracer, so that hundreds of them can be made."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from functools import lru_cache

import cv2
import numpy as np
from numpy.typing import NDArray

from camviz.cameras import Camera
from camviz.lenses import Lens
from camviz.lenses.base import Array
from camviz.poses import RigidTransform
from camviz.scenes.light import to_encoded
from camviz_clinic.calibration.boards.picture import whiteness
from camviz_clinic.calibration.types import Board
from camviz_clinic.checks.virtual import single, spread_boards

SIDE = 480  # pixels along the longer side
TILT_DEG = (15, 35)
BLACK, WHITE, BEHIND = 40.0, 225.0, 130.0  # grey of ink, of paper, and of what is behind the board
TEXELS = 32  # along `square_size`
MARGIN = 0.6  # white around the board, in `square_size`
SHARP = 0.625  # a margin of 20 texels: the edges of squares lie between texels, and corners where they are said to
FINER = 2  # samples along each side of a pixel
BLUR = 0.6  # pixels
PAPER = 2.0  # grey levels away from what is behind

Single = NDArray[np.float32]


@dataclass(frozen=True, eq=False)
class Pictured:
    """A camera, a board's poses before it, and pictures of them by their names."""

    camera: Camera
    board: Board
    cam_from_board: RigidTransform
    pictures: dict[str, NDArray[np.uint8]] = field(repr=False)

    @property
    def corners(self) -> Array:
        """Where the corners are, (views, corners, 2)."""
        return np.array([self.camera.project(pose.apply(self.board.corners)) for pose in self.cam_from_board])


def pictured(
    rng: np.random.Generator, board: Board, views: int, lens: Lens | None = None, noise: float = 2.0, side: int = SIDE
) -> Pictured:
    """Pictures of a board by a random camera, `side` pixels along the longer side, with this lens or one of its own."""
    drawn = single(rng, views=1).camera
    camera = Camera(drawn.intrinsics.within(side), lens or drawn.lens)
    poses = spread_boards(rng, (camera,), board, views, TILT_DEG)
    names = [f"view{view + 1:02}.png" for view in range(views)]
    pictures = {name: snapshot(camera, board, pose, rng, noise) for name, pose in zip(names, poses, strict=True)}
    return Pictured(camera, board, poses, pictures)


def snapshot(
    camera: Camera,
    board: Board,
    cam_from_board: RigidTransform,
    rng: np.random.Generator,
    noise: float = 2.0,
    margin: float = MARGIN,
    texels: int = TEXELS,
) -> NDArray[np.uint8]:
    """The board at a pose, uint8 grey (height, width), a little out of focus, with noise of this σ in grey levels.

    With one pose for each row, each row is read at its own, as a rolling shutter does it. With MARGIN around it, an
    edge of a square is a lopsided ramp over two texels, and corners are found up to 0.03 px beside it; with SHARP not.
    So it is where all edges are whole numbers of `texels` apart, of which there are so many along `square_size`.
    """
    across, down = _seen(camera, board, cam_from_board, margin, texels)
    paper = (BLACK + (WHITE - BLACK) * whiteness(board, texels, margin)).astype(np.float32)
    samples = cv2.remap(paper, across, down, cv2.INTER_LINEAR, borderMode=cv2.BORDER_CONSTANT, borderValue=BEHIND)
    grid = camera.intrinsics
    picture = cv2.resize(samples, (grid.width, grid.height), interpolation=cv2.INTER_AREA)  # the mean of each pixel's
    picture = cv2.GaussianBlur(picture, (0, 0), BLUR) + rng.normal(0, noise, picture.shape)
    return np.clip(np.rint(picture), 0, 255).astype(np.uint8)


def together(
    camera: Camera,
    boards: Sequence[Board],
    cam_from_boards: RigidTransform,
    rng: np.random.Generator,
    noise: float = 2.0,
    margin: float = MARGIN,
    texels: int = TEXELS,
) -> NDArray[np.uint8]:
    """Several boards in one sRGB picture, uint8 grey (height, width); a later one covers what is behind its paper."""
    whole = np.full((camera.intrinsics.height, camera.intrinsics.width), BEHIND)
    for board, pose in zip(boards, cam_from_boards, strict=True):
        one = snapshot(camera, board, pose, rng, 0.0, margin, texels).astype(float)
        whole = np.where(np.abs(one - BEHIND) > PAPER, one, whole)
    encoded = 255 * to_encoded(whole / 255)
    return np.clip(np.rint(encoded + rng.normal(0, noise, whole.shape)), 0, 255).astype(np.uint8)


def _seen(
    camera: Camera, board: Board, cam_from_board: RigidTransform, margin: float, texels: int
) -> tuple[Single, Single]:
    """The column and the row of the paper that each sample sees, float32 (FINER * height, FINER * width) each."""
    texel = board.square_size / texels
    left, top = (edge - margin * board.square_size for edge in board.area[:2])
    board_from_cam = (cam_from_board.inv().as_matrix()[..., :3, :] / texel).astype(np.float32)  # in texels
    turn, start = board_from_cam[..., :3], board_from_cam[..., 3]
    if turn.ndim == 2:
        x, y, z = np.tensordot(turn, _rays(camera), axes=1)
    else:
        x, y, z = np.einsum("rij,jrc->irc", turn.repeat(FINER, axis=0), _rays(camera))
        start = start.repeat(FINER, axis=0).T[..., None]
    with np.errstate(divide="ignore", invalid="ignore"):
        along = -start[2] / z
    behind = ~(along > 0)
    for at, first, edge in ((x, start[0], left), (y, start[1], top)):
        at *= along
        at += np.asarray(first - edge / texel - 0.5, np.float32)
        at[behind] = -1e6
    return x, y


@lru_cache(maxsize=1)
def _rays(camera: Camera) -> Single:
    """The directions (3, FINER * height, FINER * width), float32, in which a camera samples."""
    grid = camera.intrinsics
    u, v = np.meshgrid(*((np.arange(FINER * side) + 0.5) / FINER - 0.5 for side in (grid.width, grid.height)))
    rays = camera.lens.unproject(grid.from_pixels(np.stack([u, v], axis=-1)))
    return np.ascontiguousarray(np.moveaxis(rays, -1, 0), np.float32)
