"""Functions that never return, in a real JupyterLab: what the reader sees, and that the kernel lives."""

import json

import pytest
from laboratory import Notebook, jupyterlab

pytestmark = pytest.mark.browser

SETUP = """from camviz_school.course.exercises import Tutor
from camviz.views.distortion import DistortionView
from camviz.widgets import explore
check = Tutor()

def endless(k1):
    while True:
        try:
            k1 += 1
        except:
            k1 = 0

def endless_beyond(xy, k1, k2, k3):
    while k1 > 0.1:
        pass
    return xy

print("ready")
"""
CHECK = 'check("05.fold_radius", endless)'
VIEW = """explore(DistortionView(yours=endless_beyond, k1=0.0, panels='picture yours'), 'k1')"""
ALIVE = "print('alive ' * 2)"
RUN = """async (index) => {
  const { content, context, sessionContext } = jupyterapp.shell.currentWidget;
  await context.ready;
  await sessionContext.ready;
  content.activeCellIndex = index;
  content.deselectAll();
  return void jupyterapp.commands.execute("notebook:run-cell");
}"""


@pytest.fixture(scope="module")
def notebook(browser, tmp_path_factory):
    home = tmp_path_factory.mktemp("endless")
    (home / "lab").mkdir()
    cells = [
        {"cell_type": "code", "metadata": {}, "source": source, "outputs": [], "execution_count": None, "id": f"c{i}"}
        for i, source in enumerate((SETUP, CHECK, VIEW, ALIVE))
    ]
    kernel = {"kernelspec": {"name": "python3", "display_name": "Python 3", "language": "python"}}
    notebook = {"cells": cells, "metadata": kernel, "nbformat": 4, "nbformat_minor": 5}
    (home / "lab/endless.ipynb").write_text(json.dumps(notebook))
    with jupyterlab(home / "lab", home / "private") as address:
        opened = Notebook(browser, address, "endless.ipynb")
        opened.page.evaluate(RUN, 0)
        cell(opened, 0).get_by_text("ready").wait_for()
        yield opened
        opened.close()


def cell(notebook, index):
    return notebook.page.locator(".jp-Cell").nth(index).locator(".jp-Cell-outputArea")


def assert_alive(notebook):
    notebook.page.evaluate(RUN, 3)
    cell(notebook, 3).get_by_text("alive alive").wait_for()


def test_an_endless_exercise_is_announced_and_then_stopped(notebook):
    notebook.page.evaluate(RUN, 1)
    cell(notebook, 1).get_by_text("still running: press ■ to stop").wait_for()
    cell(notebook, 1).get_by_text("had not returned after 10 s, and was stopped.").wait_for()
    assert_alive(notebook)


def test_the_stop_button_brings_a_sentence_and_no_traceback(notebook):
    notebook.page.evaluate(RUN, 1)
    cell(notebook, 1).get_by_text("still running: press ■ to stop").wait_for()
    notebook.page.locator("[data-command='notebook:interrupt-kernel'], [title^='Interrupt']").first.click()
    cell(notebook, 1).get_by_text("You stopped").wait_for()
    assert "Traceback" not in cell(notebook, 1).inner_text()
    assert_alive(notebook)


def test_a_view_whose_control_leads_into_a_loop_says_so_and_goes_on(notebook):
    notebook.page.evaluate(RUN, 2)
    notebook.page.wait_for_selector(".camviz-explorer .camviz-picture svg")
    explorer = notebook.page.query_selector(".camviz-explorer")
    explorer.evaluate("root => hands.move(root, 'k1', 1)")
    view = cell(notebook, 2)
    view.locator(".camviz-error").get_by_text("Your function is still running").wait_for()
    view.get_by_text("`endless_beyond` had not returned after 10 s").first.wait_for()
    explorer.evaluate("root => hands.settled(root)")
    assert explorer.evaluate("hands.error") == ""
    assert_alive(notebook)
    assert notebook.errors == []
