"""Step 1 of `decoupled`: poses, the target's shape and the lens together, from a calibration with a flat
target.

Each round minimises the joint problem (problem.py) for the weights at hand and finds the weights anew
(evidence.py).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np

from orthoscope.fitting.calibration import Calibration
from orthoscope.fitting.observations import Observations
from orthoscope.fitting.slopes.linearised import SharedInverse
from orthoscope.geometry.arrays import Float, ndarray
from orthoscope.geometry.pose import Pose
from orthoscope.methods.decoupled.evidence import Evidence, first_guess
from orthoscope.methods.decoupled.normal_equations import SPACE, Measurements
from orthoscope.methods.decoupled.problem import DecoupledEstimate, Joint, Known
from orthoscope.models.camera import Camera
from orthoscope.models.lenses.free import FreeLens
from orthoscope.models.lenses.spline import Displacement, Lattice
from orthoscope.models.lenses.table import FREE
from orthoscope.models.target_shape import TargetShape, polynomials, without_similarity
from orthoscope.solve.block_system import NormalEquations, after_step
from orthoscope.solve.least_squares import Options, Solution, solve
from orthoscope.solve.losses import Huber

__all__ = ["FORMULA", "StepOneFit", "fit_step_one", "polished"]

# Beside FREE, a displacement over a formula, step 1's lens may be the formula alone, by this name.
FORMULA = "formula"

# Step 1 has at most so many rounds.
ROUND_LIMIT = 6
# A round ends at this tolerance.
ROUND_TOLERANCE = 1e-3
# The last round ends so where nothing else is said.
TO_THE_LAST_DIGIT = Options(tolerance=1e-9, max_steps=50)
# Independent errors reach so many standard deviations of a coordinate once in 3000, and count less beyond.
FAR_DEVIATIONS = 4.0
# Noise may change by this share before the loss does: its sums then need not be formed again.
KEPT_LOSS_SHARE = 0.05
# The displacement's lattice has so many cells along the image's longer side.
CELLS_ALONG_SIDE = 8
# The lattice is larger than the image by this share of its sides.
MARGIN_SHARE = 0.05
# The displacement's prior ranges over this share of the image's half diagonal; from half to twice this the
# held-out error is the same.
REACH_SHARE = 0.67


@dataclass(frozen=True, eq=False)
class StepOneFit:
    """What came out: the kind of the target's shape, the problem with its last weights, the estimate and what
    it speaks for.

    Attributes:
        loss: how errors count.
        inverse: of the sums at the estimate.
        steps, status: of the solver.
    """

    target: str
    problem: Joint
    estimate: DecoupledEstimate
    loss: Huber
    evidence: Evidence
    inverse: SharedInverse
    steps: int
    status: str

    @property
    def covariance(self) -> Float[ndarray, "k k"]:
        """Of the free parameters."""
        k = len(self.problem.free)
        return self.evidence.noise * self.inverse.covariance[:k, :k]

    @property
    def views(self) -> int:
        """How many it was made from."""
        return len(self.problem.measurements.observations.order)

    @property
    def poses(self) -> tuple[Pose, ...]:
        """camera_from_target of each view."""
        return self.problem.measurements.observations.poses_in_order(self.estimate.poses)

    def with_formula(self, camera: Camera, free: Sequence[str]) -> float:
        """For another camera in the place of the estimate's: how many parameters the data determine in
        all.
        """
        problem = self.problem
        measurements = Measurements(problem.measurements.observations, camera, free)
        other = Joint(
            measurements, problem.points, free,
            surface=problem.surface,
            energy=np.zeros((0, 0)),
            single=problem.single,
            precisions=problem.precisions,
            parts=problem.parts,
        )  # fmt: skip
        known = other.minimum(other.linearise(self.estimate._replace(camera=camera), self.loss)).known
        return len(free) + float(known.surface.sum() + known.singles.sum())

    @property
    def shape(self) -> TargetShape:
        """Of the target, without a similarity."""
        points = self.problem.points
        if self.target == "flat":
            return TargetShape.flat(len(points))
        seen = self.problem.measurements.observations.present.max(0) > 0
        moved = self.problem.corners(self.estimate) - points
        return TargetShape(self.target, without_similarity(points, moved, seen, parts=self.problem.parts))


def fit_step_one(
    flat: Calibration,
    *,
    shape: str,
    first_lens: str,
    near: StepOneFit | None = None,
    ending: Options = TO_THE_LAST_DIGIT,
) -> StepOneFit:
    """Camera, poses and shape together.

    Args:
        flat: a calibration of a flat target to start from; its parameters are freed.
        shape: of the target, `flat`, `smooth` or `free`.
        first_lens: FREE or FORMULA, the lens.
        near: a fit of the same model to some of the views, whose camera and target to start from.
        ending: how the last round ends.
    """
    detections, free = flat.detections, flat.uncertainty.names
    observations = Observations.by_corner(detections)
    points, seen = detections.target.points, observations.present.max(0) > 0
    parts = detections.target.parts
    basis = polynomials(points, seen, parts=parts) if shape != "flat" else np.zeros((len(points), 0))
    estimate = DecoupledEstimate(
        _with_displacement(flat.camera) if first_lens == FREE else flat.camera,
        observations.poses_of(flat.camera_from_target),
        np.zeros((basis.shape[1], SPACE)),
        np.zeros((len(points), SPACE)),
    )
    size = float(np.ptp(points[seen, :2], axis=0).max())
    evidence = first_guess(0.5 * flat.rms_px**2, size, flat.camera.intrinsics.fx)
    if near and near.estimate.surface.shape == estimate.surface.shape:
        estimate, evidence = near.estimate._replace(poses=estimate.poses), near.evidence.awake()
    measurements = Measurements(observations, estimate.camera, free, corners_move=shape != "flat")
    problem = Joint(
        measurements,
        points,
        free,
        surface=basis,
        energy=_energy(estimate.camera),
        single=shape == "free",
        precisions=evidence.precisions(basis.shape[1]),
        parts=parts,
    )
    noise, loss = evidence.noise, _loss(evidence.noise)
    place, steps = None, 0
    for _ in range(ROUND_LIMIT - 1):
        place = place or _Place(estimate, problem.measured(estimate, loss))
        place, known, residuals, more = _round(problem, place, loss)
        estimate, steps = place.estimate, steps + more
        before = evidence
        evidence = evidence.renewed(problem, estimate, known=known, loss=loss, residuals=residuals)
        problem = problem.weighed(evidence.precisions(basis.shape[1]))
        if abs(evidence.noise / noise - 1.0) > KEPT_LOSS_SHARE:
            noise, loss, place = evidence.noise, _loss(evidence.noise), None
        if evidence.agrees_with(before):
            break
    solution = solve(problem, estimate, loss=loss, options=ending)
    return _told(shape, problem, solution, loss, evidence, steps)


def polished(fit: StepOneFit) -> StepOneFit:
    """A fit that was stopped early brought to its minimum, weights as they are."""
    solution = solve(fit.problem, fit.estimate, loss=fit.loss, options=TO_THE_LAST_DIGIT)
    if not solution.steps:
        return fit
    return _told(fit.target, fit.problem, solution, fit.loss, fit.evidence, fit.steps)


class _Place(NamedTuple):
    """An estimate, and the sums of its measurements."""

    estimate: DecoupledEstimate
    sums: NormalEquations


def _round(problem: Joint, place: _Place, loss: Huber) -> tuple[_Place, Known, Float[ndarray, "m p 2"], int]:
    """Where the problem's cost is least, what is known there, the residuals, and how many steps it took.

    One step that keeps its promise is enough, and the sums after it follow from those before.
    """
    sums = problem.with_priors(place.sums, place.estimate)
    step = problem.minimum(sums)
    there = problem.move(place.estimate, step.shared, step.blocks)
    residuals = problem.residuals(there)
    cost = problem.cost(there, loss, residuals)
    if abs(cost - (sums.cost - step.promised)) <= ROUND_TOLERANCE * cost:
        after = _Place(there, after_step(place.sums, step.shared, step.blocks))
        return after, step.known, residuals, 1
    start = there if cost < sums.cost else place.estimate
    solution = solve(problem, start, loss=loss, options=Options(tolerance=ROUND_TOLERANCE, max_steps=50))
    estimate = solution.unknowns
    place = _Place(estimate, problem.measured(estimate, loss))
    known = problem.minimum(solution.sums).known
    return place, known, problem.residuals(estimate), 1 + solution.steps


def _told(
    target: str,
    problem: Joint,
    solution: Solution[DecoupledEstimate],
    loss: Huber,
    evidence: Evidence,
    steps: int,
) -> StepOneFit:
    """The fit at the problem's minimum, and what it speaks for.

    Args:
        evidence: that the problem's weights are of.
        steps: that led to where the solution began.
    """
    estimate, minimum = solution.unknowns, problem.minimum(solution.sums)
    residuals = problem.residuals(estimate)
    evidence = evidence.renewed(problem, estimate, known=minimum.known, loss=loss, residuals=residuals)
    return StepOneFit(
        target,
        problem,
        estimate,
        loss,
        evidence,
        minimum.inverse,
        steps + solution.steps,
        solution.status.value,
    )


def _loss(noise: float) -> Huber:
    """noise: px^2 of a coordinate."""
    return Huber(FAR_DEVIATIONS * float(np.sqrt(noise)))


def _with_displacement(camera: Camera) -> Camera:
    """The camera with a displacement of nothing over its image, a margin included."""
    frame = camera.lens_frame or camera.intrinsics
    width, height = camera.image_size
    low, high = frame.to_plane(
        np.array(
            [
                [-MARGIN_SHARE * width, -MARGIN_SHARE * height],
                [(1 + MARGIN_SHARE) * width, (1 + MARGIN_SHARE) * height],
            ]
        )
    )
    longer = max(width, height)
    cells = (
        max(1, round(CELLS_ALONG_SIDE * width / longer)),
        max(1, round(CELLS_ALONG_SIDE * height / longer)),
    )
    lattice = Lattice.over(low, high, cells)
    return replace(camera, lens=FreeLens(camera.lens, Displacement(lattice, np.zeros((lattice.splines, 2)))))


def _energy(camera: Camera) -> Float[ndarray, "g g"]:
    if not isinstance(camera.lens, FreeLens):
        return np.zeros((0, 0))
    lattice = camera.lens.over.lattice
    sides = lattice.step * (np.array(lattice.shape) - 3)
    return lattice.energy(REACH_SHARE * 0.5 * float(np.hypot(*sides)))
