"""`explore(view)`: a view's picture with its controls around it, live in a notebook."""

from __future__ import annotations

import os
import re
import traceback
from collections.abc import Callable, Mapping
from dataclasses import fields
from importlib.resources import files
from math import nan
from typing import Any

import numpy as np
import traitlets
from IPython import get_ipython

from camviz.draw.picture import page_style
from camviz.views.base import Control, View
from camviz.widgets.change_request import ChangeRequest, number_of
from camviz.widgets.still import StillWidget, stills_for_boxes
from camviz.widgets.waiting import wait

_HERE = files("camviz.widgets")
_CAPTION = (
    '<figcaption style="font-size:12px;opacity:.75;flex-basis:100%">'
    "A still picture: run this cell (Shift + Enter), and it moves.</figcaption>"
)


class ViewTrait(traitlets.Any):
    """A trait that follows an explorer's view: whoever sets it changes the view, and the picture is drawn at once."""

    def set(self, obj: Any, value: Any) -> None:
        """Ask the explorer `obj` for the change; it calls `follow` of every trait that has changed with it."""
        if value is not self.get(obj):
            obj._assign(self.name, value)

    def follow(self, obj: Any, value: Any) -> None:
        """Take the value that the view has now, and tell whoever observes this trait."""
        super().set(obj, value)


