"""Plans by the minute: they add up, they stand at places that their lesson has, and a wrong one is refused in words."""

import re
from itertools import chain, pairwise
from pathlib import Path

import pytest
from every_view import classes

from camviz_school.course import notebooks
from camviz_school.course.material import material
from camviz_school.teaching import markup, plans

LESSONS = {path.name[:2]: path for path in sorted((Path(__file__).parents[1] / "lessons").glob("*.ipynb"))}
PLANNED = sorted(path.parent.name for path in material().glob("*/plan.toml"))
EACH = pytest.mark.parametrize("number", PLANNED)

PLAN = """
bring = "A ruler."
network = "Use the slides."
machine = "Share one."
[[step]]
at = "header"
minutes = [60, 45]
teacher = "Ask the question."
students = "They guess."
[[step]]
at = "question grid"
minutes = [30, 0]
teacher = "Let them vote."
students = "They vote."
[[votes]]
question = "grid"
split = [50, 30, 20, 0]
source = "a guess"
"""


@EACH
def test_a_plan_and_its_lesson_agree(number):
    assert plans.complaints(plans.plan(number), notebooks.read(LESSONS[number])) == []


@EACH
def test_minutes_add_up_and_nobody_is_left_alone_when_something_fails(number):
    """Read here from the plan's own steps, not from the total that the reader holds."""
    made = plans.plan(number)
    for length in (90, 45):
        times = made.times(length)
        assert times[0][0] == 0
        assert times[-1][1] == length
        assert all(before[1] == after[0] for before, after in pairwise(times))
    assert min(len(made.network.split()), len(made.machine.split())) > 10


def test_a_plan_knows_its_times_and_its_votes():
    made = plans.parse("05", PLAN)
    assert [(a, b, step.at) for a, b, step in made.times(90)] == [(0, 60, "header"), (60, 90, "question grid")]
    assert [(a, b, step.at) for a, b, step in made.times(45)] == [(0, 45, "header")]
    assert made.expected("05.grid").guessed
    assert made.expected("05.far_rays") is None


def test_a_lesson_without_a_plan_has_none():
    assert plans.plan("99") is None
    assert plans.plan("../05") is None


@pytest.mark.parametrize(
    ("old", "new", "complaint"),
    [
        ("[60, 45]", "[50, 45]", "the plan for 90 minutes adds up to 80"),
        ("[60, 45]", "[60, 44]", "the plan for 45 minutes adds up to 44"),
        ("[60, 45]", "[60, 45, 1]", "step 1: minutes must be two whole numbers"),
        ("[60, 45]", "[60.5, 45]", "step 1: minutes must be two whole numbers"),
        ("[30, 0]", "[0, 0]", "step 2: minutes are 0 in both"),
        ('"header"', '"heading"', "step 1: at must be"),
        ('"header"', '"header 1"', "step 1: at must be"),
        ('"question grid"', '"question"', "step 2: at must be"),
        ("They vote.", " ", "has one to 3 sentences"),
        ("They vote.", "They vote. They talk. They vote. They read.", "has one to 3 sentences"),
        ("They vote.", "They vote " + "and vote " * 18, "at most 35 words"),
        ("students", "class", "knows at, minutes, teacher, students, got class"),
        ('network = "Use the slides."\n', "", "network must be given as str"),
        ("Use the slides.", " ", "network must say something"),
        ("[50, 30, 20, 0]", "[50, 30, 10, 0]", "votes 1: split must be whole percents that add up to 100"),
        ('"a guess"', '""', "source must name a publication"),
        ("[[step]]", "[step]", "is not TOML"),
        ("bring =", "bring", "is not TOML"),
    ],
)  # fmt: skip
def test_a_wrong_plan_is_refused_in_one_sentence(old, new, complaint):
    assert old in PLAN
    with pytest.raises(ValueError) as refused:
        plans.parse("05", PLAN.replace(old, new))
    assert complaint in str(refused.value)
    assert "lesson 05" in str(refused.value)
    assert "\n" not in str(refused.value)


@pytest.mark.parametrize(
    ("old", "new", "complaint"),
    [
        ('"header"', '"section 99"', "no such section"),
        ('"header"', '"exercise dance"', "no such exercise"),
        ('"question grid"', '"question quiz_fold"', "no such question"),
        ('"question grid"', '"quiz"', "never asks the predict question grid"),
        ('question = "grid"', 'question = "grill"', "no such predict question"),
        ('question = "grid"', 'question = "far_rays"', "expects no votes for grid"),
        ("[50, 30, 20, 0]", "[50, 50]", "in 2, it has 4 choices"),
    ],
)
def test_what_a_lesson_does_not_have_is_named(old, new, complaint):
    assert old in PLAN
    found = plans.complaints(plans.parse("05", PLAN.replace(old, new)), notebooks.read(LESSONS["05"]))
    assert any(complaint in one for one in found), found


# What a teacher can take in -------------------------------------------------------------------------------------------


def said(plan):
    texts = [plan.bring, plan.network, plan.machine, *(one.text for one in plan.notice)]
    return [*texts, *(text for step in plan.steps for text in (step.teacher, step.students))]


def names_of_controls():
    """The names of all fields of all views that something else stands on, `hide_fold` for "hide what folds"."""
    controls = chain.from_iterable(view.controls().items() for view in classes().values())
    return {name for name, control in controls if name != control.label and "_" in name}


@EACH
def test_a_plan_calls_controls_what_stands_on_them(number):
    """Underscores are left to code and to formulas (r_d, r_left)."""
    names = names_of_controls()
    assert {"hide_fold", "focal_mm", "spots_px"} <= names
    words = re.findall(r"\w+", " ".join(re.sub(r"`[^`]*`", "", text) for text in said(plans.plan(number))))
    assert names & set(words) == set()
    assert {one for one in words if "_" in one} <= {"r_d", "r_left", "r_right", "X_cam", "K_new"}


@EACH
def test_the_first_minutes_hold_one_thing(number):
    """The class meets the lesson's question: two sentences of the teacher's, and one thing for the class to do."""
    first = plans.plan(number).steps[0]
    assert first.at == "header"
    assert len(markup.sentences(first.teacher)) <= 2
    assert len(first.teacher.split()) <= 30
    assert len(markup.sentences(first.students)) == 1
    assert len(first.students.split()) <= 12
    assert "," not in first.students
