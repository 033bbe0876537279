"""What only several cameras together show: what ties them, and whether they were together in time and place."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import replace

import numpy as np

from camviz.cameras import Camera
from camviz.lenses.base import Array
from camviz.poses import RigidTransform, Rotation
from camviz_clinic.calibration.adjustment import Adjustment
from camviz_clinic.calibration.types import Calibration, Mask
from camviz_clinic.checks.evidence import Evidence, NotChecked
from camviz_clinic.checks.registry import VIEW_BY_VIEW, Finding, Rng, finding
from camviz_clinic.rigs import calibrate_rig, virtual
from camviz_clinic.rigs.graph import Indices, islands, parted
from camviz_clinic.rigs.series import by_themselves, delays, frame_numbers, jumps
from camviz_clinic.rigs.virtual import VirtualRig

FEWEST_CORNERS = 4
ONE_AXIS_DEG = 2.5  # RMS of the turns about the other axes
TURNED_DEG = 8.0  # RMS about the one: boards that turn less are another matter
FEWEST_FRAMES = 6
APART = 3.0  # pixels between the two cameras' numbers, or they cannot be told apart
CLOSER = 5.0  # times closer must the exchanged cameras be


def _a_rig(evidence: Evidence) -> bool:
    """Whether a file is of a rig: of more cameras than a pair, or of a pair with what it saw frame by frame."""
    count = len(evidence.calibration.cameras)
    return count > 2 or (count == 2 and _holds_frames(evidence.calibration))


def _comparable(evidence: Evidence) -> bool:
    """Whether a file is of several cameras, and compared with another."""
    return len(evidence.calibration.cameras) > 1 and evidence.compare is not None


def _holds_frames(calibration: Calibration) -> bool:
    """Whether a file holds what all of its cameras saw of one board, frame by frame."""
    held = [calibration.detections.get(name) for name in calibration.cameras]
    shapes = {None if each is None else each.shape[:2] for each in held}
    return calibration.board is not None and len(shapes) == 1 and None not in shapes


def _together(evidence: Evidence) -> Calibration:
    """The calibration, where several of its cameras saw one board in the same frames; NotChecked otherwise."""
    calibration = evidence.calibration
    if len(calibration.cameras) < 2:
        raise NotChecked("the file holds one camera, not a rig")
    evidence.with_corners()
    if not _holds_frames(calibration):
        raise NotChecked("the file does not hold what all cameras of a rig saw of one board, frame by frame")
    assert calibration.board is not None
    corners = next(iter(calibration.detections.values()))
    if corners.shape[1] != calibration.board.columns * calibration.board.rows:
        raise NotChecked("the file's corners are not those of its board")
    return calibration


def _seen(calibration: Calibration) -> dict[str, Mask]:
    """In which frames (frames,) each camera has corners with a say."""
    return {name: calibration.used(name).sum(axis=1) >= FEWEST_CORNERS for name in calibration.cameras}


def _alone(evidence: Evidence) -> Mapping[str, Adjustment]:
    calibration = _together(evidence)
    return evidence.once(("by themselves",), lambda: by_themselves(calibration))


@finding(
    "rig-islands",
    severity="fault",
    view="boards",
    symptom="Cameras of a rig are not tied to each other.",
    causes=("two groups of cameras that never saw the board in the same frame",),
    remedy="Show the board to the two cameras that are named, both at once, in several frames, and solve again.",
    threshold="No frame is common to the groups.",
    asked_of=_a_rig,
)
def rig_islands(evidence: Evidence) -> Iterator[Finding]:
    """The check follows the frames in which two cameras both saw the board, from camera to camera."""
    calibration = _together(evidence)
    groups = islands(_seen(calibration))
    if len(groups) > 1:
        yield rig_islands.found(f"{parted(groups, list(calibration.cameras))}.", len(groups), "groups")


@rig_islands.fault("cameras in two groups", "", (1,), promised=1)
def two_groups(rng: Rng, strength: float) -> Evidence:
    """Two of four cameras never see the board together with the others."""
    truth = virtual.rig(rng, 4, frames=5, shared=0.6)
    solved = calibrate_rig(truth.observed(rng), truth.board)
    early = np.arange(20) < 10
    seen = {name: early if number < 2 else ~early for number, name in enumerate(solved.cameras)}
    apart = {
        name: np.where(seen[name][_rows(truth), None, None], corners, np.nan)
        for name, corners in solved.detections.items()
    }
    return Evidence(replace(solved, detections=apart))


def _rows(truth: VirtualRig) -> Indices:
    """The frames that any camera sees: the rows of a calibration of this rig."""
    return np.flatnonzero(np.any([np.isfinite(truth.corners(name)).all(axis=(1, 2)) for name in truth.cameras], axis=0))


@finding(
    "rig-one-frame",
    severity="warning",
    view="boards",
    symptom="A camera of a rig is held by one frame.",
    causes=("a camera that saw the board together with the others only once",),
    remedy="Show the board to this camera and a neighbour together, in ten frames at different places and angles.",
    threshold="It shares one frame with all other cameras together.",
    asked_of=_a_rig,
)
def rig_one_frame(evidence: Evidence) -> Iterator[Finding]:
    """The check counts the frames that a camera shares with any other."""
    calibration = _together(evidence)
    seen = _seen(calibration)
    for name in calibration.cameras:
        others = np.any([seen[other] for other in seen if other != name], axis=0)
        common = np.flatnonzero(seen[name] & others)
        if len(common) == 1:
            pictures = calibration.pictures.get(name)
            shown = pictures[common[0]] if pictures else f"frame {common[0] + 1}"
            sentence = (
                f"{name}: one frame alone ({shown}) ties it to the other cameras: nothing contradicts a mistake in "
                "it, and the ± of its place is that of corner noise alone."
            )
            yield rig_one_frame.found(sentence, 1, "frame", name, pictures=(int(common[0]),))


@rig_one_frame.fault("one frame in common", "frames", (3, 1), promised=1)
def one_frame(rng: Rng, strength: float) -> Evidence:
    """The last camera shares so many frames with the others."""
    truth = virtual.rig(rng, 3, frames=6, shared=0.5)
    others = truth.seen["cam0"] | truth.seen["cam1"]
    common = np.flatnonzero(truth.seen["cam2"] & others)
    kept = truth.seen["cam2"].copy()
    kept[common[int(strength) :]] = False
    truth = replace(truth, seen={**truth.seen, "cam2": kept})
    return _solved(truth, rng)


def _solved(truth: VirtualRig, rng: Rng) -> Evidence:
    return Evidence(calibrate_rig(truth.observed(rng), truth.board))


@finding(
    "rig-one-axis",
    severity="warning",
    view="boards",
    symptom="A rig's board was turned about one axis only.",
    causes=("a board on a turntable, or carried on its stand",),
    remedy="Add frames with the board tilted to all sides by 20° to 40°.",
    threshold="All turns but those about one axis are below 2.5° RMS, and those about it above 8°.",
    asked_of=_a_rig,
)
def rig_one_axis(evidence: Evidence) -> Iterator[Finding]:
    """The check compares the board's attitudes in all frames with the middle one."""
    calibration = _together(evidence)
    seen, first = _seen(calibration), next(iter(calibration.cameras))
    if first not in calibration.cam_from_board or calibration.cam_from_board[first].single:
        raise NotChecked("the file holds no poses of the board")
    turns = calibration.cam_from_board[first][np.any(list(seen.values()), axis=0)].rotation
    if len(turns) < FEWEST_FRAMES:
        raise NotChecked(f"it takes at least {FEWEST_FRAMES} frames")
    about = np.degrees((turns * turns.mean().inv()).as_rotvec())
    spread = np.sqrt(np.linalg.eigvalsh(about.T @ about / len(about)))
    if spread[1] < ONE_AXIS_DEG and spread[2] > TURNED_DEG:
        sentence = (
            f"The board was turned about one axis, by {spread[2]:.0f}° RMS, and about all others by {spread[1]:.1f}°: "
            "no frame shows how the cameras see a board that is tilted to its other sides."
        )
        yield rig_one_axis.found(sentence, spread[1], "°")


