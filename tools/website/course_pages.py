"""What is made from the course: the map of the lessons, and the glossary for the cards beside its terms."""

from __future__ import annotations

import json
from html import escape
from pathlib import Path

from camviz.draw import prose
from camviz_school.course import paths
from camviz_school.course.catalogue import Lesson, catalogue
from camviz_school.course.glossary import Term, glossary
from camviz_school.course.questions import predict_questions, quiz_questions


def course_pages() -> dict[str, str]:
    """The site's own pages about the course, by their names."""
    return {"learn.md": learn(catalogue()), "_static/terms.js": terms(glossary().terms)}


def learn(lessons: list[Lesson]) -> str:
    """The map of the lessons."""
    toctree = "\n".join(f"lessons/{Path(one.file).stem}" for one in lessons)
    cards = "\n".join(_card(one) for one in lessons)
    hours = sum(one.minutes for one in lessons) / 60
    return (
        "# Learn\n\n"
        f"{len(lessons)} lessons, about {hours:.0f} hours in all. Begin with the first, or with the question that "
        "brings you here. Your answers stay in this browser.\n\n"
        f"{paths.table(lessons, 'lessons/')}\n\n"
        f"```{{toctree}}\n:hidden:\n\n{toctree}\ndocs/glossary\nlessons/conventions\n```\n\n"
        f'<div class="lesson-map">\n{cards}\n</div>\n\n'
        '<p><button type="button" class="camviz-clear" hidden>Clear my answers in all lessons</button>'
        '<span role="status" class="camviz-cleared"></span></p>\n'
    )


def _card(one: Lesson) -> str:
    page = f"lessons/{Path(one.file).stem}.html"
    questions = len(predict_questions(one.number)) + len(quiz_questions(one.number))
    picture = f'<img src="{one.picture}" alt="" loading="lazy" width="320" height="200">' if one.picture else ""
    return (
        f'<a class="lesson-card" href="{page}">{picture}<span class="lesson-number">{one.number}</span> '
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
