"""Methods that make a calibration from detections, by name.

Floor 3.
"""

from __future__ import annotations

import inspect
from collections.abc import Callable
from typing import Any

from orthoscope.geometry.arrays import InputError
from orthoscope.geometry.target import Detections
from orthoscope.methods.calibration import Calibration
from orthoscope.methods.decoupled import decoupled
from orthoscope.methods.fccm import fccm
from orthoscope.methods.mldc import mldc
from orthoscope.methods.nmldc import nmldc

__all__ = ["METHODS", "calibrate", "settings_of"]

METHODS: dict[str, Callable[..., Calibration]] = {
    "decoupled": decoupled,
    "fccm": fccm,
    "mldc": mldc,
    "nmldc": nmldc,
}


def calibrate(detections: Detections, *, method: str = "decoupled", **settings: Any) -> Calibration:
    """Calibrate a camera from detections by a method of METHODS; its settings are the method's own (lens, skew, loss, ...).

    Raises CalibrationError where the views cannot tell the camera, InputError for a method or a setting that is none.
    """
    known = settings_of(method)
    if unknown := sorted(set(settings) - set(known)):
        raise InputError(f"method {method!r} has no setting {unknown[0]!r}; it has {', '.join(known)}.")
    return METHODS[method](detections, **settings)


def settings_of(method: str) -> list[str]:
    """The names of a method's settings.

    Raises InputError for a method that is none.
    """
    if method not in METHODS:
        raise InputError(f"method {method!r} is not known; expected one of {', '.join(METHODS)}.")
    return list(inspect.signature(METHODS[method]).parameters)[1:]
