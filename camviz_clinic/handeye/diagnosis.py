"""What is wrong with a robot's poses, by the pictures that belong to them: long because a finding rules out others."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field
from functools import cached_property

import numpy as np

from camviz.cameras import Camera
from camviz.lenses.base import Array
from camviz.poses import RigidTransform
from camviz_clinic.calibration.motions import FEWEST, PoseError, Turning, angles
from camviz_clinic.calibration.problem import LEAST_CORNERS
from camviz_clinic.calibration.types import Board
from camviz_clinic.checks.registry import SEVERITIES, Finding
from camviz_clinic.checks.rig import lone_poses
from camviz_clinic.handeye import mends
from camviz_clinic.handeye.delay import Delay, delay
from camviz_clinic.handeye.mends import FEWEST_TRIED, UNITS, Indices, Tried, exchanged
from camviz_clinic.handeye.pose_table import RobotPoses
from camviz_clinic.handeye.solving import MOST_STRAY, UNKNOWN_DEG, HandEye, hand_eye_from_corners

LITTLE_DEG = 10.0  # turned less about every second axis, X's translation is known badly
SURE = 4.0  # σ: what a scale must be away from 1
OFF = 0.005  # and how far
DISAGREE = 0.01  # of the distance to the board: robots and pictures are nearer than that
SAME_POSE_MM, SAME_POSE_DEG = 0.1, 0.01  # robots at rest scatter less from reading to reading
MIN_BOARD_MOTION = 0.05  # of the distance to the board: pictures of a board that did not move are nearer
BOARD_MOVED = "the board moved, with its turns counted at its distance, by up to"
STILL_BOARD_DEG = 3.0  # RMS: boards of pictures that did not turn are turned less by their noise
MENDS = ("wrong-unit", "poses-inverted", "poses-shifted", "poses-reordered", "poses-misread")
KINDS = (
    "poses-repeated",
    *MENDS,
    "time-offset",
    "one-axis",
    "little-turning",
    "stray-pose",
    "scale-differs",
    "robot-disagrees",
)
CAUSES = {
    "poses-repeated": ("a pose that was read once and written again", "a controller that was read before it moved"),
    "wrong-unit": ("lengths in another unit than they were read in",),
    "poses-inverted": ("poses of the base in the hand's frame", "the other arrangement of camera and board"),
    "poses-shifted": ("a picture or a row that is missing",),
    "poses-reordered": ("pictures sorted otherwise than the poses",),
    "poses-misread": ("another convention of rotations than was assumed",),
    "time-offset": ("clocks of robot and camera that differ", "a robot that moved while pictures were taken"),
    "one-axis": ("a robot that turned its hand about one axis only",),
    "little-turning": ("a robot that hardly turned its hand",),
    "stray-pose": ("a robot that had not come to rest", "a slip in recording that pose"),
    "scale-differs": ("a board whose squares are not as long as told", "a focal length that is off"),
    "robot-disagrees": ("a board or a camera that slipped on its mount", "a wrong tool frame", "an inexact robot"),
}


@dataclass(frozen=True, eq=False)
class PosedPictures:
    """A robot's poses, row by row, and the board's corners in the picture of each row.

    Args:
        poses: As read.
        pixels: (rows, corners, 2), pixels; NaN where a corner is not seen, all NaN where the board is not.
        camera: The calibrated camera.
        board: What the pictures show.
        eye_to_hand: The camera stands still and the board is on the hand.
        pictures: A name for each row.
        any_scale: The lengths of the board are not known: by what they must be multiplied is solved for.

    Raises: PoseError where there are not as many rows as pictures, and for fewer than three with four corners or more.

    >>> import numpy as np
    >>> from camviz_clinic.handeye.virtual import cell, scaled
    >>> true = scaled(cell(np.random.default_rng(3)), 1000)  # a robot that tells millimetres, which were read as metres
    >>> case = PosedPictures(RobotPoses(true.base_from_hand), true.pixels, true.camera, true.board)
    >>> [finding.id for finding in case.findings]
    ['wrong-unit']
    """

    poses: RobotPoses
    pixels: Array = field(repr=False)
    camera: Camera
    board: Board
    eye_to_hand: bool = False
    pictures: tuple[str, ...] = ()
    any_scale: bool = False

    def __post_init__(self) -> None:
        if len(self.pixels) != len(self.poses.base_from_hand):
            raise PoseError(
                f"there must be as many poses as pictures, got {len(self.poses.base_from_hand)} and {len(self.pixels)}"
            )
        if len(self.seen) < FEWEST:
            raise PoseError(f"at least {FEWEST} poses with a picture of the board are needed, got {len(self.seen)}")

    @cached_property
    def seen(self) -> Indices:
        """The rows whose pictures show the board.

        Returns: (n,), indices of rows.
        """
        return np.flatnonzero(np.isfinite(self.pixels).all(axis=-1).sum(axis=1) >= LEAST_CORNERS)

    @cached_property
    def cam_from_board(self) -> RigidTransform:
        """The board in each of these pictures."""
        return lone_poses(self.camera, self.board, self.pixels[self.seen])

    @cached_property
    def readings(self) -> tuple[Tried, Tried]:
        """The poses as given, and the reading under which robot and pictures agree best."""
        rows, others = self.poses.base_from_hand, self.poses.others
        boards = self.cam_from_board
        return mends.likely(rows, self.seen, boards, others, self.eye_to_hand, self.any_scale, self.named)

    @cached_property
    def delay(self) -> Delay | None:
        """The delay of the pictures against the poses; None where the table has no times that rise."""
        if self.poses.times is None:
            return None
        told, factor = self.poses.base_from_hand, self.readings[0].factor
        rows = RigidTransform.from_components(factor * told.translation, told.rotation)
        return delay(self.poses.times, rows, self.seen, self.cam_from_board, self.eye_to_hand)

    @cached_property
    def result(self) -> HandEye:
        """X and Z by the poses as they were given, whatever is wrong with them.

        Raises: PoseError where the poses put corners to where the camera has no image.
        """
        return hand_eye_from_corners(
            self.poses.base_from_hand,
            self.pixels,
            self.camera,
            self.board,
            eye_to_hand=self.eye_to_hand,
            any_scale=self.any_scale,
        )

    @cached_property
    def findings(self) -> tuple[Finding, ...]:
        """What is wrong, the worst first; nothing but that where poses are stale or another reading mends it."""
        stale = tuple(self._repeated())
        if any(each.severity == "fault" for each in stale):
            return stale
        if self._still:
            return tuple(self._turning())
        found = (*stale, *(tuple(self._mended()) or self._of_solution()))
        return tuple(sorted(found, key=lambda each: SEVERITIES.index(each.severity)))

    def _of_solution(self) -> tuple[Finding, ...]:
        """What the solution shows; a disagreement is told once."""
        turning = (*self._turning(), *self._stray())
        if any(each.id == "robot-disagrees" for each in turning):
            return turning
        return (*turning, *self._scale(), *self._disagreement())

    @property
    def checked(self) -> tuple[str, ...]:
        """The findings that were looked for."""
        return tuple(id for id in KINDS if id not in dict(self.skipped))

    @property
    def skipped(self) -> tuple[tuple[str, str], ...]:
        """What was not looked for, and why."""
        few = f"it takes {FEWEST_TRIED} poses or more"
        said = [(id, few) for id in MENDS] if len(self.seen) < FEWEST_TRIED else []
        if self.any_scale:
            said = [each for each in said if each[0] != "wrong-unit"]
            said += [(id, "the scale was solved for") for id in ("wrong-unit", "scale-differs")]
        if self.poses.times is None:
            said.append(("time-offset", "the poses have no column `time`"))
        elif self.delay is None:
            said.append(("time-offset", "the times do not rise from row to row, or are too few"))
        if any(each.id == "poses-repeated" and each.severity == "fault" for each in self.findings):
            said += [(id, "the poses must be recorded anew") for id in KINDS[1:] if id not in dict(said)]
        if self._mended_at_all:
            ids = ("one-axis", "little-turning", "stray-pose", "scale-differs", "robot-disagrees")
            said += [(id, "the poses must be mended first") for id in ids if id not in dict(said)]
        return tuple(said)

    @property
    def usable(self) -> bool:
        """Whether X holds: no fault was found, or none but a direction that is not known."""
        return all(each.severity != "fault" or each.id == "one-axis" for each in self.findings)

    @property
    def _mended_at_all(self) -> bool:
        return any(each.id in (*MENDS, "time-offset") and each.severity == "fault" for each in self.findings)

    def named(self, row: int) -> str:
        """A row in words."""
        return f"pose {row + 1}" + (f" ({self.pictures[row]})" if self.pictures else "")

    @cached_property
    def _turned_deg(self) -> tuple[float, float]:
        """How far the hand and the boards turned by themselves, RMS about the main axis."""
        robot, boards = self.poses.base_from_hand[self.seen].rotation, self.cam_from_board.rotation.inv()
        return float(Turning.of(robot).deg[0]), float(Turning.of(boards).deg[0])

    @property
    def _still(self) -> bool:
        """Whether neither hand nor boards turned, so that no order or form of the poses can be told from another."""
        robot, boards = self._turned_deg
        return robot < UNKNOWN_DEG and boards < STILL_BOARD_DEG

    def _repeated(self) -> Iterator[Finding]:
        """Rows that repeat one pose of the robot though the board moved."""
        A, count = self.poses.base_from_hand[self.seen], len(self.seen)
        first = _first_alike(A)
        groups = [np.flatnonzero(first == one) for one in np.unique(first)]
        moved = [_apart(self.cam_from_board[group]) for group in groups]
        stale = [(g, by) for g, by in zip(groups, moved, strict=True) if len(g) > 1 and by > self._board_motion]
        repeats = sum(len(group) - 1 for group, _ in stale)
        robot, boards = self._turned_deg
        if len(groups) == 1:
            sentence = f"All {self._alike_rows} robot poses are the same; {BOARD_MOVED} {_length(moved[0])}."
        elif len(groups) < FEWEST:
            sentence = f"The {count} rows hold only {len(groups)} different robot poses; at least {FEWEST} are needed."
        elif robot < SAME_POSE_DEG and boards > STILL_BOARD_DEG:
            sentence = (
                f"The robot's rotation is the same in all {count} rows; the boards turned by {boards:.2g}° (RMS)."
            )
        elif stale:
            rows = "; ".join(self._rows_in_words(group) for group, _ in stale[:3])
            more = f" and {len(stale) - 3} more groups" * (len(stale) > 3)
            apart = _length(max(by for _, by in stale))
            sentence = f"Rows repeat one robot pose: {rows}{more}; meanwhile {BOARD_MOVED} {apart}."
        else:
            return
        whole = not stale or len(groups) < FEWEST or repeats > MOST_STRAY * count
        yield Finding(
            "poses-repeated",
            "fault" if whole else "warning",
            sentence,
            float(repeats or count),
            "poses",
            causes=CAUSES["poses-repeated"],
            remedy="Read the robot's pose anew when it has come to rest at each picture, or leave these rows out.",
            pictures=tuple(int(self.seen[i]) for group, _ in stale for i in group),
        )

    @property
    def _alike_rows(self) -> int:
        """How many rows of the table, with a board in their picture or without, have the pose of the first seen."""
        rows = self.poses.base_from_hand
        first = _first_alike(rows)
        return int((first == first[self.seen[0]]).sum())

    @property
    def _board_motion(self) -> float:
        """How far apart in metres the boards of two pictures are that were not taken from one pose."""
        return MIN_BOARD_MOTION * float(np.median(np.linalg.norm(self.cam_from_board.translation, axis=-1)))

    def _rows_in_words(self, group: Indices) -> str:
        """Rows by their numbers, and the first and the last with their pictures."""
        rows = self.seen[group]
        if (np.diff(rows) == 1).all() and len(rows) > 2:
            return f"{self.named(int(rows[0]))} to {self.named(int(rows[-1]))}"
        return " and ".join(self.named(int(row)) for row in rows[:4]) + f" and {len(rows) - 4} more" * (len(rows) > 4)

    def _mended(self) -> Iterator[Finding]:
        given, best = self.readings
        late = self.delay
        if late is not None and late.sure and late.error * mends.ALIKE < best.error:
            yield _late(late)
        elif not best.as_given:
            yield _reading(given, best)

    def _turning(self) -> Iterator[Finding]:
        found = turning_finding(self.result.motions.turning, self.result)
        if found is not None:
            yield found

    def _stray(self) -> Iterator[Finding]:
        adjusted = self.readings[0].adjusted
        stray = np.flatnonzero(self.result.stray[self.seen])
        if not len(stray):
            return
        order = exchanged(adjusted, stray)
        if order is not None:
            yield self._exchanged(self.seen[stray], self.seen[order])
            return
        stray = stray[np.argsort(-adjusted.displacements[stray])]
        kept_out = not self.result.used[self.seen[stray]].any()
        shift, turn = adjusted.errors
        metre = self.result.scale  # of the robot, by which the board's lengths are told
        said = [
            f"{self.named(int(self.seen[i]))} is off by {1000 * metre * shift[i]:.2g} mm and {np.degrees(turn[i]):.2g}°"
            for i in stray
        ]
        worst = float(1000 * metre * adjusted.displacements[stray[0]])
        median = 1000 * metre * float(np.median(adjusted.displacements))
        more = f" and {len(said) - 3} more" * (len(said) > 3)
        yield Finding(
            "stray-pose",
            "warning" if kept_out else "fault",
            f"{'; '.join(said[:3])}{more}, the median is {median:.2g} mm at the board's distance."
            + (" It was set aside." if kept_out and len(said) == 1 else " They were set aside." if kept_out else ""),
            worst,
            "mm",
            causes=CAUSES["stray-pose"],
            remedy="Record it again, with the robot at rest, or leave it out.",
            pictures=tuple(int(i) for i in self.seen[stray]),
        )

    def _exchanged(self, stray: Indices, order: Indices) -> Finding:
        pairs = [
            f"the picture of {self.named(int(one))} belongs to pose {other + 1}"
            for one, other in zip(stray, order, strict=True)
        ]
        return Finding(
            "poses-reordered",
            "fault",
            f"Poses are exchanged: {', '.join(pairs)}.",
            float(len(stray)),
            "poses",
            causes=CAUSES["poses-reordered"],
            remedy="Name the pictures in a column `picture` of the table, or give both in the same order.",
            pictures=tuple(int(i) for i in stray),
        )

    def _scale(self) -> Iterator[Finding]:
        scale, sigma = self.result.adjusted.scale
        if is_off(scale, sigma):
            side = 1000 * self.board.square_size
            yield Finding(
                "scale-differs",
                "warning",
                f"The robot's motions are {scale:.4f} ± {sigma:.4f} times shorter than the board's."
                if scale > 1
                else f"The robot's motions are {1 / scale:.4f} ± {sigma / scale**2:.4f} times longer than the board's.",
                scale,
                "times",
                causes=CAUSES["scale-differs"],
                remedy=f"Measure the squares: with {side / scale:.2f} mm in place of {side:.2f} mm the two agree.",
            )

    def _disagreement(self) -> Iterator[Finding]:
        given = self.readings[0]
        lever = given.adjusted.motions.lever
        if given.error >= DISAGREE * lever:
            metre = self.result.scale
            error, away = 1000 * metre * given.error, metre * lever
            yield Finding(
                "robot-disagrees",
                "warning",
                f"Robot and pictures disagree by {error:.2g} mm (median) at a board {away:.2g} m away, and "
                "no other order, unit or form of the poses mends it.",
                error,
                "mm",
                causes=CAUSES["robot-disagrees"],
                remedy="See that board and camera are fixed and that the poses are those of the frame you mean.",
            )


def _first_alike(poses: RigidTransform) -> Indices:
    """For each pose the first that is the same, within what robots at rest scatter."""
    place, turn = poses.translation, np.asarray(poses.as_matrix())
    near = np.linalg.norm(place[:, None] - place, axis=-1) <= SAME_POSE_MM / 1000
    return np.asarray((near & (angles(turn) <= np.radians(SAME_POSE_DEG))).argmax(axis=1))


def _apart(boards: RigidTransform) -> float:
    """How far apart boards are at most, in metres, their turns counted at their distance."""
    place = boards.translation
    lever = float(np.linalg.norm(place, axis=-1).mean())
    shifts = np.linalg.norm(place[:, None] - place, axis=-1)
    return float(np.hypot(shifts, lever * angles(np.asarray(boards.as_matrix()))).max())


def turning_finding(turning: Turning, result: HandEye) -> Finding | None:
    """Whether the mount turned too little, and what of X is then not known."""
    unknown, second = result.unknown_directions, float(turning.deg[1])
    name, axis = result.x_name, turning.axes[0]
    direction = ", ".join(f"{x:.2f}" for x in axis)
    mount = "base" if result.eye_to_hand else "hand"
    if len(unknown) == 3 and turning.deg[0] >= LITTLE_DEG:
        return Finding(
            "robot-disagrees",
            "fault",
            f"Robot and pictures disagree by {result.turn_noise_deg:.2g}° about each axis, too much for turns of "
            f"{turning.deg[0]:.2g}° (RMS): the translation of {name} is not known.",
            result.turn_noise_deg,
            "°",
            causes=CAUSES["robot-disagrees"],
            remedy="See that each picture belongs to the pose of its row, and that board and camera are fixed.",
        )
    if len(unknown) == 3:
        return Finding(
            "little-turning",
            "fault",
            f"The hand turned by {turning.deg[0]:.2g}° (RMS) at most: the translation of {name} is not known.",
            float(turning.deg[0]),
            "°",
            causes=CAUSES["little-turning"],
            remedy="Turn the hand by 30° and more, about axes in several directions.",
        )
    if len(unknown) == 1:
        return Finding(
            "one-axis",
            "fault",
            f"The hand turned about one axis only, ({direction}) in the {mount}'s frame: how far {name} reaches along "
            "it is not known.",
            second,
            "°",
            causes=CAUSES["one-axis"],
            remedy="Turn the hand about a second axis too, by 30° and more; or measure that distance with a ruler.",
        )
    if second < LITTLE_DEG:
        worst = 1000 * float(np.sqrt(axis @ np.asarray(_place_covariance(result)) @ axis))
        return Finding(
            "little-turning",
            "warning",
            f"The hand turned by only {second:.2g}° (RMS) about every axis but ({direction}) in the {mount}'s frame: "
            f"how far {name} reaches along it is known to ±{worst:.2g} mm.",
            second,
            "°",
            causes=CAUSES["little-turning"],
            remedy="Turn the hand by 30° and more, about axes in several directions.",
        )
    return None


def _place_covariance(result: HandEye) -> Array:
    """Of X's translation (3, 3), in square metres."""
    from camviz_clinic.calibration.jacobian import twist_jacobian

    carried = twist_jacobian(np.asarray(result.mount_from_cam.translation))
    return np.asarray(carried @ result.covariance[:6, :6] @ carried.T)


