"""The target: its corners, and how far each is from where it is said to be, millimetres."""

from __future__ import annotations

from typing import Any

import numpy as np

from orthoscope.evaluation.evaluate import Evaluation
from orthoscope.geometry.arrays import Float, ndarray
from orthoscope.report.data.rounded import digits
from orthoscope.report.shape import corners_seen

__all__ = ["target_misfit", "target_shape"]


def target_shape(evaluation: Evaluation) -> dict[str, Any] | str:
    """The shape that was estimated for the target."""
    calibration = evaluation.calibration
    shape = calibration.target_shape
    if shape.kind == "flat":
        return "The target was taken to be flat, its corners where they are said to be."
    seen = corners_seen(calibration)
    return _moved(calibration.detections.target.points, np.where(seen[:, None], shape.displacements, np.nan))


def target_misfit(evaluation: Evaluation) -> dict[str, Any] | str:
    """Where the corners seem to be against where they are taken to be, as far as views agree on it."""
    misfit = evaluation.misfit.target
    if np.isnan(misfit.test.f):
        return "Too few photographs to tell what they agree on."
    if not np.nanmax(np.abs(misfit.displacements), initial=0.0) > 0.0:
        return "Photographs agree on no corner that is off its place: what is left is noise."
    told = _moved(evaluation.calibration.detections.target.points, misfit.displacements)
    return told | {"pixelsPerMm": float(f"{1e-3 * misfit.pixels_per_metre:.3g}")}


def _moved(points: Float[ndarray, "m 3"], displacements: Float[ndarray, "m 3"]) -> dict[str, Any]:
    return {"points": digits(1e3 * points), "moved": digits(1e3 * displacements, 4)}
