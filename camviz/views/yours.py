"""A reader's own function in a picture: what it answers, or empty places and one sentence that says why.

A lesson goes on with the reader's functions, right, wrong or not yet written, so whatever they do becomes numbers that
can be drawn. Whether they are right is for the checkers (`camviz_school.course.checks`) to say.
"""

from __future__ import annotations

from collections.abc import Callable
from contextlib import nullcontext
from copy import deepcopy
from io import StringIO
from typing import Any

import numpy as np

from camviz.draw import prose, svg
from camviz.draw.marks import NOTHING, Marks
from camviz.draw.panel import Panel
from camviz.views.calls import as_arrays, attribute, contained, explain, is_stub_error, stopped
from camviz.views.patience import Patience, TimeIsUp

Function = Callable[..., Any]
"""What a reader writes."""

YOURS_HERE = "yours appears here"
"""What stands over the right picture, greyed, where a reader's own will be."""

MID_GREY = 128
"""What an empty picture of bytes is filled with."""

_NOT_YET = ("is not written yet", "returns nothing yet")

_missed: set[str] = set()
"""Names of functions without which a plot was drawn."""

_stopped: dict[int, tuple[Function, str]] = {}
"""Functions that did not return, by their id, and the sentence: the next draft would otherwise wait for them again."""


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
    _say(function, problem)
    return answer


def _say(function: Function, problem: str) -> None:
    """Print what is wrong, and remember whose plot is drawn without it because it is not written yet."""
    if problem:
        print(problem)
    if is_unwritten(problem):
        _missed.add(_name_of(function))


def faded(picture: np.ndarray) -> np.ndarray:
    """A right picture (height, width, 3), uint8, greyed and with the words "yours appears here": whose place it keeps.

    >>> faded(np.full((60, 240, 3), 40, np.uint8))[0, 0]
    array([180, 180, 180], dtype=uint8)
    """
    from PIL import Image, ImageDraw, ImageFont  # 8 MB less than OpenCV, which unpacks its fonts for a word

    pale = np.asarray(Image.fromarray(picture).convert("L"), dtype=float) * 0.35 + 255 * 0.65
    made = Image.fromarray(np.uint8(np.rint(pale))).convert("RGB")
    height, width = picture.shape[:2]
    font = ImageFont.load_default(max(9.0, width / 18))
    ImageDraw.Draw(made).text((width / 2, height / 2), YOURS_HERE, (28, 35, 48), font, anchor="mm")
    return np.array(made)


def was_missed(function: Function) -> bool:
    """Whether a plot was drawn without the function of this name, as it was not written yet; forgotten when asked."""
    missed = _name_of(function) in _missed
    _missed.discard(_name_of(function))
    return missed


def _name_of(function: Function) -> str:
    return str(attribute(function, "__name__") or "your function")


def attempt_each(function: Function, *arguments: Any, like: Any) -> Any:
    """As `attempt`, for a function of one case and arguments that each hold n of them; says once what is wrong.

    >>> attempt_each(lambda x, y: x + y, [1.0, 2.0], [10.0, 20.0], like=np.zeros(2))
    array([11., 22.])
    """
    cases = zip(*arguments, like, strict=True)
    with Patience() as patience:
        answers = [tried(function, tuple(given), np.asarray(one), patience) for *given, one in cases]
    problems = [problem for _, problem in answers if problem]
    _say(function, problems[0] if problems else "")
    return np.stack([answer for answer, _ in answers])


def tried(
    function: Function, arguments: tuple[Any, ...], like: Any, patience: Patience | None = None
) -> tuple[Any, str]:
    """As `attempt`, for a view: the answer and, instead of printing it, the sentence; "" where all is well.

    Several calls for one picture share a `patience`. A function that had to be stopped is not called a second time.
    """
    wanted = like if isinstance(like, tuple) else (like,)
    with nullcontext(patience) if patience else Patience() as watching:
        given, problem = _answers(function, arguments, wanted, watching)
    parts = tuple(_in_the_type_of(one, as_given) for one, as_given in zip(wanted, given, strict=True))
    return parts if isinstance(like, tuple) else parts[0], problem


