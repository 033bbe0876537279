"""Whether a camera with the file's numbers can exist, and can have taken the pictures that it was solved from."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from camviz.cameras import Camera
from camviz.distortion import valid_region
from camviz.lenses import BrownConrady
from camviz_clinic.calibration.types import Calibration
from camviz_clinic.checks.evidence import Evidence
from camviz_clinic.checks.findings.file import PANORAMAS
from camviz_clinic.checks.findings.lens import border_pixels
from camviz_clinic.checks.findings.size import clean_factor, off_centre
from camviz_clinic.checks.registry import WRONG_NUMBERS, Finding, Rng, finding
from camviz_clinic.checks.rig import OWN_UNIT
from camviz_clinic.checks.virtual import alone, healthy, healthy_pair

OWN_WORLD = (*OWN_UNIT, "BAL problem", "OpenMVG", "OpenSfM")  # formats of scenes whose lengths are not metres
FARTHEST = 50_000.0  # metres between a camera and the next one
FOCAL = (0.01, 1000.0)  # longer sides of the picture: lenses of 179°, and of a sixteenth of a degree
STRETCHED = 3.0  # times as many pixels for a degree at the border as a straight picture has; the strongest lenses: 1.5
MAX_TANGENTIAL = 0.1  # p1, p2: a sensor tilted by τ moves a point at x by x² tan τ, and 3 p x² is that at 17°
TANGENTIAL = {"p1": 3.0, "p2": 3.0, "s1": 1.0, "s3": 1.0}  # how many x² a coefficient moves a point at most
MAX_LOST = 0.8  # of the pixels without a ray; a fisheye's circle inside its picture leaves up to 0.6
MAX_OFF_CENTRE = 1.0  # longer sides between the principal point and the middle: half a side outside the image
MAX_PIXEL_ASPECT = 1.5  # fx/fy or fy/fx: wider pixels come of binning or resizing between common formats
COMMON_ASPECTS = (1 / 2, 9 / 16, 2 / 3, 3 / 4, 4 / 5, 1, 5 / 4, 4 / 3, 3 / 2, 16 / 10, 16 / 9, 2, 21 / 9)  # of images
SAME_ASPECT = 0.03
MAX_FOCAL_RATIO = 2.0  # between the two cameras of a stereo pair with images of one size
NEAR_AXIS = 1e-6  # rad
WIDEST_DEG = 60.0  # from the axis; a straight picture has no measure for what is much farther out


OF_A_PAIR: dict[str, Any] = {
    "causes": ("a solution that ran away in one of the two cameras", "two cameras with different lenses"),
    "remedy": "Calibrate each camera alone, compare fx with the data sheet of its lens, and solve the pair again.",
}


@finding(
    "impossible-numbers",
    severity="fault",
    view="numbers",
    symptom="No camera has these numbers.",
    causes=(
        "a number that was damaged, typed wrongly or put into the wrong place of the file",
        "numbers in another unit",
        "a solution that ran away",
    ),
    remedy="Write the file again with the program that it comes from, or calibrate again.",
    threshold="Half the corners are off by more than the picture's longer side. The border is stretched "
    "three times as much as the middle, or four fifths of the pixels have no ray. p1 or p2 is 0.1 or more, as if the "
    "sensor were tilted by 17°. The focal length is below a hundredth or above a thousand of the longer side. fx and "
    "fy differ 1.5 times, which no resizing from a common format explains. The principal point is a longer side from "
    "the middle. The next camera is more than 50 km away. Focal lengths of a stereo pair that differ 2 times are a "
    "warning.",
    explains=(
        *WRONG_NUMBERS,
        *("aspect", "principal-point", "parallel-boards", "focal-uncertain", "half-pixel", "board-warp"),
        *("rectified-black", "baseline-scale", "zero-distortion", "rolling-shutter", "wrong-size", "not-a-rotation"),
    ),
)
def impossible_numbers(evidence: Evidence) -> Iterator[Finding]:
    """The check compares the corners with where the numbers put them. It also takes the rays of the image's pixels,
    p1 and p2. It compares the focal lengths and the principal point with the picture's sides, and the two focal lengths
    of a pair with each other. It measures the way from each camera to the next one.
    """
    for name, camera in evidence.cameras.items():
        yield from next(filter(None, (list(each) for each in _of_camera(evidence, name, camera))), ())
    yield from _by_pair(evidence)
    yield from _by_place(evidence)


def _of_camera(evidence: Evidence, name: str, camera: Camera) -> Iterator[Iterator[Finding]]:
    """What may be impossible of one camera, the plainest first."""
    yield _by_corners(evidence, name)
    yield _by_tangential(name, camera)
    yield _by_lens(name, camera)
    yield _by_focal(name, camera)
    yield _by_aspect(name, camera)
    yield _by_centre(name, camera)
    yield _by_lost(name, camera)


def _by_corners(evidence: Evidence, name: str) -> Iterator[Finding]:
    if name not in evidence.observed:
        return
    lengths = np.linalg.norm(evidence.observed[name].residuals, axis=-1)
    lengths = lengths[np.isfinite(lengths)]  # never empty: a camera is observed where a view has corners and rays
    off, side = float(np.median(lengths)), _longer_side(evidence.cameras[name])
    if off > side:
        sentence = (
            f"{name}: the file's numbers put the corners {off:.3g} px (median) from where they were found, in a "
            f"picture whose longer side has {side} px."
        )
        yield impossible_numbers.found(sentence, off, "px", name)


def _by_lens(name: str, camera: Camera) -> Iterator[Finding]:
    stretch = stretched(camera)
    if stretch > STRETCHED:
        sentence = (
            f"{name}: the distortion stretches the border of the picture {stretch:.3g} times as much as its middle, "
            "which no lens does."
        )
        yield impossible_numbers.found(sentence, stretch, "times", name)


def _by_tangential(name: str, camera: Camera) -> Iterator[Finding]:
    """Decentring and thin-prism terms beyond any tilt of a sensor. A mirror's are of rays 1 + ξ times as short."""
    lens: Any = camera.lens
    held = {key: float(getattr(lens, key, 0.0)) for key in TANGENTIAL}
    slopes = {key: TANGENTIAL[key] * abs(value) / (1 + getattr(lens, "xi", 0.0)) for key, value in held.items()}
    key = max(slopes, key=lambda each: slopes[each])
    if slopes[key] >= TANGENTIAL["p1"] * MAX_TANGENTIAL:
        tilt = np.degrees(np.arctan(slopes[key]))
        sentence = f"{name}: {key} = {held[key]:.3g}, as if the sensor were tilted by {tilt:.0f}°."
        yield impossible_numbers.found(sentence, abs(held[key]), "", name)


