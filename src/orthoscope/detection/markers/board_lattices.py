"""Where a board of markers is in a photograph, by lattices of its saddles in copies of it.

What lays a lattice on the board is handed in; here is in which copies lattices are looked for, which of them
are worth it, and what becomes of several: parts of one board, or another board alike.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from orthoscope.detection.chessboards.lattices import LONGEST_STEP, CornerLattice, lattices
from orthoscope.detection.saddles.saddle_points import saddle_points
from orthoscope.detection.sight import TWICE
from orthoscope.detection.small_copies import enlarged, resized, to_photograph
from orthoscope.geometry.arrays import Float, median, ndarray

__all__ = ["corners_by_lattice"]

# Copies have these longer sides, pixels; most boards are found in the first.
COPY_SIDES = (640, 320, 1280, 2560)
# Pictures with a longer side of up to this, pixels, are enlarged at last: in squares of ten pixels the circle
# about a corner reaches into the markers else.
LARGEST_ENLARGED = 1400
# A smaller copy shows no board.
LEAST_SIDE = 16
# So many lattices of each copy are looked at.
LATTICES_PER_COPY = 2
# A lattice has at least so many corners.
FEWEST_CORNERS = 6
# And at least this share of those of the largest.
SECOND_SHARE = 0.2
# Where corners are farther apart than this, pixels of a copy, a larger one shows no more of them.
LARGE_STEP_PX = 20.0
# Where this share of the board's corners is in a lattice no further copy is looked at.
ENOUGH_CORNERS_SHARE = 0.5


def corners_by_lattice(
    grey: ndarray,
    placed: Callable[[CornerLattice], Float[ndarray, "m 2"] | None],
    *,
    longest_step: float = LONGEST_STEP,
) -> tuple[Float[ndarray, "m 2"] | None, str]:
    """A board's corners by their ids, NaN where they are not seen; a remark where another is such a board.

    Args:
        grey: (h,w) uint8.
        placed: the board's corners as far as a lattice of the photograph has them; None where it is not its.
        longest_step: a lattice's step is at most so many times as long as the next one of its line.
    """
    best, remark = None, ""
    shapes = set()
    for side in (*COPY_SIDES, 0):
        if not side and max(grey.shape) > LARGEST_ENLARGED:
            break
        copy = resized(grey, side) if side else enlarged(grey)
        if copy.shape in shapes or min(copy.shape) < LEAST_SIDE:
            continue
        shapes.add(copy.shape)
        hanging = lattices(saddle_points(copy), longest_step)[:LATTICES_PER_COPY]
        least = max([FEWEST_CORNERS, *(SECOND_SHARE * len(one.pixels) for one in hanging[:1])])
        large = (one for one in hanging if len(one.pixels) >= least)
        laid = [placed(one._replace(pixels=to_photograph(one.pixels, copy, grey))) for one in large]
        found = sorted((one for one in laid if one is not None), key=_seen_count, reverse=True)
        if found and (best is None or _seen_count(found[0]) > _seen_count(best)):
            best, remark = _together(found)
        if best is not None and _seen_count(best) >= ENOUGH_CORNERS_SHARE * len(best):
            break
        if found and _usual_step(hanging[0]) > LARGE_STEP_PX:
            break
    return best, remark


def _together(found: list[Float[ndarray, "m 2"]]) -> tuple[Float[ndarray, "m 2"], str]:
    """The largest part with others of the same board; a remark where one is of another such board."""
    best, remark = found[0], ""
    for other in found[1:]:
        if np.isfinite(best + other).any():
            remark = TWICE
        else:
            best = np.where(np.isfinite(best), best, other)
    return best, remark


def _usual_step(lattice: CornerLattice) -> float:
    """The distance to the nearest corner, of most, pixels of its copy."""
    apart = np.linalg.norm(lattice.pixels[:, None] - lattice.pixels, axis=-1)
    np.fill_diagonal(apart, np.inf)
    return median(apart.min(1))


def _seen_count(corners: Float[ndarray, "m 2"]) -> int:
    return int(np.isfinite(corners[:, 0]).sum())
