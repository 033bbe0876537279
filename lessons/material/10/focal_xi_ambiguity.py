"""The valley of an omnidirectional calibration: how well corners fit at every focal length and ξ."""

from __future__ import annotations

import numpy as np

from camviz.draw import plot, svg
from camviz.draw.flow import WIDTH, Tile
from camviz.draw.panel import Panel
from camviz.draw.picture import Picture
from camviz.draw.shades import Shades, bar, contours, heat
from camviz_clinic.calibration.focal_xi_ambiguity import FocalXiAmbiguity


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


def _line(panel: Panel, one: FocalXiAmbiguity) -> str:
    lens, pixels = one.camera.lens, one.camera.intrinsics
    f = pixels.fx / (1 + lens.xi) * (1 + one.xi)  # type: ignore[attr-defined]
    line = panel.place(np.stack([one.xi, f], axis=-1))
    return svg.line(line, "paper-line") + svg.line(line, "orange thick dashed")


def _plus(at: np.ndarray) -> str:
    ends = np.array([(-8, 0), (8, 0), (0, -8), (0, 8)]) + at
    pairs = ends[[0, 2]], ends[[1, 3]]
    return svg.segments(*pairs, "paper-line") + svg.segments(*pairs, "ink thick")
