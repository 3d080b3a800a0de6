"""The models that the default method chooses among, each fitted once and judged on every view without it.

A model is a base formula, a shape of the target, a lens of step 1 and, where a formula is wanted, how it is
fitted: jointly (it is then the base itself, alone) or from the pairs of step 1.  What models share is fitted
once: the flat start of a base, step 1 for every formula from its pairs.  Each is judged by leaving one view
out after the other, by one linear step (leave_one_out.py): the order of the views cannot matter, and
no photograph is foreseen by so few others that another choice would have been right for them.
"""

from __future__ import annotations

from functools import cache, lru_cache

import numpy as np

from orthoscope.fitting.calibration import Calibration, corners_beyond
from orthoscope.fitting.slopes.linearised import Linearised
from orthoscope.fitting.unseen.leave_one_out import LeaveOneOut, leave_one_out
from orthoscope.fitting.unseen.near_copies import near_copies
from orthoscope.fitting.unseen.scatter import Scatter, scatter_of
from orthoscope.geometry.arrays import CalibrationError, Float, ndarray
from orthoscope.methods.decoupled.fitters import Fitter, Kept
from orthoscope.methods.decoupled.model import JOINT, PAIRS, Model
from orthoscope.methods.decoupled.model_selection import NEGLIGIBLE_SQUARE, Contender
from orthoscope.methods.decoupled.step_one_linearised import linearised
from orthoscope.methods.decoupled.step_two import formula_from_pairs
from orthoscope.methods.decoupled.step_two_linearised import PairsLeftOut
from orthoscope.models.camera import Camera
from orthoscope.solve.least_squares import Status
from orthoscope.targets.detections import Detections

__all__ = ["JOINT", "PAIRS", "Candidates", "Model"]


class Candidates:
    """Models fitted to the same photographs, each when it is asked for, and once.

    Args:
        detections: views that belong.
        skew: whether K has one.
        fitter: how they are fitted; each from nothing and to the last digit by default.
    """

    def __init__(self, detections: Detections, *, skew: bool, fitter: Fitter | None = None) -> None:
        self.detections, self._skew = detections, skew
        self._photographs = near_copies(detections)
        self._fitter = fitter or Kept(detections, skew=skew)
        of_some = self._fitter.of_some if isinstance(self._fitter, Kept) else None
        self.of_some = (
            self
            if of_some is None or of_some is self._fitter
            else Candidates(of_some.detections, skew=skew, fitter=of_some)
        )
        self.flat, self.step_one = cache(self._fitter.flat), cache(self._fitter.step_one)
        # Large, of many views; what is asked for of one model is asked for together.
        self.linearised = lru_cache(maxsize=1)(self._linearised)
        self.left_out = lru_cache(maxsize=1)(self._left_out)
        self.from_pairs, self.scatter = cache(self._from_pairs), cache(self._scatter)
        self.residuals = cache(self._residuals)

    def contender(self, model: Model) -> Contender:
        """The model with its squared held-out residuals; NaN in views where the others cannot tell, or in all
        where it cannot be fitted.
        """
        try:
            squares = (self.residuals(model) ** 2).sum(1)
        except CalibrationError:
            squares = np.full(len(self.detections.views), np.nan)
        return Contender(model.base, model.shape, model.lens, model.fit, squares)

    def stands(self, model: Model) -> bool:
        """Whether the model's fit ended at a minimum, its lens formula not before any corner."""
        try:
            fit = self.step_one(model.step_one)
        except CalibrationError:
            return False
        points = fit.problem.corners(fit.estimate)
        return fit.status == Status.CONVERGED and not corners_beyond(
            fit.estimate.camera, fit.poses, points, self.detections
        )

    def _residuals(self, model: Model) -> Float[ndarray, "m n"]:
        """Of each view by the model without it, as in `LeaveOneOut`.

        Raises:
            CalibrationError: the model cannot be fitted.
        """
        if model.formula:
            return self.from_pairs(model).residuals
        fit = self.linearised(model)
        # Without noise nothing holds back what one view alone decides, and nothing has to: it is exact.
        return fit.errors if fit.noise < NEGLIGIBLE_SQUARE else self.left_out(model).residuals

    def fits(self, calibration: Calibration) -> bool:
        """Whether these are the fits of a calibration's own photographs."""
        same = calibration.detections is self.detections
        return same and bool(calibration.settings.get("skew", False)) == self._skew

    def camera(self, model: Model) -> tuple[Camera, tuple[str, ...]]:
        """The model's camera, and the names of its parameters that were fitted.

        Raises:
            CalibrationError: the views cannot tell them.
        """
        fit = self.step_one(model.step_one)
        return (
            formula_from_pairs(fit, model.formula)
            if model.formula
            else (fit.estimate.camera, fit.problem.free)
        )

    def _linearised(self, model: Model) -> Linearised:
        return linearised(self.step_one(model))

    def _left_out(self, model: Model) -> LeaveOneOut:
        return leave_one_out(self.linearised(model), self._photographs)

    def _scatter(self, model: Model) -> Scatter:
        """How the model's camera scatters."""
        if model.formula:
            return self.from_pairs(model).scatter()
        return scatter_of(self.linearised(model), self.left_out(model), self.detections.target.points)

    def _from_pairs(self, model: Model) -> PairsLeftOut:
        first = model.step_one
        camera, free = self.camera(model)
        return PairsLeftOut(self.step_one(first), self.linearised(first), self.left_out(first), camera, free)
