"""Exercise checking in words: long because each kind of mistake has its reply.

A checker never raises for what a reader wrote, and never calls a stub, a constant or a function that only fits the
numbers on the page correct. It knows numpy and nothing about cameras. It gives nothing away
to someone who has not tried: an untouched stub brings neither a hint nor, where a bug is to be found, what the bug is.
"""

from __future__ import annotations

import io
import sys
from collections.abc import Callable, Iterable, Sequence
from dataclasses import replace
from math import log10
from typing import Any

import numpy as np

from camviz.views.patience import Patience, TimeIsUp
from camviz_school.course.trials import (
    Arguments,
    Array,
    Exercise,
    Function,
    Misconception,
    Trial,
    contained,
    explain,
    outcome,
    run,
    same_outcome,
    signature_complaint,
    stopped,
    whole_numbers,
)
from camviz_school.course.verdict import Verdict

__all__ = ["SHAPES", "Arguments", "Array", "Exercise", "Misconception", "Verdict", "judge"]

SHAPES: tuple[tuple[int, ...], ...] = ((), (1,), (6,), (3, 4))
"""The leading axes an exercise's cases should run through: one point, a list of one, a list, a grid.

>>> [np.zeros((*shape, 3)).size for shape in SHAPES]  # numbers in so many points of space
[3, 3, 18, 36]
"""

NEAR = 1e-4
"""Of 1 + |answer|: closer than this is a matter of rounding, not of understanding."""

ROUGHLY = 0.03
"""Of |answer|: as near as the best of a few hundred tries."""

MIN_RECURSION_LIMIT = 1000
"""Calls within calls: Python's own limit, for the time of a check where someone has set a lower one."""


def judge(exercise: Exercise, function: Any, rng: np.random.Generator | None = None, attempt: int = 1) -> Verdict:
    """What is to be said about a reader's function.

    Never raises for what the function does, and stops it when all its calls together take longer than
    camviz.views.patience allows.

    Args:
        exercise: What was asked.
        function: What the reader wrote; a function or not.
        rng: Where the cases are drawn from; unless given, one seeded by the operating system.
        attempt: 1 is the first.

    Returns: Verdict with a stronger hint at each attempt.

    >>> hints = "What is x by x?", "Multiply.", "x * ___"
    >>> square = Exercise("00.square", lambda x: x * x, lambda rng: [(rng.normal(),)], hints, "Yes.")
    >>> judge(square, lambda x: x**2, np.random.default_rng(1))
    ✓ Correct. Yes.
    >>> judge(square, lambda x: 2 * x, np.random.default_rng(1)).hint
    'What is x by x?'
    """
    rng = np.random.default_rng() if rng is None else rng
    limit = sys.getrecursionlimit()
    sys.setrecursionlimit(max(limit, MIN_RECURSION_LIMIT))
    try:
        with Patience() as patience:
            return _judged(exercise, function, rng, attempt, patience)
    except KeyboardInterrupt as stop:  # between two calls of the function
        return Verdict(exercise.name, "wrong", stopped("the check", stop))
    finally:
        sys.setrecursionlimit(limit)


def _judged(exercise: Exercise, function: Any, rng: np.random.Generator, attempt: int, patience: Patience) -> Verdict:
    if not callable(function):
        return _unsolved(exercise)
    complaint = signature_complaint(exercise, function)
    if complaint:
        return Verdict(exercise.name, "wrong", complaint)  # no hint: its mathematics may be right
    trials = _trials(exercise, function, rng, patience)
    printed = next((trial.printed for trial in trials if trial.printed), "")
    if trials[-1].interrupted:
        return _wrong(exercise, f"{trials[-1].complaint} Does a loop in it never end?", attempt)
    if _untouched(exercise, trials):
        return replace(_unsolved(exercise), printed=printed)
    other_convention = _known(exercise, exercise.conventions, trials)
    if other_convention:
        return Verdict(exercise.name, "correct", other_convention, printed=printed)
    complaint = _complaint(exercise, function, trials, rng, patience)
    verdict = _wrong(exercise, complaint, attempt) if complaint else _correct(exercise)
    return replace(verdict, printed=printed)


def _trials(exercise: Exercise, function: Function, rng: np.random.Generator, patience: Patience) -> list[Trial]:
    """A call for each case, until one has to be stopped."""
    trials: list[Trial] = []
    for arguments in exercise.cases(rng):
        trials.append(run(exercise, function, arguments, patience))
        if trials[-1].interrupted:
            break
    return trials


def _untouched(exercise: Exercise, trials: Sequence[Trial]) -> bool:
    """True for a stub that returns nothing, and for a faulty function that still does what it did as given."""
    if exercise.as_given:
        return _does_the_same(exercise, exercise.as_given, trials)
    return trials[0].stub and not any(trial.fits for trial in trials)


