"""Finding a grid of discs: spots, the lattice that they make, the board's discs, then their outlines.

Discs are black on white, or white on black; both are tried. What is returned is the centre of the ellipse
that a disc's outline makes, which is not where the disc's centre is seen (`fitting/disc_centres.py`).
"""

from __future__ import annotations

import numpy as np

from orthoscope.detection.discs.disc_lattice import (
    diameter_in_steps,
    foreseen,
    laid_on,
    numbered,
)
from orthoscope.detection.discs.disc_outlines import refined_discs, spots
from orthoscope.detection.discs.whole_discs import are_whole
from orthoscope.detection.sight import Sight, Unseen
from orthoscope.detection.small_copies import resized, to_photograph
from orthoscope.geometry.arrays import Int, ndarray
from orthoscope.geometry.ellipses import Ellipses
from orthoscope.targets.circles import Circles

__all__ = ["see_circles"]

# Copies have these longer sides, pixels.
COPY_SIDES = (640, 1280, 2560)
# A sight of the board has at least this many discs.
FEWEST_DISCS = 6
# A sight of the board has at least this share of its discs.
LEAST_DISCS_SHARE = 0.15
# Where this share of the board's discs is found no other copy is looked at.
ENOUGH_DISCS_SHARE = 0.97
# No picture with a shorter side, pixels, is looked at.
SMALLEST_SIDE = 16
# A disc is no farther from where it was foreseen than so many of its radii.
FARTHEST_RADII = 0.8


def see_circles(grey: ndarray, board: Circles) -> Sight | Unseen:
    """The centres of the outlines of a grid's discs, or of the part of it that can be seen.

    Args:
        grey: (h,w) uint8.
        board: what to look for.
    """
    count = board.columns * board.rows
    best = Sight(np.zeros(0, dtype=int), np.zeros((0, 2)))
    several, laid, seen, shapes = False, False, 0, set()
    for side in COPY_SIDES:
        copy = resized(grey, side)
        if copy.shape in shapes or min(copy.shape) < SMALLEST_SIDE:
            continue
        shapes.add(copy.shape)
        for picture, whole in ((copy, grey), (255 - copy, 255 - grey)):
            for found in spots(picture):
                which, places = numbered(found)
                seen = max(seen, len(which))
                if len(which) < max(FEWEST_DISCS, LEAST_DISCS_SHARE * count, len(best.ids)):
                    continue
                discs = Ellipses(found.centres[which], found.axes[which])
                ids, unsure = laid_on(board, discs, places, copy.shape)
                several |= unsure
                if (ids >= 0).sum() >= FEWEST_DISCS:
                    laid = True
                    best = max(
                        best, _outlined(copy, whole, board, discs, ids), key=lambda sight: len(sight.ids)
                    )
                if len(best.ids) >= ENOUGH_DISCS_SHARE * count:
                    return best
    if len(best.ids) >= FEWEST_DISCS:
        return best
    if laid:
        return Unseen("is in it, but too blurred, dim or small to say where its discs are")
    if several:
        return Unseen("is in it in part only, and which part cannot be told")
    return Unseen(f"was not found in it: {seen} discs hang together, the board has {count}")


def _outlined(
    copy: ndarray, grey: ndarray, board: Circles, discs: Ellipses, ids: Int[ndarray, " n"]
) -> Sight:
    """Ids and centres from outlines in the photograph, those of discs that were no spots included."""
    scale = grey.shape[1] / copy.shape[1]
    mine = ids >= 0
    rough = Ellipses(to_photograph(discs.centres[mine], copy, grey), discs.axes[mine] * scale)
    known, fine = ids[mine], refined_discs(grey, rough)
    unlike = known[:0]
    for _ in range(board.columns + board.rows):
        good = np.isfinite(fine.ellipses.centres[:, 0])
        known, fine = known[good], fine.of(good)
        good = are_whole(board, fine, known)
        unlike = np.union1d(unlike, known[~good])
        known, fine = known[good], fine.of(good)
        if len(known) < FEWEST_DISCS:
            break
        more, there = foreseen(board, fine.ellipses, known, grey.shape)
        added = refined_discs(grey, there)
        off = np.linalg.norm(added.ellipses.centres - there.centres, axis=1)
        near = ~np.isin(more, unlike) & (off < FARTHEST_RADII * np.sqrt(np.abs(np.linalg.det(there.axes))))
        if not near.any():
            break
        known, fine = np.concatenate([known, more[near]]), fine.with_more(added.of(near))
        fine = refined_discs(grey, fine.ellipses)  # which leaves out what is near to another
    order = np.argsort(known)
    diameter = diameter_in_steps(fine.ellipses, board.neighbour_places()[known]) * board.nearest
    return Sight(known[order], fine.ellipses.centres[order], diameter=diameter)
