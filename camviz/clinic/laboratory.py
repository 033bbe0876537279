"""Experiments with one virtual camera: ten boards, one fault of any strength, and a plain least-squares solution.

It is as small as an inspection allows, so that a slider can move it; `camviz.clinic.faults` has the faults of every
kind in set-ups of every kind. Nothing is set aside as an outlier here: a fault may do all the harm it can.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from functools import cached_property, lru_cache, partial
from pathlib import Path

import numpy as np

from camviz.calibration.adjustment import Adjustment
from camviz.calibration.difference import Difference, difference, pixel_grid
from camviz.calibration.jacobian import with_parameters
from camviz.calibration.residual_statistics import view_rms
from camviz.calibration.types import Board, Calibration
from camviz.calibration.uncertainty import mean_deviation, projection_covariance
from camviz.cameras import Camera, Intrinsics
from camviz.clinic import injections
from camviz.clinic.findings import Inspection, inspect
from camviz.clinic.virtual import SetUp, spread_boards
from camviz.distortion import image_corner_radius
from camviz.lenses import BrownConrady
from camviz.lenses.base import Array

BOARD = Board(9, 6, 0.025)
VIEWS = 10
TILTS_DEG = (15.0, 40.0)
ESTIMATED = ("fx", "fy", "cx", "cy", "k1", "k2", "p1", "p2")
GRID = (12, 9)  # pixels at which two cameras are compared

Change = Callable[[np.random.Generator, Array, tuple[int, int], float], None]


@dataclass(frozen=True)
class Illness:
    """A fault that grows from nothing to `gross` with its strength, the finding that names it, and itself in words."""

    finding: str
    gross: float
    words: str  # with the amount as {0}

    def amount(self, strength: float) -> float:
        """What a strength of 0 … 1 means, in the unit of the words."""
        return strength * self.gross


ILLNESSES: Mapping[str, Illness] = {
    "outlier corner": Illness("outlier-view", 30, "one corner of one view is {0:.1f} px off"),
    "blurred view": Illness("outlier-view", 6, "the corners of one view scatter by {0:.1f} px more"),
    "column off": Illness("outlier-line", 1, "in one view a column of corners is {0:.2f} squares off"),
    "parallel boards": Illness("parallel-boards", 1, "no board is tilted by more than {0:.1f}°"),
    "boards in the middle": Illness("low-coverage", 1, "the boards stay inside {0:.0%} of the width and height"),
    "warped board": Illness("board-warp", 2, "the board is bent by {0:.2f} % of its length"),
    "autofocus drift": Illness("split-disagreement", 3, "the focal length grows by {0:.2f} % from first view to last"),
    "rolling shutter": Illness("pose-absorbs-error", 30, "boards move by {0:.1f} px while a picture is read out"),
    "lens too rich": Illness(
        "model-too-simple", 30, "an r⁵ term of {0:.1f} px, at the corner, and a model with k1 only"
    ),
    "moved centre": Illness("pose-absorbs-error", 8, "cx is moved by {0:.1f} % of the width, and the poses follow"),
    "half pixel": Illness("half-pixel", 1, "cx and cy are counted from {0:.2f} px elsewhere"),
}

_CHANGES: Mapping[str, Change] = {
    "outlier corner": injections.one_corner_off,
    "blurred view": injections.one_view_blurred,
    "column off": injections.one_column_off,
}


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
        """Observed less projected, in pixels (views, corners, 2)."""
        return self.solved.residuals["camera"]

    @cached_property
    def errors(self) -> Array:
        """The RMS (views,) of every view."""
        return view_rms(self.residuals)

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
    if fault not in ILLNESSES:
        raise ValueError(f"fault must be one of {', '.join(ILLNESSES)}, got {fault!r}")
    illness, amount = ILLNESSES[fault], ILLNESSES[fault].amount(strength)
    tilts, window = TILTS_DEG, 1.0
    if fault == "parallel boards":
        tilts = (TILTS_DEG[0] * (1 - strength), TILTS_DEG[1] * (1 - strength) + 8 * strength)
        amount = tilts[1]
    elif fault == "boards in the middle":
        window = amount = 1 - 0.75 * strength
    set_up = _set_up(seed, tilts, window)
    estimated: tuple[str, ...] = ESTIMATED
    if fault == "warped board":
        side = (BOARD.columns - 1) * BOARD.square_size
        set_up = replace(set_up, warp=(amount / 100 * side, 0.0))
    elif fault == "autofocus drift":
        set_up = replace(set_up, zoom=1 + amount / 100 * np.linspace(-0.5, 0.5, VIEWS))
    elif fault == "lens too rich":
        set_up, estimated = _richer(set_up, seed, amount, illness.gross), ("fx", "fy", "cx", "cy", "k1")
    rng = np.random.default_rng([seed, 1])
    moving = amount if fault == "rolling shutter" else 0.0
    seen = injections.read_by_rows(np.random.default_rng([seed, 2]), set_up, moving) if moving else set_up.corners[0]
    corners = seen + noise * rng.normal(size=seen.shape)
    if fault in _CHANGES:
        _CHANGES[fault](rng, corners, (BOARD.rows, BOARD.columns), amount)
    solved = _after(fault, amount, _solved(set_up, corners, estimated))
    return Experiment(set_up.camera, solved, illness.words.format(amount))


@lru_cache(maxsize=8)
def _set_up(seed: int, tilts_deg: tuple[float, float], window: float) -> SetUp:
    rng = np.random.default_rng(seed)
    grid = Intrinsics.from_fov(640, 480, rng.uniform(55, 65))
    cx, cy = np.array([grid.cx, grid.cy]) + rng.uniform(-9, 9, 2)
    camera = Camera(replace(grid, cx=cx, cy=cy), BrownConrady(k1=rng.uniform(-0.22, -0.08), k2=0.03))
    return SetUp((camera,), BOARD, spread_boards(rng, (camera,), BOARD, VIEWS, tilts_deg, window), 0.0)


def _richer(set_up: SetUp, seed: int, amount: float, gross: float) -> SetUp:
    """With an r⁵ term that moves the image's corner by so many pixels; the boards have room in its grossest picture."""
    grid = set_up.camera.intrinsics
    cameras = [
        Camera(grid, BrownConrady(0.05, px / (grid.fx * image_corner_radius(grid) ** 5))) for px in (gross, amount)
    ]
    poses = spread_boards(np.random.default_rng(seed), (cameras[0],), BOARD, VIEWS, TILTS_DEG)
    return replace(set_up, cameras=(cameras[1],), cam_from_board=poses)


def _solved(set_up: SetUp, corners: Array, estimated: tuple[str, ...]) -> Adjustment:
    """The least squares near the truth; what is not estimated is 0."""
    start = set_up.camera
    start = with_parameters(start, dict.fromkeys({"k1", "k2", "p1", "p2"} - set(estimated), 0.0))
    detections, poses = {"camera": corners}, set_up.cam_from_board
    return Adjustment(BOARD, {"camera": start}, detections, poses, {"camera": estimated}).refined()


def _after(fault: str, amount: float, solved: Adjustment) -> Adjustment:
    """The faults that come into the numbers after they were solved for."""
    camera = solved.cameras["camera"]
    moved = partial(with_parameters, camera)
    cx, cy = camera.intrinsics.cx, camera.intrinsics.cy
    if fault == "moved centre":
        shifted = moved({"cx": cx + amount / 100 * camera.intrinsics.width})
        return replace(solved, cameras={"camera": shifted}).refined(only_poses=True)
    if fault == "half pixel":
        return replace(solved, cameras={"camera": moved({"cx": cx + amount, "cy": cy + amount})})
    return solved
