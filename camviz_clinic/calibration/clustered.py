"""The covariance of a solution by the scatter of its views, which are independent of each other as corners are not.

The corners of one view share the board's bend as it is held, the blur, the light, and what the model cannot say. So
their residuals are correlated, and σ² (JᵀJ)⁻¹ counts as many measurements as there are corners where there are hardly
more than views. What the solution would be without each view in turn tells how far it really scatters.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from camviz.lenses.base import Array

FEWEST_VIEWS = 3  # fewer tell no scatter
UNKNOWN = 1e-12  # of a parameter's own information: less is rounding, and nothing that a view measures
ALONE = 1e-6  # of the information on a direction: where all other views have less, one measures it alone


@dataclass(frozen=True, eq=False)
class ByView:
    """Every view's share in the normal equations of the s shared parameters, with the view's own pose taken out.

    `information` (views, s, s) is Aᵢ - Bᵢ Cᵢ⁻¹ Bᵢᵀ and `gradient` (views, s) the same of Jᵀr, in the views that have a
    say (`Arrowhead`). `assumed` (s, s) and `pull` (s,) are what priors add to the sums of both. `alone` is the variance
    of a direction that a single view measures, in that by the noise of its corners: beyond all digits unless given.
    """

    information: Array
    gradient: Array
    assumed: Array
    pull: Array
    alone: float = 1 / UNKNOWN

    def covariance(self, sigma: float) -> Array:
        """The covariance (s, s) of the shared parameters by the delete-one-view jackknife.

        Without view i the solution moves by δᵢ = -(H - Hᵢ)⁻¹ gᵢ, H being the sum of all Hᵢ and of what is assumed, and
        gᵢ the view's gradient at the least sum of squares. The covariance of n views is (n - 1)/n Σ δᵢ δᵢᵀ. That is
        exact for a linear problem, and the CR3 of the sandwich estimators (Bell & McCaffrey 2002, "Bias reduction in
        standard errors for linear regression with multi-stage samples", Survey Methodology 28, 169; Tukey 1958). A
        prior adds its own σ² H⁻¹ PᵀP H⁻¹, `sigma` being the corners' σ in pixels.

        A direction that no view measures gets a variance beyond all digits, and one that a single view measures, which
        no other can contradict, that of `alone`.
        """
        whole = self.information.sum(axis=0) + self.assumed
        scale = np.sqrt(np.maximum(np.einsum("ii->i", whole), 0))  # below 0 by rounding: the poses take all of it
        scale = np.where(scale > 0, scale, 1)
        values, vectors = np.linalg.eigh(whole / np.outer(scale, scale))
        known = values > UNKNOWN * len(values)
        white = vectors[:, known] / np.sqrt(values[known]) / scale[:, None]  # H⁻¹ = white whiteᵀ
        shares = white.T @ self.information @ white
        step = white.T @ (self.gradient.sum(axis=0) + self.pull)  # to the least sum of squares, where it is not there
        scores = self.gradient @ white - shares @ step
        changes, alone = _without_each(shares, scores)
        n = len(changes)
        scatter = (n - 1) / n * changes.T @ changes + sigma**2 * white.T @ self.assumed @ white
        scatter += sigma**2 * self.alone * alone.T @ alone
        beyond = vectors[:, ~known] / scale[:, None]
        return np.asarray(white @ scatter @ white.T + sigma**2 / UNKNOWN * beyond @ beyond.T)


def _without_each(shares: Array, scores: Array) -> tuple[Array, Array]:
    """(1 - Sᵢ)⁻¹ zᵢ (views, k) of shares (views, k, k) that with the prior's add up to 1.

    Without the directions that a single view measures, in which Sᵢ is 1: these, (n, k), are the second result.
    """
    shares, axes = np.linalg.eigh(shares)
    left = 1 - shares
    single = left < ALONE
    along = np.where(single, 0, np.einsum("vij,vi->vj", axes, scores) / np.where(single, 1, left))
    return np.einsum("vij,vj->vi", axes, along), np.swapaxes(axes, 1, 2)[single]
