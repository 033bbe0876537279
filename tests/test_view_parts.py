"""What views share: numbers as text, rows beside a picture, bars that choose a view, the walk around a space."""

from dataclasses import dataclass, replace

import numpy as np
import pytest

from camviz.draw import plot, svg
from camviz.draw.flow import rows
from camviz.draw.panel import Panel
from camviz.draw.readout import decimal, listed, readout, seconds, signed, vector
from camviz.draw.space import OrbitCamera, space_panel
from camviz.views.base import OrbitView, View, answered, step_of, without
from camviz.views.view_bars import ViewChooser, bars_of, ceiling, figures_on, names_below


def texts(drawn):
    return [(text.x, text.y, text.class_, text.words) for text in drawn.texts()]


@pytest.mark.parametrize(
    ("written", "words"),
    [
        (signed(2, 1), "+2.0"),
        (signed(-1.25, 2), "−1.25"),
        (decimal(-0.04, 1), "0.0"),
        (decimal(-2, 0), "−2"),
        (vector([1, -0.5], 2), "(1.00, −0.50)"),
        (vector([1, -0.5], 1, width=5), "(  1.0,  −0.5)"),
        (seconds(0.01), "1/100 s"),
        (seconds(2), "2 s"),
        (listed({"a": "1 m", "b": "2 m"}), "a 1 m; b 2 m"),
        (listed([("a", "1 m")]), "a 1 m"),
    ],
)
def test_numbers_are_written_with_true_minus_signs_and_no_negative_zero(written, words):
    assert written == words


def test_a_readout_has_each_value_at_one_distance_from_its_name():
    drawn = texts(readout({"gain": "2", "dark": "3"}, (10, 20), (0, 40), (5, 17)))
    assert drawn == [
        (10, 20, "note", "gain"),
        (15, 37, "label", "2"),
        (10, 60, "note", "dark"),
        (15, 77, "label", "3"),
    ]


def test_what_is_the_readers_own_is_orange():
    drawn = texts(readout({"row time, yours": "2", "row time": "3"}, (0, 0), (9, 0), (0, 1)))
    assert [class_ for *_, class_, _ in drawn] == ["note", "orange", "note", "label"]


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


def test_a_space_is_a_handle_that_says_how_to_turn_it():
    drawn, attached = Walk().in_space(space_panel("space", 0, 0, 60, 40), [], False, "Nothing", "Walk around nothing")
    assert drawn.handles == ["eye"]
    assert "drag to turn" in [text.words for text in drawn.texts()]
    assert drawn.panels()["space"].attributes["aria_label"] == "Walk around nothing"
    assert not attached


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


@pytest.mark.parametrize(("x", "chosen"), [(10, 1), (49, 2), (60, 3), (75, 4), (109, 5), (-99, 1), (999, 5)])
def test_a_click_chooses_the_bar_that_is_there_and_none_beyond_the_last(x, chosen):
    assert Bars().dragged("bars", x, 20, 0, 0).view == chosen


def test_keys_go_from_bar_to_bar_and_stop_at_the_ends():
    assert [Bars(view=v).pressed("bars", key).view for v, key in ((3, "+"), (3, "ArrowLeft"), (5, "+"), (1, "-"))] == [
        4, 2, 5, 1,
    ]  # fmt: skip
    assert Bars().pressed("else", "+").view == 3


def test_the_chosen_bar_alone_is_orange_and_a_missing_value_has_none():
    panel, values = Bars()._bars, np.array([1.0, np.nan, 2.0, 1.5])
    drawn = bars_of(panel, values, 2)
    assert {path.class_: len(path.lines) for path in drawn} == {"fill-blue": 2, "fill-orange": 1}
    assert [words for *_, words in texts(figures_on(panel, values))] == ["1.00", "2.00", "1.50"]


def test_a_bar_that_would_flatten_the_rest_is_cut_and_keeps_its_number():
    values = np.array([0.10, 0.20, 0.15, 44.0, np.nan])
    assert ceiling(values) == pytest.approx(1.2 * 0.20)
    assert ceiling(values[:3]) == ceiling(values)
    assert ceiling(np.array([0.1, 0.1, 0.9])) == pytest.approx(1.2 * 0.9)  # tall, and yet the others can be read
    panel = replace(Bars()._bars, top=ceiling(values))
    drawn = figures_on(panel, values)
    assert [len(path.lines) for path in drawn.of("paper-line cut")] == [1]
    (x, y, *_), *_ = [found for found in texts(drawn) if found[-1] == "44.00"]
    assert x == pytest.approx(panel.place((4, 0))[0], abs=0.1)
    assert 0 < y < panel.height / 2


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


def test_a_function_that_is_not_there_answers_nothing_and_says_so():
    values, words = answered(None, (1,), np.zeros((2, 3)))
    assert np.isnan(values).all()
    assert values.shape == (2, 3)
    assert words in [text.words for text in without(Panel("p", 0, 0, 900, 50, 0, 1, 0, 1), words, "Yours").texts()]
    assert answered(lambda x: 2 * x, (np.ones(2),), np.zeros(2))[0].tolist() == [2, 2]


def test_plus_and_the_arrows_up_and_right_lead_onwards():
    assert [step_of(key) for key in ("ArrowRight", "ArrowUp", "+", "ArrowLeft", "ArrowDown", "-", "x")] == [
        1, 1, 1, -1, -1, -1, 0,
    ]  # fmt: skip


def test_a_picture_of_tiles_stands_on_paper_of_their_size():
    line = svg.line([(0, 0), (9, 9)], "ink")
    picture = View().tiled(rows((120, {"all": 960})), {"all": line, "none": svg.NOTHING}, {"a": b"b"}, "words")
    paper, drawn = picture.marks
    assert (paper.width, paper.height, paper.class_, drawn) == (960, 120, "paper", line[0])
    assert (picture.height, picture.description, picture.photographs) == (120, "words", {"a": b"b"})
