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
from orthoscope.detection.discs.disc_outlines import Outlines, fitted_whole, outlines_near, smoothed, spots
from orthoscope.detection.discs.whole_discs import are_whole
from orthoscope.detection.sight import Sight, Unseen
from orthoscope.detection.small_copies import resized, to_photograph
from orthoscope.geometry.arrays import Float, Int, ndarray
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
# A spot so many of its radii from where a disc was looked for may be another.
NEW_RADII = 0.5


def see_circles(grey: ndarray, board: Circles) -> Sight | Unseen:
    """The centres of the outlines of a grid's discs, or of the part of it that can be seen.

    Args:
        grey: (h,w) uint8.
        board: what to look for.
    """
    count = board.columns * board.rows
    best = Sight(np.zeros(0, dtype=int), np.zeros((0, 2)))
    asked = np.zeros((0, 2))
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
                mine = ids >= 0
                rough = Ellipses(
                    to_photograph(discs.centres[mine], copy, grey),
                    discs.axes[mine] * grey.shape[1] / copy.shape[1],
                )
                if mine.sum() >= FEWEST_DISCS and _are_new(rough, asked):
                    laid = True
                    sight, where = _outlined(whole, board, rough, ids[mine])
                    asked = np.concatenate([asked, where])
                    best = max(best, sight, key=lambda sight: len(sight.ids))
                if len(best.ids) >= ENOUGH_DISCS_SHARE * count:
                    return best
    if len(best.ids) >= FEWEST_DISCS:
        return best
    if laid:
        return Unseen("is in it, but too blurred, dim or small to say where its discs are")
    if several:
        return Unseen("is in it in part only, and which part cannot be told")
    return Unseen(f"was not found in it: {seen} discs hang together, the board has {count}")


def _are_new(discs: Ellipses, asked: Float[ndarray, "k 2"]) -> bool:
    """Whether a disc is where none was looked for yet."""
    apart = np.linalg.norm(discs.centres[:, None] - asked, axis=2).min(1, initial=np.inf)
    return bool((apart > NEW_RADII * np.sqrt(np.abs(np.linalg.det(discs.axes)))).any())


def _outlined(
    grey: ndarray, board: Circles, rough: Ellipses, ids: Int[ndarray, " n"]
) -> tuple[Sight, Float[ndarray, "k 2"]]:
    """Ids and centres from outlines in the photograph, those of discs that were no spots included, and where
    discs were looked for. What is given out was seen whole in the last fit; where it was foreseen, or rays
    met an outline, only said where to look.

    Args:
        grey: (h,w) uint8.
        board: what to look for.
        rough: spots.
        ids: of these.
    """
    smooth, known, left_out = smoothed(grey), ids, ids[:0]
    rays, asked = outlines_near(smooth, rough), rough.centres
    fine, count = rays, 0
    while True:
        known, rays, more = _with_next(smooth, board, known, rays, left_out)
        asked = np.concatenate([asked, more])
        if len(known) in (0, count):
            break
        fine = fitted_whole(grey, rays)
        good = are_whole(board, fine, known)
        left_out = np.union1d(left_out, known[~good])
        known, rays, fine, count = known[good], rays.of(good), fine.of(good), int(good.sum())
    if len(known) < FEWEST_DISCS:
        return Sight(known[:0], np.zeros((0, 2))), asked
    order = np.argsort(known)
    diameter = diameter_in_steps(fine.ellipses, board.neighbour_places()[known]) * board.nearest
    return Sight(known[order], fine.ellipses.centres[order], diameter=diameter), asked


def _with_next(
    smooth: ndarray, board: Circles, ids: Int[ndarray, " n"], rays: Outlines, left_out: Int[ndarray, " k"]
) -> tuple[Int[ndarray, " m"], Outlines, Float[ndarray, "l 2"]]:
    """Discs that have an outline, and those next to them where these foresee them, and so on; and where discs
    were looked for.

    Args:
        smooth: the picture as rays need it.
        board: what to look for.
        ids: of the discs.
        rays: their outlines, NaN where there is none.
        left_out: ids that are not looked for again.
    """
    asked = [np.zeros((0, 2))]
    while True:
        seen = np.isfinite(rays.ellipses.centres[:, 0])
        ids, rays = ids[seen], rays.of(seen)
        if len(ids) < FEWEST_DISCS:
            break
        more, there = foreseen(board, rays.ellipses, ids, smooth.shape)
        wanted = ~np.isin(more, left_out)
        more, there = more[wanted], there.of(wanted)
        asked.append(there.centres)
        added = outlines_near(smooth, there)
        off = np.linalg.norm(added.ellipses.centres - there.centres, axis=1)
        near = off < FARTHEST_RADII * np.sqrt(np.abs(np.linalg.det(there.axes)))
        if not near.any():
            break
        ids, rays = np.concatenate([ids, more[near]]), rays.with_more(added.of(near))
    return ids, rays, np.concatenate(asked)
