"""What a teacher prints: the plan with the keys, the exercise sheet with the quiz, and how both are marked."""

from __future__ import annotations

from collections.abc import Sequence
from html import escape
from importlib.resources import files

from camviz.draw import prose
from camviz.draw.page import document
from camviz_school.course import questions
from camviz_school.course.checks import Exercise
from camviz_school.course.exercises import exercises
from camviz_school.course.notebooks import Notebook, exercise_cells, solution_code
from camviz_school.course.questions import Question
from camviz_school.teaching import markup, parts, plans
from camviz_school.teaching.edition import place
from camviz_school.teaching.marking import POINTS, RULE, WrongAnswer, example, wrong_answers
from camviz_school.teaching.numbering import Numbering
from camviz_school.teaching.slides import Slide

SPARE_LINES = 4
"""To write on, beyond as many as the solution has."""


def sheets(notebook: Notebook, lesson: str, slides: Sequence[Slide]) -> dict[str, str]:
    """The pages to print for a lesson ("05") with these slides, as HTML by the end of their file names."""
    plan = plans.plan(lesson)
    made = {"plan": plan_page(notebook, Numbering.of(plan, slides))} if plan else {}
    if exercises(lesson):
        made |= {"exercises": exercise_sheet(notebook, lesson), "marking": marking_scheme(notebook, lesson)}
    return made


def plan_page(notebook: Notebook, numbering: Numbering) -> str:
    """The plan by the minute, then the key to every question: all that a lesson needs when no screen works."""
    titles, plan = parts.titles(notebook), numbering.plan
    columns = (f"{plans.LONG} min", f"{plans.SHORT} min", "slides", "where", "you", "the class")
    head = "".join(f"<th>{title}</th>" for title in columns)
    rows = ""
    for long, short, step in plan.timetable():
        when = f"<td>{long}</td><td>{short}</td><td>{numbering.slides(step)}</td>"
        texts = "".join(f"<td>{prose.inline(' '.join(one.split()))}</td>" for one in (step.teacher, step.students))
        rows += f"<tr>{when}<td>{markup.inline(place(step, titles))}</td>{texts}</tr>"
    notes = "".join(f"<p><b>{title}.</b> {prose.inline(' '.join(text.split()))}</p>" for title, text in plan.cases)
    keys = "".join(question_key(one, plan.expected(one.name)) for one in _asked(notebook))
    body = (
        f"{notes}<table class='plan'><tr>{head}</tr>{rows}</table><p>{numbering.sentence}</p>"
        f"<h2 class='keys'>Questions and their keys</h2>{keys}"
    )
    return _page(notebook, "plan", body)


def question_key(question: Question, votes: plans.ExpectedVotes | None = None) -> str:
    """A question with, for each choice, whether it is right, how many are expected to choose it, and the reply."""
    rows = ""
    for number, (letter, choice) in enumerate(question.lettered):
        share = f"{votes.split[number]} %" if votes else ""
        thought = f"<br><em>{prose.inline(choice.misconception)}</em>" if choice.misconception else ""
        rows += (
            f"<tr><td>{'✓' if choice.correct else ''} ({letter})</td>"
            f"<td>{prose.inline(choice.text)}{thought}</td><td>{share}</td><td>{prose.to_html(choice.reply)}</td></tr>"
        )
    expected = "expected (a guess)" if votes and votes.guessed else "expected" if votes else ""
    head = f"<tr><th></th><th>choice, and the thought behind it</th><th>{expected}</th><th>reply</th></tr>"
    source = f"<p>Expected votes: {prose.inline(votes.source)}.</p>" if votes and not votes.guessed else ""
    text = prose.to_html(question.text)
    return f"<section class='key'>{text}<table>{head}{rows}</table>{source}</section>"


def exercise_sheet(notebook: Notebook, lesson: str) -> str:
    """Each exercise with its stub and lines to write on; then the exit quiz, to tick."""
    cells, tasks = exercise_cells(notebook), parts.tasks(notebook)
    body = "<p class='name'>Name <span></span> Date <span></span></p>"
    for name in exercises(lesson):
        stub, _, solution = cells[name]
        heading, task = tasks[name]
        lines = len(solution_code(solution).splitlines()) - len(stub.source.splitlines()) + SPARE_LINES
        body += (
            f"<section class='task'><h2>{markup.inline(heading)} <small>{POINTS} points</small></h2>{markup.html(task)}"
            f"<pre>{escape(_without_ellipsis(stub.source))}</pre>{'<div class=line></div>' * max(lines, SPARE_LINES)}"
            f"</section>"
        )
    quiz = "".join(_tick(number, one) for number, one in enumerate(questions.quiz_questions(lesson), start=1))
    return _page(notebook, "exercises", body + (f"<h2 class='quiz'>Exit quiz</h2>{quiz}" if quiz else ""))


def marking_scheme(notebook: Notebook, lesson: str) -> str:
    """Each exercise's solution, its points, and the typical wrong answers with the points they keep; the quiz's key."""
    cells, tasks = exercise_cells(notebook), parts.tasks(notebook)
    total = POINTS * len(exercises(lesson))
    quiz = questions.quiz_questions(lesson)
    body = f"<p>{escape(' '.join(RULE.split()))}</p><p>Exercises {total} points"
    body += f", exit quiz {len(quiz)}: {total + len(quiz)} in all.</p>" if quiz else ".</p>"
    for name, exercise in exercises(lesson).items():
        code = escape(solution_code(cells[name][2]))
        body += f"<section><h2>{markup.inline(tasks[name][0])} <small>{POINTS} points</small></h2><pre>{code}</pre>"
        body += f"{_wrong_answers(exercise)}</section>"
    keys = "".join(question_key(one) for one in quiz)
    body += f"<h2>Exit quiz <small>one point each, for the first choice</small></h2>{keys}" if quiz else ""
    return _page(notebook, "marking scheme", body)


def _wrong_answers(exercise: Exercise) -> str:
    found, case = wrong_answers(exercise), example(exercise)
    told = f"<p>{prose.inline(case[0])} gives <code>{escape(case[1])}</code>.</p>" if case else ""
    head = "<tr><th>keeps</th><th>wrong answer</th><th>what to say</th><th>gives</th></tr>"
    return f"{told}<table class='wrong'>{head}{''.join(map(_wrong_row, found))}</table>"


def _wrong_row(one: WrongAnswer) -> str:
    cells = (
        f"{one.keeps} of {POINTS}",
        escape(one.name),
        prose.inline(one.thought),
        f"<code>{escape(one.gives)}</code>",
    )
    return f"<tr>{''.join(f'<td>{cell}</td>' for cell in cells)}</tr>"


def _tick(number: int, question: Question) -> str:
    choices = "".join(f"<li>☐ ({letter}) {prose.inline(one.text)}</li>" for letter, one in question.lettered)
    text = prose.inline(" ".join(question.text.split()))
    return f"<section class='tick'><p><b>{number}.</b> {text}</p><ul>{choices}</ul></section>"


def _asked(notebook: Notebook) -> list[Question]:
    return [one for cell in notebook.cells for one in parts.asked(cell)]


def _without_ellipsis(stub: str) -> str:
    """A stub as far as it is given: the lines to write on follow."""
    return "\n".join(line for line in stub.splitlines() if not line.lstrip().startswith("..."))


def _page(notebook: Notebook, what: str, body: str) -> str:
    title = markup.plain(notebook.cells[0].source.splitlines()[0].lstrip("# "))
    layout = (files(__package__) / "sheets.css").read_text(encoding="utf-8")
    return document(f"{title}: {what}", body, layout=layout)
