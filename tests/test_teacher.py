"""What a teacher gets: keys beside the questions, solutions in place, outputs, sheets and a marking scheme."""

import re
from functools import cache
from itertools import chain
from pathlib import Path

import nbformat
import numpy as np
import pytest

from camviz.draw import prose
from camviz_clinic.commands.command import main
from camviz_school.commands import teacher
from camviz_school.course import notebooks, questions
from camviz_school.course.checks import Exercise
from camviz_school.course.exercises import exercises
from camviz_school.course.material import module
from camviz_school.course.minutes import is_layered
from camviz_school.teaching import deck, edition, marking, markup, numbering, one_page, panels, parts, plans, sheets

lesson05 = module("05")

ROOT = Path(__file__).parents[1]
LESSONS = sorted((ROOT / "lessons").glob("*.ipynb"))
EACH = pytest.mark.parametrize("path", LESSONS, ids=lambda path: path.stem)
DISTORTION = next(path for path in LESSONS if path.name.startswith("05"))


@cache
def made(path):
    """A lesson's teacher's edition, not to be changed."""
    return edition.teacher_edition(notebooks.read(path))


@cache
def planned(path):
    """A lesson's slides, not to be changed."""
    return deck.planned_slides(notebooks.read(path))


def numbers(path):
    return numbering.Numbering.of(plans.plan(path.name[:2]), planned(path))


def cell(source, **output):
    one = nbformat.v4.new_code_cell(source)
    one.outputs = [nbformat.v4.new_output("display_data", data=output)] if output else []
    return one


# The edition ---------------------------------------------------------------------------------------------------------


@pytest.mark.sampled(4)
@EACH
def test_every_question_is_followed_by_its_key(path):
    cells = made(path).cells
    nbformat.validate(made(path))
    asked = [number for number, one in enumerate(cells) if parts.asked(one)]
    assert asked
    for number in asked:
        key = cells[number + 1]
        assert key.metadata["tags"] == ["key"]
        text = key.source.replace("\\", "")
        for one in parts.asked(cells[number]):
            right = " ".join(one.choices[one.answer].text.split())
            assert f"Right is **({'abcdefgh'[one.answer]})** {right}" in text
            for choice in one.choices:
                assert " ".join(choice.reply.split()) in text
                assert " ".join(choice.misconception.split()) in text


def test_a_key_says_which_votes_to_expect_and_that_nobody_counted_them():
    plan = plans.plan("05")
    key = edition.key_markdown(questions.question("05.far_rays"), plan.expected("05.far_rays"))
    assert [int(share) for share in re.findall(r"(\d+) % expected", key)] == list(plan.expected("05.far_rays").split)
    assert "The expected votes are a guess" in key
    counted = plans.ExpectedVotes("far_rays", (40, 40, 10, 10), "Crouch and Mazur 2001, page 972")
    key = edition.key_markdown(questions.question("05.far_rays"), counted)
    assert "from Crouch and Mazur 2001" in key
    assert "guess" not in key
    assert "expected" not in edition.key_markdown(questions.question("05.far_rays"), None)


def test_the_plan_stands_below_the_header_and_its_links_lead_somewhere():
    cells = made(DISTORTION).cells
    assert [one.metadata["tags"] for one in (cells[0], cells[2])] == [["teacher"], ["plan"]]
    plan = cells[2].source
    assert plan.count("\n| ") == len(plans.plan("05").steps) + 1
    text = "\n".join(one.source for one in cells if one.cell_type == "markdown")
    links = re.findall(r"\]\(#([^)]+)\)", plan)
    assert len(links) == len([step for step in plans.plan("05").steps if step.kind not in ("header", "quiz")])
    assert set(links) <= set(re.findall(r'<a id="([^"]+)">', text))
    assert '<a id="plan-section-2"></a>\n\n## 2 · A polynomial folds' in text
    assert all(word in plan for word in ("Bring", "If the network fails", "If a machine fails"))


def test_a_lesson_without_a_plan_has_its_keys_all_the_same(monkeypatch):
    monkeypatch.setattr(plans, "plan", lambda lesson: None)
    cells = edition.teacher_edition(notebooks.read(DISTORTION)).cells
    assert not [one for one in cells if "plan" in one.metadata.get("tags", [])]
    assert [one for one in cells if "key" in one.metadata.get("tags", [])]
    assert set(sheets.sheets(notebooks.read(DISTORTION), "05", [])) == {"exercises", "marking"}


