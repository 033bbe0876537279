"""Which views the clinic has, in the order in which they are best read, and how each comes from a calibration."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import cached_property, lru_cache
from pathlib import Path

import cv2
import numpy as np
from numpy.typing import NDArray

from camviz.colour.picture_files import PictureError, read_picture
from camviz.views.base import View
from camviz.views.distortion import DistortionView
from camviz_clinic.calibration.adjustment import Adjustment
from camviz_clinic.checks.evidence import Evidence
from camviz_clinic.checks.inspection import Inspection
from camviz_clinic.views.board_poses import BoardPosesView
from camviz_clinic.views.board_residuals import BoardResidualsView, tested
from camviz_clinic.views.correlation import CorrelationView
from camviz_clinic.views.coverage import CoverageView
from camviz_clinic.views.cross_validation import CrossValidationView
from camviz_clinic.views.depth import DepthErrorView
from camviz_clinic.views.difference import DifferenceView
from camviz_clinic.views.errors import ErrorsView
from camviz_clinic.views.fold_map import FoldView
from camviz_clinic.views.guidance import GuidanceView
from camviz_clinic.views.histogram import HistogramView
from camviz_clinic.views.missing import MissingView
from camviz_clinic.views.numbers import NumbersView
from camviz_clinic.views.observations import Missing, Observations, Photographs
from camviz_clinic.views.outliers import OutliersView
from camviz_clinic.views.pairs import EpipolarPairsView, SharedViews
from camviz_clinic.views.radius import RadiusView
from camviz_clinic.views.rectified import RectifiedView
from camviz_clinic.views.residuals import ResidualsView
from camviz_clinic.views.rig import RigView
from camviz_clinic.views.uncertainty import UncertaintyRangeView, UncertaintyView, adjusted
from camviz_clinic.views.undistorted import UndistortedView

LARGEST = 640  # pixels, of the longer side of a photograph as it is shown


@dataclass(frozen=True, eq=False)
class Case(Evidence):
    """The evidence about a calibration as views show it: with the folder of its pictures, or one for each camera.

    What several views need is made once. `largest` is how many pixels the longer side of a shown photograph has.
    """

    images: Path | Mapping[str, Path] | None = None
    largest: int = LARGEST

    @classmethod
    def of(
        cls, inspection: Inspection, images: Path | Mapping[str, Path] | None = None, largest: int = LARGEST
    ) -> Case:
        """The case of an inspection that has a calibration. What its checks have made is not made again."""
        assert inspection.calibration is not None
        case = cls(inspection.calibration, inspection.compare, images=images, largest=largest)
        return case.knowing(inspection.evidence) if inspection.evidence else case

    @cached_property
    def names(self) -> tuple[str, ...]:
        """The cameras that views are made of: those with corners, or those that differ in their pixels or lens."""
        cameras = self.calibration.cameras
        distinct: dict[object, str] = {}
        for name, camera in cameras.items():
            distinct.setdefault(name if name in self.calibration.detections else (camera.intrinsics, camera.lens), name)
        return tuple(distinct.values())

    def adjustment(self, *names: str) -> Adjustment:
        """The adjustment of some cameras, or of all, made once. Raises Missing."""
        return self.once(("adjustment", *names), lambda: adjusted(self.calibration, *names))

    def observations(self, name: str) -> Observations:
        """What a camera saw. Raises Missing."""
        return self.once(
            ("observations", name), lambda: Observations.of(self.calibration, name, self.photographs(name))
        )

    def photographs(self, name: str, *, full: bool = False) -> Photographs:
        """The pictures of a camera's views as they are shown, or in `full` size; None for one that is not at hand."""
        pictures, k = self.calibration.pictures.get(name, ()), self.calibration.cameras[name].intrinsics

        def photograph(view: int) -> NDArray[np.uint8] | None:
            path = self._path(name, pictures[view]) if view < len(pictures) else None
            if path is None:
                return None
            image = _read(path)
            if image is None or image.shape[:2] != (k.height, k.width):
                return None
            return image if full else _reduced(image, self.largest)

        return photograph if full else lru_cache(maxsize=32)(photograph)

    def _path(self, name: str, picture: str) -> Path | None:
        """Where a camera's picture lies: in its folder or beside the file, never outside, wherever the file points."""
        named = Path(picture)
        inside = named if not named.is_absolute() and ".." not in named.parts else Path(named.name)
        images = self.images.get(name) if isinstance(self.images, Mapping) else self.images
        folders = [folder for folder in (images, self.calibration.source.parent) if folder]
        tried = (folder / part for folder in folders for part in (inside, Path(named.name)))
        return next((path for path in tried if path.is_file()), None)


