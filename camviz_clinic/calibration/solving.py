"""From the corners of boards to cameras: OpenCV solves, outliers are set aside, what is left is adjusted together."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from pathlib import Path

import cv2
import numpy as np

from camviz.cameras import Camera
from camviz.poses import RigidTransform
from camviz_clinic.calibration.adjustment import Adjustment
from camviz_clinic.calibration.board_warp import check_board_warp, with_board_warp
from camviz_clinic.calibration.camera_models import MODELS, CameraModel
from camviz_clinic.calibration.detection import CannotCalibrate, Detections, seen
from camviz_clinic.calibration.jacobian import with_parameters
from camviz_clinic.calibration.outliers import Masks, outliers, sentences
from camviz_clinic.calibration.regularisation import regularised, with_priors
from camviz_clinic.calibration.solvers import Views, poses_from_rays, solve_with_opencv
from camviz_clinic.calibration.types import Board, Calibration, Mask

FEWEST_VIEWS = 3
MOST_ROUNDS = 20
TRIMMINGS = 10
ANOTHER_WAY_DEG = 45.0  # from the other views: a symmetric board's other order turns by 180° or 90°
SHORT = 0.01  # of the sum of squares: half a per cent of the RMS
STOPPED_SHORT = (
    "The solution stopped where its lens folds at a corner, short of the least error of this model. Another program "
    "may reach less. The model probably does not describe this lens."
)
FOLDED = (
    "the lens that fits the views folds inside the image: take views that reach into the corners of the image, "
    "or a model with fewer parameters"
)


def calibrate(
    detections: Detections,
    board: Board,
    model: str = "standard",
    *,
    fixed: Sequence[str] = (),
    robust: bool = True,
    board_warp: str = "off",
) -> Calibration:
    """The camera that saw a board in at least three views.

    Args:
        detections: The corners.
        board: Their places.
        model: One of MODELS.
        fixed: Parameters that are not solved for: the principal point (cx, cy) stays in the middle of the image, all
            others stay 0.
        robust: Set aside corners and views that the rest contradicts: see `camviz_clinic.calibration.outliers`.
        board_warp: {"off", "auto", "on"}, whether the board's bend is solved for with everything else, as mrcal solves
            for its calobject_warp: never, where it earns its place (`earns_its_place`), or always.

    Returns: Calibration with one camera, named "camera".

    Raises:
        CannotCalibrate: Where the views do not give a camera.
        ValueError: For an unknown model, parameter or `board_warp`, and for corners of another board.

    >>> from camviz_clinic.checks import virtual
    >>> rng = np.random.default_rng(1)
    >>> truth = virtual.single(rng)  # a camera and boards before it, whose corners are seen with noise
    >>> found = calibrate(virtual.detections(truth.camera, truth.observed(rng)[0]), truth.board)
    >>> bool(abs(found.cameras["camera"].intrinsics.fx / truth.camera.intrinsics.fx - 1) < 0.002)
    True
    """
    kind, estimated = _model(model, fixed)
    check_board_warp(board_warp)
    adjustment = _alone("camera", detections, board, kind, estimated, robust)
    adjustment = with_board_warp(adjustment, board_warp, _robust if robust else _settled)
    return _calibration(adjustment, {"camera": detections}, detections.skipped, _stopped_short(adjustment))


def calibrate_pair(
    left: Detections,
    right: Detections,
    board: Board,
    model: str = "standard",
    *,
    fixed: Sequence[str] = (),
    robust: bool = True,
    joint: bool = True,
    board_warp: str = "off",
) -> Calibration:
    """The cameras of a pair, from the views that both have; the left one's frame is the world.

    Views are of one moment that have the same place among the pictures (`Detections.places`). All is solved for
    together: both cameras, where the right one stands, and one pose of the board for each view.

    Args:
        left, right: The corners that either camera saw.
        board: Their places.
        model: One of MODELS.
        fixed: Parameters that are not solved for, as of `calibrate`.
        robust: Set aside what the rest contradicts, as of `calibrate`.
        joint: Otherwise each camera stays as it is when calibrated alone, and only the poses are solved for (OpenCV's
            CALIB_FIX_INTRINSIC).
        board_warp: Whether the board's bend is solved for, as of `calibrate`.

    Returns: Calibration with the cameras "left" and "right".

    Raises:
        CannotCalibrate: Where fewer than three views are common, or the views do not give a camera.
        ValueError: For an unknown model, parameter or `board_warp`, and for corners of another board.

    >>> from camviz_clinic.checks import virtual
    >>> rng = np.random.default_rng(1)
    >>> truth = virtual.pair(rng, views=6)
    >>> seen = (virtual.detections(*each) for each in zip(truth.cameras, truth.observed(rng)))
    >>> off = calibrate_pair(*seen, truth.board).cameras["right"].centre - truth.cameras[1].centre
    >>> bool(np.linalg.norm(off) < 0.001)  # the right camera stands within a millimetre of where it is
    True
    """
    kind, estimated = _model(model, fixed)
    check_board_warp(board_warp)
    both = {"left": left, "right": right}
    places = sorted(set(left.places) & set(right.places))
    if len(places) < FEWEST_VIEWS:
        raise CannotCalibrate(
            f"at least {FEWEST_VIEWS} views in which both cameras see the board are needed, there are {len(places)}"
        )
    shared = {name: each.only(map(each.places.index, places)) for name, each in both.items()}
    alone = {name: _alone(name, shared[name], board, kind, estimated, robust) for name in both}
    pair = _paired(alone, board, estimated if joint else (), robust)
    pair = _robust(pair) if robust else _settled(pair)
    pair = with_board_warp(pair, board_warp, _robust if robust else _settled)
    stopped = _stopped_short(pair)
    if not joint:
        pair = replace(pair, estimated=dict.fromkeys(both, estimated))
    skipped = [picture for detections in both.values() for picture in detections.skipped]
    for name, other in (("left", "right"), ("right", "left")):
        lonely = set(both[name].places) - set(places)
        names = [
            picture for picture, place in zip(both[name].pictures, both[name].places, strict=True) if place in lonely
        ]
        skipped += [(picture, f"its partner of the {other} camera shows no board") for picture in names]
    return _calibration(pair, shared, tuple(skipped), stopped)


def _model(name: str, fixed: Sequence[str]) -> tuple[CameraModel, tuple[str, ...]]:
    """The model and the parameters that are to be estimated."""
    if name not in MODELS:
        raise ValueError(f"model must be one of {', '.join(MODELS)}, got {name!r}")
    kind = MODELS[name]
    free = [parameter for parameter in kind.parameters if parameter not in ("fx", "fy", "xi")]
    if isinstance(fixed, str):
        raise ValueError(f"fixed must be a list of parameters, got the one word {fixed!r}")
    for parameter in fixed:
        if parameter not in free:
            raise ValueError(f"fixed must be some of {', '.join(free)} of the model {name}, got {parameter!r}")
    return kind, tuple(parameter for parameter in kind.parameters if parameter not in fixed)


def _alone(
    name: str, detections: Detections, board: Board, kind: CameraModel, estimated: tuple[str, ...], robust: bool
) -> Adjustment:
    """One camera, solved for by OpenCV and adjusted."""
    corners = detections.corners
    if corners.shape[1] != board.columns * board.rows:
        raise ValueError(
            f"detections must have the {board.columns * board.rows} corners of the board, got {corners.shape}"
        )
    if len(corners) < FEWEST_VIEWS:
        raise CannotCalibrate(
            f"at least {FEWEST_VIEWS} views of the board are needed for a calibration, got {len(corners)}"
        )
    fixed = tuple(parameter for parameter in kind.parameters if parameter not in estimated)

    def begun(aside: Mask) -> Adjustment:
        camera, poses = _solved(detections, board, kind, fixed, aside)
        start = Adjustment(board, {name: camera}, {name: corners}, poses, {name: estimated}, {name: aside})
        return with_priors(start) if kind.regularised else start

    start = begun(np.zeros(corners.shape[:2], dtype=bool))
    return _robust(start, lambda masks: begun(masks[name])) if robust else _settled(start)


def _solved(
    detections: Detections, board: Board, kind: CameraModel, fixed: tuple[str, ...], aside: Mask
) -> tuple[Camera, RigidTransform]:
    """OpenCV's solution from the corners in use; the pose of a view that is set aside comes from all its corners."""
    there = seen(detections.corners)
    use = np.asarray((there & ~aside).any(axis=1))
    size = detections.width, detections.height
    try:
        views = Views.of(board, detections.corners[use], (there & ~aside)[use], *size)
        camera, poses = solve_with_opencv(kind, views, fixed)
        middle = {"cx": (size[0] - 1) / 2, "cy": (size[1] - 1) / 2}
        camera = with_parameters(camera, {parameter: middle.get(parameter, 0.0) for parameter in fixed})
        if use.all():
            return camera, poses
        others = Views.of(board, detections.corners[~use], there[~use], *size)
        silent = poses_from_rays(camera, others.points, others.pixels)
        order = np.argsort(np.concatenate([np.flatnonzero(use), np.flatnonzero(~use)]))
    except (cv2.error, ValueError) as error:
        raise CannotCalibrate(
            f"the views of the board do not give a camera of this model ({_first_line(error)}): take views that are "
            "tilted against each other and reach into the corners of the image, or a simpler model"
        ) from error
    return camera, RigidTransform.concatenate([poses, silent])[order]


