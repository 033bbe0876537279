"""One call of a reader's function, long because so much can come of it: what it was given, returned, printed or raised.

Nothing that the function does gets out of `run`; it all becomes a `Trial`, for `camviz_school.course.checks` to speak
about.
"""

from __future__ import annotations

import inspect
import io
from collections.abc import Callable, Iterable, Iterator
from copy import deepcopy
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from camviz.views.calls import Array, Function, as_arrays, contained, explain, is_stub_error, message, quiet, stopped
from camviz.views.patience import Patience, TimeIsUp

Arguments = tuple[Any, ...]
"""The arguments of one call."""

HINTS = 3
"""Every exercise has three: where to look, what to use, and the solution's line with a gap, written ___."""


@dataclass(frozen=True)
class Misconception:
    """A known mistake.

    Attributes:
        function: Makes it.
        explanation: What to say to someone whose answers match the function's everywhere.

    >>> Misconception(lambda x: x**2, "This is the square.").explanation
    'This is the square.'
    """

    function: Function
    explanation: str


@dataclass(frozen=True)
class Exercise:
    """What is asked, how to recognise the answer, and what to say otherwise.

    Known mistakes, other right ways and other conventions are written below the exercise, under its decorators.

    Args:
        name: "LESSON.FUNCTION".
        reference: Gives the answer, an array or a tuple of arrays.
        cases: From a Generator to fresh argument tuples, different each time and of several shapes.
        hints: Three, one per try.
        praise: What to say to a right answer.
        tolerance: Relative to 1 + the size of the answer.
        shown: The arguments printed in the lesson.
        canonical: Brings answers that mean the same (a matrix up to scale) to one form before they are compared.
        laws: Further statements, law(function, rng) -> complaint in words, or "" where it holds.
        as_given: The faulty function with which the search for a bug begins.
        any_numbers: False where rounded arguments no longer belong together, such as the pixels of one point.

    Raises: ValueError for other than three hints, and a tolerance that is not positive.

    >>> double = Exercise("00.double", lambda x: 2 * x, lambda rng: [(rng.normal(),)], ("a", "b", "c"), "Twice.")
    >>> @double.wrong("This is the square: it agrees at 2 and nowhere else.")
    ... def squared(x):
    ...     return x**2
    >>> @double.right
    ... def added(x):
    ...     return x + x
    """

    name: str
    reference: Function
    cases: Callable[[np.random.Generator], Iterable[Arguments]]
    hints: tuple[str, ...]
    praise: str
    tolerance: float = 1e-9
    shown: tuple[Arguments, ...] = ()
    canonical: Callable[[Array], Array] | None = None
    laws: tuple[Callable[[Function, np.random.Generator], str], ...] = ()
    as_given: Function | None = None
    any_numbers: bool = True
    misconceptions: list[Misconception] = field(default_factory=list, init=False)
    right_ways: list[Function] = field(default_factory=list, init=False)
    conventions: list[Misconception] = field(default_factory=list, init=False)

    def __post_init__(self) -> None:
        if len(self.hints) != HINTS:
            raise ValueError(f"hints of exercise {self.name} must be {HINTS}, got {len(self.hints)}")
        if not self.tolerance > 0:
            raise ValueError(f"tolerance of exercise {self.name} must be positive, got {self.tolerance}")

    def wrong(self, explanation: str) -> Callable[[Function], Function]:
        """Decorates a wrong function that readers write.

        Args:
            explanation: Speaks to the thought behind it.

        Returns: The decorator.
        """

        def remember(function: Function) -> Function:
            self.misconceptions.append(Misconception(function, explanation))
            return function

        return remember

    def right(self, function: Function) -> Function:
        """Decorates another right way: OpenCV's function, the lesson's own formula, another order of the terms.

        Args:
            function: The other way.

        Returns: The same.
        """
        self.right_ways.append(function)
        return function

    def convention(self, explanation: str) -> Callable[[Function], Function]:
        """Decorates a function that answers by another convention, and is accepted with a word about it.

        Args:
            explanation: Says whose convention it is, and what the task's is.

        Returns: The decorator.
        """

        def remember(function: Function) -> Function:
            self.conventions.append(Misconception(function, explanation))
            return function

        return remember

    @property
    def bug(self) -> bool:
        """True where the task is to find the bug in a function that is given."""
        return self.as_given is not None

    @property
    def parameters(self) -> list[str]:
        """The names of the arguments."""
        return list(inspect.signature(self.reference).parameters)

    @cached_property
    def yes_or_no(self) -> bool:
        """True where the answer is True or False, or an array of them."""
        answer = self.reference(*next(iter(self.cases(np.random.default_rng(0)))))
        return isinstance(answer, bool) or getattr(answer, "dtype", None) == np.bool_

    def answer(self, arguments: Arguments, reference: Function | None = None) -> tuple[Array, ...]:
        """The right answer in canonical form.

        Args:
            arguments: tuple, of one call.
            reference: Another reference.

        Returns: tuple of (...), one for each array of the answer.
        """
        with quiet():
            return self.normalised((reference or self.reference)(*deepcopy(arguments)))

    def normalised(self, result: Any) -> tuple[Array, ...]:
        """A result as float64 arrays in canonical form. Raises whatever numpy does for what is not numbers.

        Args:
            result: What a function returned.

        Returns: tuple of (...), one for each array of the result.
        """
        parts = as_arrays(result)
        if self.canonical is None:
            return parts
        return tuple(np.asarray(self.canonical(part), dtype=np.float64) for part in parts)

    def same(self, actual: tuple[Array, ...], expected: tuple[Array, ...]) -> bool:
        """Whether two answers have the same shapes and agree to the tolerance; NaN equals NaN.

        Args:
            actual, expected: tuple of (...), answers in canonical form, in the exercise's unit.

        Returns: True where they are the same.
        """
        if [part.shape for part in actual] != [part.shape for part in expected]:
            return False
        return all(self.close(a, e).all() for a, e in zip(actual, expected, strict=True))

    def close(self, actual: Array, expected: Array) -> NDArray[np.bool_]:
        """Element by element, whether an answer agrees to the tolerance.

        Args:
            actual, expected: (...), answers in the exercise's unit.

        Returns: (...) of bool, True where they agree; NaN equals NaN.
        """
        with quiet():
            return np.isclose(actual, expected, rtol=self.tolerance, atol=self.tolerance, equal_nan=True)

    def call(self, arguments: Arguments) -> str:
        """The call as a reader would write it; a larger array stands as its shape.

        Args:
            arguments: tuple, of the call.

        Returns: Python within double backquotes.
        """
        pairs = zip(self.parameters, arguments, strict=False)
        return f"``{self.name.split('.')[-1]}({', '.join(f'{name}={_short(value)}' for name, value in pairs)})``"


