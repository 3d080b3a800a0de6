"""The upper tail of Fisher's F distribution.

F = (A / a) / (B / b), A and B sums of a and b squares of independent standard normal numbers, is larger than
f with probability I_x(b/2, a/2), x = b / (b + a f): the regularised incomplete beta function, by its
continued fraction (W. H. Press et al., Numerical Recipes, 3rd ed., 6.4; evaluated as W. J. Lentz does). scipy
has the same function, and takes longer to import than all tests take to run.
"""

from __future__ import annotations

import math

__all__ = ["f_survival"]

# This stands instead of a 0, which a continued fraction may meet on its way.
SMALLEST_NUMBER = 1e-300
# The fraction has at most so many terms; it needs about the root of the larger argument.
MOST_TERMS = 10_000


def f_survival(f: float, a: float, b: float) -> float:
    """The probability that F of a and b degrees of freedom (positive, fractions allowed) is larger than f;
    NaN where f is NaN.
    """
    if math.isnan(f):
        return math.nan
    return _beta(b / (b + a * f), 0.5 * b, 0.5 * a) if f > 0.0 else 1.0


def _beta(x: float, p: float, q: float) -> float:
    """I_x(p, q), from the side on which the continued fraction converges fast."""
    if x <= 0.0 or x >= 1.0:
        return float(x >= 1.0)
    if x > (p + 1.0) / (p + q + 2.0):
        return 1.0 - _beta(1.0 - x, q, p)
    front = math.lgamma(p + q) - math.lgamma(p) - math.lgamma(q) + p * math.log(x) + q * math.log1p(-x)
    return math.exp(front) * _fraction(x, p, q) / p


def _fraction(x: float, p: float, q: float) -> float:
    """The continued fraction 1 / (1 + d_1 / (1 + d_2 / (1 + ...))), two terms at a time."""
    c, d = 1.0, 1.0 / (1.0 - (p + q) * x / (p + 1.0) or SMALLEST_NUMBER)
    value = d
    for m in range(1, MOST_TERMS):
        even = m * (q - m) * x / ((p + 2 * m - 1) * (p + 2 * m))
        odd = -(p + m) * (p + q + m) * x / ((p + 2 * m) * (p + 2 * m + 1))
        for term in (even, odd):
            d = 1.0 / (1.0 + term * d or SMALLEST_NUMBER)
            c = 1.0 + term / c or SMALLEST_NUMBER
            value *= c * d
        if abs(c * d - 1.0) < 1e-15:
            break
    return value
