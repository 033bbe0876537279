"""What a calibration file says, whatever program wrote it."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any

from scipy.spatial.transform import RigidTransform

from camviz.cameras import Camera, Rig
from camviz.lenses.base import Array

if TYPE_CHECKING:
    from camviz.clinic import Inspection


class CalibrationError(ValueError):
    """A file that cannot be read as a calibration; the message is one sentence: where, what was expected, what came.

    `id` names the clinic's finding that this is, such as "bad-k"; it is empty where the file is simply unreadable.
    """

    def __init__(self, sentence: str, id: str = "") -> None:
        super().__init__(sentence)
        self.id = id


@dataclass(frozen=True)
class Board:
    """A chessboard: its inner corners by columns and rows, and the side of a square in metres, if the file is."""

    columns: int
    rows: int
    square_size: float

    def __post_init__(self) -> None:
        for name in ("columns", "rows"):
            if getattr(self, name) < 1:
                raise ValueError(f"{name} must be a number of inner corners, at least 1, got {getattr(self, name)}")
        if not self.square_size > 0:
            raise ValueError(f"square_size must be a positive length, got {self.square_size}")


@dataclass(frozen=True, eq=False)
class Calibration:
    """The cameras of one calibration file, by name and in place, and what else the file recorded.

    The world is the frame of the first camera, the left one of a pair, unless the file has a world of its own, as
    COLMAP's, mrcal's, nerfstudio's and Metashape's do. Detections, board poses and errors are kept by camera name and
    left out where the file has none. `notes` say in words what a reader should know about the file.
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
    faults: tuple[CalibrationError, ...] = ()  # what was mended in reading, where `load` was asked to mend

    def __post_init__(self) -> None:
        if not self.cameras:
            raise ValueError("cameras must name at least one camera, got none")

    @property
    def rig(self) -> Rig:
        """The cameras as one rig."""
        return Rig(self.cameras)

    def inspect(self, **options: Any) -> Inspection:
        """What is wrong with it, and what to do: see `camviz.clinic.inspect`, which takes the same options."""
        from camviz.clinic import inspect

        return inspect(self, **options)