@dataclass(frozen=True)
class Whole:
    """The arguments of one call, some of them whole numbers: as decimals, and as integers."""

    decimals: Arguments
    integers: Arguments


def whole_numbers(exercise: Exercise, cases: Iterable[Arguments]) -> Iterator[Whole]:
    """The first case that can be rounded and has another answer than whole numbers, if there is one.

    An array is rounded where that leaves NaN and infinity in the answer where they were. Matrices (3, 3) and (4, 4)
    stay: few of them are rotations, or have an inverse, once they are rounded.

    Args:
        exercise: What was asked.
        cases: Of the exercise.

    Returns: Iterator over no case or one.
    """
    if not exercise.any_numbers or exercise.yes_or_no:
        return
    for case in cases:
        decimals = _rounded(exercise, case)
        rounded = [one is not other for one, other in zip(decimals, case, strict=True)]
        answer = exercise.answer(decimals)
        if any(rounded) and not exercise.same(answer, tuple(map(np.rint, answer))):
            pairs = zip(decimals, rounded, strict=True)
            yield Whole(decimals, tuple(value.astype(np.int64) if whole else value for value, whole in pairs))
            return


def _rounded(exercise: Exercise, case: Arguments) -> Arguments:
    """A case, its arrays rounded one after the other, as far as the answer bears it."""
    finite = _finite(exercise, case)
    for index, value in enumerate(case):
        array = isinstance(value, np.ndarray) and value.dtype.kind == "f" and value.ndim > 0
        if not array or value.shape[-2:] in ((3, 3), (4, 4)) or not np.isfinite(value).all():
            continue
        tried = (*case[:index], np.rint(value), *case[index + 1 :])
        if _finite(exercise, tried) == finite:
            case = tried
    return case


