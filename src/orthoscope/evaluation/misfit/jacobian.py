"""How the residuals of a calibration move with everything that may explain them: camera, poses, places of the
target's corners.

e = projected minus detected of corner p in view j. q = R_j p, P = q + t_j in the camera frame;  the pixel is
L (x_d, y_d, 1), (x_d, y_d) the lens's image of P' = M P, where M is the identity and L = K but for a camera
with a lens frame L, where M = L^-1 K. With J = de/dP:  d/dd = J R_j for a displacement d of the corner in the
target frame, d/dt = J, and d/dw = J [w x q'] for a turn about the middle of what the view shows, q' from
there. An entry (a,b) of L moves component a of the pixel by (x_d, y_d, 1)_b; with a lens frame it also moves
P' by -L^-1 e_a P'_b, and the same entry of K then moves P' by L^-1 e_a P_b.
"""

from __future__ import annotations

from dataclasses import replace
from typing import NamedTuple

import numpy as np

from orthoscope.fitting.calibration import Calibration
from orthoscope.fitting.reprojection import with_parameters
from orthoscope.geometry.arrays import Float, Int, ndarray
from orthoscope.models.camera import Camera

__all__ = ["Slopes", "parameters_of", "slopes_of", "stepped"]

ENTRIES = {"fx": (0, 0), "fy": (1, 1), "cx": (0, 2), "cy": (1, 2), "skew": (0, 1)}  # of K: row, column
FRAME = {
    "lens fx": "fx",
    "lens fy": "fy",
    "lens cx": "cx",
    "lens cy": "cy",
}  # of a lens that has a frame of its own


class Slopes(NamedTuple):
    """One row for each corner that has an image, all views together.

    view, corner: which view, which row of the target's points. pixels: detected. residual: (n,2) pixels.
    by_camera: (n,2,k), by `parameters_of`. by_pose: (n,2,6). by_place: (n,2,3) pixels per metre, of the
    corner in the target.
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
        projected, by_point, by_camera = _projected(calibration, points)
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


def _projected(calibration: Calibration, points: Float[ndarray, "3 n"]) -> tuple[ndarray, ndarray, ndarray]:
    """Pixels (2,n), their slopes (3,2,n) by the point in the camera frame, and (k,2,n) by `parameters_of` the
    camera.
    """
    camera, names = calibration.camera, parameters_of(calibration)
    frame = camera.lens_frame or camera.intrinsics
    turn = np.linalg.solve(frame.matrix, camera.intrinsics.matrix) if camera.lens_frame else None
    rays = points if turn is None else turn @ points
    x, y, pull_back = camera.lens.chart.linearise(*rays)
    coefficients = [name for name in names if name in camera.lens.names()]
    at = camera.lens.linearise(x, y, coefficients)
    to_pixel = frame.matrix[:2, :2]
    u, v = np.tensordot(to_pixel, np.array([[at.j_xx, at.j_xy], [at.j_yx, at.j_yy]]), 1)
    by_ray = np.stack([pull_back(*u), pull_back(*v)], axis=1)

    by_camera = np.zeros((len(names), 2, x.size))
    by_coefficient = dict(zip(coefficients, at.by, strict=True))
    for slope, name in zip(by_camera, names, strict=True):
        if name in by_coefficient:
            slope[:] = np.tensordot(to_pixel, np.array(np.broadcast_arrays(*by_coefficient[name])), 1)
        else:
            _set_entry(slope, name, camera, (at.x, at.y, 1.0), by_ray, -rays if name in FRAME else points)
    return (
        np.stack(frame.pixel(at.x, at.y)),
        by_ray if turn is None else np.tensordot(turn.T, by_ray, 1),
        by_camera,
    )


def _set_entry(
    slope: ndarray, name: str, camera: Camera, place: tuple, by_ray: ndarray, moving: Float[ndarray, "3 n"]
) -> None:
    """Adds to slope (2,n), which is 0, those by an entry of K or of the lens frame.

    place: x_d, y_d, 1. by_ray: (3,2,n), by P'. moving: what the entry moves P' by, where there is a lens
    frame: P, or -P'.
    """
    row, column = ENTRIES[FRAME.get(name, name)]
    if name in FRAME or camera.lens_frame is None:
        slope[row] = place[column]
    if camera.lens_frame is not None:
        slope += np.tensordot(np.linalg.inv(camera.lens_frame.matrix)[:, row], by_ray, 1) * moving[column]


def parameters_of(calibration: Calibration) -> tuple[str, ...]:
    """The camera's parameters that the fit may have used: estimated, or not zero; and those of a lens frame
    where there is one.
    """
    camera, estimated = calibration.camera, calibration.uncertainty.deviations
    K = [name for name in ENTRIES if name != "skew" or camera.intrinsics.skew or name in estimated]
    coefficients = [name for name, value in _coefficients(camera).items() if name in estimated or value]
    return (*K, *coefficients, *(FRAME if camera.lens_frame else {}))


def stepped(camera: Camera, name: str, step: float) -> Camera:
    """The camera with one of these parameters larger by a step."""
    if name not in FRAME:
        return with_parameters(camera, (name,), np.array([step]))
    frame, entry = camera.lens_frame or camera.intrinsics, FRAME[name]
    return replace(camera, lens_frame=replace(frame, **{entry: getattr(frame, entry) + step}))


def _coefficients(camera: Camera) -> dict[str, float]:
    """The lens's coefficients by name."""
    return dict(zip(camera.lens.names(), camera.lens.coefficients.tolist(), strict=True))