@rig_one_axis.fault("board on a turntable", "°", (10, 4, 1), promised=1)
def turntable(rng: Rng, strength: float) -> Evidence:
    """The board turns about an upright axis, and about the others by so little."""
    truth = virtual.film(rng, 3, frames=16)
    count, middle = len(truth.world_from_board), truth.board.corners.mean(axis=0)
    turn = Rotation.from_rotvec([0, 1, 0] * np.linspace(-0.5, 0.5, count)[:, None])
    wobble = Rotation.from_rotvec(np.radians(strength) * rng.normal(0, 1, (count, 3)) * [1, 0, 1])
    centres = truth.world_from_board.apply(middle)
    rotation = truth.cameras["cam1"].world_from_cam.rotation * wobble * turn
    poses = RigidTransform.from_components(centres - rotation.apply(middle), rotation)
    return _solved(virtual.shown(truth, poses), rng)


@finding(
    "rig-late",
    severity="fault",
    view="per-view-errors",
    symptom="A camera of a rig takes its pictures later than the others.",
    causes=("a camera that started a frame late or lost one", "a trigger or a clock that lags", "files numbered apart"),
    remedy="Shift its pictures by the delay, or trigger the cameras together, and solve again.",
    threshold="With the delay taken off, its error is a third of what it is, and that is above 3 px.",
    explains=(*VIEW_BY_VIEW, "rolling-shutter", "split-disagreement"),
    asked_of=_a_rig,
)
def rig_late(evidence: Evidence) -> Iterator[Finding]:
    """The check lets the frames of one camera lag behind another's, by quarters of a frame up to four, and asks whether
    the two then agree on how they stand to each other.
    """
    alone = _alone(evidence)
    calibration = evidence.calibration
    seen = {name: each.posed for name, each in alone.items()}
    numbers = frame_numbers(calibration.pictures, seen, len(next(iter(seen.values()))))
    for name, late in delays(alone, numbers).items():
        way = "late" if late.frames > 0 else "early"
        count = f"{abs(late.frames):g} frame{'s' * (abs(late.frames) != 1)}"
        sentence = (
            f"{name}: its pictures are {count} {way}: corners are {late.without:.1f} px off as they are, and "
            f"{late.along:.1f} px with the delay taken off."
        )
        yield rig_late.found(sentence, late.frames, "frames", name)