def _correct(exercise: Exercise) -> Verdict:
    return Verdict(exercise.name, "correct", exercise.praise)


def _unsolved(exercise: Exercise) -> Verdict:
    begin = (
        "The function still does what it did when it was given to you. Change it,"
        if exercise.bug
        else "Replace the stub by your own lines,"
    )
    demand = "True or False" if exercise.yes_or_no else f"right to {_digits(exercise.tolerance)}"
    test = f"It is tried on fresh random numbers, and its answers must be {demand}."
    hint = f"""Stuck? `check.hint("{exercise.name}")` gives the first of three hints."""
    return Verdict(exercise.name, "unsolved", f"{begin} then run this cell again. {test} {hint}")


def _digits(tolerance: float) -> str:
    """A tolerance of 1 + |answer| in words."""
    digits = round(-log10(tolerance))
    return f"{100 * tolerance:g} %" if digits < 3 else f"about {digits} digits"


def _wrong(exercise: Exercise, message: str, attempt: int) -> Verdict:
    return Verdict(exercise.name, "wrong", message, hint(exercise, attempt))


def hint(exercise: Exercise, attempt: int) -> str:
    """What is given at the attempt (1 is the first): a stronger hint each time, the last one again and again."""
    return exercise.hints[min(max(attempt, 1), len(exercise.hints)) - 1]


def _complaint(
    exercise: Exercise, function: Function, trials: Sequence[Trial], rng: np.random.Generator, patience: Patience
) -> str:
    """What is wrong, in words, the most telling thing first; empty when nothing is."""
    if all(trial.fits for trial in trials):
        mutated = next((trial.mutated for trial in trials if trial.mutated), "")
        return (
            mutated
            or _with_whole_numbers(exercise, function, trials, patience)
            or _broken_law(exercise, function, rng, patience)
        )
    wrong = [trial for trial in trials if not trial.fits]
    known = _known(exercise, exercise.misconceptions, trials) or _nothing_but_nan(trials) or _constant(trials)
    broken = next((trial.complaint for trial in wrong if trial.complaint), "")
    if broken:
        return known or _only_for_some(exercise, function, trials, patience) + broken
    return (
        known
        or _usual_change(exercise, trials)
        or _factor(exercise, trials)
        or _misplaced_nan(exercise, wrong)
        or _in_some_shapes(exercise, function, trials, patience)
        or _in_steps(exercise, function, trials, patience)
        or _nearly(exercise, trials)
        or _without_a_look_at(exercise, function, patience)
        or _difference(exercise, wrong[0])
    )


def _with_whole_numbers(exercise: Exercise, function: Function, trials: Sequence[Trial], patience: Patience) -> str:
    """Speaks when whole numbers bring a wrong answer, above all as integers; an error in answer to these is forgiven.

    OpenCV's functions raise one, and whoever calls them learns what to do.
    """
    for whole in whole_numbers(exercise, [trial.arguments for trial in trials]):
        trial = run(exercise, function, whole.decimals, patience)
        if not trial.fits:
            return trial.complaint or _difference(exercise, trial)
        trial = run(exercise, function, whole.integers, patience)
        if not (trial.fits or trial.raised):
            return (
                f"{trial.complaint or _difference(exercise, trial)} For the same numbers as decimals it is right. "
                "For example, `np.zeros_like` of integers makes integers, which cut decimals off: "
                "give the array that you fill `dtype=float`."
            )
    return ""


def _broken_law(exercise: Exercise, function: Function, rng: np.random.Generator, patience: Patience) -> str:
    for law in exercise.laws:
        try:
            with contained(io.StringIO()):
                complaint = patience.call(law, function, rng)
        except (KeyboardInterrupt, TimeIsUp) as stop:
            return stopped("your function", stop)
        except BaseException as error:
            complaint = explain(error, function)
        if complaint:
            return complaint
    return ""


def _known(exercise: Exercise, functions: Sequence[Misconception], trials: Sequence[Trial]) -> str:
    """The explanation of the known function that does what the reader's does in every case.

    It has to give a number somewhere: functions that only raise errors, or only answer NaN, have little in common.
    """
    if not any((~np.isnan(part)).any() for trial in trials for part in trial.actual):
        return ""
    for known in functions:
        if _does_the_same(exercise, known.function, trials):
            return known.explanation
    return ""


def _does_the_same(exercise: Exercise, function: Function, trials: Sequence[Trial]) -> bool:
    return all(same_outcome(exercise, outcome(exercise, function, trial.arguments), trial) for trial in trials)


def _nothing_but_nan(trials: Sequence[Trial]) -> str:
    answers = [trial.actual for trial in trials if trial.actual]
    if not answers or not np.isnan(_joined(answers)).all():
        return ""
    return "All values that your function returns are NaN. Print the values on the way to find the first NaN."


