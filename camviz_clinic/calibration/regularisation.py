"""Solving under a prior on the denominator.

A rational lens has the same picture with many pairs of numerator and denominator. Corners hardly tell them apart:
free, the denominator follows the noise, and where no corner was seen it comes near 0 or passes through it. So a
rational model is always solved under a `DenominatorPrior`, as mrcal does it. OpenCV's own minimum is a call of
cv2.calibrateCamera away.

There are two such priors. The broad one forbids near-poles and little else: a lens whose denominator rises to a
thousand is what it was without it. Under the strict one the solution is that of the standard model, to the digits that
a solver has, so that it predicts as well. The broad one is taken where it lessens the sum of squares, in σ², by more
than 2 for each coefficient: then it can be expected to predict the corners that it has not seen better, too (Akaike
1974, "A new look at the statistical model identification").
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import replace

import numpy as np

from camviz.distortion import image_reach
from camviz_clinic.calibration.adjustment import Adjustment
from camviz_clinic.calibration.denominator_prior import LIKELY, DenominatorPrior

BROAD, STRICT = 10.0, 1e-6  # deviations of log D: any D, and D within a millionth of 1
TIGHTENED = tuple(np.geomspace(LIKELY, STRICT, 4).tolist())  # on the way to the strict one
ROUGHLY = 1e-8  # of the sum of squares, where it goes on from there
EARNED = 2.0  # of the sum of squares, in σ², for each coefficient


def with_priors(adjustment: Adjustment) -> Adjustment:
    """The same problem with a prior on every denominator, out to the picture's farthest ray as the cameras have it."""
    return replace(adjustment, priors=dict.fromkeys(adjustment.cameras, DenominatorPrior(1.0)))


def regularised(adjustment: Adjustment) -> Adjustment:
    """The problem at its least cost, each prior broad or strict as the corners have it; `refined` without priors."""
    if not adjustment.at_work:
        return adjustment.refined()
    broad = _under(adjustment, adjustment.at_work, BROAD).refined(settled=ROUGHLY)
    if not broad.sigma > 0:
        return broad
    broad = _under(broad, broad.at_work, BROAD).refined(
        settled=ROUGHLY
    )  # the lens now tells how far its picture reaches
    for name in broad.at_work:
        broad = _better(broad, name)
    return broad.refined()


def _better(broad: Adjustment, name: str) -> Adjustment:
    """The solution with one camera's prior made strict, unless its denominator earns its coefficients."""
    strict = broad
    for deviation in TIGHTENED:
        strict = _under(strict, [name], deviation).refined(settled=ROUGHLY)
    free = set(broad.estimated[name]) & set(broad.cameras[name].lens.denominator_terms)
    used = {each: mask & strict.used[each] for each, mask in broad.used.items()}
    gained = strict.sum_of_squares_over(used) - broad.sum_of_squares_over(used)
    return broad if gained > EARNED * len(free) * broad.sigma**2 else strict


def _under(adjustment: Adjustment, names: Iterable[str], deviation: float) -> Adjustment:
    """With the priors of these cameras as wide as that; they reach as far as they can without a pole."""
    priors = dict(adjustment.priors)
    for name in names:
        camera, prior = adjustment.cameras[name], priors[name]
        noise = adjustment.sigma if adjustment.sigma > 0 else prior.noise
        there = DenominatorPrior(image_reach(camera), deviation, noise)
        priors[name] = there if np.isfinite(there.cost(camera.lens)) else replace(there, reach=prior.reach)
    return replace(adjustment, priors=priors)
