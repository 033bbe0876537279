"""Every exercise against the wrong functions that students write and the right ways that are published."""

import re
from functools import cache

import numpy as np
import pytest

from camviz_school.course import notebooks
from camviz_school.course.checks import judge
from camviz_school.course.exercises import exercises
from camviz_school.course.material import lessons_folder
from camviz_school.course.trials import HINTS

NUMBERS = [path.name[:2] for path in sorted(lessons_folder().glob("*.ipynb"))]
ALL = [one for number in NUMBERS for one in exercises(number).values()]
EACH = pytest.mark.parametrize("one", ALL, ids=lambda one: one.name)
GAP = "___"


@cache
def lesson(number):
    """The solutions of a lesson, and what its cells define for them."""
    (path,) = lessons_folder().glob(f"{number}_*.ipynb")
    notebook = notebooks.read(path)
    solutions, namespace = notebooks.solutions(notebook), {"np": np, "__name__": "lesson"}
    for cell in notebook.cells:
        if "build" in cell.metadata.get("tags", []):
            exec(cell.source, namespace)
        elif "stub" in cell.metadata.get("tags", []):
            exec(solutions[notebooks.exercise_of(cell)], namespace)
    return solutions, namespace


def solution_of(one):
    """The code of the folded solution in the exercise's notebook."""
    return lesson(one.name.partition(".")[0])[0][one.name]


def function_of(one, source):
    """The exercise's function as some code defines it, among what the lesson defines for it."""
    number, _, name = one.name.partition(".")
    namespace = dict(lesson(number)[1])
    exec(source, namespace)
    return namespace[name]


def code_in(text):
    return [found[0] or found[1] for found in re.findall(r"``(.+?)``|`([^`]+)`", text)]


def squeezed(code):
    return re.sub(r"\s+", "", code)


@pytest.fixture
def seeds(thorough):
    return range(50 if thorough else 1)


@pytest.mark.parametrize("number", NUMBERS)
def test_exercises_are_numbered_as_they_stand_on_the_sheet(number):
    (path,) = lessons_folder().glob(f"{number}_*.ipynb")
    cells = notebooks.read(path).cells
    stubs = [notebooks.exercise_of(cell) for cell in cells if "stub" in cell.metadata.get("tags", [])]
    assert stubs == list(exercises(number))
    numbers = re.findall(r"(?m)^###+ Exercise (\d+):", "\n".join(cell.source for cell in cells))
    assert [int(one) for one in numbers] == list(range(1, len(numbers) + 1))


@pytest.mark.sampled(40)
@EACH
def test_no_wrong_function_is_accepted_and_each_is_answered_by_its_own_reply(one, seeds):
    assert len({known.explanation for known in one.misconceptions}) == len(one.misconceptions)
    for seed in seeds:
        for known in one.misconceptions:
            answer = judge(one, known.function, np.random.default_rng(seed))
            assert answer.status == "wrong", f"{known.function.__name__} at seed {seed}: {answer!r}"
            assert answer.message == known.explanation, f"{known.function.__name__} at seed {seed}: {answer!r}"


@EACH
def test_no_right_way_is_refused(one, seeds):
    for seed in seeds:
        for way in (one.reference, *one.right_ways):
            answer = judge(one, way, np.random.default_rng(seed))
            assert answer.correct, f"{way.__name__} at seed {seed}: {answer!r}"


@pytest.mark.parametrize("one", [one for one in ALL if one.conventions], ids=lambda one: one.name)
def test_an_answer_by_another_convention_is_accepted_and_told_which(one, seeds):
    for seed in seeds:
        for known in one.conventions:
            answer = judge(one, known.function, np.random.default_rng(seed))
            assert answer.correct
            assert answer.message == known.explanation


@pytest.mark.parametrize("one", [one for one in ALL if one.bug], ids=lambda one: one.name)
def test_the_function_given_to_be_mended_is_not_tried_yet_and_gives_nothing_away(one, seeds):
    for seed in seeds:
        answer = judge(one, one.as_given, np.random.default_rng(seed))
        assert answer.status == "unsolved"
        assert answer.hint == ""


@EACH
def test_three_hints_lead_on_and_only_the_last_shows_the_solution_s_line_with_a_gap(one):
    assert len(one.hints) == HINTS
    lines = [line.strip() for line in solution_of(one).splitlines() if line.strip()]
    for hint in one.hints[:-1]:
        shown = [code for code in code_in(hint) if squeezed(code) in map(squeezed, lines)]
        assert not shown, f"an early hint shows a whole line of the solution: {shown}"
        assert GAP not in hint
    gapped = [code for code in code_in(one.hints[-1]) if GAP in code]
    assert gapped, "the last hint shows the line with a gap, written ___"
    for code in gapped:
        pattern = ".+".join(re.escape(squeezed(part)) for part in code.split(GAP))
        found = [line for line in lines if re.fullmatch(pattern, squeezed(line))]
        assert found, f"no line of the solution is {code!r} with the gap filled"
        assert code.count(GAP) <= 3


@EACH
def test_the_notebook_gives_what_the_exercise_says_it_gives(one):
    number = one.name.partition(".")[0]
    (path,) = lessons_folder().glob(f"{number}_*.ipynb")
    notebook = notebooks.read(path)
    stub, check, _ = notebooks.exercise_cells(notebook)[one.name]
    saved = "".join(str(output.get("data", {}).get("text/plain", "")) for output in check.outputs)
    assert saved.startswith("○ Not tried yet.")
    assert not any(known.explanation[:40] in saved for known in one.misconceptions)
    if one.as_given is not None:
        namespace = {"np": np}
        for cell in notebooks.tagged(notebook, "build"):  # what the lesson built before, the stub may call
            exec(cell.source, namespace)
        exec(stub.source, namespace)
        given = namespace[one.name.partition(".")[2]]
        assert judge(one, given, np.random.default_rng(1)).status == "unsolved"
