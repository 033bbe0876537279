"""How the cameras stand to each other: signs, lengths, directions, and the order of the corners in a pair."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray

from camviz.calibration.solving import ANOTHER_WAY_DEG
from camviz.calibration.types import Board
from camviz.cameras import Camera
from camviz.clinic.catalogue import Finding, Lacking, Outcome, found
from camviz.clinic.evidence import Evidence
from camviz.clinic.rig import (
    FLIPPED,
    OWN_UNIT,
    Pair,
    distances,
    fits_better,
    lone_poses,
    references,
)
from camviz.poses import RigidTransform
from camviz.twoview import RectifiedPair, rectify

MUCH_BETTER = 5.0  # how many times closer a changed transform must be to what is known
LENGTHS = (0.001, 10.0)  # metres between which the baseline of a pair is not worth a word
SQUARES = (0.0005, 0.5)  # the same for the side of a square
SAME_LENGTH = 0.02
BLACK = 0.4  # of a rectified picture
TURNED_DEG = 35.0
AGAIN_DEG = 10.0
NO_PAIR = Lacking("the file holds no stereo pair")


def baseline_sign(evidence: Evidence) -> Outcome:
    """t.x of right_from_left, where the file says which camera is the left one."""
    of_file = [fault for fault in evidence.calibration.faults if fault.id == "baseline-sign"]
    declared = [pair for pair in evidence.pairs if pair.declared and _length(pair) > 0]
    if not declared and not of_file:
        return Lacking("the file does not say where a left and a right camera stand")
    findings = [found("baseline-sign", f"{fault}.", fault.value, "m") for fault in of_file]
    for pair in declared:
        t = pair.right_from_left.translation
        if t[0] > 0 and abs(t[0]) == np.abs(t).max() and not _explained(evidence, pair):
            sentence = f"{pair.title}: the right camera stands {t[0]:.4g} m to the left of the left one (t.x > 0)."
            findings.append(found("baseline-sign", sentence, t[0], "m", pair.right))
    return findings


def _explained(evidence: Evidence, pair: Pair) -> bool:
    """Whether the boards show that the transform is inverted, rather than the cameras swapped."""
    return pair.agreed is not None and fits_better(pair.right_from_left, pair.agreed, _inverted, MUCH_BETTER)


def _inverted(pose: RigidTransform) -> RigidTransform:
    return pose.inv()


def _in_opengl(pose: RigidTransform) -> RigidTransform:
    return FLIPPED * pose * FLIPPED


def _flipped_camera(pose: RigidTransform) -> RigidTransform:
    return FLIPPED * pose


def baseline_scale(evidence: Evidence) -> Outcome:
    """Baselines against the boards that both cameras saw, another calibration, and the size of things."""
    board, own_unit = evidence.calibration.board, evidence.calibration.format in OWN_UNIT
    stereo = [] if own_unit else [pair for pair in evidence.pairs if _length(pair) > 0]
    if board is None and not stereo:
        return Lacking("the file holds neither a board nor a stereo pair in metres")
    findings = [*_square(board, evidence.board)] if board is not None else []
    for pair in stereo:
        finding = _baseline(evidence, pair)
        findings += [finding] if finding else []
    return findings


def _length(pair: Pair) -> float:
    return float(np.linalg.norm(pair.right_from_left.translation))


def _square(board: Board, known: Board | None) -> Iterator[Finding]:
    if known is not None and abs(np.log(board.square_size / known.square_size)) > SAME_LENGTH:
        ratio = board.square_size / known.square_size
        sentence = (
            f"The file takes the side of a square for {board.square_size:.4g} m, it is {known.square_size:.4g} m: all "
            f"lengths are {ratio:.4g} times what they should be."
        )
        yield found("baseline-scale", sentence, ratio, "times")
        return
    if not SQUARES[0] <= board.square_size <= SQUARES[1]:
        likely = board.square_size / 1000 if board.square_size > 1 else board.square_size * 1000
        sentence = (
            f"The board's squares measure {board.square_size:.4g} m, and all lengths go with them; "
            f"were they meant to be {likely * 1000:.4g} mm?"
        )
        yield found("baseline-scale", sentence, board.square_size, "m")


def _baseline(evidence: Evidence, pair: Pair) -> Finding | None:
    """The first evidence that speaks, the strongest first."""
    length = _length(pair)
    for known, said in _known_lengths(evidence, pair):
        if abs(np.log(length / known)) > SAME_LENGTH:
            sentence = (
                f"{pair.title}: the baseline is {length:.4g} m long, {length / known:.4g} times the {known:.4g} m of "
                f"{said}."
            )
            return found("baseline-scale", sentence, length / known, "times", pair.right)
    if not LENGTHS[0] <= length <= LENGTHS[1]:
        unit = "millimetres" if length > 1 else "kilometres"
        sentence = f"{pair.title}: the baseline is {length:.4g} m long, as if {unit} had been taken for metres."
        return found("baseline-scale", sentence, length, "m", pair.right)
    return None


def _known_lengths(evidence: Evidence, pair: Pair) -> Iterator[tuple[float, str]]:
    if pair.agreed is not None and pair.by_view is not None:
        lengths = np.linalg.norm(np.atleast_2d(pair.by_view.translation), axis=1)
        yield float(np.median(lengths)), "the boards that both saw"
    if evidence.compare is not None:
        others = {name: other for name, _, other in evidence.matched()}
        if {pair.left, pair.right} <= set(others):
            length = float(np.linalg.norm(others[pair.left].centre - others[pair.right].centre))
            if length > 0:
                yield length, "the other calibration"


def rectified_black(evidence: Evidence) -> Outcome:
    """Where the pixels of the rectified pictures come from, and how far rectification turns the cameras."""
    stereo = [pair for pair in evidence.pairs if _length(pair) > 0]
    if not stereo:
        return NO_PAIR
    return [finding for pair in stereo for finding in _rectified(pair)]


def _rectified(pair: Pair) -> Iterator[Finding]:
    if np.abs(pair.right_from_left.translation).argmax() == 1:
        return  # one above the other: rectified along the columns, which is another matter
    try:
        rectified = rectify(*pair.cameras)
    except ValueError as error:
        yield found("rectified-black", f"{pair.title}: the pair cannot be rectified: {error}.", None, "", pair.right)
        return
    black = max(black_share(rectified, side) for side in ("left", "right"))
    turn_of = rectified.left_original.world_from_cam.rotation.inv() * rectified.left.world_from_cam.rotation
    turn = float(np.degrees(turn_of.magnitude()))
    if black > BLACK:
        sentence = f"{pair.title}: {black:.0%} of a rectified picture have no original."
        yield found("rectified-black", sentence, black * 100, "%", pair.right)
    elif turn > TURNED_DEG:
        sentence = f"{pair.title}: rectification turns the cameras by {turn:.0f}°."
        yield found("rectified-black", sentence, turn, "°", pair.right)


def black_share(rectified: RectifiedPair, side: str, samples: int = 48) -> float:
    """The share of a rectified picture's pixels that the original camera does not show."""
    camera: Camera = getattr(rectified, side)
    original: Camera = getattr(rectified, f"{side}_original")
    grid = camera.intrinsics
    u, v = np.meshgrid(np.linspace(0, grid.width - 1, samples), np.linspace(0, grid.height - 1, samples))
    rays = camera.unproject(np.stack([u, v], axis=-1))
    pixels = original.at(RigidTransform.from_rotation(original.world_from_cam.rotation)).project(rays)
    return float(1 - original.intrinsics.contains(pixels).mean())


