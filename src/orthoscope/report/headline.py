"""What the page says first: how far the camera may be trusted, in a word, a sentence, a colour; what to do.

Colours never speak alone: each grade has its word and its sign.
"""

from __future__ import annotations

from typing import NamedTuple

from orthoscope.evaluation.evaluate import Evaluation
from orthoscope.evaluation.verdict.grades import Grade

__all__ = ["Headline", "headline", "next_steps"]

# A grade has a class of colours and a sign.
LOOKS = {
    Grade.GOOD: ("good", "\N{CHECK MARK}"),
    Grade.REGION: ("region", "\N{WHITE SQUARE}"),
    Grade.USABLE: ("usable", "\N{ALMOST EQUAL TO}"),
    Grade.NO: ("no", "\N{MULTIPLICATION SIGN}"),
}


class Headline(NamedTuple):
    """The verdict as the page opens with it.

    Attributes:
        grade: a word or two.
        look: the class of its colours.
        sign: beside the word, for those who do not see the colour.
        sentence: how far off the camera is, and where.
        limit: what limits it; may be empty.
    """

    grade: str
    look: str
    sign: str
    sentence: str
    limit: str


def headline(evaluation: Evaluation) -> Headline:
    """What stands above all else; the grade's word is said once, in colour."""
    verdict = evaluation.verdict
    look, sign = LOOKS[verdict.grade]
    said = verdict.far.partition(": ")[2] or verdict.far
    return Headline(str(verdict.grade), look, sign, said[:1].upper() + said[1:], verdict.limit)


def next_steps(evaluation: Evaluation) -> list[str]:
    """What to do now: the verdict's advice; empty where the camera is as good as it gets."""
    return [evaluation.verdict.advice] if evaluation.verdict.advice else []
