"""Deeper sections, each folded below its heading and its minutes until a reader opens it."""

from __future__ import annotations

from typing import Any

from docutils import nodes
from sphinx.application import Sphinx

_OPEN = (
    '<details class="camviz-deeper"><summary><span class="closed">Show this section</span>'
    '<span class="opened">Hide this section</span></summary>'
)
_CLOSE = "</details>"


def setup(app: Sphinx) -> dict[str, Any]:
    """Folds the deeper sections of each page."""
    app.connect("doctree-resolved", lambda _app, doctree, _page: fold(doctree))
    return {"parallel_read_safe": True, "parallel_write_safe": True}


def fold(doctree: nodes.Node) -> None:
    """Puts all of each section "Deeper: …" into a fold, but for its heading and the line with its minutes."""
    for section in list(doctree.findall(nodes.section)):
        title, *said = section.children
        if title.astext().startswith("Deeper: "):
            minutes, *rest = said
            section.children = [title, minutes]
            section.extend([_html(_OPEN), *rest, _html(_CLOSE)])


def _html(text: str) -> nodes.raw:
    return nodes.raw("", text, format="html")
