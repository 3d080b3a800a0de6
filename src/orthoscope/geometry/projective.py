"""The projective plane: homographies for all views at once, fitted lines, cross-ratios.

A plane point p = (X, Y, 1) is seen along ray r where r x (H p) = 0. Stacked over the corners of a view, the
normal matrix of these equations is  sum (|r|^2 I - r r^T) (x) (p p^T), 9 by 9; H is its last eigenvector.
Rays may lie past 90 degrees. Pixels are the rays (u, v, 1) after Hartley's normalisation (R. Hartley, In
defense of the eight-point algorithm, TPAMI 19(6), 1997). Views are padded to one length; weight 0 marks
padding.

What every projection keeps: points of a line stay on a line, and the cross-ratio of four of them (the paper's
eq. 5 and 6) stays
    CR = |p1 p3| |p2 p4| / (|p1 p4| |p2 p3|),   4/3 for four equally spaced points.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from orthoscope.geometry.arrays import Float, ndarray

__all__ = [
    "FittedLines",
    "cross_ratio",
    "cross_ratio_slope",
    "fitted_lines",
    "homographies_to_pixels",
    "homographies_to_rays",
]

# Where each entry of a symmetric 3x3 matrix stands among its six different ones.
SYMMETRIC_PLACES = np.array([[0, 1, 2], [1, 3, 4], [2, 4, 5]])
# So many views are done together, so that the intermediate arrays stay in the processor's cache.
VIEWS_AT_ONCE = 15


def homographies_to_rays(
    points: Float[ndarray, "v n 2"], rays: Float[ndarray, "v n 3"], weights: Float[ndarray, "v n"]
) -> Float[ndarray, "v 3 3"]:
    """H of each view, H (X, Y, 1) along the ray, scaled to |H| = 1 and to point forward along its rays.

    Args:
        points: of the target's plane, (v,n,2) metres.
        rays: of these points, (v,n,3), any length.
        weights: (v,n), 0 where there is no corner.
    """
    h = np.empty((len(points), 3, 3))
    for start in range(0, len(points), VIEWS_AT_ONCE):
        some = slice(start, start + VIEWS_AT_ONCE)
        h[some] = _homographies(points[some], rays[some], weights[some])
    return h / np.sqrt((h * h).sum((1, 2), keepdims=True))


def _homographies(points: ndarray, rays: ndarray, weights: ndarray) -> ndarray:
    """H of each of some views up to a positive factor, its parameters as those of `homographies_to_rays`.

    Both factors of the normal matrix are symmetric, so six sums stand for nine.
    """
    normalised, plane_from_target = _hartley(points, weights)
    (X, Y), (x, y, z) = np.moveaxis(normalised, -1, 0), np.moveaxis(rays, -1, 0)
    one = np.ones_like(X)
    pp = np.stack([X * X, X * Y, X, Y * Y, Y, one], axis=1)
    rr = (
        np.stack([y * y + z * z, -x * y, -x * z, x * x + z * z, -y * z, x * x + y * y], axis=1)
        * weights[:, None]
    )
    sums = rr @ pp.transpose(0, 2, 1)
    normal = sums[:, SYMMETRIC_PLACES[:, None, :, None], SYMMETRIC_PLACES[None, :, None, :]].reshape(-1, 9, 9)
    h = np.linalg.eigh(normal)[1][:, :, 0].reshape(-1, 3, 3)
    forward = ((h @ np.stack([X, Y, one], axis=1)) * np.stack([x, y, z], axis=1)).sum(1)
    return h * np.where((weights * forward).sum(-1) < 0, -1.0, 1.0)[:, None, None] @ plane_from_target


def homographies_to_pixels(
    points: Float[ndarray, "v n 2"], pixels: Float[ndarray, "v n 2"], weights: Float[ndarray, "v n"]
) -> Float[ndarray, "v 3 3"]:
    """H of each view from the target's plane to pixels, scaled to |H| = 1, third coordinate positive.

    Args:
        points: of the target's plane, (v,n,2) metres.
        pixels: of these points, (v,n,2).
        weights: (v,n), 0 where there is no corner.
    """
    normalised, plane_from_pixels = _hartley(pixels, weights)
    rays = np.concatenate([normalised, np.ones_like(normalised[..., :1])], axis=-1)
    h = np.linalg.solve(plane_from_pixels, homographies_to_rays(points, rays, weights))
    return h / np.sqrt((h * h).sum((1, 2), keepdims=True))


class FittedLines(NamedTuple):
    """The line nearest to each set of points, through `middle` along the unit vector `direction`.

    Attributes:
        middle: (...,2), the mean of the points.
        direction: (...,2), a unit vector.
        along: (...,n), the place of each point on the line, from its middle.
        across: (...,n), each one's signed distance from the line, to the side of (-direction_y, direction_x).
        gap: (...), the sum of squares along the line less that across it; 0 for points without a direction.
    """

    middle: Float[ndarray, "*batch 2"]
    direction: Float[ndarray, "*batch 2"]
    along: Float[ndarray, "*batch n"]
    across: Float[ndarray, "*batch n"]
    gap: Float[ndarray, "*batch"]


def fitted_lines(points: Float[ndarray, "*batch n 2"], weights: Float[ndarray, "*batch n"]) -> FittedLines:
    """The line with the least sum of squared distances from its points, for every set of the stack.

    Args:
        points: (...,n,2).
        weights: (...,n), 0 where there is no point.
    """
    middle = (weights[..., None] * points).sum(-2) / weights.sum(-1)[..., None]
    x, y = np.moveaxis(points - middle[..., None, :], -1, 0)
    more, mixed = (weights * (x * x - y * y)).sum(-1), 2.0 * (weights * x * y).sum(-1)
    turn = 0.5 * np.arctan2(mixed, more)
    cosine, sine = np.cos(turn), np.sin(turn)
    along, across = x * cosine[..., None] + y * sine[..., None], y * cosine[..., None] - x * sine[..., None]
    return FittedLines(middle, np.stack([cosine, sine], axis=-1), along, across, np.hypot(more, mixed))


def cross_ratio(points: Float[ndarray, "*batch 4 2"]) -> Float[ndarray, "*batch"]:
    """The cross-ratio of four points in their order along a line, as in the module's docstring."""
    return (
        _distance(points, 0, 2)
        * _distance(points, 1, 3)
        / (_distance(points, 0, 3) * _distance(points, 1, 2))
    )


