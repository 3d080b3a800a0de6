"""Metric lens calibration in two steps (MLDC), the paper's method.

Numbered as its section 3:
1. the pin-hole, and the corrected points q_p that fit it perfectly (3.1);
2. the lens from the pairs of detected and corrected points (q_d, q_p), about a centre of its own (3.2,
   lens_about_centre.py).

The paper finds q_p by minimising its eq. (7), which every pin-hole makes zero with points of its own
(eq7.py). So what step 1 gives is one member of that family, and `correct` says which:

    nearest   of all pin-hole images of the target the ones nearest to the detected points. It needs no
              eq. (7): they are the projections of the pin-hole that is fitted to the detections without any
              lens (eq. 4 with the points held)
    literal   where eq. (7), searched as the paper does from Zhang's closed form and the detections, comes to
              rest; it depends on the damping

Either pin-hole has taken up part of the lens, since nothing in step 1 knows of one, and step 2 does not give
it back: a lens moves pixels to and from its centre, while these pin-holes are off in other ways too.
docs/paper.md says what that costs.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import NamedTuple

import numpy as np

from orthoscope.fitting.calibration import Calibration, Uncertainty
from orthoscope.fitting.identifiability import check_known
from orthoscope.fitting.initial_camera import Assumptions, StartingCameras
from orthoscope.fitting.observations import Observations, Poses
from orthoscope.fitting.pinhole import fit_pinhole, pinhole_start
from orthoscope.fitting.reprojection import Estimate
from orthoscope.fitting.usable_views import with_usable_views
from orthoscope.geometry.arrays import Float, InputError, ndarray
from orthoscope.geometry.blas import with_one_thread
from orthoscope.methods.mldc.eq7 import Eq7
from orthoscope.methods.mldc.lens_about_centre import fit_centred_lens
from orthoscope.solve.least_squares import Options, Status, shared_covariance, solve
from orthoscope.solve.losses import LOSSES
from orthoscope.targets.detections import Detections
from orthoscope.version import __version__

__all__ = ["mldc"]

# px^2: a step that promises less ends the search of eq. (7), the points then "satisfy all template
# restrictions perfectly"
PERFECT = 1e-13


class Search(NamedTuple):
    """How step 1 searches: what `mldc` was asked for."""

    damping: float
    damp: str
    weights: Sequence[float]
    max_steps: int
    progress: Callable[[int, float], None] | None


class Corrected(NamedTuple):
    """Step 1's outcome: the pin-hole whose projections are the corrected points, how the search ended, which
    member it is (a sentence).
    """

    pinhole: Estimate
    status: Status
    steps: int
    member: str


@with_one_thread
def mldc(
    detections: Detections,
    *,
    correct: str = "nearest",
    lens: str = "pfet",
    damping: float = 1e-4,
    damp: str = "identity",
    weights: Sequence[float] = (1.0, 1.0, 1.0),
    skew: bool = False,
    loss: str = "linear",
    loss_scale: float = 1.0,
    max_steps: int = 200,
    progress: Callable[[int, float], None] | None = None,
) -> Calibration:
    """Calibrate the pin-hole with corrected points first, the lens from detected and corrected points then
    (the paper's MLDC).

    correct: `nearest` or `literal`, which of the members that eq. (7) allows. damping, damp, weights: of
    `literal` alone: the first lambda, what it multiplies (`identity` or `diagonal`), and how J_PH, J_CR and
    J_ST count. lens: a name of LENSES, or with the coefficients to free, `pfet:a1,a3`; `auto` is pfet. skew:
    whether K has one. loss, loss_scale: how step 2 counts large errors, a name of LOSSES and where it starts
    to matter, pixels. progress: called after each step with (step, cost), those of step 1 first. The result's
    assumptions say which member it is. It has no uncertainty: what step 1 leaves open shows in no residual.
    `literal` needs 8 (6 + 2n)^2 bytes a few times over for each view of n corners. Raises CalibrationError
    where the views cannot tell the pin-hole, InputError for a setting that is none.
    """
    if correct not in CORRECTIONS:
        raise InputError(f"correct is {correct!r}; expected one of {', '.join(CORRECTIONS)}.")
    if loss not in LOSSES:
        raise InputError(f"loss {loss!r} is not known; expected one of {', '.join(LOSSES)}.")
    used = with_usable_views(detections)
    narrowing = Assumptions.of(len(used.views), skew=skew)
    bases = StartingCameras(Observations.of(used), used.target.points, used.image_size, narrowing)
    corrected = CORRECTIONS[correct](bases, used, Search(damping, damp, weights, max_steps, progress))  # 1
    pinhole, poses = corrected.pinhole
    weighing, options = LOSSES[loss](loss_scale), Options(max_steps=max_steps, progress=progress)
    fit = fit_centred_lens(
        *_pairs(bases, poses), pinhole=pinhole, lens=lens, loss=weighing, options=options
    )  # 2
    return Calibration(
        camera=fit.unknowns,
        camera_from_target=bases.observations.poses_in_order(poses),
        detections=used,
        method="mldc",
        settings={
            "correct": correct,
            "lens": lens,
            "damping": damping,
            "damp": damp,
            "weights": [float(weight) for weight in weights],
            "skew": skew,
            "loss": loss,
            "loss_scale": loss_scale,
            "max_steps": max_steps,
        },
        uncertainty=Uncertainty((), np.empty((0, 0))),
        status=next(
            (status for status in (corrected.status, fit.status) if status is not Status.CONVERGED),
            Status.CONVERGED,
        ).value,
        steps=corrected.steps + fit.steps,
        version=__version__,
        assumptions=(corrected.member, *narrowing.assumptions),
    )


def _pairs(bases: StartingCameras, poses: Poses) -> tuple[Float[ndarray, "n 3"], Float[ndarray, "n 2"]]:
    """The rays of all corners, which K takes to the corrected points, and where the corners were detected."""
    observations = bases.observations
    present = observations.present > 0
    points = bases.points[observations.ids] @ np.swapaxes(poses.rotation, 1, 2) + poses.translation[:, None]
    return points[present], observations.pixels()[present]


def _nearest(bases: StartingCameras, used: Detections, search: Search) -> Corrected:
    """The pin-hole nearest to the detections."""
    options = Options(max_steps=search.max_steps, progress=search.progress)
    solution = fit_pinhole(bases, options=options)
    check_known(solution, bases.narrowing.free, shared_covariance(solution.sums, 2 * used.corners), used)
    member = (
        "corrected points: of all the pin-hole images of the target, which satisfy eq. (7) alike, those"
        " nearest to the detected corners; the pin-hole that makes them has taken up part of the lens"
    )
    return Corrected(solution.unknowns, solution.status, solution.steps, member)


def _literal(bases: StartingCameras, used: Detections, search: Search) -> Corrected:
    """Where the search of eq. (7) comes to rest."""
    start = pinhole_start(bases)
    problem = Eq7(bases.observations, used.target, bases.narrowing.free, weights=search.weights)
    options = Options(
        search.max_steps, floor=PERFECT, damping=search.damping, damp=search.damp, progress=search.progress
    )
    solution = solve(problem, problem.start(start, bases.observations), options=options)
    member = (
        f"corrected points: where eq. (7), J = {solution.cost:.1g}, came to rest from Zhang's closed form"
        f" with {search.damp} damping {search.damping:g}; every pin-hole has points that make J zero, and"
        " another damping ends at another"
    )
    return Corrected(solution.unknowns.pinhole, solution.status, solution.steps, member)


CORRECTIONS: dict[str, Callable[[StartingCameras, Detections, Search], Corrected]] = {
    "nearest": _nearest,
    "literal": _literal,
}