def _finite(exercise: Exercise, case: Arguments) -> list[list[bool]]:
    """Which numbers of the answer are finite; empty where there is no answer."""
    try:
        return [np.isfinite(part).ravel().tolist() for part in exercise.answer(case)]
    except np.linalg.LinAlgError:
        return []


@dataclass(frozen=True)
class Trial:
    """What came of one call.

    `actual` is () unless numbers came back, `stub` says that nothing did, `raised` is the type of what was raised and
    its message, and `interrupted` that the reader, or the end of the time there is, stopped the call.
    """

    arguments: Arguments
    expected: tuple[Array, ...] = ()
    actual: tuple[Array, ...] = ()
    complaint: str = ""
    stub: bool = False
    raised: tuple[type[BaseException], str] | None = None
    interrupted: bool = False
    mutated: str = ""
    printed: str = ""
    fits: bool = False


def run(exercise: Exercise, function: Function, arguments: Arguments, patience: Patience | None = None) -> Trial:
    """Calls the function with a copy of the arguments, silently, and compares what it returns with the answer.

    It may take what time the patience has left; without one, as long as a whole check.
    """
    if patience is None:
        with Patience() as patience:
            return run(exercise, function, arguments, patience)
    given, output = deepcopy(arguments), _Printed()
    trial, result = _called(exercise, function, Trial(arguments), given, output, patience)
    trial = replace(
        trial,
        expected=exercise.answer(arguments),  # not before the call, where the function could find it
        printed=" ".join(output.getvalue().split())[:200],
        mutated=_mutated(exercise, arguments, given),
    )
    if trial.stub or trial.complaint:
        return trial
    return _compared(exercise, trial, result, patience)


def _called(
    exercise: Exercise, function: Function, trial: Trial, given: Arguments, output: _Printed, patience: Patience
) -> tuple[Trial, Any]:
    """The trial so far and what the function returned."""
    try:
        with contained(output):
            result = patience.call(function, *given)
    except (KeyboardInterrupt, TimeIsUp) as stop:
        return _interrupted(exercise, trial, stop), None
    except BaseException as error:
        if is_stub_error(error, function):
            return _nothing(exercise, trial), None
        complaint = explain(error, function) + f" It was called as {exercise.call(trial.arguments)}."
        return replace(trial, raised=(type(error), message(error)), complaint=complaint), None
    return (_nothing(exercise, trial) if result is None or result is Ellipsis else trial), result


def _interrupted(exercise: Exercise, trial: Trial, stop: BaseException) -> Trial:
    return replace(trial, interrupted=True, complaint=stopped(exercise.call(trial.arguments), stop))


def outcome(exercise: Exercise, function: Function, arguments: Arguments) -> Trial:
    """What a function of ours does with the arguments, without the care that a reader's needs."""
    try:
        with quiet():
            result = function(*deepcopy(arguments))
    except Exception as error:
        return Trial(arguments, raised=(type(error), message(error)))
    if result is None:
        return Trial(arguments, stub=True)
    with quiet():
        return Trial(arguments, actual=exercise.normalised(result))


def same_outcome(exercise: Exercise, one: Trial, other: Trial) -> bool:
    """True where two functions did the same: numbers that agree, or nothing, or an error with the same message."""
    if one.actual or other.actual:
        return exercise.same(one.actual, other.actual)
    return one.stub == other.stub and one.raised == other.raised


