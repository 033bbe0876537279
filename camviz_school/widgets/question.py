"""Questions to commit to before seeing: `ask("05.far_rays")`, and the quiz in two forms.

`quiz("05", "A")` stands before a lesson, takes one choice a question and tells nothing. `quiz("05")`, form B, stands at
its end and replies to each choice. What is chosen is kept beside the notebook (camviz_school.course.answers). It is
there again when the cell is run again, after a restart and in a notebook that was closed; "Start again" clears it.

Live, the answer stays in the kernel until the reader has committed to a choice. Without a kernel, or with
CAMVIZ_STATIC=1, the same questions are a page of folded replies; of what is asked before a lesson, without any.
"""

from __future__ import annotations

import os
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import traitlets

from camviz.draw import prose
from camviz.widgets.still import StillWidget
from camviz_school.course.answers import KEPT_IN, AnswerBook, read_answers
from camviz_school.course.questions import Question, question, quiz_questions
from camviz_school.widgets.ballot import Ballot

Tries = tuple[int, ...]
"""The choices a reader has committed to, in order; () before the first."""


LEAD = "Choose what seems right to you today. What is right, you learn with the quiz at the end."
KEPT = "Kept. The answers come with the quiz at the end."


@dataclass(frozen=True)
class QuestionPage:
    """Questions as a page: each choice can be opened to see its reply.

    `when` is "before" or "after" a lesson, or "during" it for a predict question. What is asked before has no replies.
    """

    questions: tuple[Question, ...]
    title: str
    when: str = "during"

    @property
    def silent(self) -> bool:
        """True where nothing may be told."""
        return self.when == "before"

    @property
    def lead(self) -> str:
        """What to know before choosing, or ""."""
        return LEAD if self.silent else ""

    def __repr__(self) -> str:
        return "\n\n".join([self.title, *filter(None, [self.lead]), *(_plain(one) for one in self.questions)])

    def unanswered(self) -> str:
        """The page without any reply, for a reader who has yet to choose."""
        return self.so_far(((),) * len(self.questions))

    def so_far(self, tries: tuple[Tries, ...]) -> str:
        """The page with the last choice made at each question, and its reply."""
        made = dict(zip((one.name for one in self.questions), tries, strict=True))
        end = "change your answers" if any(tries) and not self.silent else "answer"
        return self._page(lambda one: _so_far(one, made[one.name], self.silent), f"<p>Run this cell to {end}.</p>")

    def _repr_html_(self) -> str:
        return self.unanswered() if self.silent else self._page(_html)

    def _page(self, show: Callable[[Question], str], end: str = "") -> str:
        head = f"<p><strong>{prose.inline(self.title)}</strong></p>{prose.to_html(self.lead)}"
        return f"<section>{head}{''.join(map(show, self.questions))}{end}</section>"


