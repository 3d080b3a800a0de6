"""What a calibration's fits say of it beyond the camera: how it scatters, and what leaving each photograph
out does.

A method that compares models has all this at hand when it ends (methods/decoupled/candidates.py); evaluation
asks for it, and it is not saved.
"""

from __future__ import annotations

from typing import NamedTuple

from orthoscope.fitting.calibration import Calibration
from orthoscope.fitting.slopes.linearised import Linearised
from orthoscope.fitting.unseen.leave_one_out import LeaveOneOut
from orthoscope.fitting.unseen.scatter import Scatter
from orthoscope.geometry.arrays import Float, ndarray
from orthoscope.targets.detections import Detections

__all__ = ["Fits", "OwnFit", "RichestFit"]


class OwnFit(NamedTuple):
    """The calibration's own model.

    Attributes:
        known: the fit, linearised.
        left_out: (m,2p) residuals of each view by the fit without it, as in `LeaveOneOut`.
        scatter: of its camera.
    """

    known: Linearised
    left_out: Float[ndarray, "m n"]
    scatter: Scatter


class RichestFit(NamedTuple):
    """Every corner free and a free lens, of all photographs or, where they are many, of some that stand for
    them.

    Attributes:
        detections: that it was made from.
        base: the formula under the free lens.
        flat: a calibration of a flat target with the base alone, which the fit started from.
        known: the fit, linearised.
        left_out: each view left out of it.
        scatter: of its camera.
        poorer: scatter of the calibration's own model on the same photographs; None where that is this fit,
            or is not known.
    """

    detections: Detections
    base: str
    flat: Calibration
    known: Linearised
    left_out: LeaveOneOut
    scatter: Scatter
    poorer: Scatter | None


class Fits(NamedTuple):
    """Both; None where the photographs do not tell one, or the method has no such fit."""

    own: OwnFit | None
    richest: RichestFit | None
