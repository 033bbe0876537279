"""A prior on the denominator of a rational lens, which keeps its poles out of the picture."""

from __future__ import annotations

from dataclasses import dataclass
from math import inf, log

import numpy as np

from camviz.distortion.limits import NEARLY_A_POLE
from camviz.lenses import Lens
from camviz.lenses.base import Array

RADII = 12  # at which the denominator is asked, evenly in r²
NOISE = 0.1  # pixels in a corner's coordinate, mrcal's nominal_pixel_error
LIKELY = -log(NEARLY_A_POLE) / 3  # of log D: a near-pole is three deviations away


@dataclass(frozen=True)
class DenominatorPrior:
    """log D(r²) is normal about 0 from the axis to the radius `reach`, D being the lens's denominator.

    Its standard deviation is `deviation`, but below 0 at most log(5)/3: a near-pole of D = 1/5 is three deviations
    away or more, and a pole costs without end, so that no calibration gets there. The prior stands among the
    measurements, corners of `noise` σ in pixels: log D counts as a residual of σ/τ log D pixels. The twelve radii
    together weigh as much as the three coefficients that there are.

    mrcal draws k4, k5 and k6 themselves to 0, with 0.5 px each (mrcal.c, "regularization"). What such coefficients
    mean depends on the angle of view: 0.5 px hardly hold a narrow lens, and bend one of 150°, whose D rises to 1000.
    """

    reach: float
    deviation: float = LIKELY
    noise: float = NOISE

    def __post_init__(self) -> None:
        for name in ("reach", "deviation", "noise"):
            if not 0 < getattr(self, name) < inf:
                raise ValueError(f"{name} must be positive and finite, got {getattr(self, name)}")

    def cost(self, lens: Lens) -> float:
        """What it adds to the sum of squares, in px²; infinite where there is a pole."""
        D = lens.denominator(self._squared_radii)
        return float(np.sum((self._weights(D) * np.log(D)) ** 2)) if (D > 0).all() else inf

    def scatter(self, lens: Lens) -> float:
        """Σ (log D)² over as many radii as there are coefficients; infinite where there is a pole."""
        D = lens.denominator(self._squared_radii)
        return float(np.mean(np.log(D) ** 2) * len(lens.denominator_terms)) if (D > 0).all() else inf

    def rows(self, lens: Lens, names: tuple[str, ...]) -> tuple[Array, Array]:
        """The derivative (12, n) of what it expects by the parameters `names`, and its residuals (12,), in pixels.

        They are 0 where the denominator is not positive, for a lens that was not solved under this prior.
        """
        s = self._squared_radii
        D = lens.denominator(s)
        good = D > 0
        D = np.where(good, D, 1)
        powers = {name: s**power for power, name in enumerate(lens.denominator_terms, 1)}
        columns = [powers.get(name, np.zeros(RADII)) for name in names]
        slopes = (self._weights(D) / D)[:, None] * np.stack(columns, axis=-1)
        return np.where(good[:, None], slopes, 0), -self._weights(D) * np.log(D)

    @property
    def _squared_radii(self) -> Array:
        return self.reach**2 * np.arange(1, RADII + 1) / RADII

    def _weights(self, D: Array) -> Array:
        """Pixels for each log D (12,)."""
        deviations = np.where(D < 1, min(self.deviation, LIKELY), self.deviation)
        return self.noise / deviations * np.sqrt(3 / RADII)
