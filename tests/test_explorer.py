"""The explorer answers each wish of the browser once, with the newest state, and shows what went wrong."""

import asyncio
import re
from dataclasses import dataclass
from typing import Self

import nbclient
import nbconvert
import nbformat
import numpy as np
import pytest
from ipywidgets import HTML, FloatSlider, HBox, Tab, VBox, interactive_output, jslink
from traitlets import TraitError, link

from camviz.draw import svg
from camviz.draw.picture import Picture
from camviz.views.base import View, choice, slider, switch
from camviz.views.frustum import FrustumView
from camviz.widgets import Explorer, explore
from camviz.widgets.still import _show_box
from camviz.widgets.waiting import hand_out
from camviz_school.views.light_field import LightFieldView


@dataclass(frozen=True)
class Toy(View):
    """A view that draws its own state and refuses to draw above 5."""

    size: float = slider(1.0, 0, 10, 0.5, unit="mm", help="how large")
    colour: str = choice("red", "blue")
    lit: bool = switch(True)
    x: float = 0.0

    def figure(self, *, draft: bool = False) -> Picture:
        if self.size > 5:
            raise ValueError("size must be at most 5")
        return Picture.whole(svg.text((0, 9), f"{self} {draft}"), 10, 10, "Toy", f"size {self.size:g}")

    def dragged(self, handle: str, x: float, y: float, dx: float, dy: float) -> Self:
        return self.but(x=self.x + dx)


@dataclass(frozen=True)
class Large(Toy):
    """A view that draws every size, and whose size is dragged."""

    def figure(self, *, draft: bool = False) -> Picture:
        return Picture.whole(svg.NOTHING, 10, 10, "Large", f"size {self.size:g}")

    def dragged(self, handle: str, x: float, y: float, dx: float, dy: float) -> Self:
        return self.but(size=self.size + dx)


def wish(explorer: Explorer, number: int = 1, *, draft: bool = False, **parts: object) -> dict:
    explorer._receive(explorer, {"id": number, "draft": draft, **parts}, [])
    return explorer.frame


def test_a_wish_is_answered_by_its_number_with_the_new_state():
    frame = wish(explorer := explore(Toy()), 7, values={"size": 3.0, "colour": "blue"}, draft=True)
    assert (frame["answers"], frame["draft"], frame["error"]) == (7, True, "")
    assert explorer.view == Toy(size=3.0, colour="blue")
    assert explorer.values["size"] == 3.0


def test_an_error_is_shown_and_the_last_good_state_kept():
    explorer = explore(Toy())
    good = explorer.frame["html"]
    frame = wish(explorer, 2, values={"size": 9.0})
    assert frame["error"] == "size must be at most 5"
    assert frame["answers"] == 2
    assert frame["html"] == good
    assert explorer.view == Toy()
    assert wish(explorer, 3, values={"size": 2.0})["error"] == ""


def test_an_error_while_dragging_stays_until_the_next_wish():
    """A frame that is no draft is not asked for again by itself, which would wipe the message away."""
    explorer = explore(Toy())
    wish(explorer, 2, values={"size": 4.0}, draft=True)
    assert wish(explorer, 3, values={"size": 9.0}, draft=True)["draft"] is False


def test_a_value_of_the_wrong_kind_is_refused_in_words():
    assert "size must be a finite number, got 'wide'" in wish(explore(Toy()), values={"size": "wide"})["error"]


def test_code_gets_the_error_where_it_stands():
    with pytest.raises(ValueError, match="at most 5"):
        explore(Toy()).set(size=8.0)


def test_reset_returns_to_the_first_state():
    explorer = explore(Toy(size=2.0))
    wish(explorer, values={"size": 4.0})
    wish(explorer, reset=True)
    assert explorer.view == Toy(size=2.0)


def test_drags_and_keys_move_the_view():
    explorer = explore(Toy())
    wish(explorer, drags=[["handle", 5, 5, 2.5, 0]])
    assert explorer.view.x == 2.5
    wish(explorer, keys=[["handle", "ArrowLeft"], ["handle", "ArrowLeft"]])
    assert explorer.view.x == -17.5