class QuestionWidget(StillWidget):
    """The live questions. Only what the reader may see is in `cards`; replies come when a choice has been made.

    What is chosen is kept in `book`, and shown again by the next widget; a quiz before a lesson takes no second choice.
    """

    _esm = Path(__file__).with_name("question.js")
    _css = Path(__file__).with_name("question.css")

    title = traitlets.Unicode().tag(sync=True)
    lead = traitlets.Unicode().tag(sync=True)
    cards: traitlets.List = traitlets.List().tag(sync=True)
    summary = traitlets.Unicode().tag(sync=True)
    looking_back = traitlets.Unicode().tag(sync=True)
    can_start_again = traitlets.Bool().tag(sync=True)
    can_export = traitlets.Bool().tag(sync=True)
    exported = traitlets.Unicode().tag(sync=True)
    problem = traitlets.Unicode().tag(sync=True)
    room = traitlets.Unicode().tag(sync=True)

    def __init__(self, sheet: QuestionPage, book: AnswerBook | None = None) -> None:
        self.sheet = sheet
        self.book = book
        self.tries: tuple[Tries, ...] = ((),) * len(sheet.questions)
        self._ballot = Ballot(sheet.questions[0].name, self._heard) if sheet.when == "during" else None
        super().__init__(title=sheet.title, lead=sheet.lead)
        self._kept(self._recall)
        self._earlier = [bool(made) for made in self.tries]
        self._show()
        self.on_msg(self._receive)

    def commit(self, number: int, choice: int) -> None:
        """Commits to a choice of question `number`, both counted from 0. Raises ValueError when there is none such."""
        if number not in range(len(self.tries)) or choice not in range(len(self.sheet.questions[number].choices)):
            raise ValueError(f"there is no choice {choice!r} of question {number!r}")
        before = self.tries
        if self.sheet.silent and before[number]:
            raise ValueError("this question takes one choice, and has it")
        self._kept(lambda book: book.keep(self.sheet.questions[number], self.sheet.when, choice))
        self.tries = (*before[:number], (*before[number], choice), *before[number + 1 :])
        self._earlier[number] = False
        if self._ballot:
            self._ballot.cast(choice)
        self._show()
        self.keep_now()

    def start_again(self) -> None:
        """Takes back all choices, but for those before a lesson, which are the first of two measurements."""
        if self.sheet.silent:
            raise ValueError("these questions take one choice")
        self._kept(lambda book: book.start_again(self.sheet.questions, self.sheet.when))
        self.tries = ((),) * len(self.tries)
        self._earlier = [False] * len(self.tries)
        self._show()
        self.keep_now()

    def export(self) -> None:
        """Writes the answers to a file for the teacher, and says where it is and what is in it."""
        self._kept(self._export)

    def __repr__(self) -> str:
        return repr(self.sheet)

    def still(self) -> dict[str, str]:
        """The questions with what was chosen, and without any other reply, which would give the answers away."""
        html = self.sheet.unanswered() if self._voting else self.sheet.so_far(self.tries)
        return {"text/plain": repr(self.sheet), "text/html": html}

    @property
    def _voting(self) -> bool:
        """Whether the reply waits until the class's teacher shows it."""
        return self._ballot is not None and self._ballot.news.waiting

    def _heard(self) -> None:
        """There is news from the class's room."""
        if self._ballot and self._ballot.news.again:
            self.tries = ((),) * len(self.tries)
        self._show()
        self.keep_now()

    def _show(self) -> None:
        cards = zip(self.sheet.questions, self.tries, self._earlier, strict=True)
        with self.hold_sync():  # one message: a reply is never seen without what belongs to it
            self.cards = [_card(one, made, earlier, self.sheet.silent, self._voting) for one, made, earlier in cards]
            self.can_start_again = any(self.tries) and not self.sheet.silent and not self._voting
            self.room = self._ballot.news.said if self._ballot else ""
            self.summary = "" if self.sheet.silent else score(self.sheet.questions, self.tries)
            self._kept(self._account)

    def _recall(self, book: AnswerBook) -> None:
        """What was chosen before, in another run of the cell or another kernel."""
        self.tries = tuple(book.chosen(one, self.sheet.when) for one in self.sheet.questions)

    def _account(self, book: AnswerBook) -> None:
        """Once all is kept: where it is or, after the lesson, what was thought before it."""
        complete = all(book.chosen(one, self.sheet.when) for one in self.sheet.questions)
        if not self.sheet.questions[0].form or (self.sheet.silent and not complete):
            return
        if self.sheet.silent:
            code = book.participant(self._lesson)
            self.summary = f"Kept in {KEPT_IN} beside this notebook, under the random code {code} and without a name."
        else:
            self.can_export = complete
            self.looking_back = looking_back(book, self._lesson) if complete else ""

    def _export(self, book: AnswerBook) -> None:
        path = book.export(self._lesson)
        count = len(read_answers(path))
        self.exported = f"Written to {path.name}, beside this notebook: {count} choices, a random code, no name."

    @property
    def _lesson(self) -> str:
        return self.sheet.questions[0].name.partition(".")[0]

    def _kept(self, what: Callable[[AnswerBook], object]) -> None:
        """Does something with the book, if there is one; what goes wrong with its file is said, and stops nothing."""
        if self.book is None:
            return
        try:
            what(self.book)
        except (OSError, ValueError) as error:
            self.problem = f"Your choices cannot be kept in {self.book.path}: {error}"

    def _receive(self, _widget: Any, message: Any, _buffers: Any) -> None:
        try:
            if message == {"export": True}:
                self.export()
            elif message == {"again": True}:
                self.start_again()
            else:
                self.commit(message["question"], message["choice"])
        except Exception as error:
            self.problem = f"This went wrong in the kernel: {type(error).__name__}: {error}"
            raise


def ask(name: str) -> QuestionWidget | QuestionPage:
    """A question to be answered before going on.

    Args:
        name: "LESSON.ID".

    Returns: Live in a notebook; a page of folded replies elsewhere.
    Raises: ValueError where there is no such question.

    >>> print(str(ask("05.far_rays")).splitlines()[0])
    Predict
    """
    return _shown(QuestionPage((question(name),), "Predict"))


def quiz(lesson: str, form: str = "B", when: str = "") -> QuestionWidget | QuestionPage:
    """A form of a lesson's quiz: A before it, without replies, B after it, with replies and a score.

    Args:
        lesson: Its two digits.
        form: {"B", "A"}, which form.
        when: {"", "before", "after"}, asks a form at the other end: half of a class can so answer B first and A last.

    Returns: Live in a notebook; a page elsewhere, with folded replies where they may be seen.
    Raises: ValueError where the lesson has no such form, and for another `when`.

    >>> quiz("05", "A").silent, quiz("05").silent  # before the lesson nothing is told
    (True, False)
    """
    if when not in ("", "before", "after"):
        raise ValueError(f'when must be "before" or "after", got {when!r}')
    questions = quiz_questions(lesson, form)
    if not questions:
        raise ValueError(f"lesson {lesson!r} has no quiz" if form == "B" else f"the quiz of {lesson!r} has no {form!r}")
    when = when or ("before" if form == "A" else "after")
    return _shown(QuestionPage(questions, "What do you think now?" if when == "before" else "Exit quiz", when))


