"""What a lens does inside its own image: whether it folds, comes near a pole, and can be inverted."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import replace
from math import cos, degrees, inf, isfinite, pi, radians
from pathlib import Path
from typing import Any

import cv2
import numpy as np

from camviz.cameras import Camera, Intrinsics
from camviz.distortion import (
    ideal_image_radius,
    image_corner_radius,
    image_reach,
    is_rational,
    pole_radius,
    valid_region,
    weakest_denominator,
)
from camviz.distortion.limits import NEARLY_A_POLE
from camviz.lenses import BrownConrady
from camviz.lenses.base import Array, Fold, Lens, on_plane
from camviz_clinic.calibration.adjustment import Adjustment
from camviz_clinic.calibration.enumeration import enumerated
from camviz_clinic.calibration.types import Calibration
from camviz_clinic.checks.evidence import Evidence, NotChecked
from camviz_clinic.checks.registry import Finding, Rng, finding
from camviz_clinic.checks.virtual import alone, healthy
from camviz_clinic.files.parameter_layouts import LAYOUTS

LOST = 0.01  # of the pixels, fewer than which may fold
MAX_FOLDED_BEYOND_CORNERS = 0.1  # of the pixels: a fold that takes more is a fault, wherever corners were seen
CLOSE_PX = 0.5  # how well a pixel must return from OpenCV's inverse
STEPS = (100, 1000)  # of OpenCV's inverse, tried in this order
NEARLY_SIDEWAYS = cos(radians(85))  # beyond, a ray has no point on the plane z = 1 worth the name


@finding(
    "fold",
    severity="fault",
    view="fold-map",
    symptom="The border mirrors or folds back after undistortion.",
    causes=("a distortion polynomial that turns back inside the image", "no corners near the border in the fit"),
    remedy="Take fewer terms and solve again with more views that reach the border.",
    threshold="Any such pixel lies on the border. It is a note where less than 1 % of the pixels are lost, and up to "
    "10 % beyond the last corner of the board. So it is for a fisheye beyond 90°, whose picture may end before.",
    explains=("inverse-not-converged", "rectified-black"),
)
def fold(evidence: Evidence) -> Iterator[Finding]:
    """The check looks for pixels at which no ray arrives. The way there from the axis passes a root of g'(r) or of the
    Jacobian's determinant.
    """
    bent = {name: camera for name, camera in evidence.cameras.items() if camera.lens.can_fold}
    if not bent:
        raise NotChecked("no lens here has a polynomial that could turn back")
    for name, camera in bent.items():
        yield from _fold(evidence, name, camera)


def _fold(evidence: Evidence, name: str, camera: Camera) -> Iterator[Finding]:
    lens, turn = camera.lens, camera.lens.fold
    turns = turn is not None and turn.angle < inf
    if _seen(camera, border_pixels(camera)).all() or not (turns or lens.may_mirror) or _ends_before_pole(lens):
        return
    lost = _lost(camera)
    sentence = f"{name}: {_percent(lost)} of the pixels have no ray of their own. The distortion {_where(camera)}."
    if turn is None or not turns:
        yield fold.found(sentence, lost, "", name)
        return
    corners = evidence.calibration.detections.get(name)
    seen = corners is not None and not _corners_lost(evidence, name, camera) and lost <= MAX_FOLDED_BEYOND_CORNERS
    beyond = turn.angle >= pi / 2 and not _corners_lost(evidence, name, camera)
    severity = "note" if beyond or seen or lost < LOST else fold.severity
    yield fold.found(sentence, turn.radius, turn.unit, name, severity=severity, remedy=_unfolded(camera, turn))


def _lost(camera: Camera) -> float:
    """The fraction of the pixels at which no ray arrives."""
    return 1 - float(valid_region(camera, max(1, camera.intrinsics.width // 128)).mean())


def _percent(fraction: float) -> str:
    return f"{fraction:.0%}" if fraction >= 0.01 else "less than 1 %"


def _ends_before_pole(lens: Lens) -> bool:
    """Whether a pole ends the lens that its numerator almost cancels: `near_pole` reports it."""
    return isinstance(lens, BrownConrady) and lens.cancelled_radius <= lens.limit_radius < inf


def _unfolded(camera: Camera, turn: Fold) -> str:
    """What takes the fold out of the image: the fewest radial terms without which there is none, each choice tried."""
    lens: Any = camera.lens
    used = [name for name in lens.parameters() if name.startswith("k") and getattr(lens, name)]
    for count in range(1, len(used)):
        left_out = tuple(used[-count:])
        without = replace(camera, lens=replace(lens, **dict.fromkeys(left_out, 0.0)))
        if _seen(without, border_pixels(without)).all():
            return f"Fix {enumerated(left_out)} to 0, and solve again with more views that reach the border."
    radius = turn.image * min(camera.intrinsics.fx, camera.intrinsics.fy)
    return (
        "Solve again with more views that reach the border, with all of the model's radial terms. "
        f"Until then use only pixels within {radius:.0f} px of the principal point."
    )


def _where(camera: Camera) -> str:
    turn, corner = camera.lens.fold, image_corner_radius(camera.intrinsics)
    if turn is None:
        return "mirrors part of the image (the determinant of its Jacobian reaches 0)"
    radius = "" if turn.unit == "rad" else f"at r = {turn.radius:.4g}, "
    return (
        f"turns back {radius}{degrees(turn.angle):.1f}° from the axis, which is {turn.image:.3g} focal lengths from "
        f"the principal point in the image. The farthest corner is at {corner:.3g}"
    )


def _seen(camera: Camera, pixels: Array) -> np.ndarray:
    return np.isfinite(camera.lens.unproject(camera.intrinsics.from_pixels(pixels))[..., 0])


def _corners_lost(evidence: Evidence, name: str, camera: Camera) -> bool:
    pixels = evidence.calibration.detections.get(name)
    return pixels is not None and not _seen(camera, pixels[np.isfinite(pixels).all(axis=-1)]).all()


def border_pixels(camera: Camera, samples: int = 16) -> Array:
    """The centres of pixels all along the border (n, 2)."""
    grid = camera.intrinsics
    return np.asarray(np.clip(grid.border(samples), [0, 0], [grid.width - 1, grid.height - 1]))


@fold.fault("folding polynomial", "of the corner's radius", (1.6, 0.95, 0.8), promised=0.95, beyond_doubt=(0.7, 0.9))
def folding(rng: Rng, strength: float) -> Evidence:
    """The polynomial turns back: k3 makes g'(r) = 0 there."""
    solved = healthy(rng)
    camera = solved.cameras["camera"]
    lens = BrownConrady(k1=-0.2, k2=0.04)
    r = strength * ideal_image_radius(replace(camera, lens=lens))
    k3 = -(1 + 3 * lens.k1 * r**2 + 5 * lens.k2 * r**4) / (7 * r**6)
    return Evidence(alone(solved, replace(camera, lens=replace(lens, k3=k3))))