def _by_aspect(name: str, camera: Camera) -> Iterator[Finding]:
    """Pixels that no resizing between images of common formats, and no binning, makes so wide or so high."""
    grid = camera.intrinsics
    ratio = grid.fx / grid.fy
    format_before = grid.width / grid.height / ratio
    resized = min(abs(np.log(format_before / each)) for each in COMMON_ASPECTS) < SAME_ASPECT
    binned = abs(abs(np.log(ratio)) - np.log(2)) < SAME_ASPECT
    if abs(np.log(ratio)) > np.log(MAX_PIXEL_ASPECT) and not (resized or binned or isinstance(camera.lens, PANORAMAS)):
        sentence = (
            f"{name}: fx = {grid.fx:.4g} and fy = {grid.fy:.4g} px differ {max(ratio, 1 / ratio):.3g} times. No common "
            f"image format resized to {grid.width}×{grid.height} explains it."
        )
        yield impossible_numbers.found(sentence, ratio, "", name)


def _by_centre(name: str, camera: Camera) -> Iterator[Finding]:
    grid, off = camera.intrinsics, off_centre(camera.intrinsics) / _longer_side(camera)
    if off >= MAX_OFF_CENTRE and clean_factor(grid) is None:
        sentence = (
            f"{name}: the principal point ({grid.cx:.4g}, {grid.cy:.4g}) is {off:.3g} times the longer side from the "
            f"middle of the {grid.width}×{grid.height} image, far outside it."
        )
        yield impossible_numbers.found(sentence, off, "longer sides", name)