def _constant(trials: Sequence[Trial]) -> str:
    if len(trials) < 2 or not all(trial.actual for trial in trials):
        return ""
    values = np.unique(_joined(trial.actual for trial in trials))
    return "Your function answers the same number whatever it is given." if len(values) == 1 else ""


def _usual_change(exercise: Exercise, trials: Sequence[Trial]) -> str:
    """Speaks when every answer is the right one turned, swapped or converted in a way that has a usual cause."""
    for change, explanation in _USUAL_CHANGES:
        if all(exercise.same(trial.actual, tuple(change(part) for part in trial.expected)) for trial in trials):
            return explanation
    return ""


def _transposed(answer: Array) -> Array:
    return np.swapaxes(answer, -1, -2) if answer.ndim > 1 else answer


def _reversed(answer: Array) -> Array:
    return answer[..., ::-1] if answer.ndim else answer


_USUAL_CHANGES: tuple[tuple[Callable[[Array], Array], str], ...] = (
    (np.negative, "Every number is right but for its sign: the sign is flipped."),
    (_reversed, "The numbers are right but come in reverse order: look at which coordinate is first, and which last."),
    (_transposed, "This is the transpose of the answer: rows and columns have changed places."),
    (np.degrees, "This looks like degrees, where radians are wanted."),
    (np.radians, "This looks like a conversion from degrees of something that was in radians already."),
)


def _factor(exercise: Exercise, trials: Sequence[Trial]) -> str:
    """Speaks when every answer is the right one times the same number, zeros and NaN included."""
    actual, expected = _joined(t.actual for t in trials), _joined(t.expected for t in trials)
    usable = np.isfinite(actual) & np.isfinite(expected) & (np.abs(expected) > 1e-6)
    if usable.sum() < 3:
        return ""
    ratios = actual[usable] / expected[usable]
    factor = float(np.median(ratios))
    alike = np.allclose(ratios, factor, rtol=1e-6, atol=0)
    if factor == 0 or not alike or not exercise.close(actual, factor * expected)[~usable].all():
        return ""
    if abs(factor - 1) < 1e-5:
        return f"Close, but not to {exercise.tolerance:g}: is something rounded, or an iteration stopped too early?"
    if abs(factor - 1) < 5e-3:
        return f"Every answer is the right one times {factor:.6g}: close, but is a constant rounded in it?"
    return f"Every answer is the right one times {factor:.6g}: a constant factor is missing, or counted twice."


def _misplaced_nan(exercise: Exercise, wrong: Sequence[Trial]) -> str:
    """Speaks when nothing but the place of NaN is wrong."""
    actual, expected = _joined(t.actual for t in wrong), _joined(t.expected for t in wrong)
    either = np.isnan(actual) | np.isnan(expected)
    if not exercise.close(actual, expected)[~either].all():
        return ""
    for trial in wrong:
        no_answer, no_number = np.isnan(_joined([trial.expected])), np.isnan(_joined([trial.actual]))
        if (no_answer & ~no_number).any():
            return f"Some of these inputs have no answer, and then NaN is wanted: {exercise.call(trial.arguments)}."
        if (no_number & ~no_answer).any():
            return f"Your function gives NaN where there is an answer: {exercise.call(trial.arguments)}."
    return ""


def _nearly(exercise: Exercise, trials: Sequence[Trial]) -> str:
    """Speaks when every answer is right to four digits or so, and none is to the tolerance asked for."""
    actual, expected = _joined(t.actual for t in trials), _joined(t.expected for t in trials)
    near = np.isclose(actual, expected, rtol=NEAR, atol=NEAR, equal_nan=True)
    if exercise.yes_or_no or exercise.tolerance >= NEAR or not near.all():
        return ""
    return f"Close, but not to {exercise.tolerance:g}: is something rounded, or an iteration stopped too early?"


def _in_steps(exercise: Exercise, function: Function, trials: Sequence[Trial], patience: Patience) -> str:
    """Speaks when every answer is nearly right, and none changes when all numbers change by a ten-millionth."""
    actual, expected = _joined(t.actual for t in trials), _joined(t.expected for t in trials)
    if exercise.yes_or_no or not np.isclose(actual, expected, rtol=ROUGHLY, atol=0, equal_nan=True).all():
        return ""
    for trial in trials:
        after = run(exercise, function, tuple(map(_nudged, trial.arguments)), patience)
        if not after.actual or not all(map(np.array_equal, after.actual, trial.actual)):
            return ""
    return (
        "Each answer is nearly right, and stays the same when your function is given slightly other numbers: is it the "
        "best of a list or a grid that is too coarse, or is something rounded?"
    )


