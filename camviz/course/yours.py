"""A reader's own function in a picture: what it answers, or empty places and one sentence that says why.

A lesson goes on with the reader's functions, right, wrong or not yet written, so whatever they do becomes numbers that
can be drawn. Whether they are right is for the checkers (`camviz.course.checks`) to say.
"""

from __future__ import annotations

from collections.abc import Callable
from copy import deepcopy
from io import StringIO
from typing import Any

import numpy as np

from camviz.course import prose
from camviz.course.trials import as_arrays, contained, explain

Function = Callable[..., Any]

MID_GREY = 128
"""What an empty picture of bytes is filled with."""


def attempt(function: Function, *arguments: Any, like: Any) -> Any:
    """What a reader's function answers, in the shape and type of `like`, an array or a tuple of arrays.

    Never raises for what the function does. Where it returns nothing, stops with an error or answers in another shape,
    every number is NaN (a picture of bytes is grey, a mask is False), and one printed sentence says why.

    >>> attempt(lambda x: 2 * x, np.array([1.0, 2.0]), like=np.zeros(2))
    array([2., 4.])
    >>> def double(x):
    ...     ...  # your lines here
    >>> attempt(double, np.array([1.0, 2.0]), like=np.zeros(2))
    `double` returns nothing yet, so its part of the picture stays empty.
    array([nan, nan])
    """
    answer, problem = tried(function, arguments, like)
    if problem:
        print(problem)
    return answer


def attempt_each(function: Function, *arguments: Any, like: Any) -> Any:
    """As `attempt`, for a function of one case and arguments that each hold n of them; says once what is wrong.

    >>> attempt_each(lambda x, y: x + y, [1.0, 2.0], [10.0, 20.0], like=np.zeros(2))
    array([11., 22.])
    """
    cases = zip(*arguments, like, strict=True)
    answers = [tried(function, tuple(given), np.asarray(one)) for *given, one in cases]
    problems = [problem for _, problem in answers if problem]
    if problems:
        print(problems[0])
    return np.stack([answer for answer, _ in answers])


def tried(function: Function, arguments: tuple[Any, ...], like: Any) -> tuple[Any, str]:
    """As `attempt`, for a view: the answer and, instead of printing it, the sentence; "" where all is well."""
    wanted = like if isinstance(like, tuple) else (like,)
    given, problem = _answers(function, arguments, wanted)
    parts = tuple(_in_the_type_of(one, as_given) for one, as_given in zip(wanted, given, strict=True))
    return parts if isinstance(like, tuple) else parts[0], problem


def _answers(
    function: Function, arguments: tuple[Any, ...], wanted: tuple[Any, ...]
) -> tuple[tuple[np.ndarray, ...], str]:
    """Arrays of float in the shapes wanted, all NaN where there is a problem."""
    empty = tuple(np.full(np.shape(one), np.nan) for one in wanted)
    name = f"`{getattr(function, '__name__', 'your function')}`"
    left_out = "so its part of the picture stays empty."
    try:
        with contained(StringIO()):
            result = function(*deepcopy(arguments))
            if result is None or result is Ellipsis:
                return empty, f"{name} returns nothing yet, {left_out}"
            parts = as_arrays(result)
    except KeyboardInterrupt:
        raise
    except NotImplementedError:
        return empty, f"{name} is not written yet, {left_out}"
    except BaseException as error:
        return empty, f"{name} gives no answer, {left_out} {prose.to_plain(explain(error, function))}"
    shapes, right = [part.shape for part in parts], [one.shape for one in empty]
    if shapes != right:
        return empty, f"{name} answers in shape {_listed(shapes)}, where {_listed(right)} is wanted, {left_out}"
    return parts, ""


def _in_the_type_of(like: Any, values: np.ndarray) -> Any:
    kind = np.asarray(like).dtype
    if kind == np.uint8:
        return np.clip(np.nan_to_num(values, nan=MID_GREY), 0, 255).round().astype(np.uint8)
    if kind == np.bool_:
        return np.nan_to_num(values).astype(bool)
    return values[()]  # a number where a number is wanted, an array else


def _listed(shapes: list[tuple[int, ...]]) -> str:
    return ", ".join(map(str, shapes))
