"""How well a board's corners fit a unified sphere of any focal length and ξ: a long valley along f/(1 + ξ).

Near the axis x = X/(Z + ξ D) is X/((1 + ξ) Z), so that the middle of a picture determines only f/(1 + ξ).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from camviz.cameras import Camera
from camviz.draw import plot, svg
from camviz.draw.flow import WIDTH, Tile
from camviz.draw.panel import Panel
from camviz.draw.picture import Picture
from camviz.draw.shades import Shades, bar, contours, heat
from camviz.lenses import UnifiedSphere
from camviz.lenses.base import Array
from camviz.poses import RigidTransform
from camviz_clinic.calibration.types import Board

STEPS = 6  # of Gauss and Newton for every pose
HELD = 1e-12  # added to their normal equations: where a board has run away, it has no pose to be solved for


@dataclass(frozen=True, eq=False)
class FocalXiAmbiguity:
    """The RMS misfit in pixels (m, n) that is left at `xi` (m,) and `focal` (n,) once every board has its best pose.

    NaN where some corner has no image. `camera` is the one the map was drawn around.
    """

    xi: Array
    focal: Array
    misfit: Array
    camera: Camera

    def floor(self) -> Array:
        """For every ξ the focal length (m,) in pixels that fits best, between the map's values; NaN where none does."""
        known = np.where(np.isfinite(self.misfit), self.misfit, np.inf)
        at = np.clip(known.argmin(axis=1), 1, len(self.focal) - 2)[:, None]
        low, mid, high = np.take_along_axis(known**2, at + np.array([-1, 0, 1]), axis=1).T
        with np.errstate(invalid="ignore"):
            off = 0.5 * (low - high) / (low - 2 * mid + high)
        return self.focal[at[:, 0]] + off * (self.focal[1] - self.focal[0])


def focal_xi_ambiguity(
    camera: Camera, board: Board, corners: ArrayLike, cam_from_board: RigidTransform, xi: ArrayLike, focal: ArrayLike
) -> FocalXiAmbiguity:
    """The map over `xi` (m,) and `focal` (n,), evenly spaced, of corners (views, n, 2) in pixels, NaN where not seen.

    `camera`, a calibrated unified sphere, gives the principal point, fy/fx, and the distortion, which is taken off the
    corners; the poses are the calibration's, and are solved for anew at every place of the map. Raises ValueError for
    another lens.
    """
    if not isinstance(camera.lens, UnifiedSphere):
        raise ValueError(f"camera must have a UnifiedSphere lens, got {type(camera.lens).__name__}")
    xi, focal = np.asarray(xi, dtype=float), np.asarray(focal, dtype=float)
    seen = _ideal(camera, camera.lens, np.asarray(corners, dtype=float))
    poses = cam_from_board.as_matrix()
    start = poses[:, :3, :3] @ board.corners.T + poses[:, :3, 3:]  # (views, 3, corners)
    sizes = focal / camera.intrinsics.fx
    misfit = np.stack([_row(start, poses[:, :3, 3], seen, camera.lens.xi, one, sizes) for one in xi])
    return FocalXiAmbiguity(xi, focal, camera.intrinsics.fx * misfit, camera)


def focal_xi_ambiguity_picture(
    *maps: tuple[str, FocalXiAmbiguity], true_xi: float | None = None, true_focal: float | None = None
) -> Picture:
    """Maps of the misfit side by side under their captions, with the line f/(1 + ξ) = const through each camera.

    The cross is the calibrated camera; a ring is the truth, where it is known. All maps have one scale of colours.
    """
    shades = Shades(0.05, 20.0, logarithmic=True)
    width = WIDTH / max(len(maps), 2)
    tiles, attached = list[Tile](), dict[str, bytes]()
    for i, (caption, one) in enumerate(maps):
        left, limits = i * width, ((one.xi[0], one.xi[-1]), (one.focal[0], one.focal[-1]))
        panel = plot.plot_panel(f"valley{i}", left + 64, 34, width - 160, 300, *limits)
        misfit = np.clip(one.misfit.T[::-1], shades.low, None)
        coloured, picture = heat(panel, f"valley{i}", misfit, shades)
        truth = [] if true_xi is None or true_focal is None else [(true_xi, true_focal)]
        marks = _line(panel, one) + svg.dots(panel.place(truth) if truth else [], "red", 11)
        lens, pixels = one.camera.lens, one.camera.intrinsics
        marks += _plus(panel.place((lens.xi, pixels.fx)))  # type: ignore[attr-defined]
        scale, key = bar(left + width - 78, 54, 280, "scale", shades, "RMS, px")
        content = coloured + contours(panel, misfit, shades) + marks
        body = plot.axes(panel, "ξ", "f in px", aside=46) + panel.show(content, title=caption) + scale
        tiles.append(Tile(caption, (left, 0.0, width, 386.0), body))
        attached |= picture | key
    lowest = "; ".join(f"{caption}: least {np.nanmin(one.misfit):.2f} px" for caption, one in maps)
    words = f"The misfit over ξ and f, with the dashed line f/(1 + ξ) = const through the solution. {lowest}."
    return Picture(tuple(tiles), "The valley along f/(1 + ξ)", words, attached)


