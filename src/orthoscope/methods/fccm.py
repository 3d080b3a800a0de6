"""Full calibration (FCCM), the paper's first peer: pin-hole, lens and poses in one least-squares problem.

Steps as in Zhang's section 3, for any lens of LENSES, partial boards and lenses past 90 degrees
(initial_camera.py):
1. a homography for each view; 2. K in closed form, or an equidistant lens; 3. poses; 4. everything together,
   Levenberg-Marquardt. Steps 1 to 3 and the first part of 4 look at a sample of each view's corners: most of
   the way is gone for a fraction of the work. Z. Zhang, A flexible new technique for camera calibration,
   TPAMI 22(11), 2000.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import replace
from functools import lru_cache, partial

import numpy as np

from orthoscope.fitting.board_order import in_one_order
from orthoscope.fitting.calibration import Calibration
from orthoscope.fitting.identifiability import check_enough, check_known, told
from orthoscope.fitting.observations import Observations
from orthoscope.fitting.reprojection import Estimate, Reprojection
from orthoscope.fitting.starts.initial_camera import (
    Assumptions,
    StartingCameras,
    starts,
    starts_elsewhere,
    suited_lens,
)
from orthoscope.fitting.usable_views import with_usable_views
from orthoscope.geometry.arrays import CalibrationError, InputError
from orthoscope.machine.blas import with_one_thread
from orthoscope.methods.mldc.lens_about_centre import parse_centred_lens
from orthoscope.methods.own_centre import CENTRE_OPEN, with_own_centre
from orthoscope.models.lenses.table import parse_lens
from orthoscope.solve.block_system import shared_covariance
from orthoscope.solve.least_squares import Options, Solution, Status, solve
from orthoscope.solve.losses import LOSSES, USUAL_SCALE, Loss
from orthoscope.targets.detections import Detections, View
from orthoscope.targets.target import Target
from orthoscope.version import __version__

__all__ = ["fccm", "fit_flat"]

AUTO = "auto"
# Of a million numbers' cost this share is 1e-4 of one's variance: nothing known moves by 1 % of its
# deviation.
COST_TOLERANCE = 1e-10
# So many corners of each view are enough to come near the minimum.
SAMPLE_CORNERS = 64
# The sample's fit need not be exact.
ROUGH_OPTIONS = Options(max_steps=50, tolerance=1e-3, trusting=True)
# A sample of the corners tells so many of a lens's coefficients, the first; a denominator's would start in a
# valley of the sample's own.
FIRM_COEFFICIENTS = 5
# An rms below this share of the diagonal is a minimum worth having; above it the other start is tried too.
ADEQUATE_SHARE = 0.003
# So many steps speak of a flat valley, and where corners are few there are often others.
LONG_WALK_STEPS = 25
# Corners are few up to this number.
FEW_CORNERS = 2000
# No camera has pixels that are so many times longer than wide.
MOST_ASPECT_RATIO = 1.1


@with_one_thread
def fccm(
    detections: Detections,
    *,
    lens: str = AUTO,
    own_centre: bool = False,
    skew: bool = False,
    loss: str = "linear",
    loss_scale: float = USUAL_SCALE,
    max_steps: int = 200,
    progress: Callable[[int, float], None] | None = None,
) -> Calibration:
    """Calibrate pin-hole, lens and poses jointly (Zhang's full calibration; the paper's FCCM).

    Args:
        detections: of any target.
        lens: a name of LENSES, or with the coefficients to free, `brown:k1,k2`; `auto` takes brown, or
            kannala_brandt for wide views.
        own_centre: whether the lens stands about a centre of its own instead of the principal point
            (own_centre.py); decentering then is free only where it is named.
        skew: whether K has one.
        loss: a name of LOSSES, how large errors count.
        loss_scale: where the loss starts to matter, pixels.
        max_steps: of the solver.
        progress: called after each step with (step, cost).
    Raises:
        CalibrationError: the views cannot tell the camera.
        InputError: a setting is none.
    """
    return in_one_order(
        fit_flat(
            detections,
            lens=lens,
            own_centre=own_centre,
            skew=skew,
            loss=loss,
            loss_scale=loss_scale,
            max_steps=max_steps,
            progress=progress,
        )
    )


def fit_flat(
    detections: Detections,
    *,
    lens: str = AUTO,
    own_centre: bool = False,
    skew: bool = False,
    loss: str = "linear",
    loss_scale: float = USUAL_SCALE,
    max_steps: int = 200,
    progress: Callable[[int, float], None] | None = None,
) -> Calibration:
    """`fccm` with the corners of every view listed as they came; settings as there."""
    if loss not in LOSSES:
        raise InputError(f"loss {loss!r} is not known; expected one of {', '.join(LOSSES)}.")
    used = with_usable_views(detections)
    observations, bases = _starting(used.views, used.target, used.image_size, skew)
    narrowing, sample = bases.narrowing, bases.observations
    lens = suited_lens(bases) if lens == AUTO else lens
    kind, coefficients = (parse_centred_lens if own_centre else parse_lens)(lens)
    free = (*narrowing.free, *coefficients)
    check_enough(used, free)
    cost, options = (
        LOSSES[loss](loss_scale),
        Options(max_steps=max_steps, tolerance=COST_TOLERANCE, trusting=True, progress=progress),
    )
    estimates: Iterable[Estimate] = starts(bases, kind, coefficients=coefficients)
    if sample is not observations:
        estimates = map(partial(_nearer, bases=bases, free=free, loss=cost), estimates)
    solution = _best(estimates, observations, used, free, cost, options)
    if len(used.views) > 2 and _is_doubtful(solution, bases):
        elsewhere = starts_elsewhere(bases, kind, coefficients)
        more = map(partial(_nearer, bases=bases, free=free, loss=cost), elsewhere)
        solution = _best(more, observations, used, free, cost, options, best=solution)
    centred = None
    if own_centre:
        centred = with_own_centre(
            solution.unknowns,
            observations,
            used.target.points,
            narrowing.free,
            coefficients,
            loss=cost,
            options=options,
        )
    steps, (solution, free) = solution.steps, centred or (solution, free)
    covariance = shared_covariance(solution.sums, 2 * used.corners)
    check_known(solution, free, covariance, used)
    uncertainty, left_open = told(free, covariance)
    return Calibration(
        camera=solution.unknowns.camera,
        camera_from_target=observations.poses_in_order(solution.unknowns.poses),
        detections=used,
        method="fccm",
        settings={
            "lens": lens,
            "own_centre": own_centre,
            "skew": skew,
            "loss": loss,
            "loss_scale": loss_scale,
            "max_steps": max_steps,
        },
        uncertainty=uncertainty,
        status=solution.status.value,
        steps=steps + solution.steps if centred else steps,
        version=__version__,
        assumptions=(
            *narrowing.assumptions,
            *((CENTRE_OPEN,) if own_centre and not centred else ()),
            *left_open,
        ),
    )


@lru_cache(maxsize=2)
def _starting(
    views: tuple[View, ...], target: Target, image_size: tuple[int, int], skew: bool
) -> tuple[Observations, StartingCameras]:
    """The views' corners, and where a calibration of them starts, whatever its lens: who tries several lenses
    asks for it several times.
    """
    observations = Observations.of(Detections(target, image_size, views))
    narrowing = Assumptions.of(len(views), skew=skew)
    sample = observations.thinned(SAMPLE_CORNERS)
    return observations, StartingCameras(sample, target.points, image_size, narrowing)


def _nearer(start: Estimate, *, bases: StartingCameras, free: tuple[str, ...], loss: Loss) -> Estimate:
    """A start brought near the minimum on the bases' sample of corners, with the parameters that it tells."""
    firm = [name for name in free if name not in start.camera.lens.names()[FIRM_COEFFICIENTS:]]
    return solve(
        Reprojection(bases.observations, bases.points, start.camera, firm),
        start,
        loss=loss,
        options=ROUGH_OPTIONS,
    ).unknowns