def score(questions: tuple[Question, ...], tries: tuple[Tries, ...]) -> str:
    """What a quiz came to, counting first tries; "" until every question of at least two has been answered."""
    if len(questions) < 2 or not all(tries):
        return ""
    right = sum(made[0] == one.answer for one, made in zip(questions, tries, strict=True))
    return f"{right} of {len(questions)} right at the first try."


def looking_back(book: AnswerBook, lesson: str) -> str:
    """What a reader thought before the lesson, with the replies, as folded HTML; "" where nothing was chosen then."""
    forms = [quiz_questions(lesson, form) for form in ("A", "B")]
    made = [(one, book.chosen(one, "before")) for form in forms for one in form]
    chosen = [(one, choices[0]) for one, choices in made if choices]
    if not chosen:
        return ""
    right = sum(one.answer == choice for one, choice in chosen)
    summary = f"Before the lesson: {right} of {len(chosen)} right. What you chose then, and the answers"
    return f"<details><summary>{summary}</summary>{''.join(_then(*pair) for pair in chosen)}</details>"


def _shown(sheet: QuestionPage) -> QuestionWidget | QuestionPage:
    return QuestionWidget(sheet, AnswerBook(Path.cwd())) if _live() else sheet


def _live() -> bool:
    """True inside a Jupyter kernel that was not told to make static pages."""
    if os.environ.get("CAMVIZ_STATIC") == "1":
        return False
    from IPython.core.getipython import get_ipython

    return getattr(get_ipython(), "kernel", None) is not None


def _card(one: Question, made: Tries, earlier: bool, silent: bool, voting: bool = False) -> dict[str, Any]:
    """What the page may know of a question: its texts, and after a try, unless silent, the reply to the choice made.

    While the class is `voting` on it there is no reply, and the choice can be changed.
    """
    choices = [prose.inline(choice.text) for choice in one.choices]
    shown = {"text": prose.to_html(one.text), "choices": choices, "tries": len(made), "earlier": earlier}
    shown["voting"] = voting
    if not made or voting:
        return {**shown, "chosen": made[-1] if made else None, "correct": None, "reply": ""}
    if silent:
        return {**shown, "chosen": made[0], "correct": None, "reply": prose.to_html(KEPT)}
    choice = one.choices[made[-1]]
    return {**shown, "chosen": made[-1], "correct": choice.correct, "reply": prose.to_html(choice.reply)}


def _plain(one: Question) -> str:
    choices = [f"  ({chr(97 + i)}) {prose.to_plain(choice.text)}" for i, choice in enumerate(one.choices)]
    return "\n".join([prose.to_plain(one.text), *choices])


def _so_far(one: Question, made: Tries, silent: bool) -> str:
    choices = [prose.inline(choice.text) for choice in one.choices]
    reply = ""
    if made:
        choice = one.choices[made[-1]]
        choices[made[-1]] = f"<strong>{choices[made[-1]]}</strong> (your answer)"
        reply = f"<blockquote>{prose.to_html(KEPT if silent else _judged(choice.correct, choice.reply))}</blockquote>"
    return f"<div>{prose.to_html(one.text)}<ul>{''.join(f'<li>{text}</li>' for text in choices)}</ul>{reply}</div>"


def _html(one: Question) -> str:
    choices = "".join(
        f"<details><summary>{prose.inline(choice.text)}</summary>"
        f"<blockquote>{prose.to_html(_judged(choice.correct, choice.reply))}</blockquote></details>"
        for choice in one.choices
    )
    return f"<div>{prose.to_html(one.text)}{choices}</div>"


def _then(one: Question, chosen: int) -> str:
    """A question of before the lesson: what was chosen and, where that was wrong, the answer, each with its reply."""
    shown = {chosen: "You chose:", one.answer: "You chose the answer:" if chosen == one.answer else "The answer:"}
    replies = "".join(
        f"<p><em>{says}</em> {prose.inline(one.choices[index].text)}</p>"
        f"<blockquote>{prose.to_html(one.choices[index].reply)}</blockquote>"
        for index, says in shown.items()
    )
    return f"<div>{prose.to_html(one.text)}{replies}</div>"


def _judged(correct: bool, reply: str) -> str:
    return f"*{'✓ Correct.' if correct else '✗ Not this one.'}* {reply.strip()}"
