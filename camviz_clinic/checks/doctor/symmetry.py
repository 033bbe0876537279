"""A chessboard that looks the same when it is turned by 180°."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from camviz.cameras import Camera
from camviz.lenses.base import Array
from camviz_clinic.calibration import CannotCalibrate, Detections, calibrate
from camviz_clinic.calibration.types import Board
from camviz_clinic.checks.doctor.shown import Shown
from camviz_clinic.checks.doctor.trouble import trouble
from camviz_clinic.checks.rig import ENOUGH, lone_poses

SAME_DEG = 10.0  # between what two views say of how the cameras stand; the other order is 180° away
FEWEST, AGREEING = 3, 0.6  # views, and share of them, that must agree once some are turned


@trouble("symmetric board", cause="a board whose sides are both odd or both even", finding="corner-order")
def symmetric_board(shown: Shown) -> Iterator[tuple[str, str]]:
    """The two cameras of a pair begin at opposite corners of the board in some views."""
    board = shown.board
    if board.kind != "chessboard" or not symmetric(board.columns, board.rows):
        return
    seen = _seen(shown)
    views = turned_views(board, *seen) if seen else []
    if views:
        sentence = (
            f"A chessboard of {board.columns}×{board.rows} corners looks the same when it is turned by 180°. The "
            f"two cameras began at opposite corners in {len(views)} view{'s' * (len(views) > 1)}. "
            "A board with one odd and one even side has one order."
        )
        yield sentence, f"--board {board.columns}x{board.rows - 1}"


def symmetric(columns: int, rows: int) -> bool:
    """Whether a chessboard of so many inner corners looks the same when it is turned by 180°.

    >>> symmetric(9, 6), symmetric(9, 7), symmetric(8, 6)
    (False, True, True)
    """
    return (columns + rows) % 2 == 0


def turned_views(board: Board, cameras: tuple[Camera, Camera], corners: tuple[Array, Array]) -> list[int]:
    """The views in which the corners (views, n, 2) of two cameras run in opposite orders; none where too few agree."""
    whole = [np.isfinite(each).all(axis=-1).sum(axis=1) >= max(ENOUGH, len(board.corners)) for each in corners]
    known = np.flatnonzero(whole[0] & whole[1])
    if len(known) < FEWEST:
        return []
    board_from_left = lone_poses(cameras[0], board, corners[0][known]).inv()
    right = corners[1][known]
    by_order = [lone_poses(cameras[1], board, each) * board_from_left for each in (right, right[:, ::-1])]
    matrices = np.array([each.rotation.as_matrix() for each in by_order])  # [order, view]
    cosines = (np.einsum("ovij,pwij->ovpw", matrices, matrices) - 1) / 2
    degrees = np.degrees(np.arccos(np.clip(cosines, -1, 1)))
    agreeing = (degrees.min(axis=2) < SAME_DEG).sum(axis=2)
    order, view = np.unravel_index(agreeing.argmax(), agreeing.shape)
    if agreeing[order, view] < max(FEWEST, AGREEING * len(known)):
        return []
    return [int(each) for each in known[degrees[order, view, 1] < SAME_DEG]]


def _seen(shown: Shown) -> tuple[tuple[Camera, Camera], tuple[Array, Array]] | None:
    """Two cameras and their corners in the same views, each camera solved for alone where the pair was not."""
    if shown.both is not None:
        left, right = shown.both
        cameras = _alone(left, shown.board), _alone(right, shown.board)
        places = sorted(set(left.places) & set(right.places))
        if cameras[0] is None or cameras[1] is None or not places:
            return None
        rows = [[each.places.index(place) for place in places] for each in (left, right)]
        return (cameras[0], cameras[1]), (left.corners[rows[0]], right.corners[rows[1]])
    calibration = shown.calibration
    if calibration is None or set(calibration.detections) != {"left", "right"}:
        return None
    seen = calibration.detections["left"], calibration.detections["right"]
    return (calibration.cameras["left"], calibration.cameras["right"]), seen


def _alone(seen: Detections, board: Board) -> Camera | None:
    try:
        return calibrate(seen, board).cameras["camera"]
    except CannotCalibrate:
        return None
