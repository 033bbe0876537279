"""What every view is: a frozen state that declares its own controls and turns itself into a picture."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import Field, dataclass, field, fields, replace
from functools import cached_property
from math import inf
from pathlib import Path
from reprlib import repr as short
from typing import Any, ClassVar, Self

import numpy as np

from camviz.draw.flow import Cell, Part, Tile
from camviz.draw.marks import NOTHING, Marks
from camviz.draw.orbit_camera import OrbitCamera
from camviz.draw.panel import Panel
from camviz.draw.picture import Picture
from camviz.draw.space import Item, draw_space
from camviz.views.yours import Function, answered, without  # noqa: F401 - asked for here, beside the base of views

Drawn = tuple[Marks, dict[str, bytes]]
"""A part of a picture, and the photographs that it needs."""
ORBIT_HANDLES = ("eye", "orbit")


@dataclass(frozen=True)
class Control:
    """How one field of a view is touched: a slider (`low` … `high`), a choice among words, or an on/off switch."""

    label: str
    unit: str = ""
    low: float | None = None
    high: float | None = None
    step: float | None = None
    choices: tuple[str, ...] = ()
    help: str = ""

    def checked(self, name: str, value: Any) -> Any:
        """The value if the control allows it; ValueError saying what `name` takes if not."""
        if self.choices:
            if value not in self.choices:
                raise ValueError(f"{name} must be one of {', '.join(map(repr, self.choices))}, got {short(value)}")
            return value
        if self.low is None or self.high is None:
            if not isinstance(value, bool):
                raise ValueError(f"{name} must be True or False, got {short(value)}")
            return value
        if isinstance(value, bool) or not isinstance(value, int | float) or not abs(value) < inf:
            raise ValueError(f"{name} must be a finite number, got {short(value)}")
        return value

    def held(self, name: str, value: Any) -> Any:
        """The value as `checked` has it, a number beyond the control's range at the end of that range."""
        value = self.checked(name, value)
        return value if self.low is None or self.high is None else min(max(value, self.low), self.high)


def slider(
    default: float, low: float, high: float, step: float, *, label: str = "", unit: str = "", help: str = ""
) -> Any:
    """A view's field moved by a slider from `low` to `high` in steps of `step`."""
    return field(default=default, metadata={"control": Control(label, unit, low, high, step, (), help)})


def choice(default: str, *others: str, label: str = "", help: str = "") -> Any:
    """A view's field chosen among words; the first is the default."""
    return field(default=default, metadata={"control": Control(label, choices=(default, *others), help=help)})


def switch(default: bool, *, label: str = "", help: str = "") -> Any:
    """A view's field turned on and off."""
    return field(default=default, metadata={"control": Control(label, help=help)})


