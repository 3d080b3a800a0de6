"""What the page says first: how far the camera may be trusted, in a word, a sentence and a colour; and what
to do.

Colours never speak alone: each grade has its word and its sign.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from orthoscope.evaluation.evaluate import Evaluation

__all__ = ["Headline", "headline", "next_steps"]

LOOKS = {  # of a grade: the class of its colours, and its sign
    "good": ("good", "\N{CHECK MARK}"),
    "good within a region": ("region", "\N{WHITE SQUARE WITH ROUNDED CORNERS}"),
    "usable": ("usable", "\N{ALMOST EQUAL TO}"),
    "do not use": ("no", "\N{MULTIPLICATION SIGN}"),
}


class Headline(NamedTuple):
    """Args:
    grade: a word or two.
    look: the class of its colours.
    sign: beside the word, for those who do not see the colour.
    sentence: how far off the camera is, and where.
    """

    grade: str
    look: str
    sign: str
    sentence: str


def headline(evaluation: Evaluation) -> Headline:
    """The verdict as the page opens with it."""
    grade = _grade(evaluation)
    look, sign = LOOKS[grade]
    return Headline(grade, look, sign, str(evaluation.verdict))


def next_steps(evaluation: Evaluation) -> list[str]:
    """What to do now, most urgent first: what the evaluation advises, or how the camera is put to use."""
    return [*evaluation.warnings[:3]]


def _grade(evaluation: Evaluation) -> str:
    """The evaluation's own."""
    verdict = str(evaluation.verdict)
    if verdict.startswith("Do not trust") or not np.isfinite(evaluation.held_out_rms_px):
        return "do not use"
    return "usable" if evaluation.warnings else "good"
