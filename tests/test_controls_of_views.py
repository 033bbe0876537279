"""What all views have in common: controls that are seen, panels that open, and places for a reader's functions."""

from dataclasses import fields, replace
from itertools import combinations

import pytest
from every_view import STATES, classes

from camviz.draw.flow import WIDTH
from camviz.draw.labels import overlap
from camviz.views.base import View
from camviz.views.yours import YOURS_HERE

ACTS_WHERE = {
    ("ChainView", "mode"): {"panels": "world picture"},
    ("ChainView", "near"): {"panels": "world picture"},
    ("ChainView", "far"): {"panels": "world picture"},
    ("ChainView", "seen_from"): {"panels": "world picture"},
    ("ColourView", "set_kelvin"): {"method": "by hand"},
    ("ColourView", "set_tint"): {"method": "by hand"},
    ("DistortionView", "hide_fold"): {"k1": -0.5},
    ("ExposureView", "compensation"): {"metering": "average"},
    ("ExposureView", "vignetting"): {"f_number": 1.4},
    ("IntrinsicsView", "x0"): {"operation": "cropped"},
    ("IntrinsicsView", "y0"): {"operation": "cropped"},
    ("MosaicView", "robust"): {"wrong": 20},
}
"""The state in which a control changes something, where that is not the first one."""
WAITS = {
    ("DepthOfFieldView", "hold"),  # says what a change of the focal length does
    ("clinic distortion", "hide_fold"),  # of a lens that folds
    ("EpipolarView", "matches"),  # of a reader's own function
    ("EpipolarView", "normalised"),
    ("IntrinsicsView", "dolly_zoom"),  # says what a change of the focal length does
    ("IntrinsicsView", "scale"),
}
"""Controls that change nothing by themselves."""
OPENING = sorted(name for name in STATES if name in classes() and classes()[name].openable)
BESIDE = {
    "CalibrationView": "picture each yours",
    "ColourView": "chart photograph yours",
    "DemosaicingView": "picture yours",
    "FisheyeView": "picture yours",
    "LightFieldView": "picture yours",
    "OmnidirectionalView": "doughnut yours",
    "PinholeView": "box yours",
}
"""The panels of views that give a reader's function a place of its own."""
YOURS = [
    (name, field.name)
    for name in sorted(set(STATES) & set(classes()) - {"ChainView", "DistortionView", "ReadoutView"})  # have their own
    for field in fields(classes()[name])
    if field.name.startswith("your")
]


def looks(view: View) -> tuple:
    """All that is seen of a view, without the words that describe it."""
    picture = view.figure(draft=True)
    return picture.body, tuple(sorted(picture.photographs.items()))


@pytest.mark.sampled(10)
@pytest.mark.parametrize("name", STATES)
def test_every_control_changes_what_is_seen(name):
    first = STATES[name]()
    for field, control in first.offered().items():
        if (name, field) not in WAITS:
            view = first.but(**ACTS_WHERE.get((name, field), {}))
            high = 90.0 if control.high == 180.0 else control.high  # a whole turn is none
            ends = control.choices or ((False, True) if control.low is None else (control.low, high))
            assert len({looks(view.but(**{field: end})) for end in ends}) == len(ends), field


@pytest.mark.sampled(8)
@pytest.mark.parametrize("name", OPENING)
def test_a_panel_opens_and_closes_and_covers_no_other(name):
    opened = STATES[name]()
    opened = opened.with_panels(dict.fromkeys(opened.openable, True))
    for panel in [*opened.openable][:0:-1]:
        cells = [tile.cell for tile in opened.figure(draft=True).tiles]
        boxes = [(x, y, x + width, y + height) for x, y, width, height in cells]
        assert max(box[2] for box in boxes) <= WIDTH + 0.5
        assert [pair for pair in combinations(boxes, 2) if overlap(*pair)] == []
        closed = opened.with_panels({panel: False})
        assert looks(closed) != looks(opened)
        assert closed.with_panels({panel: True}).with_panels({panel: False}) == closed
        opened = closed
    with pytest.raises(ValueError, match="panels must be"):
        replace(opened, panels="nonsense")


@pytest.mark.sampled(8)
@pytest.mark.parametrize(("name", "field"), YOURS)
def test_a_readers_function_without_an_answer_is_a_sentence(name, field):
    view = STATES[name]()
    view = view.but(panels=BESIDE.get(name, view.panels))
    for function, sentence in ((lambda *_: None, YOURS_HERE), (lambda *_: 1 / 0, "ZeroDivisionError")):
        picture = view.but(**{field: function}).figure(draft=True)
        assert sentence in " ".join(text.words for text in picture.marks.texts())
    assert not any(photograph.startswith("your") for photograph in picture.photographs)
