"""How the cameras of a pair stand to each other: the sign and length of the baseline, and the rectified pictures."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import numpy as np

from camviz.cameras import Camera
from camviz.poses import RigidTransform, Rotation
from camviz.twoview import RectifiedPair, rectify
from camviz_clinic.calibration.types import Board, Calibration
from camviz_clinic.checks import virtual
from camviz_clinic.checks.evidence import Evidence, NotChecked
from camviz_clinic.checks.findings.file import named
from camviz_clinic.checks.pair_difference import pair_differences
from camviz_clinic.checks.registry import WRONG_NUMBERS, Finding, Rng, finding
from camviz_clinic.checks.rig import OWN_UNIT, StereoPair, corner_errors, fits_better, lone_poses, middlemost
from camviz_clinic.checks.virtual import healthy_pair

LENGTHS = (0.001, 10.0)  # metres between which the baseline of a pair is not worth a word
SQUARES = (0.0005, 0.5)  # the same for the side of a square
SAME_LENGTH = 0.02
UNITS = {"metres": 1.0, "feet": 0.3048, "inches": 0.0254, "centimetres": 0.01, "millimetres": 0.001}  # in metres
TAKEN_FOR = ("metres", "millimetres", "centimetres")  # what programs and options ask for, the commonest first
EXCHANGED_TIMES = 1.05  # by which the median error of the corners falls in both cameras, with the other camera's lens
OTHER_CALIBRATION = "the other calibration"
BLACK = 0.4  # of a rectified picture
TURNED_DEG = 35.0


@finding(
    "baseline-sign",
    severity="fault",
    view="boards",
    symptom="The baseline has the wrong sign.",
    causes=("a left and a right camera that were swapped",),
    remedy="Exchange the names left and right, with their pictures.",
    threshold="t.x is above 0 and the larger part of the baseline.",
    explains=("rectified-black",),
)
def baseline_sign(evidence: Evidence) -> Iterator[Finding]:
    """The check reads t.x of right_from_left. It is negative when the right camera stands on the right."""
    of_file = named(evidence, "baseline-sign")
    declared = [pair for pair in evidence.pairs if pair.declared and pair.baseline > 0]
    if not declared and not of_file:
        raise evidence.without_pair("the file does not say where a left and a right camera stand")
    for fault in of_file:
        yield baseline_sign.found(f"{fault}.", fault.value, "m")
    for pair in declared:
        t = pair.right_from_left.translation
        if t[0] > 0 and abs(t[0]) == np.abs(t).max() and not _is_inverted(pair):
            sentence = f"{pair.title}: the right camera stands {t[0]:.4g} m to the left of the left one (t.x > 0)."
            yield baseline_sign.found(sentence, t[0], "m", pair.right)


def _is_inverted(pair: StereoPair) -> bool:
    """Whether the boards show that the transform is inverted, rather than the cameras swapped."""
    return pair.agreed is not None and fits_better(pair.right_from_left, pair.agreed, RigidTransform.inv)


def _exchanged(rng: Rng, strength: float) -> Evidence:
    """Left is right, and the file has no corners."""
    left, right = healthy_pair(rng).cameras.values()
    return Evidence(Calibration({"left": right, "right": left}, Path("virtual"), "OpenCV FileStorage, stereo"))


swapped = baseline_sign.fault("swapped cameras", "", (1,), promised=1)(_exchanged)


@finding(
    "baseline-scale",
    severity="fault",
    view="boards",
    symptom="The baseline has the wrong length.",
    causes=("one unit of length taken for another", "another side of a square in one of the solutions"),
    remedy="Scale all translations, or solve again with the side of the board's squares as measured (--square-mm).",
    threshold="The baseline is 2 % off other evidence, above 10 m or below 1 mm. A unit is named within 2 % of its "
    "ratio. Or a square is above half a metre or below half a millimetre.",
)
def baseline_scale(evidence: Evidence) -> Iterator[Finding]:
    """The check compares the baseline with its measured length, with the board poses of the same file, with the other
    calibration, and with the size of things.
    """
    board, own_unit = evidence.calibration.board, evidence.calibration.format in OWN_UNIT
    stereo = [] if own_unit else [pair for pair in evidence.pairs if pair.baseline > 0]
    if board is None and not stereo:
        raise NotChecked("the file holds neither a board nor a stereo pair in metres")
    if board is not None:
        yield from _square(board, evidence.board)
    for pair in stereo:
        yield from _baseline(evidence, pair)


def _square(board: Board, known: Board | None) -> Iterator[Finding]:
    side = board.square_size
    if known is not None and abs(np.log(side / known.square_size)) > SAME_LENGTH:
        ratio = side / known.square_size
        sentence = (
            f"All lengths are {ratio:.4g} times what they should be: the file takes the side of a square for "
            f"{side:.4g} m, and it is {known.square_size:.4g} m."
        )
        yield baseline_scale.found(sentence, ratio, "times")
    elif not SQUARES[0] <= side <= SQUARES[1]:
        likely = side / 1000 if side > 1 else side * 1000
        sentence = (
            f"The board's squares measure {side:.4g} m, and all lengths go with them. "
            f"Were they meant to be {likely * 1000:.4g} mm?"
        )
        yield baseline_scale.found(sentence, side, "m")


def _baseline(evidence: Evidence, pair: StereoPair) -> Iterator[Finding]:
    """The first evidence that speaks, the strongest first."""
    length = pair.baseline
    for known, said in _known_lengths(evidence, pair):
        ratio = length / known
        if abs(np.log(ratio)) > SAME_LENGTH:
            yield _other_unit(pair, known, said) or _other_length(evidence, pair, known, said)
            return
    if not LENGTHS[0] <= length <= LENGTHS[1]:
        unit = "millimetres" if length > 1 else "kilometres"
        sentence = f"{pair.title}: the baseline is {length:.4g} m long, as if {unit} had been taken for metres."
        yield baseline_scale.found(sentence, length, "m", pair.right)


def _other_unit(pair: StereoPair, known: float, said: str) -> Finding | None:
    """The baseline beside a known length in metres, where their ratio is that of two units."""
    ratio = pair.baseline / known
    units = confused_units(ratio)
    if units is None:
        return None
    cause = f"{units[0]} taken for {units[1]}"
    sentence = (
        f"{pair.title}: the baseline is {pair.baseline:.4g} m long, {ratio:.4g} times the {known:.4g} m of {said}. "
        f"{units[0].capitalize()} were taken for {units[1]}."
    )
    remedy = f"Divide all translations by {ratio:.4g}, or solve again with the side of a square in mm (--square-mm)."
    return baseline_scale.found(sentence, ratio, "times", pair.right, causes=(cause,), remedy=remedy)


def confused_units(ratio: float) -> tuple[str, str] | None:
    """The unit that lengths have, and the one they were taken for, where they are so many times too long."""
    for taken_for in TAKEN_FOR:
        for unit, size in UNITS.items():
            if unit != taken_for and abs(np.log(ratio * size / UNITS[taken_for])) < SAME_LENGTH:
                return unit, taken_for
    return None


def _other_length(evidence: Evidence, pair: StereoPair, known: float, said: str) -> Finding:
    """The baseline beside a known length in metres, from which no unit leads to it."""
    off, ratio = 1000 * (pair.baseline - known), pair.baseline / known
    sentence = (
        f"{pair.title}: the baseline is {1000 * pair.baseline:.4g} mm, {abs(off):.2g} mm ({abs(ratio - 1):.1%}) "
        f"{'longer' if off > 0 else 'shorter'} than the {1000 * known:.4g} mm of {said}."
    )
    if said != OTHER_CALIBRATION:
        remedy = f"Multiply all translations by {1 / ratio:.5g}, or solve again with the side of a square as measured."
        causes = ("another side of a square than the board has", "cameras that were moved")
        return baseline_scale.found(sentence, ratio, "times", pair.right, causes=causes, remedy=remedy)
    depths = [each.depth_sentence for each in pair_differences(evidence) if each.pair == pair.title]
    remedy = f"Measure the baseline and give it (--baseline-mm). One of the two must be scaled {1 / ratio:.5g} times."
    causes = ("another side of a square in one of the two solutions", "cameras that were moved between the two")
    sentence = " ".join([sentence, *depths])
    return baseline_scale.found(sentence, ratio, "times", pair.right, causes=causes, remedy=remedy)


def _known_lengths(evidence: Evidence, pair: StereoPair) -> Iterator[tuple[float, str]]:
    if evidence.baseline is not None:
        yield evidence.baseline, "the measured one"
    if pair.agreed is not None and pair.by_view is not None:
        lengths = np.linalg.norm(np.atleast_2d(pair.by_view.translation), axis=1)
        yield float(np.median(lengths)), "the boards that both saw"
    others = {name: other for name, _, other in evidence.matched()}
    if {pair.left, pair.right} <= set(others):
        length = float(np.linalg.norm(others[pair.left].centre - others[pair.right].centre))
        if length > 0:
            yield length, OTHER_CALIBRATION


@baseline_scale.fault("two baselines", "%", (1, 3, 10), promised=3)
def two_baselines(rng: Rng, strength: float) -> Evidence:
    """The baseline is longer than in another calibration, and the file has no corners."""
    solved = healthy_pair(rng)
    right = solved.cameras["right"]
    pose = right.world_from_cam
    moved = RigidTransform.from_components(pose.translation * (1 + strength / 100), pose.rotation)
    cameras = {**solved.cameras, "right": right.at(moved)}
    return Evidence(Calibration(cameras, Path("virtual"), "OpenCV FileStorage, stereo"), solved)


@baseline_scale.fault("square in millimetres", "times itself", (1000,), promised=1000)
def square_in_millimetres(rng: Rng, strength: float) -> Evidence:
    """The square is taken for so many times itself."""
    set_up = virtual.pair(rng)
    return Evidence(set_up.solved(set_up.observed(rng), square=strength))


@baseline_scale.fault("wrong square", "%", (0.5, 4, 20), promised=4)
def wrong_square(rng: Rng, strength: float) -> Evidence:
    """The square is wrong, beside a calibration with the right one."""
    set_up = virtual.pair(rng)
    good, bad = (set_up.solved(set_up.observed(rng), square=1 + off / 100) for off in (0, strength))
    return Evidence(bad, good)


@finding(
    "sides-exchanged",
    severity="fault",
    view="epipolar-pairs",
    symptom="Left and right are exchanged.",
    causes=("camera matrices written in the other order", "folders of pictures given in the other order"),
    remedy="Exchange the two camera matrices with their distortion, or the two folders of pictures.",
    threshold="With the other camera's lens the corners of both cameras fit 1.05 times better (median).",
    explains=(
        *WRONG_NUMBERS,
        *("parallel-boards", "focal-uncertain", "unidentifiable", "rolling-shutter", "half-pixel", "board-warp"),
        *("baseline-sign", "baseline-scale", "rectified-black", "inverted-transform", "corner-order", "aspect"),
    ),
)
def sides_exchanged(evidence: Evidence) -> Iterator[Finding]:
    """The check fits every pose of the board to the corners of one camera alone, with its own lens and with that of the
    other camera. The transform of the pair tells whether the lenses or the pictures are exchanged.
    """
    stereo = [pair for pair in evidence.pairs if pair.seen_from_both is not None]
    if not stereo:
        raise evidence.without_pair("it needs corners of a board that both cameras of a pair saw")
    for pair in stereo:
        yield from _exchanged_sides(pair)


def _exchanged_sides(pair: StereoPair) -> Iterator[Finding]:
    left, right = pair.cameras
    board, seen, alone = pair.calibration.board, pair.seen_from_both, pair.alone
    assert board is not None
    assert seen is not None
    assert alone is not None
    corners, names = [seen[pair.left], seen[pair.right]], (pair.left, pair.right)
    crossed = [lone_poses(camera, board, each) for camera, each in zip((right, left), corners, strict=True)]
    own, other = (
        [float(np.nanmedian(corner_errors(*each, board))) for each in zip(cameras, poses, corners, strict=True)]
        for cameras, poses in (((left, right), alone), ((right, left), crossed))
    )
    if not all(ours > EXCHANGED_TIMES * theirs for ours, theirs in zip(own, other, strict=True)):
        return
    by_view = crossed[1] * crossed[0].inv()
    of_lenses = by_view[middlemost(by_view)].translation @ pair.right_from_left.translation > 0
    what = "camera matrices" if of_lenses else "pictures"
    sentence = f"{pair.title}: the two {what} are exchanged. With the other camera's lens the corners' error falls" + (
        ";".join(f" from {a:.2g} to {b:.2g} px ({name})" for name, a, b in zip(names, own, other, strict=True))
    )
    keys = "Exchange the two camera matrices, each with its distortion coefficients (M1, D1 and M2, D2)."
    yield sides_exchanged.found(
        f"{sentence}.",
        min(np.divide(own, other)),
        "times",
        causes=sides_exchanged.causes[:: 1 if of_lenses else -1],
        remedy=keys if of_lenses else "Exchange the two folders of pictures, or the corners of the two cameras.",
    )


@sides_exchanged.fault("lenses or pictures exchanged", "", (1, 2), promised=1)
def lenses_or_pictures(rng: Rng, strength: float) -> Evidence:
    """The two camera matrices are exchanged (1), or the corners of the two cameras (2)."""
    solved = healthy_pair(rng)
    left, right = solved.cameras.values()
    if strength == 1:
        lenses = {"left": right.at(left.world_from_cam), "right": left.at(right.world_from_cam)}
        return Evidence(replace(solved, cameras=lenses, cam_from_board={}))
    corners = {"left": solved.detections["right"], "right": solved.detections["left"]}
    return Evidence(replace(solved, detections=corners, cam_from_board={}, set_aside={}))


@finding(
    "rectified-black",
    severity="fault",
    view="rectified",
    symptom="The rectified pair is black or turned.",
    causes=("swapped cameras", "a distortion model that folds", "a transform that belongs to another pair"),
    remedy="Check the order of the cameras and the direction of their transform, then the lens models.",
    threshold="More than 40 % of a rectified picture have no original, or the turn is more than 35°.",
)
def rectified_black(evidence: Evidence) -> Iterator[Finding]:
    """The check asks where each pixel of the rectified pictures comes from, and how far rectification turns the
    cameras.
    """
    stereo = [pair for pair in evidence.pairs if pair.baseline > 0]
    if not stereo:
        raise evidence.without_pair("the file holds no stereo pair")
    for pair in stereo:
        yield from _rectified(pair)


def _rectified(pair: StereoPair) -> Iterator[Finding]:
    if np.abs(pair.right_from_left.translation).argmax() == 1:
        return  # one above the other: rectified along the columns, which is another matter
    try:
        rectified = rectify(*pair.cameras)
    except ValueError as error:
        yield rectified_black.found(f"{pair.title}: the pair cannot be rectified: {error}.", camera=pair.right)
        return
    black = max(black_share(rectified, side) for side in ("left", "right"))
    turn_of = rectified.left_original.world_from_cam.rotation.inv() * rectified.left.world_from_cam.rotation
    turn = float(np.degrees(turn_of.magnitude()))
    if black > BLACK:
        sentence = f"{pair.title}: {black:.0%} of a rectified picture have no original."
        yield rectified_black.found(sentence, black * 100, "%", pair.right)
    elif turn > TURNED_DEG:
        sentence = f"{pair.title}: rectification turns the cameras by {turn:.0f}°."
        yield rectified_black.found(sentence, turn, "°", pair.right)


def black_share(rectified: RectifiedPair, side: str, samples: int = 48) -> float:
    """The share of a rectified picture's pixels that the original camera does not show."""
    camera: Camera = getattr(rectified, side)
    original: Camera = getattr(rectified, f"{side}_original")
    grid = camera.intrinsics
    u, v = np.meshgrid(np.linspace(0, grid.width - 1, samples), np.linspace(0, grid.height - 1, samples))
    rays = camera.unproject(np.stack([u, v], axis=-1))
    pixels = original.at(RigidTransform.from_rotation(original.world_from_cam.rotation)).project(rays)
    return float(1 - original.intrinsics.contains(pixels).mean())


swapped_rectified = rectified_black.fault("swapped cameras, rectified", "", (1,), promised=1)(_exchanged)


@rectified_black.fault("right camera turned", "°", (5, 60, 90), promised=60)
def turned_away(rng: Rng, strength: float) -> Evidence:
    """The right camera is turned in the file alone."""
    solved = healthy_pair(rng)
    right = solved.cameras["right"]
    turn = RigidTransform.from_rotation(Rotation.from_rotvec([0, np.radians(strength), 0]))
    cameras = {**solved.cameras, "right": right.at(right.world_from_cam * turn)}
    return Evidence(Calibration(cameras, Path("virtual"), "OpenCV FileStorage, stereo"))
