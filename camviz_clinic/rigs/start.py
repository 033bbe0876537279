"""Where a rig's solution begins: every camera by itself, then a chain of cameras, then one pose for each frame."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np

from camviz.cameras import Camera
from camviz.lenses.base import Array
from camviz.poses import RigidTransform
from camviz_clinic.calibration.adjustment import Adjustment
from camviz_clinic.calibration.boards.charuco import FEWEST
from camviz_clinic.calibration.denominator_prior import DenominatorPrior
from camviz_clinic.calibration.detection import CannotCalibrate, Detections, seen
from camviz_clinic.calibration.problem import moved
from camviz_clinic.calibration.solvers import pose_from_rays
from camviz_clinic.calibration.solving import calibrate
from camviz_clinic.calibration.types import Board, Mask
from camviz_clinic.rigs.adjustment import RigAdjustment
from camviz_clinic.rigs.graph import Indices, chained, islands, links, parted

MOST_ALONE = 30  # views of a camera that its first solution is made of
_NOTHING: tuple[str, ...] = ()
CAPPED = 20.0  # pixels: a corner further off says no more against a pose


def alone(
    detections: Detections, board: Board, model: str, fixed: Sequence[str], robust: bool, held: Camera | None
) -> Adjustment:
    """One camera by itself: from a few dozen of its views, and the poses of all of them.

    Raises CannotCalibrate where the views do not give a camera.
    """
    corners = detections.corners
    if held is not None:
        camera, estimated, priors = Camera(held.intrinsics, held.lens), _NOTHING, {}
    else:
        few = varied(corners, MOST_ALONE)
        judged = robust and len(board.corners) > FEWEST  # of a single marker's four corners the rest says nothing
        solved = calibrate(detections.only(few), board, model, fixed=fixed, robust=judged)
        camera, estimated, priors = solved.cameras["camera"], solved.estimated["camera"], dict(solved.priors)
    poses, known = board_poses(camera, board, corners)
    unknown = np.repeat(~known[:, None], corners.shape[1], axis=1)
    problem = Adjustment(
        board, {"camera": camera}, {"camera": corners}, poses, {"camera": estimated}, {"camera": unknown}, priors=priors
    )
    return problem.refined(only_poses=True)


def varied(corners: Array, most: int) -> Indices:
    """Views (n,) that differ most in where the board is seen, how large, and how it is turned.

    Each is the one farthest from those chosen before it (Gonzalez 1985), by the middle and the spread of its corners.
    """
    if len(corners) <= most:
        return np.arange(len(corners))
    middle = np.nanmean(corners, axis=1)
    off = np.nan_to_num(corners - middle[:, None])
    spread = np.einsum("vni,vnj->vij", off, off) / seen(corners).sum(axis=1)[:, None, None]
    features = np.column_stack([middle, np.sign(spread).reshape(-1, 4) * np.sqrt(np.abs(spread)).reshape(-1, 4)])
    chosen = [int(np.argmax(seen(corners).sum(axis=1)))]
    distance = np.full(len(corners), np.inf)
    while len(chosen) < most:
        distance = np.minimum(distance, np.linalg.norm(features - features[chosen[-1]], axis=1))
        chosen.append(int(np.argmax(distance)))
    return np.sort(chosen)


def board_poses(camera: Camera, board: Board, corners: Array) -> tuple[RigidTransform, Mask]:
    """cam_from_board of views (v, n, 2) from their rays, and which of them show enough for one."""
    ahead = RigidTransform.from_translation([0, 0, 10 * board.length])
    poses, known = [], np.zeros(len(corners), dtype=bool)
    rays, there = camera.unproject(corners), seen(corners)
    for view in range(len(corners)):
        try:
            poses.append(pose_from_rays(rays[view][there[view]], board.corners[there[view]]))
            known[view] = np.isfinite(camera.project(poses[-1].apply(board.corners[there[view]]))).all()
        except (ValueError, np.linalg.LinAlgError):  # too few corners, on one line, or without rays
            poses.append(ahead)
    return RigidTransform.concatenate(poses), known


def spread_out(adjustment: Adjustment, places: Sequence[int], frames: int) -> Adjustment:
    """The same problem among the frames of the whole rig: NaN, and no say, where the camera saw nothing."""
    rows = np.asarray(places)
    corners = np.full((frames, *adjustment.detections["camera"].shape[1:]), np.nan)
    corners[rows] = adjustment.detections["camera"]
    aside = np.zeros(corners.shape[:2], dtype=bool)
    aside[rows] = adjustment.set_aside["camera"]
    poses = [RigidTransform.from_translation([0, 0, 10 * adjustment.board.length])] * frames
    for row, pose in zip(rows, adjustment.first_from_board, strict=True):
        poses[row] = pose
    return replace(
        adjustment,
        detections={"camera": corners},
        set_aside={"camera": aside},
        first_from_board=RigidTransform.concatenate(poses),
    )


def begun(by_camera: Mapping[str, Adjustment], board: Board) -> RigAdjustment:
    """The cameras in a chain from the first, and each frame's board where most of those who see it put it.

    Raises CannotCalibrate where the frames do not tie all cameras together.
    """
    names = list(by_camera)
    groups = islands({name: each.posed for name, each in by_camera.items()})
    if len(groups) > 1:
        raise CannotCalibrate(parted(groups, names))
    placed = chained(names, links(by_camera))
    cameras = {name: by_camera[name].cameras["camera"].at(placed[name]) for name in names}
    priors: dict[str, DenominatorPrior] = {
        name: each.priors["camera"] for name, each in by_camera.items() if "camera" in each.priors
    }
    return RigAdjustment(
        board,
        cameras,
        {name: each.detections["camera"] for name, each in by_camera.items()},
        _frames(cameras, by_camera, board),
        {name: each.estimated["camera"] for name, each in by_camera.items()},
        {name: each.set_aside["camera"] for name, each in by_camera.items()},
        priors=priors,
    )


def _frames(cameras: Mapping[str, Camera], by_camera: Mapping[str, Adjustment], board: Board) -> RigidTransform:
    """first_from_board of every frame: of what its cameras say, that which leaves the others the smallest errors."""
    proposals = [cameras[name].world_from_cam * each.first_from_board for name, each in by_camera.items()]
    errors = []
    for poses, each in zip(proposals, by_camera.values(), strict=True):
        points = moved(poses, board.corners)
        total = np.zeros(len(points))
        for name, camera in cameras.items():
            corners = by_camera[name].detections["camera"]
            off = np.linalg.norm(camera.project(points) - corners, axis=-1)
            total += np.where(seen(corners), np.nan_to_num(np.minimum(off, CAPPED), nan=CAPPED), 0).sum(axis=1)
        errors.append(np.where(each.posed, total, np.inf))
    best = np.argmin(errors, axis=0)
    return RigidTransform.concatenate([proposals[camera][frame] for frame, camera in enumerate(best)])