class Explorer(StillWidget):
    """A view under a reader's hands, and under a program's: each control of the view is a trait.

    `explorer.k1 = -0.2` redraws the picture, `explorer.observe(f, "k1")` hears of every change, and `link` and `jslink`
    tie `(explorer, "k1")` to other widgets. `view` is the present state, `values` the values of the controls that are
    shown, and `state` all fields of the view; each of them can be set. `value` is `view` by the name that
    `interactive_output` expects. A control whose name the widget needs itself has a "_" behind it: `view_`.

    A number outside a control's range is held at its end, as the slider holds it; `set` goes beyond. What cannot be
    drawn is refused, and the last good state stays.

    The browser asks for one picture at a time and always for its newest request, so that no queue builds up.
    What it asks for is checked: numbers are held within their ranges, whatever moves them. An error in drawing is shown
    in words above the last good picture. Buttons below the picture open the view's further panels, where it has any;
    `panels` names them, and `opened` those that are open. A button makes words twice as large for the back row;
    CAMVIZ_SCALE (1 to 3) does so from the start.

    Args:
        view: The state to begin with.
        controls: Those that are shown, by the fields that they change. `explore` makes them.
        together: Controls whose combinations `camviz_school.record` records.

    Raises: ValueError for what cannot be drawn, when it is set.

    >>> from camviz.views.distortion import DistortionView
    >>> explorer = explore(DistortionView(), "k1")
    >>> explorer.k1 = -100  # the slider ends at -1
    >>> explorer.view.k1, explorer.values
    (-1.0, {'k1': -1.0})
    """

    _esm = (_HERE / "explorer.js").read_text(encoding="utf-8")
    _css = page_style() + (_HERE / "explorer.css").read_text(encoding="utf-8")

    controls: traitlets.List[Any] = traitlets.List(read_only=True).tag(sync=True)
    panels: traitlets.List[Any] = traitlets.List(read_only=True).tag(sync=True)
    opened: traitlets.List[Any] = traitlets.List(read_only=True).tag(sync=True)
    frame: traitlets.Dict[Any, Any] = traitlets.Dict(read_only=True).tag(sync=True)
    _title = traitlets.Unicode().tag(sync=True)
    _scale = traitlets.Float().tag(sync=True)
    values = ViewTrait().tag(sync=True)
    view = ViewTrait()
    value = ViewTrait()

    def __init__(self, view: View, controls: dict[str, Control], together: tuple[str, ...] = ()) -> None:
        self._together = together
        self._first, self._title, self._scale = view, view.title, _scale()
        self._units: dict[str, float] = {}  # picture units that make a CSS pixel, of each tile in the page
        self._controls = controls
        self._ranges = {**view.offered(), **controls}
        self._control_of = {f"{name}_" if hasattr(Explorer, name) else name: name for name in self._ranges}
        self.add_traits(**{trait: ViewTrait().tag(sync=True) for trait in self._control_of})
        described = [{"name": name, **vars(one), "first": getattr(view, name)} for name, one in controls.items()]
        self.set_trait("controls", described)
        more = [name for name in view.openable if name not in view.opened]
        self.set_trait("panels", [{"name": name, "words": view.openable[name]} for name in more])
        self._show(view, draft=False)
        super().__init__()
        self.on_msg(self._receive)
        self.observe(lambda _: self.keep_soon(), "view")
        wait(self)
        stills_for_boxes()

    def set(self, **changes: Any) -> Explorer:
        """Change the view's fields and redraw, beyond the controls' ranges too.

        Args:
            **changes: Fields of the view, and their values.

        Raises: ValueError for what cannot be drawn: it is raised here, where the code is.
        """
        self._show(self.view.but(**changes), draft=False)
        return self

    @property
    def first(self) -> View:
        """The state in which it was made, to which *Reset* returns."""
        return self._first

    @property
    def together(self) -> tuple[str, ...]:
        """The controls that belong together: a recording has every combination of their positions."""
        return self._together

    @property
    def state(self) -> dict[str, Any]:
        """Every field of the view by its name: `view.but(**explorer.state)` is the present view."""
        return {field.name: getattr(self.view, field.name) for field in fields(self.view) if field.init}

    @state.setter
    def state(self, state: Mapping[str, Any]) -> None:
        self.set(**state)

    def __setattr__(self, name: str, value: Any) -> None:
        if not name.startswith("_") and not hasattr(type(self), name):
            raise AttributeError(self._unknown(name))
        super().__setattr__(name, value)

    def _assign(self, trait: str, value: Any) -> None:
        """Change the view by one of its traits. What a hand in the page does is drafted, and its errors are shown."""
        hand = _by_hand()
        try:
            view = self._assigned(trait, value)
            if view is not self.view:
                self._show(view, draft=hand)
        # Whatever a view raises belongs in front of the reader whose hand it was, and else where the code is.
        except Exception as error:
            if not hand:
                raise
            self._tell(error, answers=0)

    def _assigned(self, trait: str, value: Any) -> View:
        """The view after a trait was set: the present one where that changes nothing."""
        if trait in ("view", "value"):
            if type(value) is not type(self.view):
                raise ValueError(f"{trait} must be a {type(self.view).__name__}, got {type(value).__name__}")
            return value
        wished = value if trait == "values" else {self._control_of[trait]: value}
        if not isinstance(wished, Mapping):
            raise ValueError(f"values must be a dict of controls and their values, got {type(wished).__name__}")
        held = {name: self._held(name, one) for name, one in wished.items()}
        changes = {name: one for name, one in held.items() if one != getattr(self.view, name)}
        return self.view.but(**changes) if changes else self.view

    def _held(self, name: str, value: Any) -> Any:
        """The value, a number held within the range of its control; ValueError where there is no such control."""
        if name not in self._ranges:
            raise ValueError(self._unknown(name))
        return self._ranges[name].held(name, value.item() if isinstance(value, np.generic) else value)

    def _within(self, view: View, before: View) -> View:
        """The view, each control that differs from the view `before` held within its range."""
        values = {name: (getattr(before, name), getattr(view, name)) for name in self._ranges}
        moved = {name: (new, self._held(name, new)) for name, (old, new) in values.items() if new != old}
        beyond = {name: held for name, (new, held) in moved.items() if held != new}
        return view.but(**beyond) if beyond else view

    def _unknown(self, name: str) -> str:
        return f"{type(self.view).__name__} has no control {name!r}; it has {', '.join(self._ranges)}"

    def _show(self, view: View, *, draft: bool, answers: int = 0) -> None:
        picture = view.figure(draft=draft)
        frame: dict[str, Any] = {"html": picture.flow(self._units), "photographs": picture.photographs}
        frame |= {"described": picture.description, "answers": answers, "draft": draft, "error": ""}
        frame["units"] = dict(self._units)
        followed = {"view": view, "value": view, "values": {name: getattr(view, name) for name in self._controls}}
        followed |= {trait: getattr(view, name) for trait, name in self._control_of.items()}
        # One message to the page; and nobody hears of a change before all of it is done.
        with self.hold_sync(), self.hold_trait_notifications():
            for trait, value in followed.items():
                getattr(type(self), trait).follow(self, value)
            self.set_trait("opened", list(view.opened))
            self.set_trait("frame", frame)

    def take(self, function: Callable[..., Any]) -> bool:
        """Draw with the function that a reader has written anew.

        Args:
            function: Takes the place of the function of the same name that the view was given.

        Returns: Whether the view has one, and it is another.
        """
        name = getattr(function, "__name__", "")
        held = {one: value for one, value in self.state.items() if callable(value)}
        theirs = [one for one, value in held.items() if name and getattr(value, "__name__", "") == name]
        changes = {one: function for one in theirs if held[one] is not function}
        if changes:
            self._first = self._first.but(**changes)
            self._show(self.view.but(**changes), draft=False)
        return bool(changes)

    def _tell(self, error: Exception, answers: int) -> None:
        """Show an error above the last good picture."""
        told = {"answers": answers, "draft": False, "error": self.in_words(error)}
        self.set_trait("frame", {**self.frame, **told})
        self.log.warning("%s", "".join(traceback.format_exception(error)))

    def in_words(self, error: Exception) -> str:
        """What an error says, the fields of the view by the words that stand beside their controls.

        Args:
            error: What a view raised.

        Returns: One sentence for a reader.
        """
        if not isinstance(error, ValueError):
            return f"{type(error).__name__}: {error}"
        words = str(error)
        for name, control in self._ranges.items():
            as_name = rf"\b{name}\b" if "_" in name else rf"^{name}\b"  # elsewhere "size" may be a word like any other
            words = re.sub(as_name, control.label, words)
        return words

    def _receive(self, _widget: object, message: object, _buffers: object) -> None:
        try:
            request = ChangeRequest.of(message)
            self._show(self._requested(request), draft=request.draft, answers=number_of(message))
        # The widget's edge: whatever a view raises belongs in front of the reader, and nobody above would show it.
        except Exception as error:
            self._tell(error, answers=number_of(message))

    def _requested(self, request: ChangeRequest) -> View:
        self._units |= request.units
        view = self._first.with_panels(self._as_now()) if request.reset else self.view
        if request.values:
            view = view.but(**{name: self._requested_value(name, value) for name, value in request.values.items()})
        view = view.with_panels(request.panels)
        for drag in request.drags:
            view = self._within(view.dragged(*drag), view)
        for key in request.keys:
            view = self._within(view.pressed(*key), view)
        return view

    def _as_now(self) -> dict[str, bool]:
        """Which panels are open: a reset leaves those to the reader who opened them."""
        return {name: name in self.view.opened for name in self.view.openable}

    def _requested_value(self, name: str, value: Any) -> Any:
        """The value, held within its control's range; where the control began it may return to, even from outside."""
        held = self._held(name, value)
        first = getattr(self._first, name)
        return first if value == first else held

    def still(self) -> dict[str, str]:
        bundle = self.view.figure()._repr_mimebundle_()
        return {**bundle, "text/html": bundle["text/html"].replace("</figure>", f"{_CAPTION}</figure>")}


