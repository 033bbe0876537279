"""Lessons in a real JupyterLab, all with --all: they run, controls change the picture, nothing raises."""

import re

import pytest

pytestmark = pytest.mark.browser

THEMES = {"light": "JupyterLab Light", "dark": "JupyterLab Dark"}
BROKEN = ".camviz-error:not([hidden]), .jp-RenderedText[data-mime-type='application/vnd.jupyter.stderr']"
WIDGET_FAILED = re.compile("Error (displaying|creating|rendering) widget|Loading widget|Failed to load")


def outputs(cells):
    """Every output of cells that are not there to show an error."""
    for cell in cells:
        if cell["cell_type"] == "code" and "raises-exception" not in cell["metadata"].get("tags", []):
            yield from cell["outputs"]


def explorers(lesson):
    return lesson.page.query_selector_all(".camviz-explorer")


def driven(lesson, thorough, having):
    """The first and the last visualizer that have something; with --all, every one. Each view's own tests drive all of
    its controls and handles without a browser, and the site's tests all of its panes: here it is the way there and back
    that is tested.
    """
    found = [one for one in explorers(lesson) if one.query_selector(having)]
    return found if thorough or len(found) < 3 else [found[0], found[-1]]


def picture(explorer) -> str:
    """The picture once it rests; fails when the visualizer shows an error."""
    explorer.evaluate("root => hands.settled(root)")
    assert explorer.evaluate("root => hands.error(root)") == ""
    return explorer.evaluate("root => hands.picture(root)")


@pytest.fixture
def window(lesson):
    """Whatever size a test gives the lesson's window, the next test has the first one again."""
    size = lesson.page.viewport_size
    yield
    lesson.page.set_viewport_size(size)


def test_runs_from_top_to_bottom_and_shows_no_error(lesson) -> None:
    shown = [out for out in outputs(lesson.cells) if out["output_type"] == "error" or out.get("name") == "stderr"]
    assert shown == []
    assert lesson.page.locator(BROKEN).all_inner_texts() == []
    assert lesson.page.get_by_text(WIDGET_FAILED).all_inner_texts() == []
    assert lesson.errors == []


def test_shows_a_visualizer_wherever_the_lesson_makes_one(lesson) -> None:
    made = sum("explore(" in cell["source"] for cell in lesson.cells if cell["cell_type"] == "code")
    assert len(explorers(lesson)) >= made


def move(explorer, control: str, place: float) -> str:
    """Move a control to a place between its ends, 0 and 1; the value it then shows."""
    return explorer.evaluate("(root, [name, to]) => hands.move(root, name, to)", [control, place])


def reset(explorer) -> str:
    """Press Reset; the picture it brings."""
    explorer.evaluate("root => hands.reset(root)")
    return picture(explorer)


def acts_on_another(explorer, control: str) -> bool:
    """Whether a control that changes nothing by itself (a lock, a share of something off) does so beside another."""
    for other in explorer.evaluate("root => hands.controls(root)"):
        for end in (0, 1, 1 / 3, 2 / 3, 1 / 2):
            for order in ((other, control), (control, other)):
                seen = set()
                for place in (0, 1):
                    reset(explorer)
                    for name in order:
                        move(explorer, name, place if name == control else end)
                        shown = picture(explorer)
                    seen.add(shown)
                if other != control and len(seen) > 1:
                    return True
    return False


@pytest.mark.by_example
@pytest.mark.parametrize("theme", ["light", pytest.param("dark", marks=pytest.mark.thorough)])
def test_every_control_changes_the_picture_at_both_ends_and_the_middle(lesson, theme, thorough, screenshot) -> None:
    lesson.theme(THEMES[theme])
    still = []
    for number, explorer in enumerate(driven(lesson, thorough, "[data-control]"), 1):
        explorer.scroll_into_view_if_needed()
        screenshot(explorer, f"{number}")
        first = reset(explorer)
        for control in explorer.evaluate("root => hands.controls(root)"):
            seen = set()
            for place in (0, 1, 0.5):
                value = move(explorer, control, place)
                seen.add(picture(explorer))
                if place != 0.5:
                    screenshot(explorer, f"{number}-{control}-{value}")
            assert reset(explorer) == first, f"reset after {control} does not bring the first picture back"
            if len(seen) == 1 and not acts_on_another(explorer, control):
                still.append(f"visualizer {number}: {control}")
    assert still == [], "controls that change nothing"
    assert lesson.errors == []


@pytest.mark.by_example
@pytest.mark.parametrize("theme", ["light", pytest.param("dark", marks=pytest.mark.thorough)])
def test_words_stand_out_from_what_is_behind_them(lesson, theme) -> None:
    """Labels of controls, of questions and in pictures reach a contrast of 4.5 to 1 (WCAG 2.2, 1.4.3)."""
    lesson.theme(THEMES[theme])
    weak = lesson.page.evaluate("selector => hands.weak(selector)", ".camviz-explorer label, .camviz-question label")
    assert weak == []
    assert [explorer.evaluate("root => hands.weakInPicture(root)") for explorer in explorers(lesson)] == [
        [] for _ in explorers(lesson)
    ]