def _is_doubtful(solution: Solution[Estimate], bases: StartingCameras) -> bool:
    """Whether there may be a better minimum elsewhere: pixels far from square, a principal point off the
    frame, or one that Zhang's closed form would put there.
    """
    K, (width, height) = solution.unknowns.camera.intrinsics, bases.image_size
    inside = 0.0 < K.cx < width and 0.0 < K.cy < height
    return (
        not inside
        or not 1.0 / MOST_ASPECT_RATIO < K.fx / K.fy < MOST_ASPECT_RATIO
        or bases.closed_form_is_off_the_frame
    )


def _best(
    estimates: Iterable[Estimate],
    observations: Observations,
    used: Detections,
    free: tuple[str, ...],
    loss: Loss,
    options: Options,
    *,
    best: Solution[Estimate] | None = None,
) -> Solution[Estimate]:
    """The joint refinement from the first start that ends well and without a long walk, or else the best of
    all; and of all of them, where one is known.
    """
    known, first = best, None
    enough = used.corners * float(loss.cost(np.array((ADEQUATE_SHARE * np.hypot(*used.image_size)) ** 2)))
    for estimate in estimates:
        first = first or estimate
        problem = Reprojection(observations, used.target.points, estimate.camera, free)
        solution = solve(problem, estimate, loss=loss, options=options)
        if (
            estimate.camera.lens.scaled_by
        ):  # at the minimum already: this only expresses it, and its covariance, by K's scale
            camera, poses = solution.unknowns
            scaled = solve(problem, Estimate(camera.with_unit_scale(), poses), loss=loss, options=options)
            solution = replace(scaled, steps=solution.steps + scaled.steps)
        if solution.status is not Status.NO_COST and (best is None or solution.cost < best.cost):
            best = solution
        ends_well = best is not None and best.cost < enough
        if ends_well and known is None and (solution.steps < LONG_WALK_STEPS or used.corners > FEW_CORNERS):
            break
    if best is None:
        assert first is not None, "there is a start"
        raise CalibrationError(_no_start(first, observations, used))
    return best


def _no_start(estimate: Estimate, observations: Observations, used: Detections) -> str:
    """What to say where no start leads anywhere: which views the likeliest one cannot see."""
    e = Reprojection(observations, used.target.points, estimate.camera).residuals(estimate)
    lost = np.sort(observations.order[np.isnan(e).any((1, 2))])
    names = ", ".join(used.views[i].image for i in lost[:5]) + (
        f" and {len(lost) - 5} more" if len(lost) > 5 else ""
    )
    return (
        f"no camera sees the target as it is in {names}: some of its corners would be behind the camera. "
        "Check the target's columns and rows and the order of the corners, or leave these photographs out."
    )