def is_unwritten(problem: str) -> bool:
    """Whether a sentence of `tried` says that the reader has not begun: there is nothing wrong, and nothing yet.

    >>> is_unwritten("`distort` returns nothing yet, so its part of the picture stays empty.")
    True
    """
    return any(f" {words}, " in problem for words in _NOT_YET)


def placeholder(problem: str) -> str:
    """What stands where a reader's own would be: `YOURS_HERE` while nothing is written, else what is wrong with it."""
    return YOURS_HERE if is_unwritten(problem) else problem


def answered(function: Function | None, arguments: tuple[Any, ...], like: Any) -> tuple[Any, str]:
    """What a reader's function answers, in the shape of `like`, and what is wrong with it; NaN where there is none."""
    if function is None:
        like = np.asarray(like, dtype=float)
        return np.full(like.shape, np.nan), "No function of yours has been given."
    return tried(function, arguments, like)


def without(
    panel: Panel, problem: str, title: str, at: tuple[float, float] = (12, 26), right: Marks = NOTHING
) -> Marks:
    """The panel with the sentence that says why it is empty.

    Where the reader has written nothing yet and `right` is what a right function would show there, the panel shows that
    greyed, and says whose place it is.
    """
    if right and is_unwritten(problem):
        words = svg.text((panel.width / 2, panel.height / 2), YOURS_HERE, "title halo middle")
        return panel.show(svg.group(right, "awaited") + words, title=title)
    return panel.show(svg.paragraph(at, problem, panel.width - 2 * at[0]), title=title)


def _answers(
    function: Function, arguments: tuple[Any, ...], wanted: tuple[Any, ...], patience: Patience
) -> tuple[tuple[np.ndarray, ...], str]:
    """Arrays of float in the shapes wanted, all NaN where there is a problem."""
    empty = tuple(np.full(np.shape(one), np.nan) for one in wanted)
    name = f"`{_name_of(function)}`"
    left_out = "so its part of the picture stays empty."
    if id(function) in _stopped:
        return empty, _stopped[id(function)][1]
    try:
        with contained(StringIO()):
            parts = patience.call(_numbers, function, deepcopy(arguments))
    except (KeyboardInterrupt, TimeIsUp) as stop:
        again = "It is not called again until you have run the cell in which it stands."
        _stopped[id(function)] = function, f"{stopped(name, stop)[:-1]}, {left_out} {again}"
        return empty, _stopped[id(function)][1]
    except BaseException as error:
        if is_stub_error(error, function):
            return empty, f"{name} {_NOT_YET[0]}, {left_out}"
        return empty, f"{name} gives no answer, {left_out} {prose.to_plain(explain(error, function))}"
    if parts is None:
        return empty, f"{name} {_NOT_YET[1]}, {left_out}"
    shapes, right = [part.shape for part in parts], [one.shape for one in empty]
    if shapes != right:
        return empty, f"{name} answers in shape {_listed(shapes)}, where {_listed(right)} is wanted, {left_out}"
    if _all_nan(parts) and not _all_nan(wanted):
        return empty, f"{name} answers NaN everywhere, {left_out}"
    return parts, ""


def _numbers(function: Function, arguments: tuple[Any, ...]) -> tuple[np.ndarray, ...] | None:
    """What a reader's function returns, as arrays; None for a stub."""
    result = function(*arguments)
    return None if result is None or result is Ellipsis else as_arrays(result)


def _all_nan(parts: tuple[Any, ...]) -> bool:
    return all(np.size(part) and np.isnan(np.asarray(part, dtype=float)).all() for part in parts)


def _in_the_type_of(like: Any, values: np.ndarray) -> Any:
    kind = np.asarray(like).dtype
    if kind == np.uint8:
        return np.clip(np.nan_to_num(values, nan=MID_GREY), 0, 255).round().astype(np.uint8)
    if kind == np.bool_:
        return np.nan_to_num(values).astype(bool)
    return values[()]  # a number where a number is wanted, an array else


def _listed(shapes: list[tuple[int, ...]]) -> str:
    return ", ".join(map(str, shapes))
