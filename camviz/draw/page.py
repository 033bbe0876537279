"""A whole HTML page in the style of every picture, readable without a network."""

from __future__ import annotations

from html import escape
from importlib.resources import files

from camviz import __version__
from camviz.draw.picture import Picture, page_style


def document(title: str, body: str, *, layout: str = "", script: str = "") -> str:
    """A whole HTML page around its body, in the style of every picture; more `layout` (CSS) and `script` go inside."""
    name = escape(title) or "A calibration"  # one that was made and not read has no file's name
    code = f"<script>{script}</script>" if script else ""
    return (
        f'<!DOCTYPE html><html lang="en"><head><meta charset="utf-8"><title>{name} · camviz</title>'
        f'<meta name="description" content="{name}: a camera calibration, looked at by camviz.">'
        '<meta name="viewport" content="width=device-width, initial-scale=1"><link rel="icon" href="data:,">'
        f"<style>{page_style()}{_layout()}{layout}</style></head><body><main><h1>{name}</h1>{body}</main>"
        f"<footer>Made by camviz {__version__}. Pixels count from the centre of the first one; metres; "
        f"x right, y down, z forward.</footer>{code}</body></html>\n"
    )


def _layout() -> str:
    return (files("camviz.draw") / "page.css").read_text(encoding="utf-8")


def figure(name: str, picture: Picture) -> str:
    """A picture under its caption."""
    caption = f"<figcaption>{escape(name)}</figcaption>" if name else ""
    return f"<figure>{caption}{picture.embedded()}</figure>"
