"""What a reader moves, and the positions at which it is recorded."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from typing import Any


@dataclass(frozen=True)
class Axis:
    """One thing that is moved: its name, its first value, and every value at which it may be recorded, in order.

    Numbers lie on a slider and can be thinned; words and switches are recorded all.

    Args:
        name: By which the widget's JavaScript sends it.
        first: The value to begin with.
        values: All values, in order.
        period: Of an angle in degrees, 360; 0 for what does not come round.
        with_each: Whether it is recorded with each of the other axes, too: a panel that is opened must not close when
            a slider is moved.

    Raises: ValueError where the first value is none of the values.

    >>> Axis.choice("show", ("left", "right"), "left").is_number
    False
    """

    name: str
    first: Any
    values: tuple[Any, ...]
    period: float = 0.0
    with_each: bool = False

    def __post_init__(self) -> None:
        if self.first not in self.values:
            raise ValueError(f"the first value of {self.name} must be one of its values, got {self.first!r}")

    @classmethod
    def slider(cls, name: str, low: float, high: float, step: float, first: float, most: int = 41) -> Axis:
        """At most so many values from one end to the other, each on a step, and the first value among them.

        Args:
            name: Of the axis.
            low, high: The ends, in the slider's own unit.
            step: From one place of the slider to the next.
            first: The value to begin with.
            most: How many values, at least 3.

        Returns: Axis with its values in order.

        >>> Axis.slider("k1", -0.5, 0.5, 0.1, 0.25, most=5).values
        (-0.5, -0.3, 0.0, 0.25, 0.5)
        """
        steps = max(round((high - low) / step), 1)
        count = min(most, steps + 1)
        places = {round(low + step * round(i * steps / (count - 1)), 12) for i in range(count)} - {low, high}
        inner = {one for one in places if low < one < high}
        if low < first < high and first not in inner:
            inner -= {min(inner, key=lambda one: abs(one - first))} if len(inner) + 3 > most else set()
            inner |= {first}
        return cls(name, first, tuple(sorted(inner | {low, high, first})))

    @classmethod
    def choice(cls, name: str, values: Iterable[Any], first: Any) -> Axis:
        """Words of which one is chosen, or False and True.

        Args:
            name: Of the axis.
            values: What can be chosen.
            first: What is chosen to begin with.

        Returns: Axis with all the values.
        """
        return cls(name, first, tuple(values))

    @classmethod
    def turn(cls, name: str, first: float, most: int = 24) -> Axis:
        """Angles in degrees, all around, from the first on.

        Args:
            name: Of the axis.
            first: The angle to begin with, in degrees.
            most: How many angles.

        Returns: Axis with a period of 360.

        >>> Axis.turn("eye", 30.0, most=4).values
        (30.0, 120.0, 210.0, 300.0)
        """
        return cls(name, first, tuple(first + 360 * i / most for i in range(most)), 360.0)

    @property
    def is_number(self) -> bool:
        """Whether the values lie on a slider or a circle, and may be thinned."""
        return isinstance(self.first, int | float) and not isinstance(self.first, bool)

    def thinned(self, count: int) -> tuple[Any, ...]:
        """Some of the values, evenly, the first one among them; of words, all.

        Args:
            count: How many at most, at least 3.

        Returns: In order.

        >>> Axis.slider("x", 0, 10, 1, 3).thinned(3)
        (0, 3, 10)
        """
        have = len(self.values)
        if not self.is_number or have <= count:
            return self.values
        last = have if self.period else have - 1
        places = {round(i * last / (count if self.period else count - 1)) for i in range(count)}
        own = self.values.index(self.first)
        if own not in places:
            places -= {min(places - {0, last}, key=lambda place: abs(place - own))}
        return tuple(self.values[place] for place in sorted(places | {own}))
