"""Experiments with one virtual camera: ten boards, one fault of any strength, and a plain least-squares solution.

It is as small as an inspection allows, so that a slider can move it. Nothing is set aside as an outlier here: a fault
may do all the harm it can. `LabFault`, beside the findings in `camviz_clinic.checks.findings`, says what each fault
changes.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property, lru_cache
from pathlib import Path

import numpy as np

from camviz.cameras import Camera, Intrinsics
from camviz.distortion import image_corner_radius
from camviz.lenses import BrownConrady
from camviz.lenses.base import Array
from camviz_clinic.calibration.adjustment import Adjustment
from camviz_clinic.calibration.difference import Difference, difference, pixel_grid
from camviz_clinic.calibration.jacobian import with_parameters
from camviz_clinic.calibration.types import Board, Calibration
from camviz_clinic.calibration.uncertainty import mean_deviation, projection_covariance
from camviz_clinic.checks.findings import faults
from camviz_clinic.checks.inspection import Inspection, inspect
from camviz_clinic.checks.registry import LabFault
from camviz_clinic.checks.virtual import SetUp, spread_boards

BOARD = Board(9, 6, 0.025)
VIEWS = 10
GRID = (12, 9)  # pixels at which two cameras are compared


def lab_faults() -> dict[str, LabFault]:
    """The faults that the fault lab shows, by their names."""
    return {name: fault.lab for name, fault in faults().items() if fault.lab}


@dataclass(frozen=True, eq=False)
class Experiment:
    """What was true, and what was solved from it: `solved` is the adjustment at the calibration's numbers."""

    truth: Camera
    solved: Adjustment
    words: str

    @property
    def camera(self) -> Camera:
        return self.solved.cameras["camera"]

    @cached_property
    def calibration(self) -> Calibration:
        """As a file would hold it."""
        names = tuple(f"view{view + 1:02}.png" for view in range(self.solved.views))
        return Calibration(
            dict(self.solved.cameras),
            Path("virtual"),
            "camviz",
            board=self.solved.board,
            detections=dict(self.solved.detections),
            cam_from_board={"camera": self.solved.first_from_board},
            per_view_errors={"camera": self.errors},
            pictures={"camera": names},
            estimated=dict(self.solved.estimated),
        )

    @cached_property
    def inspection(self) -> Inspection:
        """What the clinic says of it."""
        return inspect(self.calibration)

    @cached_property
    def residuals(self) -> Array:
        """Detected less projected, in pixels (views, corners, 2)."""
        return self.solved.residuals["camera"]

    @cached_property
    def errors(self) -> Array:
        """The RMS (views,) of every view."""
        return self.solved.view_rms("camera")

    @cached_property
    def believed(self) -> Array:
        """How far off the solution takes its projections to be, in pixels (rows, columns) of `GRID`, RMS distance."""
        uv = pixel_grid(self.camera.intrinsics, GRID)
        return np.asarray(np.sqrt(2) * mean_deviation(projection_covariance(self.solved, uv)))

    @cached_property
    def off(self) -> Difference:
        """How far off they are, against the true camera."""
        believed = np.maximum(self.believed, 1e-9)
        return difference(self.camera, self.truth, grid=GRID, uncertainties=(believed, believed))

    @cached_property
    def estimates(self) -> dict[str, tuple[float, float]]:
        """By parameter: estimated less true, and its σ, in pixels; of k1 and k2 what they do at the image's corner."""
        found: Array = self.solved.intrinsics("camera")
        sigmas = np.sqrt(np.maximum(np.diag(self.solved.intrinsics_covariance("camera")), 0))
        grid, lens = self.truth.intrinsics, self.truth.lens
        corner, pixels = image_corner_radius(grid), {}
        for name, value, sigma in zip(self.solved.estimated["camera"], found, sigmas, strict=True):
            if name in ("p1", "p2"):
                continue
            true = getattr(grid, name) if hasattr(grid, name) else getattr(lens, name)
            scale = {"k1": grid.fx * corner**3, "k2": grid.fx * corner**5}.get(name, 1.0)
            pixels[name] = (float(scale * (value - true)), float(scale * sigma))
        return pixels


@lru_cache(maxsize=8)
def experiment(fault: str, strength: float, noise: float, seed: int) -> Experiment:
    """One fault of strength 0 (none) … 1 (gross), corners with `noise` px, camera and boards by `seed`.

    Raises ValueError naming the faults there are for any other.
    """
    if fault not in lab_faults():
        raise ValueError(f"fault must be one of {', '.join(lab_faults())}, got {fault!r}")
    lab, declared, rng = lab_faults()[fault], faults()[fault], np.random.default_rng([seed, 1])
    amount = lab.amount(strength)
    set_up = _set_up(seed, **(lab.spread(strength) if lab.spread else {}))
    if lab.set_up:
        set_up = lab.set_up(seed, set_up, amount)
    elif declared.stage == "set-up":
        set_up = declared.make(np.random.default_rng([seed, 2]), set_up, amount)
    corners = set_up.corners[0] + noise * rng.normal(size=set_up.corners[0].shape)
    if declared.stage == "corners":
        declared.make(rng, corners, (BOARD.rows, BOARD.columns), amount)
    solved = _solved(set_up, corners, lab.estimated)
    if declared.stage == "solution":
        solved = declared.make(solved, amount)
    return Experiment(set_up.camera, solved, lab.words.format(amount))


@lru_cache(maxsize=8)
def _set_up(seed: int, tilt_deg: tuple[float, float] = (15.0, 40.0), window: float = 1.0) -> SetUp:
    rng = np.random.default_rng(seed)
    grid = Intrinsics.from_fov(640, 480, rng.uniform(55, 65))
    cx, cy = np.array([grid.cx, grid.cy]) + rng.uniform(-9, 9, 2)
    camera = Camera(replace(grid, cx=cx, cy=cy), BrownConrady(k1=rng.uniform(-0.22, -0.08), k2=0.03))
    return SetUp((camera,), BOARD, spread_boards(rng, (camera,), BOARD, VIEWS, tilt_deg, window), 0.0)


def _solved(set_up: SetUp, corners: Array, estimated: tuple[str, ...]) -> Adjustment:
    """The least squares near the truth; what is not estimated is 0."""
    start = with_parameters(set_up.camera, dict.fromkeys({"k1", "k2", "p1", "p2"} - set(estimated), 0.0))
    detections, poses = {"camera": corners}, set_up.cam_from_board
    known = {"camera": estimated}
    return Adjustment(BOARD, {"camera": start}, detections, poses, known, certain_board=True).refined()