def test_only_the_named_controls_are_offered_and_ranges_narrow_them():
    explorer = explore(Toy(), "lit", size=(1, 3))
    assert [control["name"] for control in explorer.controls] == ["lit", "size"]
    assert (explorer.controls[1]["low"], explorer.controls[1]["high"], explorer.controls[1]["step"]) == (1, 3, 0.5)


def test_an_unknown_control_is_named_beside_those_there_are():
    with pytest.raises(ValueError, match="Toy has no control 'zoom'; it has size, colour, lit"):
        explore(Toy(), "zoom")


@pytest.fixture
def shown(monkeypatch):
    bundles = []
    monkeypatch.setattr("camviz.widgets.still.display", lambda bundle, **_: bundles.append(bundle))
    return bundles


def test_without_a_kernel_to_come_the_output_is_the_picture_alone(monkeypatch, shown):
    monkeypatch.setenv("CAMVIZ_STATIC", "1")
    explore(Toy())._ipython_display_()
    assert [set(bundle) for bundle in shown] == [{"text/html", "text/plain"}]


def test_beside_the_widget_the_notebook_keeps_the_present_picture(monkeypatch, shown):
    """The picture and the live view know each other, so that the one can hide the other."""
    monkeypatch.delenv("CAMVIZ_STATIC", raising=False)
    explorer = explore(Toy()).set(size=2.0)
    explorer._ipython_display_()
    kept, live = shown
    assert "size 2" in kept["text/html"]
    assert live["application/vnd.jupyter.widget-view+json"]["model_id"] == explorer.model_id
    assert f'data-camviz-still="{explorer.model_id}"' in kept["text/html"]
    assert explorer.model_id in explorer.still_hidden


# Each control a trait ----------------------------------------------------------------------------------------------


def test_setting_a_control_redraws_and_tells_whoever_observes_it():
    explorer, heard = explore(Toy()), []
    explorer.observe(lambda change: heard.append((change["name"], change["old"], change["new"])), ["size", "colour"])
    explorer.size = 3.0
    explorer.colour = "blue"
    assert heard == [("size", 1.0, 3.0), ("colour", "red", "blue")]
    assert explorer.view == Toy(size=3.0, colour="blue")
    assert "size=3.0, colour='blue'" in explorer.frame["html"]
    assert explorer.values == {"size": 3.0, "colour": "blue", "lit": True}


def test_what_a_hand_does_is_heard_once_and_after_all_of_it_is_done():
    """An observer that sets another control sees, and leaves, one consistent view."""
    explorer, heard = explore(Toy()), []

    def follow(change):
        heard.append((change["new"], explorer.view.size, explorer.values["size"]))
        explorer.colour = "blue"

    explorer.observe(follow, "size")
    wish(explorer, values={"size": 2.0, "lit": False}, draft=True)
    assert heard == [(2.0, 2.0, 2.0)]
    assert explorer.view == Toy(size=2.0, colour="blue", lit=False)
    assert (explorer.size, explorer.colour, explorer.lit) == (2.0, "blue", False)


def test_a_number_beyond_the_slider_is_held_at_its_end():
    explorer = explore(Toy(), size=(0, 4))
    explorer.size = 7
    assert explorer.size == explorer.view.size == 4
    explorer.size = np.float32(-3)
    assert explorer.view.size == 0
    assert explorer.set(size=4.5).size == 4.5  # `set` asks the view alone


def test_what_cannot_be_drawn_is_refused_and_nothing_changes():
    explorer = explore(Toy())
    before = explorer.frame
    with pytest.raises(ValueError, match=r"^size must be at most 5$"):
        explorer.size = 9.0
    with pytest.raises(ValueError, match=r"^size must be a finite number, got 'wide'$"):
        explorer.size = "wide"
    assert (explorer.size, explorer.view, explorer.frame) == (1.0, Toy(), before)