def _paired(alone: Mapping[str, Adjustment], board: Board, estimated: tuple[str, ...], robust: bool) -> Adjustment:
    """Two cameras as a pair: the right one stands where the middle of the views has it.

    Where a view disagrees widely, its right corners may have been counted in another order. With `robust` they are
    set aside at first, for one such view can spoil the solution.
    """
    left, right = alone.values()
    right_from_left = right.first_from_board * left.first_from_board.inv()
    apart = np.linalg.norm(right_from_left.translation - np.median(right_from_left.translation, axis=0), axis=1)
    middle = right_from_left[int(np.argmin(apart))]
    right_camera = right.cameras["right"].at(middle.inv())
    poses = [left.first_from_board, middle.inv() * right.first_from_board]
    otherwise = robust & (np.degrees((right_from_left.rotation * middle.rotation.inv()).magnitude()) > ANOTHER_WAY_DEG)
    better = np.argmax([left.used["left"].sum(axis=1), right.used["right"].sum(axis=1) * ~otherwise], axis=0)
    return Adjustment(
        board,
        {"left": left.cameras["left"], "right": right_camera},
        {**left.detections, **right.detections},
        RigidTransform.concatenate([poses[camera][view] for view, camera in enumerate(better)]),
        dict.fromkeys(alone, estimated),
        {**left.set_aside, "right": right.set_aside["right"] | otherwise[:, None]},
        priors={**left.priors, **right.priors},
    )


