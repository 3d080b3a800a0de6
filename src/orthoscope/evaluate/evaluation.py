"""The verdict: how good a calibration is, in numbers and in sentences.

Floor 4.  Numbers first (rms, held-out error, NCE, coverage, views that do not belong), then what they mean for someone who wants to use the camera.
"""

from __future__ import annotations

from collections.abc import Callable
from concurrent.futures import Executor
from dataclasses import dataclass
from functools import partial

import numpy as np

from orthoscope.evaluate.metrics import corners_by_cell, lateral_errors, normalised_calibration_error
from orthoscope.geometry.arrays import InputError, ndarray
from orthoscope.geometry.target import Detections
from orthoscope.methods import METHODS
from orthoscope.methods.calibration import Calibration, residuals_of, rms
from orthoscope.methods.held_out import HeldOut, held_out
from orthoscope.methods.resection import resect
from orthoscope.methods.screening import screened
from orthoscope.models.camera import Camera

__all__ = ["Evaluation", "UnseenError", "ViewError", "evaluate", "evaluate_on"]

SUSPECT = 2.5  # times the typical view's rms: a view with more does not belong
NOTABLE = 0.3  # px: but not where it is small in itself
FEW_VIEWS = 8
SPARSE = 0.6  # of the frame


@dataclass(frozen=True, eq=False)
class ViewError:
    """One photograph's share: rms px per point in the calibration, and when it was held out (NaN where that was not done)."""

    image: str
    corners: int
    rms_px: float
    held_out_rms_px: float


@dataclass(frozen=True, eq=False)
class Evaluation:
    """What `evaluate` finds out about a calibration.

    rms_px, median_px, largest_px: of |residual| over the corners it was made from.  held_out_rms_px: over all corners, each from a fold that did
    not use its photograph; held_out_error_px: its standard error over views; NaN where there were too few views.  nce: of held-out views where there
    are any, else of the training views.  coverage: share of the frame's cells (metrics.COVERAGE_GRID) where corners were seen.  suspects: views and why they do not
    belong.  warnings: sentences.  verdict: one sentence.  held_out_residuals: one array (n,2) for each view, NaN where not done.
    """

    calibration: Calibration
    rms_px: float
    median_px: float
    largest_px: float
    held_out_rms_px: float
    held_out_error_px: float
    nce: float
    coverage: float
    views: tuple[ViewError, ...]
    held_out_residuals: tuple[ndarray, ...]
    suspects: tuple[tuple[str, str], ...]
    warnings: tuple[str, ...]
    verdict: str


@dataclass(frozen=True, eq=False)
class UnseenError:
    """Error of a camera on photographs it was not made from: rms_px per point, of each view too; nce; the detections that could be used."""

    detections: Detections
    rms_px: float
    view_rms_px: tuple[float, ...]
    nce: float


def evaluate_on(camera: Camera, detections: Detections) -> UnseenError:
    """The error of a camera on other photographs: the camera stays fixed, the pose of each view is fitted.

    Raises InputError where the photographs are of another size than the camera's, CalibrationError where no view can be used.
    """
    if tuple(detections.image_size) != tuple(camera.image_size):
        (width, height), (w, h) = detections.image_size, camera.image_size
        raise InputError(f"these photographs are {width}x{height}; the camera was calibrated at {w}x{h}. Hand in photographs of that size.")
    used = screened(detections)
    poses = resect(camera, used)
    residuals = residuals_of(camera, poses, used)
    estimated, observed = lateral_errors(camera, poses, used)
    nce = normalised_calibration_error(estimated, observed, camera.intrinsics) if len(observed) else float("nan")
    return UnseenError(used, rms(np.concatenate(residuals)), tuple(rms(e) for e in residuals), nce)


