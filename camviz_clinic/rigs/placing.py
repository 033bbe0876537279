"""Where cameras and boards stand to each other, from what each camera saw of each board in each frame.

Two cameras are tied by a board that both see in one frame, and two boards by a camera that sees both in one frame. What
is tied counts as one from then on, and ties more: the tie by most corners comes first, as in a maximum spanning tree
(Kruskal 1956). Two groups of cameras of which each sees a board of its own are tied by how these turn together: the
equation A Y = X B of a hand and an eye (Park & Martin 1994), A and B being the boards' poses before either group.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np

from camviz.lenses.base import Array
from camviz.poses import RigidTransform
from camviz_clinic.calibration.detection import CannotCalibrate
from camviz_clinic.calibration.enumeration import enumerated
from camviz_clinic.calibration.motions import Motions
from camviz_clinic.calibration.motions_solving import start
from camviz_clinic.calibration.types import Mask
from camviz_clinic.rigs.graph import middlemost, parted

FEWEST_MOTIONS = 6  # frames
ONE_AXIS_DEG = 3.0  # RMS of the turns about the second axis: with less, a place along the first is unknown


@dataclass(frozen=True, eq=False)
class Sighting:
    """One camera's sight of a board: cam_from_board (frames, 4, 4), NaN where there is none, and corners (frames,)."""

    poses: Array
    corners: Array


@dataclass(frozen=True, eq=False)
class Placed:
    """All cameras and boards in place.

    Args:
        first_from_cam: By camera.
        reference_from_board: By board, in the frame of the first board that it is fixed to.
    """

    first_from_cam: Mapping[str, RigidTransform]
    reference_from_board: Mapping[str, RigidTransform]


@dataclass(eq=False)
class _Groups:
    """What is tied so far: for each group of cameras and of boards, the poses of the one before the other.

    `cameras` and `boards` give the members of each group, by the name of its first one, in the frame of that one.
    """

    sightings: dict[tuple[str, str], Sighting]
    cameras: dict[str, dict[str, Array]]
    boards: dict[str, dict[str, Array]]
    fixed: Mapping[str, int]  # by board: those of one number keep their places to each other
    points: Mapping[str, Array] = field(repr=False)

    def tie_cameras(self, one: str, other: str, one_from_other: Array) -> None:
        """The other group's cameras go over to the one's."""
        for name, pose in self.cameras.pop(other).items():
            self.cameras[one][name] = one_from_other @ pose
        for board in self.boards:
            there = self.sightings.pop((other, board))
            self._better(one, board, Sighting(one_from_other @ there.poses, there.corners))

    def tie_boards(self, one: str, other: str, one_from_other: Array) -> None:
        """The other group's boards go over to the one's."""
        for name, pose in self.boards.pop(other).items():
            self.boards[one][name] = one_from_other @ pose
        for camera in self.cameras:
            there = self.sightings.pop((camera, other))
            self._better(camera, one, Sighting(there.poses @ inverted(one_from_other), there.corners))

    def _better(self, camera: str, board: str, other: Sighting) -> None:
        """Frame by frame, the pose that more corners tell."""
        here = self.sightings[camera, board]
        take = other.corners > here.corners
        self.sightings[camera, board] = Sighting(
            np.where(take[:, None, None], other.poses, here.poses), np.maximum(here.corners, other.corners)
        )

    def shared_by_cameras(self, one: str, other: str) -> list[tuple[Sighting, Sighting]]:
        """What either saw of each group of boards."""
        return [(self.sightings[one, board], self.sightings[other, board]) for board in self.boards]

    def shared_by_boards(self, one: str, other: str) -> list[tuple[Sighting, Sighting]]:
        """How each group of cameras saw either."""
        return [(self.sightings[camera, one], self.sightings[camera, other]) for camera in self.cameras]


def placed(
    sightings: Mapping[tuple[str, str], Sighting],
    points: Mapping[str, Array],
    fixed: Mapping[str, int],
    known: Mapping[str, RigidTransform],
) -> Placed:
    """The cameras in the first one's frame, and the boards in the frame of the first that each is fixed to.

    Args:
        sightings: By camera and board, of every camera with every board.
        points: By board, its corners (corners, 3).
        fixed: By board, a number: boards of one number keep their places to each other.
        known: By board, reference_from_board of those whose place to the first of their number is known.

    Returns: Placed.
    Raises: CannotCalibrate where the frames do not tie all cameras, or all boards of one number.
    """
    cameras, boards = (list(dict.fromkeys(names)) for names in zip(*sightings, strict=True))
    groups = _Groups(
        dict(sightings),
        {name: {name: np.eye(4)} for name in cameras},
        {name: {name: np.eye(4)} for name in boards},
        fixed,
        points,
    )
    for board, pose in known.items():
        groups.tie_boards(next(each for each in boards if fixed[each] == fixed[board]), board, pose.as_matrix())
    while _tie_best(groups) or _tie_by_motion(groups):
        pass
    _refuse_parted(groups, cameras, boards)
    first = cameras[0]
    return Placed(
        {name: RigidTransform.from_matrix(groups.cameras[first][name]) for name in cameras},
        {name: RigidTransform.from_matrix(pose) for group in groups.boards.values() for name, pose in group.items()},
    )


