"""A recorded pane in one file, for pages that are built by others: a module of anywidget's, or a page of its own.

What builds a page copies files elsewhere and renames them; one file has no neighbours that it could lose.
"""

from __future__ import annotations

import json
from base64 import b64encode
from html import escape
from importlib.resources import files
from pathlib import Path

from camviz_school.record.recording import PLAYER, RecordedPane


def write_one_file(pane: RecordedPane, path: str | Path) -> Path:
    """Write a pane as one file that needs no other.

    Args:
        pane: What was recorded.
        path: Its ending says what is written. ".mjs": a module that exports `render` as anywidget's do, for MyST's
            `{anywidget}`. ".html": a page, for a frame (iframe), a learning platform, or a double click.

    Returns: The path.
    Raises: ValueError for another ending.

    >>> import anywidget, traitlets
    >>> from camviz_school.record import Axis, Widget, record
    >>> class Dot(anywidget.AnyWidget):
    ...     _esm = "export default { render() {} }"
    ...     x = traitlets.Int(0).tag(sync=True)
    >>> made = record(Widget(Dot(), (Axis.slider("x", 0, 100, 1, first=0),), title="A dot"), "recorded")
    >>> write_one_file(made, "recorded/dot.mjs").name
    'dot.mjs'
    """
    path = Path(path)
    writers = {".mjs": _module, ".html": _page}
    if path.suffix not in writers:
        raise ValueError(f"the file must end in .mjs (a module) or .html (a page), got {path.name}")
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text(writers[path.suffix](pane), encoding="utf-8")
    return path


def _module(pane: RecordedPane) -> str:
    html = json.dumps(pane.html_within(), ensure_ascii=False)
    return (
        f"{_scripts(pane)}\n"
        f"export default {{ render({{ el }}) {{ el.innerHTML = {html}; "
        "window.camvizRecorded.watch(el.firstElementChild); } };\n"
    )


def _page(pane: RecordedPane) -> str:
    return (
        f'<!doctype html><html lang="en"><head><meta charset="utf-8"><title>{escape(pane.title)}</title>'
        '<meta name="viewport" content="width=device-width, initial-scale=1"><link rel="icon" href="data:,">'
        "<style>:root { color-scheme: light dark } body { margin: 4px; font-family: system-ui, sans-serif }</style>"
        f"</head><body><main>{pane.html_within()}</main><script>{_scripts(pane)}</script></body></html>\n"
    )


def _scripts(pane: RecordedPane) -> str:
    """The player, and all files of the pane, which they hand to it. No text in them ends a script element."""
    parts = [(files("camviz_school.record") / PLAYER).read_text(encoding="utf-8")]
    for name in pane.files:
        data = (pane.folder / name).read_bytes()
        photograph = f"data:image/webp;base64,{b64encode(data).decode()}"
        parts.append(data.decode() if name.endswith(".js") else f'camvizRecorded("{name}","{photograph}");\n')
    return "".join(parts).replace("</", "<\\/").replace("<!--", "<\\!--")
