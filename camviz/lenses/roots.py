"""Where a polynomial first crosses zero, and where a rising function takes a value."""

from collections.abc import Callable

import numpy as np

from camviz.lenses.base import Array


def first_positive_root(coefficients: np.ndarray) -> float:
    """The smallest s > 0 with c0 + c1 s + c2 s² + … = 0; infinity where there is none. c0 must not be 0.

    Solved for 1/s, whose leading coefficient is c0: a vanishing last coefficient then costs no accuracy.
    """
    inverses = np.roots(coefficients)
    real = inverses.real[np.abs(inverses.imag) <= 1e-7 * np.abs(inverses)]
    largest = real.max(initial=0.0)
    return float(1 / largest) if largest > 0 else np.inf


def solve_rising(
    function: Callable[[Array], Array], slope: Callable[[Array], Array], value: Array, nodes: Array, levels: Array
) -> Array:
    """The t (n,) with function(t) = value (n,), by Newton's method kept inside the bracket that a table gives.

    `levels` are the function's values at the rising `nodes`, between whose ends it must rise. NaN for a value beyond
    the table and where the equation does not hold to 13 digits in the end.
    """
    cell = np.clip(np.searchsorted(levels, value, side="right"), 1, len(nodes) - 1)
    low, high = nodes[cell - 1], nodes[cell]
    t = low + (high - low) * (value - levels[cell - 1]) / (levels[cell] - levels[cell - 1])
    t[(value < levels[0]) | (value > levels[-1])] = np.nan
    todo = np.arange(len(t))
    for _ in range(60):
        error = function(t[todo]) - value[todo]
        off = np.abs(error) > 1e-13 * value[todo]
        todo, error = todo[off], error[off]
        if not len(todo):
            return t
        # f(t) = value  →  t ← t - (f(t) - value) / f'(t)
        t[todo] = np.clip(t[todo] - error / slope(t[todo]), low[todo], high[todo])
    t[todo] = np.nan
    return t
