"""What the numbers of a file tell by themselves: no corners are needed."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from fractions import Fraction
from math import atan, degrees

import numpy as np

from camviz.cameras import Camera
from camviz.clinic.catalogue import Finding, Lacking, Outcome, found
from camviz.clinic.evidence import PANORAMAS, Evidence
from camviz.lenses import BrownConrady, KannalaBrandt, Perspective

SQUARE = 0.02  # how far fx/fy may be from 1: sensors have square pixels to a few thousandths
OFF_CENTRE = 0.1  # of the longer side: lenses sit within a few hundredths of the middle of the sensor
WIDEST_DEG = 170.0  # no lens that keeps lines nearly straight sees more
CLEAN = sorted({Fraction(p, q) for p in range(1, 5) for q in range(1, 5)} - {Fraction(1)})  # 1/4 … 4
STANDARD_ERRORS = 5.0
ALIKE = 0.06  # how well a clean factor must fit both axes


def not_a_rotation(evidence: Evidence) -> Outcome:
    return _refused(evidence, "not-a-rotation", "")


def bad_k(evidence: Evidence) -> Outcome:
    return _refused(evidence, "bad-k", "")


def coefficient_count(evidence: Evidence) -> Outcome:
    return _refused(evidence, "coefficient-count", "coefficients")


def _refused(evidence: Evidence, id: str, unit: str) -> list[Finding]:
    return [found(id, f"{fault}.", fault.value, unit) for fault in evidence.calibration.faults if fault.id == id]


def zero_distortion(evidence: Evidence) -> Outcome:
    """A lens whose kind has coefficients, all of which are 0. A pinhole that says it is one has none."""
    if all(isinstance(camera.lens, Perspective) for camera in evidence.cameras.values()):
        return Lacking("the file describes pinholes, which have no distortion coefficients")
    bare = {name: each for name, each in evidence.cameras.items() if each.lens in (BrownConrady(), KannalaBrandt())}
    return [finding for name, camera in bare.items() for finding in _zero(evidence, name)]


def _zero(evidence: Evidence, name: str) -> Iterator[Finding]:
    """Where there are corners, they say whether the lens is straight."""
    sentence, observed = f"{name}: all distortion coefficients are 0", evidence.observed.get(name)
    if observed is None:
        yield found("zero-distortion", f"{sentence}.", 0, "", name)
        return
    bent = replace(observed.adjustment, estimated={name: ("fx", "fy", "cx", "cy", "k1")}).refined()
    k1, sigma = bent.intrinsics(name)[-1], float(np.sqrt(bent.intrinsics_covariance(name)[-1, -1]))
    if abs(k1) > STANDARD_ERRORS * sigma:
        sentence += f", and the corners ask for k1 = {k1:.3g} ± {sigma:.1g}."
        yield found("zero-distortion", sentence, k1, "", name)


def aspect(evidence: Evidence) -> Outcome:
    """fx/fy, which is the ratio of a pixel's height to its width. Panoramas have angles in place of pixels."""
    cameras = {name: each for name, each in evidence.cameras.items() if not isinstance(each.lens, PANORAMAS)}
    if not cameras:
        return Lacking("a panorama's pixels are angles")
    return [finding for name, camera in cameras.items() for finding in _aspect(evidence, name, camera)]


def _aspect(evidence: Evidence, name: str, camera: Camera) -> Iterator[Finding]:
    grid = camera.intrinsics
    ratio = grid.fx / grid.fy
    sigma = (evidence.sigma_of(name, "fx") or 0.0) / grid.fx
    if abs(np.log(ratio)) > max(SQUARE, STANDARD_ERRORS * sigma):
        sentence = f"{name}: fx/fy = {ratio:.4g}, as if pixels were {_percent(1 / ratio)} than high."
        yield found("aspect", sentence, ratio, "", name)


def _percent(ratio: float) -> str:
    return f"{abs(ratio - 1) * 100:.3g} % {'wider' if ratio > 1 else 'narrower'}"


def principal_point(evidence: Evidence) -> Outcome:
    """How far (cx, cy) is from the middle of the image."""
    return [
        finding
        for name, camera in evidence.cameras.items()
        if not any(True for _ in _clean_factor(name, camera))  # wrong-size explains it
        for finding in _off_centre(name, camera)
    ]


def _off_centre(name: str, camera: Camera) -> Iterator[Finding]:
    grid = camera.intrinsics
    offset = np.array([grid.cx - (grid.width - 1) / 2, grid.cy - (grid.height - 1) / 2])
    distance, longer = float(np.hypot(*offset)), max(grid.width, grid.height)
    if distance > OFF_CENTRE * longer:
        sentence = (
            f"{name}: the principal point ({grid.cx:.1f}, {grid.cy:.1f}) is {distance:.0f} px from the middle of the "
            f"{grid.width}×{grid.height} image, {distance / longer:.0%} of its longer side."
        )
        yield found("principal-point", sentence, distance, "px", name)


def wrong_size(evidence: Evidence) -> Outcome:
    """The camera matrix against the size of the image, of the pictures, of what the corners cover, of another file."""
    findings = [
        *_other_pictures(evidence),
        *_corners_outside(evidence),
        *(each for name, camera in evidence.cameras.items() for each in _clean_factor(name, camera)),
        *(each for name, camera in evidence.cameras.items() for each in _too_wide(name, camera)),
        *_other_scale(evidence),
    ]
    return list({finding.camera: finding for finding in reversed(findings)}.values())[::-1]  # the plainest of each


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
                f"the pictures have {width}×{height}."
            )
            yield found("wrong-size", sentence, width / grid.width, "times", name)


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
            yield found("wrong-size", sentence, value, "times", name)


def _clean_factor(name: str, camera: Camera) -> Iterator[Finding]:
    """(cx, cy) the same clean multiple of the middle on both axes: a camera matrix of another resolution."""
    grid = camera.intrinsics
    factors = np.array([(grid.cx + 0.5) / (grid.width / 2), (grid.cy + 0.5) / (grid.height / 2)])
    if not (factors > 0).all() or (abs(factors - 1) < 2 * ALIKE).any():
        return
    clean = min(CLEAN, key=lambda factor: abs(np.log(factors / float(factor))).max())
    if abs(np.log(factors / float(clean))).max() < ALIKE:
        size = f"{grid.width * clean}×{grid.height * clean}"
        sentence = (
            f"{name}: the principal point ({grid.cx:.1f}, {grid.cy:.1f}) is the middle of an image of {size}, "
            f"and this one has {grid.width}×{grid.height}: {clean} times on both axes."
        )
        yield found("wrong-size", sentence, float(clean), "times", name)


def _too_wide(name: str, camera: Camera) -> Iterator[Finding]:
    """A focal length so short that only another unit explains it."""
    if not isinstance(camera.lens, (BrownConrady, Perspective)):
        return
    grid = camera.intrinsics
    view = degrees(2 * atan(min(grid.width / grid.fx, grid.height / grid.fy) / 2))
    if view > WIDEST_DEG:
        sentence = (
            f"{name}: with fx = {grid.fx:.4g} px the {grid.width} px wide image would see {view:.1f}°; "
            "this looks like a focal length in millimetres, or of a much smaller image."
        )
        yield found("wrong-size", sentence, view, "°", name)


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
                f"{name}: fx, fy, cx and cy are all {factor:.3g} times those of the other calibration, "
                "beyond what the image sizes explain: one of the two is for another resolution."
            )
            yield found("wrong-size", sentence, factor, "times", name)
