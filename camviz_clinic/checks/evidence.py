"""What there is to judge a calibration by: its numbers, the corners it was solved from, pictures, another one."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Any, Self, TypeVar, cast

import numpy as np

from camviz.cameras import Camera
from camviz.poses import RigidTransform
from camviz_clinic.calibration.adjustment import Adjustment
from camviz_clinic.calibration.cross_validation import HeldOut, held_out
from camviz_clinic.calibration.identifiability import undecided, undecided_by_covariance
from camviz_clinic.calibration.stamp import Stamp
from camviz_clinic.calibration.types import Board, Calibration
from camviz_clinic.calibration.undecided import Undecided
from camviz_clinic.checks.between_views import Partings
from camviz_clinic.checks.doctor.shown import Shown
from camviz_clinic.checks.observed import Observed
from camviz_clinic.checks.rig import StereoPair, board_poses, pairs

Made = TypeVar("Made")


class NotChecked(Exception):  # noqa: N818 - it is an answer, not an error
    """Why a check cannot be made: what the calibration does not hold, as a clause that follows "Not checked, "."""


@dataclass(frozen=True, eq=False)
class Evidence:
    """A calibration, another one, (width, height) of pictures by their names, the board as it was measured, a distance
    in metres at which errors matter, the length in metres of a pair's baseline as it was measured, pictures of the
    board, and how new pictures were taken.
    """

    calibration: Calibration
    compare: Calibration | None = None
    sizes: Mapping[str, tuple[int, int]] = field(default_factory=dict)
    board: Board | None = None
    at: float | None = None
    baseline: float | None = None
    shown: Shown | None = None
    taken: Stamp | None = None
    _made: dict[tuple[str, ...], Any] = field(default_factory=dict, init=False, repr=False)

    @cached_property
    def cameras(self) -> dict[str, Camera]:
        """The cameras that differ in their pixels or their lens, by the first name that has them."""
        distinct: dict[object, str] = {}
        for name, camera in self.calibration.cameras.items():
            distinct.setdefault((camera.intrinsics, camera.lens), name)
        return {name: self.calibration.cameras[name] for name in distinct.values()}

    def adjustment(self, *names: str) -> Adjustment:
        """The adjustment of some cameras, or of all, made once.

        Raises ValueError where the file holds no board, no corners or no poses of these cameras.
        """
        return self.once(("adjustment", *names), lambda: Adjustment.of(self.calibration, *names))

    def once(self, key: tuple[str, ...], make: Callable[[], Made]) -> Made:
        """What is made of this evidence, by its key, made once."""
        if key not in self._made:
            self._made[key] = make()
        return cast(Made, self._made[key])

    def knowing(self, other: Evidence) -> Self:
        """This evidence, with what was made of other evidence about the same calibration."""
        if other.calibration is self.calibration:
            self._made.update(other._made)
        return self

    def held_out(self, name: str) -> HeldOut:
        """A camera's corners held out of their view's pose, at the file's numbers."""
        return self.once(("held out", name), lambda: held_out(self.adjustment(name), camera=name))

    def partings(self, name: str) -> Partings:
        """A camera's views parted in two, solved anew. Raises ValueError where a half has too few views."""
        return self.once(("partings", name), lambda: Partings.of(self.observed[name]))

    def counterparts(self) -> Iterator[tuple[str, Camera, Camera]]:
        """As `matched`, without cameras that share their pixels and lens with one before."""
        return (each for each in self.matched() if each[0] in self.cameras)

    def matched(self) -> Iterator[tuple[str, Camera, Camera]]:
        """Name, camera, and the same camera in the other calibration: by name, else by order if both have as many."""
        if self.compare is None:
            return
        ours, others = self.calibration.cameras, self.compare.cameras
        if set(ours) & set(others):
            yield from ((name, ours[name], others[name]) for name in ours if name in others)
        elif len(ours) == len(others):
            for (name, camera), other in zip(ours.items(), others.values(), strict=True):
                yield name, camera, other

    @cached_property
    def cam_from_board(self) -> dict[str, RigidTransform]:
        """The board's poses by camera: the file's, or found from its corners where it has none."""
        calibration, poses = self.calibration, dict(self.calibration.cam_from_board)
        for name, pixels in calibration.detections.items():
            if name not in poses and self._are_of_the_board(name):
                assert calibration.board is not None
                poses[name] = board_poses(calibration.cameras[name], calibration.board, pixels)
        return poses

    def _are_of_the_board(self, name: str) -> bool:
        """Whether a camera's corners are as many as the board has."""
        board = self.calibration.board
        return board is not None and self.calibration.detections[name].shape[1] == board.columns * board.rows

    @cached_property
    def pairs(self) -> list[StereoPair]:
        """The stereo pairs."""
        return pairs(self.calibration)

    @cached_property
    def observed(self) -> dict[str, Observed]:
        """The cameras whose corners, board and poses are known."""
        found = {}
        for name in self.calibration.detections:
            if name in self.cam_from_board and self._are_of_the_board(name):
                observed = Observed(name, self._posed(name))
                if observed.adjustment.posed.any():
                    found[name] = observed
        return found

    def _posed(self, name: str) -> Adjustment:
        """A camera's adjustment, also where the file does not hold the board's poses."""
        if name in self.calibration.cam_from_board:
            return self.adjustment(name)
        return Adjustment.of(replace(self.calibration, cam_from_board=self.cam_from_board), name)

    def with_corners(self) -> dict[str, Observed]:
        """As `observed`. Raises NotChecked where there is no such camera."""
        if not self.observed:
            raise NotChecked("the file holds no detected corners of a known board")
        return self.observed

    def without_pair(self, otherwise: str) -> NotChecked:
        """Why a check of pairs is not made: there is one camera alone, or else what `otherwise` says."""
        alone = len(self.calibration.cameras) == 1
        return NotChecked("the file holds one camera, not a pair" if alone else otherwise)

    def picture(self, name: str, view: int) -> str:
        """What to call a view: the name of its picture, or its number."""
        pictures = self.calibration.pictures.get(name)
        called = pictures[view] if pictures else f"view {view + 1}"
        return called if len(self.calibration.cameras) == 1 else f"{name}, {called}"

    def sigma_of(self, name: str, parameter: str) -> float | None:
        """The standard deviation of an estimated intrinsic, from the file or from its corners; None where unknown."""
        estimated, covariance = self.calibration.estimated.get(name, ()), self.calibration.intrinsics_covariance
        if name in covariance and parameter in estimated:
            place = estimated.index(parameter)
            return float(np.sqrt(max(covariance[name][place, place], 0)))
        if name not in self.observed:
            return None
        adjustment = self.observed[name].adjustment
        names = adjustment.estimated[name]
        if parameter not in names or not np.isfinite(adjustment.sigma):
            return None
        place = names.index(parameter)
        return float(np.sqrt(max(adjustment.covariance[place, place], 0)))

    def undecided(self, name: str) -> tuple[Undecided, ...]:
        """Combinations of a camera's intrinsics that its corners do not decide, the worst first.

        By the corners that the calibration holds, unless it was solved from more of them and says so; without any, by
        the covariance in the file; () without either.
        """
        return self.once(("undecided", name), lambda: self._undecided(name))

    def _undecided(self, name: str) -> tuple[Undecided, ...]:
        calibration = self.calibration
        if name in calibration.undecided:
            return calibration.undecided[name]
        if name not in self.observed:
            covariance, names = calibration.intrinsics_covariance.get(name), calibration.estimated.get(name, ())
            if covariance is None or name in calibration.detections:
                return ()
            return undecided_by_covariance(calibration.cameras[name], names, covariance)
        observed = self.observed[name]
        return undecided(self._with_others(name) or observed.adjustment, name, observed.noise)

    def _with_others(self, name: str) -> Adjustment | None:
        """A camera's adjustment with all that saw the board beside it, which tell of the board's poses, if any did."""
        seen_by = [each for each in self.observed if each in self.calibration.cam_from_board]
        if name not in seen_by or len(seen_by) < 2:
            return None
        try:
            return self.adjustment(*seen_by)
        except ValueError:  # the cameras have other views each
            return None

    def focal_uncertainty(self, name: str) -> float | None:
        """The standard deviation of fx over fx; None where it is unknown."""
        sigma = self.sigma_of(name, "fx")
        return None if sigma is None else sigma / self.calibration.cameras[name].intrinsics.fx
