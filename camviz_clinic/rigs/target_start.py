"""Where the solution of several boards begins: every camera alone, then all in place, then one pose for each view."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from camviz.cameras import Camera
from camviz.lenses.base import Array
from camviz.poses import RigidTransform
from camviz_clinic.calibration.adjustment import Adjustment
from camviz_clinic.calibration.detection import CannotCalibrate, Detections, seen
from camviz_clinic.calibration.types import Board
from camviz_clinic.rigs.placing import Placed, Sighting, placed
from camviz_clinic.rigs.rejection import medians
from camviz_clinic.rigs.start import CAPPED, alone
from camviz_clinic.rigs.target import Target, TargetAdjustment

Indices = NDArray[np.intp]
MOST_PROPOSALS = 8  # poses that are tried for each view
FAR = 6.0  # times the median of a picture's corners


def alone_before(
    seen_boards: Mapping[str, Detections],
    boards: Mapping[str, Board],
    model: str,
    fixed: Sequence[str],
    robust: bool,
    held: Camera | None,
) -> dict[str, Adjustment]:
    """One camera before each of its boards: its lens from the board that it saw most of, where that gives one.

    Raises CannotCalibrate where none does.
    """
    by_corners = sorted(seen_boards, key=lambda name: -int(seen(seen_boards[name].corners).sum()))
    refused: list[str] = []
    for best in by_corners:
        try:
            own = alone(seen_boards[best], boards[best], model, fixed, robust, held)
        except CannotCalibrate as error:
            refused.append(f"{best}: {error}")
            continue
        lens = own.cameras["camera"]
        others = [name for name in by_corners if name != best]
        rest = {name: alone(seen_boards[name], boards[name], model, fixed, robust, lens) for name in others}
        return {best: own, **rest}
    raise CannotCalibrate("; ".join(refused) or "it sees none of the boards")


def begun(
    by_camera: Mapping[str, Mapping[str, Adjustment]],
    boards: Mapping[str, Board],
    groups: Sequence[Sequence[str]],
    known: Mapping[str, RigidTransform],
) -> tuple[TargetAdjustment, Indices, Indices]:
    """Where the solution begins, and the frame and the group (views,) of each of its views.

    `by_camera` has each camera as `alone_before` has it, all with the same frames; its lens is that of the first board.
    Raises CannotCalibrate where the frames do not tie all cameras, or the boards of a group.
    """
    sightings = _sightings(by_camera, boards)
    group_of = {name: number for number, group in enumerate(groups) for name in group}
    at = placed(sightings, {name: board.corners for name, board in boards.items()}, group_of, known)
    of_frame, of_group = _views(sightings, group_of, len(groups))
    places = RigidTransform.concatenate([at.reference_from_board[name] for name in boards])
    target = Target.of(tuple(boards), tuple(boards.values()), places)
    detections, aside = {}, {}
    for camera, each in by_camera.items():
        detections[camera] = np.full((len(of_frame), len(target.corners), 2), np.nan)
        aside[camera] = np.zeros((len(of_frame), len(target.corners)), dtype=bool)
        for i, name in enumerate(boards):
            if name in each:
                views, rows = np.flatnonzero(of_group == group_of[name]), target.rows_of(i)
                detections[camera][views, rows] = each[name].detections["camera"][of_frame[views]]
                aside[camera][views, rows] = each[name].set_aside["camera"][of_frame[views]]
    own = {camera: next(iter(each.values())) for camera, each in by_camera.items()}
    firsts = {group[0] for group in groups}
    start = TargetAdjustment(
        target,
        {camera: one.cameras["camera"].at(at.first_from_cam[camera]) for camera, one in own.items()},
        detections,
        RigidTransform.identity(len(of_frame)),
        {camera: one.estimated["camera"] for camera, one in own.items()},
        aside,
        priors={camera: one.priors["camera"] for camera, one in own.items() if "camera" in one.priors},
        free=tuple(i for i, name in enumerate(boards) if name not in firsts and name not in known),
    )
    return _posed(start, *_proposals(sightings, at, group_of, of_frame, of_group)), of_frame, of_group


def _sightings(
    by_camera: Mapping[str, Mapping[str, Adjustment]], boards: Mapping[str, Board]
) -> dict[tuple[str, str], Sighting]:
    """Of every camera with every board; most of them may be empty."""
    frames = next(one.views for each in by_camera.values() for one in each.values())
    found = {}
    for camera, each in by_camera.items():
        for name in boards:
            poses, corners = np.full((frames, 4, 4), np.nan), np.zeros(frames, dtype=int)
            if name in each:
                posed = each[name].posed
                poses[posed] = each[name].first_from_board[posed].as_matrix()
                corners[posed] = each[name].used["camera"].sum(axis=1)[posed]
            found[camera, name] = Sighting(poses, corners)
    return found


def _views(
    sightings: Mapping[tuple[str, str], Sighting], group_of: Mapping[str, int], groups: int
) -> tuple[Indices, Indices]:
    """The frame and the group of each view: of each frame in which any camera sees any board of a group."""
    frames = len(next(iter(sightings.values())).corners)
    there = np.zeros((frames, groups), dtype=bool)
    for (_, name), each in sightings.items():
        there[:, group_of[name]] |= each.corners > 0
    of_frame, of_group = np.nonzero(there)
    return of_frame, of_group


def _proposals(
    sightings: Mapping[tuple[str, str], Sighting],
    at: Placed,
    group_of: Mapping[str, int],
    of_frame: Indices,
    of_group: Indices,
) -> tuple[Array, Array]:
    """first_from_reference (n, views, 4, 4) of each view by every camera and board, and by how many corners."""
    poses, corners = [], []
    for (camera, name), each in sightings.items():
        to_first, from_reference = (
            at.first_from_cam[camera].as_matrix(),
            at.reference_from_board[name].inv().as_matrix(),
        )
        poses.append(to_first @ each.poses[of_frame] @ from_reference)
        corners.append(np.where(of_group == group_of[name], each.corners[of_frame], 0))
    return np.array(poses), np.array(corners)


def _posed(start: TargetAdjustment, poses: Array, corners: Array) -> TargetAdjustment:
    """With that pose of each view that leaves its corners the smallest errors, of those that most corners tell."""
    views = np.arange(start.views)
    best, least = np.zeros((start.views, 4, 4)), np.full(start.views, np.inf)
    for chosen in np.argsort(-corners, axis=0, kind="stable")[:MOST_PROPOSALS]:
        told = corners[chosen, views] > 0
        tried = np.where(told[:, None, None], poses[chosen, views], np.eye(4))
        there = replace(start, first_from_board=RigidTransform.from_matrix(tried))
        errors = np.where(told, sum(_off(there, name) for name in there.cameras), np.inf)
        better = errors < least
        best[better], least[better] = tried[better], errors[better]
    return _settled(replace(start, first_from_board=RigidTransform.from_matrix(best)))


def _settled(start: TargetAdjustment) -> TargetAdjustment:
    """With each view's pose by the corners that most of a picture agrees with; others have no say until all is solved.

    So a board that is mistaken for another does not spoil the first solution.
    """
    aside = {}
    for name, residuals in start.residuals.items():
        off = np.linalg.norm(residuals, axis=-1)
        aside[name] = start.set_aside[name] | (off > FAR * medians(off)[:, None])
    better = replace(start, set_aside=aside).refined(only_poses=True)
    return replace(start, first_from_board=better.first_from_board, set_aside=aside)


def _off(adjustment: TargetAdjustment, name: str) -> Array:
    """The sum (views,) of a camera's errors in pixels, none above CAPPED."""
    off = np.linalg.norm(adjustment.residuals[name], axis=-1)
    capped = np.nan_to_num(np.minimum(off, CAPPED), nan=CAPPED)
    return np.asarray(np.sum(capped, axis=1, where=seen(adjustment.detections[name])))
