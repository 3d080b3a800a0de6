"""Two ways to fit a model: to compare it with others, and to keep it.

What is compared starts from what was fitted before it and ends where the rest would change no choice. What is
kept starts from nothing, so that it is the same whatever it was compared with; of many photographs some are
fitted first, and all from there.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from functools import cache
from typing import Protocol

from orthoscope.fitting.calibration import Calibration
from orthoscope.methods.decoupled.model import Model
from orthoscope.methods.decoupled.representative import representative
from orthoscope.methods.decoupled.step_one import StepOneFit, fit_step_one, polished
from orthoscope.methods.fccm import fit_flat
from orthoscope.models.target_shape import SHAPES
from orthoscope.targets.detections import Detections

__all__ = ["Compared", "Fitter", "Kept", "some_of"]

# A choice needs no more than so many corners in views that are spread as widely as all.
CHOICE_CORNERS = 12000
# It needs so many views, however many corners they have.
CHOICE_VIEWS = 40
# A fit that is compared with others ends at this tolerance, a share of squared errors. At 1e-4 a formula with
# many coefficients was not yet where five views of a fisheye foretell each other worse, and was taken.
COMPARED_TOLERANCE = 1e-6


class Fitter(Protocol):
    """Fits models of step 1."""

    def flat(self, base: str, /) -> Calibration:
        """With a flat target and this formula.

        Raises CalibrationError where the views cannot tell them.
        """
        ...

    def step_one(self, model: Model) -> StepOneFit:
        """The fit; raises as `flat` does."""
        ...


def some_of(detections: Detections) -> Detections:
    """The views that a choice is made from, and a fit of all starts from; the same each time."""
    views = len(detections.views) * CHOICE_CORNERS // max(detections.corners, 1)
    return representative(detections, max(views, CHOICE_VIEWS))


class Compared:
    """Each model from the nearest that was fitted before.

    Args:
        detections: the views.
        skew: whether K has one.
        flats: calibrations of a flat target that are there already, by their base; those that are made here
            are put there too.
    """

    def __init__(self, detections: Detections, *, skew: bool, flats: dict[str, Calibration]) -> None:
        self.cold: dict[Model, StepOneFit] = {}
        self.flat = _flats(detections, skew, flats)
        self._fitted: dict[Model, StepOneFit] = {}

    def step_one(self, model: Model) -> StepOneFit:
        """Started from a richer one on the same base, and ended early.

        The first of a base starts from nothing: bases are compared by it, and what another base found is not
        neutral between them.
        """
        near = self._nearest(model)
        fit = _fit(self.flat(model.base), model, near)
        self._fitted[model] = fit
        if near is None:
            self.cold[model] = fit
        return fit

    def _nearest(self, model: Model) -> StepOneFit | None:
        richer = [
            fit
            for other, fit in self._fitted.items()
            if other.base == model.base and SHAPES.index(other.shape) >= SHAPES.index(model.shape)
        ]
        return richer[0] if richer else None


class Kept:
    """Each model from nothing and to the last digit.

    Args:
        detections, skew, flats: as of `Compared`.
        cold: fits that started from nothing, of `some_of` the views.

    Attributes:
        of_some: the same of `some_of` the views; itself where these are all.
    """

    def __init__(
        self,
        detections: Detections,
        *,
        skew: bool,
        flats: dict[str, Calibration] | None = None,
        cold: Mapping[Model, StepOneFit] | None = None,
    ) -> None:
        some, flats = some_of(detections), {} if flats is None else flats
        self.detections, self._cold = detections, dict(cold or {})
        self.flat = _flats(detections, skew, flats)
        self.of_some = self if some is detections else Kept(some, skew=skew, flats=flats, cold=cold)

    def step_one(self, model: Model) -> StepOneFit:
        """Some of the views first, then all."""
        cold = self.of_some.cold(model)
        if self.of_some is self:
            return polished(cold)
        return fit_step_one(self.flat(model.base), shape=model.shape, first_lens=model.first_lens, near=cold)

    def cold(self, model: Model) -> StepOneFit:
        """From nothing, and ended early."""
        if model not in self._cold:
            self._cold[model] = _fit(self.flat(model.base), model, None)
        return self._cold[model]


def _flats(detections: Detections, skew: bool, known: dict[str, Calibration]) -> Callable[[str], Calibration]:
    """Calibrations of a flat target by their base, each made once; those that are there already are taken
    where they are of these very views.
    """

    @cache
    def flat(base: str) -> Calibration:
        there = known.get(base)
        if there is not None and there.detections is detections:
            return there
        made = fit_flat(detections, lens=base, skew=skew)
        known.setdefault(base, made)
        return made

    return flat


def _fit(flat: Calibration, model: Model, near: StepOneFit | None) -> StepOneFit:
    return fit_step_one(
        flat, shape=model.shape, first_lens=model.first_lens, near=near, tolerance=COMPARED_TOLERANCE
    )
