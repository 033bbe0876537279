"""Statistics of the frames that a virtual sensor exposed."""

from math import nan

import numpy as np
from numpy.typing import ArrayLike


def slope_through_origin(x: ArrayLike, y: ArrayLike, weights: ArrayLike = 1.0) -> float:
    """The slope m of the least-squares line y = m x through points x, y (n,); NaN where every x is 0."""
    x, y, weights = np.broadcast_arrays(np.asarray(x, float), np.asarray(y, float), np.asarray(weights, float))
    below = float(np.sum(weights * x * x))
    return float(np.sum(weights * x * y)) / below if below > 0 else nan
