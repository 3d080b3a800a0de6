"""The verdict in words: how far off the camera is, where that holds, at most one limit, what to do."""

from __future__ import annotations

from math import isnan
from typing import NamedTuple

from orthoscope.evaluation.verdict.advice import Advice, advice_on
from orthoscope.evaluation.verdict.causes import CAUSES
from orthoscope.evaluation.verdict.grades import Grade, by_error, lower
from orthoscope.evaluation.verdict.situation import FINE_PX, Situation, coarse_px
from orthoscope.geometry.numbers import rough_pixels

__all__ = ["Verdict", "far_on_others", "grade_on_others", "verdict_on"]

HEADS = {
    Grade.GOOD: "Good",
    Grade.REGION: "Good within a region",
    Grade.USABLE: "Usable",
    Grade.NO: "Do not use this camera",
}


# Where the error at the target's distances is no more than this share of that far away, both are told.
NEARER_SHARE = 0.5


class Verdict(NamedTuple):
    """What a user should know before anything else.

    Attributes:
        grade: how far the camera may be trusted.
        cause: the name of what limits it; empty where nothing does.
        far: how far off it is, and where that holds.
        limit: what limits it, or empty.
        advice: what to do, or empty.
    """

    grade: Grade
    cause: str
    far: str
    limit: str
    advice: str

    def __str__(self) -> str:
        return " ".join(part for part in (self.far, self.limit, self.advice) if part)


def verdict_on(s: Situation) -> Verdict:
    """The verdict on a situation."""
    held = [cause for cause in CAUSES if cause.holds(s)]
    grade = by_error(s)
    for cause in held:
        grade = lower(grade, cause.allows(s))
    first = held[0] if held else None
    limit = _sentence(first.says(s)) if first else ""
    advice: Advice | None = advice_on(first.name if first else "", s)
    return Verdict(
        grade, first.name if first else "", _far(grade, s), limit, advice.says(s) if advice else ""
    )


def grade_on_others(rms_px: float, image_size: tuple[int, int]) -> Grade:
    """How far a camera may be trusted by photographs that it was not made from.

    Args:
        rms_px: of what is left over after the poses are fitted, per corner; the corners' own noise is in
            it, so the camera is rather nearer.
        image_size: of the camera.
    """
    return by_error(Situation(error_px=rms_px, coarse_px=coarse_px(image_size)))


def far_on_others(rms_px: float, image_size: tuple[int, int]) -> str:
    """How far off a camera is on such photographs, in the words of a verdict.

    Args:
        rms_px, image_size: as of `grade_on_others`.
    """
    head = HEADS[grade_on_others(rms_px, image_size)]
    return f"{head}: off by about {rough_pixels(rms_px)} px where these photographs have corners."


def _far(grade: Grade, s: Situation) -> str:
    if isnan(s.error_px):
        return f"{HEADS[grade]}: nothing says how far off it is."
    if grade in (Grade.GOOD, Grade.REGION) and s.error_px <= FINE_PX:
        seen = f"off by about {rough_pixels(s.error_px)} px where corners were seen"
        return f"{HEADS[grade]}: {seen}, and by less than {FINE_PX:g} px over {_share(s.share)} of the frame."
    if s.near_px <= NEARER_SHARE * s.error_px:
        near = f"off by about {rough_pixels(s.near_px)} px at the distances where the target was"
        return f"{HEADS[grade]}: {near}, by {rough_pixels(s.error_px)} px far away."
    return f"{HEADS[grade]}: off by about {rough_pixels(s.error_px)} px where corners were seen."


def _share(share: float) -> str:
    return "all" if share > 0.995 else f"{100 * share:.0f} %"


def _sentence(clause: str) -> str:
    return clause[:1].upper() + clause[1:] + "."
