"""How the residuals of a calibration move with everything that may explain them: camera, poses, places of the
target's corners.

e = projected minus detected of corner p in view j. q = R_j p, P = q + t_j in the camera frame. With J =
de/dP, which the camera says of itself (models/pixel_slopes.py): d/dd = J R_j for a displacement d of the
corner in the target frame, d/dt = J, and d/dw = J [w x q'] for a turn about the middle of what the view
shows, q' from there.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from orthoscope.fitting.calibration import Calibration
from orthoscope.geometry.arrays import Float, Int, ndarray
from orthoscope.models.camera import Camera
from orthoscope.models.parameters import INTRINSICS, Parameters

__all__ = ["Slopes", "parameters_of", "slopes_of", "stepped"]

# These parameters belong to a lens that has a frame of its own.
FRAME_NAMES = ("frame_fx", "frame_fy", "centre_x", "centre_y")


class Slopes(NamedTuple):
    """One row for each corner that has an image, all views together.

    Attributes:
        view, corner: which view, which row of the target's points.
        pixels: detected.
        residual: (n,2) pixels.
        by_camera: (n,2,k), by `parameters_of`.
        by_pose: (n,2,6).
        by_place: (n,2,3) pixels per metre, of the corner in the target.
    """

    view: Int[ndarray, " n"]
    corner: Int[ndarray, " n"]
    pixels: Float[ndarray, "n 2"]
    residual: Float[ndarray, "n 2"]
    by_camera: Float[ndarray, "n 2 k"]
    by_pose: Float[ndarray, "n 2 6"]
    by_place: Float[ndarray, "n 2 3"]


def slopes_of(calibration: Calibration) -> Slopes:
    """Residuals and their slopes at the calibration's own estimate; slopes lie in memory column by column."""
    views, poses = calibration.detections.views, calibration.camera_from_target
    view = np.repeat(np.arange(len(views)), [len(seen.ids) for seen in views])
    corner = np.concatenate([np.empty(0, dtype=np.int64), *(seen.ids for seen in views)])
    pixels = np.concatenate([np.empty((0, 2)), *(seen.pixels for seen in views)])
    rotation = _of_each([pose.rotation.ravel() for pose in poses], 9, view).reshape(3, 3, -1)
    turned = (rotation * np.ascontiguousarray(calibration.target_points.T)[:, corner]).sum(1)
    points = turned + _of_each([pose.translation for pose in poses], 3, view)

    with np.errstate(invalid="ignore", over="ignore", divide="ignore"):
        image = calibration.camera.linearise(points, parameters_of(calibration))
        projected, by_camera = np.stack([image.u, image.v]), image.by_parameters()
        by_point = np.stack([np.stack(by) for by in zip(*image.by_point, strict=True)])  # (3, 2, n)
        q = _from_their_middle(turned, view, len(views))
        by_turn = [q[i - 2] * by_point[i - 1] - q[i - 1] * by_point[i - 2] for i in range(3)]
        by_place = (rotation[:, :, None] * by_point[:, None]).sum(0)
    by_pose = np.concatenate([by_turn, by_point])
    slopes = Slopes(view, corner, pixels, (projected - pixels.T).T, by_camera.T, by_pose.T, by_place.T)
    usable = (
        np.isfinite(slopes.residual).all(1)
        & np.isfinite(by_point).all((0, 1))
        & np.isfinite(by_camera).all((0, 1))
    )
    return slopes if usable.all() else Slopes(*(rows.T[..., usable].T for rows in slopes))


def _of_each(values: list[ndarray], width: int, view: Int[ndarray, " n"]) -> Float[ndarray, "width n"]:
    """The numbers (width,) that each row's view has."""
    return np.ascontiguousarray(np.array(values).reshape(-1, width).T)[:, view]


def _from_their_middle(
    points: Float[ndarray, "3 n"], view: Int[ndarray, " n"], views: int
) -> Float[ndarray, "3 n"]:
    """Points from the mean of those of their own view, so that turning and shifting are told apart well."""
    counts = np.maximum(np.bincount(view, minlength=views), 1)
    return (
        points
        - np.array([np.bincount(view, weights=row, minlength=views) / counts for row in points])[:, view]
    )


def parameters_of(calibration: Calibration) -> tuple[str, ...]:
    """The camera's parameters that the fit may have used: estimated, or not zero; and those of a lens frame
    where there is one.
    """
    camera, estimated = calibration.camera, calibration.uncertainty.deviations
    K = [name for name in INTRINSICS if name != "skew" or camera.intrinsics.skew or name in estimated]
    coefficients = [name for name, value in _coefficients(camera).items() if name in estimated or value]
    return (*K, *coefficients, *(FRAME_NAMES if camera.lens_frame else ()))


def stepped(camera: Camera, name: str, step: float) -> Camera:
    """The camera with one of these parameters larger by a step."""
    return Parameters.of((name,)).moved(camera, np.array([step]))


def _coefficients(camera: Camera) -> dict[str, float]:
    """The lens's coefficients by name."""
    return dict(zip(camera.lens.names(), camera.lens.coefficients.tolist(), strict=True))
