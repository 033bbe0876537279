"""A lesson's minutes by one rule, and the pattern of a lesson that has a core and goes deeper."""

import ast
import builtins
import re
from copy import deepcopy
from pathlib import Path

import matplotlib.pyplot as plt
import nbformat
import pytest
from IPython.display import display
from test_lessons import replace

from camviz_school.course import core_rules, minutes, notebooks
from camviz_school.teaching import plans

LESSONS = Path(__file__).parents[1] / "lessons"
EVERY = {path.name[:2]: notebooks.read(path) for path in sorted(LESSONS.glob("*.ipynb"))}
LAYERED = [number for number, lesson in EVERY.items() if minutes.is_layered(lesson)]


def text(source, *tags):
    return nbformat.v4.new_markdown_cell(source, metadata={"tags": list(tags)})


def code(source, *tags, **metadata):
    return nbformat.v4.new_code_cell(source, metadata={"tags": list(tags), **metadata})


SOLUTION = """<details><summary>Solution</summary>

```python
def double(x):
    \"\"\"Twice.\"\"\"
    y = x
    return 2 * y
```
</details>"""


# The rule -------------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("cells", "expected"),
    [
        ([text("word " * 200)], 1),  # a minute for 200 words
        ([text("word " * 100 + "<details>" + "word " * 500 + "</details>")], 0.5),  # what is folded is not reckoned
        ([text("$$x = 1$$")], 0.5),
        ([text("$x = 1$ $y$")], 0.2),
        ([code("a = 1\n\n# a remark\nb = 2")], 2 / 8),  # blank lines and remarks are none
        ([code("a = 1\n" * 8, "setup"), code("a = 1\n" * 8, "colab")], 0),
        ([code('explore(view, "k1", "show")')], 1 / 8 + 2 * 0.5),
        ([code('explore(view, "k1", k2=(0, 1), together=("k1", "k2"))')], 1 / 8 + 2 * 0.5),
        ([code("explore(view)")], 1 / 8 + 4 * 0.5),
        ([code('ask("05.grid")')], 2),
        ([code("ward = Ward(16)\nward[1]"), code("ward[2]"), text("ward[3]")], 3 / 8 + 2 * 4 + 1 / 200),  # patients
        ([code('quiz("05", "A")')], 4 * 1),
        ([code('quiz("05")')], 4 * 1.5),
        ([code("def double(x): ...", "stub", camviz={"exercise": "05.double"}), text(SOLUTION, "solution")], 5 + 2),
    ],
)
def test_each_part_costs_what_the_rule_says(cells, expected):
    assert minutes.reckoned(cells) == pytest.approx(expected)
    filled = [text("word " * 1000), *cells]
    assert minutes.reckoned(filled) == pytest.approx(5 + expected)  # parts add up


def test_minutes_are_said_to_five():
    assert [minutes.said(one) for one in (47.4, 47.6, 52.4, 52.6)] == [45, 50, 50, 55]


def test_a_lesson_ends_its_core_where_it_goes_deeper():
    lesson = nbformat.v4.new_notebook(
        cells=[
            text("# 05"),
            text("## Going deeper\n\nAny order."),
            text("### One\n\n#### Of it"),
            code("1"),
            text("### Two"),
        ]
    )
    assert minutes.is_layered(lesson)
    assert [cell.source for cell in minutes.core(lesson)] == ["# 05"]
    assert [(one.title, len(one.cells)) for one in minutes.sections(lesson)] == [("One", 2), ("Two", 1)]
    lesson.cells[1].source = "## Recap"
    assert not minutes.is_layered(lesson)
    assert (len(minutes.core(lesson)), minutes.sections(lesson)) == (5, [])


# What every divided lesson holds to -----------------------------------------------------------------------------------


def test_lesson_05_is_divided():
    assert "05" in LAYERED
    assert [one.title for one in minutes.sections(EVERY["05"])] == [
        "Deeper: the map of a whole photograph",
        "Deeper: taking a point back",
        "Deeper: the smaller terms, and a bug",
    ]


@pytest.mark.parametrize("number", LAYERED)
def test_a_divided_lesson_follows_the_pattern(number):
    assert core_rules.complaints(EVERY[number], number) == []


