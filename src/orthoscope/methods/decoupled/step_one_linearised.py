"""A fit of step 1 as linear algebra, for whoever asks what its views say one by one
(fitting/linearised.py).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from orthoscope.fitting.linearised import Linearised, Slopes
from orthoscope.fitting.observations import Observations, Poses
from orthoscope.fitting.reprojection import POSE, Estimate, Places, Reprojection
from orthoscope.geometry.arrays import Float, ndarray
from orthoscope.methods.decoupled.normal_equations import SPACE, by_corner, spline_values
from orthoscope.methods.decoupled.step_one import StepOneFit
from orthoscope.models.camera import Camera
from orthoscope.models.free_lens import FreeLens
from orthoscope.solve.losses import Loss

__all__ = ["linearised", "roots_of", "slopes_of"]


def linearised(fit: StepOneFit) -> Linearised:
    """The fit at its estimate, with the weights of loss and priors that it ended with."""
    problem, estimate, loss = fit.problem, fit.estimate, fit.loss
    observations, points = problem.measurements.observations, problem.corners(estimate)
    moves = problem.single or problem.surface.shape[1] > 0
    slopes, residual = slopes_of(
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


def slopes_of(
    observations: Observations,
    camera: Camera,
    poses: Poses,
    points: Float[ndarray, "p 3"],
    free: Sequence[str],
    *,
    moves: bool,
) -> tuple[Slopes, Float[ndarray, "m n"]]:
    """The slopes at a camera and poses, without a surface, and the residuals (m,2p).

    Args:
        observations: by corner.
        points: the target's corners, metres.
        free: the camera's parameters that move.
        moves: whether slopes by the places of corners are wanted.
    """
    m, p = observations.ids.shape
    k, g = len(free), camera.lens.over.lattice.splines if isinstance(camera.lens, FreeLens) else 0
    of_camera, of_pose, residual = np.empty((m, k, 2 * p)), np.empty((m, POSE, 2 * p)), np.empty((m, 2 * p))
    of_corner, of_spline = np.empty((m, p if moves else 0, 2, SPACE)), np.zeros((m, p, g))
    reprojection = Reprojection(observations, points, camera, free)
    for chunk in observations.chunks():
        stacked = reprojection.stack(Estimate(camera, poses), chunk, Places(*points.T))
        of_camera[chunk.rows], of_pose[chunk.rows], residual[chunk.rows] = (
            stacked[:, :k],
            stacked[:, k:-1],
            stacked[:, -1],
        )
        if moves:
            turned = by_corner(stacked[:, k + SPACE : k + POSE], poses.rotation[chunk.rows])  # (v, p, 3, 2)
            of_corner[chunk.rows] = turned.transpose(0, 1, 3, 2)
        if isinstance(camera.lens, FreeLens):
            of_spline[chunk.rows] = spline_values(camera.lens, poses.only(chunk.rows), points)
    frame = camera.lens_frame or camera.intrinsics
    of_spline *= observations.present[:, :, None]
    surface = np.zeros((p, 0))
    return Slopes(of_camera, of_pose, of_spline, of_corner, surface, frame.matrix[:2, :2]), residual
