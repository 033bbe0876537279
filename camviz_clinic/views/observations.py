"""What one camera saw of a board in every view, beside what its calibration says it should have seen."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Any, Self

import numpy as np
from numpy.typing import NDArray

from camviz.cameras import Camera
from camviz.draw import svg
from camviz.draw.marks import Marks
from camviz.draw.panel import Panel
from camviz.lenses.base import Array
from camviz.poses import RigidTransform
from camviz.views.base import View
from camviz_clinic.calibration.pairing import last_number
from camviz_clinic.calibration.types import Board

if TYPE_CHECKING:
    from camviz_clinic.files import Calibration

_SHORT = 4  # digits, not a time in nanoseconds
Photographs = Callable[[int], "NDArray[np.uint8] | None"]


class Missing(ValueError):  # noqa: N818 - it says what is the case
    """What a view needs and a calibration does not hold; the message is one sentence for the reader."""


def short_names(pictures: Sequence[str], views: int) -> tuple[str, ...]:
    """What tells views apart in little room: the last numbers in the names of their pictures, or else their places."""
    numbers = tuple(last_number(Path(name)) for name in pictures)
    usable = len(set(numbers)) == len(numbers) == views and all(0 < len(number) <= _SHORT for number in numbers)
    return numbers if usable else tuple(str(view + 1) for view in range(views))


def not_at_hand(panel: Panel) -> Marks:
    """What stands in a panel for want of its photograph: how to have it."""
    words = "The picture is not at hand; name its folder: --images FOLDER, or in a notebook explore(images=FOLDER)."
    return svg.paragraph((8, panel.height - 60), words, panel.width - 16, "note halo clear")


def no_photographs(view: int) -> None:
    """For calibrations without their pictures: none of them is at hand."""
    return None


@dataclass(frozen=True, eq=False)
class Observations:
    """Corners (views, corners, 2) in pixels as they were detected, NaN where not seen, and the pose of every view.

    `set_aside` (views, corners) marks corners that were seen but not used in the solution, `pictures` has a name per
    view, `photographs` gives view i's picture (height, width, 3) uint8 or None. `board_warp` (2,) bends the board.
    """

    camera: Camera
    board: Board
    detections: Array
    cam_from_board: RigidTransform
    set_aside: NDArray[np.bool_] | None = None
    pictures: tuple[str, ...] = ()
    board_warp: Array | None = None
    name: str = "camera"
    photographs: Photographs = field(default=no_photographs, repr=False)

    def __post_init__(self) -> None:
        count = self.board.columns * self.board.rows
        if self.detections.ndim != 3 or self.detections.shape[1:] != (count, 2):
            expected = f"(views, {count}, 2), the board having {self.board.columns} × {self.board.rows} corners"
            raise ValueError(f"detections must have shape {expected}, got {self.detections.shape}")
        if self.cam_from_board.single or len(self.cam_from_board) != len(self.detections):
            got = 1 if self.cam_from_board.single else len(self.cam_from_board)
            raise ValueError(f"cam_from_board must hold one pose for each of {len(self.detections)} views, got {got}")

    @classmethod
    def of(cls, calibration: Calibration, name: str = "", photographs: Photographs = no_photographs) -> Observations:
        """What a calibration holds of a camera, the first unless named. Raises Missing where it holds too little."""
        name = name or next(iter(calibration.cameras))
        if calibration.board is None or name not in calibration.detections:
            what = "the board" if calibration.board is None else f"the corners that {name} saw"
            raise Missing(f"The file does not hold {what}, so there is nothing to compare the calibration with.")
        if name not in calibration.cam_from_board:
            raise Missing(f"The file does not hold where the board was in the views of {name}.")
        if not np.isfinite(calibration.detections[name]).any():
            raise Missing(f"{name} saw no corner of the board in any view.")
        camera = calibration.cameras[name].at(RigidTransform.identity())
        corners, poses = np.asarray(calibration.detections[name], dtype=float), calibration.cam_from_board[name]
        aside, pictures = calibration.set_aside.get(name), calibration.pictures.get(name, ())
        warp = calibration.board_warp
        return cls(camera, calibration.board, corners, poses, aside, pictures, warp, name, photographs)

    def __len__(self) -> int:
        return len(self.detections)

    @cached_property
    def shown(self) -> NDArray[np.bool_]:
        """Which views (views,) show any corner; another camera of a rig may have seen the others."""
        return np.asarray(np.any(np.isfinite(self.detections).all(axis=-1), axis=1))

    @cached_property
    def corners_board(self) -> Array:
        """The board's corners (corners, 3) in its own frame, in metres, bent where the board is."""
        return self.board.corners if self.board_warp is None else self.board.warped(self.board_warp)

    @cached_property
    def corners_cam(self) -> Array:
        """The board's corners (views, corners, 3) in the camera's frame; NaN in a view that shows none of them."""
        R, t = self.cam_from_board.rotation.as_matrix(), self.cam_from_board.translation
        points = np.einsum("vij,cj->vci", R, self.corners_board) + t[:, None]
        return np.where(self.shown[:, None, None], points, np.nan)

    @cached_property
    def projected(self) -> Array:
        """Where (views, corners, 2) the calibration puts the corners."""
        return self.camera.project(self.corners_cam)

    @cached_property
    def residuals(self) -> Array:
        """Detected less projected, (views, corners, 2) in pixels."""
        return self.detections - self.projected

    @cached_property
    def on_board(self) -> Array:
        """Where (views, corners, 2) on the board, in metres, the rays of the detected corners meet it."""
        rays_cam = self.camera.unproject(self.detections)
        R, t = self.cam_from_board.rotation.as_matrix(), self.cam_from_board.translation
        rays = np.einsum("vij,vci->vcj", R, rays_cam)
        centres = -np.einsum("vij,vi->vj", R, t)[:, None]
        with np.errstate(divide="ignore", invalid="ignore"):
            along = (self.corners_board[:, 2] - centres[..., 2]) / rays[..., 2]
        return (centres + along[..., None] * rays)[..., :2]

    @cached_property
    def used(self) -> NDArray[np.bool_]:
        """Which corners (views, corners) were seen, have an image, and were not set aside."""
        known = np.isfinite(self.residuals).all(axis=-1)
        return np.asarray(known if self.set_aside is None else known & ~self.set_aside)

    @cached_property
    def aside(self) -> NDArray[np.bool_]:
        """Which corners (views, corners) were seen and set aside."""
        known = np.isfinite(self.detections).all(axis=-1)
        return np.zeros_like(known) if self.set_aside is None else known & self.set_aside

    @cached_property
    def lengths(self) -> Array:
        """The length of every residual (views, corners) in pixels; NaN where a corner was not seen."""
        return np.linalg.norm(self.residuals, axis=-1)

    @cached_property
    def rms(self) -> Array:
        """The RMS (views,) in pixels of every view's used corners; NaN where a view has none."""
        return _root_mean(self.lengths, self.used)

    @cached_property
    def rms_seen(self) -> Array:
        """The RMS (views,) in pixels of all corners seen, those that were set aside too."""
        return _root_mean(self.lengths, self.used | self.aside)

    @property
    def total_rms(self) -> float:
        """The RMS in pixels of all used corners."""
        return float(np.sqrt(np.mean(self.lengths[self.used] ** 2))) if self.used.any() else float("nan")

    @cached_property
    def worst(self) -> int:
        """The view with the largest RMS."""
        return int(np.nanargmax(self.rms_seen)) if np.isfinite(self.rms_seen).any() else 0

    @cached_property
    def distances(self) -> Array:
        """How far (views,) the middle of the board was from the camera, in metres."""
        return np.linalg.norm(self.corners_cam.mean(axis=1), axis=-1)

    @cached_property
    def tilts_deg(self) -> Array:
        """The angle (views,) in degrees between the board's normal and the ray to its middle."""
        normals = self.cam_from_board.rotation.as_matrix()[:, :, 2]
        middles = self.corners_cam.mean(axis=1)
        cosine = np.abs(np.sum(normals * middles, axis=-1)) / np.linalg.norm(middles, axis=-1)
        return np.degrees(np.arccos(np.clip(cosine, 0, 1)))

    def picture(self, view: int) -> str:
        """What a view is called: its picture's name, or its number."""
        return self.pictures[view] if view < len(self.pictures) else f"view {view + 1}"


class ObservedView(View):
    """A view of what one camera saw, its first field an `Observations`."""

    @classmethod
    def of(cls, calibration: Any, camera: str = "", **options: Any) -> Self:
        """The view of a calibration. Raises Missing where it holds no corners or poses."""
        return cls.about(Observations.of(calibration, camera, **options))

    @classmethod
    def about(cls, observations: Observations) -> Self:
        """The view as it opens."""
        return cls(observations)  # type: ignore[call-arg]


def _root_mean(lengths: Array, chosen: NDArray[np.bool_]) -> Array:
    count = chosen.sum(axis=1)
    total = np.where(chosen, lengths, 0) ** 2
    with np.errstate(invalid="ignore", divide="ignore"):
        return np.sqrt(total.sum(axis=1) / np.where(count, count, np.nan))
