"""What can be recorded: a widget's JavaScript, what is moved, and what its kernel answers to values."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any, Protocol

import anywidget

from camviz.draw.picture import Picture
from camviz.views.base import ORBIT_HANDLES, View
from camviz.widgets import Explorer
from camviz_school.record.axes import Axis
from camviz_school.record.hands import PULLS, Reading, hands
from camviz_school.record.packing import Fitted, Joined

Values = Mapping[str, Any]
"""A position: a value for each axis by its name."""

UNITS = (1.0, 1.4, 2.0, 2.8)  # picture units a CSS pixel: wide columns, a telephone's, and both with large words
EYE = "eye"
PANEL = "panel"  # which further panel the reader has opened, by its name in the view's `openable`; "" for none


class Pane(Protocol):
    """A widget as `record` takes it. `Explored` is that of an `Explorer`, `Widget` that of any anywidget.

    >>> class Clock(Widget):  # a pane of one's own begins with another's
    ...     @property
    ...     def traits(self):
    ...         return {"hours": 24}
    """

    title: str

    @property
    def sources(self) -> dict[str, str]:
        """The widget's own JavaScript (`esm`, a module that exports `render`) and style sheet (`css`)."""

    @property
    def axes(self) -> tuple[Axis, ...]:
        """What is moved."""

    @property
    def together(self) -> tuple[str, ...]:
        """The axes whose combinations are recorded; the others are recorded one at a time."""

    @property
    def traits(self) -> dict[str, Any]:
        """The traits that never change, and what else the page needs to know."""

    def frame(self, values: Values) -> dict[str, Any]:
        """The traits that change, as the kernel answers to these values. Bytes among them must be JPEG or PNG.

        Args:
            values: mapping of str to object, a value for each axis by its name.

        Returns: The traits by their names.
        """

    def still(self) -> Picture | None:
        """What stands on the page before any script.

        Returns: None for nothing.
        """


@dataclass(frozen=True)
class Widget:
    """Any anywidget whose kernel answers to values: those of its traits are set, others are sent in one message.

    Args:
        widget: Whose kernel is asked.
        axes: What is moved.
        title: The pane's name.
        together: Axes whose combinations are recorded.
        send: Makes the message of the values, where the widget's JavaScript sends another one than {name: value, …}. It
            must have the values in a dict of its own, under "values", for the page to find them.

    >>> import anywidget, traitlets
    >>> class Dot(anywidget.AnyWidget):
    ...     _esm = "export default { render() {} }"
    ...     x = traitlets.Int(0).tag(sync=True)
    >>> Widget(Dot(), (Axis.slider("x", 0, 100, 1, first=0),), title="A dot").frame({"x": 50})
    {'x': 50}
    """

    widget: anywidget.AnyWidget
    axes: tuple[Axis, ...]
    title: str
    together: tuple[str, ...] = ()
    send: Callable[[Values], Mapping[str, Any]] = dict

    @property
    def sources(self) -> dict[str, str]:
        """The widget's own JavaScript and style sheet."""
        return {"esm": str(self.widget._esm), "css": str(getattr(self.widget, "_css", ""))}

    @property
    def traits(self) -> dict[str, Any]:
        """None: all traits may change."""
        return {}

    def frame(self, values: Values) -> dict[str, Any]:
        """The traits as the kernel answers to these values.

        Args:
            values: mapping of str to object, a value for each axis by its name.

        Returns: All traits that are synchronised, by their names.
        """
        own = set(self.widget.traits(sync=True)) - set(anywidget.AnyWidget.class_traits(sync=True))
        own = {name for name in own if name not in ("_esm", "_css", "_anywidget_id")}
        asked = {name: value for name, value in values.items() if name not in own}
        for name in values.keys() & own:
            setattr(self.widget, name, values[name])
        if asked:
            self.widget._handle_custom_msg(dict(self.send(asked)), [])
        return dict(self.widget.get_state(own))

    def still(self) -> Picture | None:
        """Nothing: only the widget's JavaScript knows how to draw.

        Returns: Nothing stands on the page before the script.
        """
        return None


