"""Laws that several exercises share: what must hold of a reader's function beyond single answers."""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np

from camviz_school.course.trials import Arguments, Array, Function

MOVED_PX = 5.0
"""By how much a match is moved to see whether it counts."""


def unused_row(function: Function, arguments: Arguments, canonical: Callable[[Array], Array]) -> int | None:
    """Return the first of n matches that does not change a function's answer, None where all change it.

    Args:
        function: Takes the arguments.
        arguments: tuple of (n, ...), the last of them pixels.
        canonical: Brings answers that mean the same to one form.

    >>> unused_row(lambda x: x[:2].sum(axis=0), (np.ones((4, 2)),), np.asarray)
    2
    """
    before = canonical(np.asarray(function(*arguments), dtype=np.float64))
    *others, pixels = arguments
    for row in range(len(pixels)):
        moved = pixels.copy()
        moved[row] += MOVED_PX
        after = canonical(np.asarray(function(*others, moved), dtype=np.float64))
        if np.allclose(after, before, rtol=1e-7, atol=1e-12):
            return row
    return None


def error_ratio(
    function: Function, reference: Function, draws: Sequence[Arguments], error: Callable[[Array, int], float]
) -> float:
    """Return how much larger a function's error is than the reference's, as the median over noisy draws.

    Args:
        function, reference: Take the arguments of a draw.
        draws: The arguments, with noise.
        error: error(answer, number of the draw), against the truth of that draw.
    """
    ratios = []
    for number, arguments in enumerate(draws):
        answer = np.asarray(function(*(value.copy() for value in arguments)), dtype=np.float64)
        ratios.append(error(answer, number) / error(reference(*arguments), number))
    return float(np.median(ratios))
