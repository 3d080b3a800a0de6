"""How the residuals of a calibration move with everything that may explain them: camera, poses, places of the target's corners.

Floor 4.  e = projected minus detected of corner p in view j, P = R_j p + t_j in the camera frame, J = de/dP:  d/dd = J R_j for a
displacement d of the corner in the target frame, d/dt = J, and d/dw = J [w x q] for a turn about the middle of what the view shows, q from
there.  J and the camera's columns are central differences of `project`, so that any camera has them: they serve statistics, where six
digits are plenty, not a solver.
"""

from __future__ import annotations

from dataclasses import replace
from typing import NamedTuple

import numpy as np

from orthoscope.geometry.arrays import Float, Int, ndarray
from orthoscope.geometry.pose import cross_matrix
from orthoscope.methods.calibration import Calibration
from orthoscope.methods.reprojection import with_parameters
from orthoscope.models.camera import Camera, Intrinsics

__all__ = ["Slopes", "parameters_of", "slopes_of", "stepped"]

INTRINSICS = ("fx", "fy", "cx", "cy", "skew")
FRAME = ("lens fx", "lens fy", "lens cx", "lens cy")  # of a lens that has a frame of its own
SMALL_TURN = 1e-6  # radians by which a ray is moved, each way
SMALL_SHARE = 1e-4  # of a coefficient


class Slopes(NamedTuple):
    """One row for each corner that has an image, all views together.

    view, corner: which view, which row of the target's points.  pixels: detected.  residual: (n,2) pixels.  by_camera: (n,2,k), by
    `parameters_of`.  by_pose: (n,2,6).  by_place: (n,2,3) pixels per metre, of the corner in the target.
    """

    view: Int[ndarray, " n"]
    corner: Int[ndarray, " n"]
    pixels: Float[ndarray, "n 2"]
    residual: Float[ndarray, "n 2"]
    by_camera: Float[ndarray, "n 2 k"]
    by_pose: Float[ndarray, "n 2 6"]
    by_place: Float[ndarray, "n 2 3"]


def slopes_of(calibration: Calibration) -> Slopes:
    """Residuals and their slopes at the calibration's own estimate."""
    views = calibration.detections.views
    view = np.repeat(np.arange(len(views)), [len(seen.ids) for seen in views])
    corner = np.concatenate([np.empty(0, dtype=np.int64), *(seen.ids for seen in views)])
    pixels = np.concatenate([np.empty((0, 2)), *(seen.pixels for seen in views)])
    poses = calibration.camera_from_target
    rotation = np.array([pose.rotation for pose in poses]).reshape(-1, 3, 3)[view]
    turned = (rotation @ calibration.target_points[corner][:, :, None])[:, :, 0]
    points = turned + np.array([pose.translation for pose in poses]).reshape(-1, 3)[view]

    residual = calibration.camera.project(points, beyond=True) - pixels
    by_point = _by_point(calibration.camera, points)
    by_turn = by_point @ -cross_matrix(_from_their_middle(turned, view, len(views)))
    slopes = Slopes(
        view, corner, pixels, residual, _by_camera(calibration, points), np.concatenate([by_turn, by_point], axis=-1), by_point @ rotation
    )
    usable = np.isfinite(residual).all(1) & np.isfinite(by_point).all((1, 2)) & np.isfinite(slopes.by_camera).all((1, 2))
    return Slopes(*(rows[usable] for rows in slopes))


def _from_their_middle(points: ndarray, view: ndarray, views: int) -> Float[ndarray, "n 3"]:
    """Points (n,3) from the mean of those of their own view, so that turning and shifting are told apart well."""
    counts = np.maximum(np.bincount(view, minlength=views), 1)
    middle = np.stack([np.bincount(view, weights=column, minlength=views) for column in points.T], axis=-1) / counts[:, None]
    return points - middle[view]


def _by_point(camera: Camera, points: Float[ndarray, "n 3"]) -> Float[ndarray, "n 2 3"]:
    """Slopes of the pixels by the point in the camera frame."""
    step = SMALL_TURN * np.sqrt((points * points).sum(-1))[:, None]
    moved = [camera.project(points + sign * step * axis, beyond=True) for axis in np.eye(3) for sign in (1.0, -1.0)]
    return np.stack([moved[2 * i] - moved[2 * i + 1] for i in range(3)], axis=-1) / (2.0 * step[:, :, None])


def _by_camera(calibration: Calibration, points: Float[ndarray, "n 3"]) -> Float[ndarray, "n 2 k"]:
    """Slopes of the pixels by the camera's parameters."""
    columns = [np.empty((len(points), 2, 0))]
    for name in parameters_of(calibration):
        step = _step(calibration.camera, name)
        ahead, behind = (stepped(calibration.camera, name, sign * step).project(points, beyond=True) for sign in (1.0, -1.0))
        columns.append((ahead - behind)[:, :, None] / (2.0 * step))
    return np.concatenate(columns, axis=-1)


def parameters_of(calibration: Calibration) -> tuple[str, ...]:
    """The camera's parameters that the fit may have used: estimated, or not zero; and those of a lens frame where there is one."""
    camera, estimated = calibration.camera, calibration.uncertainty.deviations
    K = [name for name in INTRINSICS if name != "skew" or camera.intrinsics.skew or name in estimated]
    coefficients = [name for name, value in _coefficients(camera).items() if name in estimated or value]
    return (*K, *coefficients, *(FRAME if camera.lens_frame else ()))


def stepped(camera: Camera, name: str, step: float) -> Camera:
    """The camera with one of these parameters larger by a step."""
    if name not in FRAME:
        return with_parameters(camera, (name,), np.array([step]))
    values = list((camera.lens_frame or camera.intrinsics).as_tuple())
    values[FRAME.index(name)] += step
    return replace(camera, lens_frame=Intrinsics(*values))


def _step(camera: Camera, name: str) -> float:
    """A step that is small for the parameter: a pixel, or a small share of a coefficient."""
    return 1.0 if name in INTRINSICS + FRAME else SMALL_SHARE * max(abs(_coefficients(camera)[name]), 0.01)


def _coefficients(camera: Camera) -> dict[str, float]:
    """The lens's coefficients by name."""
    return dict(zip(camera.lens.names(), camera.lens.coefficients.tolist(), strict=True))
