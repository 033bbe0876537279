"""The examples of docs/recipes.md, carried out word for word in a copy of the repository."""

import json
import re

import nbformat
import pytest
from house import RECIPES, ROOT, examples, house

NUMBER = f"{1 + max(int(path.name[:2]) for path in (ROOT / 'lessons').glob('[0-9][0-9]_*.ipynb'))}"
"""The next free one: the page may name one that has been taken since."""
(NAMED,) = re.findall(r"^`lessons/material/(\d\d)/lesson.toml`$", RECIPES, re.MULTILINE)
PAGE = re.sub(rf"(?<!\d){NAMED}(?!\d)", NUMBER, RECIPES)
CELL = re.compile(r"^# %%(?P<words>.*)$", re.MULTILINE)


def notebook(text):
    """The notebook whose cells stand one below the other, each under `# %%` and its tags."""
    _, *pieces = CELL.split(text)
    cells = [cell(words.split(), source.strip("\n")) for words, source in zip(pieces[::2], pieces[1::2], strict=True)]
    return nbformat.writes(nbformat.v4.new_notebook(cells=cells))


def cell(words, source):
    tags = [word for word in words if word.isalpha()]
    exercises = [word for word in words if word[0].isdigit()]
    metadata = {"tags": tags} | ({"camviz": {"exercise": exercises[0]}} if exercises else {})
    if "[markdown]" in words:
        return nbformat.v4.new_markdown_cell(re.sub(r"^# ?", "", source, flags=re.MULTILINE), metadata=metadata)
    return nbformat.v4.new_code_cell(source, metadata=metadata)


def lesson_files():
    """The files of the lesson, the notebook from its cells."""
    found = examples("A lesson", PAGE)
    return {path: notebook(text) if path.endswith(".ipynb") else text for path, text in found.items()}


@pytest.fixture(scope="module")
def lesson(tmp_path_factory):
    """The lesson of the page, written, and the pages made anew."""
    made = house(tmp_path_factory.mktemp("house") / "camviz")
    made.add(lesson_files())
    made.run("-m", "camviz_school.commands.lessons", "pages")
    return made


def test_a_lesson_is_a_notebook_and_its_folder():
    written = lesson_files()
    assert {re.match(r"lessons/(material/\d+|.*)", path)[1] for path in written} == {
        f"{NUMBER}_shadows.ipynb",
        f"material/{NUMBER}",
    }


@pytest.mark.thorough
def test_the_pages_list_the_lesson_in_its_place_and_nothing_else_is_written(lesson):
    made = {"README.md", "docs/glossary.md", "lessons/00_start_here.ipynb"}
    assert lesson.touched() == {*made, *lesson_files()}
    readme = lesson.text("README.md")
    assert f"| **[{NUMBER} Shadows](lessons/{NUMBER}_shadows.ipynb)** |" in readme
    row = "How tall is a tree that you cannot climb? | the sun measures every tree at once | a tree of your own | 10 |"
    assert f"| {NUMBER} Shadows | {row}" in readme
    start = "".join(one.source for one in nbformat.reads(lesson.text("lessons/00_start_here.ipynb"), 4).cells)
    assert f"| {NUMBER} | [Shadows]({NUMBER}_shadows.ipynb) | How tall is a tree that you cannot climb? | 10 |" in start
    for page, way in ((readme, r"^\| (\d\d) "), (start, r"^\| (\d\d) \|")):
        order = re.findall(way, page, re.MULTILINE)
        assert order[-2:] == [f"{int(NUMBER) - 1}", NUMBER]
    assert '<a id="gnomon"></a>**Gnomon.** An upright stick' in start
    assert f"*Lesson [{NUMBER}](../lessons/{NUMBER}_shadows.ipynb).*" in lesson.text("docs/glossary.md")


@pytest.mark.thorough
def test_the_check_of_the_lesson_finds_nothing_wrong_and_says_what_is_still_lacking(lesson):
    said = lesson.run("-m", "camviz_school.commands.lessons", "check", NUMBER, status=1)
    assert {line.partition(": ")[2] for line in said.splitlines()} == {
        "no cell is tagged nbval-check-output, so no number of this lesson is held",
        "at least two predict questions are wanted, 1 are asked",
        f'the lesson must end with one quiz("{NUMBER}"), has []',
        "three to five exercises are wanted, there are 1",
        "one exercise should be to find a bug",
        "at least two of the reader's functions must run in the lesson, [] do",
        "no visualizer runs a function of the reader's: explore(…View(…, yours=…))",
        "nothing of the reader's own is plotted: attempt(…) and plt",
        "there is no heading 'Recap'",
        "there is no heading 'Further reading'",
        "at least three terms should be linked to the glossary, as 00_start_here.ipynb#principal-point",
        "no cell has a note for the teacher in its metadata",
    }


