"""What the measurements say about camera, spline, poses and single corners: the sums of their linearised
problem.

Unknowns in four groups: z of the camera (k parameters and, for a free lens, the 2 g coefficients of its
displacement, all of x first), six of each view, three of each of the target's corners. With rows u and v of
each corner in each view and their derivatives, every sum that normal equations want is formed once, whichever
group is eliminated later:

    zz zv vv   camera and poses        zc cc vc   the same with corners        z v c   each with the residual

A corner moves its image as its view's translation does, turned into the target's frame: d/dp = R^T d/dt. A
spline's coefficient moves u by f_x B and v by f_y B, so its sums are products with the one matrix B of spline
values (spline_sums.py).
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from orthoscope.fitting.observations import Chunk, Observations, Poses
from orthoscope.fitting.reprojection import POSE, Estimate, Places, Reprojection
from orthoscope.fitting.slopes.residual_slopes import splines_along
from orthoscope.geometry.arrays import Float, ndarray
from orthoscope.methods.decoupled.spline_sums import SplineSums, spline_sums
from orthoscope.models.camera import Camera
from orthoscope.models.intrinsics import Intrinsics
from orthoscope.models.lenses.free import FreeLens
from orthoscope.solve.losses import Loss

__all__ = ["MeasurementSums", "Measurements", "spline_unknowns"]

# A corner has so many coordinates.
SPACE = 3


class MeasurementSums(NamedTuple):
    """The module's sums: cost, zz (n,n), z (n,), zv (m,n,6), vv (m,6,6), v (m,6), zc (p,n,3), cc (p,3,3), c
    (p,3), vc (m,p,6,3).

    Attributes:
        residuals: (m,p,2) predicted minus detected, pixels, not weighted; 0 where a corner was not seen.
    """

    cost: float
    zz: ndarray
    z: ndarray
    zv: ndarray
    vv: ndarray
    v: ndarray
    zc: ndarray
    cc: ndarray
    c: ndarray
    vc: ndarray
    residuals: ndarray


def spline_unknowns(camera: Camera) -> int:
    """How many coefficients the displacement of a camera's lens has, in x and y together; 0 for a formula."""
    return camera.lens.over.coefficients.size if isinstance(camera.lens, FreeLens) else 0


class Measurements:
    """The corners of all views, and what they say at an estimate.

    Args:
        observations: by corner.
        camera: of the kind to come.
        free: its parameters that move.
        corners_move: whether sums with corners are wanted; they are zero otherwise.
    """

    def __init__(
        self, observations: Observations, camera: Camera, free: Sequence[str], *, corners_move: bool = True
    ) -> None:
        self.observations, self.corners_move = observations, corners_move
        corners = observations.ids.shape[1]
        self._reprojection = Reprojection(observations, np.zeros((corners, SPACE)), camera, free)
        self._chunks = observations.chunks()
        self._k = len(free)
        self._last: tuple[tuple[Camera, Poses, Loss], ndarray, MeasurementSums] | None = None

    def sums(
        self, camera: Camera, poses: Poses, points: Float[ndarray, "p 3"], loss: Loss
    ) -> MeasurementSums:
        """The sums at an estimate; points: of the target's corners, metres, target frame.

        Asked for the same again, as when only priors have changed, it gives the same again without work.
        """
        asked = (camera, poses, loss)
        if not (
            self._last
            and all(one is other for one, other in zip(asked, self._last[0], strict=True))
            and (points == self._last[1]).all()
        ):
            self._last = (asked, points, self._sums(camera, poses, points, loss))
        return self._last[2]

    def _sums(
        self, camera: Camera, poses: Poses, points: Float[ndarray, "p 3"], loss: Loss
    ) -> MeasurementSums:
        m, p = self.observations.ids.shape
        k, g = self._k, spline_unknowns(camera) // 2
        n = k + 2 * g
        sums = _zeros(n, m, p)
        cost, places = 0.0, Places(*points.T)
        with np.errstate(invalid="ignore", over="ignore", divide="ignore"):
            for chunk in self._chunks:
                stacked = self._reprojection.stack(Estimate(camera, poses), chunk, places)
                sums.residuals[chunk.rows] = _residuals(stacked)
                part, root = self._weigh(stacked, chunk, loss)
                cost += part
                _add_camera_and_poses(sums, stacked, chunk.rows, k)
                turned = _turned(stacked, poses.rotation[chunk.rows], k) if self.corners_move else None
                if turned is not None:
                    _add_corners(sums, stacked, turned, chunk.rows, k)
                if isinstance(camera.lens, FreeLens):
                    across, down = splines_along(camera.lens, poses.only(chunk.rows), points)
                    found = spline_sums(across * root[:, :, None], down, stacked, turned)
                    _add_spline(sums, found, chunk.rows, k, camera.lens_frame or camera.intrinsics)
        return sums._replace(cost=cost)

    def forget(self) -> None:
        """Give back what the last sums took."""
        self._last = None

    def residuals(
        self, camera: Camera, poses: Poses, points: Float[ndarray, "p 3"]
    ) -> Float[ndarray, "m p 2"]:
        """Projected minus detected, pixels; 0 where a corner was not seen."""
        seen = self.observations.present > 0
        in_camera = points @ poses.rotation.transpose(0, 2, 1) + poses.translation[:, None]
        found = np.zeros((*seen.shape, 2))
        found[seen] = camera.project(in_camera[seen], beyond=True) - self.observations.pixels()[seen]
        return found

    def _weigh(self, stacked: ndarray, chunk: Chunk, loss: Loss) -> tuple[float, ndarray]:
        """The cost of a chunk, and the root of each corner's weight (views, n), by which its rows are
        multiplied here.
        """
        views, n = chunk.u.shape
        e = stacked[:, -1]
        squared = e[:, :n] ** 2 + e[:, n:] ** 2
        root = np.ones((views, n))
        if (weight := loss.weight(squared)) is not None and (weight < 1.0).any():
            root = np.sqrt(weight)
            stacked *= np.concatenate([root, root], axis=1)[:, None]
        return float(loss.cost(squared).sum()), root if chunk.present is None else root * chunk.present


