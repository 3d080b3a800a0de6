"""Lengths with their unit, as targets and sheets of paper are described: `25mm`, `1.5in`."""

from __future__ import annotations

import re

from orthoscope.geometry.arrays import InputError

__all__ = ["can_be_printed", "length_text", "parse_length"]

METRES = {"m": 1.0, "cm": 1e-2, "mm": 1e-3, "um": 1e-6, "in": 0.0254}
# A board's squares are no smaller than a wave of light, metres.
SMALLEST_SQUARE = 1e-8
# A board's squares are no larger than a town, metres.
LARGEST_SQUARE = 1e4
# Squares or tags of a board; a photograph shows fewer than a tenth of that.
MOST_SQUARES = 100_000


def can_be_printed(columns: int, rows: int, size: float) -> bool:
    """Whether a board of so many squares of this size (metres) can be meant."""
    return columns * rows <= MOST_SQUARES and SMALLEST_SQUARE <= size <= LARGEST_SQUARE


def parse_length(text: str) -> float:
    """A length with its unit, such as `25mm`, in metres.

    Raises:
        InputError: there is no number or no unit out of m, cm, mm, um, in.
    """
    found = re.fullmatch(r"\s*([0-9.eE+-]+)\s*([a-z]+)\s*", text)
    try:
        return float(found[1]) * METRES[found[2]]  # type: ignore[index]
    except (TypeError, ValueError, KeyError) as error:
        bare = re.fullmatch(r"\s*([0-9.]+)\s*", text)
        hint = f" Say which: {bare[1]}mm, where it is millimetres." if bare else ""
        raise InputError(
            f"length {text!r} is not understood; expected a number and a unit ({', '.join(METRES)}), such as"
            f" 25mm.{hint}"
        ) from error


def length_text(metres: float) -> str:
    """A length in millimetres, such as `25mm`; `parse_length` gives it back to a part in 10^9."""
    return f"{round(metres * 1e3, 9):.10g}mm"
