"""The verdict: how good a calibration is, in numbers and in sentences.

Floor 4.
"""

from __future__ import annotations

from dataclasses import dataclass

from orthoscope.geometry.arrays import ndarray
from orthoscope.methods.calibration import Calibration

__all__ = ["Evaluation", "ViewError"]


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

    rms_px, median_px: over the corners it was made from.  held_out_rms_px: over all corners, each from a fold that did not use its
    photograph; held_out_error_px: its standard error over views.  nce: of held-out views where there are any, else of the training views.
    coverage: share of the image's area where corners were seen.  suspects: views and why they do not belong.  warnings, verdict: sentences.
    held_out_residuals: one array (n,2) for each view, NaN where not done.
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
