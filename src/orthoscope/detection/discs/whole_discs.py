"""Which discs are whole: as large, as dark, as smooth and where those near them foresee it.

Something that covers a part of a disc leaves an outline that may be an ellipse again, smaller and beside the
true one; blurred, it only makes the disc fainter. What discs have in common changes evenly over a board:
size and place are foreseen by a parabola through the nearest twelve; contrast, since several that are covered
stand together, by one through most of the board's.
"""

from __future__ import annotations

import numpy as np

from orthoscope.detection.discs.disc_foresight import FORESEEING_DISCS, foretelling
from orthoscope.detection.discs.disc_outlines import Outlines
from orthoscope.geometry.arrays import Bool, Float, Int, median, ndarray

__all__ = ["are_whole"]

# With no more than so many discs nearby none is foreseen well enough to compare with.
FEWEST_FORESEEING = 5
# A disc's outline is at most so many times as rough as is usual, or this rough, radii.
MOST_ROUGH, SMOOTH_RADII = 3.0, 0.03
# A disc's radius is at most this share off what those near it foresee, or so many times the usual share.
MOST_OFF_SIZE, TIMES_OFF_SIZE = 0.1, 5.0
# A disc's contrast is at most this share off, that of one that may be covered the second share, or so many
# times the usual one.
MOST_OFF_CONTRAST, SUSPECT_OFF_CONTRAST, TIMES_OFF_CONTRAST = 0.15, 0.05, 5.0
# The parabola of contrasts goes, so many times, through those that are off by less than so many times the
# usual.
MOST_ROUNDS, MOST_TIMES_USUAL = 4, 3.0
# A disc's centre is at most so many of its radii off from where those near it foresee it, or so many times as
# far as is usual.
MOST_OFF_PLACE, TIMES_OFF_PLACE = 0.15, 6.0
# One that is rough, of another size or hardly wider than the blur is off by at most so many times the usual,
# but within these, pixels.
SUSPECT_OFF_PX = 0.4, 0.6
# Where no sector of an outline can be off by so much unseen, radii, it is all of a disc, and within so many
# radii of where others foresee it, which a lens's curve makes uncertain, it is the board's.
LEAST_DOUBT, SURELY_NEAR = 0.05, 1.0
# Where a sector may be off by more than this unseen, radii, the disc may be covered.
MOST_DOUBT = 0.1
# A disc whose outline is rougher than this, radii, and than so many times the usual, or its radius off by
# more than this share, may be covered.
SURELY_SMOOTH, SUSPECT_ROUGH, SURELY_AS_LARGE = 0.015, 2.0, 0.03


def are_whole(discs: Outlines, places: Int[ndarray, "n 2"]) -> Bool[ndarray, " n"]:
    """Which discs have an outline and are like those near them; others are partly covered.

    Args:
        discs: that were found.
        places: of these in the lattice.
    """
    outlined = np.isfinite(discs.ellipses.centres[:, 0])
    if not outlined.all():
        whole = np.zeros(len(places), dtype=bool)
        whole[outlined] = are_whole(discs.of(outlined), places[outlined])
        return whole
    if not len(places):
        return np.zeros(0, dtype=bool)
    centres, roughness = discs.ellipses.centres, discs.roughness
    radii = np.sqrt(np.abs(np.linalg.det(discs.ellipses.axes)))
    good = roughness < max(MOST_ROUGH * median(roughness), SMOOTH_RADII)
    known = np.column_stack([centres, np.log(radii)])
    off = _off_foreseen(places, known, good)
    off_place = np.hypot(off[:, 0], off[:, 1]) / radii
    off_size, off_contrast = np.abs(off[:, 2]), _off_parabola(places, np.log(discs.contrast))
    usual = TIMES_OFF_PLACE * median(off_place)
    suspect = (
        (discs.doubt > MOST_DOUBT)
        | (roughness > max(SURELY_SMOOTH, SUSPECT_ROUGH * median(roughness)))
        | (off_size > SURELY_AS_LARGE)
    )
    low, high = (px / radii for px in SUSPECT_OFF_PX)
    farthest = np.where(suspect, np.clip(usual, low, high), max(MOST_OFF_PLACE, usual))
    good &= off_place < np.where(discs.doubt < LEAST_DOUBT, SURELY_NEAR, farthest)
    least = np.where(suspect, SUSPECT_OFF_CONTRAST, MOST_OFF_CONTRAST)
    good &= off_contrast < np.maximum(least, TIMES_OFF_CONTRAST * median(off_contrast))
    return good & (off_size < max(MOST_OFF_SIZE, TIMES_OFF_SIZE * median(off_size)))


def _off_foreseen(
    places: Int[ndarray, "n 2"], values: Float[ndarray, "n k"], good: Bool[ndarray, " n"]
) -> Float[ndarray, "n k"]:
    """How far values are from where the nearest of the good ones foresee them; 0 of few discs."""
    count = min(FORESEEING_DISCS, int(good.sum()) - 1)
    if count <= FEWEST_FORESEEING:
        return np.zeros(values.shape)
    apart = np.abs(places[:, None] - places).sum(-1).astype(float)
    apart[:, ~good] = np.inf
    np.fill_diagonal(apart, np.inf)
    nearest = np.argsort(apart, axis=1, kind="stable")[:, :count]
    weights = np.array([foretelling(steps) for steps in places[nearest] - places[:, None]])
    far = np.maximum(1.0, np.linalg.norm(weights, axis=1))
    return (np.einsum("nj,njk->nk", weights, values[nearest]) - values) / far[:, None]


def _off_parabola(places: Int[ndarray, "n 2"], values: Float[ndarray, " n"]) -> Float[ndarray, " n"]:
    """How far each value is from a parabola through most of them; 0 of few discs."""
    x, y = ((places - places.mean(0)) / max(np.ptp(places), 1)).T
    terms = np.stack([np.ones_like(x), x, y, x * x, x * y, y * y], axis=1)
    if len(places) < 2 * terms.shape[1]:
        return np.zeros(len(places))
    off, used = np.abs(values - median(values)), np.ones(len(places), dtype=bool)
    for _ in range(MOST_ROUNDS):
        used = off <= MOST_TIMES_USUAL * median(off)
        off = np.abs(values - terms @ np.linalg.lstsq(terms[used], values[used], rcond=None)[0])
    return off
