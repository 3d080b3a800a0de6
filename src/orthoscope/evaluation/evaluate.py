"""How good a calibration is: its numbers, and the verdict that is made of them.

The error that counts is that of the camera (camera_error.py). Held-out error is the check on it, and cannot
see what all photographs share: a target or a formula that is wrong, which the misfit tests find, and
photographs that do not agree on one camera.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from concurrent.futures import Executor
from dataclasses import dataclass, replace

import numpy as np

from orthoscope.evaluation.camera_error import CameraError
from orthoscope.evaluation.coverage import share_covered
from orthoscope.evaluation.disagreement import AGREED, Disagreement
from orthoscope.evaluation.groups import Groups
from orthoscope.evaluation.metrics import nce_of
from orthoscope.evaluation.misfit.misfit import Misfit, misfit
from orthoscope.evaluation.reference_fit import reference_fit
from orthoscope.evaluation.suspects import ViewError
from orthoscope.evaluation.unseen_views import in_folds, in_turn
from orthoscope.evaluation.verdict.facts import Findings, situation_of
from orthoscope.evaluation.verdict.situation import NOTHING_KNOWN, Situation
from orthoscope.evaluation.verdict.verdict import Verdict, verdict_on
from orthoscope.fitting.board_order import listed_as_known
from orthoscope.fitting.calibration import Calibration, residuals_of, rms
from orthoscope.fitting.disc_centres import at_disc_centres, has_outlines
from orthoscope.fitting.fits import Fits
from orthoscope.fitting.resection import resect
from orthoscope.fitting.unseen.held_out import USUAL_FOLDS
from orthoscope.fitting.usable_views import with_usable_views
from orthoscope.geometry.arrays import Bool, Float, InputError, median, ndarray
from orthoscope.geometry.numbers import with_error
from orthoscope.machine.blas import with_one_thread
from orthoscope.methods import check_settings
from orthoscope.methods.decoupled.fits import fits_of
from orthoscope.models.camera import Camera
from orthoscope.models.image_size import check_image_size
from orthoscope.models.target_shape import TargetShape
from orthoscope.targets.detections import Detections

__all__ = ["Evaluation", "UnseenError", "ViewError", "evaluate", "evaluate_on", "examine"]


@dataclass(frozen=True, eq=False)
class Evaluation:
    """What `evaluate` finds out about a calibration.

    Attributes:
        calibration: that was evaluated.
        rms_px, median_px, largest_px: of |residual| over the corners that it was made from.
        held_out_rms_px: over all corners, each by a camera that did not use its photograph; NaN where there
            were too few.
        held_out_error_px: its standard error over photographs.
        nce: of held-out photographs where there are any, else of those that were used.
        misfit: of the target and of the lens (misfit.py).
        coverage: share of the frame's cells where corners were seen (coverage.py).
        views: what each photograph's error is.
        held_out_residuals: one array (n,2) for each photograph, NaN where not done.
        suspects: photographs that do not belong, with what is wrong.
        warnings: what else should be known, a sentence each.
        verdict: the grade, what limits it, and what to do.
        error: how far off the camera is (camera_error.py); None where nothing tells.
        disagreement: whether the photographs agree on one camera (disagreement.py).
        groups: of photographs of two cameras; None where there is one.
        situation: the facts that the verdict is made from.
        folds: in how many parts the views were held out; 0 for each photograph in its turn.
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
    verdict: Verdict
    error: CameraError | None = None
    disagreement: Disagreement = AGREED
    groups: Groups | None = None
    situation: Situation = NOTHING_KNOWN
    folds: int = 0

    def __repr__(self) -> str:
        held_out = with_error(self.held_out_rms_px, self.held_out_error_px)
        told = f"{self.verdict.grade}, rms {self.rms_px:.3g} px, held out {held_out} px"
        return f"Evaluation({told})\n  {self.verdict}"

    def trusted(self, pixels: Float[ndarray, "n 2"]) -> Bool[ndarray, " n"]:
        """Which places of the image lie where the camera may be used; none where nothing tells how far off it
        is.

        Args:
            pixels: (n,2) of the camera's image.
        """
        return self.error.trusted(pixels) if self.error else np.zeros(len(pixels), dtype=bool)


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
    """The error of a camera on other photographs: the camera stays fixed, the pose of each view is fitted. A
    board that looks the same upside down is taken from the end that its shape fits.

    Args:
        shape: of the target, where it is known and these photographs show the same one.
    Raises:
        InputError: the photographs are of another size than the camera's.
        CalibrationError: no view can be used.
    """
    check_image_size(camera, detections.image_size)
    used = listed_as_known(camera, with_usable_views(detections), shape)
    poses = resect(camera, used, shape=shape)
    if has_outlines(used):
        used = at_disc_centres(used, camera, poses, [view.image for view in used.views], shape=shape)
        poses = resect(camera, used, shape=shape)
    residuals = residuals_of(camera, poses, used, shape=shape)
    nce = nce_of(camera, poses, used, shape=shape)
    return UnseenError(used, rms(np.concatenate(residuals)), tuple(rms(e) for e in residuals), nce)


