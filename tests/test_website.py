"""The site is the lessons: each page has every word, picture, question and reply of its notebook."""

import inspect
import json
import os
import re
import subprocess
import sys
import time
from dataclasses import replace
from html import unescape
from itertools import islice, pairwise
from pathlib import Path
from types import SimpleNamespace

import nbformat
import numpy as np
import psutil
import pytest
from docutils import nodes
from docutils.core import publish_doctree
from pygments.formatters import HtmlFormatter

ROOT = Path(__file__).resolve().parents[1]
sys.path[:0] = [str(ROOT / "tools/website"), str(ROOT / "tools/docs")]

import deeper  # noqa: E402
import docstrings  # noqa: E402
import engineers  # noqa: E402
import mistakes  # noqa: E402
import panes  # noqa: E402
import pictures  # noqa: E402
import previews  # noqa: E402
import slim_styles  # noqa: E402
from api_pages import aliases, api_pages  # noqa: E402
from beside import beside  # noqa: E402
from course_pages import course_pages, learn  # noqa: E402
from lesson_page import LessonPage, asked_by, exercise_html  # noqa: E402
from links import on_site  # noqa: E402
from moving_picture import moved  # noqa: E402
from scripts import question_script  # noqa: E402

from camviz.cameras import Camera  # noqa: E402
from camviz.twoview import ransac_fundamental  # noqa: E402
from camviz.views.frustum import FrustumView  # noqa: E402
from camviz.widgets import explore  # noqa: E402
from camviz_school.course.catalogue import catalogue  # noqa: E402
from camviz_school.course.exercises import exercises  # noqa: E402
from camviz_school.course.glossary import glossary  # noqa: E402
from camviz_school.course.material import lesson_paths  # noqa: E402
from camviz_school.views.pinhole import PinholeView  # noqa: E402

LESSONS = lesson_paths()
PIXELS = "(..., 2), pixels (u, v), whose centres are integers."
PAGES = frozenset(path.relative_to(ROOT).as_posix() for path in [*LESSONS, *(ROOT / "docs").glob("*.md")])


@pytest.fixture(scope="module", params=LESSONS, ids=lambda path: path.name[:2])
def pair(request, tmp_path_factory):
    """A lesson's notebook, and what the site makes its page from."""
    page = LessonPage(request.param, ROOT, tmp_path_factory.mktemp("site"), PAGES, {})
    return nbformat.read(request.param, 4), page.notebook(), page


def words(text: str) -> list[str]:
    """What a reader reads of Markdown or HTML: no tags, no addresses."""
    without_links = re.sub(r"!?\[((?:[^\[\]]|\[[^\[\]]*\])*)\]\([^()\s]+\)", r"\1", text)
    return unescape(re.sub(r"<a class=\"term\"[^>]*>|</a>|<[^<>]+>", "", without_links)).split()


def html_of(cell) -> str:
    return "".join(output.get("data", {}).get("text/html", "") for output in cell.get("outputs", []))


def tags(cell) -> list[str]:
    return cell.metadata.get("tags", [])


def code(notebook):
    """The cells with code, but for those that a page makes of the imports of another one."""
    return [cell for cell in notebook.cells if cell.cell_type == "code" and "imports" not in tags(cell)]


def lines_of_code(notebook) -> list[str]:
    cells = [cell.source for cell in notebook.cells if cell.cell_type == "code"]
    return [line for source in cells for line in source.splitlines() if line]


def test_a_page_has_the_cells_of_its_notebook_word_for_word(pair) -> None:
    lesson, page, _ = pair
    assert len(code(page)) == len(code(lesson))
    assert lines_of_code(page) == lines_of_code(lesson)
    shown, written = (
        [word for cell in one.cells if cell.cell_type != "code" for word in words(cell.source)]
        for one in (page, lesson)
    )
    assert shown == written


def test_a_page_has_every_picture_of_its_notebook_with_its_words_as_a_file(pair) -> None:
    lesson, page, made = pair
    for cell, shown in zip(code(lesson), code(page), strict=True):
        if asked_by(cell.source):
            continue
        html = html_of(shown)
        assert "data:image" not in html
        assert re.findall(r'alt="([^"]*)"', html_of(cell)) == re.findall(r'alt="([^"]*)"', html)
        for name in re.findall(rf'src="\.\./{"_pictures"}/([^"]+)"', html):
            assert (made.site / "_pictures" / name).stat().st_size > 100


