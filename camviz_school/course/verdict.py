"""What is said of a reader's function, in words that Jupyter shows."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

from camviz.draw import prose

_TITLES = {"correct": "✓ *Correct.*", "wrong": "✗ *Not yet.*", "unsolved": "○ *Not tried yet.*", "hint": "*Hint.*"}
_COLOURS = {
    "correct": "var(--jp-success-color1, #2e7d32)",
    "wrong": "var(--jp-error-color1, #c62828)",
    "unsolved": "var(--jp-info-color1, #0277bd)",
    "hint": "var(--jp-info-color1, #0277bd)",
}


@dataclass(frozen=True)
class Verdict:
    """What the checker says. Shown by a notebook as a box in words, by a terminal as text; true when correct.

    Attributes:
        exercise: Its name.
        status: What the function is.
        message: What to say.
        hint: What to say next; empty where it is correct.
        printed: What the function printed.

    >>> Verdict("00.double", "correct", "Twice.")
    ✓ Correct. Twice.
    """

    exercise: str
    status: Literal["correct", "wrong", "unsolved", "hint"]
    message: str
    hint: str = ""
    printed: str = ""

    @property
    def correct(self) -> bool:
        """Whether nothing is left to do."""
        return self.status == "correct"

    def __bool__(self) -> bool:
        return self.correct

    def __repr__(self) -> str:
        return "\n".join(prose.to_plain(part) for part in self._parts())

    def _repr_html_(self) -> str:
        style = f"border-left: 4px solid {_COLOURS[self.status]}; padding: 0 1em; max-width: 48em"
        return f'<div style="{style}">{"".join(prose.to_html(part) for part in self._parts())}</div>'

    def _parts(self) -> list[str]:
        hint = [f"*Hint.* {self.hint}"] if self.hint else []
        printed = [f"(Your function printed: ``{self.printed}``)"] if self.printed else []
        parts = [f"{_TITLES[self.status]} {self.message}", *hint, *printed]
        return [part.encode(errors="backslashreplace").decode() for part in parts]  # half of a surrogate pair