@finding(
    "near-pole",
    severity="fault",
    view="fold-map",
    symptom="The undistorted picture shows a ring or garbage.",
    causes=(
        "a rational model whose denominator comes close to zero in or near the image",
        "more coefficients than the corners can determine",
    ),
    remedy="Solve again with fewer terms (the standard model), or with corners out to the edge of the image.",
    threshold="D falls below 0.2, where every error of the numerator counts five times, or there is a pole.",
    explains=("inverse-not-converged", "rectified-black"),
)
def near_pole(evidence: Evidence) -> Iterator[Finding]:
    """The check follows the denominator D(r²) = 1 + k4 r² + k5 r⁴ + k6 r⁶ out to the farthest ray that an undistorted
    picture asks for.
    """
    rational = {name: camera for name, camera in evidence.cameras.items() if is_rational(camera.lens)}
    if not rational:
        raise NotChecked("no lens here has a denominator (k4 k5 k6)")
    for name, camera in rational.items():
        lens, reach = camera.lens, image_reach(camera)
        radius, least = weakest_denominator(lens, reach)
        pole, cut = pole_radius(lens), _ends_before_pole(lens) and not _seen(camera, border_pixels(camera)).all()
        if pole <= reach or cut:
            what, radius, least = "is 0, which is a pole,", pole, min(least, 0.0)
        elif least < NEARLY_A_POLE:
            what = f"falls to {least:.3g}"
        else:
            continue
        lost = f" Beyond it {_percent(_lost(camera))} of the pixels have no ray." if cut else ""
        sentence = (
            f"{name}: the denominator of the rational model {what} at r = {radius:.4f} focal lengths. "
            f"The image reaches to {reach:.4f}.{lost}"
        )
        yield near_pole.found(sentence, least, "", name)


@near_pole.fault("near-pole rational model", "", (0.5, 0.15, 0.05), promised=0.15)
def close_to_a_pole(rng: Rng, strength: float) -> Evidence:
    """The denominator has this value at the farthest corner's ray.

    It fits the corners: N = D (1 + k1 s + k2 s² + k3 s³) up to s³, with D = 1 + k4 s, adjusted with that k4.
    """
    solved = healthy(rng)
    camera = solved.cameras["camera"]
    lens = camera.lens
    assert isinstance(lens, BrownConrady)
    k4 = -(1 - strength) / ideal_image_radius(camera) ** 2
    k1, k2, k3 = lens.k1 + k4, lens.k2 + lens.k1 * k4, lens.k3 + lens.k2 * k4
    start = replace(camera, lens=replace(lens, k1=k1, k2=k2, k3=k3, k4=k4))
    best = replace(Adjustment.of(solved), cameras={"camera": start}).refined()
    return Evidence(replace(solved, cameras=best.cameras, cam_from_board={"camera": best.first_from_board}))


