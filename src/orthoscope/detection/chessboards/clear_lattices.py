"""Lattices without what is none of them: corners off the lines of others, and thin lines at the rim."""

from __future__ import annotations

import numpy as np

from orthoscope.detection.chessboards.grid import grid_shape
from orthoscope.detection.chessboards.lattices import CornerLattice
from orthoscope.geometry.arrays import Bool, Float, ndarray

__all__ = ["on_lines", "rim_box", "without_strays", "without_thin_lines"]

# A corner strays from the parabolas of its row and column by at most this share of a step.
FARTHEST_STRAY_SHARE = 0.3
# Strays are taken out at most so many times, those nearly as far off as the worst together.
CLEARING_ROUNDS = 12
# Beyond this share of the worst stray a corner is nearly as far off.
NEARLY_WORST_SHARE = 0.8
# At least this share of the corners is left when strays are taken out; with fewer it was a lattice by chance.
LEAST_LEFT_SHARE = 0.5
# A line at the rim with fewer than three corners, and less than this share of the next line's, is chance.
THIN_LINE_SHARE = 0.34


def without_strays(found: CornerLattice) -> CornerLattice | None:
    """The lattice without corners that are off their neighbours' lines; None where hardly any is left."""
    keep = on_lines(found.pixels, found.cells.astype(float))
    if keep is None:
        return None
    cells = found.cells[keep]
    return CornerLattice(found.pixels[keep], cells - cells.min(0), found.bright[keep])


def without_thin_lines(found: CornerLattice) -> CornerLattice | None:
    """The lattice without lines at its rim that have hardly a corner, and may be chance; None where nothing
    is left.
    """
    seen = np.zeros(found.size[::-1], dtype=bool)
    seen[found.cells[:, 1], found.cells[:, 0]] = True
    box = rim_box(seen)
    if box is None:
        return None
    low, high = (np.array([getattr(part, end) for part in box[::-1]]) for end in ("start", "stop"))
    keep = ((found.cells >= low) & (found.cells < high)).all(1)
    return CornerLattice(found.pixels[keep], found.cells[keep] - low, found.bright[keep])


def on_lines(pixels: Float[ndarray, "m 2"], places: Float[ndarray, "m 2"]) -> Bool[ndarray, " m"] | None:
    """Which corners of a lattice are on their neighbours' lines, the worst taken out first; None where hardly
    any is.

    Args:
        pixels: the corners.
        places: column and row of each in the lattice, in steps.
    """
    keep = np.arange(len(pixels))
    for _ in range(CLEARING_ROUNDS):
        if len(keep) < max(4, LEAST_LEFT_SHARE * len(pixels)):
            return None
        stray = grid_shape(pixels[keep], places[keep]).stray
        if stray.max() <= FARTHEST_STRAY_SHARE:
            break
        keep = keep[stray <= max(FARTHEST_STRAY_SHARE, NEARLY_WORST_SHARE * stray.max())]
    return np.isin(np.arange(len(pixels)), keep)


def rim_box(seen: Bool[ndarray, "r c"]) -> tuple[slice, slice] | None:
    """Rows and columns with corners, thin lines at the rim left out; None where nothing is left.

    Args:
        seen: where corners are.
    """
    top, bottom, left, right = 0, seen.shape[0], 0, seen.shape[1]
    while bottom - top >= 2 and right - left >= 2:
        part = seen[top:bottom, left:right]
        lines = [
            (part[0], part[1]),
            (part[-1], part[-2]),
            (part[:, 0], part[:, 1]),
            (part[:, -1], part[:, -2]),
        ]
        thin = [
            line.sum() == 0 or (line.sum() < 3 and line.sum() < THIN_LINE_SHARE * next_.sum())
            for line, next_ in lines
        ]
        if not any(thin):
            return slice(top, bottom), slice(left, right)
        top, bottom, left, right = top + thin[0], bottom - thin[1], left + thin[2], right - thin[3]
    return None
