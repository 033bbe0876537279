"""The plan of a rectified pair: the depths between which an error of the disparity leaves a point."""

from __future__ import annotations

import numpy as np

from camviz import twoview
from camviz.draw import plot, svg
from camviz.draw.marks import NOTHING, Marks
from camviz.draw.panel import Panel
from camviz.lenses.base import Array


def wedge_panel(
    place: tuple[float, float, float, float],
    pair: twoview.RectifiedPair,
    disparity: float,
    plus_minus: float,
    farthest: float,
    notes: tuple[str, str],
    *,
    worth: bool = True,
) -> Marks:
    """The panel at `place` (x, y, width, height), along the left camera's ray of the point, out to `farthest` metres.

    The right camera's pixel is a wedge, `plus_minus` pixels to either side, that meets the left ray between the
    nearest and the farthest depth. The comb has a tooth for each whole disparity. `notes` are a line each. Without
    `worth` only the two rays are drawn, to where they meet: neither the wedge nor the comb.
    """
    B, f, Z = pair.baseline, pair.focal_length, float(pair.depth(disparity))
    near, far = (float(depth) for depth in twoview.depth_interval(Z, f, B, plus_minus))
    right = max(1.15 * farthest, min(1.1 * far, 3 * Z))
    panel = plot.plot_panel("wedge", *place, (0, right), (-0.5 * B, 1.85 * B))
    # The ray of the disparity's lower end runs from the right camera at (0, B) by (d - e) / f across for each metre.
    end = min(far, 2 * right)
    edge = (end, B - end * (disparity - plus_minus) / f)
    wedge = svg.polygon(panel.place([(0, B), edge, (end, 0), (near, 0)]), "wash fill-orange") if worth else NOTHING
    sides = svg.path([panel.place([(0, B), tip]) for tip in ((near, 0), edge)], "orange thin") if worth else NOTHING
    named, words = (right, "blue halo end") if right / 2 > Z else (0, "blue halo")  # where the orange ray is not
    error = _error(panel, f * B, right, B, (near, min(far, right)), notes[1]) if worth else svg.NOTHING
    content = (
        plot.grid(panel)
        + wedge
        + svg.line(panel.place([(0, 0), (right, 0)]), "blue")
        + sides
        + svg.line(panel.place([(0, B), (Z, 0)]), "orange")
        + error
        + svg.dots(panel.place([(Z, 0)]), "red", 8)
        + svg.dots(panel.place([(0, 0), (0, B)]), "ink", 9)
        + svg.text(panel.place((0, B)) + (9, -6), "right camera", "orange halo")
        + svg.text(panel.place((named, 0)) + (9 if named == 0 else -8, -7), "the left camera’s ray", words)
        + svg.text((panel.width - 8, 16), notes[0], "note end halo")
    )
    title = "What a disparity is worth" if worth else "Where the two rays meet"
    return plot.axes(panel, "Z in metres", "x in metres") + panel.show(content, title=title)


def _error(
    panel: Panel, focal_baseline: float, right: float, B: float, between: tuple[float, float], note: str
) -> Marks:
    """The comb, the piece of the left ray that the error leaves, and what that is in numbers."""
    near, far = between
    return (
        _comb(panel, focal_baseline, right, B)
        + svg.line(panel.place([(near, 0), (far, 0)]), "red thick")
        + svg.text((panel.width - 8, 33), note, "red end halo")
        + svg.text((panel.width - 8, panel.height - 6), "a tooth for each pixel of disparity", "note end halo")
    )


def _comb(panel: Panel, focal_baseline: float, right: float, B: float) -> Marks:
    """Teeth at the depths of the whole disparities, as long as they stand two picture units apart."""
    last = int((focal_baseline / 2 * panel.scale[0]) ** 0.5)  # Z² / (f B) is the gap
    depths: Array = focal_baseline / np.arange(1, 2 + last)
    depths = depths[depths <= right]
    teeth = np.stack([depths, np.full_like(depths, -0.08 * B)], axis=-1)
    return svg.segments(panel.place(teeth), panel.place(teeth - (0, 0.12 * B)), "muted thin")


def metres(depth: float) -> str:
    """A length in words, with about three digits that count; none behind the cameras, and from 100 km on infinite."""
    if not abs(depth) < 1e5:
        return "∞" if depth > 0 else "none"
    return f"{depth:.3f} m" if depth < 10 else f"{depth:.2f} m" if depth < 100 else f"{depth:.0f} m"
