"""The richest fit of a calibration's own photographs: what its camera is compared with, and what its views
are asked by.

Every corner free and a free lens over the same base: whatever the calibration took for granted of target and
lens is open here. From it come the test of whether the photographs agree (disagreement.py), what leaving each
of them out does, and, beside the calibration's own fit, how far off its camera is (camera_error.py).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from orthoscope.evaluation.camera_error import CameraError, picked, predicted_error
from orthoscope.evaluation.disagreement import Disagreement, disagreement, with_spread
from orthoscope.evaluation.groups import Groups, two_groups
from orthoscope.fitting.calibration import Calibration
from orthoscope.fitting.fits import Fits, RichestFit
from orthoscope.fitting.slopes.linearised import Linearised
from orthoscope.fitting.unseen.leave_one_out import LeaveOneOut, leave_one_out
from orthoscope.fitting.unseen.near_copies import near_copies
from orthoscope.geometry.arrays import Float, ndarray
from orthoscope.methods.decoupled.fits import richest_of_all
from orthoscope.targets.detections import Detections

__all__ = ["ReferenceFit", "reference_fit"]

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
        disagreement: whether the photographs agree on one camera.
        groups: of photographs of two cameras; None where there is one.
        of_all: a fit of all views, linearised: the calibration's own model, or this one.
        error: how far off the calibration's own camera is.
        own_left_out: (m,) squared error of each view, px^2, by the calibration's own model without it.
        own_squares: (m,) the same with it, as the calibration is.
    """

    detections: Detections
    known: Linearised
    left_out: LeaveOneOut
    base: str
    disagreement: Disagreement
    groups: Groups | None
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
    differ, groups = _agreement(richest, calibration)
    photographs = near_copies(calibration.detections)
    error = predicted_error(
        scatter,
        seen,
        distance=distance,
        richest=richest.scatter if richest.scatter is not scatter else None,
        poorer=richest.poorer,
        judged=calibration.camera,
        corners=pixels,
        copies=len(photographs) / (int(photographs.max()) + 1),
        differ_px=differ.by_px,
    )
    without = (own.left_out**2).sum(1) if own else richest.left_out.squares
    within = np.array([float(np.nansum(e**2)) for e in calibration.residuals()])
    return ReferenceFit(
        detections=richest.detections,
        known=richest.known,
        left_out=richest.left_out,
        base=richest.base,
        disagreement=differ,
        groups=groups,
        of_all=own.known if own and richest.detections is not calibration.detections else richest.known,
        error=error,
        own_left_out=without,
        own_squares=within,
    )


def _agreement(richest: RichestFit, calibration: Calibration) -> tuple[Disagreement, Groups | None]:
    """Whether the photographs agree on one camera, and if not, which of them belong together; where some of
    them do not agree, all are asked.
    """
    found = disagreement(richest.known, richest.detections)
    if (
        found.certain
        and richest.detections is not calibration.detections
        and (of_all := richest_of_all(calibration))
    ):
        richest = of_all
        found = disagreement(richest.known, richest.detections)
    if not found.certain:
        return found, None
    known = richest.known
    groups = two_groups(known, found, leave_one_out(known), richest.flat)
    return (with_spread(found, known, richest.detections) if groups else found), groups


def _distances(calibration: Calibration) -> Float[ndarray, " n"]:
    """Of every detected corner from the camera, metres, view after view."""
    points = calibration.detections.target.points
    pairs = zip(calibration.camera_from_target, calibration.detections.views, strict=True)
    return np.concatenate([np.linalg.norm(pose.apply(points[view.ids]), axis=1) for pose, view in pairs])