@pytest.mark.sampled(4)
@EACH
def test_all_that_is_the_teacher_s_can_be_taken_out_by_its_tags(path):
    """As docs/teaching.md has nbgrader do it before a lesson is handed out."""
    theirs = {"plan", "key", "teacher", "solution"}
    kept = [one for one in made(path).cells if not theirs & set(one.metadata.get("tags", []))]
    lesson = [one for one in notebooks.read(path).cells if "solution" not in one.metadata.get("tags", [])]
    assert [one.id for one in kept] == [one.id for one in lesson]
    replies = [choice.reply for one in questions.questions(path.name[:2]).values() for choice in one.choices]
    text = "\n".join(one.source for one in kept)
    assert not [reply for reply in replies if " ".join(reply.split())[:60] in text]


def test_a_quiz_in_another_form_is_keyed_by_that_form(monkeypatch):
    given = []
    monkeypatch.setattr(questions, "quiz_questions", lambda *arguments: given.append(arguments) or ())
    for call in ('quiz("05")', 'quiz("05", "A")', 'quiz("05", form="B", when="before")'):
        parts.asked(cell(call))
    assert given == [("05",), ("05", "A"), ("05", "B")]
    assert parts.asked(nbformat.v4.new_markdown_cell('quiz("05")')) == ()


def test_what_markdown_would_take_for_markup_is_escaped():
    assert edition._markdown("if a <b and $5, then `x<y` and *so* ~3") == r"if a \<b and \$5, then `x<y` and *so* \~3"


# Outputs -------------------------------------------------------------------------------------------------------------


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    """One lesson's executed edition, with everything beside it, as the command writes it."""
    out = tmp_path_factory.mktemp("teacher") / "mine"
    assert main(["teacher", str(out), "--lesson", "05", "--slides"]) == 0
    return out


@pytest.mark.thorough
def test_an_executed_edition_has_pictures_and_every_solution_is_right_in_it(folder, capsys):
    notebook = notebooks.read(folder / DISTORTION.name)
    shown = [one for one in notebook.cells if panels.panels(one)]
    assert len(shown) == len([one for one in notebooks.read(DISTORTION).cells if panels.panels(one)])
    checks = notebooks.tagged(notebook, "check")
    assert len(checks) == len(exercises("05"))
    for one in checks:
        assert "Correct." in one.outputs[-1].text
    assert not [out for one in notebook.cells for out in one.get("outputs", []) if out.output_type == "error"]
    assert "widget-view" not in (folder / DISTORTION.name).read_text(encoding="utf-8")


@pytest.mark.thorough
def test_the_folder_holds_what_the_help_promises(folder, capsys):
    names = {path.name.partition("_")[2] for path in folder.glob("05_*.html")}
    assert names == {"plan.html", "one_page.html", "exercises.html", "marking.html", "slides.html"}
    assert [path.name for path in folder.glob("*.ipynb")] == [DISTORTION.name]
    with pytest.raises(SystemExit):
        main(["teacher", "--help"])
    text = capsys.readouterr().out
    assert all(f"NN_{name}" in text for name in names)


def test_what_a_teacher_changed_is_kept_and_the_new_version_is_put_beside_it(folder, capsys):
    sheet = folder / "05_exercises.html"
    sheet.write_text("mine", encoding="utf-8")
    (folder / "05_plan.html").unlink()
    assert main(["teacher", str(folder), "--lesson", "05", "--no-run"]) == 0
    assert sheet.read_text(encoding="utf-8") == "mine"
    assert (folder / "05_plan.html").is_file()
    assert (folder / "05_slides.html").is_file()


def test_a_lesson_that_does_not_run_is_written_without_outputs_and_named_in_one_sentence(tmp_path):
    source = tmp_path / "source"
    source.mkdir()
    broken = notebooks.read(DISTORTION)
    broken.cells[1].source += "\nraise RuntimeError('no such\\ncamera')"
    notebooks.write(broken, source / DISTORTION.name)
    said = []
    (written,) = edition.write_teacher_edition(source, tmp_path / "out", run=True, say=said.append)
    assert said[0] == f"running {DISTORTION.name} (1 of 1)"
    assert said[1:] == [
        f"{DISTORTION.name} could not be run (RuntimeError: no such camera), so it is written without outputs."
    ]
    cells = notebooks.read(written).cells
    assert not any(one.get("outputs") for one in cells)
    assert any("BEGIN SOLUTION" in one.source for one in cells)


