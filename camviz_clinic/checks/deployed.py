"""Whether a calibration that is in use still describes its camera, judged by new pictures of a board.

The camera is held as it is, and every pose of the board is free. Poses take much of an error away, so the verdict does
not rest on residuals: `Refit` asks what solving the camera anew would change over the image, and how well it is known.
"""

from __future__ import annotations

from collections.abc import Mapping
from types import MappingProxyType

from camviz_clinic.calibration.detection import Detections
from camviz_clinic.calibration.stamp import Stamp
from camviz_clinic.calibration.types import Board, Calibration
from camviz_clinic.checks.camera_check import camera_judgement
from camviz_clinic.checks.judgement import Check
from camviz_clinic.checks.pair_check import pair_judgement
from camviz_clinic.checks.rig import pairs
from camviz_clinic.checks.stamps import contradictions, holds_for

LIMIT_PX = 1.0  # RMS over the image
NOT_TOLD: Mapping[str, Stamp] = MappingProxyType({})
SAME_SQUARE = 1e-3  # of its side
UNSEEN = (
    "One camera alone does not show a turn of the whole camera in its mount. Most of a shift of the principal point "
    "looks like such a turn; what it does beyond that is counted."
)


def check(
    calibration: Calibration,
    detections: Detections | Mapping[str, Detections],
    board: Board | None = None,
    limit: float = LIMIT_PX,
    taken: Mapping[str, Stamp] = NOT_TOLD,
) -> Check:
    """Whether a calibration still holds, by a board's corners in new pictures of its cameras.

    The verdict is "pass" where the calibration is surely (99 %) within the limit, "fail" where it is surely beyond it,
    "warn" where it is surely beyond half of it, and "inconclusive" where the pictures do not tell. Corners of both
    cameras of a pair judge the pair, too.

    Args:
        calibration: What is in use.
        detections: The corners, of one camera or of cameras by name.
        board: That of the calibration unless given.
        limit: How far it may be off over the image, in pixels: the RMS of far points, once a turn of the whole camera
            is taken out.
        taken: How the new pictures were taken, by camera: what of it contradicts the calibration's stamp is told.

    Returns: The verdict, with its reasons and numbers.

    Raises:
        ValueError: Without a board, for an unknown camera, for corners of another board, and for a limit not above 0.

    >>> from dataclasses import replace
    >>> import numpy as np
    >>> from camviz_clinic.checks.virtual import detections, single
    >>> before, after = (single(np.random.default_rng(9), views=views) for views in (20, 30))  # one camera, other views
    >>> calibration = before.solved(before.observed(np.random.default_rng(1)))
    >>> longer = replace(before.camera.intrinsics, fx=1.01 * before.camera.intrinsics.fx)
    >>> for camera in before.camera, replace(before.camera, intrinsics=longer):
    ...     seen = replace(after, cameras=(camera,)).observed(np.random.default_rng(2))[0]
    ...     check(calibration, detections(camera, seen)).verdict
    'pass'
    'fail'
    """
    board = board or calibration.board
    if board is None:
        raise ValueError("board must be given, as the calibration holds none")
    if not limit > 0:
        raise ValueError(f"limit must be a positive number of pixels, got {limit}")
    found = _by_name(calibration, detections, board)
    judged = {name: camera_judgement(calibration, name, seen, board, limit) for name, seen in found.items()}
    refits = {name: refit for name, (_, refit) in judged.items() if refit}
    judgements = [judgement for judgement, _ in judged.values()]
    for pair in pairs(calibration):
        if found.keys() >= {pair.left, pair.right}:
            judgements.append(pair_judgement(pair, found, board, limit, refits))
    against = {name: tuple(contradictions(calibration.stamps.get(name, Stamp()), taken[name])) for name in taken}
    return Check(
        limit,
        tuple(judgements),
        _notes(calibration, board, found),
        tuple(sentence for name in found if (sentence := holds_for(calibration, name))),
        {name: several for name, several in against.items() if several},
    )


def _by_name(
    calibration: Calibration, detections: Detections | Mapping[str, Detections], board: Board
) -> Mapping[str, Detections]:
    """The detections by camera, all of them of this board."""
    cameras, corners = calibration.cameras, board.columns * board.rows
    if isinstance(detections, Detections):
        if len(cameras) > 1:
            raise ValueError(f"detections must name their camera, one of {', '.join(cameras)}")
        detections = {next(iter(cameras)): detections}
    for name, seen in detections.items():
        if name not in cameras:
            raise ValueError(f"detections must be of {', '.join(cameras)}, got {name}")
        if seen.corners.shape[1] != corners:
            raise ValueError(f"detections must have the {corners} corners of the board, got {seen.corners.shape[1]}")
    return detections


def _notes(calibration: Calibration, board: Board, found: Mapping[str, Detections]) -> tuple[str, ...]:
    notes, own = [UNSEEN] if len(found) == 1 else [], calibration.board
    if own is not None and abs(own.square_size / board.square_size - 1) > SAME_SQUARE:
        notes.append(
            f"The calibration was made with squares of {1000 * own.square_size:.4g} mm, these are of "
            f"{1000 * board.square_size:.4g} mm."
        )
    return (*notes, *(f"{picture}: skipped, {why}." for seen in found.values() for picture, why in seen.skipped))