@rig_late.fault("camera a frame late", "frames", (0.5, 1, 2), promised=1)
def a_frame_late(rng: Rng, strength: float) -> Evidence:
    """One of three cameras films so many frames late."""
    return _solved(replace(virtual.film(rng, 3, frames=24), late={"cam1": strength}), rng)


@finding(
    "rig-moved",
    severity="fault",
    view="per-view-errors",
    symptom="A camera of a rig was moved between the frames.",
    causes=("a camera that was knocked or whose mount slipped", "frames of two set-ups in one folder"),
    remedy="Fix the camera, and solve again from the frames after it was moved, or from those before.",
    threshold="By its place on the other side of a frame its error is above 3 px, and three times that by its own.",
    explains=(*VIEW_BY_VIEW, "split-disagreement"),
    asked_of=_a_rig,
)
def rig_moved(evidence: Evidence) -> Iterator[Finding]:
    """The check asks for every frame whether two cameras stand otherwise to each other before it and from it on."""
    alone = _alone(evidence)
    for name, jump in jumps(alone).items():
        pictures = evidence.calibration.pictures.get(name)
        shown = pictures[jump.row] if pictures else f"frame {jump.row + 1}"
        or_other = "" if len(alone) > 2 else " or the other camera"
        sentence = (
            f"{name}: it{or_other} was moved before {shown}: corners are {jump.across:.1f} px off by where it stood "
            f"before, and {jump.beside:.1f} px by where it stands since."
        )
        yield rig_moved.found(sentence, jump.across, "px", name, pictures=(jump.row,))


@rig_moved.fault("camera knocked", "°", (0.3, 1, 3), promised=1)
def knocked(rng: Rng, strength: float) -> Evidence:
    """One of three cameras is turned and shifted from a frame in the middle on."""
    truth = virtual.film(rng, 3, frames=24)
    name = f"cam{rng.integers(3)}"
    turn = Rotation.from_rotvec(np.radians(strength) * _direction(rng))
    knock = RigidTransform.from_components(0.005 * strength * _direction(rng), turn)
    moved = truth.cameras[name].world_from_cam * knock
    return _solved(replace(truth, knocked={name: (int(rng.integers(8, 17)), moved)}), rng)


def _direction(rng: Rng) -> Array:
    vector = rng.normal(0, 1, 3)
    return vector / np.linalg.norm(vector)


@finding(
    "rig-exchanged",
    severity="fault",
    view="numbers",
    symptom="Two cameras of a rig are exchanged.",
    causes=("two folders exchanged", "cables or serial numbers exchanged since the other calibration"),
    remedy="Exchange the two folders, or the two names.",
    threshold="Exchanged, the two are five times closer to the other calibration, from which they are 3 px off.",
    explains=("models-differ",),
    asked_of=_comparable,
)
def rig_exchanged(evidence: Evidence) -> Iterator[Finding]:
    """The check compares focal lengths and principal points with those of the other calibration, and with those under
    each other's name.
    """
    if len(evidence.calibration.cameras) < 2:
        raise NotChecked("the file holds one camera, not a rig")
    both = {name: (ours, other) for name, ours, other in evidence.matched()}
    if len(both) < 2:
        raise NotChecked("it needs another calibration (--compare)")
    names = list(both)
    for i, one in enumerate(names):
        for other in names[i + 1 :]:
            straight = max(_apart(*both[one]), _apart(*both[other]))
            crossed = max(_apart(both[one][0], both[other][1]), _apart(both[other][0], both[one][1]))
            if straight > APART and crossed * CLOSER < straight:
                sentence = (
                    f"{one} and {other} are exchanged: their numbers are {straight:.1f} px from those of the other "
                    f"calibration, and {crossed:.2g} px under each other's name."
                )
                yield rig_exchanged.found(sentence, straight, "px", one)


def _apart(one: Camera, other: Camera) -> float:
    """The largest difference of focal lengths and principal points, in pixels; infinite for other pictures."""
    a, b = one.intrinsics, other.intrinsics
    if (a.width, a.height) != (b.width, b.height):
        return np.inf
    return float(max(abs(getattr(a, key) - getattr(b, key)) for key in ("fx", "fy", "cx", "cy")))


@rig_exchanged.fault("two folders exchanged", "", (1,), promised=1)
def exchanged(rng: Rng, strength: float) -> Evidence:
    """Two of three folders are exchanged, beside a calibration of before."""
    truth = virtual.rig(rng, 3, frames=10, shared=0.5)
    before, now = (truth.observed(rng) for _ in range(2))
    now = {**now, "cam0": now["cam1"], "cam1": now["cam0"]}
    return Evidence(calibrate_rig(now, truth.board), compare=calibrate_rig(before, truth.board))
