"""What the method tried, and what each loses against the one that was taken."""

from __future__ import annotations

from typing import Any

import numpy as np

from orthoscope.evaluation.evaluate import Evaluation

__all__ = ["choice"]


def choice(evaluation: Evaluation) -> dict[str, Any] | str:
    """Of each candidate: its name, held-out error, standard error and loss, pixels."""
    candidates = [one for one in evaluation.calibration.candidates if np.isfinite(one.held_out_px)]
    if not candidates:
        return "The method had no choice to make, or no photograph could judge it."
    return {
        "candidates": [
            {
                "name": f"{one.target} target, {one.lens} lens",
                "heldOut": round(one.held_out_px, 6),
                "error": round(one.standard_error_px, 6) if np.isfinite(one.standard_error_px) else None,
                "loses": round(one.loses_px, 6) if np.isfinite(one.loses_px) else None,
            }
            for one in candidates
        ]
    }
