"""A fit of step 1 as linear algebra, for whoever asks what its views say one by one
(fitting/linearised.py).
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from orthoscope.fitting.linearised import Linearised
from orthoscope.fitting.residual_slopes import residual_slopes
from orthoscope.geometry.arrays import Float, ndarray
from orthoscope.methods.decoupled.step_one import StepOneFit
from orthoscope.solve.losses import Loss

__all__ = ["linearised", "roots_of"]


def linearised(fit: StepOneFit) -> Linearised:
    """The fit at its estimate, with the weights of loss and priors that it ended with."""
    problem, estimate, loss = fit.problem, fit.estimate, fit.loss
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
        noise=fit.evidence.noise,
        normal=problem.linearise(estimate, loss),
        by_corner=problem.by_corner,
    )


def roots_of(
    loss: Loss, residual: Float[ndarray, "m n"], present: Float[ndarray, "m p"]
) -> Float[ndarray, "m n"]:
    """The root of each row's weight; 0 where a corner was not seen."""
    half = residual.shape[1] // 2
    weight = loss.weight(residual[:, :half] ** 2 + residual[:, half:] ** 2)
    root = present * (1.0 if weight is None else np.sqrt(weight))
    return np.concatenate([root, root], axis=1)
