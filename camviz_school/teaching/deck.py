"""Slides as one HTML file that needs nothing else: no network, no server, and to scroll through not even a script."""

from __future__ import annotations

import re
from collections.abc import Sequence
from html import escape
from importlib.resources import files

from camviz_school.course.notebooks import Notebook
from camviz_school.teaching import parts, plans
from camviz_school.teaching.slides import Slide, slides

# Not even by mistake does a page of slides load anything.
POLICY = "default-src 'none'; img-src data:; style-src 'unsafe-inline'; script-src 'unsafe-inline'"
HELP = "→ or space: next · ←: back · 1–9: part · Home, End · z: enlarge · d: dark or light · f: full screen · p: print"


def deck(notebook: Notebook, *, solved: bool = False) -> str:
    """The slides of a lesson as a page; `solved` says that the lesson was run with its solutions."""
    return page(planned_slides(notebook, solved=solved))


def page(made: Sequence[Slide]) -> str:
    """Slides as a page."""
    title = re.sub(r"<[^>]*>", "", made[0].heading)
    body = "".join(_section(number, one, len(made)) for number, one in enumerate(made, start=1))
    return (
        f'<!DOCTYPE html><html lang="en"><head><meta charset="utf-8"><title>{title} · slides</title>'
        f'<meta http-equiv="Content-Security-Policy" content="{POLICY}">'
        f'<meta name="viewport" content="width=device-width, initial-scale=1"><style>{_file("deck.css")}</style></head>'
        f'<body><main>{body}</main><p class="help" hidden>{escape(HELP)}</p>'
        f"<script>{_file('deck.js')}</script></body></html>\n"
    )


def planned_slides(notebook: Notebook, *, solved: bool = False) -> list[Slide]:
    """The slides of a lesson, which say in each picture what its plan says, where it has one."""
    plan = plans.plan(parts.number_of(notebook))
    return slides(notebook, plan.notice if plan else (), solved=solved)


def _section(number: int, slide: Slide, count: int) -> str:
    part = re.match(r"(\d+) · ", slide.part)
    jump = f' data-part="{part[1]}"' if part else ""
    level = "h1" if slide.kind == "title" else "h2"
    heading = f"<{level}>{slide.heading}</{level}>" if slide.heading else ""
    return (
        f'<section class="slide {slide.kind}" id="s{number}"{jump}><header>{escape(slide.part)}</header>'
        f"<div class='idea'>{heading}{slide.body}</div><footer>{number} / {count}</footer></section>"
    )


def _file(name: str) -> str:
    return (files(__package__) / name).read_text(encoding="utf-8")
