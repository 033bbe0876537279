"""What is made from the course: the map of the lessons, and the glossary for the cards beside its terms."""

from __future__ import annotations

import json
from html import escape
from pathlib import Path

import pictures

from camviz.draw import prose
from camviz_school.course import paths, saved_outputs
from camviz_school.course.catalogue import Lesson, catalogue
from camviz_school.course.glossary import Term, glossary
from camviz_school.course.material import lesson_paths
from camviz_school.course.notebooks import read
from camviz_school.course.questions import predict_questions, quiz_questions

PARTS = (
    ("Begin", "00", ""),
    (
        "One camera",
        "01 02 03 04 05 06",
        "The way begins here: from a hole in a box to a camera whose numbers you have measured.",
    ),
    ("Two cameras", "07 08", "After 06: what a second picture adds."),
    (
        "Other cameras",
        "09 10 11",
        "09 and 10 after 03, 11 after 08: lenses that see behind themselves, and one that focuses later.",
    ),
    ("The sensor", "12 13 14 15", "After 01, on a way of its own: what becomes of the light."),
    ("The clinic", "16", "After 05, 06 and 08: all of it in a calibration that somebody gives you."),
    ("Electives", "", "For whoever wants more."),
)
"""The course as a map: each part's title, its lessons, and where it follows. The last has all other lessons."""


def course_pages(pictured: Path) -> dict[str, str]:
    """The site's own pages about the course, by their names; pictures of the lessons go to the folder `pictured`."""
    shown = {path.name: _first_picture(path, pictured) for path in lesson_paths()}
    return {"learn.md": learn(catalogue(), shown), "_static/terms.js": terms(glossary().terms)}


def learn(lessons: list[Lesson], shown: dict[str, str]) -> str:
    """The map of the lessons; `shown` are the addresses of their pictures by their files."""
    toctree = "\n".join(f"lessons/{Path(one.file).stem}" for one in lessons)
    hours = sum(one.minutes for one in lessons) / 60
    parts = "".join(
        f'<section class="map-part"><h2>{title}</h2><p>{words}</p><div class="lesson-map">'
        f"{''.join(_card(one, shown.get(one.file, '')) for one in members)}</div></section>\n"
        for title, words, members in _parts(lessons)
    )
    return (
        "# Learn\n\n"
        f"{len(lessons)} lessons, about {hours:.0f} hours for their cores. Begin with the first, or with the question "
        "that brings you here. Your answers stay in this browser.\n\n"
        f"{paths.table(lessons, 'lessons/')}\n\n"
        f"```{{toctree}}\n:hidden:\n\n{toctree}\ndocs/glossary\nlessons/conventions\n```\n\n"
        f'<div class="course-map">\n{parts}</div>\n\n'
        '<p>Beside the lessons: the <a href="docs/glossary.html">glossary</a> and the '
        '<a href="lessons/conventions.html">conventions</a>.</p>\n\n'
        '<p><button type="button" class="camviz-clear" hidden>Clear my answers in all lessons</button>'
        '<span role="status" class="camviz-cleared"></span></p>\n'
    )


def _parts(lessons: list[Lesson]) -> list[tuple[str, str, list[Lesson]]]:
    named = {number for _, numbers, _ in PARTS for number in numbers.split()}
    rest = {one.number for one in lessons} - named
    members = [set(numbers.split()) or rest for _, numbers, _ in PARTS]
    return [
        (title, words, [one for one in lessons if one.number in wanted])
        for (title, _, words), wanted in zip(PARTS, members, strict=True)
    ]


def _first_picture(path: Path, folder: Path) -> str:
    """The address of the first panel of a lesson's first picture, from the top of the site; "" without one."""
    for cell in read(path).cells:
        for _, source in saved_outputs.images(cell):
            if source.startswith("data:image/svg+xml"):
                return f"{folder.name}/{pictures.kept(source, folder).name}"
    return ""


def _card(one: Lesson, picture: str) -> str:
    page = f"lessons/{Path(one.file).stem}.html"
    questions = len(predict_questions(one.number)) + len(quiz_questions(one.number))
    image = f'<img src="{picture}" alt="" loading="lazy" width="320" height="200">' if picture else ""
    return (
        f'<a class="lesson-card" href="{page}">{image}<span class="lesson-number">{one.number}</span> '
        f'<strong>{escape(one.title)}</strong><span class="lesson-question">{escape(one.question)}</span>'
        f'<span class="lesson-minutes">{one.minutes} minutes</span>'
        f'<span class="lesson-progress" data-lesson="{one.number}" data-questions="{questions}"></span></a>'
    )


def terms(entries: tuple[Term, ...]) -> str:
    """The glossary as a script, by anchors; the site's script loads it when a reader first rests on a term."""
    shown = {one.anchor: _sentence(one) for one in entries}
    return f"window.camvizTerms = {json.dumps(shown, ensure_ascii=False)};\n"


def _sentence(one: Term) -> str:
    formula = f" <code>{escape(one.formula)}</code>" if one.formula else ""
    return f"<p><strong>{escape(one.name)}.</strong> {prose.inline(one.sentence)}{formula}</p>"
