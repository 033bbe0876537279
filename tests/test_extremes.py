"""Whatever a hand can choose and a keyboard can type, every view draws a picture in which each number is one."""

import re
from math import inf, nan

import pytest
from every_view import STATES

from camviz.views.base import Control
from camviz.widgets.explorer import Explorer

HUGE = 1e308
PLACES = "d|x|y|x1|y1|x2|y2|r|rx|ry|cx|cy|width|height|points|transform|viewBox|style"
NO_NUMBER = re.compile(rf' (?:{PLACES})="[^"]*(?:nan|inf)[^"]*"|>[^<]*\b(?:nan|inf)\b[^<]*<', re.IGNORECASE)
"""A place, or written words, with what is no number; "infinity" is a word that a picture may say."""


def extremes(control: Control) -> dict[object, object]:
    """What can be asked of a control, and the value that it then has: each choice, or the ends of its range."""
    if control.choices:
        return {word: word for word in control.choices}
    return {False: False, True: True} if control.low is None else {-HUGE: control.low, HUGE: control.high}


def nonsense(picture: dict) -> set[str]:
    """What of a picture is written as a number and is none."""
    return set(NO_NUMBER.findall(f"{picture['html']}>{picture['described']}<"))


@pytest.mark.sampled(5)
@pytest.mark.parametrize("name", STATES)
def test_every_number_of_a_picture_is_one_at_the_ends_of_every_control(name):
    explorer = Explorer(STATES[name](), STATES[name]().offered())
    assert nonsense(explorer.frame) == set()
    for field, control in explorer._controls.items():
        for asked, held in extremes(control).items():
            explorer._receive(None, {"reset": True, "values": {field: asked}, "draft": True}, [])
            assert explorer.frame["error"] == ""
            assert explorer.values[field] == (pytest.approx(held) if control.high else held)
            assert (field, asked, nonsense(explorer.frame)) == (field, asked, set())


@pytest.mark.sampled(8)
@pytest.mark.parametrize("name", STATES)
def test_what_is_no_number_reaches_no_view(name):
    explorer = Explorer(STATES[name](), STATES[name]().offered())
    before = explorer.view
    for field in [field for field, control in explorer._controls.items() if control.low is not None]:
        for typed in (nan, inf, -inf):
            explorer._receive(None, {"values": {field: typed}, "draft": True}, [])
            assert "must be a finite number" in explorer.frame["error"]
            assert explorer.view is before