def test_a_page_says_once_which_function_of_the_reader_a_picture_waits_for(pair) -> None:
    lesson, page, _ = pair
    for cell, shown in zip(code(lesson), code(page), strict=True):
        printed = "".join(one.text for one in cell.outputs if one.output_type == "stream")
        names = re.findall(r"`(\w+)` (?:returns nothing|is not written) yet", printed)
        left = "".join(one.text for one in shown.outputs if one.output_type == "stream")
        told = re.findall(r'class="camviz-awaited">(.*? waits for .*?)</p>', html_of(shown))
        assert " yet, so its part of the picture stays empty" not in left
        assert len(told) == bool(names)
        assert re.findall(r"<code>(\w+)</code>", "".join(told)) == list(dict.fromkeys(names))
        of_the_notebook = r" yet, so |^The sample \S+ could not be fetched"
        kept = [line for line in printed.splitlines() if not re.search(of_the_notebook, line)]
        assert [re.sub(r"\bnan\b", "–", line) for line in kept] == left.splitlines()


def test_a_page_shows_no_import_and_no_code_that_waits_for_a_function(pair) -> None:
    lesson, page, _ = pair
    for cell, shown in zip(code(lesson), code(page), strict=True):
        printed = "".join(one.text for one in cell.outputs if one.output_type == "stream")
        if "hide-input" in tags(shown):
            continue
        assert not re.search(r"^(import|from) ", shown.source, re.MULTILINE)
        assert not re.search(r" yet, so its part|\bnan\b", printed)


def grouped(*cells):
    """What `beside` makes, a group in brackets: "# a" is a heading, P a pane, ? a prediction, x an exercise."""
    kinds = {"P": "pane", "?": "asked", "x": "other"}
    made = [
        nbformat.v4.new_code_cell(one) if one in kinds else nbformat.v4.new_markdown_cell(one.replace("|", "\n\n"))
        for one in cells
    ]
    shown = beside(made, lambda cell: kinds.get(cell.source, "said"))
    return " ".join({'<div class="camviz-beside">': "[", "</div>": "]"}.get(cell.source, cell.source) for cell in shown)


def test_a_pane_stands_beside_the_sentences_before_and_after_it():
    assert grouped("# One|a", "P", "b", "x") == "# One [ a P b ] x"
    assert grouped("# One|a|## Two|b", "P", "c|# Three") == "# One|a|## Two [ b P c ] # Three".replace("|", "\n\n")


def test_a_prediction_and_the_last_text_before_a_pane_lead_to_it():
    assert grouped("P", "a", "?", "b", "P", "c") == "[ P a ] [ ? b P c ]"
    assert grouped("P", "a", "?", "P") == "[ P a ] [ ? P ]"
    assert grouped("P", "P", "a") == "P [ P a ]"


def test_sentences_without_a_pane_and_a_pane_without_sentences_have_the_whole_width():
    assert grouped("# One|a", "x", "b", "x", "P", "x") == "# One a x b x P x"


def test_a_deeper_sections_minutes_stand_with_its_heading_above_its_pane():
    begins = "### Deeper: a|*About 5 minutes. Asks for: section 1.*"
    assert grouped(f"{begins}|b", "P") == f"{begins} [ b P ]".replace("|", "\n\n")


def test_a_deeper_section_is_folded_below_its_minutes_with_the_headings_in_it():
    def section(title, *parts):
        return nodes.section("", nodes.title(text=title), *parts)

    def said(text):
        return nodes.paragraph(text=text)

    core, inner = section("1 · Core", said("core")), section("Exercise 3", said("task"))
    page = section("Lesson", core, section("Deeper: a", said("About 5 minutes."), said("first"), inner))
    deeper.fold(page)
    assert [one.tagname for one in page.children[1:]] == ["section", "section"]
    assert [one.astext() for one in core.children] == ["1 · Core", "core"]
    title, minutes, opens, first, within, closes = page.children[2].children
    assert (title.astext(), minutes.astext(), first.astext()) == ("Deeper: a", "About 5 minutes.", "first")
    assert (opens.astext()[:8], within, closes.astext()) == ("<details", inner, "</details>")


def test_each_column_of_a_table_has_a_head():
    """An empty one is read out as nothing (axe: empty-table-header)."""
    for path in (ROOT / "docs").rglob("*.md"):
        heads = re.findall(r"^(\|.*\|)\n\|[ :]*---", path.read_text(encoding="utf-8"), re.MULTILINE)
        assert [head for head in heads if re.search(r"\| *\|", head)] == [], path


