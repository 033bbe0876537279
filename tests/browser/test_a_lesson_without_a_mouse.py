"""Lesson 05 in a real JupyterLab by keys alone, and as a screen reader knows it: by its accessibility tree alone."""

import shutil

import pytest
from laboratory import LATE_MS, ROOT, jupyterlab

from camviz.draw import prose
from camviz_school.course.questions import question

pytestmark = [
    pytest.mark.browser,
    pytest.mark.parametrize("lesson", ["05_distortion.ipynb"], indirect=True, scope="module"),
]

PREDICT = question("05.far_rays")
FOCUSABLE = """root => [...root.querySelectorAll("input, select, button, [tabindex='0']")]
  .filter((one) => !one.disabled && one.checkVisibility({ visibilityProperty: true }))"""
MARK = f"""root => {{
  const all = ({FOCUSABLE})(root);
  all.forEach((one, i) => {{ one.dataset.stop = i; }});
  return all.length;
}}"""
FOCUSED = """root => {
  const one = document.activeElement, { outlineStyle, outlineWidth } = getComputedStyle(one);
  if (!root.contains(one)) return "outside";
  const outlined = outlineStyle !== "none" && parseFloat(outlineWidth) >= 2;
  return outlined ? Number(one.dataset.stop) : `no outline: ${one.outerHTML}`;
}"""
PAUSE_MS = 250
LAST = "Lens distortion, 8"  # the one that has every kind of control


@pytest.fixture(scope="module")
def address(tmp_path_factory):
    """A server of its own: other tests leave answers in theirs."""
    home = tmp_path_factory.mktemp("keys")
    shutil.copytree(ROOT / "lessons", home / "lessons")
    with jupyterlab(home / "lessons", home / "private") as address:
        yield address


@pytest.fixture
def explorers(lesson):
    """The lesson's visualizers, as they are at first."""
    found = lesson.page.query_selector_all(".camviz-explorer")
    for one in found:
        one.evaluate("root => hands.reset(root)")
        picture(one)
    yield found
    assert lesson.errors == []


def picture(explorer):
    explorer.evaluate("root => hands.settled(root)")
    assert explorer.evaluate("hands.error") == ""
    return explorer.evaluate("root => hands.picture(root)")


def focused(lesson, what):
    """A property of the element that has the focus."""
    return lesson.page.evaluate(f"document.activeElement.{what}")


def press(lesson, explorer, *keys):
    """Press the keys; the value that the focused control has then, once the picture rests."""
    for key in keys:
        lesson.page.keyboard.press(key)
    picture(explorer)
    return float(focused(lesson, "value"))


# Keys -----------------------------------------------------------------------------------------------------------------


def test_tab_reaches_all_that_can_be_moved_shows_where_it_is_and_goes_on(lesson, explorers):
    """And back; what comes before and after is an editor of JupyterLab's, which has keys of its own."""
    for explorer in explorers:
        stops = list(range(explorer.evaluate(MARK)))
        for key, way in (("Tab", stops), ("Shift+Tab", stops[::-1])):
            explorer.evaluate(f"(root, stop) => ({FOCUSABLE})(root)[stop].focus()", way[0])
            for stop in way:
                assert explorer.evaluate(FOCUSED) == stop
                lesson.page.keyboard.press(key)
            assert explorer.evaluate(FOCUSED) == "outside"


def test_every_control_obeys_its_keys_and_goes_back(lesson, explorers, thorough):
    """Without --all, of the last visualizer, which has every kind of control."""
    for explorer in explorers if thorough else explorers[-1:]:
        first = picture(explorer)
        explorer.evaluate(f"root => ({FOCUSABLE})(root)[0].focus()")
        for name in explorer.evaluate("root => hands.controls(root)"):
            assert focused(lesson, "closest('.camviz-control').dataset.control") == name
            kind = focused(lesson, "type")
            if kind == "range":
                slide_and_type(lesson, explorer)
            else:
                before = focused(lesson, "value"), focused(lesson, "checked")
                lesson.page.keyboard.press("Space" if kind == "checkbox" else "ArrowDown")
                picture(explorer)
                assert (focused(lesson, "value"), focused(lesson, "checked")) != before
            label = focused(lesson, "labels[0].textContent")
            tab_to(lesson, f"Reset {label.partition(' [')[0]}")
            lesson.page.keyboard.press("Enter")
            assert picture(explorer) == first
            assert focused(lesson, "type") == kind
            for _ in range(1 + (kind == "range")):
                lesson.page.keyboard.press("Tab")
        assert focused(lesson, "textContent") == "Reset"