def _robust(adjustment: Adjustment, begin_anew: Callable[[Masks], Adjustment] | None = None) -> Adjustment:
    """Solved, judged and solved again until no corner changes sides; the second time from the beginning."""
    at_first = begin_anew is not None
    for turn in range(MOST_ROUNDS):
        adjustment = _settled(adjustment)
        found = outliers(adjustment, at_first=at_first and turn == 0)
        if turn > MOST_ROUNDS / 2:  # one that changes sides again and again goes
            found = {name: mask | adjustment.set_aside[name] for name, mask in found.items()}
        same = all(np.array_equal(mask, adjustment.set_aside[name]) for name, mask in found.items())
        if same and not (at_first and turn == 0):
            return adjustment
        _refuse_too_few(adjustment, found)
        adjustment = begin_anew(found) if begin_anew and turn == 0 else replace(adjustment, set_aside=found)
    return _settled(adjustment)


def _settled(adjustment: Adjustment) -> Adjustment:
    """At the least squares; a view without a say is given the pose that suits its own corners best."""
    try:
        adjustment = regularised(adjustment)
    except np.linalg.LinAlgError as error:  # a corner on the very fold of the lens
        raise CannotCalibrate(FOLDED) from error
    if sum(mask.sum() for mask in adjustment.used.values()) < sum(mask.sum() for mask in _wanted(adjustment)) / 2:
        raise CannotCalibrate(FOLDED)
    poses = list(adjustment.first_from_board)
    for view in np.flatnonzero(~adjustment.posed):
        poses[view] = _trimmed(adjustment, int(view)).first_from_board[0]
    return replace(adjustment, first_from_board=RigidTransform.concatenate(poses))