@dataclass(frozen=True)
class Entry:
    """One view of the clinic: its stable name, its title, what it is for, and whether it is of all cameras at once."""

    name: str
    title: str
    purpose: str
    make: Callable[[Case, str], View]
    of_all: bool = False

    def view(self, case: Case, camera: str = "") -> View:
        """The view of a case, of its first camera unless named; a MissingView where the evidence is not there."""
        camera = camera or case.names[0]
        try:
            return self.make(case, camera)
        except Missing as missing:
            return MissingView(self.title, str(missing))


def _boards(case: Case, name: str) -> View:
    try:
        return RigView.of(case.calibration)
    except Missing as missing:
        if name not in case.calibration.cam_from_board or case.calibration.board is None:
            raise missing
    return BoardPosesView.of(case.calibration, name)


def _residuals(case: Case, name: str) -> View:
    try:
        return ResidualsView.about(case.observations(name))
    except Missing as missing:
        if name not in case.calibration.per_view_errors:
            raise missing
    return ErrorsView.of(case.calibration, name)


def _outliers(case: Case, name: str) -> View:
    return OutliersView(Observations.of(case.calibration, name, case.photographs(name, full=True)))


def _some_photograph(case: Case, name: str) -> NDArray[np.uint8] | None:
    taken = case.photographs(name)
    views = range(len(case.calibration.pictures.get(name, ())))
    return next((image for image in map(taken, views) if image is not None), None)


def _shared(case: Case) -> SharedViews:
    left, right = tuple(case.calibration.cameras)[:2]
    return SharedViews.of(case.calibration, (case.photographs(left), case.photographs(right)))


def _rectified(case: Case, _: str) -> View:
    cameras = tuple(case.calibration.cameras)[:2]
    if len(cameras) < 2:
        return RectifiedView.of(case.calibration)
    return RectifiedView.of(case.calibration, photographs=(case.photographs(cameras[0]), case.photographs(cameras[1])))


def _pairs(case: Case, _: str) -> View:
    if len(case.calibration.cameras) < 2:
        raise Missing("The file holds one camera; this needs a pair.")
    return EpipolarPairsView.about(_shared(case))


def _correlation(case: Case, name: str) -> View:
    try:
        return CorrelationView.about(case.adjustment(name))
    except Missing:
        return CorrelationView.of(case.calibration, name)  # from the covariance that the file holds


def _cross_validation(case: Case, name: str) -> View:
    pictures = case.calibration.pictures.get(name, ())
    return CrossValidationView.about(case.adjustment(name), name, pictures, case.held_out)


