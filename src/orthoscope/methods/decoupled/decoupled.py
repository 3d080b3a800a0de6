"""The default method: pin-hole and lens decoupled, the paper's idea made well posed.

The paper corrects detected corners by what perspective alone demands and fits any lens formula to (distorted,
corrected) pairs; its eq. (7) leaves the camera open, since nothing ties the views together. What ties them is
that one lens and one target made them all:
0. corners and views that do not belong are named and left out (outliers.py);
1. poses, the target's shape and a lens that no formula limits, together, their weights found (step_one.py,
   evidence.py);
2. a lens formula, or the free lens itself, from the pairs of step 1 (step_two.py). Which target shape, which
   lens: the simplest that is as good as the best on photographs that were not used (fold_fits.py,
   model_selection.py). The figures behind each choice: docs/decoupled.md.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import NamedTuple

import numpy as np

from orthoscope.fitting.calibration import Calibration, Candidate, Uncertainty
from orthoscope.fitting.held_out import FEWEST_VIEWS, folds_of_views
from orthoscope.fitting.resection import resect
from orthoscope.geometry.arrays import InputError
from orthoscope.methods.decoupled.fold_fits import FoldFit
from orthoscope.methods.decoupled.model_selection import (
    Contender,
    judged,
    richest_unless_worse,
    simplest_as_good,
)
from orthoscope.methods.decoupled.step_one import FORMULA, StepOneFit, fit_step_one
from orthoscope.methods.decoupled.step_two import by_simplicity, formula_from_pairs
from orthoscope.methods.fccm import fccm
from orthoscope.methods.outliers.outliers import without_outliers
from orthoscope.models.lenses import FREE, parse_lens
from orthoscope.models.target_shape import SHAPES
from orthoscope.targets.detections import Detections
from orthoscope.version import __version__

__all__ = ["decoupled"]

AUTO = "auto"
# what a candidate's lens is called after step 2, since step 1 may have tried the same formula
FROM_PAIRS = "from pairs"
TOO_FEW = (
    f"fewer than {FEWEST_VIEWS} views cannot be judged by views that were not used; where nothing else was"
    " asked for, the target is taken to be as it is said to be, and the lens to follow its formula"
)

Progress = Callable[[int, int], None]


class _Plan(NamedTuple):
    """What is left to choose: target shapes and lenses of step 1, formulas of step 2 (None: step 1's own
    lens), each simplest first.
    """

    shapes: tuple[str, ...]
    through: tuple[str, ...]
    formulas: tuple[str | None, ...]


def decoupled(
    detections: Detections,
    *,
    lens: str = AUTO,
    target: str = AUTO,
    base: str = AUTO,
    through: str = AUTO,
    among: Sequence[str] = (),
    skew: bool = False,
    folds: int = 5,
    judging: Progress | None = None,
) -> Calibration:
    """Calibrate with the target's shape estimated and a lens that no formula limits; then, where one is
    wanted, fit a lens formula.

    lens: a name of LENSES (with the coefficients to free, `brown:k1,k2`), `free`, or `auto`: the free lens,
    or out of the names in `among` the simplest that foresees views not used as well as the best. target:
    `flat`, `smooth`, `free` or `auto`. base: the formula under the free lens; `auto` takes brown, or
    kannala_brandt for wide views. through: the lens of step 1, `free`, `formula` (the base alone) or `auto`.
    folds: of the views, to judge by. judging: called with (fits done, fits to do). Raises CalibrationError
    where the views cannot tell the camera, InputError for a setting that is none.
    """
    plan = _plan(lens, target, through, among)
    flat = fccm(without_outliers(detections, lens=base), lens=base, skew=skew)
    used, base, assumptions = flat.detections, flat.settings["lens"], flat.assumptions
    candidates: tuple[Candidate, ...] = ()
    if len(used.views) < FEWEST_VIEWS and max(map(len, plan)) > 1:
        plan = _Plan(plan.shapes[:1], plan.through[:1], plan.formulas[:1])
        assumptions = (*assumptions, TOO_FEW)
    elif max(map(len, plan)) > 1:
        fold_fits = [
            FoldFit(used, part, base=base, skew=skew) for part in folds_of_views(len(used.views), folds)
        ]
        plan, candidates = _choose(fold_fits, used, plan, base, judging)
    shape, through, formula = plan.shapes[0], plan.through[0], plan.formulas[0]
    fit = fit_step_one(flat, target=shape, through=through)
    settings = {
        "lens": formula or (FREE if through == FREE else base),
        "target": shape,
        "base": base,
        "through": through,
        "skew": skew,
    }
    return _calibration(fit, used, settings, assumptions, candidates, flat.steps)


def _plan(lens: str, target: str, through: str, among: Sequence[str]) -> _Plan:
    """What the settings leave open.

    Raises InputError for a setting that is none.
    """
    if target not in (AUTO, *SHAPES):
        raise InputError(
            f"target shape {target!r} is not known; expected one of {AUTO}, {', '.join(SHAPES)}."
        )
    if through not in (AUTO, FREE, FORMULA):
        raise InputError(
            f"through is {through!r}; expected 'free' (a free lens in step 1), 'formula' (its base alone) or"
            " 'auto'."
        )
    if lens == FREE and through == FORMULA:
        raise InputError(
            "lens is 'free' and through is 'formula'; expected one of the two. A free lens comes through a"
            " free lens."
        )
    formulas = tuple(name for name in (among if lens == AUTO else (lens,)) if name != FREE)
    for name in formulas:
        parse_lens(name)
    lenses_of_step_one = (FREE,) if lens == FREE else (FORMULA, FREE) if through == AUTO else (through,)
    return _Plan(
        SHAPES if target == AUTO else (target,), lenses_of_step_one, by_simplicity(formulas) or (None,)
    )


def _choose(
    fold_fits: Sequence[FoldFit], used: Detections, plan: _Plan, base: str, progress: Progress | None
) -> tuple[_Plan, tuple[Candidate, ...]]:
    """Step 1's shape first, with its base alone, which is quick; then its lens for that shape; then the
    formula for both.
    """
    corners = np.array([len(view.ids) for view in used.views], dtype=float)
    formulas = plan.formulas if len(plan.formulas) > 1 else ()
    to_do = len(fold_fits) * (len(plan.shapes) + len(plan.through) - 1 + len(formulas))
    done = 0

    def contender(shape: str, through: str, formula: str | None = None) -> Contender:
        nonlocal done
        squares = np.full(len(corners), np.nan)
        for fold_fit in fold_fits:
            squares[fold_fit.part] = fold_fit.squares(shape, through, formula)
            done += 1
            if progress:
                progress(done, to_do)
        return Contender(
            shape, f"{formula} {FROM_PAIRS}" if formula else FREE if through == FREE else base, squares
        )

    tried = [contender(shape, plan.through[0]) for shape in plan.shapes]
    taken = richest_unless_worse(tried, corners)
    shape, through, formula = (
        plan.shapes[taken],
        plan.through[0],
        None if formulas else next(iter(plan.formulas)),
    )
    if len(plan.through) > 1:
        tried.append(contender(shape, plan.through[1]))
        if richest_unless_worse([tried[taken], tried[-1]], corners):
            taken, through = len(tried) - 1, plan.through[1]
    if formulas:
        of_formulas = [contender(shape, through, formula) for formula in formulas]
        best = simplest_as_good(of_formulas, corners)
        formula, taken, tried = formulas[best], len(tried) + best, [*tried, *of_formulas]
    return _Plan((shape,), (through,), (formula,)), judged(tried, corners, taken)


def _calibration(
    fit: StepOneFit,
    used: Detections,
    settings: dict,
    assumptions: tuple[str, ...],
    candidates: tuple[Candidate, ...],
    steps: int,
) -> Calibration:
    """Step 2, poses to match, and what is known about the camera."""
    own = settings["lens"] == (FREE if settings["through"] == FREE else settings["base"])
    if own:
        camera, names, covariance, parameters = (
            fit.estimate.camera,
            fit.problem.free,
            fit.covariance,
            fit.evidence.parameters,
        )
    else:
        camera, names = formula_from_pairs(fit, settings["lens"])
        covariance, parameters = fit.with_formula(camera, names)
    shape = fit.shape
    return Calibration(
        camera=camera,
        camera_from_target=resect(camera, used, shape=shape),
        detections=used,
        method="decoupled",
        settings=settings,
        uncertainty=Uncertainty(names, covariance),
        status=fit.status,
        steps=steps + fit.steps,
        version=__version__,
        assumptions=assumptions,
        target_shape=shape,
        parameters=parameters,
        candidates=candidates,
        free_camera=fit.estimate.camera if settings["through"] == FREE and not own else None,
    )
