"""What the method tried, and what each loses against the one that was taken."""

from __future__ import annotations

from typing import Any

import numpy as np

from orthoscope.evaluation.evaluate import Evaluation
from orthoscope.fitting.calibration import Candidate
from orthoscope.geometry.numbers import with_error
from orthoscope.models.lenses.table import FREE

__all__ = ["choice", "model_name"]


def choice(evaluation: Evaluation) -> dict[str, Any] | str:
    """Of each candidate: its name, held-out error, standard error and loss, pixels; the first two also as
    people read them.
    """
    candidates = [one for one in evaluation.calibration.candidates if np.isfinite(one.held_out_px)]
    if not candidates:
        return "The method had no choice to make, or no photograph could judge it."
    return {
        "candidates": [
            {
                "name": model_name(one),
                "heldOut": round(one.held_out_px, 6),
                "error": round(one.standard_error_px, 6) if np.isfinite(one.standard_error_px) else None,
                "told": f"{with_error(one.held_out_px, one.standard_error_px)} px",
                "loses": round(one.loses_px, 6) if np.isfinite(one.loses_px) else None,
            }
            for one in candidates
        ]
    }


def model_name(candidate: Candidate) -> str:
    """What tells a candidate from the others: `flat target, brown` or `free target, free on brown`."""
    lens = f"free on {candidate.base}" if candidate.lens == FREE and candidate.base else candidate.lens
    pairs = " from pairs" if candidate.fit == "pairs" else ""
    return f"{candidate.target} target, {lens}{pairs}"
