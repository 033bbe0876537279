"""What may be wrong with the description of a board, in one place: its name, what it comes from, how it is seen."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import dataclass
from typing import Any

from camviz_clinic.checks.doctor.shown import Shown

Seen = tuple[str, str] | tuple[str, str, float, str]


@dataclass(frozen=True)
class Diagnosis:
    """What the pictures show, in one sentence, and the option of the commands that mends it.

    Attributes:
        trouble: The name of the Trouble.
        cause: What it comes from.
        sentence: What the pictures show.
        option: What mends it; "no …" for an option that is to be left out.
        value: A number that shows it.
        unit: Of the value.

    >>> Diagnosis("sides swapped", "a slip", "The board has 8×5 inner corners.", "--board 8x5").option
    '--board 8x5'
    """

    trouble: str
    cause: str
    sentence: str
    option: str
    value: float | None = None
    unit: str = ""


@dataclass(frozen=True)
class Trouble:
    """One way in which a board is not as described.

    Args:
        name: Its name.
        cause: What it comes from.
        examine: Takes Shown; gives a sentence, an option, and perhaps a number and its unit for what it sees, and
            nothing where it sees nothing.
        finding: The id under which an inspection has it.

    >>> from camviz_clinic.checks.doctor import troubles
    >>> troubles()["wrong unit"].finding
    'baseline-scale'
    """

    name: str
    cause: str
    examine: Callable[[Shown], Iterable[Seen]]
    finding: str = "wrong-board"

    def diagnoses(self, shown: Shown) -> Iterable[Diagnosis]:
        """What of this the pictures show.

        Args:
            shown: The pictures, and the board as it was described.

        Yields: Each with the option that mends it.
        """
        for seen in self.examine(shown):
            yield Diagnosis(self.name, self.cause, *seen)


def trouble(name: str, cause: str, **more: Any) -> Callable[[Callable[[Shown], Iterable[Seen]]], Trouble]:
    """Declare the decorated function as a Trouble; `more` are its other fields."""
    return lambda examine: Trouble(name, cause, examine, **more)
