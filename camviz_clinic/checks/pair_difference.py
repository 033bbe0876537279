"""How far two calibrations of one stereo pair differ in millimetres: their baselines, and the depth they measure."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from camviz.cameras import Camera
from camviz.lenses.base import Array
from camviz.twoview import triangulate
from camviz_clinic.checks.evidence import Evidence
from camviz_clinic.checks.rig import OWN_UNIT

WORKING_DISTANCE_M = 1.0  # where no distance is given (--at)


@dataclass(frozen=True)
class PairDifference:
    """Baselines of both calibrations, and how much deeper the first one measures a point in the middle of the image.

    Attributes:
        pair: The names of the two cameras.
        baseline_mm, other_mm: The baselines in mm.
        at: The depth of the point in metres, by the other calibration.
        depth_mm: The first calibration's depth minus `at`, in mm; NaN where it sees no such point.
    """

    pair: str
    baseline_mm: float
    other_mm: float
    at: float
    depth_mm: float

    @property
    def sentence(self) -> str:
        """The numbers in words."""
        off = abs(self.baseline_mm - self.other_mm)
        said = (
            f"{self.pair}: the baselines are {self.baseline_mm:.4g} and {self.other_mm:.4g} mm. They differ by "
            f"{off:.2g} mm ({off / self.other_mm:.1%})."
        )
        return said if np.isnan(self.depth_mm) else f"{said} {self.depth_sentence}"

    @property
    def depth_sentence(self) -> str:
        """The difference of depths in words."""
        return f"At {self.at:g} m their depths differ by {abs(self.depth_mm):.2g} mm (middle of the image)."


def pair_differences(evidence: Evidence) -> list[PairDifference]:
    """Of the stereo pairs that both calibrations hold in metres; made once."""
    return evidence.once(("pair differences",), lambda: list(_pair_differences(evidence)))


def _pair_differences(evidence: Evidence) -> Iterator[PairDifference]:
    compare = evidence.compare
    if compare is None or {evidence.calibration.format, compare.format} & set(OWN_UNIT):
        return
    others = {name: other for name, _, other in evidence.matched()}
    for pair in evidence.pairs:
        if {pair.left, pair.right} <= set(others):
            left, right = others[pair.left], others[pair.right]
            length, at = float(np.linalg.norm(left.centre - right.centre)), evidence.at or WORKING_DISTANCE_M
            if pair.baseline > 0 and length > 0:
                depth = _depth(pair.cameras, (left, right), at)
                yield PairDifference(pair.title, 1000 * pair.baseline, 1000 * length, at, 1000 * (depth - at))


def _depth(ours: tuple[Camera, Camera], theirs: tuple[Camera, Camera], at: float) -> float:
    """The depth in metres that `ours` measure of the point that `theirs` see in the middle at a depth `at`."""
    left = theirs[0]
    middle = np.array([(left.intrinsics.width - 1) / 2, (left.intrinsics.height - 1) / 2])
    ray: Array = left.lens.unproject(left.intrinsics.from_pixels(middle))
    point = left.world_from_cam.apply(ray / ray[2] * at)
    pixels = np.stack([camera.project(point) for camera in theirs])
    return float(ours[0].cam_from_world.apply(triangulate(ours, pixels))[2])
