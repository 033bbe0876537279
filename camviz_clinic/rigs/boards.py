"""`calibrate_boards`: cameras and several boards, fixed to each other or not, solved for together."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path

import numpy as np

from camviz.cameras import Camera
from camviz.poses import RigidTransform
from camviz_clinic.calibration.adjustment import Adjustment
from camviz_clinic.calibration.detection import CannotCalibrate, Detections, seen
from camviz_clinic.calibration.identifiability import undecided
from camviz_clinic.calibration.problem import rms_by_view
from camviz_clinic.calibration.types import Board, Calibration
from camviz_clinic.calibration.undecided import Undecided
from camviz_clinic.rigs.graph import Indices, cross
from camviz_clinic.rigs.places import RelativePose
from camviz_clinic.rigs.rejection import sentences
from camviz_clinic.rigs.solving import FORMAT, judged, settled
from camviz_clinic.rigs.start import spread_out
from camviz_clinic.rigs.target import TargetAdjustment
from camviz_clinic.rigs.target_start import alone_before, begun

KNOWN = 0.1  # of a board's size: one that is known less well is not told


@dataclass(frozen=True, eq=False)
class SolvedBoards:
    """Cameras in place, and where the boards are to each other.

    Args:
        adjustment: The solution. Its views are the frames of each group of boards that are fixed to each other.
        groups: The boards' names by group; all are in the frame of the first of their group.
        frames: (views,), the frame of each view.
        of_group: (views,), the number of the group that each view shows.
        pictures: By camera, the names of its pictures by their frames.
        sizes: By board, how many times larger it is than said beside the board that most corners are of, and σ of it.

    >>> from camviz_clinic.rigs import virtual_boards
    >>> rng = np.random.default_rng(0)
    >>> truth = virtual_boards.back_to_back(rng)
    >>> found = calibrate_boards(truth.observed(rng), truth.boards)
    >>> found.largest, found.place("behind").seen_from
    ('ahead', 'ahead')
    """

    adjustment: TargetAdjustment
    groups: tuple[tuple[str, ...], ...]
    frames: Indices
    of_group: Indices
    pictures: Mapping[str, Mapping[int, str]]
    sizes: Mapping[str, tuple[float, float]]

    @property
    def boards(self) -> dict[str, RigidTransform]:
        """reference_from_board of every board, in metres: the first of its group is where it is."""
        target = self.adjustment.board
        return {name: target.places[i] for i, name in enumerate(target.names)}

    @property
    def largest(self) -> str:
        """The board that most corners are of."""
        target, used = self.adjustment.board, self.adjustment.used.values()
        counts = [sum(int(each[:, target.rows_of(i)].sum()) for each in used) for i in range(len(target.parts))]
        return target.names[int(np.argmax(counts))]

    def place(self, board: str) -> RelativePose:
        """Where a board stands in the frame of the first that it is fixed to, with its covariance.

        Args:
            board: Its name.

        Returns: RelativePose whose translation is the board's first corner.
        Raises: ValueError for an unknown name, and the first of a group, whose frame it is.
        """
        target = self.adjustment.board
        if board not in target.names or board in [group[0] for group in self.groups]:
            others = [name for group in self.groups for name in group[1:]]
            raise ValueError(f"board must be one of {', '.join(others) or 'no other'}, got {board}")
        part = target.names.index(board)
        pose, first = target.places[part], next(group[0] for group in self.groups if board in group)
        place, covariance = self.adjustment.place_of_part(part), np.zeros((6, 6))
        if place is not None:
            origin = np.eye(6)
            origin[3:, :3] = -cross(pose.translation)  # a twist (ω, τ) moves a point p by ω × p + τ
            covariance = origin @ self.adjustment.covariance[place, place] @ origin.T
        return RelativePose(board, first, pose, covariance)

    @property
    def calibration(self) -> Calibration:
        """The cameras with their covariances, as a file holds them: without a board, of which it could hold one."""
        adjustment = self.adjustment
        covariance = adjustment.covariance
        places = {name: adjustment.intrinsics_of(name) for name in adjustment.cameras}
        return Calibration(
            adjustment.cameras,
            Path(),
            FORMAT,
            notes=sentences(adjustment),
            estimated=adjustment.estimated,
            intrinsics_covariance={name: covariance[place, place] for name, place in places.items()},
        )

    @cached_property
    def undecided(self) -> dict[str, tuple[Undecided, ...]]:
        """By camera, the combinations of its intrinsics that the corners of all boards do not decide."""
        adjustment = self.adjustment
        return {name: undecided(adjustment, name, adjustment.sigma) for name in adjustment.cameras}

    def through(self, board: str) -> Calibration:
        """The same cameras with what they saw of one board: for the views and checks, which take one.

        Args:
            board: Its name.

        Returns: Calibration.
        Raises: ValueError for an unknown name.
        """
        target, adjustment = self.adjustment.board, self.adjustment
        if board not in target.names:
            raise ValueError(f"board must be one of {', '.join(target.names)}, got {board}")
        part = target.names.index(board)
        rows, group = target.rows_of(part), next(i for i, names in enumerate(self.groups) if board in names)
        views = np.flatnonzero(self.of_group == group)
        world_from_board = adjustment.first_from_board[views] * target.places[part]
        corners = {name: each[views, rows] for name, each in adjustment.detections.items()}
        residuals = {name: np.sum(each[views, rows] ** 2, axis=-1) for name, each in adjustment.residuals.items()}
        used = {name: each[views, rows] for name, each in adjustment.used.items()}
        return replace(
            self.calibration,
            board=target.parts[part],
            detections=corners,
            cam_from_board={name: each.cam_from_world * world_from_board for name, each in adjustment.cameras.items()},
            set_aside={name: seen(corners[name]) & ~used[name] for name in corners},
            undecided=self.undecided,
            per_view_errors={name: rms_by_view(np.where(used[name], residuals[name], np.nan)) for name in corners},
            pictures={
                name: tuple(named.get(int(frame), f"frame {frame + 1} without a board") for frame in self.frames[views])
                for name, named in self.pictures.items()
            },
        )


def calibrate_boards(
    detections: Mapping[str, Mapping[str, Detections]],
    boards: Mapping[str, Board],
    model: str | Mapping[str, str] = "standard",
    *,
    apart: Sequence[Sequence[str]] = (),
    known: Mapping[str, RigidTransform] | None = None,
    held: Mapping[str, Camera] | None = None,
    fixed: Sequence[str] = (),
    robust: bool = True,
) -> SolvedBoards:
    """One camera or several, and the boards that they saw: where the cameras are, and where the boards are.

    Boards that are fixed to each other, such as the two sides of a plate, the faces of a box or markers on a wall, have
    one pose in each frame, and their places to each other are solved for. Cameras that never see one board together are
    tied by them: by boards that they see in turn, or by how two boards turn together before them.

    Args:
        detections: By camera and board, the corners seen; views of one `place` are of one moment.
        boards: By name. Those that no camera saw are left out.
        model: One of MODELS, or one for each camera.
        apart: Groups of boards that move by themselves, such as (("a",), ("b", "c")); all others are fixed to each
            other.
        known: reference_from_board of boards whose place to the first of their group is known and not solved for.
        held: Cameras whose intrinsics and lens are known.
        fixed: Parameters that are not solved for, as of `calibrate`.
        robust: Set aside corners and views that the rest contradicts.

    Returns: SolvedBoards.

    Raises:
        CannotCalibrate: Where the frames do not tie all cameras, or boards that are fixed to each other.
        ValueError: For an unknown board, and corners of another one.

    Source: Triggs, McLauchlan, Hartley & Fitzgibbon (2000), "Bundle adjustment: a modern synthesis"; for cameras that
        see no board together Park & Martin (1994), "Robot sensor calibration".

    >>> from camviz_clinic.rigs import virtual_boards
    >>> rng = np.random.default_rng(0)
    >>> truth = virtual_boards.parting(rng)
    >>> found = calibrate_boards(truth.observed(rng), truth.boards, apart=[["one"]])
    >>> off = found.adjustment.cameras["cam2"].centre - truth.cameras["cam2"].centre
    >>> found.groups, bool(np.linalg.norm(off) < 0.003)
    ((('one',), ('other',)), True)
    """
    names = _seen_boards(detections, boards, [*(name for group in apart for name in group), *(known or {})])
    groups = _groups(names, apart)
    frames = sorted({place for each in detections.values() for one in each.values() for place in one.places})
    number = {frame: row for row, frame in enumerate(frames)}
    by_camera: dict[str, dict[str, Adjustment]] = {}
    for camera, each in detections.items():
        chosen = model if isinstance(model, str) else model[camera]
        own = {name: each[name] for name in names if name in each and len(each[name].corners)}
        try:
            found = alone_before(own, boards, chosen, fixed, robust, (held or {}).get(camera))
        except CannotCalibrate as error:
            raise CannotCalibrate(f"{camera}: {error}") from error
        by_camera[camera] = {
            name: spread_out(one, [number[place] for place in each[name].places], len(frames))
            for name, one in found.items()
        }
    start, of_frame, of_group = begun(by_camera, {name: boards[name] for name in names}, groups, known or {})
    solved = judged(start) if robust else settled(start)
    pictures = {
        camera: {
            number[place]: picture
            for one in each.values()
            for place, picture in zip(one.places, one.pictures, strict=True)
        }
        for camera, each in detections.items()
    }
    return SolvedBoards(solved, groups, of_frame, of_group, pictures, _sizes(start, judged if robust else settled))


def _sizes(
    start: TargetAdjustment, solve: Callable[[TargetAdjustment], TargetAdjustment]
) -> dict[str, tuple[float, float]]:
    """How many times larger than said each board is, and σ of it, beside the one with most corners: solved for anew."""
    target = start.board
    if len(target.parts) < 2:
        return {}
    counts = [
        sum(int(used[:, target.rows_of(part)].sum()) for used in start.used.values())
        for part in range(len(target.parts))
    ]
    others = tuple(part for part in range(len(target.parts)) if part != int(np.argmax(counts)))
    try:
        solved = solve(replace(start, sized=others))
    except CannotCalibrate:
        return {}
    found = {}
    for part in others:
        place = solved.place_of_size(part)
        sigma = float(np.sqrt(solved.covariance[place, place][0, 0]))
        if sigma < KNOWN:
            found[target.names[part]] = solved.board.parts[part].square_size / target.parts[part].square_size, sigma
    return found


def _seen_boards(
    detections: Mapping[str, Mapping[str, Detections]],
    boards: Mapping[str, Board],
    named: Sequence[str],
) -> list[str]:
    """The boards that any camera saw, in their order; ValueError for what is not as it must be."""
    if not detections:
        raise ValueError("detections must be of at least one camera, got none")
    unknown = sorted({*named, *(name for each in detections.values() for name in each)} - set(boards))
    if unknown:
        raise ValueError(f"boards must be some of {', '.join(boards)}, got {', '.join(unknown)}")
    for camera, each in detections.items():
        for name, one in each.items():
            expected = len(boards[name].corners)
            if one.corners.shape[1] != expected:
                raise ValueError(
                    f"detections of {name} by {camera} must have the {expected} corners of the board, "
                    f"got {one.corners.shape}"
                )
    return [name for name in boards if any(name in each and len(each[name].corners) for each in detections.values())]


def _groups(names: Sequence[str], apart: Sequence[Sequence[str]]) -> tuple[tuple[str, ...], ...]:
    """The boards by group, each in their order: those of `apart`, and one of all others."""
    moving = [name for group in apart for name in group]
    rest = tuple(name for name in names if name not in moving)
    groups = [rest, *(tuple(name for name in names if name in group) for group in apart)]
    return tuple(sorted((group for group in groups if group), key=lambda group: list(names).index(group[0])))
