"""Calling a reader's function: with patience, silently, and with its errors in words. Nothing it does gets out."""

from __future__ import annotations

import builtins
import contextlib
import io
import math
import sys
import traceback
import warnings
from collections.abc import Callable, Iterator
from types import ModuleType
from typing import Any, TextIO

import numpy as np
from numpy.typing import NDArray

from camviz.views.patience import LIMIT_S, TimeIsUp, is_debugging

Array = NDArray[np.float64]
"""Numbers."""

Function = Callable[..., Any]

_LONGEST = 500
"""Letters of an error's message."""

SHARED: tuple[ModuleType, ...] = (builtins, math, np, np.linalg, np.random)
"""What a reader's function might replace and everybody uses: put back after each call."""


@contextlib.contextmanager
def contained(output: io.StringIO) -> Iterator[None]:
    """What is called here prints into `output`, and what it replaces in the modules everybody uses is put back.

    So is the limit of calls within calls. A debugger that is opened here prints on the screen.
    """
    limit = sys.getrecursionlimit()
    before = [(module.__dict__, module.__dict__.copy()) for module in SHARED]
    printed = _Captured(output, sys.stdout)
    try:
        with contextlib.redirect_stdout(printed), contextlib.redirect_stderr(sys.stderr), quiet():
            yield
    finally:
        sys.setrecursionlimit(limit)
        for names, kept in before:  # without a builtin function, for those may be among what was replaced
            names.update(kept)


class _Captured(io.TextIOBase):
    """A stdout that writes into `output`, and on `screen` what a debugger prints."""

    def __init__(self, output: io.StringIO, screen: TextIO) -> None:
        self._output, self._screen = output, screen

    def write(self, text: str) -> int:
        return (self._screen if is_debugging(sys._getframe()) else self._output).write(text)

    def flush(self) -> None:
        self._screen.flush()


@contextlib.contextmanager
def quiet() -> Iterator[None]:
    """NaN and overflow are answers here, not news."""
    with warnings.catch_warnings(), np.errstate(all="ignore"):
        warnings.simplefilter("ignore")
        yield


def explain(error: BaseException, function: Function) -> str:
    """An exception in words: what happened, and in which line of the function."""
    what = f"Your function stopped with {type(error).__name__}: {message(error)}."
    frames = [frame for frame in traceback.extract_tb(error.__traceback__) if frame.filename == _home(function)]
    if not frames or not frames[-1].line:
        return what
    return f"{what} It happened in line {frames[-1].lineno}: ``{frames[-1].line}``."


def is_stub_error(error: BaseException, function: Function) -> bool:
    """Whether the function's own file raised NotImplementedError, and not a library that it calls."""
    frames = traceback.extract_tb(error.__traceback__)
    return isinstance(error, NotImplementedError) and frames[-1].filename == _home(function)


def _home(function: Function) -> str | None:
    return getattr(attribute(function, "__code__"), "co_filename", None)


def attribute(function: Function, name: str) -> Any:
    """An attribute of whatever a reader calls a function; None without."""
    try:
        return getattr(function, name, None)
    except BaseException:  # of their own __getattr__
        return None


def message(error: BaseException) -> str:
    try:
        words = str(error)
        return f"{words[:_LONGEST]} …" if len(words) > _LONGEST else words.rstrip(".") or "no message"
    except BaseException as another:
        return f"a message that cannot be read ({type(another).__name__})"


def stopped(call: str, stop: BaseException) -> str:
    """Why a call did not return: the reader stopped it, or its time was up."""
    if isinstance(stop, TimeIsUp):
        return f"{call[0].upper()}{call[1:]} had not returned after {LIMIT_S:g} s, and was stopped."
    return f"You stopped {call} before it returned."


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
