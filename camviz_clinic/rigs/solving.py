"""`calibrate_rig`: several cameras that see a board in any frames, solved for together."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import TypeVar

import numpy as np

from camviz.cameras import Camera
from camviz_clinic.calibration.board_warp import check_board_warp, with_board_warp
from camviz_clinic.calibration.detection import CannotCalibrate, Detections, seen
from camviz_clinic.calibration.outliers import Masks
from camviz_clinic.calibration.regularisation import regularised
from camviz_clinic.calibration.solving import FOLDED
from camviz_clinic.calibration.types import Board, Calibration, Mask
from camviz_clinic.rigs.adjustment import RigAdjustment
from camviz_clinic.rigs.graph import islands, parted
from camviz_clinic.rigs.rejection import hopeless, more_agree, outliers, sentences
from camviz_clinic.rigs.start import alone, begun, spread_out

MOST_ROUNDS = 12
FORMAT = "camviz"
Solution = TypeVar("Solution", bound=RigAdjustment)


def calibrate_rig(
    detections: Mapping[str, Detections],
    board: Board,
    model: str | Mapping[str, str] = "standard",
    *,
    held: Mapping[str, Camera] | None = None,
    fixed: Sequence[str] = (),
    robust: bool = True,
    board_warp: str = "off",
) -> Calibration:
    """The cameras of a rig of which each saw the board in any of the frames; the first one's frame is the world.

    Views are of one moment that have the same place among the pictures (`Detections.places`; `synchronised` gives
    them by the pictures' names). Each camera is calibrated by itself. Then the cameras are chained by the frames that
    two of them share, and all is solved for together: intrinsics, places, and one pose of the board for each frame.

    Args:
        detections: The corners that each camera saw, by its name.
        board: Their places.
        model: One of MODELS, or one for each camera by its name.
        held: Cameras by name whose intrinsics and lens are known and not solved for; their poses do not count.
        fixed: Parameters that are not solved for, as of `calibrate`.
        robust: Set aside corners and views that the rest contradicts, by a σ for each camera.
        board_warp: Whether the board's bend is solved for, as of `calibrate`.

    Returns: Calibration with these cameras in place. Its covariances are clustered by frame
        (`RigAdjustment.covariance`); `relative_pose` gives those of the places.

    Raises:
        CannotCalibrate: Where the frames do not tie all cameras together, or a camera's views do not give a camera.
        ValueError: For fewer than two cameras, an unknown name, model, parameter or `board_warp`, and corners of
            another board.

    Source: Triggs, McLauchlan, Hartley & Fitzgibbon (2000), "Bundle adjustment: a modern synthesis".

    >>> from camviz_clinic.rigs import virtual
    >>> rng = np.random.default_rng(1)
    >>> truth = virtual.rig(rng, 3, frames=10)
    >>> found = calibrate_rig(truth.observed(rng), truth.board)
    >>> off = found.cameras["cam2"].centre - truth.cameras["cam2"].centre
    >>> bool(np.linalg.norm(off) < 0.003)  # within three millimetres of where it is, a metre away
    True
    """
    names, held = list(detections), dict(held or {})
    _check(detections, board, model, held)
    check_board_warp(board_warp)
    models = {name: model if isinstance(model, str) else model[name] for name in names}
    frames = sorted({place for each in detections.values() for place in each.places})
    number = {place: row for row, place in enumerate(frames)}
    by_camera = {}
    for name, each in detections.items():
        try:
            own = alone(each, board, models[name], fixed, robust, held.get(name))
        except CannotCalibrate as error:
            raise CannotCalibrate(f"{name}: {error}") from error
        by_camera[name] = spread_out(own, [number[place] for place in each.places], len(frames))
    start = begun(by_camera, board)
    solved = with_board_warp(judged(start) if robust else settled(start), board_warp, judged if robust else settled)
    return _calibration(solved, detections, frames)


def _check(
    detections: Mapping[str, Detections], board: Board, model: str | Mapping[str, str], held: Mapping[str, Camera]
) -> None:
    if len(detections) < 2:
        raise ValueError(f"detections must be of at least two cameras, got {len(detections)}")
    for what, given in (("model", model), ("held", held)):
        unknown = [] if isinstance(given, str) else sorted(set(given) - set(detections))
        if unknown:
            raise ValueError(f"{what} must name cameras of {', '.join(detections)}, got {', '.join(unknown)}")
    missing = [] if isinstance(model, str) else sorted(set(detections) - set(model) - set(held))
    if missing:
        raise ValueError(f"model must be given for every camera, it lacks {', '.join(missing)}")
    for name, each in detections.items():
        if each.corners.shape[1] != board.columns * board.rows:
            raise ValueError(
                f"detections of {name} must have the {board.columns * board.rows} corners of the board, "
                f"got {each.corners.shape}"
            )
        if len(set(each.places)) != len(each.places):
            raise ValueError(f"places of {name} must be different frames, got one twice")


def judged(start: Solution) -> Solution:
    """Solved, judged and solved again until no corner changes sides.

    Where whole views go, this is done again from a solution by all of them, and the one that more corners agree with is
    taken: a lens bends wildly where it has no corners, so that views that went first may never come back.
    """
    careful = _judged(replace(start, set_aside=_together(start.set_aside, hopeless(start))))
    if not any(np.any(mask.any(axis=1) & ~careful.used[name].any(axis=1)) for name, mask in careful.set_aside.items()):
        return careful
    try:
        trusting = _judged(start)
    except CannotCalibrate:
        return careful
    return trusting if more_agree(trusting, careful) else careful


def _judged(adjustment: Solution) -> Solution:
    for turn in range(MOST_ROUNDS):
        adjustment = settled(adjustment)
        found = outliers(adjustment, at_first=turn == 0)
        if turn > MOST_ROUNDS / 2:  # one that changes sides again and again goes
            found = _together(found, adjustment.set_aside)
        if all(np.array_equal(mask, adjustment.set_aside[name]) for name, mask in found.items()):
            return adjustment
        _refuse_parted(adjustment, found)
        adjustment = replace(adjustment, set_aside=found)
    return settled(adjustment)


def settled(adjustment: Solution) -> Solution:
    """At the least sum of squares; CannotCalibrate where a lens folds at a corner."""
    try:
        solved = regularised(adjustment)
    except np.linalg.LinAlgError as error:  # a corner on the very fold of a lens
        raise CannotCalibrate(FOLDED) from error
    assert isinstance(solved, type(adjustment))
    return solved


def _together(one: Mapping[str, Mask], other: Mapping[str, Mask]) -> Masks:
    return {name: mask | other[name] for name, mask in one.items()}


def _refuse_parted(adjustment: RigAdjustment, aside: Masks) -> None:
    """CannotCalibrate where what agrees with each other no longer ties the cameras together."""
    used = {name: np.any(seen(adjustment.detections[name]) & ~mask, axis=1) for name, mask in aside.items()}
    groups = islands(used)
    if len(groups) > 1:
        raise CannotCalibrate(
            "the views contradict each other: see that the cameras stand still, that their pictures are of the same "
            f"moments, and that the board is the one named; of what agrees, {parted(groups, list(used))}"
        )


def _calibration(adjustment: RigAdjustment, detections: Mapping[str, Detections], frames: Sequence[int]) -> Calibration:
    covariance = adjustment.covariance
    pictures = {}
    for name, each in detections.items():
        named = dict(zip(each.places, each.pictures, strict=True))
        pictures[name] = tuple(named.get(frame, f"frame {frame + 1} without a board") for frame in frames)
    places = {name: adjustment.intrinsics_of(name) for name in adjustment.cameras}
    return Calibration(
        adjustment.cameras,
        Path(),
        FORMAT,
        adjustment.board,
        detections=adjustment.detections,
        cam_from_board={
            name: camera.cam_from_world * adjustment.first_from_board for name, camera in adjustment.cameras.items()
        },
        per_view_errors={name: adjustment.view_rms(name) for name in adjustment.cameras},
        notes=sentences(adjustment),
        pictures=pictures,
        set_aside=adjustment.set_aside,
        estimated=adjustment.estimated,
        intrinsics_covariance={name: covariance[place, place] for name, place in places.items()},
        skipped=tuple(one for each in detections.values() for one in each.skipped),
        priors=adjustment.priors,
        board_warp=adjustment.warp,
        board_warp_covariance=adjustment.warp_covariance,
    )
