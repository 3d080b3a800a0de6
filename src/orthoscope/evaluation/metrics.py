"""Error measures in space: the paper's NCE."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np

from orthoscope.fitting.calibration import points_of
from orthoscope.fitting.unseen.held_out import HeldOut
from orthoscope.geometry.arrays import Float, InputError, ndarray
from orthoscope.geometry.pose import Pose
from orthoscope.models.camera import WIDEST_ANGLE, Camera
from orthoscope.models.intrinsics import Intrinsics
from orthoscope.models.target_shape import TargetShape
from orthoscope.targets.detections import Detections

__all__ = ["held_out_nce", "lateral_errors", "nce_of", "normalised_calibration_error"]


def normalised_calibration_error(
    estimated: Float[ndarray, "n 3"], observed: Float[ndarray, "n 3"], intrinsics: Intrinsics
) -> float:
    """Mean lateral error over what pixel rounding alone would give: 1 is 0.41 px, as good as digitisation.

    Args:
        estimated: (n,3) metres, camera frame, back-projected from the undistorted pixels to the depths of the
            observed points.
        observed: (n,3) metres, camera frame, in the same order.
        intrinsics: of the camera that saw them.
    Raises:
        InputError: a depth is not positive.
    Source:
        Weng, Cohen and Herniou, TPAMI 14(10), 1992; the paper's eq. (11), whose print lacks the square on the
        depth.
    """
    depth = observed[:, 2]
    if not (depth > 0).all():
        raise InputError(
            "a point has no positive depth; NCE compares points in front of the camera. Drop the others."
        )
    rounding = depth * np.sqrt((intrinsics.fx**-2 + intrinsics.fy**-2) / 12.0)
    lateral = np.hypot(*(estimated - observed)[:, :2].T)
    return float((lateral / rounding).mean())


def lateral_errors(
    camera: Camera,
    camera_from_target: Sequence[Pose],
    detections: Detections,
    *,
    shape: TargetShape | None = None,
) -> tuple[ndarray, ndarray]:
    """Points as back-projected from the detected pixels and as the poses place them, for NCE.

    Corners that no straight image would hold (WIDEST_ANGLE), or whose pixel no ray reaches, are left out:
    towards 90 degrees a lateral error grows without end.

    Args:
        camera: gives the rays.
        camera_from_target: the pose of each view.
        detections: the pixels.
        shape: of the target.
    Returns:
        Estimated and observed points, (n,3) metres each, camera frame.
    """
    points = points_of(detections.target, shape)
    observed = np.concatenate(
        [
            pose.apply(points[view.ids])
            for pose, view in zip(camera_from_target, detections.views, strict=True)
        ]
    )
    rays = camera.unproject(np.concatenate([view.pixels for view in detections.views]))
    usable = (rays[:, 2] > np.cos(WIDEST_ANGLE)) & (
        observed[:, 2] > np.cos(WIDEST_ANGLE) * np.sqrt((observed**2).sum(-1))
    )
    rays, observed = rays[usable], observed[usable]
    return rays * (observed[:, 2] / rays[:, 2])[:, None], observed


def nce_of(
    camera: Camera,
    camera_from_target: Sequence[Pose],
    detections: Detections,
    *,
    shape: TargetShape | None = None,
) -> float:
    """NCE of a camera at these poses; NaN where no straight image would hold any corner.

    Arguments as in `lateral_errors`.
    """
    estimated, observed = lateral_errors(camera, camera_from_target, detections, shape=shape)
    if not len(observed):
        return float("nan")
    return normalised_calibration_error(estimated, observed, camera.intrinsics)


def held_out_nce(unseen: HeldOut, detections: Detections) -> float:
    """NCE over the corners of all views that were held out; NaN where none was, or no straight image would
    hold any.
    """
    total, corners = 0.0, 0
    for camera, shape, poses, views in _by_camera(unseen):
        estimated, observed = lateral_errors(camera, poses, detections.only(views), shape=shape)
        if len(observed):
            total += len(observed) * normalised_calibration_error(estimated, observed, camera.intrinsics)
        corners += len(observed)
    return total / corners if corners else float("nan")


def _by_camera(unseen: HeldOut) -> Iterator[tuple[Camera, TargetShape | None, list[Pose], list[int]]]:
    """The camera of each fold with the target's shape, the poses of the views that it was tried on, and which
    views these are.
    """
    folds: dict[int, list[int]] = {}
    for i, camera in enumerate(unseen.cameras):
        folds.setdefault(id(camera), []).append(i)
    for views in folds.values():
        camera, poses = (
            unseen.cameras[views[0]],
            [pose for i in views if (pose := unseen.camera_from_target[i])],
        )
        if camera is not None:
            yield camera, unseen.shapes[views[0]], poses, views
