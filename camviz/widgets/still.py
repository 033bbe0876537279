"""What remains of a widget when its kernel is gone: a still picture, saved beside it and hidden while it lives."""

from __future__ import annotations

import asyncio
import os
from collections.abc import Callable, Iterator
from html import escape
from typing import Any
from uuid import uuid4

import anywidget
import traitlets
from IPython import get_ipython
from IPython.display import display, update_display
from ipywidgets import Box, Widget

# JupyterLab puts a bare "Error displaying widget: model not found" where a saved widget was; the still says more.
_STYLE = (
    "<style>.jp-OutputArea-child:has([data-camviz-still]) + .jp-OutputArea-child .jupyter-widgets:not(:has(*))"
    "{display:none}</style>"
)

_REST_S = 1.0  # without a change, after which the saved still is drawn anew

Bundle = dict[str, str]
"""What is displayed, by its MIME types."""


class StillWidget(anywidget.AnyWidget):
    """A widget that shows itself twice: as HTML that is saved with the notebook, and live.

    A live view puts the style sheet `still_hidden` on the page. With CAMVIZ_STATIC set only the HTML is shown. Else
    `keep_soon` has the HTML of the newest output follow, so that a notebook is saved in the state in which it was left.
    """

    still_hidden = traitlets.Unicode().tag(sync=True)
    _keep: Callable[[], None] | None = None  # draws the newest output's still anew
    _resting: asyncio.TimerHandle | None = None

    def __init__(self, **traits: Any) -> None:
        super().__init__(**traits)
        self.still_hidden = f'[data-camviz-still="{self.model_id}"] {{ display: none }}'

    def still(self) -> Bundle:
        """The widget's present state as a bundle with text/html and text/plain."""
        raise NotImplementedError(f"{type(self).__name__} has no still")

    def keep_soon(self) -> None:
        """Draw the saved still anew a second after the last call, in a kernel's free time: never while a hand moves."""
        if self._resting:
            self._resting.cancel()
        try:
            loop = asyncio.get_running_loop()
        except RuntimeError:  # outside a kernel nothing is saved, and a thread of one has no free time to give
            return
        if self._keep:
            self._resting = loop.call_later(_REST_S, self._keep)

    def keep_now(self) -> None:
        """Draw the saved still anew."""
        if self._keep:
            self._keep()

    def keep_instead_of(self, other: StillWidget) -> None:
        """Take the place of another widget, and of its saved still."""
        if other._resting:
            other._resting.cancel()
        self._keep, other._keep = other._keep, None
        self.keep_soon()

    def _ipython_display_(self) -> None:
        _show_with_stills(self, [("", self)])


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


def display_kept(bundle: Callable[[], Bundle], *widgets: StillWidget) -> None:
    """Display what `bundle` makes, and again in the same place whenever one of the widgets has come to rest."""
    place = uuid4().hex
    for widget in widgets:
        widget._keep = lambda: update_display(bundle(), display_id=place, raw=True)
    display(bundle(), raw=True, display_id=place)


def _show_with_stills(widget: Widget, held: list[tuple[str, StillWidget]]) -> None:
    """Display the stills of the widgets `held`, by their titles, and then the live `widget` that holds them."""
    if os.environ.get("CAMVIZ_STATIC"):
        display(_bundle(held, static=True), raw=True)
        return
    display_kept(lambda: _bundle(held, static=False), *(one for _, one in held))
    live = {"model_id": widget.model_id, "version_major": 2, "version_minor": 1}
    display({"application/vnd.jupyter.widget-view+json": live, "text/plain": ""}, raw=True)


def _bundle(held: list[tuple[str, StillWidget]], *, static: bool) -> Bundle:
    """The stills of the widgets `held`, by their titles, as one bundle."""
    stills = [(title, "" if static else one.model_id, one.still()) for title, one in held]
    html = "".join(_kept(title, model, still["text/html"]) for title, model, still in stills)
    plain = "\n\n".join(still["text/plain"] for _, _, still in stills)
    return {"text/html": html if static else f"{_STYLE}{html}", "text/plain": plain}


def _kept(title: str, model: str, still: str) -> str:
    """A still under its title, marked by the widget that hides it while it lives."""
    html = f"<p><b>{escape(title)}</b></p>{still}" if title else still
    return f'<div data-camviz-still="{model}">{html}</div>' if model else html
