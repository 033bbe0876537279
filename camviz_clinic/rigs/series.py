"""What the frames of two cameras say one after the other: a camera that lags behind, and one that was moved."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from itertools import combinations
from pathlib import Path
from typing import TypeVar

import numpy as np

from camviz.cameras import Camera
from camviz.lenses.base import Array
from camviz.poses import RigidTransform, Rotation
from camviz_clinic.calibration.adjustment import Adjustment
from camviz_clinic.calibration.camera_models import MODELS
from camviz_clinic.calibration.detection import CannotCalibrate, Detections, seen
from camviz_clinic.calibration.pairing import last_number
from camviz_clinic.calibration.problem import moved
from camviz_clinic.calibration.solving import calibrate
from camviz_clinic.calibration.types import Board, Calibration, Mask
from camviz_clinic.rigs.graph import Indices, middlemost
from camviz_clinic.rigs.start import MOST_ALONE, board_poses, varied

FEWEST = 4  # frames on either side of a jump
MOST = 60  # frames of two cameras that are looked at, spread evenly
FEWEST_LATE = 8  # frames that agree on a delay
LATEST = 4  # frames
STEPS = 4  # of a delay, in one frame
FEWEST_CORNERS = 6  # of a view, to solve for a camera by it
BETTER = 3.0  # times smaller must the error be with the delay, or on either side of a jump
PLAIN = 3.0  # pixels: an error that is smaller needs no explanation of this kind

Found = TypeVar("Found", "Lag", "Jump")


@dataclass(frozen=True)
class Lag:
    """A camera's pictures lag behind those of the others.

    Args:
        frames: By how many frames; negative for pictures that are early.
        without, along: Pixels, the median error of its corners as they are and with the delay taken off.
    """

    frames: float
    without: float
    along: float


@dataclass(frozen=True)
class Jump:
    """A camera stands elsewhere from one frame on.

    Args:
        row: Of the first frame after it.
        across: Pixels, the median error of corners on the one side with the camera's place on the other.
        beside: Pixels, with the place on their own side.
    """

    row: int
    across: float
    beside: float


def by_themselves(calibration: Calibration) -> dict[str, Adjustment]:
    """Each camera's own solution, with the board's poses as it sees them alone, by all the corners that were found.

    What contradicts the other cameras has then no say in its lens.

    Args:
        calibration: With the corners of a board.

    Returns: By camera; ValueError without a board.
    """
    if calibration.board is None:
        raise ValueError("the calibration must hold the board that was seen; it does not")
    found = {}
    for name, corners in calibration.detections.items():
        camera = Camera(calibration.cameras[name].intrinsics, calibration.cameras[name].lens)
        estimated = tuple(calibration.estimated.get(name, ()))
        if estimated and (anew := _anew(calibration.board, camera, corners, estimated)) is not None:
            camera = anew
        found[name] = _posed(calibration.board, camera, corners)
    return found


def _anew(board: Board, camera: Camera, corners: Array, estimated: tuple[str, ...]) -> Camera | None:
    """The camera solved for from its own views (frames, corners, 2); None where these give none, or no model is known.

    The joint solution is no beginning for it: what contradicts the others may have bent its lens beyond return.
    """
    free, there = set(estimated), seen(corners)
    of_lens = {name: set(model.parameters) for name, model in MODELS.items()}
    fitting = [
        name
        for name, has in of_lens.items()
        if isinstance(camera.lens, MODELS[name].lens) and free <= has and not {"fx", "fy", "xi"} & (has - free)
    ]
    views = np.flatnonzero(there.sum(axis=1) >= FEWEST_CORNERS)
    if not fitting or not len(views):
        return None
    views = views[varied(corners[views], MOST_ALONE)]
    model = min(fitting, key=lambda name: len(of_lens[name]))
    names = tuple(str(view) for view in views)
    found = Detections(names, corners[views], camera.intrinsics.width, camera.intrinsics.height)
    try:
        return calibrate(found, board, model, fixed=tuple(of_lens[model] - free)).cameras["camera"]
    except CannotCalibrate:
        return None


def _posed(board: Board, camera: Camera, corners: Array) -> Adjustment:
    """A camera of known lens and the poses of the board that its corners (frames, corners, 2) give."""
    poses, known = board_poses(camera, board, corners)
    aside = np.repeat(~known[:, None], corners.shape[1], axis=1)
    start = Adjustment(board, {"camera": camera}, {"camera": corners}, poses, {"camera": ()}, {"camera": aside})
    return start.refined(only_poses=True, settled=1e-6)


def frame_numbers(pictures: Mapping[str, Sequence[str]], there: Mapping[str, Mask], rows: int) -> Indices:
    """The frames' numbers (rows,), by the last numbers in their pictures' names, else their places."""
    numbers = []
    for row in range(rows):
        named = [pictures[name][row] for name in pictures if row < len(pictures[name]) and there[name][row]]
        numbers.append(last_number(Path(named[0])) if named else "")
    if "" in numbers or len(set(numbers)) < rows:
        return np.arange(rows)
    counted = np.array([int(number) for number in numbers])
    return counted if (np.diff(counted) > 0).all() and counted[-1] < 2**31 else np.arange(rows)


def delays(alone: Mapping[str, Adjustment], numbers: Indices) -> dict[str, Lag]:
    """Cameras that lag behind the rest, by a delay that takes their contradictions away.

    Args:
        alone: Of `by_themselves`; all have the same frames.
        numbers: (frames,), the frames' numbers.

    Returns: By camera. Of two cameras alone it is the second one's delay against the first.
    """
    return _blamed(list(alone), lambda one, other: _delay(alone[one], alone[other], numbers), _late)


def jumps(alone: Mapping[str, Adjustment]) -> dict[str, Jump]:
    """Cameras that were moved against the rest, and when.

    Args:
        alone: Of `by_themselves`; all have the same frames.

    Returns: By camera. Of two cameras alone it may be either.
    """
    return _blamed(list(alone), lambda one, other: _jump(alone[one], alone[other]), _moved)


def _blamed(
    names: Sequence[str],
    look: Callable[[str, str], Found | None],
    said: Callable[[Sequence[tuple[Found, int]]], Found],
) -> dict[str, Found]:
    """By camera what pairs show: the camera with most pairs is to blame for these, and so on with those left."""
    shown = {pair: what for pair in combinations(names, 2) if (what := look(*pair)) is not None}
    blamed: dict[str, Found] = {}
    while shown:
        counts = {name: sum(name in pair for pair in shown) for name in names}
        culprit = max(reversed(names), key=lambda name: counts[name])
        theirs = [(what, 1 if pair[1] == culprit else -1) for pair, what in shown.items() if culprit in pair]
        blamed[culprit] = said(theirs)
        shown = {pair: what for pair, what in shown.items() if culprit not in pair}
    return blamed


def _late(found: Sequence[tuple[Lag, int]]) -> Lag:
    """The delay of one camera by those of its pairs, signed by its place in them."""
    return Lag(
        float(np.median([each.frames * sign for each, sign in found])),
        float(np.median([each.without for each, _ in found])),
        float(np.median([each.along for each, _ in found])),
    )


def _moved(found: Sequence[tuple[Jump, int]]) -> Jump:
    """The jump of one camera: when most of its pairs have it."""
    return sorted((each for each, _ in found), key=lambda each: each.row)[len(found) // 2]


def _delay(one: Adjustment, other: Adjustment, numbers: Indices) -> Lag | None:
    """By how many frames the other lags behind the one, where that explains their contradictions."""
    if not PLAIN < _error_late(one, other, numbers, 0) < np.inf:
        return None
    errors = {}
    for step in range(-LATEST * STEPS, LATEST * STEPS + 1):
        errors[step / STEPS] = _error_late(one, other, numbers, step / STEPS)
    without, best = errors[0.0], min(errors, key=lambda frames: (errors[frames], abs(frames)))
    if not (without > PLAIN and errors[best] * BETTER < without):
        return None
    return Lag(best, without, errors[best])


def _error_late(one: Adjustment, other: Adjustment, numbers: Indices, frames: float) -> float:
    """The median error in pixels of the one's corners where the other lags so many frames; infinite where too few."""
    row = {int(number): place for place, number in enumerate(numbers) if other.posed[place]}
    here, before, after = [], [], []
    for place in np.flatnonzero(one.posed):
        at = numbers[place] + frames
        below, above = int(np.floor(at)), int(np.ceil(at))
        if below in row and above in row:
            here.append(place)
            before.append(row[below])
            after.append(row[above])
    if len(here) < FEWEST_LATE:
        return np.inf
    chosen = _spread(len(here))
    share = frames - np.floor(frames)
    poses = _between(
        other.first_from_board[np.array(before)[chosen]], other.first_from_board[np.array(after)[chosen]], share
    )
    rows = np.array(here)[chosen]
    by_frame = one.first_from_board[rows] * poses.inv()
    middle = by_frame[middlemost(by_frame, poses.translation)]
    return float(np.median(_off(one, rows, middle * poses)))


