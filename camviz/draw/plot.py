"""Plots: a panel with axes. Curves, bands and marks go in as data and come out as SVG."""

from collections.abc import Sequence

import numpy as np

from camviz.draw import svg
from camviz.draw.marks import Marks
from camviz.draw.panel import Panel
from camviz.draw.readout import true_minus

Ticks = Sequence[tuple[float, str]]


def plot_panel(
    name: str, x: float, y: float, width: float, height: float, xlim: tuple[float, float], ylim: tuple[float, float]
) -> Panel:
    """A panel whose y axis points up, leaving to its left and below the room that tick labels need."""
    return Panel(name, x, y, width, height, xlim[0], xlim[1], ylim[1], ylim[0])


def axes(
    panel: Panel,
    xlabel: str,
    ylabel: str,
    xticks: Ticks | None = None,
    yticks: Ticks | None = None,
    *,
    aside: float = 40,
) -> Marks:
    """Tick labels and axis names around a plot panel, to stand beside `panel.show(grid(panel) + …)`.

    Ticks are found where none are given as (place, words), as for a logarithmic axis. The name of the y axis stands
    `aside` units to the left of it.
    """
    xs = _found(panel.left, panel.right, panel.width) if xticks is None else xticks
    ys = _found(panel.bottom, panel.top, panel.height) if yticks is None else yticks
    parts = [
        svg.text((panel.x + px, panel.y + panel.height + 16), words, "tick middle")
        for px, (_, words) in zip(panel.place(_pairs(_places(xs), panel.top))[:, 0], xs, strict=True)
    ]
    parts += [
        svg.text((panel.x - 6, panel.y + py + 4), words, "tick end")
        for py, (_, words) in zip(panel.place(_pairs(panel.left, _places(ys)))[:, 1], ys, strict=True)
    ]
    parts.append(svg.text((panel.x + panel.width / 2, panel.y + panel.height + 34), xlabel, "note middle"))
    x, y = panel.x - aside, panel.y + panel.height / 2
    parts.append(svg.text((x, y), ylabel, "note middle", turned_deg=-90))
    return svg.join(parts)


def grid(panel: Panel, xticks: Ticks | None = None, yticks: Ticks | None = None) -> Marks:
    """Grid lines at the ticks, and the axes x = 0 and y = 0 where they are inside."""
    xs = _places(_found(panel.left, panel.right, panel.width) if xticks is None else xticks)
    ys = _places(_found(panel.bottom, panel.top, panel.height) if yticks is None else yticks)
    zeros = [_pairs(0, (panel.bottom, panel.top))] if panel.left <= 0 <= panel.right else []
    zeros += [_pairs((panel.left, panel.right), 0)] if panel.bottom <= 0 <= panel.top else []
    return _lines(panel, xs, ys) + svg.path(map(panel.place, zeros), "axis")


def plotted(
    panel: Panel,
    content: Marks,
    xlabel: str,
    ylabel: str,
    xticks: Ticks | None = None,
    yticks: Ticks | None = None,
    *,
    aside: float = 40,
    **heading: str,
) -> Marks:
    """A plot with its grid and axes around what it shows; `heading` is what `Panel.show` takes, `aside` what `axes`."""
    shown = panel.show(grid(panel, xticks, yticks) + content, **heading)
    return shown + axes(panel, xlabel, ylabel, xticks, yticks, aside=aside)


def logarithmic_grid(panel: Panel, xticks: Ticks, yticks: Ticks) -> Marks:
    """Grid lines at the ticks of axes that hold logarithms, on which 0 is no place of its own."""
    return _lines(panel, _places(xticks), _places(yticks))


def _lines(panel: Panel, xs: Sequence[float], ys: Sequence[float]) -> Marks:
    lines = [_pairs(x, (panel.bottom, panel.top)) for x in xs] + [_pairs((panel.left, panel.right), y) for y in ys]
    return svg.path(map(panel.place, lines), "grid")


def curve(panel: Panel, x: np.ndarray, y: np.ndarray, class_: str) -> Marks:
    """The line through (x, y), both (n,); values far outside the panel are cut so that the text stays short."""
    points = panel.place(np.stack([x, y], axis=-1))
    outside = (np.abs(points[:, 1] - panel.height / 2) > 3 * panel.height)[:, None]
    return svg.line(np.where(outside, np.nan, points), class_)


def bars(panel: Panel, left: np.ndarray, right: np.ndarray, top: np.ndarray, class_: str) -> Marks:
    """Upright bars from 0, between `left` and `right` and as high as `top`, each (n,), as one element; NaN has none."""
    known = np.isfinite(top)
    left, right, top = left[known], right[known], np.minimum(top[known], panel.top)
    corners = np.stack([_pairs(left, 0), _pairs(left, top), _pairs(right, top), _pairs(right, 0)], axis=1)
    return svg.path(map(panel.place, corners), class_, closed=True)


