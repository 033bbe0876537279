"""`explore(view)`: a view's picture with its controls around it, live in a notebook."""

from __future__ import annotations

import traceback
from importlib.resources import files
from typing import Any

import traitlets

from camviz.draw.picture import style
from camviz.views.base import Control, View
from camviz.widgets.memory import give_back_after_cells, keep_between_pictures
from camviz.widgets.still import StillWidget

_HERE = files("camviz.widgets")
_CAPTION = (
    '<figcaption style="font-size:12px;opacity:.75">'
    "A still picture: run this cell (Shift + Enter), and it moves.</figcaption>"
)


class Explorer(StillWidget):
    """A view under a reader's hands. `view` is the present state; `set` changes it from code.

    The browser asks for one picture at a time and always for its newest wish, so a slow picture never builds a queue.
    An error in drawing is shown in words above the last good picture.
    """

    _esm = (_HERE / "explorer.js").read_text(encoding="utf-8")
    _css = style() + (_HERE / "explorer.css").read_text(encoding="utf-8")

    controls: traitlets.List[Any] = traitlets.List().tag(sync=True)
    values = traitlets.Dict().tag(sync=True)
    frame = traitlets.Dict().tag(sync=True)

    def __init__(self, view: View, controls: dict[str, Control]) -> None:
        self.view = self._first = view
        described = [{"name": name, **vars(control)} for name, control in controls.items()]
        super().__init__(controls=described, **_shown(view, controls, answers=0, draft=False))
        self._controls = controls
        self.on_msg(self._receive)
        keep_between_pictures()
        give_back_after_cells()

    def set(self, **changes: Any) -> Explorer:
        """Change the view's fields and redraw; errors are raised here, where the code is."""
        self._show(self.view.but(**changes), answers=0, draft=False)
        return self

    def _show(self, view: View, *, answers: int, draft: bool) -> None:
        shown = _shown(view, self._controls, answers=answers, draft=draft)
        with self.hold_sync():
            self.view = view
            self.values, self.frame = shown["values"], shown["frame"]

    def _receive(self, _widget: object, message: dict[str, Any], _buffers: object) -> None:
        try:
            self._show(self._wished(message), answers=message["id"], draft=message["draft"])
        # The widget's edge: whatever a view raises belongs in front of the reader, and nobody above would show it.
        except Exception as error:
            told = {"answers": message["id"], "draft": False, "error": f"{type(error).__name__}: {error}"}
            self.frame = {**self.frame, **told}
            self.log.warning("%s", "".join(traceback.format_exception(error)))

    def _wished(self, message: dict[str, Any]) -> View:
        view = self._first if message.get("reset") else self.view
        if message.get("values"):
            view = view.but(**message["values"])
        for handle, x, y, dx, dy in message.get("drags", ()):
            view = view.dragged(handle, x, y, dx, dy)
        for handle, key in message.get("keys", ()):
            view = view.pressed(handle, key)
        return view

    def still(self) -> dict[str, str]:
        bundle = self.view.figure()._repr_mimebundle_()
        return {**bundle, "text/html": bundle["text/html"].replace("</figure>", f"{_CAPTION}</figure>")}


def explore(view: View, *names: str, **ranges: Any) -> Explorer:
    """The view with controls for the fields in `names`, then `ranges`; for all of its fields when none is given.

    `ranges` narrows or widens: `k1=(-0.5, 0.5)` or `k1=(-0.5, 0.5, 0.01)` for a slider, a tuple of words for a choice.
    Raises ValueError naming the fields there are when one is unknown.
    """
    declared = view.offered()
    for name in (*names, *ranges):
        if name not in declared:
            raise ValueError(f"{type(view).__name__} has no control {name!r}; it has {', '.join(declared)}")
    wanted = (*names, *ranges) or tuple(declared)
    return Explorer(view, {name: _ranged(declared[name], ranges.get(name)) for name in wanted})


def _ranged(control: Control, limits: Any) -> Control:
    if limits is None:
        return control
    if control.choices:
        return Control(control.label, choices=tuple(limits), help=control.help)
    low, high, *step = limits
    return Control(control.label, control.unit, low, high, step[0] if step else control.step, (), control.help)


def _shown(view: View, controls: dict[str, Control], *, answers: int, draft: bool) -> dict[str, Any]:
    picture = view.figure(draft=draft)
    frame = {"svg": picture.svg(), "photographs": picture.photographs, "answers": answers, "draft": draft, "error": ""}
    return {"values": {name: getattr(view, name) for name in controls}, "frame": frame}
