"""How long a method takes for how many images: the paper's minute to hour.

Processor time of this process, so that other work on the machine adds little; still the one thing here that
no seed repeats.
"""

from __future__ import annotations

import time
from typing import NamedTuple

from orthoscope.geometry.arrays import CalibrationError
from orthoscope.paper.entries import FCCM, MLDC, OURS, PAPER, REPEATED
from orthoscope.paper.trials import Condition, simulated_trial

__all__ = ["TIMED", "Timing", "timings"]

TIMED = (MLDC, REPEATED, FCCM)


class Timing(NamedTuple):
    """A calibration's time.

    Attributes:
        images: how many.
        entry: who.
        unknowns: of eq. (7) for so many images, 2nm + 5 + 6m.
        seconds: of processor time, NaN where there was no camera.
        steps: of the search, or rounds.
    """

    images: int
    entry: str
    unknowns: int
    seconds: float
    steps: int


def timings(condition: Condition, *, seed: int) -> list[Timing]:
    """Every timed method once, on the first trial of the low distortion."""
    training = simulated_trial("low", condition, seed=seed, trial=0).training
    images, corners = len(training.views), training.corners
    found = []
    for entry in (entry for entry in (*PAPER, *OURS) if entry.name in TIMED):
        start = time.process_time()
        try:
            steps = entry.calibrate(training).steps
            seconds = time.process_time() - start
        except CalibrationError:
            steps, seconds = 0, float("nan")
        found.append(Timing(images, entry.name, 2 * corners + 5 + 6 * images, seconds, steps))
    return found