@with_one_thread
def evaluate(
    calibration: Calibration,
    *,
    folds: int | None = None,
    executor: Executor | None = None,
    progress: Callable[[int, int], None] | None = None,
) -> Evaluation:
    """Judge a calibration by photographs it has not seen, by its residuals and by what its views cover.

    Args:
        calibration: of any method.
        folds: of views, the calibration's own method called again without each; by default each photograph is
            left out in its turn by one linear step, where the method has one, and there are five folds where
            not (unseen_views.py).
        executor, progress: of the folds, as in `held_out`.
    Raises:
        InputError: the calibration's method or a setting is none, or folds are fewer than two.
    """
    if not isinstance(calibration, Calibration):
        raise InputError(
            f"what is to be judged is a {type(calibration).__name__}; expected a calibration. A camera alone"
            " is judged on photographs: orthoscope.evaluate_on(camera, detections), or check_camera."
        )
    check_settings(calibration.method, calibration.settings)
    misfits = misfit(calibration)  # before the fits, which take as much room
    fits, residuals = fits_of(calibration), calibration.residuals()
    if folds is None and fits.own is not None:
        unseen = in_turn(calibration, fits.own.left_out)
    else:
        unseen = in_folds(calibration, folds or USUAL_FOLDS, executor=executor, progress=progress)
    sizes = np.concatenate([np.hypot(*e.T) for e in residuals])
    views = tuple(
        ViewError(view.image, len(view.ids), rms(e), rms(e_unseen))
        for view, e, e_unseen in zip(calibration.detections.views, residuals, unseen.residuals, strict=True)
    )
    found = _findings(calibration, fits, views, misfits)
    situation = situation_of(found)
    return Evaluation(
        calibration=calibration,
        rms_px=rms(np.concatenate(residuals)),
        median_px=median(sizes),
        largest_px=float(sizes.max()),
        held_out_rms_px=unseen.rms_px,
        held_out_error_px=unseen.error_px,
        nce=_trained_nce(calibration) if math.isnan(unseen.nce) else unseen.nce,
        misfit=found.misfit,
        coverage=share_covered(calibration),
        views=views,
        held_out_residuals=unseen.residuals,
        suspects=situation.suspects,
        warnings=calibration.assumptions,
        verdict=verdict_on(situation),
        error=found.reference.error if found.reference else None,
        disagreement=replace(found.disagreement, wishes=None),
        groups=found.groups,
        situation=situation,
        folds=unseen.folds,
    )


def examine(calibration: Calibration) -> Findings:
    """What tests find out about a calibration, whatever was held out."""
    nothing = float("nan")
    pairs = zip(calibration.detections.views, calibration.residuals(), strict=True)
    views = tuple(ViewError(view.image, len(view.ids), rms(e), nothing) for view, e in pairs)
    return _findings(calibration, fits_of(calibration), views, misfit(calibration))


def _findings(
    calibration: Calibration, fits: Fits, views: tuple[ViewError, ...], misfits: Misfit
) -> Findings:
    reference = reference_fit(calibration, fits)
    return Findings(calibration, views, misfits, reference)


def _trained_nce(calibration: Calibration) -> float:
    """NCE over the views that the calibration was made from."""
    return nce_of(
        calibration.camera,
        calibration.camera_from_target,
        calibration.detections,
        shape=calibration.target_shape,
    )
