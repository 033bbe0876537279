"""An inspection in a real JupyterLab: findings in words, a chooser of views, and bars that a click chooses by."""

import json
import sys
from pathlib import Path

import pytest
from laboratory import Notebook, jupyterlab

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

pytestmark = pytest.mark.browser

CELL = f"""import sys
sys.path.insert(0, {str(Path(__file__).resolve().parents[1])!r})
from calibrations import sick
from camviz_clinic import inspect
inspect(sick())
"""


@pytest.fixture(scope="module")
def notebook(browser, tmp_path_factory):
    home = tmp_path_factory.mktemp("clinic")
    (home / "lab").mkdir()
    cell = {"cell_type": "code", "metadata": {}, "source": CELL, "outputs": [], "execution_count": None, "id": "a"}
    kernel = {"kernelspec": {"name": "python3", "display_name": "Python 3", "language": "python"}}
    (home / "lab/clinic.ipynb").write_text(
        json.dumps({"cells": [cell], "metadata": kernel, "nbformat": 4, "nbformat_minor": 5})
    )
    with jupyterlab(home / "lab", home / "private") as address:
        opened = Notebook(browser, address, "clinic.ipynb")
        opened.cells = opened.run_all()
        yield opened
        opened.close()


def explorer(notebook):
    notebook.page.wait_for_selector(".camviz-explorer .camviz-picture svg")
    found = notebook.page.query_selector(".camviz-explorer")
    found.evaluate("root => hands.settled(root)")
    return found


def chosen(found) -> str:
    return found.evaluate("root => root.querySelector(\"[data-control='view'] input\").value")


def test_the_output_has_the_findings_the_still_and_the_live_view(notebook):
    outputs = notebook.cells[0]["outputs"]
    kept = ["".join(output["data"].get("text/html", "")) for output in outputs if "data" in output]
    assert "outlier-" in kept[0]
    assert "<img" in kept[1]
    assert explorer(notebook).query_selector(".camviz-picture svg").is_visible()
    assert not notebook.page.locator("[data-camviz-still]").is_visible()
    assert notebook.errors == []


def test_a_click_on_a_bar_chooses_its_view(notebook):
    found = explorer(notebook)
    found.scroll_into_view_if_needed()
    assert chosen(found) == "4"
    box = found.query_selector("[data-drag='bars']").bounding_box()
    notebook.page.mouse.click(box["x"] + box["width"] * 6.5 / 10, box["y"] + box["height"] / 2)
    found.evaluate("root => hands.settled(root)")
    assert chosen(found) == "7"
    notebook.page.keyboard.press("ArrowRight")
    found.evaluate("root => hands.settled(root)")
    assert chosen(found) == "8"


def test_another_view_is_chosen_above_and_the_still_stays_hidden(notebook):
    explorer(notebook)
    notebook.page.locator(".widget-dropdown select").first.select_option(label="Coverage")
    notebook.page.wait_for_selector(".camviz-flow[aria-label^='Coverage']")
    found = explorer(notebook)
    assert found.evaluate("root => hands.controls(root)") == ["cells", "count"]
    assert not notebook.page.locator("[data-camviz-still]").is_visible()
    assert notebook.errors == []
