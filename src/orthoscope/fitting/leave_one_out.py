"""Every view left out once, by one linear step each: held-out residuals, the camera's scatter over views,
each view's influence.

With the fit linearised (linearised.py), leaving view j out moves what all views share by

    d_j = (H - A_j'A_j)^-1 A_j' e_j = H^-1 A_j' (I - B_j)^-1 e_j,      B_j = A_j H^-1 A_j',

the weights of robust loss and priors held; the view's residual, its pose fitted again, is then
e_j + A_j d_j = (I - B_j)^-1 e_j.  (I - B_j) y = e_j is solved for all views at once by conjugate gradients:
its eigenvalues are 1 but for what the view itself decides.

The scatter of the d_j is the jackknife's covariance: it takes a view, not a corner, for the independent draw,
and so holds where errors within a view are alike, where boards bend and where cameras breathe.
J. Tukey, Bias and confidence in not quite large samples, Ann. Math. Stat. 29, 1958; R. Cook and S. Weisberg,
Residuals and influence in regression, 1982, chapter 3 (a case left out by one step).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from orthoscope.fitting.linearised import Linearised
from orthoscope.geometry.arrays import Float, ndarray

__all__ = ["LeaveOneOut", "hat_of", "leave_one_out", "scattered"]

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
    """

    changes: Float[ndarray, "m q"]
    residuals: Float[ndarray, "m n"]
    of_camera: int

    @property
    def squares(self) -> Float[ndarray, " m"]:
        """Of each view the sum of its squared residuals, px^2."""
        return (self.residuals**2).sum(1)

    @property
    def scatter(self) -> Float[ndarray, "m d"]:
        """Rows whose products sum to the jackknife's covariance of the camera: scatter' scatter; NaN where a
        change is.
        """
        return scattered(self.changes[:, : self.of_camera])


def leave_one_out(fit: Linearised) -> LeaveOneOut:
    """Each view left out of a fit by one linear step."""
    e = fit.errors
    with np.errstate(over="ignore", invalid="ignore", divide="ignore"):
        y, known = _without_themselves(fit, e)
        changes = fit.solved(fit.pulls(y[..., None]))[..., 0]
        residuals = fit.without_pose(fit.residual + fit.changes(changes[..., None])[..., 0], weighted=False)
    residuals[~known], changes[~known] = np.nan, np.nan
    return LeaveOneOut(changes, residuals, fit.of_camera)


def scattered(changes: Float[ndarray, "m d"]) -> Float[ndarray, "m d"]:
    """Changes by leaving each view out, about their mean and scaled: their products sum to the jackknife's
    covariance.
    """
    known = np.isfinite(changes).all(1)
    m = max(int(known.sum()), 1)
    return np.sqrt((m - 1) / m) * (changes - changes[known].sum(0) / m)


def hat_of(fit: Linearised, rows: Float[ndarray, "m n c"]) -> Float[ndarray, "m n c"]:
    """B_j times rows of each view: the part of the view's residual that its own say in the fit explains."""
    if fit.views <= VIEWS_AT_ONCE:
        return fit.moves(fit.solved(fit.pulls(rows)))
    found = np.empty_like(rows)
    for start in range(0, fit.views, VIEWS_AT_ONCE):
        some = slice(start, start + VIEWS_AT_ONCE)
        part = fit.only(some)
        found[some] = part.moves(part.solved(part.pulls(rows[some])))
    return found


def _without_themselves(fit: Linearised, e: Float[ndarray, "m n"]) -> tuple[Float[ndarray, "m n"], ndarray]:
    """y of (I - B_j) y = e_j, and which views have one, by conjugate gradients."""
    y, residual = e.copy(), hat_of(fit, e[..., None])[..., 0]  # from y = e: e - (I - B) e
    direction, square = residual.copy(), (residual**2).sum(1)
    size = np.maximum((e**2).sum(1), 1e-300)
    for _ in range(ITERATION_LIMIT):
        if (square <= TOLERANCE_SHARE**2 * size).all():
            break
        image = direction - hat_of(fit, direction[..., None])[..., 0]
        step = square / np.maximum((direction * image).sum(1), 1e-300)
        step[square <= TOLERANCE_SHARE**2 * size] = 0.0
        y += step[:, None] * direction
        residual -= step[:, None] * image
        before, square = square, (residual**2).sum(1)
        direction = residual + (square / np.maximum(before, 1e-300))[:, None] * direction
    known = np.isfinite(y).all(1) & (square <= 1e-4 * size) & ((y**2).sum(1) < HOPELESS_RATIO**2 * size)
    return y, known
