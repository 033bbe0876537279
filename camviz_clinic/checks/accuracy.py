"""What a calibration is good for: the directions of its cameras where the boards were and in the corners, and depths.

All ± are one standard deviation, as `Adjustment.covariance` has it.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import asdict, dataclass
from math import inf, isfinite, isnan, nan
from typing import Any

import numpy as np

from camviz.lenses.base import Array
from camviz_clinic.calibration.adjustment import Adjustment
from camviz_clinic.calibration.enumeration import enumerated
from camviz_clinic.calibration.uncertainty import projection_uncertainty
from camviz_clinic.checks.between_views import FEWEST_VIEWS
from camviz_clinic.checks.evidence import Evidence
from camviz_clinic.checks.findings.boards import cell_centres, coverage, covered_cells, within_reach
from camviz_clinic.checks.task import ANYWHERE_DEG, DEPTHS, MATCHING_PX, TaskError, direction_deviation, image_corners

MAX_DIRECTION_SIGMA_PX = 5.0
"""Above this a direction is useless: five times the goal (AprilCal's 1 px), where the true error is 3.5 px (median).

Of 250 healthy virtual cameras four exceed it in a corner. All four are truly farther off there than the goal.
"""
MAX_DISPARITY_SIGMA_PX = 1.0
"""Above this a pair's depth is useless: `camviz check` fails a pair at it, and matches are four times as exact."""


@dataclass(frozen=True)
class Accuracy:
    """What a calibration is good for, in sentences.

    Attributes:
        sentence: What it is good for, and what to do where that is too little.
        sufficient: Whether nothing in the sentence is useless; None where the accuracy is not known.
        values: The numbers behind it, for programs.
    """

    sentence: str
    sufficient: bool | None = None
    values: tuple[dict[str, Any], ...] = ()


UNREAD = Accuracy("")
NO_DETECTIONS = Accuracy("Its accuracy is not known: the file holds no corner detections.")


@dataclass(frozen=True)
class CameraAccuracy:
    """How well one camera's directions are known, 1σ in degrees and in pixels.

    Attributes:
        camera: Its name.
        coverage: The fraction of the image that lies inside the outline of some board.
        covered_deg, covered_px: The largest σ in that part of the image.
        corner_deg, corner_px: The largest σ in a corner of the image; infinite where the lens turns back before it,
            and NaN where all corners lie beyond a fisheye's circle.
        halves_px: The difference in a corner of solutions from halves of the images, 0 where noise explains it.
    """

    camera: str
    coverage: float
    covered_deg: float
    covered_px: float
    corner_deg: float
    corner_px: float
    halves_px: float = 0.0

    @property
    def covered_sufficient(self) -> bool:
        """Whether directions are of use where the boards were."""
        return self.covered_px <= MAX_DIRECTION_SIGMA_PX

    @property
    def corners_sufficient(self) -> bool:
        """Whether directions are of use in the corners that have a ray. From all images they are off by half of what
        two halves of them differ by."""
        return not (self.corner_px > MAX_DIRECTION_SIGMA_PX or self.halves_px / 2 > MAX_DIRECTION_SIGMA_PX)

    @property
    def sufficient(self) -> bool:
        """Whether directions are of use in the whole image."""
        return self.covered_sufficient and self.corners_sufficient

    @property
    def largest_px(self) -> float:
        """The largest σ in the covered part and in the corners that have a ray."""
        return self.covered_px if isnan(self.corner_px) else max(self.covered_px, self.corner_px)

    def values(self) -> dict[str, Any]:
        """The numbers, for programs; None where there is none."""
        told = asdict(self).items()
        return {key: value if isinstance(value, str) or isfinite(value) else None for key, value in told}

    def sentence(self, subject: str = "") -> str:
        """What the camera is good for; `subject` names it where there are several."""
        sentence = self._sentence()
        return f"{subject}: {sentence[0].lower()}{sentence[1:]}" if subject else sentence

    def _sentence(self) -> str:
        where = f"in the {100 * self.coverage:.0f} % of the image that the boards covered"
        if not self.covered_sufficient:
            known = f"{known_to(self.covered_deg, self.covered_px)} {where}"
            return f"Not good for measuring: {known}. Add sharp images of tilted boards all over the image."
        good = f"Good to {known_to(self.covered_deg)} {where}"
        if not isfinite(self.corner_px) and self.corners_sufficient:
            return f"{good}; a corner has no ray."
        if self.corners_sufficient:
            return f"{good}, {known_to(self.corner_deg)} in the worst corner."
        bad = [known_to(self.corner_deg, self.corner_px)] if isfinite(self.corner_px) else []
        if self.corner_px == inf:
            bad.append("the lens has no ray")
        if self.halves_px == inf:
            bad.append("half of the images give a lens without a ray there")
        elif self.halves_px:
            bad.append(f"halves of the images differ by {two_digits(self.halves_px)} px")
        return f"{good}. In the worst corner {', and '.join(bad)}: add images with the board in the corners."


def accuracy(evidence: Evidence, task: Sequence[TaskError] = ()) -> Accuracy:
    """What a calibration is good for, by its least accurate camera and pair; `task` are its task errors."""
    if not evidence.calibration.detections:
        return NO_DETECTIONS
    cameras = {name: camera_accuracy(evidence, name) for name in evidence.cameras}
    known = [each for each in cameras.values() if each and each.covered_px > 0]
    if not known and all(cameras.values()):
        return Accuracy("Its accuracy is not known: no camera was solved for.")
    pairs = [each for each in (_pair_accuracy(error) for error in task) if each]
    sentences = [min(pairs, key=lambda each: bool(each.sufficient)).sentence] if pairs else []
    if known:
        worst = max(known, key=lambda each: (not each.covered_sufficient, not each.sufficient, each.largest_px))
        sentences.append(worst.sentence(f"The least accurate camera, {worst.camera}" if len(cameras) > 1 else ""))
    if unknown := [name for name, each in cameras.items() if each is None]:
        sentences.append(f"Accuracy is not known of {enumerated(unknown)}: the corners do not determine it.")
    sufficient = not unknown and all(each.sufficient for each in known) and all(each.sufficient for each in pairs)
    return Accuracy(" ".join(sentences), sufficient, tuple(each.values() for each in known))


def camera_accuracy(evidence: Evidence, name: str) -> CameraAccuracy | None:
    """How well a camera's directions are known; None where the file's corners do not determine it."""
    calibration = evidence.calibration
    camera = calibration.cameras[name]
    try:
        adjustment = evidence.adjustment(name)
        pixels = calibration.used_pixels(name)
        covered = cell_centres(camera)[covered_cells(pixels, camera)]
        inside, outside = (_largest(adjustment, uv, name) for uv in (covered, image_corners(camera.intrinsics)))
    except (KeyError, ValueError, np.linalg.LinAlgError):  # no corners or poses, or too few to solve from
        return None
    if not isfinite(inside[1]):
        return None
    cells = np.ix_((0, -1), (0, -1))  # in the corners
    rays = camera.lens.unproject(camera.intrinsics.from_pixels(cell_centres(camera)[cells]))
    if (within_reach(camera)[cells] & ~np.isfinite(rays).all(axis=-1)).any():
        outside = inf, inf
    return CameraAccuracy(name, coverage(pixels, camera), *inside, *outside, _halves_px(evidence, name))


def _largest(adjustment: Adjustment, uv: Array, name: str) -> tuple[float, float]:
    """The largest σ at pixels uv (n, 2) that have a ray, in degrees and in pixels; NaN where none has one."""
    degrees = np.degrees(direction_deviation(adjustment, uv, camera=name))
    pixels = projection_uncertainty(adjustment, uv, camera=name)
    known = np.isfinite(degrees) & np.isfinite(pixels)
    return (float(degrees[known].max()), float(pixels[known].max())) if known.any() else (nan, nan)


def _halves_px(evidence: Evidence, name: str) -> float:
    """The largest difference in a corner, in pixels, of solutions from halves of the images, beyond noise."""
    if name not in evidence.observed or evidence.observed[name].best.posed.sum() < FEWEST_VIEWS:
        return 0.0
    try:
        partings = evidence.partings(name)
    except (ValueError, np.linalg.LinAlgError):  # a half that determines no camera
        return 0.0
    return max(partings.in_time.corner, partings.by_turns.corner)


def _pair_accuracy(error: TaskError) -> Accuracy | None:
    """What a pair's depth is good for; None for the task error of one camera."""
    depths = [z for z in DEPTHS if f"depth_{z:g}m_mm" in error.values]
    if not depths:
        return None
    total, own = (np.array([error.values[f"{key}_{z:g}m_mm"] for z in depths]) for key in ("depth", "calibration"))
    disparity_px = MATCHING_PX * float(np.min(own / np.sqrt(total**2 - own**2)))
    if disparity_px > MAX_DISPARITY_SIGMA_PX:
        known = f"±{_percent(own[0], depths[0])} at {depths[0]:g} m by the calibration alone"
        return Accuracy(f"Depth is not good for measuring: {known}. Add image pairs with a tilted board.", False)
    ends = " and ".join(f"±{_percent(total[i], depths[i])} at {depths[i]:g} m" for i in (0, -1))
    return Accuracy(f"Depth at the centre is good to {ends}, with matches to ±{MATCHING_PX:g} px.", True)


def known_to(degrees: float, px: float | None = None) -> str:
    """A σ of directions, in degrees and, where it is given, in pixels.

    >>> known_to(0.0228), known_to(1.98, 35.46), known_to(120.0, 4000.0)
    ('±0.023°', '±2° (±35 px)', 'not known')
    """
    if degrees > ANYWHERE_DEG:
        return "not known"
    return f"±{two_digits(degrees)}°" + ("" if px is None else f" (±{two_digits(px)} px)")


def two_digits(value: float) -> str:
    """A number to two digits, without an exponent: "0.023", "2", "140"."""
    return np.format_float_positional(float(f"{value:.2g}"), trim="-")


def _percent(millimetres: float, depth: float) -> str:
    return f"{two_digits(millimetres / 10 / depth)} %"
