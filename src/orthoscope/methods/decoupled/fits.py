"""The fits behind a calibration, whatever method made it: those that `decoupled` has just made, or the same
again.
"""

from __future__ import annotations

import numpy as np

from orthoscope.fitting.calibration import Calibration
from orthoscope.fitting.fits import Fits, OwnFit, RichestFit
from orthoscope.fitting.starts.initial_camera import formula_for
from orthoscope.fitting.unseen.leave_one_out import leave_one_out
from orthoscope.fitting.unseen.near_copies import near_copies
from orthoscope.fitting.unseen.scatter import scatter_of
from orthoscope.geometry.arrays import CalibrationError
from orthoscope.methods.decoupled.candidates import Candidates
from orthoscope.methods.decoupled.model import BASES, PAIRS, Model
from orthoscope.methods.decoupled.step_one_linearised import linearised_flat
from orthoscope.methods.fccm import fit_flat
from orthoscope.models.lenses.free import FreeLens
from orthoscope.models.lenses.table import FREE, lens_name

__all__ = ["fits_of", "richest_of_all"]

# With fewer views a free lens and a free target have nothing to be told by.
FEWEST_VIEWS = 2


def fits_of(calibration: Calibration) -> Fits:
    """The calibration's own model and the richest one, each with every view left out.

    What is richer is told by some of many photographs, beside the own model of the same: all of them tell
    how the camera scatters.

    Args:
        calibration: of any method; of those that fit pin-hole and lens one after the other, the own model is
            not known.
    """
    if len(calibration.detections.views) < FEWEST_VIEWS:
        return Fits(None, None)
    candidates = _candidates(calibration)
    own = _own(calibration, candidates)
    if own is None or _step_one_of(calibration) == _richest_model(calibration):
        return Fits(own, _richest(calibration, candidates, own))
    some = candidates.of_some
    return Fits(own, _richest(calibration, some, own if some is candidates else _own(calibration, some)))


def richest_of_all(calibration: Calibration) -> RichestFit | None:
    """The richest fit of all photographs, however many they are."""
    candidates = _candidates(calibration)
    return _richest(calibration, candidates, None)


def _candidates(calibration: Calibration) -> Candidates:
    kept = calibration.kept
    if isinstance(kept, Candidates) and kept.fits(calibration):
        return kept
    return Candidates(calibration.detections, skew=bool(calibration.settings.get("skew", False)))


def _richest(calibration: Calibration, candidates: Candidates, own: OwnFit | None) -> RichestFit | None:
    """own: the calibration's model on the candidates' photographs."""
    model = _richest_model(calibration)
    try:
        known, left_out = candidates.linearised(model), candidates.left_out(model)
        scatter = candidates.scatter(model)
    except (CalibrationError, np.linalg.LinAlgError):
        return None
    poorer = own.scatter if own and own.scatter is not scatter else None
    flat = candidates.flat(model.base)
    return RichestFit(candidates.detections, model.base, flat, known, left_out, scatter, poorer)


def _richest_model(calibration: Calibration) -> Model:
    return Model(_base(calibration), "free", FREE)


def _own(calibration: Calibration, candidates: Candidates) -> OwnFit | None:
    """The calibration's model on the candidates' photographs, which are its own or some of them."""
    try:
        if calibration.method == "decoupled":
            model = _model(calibration)
            residuals, scatter = candidates.residuals(model), candidates.scatter(model)
            return OwnFit(candidates.linearised(model.step_one), residuals, scatter)
        if calibration.method == "fccm":
            used = candidates.detections
            same = used is calibration.detections
            mine = linearised_flat(calibration if same else fit_flat(used, **calibration.settings))
            left_out = leave_one_out(mine, near_copies(used))
            return OwnFit(mine, left_out.residuals, scatter_of(mine, left_out, used.target.points))
    except (CalibrationError, np.linalg.LinAlgError):
        return None
    return None


def _step_one_of(calibration: Calibration) -> Model | None:
    return _model(calibration).step_one if calibration.method == "decoupled" else None


def _model(calibration: Calibration) -> Model:
    """What a calibration of the default method was made as."""
    settings = calibration.settings
    formula = settings["lens"] if settings["fit"] == PAIRS else None
    return Model(settings["base"], settings["shape"], settings["first_lens"], formula)


def _base(calibration: Calibration) -> str:
    """The formula to put the free lens on: the calibration's own base, or its formula with all its
    coefficients, or the one that suits how far its corners lie from the axis.
    """
    if base := calibration.settings.get("base"):
        return str(base)
    lens = calibration.camera.lens
    name = lens_name(lens.base if isinstance(lens, FreeLens) else lens)
    if name in BASES:
        return name
    pixels = np.concatenate([view.pixels for view in calibration.detections.views])
    return formula_for(calibration.camera.unproject(pixels))
