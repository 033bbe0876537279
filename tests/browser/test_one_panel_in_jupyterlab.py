"""Lesson 05 begins with one panel and one slider; readers open more, and a right answer draws what waited for it."""

import pytest
from laboratory import ROOT, Notebook

from camviz_school.course import notebooks

pytestmark = pytest.mark.browser

LESSON = "05_distortion.ipynb"
SOLVED = """async (solution) => {
  const notebook = jupyterapp.shell.currentWidget, cells = notebook.content.widgets;
  const at = cells.findIndex((cell) => cell.model.sharedModel.getSource().startsWith("def distort"));
  cells[at].model.sharedModel.setSource(solution);
  for (const one of [at, at + 1]) {
    notebook.content.activeCellIndex = one;
    await jupyterapp.commands.execute("notebook:run-cell");
  }
  return JSON.stringify(cells[at + 1].model.sharedModel.toJSON().outputs);
}"""


@pytest.fixture(scope="module")
def lesson(browser, address):
    opened = Notebook(browser, address, LESSON, viewport={"width": 1366, "height": 768})
    opened.run_all()
    yield opened
    assert opened.errors == []
    opened.close()


def explorer(lesson, number):
    found = lesson.page.query_selector_all(".camviz-explorer")[number]
    found.scroll_into_view_if_needed()
    found.evaluate("root => hands.settled(root)")
    return found


def tiles(found):
    return [tile.get_attribute("data-tile") for tile in found.query_selector_all(".camviz-tile")]


def press(lesson, found, panel):
    found.query_selector(f"[data-opens={panel}]").click()
    lesson.page.wait_for_timeout(300)
    found.evaluate("root => hands.settled(root)")


def test_the_picture_begins_on_the_first_screen_and_fits_a_small_one_with_its_controls(lesson):
    lesson.page.evaluate("() => document.querySelector('.jp-WindowedPanel-outer').scrollTo(0, 0)")
    found = lesson.page.query_selector(".camviz-explorer")
    picture = found.query_selector(".camviz-picture svg svg").bounding_box()
    assert picture["y"] < 768 - 200  # the coping, which bends, and the lamp are in sight
    assert found.bounding_box()["height"] <= 600
    assert tiles(found) == ["the picture"]
    assert found.evaluate("root => hands.controls(root)") == ["k1"]


def test_each_control_has_a_row_and_a_slider_is_long_enough_for_its_steps(lesson):
    many = lesson.page.query_selector_all(".camviz-explorer")
    rows = [[one.bounding_box()["y"] for one in each.query_selector_all("[data-control]")] for each in many]
    assert max(map(len, rows)) > 3
    assert all(len(set(each)) == len(each) for each in rows)
    lengths = [track.bounding_box()["width"] for one in many for track in one.query_selector_all("input[type=range]")]
    assert min(lengths) > 400


def test_controls_that_stay_in_sight_leave_two_thirds_of_a_small_screen_at_200_percent_to_the_picture(lesson):
    controls = [one.query_selector(".camviz-controls") for one in lesson.shown_in(683, 384)]
    stay = [one for one in controls if "camviz-sticky" in one.get_attribute("class")]
    assert 0 < len(stay) < len(controls)
    assert max(one.bounding_box()["height"] for one in stay) < 384 / 3
    lesson.page.set_viewport_size({"width": 1366, "height": 768})


@pytest.mark.parametrize("width", [375, 1366])
def test_a_button_below_the_picture_opens_a_panel_and_closes_it_again(lesson, width):
    lesson.page.set_viewport_size({"width": width, "height": 768})
    lesson.page.evaluate(f"jupyterapp.shell.{'collapse' if width < 500 else 'expand'}Left()")
    found = explorer(lesson, 0)
    button = found.query_selector("[data-opens=curve]")
    assert (button.inner_text(), button.get_attribute("aria-pressed")) == ("+ radial curve", "false")
    press(lesson, found, "curve")
    assert (button.inner_text(), button.get_attribute("aria-pressed")) == ("− radial curve", "true")
    assert tiles(found) == ["the picture", "radial curve"]
    assert lesson.unreadable(width) == []
    press(lesson, found, "curve")
    assert tiles(found) == ["the picture"]


def test_a_right_answer_draws_the_picture_that_waited_below_it_and_says_so(lesson):
    lesson.page.set_viewport_size({"width": 1366, "height": 768})
    waiting = explorer(lesson, 2)
    assert "yours appears here" in waiting.text_content()
    path = ROOT / "lessons" / LESSON
    said = lesson.page.evaluate(SOLVED, notebooks.solutions(notebooks.read(path))["05.distort"])
    assert "Look at the picture below: your function draws it now." in said
    lesson.page.wait_for_function("root => root.textContent.includes('Bent by your function')", arg=waiting)
    assert "yours appears here" not in waiting.text_content()