def inverted_transform(evidence: Evidence) -> Outcome:
    """Each transform, and its inverse, against what else is known of it."""
    known = list(references(evidence))
    if not known:
        return Lacking("it needs boards seen by both cameras of a pair, or another calibration (--compare)")
    wrong = [each for each in known if fits_better(each[1], each[2], _inverted, MUCH_BETTER)]
    return _changed("inverted-transform", wrong, len(known), "when it is inverted")


def mirrored_frame(evidence: Evidence) -> Outcome:
    """Boards behind the camera; transforms that fit with y and z negated; cameras that look outwards, upside down."""
    boards = {name: pose for name, pose in evidence.cam_from_board.items() if not pose.single}
    known = list(references(evidence))
    worlds = evidence.calibration.format == "transforms.json" and len(evidence.calibration.cameras) >= 4
    if not boards and not known and not worlds:
        return Lacking("it needs poses of boards, another calibration (--compare), or a transforms.json")
    findings = [finding for name, pose in boards.items() for finding in _behind(evidence, name, pose)]
    for change in (_in_opengl, _flipped_camera):
        wrong = [each for each in known if fits_better(each[1], each[2], change, MUCH_BETTER)]
        findings += _changed("mirrored-frame", wrong, len(known), "when the axes y and z are negated")
    return findings + [*_outwards(evidence)] * worlds