def cross_ratio_slope(points: Float[ndarray, "*batch 4 2"]) -> Float[ndarray, "*batch 4 2"]:
    """Derivative of `cross_ratio` by each coordinate of its four points.

    As a formula of distances it goes on where the points leave their line.
    """
    slope = np.zeros_like(points)
    for i, j, sign in ((0, 2, 1.0), (1, 3, 1.0), (0, 3, -1.0), (1, 2, -1.0)):
        by_i = sign * (points[..., i, :] - points[..., j, :]) / _distance(points, i, j)[..., None] ** 2
        slope[..., i, :] += by_i
        slope[..., j, :] -= by_i
    return cross_ratio(points)[..., None, None] * slope


def _distance(points: Float[ndarray, "*batch 4 2"], i: int, j: int) -> Float[ndarray, "*batch"]:
    return np.hypot(points[..., i, 0] - points[..., j, 0], points[..., i, 1] - points[..., j, 1])


def _hartley(
    plane: Float[ndarray, "v n 2"], weights: Float[ndarray, "v n"]
) -> tuple[Float[ndarray, "v n 2"], Float[ndarray, "v 3 3"]]:
    """The points with mean 0 and mean squared radius 2, and the matrix that took them there."""
    total = np.maximum(weights.sum(-1), 1e-300)[:, None]
    centre = (weights[..., None] * plane).sum(1) / total
    spread = plane - centre[:, None]
    scale = np.sqrt(2.0 * total / np.maximum((weights[..., None] * spread**2).sum((1, 2))[:, None], 1e-300))
    matrix = np.zeros((len(plane), 3, 3))
    matrix[:, 0, 0] = matrix[:, 1, 1] = scale[:, 0]
    matrix[:, :2, 2] = -scale * centre
    matrix[:, 2, 2] = 1.0
    return spread * scale[:, :, None], matrix