def _stopped_short(adjustment: Adjustment) -> bool:
    """Whether less squares are in sight and no step leads there, because a corner would lose its image on the way."""
    if not adjustment.promised > SHORT:
        return False
    return adjustment.refined().sum_of_squares > (1 - SHORT) * adjustment.sum_of_squares


def _wanted(adjustment: Adjustment) -> list[Mask]:
    """By camera, which corners (views, corners) are seen and not set aside."""
    return [seen(corners) & ~adjustment.set_aside[name] for name, corners in adjustment.detections.items()]


def _trimmed(adjustment: Adjustment, view: int) -> Adjustment:
    """One view alone, its pose fitted to the better half of its corners (least trimmed squares, Rousseeuw 1984).

    Its pose stays where none of its corners has an image: they were found beyond the fold of a lens.
    """
    detections = {name: corners[view : view + 1] for name, corners in adjustment.detections.items()}
    alone = replace(
        adjustment,
        detections=detections,
        first_from_board=adjustment.first_from_board[view : view + 1],
        estimated=dict.fromkeys(detections, ()),
        set_aside={},
    )
    for _ in range(TRIMMINGS):
        alone = alone.refined(only_poses=True)
        distances = {name: np.linalg.norm(residuals, axis=-1) for name, residuals in alone.residuals.items()}
        if not any(np.isfinite(distance).any() for distance in distances.values()):
            return alone
        middle = np.nanmedian(np.concatenate(list(distances.values()), axis=1))
        alone = replace(alone, set_aside={name: distance > middle for name, distance in distances.items()})
    return alone


def _refuse_too_few(adjustment: Adjustment, aside: Masks) -> None:
    for name, mask in aside.items():
        left = int((seen(adjustment.detections[name]) & ~mask).any(axis=1).sum())
        if left < FEWEST_VIEWS:
            raise CannotCalibrate(
                f"the views contradict each other: only {left} of {len(mask)} of the camera {name} would agree on one "
                "camera; see that the board is the one named and lies still, and that zoom and focus are locked"
            )


def _calibration(
    adjustment: Adjustment, detections: Mapping[str, Detections], skipped: tuple[tuple[str, str], ...], stopped: bool
) -> Calibration:
    pictures = {name: each.pictures for name, each in detections.items()}
    return Calibration(
        adjustment.cameras,
        Path(),
        "camviz",
        adjustment.board,
        detections=adjustment.detections,
        cam_from_board={
            name: camera.cam_from_world * adjustment.first_from_board for name, camera in adjustment.cameras.items()
        },
        per_view_errors={name: adjustment.view_rms(name) for name in adjustment.cameras},
        notes=(*sentences(adjustment, pictures), *([STOPPED_SHORT] if stopped else [])),
        pictures=pictures,
        set_aside=adjustment.set_aside,
        estimated=adjustment.estimated,
        intrinsics_covariance={name: adjustment.intrinsics_covariance(name) for name in adjustment.cameras},
        skipped=skipped,
        priors=adjustment.priors,
        board_warp=adjustment.warp,
        board_warp_covariance=adjustment.warp_covariance,
    )


def _first_line(error: Exception) -> str:
    return " ".join(str(getattr(error, "err", error)).split())[:120]