_ENTRIES = (
    Entry(
        "numbers",
        "The numbers",
        "What the file says of the camera, and where its axis meets the picture.",
        lambda case, name: NumbersView.of(case.calibration, name),
    ),
    Entry(
        "residual-vectors",
        "Residuals, view by view",
        "Where each picture disagrees with the calibration: choose a bar, see its picture and its board.",
        _residuals,
    ),
    Entry(
        "outliers",
        "The worst corners",
        "The corners that fit worst, enlarged: was the corner found where it is?",
        _outliers,
    ),
    Entry(
        "boards",
        "Cameras and boards in space",
        "Where the cameras and boards were: are they where you held them?",
        _boards,
        True,
    ),
    Entry(
        "residual-histogram",
        "Are the residuals noise?",
        "Noise follows the bell curve; outliers and wrong models do not.",
        lambda case, name: HistogramView(case.observations(name)),
    ),
    Entry(
        "residual-radius",
        "Residuals against radius and direction",
        "Residuals that point outward or around somewhere: the model is too simple there.",
        lambda case, name: RadiusView.about(case.observations(name)),
    ),
    Entry(
        "board-residuals",
        "Is the board flat?",
        "What all views agree on is the board’s fault, and may be its bend.",
        lambda case, name: BoardResidualsView.about(case.observations(name), tested(case.adjustment(name))),
    ),
    Entry(
        "coverage",
        "Coverage",
        "Where the corners were: outside of that the calibration is a guess.",
        lambda case, name: CoverageView(case.observations(name)),
    ),
    Entry(
        "uncertainty",
        "Uncertainty of projection",
        "How far off a projected pixel may be, over the picture.",
        lambda case, name: UncertaintyView(case.adjustment(name), name),
    ),
    Entry(
        "uncertainty-range",
        "Uncertainty against range",
        "At which distances the calibration is good.",
        lambda case, name: UncertaintyRangeView(case.adjustment(name), name),
    ),
    Entry(
        "correlation",
        "What the solution cannot tell apart",
        "Parameters that can be traded for one another.",
        _correlation,
    ),
    Entry(
        "cross-validation",
        "Cross-validation",
        "What the calibration says of views and corners that it has not seen.",
        _cross_validation,
    ),
    Entry(
        "guidance",
        "Where to hold the board next",
        "The pose that would take most off the uncertainty.",
        lambda case, name: GuidanceView.about(case.adjustment(name), name),
    ),
    Entry(
        "difference",
        "The difference of two calibrations",
        "How far apart two calibrations put the same points.",
        lambda case, name: DifferenceView.of(case.calibration, case.compare, name),
    ),
    Entry(
        "distortion",
        "Lens distortion",
        "What the lens does to straight lines, and where each pixel goes.",
        lambda case, name: DistortionView.of(case.calibration.cameras[name], _some_photograph(case, name)),
    ),
    Entry(
        "fold-map",
        "Folds and poles",
        "Where a ray arrives at all, and how near the polynomial is to folding or to a pole.",
        lambda case, name: FoldView.of(case.calibration, name),
    ),
    Entry(
        "undistorted",
        "Undistorted",
        "What is left of a picture when it is straightened.",
        lambda case, name: UndistortedView.of(case.calibration, name, _some_photograph(case, name)),
    ),
    Entry(
        "epipolar-pairs",
        "Epipolar lines, pair by pair",
        "How far the corners of shared views are off their epipolar lines.",
        _pairs,
        True,
    ),
    Entry("rectified", "Rectified", "What belongs together must lie in one row of both pictures.", _rectified, True),
    Entry(
        "depth-error",
        "Depth error against range",
        "How well the pair knows how far away things are.",
        lambda case, _: DepthErrorView.of(case.calibration),
        True,
    ),
)

VIEWS: Mapping[str, Entry] = {entry.name: entry for entry in _ENTRIES}
ALIASES: Mapping[str, str] = {"per-view-errors": "residual-vectors"}  # the bars are part of that view


def title_of(name: str) -> str:
    """The title of the view that a finding names; the name itself where there is no such view."""
    entry = VIEWS.get(ALIASES.get(name, name))
    return entry.title if entry else name


def _read(path: Path) -> NDArray[np.uint8] | None:
    """A picture as RGB; None where the file is not a picture."""
    try:
        return np.ascontiguousarray(read_picture(path, cv2.IMREAD_COLOR)[..., ::-1])
    except PictureError:
        return None


def _reduced(image: NDArray[np.uint8], largest: int) -> NDArray[np.uint8]:
    height, width = image.shape[:2]
    if max(height, width) <= largest:
        return image
    scale = largest / max(height, width)
    size = (max(1, round(width * scale)), max(1, round(height * scale)))
    return np.asarray(cv2.resize(image, size, interpolation=cv2.INTER_AREA))
