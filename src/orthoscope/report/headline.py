"""What the page says first: how far the camera may be trusted, in a word, a sentence and a colour; and what
to do.

Colours never speak alone: each grade has its word and its sign.
"""

from __future__ import annotations

from typing import NamedTuple

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
    verdict = evaluation.verdict
    look, sign = LOOKS[verdict.grade]
    return Headline(str(verdict.grade), look, sign, f"{verdict.far} {verdict.limit}".strip())


def next_steps(evaluation: Evaluation) -> list[str]:
    """What to do now, most urgent first: what the evaluation advises."""
    return [evaluation.verdict.advice] if evaluation.verdict.advice else []
