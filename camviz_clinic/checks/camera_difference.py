"""How far two calibrations of one camera differ over its image, in pixels and in standard deviations."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from camviz.cameras import Intrinsics
from camviz.lenses.base import Array
from camviz_clinic.calibration.adjustment import Adjustment
from camviz_clinic.calibration.difference import difference, pixel_grid
from camviz_clinic.calibration.uncertainty import mean_deviation, projection_covariance
from camviz_clinic.checks.evidence import Evidence

GRID = (60, 40)


@dataclass(frozen=True)
class CameraDifference:
    """The difference of far points in pixels, after the rotation of `turn_deg` that makes the two agree best.

    `median` and `most` (95 %) are over the image, `border` is the median along its border. `sigmas` is 95 % of the
    difference over what the noise of both lets expect, None where neither holds its corners. `lost` is the share of
    pixels that one of the two sees and the other does not.
    """

    camera: str
    median: float
    most: float
    border: float
    sigmas: float | None
    turn_deg: float
    lost: float

    @property
    def sentence(self) -> str:
        """The numbers in words."""
        noise = "" if self.sigmas is None else f", which is {self.sigmas:.2g} σ of their noise"
        lost = f" {self.lost:.0%} of the pixels have a ray in one of them alone." if self.lost >= 0.01 else ""
        return (
            f"{self.camera}: the two calibrations differ by {self.median:.2g} px (median over the image), by "
            f"{self.most:.2g} px (95 %){noise}, and by {self.border:.2g} px at the border. "
            f"A rotation by {self.turn_deg:.2g}° is taken out.{lost}"
        )


def differences(evidence: Evidence) -> list[CameraDifference]:
    """By camera, for pictures of one size; made once."""
    return evidence.once(("differences",), lambda: list(_differences(evidence)))


def _differences(evidence: Evidence) -> Iterator[CameraDifference]:
    names = dict(zip(evidence.calibration.cameras, evidence.compare.cameras if evidence.compare else (), strict=False))
    for name, camera, other in evidence.counterparts():
        assert evidence.compare is not None
        theirs = name if name in evidence.compare.cameras else names[name]
        ours = _deviation(evidence, name, camera.intrinsics)
        noise = [
            each
            for each in (ours, _deviation(Evidence(evidence.compare), theirs, camera.intrinsics))
            if each is not None
        ]
        both = (noise[0], noise[1]) if len(noise) == 2 else None
        try:
            found = difference(camera, other, grid=GRID, uncertainties=both)
        except ValueError:  # pictures of two sizes, or no rays in common
            continue
        length = found.length
        edge = np.ones(length.shape, bool)
        edge[1:-1, 1:-1] = False
        if not np.isfinite(length[edge]).any():
            continue
        expected = np.sqrt(2 * np.sum(np.square(noise), axis=0)) if noise else None
        sigmas = None if expected is None else float(np.nanpercentile(length / np.maximum(expected, 1e-9), 95))
        seen = [
            np.isfinite(each.lens.unproject(each.intrinsics.from_pixels(found.uv))[..., 0]) for each in (camera, other)
        ]
        yield CameraDifference(
            name, float(np.nanmedian(length)), float(np.nanpercentile(length, 95)), float(np.nanmedian(length[edge])),
            sigmas, found.turn_deg, float(np.mean(seen[0] != seen[1])),
        )  # fmt: skip


def _deviation(evidence: Evidence, name: str, grid: Intrinsics) -> Array | None:
    """σ of one coordinate of a far point, (rows, columns) of `GRID`; None where the corners are not in the file."""
    try:
        adjustment: Adjustment = evidence.adjustment(name)
        return mean_deviation(projection_covariance(adjustment, pixel_grid(grid, GRID), np.inf, name))
    except (ValueError, np.linalg.LinAlgError):
        return None