def test_the_command_answers_a_wrong_number_and_a_missing_library_in_a_sentence(tmp_path, capsys, monkeypatch):
    assert main(["teacher", str(tmp_path / "mine"), "--lesson", "99"]) == 2
    assert "there is no lesson 99" in capsys.readouterr().err
    monkeypatch.setattr(teacher, "find_spec", lambda name: None if name == "latex2mathml" else name)
    assert main(["teacher", str(tmp_path / "mine")]) == 3
    said = capsys.readouterr().err
    assert "latex2mathml must be installed" in said
    assert "pip install 'camviz[lab]'" in said
    assert not (tmp_path / "mine").exists()


def test_pictures_of_the_lessons_come_along(folder):
    assert (folder / "images/launch.svg").is_file()
    assert (folder / "conventions.md").is_file() == (ROOT / "lessons/conventions.md").is_file()


# Sheets --------------------------------------------------------------------------------------------------------------


@pytest.mark.sampled(1)
@pytest.mark.by_example
@EACH
def test_the_sheets_hold_every_exercise_and_the_quiz_and_load_nothing(path):
    number, lesson = path.name[:2], notebooks.read(path)
    pages = sheets.sheets(lesson, number, planned(path))
    for name, page in pages.items():
        assert not re.findall(r'(?:src|href)="(?!data:)[^"]*"|url\((?!data:)|@import', page), name
    stubs = notebooks.stubs(lesson)
    plain = {name: re.sub(r"<[^>]+>", "", page) for name, page in pages.items()}
    for name in exercises(number):
        signature = stubs[name].splitlines()[0]
        assert signature in plain["exercises"].replace("&gt;", ">").replace("&#x27;", "'").replace("&quot;", '"')
    assert pages["exercises"].count("class=line") >= sheets.SPARE_LINES * len(stubs)
    quiz = questions.quiz_questions(number)
    assert pages["exercises"].count("☐") == sum(len(one.choices) for one in quiz)


@EACH
def test_no_solution_and_no_reply_stands_on_the_sheet_that_students_get(path):
    number, lesson = path.name[:2], notebooks.read(path)
    sheet = re.sub(r"<[^>]+>", "", sheets.exercise_sheet(lesson, number))
    for name, solution in notebooks.solutions(lesson).items():
        last = solution.strip().splitlines()[-1]
        if last not in notebooks.stubs(lesson)[name]:
            assert last.strip().replace("<", "&lt;").replace(">", "&gt;").replace("'", "&#x27;") not in sheet
    for one in questions.quiz_questions(number):
        assert one.choices[one.answer].reply.strip()[:50] not in sheet


def test_the_marking_scheme_names_every_typical_wrong_answer_with_its_points():
    page = sheets.marking_scheme(notebooks.read(DISTORTION), "05")
    for exercise in exercises("05").values():
        for known in exercise.misconceptions:
            assert known.function.__name__.replace("_", " ") in page
    assert "Exercises 20 points, exit quiz 4: 24 in all." in page
    assert len(re.findall(r"<td>[1-3] of 4</td>", page)) == sum(
        len(one.misconceptions) for one in exercises("05").values()
    )


@pytest.mark.parametrize(
    ("exercise", "name", "points"),
    [
        (lesson05.FOLD, "sign ignored", 3),  # right for four of five k1, and a special case is missing
        (lesson05.TANGENTIAL, "only the first line mended", 2),  # half of its numbers
        (lesson05.UNDISTORT_MAP, "row first", 2),  # the order alone
        (lesson05.DISTORT, "signs flipped", 1),
    ],
)
def test_points_follow_what_is_right_in_an_answer(exercise, name, points):
    (found,) = [one for one in marking.wrong_answers(exercise) if one.name == name]
    assert found.keeps == points


@pytest.mark.thorough
def test_no_wrong_answer_keeps_all_points_and_every_known_thought_keeps_some():
    for path in LESSONS:
        for exercise in exercises(path.name[:2]).values():
            assert {one.keeps for one in marking.wrong_answers(exercise)} <= {1, 2, 3}


