"""Marks on photographs: lines, rings and arrows that stand out from whatever is behind them."""

from __future__ import annotations

import cv2
import numpy as np
from numpy.typing import ArrayLike

from camviz.cameras import Camera, Intrinsics
from camviz.draw import svg
from camviz.draw.marks import Marks
from camviz.draw.panel import Panel
from camviz.lenses.base import Array


def border_arrow(panel: Panel, toward: Array, words: str) -> Marks:
    """An arrow at the panel's border that points out of it along `toward` (2,), and what lies there."""
    centre = np.array([panel.width, panel.height]) / 2
    half = np.maximum(centre - 14, 1)
    with np.errstate(divide="ignore"):
        tip = centre + toward * np.min(half / np.abs(toward))
    across = np.array([-toward[1], toward[0]])
    arrow = svg.polygon([tip + 8 * toward, tip - 6 * toward + 7 * across, tip - 6 * toward - 7 * across], "fill-yellow")
    side = "end" if toward[0] > 0.5 else "" if toward[0] < -0.5 else "middle"
    below = -12 if tip[1] > centre[1] - 14 else 22
    return arrow + svg.text(tip + (-14 * np.sign(toward[0]) * (side != "middle"), below), words, f"label halo {side}")


def camera_outline(panel: Panel, camera: Camera, other: Camera, depth: float, class_: str) -> Marks:
    """The body of another camera, `depth` metres deep, where it is in this one's picture."""
    _, rim = other.frustum(0, depth, 1)
    spokes = np.stack([np.broadcast_to(other.centre, (4, 3)), rim], axis=1)
    edges = np.stack([rim, np.roll(rim, -1, axis=0)], axis=1)
    return on_photograph(clipped(panel, panel.place(camera.project(np.concatenate([spokes, edges])))), class_)


def clipped(panel: Panel, lines: ArrayLike) -> Array:
    """The parts of lines (..., n, 2) inside the panel, as segments (m, 2, 2) (Liang & Barsky 1984)."""
    lines = np.asarray(lines, dtype=float)
    starts, ends = (part.reshape(-1, 2) for part in (lines[..., :-1, :], lines[..., 1:, :]))
    with np.errstate(divide="ignore", invalid="ignore"):
        low, high = -starts / (ends - starts), ((panel.width, panel.height) - starts) / (ends - starts)
    enter = np.fmax(np.fmin(low, high).max(axis=-1), 0)
    leave = np.fmin(np.fmax(low, high).min(axis=-1), 1)
    kept = (enter < leave) & np.isfinite(starts).all(axis=-1) & np.isfinite(ends).all(axis=-1)
    starts, along, parts = starts[kept], (ends - starts)[kept], np.stack([enter, leave], axis=-1)[kept]
    return starts[:, None] + parts[..., None] * along[:, None]


def on_photograph(lines: ArrayLike, class_: str) -> Marks:
    """Lines (m, n, 2) with an edge in the colour of the paper."""
    lines = np.asarray(lines, dtype=float)
    if lines.shape[1:] == (2, 2):
        return svg.join(svg.segments(lines[:, 0], lines[:, 1], c) for c in ("paper-line", class_))
    return svg.path(lines, "paper-line") + svg.path(lines, class_)


def shortened(starts: ArrayLike, ends: ArrayLike, longest: float) -> tuple[np.ndarray, np.ndarray]:
    """The ends (n, 2) of arrows of which none is longer than `longest` units, and which (n,) are cut to that.

    >>> ends, cut = shortened([(0, 0), (0, 0)], [(3, 4), (30, 40)], 10)
    >>> ends.tolist(), cut.tolist()
    ([[3.0, 4.0], [6.0, 8.0]], [False, True])
    """
    starts, ends = np.asarray(starts, dtype=float), np.asarray(ends, dtype=float)
    length = np.linalg.norm(ends - starts, axis=-1)
    cut = length > longest
    share = np.where(cut, longest / np.maximum(length, 1e-9), 1.0)
    return starts + (ends - starts) * share[:, None], cut


def arrows(starts: ArrayLike, ends: ArrayLike, class_: str, head: float = 6) -> Marks:
    """Arrows between places (n, 2) in the panel, with an edge in the colour of the paper and a head of their size."""
    starts, ends = (np.asarray(places, dtype=float).reshape(-1, 2) for places in (starts, ends))
    along = ends - starts
    length = np.linalg.norm(along, axis=-1, keepdims=True)
    with np.errstate(invalid="ignore", divide="ignore"):
        back = -along / length * np.minimum(head, 0.6 * length)
    side = 0.45 * np.stack([-back[:, 1], back[:, 0]], axis=-1)
    barbs = np.stack([ends + back + side, ends, ends + back - side], axis=1)
    shafts = np.stack([starts, ends], axis=1)
    known = np.isfinite(barbs).all(axis=(1, 2))
    data = np.concatenate([shafts[known], barbs[known][:, :2], barbs[known][:, 1:]])
    return svg.join(svg.segments(data[:, 0], data[:, 1], c) for c in ("paper-line", class_))


def cross(at: ArrayLike, class_: str, radius: float = 5) -> Marks:
    """Slanting crosses at places (n, 2) in the panel."""
    at = np.asarray(at, dtype=float).reshape(-1, 2)
    arm = radius * np.array([1, 1]), radius * np.array([1, -1])
    starts, ends = np.concatenate([at - a for a in arm]), np.concatenate([at + a for a in arm])
    return svg.segments(starts, ends, "paper-line") + svg.segments(starts, ends, class_)


def ring(at: Array, class_: str, radius: float) -> Marks:
    """A circle around a place (2,) in the panel."""
    return on_photograph([at + radius * circle(33)], class_)


def circle(samples: int) -> Array:
    """Points (samples, 2) all around the unit circle, the first of them again at last."""
    turn = np.linspace(0, 2 * np.pi, samples)
    return np.stack([np.cos(turn), np.sin(turn)], axis=-1)


def crop(image: np.ndarray, intrinsics: Intrinsics, uv: ArrayLike, size: float) -> np.ndarray:
    """The square of `size` pixels around a pixel (2,), 138 × 138; `image` may be smaller than its intrinsics say."""
    scale = image.shape[1] / intrinsics.width
    step = scale * size / 138
    u, v = scale * (np.asarray(uv) + 0.5) - 0.5 - 68.5 * step
    window = np.array([[step, 0, u], [0, step, v]])
    return cv2.warpAffine(image, window, (138, 138), flags=cv2.INTER_LINEAR | cv2.WARP_INVERSE_MAP)
