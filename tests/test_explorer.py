"""The explorer answers each wish of the browser once, with the newest state, and shows what went wrong."""

from dataclasses import dataclass
from typing import Self

import pytest

from camviz.draw.picture import Picture
from camviz.views.base import View, choice, slider, switch
from camviz.widgets import Explorer, explore


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
        return Picture(f"<!--{self} {draft}-->", 10, 10, "Toy", f"size {self.size:g}")

    def dragged(self, handle: str, x: float, y: float, dx: float, dy: float) -> Self:
        return self.but(x=self.x + dx)


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
    good = explorer.frame["svg"]
    frame = wish(explorer, 2, values={"size": 9.0})
    assert frame["error"] == "ValueError: size must be at most 5"
    assert frame["answers"] == 2
    assert frame["svg"] == good
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
    monkeypatch.setattr("camviz.widgets.still.display", lambda bundle, raw: bundles.append(bundle))
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