def _nudged(value: Any) -> Any:
    decimal = isinstance(value, float) or (isinstance(value, np.ndarray) and value.dtype.kind == "f")
    return value * (1 + 1e-7) if decimal else value


def _without_a_look_at(exercise: Exercise, function: Function, patience: Patience) -> str:
    """Names an argument whose number seems to be written into a function that fits the numbers shown in the lesson.

    Speaks only where another number for the argument changes the right answer, and the function's not at all.
    """
    if not exercise.shown or not all(run(exercise, function, shown, patience).fits for shown in exercise.shown):
        return ""
    (shown, *_) = exercise.shown
    before = run(exercise, function, shown, patience)
    for index, name in enumerate(exercise.parameters):
        other = shown[:index] + (shown[index] * 1.5,) + shown[index + 1 :]
        after = run(exercise, function, other, patience)
        moved = not exercise.same(after.expected, before.expected)
        if moved and after.actual and all(map(np.array_equal, after.actual, before.actual)):
            return (
                f"It fits the numbers shown in the lesson, but its answer does not change with `{name}`: is that "
                "number written into your function?"
            )
    return ""


def _only_for_some(exercise: Exercise, function: Function, trials: Sequence[Trial], patience: Patience) -> str:
    """Names the shapes of an argument for which the function is right, when the shape alone decides it.

    Each shape is tried a second time, with the numbers of a case that turned out the other way.
    """
    for index, name in enumerate(exercise.parameters):
        right = {np.shape(trial.arguments[index]): trial.arguments for trial in trials if trial.fits}
        wrong = {np.shape(trial.arguments[index]): trial.arguments for trial in trials if not trial.fits}
        if not right or not wrong or set(right) & set(wrong):
            continue
        one_right, one_wrong = next(iter(right.values())), next(iter(wrong.values()))
        again = [(_in_shape(index, like, one_wrong), True) for like in right.values()]
        again += [(_in_shape(index, like, one_right), False) for like in wrong.values()]
        if all(_turns_out(exercise, function, arguments, fits, patience) for arguments, fits in again):
            return f"It is right when `{name}` has shape {_listed(right)}, but not for {_listed(wrong)}. "
    return ""


def _in_shape(index: int, like: Arguments, arguments: Arguments) -> Arguments:
    """The arguments, the one at the index (and all that share its shape in both cases) repeated or cut off to fit."""
    before, after = np.shape(arguments[index]), np.shape(like[index])
    return tuple(
        np.resize(value, after) if (np.shape(value), np.shape(model)) == (before, after) else value
        for value, model in zip(arguments, like, strict=True)
    )


def _turns_out(exercise: Exercise, function: Function, arguments: Arguments, fits: bool, patience: Patience) -> bool:
    """Whether the function is right, or wrong, for arguments of which the reference may not know what to make."""
    try:
        exercise.answer(arguments)
    except (ValueError, IndexError, np.linalg.LinAlgError):
        return False
    return run(exercise, function, arguments, patience).fits == fits


def _in_some_shapes(exercise: Exercise, function: Function, trials: Sequence[Trial], patience: Patience) -> str:
    shapes = _only_for_some(exercise, function, trials, patience)
    return shapes and shapes + _difference(exercise, next(trial for trial in trials if not trial.fits))


def _difference(exercise: Exercise, trial: Trial) -> str:
    actual, expected = next(
        pair for pair in zip(trial.actual, trial.expected, strict=True) if not exercise.close(*pair).all()
    )
    wrong = ~exercise.close(actual, expected)
    numbers = wrong & ~np.isnan(actual) & ~np.isnan(expected)  # two of them say more than one and NaN
    index = tuple(int(i) for i in np.argwhere(numbers if numbers.any() else wrong)[0])
    where = f" at index {list(index)}" if index else ""
    got, right = _told_apart(float(actual[index]), float(expected[index]), exercise.yes_or_no)
    return f"{exercise.call(trial.arguments)} gave {got}{where}, where {right} is right."


def _told_apart(one: float, other: float, yes_or_no: bool) -> tuple[str, str]:
    """Two different numbers with as many digits as it takes to see the difference."""
    if yes_or_no and {one, other} <= {0.0, 1.0}:
        return str(bool(one)), str(bool(other))
    pairs = ((f"{one:.{digits}g}", f"{other:.{digits}g}") for digits in (6, 9, 12, 17))
    return next((pair for pair in pairs if pair[0] != pair[1]), (repr(one), repr(other)))


def _joined(answers: Iterable[tuple[Array, ...]]) -> Array:
    return np.concatenate([part.ravel() for parts in answers for part in parts])


def _listed(shapes: Iterable[tuple[int, ...]]) -> str:
    return " or ".join(str(shape) for shape in sorted(shapes, key=len))
