"""Do residuals agree from view to view, beyond chance?  The F test and the vote of the views that misfit.py
derives.

What columns explain, and how many they are, says whitening.py, of all columns together and of the granted
ones alone; the tested ones have the difference.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from orthoscope.evaluation.misfit.design_matrix import Columns
from orthoscope.evaluation.misfit.f_distribution import f_survival
from orthoscope.evaluation.misfit.whitening import FAINT_SHARE, Whitening
from orthoscope.geometry.arrays import Float, ndarray

__all__ = ["Agreement", "MisfitTest", "agreement"]

# With fewer views "the same in all views" means nothing.
FEWEST_AGREEING_VIEWS = 3
# At least so many degrees of freedom are left for the noise.
FEWEST_DEGREES_WITHIN = 10
# Up to so many views every combination of signs is tried; with more, as many at random.
ALL_SIGNS_VIEWS = 11


@dataclass(frozen=True)
class MisfitTest:
    """Whether residuals agree from view to view, and by how much.

    NaN where the views do not suffice for a test.

    Attributes:
        f, between, within: F and its degrees of freedom.
        chance: the F that these residuals have without any agreement between views.
        p_value: of F for independent normal noise.
        p_over_views: for any noise that differs from view to view.
        systematic_px: the part that agrees, rms per point.
        noise_px: the part that does not, rms per point.
    """

    f: float
    between: float
    within: float
    chance: float
    p_value: float
    p_over_views: float
    systematic_px: float
    noise_px: float


class Agreement(NamedTuple):
    """What `agreement` finds: the test, and the unknowns (columns,) of the tested block, their noise shrunk
    away.
    """

    test: MisfitTest
    unknowns: ndarray


def agreement(columns: Columns, whole: Whitening, tested: tuple[int, ...]) -> Agreement:
    """Test blocks of columns with the other blocks, and the poses, granted; NaN, and unknowns 0, where the
    views do not suffice.

    Args:
        whole: of all the columns' gram matrix.
        tested: numbers of the blocks, side by side.
    """
    granted = [i for i in range(len(columns.blocks)) if i not in tested]
    A, B = (np.concatenate([columns.places[i] for i in blocks]) for blocks in (granted, tested))
    white_A = whole.white_of(A)
    left = columns.without(
        granted, white_A.T @ (white_A @ (columns.score[A] / whole.lengths[A])) / whole.lengths[A]
    )
    scores = columns.scores(left) / whole.lengths
    of_all, of_A = scores @ whole.white.T, scores[:, A] @ white_A.T
    rank_A, rank_B = _rank(white_A), _rank(whole.white[:, B])
    within = 2 * len(left) - columns.poses_rank - rank_A - rank_B
    if columns.views < FEWEST_AGREEING_VIEWS or within < FEWEST_DEGREES_WITHIN or rank_B < 1:
        return Agreement(MisfitTest(*[float("nan")] * 8), np.zeros(len(B)))
    by_A = of_A @ of_A.T
    test = _voted(
        _Squares(
            by_B=of_all @ of_all.T - by_A, by_A=by_A, energy=float((left * left).sum()), corners=len(left)
        ),
        rank_B,
        within,
    )
    if not test.systematic_px > 0.0:
        return Agreement(test, np.zeros(len(B)))
    by_granted = white_A @ whole.gram[np.ix_(A, B)]
    gram_B, score_B = whole.gram[np.ix_(B, B)], scores[:, B].sum(0) - by_granted.T @ of_A.sum(0)
    gram_B -= by_granted.T @ by_granted
    return Agreement(test, _shrunk(gram_B, score_B, whole.lengths[B], test, len(left)))


class _Squares(NamedTuple):
    """What the tested and the granted columns explain of the residuals of views i and j together (v,v); all
    squares; number of corners.
    """

    by_B: ndarray
    by_A: ndarray
    energy: float
    corners: int


def _voted(squares: _Squares, between: float, within: float) -> MisfitTest:
    """F as it is and with views turned round."""
    views = len(squares.by_B)
    signs = _signs(views)
    by_A, by_B = _of_signs(signs, squares.by_A), _of_signs(signs, squares.by_B)
    ratios = by_B / between / np.maximum((squares.energy - by_A - by_B) / within, 1e-300)
    f, chance = float(ratios[0]), float(ratios[1:].mean())
    variance = max(squares.energy - float(by_B[0]), 0.0) / within
    excess = max(f - max(chance, 1.0), 0.0) * between * variance
    return MisfitTest(
        f=f,
        between=between,
        within=within,
        chance=chance,
        p_value=f_survival(f, between, within),
        p_over_views=float((ratios >= f * (1.0 - 1e-9)).mean()),
        systematic_px=float(np.sqrt(views / (views - 1) * excess / squares.corners)),
        noise_px=float(np.sqrt(2.0 * variance)),
    )


def _shrunk(
    gram: Float[ndarray, "c c"],
    score: Float[ndarray, " c"],
    lengths: Float[ndarray, " c"],
    test: MisfitTest,
    corners: int,
) -> Float[ndarray, " c"]:
    """The unknowns as normal numbers would be expected whose spread makes the systematic part, seen through
    the noise.

    gram (overwritten), score: of the columns, the granted ones eliminated, scaled to length 1 with
    FAINT_SHARE added; lengths: before that.
    """
    squares = lengths * lengths
    spread = test.systematic_px**2 * corners / (squares @ (gram.diagonal() - FAINT_SHARE))
    noise = 0.5 * max(test.chance, 1.0) * test.noise_px**2 / spread
    np.fill_diagonal(gram, gram.diagonal() - FAINT_SHARE + noise / squares)
    return np.linalg.solve(gram, score) / lengths


def _rank(white: Float[ndarray, "_ c"]) -> float:
    """The rank of the columns (c) that a whitening, or these columns of it, is of."""
    return white.shape[1] - FAINT_SHARE * float(np.einsum("ij,ij", white, white))


def _signs(views: int) -> Float[ndarray, "s v"]:
    """Signs for the views, none turned first; all that differ by more than a common sign, or as many at
    random (default_rng(0)).
    """
    if views <= ALL_SIGNS_VIEWS:
        bits = np.arange(2 ** (views - 1))[:, None] >> np.arange(views)
        return 1.0 - 2.0 * (bits & 1)
    signs = np.random.default_rng(0).choice([-1.0, 1.0], (2 ** (ALL_SIGNS_VIEWS - 1), views))
    signs[0] = 1.0
    return signs


def _of_signs(signs: Float[ndarray, "s v"], gram: Float[ndarray, "v v"]) -> Float[ndarray, " s"]:
    """s^T gram s of each row of signs."""
    return ((signs @ gram) * signs).sum(1)
