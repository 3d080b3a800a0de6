"""Which of several models to take, by photographs that none of them has seen.

All models meet the same views, so what counts is the difference from view to view, not each one's own
scatter. Views differ by more than models do: one at the image's rim, foreseen by no other, is off by fifty
times the others' error, and would decide alone. So models are compared by ratios: the mean over views,
weighed by their corners, of the logarithm of how many times larger the squared error of one is than that of
the other, in standard errors of that mean. Rules:

- `first_as_good`: the first that loses next to nothing against the best, or little and not surely, models
  coming in order of preference; among base formulas.
- `simplest_as_good`: the first within one standard error of the best, simplest first; among formulas whose
  coefficients nothing holds back (L. Breiman et al., Classification and Regression Trees, 1984, 3.4.3).
- `richest_unless_worse`: the richest unless another foresees surely better; among models whose weights were
  found and that contain each other, so that a richer one costs little where it is not needed.

docs/measured/choice.md has what each rule gives, on photographs and in simulation.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from orthoscope.fitting.calibration import Candidate
from orthoscope.fitting.unseen.held_out import rms_and_error
from orthoscope.geometry.arrays import Float, ndarray

__all__ = ["Contender", "first_as_good", "judged", "richest_unless_worse", "simplest_as_good"]


# A difference of so many standard errors may be chance.
ABOUT_ERRORS = 1.0
# A difference of so many standard errors is hardly chance.
SURE_ERRORS = 2.0
# A change of a squared error's logarithm by this is 5 % of an error.
LITTLE_LOGARITHM = 0.1
# By this it is 1 % of an error: nothing to prefer a formula of more coefficients for, however sure it is.
NO_LOGARITHM = 0.02
# A squared error of a corner that is less, px^2, is no error at all.
NEGLIGIBLE_SQUARE = 1e-12


@dataclass(frozen=True, eq=False)
class Contender:
    """A model with the sum of squared held-out residuals of each view (m,), px^2; NaN where the others could
    not tell.

    Attributes:
        base, target, lens, fit: as in `Candidate`.
    """

    base: str
    target: str
    lens: str
    fit: str
    squares: Float[ndarray, " m"]


def simplest_as_good(contenders: Sequence[Contender], corners: Float[ndarray, " m"]) -> int:
    """The index of the first contender that loses no more than one standard error against the best;
    contenders come simplest first.

    Args:
        corners: of each view.
    """
    return _first_within(contenders, corners, ABOUT_ERRORS, np.inf)


def first_as_good(contenders: Sequence[Contender], corners: Float[ndarray, " m"]) -> int:
    """The index of the first contender that loses next to nothing against the best, or little and not
    surely; contenders come in order of preference.

    Args:
        corners: of each view.
    """
    return _first_within(contenders, corners, SURE_ERRORS, LITTLE_LOGARITHM, nothing=NO_LOGARITHM)


def richest_unless_worse(contenders: Sequence[Contender], corners: Float[ndarray, " m"]) -> int:
    """The index of the last contender, or of the best where that one gains more than two standard errors;
    contenders come simplest first.

    Args:
        corners: of each view.
    """
    able = _able(contenders)
    if not able:
        return 0
    best, richest = _best(contenders, corners, able), able[-1]
    loses, error = _difference(contenders[richest], contenders[best], corners)
    return best if loses > SURE_ERRORS * error else richest


def judged(
    contenders: Sequence[Contender], corners: Float[ndarray, " m"], taken: int
) -> tuple[Candidate, ...]:
    """What to tell of the contenders."""
    errors = [rms_and_error(contender.squares, corners) for contender in contenders]
    return tuple(
        Candidate(
            target=contender.target,
            lens=contender.lens,
            held_out_px=rms,
            standard_error_px=error,
            loses_px=rms - errors[taken][0],
            base=contender.base,
            fit=contender.fit,
            views=int(np.isfinite(contender.squares).sum()),
        )
        for contender, (rms, error) in zip(contenders, errors, strict=True)
    )


def _first_within(
    contenders: Sequence[Contender],
    corners: Float[ndarray, " m"],
    errors: float,
    share: float,
    nothing: float = 0.0,
) -> int:
    """The first that is the best, or loses no more against it than so many standard errors and such a
    share, or than nothing to speak of.
    """
    able = _able(contenders)
    best = _best(contenders, corners, able)
    for i in able:
        mean, error = _difference(contenders[i], contenders[best], corners)
        if i == best or mean <= nothing or (mean <= share and mean <= errors * error):
            return i
    return 0


def _able(contenders: Sequence[Contender]) -> list[int]:
    """Those that as many views could judge as any contender: what fewer judge, rests on the others alone."""
    counts = [int(np.isfinite(contender.squares).sum()) for contender in contenders]
    most = max(counts, default=0)
    return [i for i, count in enumerate(counts) if count == most and most > 0]


def _best(contenders: Sequence[Contender], corners: Float[ndarray, " m"], able: Sequence[int]) -> int:
    return min(able, key=lambda i: _weighed(_logarithms(contenders[i], corners), corners)[0], default=0)


def _difference(one: Contender, other: Contender, corners: Float[ndarray, " m"]) -> tuple[float, float]:
    """The mean logarithm of the ratio of the two squared errors, and its standard error, views taken as
    independent draws.
    """
    return _weighed(_logarithms(one, corners) - _logarithms(other, corners), corners)


def _logarithms(contender: Contender, corners: Float[ndarray, " m"]) -> Float[ndarray, " m"]:
    """Of each view's mean squared error."""
    return np.log(np.maximum(contender.squares / corners, NEGLIGIBLE_SQUARE))


def _weighed(values: Float[ndarray, " m"], corners: Float[ndarray, " m"]) -> tuple[float, float]:
    """The mean over the views that have a value, weighed by corners, and its standard error."""
    known = np.isfinite(values)
    values, weights, views = values[known], corners[known], int(known.sum())
    mean = float(values @ weights / weights.sum())
    error = np.sqrt(views / max(views - 1, 1) * ((weights * (values - mean)) ** 2).sum()) / weights.sum()
    return mean, float(error)
