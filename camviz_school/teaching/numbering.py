"""Which slides belong to which step of a plan, and which are left out: counted from the slides, never typed."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from functools import cached_property

from camviz_school.teaching.plans import LONG, SHORT, Plan, Step
from camviz_school.teaching.slides import Slide


@dataclass(frozen=True)
class Numbering:
    """The numbers of a deck's slides by the steps of a plan; `places` has what each slide belongs to (slides.py)."""

    plan: Plan
    places: tuple[tuple[str, ...], ...]

    @classmethod
    def of(cls, plan: Plan, slides: Sequence[Slide]) -> Numbering:
        """The numbering of a deck."""
        return cls(plan, tuple(one.at for one in slides))

    @cached_property
    def _steps(self) -> dict[str, list[int]]:
        """By the place of a step its slides' numbers; by "" those of no step."""
        found: dict[str, list[int]] = {"": [], **{step.at: [] for step in self.plan.steps}}
        for number, places in enumerate(self.places, start=1):
            found[next((one for one in places if one in found), "")].append(number)
        return found

    def slides(self, step: Step) -> str:
        """The slides of a step, such as "3–7, 9"; "–" for a step without any."""
        return written(self._steps[step.at]) or "–"

    def skipped(self, length: int) -> list[int]:
        """The slides that the plan for 90 or for 45 minutes does not show."""
        which = (LONG, SHORT).index(length)
        left_out = {step.at for step in self.plan.steps} - {step.at for step in self.plan.steps if step.minutes[which]}
        return sorted(number for at in ("", *left_out) for number in self._steps[at])

    @property
    def sentence(self) -> str:
        """What to skip in either plan, in a sentence for each."""
        return " ".join(
            f"In {length} minutes skip slides {written(left)}." if (left := self.skipped(length)) else
            f"In {length} minutes show every slide."
            for length in (LONG, SHORT)
        )  # fmt: skip


def written(numbers: Iterable[int]) -> str:
    """Numbers as ranges.

    >>> written([3, 4, 5, 9, 11, 12])
    '3–5, 9, 11–12'
    """
    runs: list[list[int]] = []
    for number in numbers:
        if runs and number == runs[-1][-1] + 1:
            runs[-1].append(number)
        else:
            runs.append([number])
    return ", ".join(f"{run[0]}–{run[-1]}" if len(run) > 1 else str(run[0]) for run in runs)