def _tie_best(groups: _Groups) -> bool:
    """Ties the two groups of cameras or of boards that most corners tie; whether there are such."""
    cameras = [(_together(groups.shared_by_cameras(*pair)), *pair) for pair in _pairs(groups.cameras)]
    boards = [(_together(groups.shared_by_boards(*pair)), *pair) for pair in _pairs(groups.boards, groups.fixed)]
    most, one, other = max(cameras + boards, default=(0, "", ""))
    if not most:
        return False
    if (most, one, other) in cameras:
        shared = groups.shared_by_cameras(one, other)
        ties = np.concatenate([(a.poses @ inverted(b.poses))[_both(a, b)] for a, b in shared])
        where = np.concatenate([b.poses[_both(a, b), :3, 3] for a, b in shared])
        groups.tie_cameras(one, other, _middle(ties, where))
    else:
        ties = np.concatenate(
            [(inverted(a.poses) @ b.poses)[_both(a, b)] for a, b in groups.shared_by_boards(one, other)]
        )
        groups.tie_boards(one, other, _middle(ties, groups.points[other]))
    return True


def _together(shared: Sequence[tuple[Sighting, Sighting]]) -> int:
    """How many corners tell how two stand to each other: in each frame those of the one that shows fewer."""
    return sum(int(np.minimum(a.corners, b.corners).sum()) for a, b in shared)


def _both(one: Sighting, other: Sighting) -> Mask:
    return np.asarray((one.corners > 0) & (other.corners > 0))


def _middle(poses: Array, points: Array) -> Array:
    """Of poses (n, 4, 4), the one that most others agree with about where it puts points (m, 3)."""
    return np.asarray(poses[middlemost(RigidTransform.from_matrix(poses), points)])


def _tie_by_motion(groups: _Groups) -> bool:
    """Ties two groups of cameras of which each sees a board of its own, by how these turn together; whether it did."""
    found = []
    for one, other in _pairs(groups.cameras):
        for here, there in [way for pair in _pairs(groups.boards, groups.fixed) for way in (pair, pair[::-1])]:
            a, b = groups.sightings[one, here], groups.sightings[other, there]
            both = np.flatnonzero(_both(a, b))
            if len(both) < FEWEST_MOTIONS:
                continue
            motions = Motions(
                RigidTransform.from_matrix(inverted(a.poses[both])), RigidTransform.from_matrix(b.poses[both])
            )
            if motions.turning.deg[1] > ONE_AXIS_DEG:
                found.append((len(both), one, other, motions))
    if not found:
        return False
    _, one, other, motions = max(found, key=lambda each: each[0])
    groups.tie_cameras(one, other, start(motions)[0])
    return True


def _refuse_parted(groups: _Groups, cameras: Sequence[str], boards: Sequence[str]) -> None:
    """CannotCalibrate where cameras, or boards that are fixed to each other, are left in several groups."""
    apart = [tuple(name for name in cameras if name in group) for group in groups.cameras.values()]
    if len(apart) > 1:
        raise CannotCalibrate(parted(apart, cameras))
    for one, other in _pairs(groups.boards, groups.fixed):
        here, there = (enumerated([name for name in boards if name in groups.boards[each]]) for each in (one, other))
        raise CannotCalibrate(
            f"nothing ties {there} to {here}: show a board of either in one frame, to cameras of the rig"
        )


def _pairs(groups: Mapping[str, object], fixed: Mapping[str, int] | None = None) -> list[tuple[str, str]]:
    names = list(groups)
    return [
        (one, other)
        for i, one in enumerate(names)
        for other in names[i + 1 :]
        if fixed is None or fixed[one] == fixed[other]
    ]


def inverted(poses: Array) -> Array:
    """Of rigid motions (..., 4, 4); NaN stays NaN."""
    found = np.zeros_like(poses)
    found[..., :3, :3] = np.swapaxes(poses[..., :3, :3], -1, -2)
    found[..., :3, 3] = -np.einsum("...ji,...j->...i", poses[..., :3, :3], poses[..., :3, 3])
    found[..., 3, 3] = 1
    return found
