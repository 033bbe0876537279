"""Marks on photographs: lines, rings and arrows that stand out from whatever is behind them."""

from __future__ import annotations

import cv2
import numpy as np
from numpy.typing import ArrayLike

from camviz.cameras import Camera, Intrinsics
from camviz.draw import svg
from camviz.draw.panel import Panel
from camviz.lenses.base import Array


def border_arrow(panel: Panel, toward: Array, words: str) -> str:
    """An arrow at the panel's border that points out of it along `toward` (2,), and what lies there."""
    half = np.array([panel.width, panel.height]) / 2 - 14
    with np.errstate(divide="ignore"):
        tip = half + 14 + toward * np.min(half / np.abs(toward))
    across = np.array([-toward[1], toward[0]])
    arrow = svg.polygon([tip + 8 * toward, tip - 6 * toward + 7 * across, tip - 6 * toward - 7 * across], "fill-yellow")
    side = "end" if toward[0] > 0.5 else "" if toward[0] < -0.5 else "middle"
    below = -12 if tip[1] > half[1] else 22
    return arrow + svg.text(tip + (-14 * np.sign(toward[0]) * (side != "middle"), below), words, f"yellow halo {side}")


def camera_outline(panel: Panel, camera: Camera, other: Camera, class_: str) -> str:
    """The body of another camera, 12 cm deep, where it is in this one's picture."""
    _, rim = other.frustum(0, 0.12, 1)
    gap, tip = np.full((4, 3), np.nan), np.broadcast_to(other.centre, (4, 3))
    spokes = np.stack([tip, rim, gap], axis=1).reshape(-1, 3)
    return on_photograph(panel.place(camera.project([np.vstack([spokes, rim, rim[:1]])])), class_)


def on_photograph(lines: ArrayLike, class_: str) -> str:
    """Lines (m, n, 2) with an edge in the colour of the paper."""
    lines = np.asarray(lines, dtype=float)
    return svg.path(lines, "paper-line") + svg.path(lines, class_)


def ring(at: Array, class_: str, radius: float) -> str:
    """A circle around a place (2,) in the panel."""
    turn = np.linspace(0, 2 * np.pi, 33)
    return on_photograph([at + radius * np.stack([np.cos(turn), np.sin(turn)], axis=-1)], class_)


def crop(image: np.ndarray, intrinsics: Intrinsics, uv: ArrayLike, size: float) -> np.ndarray:
    """The square of `size` pixels around a pixel (2,), 138 × 138; `image` may be smaller than its intrinsics say."""
    scale = image.shape[1] / intrinsics.width
    step = scale * size / 138
    u, v = scale * (np.asarray(uv) + 0.5) - 0.5 - 68.5 * step
    window = np.array([[step, 0, u], [0, step, v]])
    return cv2.warpAffine(image, window, (138, 138), flags=cv2.INTER_LINEAR | cv2.WARP_INVERSE_MAP)
