"""What a ± must count when the data chose the model: that the other model may be the right one.

A covariance is that of one model. Where the views choose between a flat board and a bent one, other views might choose
otherwise, and the parameters would move by what lies between the two solutions.
"""

from __future__ import annotations

import numpy as np

from camviz.lenses.base import Array

PENALTY = 2  # of Akaike's criterion, for each parameter more


def weight_of_more(statistic: float, views: int, parameters: int) -> float:
    """Akaike's weight, 0 … 1, of a model with so many `parameters` more, from Hotelling's T² of these by the views.

    Twice the logarithm of the likelihoods' ratio is n ln(1 + T²/(n - 1)) for a mean of n independent samples. Source:
    Akaike (1974), "A new look at the statistical model identification"; Hotelling (1931), "The generalization of
    Student's ratio".

    >>> [round(weight_of_more(T2, views=20, parameters=2), 2) for T2 in (0, 4, 10, 20)]
    [0.12, 0.48, 0.9, 0.99]
    """
    gained = views * np.log1p(statistic / (views - 1)) - PENALTY * parameters
    return float(1 / (1 + np.exp(-gained / 2)))


def unconditional(covariance: Array, other: Array, change: Array, weight: float) -> Array:
    """The covariance (s, s) about a chosen solution, where an `other` one, off by `change` (s,), has that `weight`.

    (1 - w) C + w (C' + d dᵀ): the mean square of what the parameters are off by, over both models. Source: Burnham &
    Anderson (2004), "Multimodel inference: understanding AIC and BIC in model selection", Sociological Methods &
    Research 33, 261, eq. 4, about the chosen solution in place of a mean of both.

    >>> unconditional(np.eye(1), 2 * np.eye(1), np.array([3.0]), 0.5)
    array([[6.]])
    """
    return (1 - weight) * covariance + weight * (other + np.outer(change, change))