def _line(panel: Panel, one: FocalXiAmbiguity) -> svg.Marks:
    lens, pixels = one.camera.lens, one.camera.intrinsics
    f = pixels.fx / (1 + lens.xi) * (1 + one.xi)  # type: ignore[attr-defined]
    line = panel.place(np.stack([one.xi, f], axis=-1))
    return svg.line(line, "paper-line") + svg.line(line, "orange thick dashed")


def _plus(at: np.ndarray) -> svg.Marks:
    ends = np.array([(-8, 0), (8, 0), (0, -8), (0, 8)]) + at
    pairs = ends[[0, 2]], ends[[1, 3]]
    return svg.segments(*pairs, "paper-line") + svg.segments(*pairs, "ink thick")


def _ideal(camera: Camera, lens: UnifiedSphere, corners: Array) -> Array:
    """Corners in focal lengths of the calibrated camera, without its distortion."""
    return UnifiedSphere(lens.xi).project(lens.unproject(camera.intrinsics.from_pixels(corners)))


def _row(start: Array, places: Array, seen: Array, xi_was: float, xi: float, sizes: Array) -> Array:
    """The RMS (n,) at one ξ of focal lengths that are `sizes` (n,) times the calibrated one."""
    nearer = sizes * (1 + xi_was) / (1 + xi)  # a board looks as large at once, at this multiple of its distance
    points = start + (nearer[:, None, None] - 1)[..., None] * places[..., None]  # (n, views, 3, corners)
    for _ in range(STEPS):
        residuals, jacobian = _fitted(points, seen, xi, sizes)
        across = jacobian.swapaxes(-1, -2)
        twist = np.asarray(
            np.linalg.solve(across @ jacobian + HELD * np.eye(6), across @ residuals[..., None]), dtype=float
        )[..., 0]
        points = _turned(points, twist)
    residuals, _ = _fitted(points, seen, xi, sizes)
    counted = np.isfinite(seen).all(axis=-1).sum()
    return np.sqrt(np.sum(residuals**2, axis=(1, 2)) / counted)


def _fitted(points: Array, seen: Array, xi: float, sizes: Array) -> tuple[Array, Array]:
    """Residuals (n, views, 2 corners), 0 where no corner was seen; their derivatives (…, 6) by twists of the boards."""
    x, y, z = np.moveaxis(points, -2, 0)
    distance = np.sqrt(x * x + y * y + z * z)
    depth = z + xi * distance
    f = sizes[:, None, None]
    u, v, zero = f * x / depth, f * y / depth, np.zeros_like(x)
    by_point = [  # ∂(u, v)/∂(x, y, z) with ∂depth = (0, 0, 1) + ξ (x, y, z)/distance
        [(f * (a == b) - w * ((b == 2) + xi * p / distance)) / depth for b, p in enumerate((x, y, z))]
        for a, w in enumerate((u, v))
    ]
    rows = []
    for dx, dy, dz in by_point:  # p moves by ω × p + τ
        rows.append(np.stack([dz * y - dy * z, dx * z - dz * x, dy * x - dx * y, dx + zero, dy + zero, dz + zero], -1))
    known = np.isfinite(seen[..., 0])
    off = [np.where(known, seen[..., a] - w, 0) for a, w in enumerate((u, v))]
    weight = known[..., None]
    return np.concatenate(off, axis=-1), np.concatenate([row * weight for row in rows], axis=-2)


def _turned(points: Array, twist: Array) -> Array:
    """Boards (n, views, 3, corners) moved by twists (n, views, 6): the rotation by ω about the origin, then τ."""
    omega, tau = twist[..., :3, None], twist[..., 3:, None]
    angle = np.maximum(np.linalg.norm(omega, axis=-2, keepdims=True), 1e-300)
    axis = omega / angle
    along = np.sum(axis * points, axis=-2, keepdims=True) * axis
    across = np.cross(axis, points, axis=-2)
    return along + np.cos(angle) * (points - along) + np.sin(angle) * across + tau  # Rodrigues
