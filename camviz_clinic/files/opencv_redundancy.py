"""What an OpenCV file of a pair says twice: E, F, R1, R2, P1, P2 and Q follow from K1, K2, R and T."""

from __future__ import annotations

from collections.abc import Iterator, Mapping

import numpy as np

from camviz.cameras import Camera
from camviz.lenses.base import Array
from camviz.twoview import decompose_essential
from camviz_clinic.calibration.redundancy import Redundancy, between_directions, between_rotations, compared, share
from camviz_clinic.calibration.types import CalibrationError
from camviz_clinic.files.redundant import is_rotation
from camviz_clinic.files.section import Section

SHAPES = {
    **dict.fromkeys(("R", "R1", "R2", "E", "F"), (3, 3)),
    **dict.fromkeys(("P1", "P2"), (3, 4)),
    "T": (3, 1),
    "Q": (4, 4),
}
POSES_DEG = 0.1  # R1 and R2 that agree with R so well as poses are not a rectification


def redundancies(section: Section, keys: Mapping[str, str], left: Camera, right: Camera) -> Iterator[Redundancy]:
    """Each of the matrices beside those that it follows from; `keys` has the spelling of those that the file holds.

    The formulas are those of cv2.stereoCalibrate and cv2.stereoRectify.
    """
    held = {}
    for name, key in keys.items():
        if (matrix := _matrix(section, key, SHAPES[name])) is not None:
            held[name] = matrix
    for rule in (_essential, _rectification, _projection, _depth):
        yield from rule(held, keys, left, right)


def _matrix(section: Section, key: str, shape: tuple[int, int]) -> Array | None:
    """The matrix under a key; None where something else stands there, such as a focal length under f."""
    if not isinstance(section.values[key], (dict, list)):
        return None
    try:
        return section.array(key).reshape(shape)
    except (CalibrationError, ValueError):
        return None


Held = Mapping[str, Array]
Keys = Mapping[str, str]


def _essential(held: Held, keys: Keys, left: Camera, right: Camera) -> Iterator[Redundancy]:
    """E = [T]× R, and F = K2⁻ᵀ E K1⁻¹."""
    if not _moves(held):
        return
    R, T = held["R"], held["T"]
    if _has_rank_two(held.get("E")):
        yield compared(keys["E"], f"{keys['R']} and {keys['T']}", _motion_apart, held["E"], R, T)
    if _has_rank_two(held.get("F")):
        said = f"the camera matrices, {keys['R']} and {keys['T']}"

        def apart(F: Array, K1: Array, K2: Array, R: Array, T: Array) -> dict[str, Array]:
            return _motion_apart(K2.T @ F @ K1, R, T)

        yield compared(keys["F"], said, apart, held["F"], left.intrinsics.K, right.intrinsics.K, R, T)


def _motion_apart(E: Array, R: Array, T: Array) -> dict[str, Array]:
    """How far R and the direction of T (either way) are from the nearest motion that E has, in degrees (6,)."""
    motions = ((motion.rotation.as_matrix(), motion.translation) for motion in decompose_essential(E))
    apart = [
        np.concatenate([between_rotations(turn, R)["°"], between_directions(way, T[:, 0])["°"]])
        for turn, way in motions
    ]
    return {"°": min(apart, key=lambda each: float(np.linalg.norm(each)))}


def _rectification(held: Held, keys: Keys, *_: Camera) -> Iterator[Redundancy]:
    """R = R2ᵀ R1."""
    if not _is_rectified(held):
        return
    said = f"{keys['R1']} and {keys['R2']}"
    yield compared(
        keys["R"], said, lambda R, R1, R2: between_rotations(R, R2.T @ R1), held["R"], held["R1"], held["R2"]
    )


def _projection(held: Held, keys: Keys, *_: Camera) -> Iterator[Redundancy]:
    """P2 = K [1 | R2 T], and P1 has the same focal lengths and rows (or columns, of a pair one above the other)."""
    if not {"P1", "P2"} <= held.keys() or not (_is_projection(held["P1"]) and _is_projection(held["P2"])):
        return
    shift = _shift(held["P2"])
    if not np.any(shift):
        return
    row = 1 - int(np.argmax(np.abs(shift[:2])))
    yield compared(
        keys["P2"], keys["P1"], lambda P2, P1: {"px": (P2 - P1)[[0, 1, row], [0, 1, 2]]}, held["P2"], held["P1"]
    )
    if _is_rectified(held) and _moves(held):
        said = f"{keys['R2']} and {keys['T']}"
        yield compared(keys["P2"], said, _shift_apart, held["P2"], held["R2"], held["T"])


def _shift_apart(P2: Array, R2: Array, T: Array) -> dict[str, Array]:
    by_matrix, by_pose = _shift(P2), (R2 @ T)[:, 0]
    return between_directions(by_matrix, by_pose) | share(np.linalg.norm(by_matrix), np.linalg.norm(by_pose))


def _depth(held: Held, keys: Keys, *_: Camera) -> Iterator[Redundancy]:
    """Q has -cx, -cy and f of P1, and -1 over the baseline of P2."""
    if not {"P1", "P2", "Q"} <= held.keys() or not (_is_projection(held["P1"]) and _is_projection(held["P2"])):
        return
    Q, P1, P2 = held["Q"], held["P1"], held["P2"]
    yield compared(keys["Q"], keys["P1"], lambda Q, P1: {"px": _grid(Q) - P1[[0, 0, 1], [0, 2, 2]]}, Q, P1)
    if Q[3, 2] and np.any(_shift(P2)):
        yield compared(keys["Q"], keys["P2"], lambda Q, P2: share(1 / abs(Q[3, 2]), np.linalg.norm(_shift(P2))), Q, P2)


def _grid(Q: Array) -> Array:
    return np.array([Q[2, 3], -Q[0, 3], -Q[1, 3]])


def _shift(P: Array) -> Array:
    """t (3,) of P = K [1 | t]."""
    return np.asarray(np.linalg.solve(P[:, :3], P[:, 3]))


def _moves(held: Held) -> bool:
    return {"R", "T"} <= held.keys() and is_rotation(held["R"]) and bool(np.any(held["T"]))


def _has_rank_two(matrix: Array | None) -> bool:
    return matrix is not None and np.linalg.matrix_rank(matrix) >= 2


def _is_projection(P: Array) -> bool:
    """Whether P is K [1 | t], of a rectified camera, with a K that can be inverted."""
    return P[0, 0] > 0 and P[1, 1] > 0 and np.allclose(P[[1, 2, 2, 2], [0, 0, 1, 2]], [0, 0, 0, 1], rtol=0, atol=1e-6)


def _is_rectified(held: Held) -> bool:
    """Whether R1 and R2 turn the cameras into the rectified frame; elsewhere they are poses, with R = R2 R1ᵀ."""
    if not {"R", "R1", "R2"} <= held.keys() or not all(is_rotation(held[name]) for name in ("R", "R1", "R2")):
        return False
    R, R1, R2 = (held[name] for name in ("R", "R1", "R2"))
    as_poses, rectified = (_angle(R, each) for each in (R2 @ R1.T, R2.T @ R1))
    return rectified <= as_poses or as_poses > POSES_DEG


def _angle(one: Array, other: Array) -> float:
    return float(np.linalg.norm(between_rotations(one, other)["°"]))