def evaluate(
    calibration: Calibration,
    *,
    folds: int = 5,
    executor: Executor | None = None,
    progress: Callable[[int, int], None] | None = None,
) -> Evaluation:
    """Judge a calibration by photographs it has not seen, by its residuals and by what its views cover.

    folds: of views; the calibration's own method is called again on each (docs/conventions.md).  executor, progress: as in `held_out`.
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
    coverage = float((corners_by_cell(detections) > 0).mean())
    suspects = _suspects(views)
    warnings = (
        *calibration.assumptions,
        *_of_solver(calibration),
        *_of_lens(calibration),
        *_of_views(calibration, coverage),
        *(f"{image} does not belong: {reason}" for image, reason in suspects),
    )
    return Evaluation(
        calibration=calibration,
        rms_px=rms(np.concatenate(residuals)),
        median_px=float(np.median(sizes)),
        largest_px=float(sizes.max()),
        held_out_rms_px=unseen.rms_px,
        held_out_error_px=unseen.standard_error_px,
        nce=_nce(calibration, unseen),
        coverage=coverage,
        views=views,
        held_out_residuals=unseen.residuals,
        suspects=suspects,
        warnings=warnings,
        verdict=_verdict(calibration, unseen, coverage, suspects, warnings),
    )


def _nce(calibration: Calibration, unseen: HeldOut) -> float:
    """NCE over the views that were held out; over the training views where none was."""
    detections = calibration.detections
    total, corners = 0.0, 0
    for i, view in enumerate(detections.views):
        camera, pose = unseen.cameras[i], unseen.camera_from_target[i]
        if camera is not None and pose is not None:
            estimated, observed = lateral_errors(camera, (pose,), detections.only([i]))
            if len(observed):
                total += len(observed) * normalised_calibration_error(estimated, observed, camera.intrinsics)
            corners += len(observed)
    if corners:
        return total / corners
    estimated, observed = lateral_errors(calibration.camera, calibration.camera_from_target, detections)
    return normalised_calibration_error(estimated, observed, calibration.camera.intrinsics) if len(observed) else float("nan")


def _suspects(views: tuple[ViewError, ...]) -> tuple[tuple[str, str], ...]:
    """Views whose error, held out where that was done, is far above the typical view's."""
    errors = np.array([view.rms_px if np.isnan(view.held_out_rms_px) else view.held_out_rms_px for view in views])
    typical = float(np.median(errors))
    return tuple(
        (view.image, f"{error:.2f} px rms where a typical view has {typical:.2f}; look whether it is blurred, moving or another target")
        for view, error in zip(views, errors, strict=True)
        if error > max(SUSPECT * typical, NOTABLE)
    )


def _of_solver(calibration: Calibration) -> tuple[str, ...]:
    return () if calibration.status == "converged" else (f"the solver {calibration.status}",)


def _of_lens(calibration: Calibration) -> tuple[str, ...]:
    """Whether the formula ends before the corners or the frame do."""
    camera, detections = calibration.camera, calibration.detections
    points = detections.target.points
    seen = np.concatenate(
        [pose.apply(points[view.ids]) for pose, view in zip(calibration.camera_from_target, detections.views, strict=True)]
    )
    blind = int(np.isnan(camera.project(seen)[:, 0]).sum())
    if blind:
        return (
            f"the lens formula folds over at {np.degrees(camera.lens.field_angle):.1f} degrees from the axis, before {blind} of {len(seen)} corners: "
            "it does not suit this lens there. Try another: --lens brown, rational or kannala_brandt",
        )
    return ()


def _of_views(calibration: Calibration, coverage: float) -> tuple[str, ...]:
    """What the set of views lacks, and which photograph to take next."""
    views = len(calibration.detections.views)
    found = []
    if views < FEW_VIEWS:
        found.append(f"only {views} view{'s' if views > 1 else ''}; 15 or more, tilted in different directions, make the camera certain")
    if coverage < SPARSE:
        found.append(
            f"corners cover {100 * coverage:.0f} % of the frame; the lens is a guess elsewhere. Next, photograph the target "
            f"{_emptiest_place(calibration)}"
        )
    return tuple(found)


def _emptiest_place(calibration: Calibration) -> str:
    """The ninth of the frame with the fewest corners, in words."""
    counts = corners_by_cell(calibration.detections, (3, 3))
    row, column = np.unravel_index(int(np.argmin(counts)), counts.shape)
    down, across = ("at the top", "in the middle", "at the bottom")[row], ("left", "", "right")[column]
    return " ".join(word for word in (down, across) if word)


def _verdict(
    calibration: Calibration, unseen: HeldOut, coverage: float, suspects: tuple[tuple[str, str], ...], warnings: tuple[str, ...]
) -> str:
    """One sentence: the error that counts, and whether anything stands against trusting it."""
    error, standard_error = unseen.rms_px, unseen.standard_error_px
    trained = rms(np.concatenate(calibration.residuals()))
    if np.isnan(error):
        return (
            f"{trained:.2f} px on its own photographs; nothing says how it does on others: too few views to hold any out. "
            "Take more photographs before trusting it."
        )
    size = f"{error:.2f} ± {standard_error:.2f} px on photographs that were not used ({trained:.2f} px on those that were)"
    over = (error - trained) / trained if trained > 0 else 0.0
    if any("folds over" in warning for warning in warnings):
        return f"Do not trust this lens formula: it folds over inside the data, though it shows {size}."
    if over > 0.5 and error - trained > standard_error:
        return f"Do not trust this camera yet: {size}: it has learnt these photographs, not the camera. Take more, or use a lens with fewer coefficients."
    if suspects:
        return f"Look at {_listed([image for image, _ in suspects])} first; as it is, {size}."
    if coverage < SPARSE:
        return f"{size}, where corners were seen: {100 * coverage:.0f} % of the frame."
    return f"{size}; it holds over {100 * coverage:.0f} % of the frame."


def _listed(names: list[str]) -> str:
    return ", ".join(names[:3]) + (f" and {len(names) - 3} more" if len(names) > 3 else "")
