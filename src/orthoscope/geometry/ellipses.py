"""Ellipses through points on their rims, many at once.

Points are brought to zero mean and unit covariance, where an ellipse is nearly a circle and the conic

    a x^2 + b x y + c y^2 + d x + e y = 1

is found by linear least squares; near a circle its error is twice the distance from the rim, so that the
linear answer is the geometric one but for the square of the noise.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from orthoscope.geometry.arrays import Float, ndarray

__all__ = ["Ellipses", "fit_ellipses"]

# An ellipse needs this many points.
FEWEST_POINTS = 5


class Ellipses(NamedTuple):
    """Several ellipses; NaN where there is none.

    Attributes:
        centres: (n,2).
        axes: (n,2,2) maps the unit circle about 0 onto each, moved to 0; symmetric.
    """

    centres: Float[ndarray, "n 2"]
    axes: Float[ndarray, "n 2 2"]

    def of(self, which: ndarray) -> Ellipses:
        """Those of some."""
        return Ellipses(self.centres[which], self.axes[which])


def fit_ellipses(rims: Float[ndarray, "n k 2"], *, by_length: bool = False) -> Ellipses:
    """The ellipse through each row of points.

    Args:
        rims: points on each rim; NaN for one that is missing.
        by_length: whether points, which are then in order, count by the length of rim that each stands for,
            as they do where a rim is seen by its pixels, and not each alike.
    """
    found = _fitted(rims, np.ones(rims.shape[:2]))
    if by_length:
        lengths = np.linalg.norm(np.roll(rims, -1, axis=1) - np.roll(rims, 1, axis=1), axis=2)
        inverse = np.linalg.inv(np.where(np.isfinite(found.axes), found.axes, np.eye(2)))
        out = (rims - found.centres[:, None]) @ inverse
        steep = ((out @ inverse) ** 2).sum(2)  # square of a step in radii over one in pixels
        found = _fitted(rims, np.nan_to_num(lengths / np.maximum(steep, 1e-12)))
    return found


def _fitted(rims: Float[ndarray, "n k 2"], weights: Float[ndarray, "n k"]) -> Ellipses:
    seen = np.isfinite(rims[..., 0])
    weights = np.where(seen, weights, 0.0)
    weights = weights / np.maximum(weights.max(1, keepdims=True), 1e-300)
    count = np.maximum(weights.sum(1), 1e-9)[:, None]
    points = np.where(seen[..., None], rims, 0.0)
    middle = (points * weights[..., None]).sum(1) / count
    points = np.where(seen[..., None], rims - middle[:, None], 0.0)
    spread = np.einsum("nki,nkj,nk->nij", points, points, weights) / count[..., None] * 2.0
    usable = (seen.sum(1) >= FEWEST_POINTS) & (np.linalg.det(spread) > 0)
    spread[~usable] = np.eye(2)
    whole = np.linalg.cholesky(spread)
    x, y = np.moveaxis(np.linalg.solve(whole[:, None], points[..., None])[..., 0], -1, 0)
    terms = np.stack([x * x, x * y, y * y, x, y], axis=-1)
    normal = np.einsum("nki,nkj,nk->nij", terms, terms, weights)
    usable &= np.linalg.cond(normal) < 1e10
    normal[~usable] = np.eye(5)
    a, b, c, d, e = np.linalg.solve(normal, (terms * weights[..., None]).sum(1)[..., None])[..., 0].T
    quadratic = np.stack([a, 0.5 * b, 0.5 * b, c], axis=-1).reshape(-1, 2, 2)
    values, vectors = np.linalg.eigh(quadratic)
    usable &= values[:, 0] > 1e-9
    values[~usable] = 1.0
    inverse = np.einsum("nij,nj,nkj->nik", vectors, 1.0 / values, vectors)
    centre = -0.5 * np.einsum("nij,nj->ni", inverse, np.stack([d, e], axis=-1))
    size = 1.0 - 0.5 * (d * centre[:, 0] + e * centre[:, 1])
    usable &= size > 0
    shape = whole @ (inverse * size[:, None, None]) @ whole.swapaxes(1, 2)
    centres = middle + np.einsum("nij,nj->ni", whole, centre)
    shape[~usable], centres[~usable] = np.eye(2), np.nan
    squares, vectors = np.linalg.eigh(shape)
    axes = np.einsum("nij,nj,nkj->nik", vectors, np.sqrt(np.maximum(squares, 0.0)), vectors)
    axes[~usable] = np.nan
    return Ellipses(centres, axes)
