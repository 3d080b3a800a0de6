"""What version 0.1.0 wrote into format 1 in other words than are written now.

A candidate was a row [target, lens, held-out error, its standard error, what it loses], with a formula that
was fitted to the pairs of step 1 called `brown from pairs`; decoupled had one way to fit a formula, from
pairs, so no setting said which.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from orthoscope.fitting.calibration import Candidate
from orthoscope.formats.own.struct import Number

__all__ = ["CandidateRow", "candidate_in", "settings_in"]

CandidateRow = tuple[str, str, Number, Number, Number]
# How the lens of a candidate ended that was fitted to pairs.
FROM_PAIRS = " from pairs"


def candidate_in(row: CandidateRow, settings: Mapping[str, Any]) -> Candidate:
    """A candidate that was written as a row.

    Args:
        row: as above, null for a number that does not exist.
        settings: of the calibration, which knows the formula under a free lens.
    """
    target, lens, *numbers = row
    held_out, error, loses = (float("nan") if value is None else value for value in numbers)
    formula = lens.removesuffix(FROM_PAIRS)
    base = str(settings.get("base", "")) if formula == "free" else formula
    return Candidate(target, formula, held_out, error, loses, base, "joint" if formula == lens else "pairs")


def settings_in(method: str, settings: Mapping[str, Any]) -> dict[str, Any]:
    """Settings as they are called now, which give the same fit."""
    if method == "decoupled" and "through" in settings and "fit" not in settings:
        own = "free" if settings["through"] == "free" else settings.get("base")
        return {**settings, "fit": "joint" if settings.get("lens") == own else "pairs"}
    return dict(settings)
