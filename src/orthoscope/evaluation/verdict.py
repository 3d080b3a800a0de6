"""The verdict in plain words: what stands against trusting a calibration, and what to do about it.

Floor 4.  Sentences are made of findings, each with its number; the thresholds that turn a number into a sentence stand here and nowhere
else.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from orthoscope.evaluation.coverage import emptiest_place
from orthoscope.methods.calibration import Calibration
from orthoscope.methods.held_out import FEWEST_VIEWS, HeldOut
from orthoscope.solve.least_squares import Status

__all__ = ["Findings", "ViewError", "corners_beyond", "suspects_among", "verdict_on", "warnings_about"]

SUSPECT = 2.5  # times the typical view's rms: a view with more does not belong
NOTABLE = 0.3  # px: but not where it is small in itself
FEW_VIEWS = 8
SPARSE = 0.6  # of the frame
LEARNT = 0.5  # held-out error above the training error by this share of it: the photographs were learnt, not the camera


@dataclass(frozen=True, eq=False)
class ViewError:
    """One photograph's share: rms px per point in the calibration, and when it was held out (NaN where that was not done)."""

    image: str
    corners: int
    rms_px: float
    held_out_rms_px: float


class Findings(NamedTuple):
    """What was found out: held-out errors, share of the frame covered, views that do not belong and why, corners beyond the domain."""

    calibration: Calibration
    unseen: HeldOut
    coverage: float
    suspects: tuple[tuple[str, str], ...]
    beyond: int


def suspects_among(views: tuple[ViewError, ...]) -> tuple[tuple[str, str], ...]:
    """Views whose error, held out where that was done, is far above the typical view's."""
    errors = np.array([view.rms_px if np.isnan(view.held_out_rms_px) else view.held_out_rms_px for view in views])
    typical = float(np.median(errors))
    return tuple(
        (view.image, f"{error:.2f} px rms where a typical view has {typical:.2f}; look whether it is blurred, moving or another target")
        for view, error in zip(views, errors, strict=True)
        if error > max(SUSPECT * typical, NOTABLE)
    )


def corners_beyond(calibration: Calibration) -> int:
    """How many corners lie where the lens formula has ended before them."""
    points = calibration.detections.target.points
    views = zip(calibration.camera_from_target, calibration.detections.views, strict=True)
    seen = np.concatenate([pose.apply(points[view.ids]) for pose, view in views])
    return int(np.isnan(calibration.camera.project(seen)[:, 0]).sum())


def warnings_about(found: Findings) -> tuple[str, ...]:
    """Everything that a user should know before using the camera, a sentence each."""
    calibration, detections = found.calibration, found.calibration.detections
    views = len(detections.views)
    told = list(calibration.assumptions)
    if calibration.status != Status.CONVERGED:
        told.append(f"the solver {calibration.status}")
    if found.beyond:
        told.append(
            f"the lens formula folds over at {np.degrees(calibration.camera.lens.field_angle):.1f} degrees from the axis, "
            f"before {found.beyond} of {detections.corners} corners: "
            "it does not suit this lens there. Try another: --lens brown, rational or kannala_brandt"
        )
    if views < FEW_VIEWS:
        told.append(f"only {views} view{'s' if views > 1 else ''}; 15 or more, tilted in different directions, make the camera certain")
    if found.coverage < SPARSE:
        told.append(
            f"corners cover {100 * found.coverage:.0f} % of the frame; the lens is a guess elsewhere. Next, photograph the target "
            f"{emptiest_place(detections)}"
        )
    return (*told, *(f"{image} does not belong: {reason}" for image, reason in found.suspects))


def verdict_on(found: Findings) -> str:
    """One sentence: the error that counts, and whether anything stands against trusting it."""
    error, standard_error, trained = found.unseen.rms_px, found.unseen.standard_error_px, found.calibration.rms_px
    if np.isnan(error):
        few = len(found.unseen.residuals) < FEWEST_VIEWS
        why = "too few views to hold any out" if few else "without some of them, the others cannot tell the camera"
        on_its_own = f"{_px(trained)} px on its own photographs; nothing says how it does on others: {why}."
        return f"{on_its_own} Take more photographs before trusting it."
    places = _places(standard_error)
    size = (
        f"{error:.{places}f} ± {standard_error:.{places}f} px on photographs that were not used "
        f"({trained:.{places}f} px on those that were)"
    )
    if found.beyond:
        return f"Do not trust this lens formula: it folds over inside the data, though it shows {size}."
    if error - trained > max(LEARNT * trained, standard_error):
        return (
            f"Do not trust this camera yet: {size}: it has learnt these photographs, not the camera. "
            "Take more, or use a lens with fewer coefficients."
        )
    if found.suspects:
        return f"Look at {_listed([image for image, _ in found.suspects])} first; as it is, {size}."
    if found.coverage < SPARSE:
        return f"{size}, where corners were seen: {100 * found.coverage:.0f} % of the frame."
    return f"{size}; it holds over {100 * found.coverage:.0f} % of the frame."


def _places(deviation: float) -> int:
    """Decimals that show a standard error of less than 0.005 px too; never fewer than two, never more than four."""
    return int(np.clip(np.ceil(-np.log10(max(2.0 * deviation, 1e-9))), 2, 4))


def _px(value: float) -> str:
    return f"{value:.{_places(value)}f}"


def _listed(names: list[str]) -> str:
    return ", ".join(names[:3]) + (f" and {len(names) - 3} more" if len(names) > 3 else "")
