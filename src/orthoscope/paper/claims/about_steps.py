"""Claims about step 2, about time, and about straightened photographs."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import pairwise

import numpy as np

from orthoscope.paper.claims import sentences
from orthoscope.paper.claims.claim import Claim, ClaimVerdict, share
from orthoscope.paper.claims.wording import each_of, joined_words
from orthoscope.paper.entries import FCCM, MLDC, NMLDC, REPEATED
from orthoscope.paper.step_two import DEGREES, IMAGES, PAPER_DEGREE, name_of_degree, name_of_images
from orthoscope.paper.times import Timing
from orthoscope.paper.trials import Outcome

__all__ = ["better_straightened", "degree_does_not_matter", "one_image_is_enough", "time_grows"]

# Shares by which rounds and errors of two degrees may differ and still be alike.
ALIKE = 0.25
# NCE of rounding to whole pixels.
ACCURATE_NCE = 1.0


def degree_does_not_matter(where: str, outcomes: Sequence[Outcome]) -> Claim:
    """Whether rounds and error are those of the fifth degree."""
    paper = sentences.DEGREE
    names = [name_of_degree(degree) for degree in DEGREES]
    nce, steps = _means(outcomes, names, "test_nce"), _means(outcomes, names, "steps")
    fifth = name_of_degree(PAPER_DEGREE)
    others = [name for name in names if name != fifth and np.isfinite(nce[name])]
    if not others or not np.isfinite(nce[fifth]):
        return Claim(where, paper, ClaimVerdict.OPEN, "Not all degrees gave a camera.")
    alike = [
        name
        for name in others
        if abs(steps[name] / steps[fifth] - 1) <= ALIKE and abs(nce[name] / nce[fifth] - 1) <= ALIKE
    ]
    rounds = joined_words([f"{steps[name]:.0f} for {name}" for name in names])
    finding = (
        f"The rounds of both steps are {rounds}, the test NCE is {each_of(nce)}: both within"
        f" {100 * ALIKE:.0f} % of the fifth degree's for {len(alike)} of {len(others)} others."
    )
    return Claim(where, paper, share(len(alike), len(others)), finding)


def one_image_is_enough(where: str, outcomes: Sequence[Outcome]) -> Claim:
    """Whether step 2 gives a good lens from the pairs of one image."""
    paper = sentences.ONE_IMAGE
    nce = _means(outcomes, [*map(name_of_images, IMAGES), name_of_degree(PAPER_DEGREE)], "test_nce")
    nce["all"] = nce.pop(name_of_degree(PAPER_DEGREE))
    told = {name: value for name, value in nce.items() if np.isfinite(value)}
    one = name_of_images(1)
    if one not in told:
        return Claim(where, paper, ClaimVerdict.OPEN, "One image gave no lens.")
    finding = f"With the pin-hole of all images the test NCE is {each_of(told)}."
    return Claim(
        where,
        paper,
        ClaimVerdict.HOLDS if told[one] < ACCURATE_NCE else ClaimVerdict.FAILS,
        finding,
        ours=False,
    )


def time_grows(where: str, timings: Sequence[Timing]) -> Claim:
    """Whether eq. (7)'s search takes longer with more images."""
    paper = sentences.ACCURATE_FROM_THREE
    own = sorted((t for t in timings if t.entry == MLDC and np.isfinite(t.seconds)), key=lambda t: t.images)
    if len(own) < 2:
        return Claim(where, paper, ClaimVerdict.OPEN, "Eq. (7) was not timed with two numbers of images.")
    grows = [one.seconds < other.seconds for one, other in pairwise(own)]
    first, last = own[0], own[-1]
    finding = (
        f"The search of eq. (7) takes {first.seconds:.2g} s with {first.images} images ({first.unknowns}"
        f" unknowns) and {last.seconds:.2g} s with {last.images} ({last.unknowns}), where the paper had a"
        " minute to an hour."
    )
    return Claim(where, paper, share(sum(grows), len(grows)), finding)


def better_straightened(where: str, outcomes: Sequence[Outcome], *, mldc: str = MLDC) -> Claim:
    """Whether MLDC makes rows and columns of test photographs straightest; mldc: which reading of it."""
    paper, ours = sentences.BETTER_STRAIGHTENED, mldc != MLDC
    bent = _means(outcomes, [mldc, NMLDC, FCCM, *([REPEATED] if not ours else [])], "bent_px")
    told = {name: value for name, value in bent.items() if np.isfinite(value)}
    if mldc not in told or len(told) < 2:
        return Claim(where, paper, ClaimVerdict.OPEN, "There are no straightened corners to measure.", ours)
    rivals = [value for name, value in told.items() if name in (NMLDC, FCCM)]
    wins = sum(told[mldc] < value for value in rivals)
    finding = (
        "Rows and columns of test views, straightened, are off their lines by (rms, pixels of the photograph)"
        f" {', '.join(f'{value:.3f} for {name}' for name, value in told.items())}."
    )
    return Claim(where, paper, share(wins, len(rivals)), finding, ours)


def _means(outcomes: Sequence[Outcome], names: Sequence[str], of: str) -> dict[str, float]:
    """The mean of one of a judgement's numbers for each name, over the trials that have it; NaN for none."""
    means = {}
    for name in names:
        values = [getattr(o.judgement, of) for o in outcomes if o.entry == name]
        known = [value for value in values if np.isfinite(value)]
        means[name] = float(np.mean(known)) if known else float("nan")
    return means
