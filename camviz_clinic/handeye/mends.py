"""Other ways in which a robot's poses may have been meant, each tried on the pictures' boards."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import linear_sum_assignment

from camviz.lenses.base import Array
from camviz.poses import RigidTransform
from camviz_clinic.calibration.motions import Motions, angles
from camviz_clinic.calibration.motions_solving import start
from camviz_clinic.handeye.adjusting import Adjusted, far_off, robust

MUCH_BETTER = 3.0  # times: what another reading must take off the poses' errors
ALIKE = 1.1  # times the least error: of readings so near to it the one that fits most poses is named
FEWEST_TRIED = 6  # poses: fewer can be fitted by a wrong reading
NEARER = 2.0  # times: by what the angles must agree better for an order or a form to be tried
RESCALED = 3  # rounds
MAX_SHIFT_ROWS = 5
SHIFT_TOLERANCE_DEG = 1.0  # of the angle between two poses: within it robot and pictures agree
MIN_SHIFT_GAIN = 2  # pictures that must agree beyond those that do without a shift
MAX_SHIFT_PICTURES = 150  # of more, some evenly
NEAR_UNIT = 1.1  # times
UNITS = {
    0.001: ("millimetres", "Read the lengths as millimetres: --unit mm."),
    1000.0: ("metres", "Read the lengths as metres: --unit m."),
    0.01: ("centimetres", "Multiply the lengths by 10 and read them with --unit mm."),
    100.0: ("metres", "Read the lengths as metres: --unit m."),
    0.0254: ("inches", "Multiply the lengths by 25.4 and read them with --unit mm."),
}
Indices = NDArray[np.intp]
Readings = Mapping[str, RigidTransform]


@dataclass(frozen=True, eq=False)
class Pairing:
    """Poses of the robot for the boards of some pictures, as one may have meant them.

    Attributes:
        id: The finding that this is, if it is right; empty for the poses as they were given.
        says: What would be the case, as the rest of a sentence.
        remedy: What to do then.
        base_from_hand, cam_from_board: As many of the one as of the other.
    """

    id: str
    says: str
    remedy: str
    base_from_hand: RigidTransform
    cam_from_board: RigidTransform


@dataclass(frozen=True, eq=False)
class Tried:
    """A pairing that was solved.

    Attributes:
        pairing: Which poses belong to which boards.
        unit: The factor of the robot's lengths where they are in another unit, or 1.
        adjusted: X and Z, in the lengths of the camera's board.
        factor: By what the robot's lengths were multiplied: the unit, or what fits best where the scale is not known.
    """

    pairing: Pairing
    unit: float
    adjusted: Adjusted
    factor: float

    @property
    def error(self) -> float:
        """The median over the poses of how far the board is off, in metres."""
        return float(np.median(self.adjusted.displacements))

    @property
    def strays(self) -> int:
        """How many poses are far from the others even so: a shift by three rows fits most of 1, 10, 11, 12, 2, 3 …"""
        return len(far_off(self.adjusted.displacements))

    @property
    def fits(self) -> int:
        """How many poses agree with the others."""
        return len(self.adjusted.displacements) - self.strays

    @property
    def as_given(self) -> bool:
        """Whether nothing is read otherwise."""
        return not self.pairing.id and self.unit == 1


def tried(pairing: Pairing, eye_to_hand: bool, unit: float | None = None) -> Tried:
    """A pairing solved, with its lengths in the unit that they seem to be in, or in this one."""
    motions = Motions.of(pairing.base_from_hand, pairing.cam_from_board, eye_to_hand)
    factor = start(motions, None)[2] if unit is None else unit
    unit = next((each for each in (*UNITS, 1.0) if max(each / factor, factor / each) < NEAR_UNIT), 1.0)
    X, Z, _ = start(motions.scaled(unit))
    return Tried(pairing, unit, robust(motions.scaled(unit), *map(RigidTransform.from_matrix, (X, Z))), unit)


def tried_at_any_scale(pairing: Pairing, eye_to_hand: bool) -> Tried:
    """A pairing solved with the robot's lengths multiplied by the factor that fits best."""
    motions = Motions.of(pairing.base_from_hand, pairing.cam_from_board, eye_to_hand)
    X, Z, factor = start(motions, None)
    here = robust(motions.scaled(factor), *map(RigidTransform.from_matrix, (X, Z)))
    for _ in range(RESCALED):
        factor *= float(np.clip(here.scale[0], 0.5, 2))
        here = robust(motions.scaled(factor), here.X, here.Z)
    return Tried(pairing, 1.0, here, factor)


