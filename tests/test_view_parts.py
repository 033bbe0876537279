"""What views share: numbers as text, rows beside a picture, bars that choose a view, the walk around a space."""

from dataclasses import dataclass, replace

import numpy as np
import pytest

from camviz.draw import plot
from camviz.draw.panel import Panel
from camviz.draw.readout import decimal, listed, readout, seconds, signed, vector
from camviz.draw.space import OrbitCamera, space_panel
from camviz.views.base import OrbitView, answered, step_of, without
from camviz.views.view_bars import ViewChooser, bars_of, ceiling, figures_on, names_below


def test_numbers_have_true_minus_signs_and_no_negative_zero():
    assert (signed(2, 1), signed(-1.25, 2), decimal(-0.04, 1), decimal(-2, 0)) == ("+2.0", "−1.25", "0.0", "−2")
    assert (vector([1, -0.5], 2), vector([1, -0.5], 1, width=5)) == ("(1.00, −0.50)", "(  1.0,  −0.5)")
    assert (seconds(0.01), seconds(2)) == ("1/100 s", "2 s")
    assert listed({"a": "1 m", "b": "2 m"}) == "a 1 m; b 2 m"
    readings = readout({"row time, yours": "2", "row time": "3"}, (0, 0), (9, 0), (0, 1)).texts()
    assert [text.class_ for text in readings] == ["note", "orange", "note", "label"]  # the reader's own is orange


@dataclass(frozen=True)
class Walk(OrbitView):
    """A view of nothing, to walk around."""

    eye: OrbitCamera = OrbitCamera()


def test_only_the_handle_of_the_space_walks_around_it():
    view = Walk()
    assert view.dragged("eye", 0, 0, 10, 0).eye == view.eye.orbited(10, 0)
    assert view.pressed("orbit", "+").eye == view.eye.key("+")
    assert view.dragged("bars", 0, 0, 10, 0) is view
    assert view.pressed("bars", "ArrowLeft") == view
    drawn, attached = view.in_space(space_panel("space", 0, 0, 60, 40), [], False, "Nothing", "Walk around nothing")
    assert (drawn.handles, attached) == (["eye"], {})
    assert drawn.panels()["space"].attributes["aria_label"] == "Walk around nothing"


@dataclass(frozen=True)
class Bars(ViewChooser):
    """A view of five bars."""

    view: int = 3
    panels: str = "one"
    layouts = ("one", "one two")

    @classmethod
    def controls(cls):
        return {}

    @property
    def count(self):
        return 5

    @property
    def _bars(self):
        return plot.plot_panel("bars", 10, 0, 100, 50, (0.5, 5.5), (0, 2))


def test_clicks_and_keys_choose_a_bar_that_is_there():
    for x, chosen in ((10, 1), (49, 2), (60, 3), (75, 4), (109, 5), (-99, 1), (999, 5)):
        assert Bars().dragged("bars", x, 20, 0, 0).view == chosen
    for view, key, chosen in ((3, "+", 4), (3, "ArrowLeft", 2), (5, "+", 5), (1, "-", 1)):
        assert Bars(view=view).pressed("bars", key).view == chosen
    assert Bars().pressed("else", "+").view == 3
    assert [step_of(key) for key in ("ArrowRight", "ArrowUp", "ArrowDown", "x")] == [1, 1, -1, 0]


def test_the_chosen_bar_alone_is_orange():
    panel, values = Bars()._bars, np.array([1.0, np.nan, 2.0, 1.5])
    drawn = bars_of(panel, values, 2)
    assert {path.class_: len(path.lines) for path in drawn} == {"fill-blue": 2, "fill-orange": 1}
    (orange,) = drawn.of("fill-orange")
    assert panel.data(orange.lines[0])[:, 0].mean() == pytest.approx(3)
    assert [text.words for text in figures_on(panel, values).texts()] == ["1.00", "2.00", "1.50"]


def test_a_bar_that_would_flatten_the_rest_is_cut():
    values = np.array([0.10, 0.20, 0.15, 44.0, np.nan])
    assert ceiling(values) == pytest.approx(1.2 * 0.20)
    assert ceiling(values[:3]) == ceiling(values)
    assert ceiling(np.array([0.1, 0.1, 0.9])) == pytest.approx(1.2 * 0.9)  # tall, and yet the others can be read
    panel = replace(Bars()._bars, top=ceiling(values))
    drawn = figures_on(panel, values)
    assert [len(path.lines) for path in drawn.of("paper-line cut")] == [1]
    number = next(text for text in drawn.texts() if text.words == "44.00")
    assert number.x == pytest.approx(panel.place((4, 0))[0], abs=0.1)
    assert 0 < number.y < panel.height / 2


def test_names_stand_below_all_bars_or_below_round_ones():
    assert names_below(["a", "b"]) == [(1.0, "a"), (2.0, "b")]
    ticks = names_below([str(i + 1) for i in range(100)])
    assert 2 <= len(ticks) <= 16
    assert all(name == f"{tick:g}" for tick, name in ticks)


def test_a_view_takes_no_panels_but_those_it_can_draw():
    assert Bars(panels="one two")._has("two")
    assert not Bars()._has("two")
    with pytest.raises(ValueError, match=r"panels must be one of 'one', 'one two', got 'three'"):
        Bars(panels="three")


def test_a_missing_function_answers_nothing_and_says_so():
    values, words = answered(None, (1,), np.zeros((2, 3)))
    assert np.isnan(values).all()
    assert values.shape == (2, 3)
    assert words in [text.words for text in without(Panel("p", 0, 0, 900, 50, 0, 1, 0, 1), words, "Yours").texts()]
    assert answered(lambda x: 2 * x, (np.ones(2),), np.zeros(2))[0].tolist() == [2, 2]
