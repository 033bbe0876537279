"""A calibration at a glance: where it comes from, its numbers with their uncertainties, and what to do next."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from datetime import datetime
from functools import cached_property
from math import inf
from typing import Any

import numpy as np

from camviz_clinic.calibration.detection import seen
from camviz_clinic.calibration.enumeration import enumerated
from camviz_clinic.calibration.guidance import instruction, next_board_poses
from camviz_clinic.calibration.types import Calibration
from camviz_clinic.calibration.uncertainty import largest_expected_error, projection_uncertainty
from camviz_clinic.checks.accuracy import MAX_DIRECTION_SIGMA_PX, Accuracy, accuracy
from camviz_clinic.checks.evidence import Evidence
from camviz_clinic.checks.stamps import holds_for
from camviz_clinic.checks.task import TaskError, image_corners, task_errors

GOOD = 1.0  # pixels: where the largest expected error is below this, no more pictures are asked for (AprilCal's limit)
UNKNOWN = "not in the file"
MOST_CAMERAS = 4
RMS, MIDDLE, CORNER = "RMS error", "uncertainty, centre", "uncertainty, worst corner"
BEND = ("board's bend along rows", "board's bend along columns")
LEGEND = (
    "± is one standard deviation, by the scatter of the views and by whether the board is flat; "
    "uncertainty: of the pixel of a far point."
)


def bend_mm(calibration: Calibration) -> tuple[list[float], list[float] | None] | None:
    """The board's two sagittas and their σ in mm; None where the bend was not solved for, and for an unknown σ."""
    warp, covariance = calibration.board_warp, calibration.board_warp_covariance
    if warp is None:
        return None
    sigmas = None if covariance is None else (1000 * np.sqrt(np.diag(covariance))).tolist()
    return (1000 * warp).tolist(), sigmas