@pytest.mark.parametrize("number", LAYERED)
def test_what_stands_below_the_core_is_in_a_deeper_section(number):
    """The site folds these sections; a heading of their rank would end the one above it."""
    cells = EVERY[number].cells[len(minutes.core(EVERY[number])) :]
    text = "\n\n".join(cell.source for cell in cells if cell.cell_type == "markdown")
    first, *others = re.findall(r"^#{1,3} .*", text, re.MULTILINE)
    assert first == "## Going deeper"
    assert [heading for heading in others if not heading.startswith("### Deeper: ")] == []


def code_of(cells):
    """The code of cells as Python reads it, without `%magic` lines."""
    sources = [cell.source for cell in cells if cell.cell_type == "code"]
    return ast.parse("\n".join(re.sub(r"^\s*%.*$", "", source, flags=re.MULTILINE) for source in sources))


def named(tree):
    """The names that code gives to anything, and those that it uses."""
    nodes, given = list(ast.walk(tree)), set()
    for node in nodes:
        if isinstance(node, ast.alias):
            given.add((node.asname or node.name).partition(".")[0])
        elif isinstance(node, ast.FunctionDef | ast.ClassDef | ast.ExceptHandler):
            given.add(node.name)
        elif isinstance(node, ast.arg):
            given.add(node.arg)
    names = [node for node in nodes if isinstance(node, ast.Name)]
    used = {name.id for name in names if isinstance(name.ctx, ast.Load)}
    return given | {name.id for name in names if not isinstance(name.ctx, ast.Load)}, used


@pytest.mark.parametrize("number", LAYERED)
def test_a_deeper_section_uses_no_name_that_only_another_one_gives(number):
    lesson = EVERY[number]
    known = named(code_of(minutes.core(lesson)))[0] | set(dir(builtins)) | {"display", "get_ipython"}
    for section in minutes.sections(lesson):
        given, used = named(code_of(section.cells))
        assert used - given - known == set(), section.title


OFTEN = ("05", "07")  # the others with --all: each runs its lesson's core once more


@pytest.mark.parametrize(
    "number", [one if one in OFTEN else pytest.param(one, marks=pytest.mark.thorough) for one in LAYERED]
)
def test_each_deeper_section_runs_after_the_core_without_the_others(number, monkeypatch):
    """With the solutions of the core and of the section alone."""
    monkeypatch.chdir(LESSONS)
    monkeypatch.setenv("CAMVIZ_STATIC", "1")
    lesson, solved = EVERY[number], notebooks.solutions(EVERY[number])

    def run(cells, namespace):
        for cell in cells:
            tags = set(cell.metadata.get("tags", []))
            if cell.cell_type == "code" and not tags & {"check", "colab"}:
                exec(solved[notebooks.exercise_of(cell)] if "stub" in tags else cell.source, namespace)
                plt.close("all")  # as a notebook does after each cell
        return namespace

    core = run(minutes.core(lesson), {"__name__": "__main__", "display": display})  # a notebook has that name, too
    for section in minutes.sections(lesson):
        run(section.cells, dict(core))


@pytest.mark.parametrize("number", LAYERED)
def test_the_plan_for_90_minutes_has_time_for_all_of_the_core(number):
    """No exercise is left for home: each step gets as long as one student needs for it, at least."""
    plan, core = plans.plan(number), minutes.core(EVERY[number])
    times = {step.at: step.minutes[0] for step in plan.steps}
    for name in minutes.stubs(core):
        stub, _, solution = notebooks.exercise_cells(EVERY[number])[name]
        assert times[f"exercise {name.partition('.')[2]}"] >= minutes.reckoned([stub, solution])
    asked = [cell.source.split(".")[1].rstrip('")') for cell in core if cell.source.startswith("ask(")]
    assert all(times[f"question {name}"] >= minutes.MINUTES_A_PREDICTION for name in asked)
    assert sum(times.values()) >= minutes.reckoned(core)


# Each departure -------------------------------------------------------------------------------------------------------


def cell_of(lesson, start):
    return next(cell for cell in lesson.cells if cell.source.startswith(start))


def longer(count):
    def change(lesson):
        core = minutes.core(lesson)
        cell_of(lesson, "## 2").source += "\n\n" + "word " * (count - minutes.words(core))

    return change