def _changed(
    id: str, wrong: list[tuple[str, RigidTransform, RigidTransform, str]], count: int, how: str
) -> list[Finding]:
    """One finding where most transforms are wrong in the same way."""
    if not 2 * len(wrong) > count:
        return []
    name, ours, other, source = wrong[0]
    more = f" (and {len(wrong) - 1} more)" * (len(wrong) > 1)
    off = float(distances(ours, other)[0])
    sentence = f"{name}{more}: the transform agrees with {source} only {how}."
    return [found(id, sentence, off, "", None)]


def _behind(evidence: Evidence, name: str, poses: RigidTransform) -> Iterator[Finding]:
    board = evidence.calibration.board
    middle = board.corners.mean(axis=0) if board else np.zeros(3)
    depths = np.array([pose.apply(middle)[2] for pose in poses])
    if np.mean(depths < 0) > 0.5:
        sentence = f"{name}: {int(np.sum(depths < 0))} of the {len(depths)} boards are behind the camera (z < 0)."
        yield found("mirrored-frame", sentence, float(np.median(depths)), "m", name)


def _outwards(evidence: Evidence) -> Iterator[Finding]:
    """In nerfstudio's world z is up. Photographs around a thing look at it: their axes meet before the cameras."""
    cameras = list(evidence.calibration.cameras.values())
    poses = RigidTransform.concatenate([camera.world_from_cam for camera in cameras])
    axes, centres = poses.rotation.as_matrix(), poses.translation
    forward, up = axes[:, :, 2], -axes[:, :, 1]
    across = np.eye(3) - forward[:, :, None] * forward[:, None, :]  # Σ (1 - d dᵀ) X = Σ (1 - d dᵀ) c
    meeting = np.linalg.lstsq(across.sum(axis=0), (across @ centres[..., None]).sum(axis=0).ravel(), rcond=None)[0]
    behind = float(np.mean(np.sum((meeting - centres) * forward, axis=1) < 0))
    inverted = float(np.mean(up[:, 2] < 0))
    if min(behind, inverted) > 0.5:
        sentence = (
            f"{behind:.0%} of the cameras look away from where their axes meet, and {inverted:.0%} have their top down."
        )
        yield found("mirrored-frame", sentence, behind * 100, "%")


def corner_order(evidence: Evidence) -> Outcome:
    """Views from which the pair would stand quite otherwise, unless one camera's corners are counted another way."""
    stereo = [pair for pair in evidence.pairs if pair.by_view is not None and len(pair.views) > 2]
    if not stereo:
        return Lacking("it needs corners of at least three views that both cameras of a pair saw")
    return [finding for pair in stereo for finding in _other_order(evidence, pair)]


def _other_order(evidence: Evidence, pair: Pair) -> Iterator[Finding]:
    board, seen, by_view, agreed = evidence.calibration.board, pair.seen_from_both, pair.by_view, pair.agreed
    assert board is not None
    assert seen is not None
    assert by_view is not None
    assert agreed is not None
    angles = np.degrees((by_view.rotation * agreed.rotation.inv()).magnitude())
    for row in np.flatnonzero(angles > ANOTHER_WAY_DEG):
        left, right = (seen[name][row : row + 1] for name in (pair.left, pair.right))
        left_pose = lone_poses(pair.cameras[0], board, left)
        for order in orders(board):
            turned = lone_poses(pair.cameras[1], board, right[:, order]) * left_pose.inv()
            if np.degrees((turned.rotation * agreed.rotation.inv()).magnitude())[0] < AGAIN_DEG:
                view = pair.views[row]
                sentence = (
                    f"{evidence.picture(pair.right, view)}: the corners of the two cameras run in different orders; by "
                    f"this view the pair would be turned by {angles[row]:.0f}°."
                )
                yield found("corner-order", sentence, angles[row], "°", pair.right, pictures=(view,))
                break


def orders(board: Board) -> list[NDArray[np.intp]]:
    """The other ways to count a board's corners: backwards, and by quarter turns where it is square."""
    index = np.arange(board.columns * board.rows).reshape(board.rows, board.columns)
    turns = (1, 2, 3) if board.columns == board.rows else (2,)
    return [np.rot90(index, turn).ravel() for turn in turns]