def explore(view: View, *names: str, together: tuple[str, ...] = (), **ranges: Any) -> Explorer:
    """The view with controls for some of its fields, or for all.

    The notebook is saved with the picture of the state in which one left it; a cell run again begins with `view`.

    Args:
        view: What is shown.
        *names: Fields that get a control, before those of `ranges`; all of its fields when none of both is given.
        together: Controls that a page without a kernel moves at the same time (`camviz_school.record`); here all do.
        **ranges: Fields with other limits: `k1=(-0.5, 0.5)` or `k1=(-0.5, 0.5, 0.01)` for a slider, a tuple of words
            for a choice.

    Returns: Live in a notebook.

    Raises:
        ValueError: Naming the fields there are when one is unknown, and for a range that is none.

    >>> from camviz.views.distortion import DistortionView
    >>> explore(DistortionView(k1=-0.3), "k3", k1=(-0.5, 0.5)).values
    {'k3': 0.0, 'k1': -0.3}
    """
    declared = view.offered()
    for name in (*names, *ranges):
        if name not in declared:
            raise ValueError(f"{type(view).__name__} has no control {name!r}; it has {', '.join(declared)}")
    wanted = (*names, *ranges) or tuple(declared)
    if unknown := [name for name in together if name not in wanted]:
        raise ValueError(f"together must name controls that are shown, {', '.join(wanted)}, got {unknown[0]!r}")
    return Explorer(view, {name: _ranged(declared[name], ranges.get(name)) for name in wanted}, tuple(together))


def _ranged(control: Control, limits: Any) -> Control:
    if limits is None:
        return control
    if control.choices:
        return Control(control.label, choices=tuple(limits), help=control.help)
    if not isinstance(limits, (tuple, list)) or len(limits) not in (2, 3):
        raise ValueError(f"a range must be (low, high) or (low, high, step), got {limits!r} for {control.label}")
    low, high, *step = limits
    return Control(control.label, control.unit, low, high, step[0] if step else control.step, (), control.help)


def _scale() -> float:
    """How many times as large as usual words are: what CAMVIZ_SCALE asks for."""
    asked = os.environ.get("CAMVIZ_SCALE") or "1"
    try:
        scale = float(asked)
    except ValueError:
        scale = nan
    if not 1 <= scale <= 3:
        raise ValueError(f"CAMVIZ_SCALE must be a number from 1 to 3, got {asked!r}")
    return scale


def _by_hand() -> bool:
    """Whether the kernel answers a message of the page, in which a hand moves something, and runs no cell."""
    kernel = getattr(get_ipython(), "kernel", None)
    return kernel is not None and kernel.get_parent().get("header", {}).get("msg_type") == "comm_msg"
