"""The fits behind a calibration, whatever method made it: those that `decoupled` has just made, or the same
again.
"""

from __future__ import annotations

import numpy as np

from orthoscope.fitting.calibration import Calibration
from orthoscope.fitting.fits import Fits, OwnFit, RichestFit
from orthoscope.fitting.leave_one_out import leave_one_out
from orthoscope.fitting.near_copies import near_copies
from orthoscope.fitting.scatter import scatter_of
from orthoscope.geometry.arrays import CalibrationError
from orthoscope.methods.decoupled.candidates import Candidates
from orthoscope.methods.decoupled.model import PAIRS, Model
from orthoscope.methods.decoupled.step_one_linearised import linearised_flat
from orthoscope.models.free_lens import FreeLens
from orthoscope.models.lenses import FREE, lens_name

__all__ = ["fits_of"]

# The richest fit has one of these bases under its free lens.
RICHEST_BASES = ("brown", "kannala_brandt", "rational")
# With fewer views a free lens and a free target have nothing to be told by.
FEWEST_VIEWS = 2


def fits_of(calibration: Calibration) -> Fits:
    """The calibration's own model and the richest one, each with every view left out.

    Args:
        calibration: of any method; of those that fit pin-hole and lens one after the other, the own model is
            not known.
    """
    if len(calibration.detections.views) < FEWEST_VIEWS:
        return Fits(None, None)
    kept = calibration.kept
    candidates = kept if isinstance(kept, Candidates) and kept.fits(calibration) else _again(calibration)
    return Fits(_own(calibration, candidates), _richest(calibration, candidates))


def _again(calibration: Calibration) -> Candidates:
    return Candidates(calibration.detections, skew=bool(calibration.settings.get("skew", False)))


def _richest(calibration: Calibration, candidates: Candidates) -> RichestFit | None:
    model = Model(_base(calibration), "free", FREE)
    try:
        return RichestFit(
            model.base, candidates.linearised(model), candidates.left_out(model), candidates.scatter(model)
        )
    except (CalibrationError, np.linalg.LinAlgError):
        return None


def _own(calibration: Calibration, candidates: Candidates) -> OwnFit | None:
    try:
        if calibration.method == "decoupled":
            model = _model(calibration)
            return OwnFit(candidates.residuals(model), candidates.scatter(model))
        if calibration.method == "fccm":
            mine = linearised_flat(calibration)
            left_out = leave_one_out(mine, near_copies(calibration.detections))
            return OwnFit(
                left_out.residuals, scatter_of(mine, left_out, calibration.detections.target.points)
            )
    except (CalibrationError, np.linalg.LinAlgError):
        return None
    return None


def _model(calibration: Calibration) -> Model:
    """What a calibration of the default method was made as."""
    settings = calibration.settings
    formula = settings["lens"] if settings["fit"] == PAIRS else None
    return Model(settings["base"], settings["shape"], settings["first_lens"], formula)


def _base(calibration: Calibration) -> str:
    """The formula to put the free lens on: the calibration's own base, or its formula with all its
    coefficients.
    """
    if base := calibration.settings.get("base"):
        return str(base)
    lens = calibration.camera.lens
    name = lens_name(lens.base if isinstance(lens, FreeLens) else lens)
    return name if name in RICHEST_BASES else "brown"
