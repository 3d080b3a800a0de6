"""Discs that were no spots: sought where their neighbours foresee them, and so on from these."""

from __future__ import annotations

import numpy as np

from orthoscope.detection.discs.disc_foresight import beside, foreseen, is_among
from orthoscope.detection.discs.disc_outlines import Outlines, outlines_near
from orthoscope.geometry.arrays import Float, Int, median, ndarray

__all__ = ["FEWEST_DISCS", "with_next"]

# A disc is no farther from where it was foreseen than so many of its radii.
FARTHEST_RADII = 0.8
# Its area is that of its neighbour within this factor.
MOST_AREA_RATIO = 1.6
# Its contrast is at least this share of what is usual.
LEAST_CONTRAST_SHARE = 0.5
# Fewer discs are no sight of a board, and foresee no others.
FEWEST_DISCS = 6


def with_next(
    smooth: ndarray,
    rays: Outlines,
    places: Int[ndarray, "n 2"],
    *,
    among: Int[ndarray, "k 2"] | None = None,
) -> tuple[Outlines, Int[ndarray, "m 2"], Float[ndarray, "l 2"]]:
    """Discs that have an outline and those next to them; their places; and where others were looked for.

    Args:
        smooth: the picture as rays need it.
        rays: outlines, NaN where there is none.
        places: of these in the lattice.
        among: places that may have a disc; by default all have.
    """
    asked = [np.zeros((0, 2))]
    while True:
        seen = np.isfinite(rays.ellipses.centres[:, 0])
        rays, places = rays.of(seen), places[seen]
        if len(places) < FEWEST_DISCS:
            break
        wanted = beside(places)
        wanted = wanted if among is None else wanted[is_among(wanted, among)]
        more, there = foreseen(rays.ellipses, places, wanted, smooth.shape)
        if not len(more):
            break
        asked.append(there.centres)
        added = outlines_near(smooth, there)
        seen = np.isfinite(added.ellipses.centres[:, 0])
        added, there, more = added.of(seen), there.of(seen), more[seen]
        areas, expected = (np.linalg.det(one.axes) for one in (added.ellipses, there))
        off = np.linalg.norm(added.ellipses.centres - there.centres, axis=1)
        near = off < FARTHEST_RADII * np.sqrt(expected)
        near &= (areas < MOST_AREA_RATIO * expected) & (expected < MOST_AREA_RATIO * areas)
        near &= added.contrast > LEAST_CONTRAST_SHARE * median(rays.contrast)
        if not near.any():
            break
        rays, places = rays.with_more(added.of(near)), np.concatenate([places, more[near]])
    return rays, places, np.concatenate(asked)
