"""The lessons: they follow the pattern, solutions pass, stubs do not, and both editions come from one source."""

import ast
import inspect
import os
import re
import textwrap
from base64 import b64decode
from io import BytesIO
from pathlib import Path
from xml.etree import ElementTree

import nbformat
import numpy as np
import pytest
from PIL import Image

from camviz_school.commands import lessons
from camviz_school.course import notebooks, saved_outputs
from camviz_school.course.exercises import Tutor, exercises
from camviz_school.course.lesson_rules import SETUP, complaints
from camviz_school.course.material import module
from camviz_school.teaching import panels
from camviz_school.teaching.edition import mark_solution, teacher_edition, write_teacher_edition

lesson05 = module("05")

ROOT = Path(__file__).parents[1]
LESSONS = sorted((ROOT / "lessons").glob("*.ipynb"))
EACH = pytest.mark.parametrize("path", LESSONS, ids=lambda path: path.stem)

HEADER = """# 05 Lens distortion
**What does a polynomial do beyond its last data point?** [launch](https://mybinder.org/v2)

About 65 minutes.
**Prerequisites:** lesson 03. **What you'll do:** … **What you'll learn:** … **What you’ll need:** …"""

ENDING = """## Recap
A [fold](00_start_here.ipynb#fold), the [principal point](00_start_here.ipynb#principal-point) and
[undistortion](00_start_here.ipynb#undistortion).
## Further reading
Hartley and Zisserman 2004, section 7.4."""

BUG = inspect.getsource(lesson05.tangential_as_given).replace("tangential_as_given", "tangential")


def code(source, *tags, **camviz):
    return nbformat.v4.new_code_cell(source, metadata={"tags": [*tags], **({"camviz": camviz} if camviz else {})})


def text(source, *tags, **camviz):
    return nbformat.v4.new_markdown_cell(source, metadata={"tags": [*tags], **({"camviz": camviz} if camviz else {})})


def exercise_cells(name):
    """The stub, check and folded solution of an exercise of lesson 05, made from its reference."""
    function = name.split(".")[1]
    source = textwrap.dedent(inspect.getsource(getattr(lesson05, function)))
    solution = source.replace(": Array", "").replace(" -> Array", "").replace("ArrayLike", "object")
    signature = solution.splitlines()[0]
    stub = BUG if function == "tangential" else f"{signature}\n    raise NotImplementedError"
    folded = f"<details><summary>Solution</summary>\n\n```python\n{solution}```\n\n</details>"
    return [
        code(stub, "stub", exercise=name),
        code(f'check("{name}", {function})', "check"),
        text(folded, "solution"),
    ]


@pytest.fixture
def lesson():
    cells = [
        text(HEADER),
        code(SETUP, "setup"),
        text("Before you begin:"),
        code('quiz("05", "A")'),
        code('ask("05.grid")'),
        text("## Predict", teacher="10 minutes.\nAsk for hands before the reveal."),
        code('ask("05.far_rays")'),
        code('ask("05.undistort")'),
        code("print(round((1 / 0.9) ** 0.5, 3))", "nbval-check-output"),
        *(cell for name in exercises("05") for cell in exercise_cells(name)),
        code('explore(DistortionView(yours=distort), "k1")'),
        code("turn = attempt(fold_radius, -0.3, like=0.0)\nplt.plot(turn, 0.7, 'o')"),
        code('quiz("05")'),
        text(ENDING),
    ]
    return nbformat.v4.new_notebook(cells=cells)


def test_a_lesson_that_follows_the_pattern_brings_no_complaints(lesson):
    nbformat.validate(lesson)
    assert complaints(lesson, "05_distortion.ipynb") == []


def drop(tag):
    def change(notebook):
        notebook.cells = [cell for cell in notebook.cells if tag not in cell.metadata.get("tags", [])]

    return change


def replace(old, new):
    def change(notebook):
        assert any(old in cell.source for cell in notebook.cells)
        for cell in notebook.cells:
            cell.source = cell.source.replace(old, new)

    return change


def drop_first(notebook):
    del notebook.cells[0]


def quiz_last(notebook):
    quiz = next(cell for cell in notebook.cells if cell.source.startswith("quiz("))
    notebook.cells.remove(quiz)
    notebook.cells.append(quiz)


def first_thoughts_later(notebook):
    cells = notebook.cells
    cells[3], cells[4] = cells[4], cells[3]


def drop_notes(notebook):
    for cell in notebook.cells:
        cell.metadata.get("camviz", {}).pop("teacher", None)