@pytest.mark.by_example
def test_handles_follow_the_pointer(lesson, thorough) -> None:
    for explorer in driven(lesson, thorough, "[data-drag]"):
        for handle in explorer.evaluate("root => hands.handles(root)"):
            before = picture(explorer)
            explorer.scroll_into_view_if_needed()
            x, y = explorer.evaluate("(root, name) => hands.grip(root, name)", handle)
            for aside in (20, -60):  # a bar may be chosen already: then its neighbour is not
                lesson.page.mouse.move(x, y)
                lesson.page.mouse.down()
                lesson.page.mouse.move(x + aside, y + 12, steps=4)
                lesson.page.mouse.up()
                if picture(explorer) != before:
                    break
            assert picture(explorer) != before, handle
            reset(explorer)


@pytest.mark.parametrize("width", [375, pytest.param(1440, marks=pytest.mark.thorough)])
def test_every_word_can_be_read_on_a_telephone_and_on_a_desk(lesson, window, width) -> None:
    """At least 12 CSS pixels, whole, and over no other word."""
    assert lesson.unreadable(width) == []


def test_the_controls_and_the_main_panel_fit_a_small_laptop_together(lesson, window) -> None:
    beyond = [one.evaluate("root => hands.beyond(root)") for one in lesson.shown_in(1366, 768)]
    assert {number: excess for number, excess in enumerate(beyond, 1) if excess > 0} == {}


@pytest.mark.by_example
def test_a_finger_drags_every_handle_all_the_way(lesson, thorough) -> None:
    """The page neither scrolls nor takes the finger away: of 15 moves, 15 arrive. Without --all, a handle a picture."""
    arrived = {}
    for number, explorer in enumerate(driven(lesson, thorough, "[data-drag]"), 1):
        handles = explorer.evaluate("root => hands.handles(root)")
        for handle in handles if thorough else handles[:1]:
            x, y = explorer.evaluate("(root, name) => hands.grip(root, name)", handle)
            explorer.evaluate("root => hands.countMoves(root)")
            scrolled = lesson.swipe(x, y, 30, -60)
            arrived[number, handle] = (lesson.page.evaluate("moves"), scrolled)
            reset(explorer)
    assert {handle: one for handle, one in arrived.items() if one != (15, 0)} == {}


def test_questions_answer_every_choice(lesson) -> None:
    for form in lesson.page.locator(".camviz-question form").all():
        for choice in form.locator("input[type=radio]").all():
            if not choice.is_enabled() or not form.locator("button").is_visible():
                break
            choice.check()
            form.locator("button").click()
            form.locator("button:disabled").wait_for(state="attached")  # the answer is in, the reply has come
            assert len(form.locator("[role=status]").inner_text()) > 20


@pytest.mark.parametrize("theme", ["dark", pytest.param("light", marks=pytest.mark.thorough)])
def test_axe_finds_nothing_wrong(lesson, theme) -> None:
    """With what was saved, and with what is there when it has run: visualizers, stills, replies, tables, plots."""
    assert lesson.wrong_at_first == []
    lesson.theme(THEMES[theme])
    lesson.page.add_style_tag(content="[data-camviz-still] { display: block !important }")
    assert lesson.axe() == []


@pytest.mark.by_example
def test_a_visualizer_obeys_the_keyboard_alone(lesson) -> None:
    """Tab reaches every control, arrows move it, a number and Enter do the same, Enter on Reset brings it back."""
    keys = lesson.page.keyboard
    for explorer in [one for one in explorers(lesson) if one.query_selector("input[type=range]")][:1]:
        explorer.scroll_into_view_if_needed()
        first = reset(explorer)
        far_end = explorer.query_selector("input[type=range]").evaluate("it => it.value === it.min ? it.max : it.min")
        explorer.query_selector(".camviz-controls").click(position={"x": 1, "y": 1})
        at_its_right_end = explorer.query_selector("input[type=range]").evaluate("it => it.value === it.max")
        tab_to(lesson, explorer, "input[type=range]")
        for _ in range(5):
            keys.press("ArrowLeft" if at_its_right_end else "ArrowRight")
        moved = picture(explorer)
        assert moved != first
        tab_to(lesson, explorer, "input[type=number]")
        keys.press("Control+a")
        keys.type(far_end)
        keys.press("Enter")
        assert picture(explorer) not in (first, moved)
        back = "Tab"  # Reset stands behind the controls, and before the picture
        if explorer.evaluate("root => hands.handles(root).length"):
            before, back = picture(explorer), "Shift+Tab"
            tab_to(lesson, explorer, "[data-drag]")
            keys.press("ArrowRight")
            if picture(explorer) == before:  # where the far end, just typed, is this handle's end as well
                keys.press("ArrowLeft")
            assert picture(explorer) != before
        tab_to(lesson, explorer, "button[data-action=reset]", back)
        keys.press("Enter")
        assert picture(explorer) == first


def tab_to(lesson, explorer, selector: str, key: str = "Tab") -> None:
    """Press Tab until the focus is on the next element of the visualizer that `selector` names."""
    for _ in range(60):
        lesson.page.keyboard.press(key)
        if explorer.evaluate(
            "(root, s) => root.contains(document.activeElement) && document.activeElement.matches(s)", selector
        ):
            return
    raise AssertionError(f"{key} never reaches {selector}")
