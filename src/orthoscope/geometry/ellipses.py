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


def fit_ellipses(rims: Float[ndarray, "n k 2"]) -> Ellipses:
    """The ellipse through each row of points.

    Args:
        rims: points on each rim; NaN for one that is missing.
    """
    seen = np.isfinite(rims[..., 0])
    count = np.maximum(seen.sum(1), 1)[:, None]
    points = np.where(seen[..., None], rims, 0.0)
    middle = points.sum(1) / count
    points = np.where(seen[..., None], rims - middle[:, None], 0.0)
    spread = np.einsum("nki,nkj->nij", points, points) / count[..., None] * 2.0
    usable = (seen.sum(1) >= FEWEST_POINTS) & (np.linalg.det(spread) > 0)
    spread[~usable] = np.eye(2)
    whole = np.linalg.cholesky(spread)
    x, y = np.moveaxis(np.linalg.solve(whole[:, None], points[..., None])[..., 0], -1, 0)
    terms = np.stack([x * x, x * y, y * y, x, y], axis=-1)
    normal = np.einsum("nki,nkj->nij", terms, terms)
    usable &= np.linalg.cond(normal) < 1e10
    normal[~usable] = np.eye(5)
    a, b, c, d, e = np.linalg.solve(normal, terms.sum(1)[..., None])[..., 0].T
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