@pytest.mark.parametrize(
    ("change", "complaint"),
    [
        (drop_first, "header"),
        (replace("About 65 minutes", "About an hour"), "minutes"),
        (replace("About 65", "About 50"), "About 65 minutes"),
        (replace("mybinder.org", "elsewhere.org"), "mybinder.org"),
        (drop("setup"), "tagged setup"),
        (replace("import numpy as np", "import numpy as np\nsize = 3"), "the same as everywhere"),
        (replace('ask("05.far_rays")', ""), "05.far_rays is never asked"),
        (replace('ask("05.far_rays")', 'ask("05.quiz_fold")'), "no such predict question"),
        (replace('quiz("05")', ""), "one quiz"),
        (replace('quiz("05", "A")', ""), 'a cell quiz("05", "A") must ask what the reader thinks before'),
        (first_thoughts_later, 'quiz("05", "A") must stand below the setup cell'),
        (drop("check"), "needs one cell tagged check"),
        (drop("solution"), "needs one cell tagged solution"),
        (replace('check("05.distort"', 'check("05.tangential"'), 'must call check("05.distort"'),
        (replace("print(", "plt.plot(1)\n" * 9 + "print("), "9 lines that draw"),
        (replace("print(", "\n" * 30 + "print("), "lines of code"),
        (drop("nbval-check-output"), "nbval-check-output"),
        (replace("## Recap", "## End"), "Recap"),
        (replace("## Further reading", ""), "Further reading"),
        (replace("#undistortion", "#undistorsion"), "undistorsion"),
        (replace("[fold](00_start_here.ipynb#fold)", "fold"), "at least three terms"),
        (replace("<details>", "<div>"), "not folded"),
        (drop_notes, "note for the teacher"),
        (quiz_last, "above the recap"),
        (replace("(fold_radius, -0.3", "(distort, -0.3"), "at least two of the reader's functions"),
        (replace("yours=distort", "k2=0"), "no visualizer runs a function of the reader's"),
        (replace("plt.plot(turn", "print(turn"), "nothing of the reader's own is plotted"),
        (replace("## Recap", "The fold comes first.\n## Recap"), "the first use of 'Fold' should link"),
        (replace("## Recap", "Word" + " word" * 35 + ".\n\n## Recap"), "a sentence of 36 words"),
    ],
)  # fmt: skip
def test_each_departure_from_the_pattern_is_named(lesson, change, complaint):
    change(lesson)
    found = complaints(lesson, "05_distortion.ipynb")
    assert any(complaint in one for one in found), found


def test_every_solution_passes_its_checker_and_no_stub_does(lesson):
    solved, unsolved = notebooks.verdicts(lesson, solved=True), notebooks.verdicts(lesson, solved=False)
    assert list(solved) == list(unsolved) == list(exercises("05"))
    assert all(solved.values()), solved
    assert not any(unsolved.values())
    assert {one.status for one in unsolved.values()} == {"unsolved"}


def test_the_teacher_s_edition_has_solutions_in_place_notes_visible_and_hidden_tests(lesson):
    edition = teacher_edition(lesson)
    nbformat.validate(edition)
    stub = notebooks.stubs(edition)["05.fold_radius"]
    assert "### BEGIN SOLUTION" in stub
    assert "NotImplementedError" not in stub
    notice, *notes = [cell.source for cell in notebooks.tagged(edition, "teacher")]
    assert notice == edition.cells[0].source
    assert notice.startswith("**Teacher's edition**")
    assert edition.cells[1].source == lesson.cells[0].source  # what nbgrader hands out does not call itself a teacher's
    assert notes == ["> **For the teacher:** 10 minutes.\n> Ask for hands before the reveal."]
    assert all("<details open>" in cell.source for cell in notebooks.tagged(edition, "solution"))
    assert '_verdict = check("05.distort", distort)\nassert _verdict' in notebooks.checks(edition)["05.distort"]
    assert not any(cell.get("outputs") for cell in edition.cells)


def test_the_student_s_edition_shows_nothing_of_the_teacher_s(lesson):
    before = nbformat.writes(lesson)
    teacher_edition(lesson)
    assert nbformat.writes(lesson) == before
    assert not any("Ask for hands" in cell.source or "BEGIN SOLUTION" in cell.source for cell in lesson.cells)


def test_every_check_of_the_teacher_s_edition_holds_when_run_as_code(lesson):
    edition, namespace = teacher_edition(lesson), {}
    for cell in edition.cells:
        if {"setup", "stub", "check"} & set(cell.metadata.get("tags", [])):
            exec(cell.source, namespace)