def test_a_report_of_the_gallery_has_its_picture_and_no_other_page_changes():
    page = (ROOT / "docs/engineers/gallery.md").read_text(encoding="utf-8")
    shown = engineers.with_pictures(page)
    assert re.findall(r"reports/([\w-]+)\.svg", shown) == re.findall(r"reports/([\w-]+)\.html", page)
    assert re.sub(r"<img [^>]*><br> ", "", shown) == page
    other = (ROOT / "docs/engineers/symptoms.md").read_text(encoding="utf-8")
    assert engineers.with_pictures(other) == other


def test_reports_are_made_anew_when_what_makes_them_has_changed(tmp_path: Path) -> None:
    script, clinic = tmp_path / "docs/engineers/gallery.py", tmp_path / "camviz_clinic/report/page.py"
    for path in (script, clinic):
        path.parent.mkdir(parents=True)
    clinic.touch()
    script.write_text(
        "import sys, pathlib; f = pathlib.Path(sys.argv[1]); f.mkdir(parents=True, exist_ok=True)\n"
        "(f / 'a.html').write_text(str(len([*f.glob('a.html')])))",
        encoding="utf-8",
    )
    made = tmp_path / "site" / engineers.REPORTS / "a.html"
    for changed, said in ((None, "0"), (None, "0"), (clinic, "1")):
        if changed:
            os.utime(changed, (made.stat().st_mtime + 10,) * 2)
        engineers.write_reports(tmp_path, tmp_path / "site")
        assert made.read_text(encoding="utf-8") == said


def test_every_lesson_stands_on_the_map_once(tmp_path: Path):
    lessons = catalogue()
    unknown = replace(lessons[0], number="98")
    mapped = learn([*lessons, unknown], {})
    numbers = re.findall(r'class="lesson-number">(\d\d)', mapped)
    assert sorted(numbers) == sorted([*(one.number for one in lessons), "98"])
    assert mapped.index('">98<') > mapped.index("Electives")


def test_the_map_shows_the_first_panel_that_a_lesson_shows(tmp_path: Path):
    shown = course_pages(tmp_path / "_pictures")["learn.md"]
    pictures = re.findall(r'<img src="(_pictures/[^"]+)"', shown)
    assert len(pictures) == len(LESSONS)
    assert all((tmp_path / one).stat().st_size > 100 for one in pictures)


def test_a_page_has_every_question_with_all_choices_and_replies(pair) -> None:
    """In the list for readers without scripts, and in what makes it live; before the lesson the list has no replies."""
    lesson, page, _ = pair
    asked = [(asked_by(cell.source), html_of(shown)) for cell, shown in zip(code(lesson), code(page), strict=True)]
    asked = [(found, html) for found, html in asked if found]
    assert len(asked) == sum(cell.source.startswith(("ask(", "quiz(")) for cell in lesson.cells)
    for (questions, _, when), html in asked:
        folded, data = html.split('<script type="application/json">')
        told = json.loads(data.split("</script>")[0])
        assert [one["name"] for one in told["questions"]] == [one.name for one in questions]
        for question, one in zip(questions, told["questions"], strict=True):
            assert [each["correct"] for each in one["choices"]] == [each.correct for each in question.choices]
            for choice, each in zip(question.choices, one["choices"], strict=True):
                reply, text = words(each["reply"]), words(each["text"])
                assert reply == words_of_prose(choice.reply)
                assert each["text"] in folded
                assert text == words_of_prose(choice.text)
                assert (each["reply"] in folded) == (when != "before")


def words_of_prose(text: str) -> list[str]:
    from camviz.draw import prose

    return words(prose.to_html(text))


def test_an_exercise_has_its_hints_each_inside_the_one_before(pair) -> None:
    _, page, made = pair
    for name, exercise in exercises(made.path.name[:2]).items():
        html = exercise_html(name, made.path.name)
        assert html.count("<details>") == 4  # the way into JupyterLab, and three hints
        assert html.endswith("</details></details></details></div>")
        assert len(exercise.hints) == 3
        assert any(html in html_of(cell) for cell in page.cells)


