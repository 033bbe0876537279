"""Controls under fingers, keys and screen readers, and without a kernel: in JupyterLab, with --all in Notebook 7."""

import json
import re

import pytest
from laboratory import NOTEBOOKS_OWN, Notebook, jupyter

pytestmark = pytest.mark.browser

CELLS = (
    "from camviz.views.distortion import DistortionView\nfrom camviz.widgets import explore\n"
    "lens = explore(DistortionView(), 'k1', 'k2', 'show')\nlens",
    "explore(DistortionView(), 'k1')",
    "import os",
)
FIRST = ".camviz-explorer >> nth=0"
STILL = "() => jupyterapp.shell.currentWidget.content.model.toJSON().cells[0].outputs[0].data['text/html']"
CANCELLED = "Error: Canceled future for create_subshell_request"  # of JupyterLab, where its kernel goes
NEW_KERNEL = """async () => {
  const dialog = document.querySelector(".jp-Dialog button");  // in which JupyterLab says the same
  dialog?.click();
  await jupyterapp.shell.currentWidget.sessionContext.changeKernel({ name: "python3" });
}"""
KERNEL = "jupyterapp.shell.currentWidget.sessionContext.session.kernel"


@pytest.fixture(scope="module", params=["JupyterLab", pytest.param("Notebook 7", marks=pytest.mark.thorough)])
def opened(request, browser, tmp_path_factory):
    """Two visualizers of one name, on a touch screen."""
    home = tmp_path_factory.mktemp("controls")
    (home / "lab").mkdir()
    empty = {"cell_type": "code", "metadata": {}, "outputs": [], "execution_count": None}
    cells = [{**empty, "source": source, "id": f"cell{i}"} for i, source in enumerate(CELLS)]
    kernel = {"kernelspec": {"name": "python3", "display_name": "Python 3", "language": "python"}}
    saved = {"cells": cells, "metadata": kernel, "nbformat": 4, "nbformat_minor": 5}
    (home / "lab/controls.ipynb").write_text(json.dumps(saved))
    with jupyter(request.param, home / "lab", home / "private") as address:
        size = {"width": 1000, "height": 800}
        opened = Notebook(browser, address, "controls.ipynb", has_touch=True, viewport=size)
        opened.page.evaluate("jupyterapp.shell.collapseLeft()")
        opened.again = lambda: Notebook(browser, address, "controls.ipynb")
        opened.run_all()
        yield opened
        opened.close()


@pytest.fixture
def notebook(opened):
    """The notebook with its first visualizer in its first state, at the upper edge."""
    opened.first = opened.page.query_selector(FIRST)
    opened.first.evaluate("root => { hands.reset(root); root.scrollIntoView(); }")
    opened.first.evaluate("root => hands.settled(root)")
    yield opened
    assert [error for error in opened.errors if not error.startswith((CANCELLED, NOTEBOOKS_OWN))] == []


def swipe(notebook, x: float, y: float, dx: float, dy: float, moves: int = 15) -> float:
    """A finger's way over the page until the picture rests; by how much the notebook has scrolled."""
    scrolled = notebook.swipe(x, y, dx, dy, moves)
    notebook.first.evaluate("root => hands.settled(root)")
    return scrolled


def slider(notebook):
    return notebook.page.locator(FIRST).locator("[data-control=k1] input[type=range]")


def number(notebook):
    return notebook.page.locator(FIRST).locator("[data-control=k1] input[type=number]")


def values(notebook) -> tuple[str, str]:
    notebook.first.evaluate("root => hands.settled(root)")
    return slider(notebook).input_value(), number(notebook).input_value()


def test_a_finger_drags_a_handle_all_the_way_and_scrolls_beside_it(notebook):
    x, y = notebook.first.evaluate("root => hands.grip(root, 'orbit')")
    before = notebook.first.evaluate("root => hands.picture(root)")
    notebook.first.evaluate("root => hands.countMoves(root)")
    assert swipe(notebook, x, y, 40, -60) == 0
    assert notebook.page.evaluate("moves") == 15
    after = notebook.first.evaluate("root => hands.picture(root)")
    assert after != before
    box = notebook.page.locator(FIRST).locator(".camviz-picture").bounding_box()
    assert swipe(notebook, box["x"] + 20, y, 0, 150) < -50
    assert notebook.first.evaluate("root => hands.picture(root)") == after


