"""Every exercise against the wrong functions that students write and the right ways that are published.

The counts are printed: python -m pytest -s tests/lessons/test_exercises.py
"""

import re

import numpy as np
import pytest

from camviz_school.course import notebooks
from camviz_school.course.checks import judge
from camviz_school.course.exercises import exercises
from camviz_school.course.material import lessons_folder
from camviz_school.course.trials import HINTS

ADVERSARIES = 8
HELD = [path.name[:2] for path in sorted(lessons_folder().glob("*.ipynb"))]
ALL = [one for number in HELD for one in exercises(number).values()]
EACH = pytest.mark.parametrize("one", ALL, ids=lambda one: one.name)
GAP = "___"


def solution_of(one):
    number = one.name.partition(".")[0]
    (path,) = lessons_folder().glob(f"{number}_*.ipynb")
    return notebooks.solutions(notebooks.read(path))[one.name]


def code_in(text):
    return [found[0] or found[1] for found in re.findall(r"``(.+?)``|`([^`]+)`", text)]


def squeezed(code):
    return re.sub(r"\s+", "", code)


@pytest.fixture
def seeds(thorough):
    return range(50 if thorough else 1)


@pytest.mark.parametrize("number", HELD)
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
    assert len(one.misconceptions) >= ADVERSARIES
    assert len({known.explanation for known in one.misconceptions}) == len(one.misconceptions)
    for seed in seeds:
        for known in one.misconceptions:
            answer = judge(one, known.function, np.random.default_rng(seed))
            assert answer.status == "wrong", f"{known.function.__name__} at seed {seed}: {answer!r}"
            assert answer.message == known.explanation, f"{known.function.__name__} at seed {seed}: {answer!r}"
    print(f"{one.name}: {len(one.misconceptions)} wrong functions × {len(seeds)} seeds, 0 accepted")


@EACH
def test_no_right_way_is_refused(one, seeds):
    assert one.right_ways
    ways = [one.reference, *one.right_ways]
    for seed in seeds:
        for way in ways:
            answer = judge(one, way, np.random.default_rng(seed))
            assert answer.correct, f"{way.__name__} at seed {seed}: {answer!r}"
    print(f"{one.name}: {len(ways)} right ways × {len(seeds)} seeds, 0 refused")


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


def test_the_counts():
    wrong = sum(len(one.misconceptions) for one in ALL)
    right = sum(1 + len(one.right_ways) for one in ALL)
    print(f"\n{len(ALL)} exercises, {wrong} wrong functions and {right} right ways")
    assert wrong >= ADVERSARIES * len(ALL)