def test_a_term_leads_to_the_glossary_and_a_file_that_is_no_page_to_github() -> None:
    page = "lessons/05_distortion.ipynb"
    link = on_site("a [ray](00_start_here.ipynb#ray), `[x](y.md)`", page, PAGES, ROOT)
    assert link == 'a <a class="term" href="../docs/glossary.html#ray">ray</a>, `[x](y.md)`'
    assert on_site("[next](06_calibration.ipynb)", page, PAGES, ROOT) == "[next](06_calibration.ipynb)"
    assert "camviz/blob/main/LICENSE)" in on_site("[L](../LICENSE)", "docs/clinic.md", PAGES, ROOT)


def test_every_term_that_a_lesson_links_is_in_the_glossary(pair) -> None:
    _, page, made = pair
    if made.path.name.startswith("00"):
        return
    linked = {
        name for cell in page.cells for name in re.findall(r'class="term" href="[^"#]+#([^"]+)"', str(cell.source))
    }
    assert linked <= {one.anchor for one in glossary().terms}


def test_pictures_with_one_content_are_one_file(tmp_path: Path) -> None:
    image = '<img alt="a" src="data:image/png;base64,iVBORw0KGgo=">'
    html = pictures.outside(image + image, tmp_path, "../p")
    assert len(list(tmp_path.iterdir())) == 1
    assert html.count('loading="lazy"') == 2
    drawn = FrustumView().figure()
    _, _, width, height = drawn.tiles[0].cell  # known before it is fetched
    assert f' width="{width:g}" height="{height:g}"' in pictures.outside(drawn.figure(), tmp_path, "../p")


def test_the_pages_script_is_the_notebooks_own() -> None:
    source = (ROOT / "camviz_school/widgets/question.js").read_text(encoding="utf-8")
    assert source.removesuffix("export default { render };\n") in question_script()


def test_the_icon_font_is_left_out_and_another_font_is_not():
    sheet = r"@font-face{font-family:Font Awesome\ 7 Free;src:url(a)}@font-face{font-family:Own;src:url(b)}"
    assert slim_styles.used(sheet, set()) == "@font-face{font-family:Own;src:url(b)}"


@pytest.mark.parametrize("style", ["a11y-high-contrast-light", "a11y-high-contrast-dark"])
def test_code_whose_elements_are_left_out_has_the_colour_of_text(style):
    assert style in (ROOT / "tools/website/conf.py").read_text(encoding="utf-8")
    sheet = HtmlFormatter(style=style).get_style_defs(".highlight")
    colours = dict(re.findall(r"^\.highlight (?:\.(\w+) )?\{[^}]*?\bcolor: (#\w+)", sheet.lower(), re.MULTILINE))
    assert {colours[one] for one in slim_styles.UNCOLOURED} == {colours[""]}
    assert colours["k"] != colours[""]


def test_a_constant_is_explained_by_its_own_words_and_not_by_its_types():
    import camviz.colour
    import camviz.mosaics

    said = docstrings.of_constant("camviz.mosaics.PATTERNS", camviz.mosaics.PATTERNS)
    assert said
    assert said[0] not in (dict.__doc__ or "")
    assert docstrings.of_constant("camviz.mosaics.NOTHING", object()) == []
    lines = (np.ndarray.__doc__ or "").split("\n")
    docstrings._process(None, "data", "camviz.colour.WAVELENGTHS_NM", camviz.colour.WAVELENGTHS_NM, None, lines)
    assert lines[0].startswith("The wavelengths (81,) of all spectra here, in nanometres")


def test_a_preview_tells_its_size(tmp_path: Path):
    view = FrustumView(panels="picture")
    previews.write(view.figure(), "05", tmp_path)
    width, height = previews.sizes(tmp_path)["05"]
    assert width == previews.WIDTH
    assert height / width == pytest.approx(view.figure().height / view.figure().width, abs=0.001)


def test_a_moving_picture_begins_at_the_present_state_and_goes_to_both_ends(monkeypatch):
    monkeypatch.setattr(FrustumView, "figure", lambda view: view.hfov_deg)
    view, slider = FrustumView(hfov_deg=60), FrustumView.controls()["hfov_deg"]
    way = moved(view, "hfov_deg")
    assert (way[0], max(way), min(way)) == (60, slider.high, slider.low)
    steps = [max(after, before) / min(after, before) for before, after in pairwise([*way, way[0]])]
    assert max(steps) < 1.1  # no leap, nor from the last picture to the first


def fields(lines: list[str]) -> dict[str, str]:
    """What a page shows of a docstring: the text of each field by its title."""
    page = publish_doctree("\n".join(lines))
    assert not list(page.findall(nodes.system_message))
    return {field[0].astext(): field[1].astext() for field in page.findall(nodes.field)}


