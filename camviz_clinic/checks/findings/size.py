"""Whether the camera matrix fits the image: its size, its middle, the pictures, the corners, another calibration."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from fractions import Fraction
from math import atan, degrees

import numpy as np

from camviz.cameras import Camera, Intrinsics
from camviz.lenses import BrownConrady, Perspective
from camviz_clinic.checks.evidence import Evidence
from camviz_clinic.checks.registry import WRONG_NUMBERS, Finding, Rng, finding
from camviz_clinic.checks.stamps import size_change
from camviz_clinic.checks.virtual import alone, changed, healthy

OFF_CENTRE = 0.1  # of the longer side: lenses sit within a few hundredths of the middle of the sensor
WIDEST_DEG = 170.0  # no lens that keeps lines nearly straight sees more
CLEAN = sorted({Fraction(p, q) for p in range(1, 5) for q in range(1, 5)} - {Fraction(1)})  # 1/4 … 4
ALIKE = 0.06  # how well a clean factor must fit both axes


@finding(
    "wrong-size",
    severity="fault",
    view="numbers",
    symptom="cx, cy or f are off by a clean factor, or fit the image with its sides exchanged.",
    causes=(
        "a camera matrix for another resolution or crop",
        "a focal length in millimetres taken for pixels",
        "width and height exchanged",
    ),
    remedy="Rescale the camera matrix to the size of the pictures, c' = s c + (s - 1)/2 and f' = s f, "
    "or give the size it belongs to.",
    threshold="Both axes share a ratio of whole numbers up to 4 within 6 %. "
    "Or a factor against the other calibration is beyond 12 %. "
    "Or pictures have another size, corners lie outside the image, or the field of view is above 170°. "
    "Or the principal point is a tenth of the longer side off the middle, and half of that with exchanged sides.",
    explains=(*WRONG_NUMBERS, "principal-point"),
)
def wrong_size(evidence: Evidence) -> list[Finding]:
    """The check holds the camera matrix against the image size, the pictures, the corners and the other calibration."""
    findings = [
        *(each for name, camera in evidence.cameras.items() for each in _exchanged(name, camera)),
        *_other_pictures(evidence),
        *_corners_outside(evidence),
        *(each for name, camera in evidence.cameras.items() for each in _of_another_size(name, camera)),
        *(each for name, camera in evidence.cameras.items() for each in _too_wide(name, camera)),
        *_other_scale(evidence),
    ]
    return list({finding.camera: finding for finding in reversed(findings)}.values())[::-1]  # the plainest of each


def _exchanged(name: str, camera: Camera) -> Iterator[Finding]:
    """The principal point is off the middle, and near that of the image with width and height exchanged."""
    grid = camera.intrinsics
    if sides_exchanged(grid):
        sentence = (
            f"{name}: width and height are exchanged. The principal point ({grid.cx:.1f}, {grid.cy:.1f}) fits an image "
            f"of {grid.height}×{grid.width}, not this one of {grid.width}×{grid.height}."
        )
        yield wrong_size.found(
            sentence,
            off_centre(grid),
            "px",
            name,
            causes=("an image size written as height and width", "pictures turned by a quarter after the calibration"),
            remedy=f"Exchange width and height in the file: {grid.height}×{grid.width}. "
            "If the pictures are turned, turn them back.",
        )


def off_centre(grid: Intrinsics) -> float:
    """The distance of the principal point from the middle of the image, in pixels."""
    return float(np.hypot(grid.cx - (grid.width - 1) / 2, grid.cy - (grid.height - 1) / 2))


def sides_exchanged(grid: Intrinsics) -> bool:
    """Whether the principal point is far from the middle, and less than half as far with the sides exchanged."""
    limit, now = OFF_CENTRE * max(grid.width, grid.height), off_centre(grid)
    turned = off_centre(replace(grid, width=grid.height, height=grid.width))
    return now > limit and turned <= min(limit, now / 2)


def _other_pictures(evidence: Evidence) -> Iterator[Finding]:
    """Pictures of another size than the camera's; several sizes say nothing."""
    if len(set(evidence.sizes.values())) != 1:
        return
    ((width, height),) = set(evidence.sizes.values())
    for name, camera in evidence.cameras.items():
        grid = camera.intrinsics
        if (grid.width, grid.height) != (width, height):
            sentence = (
                f"{name}: the calibration is for images of {grid.width}×{grid.height}, "
                f"the pictures have {width}×{height}, "
                f"which {size_change((grid.width, grid.height), (width, height)).words}."
            )
            yield wrong_size.found(sentence, width / grid.width, "times", name)


def _corners_outside(evidence: Evidence) -> Iterator[Finding]:
    """Corners that lie beyond the image they were found in."""
    for name, pixels in evidence.calibration.detections.items():
        grid = evidence.calibration.cameras[name].intrinsics
        seen = pixels[np.isfinite(pixels).all(axis=-1)]
        outside = ~grid.contains(seen)
        if outside.any():
            u, v = seen.max(axis=0)
            sentence = (
                f"{name}: {outside.sum()} of {len(seen)} corners lie outside the {grid.width}×{grid.height} image, "
                f"as far as ({u:.0f}, {v:.0f})."
            )
            value = max((u + 0.5) / grid.width, (v + 0.5) / grid.height)
            yield wrong_size.found(sentence, value, "times", name)


