"""Error measures: the paper's NCE, and how much of the frame the corners cover.

Floor 4.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from orthoscope.geometry.arrays import Float, InputError, Int, ndarray
from orthoscope.geometry.pose import Pose
from orthoscope.geometry.target import Detections
from orthoscope.models.camera import WIDEST, Camera, Intrinsics

__all__ = ["COVERAGE_GRID", "corners_by_cell", "lateral_errors", "normalised_calibration_error"]

COVERAGE_GRID = (8, 6)  # cells across and down by which the frame is said to be covered


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


def lateral_errors(camera: Camera, camera_from_target: Sequence[Pose], detections: Detections) -> tuple[ndarray, ndarray]:
    """Points as back-projected from the detected pixels and as the poses place them (n,3 each), for NCE.

    Corners that no straight image would hold (WIDEST), or whose pixel no ray reaches, are left out: towards 90 degrees a lateral error grows
    without end.
    """
    points = detections.target.points
    observed = np.concatenate([pose.apply(points[view.ids]) for pose, view in zip(camera_from_target, detections.views, strict=True)])
    rays = camera.unproject(np.concatenate([view.pixels for view in detections.views]))
    usable = (rays[:, 2] > np.cos(WIDEST)) & (observed[:, 2] > np.cos(WIDEST) * np.sqrt((observed**2).sum(-1)))
    rays, observed = rays[usable], observed[usable]
    return rays * (observed[:, 2] / rays[:, 2])[:, None], observed


def corners_by_cell(detections: Detections, grid: tuple[int, int] = COVERAGE_GRID) -> Int[ndarray, "rows columns"]:
    """How many corners were seen in each cell of a grid (columns, rows) over the frame."""
    pixels = np.concatenate([view.pixels for view in detections.views])
    width, height = detections.image_size
    edges_x, edges_y = np.linspace(-0.5, width - 0.5, grid[0] + 1), np.linspace(-0.5, height - 0.5, grid[1] + 1)
    return np.histogram2d(pixels[:, 1], pixels[:, 0], bins=(edges_y, edges_x))[0].astype(np.int64)
