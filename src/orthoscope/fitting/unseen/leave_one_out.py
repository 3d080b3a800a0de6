"""Every view left out once, by one linear step each: held-out residuals, the camera's scatter over views,
each view's influence.

With the fit linearised (linearised.py), leaving view j out moves what all views share by

    d_j = (H - A_j'A_j)^-1 A_j' e_j = H^-1 A_j' (I - B_j)^-1 e_j,      B_j = A_j H^-1 A_j',

the weights of robust loss and priors held; the view's residual, its pose fitted again, is then
e_j + A_j d_j = (I - B_j)^-1 e_j.  (I - B_j) y = e_j is solved for all views at once by conjugate gradients:
its eigenvalues are 1 but for what the view itself decides.

Views that are the same photograph again (near_copies.py) are left out together: A_j, e_j and B_j are then
those of all of them.

The scatter of the d_j is the jackknife's covariance: it takes a view, not a corner, for the independent draw,
and so holds where errors within a view are alike, where boards bend and where cameras breathe.
J. Tukey, Bias and confidence in not quite large samples, Ann. Math. Stat. 29, 1958; R. Cook and S. Weisberg,
Residuals and influence in regression, 1982, chapter 3 (a case left out by one step).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from orthoscope.fitting.slopes.linearised import Linearised
from orthoscope.fitting.unseen.near_copies import summed_over
from orthoscope.geometry.arrays import Float, Int, ndarray

__all__ = ["LeaveOneOut", "leave_one_out", "say_of", "scattered"]

# Conjugate gradients end at this share of a view's residual.
TOLERANCE_SHARE = 1e-5
# Conjugate gradients have at most so many iterations.
ITERATION_LIMIT = 200
# Where a residual is this many times the fit's own, the others do not tell where this view's corners are.
HOPELESS_RATIO = 1e3
# So many views are looked at together, for what is between to take no more room than it has to.
VIEWS_AT_ONCE = 64


@dataclass(frozen=True, eq=False)
class LeaveOneOut:
    """What leaving each view out does.

    Attributes:
        changes: (m,q) of what views share (linearised.py has the order), from the full fit to the one without
            view j; NaN where the other views cannot tell.
        residuals: (m,2p) of view j by the fit without it, pixels, predicted minus detected, not weighted, its
            pose fitted by least squares; u of all corners, then v; 0 where a corner was not seen, NaN where
            the others cannot tell.
        of_camera: how many of the changes, the first, are the camera's.
        groups: (m,) which photograph each view is; of copies the changes and residuals are those without all
            of them.
    """

    changes: Float[ndarray, "m q"]
    residuals: Float[ndarray, "m n"]
    of_camera: int
    groups: Int[ndarray, " m"]

    @property
    def squares(self) -> Float[ndarray, " m"]:
        """Of each view the sum of its squared residuals, px^2."""
        return (self.residuals**2).sum(1)

    @property
    def scatter(self) -> Float[ndarray, "m d"]:
        """Rows whose products sum to the jackknife's covariance of the camera: scatter' scatter; NaN where a
        change is.
        """
        return scattered(self.changes[:, : self.of_camera], self.groups)


def leave_one_out(fit: Linearised, groups: Int[ndarray, " m"] | None = None) -> LeaveOneOut:
    """Each view left out of a fit by one linear step.

    Args:
        groups: which photograph each view is (near_copies.py); by default each is one of its own.
    """
    e = fit.errors
    groups = np.arange(fit.views) if groups is None else groups
    with np.errstate(over="ignore", invalid="ignore", divide="ignore"):
        y, known = _without_themselves(fit, e, groups)
        changes = fit.solved(summed_over(groups, fit.pulls(y[..., None])))[..., 0]
        residuals = fit.without_pose(fit.residual + fit.changes(changes[..., None])[..., 0], weighted=False)
    residuals[~known], changes[~known] = np.nan, np.nan
    return LeaveOneOut(changes, residuals, fit.of_camera, groups)


def scattered(changes: Float[ndarray, "m d"], groups: Int[ndarray, " m"]) -> Float[ndarray, "m d"]:
    """Changes by leaving each view out, about their mean and scaled: their products sum to the jackknife's
    covariance.

    Args:
        groups: which photograph each view is; copies share the row of theirs.
    """
    known = np.isfinite(changes).all(1)
    share = 1.0 / summed_over(groups, np.ones(len(groups)))  # of its photograph's row
    m = max(float(share[known].sum()), 1.0)
    mean = share[known] @ changes[known] / m
    return np.sqrt((m - 1.0) / m * share)[:, None] * (changes - mean)


def say_of(
    fit: Linearised, rows: Float[ndarray, "m n c"]
) -> tuple[Float[ndarray, "m c c"], Float[ndarray, "m d c"]]:
    """What each view's own say in the fit explains of rows of it, rows_j'B_j rows_j; and how the camera moves
    by them, its part of H^-1 A_j' rows_j.
    """
    d, c = fit.of_camera, rows.shape[2]
    explained, moved = np.empty((fit.views, c, c)), np.empty((fit.views, d, c))
    for start in range(0, fit.views, VIEWS_AT_ONCE):
        some = slice(start, start + VIEWS_AT_ONCE)
        explained[some], found = fit.inverse.between(fit.only(some).pulls(rows[some]))
        moved[some] = found[:, :d]
    return explained, moved


def _without_themselves(
    fit: Linearised, e: Float[ndarray, "m n"], groups: Int[ndarray, " m"]
) -> tuple[Float[ndarray, "m n"], ndarray]:
    """y of (I - B_j) y = e_j, and which views have one, by conjugate gradients; copies together."""

    def hat(rows: Float[ndarray, "m n"]) -> Float[ndarray, "m n"]:
        return fit.moves(fit.solved(summed_over(groups, fit.pulls(rows[..., None]))))[..., 0]

    def dot(one: Float[ndarray, "m n"], other: Float[ndarray, "m n"]) -> Float[ndarray, " m"]:
        return summed_over(groups, (one * other).sum(1))

    y, residual = e.copy(), hat(e)  # from y = e: e - (I - B) e
    direction, square = residual.copy(), dot(residual, residual)
    size = np.maximum(dot(e, e), 1e-300)
    for _ in range(ITERATION_LIMIT):
        if (square <= TOLERANCE_SHARE**2 * size).all():
            break
        image = direction - hat(direction)
        step = square / np.maximum(dot(direction, image), 1e-300)
        step[square <= TOLERANCE_SHARE**2 * size] = 0.0
        y += step[:, None] * direction
        residual -= step[:, None] * image
        before, square = square, dot(residual, residual)
        direction = residual + (square / np.maximum(before, 1e-300))[:, None] * direction
    finite = summed_over(groups, np.isfinite(y).all(1).astype(float)) == summed_over(
        groups, np.ones(len(groups))
    )
    known = finite & (square <= 1e-4 * size) & (dot(y, y) < HOPELESS_RATIO**2 * size)
    return y, known