def is_off(scale: float, sigma: float) -> bool:
    """Whether a scale is surely not 1, and by enough to matter.

    >>> is_off(1.006, 0.0014), is_off(1.006, 0.0016), is_off(1.0049, 0.0001)
    (True, False, False)
    """
    return abs(scale - 1) >= max(SURE * sigma, OFF)


def _reading(given: Tried, best: Tried) -> Finding:
    """The finding that another reading mends."""
    id, pairing = best.pairing.id or "wrong-unit", best.pairing
    unit, remedy = UNITS.get(best.unit, ("", ""))
    says = " and ".join(filter(None, [pairing.says, f"the lengths are {unit}" if unit else ""]))
    sentence = (
        f"Robot and pictures disagree by {_length(given.error)} (median), and by {_length(best.error)} if {says}."
    )
    if not mends.much_better(best.error, given.error):
        count = len(given.adjusted.displacements)
        sentence = f"{given.fits} of {count} pictures agree with the robot, and {best.fits} if {says}."
    return Finding(
        id,
        "fault",
        sentence,
        1000 * given.error,
        "mm",
        causes=CAUSES[id],
        remedy=" ".join(filter(None, [pairing.remedy, remedy])),
    )


def _late(late: Delay) -> Finding:
    when, other = ("after", "later") if late.seconds > 0 else ("before", "earlier")
    return Finding(
        "time-offset",
        "fault",
        f"The pictures were taken {1000 * abs(late.seconds):.3g} ± {1000 * late.sigma:.2g} ms {when} the times of "
        f"their poses: with poses that much {other} robot and pictures disagree by {_length(late.error)} (median), "
        f"now by {_length(late.without)}.",
        1000 * late.seconds,
        "ms",
        causes=CAUSES["time-offset"],
        remedy="Stop the robot for each picture; or interpolate its poses at the times of the pictures.",
    )


def _length(metres: float) -> str:
    """A length with two digits or more: 117 m, 170 mm, 0.71 mm."""
    if metres >= 1:
        return f"{metres:.3g} m"
    return f"{1000 * metres:.0f} mm" if metres >= 0.01 else f"{1000 * metres:.2g} mm"
