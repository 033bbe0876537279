"""One call of a reader's function: what it was given, what it returned, printed, changed or raised.

Nothing that the function does gets out of `run`; it all becomes a `Trial`, for `camviz.checks` to speak about.
"""

from __future__ import annotations

import contextlib
import inspect
import io
import traceback
import warnings
from collections.abc import Callable, Iterable, Iterator
from copy import deepcopy
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
Function = Callable[..., Any]
Arguments = tuple[Any, ...]


@dataclass(frozen=True)
class Misconception:
    """A known mistake: the function that makes it, and what to say to someone whose answers match it everywhere."""

    reference: Function
    explanation: str


@dataclass(frozen=True)
class Exercise:
    """What is asked, how to recognise the answer, and what to say otherwise.

    `cases(rng)` yields fresh argument tuples, different each time and of several shapes; `reference(*arguments)` is the
    answer, an array or a tuple of arrays. `tolerance` is relative to 1 + |answer|. `shown` are the arguments printed in
    the lesson. `canonical` brings answers that mean the same (a matrix up to scale) to one form before they are
    compared. `laws` are further statements, law(function, rng) -> complaint in words, or "" where it holds. `hints` are
    given one per try, the last one again and again. The stub of a `bug` exercise is a wrong function, to be mended.
    """

    name: str
    reference: Function
    cases: Callable[[np.random.Generator], Iterable[Arguments]]
    hints: tuple[str, ...]
    praise: str
    misconceptions: tuple[Misconception, ...] = ()
    tolerance: float = 1e-9
    shown: tuple[Arguments, ...] = ()
    canonical: Callable[[Array], Array] | None = None
    laws: tuple[Callable[[Function, np.random.Generator], str], ...] = ()
    bug: bool = False

    def __post_init__(self) -> None:
        if not self.hints:
            raise ValueError(f"hints of exercise {self.name} must hold at least one hint")
        if not self.tolerance > 0:
            raise ValueError(f"tolerance of exercise {self.name} must be positive, got {self.tolerance}")

    @property
    def parameters(self) -> list[str]:
        """The names of the arguments."""
        return list(inspect.signature(self.reference).parameters)

    def answer(self, arguments: Arguments, reference: Function | None = None) -> tuple[Array, ...]:
        """The right answer, or that of another reference, in canonical form."""
        with quiet():
            return self.normalised((reference or self.reference)(*deepcopy(arguments)))

    def normalised(self, result: Any) -> tuple[Array, ...]:
        """A result as float64 arrays in canonical form. Raises whatever numpy does for what is not numbers."""
        parts = as_arrays(result)
        if self.canonical is None:
            return parts
        return tuple(np.asarray(self.canonical(part), dtype=np.float64) for part in parts)

    def same(self, actual: tuple[Array, ...], expected: tuple[Array, ...]) -> bool:
        """True when the answers have the same shapes and agree to the tolerance; NaN equals NaN."""
        if [part.shape for part in actual] != [part.shape for part in expected]:
            return False
        return all(self.close(a, e).all() for a, e in zip(actual, expected, strict=True))

    def close(self, actual: Array, expected: Array) -> NDArray[np.bool_]:
        """Element by element, whether an answer agrees to the tolerance."""
        with quiet():
            return np.isclose(actual, expected, rtol=self.tolerance, atol=self.tolerance, equal_nan=True)

    def call(self, arguments: Arguments) -> str:
        """The call as a reader would write it; a larger array stands as its shape."""
        pairs = zip(self.parameters, arguments, strict=False)
        return f"``{self.name.split('.')[-1]}({', '.join(f'{name}={_short(value)}' for name, value in pairs)})``"


@dataclass(frozen=True)
class Trial:
    """What came of one call. `actual` is () unless numbers came back, `stub` says that nothing did."""

    arguments: Arguments
    expected: tuple[Array, ...]
    actual: tuple[Array, ...] = ()
    complaint: str = ""
    stub: bool = False
    mutated: str = ""
    printed: str = ""
    fits: bool = False


def run(exercise: Exercise, function: Function, arguments: Arguments) -> Trial:
    """Calls the function with a copy of the arguments, silently, and compares what it returns with the answer."""
    trial = Trial(arguments, exercise.answer(arguments))
    given, output = deepcopy(arguments), io.StringIO()
    try:
        with contextlib.redirect_stdout(output), quiet():
            result = function(*given)
    except NotImplementedError:
        return _nothing(exercise, trial)
    except (Exception, SystemExit) as error:
        return replace(trial, complaint=explain(error, function) + f" It was called as {exercise.call(arguments)}.")
    printed = " ".join(output.getvalue().split())[:200]
    trial = replace(trial, printed=printed, mutated=_mutated(exercise, arguments, given))
    if result is None or result is Ellipsis:
        return _nothing(exercise, trial)
    return _compared(exercise, trial, result)


def explain(error: BaseException, function: Function) -> str:
    """An exception in words: what happened, and in which line of the function."""
    what = f"Your function stopped with {type(error).__name__}: {str(error).rstrip('.') or 'no message'}."
    home = getattr(getattr(function, "__code__", None), "co_filename", None)
    frames = [frame for frame in traceback.extract_tb(error.__traceback__) if frame.filename == home]
    if not frames or not frames[-1].line:
        return what
    return f"{what} It happened in line {frames[-1].lineno}: ``{frames[-1].line}``."


def signature_complaint(exercise: Exercise, function: Function) -> str:
    """What is wrong with the function's parameters, or "" when it can be called as the exercise calls it."""
    try:
        signature = inspect.signature(function)
    except (TypeError, ValueError):
        return ""
    try:
        signature.bind(*exercise.parameters)
    except TypeError:
        return f"It will be called with `({', '.join(exercise.parameters)})`, but your function takes `{signature}`."
    return ""


def as_arrays(result: Any) -> tuple[Array, ...]:
    """A result as float64 arrays: one for numbers, an array or a list, several for a tuple of arrays."""
    several = isinstance(result, tuple) and any(np.ndim(part) > 0 for part in result)
    parts = tuple(np.asarray(part) for part in (result if several else (result,)))
    if any(np.iscomplexobj(part) for part in parts):
        raise TypeError("complex numbers are no answer here")
    return tuple(part.astype(np.float64) for part in parts)


@contextlib.contextmanager
def quiet() -> Iterator[None]:
    """NaN and overflow are answers here, not news."""
    with warnings.catch_warnings(), np.errstate(all="ignore"):
        warnings.simplefilter("ignore")
        yield


def _nothing(exercise: Exercise, trial: Trial) -> Trial:
    call = exercise.call(trial.arguments)
    return replace(
        trial, stub=True, complaint=f"{call} returned nothing: is a `return` missing on one of the ways out?"
    )


def _compared(exercise: Exercise, trial: Trial, result: Any) -> Trial:
    try:
        shapes = [part.shape for part in as_arrays(result)]
        with quiet():
            actual = exercise.normalised(result)
    except (TypeError, ValueError, ArithmeticError, IndexError):  # LinAlgError is a ValueError
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
        return str(np.round(value, 6).tolist())
    return f"{value:.6g}" if isinstance(value, float) else repr(value)


def _count(number: int) -> str:
    return "one array" if number == 1 else f"{number} arrays"