def _zeros(n: int, m: int, p: int) -> MeasurementSums:
    shapes = [
        (n, n),
        (n,),
        (m, n, POSE),
        (m, POSE, POSE),
        (m, POSE),
        (p, n, SPACE),
        (p, SPACE, SPACE),
        (p, SPACE),
        (m, p, POSE, SPACE),
        (m, p, 2),
    ]
    return MeasurementSums(0.0, *(np.zeros(shape) for shape in shapes))


def _residuals(stacked: Float[ndarray, "v columns n2"]) -> Float[ndarray, "v n 2"]:
    return stacked[:, -1].reshape(len(stacked), 2, -1).transpose(0, 2, 1)


def _add_camera_and_poses(sums: MeasurementSums, stacked: ndarray, rows: slice, k: int) -> None:
    gram = stacked @ stacked.transpose(0, 2, 1)
    sums.zz[:k, :k] += gram[:, :k, :k].sum(0)
    sums.z[:k] += gram[:, :k, -1].sum(0)
    sums.zv[rows, :k], sums.vv[rows], sums.v[rows] = gram[:, :k, k:-1], gram[:, k:-1, k:-1], gram[:, k:-1, -1]


def _turned(stacked: ndarray, rotation: ndarray, k: int) -> Float[ndarray, "v 3 2 p"]:
    """d(u, v) by the place of each corner in the target's frame."""
    by_place = rotation.transpose(0, 2, 1) @ stacked[:, k + SPACE : k + POSE]
    return by_place.reshape(len(stacked), SPACE, 2, -1)


def _add_corners(
    sums: MeasurementSums, stacked: ndarray, turned: Float[ndarray, "v 3 2 p"], rows: slice, k: int
) -> None:
    halves = stacked.reshape(*stacked.shape[:2], 2, -1)
    sums.zc[:, :k] += np.einsum("vahp,vchp->acp", turned, halves[:, :k]).transpose(2, 1, 0)
    sums.cc[:] += np.einsum("vahp,vbhp->abp", turned, turned).transpose(2, 0, 1)
    sums.c[:] += np.einsum("vahp,vhp->ap", turned, halves[:, -1]).T
    sums.vc[rows] = np.einsum("vahp,vchp->vacp", turned, halves[:, k:-1]).transpose(0, 3, 2, 1)


def _add_spline(sums: MeasurementSums, found: SplineSums, rows: slice, k: int, frame: Intrinsics) -> None:
    """Sums of the displacement's coefficients: x moves u by fx B; y moves v by fy B and u by skew B."""
    g = len(found.square)
    x, y = slice(k, k + g), slice(k + g, k + 2 * g)
    sums.zz[x, x] += frame.fx**2 * found.square
    sums.zz[x, y] += frame.fx * frame.skew * found.square
    sums.zz[y, x] += frame.fx * frame.skew * found.square
    sums.zz[y, y] += (frame.fy**2 + frame.skew**2) * found.square
    of_y = frame.fy * found.of_v + frame.skew * found.of_u
    for columns, products in ((x, frame.fx * found.of_u), (y, of_y)):
        with_camera = products[:, :, :k].sum(0)
        sums.zz[columns, :k] += with_camera
        sums.zz[:k, columns] += with_camera.T
        sums.z[columns] += products[:, :, -1].sum(0)
        sums.zv[rows, columns] = products[:, :, k:-1]
    if len(found.by_place):
        by_u, by_v = found.by_place
        sums.zc[:, x] += frame.fx * by_u.transpose(2, 0, 1)
        sums.zc[:, y] += (frame.fy * by_v + frame.skew * by_u).transpose(2, 0, 1)
