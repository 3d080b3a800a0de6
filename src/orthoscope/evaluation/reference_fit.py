"""The richest fit of a calibration's own photographs: what its camera is compared with, and what its views
are asked by.

Every corner free and a free lens over the same base: whatever the calibration took for granted of target and
lens is open here. From it come the test of whether the photographs agree (disagreement.py), what leaving each
of them out does, and, beside the calibration's own fit, how far off its camera is (camera_error.py).
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from orthoscope.evaluation.camera_error import CameraError, picked, predicted_error, rms_difference
from orthoscope.fitting.calibration import Calibration
from orthoscope.fitting.fits import Fits
from orthoscope.fitting.leave_one_out import LeaveOneOut
from orthoscope.fitting.linearised import Linearised
from orthoscope.geometry.arrays import Float, ndarray
from orthoscope.targets.detections import Detections

__all__ = ["ReferenceFit", "reference_fit"]

# A camera that is nearer to a fit of which all is known than this share of the error is that fit's.
AS_GOOD_SHARE = 0.2
# Methods whose own fit leaves views out: where it cannot, nothing is known of their camera.
ONE_FIT = ("decoupled", "fccm")


@dataclass(frozen=True, eq=False)
class ReferenceFit:
    """The richest fit and what it says.

    Attributes:
        detections: that it was made from, all or some that stand for many.
        known: it, linearised.
        left_out: each view left out of it.
        base: the formula under its free lens.
        of_all: a fit of all views, linearised: the calibration's own model, or this one.
        error: how far off the calibration's own camera is.
        own_left_out: (m,) squared error of each view, px^2, by the calibration's own model without it.
        own_squares: (m,) the same with it, as the calibration is.
    """

    detections: Detections
    known: Linearised
    left_out: LeaveOneOut
    base: str
    of_all: Linearised
    error: CameraError
    own_left_out: Float[ndarray, " m"]
    own_squares: Float[ndarray, " m"]


def reference_fit(calibration: Calibration, fits: Fits) -> ReferenceFit | None:
    """The richest fit of a calibration's photographs; None where they do not tell one.

    Args:
        fits: of the calibration.
    """
    if fits.richest is None or (fits.own is None and calibration.method in ONE_FIT):
        return None
    richest, own = fits.richest, fits.own
    scatter = own.scatter if own else richest.scatter
    pixels = np.concatenate([view.pixels for view in calibration.detections.views])
    some = picked(pixels)
    seen, distance = pixels[some], _distances(calibration)[some]
    error = predicted_error(
        scatter, seen, distance=distance, richest=richest.scatter if own else None, poorer=richest.poorer
    )
    apart = rms_difference(calibration.camera, scatter.camera, seen)
    if apart > AS_GOOD_SHARE * error.seen_px:
        # Not the minimum of a fit whose scatter is known: what is apart is its bias.
        near_px, far_px = (float(np.hypot(px, apart)) for px in (error.near_seen_px, error.seen_px))
        error = replace(error, seen_px=far_px, near_seen_px=near_px, bias_px=apart)
    without = (own.left_out**2).sum(1) if own else richest.left_out.squares
    within = np.array([float(np.nansum(e**2)) for e in calibration.residuals()])
    return ReferenceFit(
        detections=richest.detections,
        known=richest.known,
        left_out=richest.left_out,
        base=richest.base,
        of_all=own.known if own and richest.detections is not calibration.detections else richest.known,
        error=error,
        own_left_out=without,
        own_squares=within,
    )


def _distances(calibration: Calibration) -> Float[ndarray, " n"]:
    """Of every detected corner from the camera, metres, view after view."""
    points = calibration.detections.target.points
    pairs = zip(calibration.camera_from_target, calibration.detections.views, strict=True)
    return np.concatenate([np.linalg.norm(pose.apply(points[view.ids]), axis=1) for pose, view in pairs])
