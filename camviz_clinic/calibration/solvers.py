"""How OpenCV is asked for each of the camera models, and where it begins."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import cv2
import numpy as np

from camviz.cameras import Camera, Intrinsics
from camviz.distortion.limits import NEARLY_A_POLE, image_reach, weakest_denominator
from camviz.lenses import Lens
from camviz.lenses.base import Array, unit
from camviz.poses import RigidTransform, Rotation
from camviz_clinic.calibration.camera_models import CameraModel
from camviz_clinic.calibration.detection import CannotCalibrate
from camviz_clinic.calibration.types import Board

CRITERIA = (cv2.TERM_CRITERIA_COUNT + cv2.TERM_CRITERIA_EPS, 200, 1e-12)
FOCAL_LENGTHS = np.geomspace(0.1, 4, 25)  # in image widths, tried as a fisheye's

GROUPS = {  # of parameters that OpenCV can hold at 0, or at the middle of the image
    cv2.CALIB_ZERO_TANGENT_DIST: {"p1", "p2"},
    cv2.CALIB_FIX_PRINCIPAL_POINT: {"cx", "cy"},
    cv2.CALIB_FIX_S1_S2_S3_S4: {"s1", "s2", "s3", "s4"},
    **{getattr(cv2, f"CALIB_FIX_K{i}"): {f"k{i}"} for i in range(1, 7)},
}


@dataclass(frozen=True, eq=False)
class Views:
    """What a solver is given: for each view points on the board (n, 3) in metres and their pixels (n, 2)."""

    points: list[Array]
    pixels: list[Array]
    width: int
    height: int

    @classmethod
    def of(cls, board: Board, corners: Array, used: Any, width: int, height: int) -> Views:
        """Of corners (views, corners, 2), those used (views, corners)."""
        points = board.corners
        pixels = [view[one] for view, one in zip(corners, used, strict=True)]
        return cls([points[one] for one in used], pixels, width, height)

    @property
    def size(self) -> tuple[int, int]:
        return self.width, self.height


Solution = tuple[Camera, RigidTransform]  # the poses are cam_from_board, one for each view


def solve_with_opencv(model: CameraModel, views: Views, fixed: tuple[str, ...]) -> Solution:
    """A model's camera and poses, for an adjustment to begin with; not every parameter in `fixed` need be held."""
    if not model.solver:
        return _from_start(model.lens(*model.start), views)
    flags = getattr(cv2, model.flags) if model.flags else 0
    return SOLVERS[model.solver](model.lens, flags, views, fixed)


def pose_from_rays(rays: Array, points: Array) -> RigidTransform:
    """cam_from_board of a flat board's points (n, 3), z = 0, seen along rays (n, 3), which may look backwards.

    The homography H = [r₁ r₂ t] of rays × H (x, y, 1) = 0 by least squares (Zhang 2000, sec. 2.1). Raises ValueError
    for fewer than four rays or points on one line.
    """
    rays, plane = unit(rays), np.column_stack([points[:, :2], np.ones(len(points))])
    good = np.isfinite(rays).all(axis=1)
    rays, plane = rays[good], plane[good]
    scale = np.array([1 / np.ptp(plane[:, :2]), 1 / np.ptp(plane[:, :2]), 1]) if len(plane) > 3 else None
    if scale is None or np.linalg.matrix_rank(plane * scale, 1e-6) < 3:
        raise ValueError(f"points must be at least four that are not on one line, got {len(plane)}")
    middle = unit(rays.mean(axis=0))
    to_middle = np.asarray(Rotation.align_vectors([[0, 0, 1]], [middle])[0].as_matrix())
    x, y, z = (rays @ to_middle.T).T[..., None]
    zero, xyw = np.zeros_like(plane), plane * scale
    rows = np.concatenate([np.hstack([zero, -z * xyw, y * xyw]), np.hstack([z * xyw, zero, -x * xyw])])
    H = to_middle.T @ (np.linalg.svd(np.linalg.qr(rows, mode="r"))[2][-1].reshape(3, 3) * scale)
    H *= np.sign(np.sum((plane @ H.T) * rays)) / np.sqrt(np.linalg.norm(H[:, 0]) * np.linalg.norm(H[:, 1]))
    U, _, Vt = np.linalg.svd(np.column_stack([H[:, 0], H[:, 1], np.cross(H[:, 0], H[:, 1])]))
    turn = U @ np.diag([1, 1, np.sign(np.linalg.det(U @ Vt))]) @ Vt
    return RigidTransform.from_components(H[:, 2], Rotation.from_matrix(turn))


def poses_from_rays(camera: Camera, points: list[Array], pixels: list[Array]) -> RigidTransform:
    """cam_from_board of every view."""
    alone = Camera(camera.intrinsics, camera.lens)
    return RigidTransform.concatenate(
        [pose_from_rays(alone.unproject(seen), on_board) for seen, on_board in zip(pixels, points, strict=True)]
    )


def _poses(rvecs: Any, tvecs: Any) -> RigidTransform:
    return RigidTransform.from_components(np.reshape(tvecs, (-1, 3)), Rotation.from_rotvec(np.reshape(rvecs, (-1, 3))))


def _from_start(start: Lens, views: Views) -> Solution:
    """The lens as it is given, at the focal length that makes the boards flattest; the adjustment does the rest."""
    camera = _begun(start, views)
    return camera, poses_from_rays(camera, views.points, views.pixels)