@pytest.mark.parametrize(
    ("name", "value", "message"),
    [
        ("zoom", 2, "Toy has no control 'zoom'; it has size, colour, lit"),
        ("values", {"zoom": 2}, "Toy has no control 'zoom'; it has size, colour, lit"),
        ("values", 3, "values must be a dict of controls and their values, got int"),
        ("view", 3, "view must be a Toy, got int"),
        ("frame", {}, '"frame" trait is read-only'),
        ("controls", [], '"controls" trait is read-only'),
    ],
)
def test_what_cannot_be_set_says_so_in_one_sentence(name, value, message):
    with pytest.raises((AttributeError, ValueError, TraitError), match=message):
        setattr(explore(Toy()), name, value)


def test_the_values_the_view_and_the_state_can_be_set():
    explorer, views = explore(Toy()), []
    explorer.observe(lambda change: views.append(change["new"]), "view")
    explorer.values = {"size": 2.0, "lit": False}
    explorer.view = Toy(x=3.0)
    explorer.state = {**explorer.state, "size": 4.0}
    assert views == [Toy(size=2.0, lit=False), Toy(x=3.0), Toy(size=4.0, x=3.0)]
    assert explorer.state == {"size": 4.0, "colour": "red", "lit": True, "x": 3.0}
    assert Toy().but(**explorer.state) == explorer.view == explorer.value


def test_a_control_that_is_not_shown_is_a_trait_as_well():
    explorer = explore(Toy(), "lit")
    explorer.size = 2.0
    assert explorer.view.size == 2.0
    assert explorer.values == {"lit": True}


def test_two_explorers_and_a_slider_are_linked_without_a_circle():
    one, other, slider = explore(Toy()), explore(Toy()), FloatSlider(min=0, max=8, step=0.5)
    drawn = []
    other.observe(drawn.append, "frame")
    link((one, "size"), (other, "size"))
    link((slider, "value"), (one, "size"))
    drawn.clear()
    wish(one, values={"size": 3.0})
    assert (one.view.size, other.view.size, slider.value, len(drawn)) == (3.0, 3.0, 3.0, 1)
    slider.value = 2.5
    assert (one.view.size, other.view.size, len(drawn)) == (2.5, 2.5, 2)
    link((one, "values"), (other, "values"))
    one.values = {"colour": "blue"}
    assert other.view == one.view == Toy(size=2.5, colour="blue")


def test_a_control_is_sent_to_the_page_where_jslink_finds_it():
    explorer = explore(Toy())
    assert {"size", "colour", "lit", "values", "frame"} <= set(explorer.get_state())
    jslink((FloatSlider(), "value"), (explorer, "size"))
    explorer.set_state({"size": 2.0})  # as the page sends it
    assert explorer.view.size == 2.0


def test_interactive_output_follows_an_explorer():
    explorer, seen = explore(Toy()), []
    interactive_output(lambda view: seen.append(view.size), {"view": explorer})
    explorer.size = 2.0
    assert seen == [1.0, 2.0]


def test_an_error_under_a_hand_in_the_page_is_shown_and_not_raised(monkeypatch):
    monkeypatch.setattr("camviz.widgets.explorer._by_hand", lambda: True)
    explorer = explore(Toy())
    explorer.size = 9.0
    assert explorer.frame["error"] == "size must be at most 5"
    assert explorer.size == explorer.view.size == 1.0
    explorer.size = 2.0
    assert (explorer.frame["error"], explorer.frame["draft"]) == ("", True)


@dataclass(frozen=True)
class Named(Toy):
    """A view one of whose controls has a name that the widget needs itself."""

    still: bool = switch(False)


def test_a_control_by_a_name_of_the_widget_has_an_underscore_behind_it():
    explorer = explore(Named())
    explorer.still_ = True
    assert explorer.view.still is True
    assert "Toy" in explorer.still()["text/plain"]


# Stills in boxes ---------------------------------------------------------------------------------------------------