def test_a_constant_factor_is_one_slip_and_guessing_yes_is_none():
    double = Exercise("00.d", lambda x: 2 * x, lambda rng: [(rng.normal(size=4),)] * 3, ("a", "b", "c"), "Twice.")
    double.wrong("Three times.")(lambda x: 3 * x)
    positive = Exercise("00.p", lambda x: x > 0, lambda rng: [(np.linspace(-1, 1, 9),)], ("a", "b", "c"), "Yes.")
    positive.wrong("Always yes.")(lambda x: np.full(x.shape, True))
    assert [one.keeps for one in marking.wrong_answers(double)] == [2]
    assert [one.keeps for one in marking.wrong_answers(positive)] == [1]


def test_the_example_of_an_exercise_tells_its_wrong_answers_apart():
    call, gives = marking.example(lesson05.UNDISTORT)
    assert call.startswith("``undistort(r_d=")
    different = [one for one in marking.wrong_answers(lesson05.UNDISTORT) if one.gives != gives]
    assert len(different) >= 5


# Markup --------------------------------------------------------------------------------------------------------------


@EACH
def test_every_formula_of_every_lesson_becomes_mathml(path):
    for one in notebooks.read(path).cells:
        if one.cell_type == "markdown":
            made = markup.html(one.source)
            assert "$" not in re.sub(r"<code>.*?</code>|<pre>.*?</pre>", "", made, flags=re.DOTALL)
            assert not re.search(r"<m(?:i|text)>\\", made)


def test_markdown_becomes_html_without_addresses():
    assert markup.inline("a [b](c.html) *d* `e$f$` $x_1$") == (
        'a b <em>d</em> <code>e$f$</code> <math display="inline"><mrow><msub><mi>x</mi><mn>1</mn></msub></mrow></math>'
    )
    assert "<script>" not in markup.html("<script>alert(1)</script>\n\nb <script>alert(2)</script>")
    assert markup.sentences("One 1.5 m. [Two](x.html) is it? *Yes.* No") == [
        "One 1.5 m.",
        "[Two](x.html) is it?",
        "*Yes.*",
        "No",
    ]
    assert markup.opening("One two. Three four five.", 4) == "One two."
    assert markup.opening("One two three. Four.", 2) == ""


# The page for 90 minutes ---------------------------------------------------------------------------------------------


@pytest.mark.sampled(4)
@EACH
def test_the_one_page_says_what_the_lesson_says(path):
    """Its minutes are the plan's, its votes two of the lesson's, and its first sentence the lesson's question."""
    plan = plans.plan(path.name[:2])
    if plan is None:
        pytest.skip("a lesson without a plan has no such page")
    page = one_page.one_page(notebooks.read(path), numbers(path), path.name)
    minutes = [f"{begun}–{ended}" for begun, ended, _ in plan.times(plans.LONG)]
    assert re.findall(r"<tr><td>(\d+–\d+)</td>", page) == minutes
    votes = [step for step in plan.steps if step.kind == "question"][:2]
    assert page.count("class='vote'") == len(votes)
    assert page.count("✓") == len(votes)
    assert "They learn" in page


def test_the_one_page_names_the_values_that_a_visualizer_opens_with():
    """Lesson 05's first three; the third has k1=-0.12, k2=0.06, k3=-0.04, and a name."""
    found = list(one_page.settings(notebooks.read(DISTORTION)))
    moved = "k1 (−0.2 … 0.2)"
    set_to = "k1 −0.12, k2 0.06, k3 −0.04"
    assert found[:3] == [(0, "", moved), (1, "k1 −0.1", moved), (2, set_to, f"show, {moved}")]
    page = one_page.one_page(notebooks.read(DISTORTION), numbers(DISTORTION), DISTORTION.name)
    assert f"Set {set_to}. Move show, {moved}." in page


@pytest.mark.sampled(6)
@EACH
def test_the_one_page_calls_controls_what_stands_on_them(path):
    """Only formulas of the questions have an underscore; `focal_mm` is "focal length f" on the screen."""
    found = list(one_page.settings(notebooks.read(path)))
    assert not [one for one in found if "_" in f"{one[1]}{one[2]}"]


def test_a_view_that_another_cell_has_named_is_known_by_its_class():
    """Lesson 05's eighth has a name that its own cell gives in a loop; lesson 02's first is made on the spot."""
    assert (7, "", "hide what folds, show") in list(one_page.settings(notebooks.read(DISTORTION)))
    first = {path.name[:2]: next(one_page.settings(notebooks.read(path)), None) for path in LESSONS}
    assert first["02"][2] == "focus s (0.9 … 7.4)"


