"""The richest fit of a calibration's own photographs: what its camera is compared with, and what its views are asked by.

Every corner free and a free lens over the same base: whatever the calibration took for granted of target and lens is open
here. From it come the test of whether the photographs agree (disagreement.py), what leaving each of them out does, and, beside
the calibration's own fit, how far off its camera is (camera_error.py).
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from orthoscope.evaluation.camera_error import CameraError, predicted_error, rms_difference, seen_places
from orthoscope.fitting.calibration import Calibration
from orthoscope.fitting.leave_one_out import LeaveOneOut, leave_one_out
from orthoscope.fitting.linearised import Linearised
from orthoscope.fitting.scatter import Scatter, scatter_of
from orthoscope.geometry.arrays import CalibrationError, Float, ndarray
from orthoscope.methods.decoupled.step_one import FORMULA, fit_step_one
from orthoscope.methods.decoupled.step_one_linearised import linearised
from orthoscope.methods.decoupled.step_two_linearised import PairsLeftOut
from orthoscope.methods.fccm import fccm
from orthoscope.models.free_lens import FreeLens
from orthoscope.models.lenses import FREE, lens_name

__all__ = ["ReferenceFit", "reference_fit"]

FEWEST_VIEWS = 2  # with fewer, a free lens and a free target have nothing to be told by


@dataclass(frozen=True, eq=False)
class ReferenceFit:
    """The richest fit and what it says.

    Args:
        known: it, linearised.
        left_out: each view left out of it.
        base: the formula under its free lens.
        error: how far off the calibration's own camera is.
        own_left_out: (m,) squared error of each view, px^2, by the calibration's own model without it.
        own_squares: (m,) the same with it.
    """

    known: Linearised
    left_out: LeaveOneOut
    base: str
    error: CameraError
    own_left_out: Float[ndarray, " m"]
    own_squares: Float[ndarray, " m"]


def reference_fit(calibration: Calibration) -> ReferenceFit | None:
    """The richest fit of a calibration's photographs; None where they do not tell one."""
    detections = calibration.detections
    if len(detections.views) < FEWEST_VIEWS:
        return None
    base = _base(calibration)
    try:
        flat = fccm(detections, lens=base, skew=bool(calibration.settings.get("skew", False)))
        richest = fit_step_one(flat, target="free", through=FREE)
        known = linearised(richest)
        left_out = leave_one_out(known)
        of_richest = scatter_of(known, left_out, detections.target.points)
        own, own_left_out, own_squares = _own(calibration, flat, known, left_out, of_richest)
    except (CalibrationError, np.linalg.LinAlgError):
        return None
    seen = seen_places(np.concatenate([view.pixels for view in detections.views]))
    distance = float(np.median([np.linalg.norm(pose.translation) for pose in calibration.camera_from_target]))
    error = predicted_error(
        own or of_richest, seen, distance=distance, richest=None if own is of_richest else of_richest
    )
    if own is None:  # its unknowns are none of step 1's: what separates it from the richest fit is its bias
        apart = rms_difference(calibration.camera, richest.estimate.camera, seen)
        error = replace(error, seen_px=float(np.hypot(error.seen_px, apart)), bias_px=apart)
    return ReferenceFit(known, left_out, base, error, own_left_out, own_squares)


def _base(calibration: Calibration) -> str:
    """The formula to put the free lens on: the calibration's own base, or its formula with all its coefficients."""
    if base := calibration.settings.get("base"):
        return str(base)
    lens = calibration.camera.lens
    name = lens_name(lens.base if isinstance(lens, FreeLens) else lens)
    return name if name in ("brown", "kannala_brandt", "rational") else "brown"


def _own(
    calibration: Calibration, flat: Calibration, known: Linearised, left_out: LeaveOneOut, of_richest: Scatter
) -> tuple[Scatter | None, Float[ndarray, " m"], Float[ndarray, " m"]]:
    """Scatter of the calibration's own camera, and squares of its views without and with them."""
    settings, points = calibration.settings, calibration.detections.target.points
    if calibration.method == "decoupled":
        through, formula = settings["through"], settings["lens"]
        joint = formula == (FREE if through == FREE else settings["base"])
        if joint and settings["target"] == "free" and through == FREE:
            return of_richest, left_out.squares, (known.errors**2).sum(1)
        fit = fit_step_one(flat, target=settings["target"], through=through)
        mine = linearised(fit)
        without = leave_one_out(mine)
        if joint:
            return scatter_of(mine, without, points), without.squares, (mine.errors**2).sum(1)
        pairs = PairsLeftOut(fit, mine, without, calibration.camera, calibration.uncertainty.names)
        return pairs.scatter(), pairs.squares, _squares(calibration)
    if calibration.method == "fccm":
        mine = linearised(fit_step_one(calibration, target="flat", through=FORMULA))
        without = leave_one_out(mine)
        return scatter_of(mine, without, points), without.squares, (mine.errors**2).sum(1)
    return None, left_out.squares, _squares(calibration)


def _squares(calibration: Calibration) -> Float[ndarray, " m"]:
    return np.array([float(np.nansum(e**2)) for e in calibration.residuals()])
