"""Where the camera may be trusted: its predicted error over the frame, and where that stays small."""

from __future__ import annotations

from typing import Any

import numpy as np

from orthoscope.evaluation.evaluate import Evaluation
from orthoscope.report.data.rounded import PLACE_UNITS, RESIDUAL_UNITS, whole

__all__ = ["trust", "without_each"]


def trust(evaluation: Evaluation) -> dict[str, Any] | str:
    """The map at infinity and at the target's distance, thousandths of a pixel at the centres of cells, and
    the region as a polygon, tenths of a pixel, with the share of the frame that lies in it.
    """
    error = evaluation.error
    if error is None:
        return "How far off the camera is could not be predicted from these photographs."
    rows, columns = error.far.shape
    return {
        "rows": rows,
        "columns": columns,
        "far": whole(error.far.ravel(), RESIDUAL_UNITS),
        "near": whole(error.near.ravel(), RESIDUAL_UNITS),
        "limit": float(f"{error.limit_px:.3g}"),
        "distance": float(f"{error.distance:.3g}"),
        "region": whole(error.region.ravel(), PLACE_UNITS),
        "share": round(error.share, 4) if np.isfinite(error.share) else None,  # files of before had none
    }


def without_each(evaluation: Evaluation) -> dict[str, Any] | str:
    """By how much the image moves without each photograph, pixels."""
    if evaluation.error is None or not np.isfinite(evaluation.error.without_px).any():
        return "Too few photographs to leave one out."
    return {"px": [round(px, 5) if np.isfinite(px) else None for px in evaluation.error.without_px.tolist()]}