def test_a_box_shows_the_stills_of_what_lies_in_it(monkeypatch, shown):
    monkeypatch.delenv("CAMVIZ_STATIC", raising=False)
    one, other = explore(Toy(size=2.0)), explore(Toy(size=3.0))
    box = Tab([VBox([HTML("words"), one]), HBox([other])], titles=["near", "far"])
    _show_box(box)
    kept, live = shown
    assert live["application/vnd.jupyter.widget-view+json"]["model_id"] == box.model_id
    assert re.findall(r'data-camviz-still="(\w+)"><p><b>(\w+)<', kept["text/html"]) == [
        (one.model_id, "near"),
        (other.model_id, "far"),
    ]
    assert kept["text/plain"] == "Toy. size 2\n\nToy. size 3"


def test_a_box_without_stills_is_left_to_its_own_display(shown):
    with pytest.raises(NotImplementedError):
        _show_box(VBox([HTML("words")]))
    assert shown == []


def test_a_saved_notebook_shows_the_stills_of_a_tab_as_a_page(tmp_path):
    """Run by nbclient, checked by nbformat, made a page by nbconvert: what a reader without a kernel sees."""
    code = "from ipywidgets import HTML, Tab, VBox\nfrom camviz.views.distortion import DistortionView\n"
    code += "from camviz.widgets import explore\nTab([explore(DistortionView(k1=-0.25), 'k1'), VBox([HTML('words')])])"
    notebook = nbformat.v4.new_notebook(
        cells=[nbformat.v4.new_code_cell(one) for one in (code, "VBox([HTML('words')])")]
    )
    nbclient.NotebookClient(notebook, resources={"metadata": {"path": str(tmp_path)}}).execute()
    nbformat.validate(notebook)
    still, live = notebook.cells[0].outputs
    assert "image/svg+xml;base64" in still.data["text/html"]
    assert "application/vnd.jupyter.widget-view+json" in live.data
    assert set(notebook.cells[1].outputs[0].data) == {"text/plain", "application/vnd.jupyter.widget-view+json"}
    page, _ = nbconvert.HTMLExporter().from_notebook_node(notebook)
    assert 'src="data:image/svg+xml;base64' in page
    assert "A still picture" in page


# The widget's edge ------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(("value", "held"), [(1e308, 10), (-1e308, 0), (10**400, 10), (7.0, 7.0)])
def test_a_number_from_the_page_is_held_within_the_slider(value, held):
    explorer = explore(Large())
    assert wish(explorer, values={"size": value})["error"] == ""
    assert explorer.view.size == held


def test_a_control_goes_back_to_where_it_began_even_beyond_its_range():
    explorer = explore(Large(size=12.0))
    wish(explorer, values={"size": 3.0})
    assert wish(explorer, values={"size": 12.0})["error"] == ""
    assert explorer.view.size == 12.0
    wish(explorer, values={"size": 12.5})
    assert explorer.view.size == 10


def test_a_drag_and_a_key_are_held_within_the_slider_as_well():
    explorer = explore(Large(), size=(0, 4))
    wish(explorer, drags=[["size", 0, 0, 99999, 0]])
    assert explorer.view.size == 4
    wish(explorer, keys=[["size", "ArrowLeft"]])
    assert explorer.view.size == 0


@pytest.mark.parametrize("value", [float("nan"), float("inf"), "9" * 10**6, None, [], {}, True])
def test_what_is_no_number_is_refused_in_one_short_sentence(value):
    explorer = explore(Large())
    error = wish(explorer, values={"size": value})["error"]
    assert re.fullmatch(r"size must be a finite number, got .{1,40}", error)
    assert explorer.view == Large()


