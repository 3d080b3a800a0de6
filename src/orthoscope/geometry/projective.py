"""Homographies from the target's plane to rays or pixels, for all views at once.

Floor 0.  A plane point p = (X, Y, 1) is seen along ray r where r x (H p) = 0.  Stacked over the corners of a view, the
normal matrix of these equations is  sum (|r|^2 I - r r^T) (x) (p p^T), 9 by 9; H is its last eigenvector.  Rays may lie past
90 degrees.  Pixels are the rays (u, v, 1) after Hartley's normalisation (R. Hartley, In defense of the eight-point
algorithm, TPAMI 19(6), 1997).  Views are padded to one length; weight 0 marks padding.
"""

from __future__ import annotations

import numpy as np

from orthoscope.geometry.arrays import Float, ndarray

__all__ = ["homographies_to_pixels", "homographies_to_rays"]


def homographies_to_rays(
    points: Float[ndarray, "v n 2"], rays: Float[ndarray, "v n 3"], weights: Float[ndarray, "v n"]
) -> Float[ndarray, "v 3 3"]:
    """H of each view with H (X, Y, 1) along the ray, scaled to |H| = 1 and to point forward along its rays.

    points: target plane, metres.  rays: any length.  weights: 0 where there is no corner.
    """
    normalised, plane_from_target = _hartley(points, weights)
    p = np.concatenate([normalised, np.ones_like(normalised[..., :1])], axis=-1)
    view, n = weights.shape
    pp = (p[..., :, None] * p[..., None, :]).reshape(view, n, 9)
    rr = np.eye(3) * (rays * rays).sum(-1)[..., None, None] - rays[..., :, None] * rays[..., None, :]
    blocks = np.swapaxes(rr.reshape(view, n, 9) * weights[..., None], 1, 2) @ pp  # (v, 9 of r, 9 of p)
    normal = blocks.reshape(view, 3, 3, 3, 3).transpose(0, 1, 3, 2, 4).reshape(view, 9, 9)
    h = np.linalg.eigh(normal)[1][:, :, 0].reshape(view, 3, 3)
    forward = (weights * ((p @ np.swapaxes(h, 1, 2)) * rays).sum(-1)).sum(-1)
    h = h * np.where(forward < 0, -1.0, 1.0)[:, None, None] @ plane_from_target
    return h / np.sqrt((h * h).sum((1, 2), keepdims=True))


def homographies_to_pixels(
    points: Float[ndarray, "v n 2"], pixels: Float[ndarray, "v n 2"], weights: Float[ndarray, "v n"]
) -> Float[ndarray, "v 3 3"]:
    """H of each view from the target's plane (metres) to pixels, scaled to |H| = 1, third coordinate positive."""
    normalised, plane_from_pixels = _hartley(pixels, weights)
    rays = np.concatenate([normalised, np.ones_like(normalised[..., :1])], axis=-1)
    h = np.linalg.solve(plane_from_pixels, homographies_to_rays(points, rays, weights))
    return h / np.sqrt((h * h).sum((1, 2), keepdims=True))


def _hartley(plane: Float[ndarray, "v n 2"], weights: Float[ndarray, "v n"]) -> tuple[Float[ndarray, "v n 2"], Float[ndarray, "v 3 3"]]:
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
