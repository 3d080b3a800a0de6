"""Methods that make a calibration from detections, by name."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from orthoscope.geometry.arrays import InputError
from orthoscope.geometry.target import Detections
from orthoscope.methods.calibration import Calibration
from orthoscope.methods.fccm import fccm

__all__ = ["METHODS", "calibrate"]

METHODS: dict[str, Callable[..., Calibration]] = {
    "fccm": fccm,
}


def calibrate(detections: Detections, *, method: str = "fccm", **settings: Any) -> Calibration:
    """Calibrate a camera from detections by a method of METHODS; its settings are the method's own (lens, skew, loss, ...).

    Raises CalibrationError where the views cannot tell the camera, InputError for a method or a setting that is none.
    """
    if method not in METHODS:
        raise InputError(f"method {method!r} is not known; expected one of {', '.join(METHODS)}.")
    return METHODS[method](detections, **settings)
