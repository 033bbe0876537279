"""Plots: a panel with axes. Curves, bands and marks go in as data and come out as SVG."""

from collections.abc import Sequence

import numpy as np

from camviz.draw import svg
from camviz.draw.panel import Panel


def plot_panel(
    name: str, x: float, y: float, width: float, height: float, xlim: tuple[float, float], ylim: tuple[float, float]
) -> Panel:
    """A panel whose y axis points up, leaving to its left and below the room that tick labels need."""
    return Panel(name, x, y, width, height, xlim[0], xlim[1], ylim[1], ylim[0])


def axes(panel: Panel, xlabel: str, ylabel: str) -> str:
    """Tick labels and axis names around a plot panel, to stand beside `panel.show(grid(panel) + …)`."""
    xs, ys = _ticks(panel.left, panel.right, panel.width), _ticks(panel.bottom, panel.top, panel.height)
    parts = [
        svg.text((panel.x + px, panel.y + panel.height + 16), words, "tick middle")
        for px, words in zip(panel.place(_pairs(xs, panel.top))[:, 0], written(xs), strict=True)
    ]
    parts += [
        svg.text((panel.x - 6, panel.y + py + 4), words, "tick end")
        for py, words in zip(panel.place(_pairs(panel.left, ys))[:, 1], written(ys), strict=True)
    ]
    parts.append(svg.text((panel.x + panel.width / 2, panel.y + panel.height + 34), xlabel, "note middle"))
    x, y = panel.x - 40, panel.y + panel.height / 2
    parts.append(svg.text((x, y), ylabel, "note middle", transform=f"rotate(-90 {x:g} {y:g})"))
    return "".join(parts)


def grid(panel: Panel) -> str:
    """Grid lines at the ticks, and the axes x = 0 and y = 0 where they are inside."""
    xs, ys = _ticks(panel.left, panel.right, panel.width), _ticks(panel.bottom, panel.top, panel.height)
    lines = [_pairs(x, (panel.bottom, panel.top)) for x in xs] + [_pairs((panel.left, panel.right), y) for y in ys]
    zeros = [_pairs(0, (panel.bottom, panel.top))] if panel.left <= 0 <= panel.right else []
    zeros += [_pairs((panel.left, panel.right), 0)] if panel.bottom <= 0 <= panel.top else []
    return svg.path(map(panel.place, lines), "grid") + svg.path(map(panel.place, zeros), "axis")


def curve(panel: Panel, x: np.ndarray, y: np.ndarray, class_: str) -> str:
    """The line through (x, y), both (n,); values far outside the panel are cut so that the text stays short."""
    points = panel.place(np.stack([x, y], axis=-1))
    outside = (np.abs(points[:, 1] - panel.height / 2) > 3 * panel.height)[:, None]
    return svg.line(np.where(outside, np.nan, points), class_)


def band(panel: Panel, x0: float, x1: float, class_: str) -> str:
    """The vertical band x0 … x1, shaded."""
    (left, _), (right, _) = panel.place([(max(x0, panel.left), 0), (min(x1, panel.right), 0)])
    return svg.rectangle(left, 0, right - left, panel.height, f"wash {class_}") if right > left else ""


def upright(panel: Panel, x: float, class_: str) -> str:
    """A vertical line at x."""
    return svg.line(panel.place(_pairs(x, (panel.bottom, panel.top))), class_)


def legend(panel: Panel, entries: Sequence[tuple[str, str]], corner: str = "top left") -> str:
    """Names of the lines in one corner of the panel: (class, words) pairs, each with a sample of its line."""
    x = 10 if "left" in corner else panel.width - 20 - 7 * max(len(words) for _, words in entries) - 20
    y = 18 if "top" in corner else panel.height - 18 * len(entries) + 6
    rows = []
    for i, (class_, words) in enumerate(entries):
        rows.append(svg.line([(x, y + 18 * i - 4), (x + 20, y + 18 * i - 4)], class_))
        rows.append(svg.text((x + 27, y + 18 * i), words, "note halo"))
    return "".join(rows)


def ticks(low: float, high: float, count: float) -> np.ndarray:
    """Round numbers from `low` to `high`, about `count` at most: multiples of 1, 2 or 5 times a power of ten."""
    rough = (high - low) / max(count, 1)
    power = 10.0 ** np.floor(np.log10(rough))
    step = power * next(factor for factor in (1, 2, 5, 10) if factor * power >= rough * (1 - 1e-9))
    return step * np.arange(np.ceil(low / step - 1e-9), np.floor(high / step + 1e-9) + 1)


def _ticks(low: float, high: float, length: float) -> np.ndarray:
    return ticks(low, high, length / 50)


def written(values: np.ndarray) -> list[str]:
    """Evenly spaced values as text, with as many decimals as tell them apart."""
    step = float(np.min(np.diff(values))) if len(values) > 1 else 1.0
    decimals = max(0, int(np.ceil(-np.log10(step) - 1e-9)))
    return [f"{value:.{decimals}f}".replace("-", "−") if abs(value) > step / 1e6 else "0" for value in values]


def _pairs(x: object, y: object) -> np.ndarray:
    return np.stack(np.broadcast_arrays(np.asarray(x, float), np.asarray(y, float)), axis=-1).reshape(-1, 2)
