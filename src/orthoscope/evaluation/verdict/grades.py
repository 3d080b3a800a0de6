"""The four grades, and the figures that define them: one table, and nowhere else.

A grade is given by how far off the camera is where corners were seen (error_px), and by the share of the
frame over which it is off by FINE_PX at most and corners were seen.  A camera that is too far off for what is
far away may still serve where the target was (near_px): there a shift of the camera undoes what the
photographs leave open; where it is right to a seventh of a pixel there and hardly off elsewhere, it is good
within that region.  What is known to be wrong (causes.py) can lower a grade, never raise it.
"""

from __future__ import annotations

from collections.abc import Callable
from enum import StrEnum
from typing import NamedTuple

from orthoscope.evaluation.verdict.situation import COARSE_PX, FINE_PX, NEAR_PX, Situation

__all__ = ["GRADES", "WIDE_SHARE", "Grade", "by_error", "good_somewhere", "lower"]

# A camera holds widely over this share of the frame; what is left is corners of it that a board rarely
# reaches.
WIDE_SHARE = 0.7
# A camera that is off by no more at the target's distances, pixels, is good there.
NEAR_FINE_PX = 0.15
# One that is good there only may be off by no more far away, pixels: of cameras that were said to be off by
# .5 to .75, one in fifteen was off by more than one.
AWAY_PX = 0.6


class Grade(StrEnum):
    """How far a camera may be trusted, best first."""

    GOOD = "good"
    REGION = "good within a region"
    USABLE = "usable"
    NO = "do not use"


class _Row(NamedTuple):
    grade: Grade
    says: str
    holds: Callable[[Situation], bool]


GRADES: tuple[_Row, ...] = (
    _Row(
        Grade.GOOD,
        f"off by {FINE_PX:g} px at most where corners were seen: {100 * WIDE_SHARE:.0f} % of the frame or"
        " more",
        lambda s: s.error_px <= FINE_PX and s.share >= WIDE_SHARE,
    ),
    _Row(
        Grade.REGION,
        f"off by {FINE_PX:g} px at most where corners were seen: less of the frame; or by {NEAR_FINE_PX:g}"
        f" px at the target's distances, and {AWAY_PX:g} px far away",
        lambda s: good_somewhere(s),
    ),
    _Row(
        Grade.USABLE,
        f"off by more, or with a fault that is named, but by {COARSE_PX:g} px (in 1000) at most, or by"
        f" {NEAR_PX:g} px at the target's distances",
        lambda s: s.error_px <= s.coarse_px or s.near_px <= NEAR_PX,
    ),
    _Row(Grade.NO, "off by more than that, or nobody knows by how much", lambda s: True),
)


def good_somewhere(s: Situation) -> bool:
    """Whether the camera is off by little where corners were seen, far away or where the target was."""
    return s.error_px <= FINE_PX or (s.near_px <= NEAR_FINE_PX and s.error_px <= AWAY_PX)


def by_error(s: Situation) -> Grade:
    """The best grade that the predicted error allows."""
    return next(row.grade for row in GRADES if row.holds(s))


def lower(one: Grade, other: Grade) -> Grade:
    """The worse of two grades."""
    order = list(Grade)
    return max(one, other, key=order.index)
