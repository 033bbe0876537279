"""`inspect`: what is wrong with a calibration, in words, with the number that shows it, and what to do."""

from __future__ import annotations

import json
from collections.abc import Callable, Mapping, Sequence
from dataclasses import asdict, dataclass, field
from os import PathLike
from pathlib import Path
from typing import Any

import numpy as np

from camviz.calibration.types import Board, Calibration
from camviz.cameras import Camera
from camviz.clinic import checks_file, checks_lens, checks_model, checks_rig, checks_views
from camviz.clinic.catalogue import SEVERITIES, Check, Finding, Kind, Lacking, found, kinds
from camviz.clinic.evidence import Evidence
from camviz.files import CalibrationError, load

__all__ = ["CHECKS", "Finding", "Inspection", "Kind", "inspect", "inspect_file", "kinds"]

CHECKS: Mapping[str, Check] = {
    "not-a-rotation": checks_file.not_a_rotation,
    "bad-k": checks_file.bad_k,
    "coefficient-count": checks_file.coefficient_count,
    "zero-distortion": checks_file.zero_distortion,
    "aspect": checks_file.aspect,
    "wrong-size": checks_file.wrong_size,
    "principal-point": checks_file.principal_point,
    "fold": checks_lens.fold,
    "near-pole": checks_lens.near_pole,
    "inverse-not-converged": checks_lens.inverse_not_converged,
    "outlier-view": checks_views.outlier_view,
    "outlier-line": checks_views.outlier_line,
    "low-coverage": checks_views.low_coverage,
    "parallel-boards": checks_views.parallel_boards,
    "pose-absorbs-error": checks_views.pose_absorbs_error,
    "model-too-simple": checks_model.model_too_simple,
    "board-warp": checks_model.board_warp,
    "split-disagreement": checks_model.split_disagreement,
    "half-pixel": checks_model.half_pixel,
    "baseline-sign": checks_rig.baseline_sign,
    "baseline-scale": checks_rig.baseline_scale,
    "rectified-black": checks_rig.rectified_black,
    "inverted-transform": checks_rig.inverted_transform,
    "mirrored-frame": checks_rig.mirrored_frame,
    "corner-order": checks_rig.corner_order,
}
JSON_KEYS = ("id", "severity", "sentence", "value", "unit", "camera", "view", "causes", "remedy")


@dataclass(frozen=True, eq=False)
class Inspection:
    """What was found in a calibration, the worst first; what was checked; and what could not be, each with the reason.

    `calibration` is None where the file has a fault that leaves nothing to look at.
    """

    calibration: Calibration | None
    findings: tuple[Finding, ...]
    checked: tuple[str, ...]
    skipped: tuple[tuple[str, str], ...] = ()
    compare: Calibration | None = field(default=None, repr=False)

    @property
    def healthy(self) -> bool:
        """True where nothing worse than a note was found."""
        return all(finding.severity == "note" for finding in self.findings)

    def as_json(self) -> str:
        """For programs: cameras, findings, checked, skipped, as docs/clinic.md has them."""
        return json.dumps(self.as_tree(), indent=2, ensure_ascii=False)

    def as_tree(self) -> dict[str, Any]:
        """What `as_json` writes, as dicts and lists."""
        cameras = self.calibration.cameras if self.calibration else {}
        return {
            "cameras": [self._camera(name, camera) for name, camera in cameras.items()],
            "findings": [{key: _plain(asdict(each)[key]) for key in JSON_KEYS} for each in self.findings],
            "checked": list(self.checked),
            "skipped": [{"id": id, "why": why} for id, why in self.skipped],
        }

    def _camera(self, name: str, camera: Camera) -> dict[str, Any]:
        grid = camera.intrinsics
        lens: Any = camera.lens
        pinhole = {key: getattr(grid, key) for key in ("width", "height", "fx", "fy", "cx", "cy")}
        distortion = {key: float(value) for key, value in asdict(lens).items()}
        return (
            {"name": name, "model": type(lens).__name__} | pinhole | {"distortion": distortion, "rms": self.rms(name)}
        )

    def rms(self, name: str) -> float | None:
        """The error of a camera in pixels over all its views, None where the calibration does not hold it."""
        errors = self.calibration.per_view_errors.get(name) if self.calibration else None
        if errors is None or not np.isfinite(errors).any():
            return None
        return float(np.sqrt(np.nanmean(np.square(errors))))

    def as_text(self) -> str:
        """For people: the findings in plain words, then what was checked, and what was not and why."""
        lines = [line for finding in self.findings for line in (*_said(finding), "")]
        if not self.findings:
            lines = ["Nothing found.", ""]
        lines += [f"Checked: {', '.join(self.checked)}."] if self.checked else []
        reasons: dict[str, list[str]] = {}
        for id, why in self.skipped:
            reasons.setdefault(why, []).append(id)
        lines += [f"Not checked, {why}: {', '.join(ids)}." for why, ids in reasons.items()]
        return "\n".join(lines)

    def __str__(self) -> str:
        return self.as_text()


def inspect(
    calibration: Calibration,
    *,
    compare: Calibration | None = None,
    pictures: Mapping[str, tuple[int, int]] | None = None,
    board: Board | None = None,
) -> Inspection:
    """What is wrong with a calibration.

    `compare` is another calibration of the same cameras. `pictures` are the sizes (width, height) of pictures by
    their names that the calibration is meant for. `board` is the board as it was measured, where that is known.
    """
    evidence = Evidence(calibration, compare, pictures or {}, board)
    findings: list[Finding] = []
    checked, skipped = [], []
    for id, check in CHECKS.items():
        outcome = check(evidence)
        if isinstance(outcome, Lacking):
            skipped.append((id, outcome.why))
        else:
            checked.append(id)
            findings += outcome
    findings.sort(key=lambda finding: SEVERITIES.index(finding.severity))
    return Inspection(calibration, tuple(findings), tuple(checked), tuple(skipped), compare)


def inspect_file(
    path: str | PathLike[str],
    *,
    size: tuple[int, int] | None = None,
    compare: Calibration | None = None,
    pictures: Mapping[str, tuple[int, int]] | None = None,
    board: Board | None = None,
    prepare: Callable[[Calibration], Calibration] | None = None,
) -> Inspection:
    """What is wrong with a calibration file, also with one that every other command refuses.

    `prepare` may add to what was read, such as the corners in pictures; the rest is as of `inspect`. Raises
    CalibrationError where the file is not a calibration at all.
    """
    try:
        calibration = load(path, size=size, mend=True)
    except CalibrationError as error:
        if not error.id:
            raise
        finding = found(error.id, f"{str(error).removeprefix(f'{Path(path)}: ')}.", error.value)
        why = "the file could not be read beyond the fault above"
        return Inspection(None, (finding,), (error.id,), tuple((id, why) for id in CHECKS if id != error.id))
    calibration = prepare(calibration) if prepare else calibration
    return inspect(calibration, compare=compare, pictures=pictures, board=board)


def _said(finding: Finding) -> Sequence[str]:
    marks = {"fault": "✗", "warning": "!", "note": "·"}
    lines = [f"{marks[finding.severity]} {finding.severity} {finding.id}: {finding.sentence}"]
    lines += [f"    likely: {'; '.join(finding.causes)}."] if finding.causes else []
    return [*lines, f"    remedy: {finding.remedy}"]


def _plain(value: Any) -> Any:
    return list(value) if isinstance(value, tuple) else value