class Explored:
    """An explorer's pane: its controls, the onlooker's place where it can be dragged, and its picture's handles.

    `together` are the controls whose combinations are recorded, instead of those that the explorer names itself.
    Raises ValueError where one is not shown.
    """

    def __init__(self, explorer: Explorer, together: tuple[str, ...] = ()) -> None:
        shown = [control["name"] for control in explorer.controls]
        if unknown := set(together) - set(shown):
            raise ValueError(f"together must name controls that are shown, {', '.join(shown)}, got {unknown.pop()!r}")
        self._explorer, self._first = explorer, explorer.first
        self._moved: Values = {}  # what is moved in the view drawn last, which has no panel opened
        self._closed: View = explorer.first
        self.title, self.together = explorer.first.title, together or explorer.together

    @property
    def sources(self) -> dict[str, str]:
        return {"esm": Explorer._esm, "css": Explorer._css}

    @cached_property
    def axes(self) -> tuple[Axis, ...]:
        axes = [_axis(**control) for control in self._explorer.controls]
        if any(handle in tile.marks.handles for handle in ORBIT_HANDLES for tile in self._picture.tiles):
            axes.append(Axis.turn(EYE, _read(self._first, EYE)))
        if self._further:
            axes.append(Axis(PANEL, "", ("", *self._further), with_each=True))
        return tuple(axes)

    @property
    def _further(self) -> list[str]:
        """The panels that a button opens. On a page one of them is open at a time: that many positions can be kept."""
        return [each["name"] for each in self._explorer.panels]

    @cached_property
    def traits(self) -> dict[str, Any]:
        kept = {"still_hidden": "", **self._explorer.get_state(["controls", "panels", "_title", "_scale"])}
        names = [axis.name for axis in self.axes if axis.name != PANEL]
        trial = Reading(self._first, lambda view: {name: _read(view, name) for name in names}, (EYE,))
        return {**kept, "hands": hands(trial, self._picture), "pulls": list(PULLS)}

    def frame(self, values: Values) -> dict[str, Any]:
        """A state's frame; what cannot be drawn is told above the first picture, as the kernel tells it."""
        try:
            view = self._view(values)
            picture, error = view.figure(), ""
        except Exception as problem:  # as at the widget's own edge: whatever a view raises is told to the reader
            view, picture, error = self._first, self._picture, self._explorer.in_words(problem)
        shown = {control["name"]: getattr(view, control["name"]) for control in self._explorer.controls}
        frame = {**_frame(picture), "answers": 0, "draft": False, "error": error}
        return {"values": shown, "opened": list(view.opened), "frame": frame}

    def _view(self, values: Values) -> View:
        """The view at a position. What it has worked out stays as long as only panels are opened and closed."""
        moved = {axis.name: values[axis.name] for axis in self.axes if values[axis.name] != axis.first}
        panel = moved.pop(PANEL, "")
        if moved != self._moved:
            self._moved, self._closed = moved, self._first.but(**self._as_fields(moved)) if moved else self._first
        return self._closed.with_panels({panel: True}) if panel else self._closed

    def _as_fields(self, moved: Mapping[str, Any]) -> dict[str, Any]:
        if EYE not in moved:
            return dict(moved)
        eye = replace(self._first.eye, yaw_deg=(moved[EYE] + 180) % 360 - 180)  # type: ignore[attr-defined]
        return {**moved, EYE: eye}

    def still(self) -> Picture | None:
        return self._picture

    @cached_property
    def _picture(self) -> Picture:
        return self._first.figure()


def pane(widget: Explorer | Pane) -> Pane:
    """The pane of an explorer; a pane is one already."""
    return Explored(widget) if isinstance(widget, Explorer) else widget


def _axis(name: str, first: Any, low: Any, high: Any, step: Any, choices: Iterable[str], **_: Any) -> Axis:
    """The axis of a control, which `camviz.views.base.Control` describes."""
    if choices:
        return Axis.choice(name, choices, first)
    if low is None or high is None:
        return Axis.choice(name, (False, True), first)
    return Axis.slider(name, low, high, step or (high - low) / 1000, first)


def _read(view: View, name: str) -> Any:
    value = getattr(view, name, None)
    return getattr(value, "yaw_deg", None) if name == EYE else value


def _frame(picture: Picture) -> dict[str, Any]:
    """What the kernel sends of a picture, its words placed for each of UNITS."""
    html = Joined(picture.around(Fitted(tile.name, _fitted(tile.html)) for tile in picture.tiles))
    return {"html": html, "photographs": picture.photographs, "described": picture.description}


def _fitted(html: Callable[[float], str], units: Iterable[float] = UNITS) -> dict[float, str]:
    """The texts by their units; one that is as for the unit before is left out."""
    found: dict[float, str] = {}
    for unit in units:
        text = html(unit)
        if text not in found.values():
            found[unit] = text
    return found
