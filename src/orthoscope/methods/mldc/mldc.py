"""Metric lens calibration in two steps (MLDC), the paper's method.

Numbered as its section 3:
1. the pin-hole, and the corrected points q_p that fit it perfectly (3.1);
2. the lens from the pairs of detected and corrected points (q_d, q_p), about a centre of its own (3.2,
   lens_about_centre.py).

The paper finds q_p by minimising its eq. (7), which every pin-hole makes zero with points of its own
(eq7.py). So what step 1 gives is one member of that family, and `correct` says which:

    repeated        the pin-hole with which the lens of step 2 meets the detections best: both steps again and
                    again until nothing changes (repeated.py). The paper does not describe a repetition; its
                    introduction says that corrected points give an accurate pin-hole once the distortion is
                    known
    repeated-plain  the same with the pin-hole fitted in the straight image, as one reads it at first; slow,
                    and not safe for wide lenses (repeated_plain.py)
    nearest         of all pin-hole images of the target the ones nearest to the detected points. It needs no
                    eq. (7): they are the projections of the pin-hole that is fitted to the detections without
                    any lens
    literal         where eq. (7), searched as the paper does from Zhang's closed form and the detections,
                    comes to rest; it depends on the damping

With the last two the pin-hole has taken up part of the lens, since nothing in step 1 knows of one, and step 2
does not give it back: a lens moves pixels to and from its centre, while these pin-holes are off in other ways
too. docs/paper.md says what that costs.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from contextlib import suppress
from typing import NamedTuple

import numpy as np

from orthoscope.fitting.calibration import Calibration, Uncertainty
from orthoscope.fitting.identifiability import check_known, told
from orthoscope.fitting.observations import Observations
from orthoscope.fitting.reprojection import Estimate
from orthoscope.fitting.starts.initial_camera import Assumptions, StartingCameras
from orthoscope.fitting.starts.pinhole import fit_pinhole, pinhole_start
from orthoscope.fitting.usable_views import with_usable_views
from orthoscope.geometry.arrays import CalibrationError, InputError
from orthoscope.machine.blas import with_one_thread
from orthoscope.methods.fccm import fccm
from orthoscope.methods.mldc.eq7 import Eq7
from orthoscope.methods.mldc.lens_about_centre import CENTRE, fit_centred_lens
from orthoscope.methods.mldc.pairs import pairs_of
from orthoscope.methods.mldc.repeated import Rounds, joint_parameters, repeat
from orthoscope.methods.mldc.repeated_plain import repeat_plainly
from orthoscope.methods.own_centre import centre_is_told
from orthoscope.solve.block_system import shared_covariance
from orthoscope.solve.least_squares import Options, Solution, Status, solve
from orthoscope.solve.losses import LOSSES, USUAL_SCALE, Loss
from orthoscope.targets.detections import Detections
from orthoscope.version import __version__

__all__ = ["mldc"]

# A step that promises less, px^2, ends the search of eq. (7): the points then "satisfy all template
# restrictions perfectly".
COST_FLOOR = 1e-13
# An rms that is more than this many times what the full calibration leaves is a wrong minimum, or a formula
# that cannot follow the lens.
WRONG_RATIO = 1.3
NO_CLOSED_FORM = "a camera with a lens that was fitted to the corners, which have no closed form,"


class Search(NamedTuple):
    """What `mldc` was asked for, but for which points."""

    lens: str
    damping: float
    damp: str
    weights: Sequence[float]
    rounds: int
    loss: Loss
    max_steps: int
    progress: Callable[[int, float], None] | None


class Found(NamedTuple):
    """What both steps found.

    Attributes:
        estimate: the camera, and the poses whose projections by its pin-hole are the corrected points.
        status: how it ended, a sentence.
        steps: of the solver, or rounds.
        said: which points these are, and what the user should know, sentences.
        uncertainty: of the camera; of nothing where step 1 leaves open what shows in no residual.
    """

    estimate: Estimate
    status: str
    steps: int
    said: tuple[str, ...]
    uncertainty: Uncertainty = Uncertainty((), np.empty((0, 0)))


@with_one_thread
def mldc(
    detections: Detections,
    *,
    correct: str = "repeated",
    lens: str = "pfet",
    damping: float = 1e-4,
    damp: str = "identity",
    weights: Sequence[float] = (1.0, 1.0, 1.0),
    skew: bool = False,
    loss: str = "linear",
    loss_scale: float = USUAL_SCALE,
    rounds: int = 60,
    max_steps: int = 200,
    progress: Callable[[int, float], None] | None = None,
) -> Calibration:
    """Calibrate the pin-hole with corrected points, the lens from detected and corrected points (the paper's
    MLDC).

    The result's assumptions say which corrected points these are. `literal` needs 8 (6 + 2n)^2 bytes a few
    times over for each view of n corners.

    Args:
        detections: of a target with rows and columns for `literal`, of any else.
        correct: `repeated`, `repeated-plain`, `nearest` or `literal`: which of the members that eq. (7)
            allows.
        lens: a name of LENSES, or with the coefficients to free, `pfet:a1,a3`; `auto` is pfet.
        damping: of `literal`, the first lambda.
        damp: of `literal`, what lambda multiplies, `identity` or `diagonal`.
        weights: of `literal`, how J_PH, J_CR and J_ST count.
        skew: whether K has one.
        loss: how large errors count, in both steps of `repeated` and in step 2 of the others; a name of
            LOSSES.
        loss_scale: where the loss starts to matter, pixels.
        rounds: of `repeated` and `repeated-plain`, at most so many.
        max_steps: of each least-squares search.
        progress: called after each step or round with (number, cost).
    Raises:
        CalibrationError: the views cannot tell the pin-hole.
        InputError: a setting is none.
    """
    if correct not in CORRECTIONS:
        raise InputError(f"correct is {correct!r}; expected one of {', '.join(CORRECTIONS)}.")
    if loss not in LOSSES:
        raise InputError(f"loss {loss!r} is not known; expected one of {', '.join(LOSSES)}.")
    if rounds < 1:
        raise InputError(f"rounds is {rounds}; expected 1 or more.")
    used = with_usable_views(detections)
    narrowing = Assumptions.of(len(used.views), skew=skew)
    bases = StartingCameras(Observations.of(used), used.target.points, used.image_size, narrowing)
    search = Search(lens, damping, damp, weights, rounds, LOSSES[loss](loss_scale), max_steps, progress)
    found = CORRECTIONS[correct](bases, used, search)
    return Calibration(
        camera=found.estimate.camera,
        camera_from_target=bases.observations.poses_in_order(found.estimate.poses),
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
            "rounds": rounds,
            "max_steps": max_steps,
        },
        uncertainty=found.uncertainty,
        status=found.status,
        steps=found.steps,
        version=__version__,
        assumptions=(*found.said, *narrowing.assumptions),
    )


def _pinhole(bases: StartingCameras, used: Detections, search: Search) -> Solution[Estimate]:
    """The pin-hole nearest to the detections."""
    solution = fit_pinhole(bases, options=Options(max_steps=search.max_steps, progress=search.progress))
    check_known(solution, bases.narrowing.free, shared_covariance(solution.sums, 2 * used.corners), used)
    return solution


def _once(
    bases: StartingCameras, pinhole: Estimate, ended: tuple[Status, int], member: str, search: Search
) -> Found:
    """Step 2 on the pairs that a step 1 gives, and no more."""
    options = Options(max_steps=search.max_steps, progress=search.progress)
    fit = fit_centred_lens(
        *pairs_of(bases, pinhole.poses),
        pinhole=pinhole.camera,
        lens=search.lens,
        loss=search.loss,
        options=options,
    )
    status = next((one for one in (ended[0], fit.status) if one is not Status.CONVERGED), Status.CONVERGED)
    return Found(Estimate(fit.unknowns, pinhole.poses), status.value, ended[1] + fit.steps, (member,))


def _nearest(bases: StartingCameras, used: Detections, search: Search) -> Found:
    """Of the pin-hole nearest to the detections."""
    pinhole = _pinhole(bases, used, search)
    member = (
        "corrected points: of all the pin-hole images of the target, which satisfy eq. (7) alike, those"
        " nearest to the detected corners; the pin-hole that makes them has taken up part of the lens"
    )
    return _once(bases, pinhole.unknowns, (pinhole.status, pinhole.steps), member, search)


def _literal(bases: StartingCameras, used: Detections, search: Search) -> Found:
    """Where the search of eq. (7) comes to rest."""
    start = pinhole_start(bases)
    problem = Eq7(bases.observations, used.target, bases.narrowing.free, weights=search.weights)
    options = Options(
        search.max_steps, floor=COST_FLOOR, damping=search.damping, damp=search.damp, progress=search.progress
    )
    solution = solve(problem, problem.start(start, bases.observations), options=options)
    where = "Zhang's closed form" if bases.pinhole is not None else NO_CLOSED_FORM
    member = (
        f"corrected points: where eq. (7), J = {solution.cost:.1g}, came to rest from {where} with"
        f" {search.damp}"
        f" damping {search.damping:g}; every pin-hole has points that make J zero, and another damping ends"
        " at"
        " another"
    )
    return _once(bases, solution.unknowns.pinhole, (solution.status, solution.steps), member, search)


def _repeated(bases: StartingCameras, used: Detections, search: Search) -> Found:
    """Of both steps, repeated."""
    nearest = _pinhole(bases, used, search)

    def rounds(*, staged: bool) -> Rounds:
        return repeat(
            bases,
            nearest.unknowns,
            search.lens,
            rounds=search.rounds,
            loss=search.loss,
            staged=staged,
            progress=search.progress,
        )

    found, usual = rounds(staged=False), _usual_cost(used, search)
    if not found.ended.settled or found.folds or found.cost > WRONG_RATIO**2 * usual:
        with suppress(CalibrationError):
            found = min((found, rounds(staged=True)), key=lambda ended: (ended.folds, ended.cost))
    free = joint_parameters(bases.narrowing.free, search.lens).names
    covariance = shared_covariance(found.sums, 2 * used.corners)
    check_known(Solution(found.estimate, found.sums, 0, Status.CONVERGED), free, covariance, used)
    uncertainty, left_open = told(free, covariance)
    sigma = float(np.sqrt(found.cost / max(2 * used.corners - len(free) - 6 * len(used.views), 1)))
    said = ["corrected points: of the pin-hole with which the lens of step 2 meets the detected corners best"]
    if CENTRE[0] in free and not centre_is_told(found.estimate.camera, free, covariance, sigma):
        said.append(
            "the views do not tell the distortion centre: the lens is nearly without distortion, and any"
            " centre"
            " makes the same images"
        )
    if found.folds:
        said.append(
            "the lens folds over before the border of the image: it is good where corners were seen and"
            " nowhere"
            " else. Free fewer coefficients, as in --lens pfet:a1,a3, or take a lens of the angle, --lens"
            " kannala_brandt"
        )
    if found.cost > WRONG_RATIO**2 * usual:
        said.append(
            f"the corners are missed by {np.sqrt(found.cost / usual):.1f} times what the full calibration"
            " leaves: a"
            " wrong minimum, or a lens that this formula cannot follow. Take more photographs or another lens"
        )
    return Found(found.estimate, found.ended.status, found.ended.rounds, (*said, *left_open), uncertainty)


def _repeated_plain(bases: StartingCameras, used: Detections, search: Search) -> Found:
    """Of the two steps repeated as one reads them at first."""
    nearest = _pinhole(bases, used, search)
    plain = repeat_plainly(
        bases, nearest.unknowns, search.lens, rounds=search.rounds, loss=search.loss, progress=search.progress
    )
    member = (
        f"corrected points: of the pin-hole after {plain.rounds} plain rounds of both steps, each fitted in"
        " the"
        " image corrected by the lens of the last"
    )
    return Found(plain.estimate, plain.status, plain.rounds, (member,))


def _usual_cost(used: Detections, search: Search) -> float:
    """The cost that the full calibration leaves by the same loss; infinite where it gives no camera."""
    try:
        usual = fccm(used)
    except CalibrationError:
        return np.inf
    squared = (np.concatenate(usual.residuals()) ** 2).sum(1)
    return float(search.loss.cost(squared).sum())


CORRECTIONS: dict[str, Callable[[StartingCameras, Detections, Search], Found]] = {
    "repeated": _repeated,
    "repeated-plain": _repeated_plain,
    "nearest": _nearest,
    "literal": _literal,
}
