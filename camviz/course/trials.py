"""One call of a reader's function: what it was given, what it returned, printed, changed or raised.

Nothing that the function does gets out of `run`; it all becomes a `Trial`, for `camviz.course.checks` to speak about.
"""

from __future__ import annotations

import builtins
import contextlib
import inspect
import io
import math
import sys
import traceback
import warnings
from collections.abc import Callable, Iterable, Iterator
from copy import deepcopy
from dataclasses import dataclass, field, replace
from functools import cached_property
from types import ModuleType
from typing import Any

import numpy as np
from numpy.typing import NDArray

from camviz.course.patience import LIMIT_S, Patience, TimeIsUp

Array = NDArray[np.float64]
"""Numbers."""
Function = Callable[..., Any]
Arguments = tuple[Any, ...]
"""The arguments of one call."""

HINTS = 3
"""Every exercise has three: where to look, what to use, and the solution's line with a gap, written ___."""

_LONGEST = 500
"""Letters of an error's message."""

SHARED: tuple[ModuleType, ...] = (builtins, math, np, np.linalg, np.random)
"""What a reader's function might replace and everybody uses: put back after each call."""


@dataclass(frozen=True)
class Misconception:
    """A known mistake.

    Attributes
    ----------
    function : callable
        Makes it.
    explanation : str
        What to say to someone whose answers match the function's everywhere.

    Examples
    --------
    >>> Misconception(lambda x: x**2, "This is the square.").explanation
    'This is the square.'
    """

    function: Function
    explanation: str


@dataclass(frozen=True)
class Exercise:
    """What is asked, how to recognise the answer, and what to say otherwise.

    Known mistakes, other right ways and other conventions are written below the exercise, under its decorators.

    Parameters
    ----------
    name : str
        "LESSON.FUNCTION".
    reference : callable
        Gives the answer, an array or a tuple of arrays.
    cases : callable
        From a Generator to fresh argument tuples, different each time and of several shapes.
    hints : tuple of str
        Three, one per try.
    praise : str
        What to say to a right answer.
    tolerance : float, optional
        Relative to 1 + the size of the answer.
    shown : tuple of tuple, optional
        The arguments printed in the lesson.
    canonical : callable, optional
        Brings answers that mean the same (a matrix up to scale) to one form before they are compared.
    laws : tuple of callable, optional
        Further statements, law(function, rng) -> complaint in words, or "" where it holds.
    as_given : callable, optional
        The faulty function with which the search for a bug begins.

    Raises
    ------
    ValueError
        For other than three hints, and a tolerance that is not positive.

    Examples
    --------
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

        Parameters
        ----------
        explanation : str
            Speaks to the thought behind it.

        Returns
        -------
        callable
            The decorator.
        """

        def remember(function: Function) -> Function:
            self.misconceptions.append(Misconception(function, explanation))
            return function

        return remember

    def right(self, function: Function) -> Function:
        """Decorates another right way: OpenCV's function, the lesson's own formula, another order of the terms.

        Parameters
        ----------
        function : callable
            The other way.

        Returns
        -------
        callable
            The same.
        """
        self.right_ways.append(function)
        return function

    def convention(self, explanation: str) -> Callable[[Function], Function]:
        """Decorates a function that answers by another convention, and is accepted with a word about it.

        Parameters
        ----------
        explanation : str
            Says whose convention it is, and what the task's is.

        Returns
        -------
        callable
            The decorator.
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

        Parameters
        ----------
        arguments : tuple
            Of one call.
        reference : callable, optional
            Another reference.

        Returns
        -------
        tuple of array (...)
            One for each array of the answer.
        """
        with quiet():
            return self.normalised((reference or self.reference)(*deepcopy(arguments)))

    def normalised(self, result: Any) -> tuple[Array, ...]:
        """A result as float64 arrays in canonical form. Raises whatever numpy does for what is not numbers.

        Parameters
        ----------
        result : Any
            What a function returned.

        Returns
        -------
        tuple of array (...)
            One for each array of the result.
        """
        parts = as_arrays(result)
        if self.canonical is None:
            return parts
        return tuple(np.asarray(self.canonical(part), dtype=np.float64) for part in parts)

    def same(self, actual: tuple[Array, ...], expected: tuple[Array, ...]) -> bool:
        """Whether two answers have the same shapes and agree to the tolerance; NaN equals NaN.

        Parameters
        ----------
        actual, expected : tuple of array (...)
            Answers in canonical form, in the exercise's unit.

        Returns
        -------
        bool
            True where they are the same.
        """
        if [part.shape for part in actual] != [part.shape for part in expected]:
            return False
        return all(self.close(a, e).all() for a, e in zip(actual, expected, strict=True))

    def close(self, actual: Array, expected: Array) -> NDArray[np.bool_]:
        """Element by element, whether an answer agrees to the tolerance.

        Parameters
        ----------
        actual, expected : array (...)
            Answers in the exercise's unit.

        Returns
        -------
        array (...) of bool
            True where they agree; NaN equals NaN.
        """
        with quiet():
            return np.isclose(actual, expected, rtol=self.tolerance, atol=self.tolerance, equal_nan=True)

    def call(self, arguments: Arguments) -> str:
        """The call as a reader would write it; a larger array stands as its shape.

        Parameters
        ----------
        arguments : tuple
            Of the call.

        Returns
        -------
        str
            Python within double backquotes.
        """
        pairs = zip(self.parameters, arguments, strict=False)
        return f"``{self.name.split('.')[-1]}({', '.join(f'{name}={_short(value)}' for name, value in pairs)})``"


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
    except NotImplementedError:
        return _nothing(exercise, trial), None
    except (KeyboardInterrupt, TimeIsUp) as stop:
        return _interrupted(exercise, trial, stop), None
    except BaseException as error:
        complaint = explain(error, function) + f" It was called as {exercise.call(trial.arguments)}."
        return replace(trial, raised=(type(error), _message(error)), complaint=complaint), None
    return (_nothing(exercise, trial) if result is None or result is Ellipsis else trial), result


