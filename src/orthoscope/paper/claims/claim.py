"""What a claim of the paper is, and what becomes of it.

A claim is a sentence of the paper; its verdict and its finding are computed from a run's numbers
(about_curves.py, about_eq7.py), so that another run, another method or another simulation
changes them.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from enum import StrEnum

from orthoscope.paper.claims.sentences import BETTER, Sentence

__all__ = ["Claim", "ClaimVerdict", "main_headline", "of_sentence", "share"]


class ClaimVerdict(StrEnum):
    """Whether a claim stands."""

    HOLDS = "holds"
    PARTLY = "holds in part"
    FAILS = "does not hold"
    OPEN = "cannot be told"


@dataclass(frozen=True)
class Claim:
    """What becomes of a sentence of the paper at one place.

    Attributes:
        where: it is claimed, a figure.
        paper: the sentence.
        verdict: whether it stands here.
        finding: a sentence with its numbers.
        ours: whether it is judged of a method as we made it work instead of as printed.
    """

    where: str
    paper: Sentence
    verdict: ClaimVerdict
    finding: str
    ours: bool = False


def share(number: int, of: int) -> ClaimVerdict:
    """All of them, some of them, none."""
    return ClaimVerdict.HOLDS if number == of else ClaimVerdict.PARTLY if number else ClaimVerdict.FAILS


def of_sentence(claims: Sequence[Claim]) -> ClaimVerdict:
    """What becomes of one sentence that the paper says at several places, of its methods as printed."""
    verdicts = {
        claim.verdict for claim in claims if not claim.ours and claim.verdict is not ClaimVerdict.OPEN
    }
    if not verdicts:
        return ClaimVerdict.OPEN
    return verdicts.pop() if len(verdicts) == 1 else ClaimVerdict.PARTLY


def main_headline(claims: Sequence[Claim]) -> str:
    """One sentence for the top of the page, from the claims that MLDC is better on test data (BETTER), as
    printed and repeated.
    """
    told = [claim for claim in claims if claim.paper == BETTER and claim.verdict is not ClaimVerdict.OPEN]
    printed, repeated = ([claim for claim in told if claim.ours is ours] for ours in (False, True))
    if not printed:
        return "Whether MLDC is better than FCCM on test data cannot be told from this run."
    said = f"The paper's main claim, that MLDC is better than FCCM on test data, {_stands(printed)}"
    return said + (f"; with its two steps repeated it {_stands(repeated)}." if repeated else ".")


def _stands(claims: Sequence[Claim]) -> str:
    """A verdict with how often it stands."""
    holds = sum(claim.verdict is ClaimVerdict.HOLDS for claim in claims)
    partly = sum(claim.verdict is ClaimVerdict.PARTLY for claim in claims)
    counts = f"in {holds} of {len(claims)} figures" + (f", in part in {partly}" if partly else "")
    return f"{share(2 * holds + partly, 2 * len(claims)).value} ({counts})"
