"""What a lens does inside its own image: whether it folds, comes near a pole, and can be inverted."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from math import cos, degrees, inf, isfinite, pi, radians

import cv2
import numpy as np

from camviz.cameras import Camera
from camviz.clinic.catalogue import Finding, Lacking, Outcome, found
from camviz.clinic.evidence import Evidence, border_pixels
from camviz.distortion import (
    ideal_image_radius,
    image_corner_radius,
    is_rational,
    valid_region,
    weakest_denominator,
)
from camviz.lenses.base import Array, Lens, on_plane

WEAKEST = 0.2  # a denominator below which every error of the numerator is multiplied by more than five
CLOSE_PX = 0.5  # how well a pixel must return from OpenCV's inverse
NEARLY_SIDEWAYS = cos(radians(85))  # beyond, a ray has no point on the plane z = 1 worth the name


def near_pole(evidence: Evidence) -> Outcome:
    """D(r²) out to the farthest ray that this image, or an undistorted one with the same K, asks for."""
    rational = {name: camera for name, camera in evidence.cameras.items() if is_rational(camera.lens)}
    if not rational:
        return Lacking("no lens here has a denominator (k4 k5 k6)")
    return [finding for name, camera in rational.items() for finding in _near_pole(name, camera)]


def _near_pole(name: str, camera: Camera) -> Iterator[Finding]:
    reach = float(np.nanmax([ideal_image_radius(camera), image_corner_radius(camera.intrinsics)]))
    radius, least = weakest_denominator(camera.lens, reach)
    if least < WEAKEST:
        what = "passes through 0: a pole" if least <= 0 else f"falls to {least:.3g}"
        sentence = (
            f"{name}: the denominator of the rational model {what} at r = {radius:.3g} focal lengths, "
            f"and the image reaches to {reach:.3g}."
        )
        yield found("near-pole", sentence, least, "", name)


def fold(evidence: Evidence) -> Outcome:
    """Pixels along the border at which no ray arrives, because the lens turns back on the way there."""
    bent = {name: camera for name, camera in evidence.cameras.items() if camera.lens.can_fold}
    if not bent:
        return Lacking("no lens here has a polynomial that could turn back")
    return [finding for name, camera in bent.items() for finding in _fold(evidence, name, camera)]


def _fold(evidence: Evidence, name: str, camera: Camera) -> Iterator[Finding]:
    lens, fold = camera.lens, camera.lens.fold
    turns = fold is not None and fold.angle < inf
    if _seen(camera, border_pixels(camera)).all() or not (turns or lens.may_mirror):
        return
    lost = 1 - float(valid_region(camera, max(1, camera.intrinsics.width // 128)).mean())
    sentence = f"{name}: the distortion {_where(camera)}; {_share(lost)} of the pixels have no ray of their own."
    if fold is None or not turns:
        yield found("fold", sentence, lost, "", name)
        return
    severity = "note" if fold.angle >= pi / 2 and not _corners_lost(evidence, name, camera) else None
    yield found("fold", sentence, fold.radius, fold.unit, name, severity=severity)


def _where(camera: Camera) -> str:
    fold, corner = camera.lens.fold, image_corner_radius(camera.intrinsics)
    if fold is None:
        return "mirrors part of the image (the determinant of its Jacobian reaches 0)"
    radius = "" if fold.unit == "rad" else f"at r = {fold.radius:.4g}, "
    return (
        f"turns back {radius}{degrees(fold.angle):.1f}° from the axis, whose image is {fold.image:.3g} focal lengths "
        f"from the principal point, and the farthest corner is at {corner:.3g}"
    )


def _share(part: float) -> str:
    return f"{part:.0%}" if part >= 0.01 else "less than 1 %"


def _seen(camera: Camera, pixels: Array) -> np.ndarray:
    return np.isfinite(camera.lens.unproject(camera.intrinsics.from_pixels(pixels))[..., 0])


def _corners_lost(evidence: Evidence, name: str, camera: Camera) -> bool:
    pixels = evidence.calibration.detections.get(name)
    if pixels is None:
        return False
    seen = pixels[np.isfinite(pixels).all(axis=-1)]
    return not _seen(camera, seen).all()


def inverse_not_converged(evidence: Evidence) -> Outcome:
    """Border pixels through OpenCV's inverse as it is called without criteria, and forward again."""
    known = {name: camera for name, camera in evidence.cameras.items() if _opencv_model(camera.lens) in INVERSES}
    if not known:
        return Lacking("OpenCV's undistortPoints is not for these lenses")
    findings = []
    for name, camera in known.items():
        error = default_round_trip(camera)
        if not error <= CLOSE_PX:
            sentence = (
                f"{name}: cv2.undistortPoints as it is called without criteria leaves points at the border "
                f"{f'{error:.2g} px' if error < 1000 else 'more than 1000 px'} off."
            )
            findings.append(found("inverse-not-converged", sentence, min(error, 1e6), "px", name))
    return findings


def default_round_trip(camera: Camera) -> float:
    """The largest distance in pixels between a border pixel and its return from OpenCV's inverse with its defaults."""
    intrinsics, lens = camera.intrinsics, camera.lens
    pixels = border_pixels(camera)
    forward = lens.unproject(intrinsics.from_pixels(pixels))[..., 2]  # NaN where the lens folds
    pixels = pixels[forward > NEARLY_SIDEWAYS]
    if not len(pixels):
        return 0.0
    with np.errstate(all="ignore"):
        back = INVERSES[_opencv_model(lens)](camera, pixels)
        error = float(np.linalg.norm(back - pixels, axis=-1).max())
    return error if isfinite(error) else 1e6


def _opencv_model(lens: Lens) -> str:
    """What OpenCV calls a lens; nothing if it has none such."""
    return next((each.model for each in lens.spellings if each.program == "opencv"), "")


def _calib3d_and_back(camera: Camera, pixels: Array) -> Array:
    K, coefficients = camera.intrinsics.K, np.array(_values(camera.lens))
    ideal = cv2.undistortPoints(pixels.reshape(-1, 1, 2), K, coefficients).reshape(-1, 2)
    return camera.intrinsics.to_pixels(camera.lens.project_unchecked(on_plane(ideal)))


def _fisheye_and_back(camera: Camera, pixels: Array) -> Array:
    K, coefficients = camera.intrinsics.K, np.array(_values(camera.lens))
    ideal = cv2.fisheye.undistortPoints(pixels.reshape(-1, 1, 2), K, coefficients)
    return cv2.fisheye.distortPoints(ideal.reshape(-1, 1, 2), K, coefficients).reshape(-1, 2)


def _values(lens: Lens) -> list[float]:
    return [getattr(lens, name) for name in lens.parameters()]


INVERSES: dict[str, Callable[[Camera, Array], Array]] = {
    "distortion_coefficients": _calib3d_and_back,
    "cv2.fisheye": _fisheye_and_back,
}
