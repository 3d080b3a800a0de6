"""What repeats from view to view, at one corner of the target or one place of the image, is no outlier.

A wrong corner is wrong in one photograph. A residual that comes back at one corner *of the target* in every
view says that the target is not as it is described; residuals that are large at one place *of the image*,
whatever corner lies there, say that the lens formula cannot follow the lens. The first can be taken away:
corner i moved by d_i moves its pixel in view j by J_ij d_i, and d_i follows by robust least squares over the
views, with a prior that weighs as much as PRIOR_VIEWS views. Of the second, the typical size can be told.
"""

from __future__ import annotations

import numpy as np

from orthoscope.fitting.observations import Observations
from orthoscope.fitting.reprojection import Estimate, Reprojection
from orthoscope.geometry.arrays import Float, Int, ndarray

__all__ = ["by_target", "cells_of", "thirds_of_groups"]

# The prior weighs as much as this many views: what one photograph says of a corner is mostly its own error,
# what five say alike is the corner's place.
PRIOR_VIEWS = 1.0
# Noise is never taken to be less than this, pixels.
LEAST_NOISE = 1e-9
# To see how their pixels move, corners are moved by this share of the target's extent: little beside a
# square, much beside rounding.
SHIFT_SHARE = 1e-3
# Errors are reweighted this often, towards least absolute ones.
REWEIGHTING_ROUNDS = 4
# A cell of the image has about this many corners. The lower third tells the typical one, so that half of a
# cell may be wrong.
CORNERS_PER_CELL = 48


def by_target(
    observations: Observations,
    points: Float[ndarray, "p 3"],
    estimate: Estimate,
    residuals: Float[ndarray, "m n 2"],
    *,
    noise: float,
) -> Float[ndarray, "m n 2"]:
    """The part of the residuals that a displacement of the target's corners explains.

    Args:
        observations: the views.
        points: of the target, (p,3) metres.
        estimate: camera and poses.
        residuals: of all corners, (m,n,2) pixels.
        noise: of one coordinate, pixels; residuals below it all weigh the same.
    Returns:
        (m,n,2) pixels; 0 in the padding.
    """
    seen = observations.present > 0
    ids, e, J = (
        observations.ids[seen],
        residuals[seen],
        _pixels_by_place(observations, points, estimate, residuals)[seen],
    )
    prior = PRIOR_VIEWS * 0.5 * (J[..., :2] ** 2).sum((1, 2)).mean() * np.eye(3)
    products = np.concatenate([(J.transpose(0, 2, 1) @ J).reshape(-1, 9), (e[:, None] @ J)[:, 0]], axis=1)
    left = e
    for _ in range(REWEIGHTING_ROUNDS):
        weight = 1.0 / np.maximum(np.hypot(*left.T), max(noise, LEAST_NOISE))
        weight /= _greatest(weight, ids, len(points))[ids]
        sums = _sums(weight[:, None] * products, ids, len(points))
        displacements = np.linalg.solve(sums[:, :9].reshape(-1, 3, 3) + prior, sums[:, 9:, None])
        left = e - (J @ displacements[ids])[..., 0]
    explained = np.zeros_like(residuals)
    explained[seen] = e - left
    return explained


def cells_of(pixels: Float[ndarray, "n 2"]) -> Int[ndarray, " n"]:
    """A cell of the image for each pixel, 0, 1, 2..., about CORNERS_PER_CELL in each.

    The image is cut into strips that hold as many each, and these into cells that do.
    """
    n = len(pixels)
    sides = max(1, round(np.sqrt(n / CORNERS_PER_CELL)))
    strip = _ranks(pixels[:, 0]) * sides // max(n, 1)
    starts = np.searchsorted(np.sort(strip), np.arange(sides + 1))
    within = np.empty(n, dtype=np.int64)
    within[np.lexsort((pixels[:, 1], strip))] = np.arange(n)
    return strip * sides + (within - starts[strip]) * sides // np.maximum(np.diff(starts)[strip], 1)


def thirds_of_groups(
    values: Float[ndarray, " n"], group: Int[ndarray, " n"], groups: int
) -> Float[ndarray, " g"]:
    """What a third of the values of each group are below; infinite for a group without any.

    Args:
        values: any numbers, (n,).
        group: the number of each value's group, (n,).
        groups: how many groups there are.
    """
    counts = np.bincount(group, minlength=groups)
    third = np.cumsum(counts) - counts + counts // 3
    ranked = np.append(values[np.lexsort((values, group))], np.inf)
    return np.where(counts > 0, ranked[np.minimum(third, len(values))], np.inf)


def _pixels_by_place(
    observations: Observations,
    points: Float[ndarray, "p 3"],
    estimate: Estimate,
    residuals: Float[ndarray, "m n 2"],
) -> Float[ndarray, "m n 2 3"]:
    """How each corner's pixel moves with its place in the target, px/m.

    The whole target is moved a little along each axis.
    """
    step = SHIFT_SHARE * float(np.ptp(points, axis=0).max())
    moved = [
        Reprojection(observations, points + shift, estimate.camera).residuals(estimate)
        for shift in step * np.eye(3)
    ]
    return np.nan_to_num(np.stack([there - residuals for there in moved], axis=-1) / step)


def _sums(values: Float[ndarray, "n c"], group: Int[ndarray, " n"], groups: int) -> Float[ndarray, "g c"]:
    """Sums of the rows of each group."""
    columns = values.shape[1]
    places = (group[:, None] * columns + np.arange(columns)).ravel()
    return np.bincount(places, weights=values.ravel(), minlength=groups * columns).reshape(groups, columns)


def _greatest(values: Float[ndarray, " n"], group: Int[ndarray, " n"], groups: int) -> Float[ndarray, " g"]:
    """The greatest value of each group; 0 for a group without any."""
    greatest = np.zeros(groups)
    np.maximum.at(greatest, group, values)
    return greatest


def _ranks(values: Float[ndarray, " n"]) -> Int[ndarray, " n"]:
    """The place of each value in ascending order."""
    ranks = np.empty(len(values), dtype=np.int64)
    ranks[np.argsort(values, kind="stable")] = np.arange(len(values))
    return ranks
