"""The richest fit of a calibration's own photographs: what its camera is compared with, and what its views
are asked by.

Every corner free and a free lens over the same base: whatever the calibration took for granted of target and
lens is open here. From it come the test of whether the photographs agree (disagreement.py), what leaving each
of them out does, and, beside the calibration's own fit, how far off its camera is (camera_error.py).
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
from orthoscope.methods.decoupled.candidates import PAIRS, Candidates, Model
from orthoscope.methods.decoupled.step_one import FORMULA, fit_step_one
from orthoscope.methods.decoupled.step_one_linearised import linearised
from orthoscope.models.free_lens import FreeLens
from orthoscope.models.lenses import FREE, lens_name

__all__ = ["ReferenceFit", "reference_fit"]

# A camera that is nearer to a fit of which all is known than this share of the error is that fit's.
AS_GOOD_SHARE = 0.2
# With fewer views a free lens and a free target have nothing to be told by.
FEWEST_VIEWS = 2


@dataclass(frozen=True, eq=False)
class ReferenceFit:
    """The richest fit and what it says.

    Args:
        known: it, linearised.
        left_out: each view left out of it.
        base: the formula under its free lens.
        error: how far off the calibration's own camera is.
        own_left_out: (m,) squared error of each view, px^2, by the calibration's own model without it.
        own_squares: (m,) the same with it, as the calibration is.
    """

    known: Linearised
    left_out: LeaveOneOut
    base: str
    error: CameraError
    own_left_out: Float[ndarray, " m"]
    own_squares: Float[ndarray, " m"]


def reference_fit(calibration: Calibration) -> ReferenceFit | None:
    """The richest fit of a calibration's photographs; None where they do not tell one."""
    detections, points = calibration.detections, calibration.detections.target.points
    if len(detections.views) < FEWEST_VIEWS:
        return None
    candidates = Candidates(detections, skew=bool(calibration.settings.get("skew", False)))
    richest = Model(_base(calibration), "free", FREE)
    try:
        known, left_out = candidates.linearised(richest), candidates.left_out(richest)
        of_richest = scatter_of(known, left_out, points)
        own, without, within = _own(calibration, candidates, richest)
    except (CalibrationError, np.linalg.LinAlgError):
        return None
    seen = seen_places(np.concatenate([view.pixels for view in detections.views]))
    distance = float(np.median([np.linalg.norm(pose.translation) for pose in calibration.camera_from_target]))
    error = predicted_error(
        own or of_richest, seen, distance=distance, richest=None if own is None else of_richest
    )
    apart = rms_difference(calibration.camera, (own or of_richest).camera, seen)
    if apart > AS_GOOD_SHARE * error.seen_px:
        # Not the minimum of a fit whose scatter is known: what is apart is its bias.
        error = replace(error, seen_px=float(np.hypot(error.seen_px, apart)), bias_px=apart)
    return ReferenceFit(known, left_out, richest.base, error, without, within)


def _base(calibration: Calibration) -> str:
    """The formula to put the free lens on: the calibration's own base, or its formula with all its
    coefficients.
    """
    if base := calibration.settings.get("base"):
        return str(base)
    lens = calibration.camera.lens
    name = lens_name(lens.base if isinstance(lens, FreeLens) else lens)
    return name if name in ("brown", "kannala_brandt", "rational") else "brown"


def _own(
    calibration: Calibration, candidates: Candidates, richest: Model
) -> tuple[Scatter | None, Float[ndarray, " m"], Float[ndarray, " m"]]:
    """Scatter of the calibration's own camera where it is not the richest fit's or not known, and the squares
    of its views without and with them.
    """
    within = np.array([float(np.nansum(e**2)) for e in calibration.residuals()])
    if calibration.method == "decoupled" and not _is(calibration, richest):
        model = _model(calibration)
        without = candidates.contender(model).squares
        return candidates.scatter(model), without, within
    if calibration.method == "fccm":
        mine = linearised(fit_step_one(calibration, shape="flat", first_lens=FORMULA))
        left_out = leave_one_out(mine)
        return scatter_of(mine, left_out, calibration.detections.target.points), left_out.squares, within
    return None, candidates.left_out(richest).squares, within


def _model(calibration: Calibration) -> Model:
    """What a calibration of the default method was made as."""
    settings = calibration.settings
    formula = settings["lens"] if settings["fit"] == PAIRS else None
    return Model(settings["base"], settings["shape"], settings["first_lens"], formula)


def _is(calibration: Calibration, richest: Model) -> bool:
    return calibration.method == "decoupled" and _model(calibration) == richest