def test_a_graded_check_ends_in_no_value_and_a_failed_one_says_why(lesson):
    """nbgrader reads a cell's value as points, and shows a student the error of a test that failed."""
    for source in notebooks.checks(teacher_edition(lesson)).values():
        assert ast.unparse(ast.parse(source).body[-1]) == "print(_verdict)"
    fold = notebooks.checks(teacher_edition(lesson))["05.fold_radius"]
    namespace = {"check": Tutor(), "fold_radius": lambda k1: 2.0}
    with pytest.raises(AssertionError, match="the same number whatever it is given"):
        exec(fold, namespace)


def test_a_wrong_solution_makes_the_teacher_s_edition_fail(lesson):
    replace("np.sqrt(-3 * k1)", "np.sqrt(-k1)")(lesson)
    with pytest.raises(AssertionError):
        test_every_check_of_the_teacher_s_edition_holds_when_run_as_code(lesson)


def test_what_stub_and_solution_share_stays_outside_the_solution_s_marks():
    stub = 'def f(x):\n    """Doubles."""\n    raise NotImplementedError'
    solution = 'def f(x):\n    """Doubles."""\n    y = 2 * x\n    return y'
    marked = mark_solution(stub, solution)
    assert marked.splitlines()[:3] == ["def f(x):", '    """Doubles."""', "    ### BEGIN SOLUTION"]
    assert marked.splitlines()[-1] == "    ### END SOLUTION"
    exec(marked, namespace := {})
    assert namespace["f"](2) == 4
    with pytest.raises(ValueError, match="must differ from its stub"):
        mark_solution(stub, stub)


def test_the_teacher_s_edition_is_never_written_over_the_lessons(tmp_path, lesson):
    notebooks.write(lesson, tmp_path / "05_distortion.ipynb")
    with pytest.raises(ValueError, match="over the lessons"):
        write_teacher_edition(tmp_path, tmp_path / ".." / tmp_path.name)
    (written,) = write_teacher_edition(tmp_path, tmp_path / "teacher")
    assert "BEGIN SOLUTION" in written.read_text(encoding="utf-8")


def test_tidying_makes_two_runs_of_one_lesson_equal(lesson):
    def run(seed):
        notebook = nbformat.from_dict(lesson)
        notebook.metadata["widgets"] = {"state": seed}
        for number, cell in enumerate(notebook.cells):
            cell.id = f"{seed + number:08x}"
            cell.metadata["execution"] = {"iopub.execute_input": seed}
        return nbformat.writes(saved_outputs.tidied(notebook))

    assert run(1) == run(1000)
    tidy = saved_outputs.tidied(lesson)
    assert [cell.execution_count for cell in tidy.cells if cell.cell_type == "code"][:3] == [1, 2, 3]
    assert len({cell.id for cell in tidy.cells}) == len(tidy.cells)
    assert nbformat.writes(saved_outputs.tidied(tidy)) == nbformat.writes(tidy)


def test_saved_outputs_are_fresh_until_the_code_changes(lesson):
    saved = saved_outputs.tidied(lesson)
    assert saved_outputs.is_fresh(saved)
    saved.cells[0].source += "\nOne more word."
    assert saved_outputs.is_fresh(saved)
    saved.cells[8].source += "\n"
    assert not saved_outputs.is_fresh(saved)


def test_refreshing_runs_a_lesson_with_static_outputs_twice_alike(tmp_path):
    path = tmp_path / "99_tiny.ipynb"
    cells = [
        code("import os\nfrom camviz_school.widgets.question import ask"),
        code("print(os.environ['CAMVIZ_STATIC'], os.environ['CAMVIZ_RENDERER'])"),
        code('ask("05.far_rays")'),
        text("", "glossary"),
    ]
    notebooks.write(nbformat.v4.new_notebook(cells=cells), path)
    assert not saved_outputs.is_fresh(notebooks.read(path))
    saved_outputs.refresh(path)
    first = path.read_text(encoding="utf-8")
    notebook = notebooks.read(path)
    assert saved_outputs.is_fresh(notebook)
    assert notebook.cells[1].outputs[0].text == "1 solid\n"
    assert set(notebook.cells[2].outputs[0].data) == {"text/plain", "text/html"}
    assert '<a id="fold"></a>' in notebook.cells[3].source
    saved_outputs.refresh(path)
    assert path.read_text(encoding="utf-8") == first


def test_a_file_that_is_no_notebook_is_named(tmp_path):
    path = tmp_path / "05_picture.ipynb"
    path.write_text("not json")
    with pytest.raises(ValueError, match=r"05_picture\.ipynb is not a notebook"):
        notebooks.read(path)