def signature_complaint(exercise: Exercise, function: Function) -> str:
    """What is wrong with the function's parameters, or "" when it can be called as the exercise calls it."""
    try:
        signature = inspect.signature(function)
        signature.bind(*exercise.parameters)
    except ValueError:  # a function of C that does not tell its parameters
        return ""
    except BaseException as error:
        if not isinstance(error, TypeError):
            return f"Its parameters cannot be read: {message(error)}."
        return (
            f"It will be called with `({', '.join(exercise.parameters)})`, but your function takes "
            f"`{_signature(function)}`."
        )
    return ""


def _signature(function: Function) -> str:
    try:
        return str(inspect.signature(function))
    except TypeError:
        return "other parameters"


class _Printed(io.StringIO):
    """What a function prints: the beginning of it, and closing it closes nothing."""

    LONGEST = 2000

    def write(self, text: str) -> int:
        super().write(text[: max(0, self.LONGEST - self.tell())])
        return len(text)

    def close(self) -> None:
        """Stays open: what was printed is still to be read."""


def _nothing(exercise: Exercise, trial: Trial) -> Trial:
    call = exercise.call(trial.arguments)
    return replace(
        trial, stub=True, complaint=f"{call} returned nothing: is a `return` missing on one of the ways out?"
    )


def _compared(exercise: Exercise, trial: Trial, result: Any, patience: Patience) -> Trial:
    if len(trial.expected) > 1 and (isinstance(result, list) or _is_stack(result, trial.expected)):
        result = tuple(result)  # two answers in a list or in one array are two answers
    try:
        with contained(_Printed()):  # the result's own methods are a reader's, too
            shapes, actual = patience.call(lambda: ([p.shape for p in as_arrays(result)], exercise.normalised(result)))
    except (KeyboardInterrupt, TimeIsUp) as stop:
        return _interrupted(exercise, trial, stop)
    except BaseException:  # whatever those methods raise, LinAlgError of a canonical form among it
        what = f"something of type {type(result).__name__} that is not an array of real numbers"
        return replace(trial, complaint=f"{exercise.call(trial.arguments)} returned {what}.")
    complaint = _shape_complaint(exercise, trial, shapes)
    fits = not complaint and exercise.same(actual, trial.expected)
    return replace(trial, actual=actual, complaint=complaint, fits=fits)


def _is_stack(result: Any, expected: tuple[Array, ...]) -> bool:
    """Whether one array has all answers, one after the other along its first axis."""
    return isinstance(result, np.ndarray) and all(result.shape == (len(expected), *part.shape) for part in expected)


def _shape_complaint(exercise: Exercise, trial: Trial, shapes: list[tuple[int, ...]]) -> str:
    call, wanted = exercise.call(trial.arguments), [part.shape for part in trial.expected]
    if len(shapes) != len(wanted):
        return f"{call} returned {_count(len(shapes))}, where {_count(len(wanted))} should come back."
    for shape, expected in zip(shapes, wanted, strict=True):
        if shape != expected:
            return f"{call} returned shape {shape}, where {expected} is wanted."
    return ""


def _mutated(exercise: Exercise, before: Arguments, after: Arguments) -> str:
    for name, old, new in zip(exercise.parameters, before, after, strict=False):
        if isinstance(old, np.ndarray) and not np.array_equal(old, new, equal_nan=old.dtype.kind == "f"):
            return (
                f"The answers are right, but your function overwrites its input `{name}`, so whoever calls it loses "
                f"their numbers: begin with a copy, or build a new array."
            )
    return ""


def _short(value: Any) -> str:
    if isinstance(value, np.ndarray) and value.size > 9:
        return f"<array of shape {value.shape}>"
    if isinstance(value, np.ndarray):
        return _digits(value.tolist())
    return _digits(value)


def _digits(value: Any) -> str:
    if isinstance(value, list):
        return f"[{', '.join(map(_digits, value))}]"
    return f"{value:.6g}" if isinstance(value, float) else repr(value)


def _count(number: int) -> str:
    return "one array" if number == 1 else f"{number} arrays"
