"""The normal equations of a calibration: a few parameters that all views share, and six of its own for every view."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from camviz.lenses.base import Array


@dataclass(frozen=True, eq=False)
class Arrowhead:
    """JᵀJ and Jᵀr of a least-squares problem in s shared parameters and m of each of v views.

    No two views have a measurement in common, so that JᵀJ is an arrowhead, kept as its blocks:

        ⎡ A    B₁   B₂  … ⎤        A = shared, (s, s)
        ⎢ B₁ᵀ  C₁         ⎥        B = border, (v, s, m)
        ⎢ B₂ᵀ       C₂    ⎥        C = blocks, (v, m, m)
        ⎣ …             … ⎦

    Everything below costs time and memory in proportion to v (Triggs et al. 2000, "Bundle adjustment", section 6.1).
    """

    shared: Array
    border: Array
    blocks: Array
    shared_gradient: Array  # (s,), the upper part of Jᵀr
    gradients: Array  # (v, m), the rest of it

    @classmethod
    def of(cls, by_shared: Array, by_view: Array, residuals: Array) -> Arrowhead:
        """From J's columns (v, n, s) and (v, n, m) and the residuals (v, n) of every view's n measurements."""
        transposed = np.swapaxes(by_shared, 1, 2)
        rows = by_shared.reshape(residuals.size, by_shared.shape[2])
        return cls(
            shared=rows.T @ rows,
            border=transposed @ by_view,
            blocks=np.swapaxes(by_view, 1, 2) @ by_view,
            shared_gradient=rows.T @ residuals.ravel(),
            gradients=np.einsum("vnm,vn->vm", by_view, residuals),
        )

    def __add__(self, other: Arrowhead) -> Arrowhead:
        """The normal equations of two sets of measurements of the same parameters."""
        return Arrowhead(
            self.shared + other.shared,
            self.border + other.border,
            self.blocks + other.blocks,
            self.shared_gradient + other.shared_gradient,
            self.gradients + other.gradients,
        )

    def with_shared(self, by_shared: Array, residuals: Array) -> Arrowhead:
        """With n more measurements of the shared parameters alone: J's rows (n, s) and the residuals (n,)."""
        return replace(
            self,
            shared=self.shared + by_shared.T @ by_shared,
            shared_gradient=self.shared_gradient + by_shared.T @ residuals,
        )

    def damped(self, damping: float) -> Arrowhead:
        """The same with its diagonal multiplied by 1 + damping (Marquardt 1963)."""
        shared, blocks = self.shared.copy(), self.blocks.copy()
        np.einsum("ii->i", shared)[...] *= 1 + damping
        np.einsum("vii->vi", blocks)[...] *= 1 + damping
        return Arrowhead(shared, self.border, blocks, self.shared_gradient, self.gradients)

    @cached_property
    def block_inverses(self) -> Array:
        """Cᵢ⁻¹, (v, m, m): a view's covariance, for σ = 1, if the shared parameters were known."""
        return inverse(self.blocks)

    @cached_property
    def pose_response(self) -> Array:
        """Wᵢ = Cᵢ⁻¹ Bᵢᵀ, (v, m, s): a view's parameters follow an error δ of the shared ones by -Wᵢ δ."""
        return self.block_inverses @ np.swapaxes(self.border, 1, 2)

    @cached_property
    def information(self) -> Array:
        """A - Σ Bᵢ Cᵢ⁻¹ Bᵢᵀ, (s, s): the information on the shared parameters when every view's own are free."""
        return self.shared - np.einsum("vsm,vmt->st", self.border, self.pose_response)

    @cached_property
    def covariance(self) -> Array:
        """The covariance of the shared parameters, (s, s), for σ = 1."""
        return inverse(self.information)

    def solution(self, *, only_views: bool = False) -> tuple[Array, Array]:
        """The δ with JᵀJ δ = Jᵀr: shared (s,) and of the views (v, m); or of the views, with the shared ones kept."""
        views = np.einsum("vmn,vn->vm", self.block_inverses, self.gradients)
        if only_views:
            return np.zeros_like(self.shared_gradient), views
        shared = self.covariance @ (self.shared_gradient - np.einsum("vms,vm->s", self.pose_response, self.gradients))
        return shared, views - self.pose_response @ shared


def inverse(matrices: Array) -> Array:
    """The inverses of symmetric positive matrices (..., n, n), whose rows may have different units.

    A direction that is not determined gets the largest variance that rounding can tell from infinity.
    """
    if not matrices.shape[-1]:
        return matrices
    scale = np.sqrt(np.maximum(np.einsum("...ii->...i", matrices), 0))  # below 0 by rounding: not determined
    scale = np.where(scale > 0, scale, 1)[..., None]
    scale = scale * np.swapaxes(scale, -1, -2)
    values, vectors = np.linalg.eigh(matrices / scale)
    floor = values.shape[-1] * np.finfo(float).eps * np.maximum(values[..., -1:], 1)  # less than 1: nothing but zeros
    return (vectors / np.maximum(values, floor)[..., None, :]) @ np.swapaxes(vectors, -1, -2) / scale
