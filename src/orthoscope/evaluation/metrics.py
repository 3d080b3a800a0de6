"""Error measures in space: the paper's NCE.

Floor 4.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from orthoscope.geometry.arrays import Float, InputError, ndarray
from orthoscope.geometry.pose import Pose
from orthoscope.geometry.target import Detections
from orthoscope.methods.calibration import points_of
from orthoscope.models.camera import WIDEST, Camera, Intrinsics
from orthoscope.models.target_shape import TargetShape

__all__ = ["lateral_errors", "normalised_calibration_error"]


def normalised_calibration_error(estimated: Float[ndarray, "n 3"], observed: Float[ndarray, "n 3"], intrinsics: Intrinsics) -> float:
    """Mean lateral error over what pixel rounding alone would give; about 1 is as good as digitisation (1 is 0.41 px).

    estimated, observed: (n,3) metres, camera frame, same order, equal depths: estimated by back-projecting the undistorted pixel to the
    depth of the observed point.
    Raises InputError where a depth is not positive.  Weng, Cohen and Herniou, TPAMI 14(10), 1992; the paper's eq. (11), whose
    print lacks the square on the depth.
    """
    depth = observed[:, 2]
    if not (depth > 0).all():
        raise InputError("a point has no positive depth; NCE compares points in front of the camera. Drop the others.")
    rounding = depth * np.sqrt((intrinsics.fx**-2 + intrinsics.fy**-2) / 12.0)
    lateral = np.hypot(*(estimated - observed)[:, :2].T)
    return float((lateral / rounding).mean())


def lateral_errors(
    camera: Camera, camera_from_target: Sequence[Pose], detections: Detections, *, shape: TargetShape | None = None
) -> tuple[ndarray, ndarray]:
    """Points as back-projected from the detected pixels and as the poses place them (n,3 each), for NCE.

    Corners that no straight image would hold (WIDEST), or whose pixel no ray reaches, are left out: towards 90 degrees a lateral error
    grows without end.
    """
    points = points_of(detections.target, shape)
    observed = np.concatenate([pose.apply(points[view.ids]) for pose, view in zip(camera_from_target, detections.views, strict=True)])
    rays = camera.unproject(np.concatenate([view.pixels for view in detections.views]))
    usable = (rays[:, 2] > np.cos(WIDEST)) & (observed[:, 2] > np.cos(WIDEST) * np.sqrt((observed**2).sum(-1)))
    rays, observed = rays[usable], observed[usable]
    return rays * (observed[:, 2] / rays[:, 2])[:, None], observed
