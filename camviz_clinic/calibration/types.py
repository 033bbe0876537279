"""What a calibration is: a board, cameras, and what was recorded with them, whatever program wrote it down."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import cached_property
from pathlib import Path
from typing import Self

import numpy as np
from numpy.typing import ArrayLike, NDArray

from camviz.cameras import Camera, Rig
from camviz.lenses.base import Array, as_point
from camviz.poses import RigidTransform
from camviz_clinic.calibration.boards import kind_of
from camviz_clinic.calibration.boards.aprilgrid import FAMILY
from camviz_clinic.calibration.denominator_prior import DenominatorPrior
from camviz_clinic.calibration.line_delay import LineDelay
from camviz_clinic.calibration.rectification import Rectification
from camviz_clinic.calibration.redundancy import Redundancy
from camviz_clinic.calibration.stamp import Stamp
from camviz_clinic.calibration.undecided import Undecided

Mask = NDArray[np.bool_]


class CalibrationError(ValueError):
    """A file that cannot be read as a calibration.

    Args:
        sentence: The message: where, what was expected, what came.
        id: The clinic's finding that this is, such as "bad-k"; empty where the file is simply unreadable.
        value: The number that shows it.
        remedy: What to change in the file, where that is known.

    >>> from camviz_clinic.files import load
    >>> load("none.yaml")
    Traceback (most recent call last):
    camviz_clinic.calibration.types.CalibrationError: none.yaml: there is no such file
    """

    def __init__(self, sentence: str, id: str = "", value: float | None = None, remedy: str = "") -> None:
        super().__init__(sentence)
        self.id, self.value, self.remedy = id, value, remedy


@dataclass(frozen=True)
class Board:
    """A board: its points by columns and rows, and the distance of two of them.

    A chessboard's points are its inner corners. The markers of a ChArUco board lie in its white squares. An AprilGrid
    is made by `aprilgrid`, a grid of markers by `marker_grid`; a grid of circles has its circles' centres as points.

    Args:
        columns, rows: Number of points along a row and along a column.
        square_size: Distance of two neighbouring points, in metres or the file's unit: of a chessboard the side of a
            square.
        marker_size: Side of a marker, or diameter of a circle, in the same unit.
        dictionary: The markers' dictionary by OpenCV's name, such as "DICT_5X5_100".
        kind: A name in `camviz_clinic.calibration.boards.kinds()`; a chessboard unless given, or a ChArUco board with a
            dictionary.
        legacy: A ChArUco board laid out as OpenCV before 4.6 did it, white first where the squares' rows are even.
        first_id: Number of the first marker of a ChArUco board or a grid of markers.
        border_bits: Border of these markers, in cells.

    Raises: ValueError for fewer than one point, a length that is not positive, or what no board of its kind can have.

    >>> board = Board(columns=9, rows=6, square_size=0.025)
    >>> board.kind, board.length  # eight squares of 25 mm
    ('chessboard', 0.2)
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
            count = getattr(self, name)
            if int(count) != count or count < 1:
                raise ValueError(f"{name} must be a whole number of points, at least 1, got {count}")
        if not self.square_size > 0:
            raise ValueError(f"square_size must be a positive length, got {self.square_size}")
        if not self.kind:
            plain = self.marker_size is None and self.dictionary is None
            object.__setattr__(self, "kind", "chessboard" if plain else "charuco")
        may = {
            "charuco": (self.legacy, self.first_id, self.border_bits),
            "markers": (False, self.first_id, self.border_bits),
        }
        if (self.legacy, self.first_id, self.border_bits) != may.get(self.kind, (False, 0, 1)):
            raise ValueError(
                "legacy, first_id and border_bits must be left out of all boards but a ChArUco board, and legacy of a "
                f"grid of markers, got {self.legacy}, {self.first_id} and {self.border_bits}"
            )
        kind_of(self).check(self)

    @classmethod
    def aprilgrid(cls, columns: int, rows: int, tag_size: float, spacing: float = 0.3) -> Self:
        """Kalibr's AprilGrid, whose tags have two points along each side.

        Args:
            columns, rows: Number of tags.
            tag_size: Side of a tag in metres.
            spacing: Gap between two tags as a share of `tag_size`.

        Returns: Board with two points a tag along each side.

        >>> Board.aprilgrid(6, 6, 0.088, 0.3).corners.shape  # 36 tags of 4 points
        (144, 3)
        """
        return cls(2 * columns, 2 * rows, tag_size * (1 + spacing), tag_size, FAMILY, "aprilgrid")

    @classmethod
    def marker_grid(
        cls,
        columns: int,
        rows: int,
        marker_size: float,
        dictionary: str,
        spacing: float = 0.3,
        *,
        first_id: int = 0,
        border_bits: int = 1,
    ) -> Self:
        """A grid of ArUco markers without anything between them, or one marker alone.

        Args:
            columns, rows: Number of markers.
            marker_size: Side of a marker in metres.
            dictionary: By OpenCV's name, such as "DICT_4X4_50".
            spacing: Gap between two markers as a share of `marker_size`.
            first_id: Number of the marker at the upper left; the others follow row by row.
            border_bits: Border of the markers, in cells.

        Returns: Board with two points a marker along each side.

        >>> Board.marker_grid(1, 1, 0.06, "DICT_4X4_50", first_id=7).corners.shape
        (4, 3)
        """
        pitch = marker_size * (1 + spacing)
        sizes = 2 * columns, 2 * rows, pitch, marker_size, dictionary, "markers"
        return cls(*sizes, first_id=first_id, border_bits=border_bits)

    @property
    def corners(self) -> Array:
        """The points (columns * rows, 3) in the board's frame, row by row: x along a row, y down, z = 0."""
        return self._points.copy()

    @cached_property  # a solver asks for them at every step
    def _points(self) -> Array:
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
        """The corners of a bent board: z = warp_x (1 - ξ²) + warp_y (1 - η²), ξ and η from -1 to 1.

        Args:
            warp: (2,), sagittas in metres at the middle, along the rows and along the columns.

        Returns: (columns * rows, 3), points in metres in the board's frame.
        Raises: ValueError for other than two sagittas.
        Source: mrcal's documentation, "Board deformation".
        """
        corners = self.corners
        half = np.maximum(corners[:, :2].max(axis=0), self.square_size) / 2
        xi_eta = corners[:, :2] / half - 1
        corners[:, 2] = (1 - xi_eta**2) @ as_point(warp, "warp", 2)
        return corners