def test_a_finger_that_scrolls_leaves_the_slider_and_one_that_goes_sideways_moves_it(notebook):
    box = slider(notebook).bounding_box()
    x, y = box["x"] + 0.8 * box["width"], box["y"] + box["height"] / 2
    assert swipe(notebook, x, y, 12, -150) > 50
    assert values(notebook) == ("-0.28", "-0.28")
    y = slider(notebook).bounding_box()["y"] + box["height"] / 2
    swipe(notebook, x, y, -60, 5)
    assert -0.28 < float(values(notebook)[0]) < 0.5
    swipe(notebook, x, y, 0, 0, 0)  # a tap
    assert float(values(notebook)[0]) > 0.5


def test_every_target_is_large_enough_for_a_finger(notebook):
    """24 pixels under a mouse (WCAG 2.2, 2.5.8), 32 on a touch screen."""
    small = """(root, least) => [...root.querySelectorAll(".camviz-controls :is(input, select, button)")]
      .filter((one) => one.getBoundingClientRect().height < least).map((one) => one.outerHTML)"""
    coarse = notebook.page.evaluate("matchMedia('(pointer: coarse)').matches")
    assert notebook.first.evaluate(small, 32 if coarse else 24) == []


def test_a_number_beyond_the_slider_is_held_at_its_end_in_words(notebook):
    slider(notebook).focus()
    number(notebook).fill("7")
    number(notebook).press("Enter")
    assert values(notebook) == ("1", "1")
    said = "k1 goes from -1 to 1: 7 is held at 1."
    assert notebook.page.locator(FIRST).locator(".camviz-help").inner_text() == said
    number(notebook).fill("")
    number(notebook).press("Enter")
    assert values(notebook) == ("1", "1")


def test_one_control_goes_back_by_the_keyboard_alone(notebook):
    slider(notebook).focus()
    for key in ("ArrowRight", "ArrowRight"):
        notebook.page.keyboard.press(key)
    notebook.page.locator(FIRST).locator("[data-control=k2] input[type=number]").fill("0.2")
    notebook.page.keyboard.press("Enter")
    assert values(notebook) != ("-0.28", "-0.28")
    back = notebook.page.get_by_role("button", name="Reset k1")
    assert back.count() == 1  # of the two visualizers, one has moved
    number(notebook).focus()
    notebook.page.keyboard.press("Tab")
    notebook.page.keyboard.press("Enter")
    assert values(notebook) == ("-0.28", "-0.28")
    assert slider(notebook).evaluate("it => it === document.activeElement")
    assert not back.is_visible()
    assert "k1 −0.2800" in notebook.page.locator(FIRST).locator(".camviz-picture").text_content()
    assert notebook.page.locator(FIRST).locator("[data-control=k2] input[type=range]").input_value() == "0.2"


def test_help_needs_no_mouse(notebook):
    words = slider(notebook).evaluate("it => document.getElementById(it.getAttribute('aria-describedby')).textContent")
    assert words.endswith("-1 to 1, at first -0.28")
    slider(notebook).focus()
    assert notebook.page.locator(FIRST).locator(".camviz-help").inner_text() == words


def test_a_screen_reader_is_told_what_has_changed_and_two_groups_have_two_names(notebook):
    said = notebook.page.locator(FIRST).locator("[role=status]")
    slider(notebook).focus()
    for key, told in (("ArrowRight", "k1 = -0.27"), ("Home", "k1 = -1")):  # whatever the test before this one left
        notebook.page.keyboard.press(key)
        arrived = "([it, told]) => it.textContent.includes(told)"
        notebook.page.wait_for_function(arrived, arg=[said.element_handle(), told])
    assert "farthest a ray lands no limit" not in said.inner_text()  # as before
    groups = notebook.page.locator(".camviz-explorer, .camviz-controls")
    assert len(set(groups.evaluate_all("all => all.map((one) => one.ariaLabel)"))) == 4


def test_the_controls_stay_in_sight(notebook):
    controls = notebook.page.locator(FIRST).locator(".camviz-controls")
    notebook.page.evaluate("() => { document.querySelector('.jp-WindowedPanel-outer').scrollTop += 250; }")
    notebook.page.wait_for_timeout(200)
    top = notebook.page.locator(".jp-WindowedPanel-outer").bounding_box()["y"]
    assert controls.bounding_box()["y"] == pytest.approx(top, abs=1)