@finding(
    "inverse-not-converged",
    severity="note",
    view="undistorted",
    symptom="Undistorted points are wrong at the border.",
    causes=("cv2.undistortPoints, which stops after a few iterations unless it is told otherwise",),
    remedy="Pass criteria to undistortPoints, such as (cv2.TERM_CRITERIA_MAX_ITER | cv2.TERM_CRITERIA_EPS, 100, 1e-9), "
    "and project the result back.",
    threshold="A pixel and its return are 0.5 px apart.",
)
def inverse_not_converged(evidence: Evidence) -> Iterator[Finding]:
    """The check sends border pixels through OpenCV's inverse with its default criteria, and forward again through the
    polynomial.
    """
    known = {name: camera for name, camera in evidence.cameras.items() if _opencv_model(camera.lens) in INVERSES}
    if not known:
        raise NotChecked("OpenCV's undistortPoints is not for these lenses")
    for name, camera in known.items():
        error = round_trip(camera)
        if not error <= CLOSE_PX:
            off = f"{error:.2g} px" if error < 1000 else "more than 1000 px"
            fisheye = _opencv_model(camera.lens) == "cv2.fisheye"
            called = "cv2.fisheye.undistortPoints" if fisheye else "cv2.undistortPoints"
            sentence = f"{name}: {called} without criteria leaves points at the border {off} off."
            said = {
                "causes": (f"{called}, which stops after a few iterations unless it is told otherwise",),
                "remedy": _converging(camera, called),
            }
            yield inverse_not_converged.found(sentence, min(error, 1e6), "px", name, **said)


def _converging(camera: Camera, called: str) -> str:
    """The fewest of some iterations that bring OpenCV's inverse home in this camera, each tried."""
    steps = next((each for each in STEPS if round_trip(camera, each) <= CLOSE_PX), None)
    if steps is None:
        return f"{called} does not converge here. Use camera.unproject of camviz.load, or the maps of camviz lut."
    return inverse_not_converged.remedy.replace("undistortPoints", called, 1).replace("100", str(steps))


def round_trip(camera: Camera, steps: int | None = None) -> float:
    """The largest distance in pixels between a border pixel and its return from OpenCV's inverse.

    OpenCV takes so many `steps`, or its default criteria.
    """
    intrinsics, lens = camera.intrinsics, camera.lens
    pixels = border_pixels(camera)
    forward = lens.unproject(intrinsics.from_pixels(pixels))[..., 2]  # NaN where the lens folds
    pixels = pixels[forward > NEARLY_SIDEWAYS]
    if not len(pixels):
        return 0.0
    with np.errstate(all="ignore"):
        back = INVERSES[_opencv_model(lens)](camera, pixels, steps)
        error = float(np.linalg.norm(back - pixels, axis=-1).max())
    return error if isfinite(error) else 1e6


def _opencv_model(lens: Lens) -> str:
    """What OpenCV calls a lens; nothing if it has none such."""
    return next((model.name for model in LAYOUTS["opencv"] if model.lens is type(lens)), "")


def _criteria(steps: int | None) -> dict[str, Any]:
    return {} if steps is None else {"criteria": (cv2.TERM_CRITERIA_MAX_ITER | cv2.TERM_CRITERIA_EPS, steps, 1e-9)}


def _calib3d_and_back(camera: Camera, pixels: Array, steps: int | None) -> Array:
    K, coefficients = camera.intrinsics.K, np.array(_values(camera.lens))
    if steps is not None and hasattr(cv2, "undistortPointsIter"):  # what OpenCV 4 calls it with criteria
        ideal = cv2.undistortPointsIter(pixels.reshape(-1, 1, 2), K, coefficients, None, None, **_criteria(steps))
    else:
        ideal = cv2.undistortPoints(pixels.reshape(-1, 1, 2), K, coefficients, **_criteria(steps))
    ideal = ideal.reshape(-1, 2)
    return camera.intrinsics.to_pixels(camera.lens.project_unchecked(on_plane(ideal)))


def _fisheye_and_back(camera: Camera, pixels: Array, steps: int | None) -> Array:
    K, coefficients = camera.intrinsics.K, np.array(_values(camera.lens))
    ideal = cv2.fisheye.undistortPoints(pixels.reshape(-1, 1, 2), K, coefficients, **_criteria(steps))
    return cv2.fisheye.distortPoints(ideal.reshape(-1, 1, 2), K, coefficients).reshape(-1, 2)


def _values(lens: Lens) -> list[float]:
    return [getattr(lens, name) for name in lens.parameters()]


INVERSES: dict[str, Callable[[Camera, Array, int | None], Array]] = {
    "distortion_coefficients": _calib3d_and_back,
    "cv2.fisheye": _fisheye_and_back,
}


@inverse_not_converged.fault("strong lens", "-k1", (0.1, 0.25, 0.35), promised=0.35)
def strong_lens(rng: Rng, strength: float) -> Evidence:
    """A barrel lens is 80° wide."""
    lens = BrownConrady(k1=-strength, k2=0.5 * strength**2)
    camera = Camera(Intrinsics.from_fov(1280, 960, 80), lens)
    return Evidence(Calibration({"camera": camera}, Path("virtual"), "OpenCV FileStorage"))
