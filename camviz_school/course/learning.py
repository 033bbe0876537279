"""How much a class learned: Hake's normalised gain from answers given before and after a lesson.

R. R. Hake, Interactive-engagement versus traditional methods, American Journal of Physics 66 (1998), 64–74.
"""

from __future__ import annotations

import warnings
from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import ArrayLike, NDArray

from camviz_school.course.answers import Answer, read_answers
from camviz_school.course.questions import quiz_questions

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Gain:
    """The normalised gain of a class, and the interval that holds it with the `level` of confidence."""

    gain: float
    low: float
    high: float
    level: float
    students: int

    def __str__(self) -> str:
        interval = f"{100 * self.level:g} %: {self.low:.2f} to {self.high:.2f}"
        return f"g = {self.gain:.2f} ({interval}; {self.students} students)"


@dataclass(frozen=True)
class Scores:
    """The share of right first choices of each student, before and after a lesson, in the order of `participants`.

    `incomplete` counts those who left out a question at either end; their answers are in neither array.
    """

    participants: tuple[str, ...]
    before: Array
    after: Array
    incomplete: int


def normalised_gain(before: ArrayLike, after: ArrayLike, rng: np.random.Generator, level: float = 0.95) -> Gain:
    """⟨g⟩ = (mean after − mean before) / (1 − mean before), with its interval by a bootstrap over students.

    `before` and `after` (n,) are shares of right answers between 0 and 1, the same student in the same place. The
    interval is bias-corrected and accelerated (Efron 1987): students are drawn anew, each with both shares. Its ends
    are NaN where students do not differ, or where a class so drawn can have had everything right before.

    Raises ValueError for fewer than two students, shares outside 0 … 1, and a class that had everything right before,
    which has nothing left to gain.
    """
    first, last = np.asarray(before, dtype=np.float64), np.asarray(after, dtype=np.float64)
    if first.ndim != 1 or first.shape != last.shape or first.size < 2:
        raise ValueError(f"before and after must be (n,) of at least 2 students, got {first.shape} and {last.shape}")
    if not all(((shares >= 0) & (shares <= 1)).all() for shares in (first, last)):
        raise ValueError("before and after must be shares between 0 and 1")
    if first.mean() == 1:
        raise ValueError("before must leave something to gain: every answer was right")
    low, high = _interval(first, last, rng, level)
    return Gain(float(_gain(first, last)), low, high, level, first.size)


def class_scores(files: Iterable[Path], lesson: str) -> Scores:
    """The scores of a class in a lesson, from the files that students exported.

    A student counts whose file has a first choice for every question before and after. Files of other lessons are
    passed over. Raises ValueError naming a file that cannot be read or was not exported, and two files of one code.
    """
    kept: dict[str, tuple[float, float]] = {}
    incomplete = 0
    for path in sorted(files):
        answers = [one for one in read_answers(path) if one.lesson == lesson]
        if any(one.correct is None for one in answers):
            raise ValueError(f"{path.name} says not what is right: it is not an exported file")
        for code in sorted({one.participant for one in answers}):
            if code in kept:
                raise ValueError(f"{path.name}: another file has the code {code}, too")
            own = [one for one in answers if one.participant == code]
            shares = _share(own, "before", lesson), _share(own, "after", lesson)
            if np.isnan(shares).any():
                incomplete += 1
            else:
                kept[code] = shares
    pairs = np.array(list(kept.values()), dtype=np.float64).reshape(-1, 2)
    return Scores(tuple(kept), pairs[:, 0], pairs[:, 1], incomplete)


def _share(answers: list[Answer], when: str, lesson: str) -> float:
    """The share of right first choices; NaN unless every question of one form has one."""
    first = [one for one in answers if one.when == when and one.attempt == 1]
    asked = {one.form: {each.concept for each in quiz_questions(lesson, one.form)} for one in first}
    complete = len(asked) == 1 and {one.concept for one in first} == next(iter(asked.values()))
    return float(np.mean([one.correct for one in first])) if complete else np.nan


def _gain(before: Array, after: Array, axis: int = -1) -> Array:
    room = 1 - np.mean(before, axis=axis)
    risen = np.mean(after, axis=axis) - np.mean(before, axis=axis)
    return np.divide(risen, room, out=np.full(np.shape(room), np.nan), where=room > 0)


def _interval(before: Array, after: Array, rng: np.random.Generator, level: float) -> tuple[float, float]:
    from scipy.stats import bootstrap

    pair = (before, after)
    with np.errstate(all="ignore"), warnings.catch_warnings():
        warnings.simplefilter("ignore")  # of students who do not differ: the ends are NaN then, and that is said
        found = bootstrap(pair, _gain, paired=True, n_resamples=4999, confidence_level=level, method="BCa", rng=rng)
    return float(found.confidence_interval.low), float(found.confidence_interval.high)