def more_lines(count):
    def change(lesson):
        given = minutes.given_lines(minutes.core(lesson))
        cell_of(lesson, "x, y =").source += "\nx = 1" * (count - given)

    return change


def without(start):
    def change(lesson):
        lesson.cells.remove(cell_of(lesson, start))

    return change


def later(start, by):
    def change(lesson):
        cell = cell_of(lesson, start)
        at = lesson.cells.index(cell)
        lesson.cells.remove(cell)
        lesson.cells.insert(at + by, cell)

    return change


def three_panels(lesson):
    view = cell_of(lesson, "fold = explore(")
    view.outputs[-1].data["text/html"] = "<img alt='' src='data:'>" * 3


@pytest.mark.parametrize(
    ("change", "complaint"),
    [
        (longer(1301), "the core has 1301 words, more than 1300"),
        (more_lines(61), "the core gives 61 lines of code, more than 60"),
        (replace("straightening runs forwards.", "one · two."), "names more than 3 ideas"),
        (replace("**Ideas:**", "Ideas:"), "must name the ideas"),
        (later("from camviz.views.distortion", 1), "at most 2 cells may stand above the first view, 3 do"),
        (replace("<details><summary>About", "<p>About"), "must say, folded, what the lesson is about"),
        (later("import numpy as np\n\nfrom camviz.widgets", 1), "the setup cell must stand, folded"),
        (later('quiz("05", "A")', -4), 'quiz("05", "A") must stand below the first view'),
        (later('ask("05.grid")', -1), 'ask("05.grid") must be followed by its view within 2 cells'),
        (replace('"hide_fold", k1=', '"hide_fold", "show", k1='), "the first view of a section has 1 to 2 controls"),
        (three_panels, "the first view of a section has at most 2 panels, not 3"),
        (later('quiz("05")', 1), "the core must end with the quiz and the recap"),
        (replace("*About 15 minutes. Asks for: sections 1 and 2", "*About 20 minutes. Asks for: 1"), "say *About 15"),
        (replace("Asks for: sections 1 and 3, and", "It needs"), "Deeper: the map of a whole photograph' must say"),
        (without("def fold_radius"), "the core has 1 exercises, not 2 or 3"),
    ],
)  # fmt: skip
def test_each_departure_from_the_pattern_of_a_core_is_named(change, complaint):
    lesson = deepcopy(EVERY["05"])
    change(lesson)
    found = core_rules.complaints(lesson, "05")
    assert any(complaint in one for one in found), found


def test_the_key_of_a_panel_is_no_panel():
    lesson = deepcopy(EVERY["05"])
    view = cell_of(lesson, "fold = explore(")
    view.outputs[-1].data["text/html"] = "<img alt='' src=''>" * 2 + '<img alt="key" src="">'
    assert not any("panels" in one for one in core_rules.complaints(lesson, "05"))


@pytest.mark.parametrize("change", [longer(1300), more_lines(60)])
def test_what_is_just_allowed_is_not_complained_of(change):
    lesson = deepcopy(EVERY["05"])
    change(lesson)
    assert not any("more than" in one for one in core_rules.complaints(lesson, "05"))


def test_a_core_of_40_or_65_minutes_and_a_section_of_10_are_complained_of():
    for count, words in ((40, "takes 40 minutes, not 45 to 60"), (65, "takes 65 minutes, not 45 to 60")):
        lesson = deepcopy(EVERY["05"])
        now = minutes.reckoned(minutes.core(lesson))
        if count < now:  # a prediction takes two, an exit quiz six
            lesson.cells = [cell for cell in lesson.cells if not cell.source.startswith("ask(")]
            cell_of(lesson, "## 2").source = "## 2"
            lesson.cells.remove(cell_of(lesson, "fold = explore("))
        else:
            cell_of(lesson, "## 2").source += " $x$" * round(10 * (count - now))
        assert any(words in one for one in core_rules.complaints(lesson, "05")), count
    lesson = deepcopy(EVERY["05"])
    section = minutes.sections(lesson)[0]
    lesson.cells = [one for one in lesson.cells if one not in section.cells[4:]]
    assert any("takes 10 minutes, not 15 to 25" in one for one in core_rules.complaints(lesson, "05"))
