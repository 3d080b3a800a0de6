"""Eq. (7): which camera comes out for which damping.

Every pin-hole makes J zero with corrected points of its own (methods/mldc/eq7.py), so where the search ends
depends on how it walks. Here it walks several ways from the same start on the same data, which is the first
trial's.
"""

from __future__ import annotations

from typing import NamedTuple

from orthoscope.paper.entries import MLDC, PAPER, Entry, fair_peers
from orthoscope.paper.trials import Condition, Judgement, judged, simulated

__all__ = ["DAMPINGS", "Eq7Search", "member", "rivals"]

DAMPINGS = (("identity", 1e-4), ("identity", 1e2), ("diagonal", 1e-4), ("diagonal", 1.0))


class Eq7Search(NamedTuple):
    """Where a search ended: the scene, how it was damped (`damp lambda`; another method's name outside eq.
    7), J (px^2) and the camera.
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


def member(scene: str, damp: str, damping: float, *, condition: Condition, seed: int) -> Eq7Search:
    """The camera at which eq. (7) comes to rest with this damping."""
    costs = _Costs()
    settings = {"lens": "pfet", "correct": "literal", "damp": damp, "damping": damping, "progress": costs}
    judgement = judged(Entry(MLDC, "mldc", settings), *simulated(scene, condition, seed=seed, trial=0))
    return Eq7Search(scene, f"{damp} {damping:g}", costs.last[1], judgement)


def rivals(scene: str, *, condition: Condition, seed: int) -> list[Eq7Search]:
    """What the other methods make of the same data; MLDC's default is the member nearest to the
    detections.
    """
    data = simulated(scene, condition, seed=seed, trial=0)
    named = [(entry.name if entry.name != MLDC else "nearest to the detections", entry) for entry in PAPER]
    named += [(entry.name, entry) for entry in fair_peers()]
    order = sorted(named, key=lambda pair: pair[1].name != MLDC)
    return [Eq7Search(scene, name, float("nan"), judged(entry, *data)) for name, entry in order]
