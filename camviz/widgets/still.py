"""What remains of a widget when its kernel is gone: a still picture, saved beside it and hidden while it lives."""

from __future__ import annotations

import os
from collections.abc import Iterator
from html import escape
from typing import Any

import anywidget
import traitlets
from IPython import get_ipython
from IPython.display import display
from ipywidgets import Box, Widget

# JupyterLab puts a bare "Error displaying widget: model not found" where a saved widget was; the still says more.
_STYLE = (
    "<style>.jp-OutputArea-child:has([data-camviz-still]) + .jp-OutputArea-child .jupyter-widgets:not(:has(*))"
    "{display:none}</style>"
)


class StillWidget(anywidget.AnyWidget):
    """A widget that shows itself twice: as HTML that is saved with the notebook, and live.

    A live view puts the style sheet `still_hidden` on the page. With CAMVIZ_STATIC set only the HTML is shown.
    """

    still_hidden = traitlets.Unicode().tag(sync=True)
    _displayed = False

    def __init__(self, **traits: Any) -> None:
        super().__init__(**traits)
        self.still_hidden = f'[data-camviz-still="{self.model_id}"] {{ display: none }}'

    def still(self) -> dict[str, str]:
        """The widget's present state as a bundle with text/html and text/plain."""
        raise NotImplementedError(f"{type(self).__name__} has no still")

    def _ipython_display_(self) -> None:
        _show_with_stills(self, [("", self)])
        self._displayed = True

    def renew_still(self) -> None:
        """Let the notebook keep the present state from now on, where this widget has been displayed alone."""
        if self._displayed and not os.environ.get("CAMVIZ_STATIC"):
            bundle = _stills([("", self)])
            display(bundle, raw=True, update=True, display_id=_display_id(self))


def stills_for_boxes() -> None:
    """Show the stills of what lies in a box of ipywidgets (VBox, HBox, Tab …) with it, in this notebook.

    IPython asks whoever is registered for a type how to display it. A box without such widgets is shown as ever.
    """
    if shell := get_ipython():
        shell.display_formatter.ipython_display_formatter.for_type(Box, _show_box)


def _show_box(box: Box) -> None:
    held = list(_held(box))
    if not held:
        raise NotImplementedError("nothing in this box has a still")  # IPython goes on to the box's own display
    _show_with_stills(box, held)


def _held(box: Box, title: str = "") -> Iterator[tuple[str, StillWidget]]:
    """What in a box and the boxes within it has a still, each with the titles of the pages on which it lies."""
    titles = getattr(box, "titles", ()) or ("",) * len(box.children)
    for child, own in zip(box.children, titles, strict=True):
        path = " · ".join(filter(None, (title, own)))
        if isinstance(child, Box):
            yield from _held(child, path)
        elif isinstance(child, StillWidget):
            yield path, child


def _show_with_stills(widget: Widget, held: list[tuple[str, StillWidget]]) -> None:
    """Display the stills of the widgets `held`, by their titles, and then the live `widget` that holds them."""
    display(_stills(held), raw=True, display_id=_display_id(widget))
    if not os.environ.get("CAMVIZ_STATIC"):
        live = {"model_id": widget.model_id, "version_major": 2, "version_minor": 1}
        display({"application/vnd.jupyter.widget-view+json": live, "text/plain": ""}, raw=True)


def _display_id(widget: Widget) -> str:
    return f"camviz-still-{widget.model_id}"


def _stills(held: list[tuple[str, StillWidget]]) -> dict[str, str]:
    static = bool(os.environ.get("CAMVIZ_STATIC"))
    stills = [(title, one.model_id, one.still()) for title, one in held]
    html = "".join(_kept(title, "" if static else model, still["text/html"]) for title, model, still in stills)
    plain = "\n\n".join(still["text/plain"] for _, _, still in stills)
    return {"text/html": html if static else f"{_STYLE}{html}", "text/plain": plain}


def _kept(title: str, model: str, still: str) -> str:
    """A still under its title, marked by the widget that hides it while it lives."""
    html = f"<p><b>{escape(title)}</b></p>{still}" if title else still
    return f'<div data-camviz-still="{model}">{html}</div>' if model else html
