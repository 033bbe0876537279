"""Whether transforms point the right way, axes are OpenCV's, and both cameras of a pair count the corners alike."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from camviz.cameras import Camera
from camviz.poses import RigidTransform, Rotation
from camviz_clinic.calibration.solving import ANOTHER_WAY_DEG
from camviz_clinic.calibration.types import Board, Calibration
from camviz_clinic.checks import virtual
from camviz_clinic.checks.evidence import Evidence, NotChecked
from camviz_clinic.checks.registry import VIEW_BY_VIEW, Finding, Kind, Rng, finding
from camviz_clinic.checks.rig import FLIPPED, StereoPair, distances, fits_better, lone_poses
from camviz_clinic.checks.virtual import healthy, healthy_pair

AGAIN_DEG = 10.0


@dataclass(frozen=True)
class Reference:
    """A transform called `name`, as the file has it and as other evidence, its `source`, has it."""

    name: str
    ours: RigidTransform
    other: RigidTransform
    source: str


def references(evidence: Evidence) -> Iterator[Reference]:
    """The transforms of a file of which something else tells, too."""
    for pair in evidence.pairs:
        if pair.agreed is not None:
            name = f"{pair.right} from {pair.left}"
            yield Reference(name, pair.right_from_left, pair.agreed, "the boards that both saw")
    if evidence.compare is None:
        return
    ours, others = evidence.calibration, evidence.compare
    for name, camera, other in evidence.matched():
        if _is_placed(camera) or _is_placed(other):
            yield Reference(name, camera.cam_from_world, other.cam_from_world, "the other calibration")
    if ours.world_from_imu is not None and others.world_from_imu is not None:
        yield Reference("the IMU", ours.world_from_imu, others.world_from_imu, "the other calibration")


def _is_placed(camera: Camera) -> bool:
    return not np.allclose(camera.world_from_cam.as_matrix(), np.eye(4), rtol=0, atol=1e-9)


def changed(
    kind: Kind, known: list[Reference], change: Callable[[RigidTransform], RigidTransform], how: str
) -> Iterator[Finding]:
    """One finding where most transforms are right only after the same change."""
    wrong = [each for each in known if fits_better(each.ours, each.other, change)]
    if 2 * len(wrong) > len(known):
        first = wrong[0]
        more = f" (and {len(wrong) - 1} more)" * (len(wrong) > 1)
        sentence = f"{first.name}{more}: the transform agrees with {first.source} only {how}."
        yield kind.found(sentence, float(distances(first.ours, first.other)[0]))


def with_right(solved: Calibration, right_from_left: RigidTransform) -> Calibration:
    """A pair whose right camera stands elsewhere."""
    right = solved.cameras["right"].at(right_from_left.inv())
    return replace(solved, cameras={**solved.cameras, "right": right})


def bare(calibration: Calibration) -> Calibration:
    """Without corners and boards."""
    return replace(calibration, detections={}, cam_from_board={})


@finding(
    "inverted-transform",
    severity="fault",
    view="boards",
    symptom="A transform goes the wrong way round.",
    causes=("left_from_right written for right_from_left", "camera to world written for world to camera"),
    remedy="Invert the transform: R' = Rᵀ, t' = -Rᵀ t.",
    threshold="The inverse fits at least five times better.",
    explains=("rectified-black", "baseline-sign"),
)
def inverted_transform(evidence: Evidence) -> Iterator[Finding]:
    """The check holds the transform and its inverse against the board poses of both cameras, or against the other
    calibration.
    """
    known = list(references(evidence))
    if not known:
        raise evidence.without_pair(
            "it needs boards seen by both cameras of a pair, or another calibration (--compare)"
        )
    yield from changed(inverted_transform, known, RigidTransform.inv, "when it is inverted")


@inverted_transform.fault("inverted transform", "", (1, 2), promised=1)
def inverted(rng: Rng, strength: float) -> Evidence:
    """The transform of the pair is inverted, beside its corners (1) or beside another calibration (2)."""
    solved = healthy_pair(rng)
    wrong = with_right(solved, solved.cameras["right"].world_from_cam)
    return Evidence(wrong) if strength == 1 else Evidence(bare(wrong), solved)


@finding(
    "mirrored-frame",
    severity="fault",
    view="boards",
    symptom="The path of the camera looks mirrored, or boards stand behind the camera.",
    causes=("OpenGL's axes (y up, z backward) taken for OpenCV's (y down, z forward)",),
    remedy="Negate the y and z columns of every camera-to-world matrix.",
    threshold="It is so in the majority of the views.",
    explains=("rectified-black", "baseline-sign"),
)
def mirrored_frame(evidence: Evidence) -> Iterator[Finding]:
    """The check looks for boards behind the camera, and compares the poses with the other calibration. In a
    transforms.json it looks for cameras that look away from each other with their tops down.
    """
    boards = {name: pose for name, pose in evidence.cam_from_board.items() if not pose.single}
    known = list(references(evidence))
    worlds = evidence.calibration.format == "transforms.json" and len(evidence.calibration.cameras) >= 4
    if not boards and not known and not worlds:
        raise NotChecked("it needs poses of boards, another calibration (--compare), or a transforms.json")
    for name, pose in boards.items():
        yield from _behind(evidence, name, pose)
    for change in (lambda pose: FLIPPED * pose * FLIPPED, lambda pose: FLIPPED * pose):
        yield from changed(mirrored_frame, known, change, "when the axes y and z are negated")
    if worlds:
        yield from _outwards(evidence)


def _behind(evidence: Evidence, name: str, poses: RigidTransform) -> Iterator[Finding]:
    board = evidence.calibration.board
    middle = board.corners.mean(axis=0) if board else np.zeros(3)
    depths = np.array([pose.apply(middle)[2] for pose in poses])
    if np.mean(depths < 0) > 0.5:
        sentence = f"{name}: {int(np.sum(depths < 0))} of the {len(depths)} boards are behind the camera (z < 0)."
        yield mirrored_frame.found(sentence, float(np.median(depths)), "m", name)


def _outwards(evidence: Evidence) -> Iterator[Finding]:
    """In nerfstudio's world z is up. Photographs around a thing look at it: their axes meet before the cameras."""
    cameras = list(evidence.calibration.cameras.values())
    poses = RigidTransform.concatenate([camera.world_from_cam for camera in cameras])
    axes, centres = poses.rotation.as_matrix(), poses.translation
    forward, up = axes[:, :, 2], -axes[:, :, 1]
    across = np.eye(3) - forward[:, :, None] * forward[:, None, :]  # Σ (1 - d dᵀ) X = Σ (1 - d dᵀ) c
    meeting = np.linalg.lstsq(across.sum(axis=0), (across @ centres[..., None]).sum(axis=0).ravel(), rcond=None)[0]
    behind = float(np.mean(np.sum((meeting - centres) * forward, axis=1) < 0))
    upside_down = float(np.mean(up[:, 2] < 0))
    if min(behind, upside_down) > 0.5:
        sentence = (
            f"{behind:.0%} of the cameras look away from where their axes meet, and {upside_down:.0%} have their top "
            "down."
        )
        yield mirrored_frame.found(sentence, behind * 100, "%")