@pytest.mark.parametrize(
    ("message", "error"),
    [
        ([], r"a message must be a dict, got \[\]"),
        ({"values": [1]}, r"values must be a dict of at most 200 controls, got \[1\]"),
        ({"values": {"x": 2.0}}, r"Large has no control 'x'; it has size, colour, lit"),
        ({"drags": [["size", 0, 0, 1, 0]] * 200_000}, r"drags must be a list of at most 200, got .*\.\.\.\]"),
        ({"drags": [["size", float("nan"), 0, 1, 0]]}, r"a drag must be a handle and x, y, dx, dy within .*nan.*"),
        ({"drags": [["size", 0, 0, 1e308, 0]]}, r"a drag must be a handle and x, y, dx, dy within .*1e\+308.*"),
        ({"drags": ["size"]}, r"a drag must be a handle .*'size'"),
        ({"keys": [["size", "Delete"]]}, r"a key must be a handle and one of ArrowLeft, .*'Delete'\]"),
        ({"keys": {"size": 1}}, r"keys must be a list of at most 200, got .*"),
    ],
)
def test_a_message_that_no_page_sends_is_refused_in_words_and_changes_nothing(message, error):
    explorer = explore(Large())
    explorer._receive(explorer, {"id": 3, "draft": True, **message} if isinstance(message, dict) else message, [])
    assert re.fullmatch(error, explorer.frame["error"])
    assert explorer.frame["answers"] == (3 if isinstance(message, dict) else 0)
    assert explorer.view == Large()


def test_a_message_without_a_number_is_obeyed_and_answers_none():
    explorer = explore(Large())
    explorer._receive(explorer, {"values": {"size": 3.0}}, [])
    assert (explorer.view.size, explorer.frame["answers"], explorer.frame["error"]) == (3.0, 0, "")


def test_an_error_speaks_of_a_control_by_its_label():
    frame = wish(explore(FrustumView()), values={"hfov_deg": "wide"})
    assert frame["error"] == "field of view must be a finite number, got 'wide'"


# The state one left -----------------------------------------------------------------------------------------------


def test_the_saved_still_follows_once_the_view_has_come_to_rest(monkeypatch, shown):
    """One drawing for any number of changes, in the place of the output, and none where nothing has changed."""
    monkeypatch.delenv("CAMVIZ_STATIC", raising=False)
    monkeypatch.setattr("camviz.widgets.still._REST_S", 0.05)
    kept = []
    monkeypatch.setattr("camviz.widgets.still.update_display", lambda bundle, **where: kept.append((bundle, where)))
    places = []
    monkeypatch.setattr("camviz.widgets.still.display", lambda _, raw, **where: places.append(where))

    async def cell() -> None:
        explorer = explore(Toy())
        explorer.size = 2.0  # before it is displayed
        explorer._ipython_display_()
        await asyncio.sleep(0.2)
        assert kept == []
        for number in range(10):
            wish(explorer, number, values={"size": number / 5}, draft=True)
        wish(explorer, 10)
        await asyncio.sleep(0.2)

    asyncio.run(cell())
    ((bundle, where),) = kept
    assert "size 1.8" in bundle["text/html"]
    assert where["display_id"] == places[0]["display_id"]


def test_a_static_page_has_no_still_that_follows(monkeypatch, shown):
    monkeypatch.setenv("CAMVIZ_STATIC", "1")
    monkeypatch.setattr("camviz.widgets.still._REST_S", 0.0)
    monkeypatch.setattr("camviz.widgets.still.update_display", lambda bundle, **_: shown.append(bundle))

    async def cell() -> None:
        explorer = explore(Toy())
        explorer._ipython_display_()
        explorer.size = 2.0
        await asyncio.sleep(0.05)

    asyncio.run(cell())
    assert len(shown) == 1


def test_the_scale_of_words_is_asked_for_and_checked(monkeypatch):
    monkeypatch.setenv("CAMVIZ_SCALE", "2")
    assert explore(FrustumView())._scale == 2
    for wrong in ("big", "0", "nan", "9"):
        monkeypatch.setenv("CAMVIZ_SCALE", wrong)
        with pytest.raises(ValueError, match=f"CAMVIZ_SCALE must be a number from 1 to 3, got '{wrong}'"):
            explore(FrustumView())


# Panels that the reader opens -----------------------------------------------------------------------------------------


