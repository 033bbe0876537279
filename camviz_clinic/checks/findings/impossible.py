"""Whether a camera with the file's numbers can exist, and can have taken the pictures that it was solved from."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

import numpy as np

from camviz.cameras import Camera
from camviz.lenses import BrownConrady
from camviz_clinic.checks.evidence import Evidence
from camviz_clinic.checks.findings.lens import border_pixels
from camviz_clinic.checks.registry import WRONG_NUMBERS, Finding, Rng, finding
from camviz_clinic.checks.rig import OWN_UNIT
from camviz_clinic.checks.virtual import alone, healthy

OWN_WORLD = (*OWN_UNIT, "BAL problem", "OpenMVG", "OpenSfM")  # formats of scenes whose lengths are not metres
FARTHEST = 50_000.0  # metres between a camera and the next one
FOCAL = (0.01, 1000.0)  # longer sides of the picture: lenses of 179°, and of a sixteenth of a degree
STRETCHED = 3.0  # times as many pixels for a degree at the border as a straight picture has; the strongest lenses: 1.5
NEAR_AXIS = 1e-6  # rad
WIDEST_DEG = 60.0  # from the axis; a straight picture has no measure for what is much farther out


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
    "three times as much as the middle. The focal length is below a hundredth or above a thousand of the longer side. "
    "Or the next camera is more than 50 km away.",
    explains=(
        *WRONG_NUMBERS,
        *("aspect", "principal-point", "parallel-boards", "half-pixel", "board-warp"),
        *("rectified-black", "baseline-scale", "zero-distortion", "rolling-shutter", "wrong-size"),
    ),
)
def impossible_numbers(evidence: Evidence) -> Iterator[Finding]:
    """The check compares the corners with where the numbers put them. It also takes the rays of the border's pixels,
    the focal length as a share of the picture, and the way from each camera to the next one.
    """
    for name, camera in evidence.cameras.items():
        yield from list(_by_corners(evidence, name)) or list(_by_lens(name, camera)) or list(_by_focal(name, camera))
    yield from _by_place(evidence)


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