def test_a_page_of_the_reference_shows_every_section_of_a_docstring():
    said = fields(docstrings.as_page((inspect.getdoc(ransac_fundamental) or "").split("\n")))
    assert list(said) == ["Parameters", "Returns", "Raises", "Source"]
    assert said["Parameters"].startswith("uv_left, uv_right – (n, 2), pairs in pixels")
    assert said["Parameters"].endswith("max_samples – The most samples.")
    assert [line.split(" – ")[0] for line in said["Returns"].split("\n\n")] == ["F", "agrees"]
    assert said["Raises"] == "ValueError – Where no 8 pairs agree, and for a confidence outside (0, 1)."
    assert said["Source"] == "Hartley & Zisserman (2004), algorithm 11.4 and eq. 4.18."


def test_a_page_of_the_reference_shows_what_the_names_for_arrays_say():
    """A name in a signature says shape and unit on the function's page, and all such names have a page of their own."""
    lines = inspect.getdoc(Camera.project).split("\n")
    docstrings._process(None, "method", "camviz.Camera.project", Camera.project, None, lines)
    said = fields(lines)["Arrays"].split("\n\n")
    assert said == ["PointsLike – " + aliases("camviz.lenses.arrays")["PointsLike"], "Pixels – " + PIXELS]
    page = api_pages()["api/camviz.lenses.arrays.md"]
    assert f"| `Pixels` | {PIXELS} |" in page
    assert "   Pixels" not in page  # which Sphinx cannot show


def test_a_colon_in_what_a_function_returns_and_markup_that_is_mathematics_stay_text():
    said = fields(
        docstrings.as_page(
            ["The sum.", "", "Args:", "    *a: |a| in mm.", "Returns: Depth: exact.", "Source: S. F. Ray."]
        )
    )
    assert said == {"Parameters": "*a – |a| in mm.", "Returns": "Depth: exact.", "Source": "S. F. Ray."}


def test_a_signature_shows_types_as_the_source_writes_them():
    shown = docstrings._signature(None, "function", "", ransac_fundamental)
    assert shown
    assert shown[0].startswith("(uv_left: ArrayLike, uv_right: ArrayLike, threshold_px: PixelLength")
    assert shown[0].endswith("max_samples: int = 5000)")
    assert shown[1] == "tuple[Array, np.ndarray]"
    assert docstrings._signature(None, "method", "", FrustumView.figure)[0].startswith("(")
    assert "self" not in docstrings._signature(None, "method", "", FrustumView.figure)[0]


def test_the_references_of_two_docstrings_of_scipy_can_stand_on_one_page():
    lines = [
        "Turns.",
        "",
        "Notes",
        "-----",
        "After [1]_.",
        "",
        "References",
        "----------",
        ".. [1] A book,",
        "   2001.",
    ]
    one, other = (docstrings.of_numpydoc(name, lines) for name in ("a.apply", "b.apply"))
    page = publish_doctree("\n".join([*one, "", *other]))
    assert not list(page.findall(nodes.system_message))
    assert [note.astext() for note in page.findall(nodes.footnote)] == ["1\n\nA book,\n2001.", "2\n\nA book,\n2001."]


def lesson(number: str) -> Path:
    return next(path for path in LESSONS if path.name.startswith(number))


def test_a_page_runs_the_solutions_where_a_notebook_has_stubs_and_checks_nothing():
    cells = panes.code_cells(lesson("01"))
    solved = {cell.exercise: cell.source for cell in cells.values() if cell.exercise}
    assert list(solved) == list(exercises("01"))
    assert not any("NotImplementedError" in source for source in solved.values())
    assert not any(cell.source.startswith("check(") for cell in cells.values())
    ((pane, exercise),) = [
        (number, panes.own_in(cells, number)) for number in cells if "yours=" in cells[number].source
    ]
    assert set(exercise) == {"01.project"}
    assert exercise["01.project"] < pane


def test_what_depends_on_an_exercise_is_found_through_the_names_between():
    sources = {
        1: "def f(x): return x",
        2: "a = f(1)",
        3: "b = 2",
        4: "c = [f for f in (1, 2)]",
        5: "d = a + b",
        6: "b",
        7: "print(d)",
    }
    assert mistakes.dependents(sources, 1, 7, "f") == [2, 5, 7]
    assert mistakes.dependents(sources, 1, 5, "f") == [2, 5]
    assert mistakes.dependents(sources, 3, 7, "b") == [5, 6, 7]


