"""A panel that a button opens takes over what the view has worked out, and shows what it would have shown without."""

from dataclasses import replace

import pytest
from every_view import STATES, classes

from camviz.views.base import View

OPENING = sorted(name for name in STATES if name in classes() and classes()[name].openable)


def everything(view: View) -> View:
    return view.with_panels(dict.fromkeys(view.openable, True))


@pytest.mark.sampled(8)
@pytest.mark.parametrize("name", OPENING)
def test_an_opened_panel_is_drawn_as_if_open_from_the_start(name):
    view = everything(STATES[name]())
    for panel in list(view.openable)[1:]:
        view = view.with_panels({panel: False})
    view.figure()
    opened = everything(view)
    taken_over, afresh = opened.figure(), replace(opened).figure()
    assert taken_over.body == afresh.body
    assert taken_over.photographs == afresh.photographs


def test_what_is_worked_out_stays_when_panels_open():
    view = STATES["CalibrationView"]().with_panels({"errors": False})
    view.figure()
    opened = view.with_panels({"errors": True})
    assert opened.adjustment is view.adjustment
    assert "_layout" in vars(view)
    assert "_layout" not in vars(opened)