@dataclass(frozen=True, eq=False)
class Summary:
    """What an engineer asks of a calibration first, in words and numbers without markup."""

    evidence: Evidence
    at: float | None = None  # metres, a distance at which errors are told too
    goal: float = GOOD

    @classmethod
    def of(cls, calibration: Calibration, at: float | None = None, goal: float = GOOD) -> Summary:
        """The summary of a calibration by itself."""
        return cls(Evidence(calibration), at, goal)

    @property
    def calibration(self) -> Calibration:
        """What it is of."""
        return self.evidence.calibration

    @cached_property
    def origin(self) -> tuple[str, ...]:
        """The file, when it was made or else written, its format, the cameras, and how many pictures were used."""
        calibration, cameras = self.calibration, self.calibration.cameras
        path = calibration.source
        known = path.name and path.exists()
        made = ", ".join(dict.fromkeys(stamp.made for stamp in calibration.stamps.values() if stamp.made))
        written = f"written {datetime.fromtimestamp(path.stat().st_mtime):%Y-%m-%d %H:%M}" if known else ""
        written = f"calibrated {made}" if made else written
        sizes = {f"{k.width} × {k.height}" for k in (camera.intrinsics for camera in cameras.values())}
        named = ", ".join(list(cameras)[:MOST_CAMERAS]) + ", …" * (len(cameras) > MOST_CAMERAS)
        shown = "one camera" if named == "camera" else f"{len(cameras)} camera{'s' * (len(cameras) > 1)}: {named}"
        shown += f", {', '.join(sorted(sizes))} px"
        parts = (path.name, written, calibration.format, shown, self.pictures)
        return tuple(part for part in parts if part)

    @property
    def pictures(self) -> str:
        """How many pictures were used, of how many that were given."""
        calibration = self.calibration
        used = [calibration.used(name).any(axis=1) for name in calibration.detections]
        if used:
            count = sum(int(mask.sum()) for mask in used)
            given = sum(int(seen(corners).any(axis=1).sum()) for corners in calibration.detections.values())
            return f"{count} of {given + len({name for name, _ in calibration.skipped})} pictures used"
        views = sum(len(errors) for errors in calibration.per_view_errors.values())
        return f"{views} views" if views else "the file does not name its pictures"

    def rms(self, name: str) -> float | None:
        """The RMS in pixels of a camera's corners: the file's, else of its corners; None where both are unknown."""
        stated, observed = self.calibration.rms(name), self.evidence.observed.get(name)
        if stated is not None or observed is None:
            return stated
        used = observed.adjustment.used[name]
        return float(np.sqrt(np.mean(np.sum(observed.residuals[used] ** 2, axis=-1)))) if used.any() else None

    @cached_property
    def names(self) -> tuple[str, ...]:
        """The cameras that are told of: those that differ, the first few of many."""
        return tuple(self.evidence.cameras)[:MOST_CAMERAS]

    @cached_property
    def uncertainty(self) -> dict[str, tuple[float, float] | None]:
        """By camera, 1σ in pixels of where a far point is seen, in the middle and in the worst corner of the picture.

        None where the file's corners do not determine it; NaN for a corner of the picture that has no ray.
        """
        return {name: self._uncertainty(name) for name in self.names}

    def _uncertainty(self, name: str) -> tuple[float, float] | None:
        corners_uv = image_corners(self.calibration.cameras[name].intrinsics)
        pixels = np.vstack([corners_uv.mean(axis=0), corners_uv])
        try:
            middle, *corners = projection_uncertainty(self.evidence.adjustment(name), pixels, camera=name)
        except (ValueError, np.linalg.LinAlgError):  # no corners or poses, or too few to solve from
            return None
        return (float(middle), float(np.max(corners))) if np.isfinite(middle) else None

    @cached_property
    def task(self) -> tuple[TaskError, ...]:
        """What the first cameras, and each pair, are worth to a task."""
        return task_errors(self.evidence, self.at, self.names)

    @cached_property
    def accuracy(self) -> Accuracy:
        """What the calibration is good for, by its least accurate camera and pair."""
        return accuracy(self.evidence, self.task)

    @property
    def worth(self) -> tuple[str, ...]:
        """What the task errors say beyond `accuracy`: the depths of pairs, and errors at a distance."""
        return tuple(each.sentence for each in self.task if self.at is not None or len(each.cameras) > 1)

    @cached_property
    def largest_errors(self) -> dict[str, float]:
        """By camera, the largest expected error of a far point in pixels (Max ERE), where the corners determine it."""
        found = {name: self.largest_error(name) for name in self.names}
        return {name: error for name, error in found.items() if error is not None}

    def largest_error(self, name: str) -> float | None:
        """A camera's largest expected error of a far point in pixels; None where the corners do not determine it."""
        known = self.uncertainty[name] if name in self.names else self._uncertainty(name)
        return largest_expected_error(self.evidence.adjustment(name), name) if known else None

    def table(self) -> dict[str, dict[str, str]]:
        """By camera: every number with its ± σ, the RMS and the uncertainty of projection, as text."""
        return {name: dict(self._rows(name)) for name in self.names}

    def _rows(self, name: str) -> Iterator[tuple[str, str]]:
        camera = self.calibration.cameras[name]
        grid, lens = camera.intrinsics, camera.lens
        rms, known = self.rms(name), self.uncertainty[name]
        yield RMS, UNKNOWN if rms is None else f"{rms:.3f} px"
        longer = max(grid.width, grid.height)
        middle, corner = (UNKNOWN,) * 2 if known is None else (_pixels(each, longer) for each in known)
        yield MIDDLE, middle
        yield CORNER, corner
        yield "image", f"{grid.width} × {grid.height} px"
        yield "lens", type(lens).__name__
        values = {key: getattr(grid, key) for key in ("fx", "fy", "cx", "cy", "skew")} | _parameters(lens)
        for key, value in values.items():
            sigma = inf if key in self.undecided(name) else self.evidence.sigma_of(name, key)
            if sigma is not None or value or key in ("cx", "cy"):
                yield key, measured(value, sigma)
        if delay := self.calibration.line_delays.get(name):
            sigma = None if delay.sigma is None else 1e6 * delay.sigma
            yield "line delay", f"{measured(1e6 * delay.seconds, sigma)} µs"
        yield from self.bend.items()

    def undecided(self, name: str) -> tuple[str, ...]:
        """The parameters of a camera whose ± is withheld, because its corners do not decide them (`unidentifiable`)."""
        combinations = self.evidence.undecided(name)
        found = {key for each in combinations for key in each.changes}
        return tuple(key for key in combinations[0].names if key in found) if found else ()

    @property
    def withheld(self) -> tuple[str, ...]:
        """Why a ± is not told, in a sentence for every camera that lacks one."""
        lacking = {name: enumerated(self.undecided(name)) for name in self.names if self.undecided(name)}
        return tuple(
            f"{name}: the ± of {keys} is not known, because the corners do not decide "
            f"{'them' if ' ' in keys else 'it'} (unidentifiable)."
            for name, keys in lacking.items()
        )

    @property
    def bend(self) -> dict[str, str]:
        """The board's two sagittas with their ± σ in mm, as text, where the bend was solved for."""
        if (found := bend_mm(self.calibration)) is None:
            return {}
        sagittas, sigmas = found
        deviations: Sequence[float | None] = sigmas or (None, None)
        told = map(measured, sagittas, deviations)
        return dict(zip(BEND, (f"{each} mm" for each in told), strict=True))

    @property
    def bend_sentence(self) -> str:
        """The same as a sentence; empty where the bend was not solved for."""
        if not self.bend:
            return ""
        rows, columns = self.bend.values()
        return f"The board's bend was solved for: {rows} along its rows, {columns} along its columns."

    @property
    def holds(self) -> tuple[str, ...]:
        """What the calibration of each camera holds for, in sentences; nothing where the file does not say."""
        said = (holds_for(self.calibration, name) for name in self.names)
        return tuple(sentence for sentence in said if sentence)

    def lines(self, below_verdict: bool = False) -> Iterator[str]:
        """The same in a few lines: the origin, what it holds for, and each camera's RMS and uncertainty.

        `below_verdict` leaves out what a verdict without findings has said.
        """
        yield " · ".join(self.origin)
        yield from self.holds
        for name, rows in self.table().items():
            pinhole = ", ".join(f"{key} = {rows[key]}" for key in ("fx", "fy", "cx", "cy"))
            others = "; ".join(f"{key} {rows[key]}" for key in (RMS, MIDDLE, CORNER) if rows[key] != UNKNOWN)
            yield f"{name}: {pinhole} px{'; ' * bool(others)}{others}."
        yield from self.withheld
        if self.bend_sentence:
            yield self.bend_sentence
        yield from self.worth if below_verdict else (each.sentence for each in self.task)

    @cached_property
    def guidance(self) -> str:
        """Whether there are enough pictures, else where to hold the board next; of the camera that is known worst.

        Empty where the file's corners do not tell.
        """
        if not self.largest_errors:
            return ""
        name = max(self.largest_errors, key=lambda each: self.largest_errors[each])
        largest, of = self.largest_errors[name], "" if len(self.names) == 1 else f" of {name}"
        longer = max(self.calibration.cameras[name].intrinsics.width, self.calibration.cameras[name].intrinsics.height)
        off = f"{largest:.2g} px off" if largest < longer else "farther off than the picture is long"
        said = f"where it is worst{of}, a far point is expected to be {off} (Max ERE)"
        if largest <= self.goal <= MAX_DIRECTION_SIGMA_PX and self.accuracy.sufficient is False:
            return ""  # what the accuracy asks for comes first
        if largest <= self.goal:
            return f"There are enough pictures: {said}, within the goal of {self.goal:g} px."
        try:
            best = next_board_poses(self.evidence.adjustment(name), camera=name)[0]
        except (ValueError, np.linalg.LinAlgError):  # no pose shows the whole board
            return f"Take more pictures with the board near the corners: {said}, and the goal is {self.goal:g} px."
        hold = instruction(self.evidence.adjustment(name), best, name)
        return (
            f"Take one picture more: {hold}. Now, {said}, and the goal is {self.goal:g} px; that picture would take "
            f"the mean uncertainty from {best.before:.2g} px to {best.after:.2g} px."
        )


def measured(value: float, sigma: float | None) -> str:
    """A number with its standard deviation, both to the second digit of that; infinite is one that is not known.

    >>> measured(532.9187, 0.4112), measured(0.0828, 0.000213), measured(0.25, None), measured(1, 0), measured(7, inf)
    ('532.92 ± 0.41', '0.08280 ± 0.00021', '0.25', '1 ± 0', '7 ± not known')
    """
    if sigma is None or sigma == inf:
        return f"{value:.6g}{' ± not known' * (sigma is not None)}".replace("-", "−")
    if not (np.isfinite(sigma) and sigma > 0):
        return f"{value:.6g} ± {sigma:g}".replace("-", "−")
    decimals = int(np.clip(1 - np.floor(np.log10(sigma)), 0, 9))
    return f"{value:.{decimals}f} ± {sigma:.{decimals}f}".replace("-", "−")


def _parameters(lens: Any) -> dict[str, float]:
    return {key: float(getattr(lens, key)) for key in lens.parameters()}


def _pixels(sigma: float, longer: float) -> str:
    """An uncertainty in a picture that is so long."""
    if not np.isfinite(sigma):
        return "no ray"
    return f"±{sigma:.2g} px" if sigma < longer else "not known"
