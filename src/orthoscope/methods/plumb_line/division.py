"""The division model's coefficient from edges, linearly: where the search for a lens starts.

With the lens x_u = x / (1 + l r^2) about the image's centre a straight line a x_u + b y_u + c = 0 is

    a x + b y + c + (c l) r^2 = 0

in the photograph, a circle, and linear in (a, b, c, c l): each edge has an l of its own, from one singular
value decomposition. The one under which the edges are straightest is taken, each edge counting by its length
and no more than so much: what is no image of a straight line has no say.

A. Fitzgibbon, Simultaneous linear estimation of multiple view geometry and lens distortion, CVPR 2001, has
the model and why it is linear, there for correspondences between views.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from orthoscope.geometry.arrays import Float, ndarray
from orthoscope.methods.plumb_line.edges import Edge

__all__ = ["bend_of_edges", "division_of_edges", "off_straight"]

# Edges that are asked for a coefficient, the longest.
ASKED = 300
# An edge that is off by more, pixels rms, is not straight under this coefficient, and how much no longer
# counts.
BENT_PX = 1.0
# Of half the diagonal: an edge that is longer has no more say, since a cable that hangs is long as well.
LONG = 0.4
# In units of half the diagonal: beyond this a coefficient is that of a circle in the scene.
STRONGEST, WEAKEST = -0.9, 0.5


def division_of_edges(edges: Sequence[Edge], image_size: tuple[int, int]) -> float:
    """The coefficient, in units of half the image's diagonal; 0 without edges."""
    candidates = [0.0, *(_of_edge(edge, image_size) for edge in edges[:ASKED])]
    likely = [value for value in candidates if STRONGEST < value < WEAKEST]
    length = np.minimum([edge.length for edge in edges], LONG * _unit(image_size))
    bent = [bend_of_edges(edges, image_size, value) for value in likely]
    costs = [float(length @ np.minimum(one, BENT_PX) ** 2) for one in bent]
    return likely[int(np.argmin(costs))]


def bend_of_edges(edges: Sequence[Edge], image_size: tuple[int, int], value: float) -> Float[ndarray, " e"]:
    """How far from straight each edge is under a coefficient: rms, about pixels of the photograph."""
    points = np.concatenate([_centred(edge, image_size) for edge in edges])
    stretch = 1.0 / (1.0 + value * (points * points).sum(1))
    return _unit(image_size) * off_straight(points * stretch[:, None], edges) / _means(stretch, edges)


def off_straight(points: Float[ndarray, "n 2"], edges: Sequence[Edge]) -> Float[ndarray, " e"]:
    """Rms distance of the points of each edge, one edge after the other, from the line nearest to them."""
    x, y = points.T
    mean_x, mean_y = _means(x, edges), _means(y, edges)
    xx, yy = _means(x * x, edges) - mean_x**2, _means(y * y, edges) - mean_y**2
    xy = _means(x * y, edges) - mean_x * mean_y
    least = 0.5 * (xx + yy) - np.hypot(0.5 * (xx - yy), xy)
    return np.sqrt(np.maximum(least, 0.0))


def _means(values: Float[ndarray, " n"], edges: Sequence[Edge]) -> Float[ndarray, " e"]:
    """Of each edge's points."""
    counts = np.array([len(edge.pixels) for edge in edges])
    return np.add.reduceat(values, np.cumsum(counts) - counts) / counts


def _of_edge(edge: Edge, image_size: tuple[int, int]) -> float:
    """The coefficient under which one edge is straight."""
    x = _centred(edge, image_size)
    rows = np.column_stack([x, np.ones(len(x)), (x * x).sum(1)])
    a, b, c, d = np.linalg.svd(rows, full_matrices=False)[2][-1]
    return float(d / c) if abs(c) > 1e-9 * np.hypot(a, b) else 0.0


def _centred(edge: Edge, image_size: tuple[int, int]) -> Float[ndarray, "n 2"]:
    return (edge.pixels - 0.5 * (np.array(image_size) - 1.0)) / _unit(image_size)


def _unit(image_size: tuple[int, int]) -> float:
    return 0.5 * float(np.hypot(*image_size))