def between(panel: Panel, x: np.ndarray, low: np.ndarray, high: np.ndarray, class_: str) -> Marks:
    """The area between two curves over x, all (n,), shaded."""
    known = np.isfinite(low + high)
    outline = np.concatenate([_pairs(x[known], low[known]), _pairs(x[known], high[known])[::-1]])
    return svg.polygon(panel.place(outline), f"wash {class_}") if known.sum() > 1 else svg.NOTHING


def logarithmic(low: float, high: float) -> list[tuple[float, str]]:
    """Ticks of an axis that holds log10 of what it names: 1, 2 and 5 times powers of ten, fewer where these crowd."""
    powers = 10.0 ** np.arange(np.floor(low), np.ceil(high) + 1)
    factors = (1, 2, 5) if high - low < 2.2 else (1,)
    values = np.sort(np.outer(powers, factors).ravel())
    values = values[(np.log10(values) >= low - 1e-9) & (np.log10(values) <= high + 1e-9)]
    return [(float(np.log10(value)), f"{value:g}") for value in values]


def logs(pair: tuple[float, float]) -> tuple[float, float]:
    """The base-10 logarithms of two numbers: a place on logarithmic axes, or the limits of one."""
    low, high = np.log10(pair)
    return float(low), float(high)


def band(panel: Panel, x0: float, x1: float, class_: str) -> Marks:
    """The vertical band x0 … x1, shaded."""
    (left, _), (right, _) = panel.place([(max(x0, panel.left), 0), (min(x1, panel.right), 0)])
    return svg.rectangle(left, 0, right - left, panel.height, f"wash {class_}") if right > left else svg.NOTHING


def upright(panel: Panel, x: float, class_: str) -> Marks:
    """A vertical line at x."""
    return svg.line(panel.place(_pairs(x, (panel.bottom, panel.top))), class_)


def level(panel: Panel, y: float, class_: str) -> Marks:
    """A horizontal line at y."""
    return svg.line(panel.place([(panel.left, y), (panel.right, y)]), class_)


def legend(panel: Panel, entries: Sequence[tuple[str, str]], corner: str = "top left") -> Marks:
    """Names of the lines in one corner of the panel: (class, words) pairs, each with a sample of its line.

    Where the picture is shown small, the whole legend grows out of its corner (flow.css), and no word leaves its line.
    """
    x = 10 if "left" in corner else panel.width - 20 - 7 * max(len(words) for _, words in entries) - 20
    y = 18 if "top" in corner else panel.height - 18 * len(entries) + 6
    width, height = 34 + 6.1 * max(len(words) for _, words in entries), 18 * len(entries) + 2
    from_x, from_y = x - 6 + width * ("right" in corner), y - 15 + height * ("bottom" in corner)
    rows = [svg.rectangle(x - 6, y - 15, width, height, "card", fill_opacity=0.85)]
    for i, (class_, words) in enumerate(entries):
        rows.append(svg.line([(x, y + 18 * i - 4), (x + 20, y + 18 * i - 4)], class_))
        rows.append(svg.text((x + 27, y + 18 * i), words, "note halo", grows_from=(from_x, from_y)))
    return svg.group(svg.join(rows), "legend", grows_from=(from_x, from_y))


def ticks(low: float, high: float, count: float) -> np.ndarray:
    """Round numbers from `low` to `high`, about `count` at most but two at least, for one says nothing of the scale:
    multiples of 1, 2 or 5 times a power of ten."""
    rough = (high - low) / max(count, 1)
    power = 10.0 ** np.floor(np.log10(rough))
    step = power * next(factor for factor in (1, 2, 5, 10) if factor * power >= rough * (1 - 1e-9))
    values = step * np.arange(np.ceil(low / step - 1e-9), np.floor(high / step + 1e-9) + 1)
    return values if len(values) > 1 or count >= 5 else ticks(low, high, 5)


def _found(low: float, high: float, length: float) -> Ticks:
    values = ticks(low, high, length / 50)
    return list(zip(values.tolist(), written(values), strict=True))


def _places(ticks: Ticks) -> list[float]:
    return [place for place, _ in ticks]


def written(values: np.ndarray) -> list[str]:
    """Evenly spaced values as text, with as many decimals as tell them apart."""
    step = float(np.min(np.diff(values))) if len(values) > 1 else 1.0
    decimals = max(0, int(np.ceil(-np.log10(step) - 1e-9)))
    return [true_minus(f"{value:.{decimals}f}") if abs(value) > step / 1e6 else "0" for value in values]


def _pairs(x: object, y: object) -> np.ndarray:
    return np.stack(np.broadcast_arrays(np.asarray(x, float), np.asarray(y, float)), axis=-1).reshape(-1, 2)
