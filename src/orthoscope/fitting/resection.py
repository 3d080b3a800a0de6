"""Where the target was in each view, the camera being known.

A homography to the camera's rays starts it, least squares in pixels ends it; nothing but the poses moves.
"""

from __future__ import annotations

import numpy as np

from orthoscope.fitting.calibration import points_of
from orthoscope.fitting.closed_form import poses_of_camera
from orthoscope.fitting.observations import Observations
from orthoscope.fitting.reprojection import Estimate, Reprojection
from orthoscope.geometry.arrays import CalibrationError
from orthoscope.geometry.blas import with_one_thread
from orthoscope.geometry.pose import Pose
from orthoscope.models.camera import Camera
from orthoscope.models.target_shape import TargetShape
from orthoscope.solve.least_squares import Status, solve
from orthoscope.solve.losses import Loss
from orthoscope.targets.detections import Detections

__all__ = ["resect"]


@with_one_thread
def resect(
    camera: Camera, detections: Detections, *, shape: TargetShape | None = None, loss: Loss | None = None
) -> tuple[Pose, ...]:
    """camera_from_target of each view, by least squares over its corners with the camera (and the target's
    shape) fixed.

    Raises CalibrationError where a view has fewer than four corners inside the lens's domain.
    """
    observations = Observations.of(detections)
    poses = poses_of_camera(camera, observations, detections.target.points)
    lost = observations.order[~np.isfinite(poses.translation).all(1)]
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