def _by_lost(name: str, camera: Camera) -> Iterator[Finding]:
    if not camera.lens.can_fold:
        return
    lost = 1 - float(valid_region(camera, max(1, camera.intrinsics.width // 64)).mean())
    if lost > MAX_LOST:
        sentence = f"{name}: the distortion leaves {lost:.0%} of the pixels without a ray."
        yield impossible_numbers.found(sentence, lost, "of the pixels", name)


def _by_pair(evidence: Evidence) -> Iterator[Finding]:
    """Two cameras of a pair with images of one size and one kind of lens, and very different focal lengths."""
    for pair in evidence.pairs:
        left, right = pair.cameras
        a, b = left.intrinsics, right.intrinsics
        ratio = max(a.fx / b.fx, b.fx / a.fx)
        alike = (a.width, a.height) == (b.width, b.height) and type(left.lens) is type(right.lens)
        if alike and ratio > MAX_FOCAL_RATIO:
            sentence = (
                f"{pair.title}: the focal lengths fx = {a.fx:.4g} and {b.fx:.4g} px differ {ratio:.3g} times, in "
                "images of one size. Two like cameras do not differ so."
            )
            yield impossible_numbers.found(sentence, ratio, "times", severity="warning", **OF_A_PAIR)


def _by_focal(name: str, camera: Camera) -> Iterator[Finding]:
    k = camera.intrinsics
    for key, length in (("fx", k.fx), ("fy", k.fy)):
        share = length / _longer_side(camera)
        if not FOCAL[0] <= share <= FOCAL[1]:
            sentence = f"{name}: {key} = {length:.4g} px is {share:.3g} times the longer side of the picture."
            yield impossible_numbers.found(sentence, share, "longer sides", name)
            return


def _by_place(evidence: Evidence) -> Iterator[Finding]:
    calibration = evidence.calibration
    if len(calibration.cameras) < 2 or calibration.format in OWN_WORLD:
        return
    names, centres = list(calibration.cameras), np.array([camera.centre for camera in calibration.cameras.values()])
    if len(names) == 2:
        names, centres = [f"{names[0]}, {names[1]}"], centres[:1] - centres[1:]
    for index, name in enumerate(names):
        others = np.delete(centres, index, axis=0) if len(names) > 1 else np.zeros((1, 3))
        away = float(np.min(np.linalg.norm(others - centres[index], axis=-1)))
        if away > FARTHEST:
            sentence = f"{name}: the next camera of the rig is {away:.3g} m away, and no rig is that wide."
            yield impossible_numbers.found(sentence, away, "m", name if len(names) > 1 else None)


def stretched(camera: Camera) -> float:
    """By how much the lens stretches the border of the picture more than its middle, at most.

    It is the length in the picture over the tangent of the angle from the axis, held against the same near the axis.
    0 where no ray of the border is within 60° of the axis.
    """
    xy = camera.intrinsics.from_pixels(border_pixels(camera))
    rays = camera.lens.unproject(xy)
    beside = np.linalg.norm(rays[:, :2], axis=-1)
    with np.errstate(divide="ignore", invalid="ignore"):
        border = np.linalg.norm(xy, axis=-1) * rays[:, 2] / beside
        known = np.isfinite(border) & (np.degrees(np.arctan2(beside, rays[:, 2])) < WIDEST_DEG) & (beside > NEAR_AXIS)
        towards = rays[known, :2] / beside[known, None] * np.sin(NEAR_AXIS)
        near = np.column_stack([towards, np.full(known.sum(), np.cos(NEAR_AXIS))])
        middle = np.linalg.norm(camera.lens.project(near), axis=-1) / np.tan(NEAR_AXIS)
        times = border[known] / middle
    times = times[np.isfinite(times)]
    return float(times.max()) if len(times) else 0.0


def _longer_side(camera: Camera) -> int:
    return max(camera.intrinsics.width, camera.intrinsics.height)


@impossible_numbers.fault("misplaced coefficient", "of k1", (1, 100, 1e5), promised=100)
def misplaced_coefficient(rng: Rng, strength: float) -> Evidence:
    """A number of another size stands where k1 belongs, and the file has no corners."""
    solved = healthy(rng)
    return Evidence(alone(solved, replace(solved.cameras["camera"], lens=BrownConrady(k1=strength))))


@impossible_numbers.fault("misplaced tangential coefficient", "of p1", (0.01, 0.1, 8), promised=0.1)
def misplaced_tangential(rng: Rng, strength: float) -> Evidence:
    """A number of another size stands where p1 belongs, and the file has no corners."""
    solved = healthy(rng)
    camera = solved.cameras["camera"]
    assert isinstance(camera.lens, BrownConrady)
    return Evidence(alone(solved, replace(camera, lens=replace(camera.lens, p1=strength))))


@impossible_numbers.fault("runaway focal length", "times", (1.5, 3, 8), promised=3)
def runaway(rng: Rng, strength: float) -> Evidence:
    """The right camera of a pair has so many times the focal length, and the file has no corners."""
    cameras = dict(healthy_pair(rng).cameras)
    grid = cameras["right"].intrinsics
    longer = replace(grid, fx=strength * grid.fx, fy=strength * grid.fy)
    cameras["right"] = replace(cameras["right"], intrinsics=longer)
    return Evidence(Calibration(cameras, Path("virtual"), "OpenCV FileStorage, stereo"))
