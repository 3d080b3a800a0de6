"""Numbers and lists as findings say them."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from orthoscope.geometry.arrays import Float, ndarray

__all__ = ["each_of", "joined_words", "short_number", "span", "times"]

# A number below each size has so many decimals.
DECIMALS = ((0.1, 3), (10.0, 2), (1e4, 0))


def short_number(value: float) -> str:
    """An NCE, or a change of one, in as many digits as one reads."""
    for limit, decimals in DECIMALS:
        if abs(value) < limit:
            return f"{round(value, decimals) + 0.0:.{decimals}f}"  # + 0.0 makes -0 plain 0
    return f"{value:.0e}"


def span(values: Float[ndarray, " n"], *, decimals: int | None = None) -> str:
    """The least and the greatest of some numbers; one of them where they read alike."""
    low, high = (
        short_number(float(value)) if decimals is None else f"{value:.{decimals}f}"
        for value in (values.min(), values.max())
    )
    return low if low == high else f"{low} to {high}"


def joined_words(words: Sequence[str]) -> str:
    """One, two and three."""
    return words[0] if len(words) == 1 else ", ".join(words[:-1]) + " and " + words[-1]


def each_of(values: Mapping[str, float]) -> str:
    """A number for each name."""
    return joined_words([f"{short_number(value)} for {name}" for name, value in values.items()])


def times(mine: float, theirs: float) -> str:
    """How many times as much, or as little, mine is; nothing where either is zero."""
    if not theirs > 0 or not mine > 0:
        return ""
    return f", {mine / theirs:.1f} times as much" if mine > theirs else f", {theirs / mine:.1f} times less"