@mirrored_frame.fault("OpenGL axes", "", (1, 2), promised=1)
def in_opengl(rng: Rng, strength: float) -> Evidence:
    """The axes are OpenGL's, of the boards (1) or of the pair (2)."""
    if strength == 1:
        solved = healthy(rng)
        poses = {"camera": FLIPPED * solved.cam_from_board["camera"]}
        return Evidence(replace(solved, detections={}, cam_from_board=poses))
    solved = healthy_pair(rng)
    right_from_left = solved.rig.a_from_b("right", "left")
    tilted = RigidTransform.from_rotation(Rotation.from_rotvec([0.1, 0, 0])) * right_from_left
    return Evidence(bare(with_right(solved, FLIPPED * tilted * FLIPPED)), with_right(solved, tilted))


@finding(
    "corner-order",
    severity="fault",
    view="epipolar-pairs",
    symptom="Both cameras are fine, and the pair is wrong.",
    causes=("corners of one camera that run the other way round: a symmetric board has two orders",),
    remedy="Use a board without symmetry (one side odd, the other even), or ChArUco. Turn the order of those views.",
    threshold="A view is more than 45° from the rest, and agrees with them once its order is turned.",
    explains=(
        *VIEW_BY_VIEW,
        "baseline-scale",
        "rectified-black",
    ),
)
def corner_order(evidence: Evidence) -> Iterator[Finding]:
    """The check finds the pair's relative pose from every view, from the corners of each camera alone."""
    stereo = [pair for pair in evidence.pairs if pair.by_view is not None and len(pair.views) > 2]
    if not stereo:
        raise evidence.without_pair("it needs corners of at least three views that both cameras of a pair saw")
    for pair in stereo:
        yield from _other_order(evidence, pair)


def _other_order(evidence: Evidence, pair: StereoPair) -> Iterator[Finding]:
    """Views from which the pair would stand otherwise, unless one camera's corners are counted another way."""
    assert pair.by_view is not None
    angles = _angles_deg(pair, pair.by_view)
    for row in map(int, np.flatnonzero(angles > ANOTHER_WAY_DEG)):
        if _fits_in_another_order(pair, row):
            view = pair.views[row]
            sentence = (
                f"{evidence.picture(pair.right, view)}: the corners of the two cameras run in different orders. "
                f"This view would turn the pair by {angles[row]:.0f}°."
            )
            yield corner_order.found(sentence, angles[row], "°", pair.right, pictures=(view,))


def _angles_deg(pair: StereoPair, right_from_left: RigidTransform) -> NDArray[np.floating]:
    assert pair.agreed is not None
    return np.atleast_1d(np.degrees((right_from_left.rotation * pair.agreed.rotation.inv()).magnitude()))


def _fits_in_another_order(pair: StereoPair, row: int) -> bool:
    board, seen = pair.calibration.board, pair.seen_from_both
    assert board is not None
    assert seen is not None
    left, right = (seen[name][row : row + 1] for name in (pair.left, pair.right))
    board_from_left = lone_poses(pair.cameras[0], board, left).inv()
    turned = (lone_poses(pair.cameras[1], board, right[:, order]) * board_from_left for order in orders(board))
    return any(_angles_deg(pair, each)[0] < AGAIN_DEG for each in turned)


def orders(board: Board) -> list[NDArray[np.intp]]:
    """The other ways to count a board's corners: backwards, and by quarter turns where it is square."""
    index = np.arange(board.columns * board.rows).reshape(board.rows, board.columns)
    turns = (1, 2, 3) if board.columns == board.rows else (2,)
    return [np.rot90(index, turn).ravel() for turn in turns]


@corner_order.fault("order flipped", "views", (1, 2, 3), promised=1)
def other_order(rng: Rng, strength: float) -> Evidence:
    """The right camera's corners are counted backwards."""
    set_up = virtual.pair(rng)
    left, right = set_up.observed(rng)
    views = rng.permutation(len(right))[: round(strength)]
    right[views] = right[views, ::-1]
    return Evidence(set_up.solved((left, right)))
