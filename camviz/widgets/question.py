"""Questions to commit to before seeing: `ask("05.far_rays")` and the exit quiz `quiz("05")`.

Live, the answer stays in the kernel until the reader has committed to a choice. Without a kernel, or with
CAMVIZ_STATIC=1, the same questions are a page of folded replies.
"""

from __future__ import annotations

import os
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import traitlets

from camviz import prose
from camviz.questions import Question, question, quiz_questions
from camviz.widgets.still import StillWidget

Tries = tuple[int, ...]
"""The choices a reader has committed to, in order; () before the first."""


@dataclass(frozen=True)
class Sheet:
    """Questions as a page: each choice can be opened to see its reply."""

    questions: tuple[Question, ...]
    title: str

    def __repr__(self) -> str:
        return "\n\n".join([self.title, *(_plain(one) for one in self.questions)])

    def unanswered(self) -> str:
        """The page without any reply, for a reader who has yet to choose."""
        questions = "".join(_unanswered(one) for one in self.questions)
        return f"<section><h4>{prose.inline(self.title)}</h4>{questions}<p>Run this cell to answer.</p></section>"

    def _repr_html_(self) -> str:
        return f"<section><h4>{prose.inline(self.title)}</h4>{''.join(_html(one) for one in self.questions)}</section>"


class QuestionWidget(StillWidget):
    """The live questions. Only what the reader may see is in `cards`; replies come when a choice has been made."""

    _esm = Path(__file__).with_name("question.js")
    _css = Path(__file__).with_name("question.css")

    title = traitlets.Unicode().tag(sync=True)
    cards: traitlets.List = traitlets.List().tag(sync=True)
    summary = traitlets.Unicode().tag(sync=True)
    problem = traitlets.Unicode().tag(sync=True)

    def __init__(self, sheet: Sheet) -> None:
        self.sheet = sheet
        self.tries: tuple[Tries, ...] = ((),) * len(sheet.questions)
        super().__init__(title=sheet.title, cards=_cards(sheet, self.tries))
        self.on_msg(self._receive)

    def commit(self, number: int, choice: int) -> None:
        """Commits to a choice of question `number`, both counted from 0. Raises ValueError when there is none such."""
        if number not in range(len(self.tries)) or choice not in range(len(self.sheet.questions[number].choices)):
            raise ValueError(f"there is no choice {choice!r} of question {number!r}")
        before = self.tries
        self.tries = (*before[:number], (*before[number], choice), *before[number + 1 :])
        self.cards = _cards(self.sheet, self.tries)
        self.summary = score(self.sheet.questions, self.tries)

    def __repr__(self) -> str:
        return repr(self.sheet)

    def still(self) -> dict[str, str]:
        """The questions without their replies, which would give the answers away."""
        return {"text/plain": repr(self.sheet), "text/html": self.sheet.unanswered()}

    def _receive(self, _widget: Any, message: Any, _buffers: Any) -> None:
        try:
            self.commit(message["question"], message["choice"])
        except Exception as error:
            self.problem = f"This went wrong in the kernel: {type(error).__name__}: {error}"
            raise


def ask(name: str) -> QuestionWidget | Sheet:
    """The question called "LESSON.ID", to be answered before going on. Raises ValueError when there is none."""
    return _shown(Sheet((question(name),), "Predict"))


def quiz(lesson: str) -> QuestionWidget | Sheet:
    """The exit quiz of a lesson ("05"), with a score. Raises ValueError when the lesson has none."""
    questions = quiz_questions(lesson)
    if not questions:
        raise ValueError(f"lesson {lesson!r} has no quiz")
    return _shown(Sheet(questions, "Exit quiz"))


def score(questions: tuple[Question, ...], tries: tuple[Tries, ...]) -> str:
    """What a quiz came to, counting first tries; "" until every question of at least two has been answered."""
    if len(questions) < 2 or not all(tries):
        return ""
    right = sum(made[0] == one.answer for one, made in zip(questions, tries, strict=True))
    return f"{right} of {len(questions)} right at the first try."


def _shown(sheet: Sheet) -> QuestionWidget | Sheet:
    return QuestionWidget(sheet) if _live() else sheet


def _live() -> bool:
    """True inside a Jupyter kernel that was not told to make static pages."""
    if os.environ.get("CAMVIZ_STATIC") == "1":
        return False
    from IPython.core.getipython import get_ipython

    return getattr(get_ipython(), "kernel", None) is not None


def _cards(sheet: Sheet, tries: tuple[Tries, ...]) -> list[dict[str, Any]]:
    return [_card(one, made) for one, made in zip(sheet.questions, tries, strict=True)]


def _card(one: Question, made: Tries) -> dict[str, Any]:
    """What the page may know of a question: its texts, and after a try the reply to the choice made."""
    shown = {"text": prose.to_html(one.text), "choices": [prose.inline(choice.text) for choice in one.choices]}
    if not made:
        return {**shown, "tries": 0, "chosen": None, "correct": None, "reply": ""}
    choice = one.choices[made[-1]]
    reply = prose.to_html(choice.reply)
    return {**shown, "tries": len(made), "chosen": made[-1], "correct": choice.correct, "reply": reply}


def _plain(one: Question) -> str:
    choices = [f"  ({chr(97 + i)}) {prose.to_plain(choice.text)}" for i, choice in enumerate(one.choices)]
    return "\n".join([prose.to_plain(one.text), *choices])


def _unanswered(one: Question) -> str:
    choices = "".join(f"<li>{prose.inline(choice.text)}</li>" for choice in one.choices)
    return f"<div>{prose.to_html(one.text)}<ul>{choices}</ul></div>"


def _html(one: Question) -> str:
    choices = "".join(
        f"<details><summary>{prose.inline(choice.text)}</summary>"
        f"<blockquote>{prose.to_html(_judged(choice.correct, choice.reply))}</blockquote></details>"
        for choice in one.choices
    )
    return f"<div>{prose.to_html(one.text)}{choices}</div>"


def _judged(correct: bool, reply: str) -> str:
    return f"*{'✓ Correct.' if correct else '✗ Not this one.'}* {reply.strip()}"
