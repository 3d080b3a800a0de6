"""How the residuals of all views move with camera, displacement of the lens, poses and the places of the
target's corners.

A corner moves its image as its view's translation does, turned into the target's frame: d/dp = R^T d/dt.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from orthoscope.fitting.observations import Observations, Poses
from orthoscope.fitting.reprojection import POSE, Estimate, Places, Reprojection
from orthoscope.fitting.slopes.linearised import ResidualSlopes
from orthoscope.fitting.slopes.spline_values import SplineValues
from orthoscope.geometry.arrays import Float, ndarray
from orthoscope.models.camera import Camera
from orthoscope.models.lenses.free import FreeLens

__all__ = ["by_corner", "residual_slopes", "splines_along"]

# A corner has so many coordinates.
SPACE = 3


def residual_slopes(
    observations: Observations,
    camera: Camera,
    poses: Poses,
    points: Float[ndarray, "p 3"],
    free: Sequence[str],
    *,
    moves: bool,
) -> tuple[ResidualSlopes, Float[ndarray, "m n"]]:
    """The slopes at a camera and poses, without a surface, and the residuals (m,2p).

    Args:
        observations: by corner.
        points: the target's corners, metres.
        free: the camera's parameters that move.
        moves: whether slopes by the places of corners are wanted.
    """
    m, p = observations.ids.shape
    k = len(free)
    of_camera, of_pose, residual = np.empty((m, k, 2 * p)), np.empty((m, POSE, 2 * p)), np.empty((m, 2 * p))
    of_corner, of_spline = np.empty((m, p if moves else 0, 2, SPACE)), _room_for_splines(camera, m, p)
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
            across, down = splines_along(camera.lens, poses.only(chunk.rows), points)
            of_spline.across[chunk.rows] = across
            of_spline.down[chunk.rows] = down * observations.present[chunk.rows, :, None]
    frame = camera.lens_frame or camera.intrinsics
    surface = np.zeros((p, 0))
    return ResidualSlopes(of_camera, of_pose, of_spline, of_corner, surface, frame.matrix[:2, :2]), residual


def by_corner(
    by_translation: Float[ndarray, "v 3 n2"], rotation: Float[ndarray, "v 3 3"]
) -> Float[ndarray, "v n 3 2"]:
    """d(u, v) by the place of each corner in the target's frame."""
    views, _, rows = by_translation.shape
    turned = (rotation.transpose(0, 2, 1) @ by_translation).reshape(views, SPACE, 2, rows // 2)
    return np.ascontiguousarray(turned.transpose(0, 3, 1, 2))


def splines_along(
    lens: FreeLens, poses: Poses, points: Float[ndarray, "p 3"]
) -> tuple[Float[ndarray, "v p nx"], Float[ndarray, "v p ny"]]:
    """The values of the splines across and down at every corner's place in the base's distorted plane."""
    in_camera = np.einsum("vab,pb->avp", poses.rotation, points) + poses.translation.T[:, :, None]
    x, y = lens.base.warp(*lens.chart.flatten(*in_camera))
    return lens.over.lattice.along(x, 0), lens.over.lattice.along(y, 1)


def _room_for_splines(camera: Camera, views: int, corners: int) -> SplineValues:
    """Values yet to be filled in."""
    if not isinstance(camera.lens, FreeLens):
        return SplineValues.none(views, corners)
    across, down = camera.lens.over.lattice.shape
    return SplineValues(np.empty((views, corners, down)), np.empty((views, corners, across)))
