"""How many points a typical wrong answer keeps: the same rule for every exercise, applied by running the answer."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import islice
from typing import Any

import numpy as np

from camviz.views.patience import Patience
from camviz_school.course.checks import Exercise, Misconception
from camviz_school.course.trials import Arguments, Trial, run

POINTS = 4
"""Of each exercise."""

RULE = """
An exercise brings 4 points. A right answer keeps 4, in whatever way it was found. A wrong one keeps 3 where at least
three quarters of its numbers are right: an end or a special case is missing. It keeps 2 where at least a quarter are
right, or where all are right but for one sign, one constant factor or the order: one slip. It keeps 1 where it shows a
thought named below, and 0 otherwise. The points are a proposal.
"""

MOST_CASES, LONGEST_CALL = 12, 90


@dataclass(frozen=True)
class WrongAnswer:
    """A typical wrong answer: its name, what to say to it, the points it keeps, and what it gives for an example."""

    name: str
    thought: str
    keeps: int
    gives: str


def wrong_answers(exercise: Exercise) -> list[WrongAnswer]:
    """The typical wrong answers of an exercise, the dearest first."""
    arguments = _telling_case(exercise)
    found = [_marked(exercise, one, arguments) for one in exercise.misconceptions]
    return sorted(found, key=lambda one: -one.keeps)


def example(exercise: Exercise) -> tuple[str, str] | None:
    """A call, and what the right answer gives for it; None where no case fits on a line."""
    arguments = _telling_case(exercise)
    return (exercise.call(arguments), _numbers(exercise.answer(arguments))) if arguments else None


def _marked(exercise: Exercise, known: Misconception, arguments: Arguments | None) -> WrongAnswer:
    cases = islice(exercise.cases(np.random.default_rng(0)), MOST_CASES)
    with Patience() as patience:  # one watch for all calls of an answer: to begin one takes longer than a call
        keeps = kept(exercise, [run(exercise, known.function, one, patience) for one in cases])
        gives = _numbers(run(exercise, known.function, arguments, patience).actual) if arguments else ""
    return WrongAnswer(known.function.__name__.replace("_", " "), known.explanation, keeps, gives)


def kept(exercise: Exercise, trials: list[Trial]) -> int:
    """The points that an answer keeps, from what it did in each case: POINTS when all of it is right."""
    if all(trial.fits for trial in trials):
        return POINTS - 1  # right numbers, and a broken law or an input overwritten
    share = sum(_share(exercise, trial) for trial in trials) / len(trials)
    if exercise.yes_or_no:
        share = 2 * share - 1  # half is what guessing brings
    if share >= 0.75:
        return 3
    return 2 if share >= 0.25 or _one_slip(exercise, trials) else 1


def _share(exercise: Exercise, trial: Trial) -> float:
    """How much of one answer is right, from 0 to 1."""
    if [part.shape for part in trial.actual] != [part.shape for part in trial.expected]:
        return 0.0
    right = [exercise.close(a, e).ravel() for a, e in zip(trial.actual, trial.expected, strict=True)]
    numbers = np.concatenate(right) if right else np.array([], bool)
    return float(numbers.mean()) if numbers.size else float(trial.fits)


def _one_slip(exercise: Exercise, trials: list[Trial]) -> bool:
    """True where every answer is the right one but for one factor or sign, or the order of the last axis."""
    if any([a.shape for a in t.actual] != [e.shape for e in t.expected] for t in trials):
        return False
    turned = all(exercise.same(t.actual, tuple(e[..., ::-1] if e.ndim else e for e in t.expected)) for t in trials)
    actual = np.concatenate([part.ravel() for t in trials for part in t.actual])
    expected = np.concatenate([part.ravel() for t in trials for part in t.expected])
    usable = np.isfinite(actual) & np.isfinite(expected) & (np.abs(expected) > 1e-6)
    factor = np.median(actual[usable] / expected[usable]) if usable.any() else 0.0
    scaled = usable.sum() > 2 and factor and np.allclose(actual, factor * expected, rtol=1e-6, equal_nan=True)
    return turned or bool(scaled)


def _telling_case(exercise: Exercise) -> Arguments | None:
    """Of the cases that fit on a line, the one in which most wrong answers differ from the right one."""
    cases = islice(exercise.cases(np.random.default_rng(0)), MOST_CASES)
    short = [one for one in (*exercise.shown, *(tuple(map(_rounded, case)) for case in cases)) if _fits(exercise, one)]

    def told_apart(arguments: Arguments) -> int:
        with Patience() as patience:
            return sum(not run(exercise, known.function, arguments, patience).fits for known in exercise.misconceptions)

    return max(short, key=told_apart, default=None)


def _fits(exercise: Exercise, arguments: Arguments) -> bool:
    """True for a call that fits on a line and has numbers for an answer, rounded arguments or not."""
    call = exercise.call(arguments)
    if "<array" in call or len(call) > LONGEST_CALL:
        return False
    trial = run(exercise, exercise.reference, arguments)
    numbers = np.concatenate([part.ravel() for part in trial.expected])
    return bool(np.isfinite(numbers).all()) and 0 < len(_numbers(trial.expected)) <= LONGEST_CALL


def _rounded(argument: Any) -> Any:
    """An argument with the digits that one would write on a board, unless those leave nothing of it."""
    if isinstance(argument, float):
        return round(argument, 2) or argument
    if isinstance(argument, np.ndarray) and argument.dtype.kind == "f":
        return argument.round(2) if argument.round(2).any() else argument
    return argument


def _numbers(parts: tuple[np.ndarray, ...]) -> str:
    """Five digits of each number, on one line."""
    return ", ".join(_written(part.tolist()) for part in parts)


def _written(value: Any) -> str:
    return f"[{', '.join(map(_written, value))}]" if isinstance(value, list) else f"{value + 0.0:.5g}"
