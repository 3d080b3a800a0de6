"""Some views that stand for many: as far apart from each other as can be.

A view is where its board is, how large and how it leans: the middle of its corners, their spread and how the
spread turns.  From the most ordinary one on, always that is taken which is farthest from all that are
(T. Gonzalez, Clustering to minimize the maximum intercluster distance, 1985), so that the rare ones, which
tell most about a camera, are among them, whatever the order of the photographs.
"""

from __future__ import annotations

from functools import lru_cache

import numpy as np

from orthoscope.geometry.arrays import Float, ndarray
from orthoscope.targets.detections import Detections

__all__ = ["representative"]


@lru_cache(maxsize=2)
def representative(detections: Detections, views: int) -> Detections:
    """At most so many of the views, in their order, the same each time; the detections themselves where there
    are no more.

    Args:
        views: how many are wanted.
    """
    if len(detections.views) <= views:
        return detections
    places = _places(detections)
    taken = [int(np.argmin(((places - places.mean(0)) ** 2).sum(1)))]
    apart = np.full(len(places), np.inf)
    while len(taken) < views:
        apart = np.minimum(apart, ((places - places[taken[-1]]) ** 2).sum(1))
        taken.append(int(np.argmax(apart)))
    return detections.only(sorted(taken))


def _places(detections: Detections) -> Float[ndarray, "m 5"]:
    """Of each view its middle and the second moments of its corners, each in units of its own spread."""
    counts = np.array([len(view.pixels) for view in detections.views])
    x, y = np.concatenate([view.pixels for view in detections.views]).T
    starts = np.cumsum(counts) - counts
    middle = np.stack([np.add.reduceat(along, starts) / counts for along in (x, y)])
    x, y = np.stack([x, y]) - np.repeat(middle, counts, axis=1)
    xx, xy, yy = (np.add.reduceat(product, starts) / (counts - 1) for product in (x * x, x * y, y * y))
    turn = xy / np.sqrt(np.maximum(xx * yy, 1e-300))
    places = np.stack([*middle, np.sqrt(xx), np.sqrt(yy), turn], axis=1)
    return places / np.maximum(places.std(0), 1e-300)
