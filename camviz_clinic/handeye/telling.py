"""A hand–eye calibration in words, as a tree for programs, and as the file that is kept."""

from __future__ import annotations

from typing import Any

import numpy as np

from camviz.lenses.base import Array
from camviz.poses import RigidTransform
from camviz_clinic.calibration.motions import Mask
from camviz_clinic.checks import words
from camviz_clinic.checks.accuracy import UNREAD, Accuracy, two_digits
from camviz_clinic.checks.task import length
from camviz_clinic.files.output import as_rows
from camviz_clinic.handeye.diagnosis import PosedPictures
from camviz_clinic.handeye.solving import HandEye

MAX_PLACE_SIGMA = 0.01  # of the distance to the board, and radians: above it `robot-disagrees` warns of a pose
ARRANGEMENTS = ("eye in hand", "eye to hand")


def as_text(case: PosedPictures, skipped_pictures: tuple[tuple[str, str], ...] = ()) -> str:
    """The verdict, the findings with what to do, X with its ±, and what was assumed."""
    lines = [*(f"{name}: skipped, {why}." for name, why in skipped_pictures), *case.poses.assumed]
    glance = [*(solution(case) if case.usable else []), *lines]
    return words.text(case.findings, case.checked, case.skipped, glance=glance, accuracy=_accuracy(case))


def _accuracy(case: PosedPictures) -> Accuracy:
    """What X is good for, by its largest σ; nothing where findings come first."""
    if words.worst_of(case.findings):
        return UNREAD
    found = case.result
    place, turn = float(np.max(found.translation_sigma)), float(np.max(found.rotation_sigma))
    board = float(np.median(np.linalg.norm(case.cam_from_board.translation, axis=-1)))
    known = f"±{length(place)} and ±{two_digits(np.degrees(turn))}° on each axis"
    if max(place / board, turn) <= MAX_PLACE_SIGMA:
        return Accuracy(f"Good to {known}.", True)
    return Accuracy(f"Not good for measuring: {known}. Add poses that turn the hand by 30° and more.", False)


def solution(case: PosedPictures) -> list[str]:
    """X and Z in lines, each number with its standard deviation."""
    found = case.result
    lines = [
        f"{found.x_name}: {_place(found)}",
        f"{found.x_name}: {_turn(found)}",
        f"{found.z_name}: {_board(found)}",
        *([f"scale: {_scale(case)}"] if case.any_scale else []),
        _fit(found),
        f"± is one standard deviation, clustered by pose; an interval of 95 % reaches {found.times_sigma:.2f} of them "
        "to either side. Errors of the camera's own numbers are not in it.",
    ]
    return lines


def as_tree(case: PosedPictures) -> dict[str, Any]:
    """The verdict, the findings and the solution, for programs; null where something is not known."""
    return {
        "verdict": words.verdict(case.findings, case.checked, case.skipped, accuracy=_accuracy(case)),
        "usable": case.usable,
        "findings": [words.tree(each) for each in case.findings],
        "checked": list(case.checked),
        "not_checked": dict(case.skipped),
        "assumed": list(case.poses.assumed),
        **(result_tree(case) if case.usable else {}),
    }


def result_tree(case: PosedPictures) -> dict[str, Any]:
    """What is kept of a solution: X and Z in metres, radians inside the covariance, and how each pose agrees."""
    found = case.result
    noise, names = found.noise, case.pictures or [None] * len(found.used)
    return {
        "arrangement": ARRANGEMENTS[found.eye_to_hand],
        found.x_name: _pose_tree(found.mount_from_cam, found.known),
        "covariance": [[float(x) for x in row] for row in _covariance(found)],
        "covariance_of": "rotation about x, y, z in radians, then translation in metres, in the frame X leads to",
        "sigma_m": [float(s) if known else None for s, known in zip(found.translation_sigma, found.known, strict=True)],
        "sigma_deg": [float(s) for s in np.degrees(found.rotation_sigma)],
        "sigmas_of_95_percent": found.times_sigma,
        "unknown_directions": [[float(x) for x in each] for each in found.unknown_directions],
        found.z_name: _pose_tree(found.other_from_board, found.known if len(found.unknown_directions) == 0 else None),
        **({"scale": _scale_tree(case)} if case.any_scale else {}),
        "robot_errors": {"mm": 1000 * noise.shift, "deg": float(np.degrees(noise.turn))} if noise else None,
        "corner_noise_px": noise.px if noise else None,
        "rms_px": found.rms_px,
        "poses": [
            {"picture": name, "used": bool(used), "off_mm": _number(1000 * off)}
            for name, used, off in zip(names, found.used, found.displacements, strict=True)
        ],
    }


