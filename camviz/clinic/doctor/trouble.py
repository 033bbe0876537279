"""What may be wrong with the description of a board, in one place: its name, what it comes from, how it is seen."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import dataclass
from typing import Any

from camviz.clinic.doctor.shown import Shown

Seen = tuple[str, str] | tuple[str, str, float, str]


@dataclass(frozen=True)
class Diagnosis:
    """What the pictures show, in one sentence, and the `option` of the commands that mends it.

    `trouble` is the name of the Trouble, `cause` what it comes from, `value` a number in `unit` that shows it.
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

    `examine` gives a sentence, an option, and perhaps a number and its unit for what it sees, and nothing where it
    sees nothing. An inspection has it under the id `finding`.
    """

    name: str
    cause: str
    examine: Callable[[Shown], Iterable[Seen]]
    finding: str = "wrong-board"

    def diagnoses(self, shown: Shown) -> Iterable[Diagnosis]:
        """What of this the pictures show."""
        for seen in self.examine(shown):
            yield Diagnosis(self.name, self.cause, *seen)


def trouble(name: str, cause: str, **more: Any) -> Callable[[Callable[[Shown], Iterable[Seen]]], Trouble]:
    """Declare the decorated function as a Trouble; `more` are its other fields."""
    return lambda examine: Trouble(name, cause, examine, **more)
