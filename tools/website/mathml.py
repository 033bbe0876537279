"""Formulas as MathML, made when the site is built: a reader's browser needs no script and no other host for them."""

from typing import Any

from docutils import nodes
from sphinx.application import Sphinx
from sphinx.writers.html5 import HTML5Translator

from camviz_school.teaching.markup import formula


def setup(app: Sphinx) -> dict[str, Any]:
    """Register the renderer `mathml`."""
    app.add_html_math_renderer("mathml", (inline, None), (display, None))
    return {"parallel_read_safe": True, "parallel_write_safe": True}


def inline(self: HTML5Translator, node: nodes.math) -> None:
    """A formula in a line of text."""
    self.body.append(formula(node.astext()))
    raise nodes.SkipNode


def display(self: HTML5Translator, node: nodes.math_block) -> None:
    """A formula of its own, which scrolls where the page is narrower."""
    self.body.append('<div class="formula" tabindex="0" role="group" aria-label="formula">')
    self.body.append(f"{formula(node.astext(), display=True)}</div>\n")
    raise nodes.SkipNode
