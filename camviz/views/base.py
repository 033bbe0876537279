"""What every view is: a frozen state that declares its own controls and turns itself into a picture."""

from __future__ import annotations

from dataclasses import Field, dataclass, field, fields, replace
from math import isfinite
from pathlib import Path
from typing import Any, ClassVar, Self

from camviz.draw.picture import Picture


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
                raise ValueError(f"{name} must be one of {', '.join(map(repr, self.choices))}, got {value!r}")
            return value
        if self.low is None or self.high is None:
            if not isinstance(value, bool):
                raise ValueError(f"{name} must be True or False, got {value!r}")
            return value
        if isinstance(value, bool) or not isinstance(value, int | float) or not isfinite(value):
            raise ValueError(f"{name} must be a finite number, got {value!r}")
        return value


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
    """Base of all views. A subclass is a frozen dataclass of state whose `figure` draws that state."""

    title: ClassVar[str] = ""

    def __post_init__(self) -> None:
        for name, control in self.controls().items():
            control.checked(name, getattr(self, name))

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

    def but(self, **changes: Any) -> Self:
        """The same view with some fields changed."""
        return replace(self, **changes)

    def dragged(self, handle: str, x: float, y: float, dx: float, dy: float) -> Self:
        """The view after the pointer dragged `handle` by (dx, dy) to (x, y), in the picture's units."""
        return self

    def pressed(self, handle: str, key: str) -> Self:
        """The view after `key` (an arrow, "+" or "-") was pressed on `handle`; an arrow drags by ten units."""
        steps = {"ArrowLeft": (-10, 0), "ArrowRight": (10, 0), "ArrowUp": (0, -10), "ArrowDown": (0, 10)}
        dx, dy = steps.get(key, (0, 0))
        return self.dragged(handle, float("nan"), float("nan"), dx, dy)

    def save(self, path: str | Path, **options: Any) -> None:
        """Write the picture of this state to a .svg, .png or .pdf file; see `Picture.save` for theme and resolution."""
        self.figure().save(path, **options)

    def _repr_mimebundle_(self, **options: Any) -> dict[str, str]:
        return self.figure()._repr_mimebundle_(**options)


def _labelled(declared: Field[Any]) -> Control:
    control: Control = declared.metadata["control"]
    return control if control.label else replace(control, label=declared.name.replace("_", " "))
