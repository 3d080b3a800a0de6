"""A fit of step 1, or a full calibration of a flat target, as linear algebra, for whoever asks what its views
say one by one (fitting/slopes/linearised.py).
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from orthoscope.fitting.calibration import Calibration
from orthoscope.fitting.observations import Observations
from orthoscope.fitting.reprojection import POSE
from orthoscope.fitting.slopes.linearised import Linearised, SharedInverse
from orthoscope.fitting.slopes.residual_slopes import residual_slopes
from orthoscope.geometry.arrays import Float, ndarray
from orthoscope.methods.decoupled.normal_equations import SPACE, Measurements
from orthoscope.methods.decoupled.problem import DecoupledEstimate, Joint, Precisions
from orthoscope.methods.decoupled.step_one import StepOneFit
from orthoscope.solve.losses import LOSSES, Loss

__all__ = ["linearised", "linearised_flat", "roots_of"]


def linearised(fit: StepOneFit) -> Linearised:
    """The fit at its estimate, with the weights of loss and priors that it ended with."""
    fit.problem.measurements.forget()
    return _linearised(fit.problem, fit.estimate, fit.loss, fit.evidence.noise, fit.inverse)


def linearised_flat(calibration: Calibration) -> Linearised:
    """A calibration by `fccm` where it ended, with its own loss: nothing is fitted.

    The noise is the cost over what poses and camera left free.
    """
    detections, settings = calibration.detections, calibration.settings
    free, corners = calibration.uncertainty.names, len(detections.target.points)
    loss = LOSSES[settings["loss"]](settings["loss_scale"])
    observations = Observations.by_corner(detections)
    problem = Joint(
        Measurements(observations, calibration.camera, free, corners_move=False),
        detections.target.points,
        free,
        surface=np.zeros((corners, 0)),
        energy=np.zeros((0, 0)),
        single=False,
        precisions=Precisions(np.zeros((0, SPACE)), np.zeros(SPACE), 0.0),
    )
    estimate = DecoupledEstimate(
        calibration.camera,
        observations.poses_of(calibration.camera_from_target),
        np.zeros((0, SPACE)),
        np.zeros((corners, SPACE)),
    )
    freedom = 2 * detections.corners - POSE * len(detections.views) - len(free)
    sums = problem.linearise(estimate, loss)
    return _linearised(problem, estimate, loss, sums.cost / max(freedom, 1), problem.minimum(sums).inverse)


def _linearised(
    problem: Joint, estimate: DecoupledEstimate, loss: Loss, noise: float, inverse: SharedInverse
) -> Linearised:
    observations, points = problem.measurements.observations, problem.corners(estimate)
    moves = problem.single or problem.surface.shape[1] > 0
    slopes, residual = residual_slopes(
        observations, estimate.camera, estimate.poses, points, problem.free, moves=moves
    )
    surface, singles, spline = problem.precisions
    return Linearised(
        camera=estimate.camera,
        names=problem.free,
        slopes=replace(slopes, surface=problem.surface),
        single=problem.single,
        residual=residual,
        root=roots_of(loss, residual, observations.present),
        spline_precision=spline * problem.energy,
        shape_precision=np.concatenate(
            [surface.ravel(), np.tile(singles, len(points)) if problem.single else np.empty(0)]
        ),
        noise=noise,
        inverse=inverse,
    )


def roots_of(
    loss: Loss, residual: Float[ndarray, "m n"], present: Float[ndarray, "m p"]
) -> Float[ndarray, "m n"]:
    """The root of each row's weight; 0 where a corner was not seen."""
    half = residual.shape[1] // 2
    weight = loss.weight(residual[:, :half] ** 2 + residual[:, half:] ** 2)
    root = present * (1.0 if weight is None else np.sqrt(weight))
    return np.concatenate([root, root], axis=1)
