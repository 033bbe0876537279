"""How well a pair knows the depth of what it sees, against that depth."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any, ClassVar

import numpy as np

from camviz.cameras import transform
from camviz.draw import plot, svg
from camviz.draw.flow import rows
from camviz.draw.marks import NOTHING
from camviz.draw.picture import Picture
from camviz.lenses.base import Array
from camviz.views.base import View, slider
from camviz_clinic.calibration.adjustment import Adjustment
from camviz_clinic.calibration.stereo_depth import DepthUncertainty, depth_uncertainty
from camviz_clinic.checks.task import length
from camviz_clinic.views.observations import Missing
from camviz_clinic.views.uncertainty import adjusted, determined

_LAYOUT = rows((376, {"depth error": 680, "in words": 280}))


@dataclass(frozen=True)
class DepthErrorView(View):
    """The standard deviation of depth in the middle of the picture: what the calibration adds, what matching, and both.

    The calibration's part comes from the joint covariance of both cameras and their places.
    """

    title: ClassVar[str] = "Depth error against range"

    adjustment: Adjustment = field(compare=False, repr=False)
    matching: float = slider(0.25, 0.0, 2.0, 0.05, unit="px", help="how well a point is matched in the other picture")
    farthest: float = slider(10.0, 1, 100, 1, unit="m", help="how far the axis goes")

    @classmethod
    def of(cls, calibration: Any) -> DepthErrorView:
        """The view of a calibrated pair. Raises Missing where there is none, or not what it was solved from."""
        names = tuple(calibration.cameras)[:2]
        if len(names) < 2:
            raise Missing("The file holds one camera; this needs a pair.")
        adjustment = determined(adjusted(calibration, *names))
        if not np.linalg.norm(adjustment.cameras[names[1]].centre) > 0:
            raise Missing("The file does not say how one camera stands to the other.")
        return cls(adjustment)

    @property
    def names(self) -> tuple[str, str]:
        """The two cameras."""
        left, right = tuple(self.adjustment.cameras)[:2]
        return left, right

    @property
    def baseline(self) -> float:
        """In metres."""
        left, right = (self.adjustment.cameras[name].centre for name in self.names)
        return float(np.linalg.norm(right - left))

    def uncertainty(self, depths: Array) -> DepthUncertainty:
        """At depths (n,) in metres; NaN where the right camera does not see the point."""
        left, right = self.names
        found = depth_uncertainty(self.adjustment, depths, self.matching, left=left, right=right)
        cameras = self.adjustment.cameras
        k = cameras[left].intrinsics
        ray = cameras[left].lens.unproject(k.from_pixels([(k.width - 1) / 2, (k.height - 1) / 2]))
        seen = cameras[right].sees(transform(cameras[left].world_from_cam, depths[:, None] * ray / ray[2]))
        parts = (np.where(seen, part, np.nan) for part in (found.from_calibration, found.from_matching))
        return DepthUncertainty(depths, *parts)

    def description(self) -> str:
        depths = np.array([1.0, self.farthest / 2, self.farthest])
        found = self.uncertainty(depths)
        told = "; ".join(
            f"at {z:g} m ±{length(t)} (calibration {length(c)}, matching {length(m)})"
            for z, c, m, t in zip(depths, found.from_calibration, found.from_matching, found.total, strict=True)
        )
        return f"Baseline {self.baseline:.4g} m, matching ±{self.matching:g} px: {told}."

    def figure(self, *, draft: bool = False) -> Picture:
        depths = np.linspace(self.farthest / 100, self.farthest, 61)
        found = self.uncertainty(depths)
        curves = {"calibration": found.from_calibration, "matching": found.from_matching, "total": found.total}
        finite = found.total[np.isfinite(found.total)]
        top = 1.08 * float(finite.max()) if finite.size and finite.max() > 0 else 1.0
        unit, factor = ("m", 1.0) if top > 0.5 else ("cm", 100.0) if top > 0.02 else ("mm", 1000.0)
        panel = plot.plot_panel("depth", 70, 34, 590, 280, (0, self.farthest), (0, top * factor))
        content = NOTHING
        classes = {"calibration": "blue thick", "matching": "orange thick", "total": "ink thick"}
        for name, curve in curves.items():
            content += plot.curve(panel, depths, factor * curve, classes[name])
        content += plot.legend(panel, [(classes[name], name) for name in curves])
        names = "depth [m]", f"standard deviation [{unit}]"
        words = (
            "Both parts grow with the square of the depth: an error of the disparity or of the angle between the "
            "cameras "
            "moves a point the farther, the farther it is.\n \n"
            f"Matching: Z² σ / (f B), with the baseline B = {self.baseline:.4g} m.\n \n"
            "Calibration: what the scatter of the views leaves open in both cameras and in how they stand. It is "
            "the same "
            "for all points of a picture, so averaging does not lessen it. Model error is left out."
        )
        body = plot.plotted(panel, content, *names, title=f"{' and '.join(self.names)}, middle of the picture")
        return self.tiled(_LAYOUT, {"depth error": body, "in words": svg.paragraph((690, 50), words, 255)})
