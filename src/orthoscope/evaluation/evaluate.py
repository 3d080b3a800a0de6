"""How good a calibration is: its numbers, and the sentences that verdict.py makes of them.

The error that counts is that of photographs which were held out; rms, NCE, coverage and the views that do not
belong stand beside it. What held-out photographs cannot show, a target or a formula that is wrong in all of
them, the misfit tests find.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from concurrent.futures import Executor
from dataclasses import dataclass
from functools import partial

import numpy as np

from orthoscope.evaluation.coverage import share_covered
from orthoscope.evaluation.metrics import held_out_nce, lateral_errors, normalised_calibration_error
from orthoscope.evaluation.misfit.misfit import Misfit, misfit
from orthoscope.evaluation.verdict import (
    Findings,
    ViewError,
    corners_beyond,
    suspects_among,
    verdict_on,
    warnings_about,
)
from orthoscope.fitting.calibration import Calibration, residuals_of, rms
from orthoscope.fitting.held_out import HeldOut, held_out
from orthoscope.fitting.resection import resect
from orthoscope.fitting.usable_views import with_usable_views
from orthoscope.geometry.arrays import InputError, ndarray
from orthoscope.geometry.blas import with_one_thread
from orthoscope.methods import METHODS
from orthoscope.models.camera import Camera
from orthoscope.models.target_shape import TargetShape
from orthoscope.targets.detections import Detections

__all__ = ["Evaluation", "UnseenError", "ViewError", "evaluate", "evaluate_on"]


@dataclass(frozen=True, eq=False)
class Evaluation:
    """What `evaluate` finds out about a calibration.

    rms_px, median_px, largest_px: of |residual| over the corners it was made from. held_out_rms_px: over all
    corners, each from a fold that did not use its photograph; held_out_error_px: its standard error over
    views; NaN where there were too few views. nce: of held-out views where there are any, else of the
    training views. misfit: of the target and of the lens (misfit.py). coverage: share of the frame's cells
    where corners were seen (coverage.py). suspects: views and why they do not belong. warnings: sentences.
    verdict: one sentence. held_out_residuals: one array (n,2) for each view, NaN where not done.
    """

    calibration: Calibration
    rms_px: float
    median_px: float
    largest_px: float
    held_out_rms_px: float
    held_out_error_px: float
    nce: float
    misfit: Misfit
    coverage: float
    views: tuple[ViewError, ...]
    held_out_residuals: tuple[ndarray, ...]
    suspects: tuple[tuple[str, str], ...]
    warnings: tuple[str, ...]
    verdict: str


@dataclass(frozen=True, eq=False)
class UnseenError:
    """Error of a camera on photographs it was not made from: rms_px per point, of each view too; nce; the
    detections that could be used.
    """

    detections: Detections
    rms_px: float
    view_rms_px: tuple[float, ...]
    nce: float


@with_one_thread
def evaluate_on(camera: Camera, detections: Detections, *, shape: TargetShape | None = None) -> UnseenError:
    """The error of a camera on other photographs: the camera stays fixed, the pose of each view is fitted.

    shape: of the target, where it is known and these photographs show the same one. Raises InputError where
    the photographs are of another size than the camera's, CalibrationError where no view can be used.
    """
    if tuple(detections.image_size) != tuple(camera.image_size):
        (width, height), (w, h) = detections.image_size, camera.image_size
        raise InputError(
            f"these photographs are {width}x{height}; the camera was calibrated at {w}x{h}. Hand in"
            " photographs of that size."
        )
    used = with_usable_views(detections)
    poses = resect(camera, used, shape=shape)
    residuals = residuals_of(camera, poses, used, shape=shape)
    estimated, observed = lateral_errors(camera, poses, used, shape=shape)
    nce = (
        normalised_calibration_error(estimated, observed, camera.intrinsics)
        if len(observed)
        else float("nan")
    )
    return UnseenError(used, rms(np.concatenate(residuals)), tuple(rms(e) for e in residuals), nce)


@with_one_thread
def evaluate(
    calibration: Calibration,
    *,
    folds: int = 5,
    executor: Executor | None = None,
    progress: Callable[[int, int], None] | None = None,
) -> Evaluation:
    """Judge a calibration by photographs it has not seen, by its residuals and by what its views cover.

    folds: of views; the calibration's own method is called again on each (docs/conventions.md). executor,
    progress: as in `held_out`.
    """
    detections = calibration.detections
    refit = partial(METHODS[calibration.method], **calibration.settings)
    unseen = held_out(detections, refit, folds=folds, executor=executor, progress=progress)
    residuals = calibration.residuals()
    sizes = np.concatenate([np.hypot(*e.T) for e in residuals])
    views = tuple(
        ViewError(view.image, len(view.ids), rms(e), rms(e_unseen))
        for view, e, e_unseen in zip(detections.views, residuals, unseen.residuals, strict=True)
    )
    found = Findings(
        calibration,
        unseen,
        misfit(calibration),
        share_covered(calibration),
        suspects_among(views),
        corners_beyond(calibration),
    )
    return Evaluation(
        calibration=calibration,
        rms_px=rms(np.concatenate(residuals)),
        median_px=float(np.median(sizes)),
        largest_px=float(sizes.max()),
        held_out_rms_px=unseen.rms_px,
        held_out_error_px=unseen.standard_error_px,
        nce=_nce(calibration, unseen),
        misfit=found.misfit,
        coverage=found.coverage,
        views=views,
        held_out_residuals=unseen.residuals,
        suspects=found.suspects,
        warnings=warnings_about(found),
        verdict=verdict_on(found),
    )


def _nce(calibration: Calibration, unseen: HeldOut) -> float:
    """NCE over the views that were held out; over the training views where none was."""
    detections = calibration.detections
    if not math.isnan(nce := held_out_nce(unseen, detections)):
        return nce
    estimated, observed = lateral_errors(
        calibration.camera, calibration.camera_from_target, detections, shape=calibration.target_shape
    )
    return (
        normalised_calibration_error(estimated, observed, calibration.camera.intrinsics)
        if len(observed)
        else float("nan")
    )