@dataclass(frozen=True)
class View:
    """Base of all views. A subclass is a frozen dataclass of state whose `figure` draws that state.

    Where it can draw several sets of panels, its field `panels` names one of its `layouts`. Where each panel may come
    and go by itself, `panels` names those that are drawn, and `openable` those for which an explorer has a button.
    """

    title: ClassVar[str] = ""
    layouts: ClassVar[Iterable[str]] = ()
    openable: ClassVar[Mapping[str, str]] = {}
    """Panels that a reader opens and closes: their names in `panels`, and the words on their buttons."""
    arrow: ClassVar[float] = 10.0
    """How far an arrow key drags a handle, in the picture's units."""

    def __post_init__(self) -> None:
        for name, control in self.controls().items():
            control.checked(name, getattr(self, name))
        if self.layouts:
            one_of("panels", self._panels, self.layouts)

    @classmethod
    def controls(cls) -> dict[str, Control]:
        """The view's controls by field name, in the order of declaration."""
        return {f.name: _labelled(f) for f in fields(cls) if "control" in f.metadata}

    def offered(self) -> dict[str, Control]:
        """The controls as this state offers them; a subclass changes those whose range depends on what it shows."""
        return self.controls()

    def figure(self, *, draft: bool = False) -> Picture:
        """The picture of this state; with `draft`, a coarser one fit for dragging."""
        raise NotImplementedError(f"{type(self).__name__} draws nothing yet")

    def description(self) -> str:
        """The state in words and numbers."""
        return ""

    def tiled(
        self,
        layout: Mapping[str, Cell],
        parts: Mapping[str, Part],
        attached: Mapping[str, bytes] | None = None,
        described: str | None = None,
    ) -> Picture:
        """A picture whose tiles are the parts by their names in the layout, under the state's description.

        A part that is "" has no tile. `attached` are the photographs that the parts need.
        """
        tiles = tuple(Tile.of(name, layout[name], body) for name, body in parts.items() if body)
        words = self.description() if described is None else described
        return Picture(tiles, self.title, words, dict(attached or {}))

    def _told(self) -> dict[str, str]:
        """The figures that the panels speak of: names and values."""
        return {}

    @property
    def _panels(self) -> str:
        return str(getattr(self, "panels", ""))

    def _has(self, panel: str) -> bool:
        """Whether the panel of that name is drawn."""
        return panel in self._panels.split()

    @property
    def opened(self) -> tuple[str, ...]:
        """Which of its `openable` panels are drawn, in the order in which `openable` has them."""
        return tuple(name for name in self.openable if self._has(name))

    def with_panels(self, opened: Mapping[str, bool]) -> Self:
        """The view with panels opened (True) or closed (False), by their names; those opened come last.

        What it has worked out stays. Raises ValueError for a panel that is not openable.
        """
        for name in opened:
            one_of("a panel to open", name, self.openable)
        now = self._panels.split()
        kept = [name for name in now if opened.get(name, True)]
        kept += [name for name, wanted in opened.items() if wanted and name not in now]
        changed = self if kept == now else self.but(panels=" ".join(kept))
        vars(changed).update({name: vars(self)[name] for name in self._worked_out if not name.startswith("_")})
        return changed

    @property
    def _worked_out(self) -> list[str]:
        """The cached properties that have a value; only private ones may depend on which panels are drawn."""
        return [name for name in vars(self) if isinstance(getattr(type(self), name, None), cached_property)]

    def but(self, **changes: Any) -> Self:
        """The same view with some fields changed."""
        return replace(self, **changes)

    def dragged(self, handle: str, x: float, y: float, dx: float, dy: float) -> Self:
        """The view after the pointer dragged `handle` by (dx, dy) to (x, y), in the picture's units."""
        return self

    def pressed(self, handle: str, key: str) -> Self:
        """The view after `key` (an arrow, "+" or "-") was pressed on `handle`; an arrow drags by `arrow` units."""
        steps = {"ArrowLeft": (-1, 0), "ArrowRight": (1, 0), "ArrowUp": (0, -1), "ArrowDown": (0, 1)}
        dx, dy = steps.get(key, (0, 0))
        return self.dragged(handle, float("nan"), float("nan"), dx * self.arrow, dy * self.arrow)

    def save(self, path: str | Path, **options: Any) -> None:
        """Write the picture of this state to a .svg, .png or .pdf file; see `Picture.save` for theme and resolution."""
        self.figure().save(path, **options)

    def _repr_mimebundle_(self, **options: Any) -> dict[str, str]:
        return self.figure()._repr_mimebundle_(**options)


class OrbitView(View):
    """A view with things in space, around which one walks by dragging or by keys: its field `eye` is the onlooker."""

    eye: OrbitCamera

    def dragged(self, handle: str, x: float, y: float, dx: float, dy: float) -> Self:
        if handle in ORBIT_HANDLES:
            return self.but(eye=self.eye.orbited(dx, dy))
        return super().dragged(handle, x, y, dx, dy)

    def pressed(self, handle: str, key: str) -> Self:
        return self.but(eye=self.eye.key(key)) if handle in ORBIT_HANDLES else super().pressed(handle, key)

    def from_afar(self, target: np.ndarray, distance: float) -> OrbitCamera:
        """The onlooker of a `target` (3,) from `distance` metres, or as much nearer or farther as one has walked."""
        away = distance * self.eye.distance / OrbitCamera().distance
        return replace(self.eye, target=tuple(target.tolist()), distance=away)

    def in_space(
        self,
        panel: Panel,
        items: Iterable[Item],
        draft: bool,
        title: str,
        label: str,
        *,
        eye: OrbitCamera | None = None,
        scenery: tuple[Item, ...] = (),
        over: Marks = NOTHING,
        **heading: str,
    ) -> Drawn:
        """A panel with things in wireframe, seen by `eye` or the field; marks `over` them; `heading` is for `show`."""
        heading = {"hint": "drag to turn", "drag": "eye"} | heading
        onlooker = eye or self.eye
        content, attached = draw_space(panel, list(items), onlooker, draft=draft, renderer="wire", scenery=scenery)
        return panel.show(content + over, title=title, label=label, **heading), attached


def one_of(name: str, value: object, known: Iterable[object]) -> None:
    """Raise ValueError unless the value of the field `name` is one of those known."""
    if value not in known:
        raise ValueError(f"{name} must be one of {', '.join(map(repr, known))}, got {value!r}")


def positive(view: View, *names: str) -> None:
    """Raise ValueError unless all of these fields of the view are above zero."""
    for name in names:
        if not getattr(view, name) > 0:
            raise ValueError(f"{name} must be positive, got {getattr(view, name)}")


def step_of(key: str) -> int:
    """1 for a key that leads onwards (right, up, plus), -1 for one that leads back, 0 for any other."""
    return {"ArrowRight": 1, "ArrowUp": 1, "+": 1, "ArrowLeft": -1, "ArrowDown": -1, "-": -1}.get(key, 0)


def _labelled(declared: Field[Any]) -> Control:
    control: Control = declared.metadata["control"]
    return control if control.label else replace(control, label=declared.name.replace("_", " "))