def likely(
    rows: RigidTransform,
    seen: Indices,
    cam_from_board: RigidTransform,
    others: Readings,
    to_hand: bool,
    any_scale: bool = False,
    named: Callable[[int], str] = lambda row: f"pose {row + 1}",
) -> tuple[Tried, Tried]:
    """The poses as they were given, and the reading under which robot and pictures agree best.

    Args:
        rows: The robot's poses, row by row.
        seen: The rows whose pictures show the board.
        cam_from_board: The board in these pictures.
        others: The same rows in other forms, by what asks for them.
        to_hand: The camera stands still.
        any_scale: The board's lengths are not known, so that no unit is tried.
        named: A row in words.

    Returns:
        given: The poses as they were given, in the given unit.
        best: Under another reading if it takes off two thirds of the error or more, or is a shift of rows with which
            more pictures agree; otherwise the same.
    """
    plain = Pairing("", "", "", rows[seen], cam_from_board)
    given = tried_at_any_scale(plain, to_hand) if any_scale else tried(plain, to_hand, 1.0)
    if len(seen) < FEWEST_TRIED:
        return given, given
    solved = tried_at_any_scale if any_scale else tried
    pairings = _pairings(rows, seen, cam_from_board, others, to_hand, named)
    readings = [solved(each, to_hand) for each in (plain, *pairings)]
    least = min(each.error for each in readings)
    alike = [each for each in readings if each.error <= ALIKE * least]
    best = min(alike, key=lambda each: each.strays)  # the first of equals, which is the simplest
    if much_better(best.error, given.error):
        return given, best
    return given, next((each for each in readings if _shift_fits_more(each, given)), given)


def _shift_fits_more(shifted: Tried, given: Tried) -> bool:
    """Whether a shift from some row on brings poses to agree that otherwise stray."""
    alike = shifted.error <= MUCH_BETTER * given.error
    return shifted.pairing.id == "poses-shifted" and alike and shifted.fits >= given.fits + MIN_SHIFT_GAIN


def much_better(error: float, given: float) -> bool:
    """Whether an error is so much smaller than the given one that it is no accident.

    >>> much_better(1.0, 3.0), much_better(1.0, 2.99)
    (True, False)
    """
    return given >= MUCH_BETTER * error


def _pairings(
    rows: RigidTransform,
    seen: Indices,
    boards: RigidTransform,
    others: Readings,
    to_hand: bool,
    named: Callable[[int], str],
) -> Iterator[Pairing]:
    """The readings that the angles of the motions do not rule out."""
    yield inverted(Pairing("", "", "", rows[seen], boards), to_hand)
    for other in _shifted(rows, seen, boards, named):
        yield other
        yield inverted(other, to_hand)
    given = Motions(rows[seen], boards).angle_mismatch
    ordered = _reordered(rows, seen, boards)
    for other, bound in (*((each, given / NEARER) for each in ordered), *_misread_bounded(others, seen, boards, given)):
        if Motions(other.base_from_hand, other.cam_from_board).angle_mismatch < bound:
            yield other
            yield inverted(other, to_hand)


def _misread_bounded(
    others: Readings, seen: Indices, boards: RigidTransform, given: float
) -> Iterator[tuple[Pairing, float]]:
    """Other forms, with the mismatch of angles that they must stay below.

    The angle between two quaternions is that of their four numbers in any order: a wrong order does not show in it, and
    they need only be no worse.
    """
    for other in _misread(others, seen, boards):
        yield other, ALIKE * given


def inverted(pairing: Pairing, to_hand: bool) -> Pairing:
    """The same with every pose inverted, which is also the other arrangement of camera and board."""
    other = "--eye-to-hand left out" if to_hand else "--eye-to-hand"
    where = "on the hand" if to_hand else "beside the robot"
    says = f"the poses are inverted (hand_from_base), or the camera is {where}"
    remedy = f"Give base_from_hand, with --invert; or, if the camera is {where}, run again with {other}."
    if pairing.id:
        says, remedy = f"{pairing.says}; and {says}", f"{pairing.remedy} {remedy}"
    id, poses = pairing.id or "poses-inverted", pairing.base_from_hand.inv()
    return replace(pairing, id=id, says=says, remedy=remedy, base_from_hand=poses)


