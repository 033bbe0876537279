"""By how much the second vote beat the first, for a question and for each thought behind a wrong answer."""

from __future__ import annotations

from collections.abc import Sequence

from camviz_school.course.questions import Question


def gain(before: float, after: float) -> float | None:
    """Hake's normalised gain, (after − before) / (1 − before), of two shares; None where nothing was left to gain.

    R. R. Hake, Interactive-engagement versus traditional methods, American Journal of Physics 66 (1998), 64–74.

    >>> gain(0.4, 0.7)
    0.5
    >>> gain(1.0, 1.0) is None
    True
    """
    return None if before >= 1 else round((after - before) / (1 - before), 12)


def gains(question: Question, pairs: Sequence[tuple[int, int]]) -> list[float | None]:
    """The gain of each choice from the first and second choices of those who voted twice, in the choices' order.

    For the right choice the shares are those who chose it. For a wrong one they are those who did *not* choose it, so
    that 1 means that everyone gave up the misconception behind it, and 0 that as many hold it as before.
    """
    return [_gain_of(number, choice.correct, pairs) for number, choice in enumerate(question.choices)]


def _gain_of(choice: int, correct: bool, pairs: Sequence[tuple[int, int]]) -> float | None:
    if not pairs:
        return None
    first, second = (sum((pair[vote] == choice) == correct for pair in pairs) / len(pairs) for vote in (0, 1))
    return gain(first, second)
