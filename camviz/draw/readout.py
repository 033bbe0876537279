"""Read-outs: numbers as text with a true minus sign, and rows of names with their values beside a picture."""

from __future__ import annotations

from collections.abc import Iterable, Mapping

import numpy as np
from numpy.typing import ArrayLike

from camviz.draw import svg
from camviz.draw.marks import Marks


def true_minus(words: str) -> str:
    """The words with minus signs for hyphens."""
    return words.replace("-", "−")


def signed(value: float, decimals: int) -> str:
    """A number with its sign, plus or minus.

    >>> signed(2, 1), signed(-0.04, 1)
    ('+2.0', '−0.0')
    """
    return true_minus(f"{value:+.{decimals}f}")


def decimal(value: float, decimals: int) -> str:
    """A number that has a sign only where it is below zero as written.

    >>> decimal(-2, 1), decimal(-0.04, 1)
    ('−2.0', '0.0')
    """
    return true_minus(f"{round(float(value), decimals) + 0.0:.{decimals}f}")


def vector(values: ArrayLike, decimals: int, width: int = 0) -> str:
    """Numbers (n,) in brackets, each at least `width` letters wide.

    >>> vector([1, -0.5], 2)
    '(1.00, −0.50)'
    """
    return f"({', '.join(f'{decimal(value, decimals):>{width}}' for value in np.asarray(values))})"


def seconds(time: float) -> str:
    """An exposure time as photographers write it.

    >>> seconds(2), seconds(0.01)
    ('2 s', '1/100 s')
    """
    return f"{time:.3g} s" if time >= 0.3 else f"1/{1 / time:.0f} s"


def listed(figures: Mapping[str, str] | Iterable[tuple[str, str]]) -> str:
    """Names with their values, one after the other.

    >>> listed({"gain": "2 DN/e⁻", "light": "3 %"})
    'gain 2 DN/e⁻; light 3 %'
    """
    return "; ".join(f"{name} {value}" for name, value in _pairs(figures))


def readout(
    figures: Mapping[str, str] | Iterable[tuple[str, str]],
    at: tuple[float, float],
    step: tuple[float, float],
    value_at: tuple[float, float],
    class_: str = "label",
) -> Marks:
    """Names with their values, the first name `at` a place, `step` from name to name and `value_at` from name to value.

    What is the reader's own, "yours" in its name, is orange.
    """
    rows = []
    for i, (name, value) in enumerate(_pairs(figures)):
        x, y = at[0] + i * step[0], at[1] + i * step[1]
        of_the_reader = "yours" in name
        rows.append(svg.text((x, y), name, "note"))
        place = (x + value_at[0], y + value_at[1])
        rows.append(svg.text(place, value, "orange" if of_the_reader else class_))
    return svg.join(rows)


def _pairs(figures: Mapping[str, str] | Iterable[tuple[str, str]]) -> Iterable[tuple[str, str]]:
    return figures.items() if isinstance(figures, Mapping) else figures
