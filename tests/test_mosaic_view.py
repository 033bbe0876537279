"""The mosaic of lesson 19 where the matches leave H open."""

from camviz_school.views.mosaic import MosaicView

WAITS = "it takes four matches"


def words_in(view):
    return " ".join(text.words for text in view.figure().marks.texts())


def test_where_the_matches_leave_h_open_nothing_is_drawn_by_it():
    view = MosaicView(turn=24.0, step=0.6, fit="floor", panels="mosaic matches numbers")
    assert view.used.sum() < 4
    assert view.numbers()["H is off by (mean)"] == view.numbers()["at most"] == "no H"
    words = words_in(view)
    assert WAITS in words
    assert "nan" not in words
    assert WAITS not in words_in(MosaicView(turn=24.0, panels="mosaic matches"))
