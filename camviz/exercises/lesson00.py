"""Lesson 00, start here: one small exercise, to meet the checker."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from camviz.checks import SHAPES, Arguments, Array, Exercise, Misconception


def homogeneous(points: Array) -> Array:
    """Points (..., n) with a last coordinate 1 appended."""
    return np.concatenate([points, np.ones_like(points[..., :1])], axis=-1)


def _cases(rng: np.random.Generator) -> Iterator[Arguments]:
    for shape in SHAPES:
        for n in (2, 3):
            yield (rng.normal(size=(*shape, n)),)


def _one_in_front(points: Array) -> Array:
    return np.concatenate([np.ones_like(points[..., :1]), points], axis=-1)


def _zero_behind(points: Array) -> Array:
    return np.concatenate([points, np.zeros_like(points[..., :1])], axis=-1)


EXERCISES = (
    Exercise(
        name="00.homogeneous",
        reference=homogeneous,
        cases=_cases,
        hints=(
            "You need an array of ones with the same shape as `points`, except for its last axis, which has length 1.",
            "`np.ones_like(points[..., :1])` has that shape; `np.concatenate([…, …], axis=-1)` joins the two.",
        ),
        praise="That is all there is to a checker: it tries fresh random points of several shapes each time.",
        misconceptions=(
            Misconception(_one_in_front, "The 1 comes *last*, after the coordinates, not in front of them."),
            Misconception(
                _zero_behind, "With a last coordinate of 0 this is a *direction*, a point at infinity. A point has 1."
            ),
        ),
    ),
)