def slide_and_type(lesson, explorer):
    """The slider that has the focus goes everywhere by keys, and its number takes what is typed."""
    low, high, step = (float(focused(lesson, end)) for end in ("min", "max", "step"))
    assert press(lesson, explorer, "Home") == low
    at_low = picture(explorer)
    assert press(lesson, explorer, "ArrowRight") == pytest.approx(low + step)
    far = press(lesson, explorer, "PageUp")
    assert far > low + 2 * step
    assert press(lesson, explorer, "PageDown") < far
    at_end = press(lesson, explorer, "End")
    assert at_end == pytest.approx(high, abs=step)
    assert picture(explorer) != at_low
    assert press(lesson, explorer, "ArrowLeft") < at_end
    lesson.page.keyboard.press("Tab")
    lesson.page.keyboard.press("Control+a")
    lesson.page.keyboard.type(str(low + 2 * step))
    assert press(lesson, explorer, "Enter") == pytest.approx(low + 2 * step)
    lesson.page.keyboard.press("Shift+Tab")
    assert float(focused(lesson, "value")) == pytest.approx(low + 2 * step)


def tab_to(lesson, name):
    """Press Tab until the focus is on the button of that name, which is not far."""
    for _ in range(3):
        lesson.page.keyboard.press("Tab")
        if focused(lesson, "ariaLabel") == name:
            return
    raise AssertionError(f"{name} is not behind its control")


def test_reset_and_the_handle_in_the_picture_are_reached_and_work(lesson, explorers):
    explorer = next(one for one in explorers if one.evaluate("root => hands.handles(root).length"))
    first = picture(explorer)
    explorer.evaluate(f"root => ({FOCUSABLE})(root)[0].focus()")
    while not focused(lesson, "dataset.drag"):
        lesson.page.keyboard.press("Tab")
        assert explorer.evaluate("root => root.contains(document.activeElement)")
    seen = [first]
    for key in ("ArrowRight", "ArrowUp", "ArrowRight"):
        lesson.page.keyboard.press(key)
        seen.append(picture(explorer))
        assert focused(lesson, "dataset.drag")
    assert len(set(seen)) == 4
    while focused(lesson, "textContent") != "Reset":
        lesson.page.keyboard.press("Shift+Tab")
        assert explorer.evaluate("root => root.contains(document.activeElement)")
    lesson.page.keyboard.press("Enter")
    assert picture(explorer) == first


def test_a_question_is_answered_and_its_reply_reached(lesson):
    form = lesson.page.locator(".camviz-question form").filter(has_text=PREDICT.choices[0].text[:20])
    form.evaluate(f"root => ({FOCUSABLE})(root)[0].focus()")
    wrong = (PREDICT.answer + 1) % len(PREDICT.choices)
    for choice, verdict in ((wrong, "Not this one."), (PREDICT.answer, "Correct.")):
        lesson.page.keyboard.press("Space")
        while int(focused(lesson, "value")) != choice:
            lesson.page.keyboard.press("ArrowDown")
        lesson.page.keyboard.press("Tab")
        assert focused(lesson, "textContent").startswith("Commit")
        lesson.page.keyboard.press("Enter")
        reply = form.get_by_role("status")
        reply.get_by_text(verdict).wait_for()
        assert int(focused(lesson, "value")) == choice  # and what holds the focus is described by the reply
        described = focused(lesson, "closest('fieldset').getAttribute('aria-describedby')")
        assert described == reply.get_attribute("id")
    for _ in range(3):  # no more to press but "Start again", and on
        lesson.page.keyboard.press("Tab")
    assert not form.locator("..").evaluate("root => root.contains(document.activeElement)")


# The accessibility tree -----------------------------------------------------------------------------------------------