def clean_factor(grid: Intrinsics) -> Fraction | None:
    """The clean multiple of the middle that cx and cy both are: that of another resolution; None where they are not."""
    factors = np.array([(grid.cx + 0.5) / (grid.width / 2), (grid.cy + 0.5) / (grid.height / 2)])
    if not (factors > 0).all() or (abs(factors - 1) < 2 * ALIKE).any():
        return None
    clean = min(CLEAN, key=lambda factor: abs(np.log(factors / float(factor))).max())
    return clean if abs(np.log(factors / float(clean))).max() < ALIKE else None


def _of_another_size(name: str, camera: Camera) -> Iterator[Finding]:
    """A camera matrix of another resolution."""
    grid = camera.intrinsics
    if clean := clean_factor(grid):
        sentence = (
            f"{name}: the principal point ({grid.cx:.1f}, {grid.cy:.1f}) is the middle of an image of "
            f"{grid.width * clean}×{grid.height * clean}, {clean} times this one's {grid.width}×{grid.height}."
        )
        yield wrong_size.found(sentence, float(clean), "times", name)


def _too_wide(name: str, camera: Camera) -> Iterator[Finding]:
    """A focal length so short that only another unit explains it."""
    if not isinstance(camera.lens, (BrownConrady, Perspective)):
        return
    grid = camera.intrinsics
    view = degrees(2 * atan(min(grid.width / grid.fx, grid.height / grid.fy) / 2))
    if view > WIDEST_DEG:
        sentence = (
            f"{name}: with fx = {grid.fx:.4g} px the image, {grid.width} px wide, would see {view:.1f}°. "
            "The focal length looks like millimetres, or like that of a much smaller image."
        )
        yield wrong_size.found(sentence, view, "°", name)


def _other_scale(evidence: Evidence) -> Iterator[Finding]:
    """All of fx, fy, cx, cy another multiple of the other calibration's than the image is."""
    for name, camera, other in evidence.counterparts():
        a, b = camera.intrinsics, other.intrinsics
        image = np.array([a.width / b.width, a.height / b.height] * 2)
        factors = np.array([a.fx / b.fx, a.fy / b.fy, (a.cx + 0.5) / (b.cx + 0.5), (a.cy + 0.5) / (b.cy + 0.5)]) / image
        if not (factors > 0).all():
            continue
        factor = float(np.exp(np.log(factors).mean()))
        if abs(np.log(factor)) > 2 * ALIKE and abs(np.log(factors / factor)).max() < ALIKE:
            sentence = (
                f"{name}: fx, fy, cx and cy are all {factor:.3g} times those of the other calibration, more than the "
                "image sizes explain. One of the two is for another resolution."
            )
            yield wrong_size.found(sentence, factor, "times", name)


@wrong_size.fault("resized K", "times", (0.5, 1.5, 2), promised=1.5, beyond_doubt=(2, 2))
def resized(rng: Rng, strength: float) -> Evidence:
    """K is for pictures of another size."""
    solved = healthy(rng)
    grid = solved.cameras["camera"].intrinsics
    large = grid.resized(round(grid.width * strength), round(grid.height * strength))
    return Evidence(alone(changed(solved, fx=large.fx, fy=large.fy, cx=large.cx, cy=large.cy)))


@wrong_size.fault("sides exchanged", "", (1,), promised=1)
def sides_swapped(rng: Rng, strength: float) -> Evidence:
    """The file has the width for the height, and the height for the width."""
    solved = healthy(rng)
    grid = solved.cameras["camera"].intrinsics
    return Evidence(alone(changed(solved, width=grid.height, height=grid.width)))


@wrong_size.fault("resized pictures", "times", (0.5, 1.25, 2), promised=1.25)
def resized_pictures(rng: Rng, strength: float) -> Evidence:
    """The pictures have another size."""
    solved = healthy(rng)
    grid = solved.cameras["camera"].intrinsics
    size = round(grid.width * strength), round(grid.height * strength)
    return Evidence(alone(solved), sizes={"picture.png": size})


@finding(
    "principal-point",
    severity="warning",
    view="numbers",
    symptom="The principal point is far from the middle of the image.",
    causes=(
        "a crop that was not applied to the camera matrix",
        "too few tilted views, so that the principal point follows the noise",
    ),
    remedy="If the pictures were cropped, subtract the crop's first pixel from cx and cy. After a crop to one side "
    "ignore this warning. If they were not, fix the principal point or add tilted views, and solve again.",
    threshold="They are a tenth of the image's longer side apart.",
)
def principal_point(evidence: Evidence) -> Iterator[Finding]:
    """The check compares cx and cy with the middle of the image."""
    for name, camera in evidence.cameras.items():
        grid = camera.intrinsics
        distance, longer = off_centre(grid), max(grid.width, grid.height)
        explained = sides_exchanged(grid) or clean_factor(grid) is not None  # by wrong-size
        if distance > OFF_CENTRE * longer and not explained:
            sentence = (
                f"{name}: the principal point ({grid.cx:.1f}, {grid.cy:.1f}) is {distance:.0f} px from the middle of "
                f"the {grid.width}×{grid.height} image, {distance / longer:.0%} of its longer side."
            )
            yield principal_point.found(sentence, distance, "px", name)


@principal_point.fault("crop", "% of the width", (5, 30, 40), promised=30, beyond_doubt=(30, 38))
def uncropped(rng: Rng, strength: float) -> Evidence:
    """Pictures were cropped at the left, and the camera matrix was not."""
    solved = healthy(rng)
    camera, grid = solved.cameras["camera"], solved.cameras["camera"].intrinsics
    width = round(grid.width * (1 - strength / 100))
    return Evidence(alone(solved, replace(camera, intrinsics=replace(grid, width=width))))
