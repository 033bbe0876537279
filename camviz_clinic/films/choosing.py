"""Which views of a board say most about cameras: chosen one after the other by what each adds to the covariance."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from camviz.cameras import Camera
from camviz.lenses.base import Array
from camviz.poses import RigidTransform
from camviz_clinic.calibration.adjustment import Adjustment
from camviz_clinic.calibration.arrowhead import inverse
from camviz_clinic.calibration.detection import Detections
from camviz_clinic.calibration.solving import calibrate
from camviz_clinic.calibration.types import Board
from camviz_clinic.rigs import calibrate_boards, calibrate_rig, rig_of
from camviz_clinic.rigs.start import MOST_ALONE, board_poses, varied

Indices = NDArray[np.intp]

ROUGH = 1e-6  # of the sum of squares, what a step of a pose must still promise
FAINT = 1e-3  # of what all views say together: what is taken as known before the first one is chosen


def most_telling(
    found: Mapping[str, Detections],
    board: Board,
    model: str | Mapping[str, str],
    count: int,
    *,
    held: Mapping[str, Camera] | None = None,
    fixed: Sequence[str] = (),
) -> tuple[int, ...]:
    """The places (`Detections.places`) of the moments by which the cameras are known best.

    The cameras are solved for by all of them. Then the moment is chosen that lessens the variances of their
    parameters most, again and again; each variance counts by its ratio to what all moments give. A moment whose corners
    are less exact than most counts for less; one that is more exact does not count for more, for that may be luck, and
    a choice by luck makes a ± too small.

    Args:
        found: By camera, one or several.
        board: What was seen.
        model: Of all cameras, or by camera.
        count: How many may be chosen.
        held, fixed: As of `calibrate_rig`.

    Returns: In their order; all there are, where they are not more than `count`.
    Raises: CannotCalibrate where these views do not give the cameras.
    """
    places = sorted({place for each in found.values() for place in each.places})
    if len(places) <= count:
        return tuple(places)
    problem = _solved(found, board, model, held, fixed)
    views = np.flatnonzero(problem.posed)
    chosen = greedy(problem.by_view.information, _noise(problem)[views], count, sum(problem.by_priors[:1]))
    return tuple(sorted(places[view] for view in views[chosen]))


def most_telling_of_boards(
    found: Mapping[str, Mapping[str, Detections]],
    boards: Mapping[str, Board],
    model: str | Mapping[str, str],
    count: int,
    *,
    apart: Sequence[Sequence[str]] = (),
    known: Mapping[str, RigidTransform] | None = None,
    held: Mapping[str, Camera] | None = None,
    fixed: Sequence[str] = (),
) -> tuple[int, ...]:
    """As `most_telling`, of several boards: by which moments the cameras and the boards' places are known best.

    Args:
        found: By camera and board.
        boards, model, apart, known, held, fixed: As of `calibrate_boards`.
        count: How many may be chosen.

    Returns: In their order; all there are, where they are not more than `count`.
    Raises: CannotCalibrate where these views do not give the cameras.
    """
    places = sorted({place for each in found.values() for one in each.values() for place in one.places})
    if len(places) <= count:
        return tuple(places)
    solved = calibrate_boards(found, boards, model, apart=apart, known=known, held=held, fixed=fixed, robust=False)
    problem = solved.adjustment
    frames, of_view = np.unique(solved.frames[problem.posed], return_inverse=True)
    information = np.zeros((len(frames), *problem.by_view.information.shape[1:]))
    np.add.at(information, of_view, problem.by_view.information)
    noise = np.zeros(len(frames))
    np.maximum.at(noise, of_view, _noise(problem)[problem.posed])
    chosen = greedy(information, noise, count, sum(problem.by_priors[:1]))
    return tuple(sorted(places[frame] for frame in frames[chosen]))


def greedy(information: Array, noise: Array, count: int, assumed: Array | float = 0.0) -> Indices:
    """The views chosen one after the other so that the mean variance of a least-squares solution is least.

    With H = Σ Hᵢ and G = Σ σᵢ² Hᵢ over the chosen, the covariance of an unweighted solution is H⁻¹ G H⁻¹. Each
    variance counts by its ratio to that of all views. (A-optimal design, e.g. Pukelsheim 2006, *Optimal Design of
    Experiments*, chapter 6, greedily.)

    Args:
        information: (views, s, s), Hᵢ, what each view says of s parameters.
        noise: (views,), σᵢ² of its measurements.
        count: How many to choose.
        assumed: (s, s), what is known beforehand.

    Returns: (count,), in the order in which they were chosen.

    >>> once, twice = np.diag([1.0, 0.1]), np.diag([0.1, 1.0])  # two views that say the same, and one that does not
    >>> greedy(np.array([once, once, twice]), np.ones(3), 2).tolist()
    [0, 2]
    """
    noisy = noise[:, None, None] * information
    whole = information.sum(axis=0) + assumed
    least = _variances(inverse(whole), noisy.sum(axis=0))
    told, scatter = FAINT * whole + assumed, FAINT * noisy.sum(axis=0)
    left, chosen = list(range(len(information))), []
    for _ in range(min(count, len(left))):
        variances = _variances(inverse(told + information[left]), scatter + noisy[left])
        best = left[int(np.argmin((variances / np.maximum(least, 1e-300)).mean(axis=1)))]
        told, scatter = told + information[best], scatter + noisy[best]
        left.remove(best)
        chosen.append(best)
    return np.array(chosen, dtype=np.intp)


def _variances(inverses: Array, scatter: Array) -> Array:
    """The diagonals (..., s) of H⁻¹ G H⁻¹."""
    return np.asarray(np.sum((inverses @ scatter) * inverses, axis=-1))


def _solved(
    found: Mapping[str, Detections],
    board: Board,
    model: str | Mapping[str, str],
    held: Mapping[str, Camera] | None,
    fixed: Sequence[str],
) -> Adjustment:
    """A solution with every view in it, in the order of their places."""
    if len(found) > 1:
        return rig_of(calibrate_rig(found, board, model, held=held, fixed=fixed))
    ((name, seen_by),) = found.items()
    some = seen_by.only(varied(seen_by.corners, MOST_ALONE))
    solved = Adjustment.of(calibrate(some, board, model if isinstance(model, str) else model[name], fixed=fixed))
    ((name, camera),) = solved.cameras.items()
    poses, known = board_poses(camera, board, seen_by.corners)
    aside = np.repeat(~known[:, None], seen_by.corners.shape[1], axis=1)
    whole = replace(solved, detections={name: seen_by.corners}, first_from_board=poses, set_aside={name: aside})
    return whole.refined(only_poses=True, settled=ROUGH)


def _noise(problem: Adjustment) -> Array:
    """σ² (views,) of the corners of each view, at least that of most."""
    squares, counts = np.zeros(problem.views), np.zeros(problem.views)
    for name, mask in problem.used.items():
        squares += np.where(mask[..., None], problem.residuals[name] ** 2, 0).sum(axis=(1, 2))
        counts += 2 * mask.sum(axis=1)
    mean = squares / np.maximum(counts, 1)
    return np.maximum(mean, np.median(mean[counts > 0]))