class Tree:
    """What a screen reader is told of the page; nodes are found in a named group, by role and name."""

    def __init__(self, page):
        self._page = page
        self._session = page.context.new_cdp_session(page)

    def every(self):
        """All nodes as they are now."""
        nodes = self._session.send("Accessibility.getFullAXTree")["nodes"]
        return [one for one in nodes if not one["ignored"] or one.get("childIds")]

    def below(self, top):
        """The node and all within it, in order, as they are now."""
        nodes = {one["nodeId"]: one for one in self.every()}

        def visit(number):
            if number in nodes:
                yield nodes[number]
                for child in nodes[number].get("childIds", []):
                    yield from visit(child)

        return [one for one in visit(top["nodeId"]) if not one["ignored"]]

    def group(self, name):
        """All within the group of that name, once the tree has it: it follows the page by a moment."""
        for _ in range(LATE_MS // PAUSE_MS):
            if found := [one for one in self.every() if told(one, "role") == "group" and told(one) == name]:
                break
            self._page.wait_for_timeout(PAUSE_MS)
        (top,) = found
        return self.below(top)

    def one(self, group, role, name):
        """The only node of that role and name within a group."""
        (found,) = [one for one in self.group(group) if told(one, "role") == role and told(one) == name]
        return found

    def within(self, node):
        """The words within a node."""
        return " ".join(told(one) for one in self.below(node) if told(one, "role") == "StaticText")

    def press(self, node, *keys):
        """Give the focus to a node and press keys, as a screen reader does."""
        self._session.send("DOM.focus", {"backendNodeId": node["backendDOMNodeId"]})
        for key in keys:
            self._page.keyboard.press(key)


def told(node, what="name"):
    """Name, role, value or description of a node, or one of its properties; None where it has none."""
    properties = {one["name"]: one["value"] for one in node.get("properties", [])}
    return (node.get(what) or properties.get(what) or {}).get("value")


@pytest.fixture
def tree(lesson, explorers):
    """The tree once the last visualizer is in sight, else JupyterLab leaves it out, and has nothing to tell."""
    explorers[-1].scroll_into_view_if_needed()
    lesson.page.wait_for_timeout(1500)
    return Tree(lesson.page)


def test_a_screen_reader_knows_every_control_by_role_name_value_and_help(tree, explorers):
    controls = [
        (told(one, "role"), told(one), told(one, "valuetext") or told(one, "value") or told(one, "checked"))
        for one in tree.group(f"Controls of {LAST}")
        if told(one, "focusable") and told(one, "role") != "option"
    ]
    assert controls == [
        ("slider", "k1", "0.295"),
        ("spinbutton", "k1, as a number", "0.29589"),
        ("slider", "k2", "-1"),
        ("spinbutton", "k2, as a number", "-1.03547"),
        ("checkbox", "hide what folds", "true"),
        ("combobox", "show", "distorted"),
        ("button", "Reset", None),
        ("button", "Large words", None),
    ]
    slider, number = tree.one(LAST, "slider", "k1"), tree.one(LAST, "spinbutton", "k1, as a number")
    for one in (slider, number):
        assert "-1 to 1, at first 0.29589" in told(one, "description")
        assert told(one, "invalid") == "false"
        assert (told(one, "valuemin"), told(one, "valuemax")) == (-1, 1)
    range_input = explorers[-1].query_selector("[data-control=k1] input[type=range]")
    assert range_input.get_attribute("aria-valuetext") == "0.29589"  # which Chromium tells readers, and not developers
    assert told(tree.one(LAST, "combobox", "show"), "description")
    assert told(tree.one(LAST, "checkbox", "hide what folds"), "description")


def test_values_and_the_picture_follow_a_change_and_it_is_announced_politely(tree, explorers):
    flow = tree.one(LAST, "group", "Lens distortion")
    assert "k1 = 0.29589" in told(flow, "description")
    tree.press(tree.one(LAST, "slider", "k1"), "Home")
    (status,) = [one for one in tree.group(LAST) if told(one, "role") == "status"]
    assert told(status, "live") == "polite"
    explorers[-1].wait_for_selector(".camviz-said:has-text('k1 = -1,')", state="attached")
    assert "k1 = -1," in tree.within(status)

    tree.press(tree.one(LAST, "combobox", "show"), "ArrowDown")
    tree.press(tree.one(LAST, "checkbox", "hide what folds"), "Space")
    picture(explorers[-1])
    assert told(tree.one(LAST, "slider", "k1"), "value") == -1
    assert told(tree.one(LAST, "spinbutton", "k1, as a number"), "value") == -1
    assert told(tree.one(LAST, "combobox", "show"), "value") == "undistorted"
    assert told(tree.one(LAST, "checkbox", "hide what folds"), "checked") == "false"
    assert "k1 = -1," in told(tree.one(LAST, "group", "Lens distortion"), "description")
    tree.press(tree.one(LAST, "button", "Reset k1"), "Enter")
    picture(explorers[-1])
    assert told(tree.one(LAST, "slider", "k1"), "value") == pytest.approx(0.295)
    handle = next(one for one in tree.group(LAST) if "arrow keys" in (told(one) or ""))
    assert told(handle, "focusable")


def test_a_screen_reader_knows_what_a_question_asks_and_what_was_replied(tree, lesson):
    """The reply describes the choices, so that who comes back hears it."""
    lesson.page.get_by_text(PREDICT.choices[0].text[:20]).last.scroll_into_view_if_needed()
    lesson.page.wait_for_timeout(500)
    groups = [one for one in tree.every() if told(one, "role") == "group" and told(one) == "Predict"]
    card = next(one for one in groups if PREDICT.choices[0].text[:20] in tree.within(one))
    radios = [one for one in tree.below(card) if told(one, "role") == "radio"]
    assert [told(one) for one in radios] == [prose.to_plain(choice.text) for choice in PREDICT.choices]
    tree.press(radios[PREDICT.answer], "Space")
    assert [told(one, "checked") for one in tree.below(card) if told(one, "role") == "radio"].count("true") == 1
    commit = [one for one in tree.below(card) if told(one, "role") == "button" and told(one).startswith("Commit")]
    for one in commit:  # none where the answer was right before
        tree.press(one, "Enter")
    lesson.page.locator(".camviz-right").get_by_text("✓ Correct.").first.wait_for()
    (choices,) = [one for one in tree.below(card) if told(one, "role") == "group" and told(one) != "Predict"]
    assert "Correct." in told(choices, "description")
    (status,) = [one for one in tree.below(card) if told(one, "role") == "status" and "Correct." in tree.within(one)]
    assert told(status, "live") == "polite"