def _jump(one: Adjustment, other: Adjustment) -> Jump | None:
    """From which frame on the two stand otherwise to each other, where they agree before and after."""
    both = np.flatnonzero(one.posed & other.posed)
    if len(both) < 2 * FEWEST:
        return None
    rows = both[_spread(len(both))]
    seen_by_other = other.first_from_board[rows]
    by_frame = one.first_from_board[rows] * seen_by_other.inv()
    middle = by_frame[middlemost(by_frame, seen_by_other.translation)]
    if (_off(one, rows, middle * seen_by_other) > PLAIN).sum() < FEWEST:
        return None
    errors = np.stack([_off(one, rows, step * seen_by_other) for step in by_frame])  # of frame j by the pose of frame i
    capped = np.minimum(errors, np.median(errors) + PLAIN)
    n = len(rows)
    split = min(range(FEWEST, n - FEWEST + 1), key=lambda m: _cost(capped, slice(m)) + _cost(capped, slice(m, n)))
    sides = slice(split), slice(split, n)
    best = [side.start or 0 for side in sides]
    best = [start + int(np.argmin(capped[side, side].sum(axis=1))) for start, side in zip(best, sides, strict=True)]
    beside = max(float(np.median(errors[best[i], sides[i]])) for i in (0, 1))
    across = min(float(np.median(errors[best[i], sides[1 - i]])) for i in (0, 1))
    if not (across > PLAIN and beside * BETTER < across):
        return None
    return Jump(int(rows[split]), across, beside)


def _cost(errors: Array, side: slice) -> float:
    return float(errors[side, side].sum(axis=1).min())


def _off(one: Adjustment, rows: Indices, poses: RigidTransform) -> Array:
    """RMS (n,) in pixels of a camera's corners in these frames against boards at these poses."""
    pixels = one.cameras["camera"].project(moved(poses, one.corners))
    squared = np.sum((pixels - one.detections["camera"][rows]) ** 2, axis=-1)
    there = np.isfinite(squared)
    mean = np.sum(np.where(there, squared, 0), axis=1) / np.maximum(there.sum(axis=1), 1)
    return np.where(there.any(axis=1), np.sqrt(mean), np.inf)


def _between(before: RigidTransform, after: RigidTransform, share: float) -> RigidTransform:
    """Poses on the straight way from the ones to the others."""
    if not share:
        return before
    turn = (after.rotation * before.rotation.inv()).as_rotvec()
    shift = after.translation - before.translation
    return RigidTransform.from_components(
        before.translation + share * shift, Rotation.from_rotvec(share * turn) * before.rotation
    )


def _spread(count: int) -> Indices:
    return np.unique(np.linspace(0, count - 1, min(count, MOST)).round().astype(int))
