"""What the notebook's own JavaScript and style sheets are on the site's pages."""

from __future__ import annotations

from importlib.resources import files

from camviz.draw.picture import page_style

_EXPORT = "export default { render };"


def question_script() -> str:
    """`camvizQuestion`, the questions' render function word for word, in a classic script: file:// loads no modules."""
    source = _text("camviz_school.widgets", "question.js")
    if source.count(_EXPORT) != 1:
        raise ValueError(f"question.js must end with {_EXPORT}, which the site's script replaces")
    return f"const camvizQuestion = (() => {{\n{source.replace(_EXPORT, 'return render;')}\n}})();\n"


def style_sheet() -> str:
    """The style sheets of pictures, panes and questions."""
    return page_style() + _text("camviz.widgets", "explorer.css") + _text("camviz_school.widgets", "question.css")


def _text(package: str, file: str) -> str:
    return (files(package) / file).read_text(encoding="utf-8")