@dataclass(frozen=True, eq=False)
class Calibration:
    """The cameras of one calibration file, by name and in place, and what else the file recorded.

    The world is the frame of the first camera, the left one of a pair, unless the file has a world of its own, as
    COLMAP's, mrcal's, nerfstudio's and Metashape's do. What was recorded of a camera is kept by its name and left out
    where the file has none; the cameras of a rig have the same views.

    Args:
        cameras: The cameras by name.
        source: The file.
        format: The program that wrote it.
        board: What was photographed.
        detections: mapping of str to (views, corners, 2), detected corners in pixels, NaN where one was not seen.
        cam_from_board: One pose of the board for each view, in metres.
        per_view_errors: mapping of str to (views,), RMS in pixels.
        world_from_imu: Where an inertial sensor stands.
        notes: What a reader should know about the file.
        pictures: A file name for each view.
        set_aside: mapping of str to (views, corners) of bool, True where a corner was seen and not used.
        estimated: The intrinsics that were solved for.
        intrinsics_covariance: mapping of str to (n, n), of the n parameters in `estimated`, in their units squared.
        priors: What the solution assumed beforehand.
        board_warp: (2,), sagittas in metres, see `Board.warped`.
        board_warp_covariance: (2, 2), in metres squared.
        skipped: tuple of (str, str), pictures that were not used, and why.
        faults: What was mended in reading, where `load` was asked to mend.
        redundant: What the file says twice, in its order.
        stamps: What the calibration of each camera holds for.
        line_delays: How long each camera's rolling shutter takes from row to row, where that is known. The corners are
            then where a shutter of all rows at once would have seen them.
        rectifications: How each camera's pictures are rectified, where the file has R and P beside K, as ROS's do.
        undecided: Combinations of each camera's intrinsics that the corners do not decide, where these were more than
            `detections` holds, as those of several boards; the worst first. No file holds it.

    Raises: ValueError without any camera.

    >>> from pathlib import Path
    >>> from camviz.cameras import Camera, Intrinsics
    >>> one = Calibration({"left": Camera(Intrinsics.from_fov(640, 480, 60))}, Path("left.yaml"), "a data sheet")
    >>> one.cameras["left"].intrinsics.width, one.rms("left")  # without errors there is no RMS
    (640, None)
    """

    cameras: Mapping[str, Camera]
    source: Path
    format: str
    board: Board | None = None
    detections: Mapping[str, Array] = field(default_factory=dict, repr=False)
    cam_from_board: Mapping[str, RigidTransform] = field(default_factory=dict, repr=False)
    per_view_errors: Mapping[str, Array] = field(default_factory=dict, repr=False)
    world_from_imu: RigidTransform | None = None
    notes: tuple[str, ...] = ()
    pictures: Mapping[str, tuple[str, ...]] = field(default_factory=dict, repr=False)
    set_aside: Mapping[str, Mask] = field(default_factory=dict, repr=False)
    estimated: Mapping[str, tuple[str, ...]] = field(default_factory=dict)
    intrinsics_covariance: Mapping[str, Array] = field(default_factory=dict, repr=False)
    priors: Mapping[str, DenominatorPrior] = field(default_factory=dict)
    board_warp: Array | None = None
    board_warp_covariance: Array | None = field(default=None, repr=False)
    skipped: tuple[tuple[str, str], ...] = ()
    faults: tuple[CalibrationError, ...] = ()
    redundant: tuple[Redundancy, ...] = ()
    stamps: Mapping[str, Stamp] = field(default_factory=dict)
    line_delays: Mapping[str, LineDelay] = field(default_factory=dict)
    rectifications: Mapping[str, Rectification] = field(default_factory=dict, repr=False)
    undecided: Mapping[str, tuple[Undecided, ...]] = field(default_factory=dict, repr=False)

    def __post_init__(self) -> None:
        if not self.cameras:
            raise ValueError("cameras must name at least one camera, got none")

    @property
    def rig(self) -> Rig:
        """The cameras as one rig."""
        return Rig(self.cameras)

    def used(self, name: str) -> Mask:
        """Which corners of a camera were seen and not set aside.

        Args:
            name: A camera.

        Returns: (views, corners) of bool, True where a corner counts; (0, 0) where none are known.
        """
        if name not in self.detections:
            return np.zeros((0, 0), bool)
        seen = np.isfinite(self.detections[name]).all(axis=-1)
        return np.asarray(seen & ~self.set_aside[name] if name in self.set_aside else seen)

    def used_pixels(self, name: str) -> Array:
        """The corners of a camera that were seen and not set aside.

        Args:
            name: A camera with detections.

        Returns: (views, corners, 2), pixels; NaN for every other corner.
        """
        return np.where(self.used(name)[..., None], self.detections[name], np.nan)

    def rms(self, name: str) -> float | None:
        """The RMS over all corners used, as the errors of the views tell it.

        Where the corners are not known, all views count alike.

        Args:
            name: A camera.

        Returns: In pixels; None where the errors are not known.
        """
        errors = np.asarray(self.per_view_errors.get(name, ()), dtype=float)
        counts = self.used(name).sum(axis=1)
        weights = np.where(np.isfinite(errors), counts if counts.shape == errors.shape else 1, 0)
        if not weights.any():
            return None
        return float(np.sqrt(np.sum(weights * np.nan_to_num(errors) ** 2) / weights.sum()))
