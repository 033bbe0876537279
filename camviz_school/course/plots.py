"""A lesson's plots in words, for those who do not see them.

Jupyter shows a figure of matplotlib as a picture without any. In a lesson its titles, axes and legends are read out.
"""

from __future__ import annotations

from html import escape
from typing import Any


def tell_plots() -> None:
    """From now on this notebook shows figures of matplotlib, which need not be loaded yet, with words."""
    from IPython.core.getipython import get_ipython

    if display_formatter := getattr(get_ipython(), "display_formatter", None):
        as_png = display_formatter.formatters["image/png"]
        show = display_formatter.ipython_display_formatter.for_type_by_name
        show("matplotlib.figure", "Figure", lambda figure: _show(figure, as_png(figure)))


def in_words(figure: Any) -> str:
    """What a figure of matplotlib shows: of each pair of axes its title, what they count and from where to where.

    >>> from matplotlib.figure import Figure
    >>> axes = Figure().subplots()
    >>> _ = axes.set_xlabel("r, ideal"), axes.plot([0, 2], [0, 1], label="no distortion"), axes.set_xlim(0, 2)
    >>> in_words(axes.figure)
    'Plot. Across: r, ideal, 0 to 2. Up: -0.05 to 1.05. Shown: no distortion.'
    """
    return " ".join(_axes_in_words(one) for one in figure.axes if one.get_visible())


def _axes_in_words(axes: Any) -> str:
    title = axes.get_title() or ("Picture" if axes.images else "Plot")
    words = [title]
    if axes.axison:
        sides = [("Across", axes.get_xlabel(), axes.get_xlim()), ("Up", axes.get_ylabel(), axes.get_ylim())]
        words += [f"{side}: {label}{', ' * bool(label)}{ends[0]:.3g} to {ends[1]:.3g}" for side, label, ends in sides]
    if shown := axes.get_legend_handles_labels()[1]:
        words.append(f"Shown: {', '.join(shown)}")
    return " ".join(f"{one.rstrip('.')}." for one in words)


def _show(figure: Any, picture: Any) -> None:
    """Display the figure as the picture that the notebook makes of it, a PNG in base64, with its words."""
    from IPython.display import display

    if not isinstance(picture, str):
        raise NotImplementedError("this notebook shows figures in another format")  # IPython goes on to that one
    words = in_words(figure)
    html = f'<img alt="{escape(words)}" src="data:image/png;base64,{picture}">'
    display({"text/html": html, "text/plain": words}, raw=True)
