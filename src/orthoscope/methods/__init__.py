"""Methods that make a calibration from detections, by name.

Each is a function in a file of its own that has its name, loaded when it is first asked for: one calibration
takes one method.
"""

from __future__ import annotations

import importlib
import inspect
from collections import UserDict
from collections.abc import Callable
from typing import Any

from orthoscope.fitting.calibration import Calibration
from orthoscope.geometry.arrays import InputError
from orthoscope.geometry.blas import with_one_thread
from orthoscope.targets.detections import Detections

__all__ = ["METHODS", "calibrate", "settings_of"]


class _Methods(UserDict[str, Any]):
    """Functions by name; what stands in the table is the function, or the name of its file until it is asked
    for.
    """

    def __getitem__(self, name: str) -> Callable[..., Calibration]:
        if isinstance(self.data[name], str):
            self.data[name] = getattr(importlib.import_module(self.data[name]), name)
        return self.data[name]


METHODS = _Methods(
    {
        "decoupled": f"{__name__}.decoupled.decoupled",
        "fccm": f"{__name__}.fccm",
        "mldc": f"{__name__}.mldc.mldc",
        "nmldc": f"{__name__}.mldc.nmldc",
    }
)


@with_one_thread
def calibrate(detections: Detections, *, method: str = "decoupled", **settings: Any) -> Calibration:
    """Calibrate a camera from detections by a method of METHODS; its settings are the method's own (lens,
    skew, loss, ...).

    Raises CalibrationError where the views cannot tell the camera, InputError for a method or a setting that
    is none.
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