@dataclass(frozen=True)
class Shelf(Toy):
    """A view of a picture, beside which a curve and numbers can be opened."""

    openable = {"curve": "radial curve", "numbers": "numbers"}  # noqa: RUF012
    panels: str = "picture"

    def figure(self, *, draft: bool = False) -> Picture:
        if self.size > 5:
            raise ValueError("size must be at most 5")
        return Picture.whole(svg.text((0, 9), self.panels), 10, 10, "Shelf", self.panels)


def test_a_panel_is_opened_and_closed_from_the_page_and_stays_open_when_the_controls_are_reset():
    explorer = explore(Shelf(), "size")
    assert explorer.panels == [{"name": "curve", "words": "radial curve"}, {"name": "numbers", "words": "numbers"}]
    assert explorer.opened == []
    assert wish(explorer, panels={"numbers": True}, values={"size": 3.0})["described"] == "picture numbers"
    assert explorer.opened == ["numbers"]
    wish(explorer, reset=True)
    assert (explorer.view.size, explorer.opened) == (1.0, ["numbers"])
    wish(explorer, panels={"curve": True})
    assert explorer.view.panels == "picture numbers curve"
    assert explorer.opened == ["curve", "numbers"]
    wish(explorer, panels={"numbers": False, "curve": True})
    assert explorer.view.panels == "picture curve"


def test_what_is_open_at_first_has_no_button_and_a_view_that_declares_nothing_has_none():
    assert [one["name"] for one in explore(Shelf(panels="picture curve")).panels] == ["numbers"]
    assert explore(Toy()).panels == explore(Toy()).opened == []


def test_an_unknown_panel_is_refused_and_a_panel_that_cannot_be_drawn_stays_closed():
    explorer = explore(Shelf())
    assert (
        "a panel to open must be one of 'curve', 'numbers', got 'attic'"
        in (wish(explorer, panels={"attic": True})["error"])
    )
    wish(explorer, panels={"curve": True}, values={"size": 9.0})
    assert explorer.opened == []


@pytest.mark.parametrize("panels", [["curve"], {"curve": 1}, {3: True}, {f"{i}": True for i in range(201)}])
def test_panels_that_no_page_sends_are_refused_in_words(panels):
    assert "panels must be a dict of at most 200 names" in wish(explore(Shelf()), panels=panels)["error"]


# A function that is written anew ------------------------------------------------------------------------------------


@dataclass(frozen=True)
class Drawn(Toy):
    """A view that shows what a reader's function makes of its size."""

    yours: object = None

    def figure(self, *, draft: bool = False) -> Picture:
        made = self.yours(self.size)
        if made is None:
            return Picture.whole(svg.NOTHING, 10, 10, "Drawn", "waits")
        if made > 50:
            raise ValueError("size must be smaller")
        return Picture.whole(svg.NOTHING, 10, 10, "Drawn", f"{made:g}")


def double(size): ...


def written(factor):
    def double(size):
        return factor * size

    return double


def test_a_view_is_drawn_with_a_function_that_is_written_after_it_was_made():
    """In the state in which the reader left it; Reset keeps the function; functions of other names are not its own."""
    waiting, other = explore(Drawn(yours=double)).set(size=3.0), explore(Drawn(yours=written(5)))
    assert waiting.frame["described"] == "waits"
    before = hand_out(lambda size: 9 * size)
    assert (before, waiting.frame["described"]) == (0, "waits")
    assert hand_out(right := written(2)) == 2
    assert (waiting.frame["described"], other.frame["described"]) == ("6", "2")
    assert wish(waiting, reset=True)["described"] == "2"
    assert hand_out(right) == 0


def test_a_function_that_cannot_be_drawn_leaves_the_picture_as_it_was():
    waiting = explore(Drawn(yours=double))
    assert hand_out(written(1000)) == 0
    assert waiting.frame["described"] == "waits"
    assert waiting.view.yours is double


def test_every_view_can_be_reset_whatever_its_fields_are_called():
    """Two views have a field of the word `opening`, an aperture's."""
    for view in (LightFieldView(), FrustumView()):
        explorer = explore(view)
        assert wish(explorer, reset=True)["error"] == ""
        assert explorer.opened == list(view.opened)