def _shifted(
    rows: RigidTransform, seen: Indices, boards: RigidTransform, named: Callable[[int], str]
) -> Iterator[Pairing]:
    shifts = row_shifts(rows, seen, boards)
    if shifts is None:
        return
    kept = (seen + shifts >= 0) & (seen + shifts < len(rows))
    if kept.sum() < FEWEST_TRIED:
        return
    says, remedy = shift_words(shifts, seen, named)
    yield Pairing("poses-shifted", says, remedy, rows[(seen + shifts)[kept]], boards[kept])


def row_shifts(rows: RigidTransform, places: Indices, boards: RigidTransform) -> Indices | None:
    """By how many rows the pose of each picture lies beyond its place, where that makes more pictures agree.

    The angle between two poses of the hand is that between the boards of their pictures (`Motions.angle_mismatch`).
    First those shifts are sought with which most pictures agree with one of them, tried for each as that one. Then
    those are sought with which most pictures agree with more than half of these.

    Args:
        rows: The robot's poses.
        places: (pictures,), the row of each picture as given; it may lie beyond the last one.
        boards: The board in each picture.

    Returns: (pictures,), or None where not at least two pictures more agree than without shifts.
    """
    if len(places) > MAX_SHIFT_PICTURES:
        stride = -(-len(places) // MAX_SHIFT_PICTURES)
        some = row_shifts(rows, places[::stride], boards[::stride])
        return None if some is None else np.repeat(some, stride)[: len(places)]
    robot, camera = (angles(np.asarray(each.as_matrix())) for each in (rows, boards))
    steps = np.arange(-MAX_SHIFT_ROWS, MAX_SHIFT_ROWS + 1)
    at = places[:, None] + steps
    inside = (at >= 0) & (at < len(rows))
    at = np.clip(at, 0, len(rows) - 1)
    off = np.abs(robot[at[:, :, None, None], at] - camera[:, None, :, None])
    # agree[i, a, j, b]: picture i shifted by a with picture j shifted by b
    agree = (off < np.radians(SHIFT_TOLERANCE_DEG)) & inside[:, :, None, None] & inside
    none = np.full(len(places), MAX_SHIFT_ROWS)
    shifted = _steadiest(_supported(agree, _steadiest(agree)))
    supported = _supported(agree, shifted)
    gain = _count(supported, shifted) - _count(supported, none)
    return np.asarray(steps[shifted]) if gain >= MIN_SHIFT_GAIN else None


def _count(supported: Array, path: Indices) -> int:
    return int(supported[np.arange(len(path)), path].sum())


def _supported(agree: Array, path: Indices) -> Array:
    """Whether pictures under shifts (pictures, shifts) agree with more than half of those that agree on this path."""
    own = np.arange(len(path))
    mutual = agree[own[:, None], path[:, None], own, path]
    members = mutual[mutual.sum(axis=1).argmax()]
    others = members[:, None] & (own[:, None] != own)
    return 2 * (others[..., None] & agree[own, path]).sum(axis=0) > others.sum(axis=0)[:, None]


def _steadiest(agree: Array) -> Indices:
    """The path (pictures,) of shifts of most agreements (..., pictures, shifts), less one for each change.

    By dynamic programming (A. Viterbi, IEEE Transactions on Information Theory 13, 1967). Of several problems the path
    of the best is returned.
    """
    steps = np.arange(agree.shape[-1])
    total, before = agree[..., 0, :].astype(float), []
    for j in range(1, agree.shape[-2]):
        best = total.argmax(axis=-1)[..., None]
        worth = np.take_along_axis(total, best, axis=-1) - 1
        before.append(np.where(total >= worth, steps, best))
        total = np.maximum(total, worth) + agree[..., j, :]
    *which, last = np.unravel_index(total.argmax(), total.shape)
    path = [int(last)]
    for step in reversed(before):
        path.append(int(step[(*which, path[-1])]))
    return np.array(path[::-1])


def shift_words(shifts: Indices, places: Indices, named: Callable[[int], str]) -> tuple[str, str]:
    """What is the case with shifts (pictures,) of rows, as the rest of a sentence; and what to do."""
    starts = [0, *(np.flatnonzero(np.diff(shifts)) + 1)]
    parts = []
    for begin in starts:
        by = abs(int(shifts[begin]))
        way = "down" if shifts[begin] > 0 else "up"
        pose = f"the pose {by} row{'s' * (by > 1)} further {way}" if by else "the pose of its own row"
        if begin:
            parts.append(f"from {named(int(places[begin]))} on each picture belongs to {pose}")
        elif by:
            parts.append(f"each picture belongs to {pose}")
    changes = np.diff(shifts, prepend=0)[starts]
    place = int(np.flatnonzero(changes)[0])
    where = f"before {named(int(places[starts[place]]))}" if starts[place] else "at the start"
    what = "missing picture or surplus row" if changes[place] > 0 else "missing row or surplus picture"
    return ", and ".join(parts), f"Look for a {what} {where}, and pair pictures and poses anew."


def _reordered(rows: RigidTransform, seen: Indices, boards: RigidTransform) -> Iterator[Pairing]:
    """The order in which the angles agree best: a pose's angles to all others, sorted, do not depend on any order."""
    robot, camera = (np.sort(angles(np.asarray(each.as_matrix())), axis=1) for each in (rows[seen], boards))
    _, order = linear_sum_assignment(np.abs(camera[:, None] - robot[None]).sum(axis=-1))
    for _ in range(3):  # by the angles between the pairs, now that most are known
        robot = angles(np.asarray(rows[seen].as_matrix()))[:, order]
        camera = angles(np.asarray(boards.as_matrix()))
        _, again = linear_sum_assignment(np.median(np.abs(camera[:, None] - robot[None]), axis=-1))
        order = again
    if (order == np.arange(len(seen))).all():
        return
    yield Pairing(
        "poses-reordered",
        f"the poses are in another order than the pictures, {_order(order, seen)}",
        "Name the pictures in a column `picture` of the table, or give both in the same order.",
        rows[seen[order]],
        boards,
    )


def _order(order: Indices, seen: Indices) -> str:
    """An order in words."""
    if (order == np.arange(len(order))[::-1]).all():
        return "reversed"
    named = sorted(range(len(order)), key=lambda i: str(i + 1))
    if order.tolist() == named or order.tolist() == np.argsort(named).tolist():
        return "sorted as words (1, 10, 11, 2) the one and as numbers the other"
    moved = np.flatnonzero(order != np.arange(len(order)))
    wrong = [f"picture {seen[i] + 1} belongs to pose {seen[order[i]] + 1}" for i in moved]
    return ", ".join(wrong[:4]) + f" and {len(wrong) - 4} more" * (len(wrong) > 4)


def _misread(others: Readings, seen: Indices, boards: RigidTransform) -> Iterator[Pairing]:
    for asked, poses in others.items():
        option = asked.startswith("--")
        yield Pairing(
            "poses-misread",
            f"the rotations are in another form: {asked}",
            f"Read them with {asked}." if option else f"Give the table with {asked}.",
            poses[seen],
            boards,
        )


def exchanged(adjusted: Adjusted, stray: Indices) -> Indices | None:
    """Which poses stray ones belong to, where they belong to each other's pictures; None where they do not."""
    if len(stray) < 2:
        return None
    motions = adjusted.motions
    A, boards = motions.other_from_mount, motions.cam_from_board[stray]
    costs = np.stack([_displacements(adjusted, A[int(i)], boards) for i in stray], axis=1)
    _, order = linear_sum_assignment(costs)
    healthy = np.setdiff1d(np.arange(len(motions)), stray)
    fits = costs[np.arange(len(stray)), order]
    limit = MUCH_BETTER * float(np.median(adjusted.displacements[healthy]))
    return stray[order] if (fits < limit).all() else None


def _displacements(adjusted: Adjusted, other_from_mount: RigidTransform, boards: RigidTransform) -> Array:
    off = adjusted.X.inv() * other_from_mount.inv() * adjusted.Z
    apart = off.inv() * boards
    shifts = np.linalg.norm(apart.translation, axis=-1)
    return np.hypot(shifts, adjusted.motions.lever * apart.rotation.magnitude())
