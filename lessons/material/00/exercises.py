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


@HOMOGENEOUS.wrong(
    "You append a 1 once, to all the numbers in a row. Every point gets a 1 of its own: join along the last axis, "
    "`axis=-1`."
)
def one_for_all(points):
    return np.append(points, 1.0)


@HOMOGENEOUS.wrong(
    "`np.hstack` joins along the second axis. That is the last one for a list of points, but not for one point or a "
    "grid of points: join along the last axis, `axis=-1`."
)
def stacked_along_the_second_axis(points):
    return np.hstack([points, np.ones_like(points[..., :1])])


@HOMOGENEOUS.wrong("You add one to each coordinate. The 1 is a coordinate of its own, behind the others.")
def one_added(points):
    return points + 1


@HOMOGENEOUS.wrong("You divide by the last coordinate. That is the way *back* from homogeneous coordinates.")
def divided(points):
    return points / points[..., -1:]


@HOMOGENEOUS.wrong("You put a 1 in place of the last coordinate. Nothing is to be lost: the 1 comes after it.")
def last_replaced(points):
    return np.concatenate([points[..., :-1], np.ones_like(points[..., :1])], axis=-1)


@HOMOGENEOUS.wrong("You append the last coordinate once more. The number to append is 1.")
def last_repeated(points):
    return np.concatenate([points, points[..., -1:]], axis=-1)


@HOMOGENEOUS.wrong(
    "You append as many ones as there are coordinates. One is enough: `points[..., :1]` has a last axis of length 1."
)
def ones_for_each_coordinate(points):
    return np.concatenate([points, np.ones_like(points)], axis=-1)


EXERCISES = (HOMOGENEOUS,)
