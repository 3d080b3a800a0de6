"""Eq. (7): which camera comes out for which damping.

Every pin-hole makes J zero with corrected points of its own (methods/mldc/eq7.py), so where the search ends
depends on how it walks. Here it walks several ways from the same start on the same data, which is the first
trial's.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

from orthoscope.paper.entries import MLDC, PAPER, PaperEntry, fair_peers
from orthoscope.paper.trials import Condition, Judgement, simulated_trial, trial_judged

__all__ = ["ALIKE", "DAMPINGS", "WEIGHTS", "Eq7Search", "member", "rivals"]

DAMPINGS = (("identity", 1e-4), ("identity", 1e2), ("diagonal", 1e-4), ("diagonal", 1.0))
# Of J_PH, J_CR and J_ST, tried beside 1, 1, 1 with the first damping.
WEIGHTS = ((1.0, 0.0, 0.0), (1.0, 1e4, 1.0), (1.0, 1.0, 1e4))
ALIKE = (1.0, 1.0, 1.0)


class Eq7Search(NamedTuple):
    """Where a search ended: the scene, how it was damped and weighed (another method's name outside eq. 7), J
    (px^2) and the camera.
    """

    scene: str
    name: str
    J: float
    judgement: Judgement

    @property
    def literal(self) -> bool:
        """Whether this is an end of eq. (7)'s search."""
        return self.J == self.J


class _Costs:
    """Listens to a method's progress and keeps the last cost of its first search; a later search starts with
    another step count or cost.
    """

    def __init__(self) -> None:
        self.last = (0, float("inf"))
        self.over = False

    def __call__(self, step: int, cost: float) -> None:
        self.over |= step <= self.last[0] or cost > self.last[1]
        if not self.over:
            self.last = (step, cost)


def member(
    scene: str,
    damp: str,
    damping: float,
    weights: tuple[float, float, float] = ALIKE,
    *,
    condition: Condition,
    seed: int,
) -> Eq7Search:
    """The camera at which eq. (7) comes to rest with this damping and these weights."""
    costs = _Costs()
    settings = {
        "lens": "pfet",
        "correct": "literal",
        "damp": damp,
        "damping": damping,
        "weights": weights,
        "progress": costs,
    }
    judgement = trial_judged(
        PaperEntry(MLDC, "mldc", settings), simulated_trial(scene, condition, seed=seed, trial=0)
    )
    weighed = "" if weights == ALIKE else ", weights " + " ".join(f"{weight:g}" for weight in weights)
    return Eq7Search(scene, f"{damp} {damping:g}{weighed}", costs.last[1], judgement)


def rivals(scene: str, *, condition: Condition, seed: int, own: Sequence[PaperEntry] = ()) -> list[Eq7Search]:
    """What the other methods make of the same data; those of MLDC first, the user's own last."""
    data = simulated_trial(scene, condition, seed=seed, trial=0)
    entries = [entry for entry in (*PAPER, *fair_peers(), *own) if entry.name != MLDC]
    order = sorted(entries, key=lambda entry: (entry.method != "mldc", entry in own))
    return [Eq7Search(scene, entry.name, float("nan"), trial_judged(entry, data)) for entry in order]
