"""What each picture of a board says alone: fx and fy by Zhang's two constraints, and by a reader's own function."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np

from camviz.cameras import Camera
from camviz.draw import plot, svg
from camviz.draw.panel import Panel
from camviz.draw.readout import true_minus
from camviz.lenses.base import Array
from camviz.views.patience import Patience
from camviz.views.yours import YOURS_HERE, is_unwritten, tried
from camviz_clinic.calibration.types import Board
from camviz_school.views.zhang import focal_lengths, homography

Function = Callable[..., Any]

_TOP = 2.0  # of the plot, in the camera's own fx
_ASIDE = 0.19  # of a board's width: fx stands left of its middle and fy right of it


@dataclass(frozen=True)
class FromEach:
    """fx and fy (boards, 2) in pixels from every picture alone; NaN where it determines none.

    `yours` are a reader's, and `problem` says in one sentence what is wrong with the function, "" where all is well.
    """

    right: Array
    yours: Array
    problem: str


def from_each(corners: Array, board: Board, camera: Camera, yours: Function | None) -> FromEach:
    """The focal lengths that pictures with these corners (boards, n, 2) give, each alone.

    The corners are straightened by the camera's lens first, and its principal point is given: what is left is a
    pinhole with two unknowns. `yours` is a function of (H, centre), a homography (3, 3) and (cx, cy), to (fx, fy).
    """
    centre = np.array([camera.intrinsics.cx, camera.intrinsics.cy])
    right, own, problem = np.full((len(corners), 2), np.nan), np.full((len(corners), 2), np.nan), ""
    undetermined = ""  # said of a board that has no right answer, which is a problem only where all are such
    with Patience() as patience:
        for i, uv in enumerate(_straightened(corners, camera)):
            try:
                H = homography(board.corners[:, :2], uv)
                right[i] = focal_lengths([H], centre)
            except ValueError:  # too few corners are seen, or no focal length fits
                if not np.isfinite(uv).any():
                    continue
            if yours is not None:
                own[i], said = tried(yours, (H, centre), centre, patience)
                undetermined = undetermined or said
                problem = problem or (said if np.isfinite(right[i]).all() else "")
    return FromEach(right, own, problem or ("" if np.isfinite(right).all(axis=1).any() else undetermined))


def _straightened(corners: Array, camera: Camera) -> Array:
    rays = camera.lens.unproject(camera.intrinsics.from_pixels(corners))
    return camera.intrinsics.to_pixels(rays[..., :2] / rays[..., 2:])


def panel_of_each(
    each: FromEach, camera: Camera, picked: int, place: tuple[float, float, float, float], yours: bool
) -> svg.Marks:
    """The plot: a pair of marks for every board, the known focal length as a line, the reader's own in orange."""
    x, y, width, height = place
    count, known = len(each.right), camera.intrinsics.fx
    panel = plot.plot_panel("each", x, y, width, height, (0.5, count + 0.5), (0, _TOP * known))
    numbered = [(i, str(i)) for i in range(1, count + 1)]
    content = plot.grid(panel, xticks=[]) + svg.line(panel.place([(0, known), (count + 1, known)]), "green dashed")
    content += _marks(panel, each.right, "blue", 9)
    entries = [("green dashed", "the camera’s fx"), ("blue thick", "from this picture alone")]
    if yours:
        waits = is_unwritten(each.problem)
        marks = _marks(panel, each.right if waits else each.yours, "orange", 0)
        content += svg.group(marks, "awaited") if waits else marks
        entries.append(("orange thick", "yours"))
    content += plot.legend(panel, entries, "bottom left")
    if is_unwritten(each.problem):
        content += svg.text((panel.width / 2, 0.14 * panel.height), YOURS_HERE, "title halo middle")
    elif each.problem:
        content += svg.paragraph((14, 40), each.problem, panel.width - 28, "note halo")
    axes = plot.axes(panel, "board; fx on the left, fy on the right", "focal length, px", xticks=numbered, aside=50)
    shown = panel.show(content, title="From each picture alone")
    return axes + shown + _written(each, picked, yours and not is_unwritten(each.problem), x - 62, y + height + 62)


def _marks(panel: Panel, values: Array, colour: str, diameter: float) -> svg.Marks:
    """Dots, or bars across them where the diameter is 0; an arrowhead at the edge for what lies outside."""
    boards = np.arange(1, len(values) + 1)[:, None] + np.array([-_ASIDE, _ASIDE])
    at = panel.place(np.stack([boards, values], axis=-1)).reshape(-1, 2)
    at = at[np.isfinite(at).all(axis=1)]
    inside = (at[:, 1] > 0) & (at[:, 1] < panel.height)
    half = 0.3 * panel.width / (panel.right - panel.left) * np.array([1, 0]) * 0.6
    marks = svg.dots(at[inside], colour, diameter) if diameter else svg.NOTHING
    marks += svg.NOTHING if diameter else svg.segments(at[inside] - half, at[inside] + half, f"{colour} thick")
    for px, py in at[~inside]:
        edge, inward = (2, 9) if py < 0 else (panel.height - 2, -9)
        marks += svg.polygon([(px, edge), (px - 5, edge + inward), (px + 5, edge + inward)], f"fill-{colour}")
    return marks


def _written(each: FromEach, picked: int, yours: bool, x: float, y: float) -> svg.Marks:
    rows = [("number", f"board {picked + 1} alone: {_pair(each.right[picked])}")]
    if yours:
        rows.append(("number orange", f"yours: {_pair(each.yours[picked])}"))
    return svg.join(svg.text((x, y + 27 * i), words, class_) for i, (class_, words) in enumerate(rows))


def _pair(values: Array) -> str:
    """In pixels; a board parallel to the picture leaves some ten digits before the point."""
    told = [f"{value:.1f}" if abs(value) < 1e5 else "over 100,000" for value in values]
    fx, fy = (words if np.isfinite(value) else "none" for words, value in zip(told, values, strict=True))
    return true_minus(f"fx {fx}, fy {fy}")
