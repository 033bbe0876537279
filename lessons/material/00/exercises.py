"""Lesson 00, start here: one small exercise, to meet the checker."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from camviz_school.course.checks import SHAPES, Arguments, Array, Exercise


def homogeneous(points: Array) -> Array:
    """Points (..., n) with a last coordinate 1 appended."""
    return np.concatenate([points, np.ones_like(points[..., :1])], axis=-1)


def _cases(rng: np.random.Generator) -> Iterator[Arguments]:
    for shape in SHAPES:
        for n in (1, 2, 3, int(rng.integers(4, 9))):
            yield (rng.normal(size=(*shape, n)),)


HOMOGENEOUS = Exercise(
    name="00.homogeneous",
    reference=homogeneous,
    cases=_cases,
    hints=(
        "The new coordinate is one more entry on the *last* axis, for every point. Which shape must the ones have?",
        "`np.ones_like` copies a shape; `points[..., :1]` has the right one. `np.concatenate` joins arrays.",
        "`return np.concatenate([points, ___], axis=-1)`",
    ),
    praise="That is all there is to a checker: it tries fresh random points of several shapes each time.",
)


@HOMOGENEOUS.right
def padded(points):
    return np.pad(points, [(0, 0)] * (points.ndim - 1) + [(0, 1)], constant_values=1.0)


@HOMOGENEOUS.right
def filled_in(points):
    result = np.ones((*points.shape[:-1], points.shape[-1] + 1))
    result[..., :-1] = points
    return result


@HOMOGENEOUS.wrong("The 1 comes *last*, after the coordinates, not in front of them.")
def one_in_front(points):
    return np.concatenate([np.ones_like(points[..., :1]), points], axis=-1)


@HOMOGENEOUS.wrong("With a last coordinate of 0 this is a *direction*, a point at infinity. A point has 1.")
def zero_behind(points):
    return np.concatenate([points, np.zeros_like(points[..., :1])], axis=-1)


@HOMOGENEOUS.wrong("You append one 1 to all numbers. Every point gets its own: join along the last axis, `axis=-1`.")
def one_for_all(points):
    return np.append(points, 1.0)


@HOMOGENEOUS.wrong("`np.hstack` joins along the second axis. That is the last one only for a list of points.")
def stacked_along_the_second_axis(points):
    return np.hstack([points, np.ones_like(points[..., :1])])


EXERCISES = (HOMOGENEOUS,)