def _calibrate_camera(lens: type[Any], flags: int, views: Views, fixed: tuple[str, ...]) -> Solution:
    """cv2.calibrateCamera, with the flags of a model.

    A rational solution may fold among the very corners, or come near a pole in the image: then the plain one is the
    better beginning.
    """
    held = sum(flag for flag, names in GROUPS.items() if names <= set(fixed))
    points, pixels = ([each.astype(np.float32) for each in lists] for lists in (views.points, views.pixels))
    _, K, coefficients, rvecs, tvecs = cv2.calibrateCamera(
        points, pixels, views.size, None, None, flags=flags | held, criteria=CRITERIA
    )
    camera = Camera(Intrinsics.from_matrix(K, *views.size), lens(*np.ravel(coefficients)[:14].tolist()))
    poses = _poses(rvecs, tvecs)
    seen = np.concatenate([camera.project(pose.apply(each)) for pose, each in zip(poses, views.points, strict=True)])
    good = np.isfinite(seen).all() and weakest_denominator(camera.lens, image_reach(camera))[1] > NEARLY_A_POLE
    return (camera, poses) if not flags or good else _calibrate_camera(lens, 0, views, fixed)


def _calibrate_fisheye(lens: type[Any], flags: int, views: Views, fixed: tuple[str, ...]) -> Solution:
    """cv2.fisheye.calibrate from the focal length that makes the boards flattest, which it must be given.

    Its poses go wrong for boards that reach to the side of the camera, where its projection mirrors: they are found
    anew from the rays, and where it fails altogether the beginning is kept.
    """
    begun = _begun(lens(), views)
    flags |= _fisheye_flag("RECOMPUTE_EXTRINSIC") | _fisheye_flag("FIX_SKEW") | _fisheye_flag("USE_INTRINSIC_GUESS")
    try:
        _, K, coefficients, *_ = cv2.fisheye.calibrate(
            *_rows(views), views.size, begun.intrinsics.K, np.zeros(4), flags=flags, criteria=CRITERIA
        )
        solved = Camera(Intrinsics.from_matrix(K, *views.size), lens(*np.ravel(coefficients).tolist()))
        camera = min(begun, solved, key=lambda one: _misfit(one, views))
    except (cv2.error, ValueError):
        camera = begun
    return camera, poses_from_rays(camera, views.points, views.pixels)


def _calibrate_omnidir(lens: type[Any], flags: int, views: Views, fixed: tuple[str, ...]) -> Solution:
    """cv2.omnidir.calibrate, which takes no initial guess and leaves out views for which it finds none."""
    if not hasattr(cv2, "omnidir"):
        raise CannotCalibrate("the model omni needs OpenCV's contributed modules: pip install opencv-contrib-python")
    flags |= cv2.omnidir.CALIB_FIX_SKEW
    _, K, xi, coefficients, *_ = cv2.omnidir.calibrate(*_rows(views), views.size, None, None, None, flags, CRITERIA)
    K = np.asarray(K) * np.array([[1, 0, 1], [0, 1, 1], [1, 1, 1]])
    solved = lens(float(np.ravel(xi)[0]), *np.ravel(coefficients)[:4].tolist())
    camera = Camera(Intrinsics.from_matrix(K, *views.size), solved)
    return camera, poses_from_rays(camera, views.points, views.pixels)


def _rows(views: Views) -> tuple[list[Array], list[Array]]:
    """Points and pixels as the fisheye and omnidir modules take them, (1, n, 3) and (1, n, 2)."""
    return [each.reshape(1, -1, 3) for each in views.points], [each.reshape(1, -1, 2) for each in views.pixels]


def _begun(lens: Lens, views: Views) -> Camera:
    """The camera with this lens, looking through the middle of the image, that fits the views best."""
    middle = (views.width - 1) / 2, (views.height - 1) / 2
    every = -(-len(views.points) // 20)  # twenty views are enough to begin with
    views = Views(views.points[::every], views.pixels[::every], *views.size)
    cameras = [Camera(Intrinsics(*views.size, f, f, *middle), lens) for f in FOCAL_LENGTHS * views.width]
    return min(cameras, key=lambda camera: _misfit(camera, views))


def _misfit(camera: Camera, views: Views) -> float:
    """The median over the views of the RMS in pixels that the pose from rays leaves; infinite where there is none."""
    errors = []
    for points, pixels in zip(views.points, views.pixels, strict=True):
        try:
            pose = pose_from_rays(camera.unproject(pixels), points)
        except ValueError:
            return np.inf
        off = camera.project(pose.apply(points)) - pixels
        errors.append(float(np.sqrt(np.mean(np.sum(off**2, axis=-1)))))
    return float(np.median(np.nan_to_num(errors, nan=np.inf)))


def _fisheye_flag(name: str) -> int:
    """OpenCV 5 has moved the flags of its fisheye module and changed their values."""
    return int(getattr(cv2.fisheye, f"CALIB_{name}", getattr(cv2, f"CALIB_{name}", 0)))


SOLVERS = {
    "calibrateCamera": _calibrate_camera,
    "fisheye.calibrate": _calibrate_fisheye,
    "omnidir.calibrate": _calibrate_omnidir,
}
