"""The default method: pin-hole and lens decoupled, the paper's idea made well posed.

The paper corrects detected corners by what perspective alone demands and fits any lens formula to (distorted,
corrected) pairs; its eq. (7) leaves the camera open, since nothing ties the views together. What ties them is
that one lens and one target made them all:
0. corners and views that do not belong are named and left out (outliers.py), boards that look alike both ways
   up are listed one way (fitting/board_order.py);
1. poses, the target's shape and a lens that no formula limits, together, their weights found (step_one.py,
   evidence.py);
2. a lens formula, or the free lens itself, from the pairs of step 1 (step_two.py), or jointly.
Which base formula, which target shape, which lens, how it is fitted: by what views foresee that were left out
(candidates.py, model_selection.py). The figures behind each choice: docs/decoupled.md,
docs/measured/choice.md.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from orthoscope.fitting.board_order import in_one_order
from orthoscope.fitting.calibration import Calibration, Candidate, Uncertainty
from orthoscope.fitting.resection import resect
from orthoscope.fitting.unseen.held_out import FEWEST_VIEWS
from orthoscope.geometry.arrays import CalibrationError, InputError
from orthoscope.machine.blas import with_one_thread
from orthoscope.methods.decoupled.candidates import Candidates
from orthoscope.methods.decoupled.fitters import Compared, Kept, some_of
from orthoscope.methods.decoupled.model import BASES, JOINT, PAIRS, Model
from orthoscope.methods.decoupled.model_selection import (
    Contender,
    first_as_good,
    judged,
    richest_unless_worse,
    simplest_as_good,
)
from orthoscope.methods.decoupled.step_one import FORMULA
from orthoscope.methods.decoupled.step_two import by_simplicity
from orthoscope.methods.fccm import fit_flat
from orthoscope.methods.outliers.outliers import without_outliers
from orthoscope.models.lenses.table import FREE, parse_lens
from orthoscope.models.target_shape import SHAPES
from orthoscope.targets.detections import Detections
from orthoscope.version import __version__

__all__ = ["decoupled"]

AUTO = "auto"
TOO_FEW = (
    f"fewer than {FEWEST_VIEWS} views cannot be judged by views that were not used; where nothing else was"
    " asked for, the target is taken to be as it is said to be, and the lens to follow its formula"
)

Progress = Callable[[int, int], None]


class _Open(NamedTuple):
    """What the settings leave open: base formulas, in order of preference; target shapes and lenses of step
    1,
    formulas to end with (none: the lens of step 1), each simplest first; how such a formula may be fitted.
    """

    bases: tuple[str, ...]
    shapes: tuple[str, ...]
    first_lens: tuple[str, ...]
    formulas: tuple[str, ...]
    fits: tuple[str, ...]


@with_one_thread
def decoupled(
    detections: Detections,
    *,
    lens: str = AUTO,
    shape: str = AUTO,
    base: str = AUTO,
    first_lens: str = AUTO,
    fit: str = AUTO,
    formulas: Sequence[str] = (),
    skew: bool = False,
    judging: Progress | None = None,
) -> Calibration:
    """Calibrate with the target's shape estimated and a lens that no formula limits; then, where one is
    wanted, fit a lens formula.

    Args:
        lens: a name of LENSES (with the coefficients to free, `brown:k1,k2`), `free`, or `auto`: the lens of
            step 1, or out of the names in `formulas` the simplest that foresees views not used as well as the
            best.
        shape: of the target, `flat`, `smooth`, `free` or `auto`.
        base: the formula under the free lens; `auto` takes, of BASES, what foresees best.
        first_lens: of step 1, `free`, `formula` (the base alone) or `auto`.
        fit: of a formula, `joint` (with poses and target), `pairs` (to what step 1 found) or `auto`.
        judging: called with (models judged, models to judge).
    Raises:
        CalibrationError: the views cannot tell the camera.
        InputError: a setting is none.
    """
    left = _open(lens, shape, base, first_lens, fit, formulas)
    start = fit_flat(without_outliers(detections, lens=base), lens=base, skew=skew)
    ordered = in_one_order(start)
    used = ordered.detections
    # Only what was fitted to these very lists is what another call would fit.
    flats = {start.settings["lens"]: start} if ordered is start else {}
    fitter = Compared(some_of(used), skew=skew, flats=flats)
    candidates = Candidates(some_of(used), skew=skew, fitter=fitter)
    assumptions: tuple[str, ...] = ()
    if len(used.views) < FEWEST_VIEWS:
        model, told = _assumed(left, start), ()
        assumptions = (TOO_FEW,) if max(map(len, left)) > 1 else ()
    else:
        model, told = _chosen(candidates, left, judging)
    candidates = Candidates(used, skew=skew, fitter=Kept(used, skew=skew, flats=flats, compared=fitter))
    flat = candidates.flat(model.base)
    settings = {
        "lens": model.lens,
        "shape": model.shape,
        "base": model.base,
        "first_lens": model.first_lens,
        "fit": model.fit,
        "skew": skew,
    }
    return _calibration(candidates, model, settings, (*flat.assumptions, *assumptions), told)


def _open(lens: str, shape: str, base: str, first_lens: str, fit: str, formulas: Sequence[str]) -> _Open:
    """What the settings leave open.

    Raises:
        InputError: a setting is none, or two contradict each other.
    """
    if shape not in (AUTO, *SHAPES):
        raise InputError(f"target shape {shape!r} is not known; expected one of {AUTO}, {', '.join(SHAPES)}.")
    if first_lens not in (AUTO, FREE, FORMULA):
        raise InputError(
            f"first_lens is {first_lens!r}; expected 'free' (a free lens in step 1), 'formula' (its base"
            " alone) or 'auto'."
        )
    if fit not in (AUTO, JOINT, PAIRS):
        raise InputError(
            f"fit is {fit!r}; expected 'joint' (a formula with poses and target), 'pairs' (a formula to what"
            " step 1 found) or 'auto'."
        )
    if lens == FREE and first_lens == FORMULA:
        raise InputError(
            "lens is 'free' and first_lens is 'formula'; expected one of the two. A free lens comes through a"
            " free lens."
        )
    wanted = by_simplicity(name for name in (formulas if lens == AUTO else (lens,)) if name != FREE)
    for name in (*wanted, *(() if base == AUTO else (base,))):
        parse_lens(name)
    lenses_of_step_one = (FREE,) if lens == FREE else (FORMULA, FREE) if first_lens == AUTO else (first_lens,)
    return _Open(
        BASES if base == AUTO else (base,),
        SHAPES if shape == AUTO else (shape,),
        lenses_of_step_one,
        wanted,
        (JOINT, PAIRS) if fit == AUTO else (fit,),
    )


def _assumed(left: _Open, start: Calibration) -> Model:
    """The model for views that are too few to judge by: the simplest that the settings allow."""
    shape, first_lens, formula = left.shapes[0], left.first_lens[0], next(iter(left.formulas), None)
    if formula and JOINT in left.fits and first_lens == FORMULA:
        return Model(formula, shape, FORMULA)
    base = left.bases[0] if len(left.bases) == 1 else start.settings["lens"]
    return Model(base, shape, first_lens, formula)


def _chosen(
    candidates: Candidates, left: _Open, progress: Progress | None
) -> tuple[Model, tuple[Candidate, ...]]:
    """The base by the richest model on it; then that or the simplest; then the formula.

    Raises:
        CalibrationError: no base can be fitted.
    """
    corners = np.array([len(view.ids) for view in candidates.detections.views], dtype=float)
    tried: dict[Model, Contender] = {}
    of_base = [_ends(base, left)[-1] for base in left.bases]
    to_do = len(of_base) + len(_ends(left.bases[0], left)) - 1 + 2 * len(left.formulas)

    def judge(models: Sequence[Model]) -> list[Contender]:
        for model in models:
            if model not in tried:
                tried[model] = candidates.contender(model)
                if progress:
                    progress(min(len(tried), to_do), to_do)
        return [tried[model] for model in models]

    if len(of_base) > 1:
        fitting = [model for model in of_base if _can_be_fitted(candidates, model.base)] or of_base[:1]
        standing = _that_stand(judge(fitting), candidates, fitting)
        tried |= zip(fitting, standing, strict=True)
        base = fitting[first_as_good(standing, corners)].base
    else:
        base = left.bases[0]
    models = _ends(base, left)
    model = models[richest_unless_worse(judge(models), corners)] if len(models) > 1 else models[0]
    if left.formulas:
        models = _with_formulas(model, left)
        model = models[simplest_as_good(judge(models), corners)] if len(models) > 1 else models[0]
    if progress and tried:
        progress(to_do, to_do)
    listed = list(tried)
    told = judged(list(tried.values()), corners, listed.index(model)) if model in tried else ()
    return model, told


def _that_stand(
    contenders: Sequence[Contender], candidates: Candidates, models: Sequence[Model]
) -> list[Contender]:
    """The contenders; what is foreseen by a fit that was stopped on its way counts for nothing beside those
    that have arrived, since with other roundings it would be elsewhere; so does what is foreseen by a lens
    whose formula ends before some of the corners.
    """
    stand = [candidates.stands(model) for model in models]
    nothing = np.full_like(contenders[0].squares, np.nan)
    return [
        contender if stands or not any(stand) else replace(contender, squares=nothing)
        for contender, stands in zip(contenders, stand, strict=True)
    ]


def _ends(base: str, left: _Open) -> list[Model]:
    """The simplest model on a base and the richest, which holds all that are between: where less is enough,
    its weights, which are found, make it nearly that; one where nothing is left open.
    """
    ends = (Model(base, left.shapes[i], left.first_lens[i]) for i in (0, -1))
    return list(dict.fromkeys(ends))


def _can_be_fitted(candidates: Candidates, base: str) -> bool:
    try:
        candidates.flat(base)
    except CalibrationError:
        return False
    return True


def _with_formulas(model: Model, left: _Open) -> list[Model]:
    """The ways to end with a formula, simplest first, the target's shape as chosen: from pairs through the
    free lens where it is allowed; jointly where step 1 may do with a formula alone.
    """
    found: list[Model] = []
    for formula in left.formulas:
        if PAIRS in left.fits and (FREE in left.first_lens or formula != model.base):
            found.append(
                Model(model.base, model.shape, FREE if FREE in left.first_lens else FORMULA, formula)
            )
        if (
            JOINT in left.fits
            and FORMULA in left.first_lens
            and (len(left.bases) > 1 or formula in left.bases)
        ):
            found.append(Model(formula, model.shape, FORMULA))
    if not found:
        raise InputError(
            f"a formula cannot be fitted {' or '.join(left.fits)} with first_lens"
            f" {' or '.join(left.first_lens)}; expected fit 'joint' with first_lens 'formula', or fit"
            " 'pairs' with first_lens 'free'."
        )
    return found


def _calibration(
    candidates: Candidates,
    model: Model,
    settings: dict,
    assumptions: tuple[str, ...],
    told: tuple[Candidate, ...],
) -> Calibration:
    """The model's camera, poses to match, and what is known about them."""
    fit, used = candidates.step_one(model.step_one), candidates.detections
    camera, names = candidates.camera(model)
    scatter = candidates.scatter(model)
    k = len(names)
    shape = fit.shape
    return Calibration(
        camera=camera,
        camera_from_target=resect(camera, used, shape=shape, near=fit.poses),
        detections=used,
        method="decoupled",
        settings=settings,
        uncertainty=Uncertainty(names, scatter.parameters, scatter.repeated[:k, :k]),
        status=fit.status,
        steps=candidates.flat(model.base).steps + fit.steps,
        version=__version__,
        assumptions=assumptions,
        target_shape=shape,
        parameters=fit.with_formula(camera, names) if model.formula else fit.evidence.parameters,
        candidates=told,
        free_camera=fit.estimate.camera if model.first_lens == FREE and model.formula else None,
        variances=fit.evidence.variances,
        kept=candidates,
    )
