"""Answers in a real JupyterLab and Notebook 7: there again after a run, a restart, and in a closed notebook."""

import json

import pytest
from laboratory import FRONT_ENDS, NOTEBOOKS_OWN, ROOT, Notebook, jupyter

from camviz_school.course.questions import question

pytestmark = pytest.mark.browser

PREDICT = question("05.far_rays")
WRONG = (PREDICT.answer + 1) % len(PREDICT.choices)
RESTART = """async () => {
  const { session } = jupyterapp.shell.currentWidget.sessionContext;
  await session.kernel.restart();
  while (session.kernel.status !== "idle") await hands.pause(50);
}"""
OPENED = """async () => {
  const { context, sessionContext } = jupyterapp.shell.currentWidget;
  await context.ready;
  await sessionContext.ready;
  await sessionContext.session.kernel.info;
  await hands.pause(1000);
  return context.model.dirty;
}"""
# The page shows a reply before the notebook has the picture that it will be saved with.
IN_THE_NOTEBOOK = "words => JSON.stringify(jupyterapp.shell.currentWidget.context.model.toJSON()).includes(words)"
SMALL = """(least) => [...document.querySelectorAll(
    ".camviz-choice, .camviz-question button, .camviz-question summary")]
  .filter((one) => one.offsetParent && one.getBoundingClientRect().height < least).map((one) => one.textContent)"""
TINY = """() => [...document.querySelectorAll(".camviz-question *")]
  .filter((one) => one.offsetParent && parseFloat(getComputedStyle(one).fontSize) < 12).map((one) => one.textContent)"""


@pytest.fixture
def folder(tmp_path):
    (tmp_path / "lab").mkdir()
    sources = ["from camviz_school.widgets import ask, quiz", 'ask("05.far_rays")', 'quiz("05")']
    cells = [
        {"cell_type": "code", "metadata": {}, "source": source, "outputs": [], "execution_count": None, "id": f"c{i}"}
        for i, source in enumerate(sources)
    ]
    kernel = {"kernelspec": {"name": "python3", "display_name": "Python 3", "language": "python"}}
    notebook = {"cells": cells, "metadata": kernel, "nbformat": 4, "nbformat_minor": 5}
    (tmp_path / "lab/answers.ipynb").write_text(json.dumps(notebook))
    lesson = json.loads((ROOT / "lessons/05_distortion.ipynb").read_text(encoding="utf-8"))
    lesson["metadata"]["language_info"]["version"] = "3.0.0"  # another Python than the reader's
    (tmp_path / "lab/lesson.ipynb").write_text(json.dumps(lesson), encoding="utf-8")
    return tmp_path


@pytest.fixture(params=FRONT_ENDS)
def address(request, folder):
    with jupyter(request.param, folder / "lab", folder / "private") as address:
        yield address


def asked(notebook, title="Predict"):
    return notebook.page.locator(f".camviz-question[aria-label='{title}']")


def commit(form, index):
    form.locator("input[type=radio]").nth(index).check()
    form.get_by_role("button", name="Commit").click()
    form.locator(".camviz-right, .camviz-wrong").wait_for()


def run(notebook):
    notebook.run_all()
    asked(notebook).locator("form").wait_for()


def assert_answered_earlier(notebook):
    reply = asked(notebook).get_by_role("status").first
    reply.get_by_text("You answered this earlier.").wait_for()
    assert "Not this one." in reply.inner_text()
    assert asked(notebook).locator("input").nth(WRONG).is_checked()
    fieldset = asked(notebook).locator("fieldset")
    assert fieldset.get_attribute("aria-describedby") == reply.get_attribute("id")


def test_an_answer_is_there_again_until_one_starts_again(browser, address, folder):
    notebook = Notebook(browser, address, "answers.ipynb")
    run(notebook)
    commit(asked(notebook).locator("form"), WRONG)
    assert "earlier" not in asked(notebook).inner_text()
    commit(asked(notebook, "Exit quiz").locator("form").first, 0)

    run(notebook)
    assert_answered_earlier(notebook)
    notebook.page.evaluate(RESTART)
    run(notebook)
    assert_answered_earlier(notebook)

    commit(asked(notebook).locator("form"), PREDICT.answer)
    asked(notebook).get_by_text("✓ Correct.").wait_for()
    notebook.page.wait_for_function(IN_THE_NOTEBOOK, arg="✓ Correct.")
    notebook.page.evaluate("() => jupyterapp.commands.execute('docmanager:save')")
    notebook.close()

    notebook = Notebook(browser, address, "answers.ipynb")
    still = notebook.page.locator("[data-camviz-still]").first
    still.get_by_text("(your answer)").wait_for()
    assert "✓ Correct." in still.inner_text()
    run(notebook)
    assert asked(notebook).locator("input").nth(PREDICT.answer).is_checked()
    assert "✓ Correct." in asked(notebook).inner_text()
    assert asked(notebook, "Exit quiz").locator(".camviz-right, .camviz-wrong").count() == 1

    asked(notebook).get_by_role("button", name="Start again").focus()
    notebook.page.keyboard.press("Enter")
    asked(notebook).get_by_text("Your answers here are cleared.").wait_for()
    assert notebook.page.evaluate("document.activeElement.type") == "radio"
    assert asked(notebook).locator("input:checked").count() == 0
    run(notebook)
    assert asked(notebook).locator("input:checked, .camviz-right").count() == 0
    assert asked(notebook, "Exit quiz").locator(".camviz-right, .camviz-wrong").count() == 1
    assert set(notebook.errors) <= {NOTEBOOKS_OWN}
    notebook.close()


def test_a_lesson_that_was_opened_is_not_unsaved(browser, address):
    notebook = Notebook(browser, address, "lesson.ipynb")
    assert notebook.page.evaluate(OPENED) is False
    notebook.close()


def test_every_word_can_be_read_and_every_target_hit(browser, address):
    notebook = Notebook(browser, address, "answers.ipynb")
    run(notebook)
    commit(asked(notebook).locator("form"), WRONG)
    forms = asked(notebook, "Exit quiz").locator("form").all()
    for one in forms:
        commit(one, 0)
    words = ".camviz-question *"
    for theme, scheme in (("JupyterLab Dark", "dark"), ("JupyterLab Light", "light")):
        notebook.theme(theme)
        assert notebook.page.evaluate("selector => hands.weak(selector)", words) == []
        radio = asked(notebook).locator("input").first
        assert radio.evaluate("one => getComputedStyle(one).colorScheme") == scheme
    assert notebook.page.evaluate(SMALL, 24) == []
    assert notebook.page.evaluate(TINY) == []
    devtools = notebook.page.context.new_cdp_session(notebook.page)
    devtools.send("Emulation.setTouchEmulationEnabled", {"enabled": True})
    assert notebook.page.evaluate("matchMedia('(pointer: coarse)').matches")
    assert notebook.page.evaluate(SMALL, 32) == []
    notebook.page.emulate_media(forced_colors="active")
    assert asked(notebook).locator(".camviz-wrong").evaluate("one => getComputedStyle(one).borderLeftWidth") == "4px"
    notebook.close()
