"""What a claim of the paper is, and what becomes of it.

A claim is a sentence of the paper; its verdict and its finding are computed from a run's numbers
(claims_about_curves.py, claims_about_eq7.py), so that another run, another method or another simulation
changes them.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from enum import StrEnum

__all__ = ["MAIN", "Claim", "ClaimVerdict", "main_headline", "share"]

MAIN = (
    "MLDC has a lower error on test data than FCCM, whose lens and pin-hole only compensate each other on"
    " training data."
)


class ClaimVerdict(StrEnum):
    """Whether a claim stands."""

    HOLDS = "holds"
    PARTLY = "holds in part"
    FAILS = "does not hold"
    OPEN = "cannot be told"


@dataclass(frozen=True)
class Claim:
    """Where it is claimed (a figure), what the paper says, whether that stands here, and the finding, a
    sentence with its numbers.
    """

    where: str
    paper: str
    verdict: ClaimVerdict
    finding: str


def share(number: int, of: int) -> ClaimVerdict:
    """All of them, some of them, none."""
    return ClaimVerdict.HOLDS if number == of else ClaimVerdict.PARTLY if number else ClaimVerdict.FAILS


def main_headline(claims: Sequence[Claim]) -> str:
    """One sentence for the top of the page, from the claims that MLDC is the better one on test data (MAIN);
    others are passed over.
    """
    told = [claim for claim in claims if claim.paper == MAIN and claim.verdict is not ClaimVerdict.OPEN]
    if not told:
        return "Whether MLDC is better than FCCM on test data cannot be told from this run."
    holds = sum(claim.verdict is ClaimVerdict.HOLDS for claim in told)
    partly = sum(claim.verdict is ClaimVerdict.PARTLY for claim in told)
    verdict = share(2 * holds + partly, 2 * len(told))
    counts = (
        f"in full in {holds} and in part in {partly} of {len(told)} comparisons"
        if partly
        else f"in {holds} of {len(told)} comparisons"
    )
    return (
        f"The paper's main claim, that MLDC is better than FCCM on test data, {verdict}: it stands {counts}."
    )
