"""What follows from a comparison, in plain words.

A difference counts where it is more than SURE_ERRORS times its standard error; what is less, chance may
account for.
"""

from __future__ import annotations

from collections.abc import Sequence
from math import isnan

from orthoscope.evaluation.comparison.compare import Comparison, Standing
from orthoscope.geometry.numbers import with_error
from orthoscope.methods.decoupled.model_selection import SURE_ERRORS

__all__ = ["as_good_as_best", "conclusions"]


def conclusions(comparison: Comparison) -> tuple[str, ...]:
    """Which entry predicts photographs best, which others are as good, what the next one loses, and who
    learnt what it was shown.
    """
    judged = comparison.judged
    if not judged:
        return ("None of them could be judged on these photographs.",)
    best, as_good = judged[0], as_good_as_best(comparison)
    worse = [standing for standing in judged[1:] if standing not in as_good]
    alone = len(comparison.standings) == 1
    told = [
        f"{best.entry.name} predicts these photographs {'with' if alone else 'best:'} {_error(best)} px on"
        " those that were not used."
    ]
    if as_good:
        told.append(_as_good(as_good))
    if worse:
        told.append(f"The next, {worse[0].entry.name}, loses {_loss(worse[0])} px.")
    learnt = min(judged, key=lambda standing: (isnan(standing.rms_px), standing.rms_px))
    if learnt in worse:
        told.append(
            f"{learnt.entry.name} has the least error on photographs that were used, {learnt.rms_px:.3f} px,"
            f" and on others {learnt.held_out_px:.3f} px: it learns photographs, not the camera."
        )
    return tuple(told)


def as_good_as_best(comparison: Comparison) -> tuple[Standing, ...]:
    """Those, apart from the best, whose loss chance may account for."""
    return tuple(
        standing
        for standing in comparison.judged[1:]
        if standing.loses_px <= SURE_ERRORS * standing.loses_error_px
    )


def _as_good(others: Sequence[Standing]) -> str:
    """Who is as good as the best."""
    listed = ", ".join(f"{standing.entry.name} ({_against(standing)})" for standing in others)
    return f"As good, for all that chance allows to say: {listed}."


def _against(standing: Standing) -> str:
    """What one that is as good as the best loses, if anything."""
    same = standing.loses_px == standing.loses_error_px == 0.0
    return "comes to the same" if same else f"loses {_loss(standing)} px"


def _error(standing: Standing) -> str:
    return with_error(standing.held_out_px, standing.error_px)


def _loss(standing: Standing) -> str:
    return with_error(standing.loses_px, standing.loses_error_px)
