"""Lookup tables of a camera, for programs that do not know its lens: a NumPy archive (.npz) that cv2.remap can use.

- `map_x`, `map_y`: (height, width) float32, for each pixel of the undistorted picture the pixel of the photograph; -1
  where the photograph shows nothing, which cv2.remap leaves black;
- `target_K`, `target_size`: the undistorted picture's camera matrix (3, 3), and its width and height;
- `rays`: (rows, columns, 3) float32, unit rays, x right, y down, z forwards, at the nodes of a grid of pixels;
- `ray_u`, `ray_v`: (columns,) and (rows,), the nodes' pixel coordinates, evenly from the first to the last pixel;
- `ray_error_px`, `ray_error_at`: the median and the worst error of reading `rays` by bilinear interpolation, over every
  pixel, and the pixel where it is worst;
- `ray_share`: the share of the pixels at which the table gives a ray.

The centre of the first pixel is (0, 0), as OpenCV has it. Rays are NaN at nodes where none arrives. Undistort by
`cv2.remap(photograph, map_x, map_y, cv2.INTER_LINEAR)`.
"""

from __future__ import annotations

import io
from dataclasses import dataclass
from math import ceil

import numpy as np

from camviz.cameras import Camera, Intrinsics
from camviz.distortion import undistort_maps, undistorted_intrinsics
from camviz.lenses.base import Array

STEP = 8.0  # pixels between nodes
NOWHERE = -1.0
ROWS = 64  # of the picture that are judged together
COARSEST = 2  # nodes along each side


@dataclass(frozen=True, eq=False)
class RayTable:
    """Unit rays (rows, columns, 3) at pixels (`u` (columns,), `v` (rows,)), between which one interpolates."""

    u: Array
    v: Array
    rays: Array

    @classmethod
    def of(cls, camera: Camera, step: float = STEP) -> RayTable:
        """The rays of a camera at nodes at most `step` pixels apart; ValueError for a step that is not positive."""
        if not step > 0:
            raise ValueError(f"step must be a positive number of pixels, got {step}")
        grid = camera.intrinsics
        u, v = (
            np.linspace(0, size - 1, max(ceil((size - 1) / step) + 1, COARSEST)) for size in (grid.width, grid.height)
        )
        rays = camera.lens.unproject(grid.from_pixels(np.stack(np.meshgrid(u, v), axis=-1)))
        return cls(u, v, rays.astype(np.float32))

    def at(self, uv: Array) -> Array:
        """Unit rays (..., 3) at pixels (..., 2) within the nodes, read bilinearly; NaN beside a node that has none."""
        column, across = _cell(self.u, uv[..., 0])
        row, down = _cell(self.v, uv[..., 1])
        upper = self.rays[row, column] * (1 - across) + self.rays[row, column + 1] * across
        lower = self.rays[row + 1, column] * (1 - across) + self.rays[row + 1, column + 1] * across
        ray = upper * (1 - down) + lower * down
        return np.asarray(ray / np.linalg.norm(ray, axis=-1, keepdims=True))


@dataclass(frozen=True)
class TableError:
    """How far from the pixel that was asked for the camera sees the ray that was read, over all pixels with a ray."""

    median: float
    worst: float
    worst_at: tuple[int, int]
    share: float


def table_error(camera: Camera, table: RayTable) -> TableError:
    """The error in pixels of reading a table bilinearly, at the centre of every pixel.

    Infinite where a ray that was read has no image. Raises ValueError where the table has no ray at any pixel.
    """
    grid = camera.intrinsics
    errors = np.full((grid.height, grid.width), np.nan)
    for top in range(0, grid.height, ROWS):
        rows = np.arange(top, min(top + ROWS, grid.height))
        uv = np.stack(np.meshgrid(np.arange(grid.width, dtype=float), rows.astype(float)), axis=-1)
        rays = table.at(uv)
        off = np.linalg.norm(grid.to_pixels(camera.lens.project(rays)) - uv, axis=-1)
        errors[rows] = np.where(np.isfinite(rays[..., 0]), np.nan_to_num(off, nan=np.inf), np.nan)
    known = np.isfinite(errors) | np.isinf(errors)
    if not known.any():
        raise ValueError("camera must see rays at some pixels, it sees none")
    v, u = np.unravel_index(np.nanargmax(errors), errors.shape)
    return TableError(float(np.nanmedian(errors)), float(errors[v, u]), (int(u), int(v)), float(known.mean()))


@dataclass(frozen=True, eq=False)
class LookupTables:
    """What is written of a camera: maps to the picture `target`, and rays with their error."""

    maps: tuple[Array, Array]
    target: Intrinsics
    table: RayTable
    error: TableError

    @classmethod
    def of(cls, camera: Camera, step: float = STEP, alpha: float = 0.0) -> LookupTables:
        """Of the undistorted picture with square pixels, from no black border (`alpha` 0) to every pixel (1), and rays.

        Raises ValueError where a perspective picture cannot show what the camera sees, and for a wrong step or alpha.
        """
        target, _ = undistorted_intrinsics(camera, alpha, square=True)
        map_x, map_y = (np.nan_to_num(each, nan=NOWHERE) for each in undistort_maps(camera, target))
        table = RayTable.of(camera, step)
        return cls((map_x, map_y), target, table, table_error(camera, table))

    def content(self) -> bytes:
        """The archive."""
        archive = io.BytesIO()
        np.savez_compressed(
            archive,
            map_x=self.maps[0],
            map_y=self.maps[1],
            target_K=self.target.K,
            target_size=np.array([self.target.width, self.target.height]),
            rays=self.table.rays,
            ray_u=self.table.u,
            ray_v=self.table.v,
            ray_error_px=np.array([self.error.median, self.error.worst]),
            ray_error_at=np.array(self.error.worst_at),
            ray_share=np.array(self.error.share),
        )
        return archive.getvalue()


def _cell(nodes: Array, at: Array) -> tuple[np.ndarray, Array]:
    """The node before, and the way from it to the next as a share (..., 1)."""
    place = (at - nodes[0]) / (nodes[1] - nodes[0])
    before = np.clip(np.floor(place).astype(int), 0, len(nodes) - 2)
    return before, (place - before)[..., None]