def _number(value: float) -> float | None:
    return float(value) if np.isfinite(value) else None


def _pose_tree(pose: RigidTransform, known: Mask | None) -> dict[str, Any]:
    """A pose; what of its translation is not known is null, and then there is no matrix. None: nothing of it is."""
    told = np.zeros(3, bool) if known is None else known
    tree: dict[str, Any] = {
        "quaternion_xyzw": [float(x) for x in pose.rotation.as_quat()],
        "translation_m": [float(x) if each else None for x, each in zip(pose.translation, told, strict=True)],
    }
    return tree | ({"matrix": as_rows(pose)} if all(told) else {})


def _covariance(found: HandEye) -> Array:
    """Of X's rotation and translation (6, 6)."""
    from camviz_clinic.calibration.jacobian import twist_jacobian

    carried = np.eye(6)
    carried[3:, :] = twist_jacobian(np.asarray(found.mount_from_cam.translation))
    return np.asarray(carried @ found.covariance[:6, :6] @ carried.T)


def _place(found: HandEye) -> str:
    told = [
        f"{axis} = {1000 * at:.2f} ± {1000 * sigma:.2f}" if known else f"{axis} is not known"
        for axis, at, sigma, known in zip(
            "xyz", found.mount_from_cam.translation, found.translation_sigma, found.known, strict=True
        )
    ]
    mount = "base" if found.eye_to_hand else "hand"
    return f"the camera stands at {', '.join(told)} mm in the {mount}'s frame."


def _turn(found: HandEye) -> str:
    vector = found.mount_from_cam.rotation.as_rotvec(degrees=True)
    turn = ", ".join(f"{x:.3f}" for x in vector)
    sigma = ", ".join(f"{x:.3f}" for x in np.degrees(found.rotation_sigma))
    quaternion = ", ".join(f"{x:.6f}" for x in found.mount_from_cam.rotation.as_quat())
    return f"rotation vector ({turn})°, known to ±({sigma})° about x, y, z; quaternion x, y, z, w ({quaternion})."


def _board(found: HandEye) -> str:
    other = "hand" if found.eye_to_hand else "base"
    if len(found.unknown_directions):
        return "how far the board reaches along the same direction is not known either."
    place = ", ".join(
        f"{axis} = {1000 * at:.2f} ± {1000 * sigma:.2f}"
        for axis, at, sigma in zip(
            "xyz", found.other_from_board.translation, found.board_translation_sigma, strict=True
        )
    )
    return f"the board's first corner lies at {place} mm in the {other}'s frame."


def _scale(case: PosedPictures) -> str:
    found, side = case.result, 1000 * case.board.square_size
    if not found.scale_known:
        return "not known. The hand must move to other places, and not only turn about one."
    times, sigma = found.scale, found.scale_sigma
    return (
        f"{times:.4f} ± {sigma:.4f}. In the robot's unit, which is that of all places told here, the board is so many "
        f"times as large as told: {side * times:.3f} ± {side * sigma:.3f} mm in place of {side:.3f} mm."
    )


def _scale_tree(case: PosedPictures) -> dict[str, Any] | None:
    """By what the board's lengths as told are multiplied to be in the robot's unit; None where it is not known."""
    found, side = case.result, 1000 * case.board.square_size
    if not found.scale_known:
        return None
    return {
        "factor": found.scale,
        "sigma": found.scale_sigma,
        "of": "lengths of the board as told, to be in the unit of the robot's poses",
        "square_mm": side * found.scale,
        "square_sigma_mm": side * found.scale_sigma,
    }


def _fit(found: HandEye) -> str:
    used = f"{int(found.used.sum())} of {len(found.used)} poses used"
    turned = ", ".join(f"{x:.1f}°" for x in found.motions.turning.deg)
    said = f"{used}; the hand turned by {turned} (RMS) about its main axes"
    if found.noise is None:
        return f"{said}."
    return (
        f"{said}. The robot's own errors are {1000 * found.noise.shift:.2g} mm along and "
        f"{np.degrees(found.noise.turn):.2g}° about each axis, the pictures' {found.noise.px:.2g} px; by the robot's "
        f"poses corners are {found.rms_px:.2g} px off (RMS)."
    )
