"""Which of several candidates to take, by photographs that none of them has seen.

All candidates meet the same views, so what counts is the difference from view to view, not each one's own
scatter. Two rules: `simplest_as_good` among formulas, whose coefficients nothing holds back: the simplest
that is within one standard error of the best (L. Breiman et al., Classification and Regression Trees, 1984,
section 3.4.3); `richest_unless_worse` among models whose weights were found and that contain each other, so
that a richer one costs little where it is not needed: the richest, unless another foresees better by more
than two standard errors. docs/decoupled.md has what each rule gives on photographs.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from orthoscope.fitting.calibration import Candidate
from orthoscope.fitting.held_out import rms_and_error
from orthoscope.geometry.arrays import Float, ndarray

__all__ = ["Contender", "judged", "richest_unless_worse", "simplest_as_good"]


ABOUT, SURELY = 1.0, 2.0  # standard errors of a difference that may be chance, and that is hardly so


@dataclass(frozen=True, eq=False)
class Contender:
    """A candidate with the sum of squared held-out residuals of each view (m,), px^2; NaN where its fold
    could not judge.
    """

    target: str
    lens: str
    squares: Float[ndarray, " m"]


def simplest_as_good(contenders: Sequence[Contender], corners: Float[ndarray, " m"]) -> int:
    """The index of the first contender that loses no more than one standard error against the best;
    contenders come simplest first.

    corners: of each view. Contenders that some view could not be judged with take no part, unless all are so:
    then the first.
    """
    able = _able(contenders)
    best = min(able, key=lambda i: contenders[i].squares.sum(), default=0)
    return next(
        (i for i in able if i == best or _loses(contenders[i], contenders[best], corners) <= ABOUT), 0
    )


def richest_unless_worse(contenders: Sequence[Contender], corners: Float[ndarray, " m"]) -> int:
    """The index of the last contender, or of the best where that one gains more than two standard errors;
    contenders come simplest first.

    corners: of each view. Contenders that some view could not be judged with take no part, unless all are so:
    then the first.
    """
    able = _able(contenders)
    if not able:
        return 0
    best, richest = min(able, key=lambda i: contenders[i].squares.sum()), able[-1]
    return best if _loses(contenders[richest], contenders[best], corners) > SURELY else richest


def _able(contenders: Sequence[Contender]) -> list[int]:
    return [i for i, contender in enumerate(contenders) if np.isfinite(contender.squares).all()]


def _loses(one: Contender, other: Contender, corners: Float[ndarray, " m"]) -> float:
    """The mean squared error of one less that of the other, in standard errors of that difference, views
    taken as independent draws.
    """
    excess, views = one.squares - other.squares, len(corners)
    mean = excess.sum() / corners.sum()
    error = np.sqrt(views / max(views - 1, 1) * ((excess - mean * corners) ** 2).sum()) / corners.sum()
    return float(mean / error) if error > 0 else 0.0


def judged(
    contenders: Sequence[Contender], corners: Float[ndarray, " m"], taken: int
) -> tuple[Candidate, ...]:
    """What to tell of the contenders."""
    errors = [rms_and_error(contender.squares, corners) for contender in contenders]
    return tuple(
        Candidate(contender.target, contender.lens, rms, error, rms - errors[taken][0])
        for contender, (rms, error) in zip(contenders, errors, strict=True)
    )