@pytest.mark.thorough
def test_the_lesson_s_question_and_exercise_are_asked_and_answered(lesson):
    code = """
import json
from pathlib import Path

from camviz_school.course import notebooks
from camviz_school.course.exercises import Tutor, exercise
from camviz_school.course.questions import question

lesson = notebooks.read(Path("lessons/NN_shadows.ipynb"))
wrong = exercise("NN.height").misconceptions[0].function
print(json.dumps({
    "question": question("NN.stick").choices[1].misconception,
    "stub": notebooks.verdicts(lesson, solved=False)["NN.height"].status,
    "solution": notebooks.verdicts(lesson, solved=True)["NN.height"].status,
    "right": [Tutor()("NN.height", way).status for way in exercise("NN.height").right_ways],
    "wrong": Tutor()("NN.height", wrong).message,
}))
""".replace("NN", NUMBER)
    said = json.loads(lesson.run("-c", code))
    assert said["question"] == "the proportion is upside down"
    assert (said["stub"], said["solution"], said["right"]) == ("unsolved", "correct", ["correct"])
    assert said["wrong"].startswith("The proportion is upside down.")


@pytest.mark.thorough
def test_a_teacher_gets_the_lesson_with_its_key_its_solution_and_its_sheets(lesson, tmp_path):
    lesson.run("-m", "camviz", "teacher", str(tmp_path / "out"), "--no-run", "--slides", "--lesson", NUMBER)
    edition = (tmp_path / "out" / f"{NUMBER}_shadows.ipynb").read_text(encoding="utf-8")
    assert "Right is **(a)** 6 m" in edition
    assert "### BEGIN SOLUTION" in edition
    pages = {path.name: path.read_text(encoding="utf-8") for path in (tmp_path / "out").glob(f"{NUMBER}_*.html")}
    assert set(pages) == {f"{NUMBER}_exercises.html", f"{NUMBER}_marking.html", f"{NUMBER}_slides.html"}
    assert "upside down" in pages[f"{NUMBER}_marking.html"]
    assert all("Shadows" in page for page in pages.values())


# A format and a finding -----------------------------------------------------------------------------------------------


def added(tmp_path, heading):
    """A copy of the repository with the one file of an example."""
    files = examples(heading)
    assert len(files) == 1
    made = house(tmp_path / "camviz")
    made.add(files)
    return made


def held(made, tests, words):
    """How many of the tests in a file that are about these words pass there."""
    said = made.run("-m", "pytest", "-o", "addopts=", "-p", "no:cacheprovider", "--all", tests, "-k", words)
    return int(re.findall(r"(\d+) passed", said)[0])


@pytest.mark.thorough
def test_a_calibration_format_is_one_file(tmp_path):
    made = added(tmp_path, "A calibration format")
    (made.root / "a.toy").write_text("toy 640 480 500 321.25 239.5\n")
    made.run("-m", "camviz", "convert", "a.toy", "b.yml", "--to", "opencv")
    made.run("-m", "camviz", "convert", "b.yml", "c.toy", "--to", "toy")
    assert made.text("c.toy") == "toy 640 480 500.0 321.25 239.5\n"
    assert "Toy (camera.toy), one camera" in made.run("-m", "camviz", "convert", "--help")
    assert "Toy" in made.run("-m", "camviz", "show", "--help")
    made.run("tools/docs/formats.py")
    assert "| `toy` | Toy: camera.toy | pinhole | one line |" in made.text("docs/formats.md")
    assert held(made, "tests/test_formats_contract.py", "toy") > 2


@pytest.mark.thorough
def test_a_finding_is_one_file(tmp_path, thorough):
    made = added(tmp_path, "A finding")
    code = """
import json
import numpy as np
from camviz_clinic.checks import Inspection, faults, kinds

fault = faults()["skew"]
found = Inspection.of(fault.inject(np.random.default_rng(1), fault.promised)).findings
print(json.dumps([each.sentence for each in found if each.id == "skewed-pixels"]))
"""
    assert json.loads(made.run("-c", code)) == ["camera: the skew is 2.0% of fx."]
    K = [500.0, 50.0, 319.5, 0.0, 500.0, 239.5, 0.0, 0.0, 1.0]
    ros = {"image_width": 640, "image_height": 480, "camera_name": "cam", "distortion_model": "plumb_bob"}
    ros["camera_matrix"] = {"rows": 3, "cols": 3, "data": K}
    ros["distortion_coefficients"] = {"rows": 1, "cols": 5, "data": [0.0] * 5}
    (made.root / "camera.yaml").write_text(json.dumps(ros))
    said = made.run("-m", "camviz", "inspect", "camera.yaml", "--json", status=1)
    assert "skewed-pixels" in [each["id"] for each in json.loads(said)["findings"]]
    made.run("tools/docs/clinic.py", "--page")
    assert "### `skewed-pixels`" in made.text("docs/clinic.md")
    words = "promised and skew or every_finding or " + ("healthy" if thorough else "20100")  # one camera and one pair
    assert held(made, "tests/test_faults.py", words) >= (8 if thorough else 5)
