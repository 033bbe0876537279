"""Both forms of a quiz in a real JupyterLab: answered by keyboard, kept over a restart, exported to a file."""

import json

import pytest
from laboratory import Notebook, jupyterlab
from playwright.sync_api import expect

from camviz_school.course.answers import KEPT_IN, read_answers
from camviz_school.course.questions import quiz_questions

pytestmark = pytest.mark.browser

RESTART = """async () => {
  const { session } = jupyterapp.shell.currentWidget.sessionContext;
  await session.kernel.restart();
  while (session.kernel.status !== "idle") await hands.pause(50);
}"""


@pytest.fixture
def folder(tmp_path):
    (tmp_path / "lab").mkdir()
    sources = ["from camviz_school.widgets import quiz", 'quiz("05", "A")', 'quiz("05")']
    cells = [
        {"cell_type": "code", "metadata": {}, "source": source, "outputs": [], "execution_count": None, "id": f"c{i}"}
        for i, source in enumerate(sources)
    ]
    kernel = {"kernelspec": {"name": "python3", "display_name": "Python 3", "language": "python"}}
    (tmp_path / "lab/forms.ipynb").write_text(
        json.dumps({"cells": cells, "metadata": kernel, "nbformat": 4, "nbformat_minor": 5})
    )
    return tmp_path


@pytest.fixture
def notebook(browser, folder):
    with jupyterlab(folder / "lab", folder / "private") as address:
        opened = Notebook(browser, address, "forms.ipynb")
        yield opened
        opened.close()


def quiz_of(notebook, title):
    """The quiz of that title; a page that draws it anew has two of them for a moment."""
    found = notebook.page.locator(f".camviz-question[aria-label='{title}']")
    expect(found).to_have_count(1)
    return found


def choose(form, index):
    """Tab to the first choice, arrows to another one, Tab to the button, Enter."""
    form.locator("input[type=radio]").first.focus()
    form.page.keyboard.press("Space")
    for _ in range(index):
        form.page.keyboard.press("ArrowDown")
    form.page.keyboard.press("Tab")
    form.page.keyboard.press("Enter")
    form.locator("button:disabled").wait_for(state="attached")


def test_before_and_after_by_keyboard_over_a_restart_into_a_file(notebook, folder):
    notebook.run_all()
    before = quiz_of(notebook, "What do you think now?")
    forms = before.locator("form").all()
    for form in forms[:2]:
        choose(form, 1)
    assert {form.locator("[role=status]").inner_text() for form in forms[:2]} == {
        "Kept. The answers come with the quiz at the end."
    }
    assert forms[0].locator("input:disabled").count() == 3
    assert notebook.page.evaluate("document.activeElement.className").startswith("camviz-reply")

    notebook.page.evaluate(RESTART)
    notebook.run_all()
    forms = before.locator("form").all()
    assert [form.locator("input:checked").count() for form in forms] == [1, 1, 0, 0]
    for form in forms[2:]:
        choose(form, 0)
    expect(before.locator(".camviz-summary")).to_contain_text(KEPT_IN)
    assert before.locator(".camviz-right, .camviz-wrong").count() == 0

    after = quiz_of(notebook, "Exit quiz")
    export = after.get_by_role("button", name="Write my answers")
    for one, form in zip(quiz_questions("05"), after.locator("form").all(), strict=True):
        assert not export.is_visible()
        choose(form, one.answer)
    after.locator("summary").focus()
    notebook.page.keyboard.press("Enter")
    assert after.locator("details[open] blockquote").count() >= 4
    export.focus()
    notebook.page.keyboard.press("Enter")
    after.get_by_text("Written to answers_05_").wait_for()
    (path,) = (folder / "lab").glob("answers_05_*.csv")
    answers = read_answers(path)
    assert [one.choice for one in answers if one.when == "before"] == ["b", "b", "a", "a"]
    assert [one.correct for one in answers if one.when == "after"] == [True] * 4
    assert notebook.errors == []


@pytest.mark.parametrize(
    ("width", "theme"),
    [
        (390, "JupyterLab Light"),
        (1366, "JupyterLab Dark"),
        pytest.param(390, "JupyterLab Dark", marks=pytest.mark.thorough),
        pytest.param(1366, "JupyterLab Light", marks=pytest.mark.thorough),
    ],
)
def test_both_forms_fit_and_can_be_read(notebook, folder, width, theme):
    notebook.page.set_viewport_size({"width": width, "height": 900})
    if width < 500:
        notebook.page.evaluate("() => jupyterapp.shell.collapseLeft()")
    notebook.theme(theme)
    notebook.run_all()  # after the theme, which has every output drawn anew
    before = quiz_of(notebook, "What do you think now?")
    choose(before.locator("form").first, 1)
    for one in (before, quiz_of(notebook, "Exit quiz")):
        one.scroll_into_view_if_needed()
        assert one.evaluate("root => root.scrollWidth <= root.clientWidth + 1")
    words = ".camviz-question label, .camviz-reply p, .camviz-lead"
    assert notebook.page.evaluate("selector => hands.weak(selector)", words) == []
