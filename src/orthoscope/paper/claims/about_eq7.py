"""Claims about eq. (7): that its search ends well, and that it ends at one camera."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from orthoscope.paper.claims import sentences
from orthoscope.paper.claims.claim import Claim, ClaimVerdict, share
from orthoscope.paper.claims.wording import span
from orthoscope.paper.eq7_searches import Eq7Search

__all__ = ["determined", "perfect", "weights_do_not_matter"]

# J of eq. (7) is as good as zero below this, px^2.
PERFECT_COST = 1e-10
# Cameras that differ by less, pixels, are one camera.
SAME_PX = 0.01
# A change of fx, fy, cx or cy by less, pixels, does not count as one.
LEAST_CHANGE_PX = 1.0
# Rounding to whole pixels has this NCE.
ACCURATE_NCE = 1.0


def perfect(where: str, members: Sequence[Eq7Search]) -> Claim:
    """The search of eq. (7) always satisfies the template's restrictions perfectly."""
    paper = sentences.ALWAYS_PERFECT
    costs = np.array([member.J for member in members if member.literal])
    if not len(costs):
        return Claim(where, paper, ClaimVerdict.OPEN, "Eq. (7) was not searched.")
    ended = int((costs < PERFECT_COST).sum())
    finding = (
        f"J ends below {PERFECT_COST:g} in {ended} of {len(costs)} searches;"
        f" its largest end is {costs.max():.0e}."
    )
    return Claim(where, paper, share(ended, len(costs)), finding)


def determined(where: str, members: Sequence[Eq7Search]) -> Claim:
    """Eq. (7) has one camera; members of one scene."""
    paper = sentences.OVER_CONSTRAINED
    ends = [
        member.judgement
        for member in members
        if member.literal and member.J < PERFECT_COST and not member.judgement.failure
    ]
    if len(ends) < 2:
        return Claim(where, paper, ClaimVerdict.OPEN, "Fewer than two searches ended at J = 0.")
    cameras = np.array([(end.fx, end.fy, end.cx, end.cy) for end in ends])
    apart = float(np.ptp(cameras, axis=0).max())
    of_each = ", ".join(
        f"{name} {span(column, decimals=1)}"
        for name, column in zip(("fx", "fy", "cx", "cy"), cameras.T, strict=True)
    )
    nce = np.array([end.test_nce for end in ends])
    one = apart < SAME_PX
    verdict = (
        ClaimVerdict.FAILS
        if not one
        else ClaimVerdict.HOLDS
        if (nce < ACCURATE_NCE).all()
        else ClaimVerdict.PARTLY
    )
    where_to = "one camera" if one else "different cameras"
    finding = (
        f"{len(ends)} searches of the same data, all with J < {PERFECT_COST:g}, end at {where_to}:"
        f" {of_each} px, up to {apart:.2g} px apart; test NCE {span(nce)}."
    )
    return Claim(where, paper, verdict, finding)


def weights_do_not_matter(where: str, members: Sequence[Eq7Search]) -> Claim:
    """The outcome does not depend on the weights; members of one scene, those of one damping."""
    paper = sentences.WEIGHTS
    weighed = [member for member in members if member.literal and "weights" in member.name]
    damped = {member.name.split(", weights")[0] for member in weighed}
    plain = [member for member in members if member.literal and member.name in damped]
    ends = [m.judgement for m in (*plain, *weighed) if not m.judgement.failure]
    if len(ends) < 2 or not plain:
        return Claim(where, paper, ClaimVerdict.OPEN, "Eq. (7) was not searched with other weights.")
    cameras = np.array([(end.fx, end.fy, end.cx, end.cy) for end in ends])
    moved = np.abs(cameras[1:] - cameras[0]).max(1)
    each = ", ".join(
        f"{m.name.split('weights ')[1]}: {px:.2g} px" for m, px in zip(weighed, moved, strict=False)
    )
    verdict = share(int((moved < LEAST_CHANGE_PX).sum()), len(moved))
    return Claim(
        where, paper, verdict, f"Against weights 1 1 1 the camera moves, with J_PH, J_CR, J_ST at {each}."
    )
