"""What remains of a widget when its kernel is gone: a still picture, saved beside it and hidden while it lives."""

from __future__ import annotations

import os
from typing import Any

import anywidget
import traitlets
from IPython.display import display

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

    def __init__(self, **traits: Any) -> None:
        super().__init__(**traits)
        self.still_hidden = f'[data-camviz-still="{self.model_id}"] {{ display: none }}'

    def still(self) -> dict[str, str]:
        """The widget's present state as a bundle with text/html and text/plain."""
        raise NotImplementedError(f"{type(self).__name__} has no still")

    def _ipython_display_(self) -> None:
        still = self.still()
        if os.environ.get("CAMVIZ_STATIC"):
            display(still, raw=True)
            return
        kept = f'{_STYLE}<div data-camviz-still="{self.model_id}">{still["text/html"]}</div>'
        display({**still, "text/html": kept}, raw=True)
        live = {"model_id": self.model_id, "version_major": 2, "version_minor": 1}
        display({"application/vnd.jupyter.widget-view+json": live, "text/plain": ""}, raw=True)