def _interrupted(exercise: Exercise, trial: Trial, stop: BaseException) -> Trial:
    return replace(trial, interrupted=True, complaint=stopped(exercise.call(trial.arguments), stop))


def stopped(call: str, stop: BaseException) -> str:
    """Why a call did not return: the reader stopped it, or its time was up."""
    if isinstance(stop, TimeIsUp):
        return f"{call[0].upper()}{call[1:]} had not returned after {LIMIT_S:g} s, and was stopped."
    return f"You stopped {call} before it returned."


def outcome(exercise: Exercise, function: Function, arguments: Arguments) -> Trial:
    """What a function of ours does with the arguments, without the care that a reader's needs."""
    try:
        with quiet():
            result = function(*deepcopy(arguments))
    except Exception as error:
        return Trial(arguments, raised=(type(error), _message(error)))
    if result is None:
        return Trial(arguments, stub=True)
    with quiet():
        return Trial(arguments, actual=exercise.normalised(result))


def same_outcome(exercise: Exercise, one: Trial, other: Trial) -> bool:
    """True where two functions did the same: numbers that agree, or nothing, or an error with the same message."""
    if one.actual or other.actual:
        return exercise.same(one.actual, other.actual)
    return one.stub == other.stub and one.raised == other.raised


def explain(error: BaseException, function: Function) -> str:
    """An exception in words: what happened, and in which line of the function."""
    what = f"Your function stopped with {type(error).__name__}: {_message(error)}."
    home = getattr(attribute(function, "__code__"), "co_filename", None)
    frames = [frame for frame in traceback.extract_tb(error.__traceback__) if frame.filename == home]
    if not frames or not frames[-1].line:
        return what
    return f"{what} It happened in line {frames[-1].lineno}: ``{frames[-1].line}``."


def attribute(function: Function, name: str) -> Any:
    """An attribute of whatever a reader calls a function; None without."""
    try:
        return getattr(function, name, None)
    except BaseException:  # of their own __getattr__
        return None


def _message(error: BaseException) -> str:
    try:
        words = str(error)
        return f"{words[:_LONGEST]} …" if len(words) > _LONGEST else words.rstrip(".") or "no message"
    except BaseException as another:
        return f"a message that cannot be read ({type(another).__name__})"


def signature_complaint(exercise: Exercise, function: Function) -> str:
    """What is wrong with the function's parameters, or "" when it can be called as the exercise calls it."""
    try:
        signature = inspect.signature(function)
        signature.bind(*exercise.parameters)
    except ValueError:  # a function of C that does not tell its parameters
        return ""
    except BaseException as error:
        if not isinstance(error, TypeError):
            return f"Its parameters cannot be read: {_message(error)}."
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


def as_arrays(result: Any) -> tuple[Array, ...]:
    """A result as float64 arrays: one for numbers, an array or a list, several for a tuple of arrays."""
    several = isinstance(result, tuple) and any(np.ndim(part) > 0 for part in result)
    return tuple(_as_array(part) for part in (result if several else (result,)))


def _as_array(part: Any) -> Array:
    if hasattr(part, "filled"):  # numpy.ma, which need not be imported for this; what is masked is not an answer
        part = part.astype(np.float64).filled(np.nan)
    values = np.asarray(part)
    if np.iscomplexobj(values):
        raise TypeError("complex numbers are no answer here")
    return values.astype(np.float64)


@contextlib.contextmanager
def quiet() -> Iterator[None]:
    """NaN and overflow are answers here, not news."""
    with warnings.catch_warnings(), np.errstate(all="ignore"):
        warnings.simplefilter("ignore")
        yield


@contextlib.contextmanager
def contained(output: io.StringIO) -> Iterator[None]:
    """What is called here prints into `output`, and what it replaces in the modules everybody uses is put back."""
    before = [(module.__dict__, module.__dict__.copy()) for module in SHARED]
    try:
        with contextlib.redirect_stdout(output), contextlib.redirect_stderr(sys.stderr), quiet():
            yield
    finally:
        for names, kept in before:  # without a builtin function, for those may be among what was replaced
            names.update(kept)


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
    if isinstance(result, list) and len(trial.expected) > 1:
        result = tuple(result)  # two answers in a list are two answers
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
