"""From the corners of a film to a camera with a rolling shutter: the film in pieces, solved and judged."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from camviz.cameras import Camera
from camviz.lenses.base import Array
from camviz.poses import RigidTransform
from camviz_clinic.calibration.clustered import FEWEST_VIEWS
from camviz_clinic.calibration.detection import CannotCalibrate, Detections, seen
from camviz_clinic.calibration.line_delay import LineDelay
from camviz_clinic.calibration.outliers import FINEST, furthest
from camviz_clinic.calibration.rolling_shutter import RollingAdjustment
from camviz_clinic.calibration.solvers import pose_from_rays
from camviz_clinic.calibration.trajectory import ORDER, Trajectory
from camviz_clinic.calibration.types import Board, Calibration

FRAMES = 8  # of a piece of the film
FEWEST_FRAMES = 6
SLOWEST_S = 0.1  # between two frames: a hand is not smooth from one to the next beyond that
GAP = 2.5  # times the usual distance of two frames: the board may have done anything meanwhile
SPANS = (2, 3, 5)  # from knot to knot in a piece: as many as the motion asks for
REACH = 0.6  # of the distance of two frames, how far a piece goes beyond them: a frame is read within that distance
FEWEST_CORNERS = 6
ROUNDS = 5
ROUGHLY = 1e-5  # of the sum of squares, where only directions of reading are compared
CLEARLY = 0.03  # of the squares left by rows, what other directions must leave more, as for `rolling-shutter`
SURE = 5.0  # σ that the delay must be from zero
BENT = 4.0  # σ that a sagitta must be from zero
OTHERS = ((1.0, 0.0), (0.5**0.5, 0.5**0.5), (0.5**0.5, -(0.5**0.5)))  # directions of reading, the control
EVEN_S = 0.001  # what a film's clock may round its times by

Indices = NDArray[np.intp]


class NotByRows(CannotCalibrate):
    """A film in which rows that are read one after the other do not clearly explain more than columns and diagonals.

    >>> raise NotByRows("the film shows no rolling shutter")
    Traceback (most recent call last):
    camviz_clinic.calibration.rolling_solving.NotByRows: the film shows no rolling shutter
    """


@dataclass(frozen=True, eq=False)
class Filmed:
    """The frames of a film that show a board.

    Args:
        detections: The corners, one view for each frame.
        times: (frames,), of each frame, in seconds; they rise.
        board: Their places.

    Raises: ValueError for times that are not one for each frame, or that do not rise.
    """

    detections: Detections
    times: Array
    board: Board

    def __post_init__(self) -> None:
        times = np.asarray(self.times, dtype=float)
        if times.shape != (len(self.detections.corners),) or not np.isfinite(times).all():
            raise ValueError(f"times must be one for each of {len(self.detections.corners)} frames, got {times.shape}")
        if not (np.diff(times) > 0).all():
            raise ValueError("times must rise from frame to frame; they do not")
        object.__setattr__(self, "times", times)


def pieces_of(times: Array, usual: float) -> list[Indices]:
    """The frames (by index) of each piece of a film: about eight that follow one another without a gap.

    Args:
        times: (frames,), of the frames that show the board, in seconds.
        usual: The distance of two frames of the film in seconds.

    Returns: Pieces of 6 to 11 frames; stretches of fewer than six are left out.

    >>> [len(each) for each in pieces_of(np.arange(20) / 30, 1 / 30)]
    [10, 10]
    >>> [len(each) for each in pieces_of(np.array([0, 1, 2, 3, 4, 5, 9, 10]) / 30, 1 / 30)]
    [6]
    """
    runs = np.split(np.arange(len(times)), np.flatnonzero(np.diff(times) > GAP * usual) + 1)
    long = [run for run in runs if len(run) >= FEWEST_FRAMES]
    return [piece for run in long for piece in np.array_split(run, max(round(len(run) / FRAMES), 1))]


def even_times(numbers: Iterable[int], times: Array) -> Array:
    """The times of frames without their rounding, where the film's frames come at even distances.

    Args:
        numbers: Of the frames in the film.
        times: (frames,), as the film tells them, in seconds.

    Returns: (frames,), on a straight line over the numbers where all are within a millisecond of one; else as given.

    >>> np.diff(even_times([0, 1, 2, 3], np.array([0, 0.033, 0.067, 0.1]))).round(4)
    array([0.0334, 0.0334, 0.0334])
    """
    counted = np.asarray(list(numbers), dtype=float)
    if len(counted) < 3:
        return times
    line = np.polynomial.Polynomial.fit(counted, times, 1)(counted)
    return np.asarray(line if np.abs(line - times).max() <= EVEN_S else times)


def with_rolling_shutter(
    start: Calibration,
    detections: Detections,
    times: Array,
    line_delay: float | None = None,
    *,
    robust: bool = True,
    board_warp: str = "off",
) -> Calibration:
    """The camera that filmed a board, with the delay of its rows and the board's path in time solved for together.

    The path is a cubic B-spline in pieces of about eight frames; the ± are by the scatter of the pieces (Oth, Furgale,
    Kneip & Siegwart 2013, "Rolling shutter camera calibration", CVPR). Corners of the result are where a shutter of all
    rows at once would have seen them, so that it can be inspected as every calibration.

    Args:
        start: One camera, solved for as if all rows were read at once, with its board.
        detections: The corners, one view for each frame; a chessboard's are nearest with finder="saddles".
        times: (frames,), in seconds.
        line_delay: From one row to the next in seconds, held; estimated unless given.
        robust: Set aside corners that the rest contradicts.
        board_warp: {"off", "auto", "on"}, whether the board's bend is solved for: never, where it is four of its
            standard deviations, or always.

    Returns: Calibration with `line_delays`.

    Raises:
        NotByRows: Where the delay is to be estimated, and rows do not clearly beat columns and diagonals.
        CannotCalibrate: For frames too far apart, and where fewer than three pieces of the film show the board.
        ValueError: For times that do not fit, and a start without a board.

    >>> from camviz.cameras import Intrinsics
    >>> from camviz_clinic.calibration import calibrate
    >>> from camviz_clinic.checks.virtual import detections
    >>> from camviz_clinic.films.virtual import SmoothTake, take
    >>> rng, camera, board = np.random.default_rng(3), Camera(Intrinsics.from_fov(640, 480, 60)), Board(7, 5, 0.04)
    >>> carried = SmoothTake(**vars(take(rng, camera, board, 6, rest_s=0, way_s=0.5, readout_s=0.0192)))  # 40 µs a row
    >>> times = np.arange(32) / 30
    >>> corners = carried.corners(times) + rng.normal(0, 0.05, (32, 35, 2))
    >>> lens = {"fixed": ("k1", "k2", "k3", "p1", "p2")}
    >>> start = calibrate(detections(camera, corners[::2]), board, robust=False, **lens)
    >>> found = with_rolling_shutter(start, detections(camera, corners), times)
    >>> bool(abs(found.line_delays["camera"].seconds - 40e-6) < 0.5e-6)
    True
    """
    ((name, _),) = start.cameras.items()
    if start.board is None:
        raise ValueError("start must hold the board that was filmed; it does not")
    film = Filmed(detections, times, start.board)
    solved, pieces = solved_film(start, film, line_delay, robust=robust)
    if line_delay is None:
        refuse_unless_by_rows(solved)
    if board_warp != "off":
        bent = settled(replace(solved, warp=np.zeros(2)), robust)
        solved = bent if board_warp == "on" or _is_bent(bent) else solved
    return _calibration(name, start, film, solved, pieces)


def solved_film(
    start: Calibration, film: Filmed, line_delay: float | None = None, *, robust: bool = True
) -> tuple[RollingAdjustment, list[Indices]]:
    """The solution and the frames of its pieces, whatever the rows tell: as many knots as the motion asks for.

    The number of knots is the first whose Akaike's criterion, N log ‖x‖² + 2 k, more knots do not lessen.
    """
    ((name, camera),) = start.cameras.items()
    usual = float(np.median(np.diff(film.times))) if len(film.times) > 1 else np.inf
    if usual > SLOWEST_S:
        raise CannotCalibrate(
            f"the frames are {usual:.2g} s apart, too far for the board's path between them: a rolling shutter needs "
            f"frames at most {SLOWEST_S:g} s apart"
        )
    rows = camera.intrinsics.height
    took = rows * abs(line_delay or 0.0)
    if took > 2 * REACH * usual:
        raise CannotCalibrate(
            f"{rows} rows would take {1000 * took:.3g} ms, longer than the {1000 * usual:.3g} ms from frame to frame: "
            "see that the line delay is that of one row"
        )
    enough = seen(film.detections.corners).sum(axis=1) >= FEWEST_CORNERS
    pieces = [np.flatnonzero(enough)[piece] for piece in pieces_of(film.times[enough], usual)]
    if len(pieces) < FEWEST_VIEWS:
        raise CannotCalibrate(
            f"at least {FEWEST_VIEWS} stretches of {FEWEST_FRAMES} frames or more in which the board is seen without a "
            f"gap are needed for a rolling shutter, there are {len(pieces)}"
        )
    poses = _poses(camera, film)
    best: RollingAdjustment | None = None
    for spans in SPANS:
        begun = _begun(camera, start.estimated[name], film, pieces, poses, spans, usual)
        begun = replace(
            begun, prior=start.priors.get(name), line_delay=line_delay or 0.0, delay_free=line_delay is None
        )
        if best is not None:
            begun = replace(begun, camera=best.camera, line_delay=best.line_delay)
        solved = settled(begun, robust)
        if best is not None and _criterion(solved) >= _criterion(best):
            break
        best = solved
    assert best is not None
    return best, pieces


def settled(adjustment: RollingAdjustment, robust: bool) -> RollingAdjustment:
    """At the least squares; corners further off than noise explains are judged anew until nothing changes."""
    adjustment = adjustment.refined()
    for turn in range(ROUNDS if robust else 0):
        distance = np.linalg.norm(adjustment.residuals, axis=-1)
        scatter = float(np.nanmedian(distance) / np.sqrt(2 * np.log(2))) if turn == 0 else adjustment.sigma
        count = int(np.isfinite(distance).sum())
        aside = distance > furthest(count, max(scatter, FINEST))
        before = np.zeros_like(aside) if adjustment.set_aside is None else adjustment.set_aside
        if np.array_equal(aside, before):
            break
        adjustment = replace(adjustment, set_aside=aside).refined()
    return adjustment


def refuse_unless_by_rows(solved: RollingAdjustment) -> None:
    """The control of the finding `rolling-shutter`, on the film: the same corners, read along columns and diagonals.

    Raises: NotByRows where the delay is not clear of zero, or another direction of reading leaves hardly more squares.
    """
    sigma = solved.deviation("line_delay")
    if not abs(solved.line_delay) > SURE * sigma:
        raise NotByRows(
            f"the film shows no rolling shutter: rows are {1e6 * solved.line_delay:.2f} ± {1e6 * sigma:.2f} µs apart"
        )
    if not (more := clearly(solved)) > CLEARLY:
        raise NotByRows(
            "the film does not tell a rolling shutter from other motion: reading along columns or diagonals leaves "
            f"{max(more, 0.0):.1%} more of the squares than along rows, and {CLEARLY:.0%} is asked for"
        )


def clearly(solved: RollingAdjustment) -> float:
    """How much more of the squares the best of the other directions of reading leaves than rows do; below 0 if less."""
    others = [replace(solved, direction=direction, line_delay=0.0).refined(ROUGHLY) for direction in OTHERS]
    return min(each.sum_of_squares for each in others) / solved.sum_of_squares - 1


def _is_bent(solved: RollingAdjustment) -> bool:
    """Whether a sagitta of the board is clear of zero."""
    assert solved.warp is not None
    return bool((np.abs(solved.warp) > BENT * np.sqrt(np.diag(solved.covariance))[-2:]).any())


def _criterion(solved: RollingAdjustment) -> float:
    there = int(np.isfinite(solved.residuals).sum())
    return there * float(np.log(solved.sum_of_squares / solved.measurements)) + 2 * solved.unknowns


def _poses(camera: Camera, film: Filmed) -> RigidTransform:
    """cam_from_board of every frame as if all rows were read at once; the identity where there is none."""
    points, poses = film.board.corners, []
    rays = camera.unproject(film.detections.corners)
    for view, there in zip(rays, seen(film.detections.corners), strict=True):
        try:
            poses.append(pose_from_rays(view[there], points[there]))
        except (ValueError, np.linalg.LinAlgError):  # too few corners, on one line, or without rays
            poses.append(RigidTransform.identity())
    return RigidTransform.concatenate(poses)


def _begun(
    camera: Camera,
    estimated: tuple[str, ...],
    film: Filmed,
    pieces: list[Indices],
    poses: RigidTransform,
    spans: int,
    usual: float,
) -> RollingAdjustment:
    """The problem at the camera and the poses of the global shutter."""
    frames = max(len(piece) for piece in pieces)
    corners = film.detections.corners
    times = np.full((len(pieces), frames), np.nan)
    detections = np.full((len(pieces), frames, *corners.shape[1:]), np.nan)
    rows = np.zeros(times.shape, dtype=int)
    for place, piece in enumerate(pieces):
        times[place, : len(piece)] = film.times[piece]
        detections[place, : len(piece)] = corners[piece]
        rows[place] = np.concatenate([piece, np.repeat(piece[-1:], frames - len(piece))])
    path = Trajectory.through(
        poses[rows.ravel()],
        times,
        np.nanmin(times, axis=1) - REACH * usual,
        np.nanmax(times, axis=1) + REACH * usual,
        spans + ORDER - 1,
        film.board.corners.mean(axis=0),
    )
    return RollingAdjustment(film.board, camera, estimated, path, times, detections)


def _calibration(
    name: str, start: Calibration, film: Filmed, solved: RollingAdjustment, pieces: list[Indices]
) -> Calibration:
    """What was solved, with a view for each frame of a piece."""
    used = np.concatenate(pieces)
    there = np.isfinite(solved.times)
    poses = solved.trajectory.cam_from_board(solved.times)[np.flatnonzero(there.ravel())]
    aside = np.zeros(solved.used.shape, bool) if solved.set_aside is None else solved.set_aside
    squares = np.where(solved.used, np.sum(solved.residuals**2, axis=-1), 0)[there]
    count = np.maximum(solved.used[there].sum(axis=1), 1)
    delay = LineDelay(solved.line_delay, solved.deviation("line_delay") if solved.delay_free else None)
    intrinsics = slice(0, len(solved.estimated))
    return replace(
        start,
        cameras={name: solved.camera},
        source=Path(),
        detections={name: solved.all_at_once[there]},
        cam_from_board={name: poses},
        per_view_errors={name: np.sqrt(squares.sum(axis=1) / count)},
        notes=tuple(_notes(film, solved, pieces, delay)),
        pictures={name: tuple(film.detections.pictures[frame] for frame in used)},
        set_aside={name: aside[there]},
        estimated={name: solved.estimated},
        intrinsics_covariance={name: solved.covariance[intrinsics, intrinsics]},
        skipped=(),
        board_warp=solved.warp,
        board_warp_covariance=None if solved.warp is None else solved.covariance[-2:, -2:],
        line_delays={name: delay},
    )


def _notes(film: Filmed, solved: RollingAdjustment, pieces: list[Indices], delay: LineDelay) -> Iterator[str]:
    count, total = sum(len(piece) for piece in pieces), len(film.times)
    yield (
        f"Rolling shutter: {delay.sentence}; solved from {count} frames in {len(pieces)} stretches. The corners kept "
        "are where a shutter of all rows at once would have seen them."
    )
    if film.detections.skipped:
        yield f"{len(film.detections.skipped)} frames do not show the board, or not well enough for its corners."
    if count < total:
        yield (
            f"{total - count} of {total} frames that show the board were left out: fewer than {FEWEST_FRAMES} follow "
            "one another there without a gap."
        )
    if solved.set_aside is not None and solved.set_aside.any():
        corners = int(np.isfinite(solved.residuals[..., 0]).sum())
        yield f"{int(solved.set_aside.sum())} of {corners} corners were set aside: they contradict the others."