def test_a_mistake_is_what_the_lesson_draws_with_it_and_one_that_shows_nothing_is_left_out():
    """Lesson 01 with its camera in the cell before the pane; the notebook's own names stay as they are."""
    project = exercises("01")["01.project"]
    sources = {
        3: "",
        4: "view = PinholeView(panels='picture yours', yours=project)",
        5: "explore(view, 'depth_mm')",
    }
    names = {"PinholeView": PinholeView, "explore": explore, "project": project.reference}
    mistakes.value_of(sources[4], after := dict(names))
    shown = mistakes.value_of(sources[5], dict(after))
    before = {3: names, 4: names, 5: after}
    found = list(islice(mistakes.mistakes("01.project", 3, 5, sources, before, [shown]), 4))
    titles = {known.function.__name__.replace("_", " "): known for known in project.misconceptions}
    assert {"divided by the distance", "upside down fraction"} <= {one.title for one in found}
    for one in found:
        assert one.explanation == titles[one.title].explanation
        assert one.explorer.view.yours is titles[one.title].function
    assert after["view"].yours is project.reference
    (first, *_) = project.misconceptions
    itself = explore(PinholeView(panels="picture yours", yours=first.function), "depth_mm")
    others = mistakes.mistakes("01.project", 3, 5, sources, before, [itself])
    assert found[0].explanation == first.explanation
    assert next(others).explanation == found[1].explanation
    told = [shown, found[0].explorer]  # what another exercise's mistake shows already is not shown again
    assert next(mistakes.mistakes("01.project", 3, 5, sources, before, told)).title == found[1].title
    assert list(mistakes.mistakes("01.project", 3, 5, {5: "explore(PinholeView())"}, before, [shown])) == []


def test_two_mistakes_that_draw_one_picture_are_shown_once(monkeypatch):
    project = exercises("01")["01.project"]
    first, second, *_ = project.misconceptions
    alike = SimpleNamespace(misconceptions=[first, first, second])
    monkeypatch.setattr("camviz_school.course.exercises.exercises", lambda lesson: {"01.project": alike})
    names = {"PinholeView": PinholeView, "explore": explore, "project": project.reference}
    sources = {5: "explore(PinholeView(panels='picture yours', yours=project), 'depth_mm')"}
    shown = mistakes.value_of(sources[5], dict(names))
    found = mistakes.mistakes("01.project", 3, 5, sources, {3: names, 5: names}, [shown])
    assert [one.explanation for one in found] == [first.explanation, second.explanation]


def test_a_pane_with_mistakes_shows_the_solution_first_and_says_so():
    one = mistakes.Mistake("upside down", "It stands on its *head*.", None)
    html = mistakes.drawn_with("<i>right</i>", [(one, "<i>wrong</i>")])
    assert re.findall(r'class="camviz-with"( hidden)?', html) == ["", " hidden"]
    assert html.index(">the solution<") < html.index(">upside down<") < html.index("<i>right</i>")
    assert html.index("<i>right</i>") < html.index("<em>head</em>") < html.index("<i>wrong</i>")
    assert "<button" not in mistakes.drawn_with("<i>right</i>", [])


def test_a_build_that_is_killed_leaves_no_recorder_behind(tmp_path):
    """SIGKILL, which no process hears."""
    builder = tmp_path / "builder.py"
    builder.write_text(
        f"""import multiprocessing, os, sys, time
from concurrent.futures import ProcessPoolExecutor
sys.path[:0] = [{str(ROOT / "tools/website")!r}, {str(ROOT)!r}]
from panes import end_with_parent

def work(folder):
    open(f"{{folder}}/started", "w").write(str(os.getpid()))
    time.sleep(600)

if __name__ == "__main__":
    spawn = multiprocessing.get_context("spawn")
    with ProcessPoolExecutor(1, mp_context=spawn, initializer=end_with_parent) as pool:
        pool.submit(work, sys.argv[1]).result()
"""
    )
    with subprocess.Popen([sys.executable, builder, tmp_path]) as parent:
        while not ((started := tmp_path / "started").exists() and started.read_text()):
            assert parent.poll() is None
            time.sleep(0.05)
        parent.kill()
    child = psutil.Process(int(started.read_text())) if psutil.pid_exists(int(started.read_text())) else None
    assert child is None or child.wait(60) is None
