"""Explorers beside other widgets in a real JupyterLab: linked in kernel and page, in boxes and tabs, in outputs."""

import json

import pytest
from laboratory import Notebook, jupyterlab

pytestmark = pytest.mark.browser

CELLS = (
    "from ipywidgets import FloatSlider, HBox, Tab, VBox, interactive_output, jslink\nfrom traitlets import link\n"
    "from camviz.views.distortion import DistortionView\nfrom camviz.widgets import explore\n"
    "one, other = explore(DistortionView(), 'k1'), explore(DistortionView(), 'k1', 'k2')\n"
    "by_kernel, by_page = FloatSlider(min=-1, max=1, step=0.01), FloatSlider(min=-1, max=1, step=0.01)\n"
    "link((one, 'k1'), (other, 'k1'))\nlink((by_kernel, 'value'), (one, 'k1'))\n"
    "jslink((by_page, 'value'), (other, 'k2'))\n"
    "VBox([HBox([by_kernel, by_page]), Tab([one, other], titles=['one', 'other'])])",
    "one.k1 = -0.2\nprint(one.k1, other.k1, by_kernel.value)",
    "interactive_output(lambda view: print(f'seen k1 = {view.k1:.2f}'), {'view': one})",
)


@pytest.fixture(scope="module")
def notebook(browser, tmp_path_factory):
    home = tmp_path_factory.mktemp("links")
    (home / "lab").mkdir()
    empty = {"cell_type": "code", "metadata": {}, "outputs": [], "execution_count": None}
    cells = [{**empty, "source": source, "id": f"cell{i}"} for i, source in enumerate(CELLS)]
    kernel = {"kernelspec": {"name": "python3", "display_name": "Python 3", "language": "python"}}
    saved = {"cells": cells, "metadata": kernel, "nbformat": 4, "nbformat_minor": 5}
    (home / "lab/links.ipynb").write_text(json.dumps(saved))
    with jupyterlab(home / "lab", home / "private") as address:
        opened = Notebook(browser, address, "links.ipynb")
        opened.cells = opened.run_all()
        yield opened
        opened.close()


def explorers(notebook):
    notebook.page.wait_for_function(
        "() => document.querySelectorAll('.camviz-explorer .camviz-picture svg').length > 1"
    )
    found = notebook.page.query_selector_all(".camviz-explorer")
    for one in found:
        one.evaluate("root => hands.settled(root)")
    return found


def shown(explorer, control: str) -> float:
    return float(
        explorer.evaluate("(root, name) => root.querySelector(`[data-control='${name}'] input`).value", control)
    )


def come_to(notebook, explorer, control: str, value: float) -> None:
    """Wait until a control of an explorer shows that value, and its picture rests."""
    at = "([root, name, value]) => Math.abs(root.querySelector(`[data-control='${name}'] input`).value - value) < 1e-6"
    notebook.page.wait_for_function(at, arg=[explorer, control, value])
    explorer.evaluate("root => hands.settled(root)")


def press(notebook, slider: int, key: str, times: int) -> None:
    """Keys on one of the notebook's own sliders."""
    handle = notebook.page.locator(".widget-slider .noUi-handle, .widget-slider [role=slider]").nth(slider)
    handle.focus()
    for _ in range(times):
        notebook.page.keyboard.press(key)


def test_code_moves_both_explorers_and_the_slider(notebook):
    one, other = explorers(notebook)
    assert "-0.2 -0.2 -0.2" in "".join(notebook.cells[1]["outputs"][0]["text"])
    assert shown(one, "k1") == shown(other, "k1") == -0.2


def test_the_stills_are_saved_with_their_tabs_and_hidden_while_the_tab_lives(notebook):
    explorers(notebook)
    kept = "".join(notebook.cells[0]["outputs"][0]["data"]["text/html"])
    assert kept.count("<figure") == 2
    assert "<b>one</b>" in kept
    assert "<b>other</b>" in kept
    stills = notebook.page.locator("[data-camviz-still]")
    assert stills.count() == 2
    assert not any(still.is_visible() for still in stills.all())


def test_a_hand_on_one_moves_the_other_and_the_slider_and_all_come_to_rest(notebook):
    one, other = explorers(notebook)
    before = other.evaluate("root => hands.picture(root)")
    one.evaluate("root => hands.move(root, 'k1', 0.9)")
    one.evaluate("root => hands.settled(root)")
    come_to(notebook, other, "k1", shown(one, "k1"))
    assert other.evaluate("root => hands.picture(root)") != before
    readout = float(notebook.page.locator(".widget-readout").first.inner_text())
    assert abs(readout - shown(one, "k1")) < 0.006
    rendered = [root.evaluate("root => root.dataset.rendered") for root in (one, other)]
    notebook.page.wait_for_timeout(500)
    assert [root.evaluate("root => root.dataset.rendered") for root in (one, other)] == rendered
    notebook.page.get_by_text(f"seen k1 = {shown(one, 'k1'):.2f}").wait_for(state="attached")  # interactive_output's


def test_sliders_linked_in_the_kernel_and_in_the_page_move_the_pictures(notebook):
    one, other = explorers(notebook)
    one.evaluate("root => hands.move(root, 'k1', 0.5)")
    one.evaluate("root => hands.settled(root)")
    start = shown(one, "k1")
    press(notebook, 0, "ArrowRight", 3)
    come_to(notebook, other, "k1", start + 0.03)
    start = shown(other, "k2")  # which of two linked values holds at first is the page's to say
    press(notebook, 1, "ArrowRight", 2)
    come_to(notebook, other, "k2", start + 0.02)
    assert notebook.errors == []
    assert [root.evaluate("root => hands.error(root)") for root in (one, other)] == ["", ""]
