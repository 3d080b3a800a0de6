"""A calibration without some of the views, and how well it foresees them, for many target shapes and lenses
at once.

What candidates share is done once: the flat start for all of them, step 1 for all lenses of one target shape.
"""

from __future__ import annotations

from functools import cache, cached_property

import numpy as np

from orthoscope.fitting.calibration import Calibration, residuals_of
from orthoscope.fitting.resection import resect
from orthoscope.geometry.arrays import CalibrationError, Float, Int, ndarray
from orthoscope.methods.decoupled.step_one import StepOneFit, fit_step_one
from orthoscope.methods.decoupled.step_two import formula_from_pairs
from orthoscope.methods.fccm import fccm
from orthoscope.targets.detections import Detections

__all__ = ["FoldFit"]


class FoldFit:
    """part: indices of the views that are to be foreseen; base, skew: of the flat start."""

    def __init__(self, detections: Detections, part: Int[ndarray, " f"], *, base: str, skew: bool) -> None:
        self.part, self._base, self._skew = part, base, skew
        self._others = detections.only(np.setdiff1d(np.arange(len(detections.views)), part))
        self._tested = detections.only(part)
        self.step_one = cache(self._step_one)

    @cached_property
    def _flat(self) -> Calibration:
        return fccm(self._others, lens=self._base, skew=self._skew)

    def _step_one(self, shape: str, through: str) -> StepOneFit:
        return fit_step_one(self._flat, target=shape, through=through)

    def squares(self, shape: str, through: str, lens: str | None = None) -> Float[ndarray, " f"]:
        """Of each view of the part the sum of its squared residuals, px^2; NaN where the others cannot tell
        the camera.

        shape, through: of step 1.  lens: the formula of step 2; by default step 1's camera is taken as it is.
        """
        try:
            fit = self.step_one(shape, through)
            camera = formula_from_pairs(fit, lens)[0] if lens else fit.estimate.camera
            poses = resect(camera, self._tested, shape=fit.shape)
        except CalibrationError:
            return np.full(len(self.part), np.nan)
        return np.array([(e * e).sum() for e in residuals_of(camera, poses, self._tested, shape=fit.shape)])
