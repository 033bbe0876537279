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
def test_a_panel_that_opens_is_drawn_as_if_it_had_been_open_from_the_start(name):
    view = everything(STATES[name]())
    for panel in list(view.openable)[1:]:
        view = view.with_panels({panel: False})
    view.figure()
    opened = everything(view)
    assert opened.figure() == replace(opened).figure()


def test_what_is_worked_out_stays_but_for_what_depends_on_panels():
    view = STATES["CalibrationView"]().with_panels({"errors": False})
    view.figure()
    opened = view.with_panels({"errors": True})
    assert opened.adjustment is view.adjustment
    assert "_layout" in vars(view)
    assert "_layout" not in vars(opened)