def test_the_command_line_says_what_it_did_and_answers_a_wrong_name_in_words(tmp_path, lesson, monkeypatch, capsys):
    monkeypatch.setattr(lessons, "lessons_folder", lambda: tmp_path)
    monkeypatch.setattr(lessons.plans, "plan", lambda number: None)
    notebooks.write(lesson, tmp_path / "05_distortion.ipynb")
    assert lessons.main(["check"]) == 0
    assert lessons.main(["fresh"]) == 1
    assert "05_distortion.ipynb is stale" in capsys.readouterr().out
    assert lessons.main(["fresh", "06"]) == 2
    assert "begins with 06" in capsys.readouterr().err


@EACH
def test_every_lesson_follows_the_pattern(path):
    """Told also by: python -m camviz_school.commands.lessons check"""
    assert complaints(notebooks.read(path), path.name) == []


@EACH
def test_every_place_says_the_same_of_a_lesson_s_question_and_of_how_long_it_takes(path):
    """Header, the map in lesson 00, README, and the teacher's note at the header."""
    number, header = path.name[:2], notebooks.read(path).cells[0]
    (minutes,) = re.findall(r"About (\d+) minutes", header.source)
    assert re.match(rf"\*\*{minutes} minutes\b", header.metadata["camviz"]["teacher"])
    readme = (ROOT / "README.md").read_text(encoding="utf-8")
    assert re.findall(rf"^\| {number} .*\| (\d+) \|$", readme, re.MULTILINE) == [minutes]
    if number != "00":
        start = notebooks.read(path.parent / "00_start_here.ipynb")
        text = "\n".join(cell.source for cell in start.cells)
        assert re.findall(rf"^\| {number} .*\| (\d+) \|$", text, re.MULTILINE) == [minutes]
        (question, *_) = re.findall(r"\*\*([^*]+\?)\*\*", header.source)
        assert all(f"| {question} |" in page for page in (readme, text))


@EACH
def test_every_lesson_s_solutions_pass_and_its_stubs_do_not(path, monkeypatch):
    monkeypatch.chdir(path.parent)
    monkeypatch.setitem(os.environ, "CAMVIZ_STATIC", "1")
    notebook = notebooks.read(path)
    assert all(notebooks.verdicts(notebook, solved=True).values())
    assert not any(notebooks.verdicts(notebook, solved=False).values())


@pytest.mark.parametrize("path", sorted((ROOT / "lessons").rglob("*.ipynb")), ids=lambda path: path.stem)
def test_jupyterlab_has_nothing_to_add_to_a_notebook_that_it_opens(path):
    """Its kernel's language and specification, but for the version of Python, which the server extension fills in."""
    from ipykernel.ipkernel import IPythonKernel

    metadata = notebooks.read(path).metadata
    kernel = {**IPythonKernel.language_info, "version": metadata.language_info.version}
    assert metadata.language_info == kernel
    assert metadata.kernelspec == {"name": "python3", "display_name": "Python 3 (ipykernel)", "language": "python"}


@EACH
def test_every_lesson_s_saved_outputs_are_fresh_and_static(path):
    """Mend with: python -m camviz_school.commands.lessons refresh"""
    notebook = notebooks.read(path)
    assert saved_outputs.is_fresh(notebook)
    assert "application/vnd.jupyter.widget-view+json" not in path.read_text(encoding="utf-8")
    assert "pictures take their place" not in path.read_text(encoding="utf-8")  # saved with the real photographs
    images = [source for cell in notebook.cells for _, source in saved_outputs.images(cell)]
    drawings = [source for source in images if source.startswith("data:image/svg")]
    assert drawings
    for drawing in drawings:  # a browser shows nothing of an image that is not well-formed
        ElementTree.fromstring(b64decode(drawing.partition(",")[2]))


@EACH
def test_no_saved_picture_is_black_or_of_any_one_colour(path):
    """Where a function is not written yet, the right picture stands in grey (`camviz.views.yours.faded`)."""
    plain = []
    for cell in notebooks.read(path).cells:
        for shown in panels.panels(cell):
            parts = [] if shown.root is None else [part.get("href", "") for part in shown.root.iter()]
            photographs = [part for part in parts if part.startswith("data:")]
            for address in [shown.source] if shown.root is None else photographs:
                data = b64decode(address.partition(",")[2])
                pixels = np.asarray(Image.open(BytesIO(data)).convert("RGB"), dtype=float)
                if pixels.size > 1200 and np.ptp(pixels) < 8:  # marks and colour bars may be smaller
                    plain.append((cell.id, pixels.shape))
    assert plain == []
