"""Of each photograph: its corners, where the camera predicts them, also held out, the board's pose."""

from __future__ import annotations

from typing import Any

import numpy as np

from orthoscope.evaluation.evaluate import Evaluation
from orthoscope.geometry.arrays import ndarray
from orthoscope.report.data.rounded import PLACE_UNITS, RESIDUAL_UNITS, digits, whole

__all__ = ["suspects_of", "views"]


def views(evaluation: Evaluation) -> list[dict[str, Any]]:
    """One object for each view, in order; `ids` is left out where every corner of the target is there."""
    calibration = evaluation.calibration
    errors = {view.image: view for view in evaluation.views}
    suspects, every = suspects_of(evaluation), np.arange(len(calibration.detections.target.points))
    told = []
    for view, pose, residuals, unseen in zip(
        calibration.detections.views,
        calibration.camera_from_target,
        calibration.residuals(),
        evaluation.held_out_residuals,
        strict=True,
    ):
        error = errors.get(view.image)
        one = {
            "name": view.image,
            "rms": _number(error.rms_px) if error else None,
            "heldOut": _number(error.held_out_rms_px) if error else None,
            "suspect": suspects.get(view.image, ""),
            "pose": [*digits(pose.rotation.ravel(), 6), *digits(pose.translation, 6)],
            **_columns(view.pixels, "x", "y", PLACE_UNITS),
            **_columns(residuals, "ex", "ey", RESIDUAL_UNITS),
        }
        if np.isfinite(unseen).any():
            one |= _columns(unseen, "hx", "hy", RESIDUAL_UNITS)
        if not np.array_equal(view.ids, every):
            one["ids"] = view.ids.tolist()
        told.append(one)
    return told


def suspects_of(evaluation: Evaluation) -> dict[str, str]:
    """Views that do not belong, and why."""
    return dict(evaluation.suspects)


def _columns(values: ndarray, x: str, y: str, units: int) -> dict[str, list]:
    return {x: whole(values[:, 0], units), y: whole(values[:, 1], units)}


def _number(value: float) -> float | None:
    return round(float(value), 5) if np.isfinite(value) else None
