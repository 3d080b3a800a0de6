"""A fit of step 1 as linear algebra, for whoever asks what its views say one by one (fitting/linearised.py)."""

from __future__ import annotations

import numpy as np

from orthoscope.fitting.linearised import Linearised, Slopes
from orthoscope.methods.joint import Joint
from orthoscope.methods.joint_fit import JointFit
from orthoscope.methods.joint_sums import SPACE, by_corner, spline_values
from orthoscope.methods.observations import Observations, Poses
from orthoscope.methods.reprojection import POSE, Estimate, Places, Reprojection
from orthoscope.models.camera import Camera
from orthoscope.models.free_lens import FreeLens

__all__ = ["linearised"]


def linearised(fit: JointFit) -> Linearised:
    """The fit at its estimate, with the weights of loss and priors that it ended with."""
    problem, estimate, loss = fit.problem, fit.estimate, fit.loss
    observations = problem.measurements.observations
    points = problem.corners(estimate)
    moves = problem.single or problem.surface.shape[1] > 0
    slopes, residual = _slopes(observations, estimate.camera, estimate.poses, points, problem, moves=moves)
    half = residual.shape[1] // 2
    weight = loss.weight(residual[:, :half] ** 2 + residual[:, half:] ** 2)
    root = observations.present * (1.0 if weight is None else np.sqrt(weight))
    surface, singles, spline = problem.precisions
    return Linearised(
        camera=estimate.camera,
        names=problem.free,
        slopes=slopes,
        single=problem.single,
        residual=residual,
        root=np.concatenate([root, root], axis=1),
        spline_precision=spline * problem.energy,
        shape_precision=np.concatenate([surface.ravel(), np.tile(singles, len(points)) if problem.single else np.empty(0)]),
        noise=fit.evidence.noise,
        normal=problem.linearise(estimate, loss),
        by_corner=problem.by_corner,
    )


def _slopes(
    observations: Observations, camera: Camera, poses: Poses, points: np.ndarray, problem: Joint, *, moves: bool
) -> tuple[Slopes, np.ndarray]:
    """The slopes, and the residuals (m,2p)."""
    m, p = observations.ids.shape
    k, g = len(problem.free), len(problem.energy)
    of_camera, of_pose, residual = np.empty((m, k, 2 * p)), np.empty((m, POSE, 2 * p)), np.empty((m, 2 * p))
    of_corner, of_spline = np.empty((m, p if moves else 0, 2, SPACE)), np.zeros((m, p, g))
    reprojection = Reprojection(observations, points, camera, problem.free)
    for chunk in observations.chunks():
        stacked = reprojection.stack(Estimate(camera, poses), chunk, Places(*points.T))
        of_camera[chunk.rows], of_pose[chunk.rows], residual[chunk.rows] = stacked[:, :k], stacked[:, k:-1], stacked[:, -1]
        if moves:
            turned = by_corner(stacked[:, k + SPACE : k + POSE], poses.rotation[chunk.rows])  # (v, p, 3, 2)
            of_corner[chunk.rows] = turned.transpose(0, 1, 3, 2)
        if isinstance(camera.lens, FreeLens):
            of_spline[chunk.rows] = spline_values(camera.lens, poses.only(chunk.rows), points)
    frame = camera.lens_frame or camera.intrinsics
    of_spline *= observations.present[:, :, None]
    return Slopes(of_camera, of_pose, of_spline, of_corner, problem.surface, frame.matrix[:2, :2]), residual
