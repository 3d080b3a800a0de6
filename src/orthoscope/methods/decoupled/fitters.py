"""Two ways to fit a model: to compare it with others, and to keep it.

Either starts from nothing but a flat target, so that it is the same whatever it is compared with. What is
compared ends where the rest would change no choice; what is kept goes on from there, and of many photographs
from a fit of some to one of all.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import cache
from typing import Protocol

from orthoscope.fitting.calibration import Calibration
from orthoscope.methods.decoupled.model import Model
from orthoscope.methods.decoupled.representative import representative
from orthoscope.methods.decoupled.step_one import StepOneFit, fit_step_one, polished
from orthoscope.methods.fccm import fit_flat
from orthoscope.solve.least_squares import Options
from orthoscope.targets.detections import Detections

__all__ = ["COMPARED", "Compared", "Fitter", "Kept", "some_of"]

# A choice needs no more than so many corners in views that are spread as widely as all.
CHOICE_CORNERS = 12000
# It needs so many views, however many corners they have.
CHOICE_VIEWS = 40
# A fit that is compared with others ends at this tolerance, a share of squared errors: at 1e-4 a formula with
# many coefficients was not yet where five views of a fisheye foretell each other worse, and was taken. What
# is still on its way after so many steps has coefficients that the photographs do not tell.
COMPARED = Options(tolerance=1e-6, max_steps=25)


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
    """Each model once, ended early.

    Args:
        detections: the views.
        skew: whether K has one.
        flats: calibrations of a flat target that are there already, by their base; those that are made here
            are put there too.
    """

    def __init__(
        self, detections: Detections, *, skew: bool, flats: dict[str, Calibration] | None = None
    ) -> None:
        self.flat = _flats(detections, skew, {} if flats is None else flats)
        self.step_one = cache(self._step_one)

    def _step_one(self, model: Model) -> StepOneFit:
        flat, (_, shape, first_lens, _) = self.flat(model.base), model
        return fit_step_one(flat, shape=shape, first_lens=first_lens, ending=COMPARED)


class Kept:
    """Each model to the last digit.

    Args:
        detections, skew, flats: as of `Compared`.
        compared: the fits of `some_of` the views that are there already.

    Attributes:
        of_some: the same of `some_of` the views; itself where these are all.
    """

    def __init__(
        self,
        detections: Detections,
        *,
        skew: bool,
        flats: dict[str, Calibration] | None = None,
        compared: Compared | None = None,
    ) -> None:
        some, flats = some_of(detections), {} if flats is None else flats
        self.detections, self.flat = detections, _flats(detections, skew, flats)
        self._compared = compared or Compared(some, skew=skew, flats=flats)
        self.of_some = (
            self if some is detections else Kept(some, skew=skew, flats=flats, compared=self._compared)
        )

    def step_one(self, model: Model) -> StepOneFit:
        """Some of the views first, then all."""
        fit = self._compared.step_one(model)
        if self.of_some is self:
            return polished(fit)
        return fit_step_one(self.flat(model.base), shape=model.shape, first_lens=model.first_lens, near=fit)


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
