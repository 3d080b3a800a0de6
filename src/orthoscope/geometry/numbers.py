"""Numbers as people read them: as many digits as mean something, and a dash where there is no number."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence, Set
from typing import Any

import numpy as np

__all__ = [
    "ABSENT",
    "degrees",
    "fixed",
    "percent",
    "pixels",
    "probability",
    "rough_pixels",
    "setting",
    "six_digits",
    "value_with_deviation",
    "with_error",
]

ABSENT = "\N{EN DASH}"


def pixels(value: float) -> str:
    """An error in pixels, three digits or so."""
    if not math.isfinite(value):
        return ABSENT
    return (
        f"{value:.3f}"
        if 0.01 <= abs(value) < 1 or value == 0
        else f"{value:.3g}"
        if abs(value) < 1000
        else f"{value:.0f}"
    )


def rough_pixels(value: float) -> str:
    """An error in pixels as a sentence says it: two digits, none of them below a hundredth of a pixel."""
    if value >= 10.0:
        return f"{value:.0f}"
    return f"{value:.2g}" if value >= 0.095 else f"{max(value, 0.01):.2f}"


def fixed(value: float, decimals: int) -> str:
    """A number in a column of numbers with so many decimals."""
    return f"{value:.{decimals}f}" if math.isfinite(value) else ABSENT


def percent(share: float) -> str:
    """A share of one, in whole percent."""
    return f"{100 * share:.0f} %" if math.isfinite(share) else ABSENT


def probability(p: float) -> str:
    """A probability, two digits; one that is next to nothing is only said to be below a thousandth."""
    if not math.isfinite(p):
        return ABSENT
    return "< 0.001" if p < 0.001 else f"{p:.2g}"


def degrees(angle: float) -> str:
    """An angle given in radians."""
    return f"{math.degrees(angle):.1f}°" if math.isfinite(angle) else ABSENT


def value_with_deviation(value: float, deviation: float) -> tuple[str, str]:
    """A value to the digit where its standard deviation has its second; six digits where there is none."""
    if not math.isfinite(deviation) or deviation <= 0:
        return f"{value:.6g}", ABSENT
    decimals = min(max(0, 1 - math.floor(math.log10(deviation))), 12)
    return (
        f"{round(value, decimals) + 0.0:.{decimals}f}",
        f"{deviation:.{decimals}f}",
    )  # + 0.0 makes -0 plain 0


def with_error(value: float, error: float, *, alone: Callable[[float], str] = pixels) -> str:
    """A number with its standard error, `0.088 ± 0.015`, the one form of it everywhere.

    Args:
        value: with the error's unit.
        error: of one standard deviation; NaN or zero where it is not known.
        alone: how the value reads without an error.
    """
    if not math.isfinite(value):
        return ABSENT
    if not math.isfinite(error) or error <= 0:
        return alone(value)
    return " ± ".join(value_with_deviation(value, error))


def six_digits(value: float) -> str:
    """A parameter whose error nobody knows."""
    return f"{value:.6g}" if math.isfinite(value) else ABSENT


def setting(value: Any) -> str:
    """A setting of any kind as text that is the same every time: no addresses, no order of hashing."""
    match value:
        case None | bool() | int() | str():
            return str(value)
        case float() | np.generic():
            return f"{value:g}" if isinstance(value, float | np.floating) else str(value)
        case np.ndarray():
            return setting(value.tolist())
        case Mapping():
            return ", ".join(f"{key}={setting(entry)}" for key, entry in value.items()) or "none"
        case Set():
            return ", ".join(sorted(setting(entry) for entry in value)) or "none"
        case Sequence():
            return ", ".join(setting(entry) for entry in value) or "none"
    return getattr(value, "__name__", type(value).__name__)