def test_large_words_for_the_back_row_make_room_for_each_other(notebook):
    smallest = """root => Math.min(...[...root.querySelectorAll(".camviz-fitted text")]
      .filter((one) => one.getClientRects().length && one.textContent.trim())
      .map((one) => [parseFloat(getComputedStyle(one).fontSize), one.getScreenCTM()])
      .map(([size, { a, b }]) => size * Math.hypot(a, b)))"""
    button = notebook.page.locator(FIRST).locator("[data-action=scale]")
    for least, pressed in ((24, "true"), (12, "false")):
        button.click()
        assert button.get_attribute("aria-pressed") == pressed
        notebook.page.wait_for_timeout(300)  # until the kernel has been told
        notebook.first.evaluate("root => hands.settled(root)")
        assert least - 0.1 <= notebook.first.evaluate(smallest) < 1.5 * least
        assert notebook.first.evaluate("root => hands.unreadable(root)") == []


@pytest.mark.parametrize("theme", ["Light", "Dark"])
def test_inputs_follow_the_theme(notebook, theme):
    notebook.theme(f"JupyterLab {theme}")
    assert slider(notebook).evaluate("it => getComputedStyle(it).colorScheme") == theme.lower()
    weak = "hands.weak('.camviz-controls :is(label, .unit, select, button, input[type=number], p)')"
    assert notebook.page.evaluate(weak) == []


def test_the_saved_picture_is_the_one_that_was_left(notebook):
    assert "k1 = -0.28" in notebook.page.evaluate(STILL)
    slider(notebook).focus()
    notebook.page.keyboard.press("End")
    notebook.page.wait_for_function(f"() => ({STILL})().includes('k1 = 1,')")
    assert not notebook.page.locator("[data-camviz-still]").first.is_visible()
    notebook.page.evaluate("() => jupyterapp.commands.execute('docmanager:save')")
    later = notebook.again()
    picture = later.page.locator("[data-camviz-still] img").first
    picture.wait_for()
    assert "k1 = 1," in picture.get_attribute("alt")
    later.page.close()


def test_a_later_view_of_a_visualizer_leaves_its_words_where_they_have_room(notebook):
    """The kernel drew for a narrow window last, where words stand aside that need not in a wide one."""
    run = """async (source) => {
      const { content } = jupyterapp.shell.currentWidget;
      content.activeCellIndex = 2;
      content.activeCell.model.sharedModel.setSource(source);
      await jupyterapp.commands.execute("notebook:run-cell");
    }"""

    def shown(number: int) -> str:
        explorer = notebook.page.wait_for_selector(f".camviz-explorer >> nth={number}")
        explorer.scroll_into_view_if_needed()
        notebook.page.wait_for_timeout(500)  # until the tiles have their sizes, and the kernel is asked
        explorer.evaluate("root => hands.settled(root)")
        return explorer.evaluate("root => hands.picture(root)")

    notebook.page.set_viewport_size({"width": 420, "height": 800})
    narrow = shown(0)
    notebook.page.evaluate("() => jupyterapp.shell.currentWidget.content.widgets[0].model.clearExecution()")
    notebook.page.set_viewport_size({"width": 1400, "height": 800})
    notebook.page.evaluate(run, "lens")
    later = shown(1)
    notebook.page.evaluate(run, "import os")
    notebook.run_all()
    fresh = shown(0)
    notebook.page.set_viewport_size({"width": 1000, "height": 800})
    shown(0)
    assert narrow != fresh
    assert later == fresh


@pytest.mark.parametrize(
    ("end", "words"),
    [
        (f"() => {KERNEL}.restart()", "The kernel was restarted"),
        (f"() => {{ {KERNEL}.requestExecute({{ code: 'os._exit(1)' }}); }}", "The kernel died and was started again"),
        ("() => jupyterapp.shell.currentWidget.sessionContext.shutdown()", "The kernel was shut down"),
    ],
)
def test_a_kernel_that_is_gone_is_told_without_being_asked(notebook, end, words):
    """Nothing is asked of the kernel, so that no time limit runs out."""
    notebook.page.evaluate(end)
    told = notebook.page.locator(FIRST).locator("[role=alert]")
    told.get_by_text(re.compile(words)).wait_for()
    slider(notebook).evaluate("it => { it.value = 0; it.dispatchEvent(new Event('input')); }")
    assert notebook.first.get_attribute("data-busy") == "false"
    notebook.page.evaluate(NEW_KERNEL)
    notebook.run_all()
