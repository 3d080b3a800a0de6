"""Where the target was in each view, the camera being known.

A homography to the camera's rays starts it, least squares in pixels ends it; nothing but the poses moves.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from orthoscope.fitting.calibration import points_of
from orthoscope.fitting.observations import Observations, Poses
from orthoscope.fitting.reprojection import Estimate, Reprojection
from orthoscope.fitting.starts.closed_form import poses_of_camera
from orthoscope.geometry.arrays import CalibrationError, Float, Int, ndarray
from orthoscope.geometry.pose import Pose
from orthoscope.machine.blas import with_one_thread
from orthoscope.models.camera import Camera
from orthoscope.models.target_shape import TargetShape
from orthoscope.solve.least_squares import Status, solve
from orthoscope.solve.losses import Loss
from orthoscope.targets.detections import Detections

__all__ = ["resect"]

# With fewer corners a view has no pose.
FEWEST_SEEN = 4


@with_one_thread
def resect(
    camera: Camera,
    detections: Detections,
    *,
    shape: TargetShape | None = None,
    loss: Loss | None = None,
    near: Sequence[Pose] | None = None,
) -> tuple[Pose, ...]:
    """camera_from_target of each view, by least squares over its corners, the camera being fixed.

    Args:
        camera: which took the photographs.
        detections: what was found in them.
        shape: of the target, fixed too; flat by default.
        loss: what a squared residual costs; least squares by default.
        near: poses of the views to start from; by default those of homographies.
    Raises:
        CalibrationError: a view has fewer than four corners inside the lens's domain.
    """
    observations = Observations.of(detections)
    if near is None:
        poses = poses_of_camera(camera, observations, detections.target.points)
        known = np.isfinite(poses.translation).all(1)
    else:
        poses = observations.poses_of(near)
        known = _seen(camera, observations, poses, detections.target.points) >= FEWEST_SEEN
    lost = observations.order[~known]
    if len(lost):
        name = detections.views[int(lost.min())].image
        raise CalibrationError(
            f"view {name!r} has fewer than 4 corners where this camera sees anything. Leave it out, or use"
            " the right camera."
        )
    problem = Reprojection(observations, points_of(detections.target, shape), camera)
    solution = solve(problem, Estimate(camera, poses), loss=loss)
    if solution.status is Status.NO_COST:
        raise CalibrationError(
            "the target lies behind this camera in some view. Use the camera that took the photographs."
        )
    return observations.poses_in_order(solution.unknowns.poses)


def _seen(
    camera: Camera, observations: Observations, poses: Poses, points: Float[ndarray, "p 3"]
) -> Int[ndarray, " m"]:
    """How many of its corners the camera sees in each view."""
    there = points[observations.ids] @ poses.rotation.transpose(0, 2, 1) + poses.translation[:, None]
    image = camera.project(there.reshape(-1, 3))[:, 0].reshape(observations.ids.shape)
    return (np.isfinite(image) & (observations.present > 0)).sum(1)
