"""The words of a check: verdicts, their reasons, and what evidence would settle them."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import asdict, dataclass, field
from typing import Any

from camviz_clinic.checks.stamps import Contradiction
from camviz_clinic.files.output import json_text

FEWEST_VIEWS = 3  # two cannot tell how much views differ among each other
VERDICTS = ("fail", "warn", "inconclusive", "pass")  # the worst first


@dataclass(frozen=True)
class Judgement:
    """The verdict on one camera or pair, why, what evidence would settle it, and the numbers behind it.

    Attributes:
        of: The camera, or the pair.
        verdict: One of "fail", "warn", "inconclusive" and "pass".
        reason: Why, in a sentence.
        settle: What would settle it; empty where nothing is open.
        facts: What was measured, in sentences.
        numbers: The same for programs.

    >>> Judgement("camera", "pass", "camera: it holds.").verdict
    'pass'
    """

    of: str
    verdict: str
    reason: str
    settle: str = ""
    facts: tuple[str, ...] = ()
    numbers: Mapping[str, Any] = field(default_factory=dict)


@dataclass(frozen=True)
class Check:
    """What new pictures say of a calibration.

    Attributes:
        limit: How far it may be off, in pixels.
        judgements: One for each camera or pair.
        notes: What a reader should know.
        holds: What the calibration holds for, in sentences.
        contradictions: What the new pictures say against it, by camera.

    >>> Check(1.0, (Judgement("left", "pass", "left: 0.1 px."), Judgement("right", "warn", "right: 0.6 px."))).verdict
    'warn'
    """

    limit: float
    judgements: tuple[Judgement, ...]
    notes: tuple[str, ...] = ()
    holds: tuple[str, ...] = ()
    contradictions: Mapping[str, tuple[Contradiction, ...]] = field(default_factory=dict)

    @property
    def worst(self) -> Judgement:
        """The judgement that decides."""
        return min(self.judgements, key=lambda each: VERDICTS.index(each.verdict))

    @property
    def verdict(self) -> str:
        """One of "fail", "warn", "inconclusive" and "pass"."""
        return self.worst.verdict

    def as_text(self) -> str:
        """For people: each verdict with its reason, what would settle it, and the numbers.

        Returns: Several lines.
        """
        lines = []
        for each in self.judgements:
            lines.append(f"{each.verdict}: {each.reason}")
            lines += [f"    to settle it: {each.settle}"] * bool(each.settle)
            lines += [f"    {fact}" for fact in each.facts]
            lines.append("")
        for name, found in self.contradictions.items():
            lines += [f"{name}: the pictures contradict the calibration: {each.sentence}." for each in found]
        return "\n".join([*lines, *self.holds, *self.notes])

    def as_tree(self) -> dict[str, Any]:
        """For programs: verdict, limit_px, judgements, contradictions, holds and notes, as docs/clinic.md has them.

        Returns: A dict of what JSON can hold.
        """
        judgements = [asdict(each) | {"facts": list(each.facts)} for each in self.judgements]
        found = [{"of": name} | asdict(each) for name, several in self.contradictions.items() for each in several]
        return {
            "verdict": self.verdict,
            "limit_px": self.limit,
            "judgements": judgements,
            "contradictions": found,
            "holds": list(self.holds),
            "notes": list(self.notes),
        }

    def as_json(self) -> str:
        """The same as strict JSON.

        Returns: JSON.
        """
        return json_text(self.as_tree())

    def __str__(self) -> str:
        return self.as_text()


def rated(least: float, most: float, limit: float) -> str:
    """The verdict on a change that lies between two bounds: it fails where it is surely beyond the limit.

    It is warned of where it is surely beyond half of the limit, and passes where it is surely within it.
    """
    if least > limit:
        return "fail"
    if least > limit / 2:
        return "warn"
    return "pass" if most <= limit else "inconclusive"


def px(length: float) -> str:
    """ "0.12 px", "1.25 px", "110 px"."""
    return f"{length:.0f} px" if length >= 100 else f"{length:.3g} px" if length >= 1 else f"{length:.2g} px"