# The plan and the slides ---------------------------------------------------------------------------------------------


@pytest.mark.sampled(6)
@EACH
def test_a_plan_numbers_the_slides_as_the_deck_does(path):
    """The numbers of the printed plan, read back: every slide once, in a step or among those to skip."""
    if plans.plan(path.name[:2]) is None:
        assert path.name.startswith("00")
        return
    made, numbered = planned(path), numbers(path)
    page = sheets.plan_page(notebooks.read(path), numbered)
    rows = re.findall(
        r"<tr><td>[^<]*</td><td>[^<]*</td><td>([^<]*)</td>", page.partition("Questions and their keys")[0]
    )
    assert len(rows) == len(numbered.plan.steps)
    in_steps = [counted(row) for row in rows]
    assert sorted([*chain.from_iterable(in_steps), *numbered.skipped(90)]) == list(range(1, len(made) + 1))
    for step, slides in zip(numbered.plan.steps, in_steps, strict=True):
        kinds = {made[number - 1].kind.split()[0] for number in slides}
        if step.kind == "question":
            assert kinds == {"question", "key", "reply"}
            asked = questions.question(f"{path.name[:2]}.{step.name}")
            assert made[slides[0] - 1].body.startswith(str(prose.to_html(asked.text)))
        elif step.kind == "exercise":
            assert "exercise" in kinds
        elif step.at == "section Recap":
            assert kinds <= {"claim", "recap"}
        elif step.at == "header":  # a lesson that goes deeper begins with its picture
            assert kinds <= {"title", "claim", *(["picture"] if is_layered(notebooks.read(path)) else [])}
    short = sorted(
        number for step, found in zip(numbered.plan.steps, in_steps, strict=True) for number in found if step.minutes[1]
    )
    assert sorted([*short, *numbered.skipped(45)]) == list(range(1, len(made) + 1))
    assert numbered.sentence in re.sub(r"<[^>]*>", "", page)


def counted(text):
    """The numbers of "3–5, 9": written here anew."""
    runs = [run.split("–") for run in text.split(", ") if run != "–"]
    return [number for run in runs for number in range(int(run[0]), int(run[-1]) + 1)]


def test_the_edition_has_the_numbers_of_the_deck_beside_it(folder):
    """Of the lesson as it was run: its pictures may need another number of slides than the open lesson's."""
    plan = next(one for one in notebooks.read(folder / DISTORTION.name).cells if "plan" in one.metadata.get("tags", []))
    page = (folder / "05_slides.html").read_text(encoding="utf-8")
    asked = re.search(r'<section class="slide question" id="s(\d+)"[^>]*><header>2 · ', page)
    row = next(line for line in plan.source.splitlines() if "Question: far rays" in line).replace("\u2060", "")
    assert row.split("|")[3].strip() == f"{asked[1]}–{int(asked[1]) + 4}"
    assert "withheld" not in re.sub(r"<style>.*?</style>", "", page, flags=re.DOTALL)
    assert "In 45 minutes skip slides" in plan.source


@EACH
def test_a_teachers_notebook_and_its_plan_agree_on_minutes(path):
    """Its note beside the header gives the minutes of a reader, the header's own; those of a class are the plan's."""
    cells = made(path).cells
    if plans.plan(path.name[:2]) is None:
        return
    header = next(
        one.source for one in cells if "header" in one.metadata.get("tags", []) or one.source.startswith("# ")
    )
    alone = re.search(r"\*About (\d+) minutes\.", header)[1]
    note = next(
        one.source
        for one in cells
        if one.metadata.get("tags") == ["teacher"] and "minutes" in one.source and "plan" in one.source
    )
    assert f"takes a reader about {alone} minutes, and a class 90 or 45, as the plan says" in note
    assert re.findall(r"\*\*(\d+) minutes", note) == []
    plan = next(one.source for one in cells if one.metadata.get("tags") == ["plan"])
    ends = re.findall(r"^\| (?:\d+\u2060–\u2060(\d+)|–) \| (?:\d+\u2060–\u2060(\d+)|–) \|", plan, re.MULTILINE)
    assert [max(int(one) for one in column if one) for column in zip(*ends, strict=True)] == [90, 45]
    left_out = [f"section {part}" for part in re.findall(r"leave out part (\d+)", note)]
    assert not [step for step in plans.plan(path.name[:2]).steps if step.at in left_out and step.minutes[1]]
