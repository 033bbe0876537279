"""What a calibration is: a board, cameras, and what was recorded with them, whatever program wrote it down."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Self

import numpy as np
from numpy.typing import ArrayLike, NDArray

from camviz.calibration.boards import kind_of
from camviz.calibration.boards.aprilgrid import FAMILY
from camviz.calibration.denominator_prior import DenominatorPrior
from camviz.calibration.redundancy import Redundancy
from camviz.cameras import Camera, Rig
from camviz.lenses.base import Array
from camviz.poses import RigidTransform

Mask = NDArray[np.bool_]


class CalibrationError(ValueError):
    """A file that cannot be read as a calibration; the message is one sentence: where, what was expected, what came.

    `id` names the clinic's finding that this is, such as "bad-k", and `value` is the number that shows it; the id is
    empty where the file is simply unreadable.
    """

    def __init__(self, sentence: str, id: str = "", value: float | None = None) -> None:
        super().__init__(sentence)
        self.id, self.value = id, value


@dataclass(frozen=True)
class Board:
    """A board: its points by columns and rows, and the distance of two of them in metres or the file's unit.

    A chessboard's points are its inner corners, `square_size` is the side of a square. A ChArUco board has markers of
    `marker_size` metres, out of OpenCV's `dictionary` of that name ("DICT_5X5_100"), in its white squares. An AprilGrid
    is made by `aprilgrid`; a grid of circles has its circles' centres as points, `square_size` apart, and may say their
    diameter as `marker_size`. The markers of a ChArUco board have a border of `border_bits` cells and are numbered from
    `first_id`; with `legacy` they are laid out as OpenCV before 4.6 did it, white first where the squares' rows are
    even. `kind` is a name in `camviz.calibration.boards.kinds()`; without it the board is a
    chessboard, or a ChArUco board where it has a dictionary.
    """

    columns: int
    rows: int
    square_size: float
    marker_size: float | None = None
    dictionary: str | None = None
    kind: str = ""
    legacy: bool = False
    first_id: int = 0
    border_bits: int = 1

    def __post_init__(self) -> None:
        for name in ("columns", "rows"):
            if getattr(self, name) < 1:
                raise ValueError(f"{name} must be a number of inner corners, at least 1, got {getattr(self, name)}")
        if not self.square_size > 0:
            raise ValueError(f"square_size must be a positive length, got {self.square_size}")
        if not self.kind:
            plain = self.marker_size is None and self.dictionary is None
            object.__setattr__(self, "kind", "chessboard" if plain else "charuco")
        if self.kind != "charuco" and (self.legacy, self.first_id, self.border_bits) != (False, 0, 1):
            raise ValueError(
                "legacy, first_id and border_bits must be left out of all boards but a ChArUco board, got "
                f"{self.legacy}, {self.first_id} and {self.border_bits}"
            )
        kind_of(self).check(self)

    @classmethod
    def aprilgrid(cls, columns: int, rows: int, tag_size: float, spacing: float = 0.3) -> Self:
        """Kalibr's AprilGrid of so many tags, of `tag_size` metres, `spacing` times as much apart.

        Two points a tag stand along each side.

        >>> Board.aprilgrid(6, 6, 0.088, 0.3).corners.shape
        (144, 3)
        """
        return cls(2 * columns, 2 * rows, tag_size * (1 + spacing), tag_size, FAMILY, "aprilgrid")

    @property
    def corners(self) -> Array:
        """The points (columns * rows, 3) in the board's frame, row by row: x along a row, y down, z = 0."""
        xy = kind_of(self).points(self)
        return np.column_stack([xy, np.zeros(len(xy))])

    @property
    def area(self) -> tuple[float, float, float, float]:
        """Left, top, right and bottom of the board with the white that its finder needs, in its own frame."""
        return kind_of(self).area(self)

    @property
    def length(self) -> float:
        """The longer side, from the first to the last point."""
        return float(self.corners[:, :2].max())

    def warped(self, warp: ArrayLike) -> Array:
        """The corners (columns * rows, 3) of a bent board: z = warp_x (1 - ξ²) + warp_y (1 - η²), ξ and η from -1 to 1.

        `warp` (2,) has the sagittas in metres at the middle, along the rows and along the columns (mrcal's model).
        """
        corners = self.corners
        half = np.maximum(corners[:, :2].max(axis=0), self.square_size) / 2
        xi_eta = corners[:, :2] / half - 1
        corners[:, 2] = (1 - xi_eta**2) @ np.asarray(warp, dtype=float)
        return corners


@dataclass(frozen=True, eq=False)
class Calibration:
    """The cameras of one calibration file, by name and in place, and what else the file recorded.

    The world is the frame of the first camera, the left one of a pair, unless the file has a world of its own, as
    COLMAP's, mrcal's, nerfstudio's and Metashape's do. What was recorded of a camera is kept by its name and left out
    where the file has none; the cameras of a rig have the same views. `notes` say in words what a reader should know
    about the file.
    """

    cameras: Mapping[str, Camera]
    source: Path
    format: str
    board: Board | None = None
    detections: Mapping[str, Array] = field(default_factory=dict, repr=False)  # name → pixels (views, corners, 2)
    cam_from_board: Mapping[str, RigidTransform] = field(default_factory=dict, repr=False)  # name → one pose per view
    per_view_errors: Mapping[str, Array] = field(default_factory=dict, repr=False)  # name → RMS (views,) in pixels
    world_from_imu: RigidTransform | None = None
    notes: tuple[str, ...] = ()
    pictures: Mapping[str, tuple[str, ...]] = field(default_factory=dict, repr=False)  # name → a file name per view
    set_aside: Mapping[str, Mask] = field(default_factory=dict, repr=False)  # name → (views, corners): seen, not used
    estimated: Mapping[str, tuple[str, ...]] = field(default_factory=dict)  # name → the intrinsics that were solved for
    intrinsics_covariance: Mapping[str, Array] = field(default_factory=dict, repr=False)  # (n, n), as `estimated` has n
    priors: Mapping[str, DenominatorPrior] = field(default_factory=dict)  # name → what the solution assumed beforehand
    board_warp: Array | None = None  # (2,) sagittas in metres, see Board.warped
    skipped: tuple[tuple[str, str], ...] = ()  # pictures that were not used, and why
    faults: tuple[CalibrationError, ...] = ()  # what was mended in reading, where `load` was asked to mend
    redundant: tuple[Redundancy, ...] = ()  # what the file says twice, in its order

    def __post_init__(self) -> None:
        if not self.cameras:
            raise ValueError("cameras must name at least one camera, got none")

    @property
    def rig(self) -> Rig:
        """The cameras as one rig."""
        return Rig(self.cameras)

    def used(self, name: str) -> Mask:
        """Which corners (views, corners) of a camera were seen and not set aside; (0, 0) where none are known."""
        if name not in self.detections:
            return np.zeros((0, 0), bool)
        seen = np.isfinite(self.detections[name]).all(axis=-1)
        return np.asarray(seen & ~self.set_aside[name] if name in self.set_aside else seen)

    def rms(self, name: str) -> float | None:
        """The RMS in pixels over all corners used, as the errors of the views tell it; None where they are not known.

        Where the corners are not known, all views count alike.
        """
        errors = np.asarray(self.per_view_errors.get(name, ()), dtype=float)
        counts = self.used(name).sum(axis=1)
        weights = np.where(np.isfinite(errors), counts if counts.shape == errors.shape else 1, 0)
        if not weights.any():
            return None
        return float(np.sqrt(np.sum(weights * np.nan_to_num(errors) ** 2) / weights.sum()))
