"""The reprojection problem: how pixels move with the camera and with the pose of each view.

e = projected minus detected, of corner p in view j: q = R_j p, P = q + t_j, the camera's image of P
(models/pixel_slopes.py has its slopes). With g = d/dP: d/dt = g and, for a rotation step on the left, d/dw =
q x g. Each chunk of views becomes one stacked array (view, column, 2 n) whose Gram matrix holds all sums that
the solver wants.
"""

from __future__ import annotations

from collections.abc import Iterable
from functools import cached_property
from typing import NamedTuple

import numpy as np

from orthoscope.fitting.observations import Chunk, Observations, Poses
from orthoscope.geometry.arrays import Float, ndarray
from orthoscope.geometry.pose import rotation_from_vector
from orthoscope.models.camera import Camera
from orthoscope.models.lenses.charts import Covector
from orthoscope.models.parameters import Parameters
from orthoscope.solve.block_system import NormalEquations
from orthoscope.solve.losses import Loss

__all__ = ["POSE", "Estimate", "Places", "Reprojection"]

# A pose has so many parameters.
POSE = 6


class Places(NamedTuple):
    """Corners of a chunk in the target's frame, metres, arrays that broadcast to (views, n); Z is None where
    all lie in the plane.
    """

    X: ndarray
    Y: ndarray
    Z: ndarray | None


class Estimate(NamedTuple):
    """The unknowns: a camera and the pose of each row of the observations."""

    camera: Camera
    poses: Poses


class Reprojection:
    """The problem for given observations, target points (m,3) and free parameters.

    Args:
        observations: what was seen.
        points: (m,3) metres, target frame.
        camera: of the kind to come.
        free: parameters of K, the lens and its frame that move (models/parameters.py); none leaves the camera
            fixed (resection).
    Raises:
        InputError: the camera does not have one of the parameters, or one is named twice.
    """

    def __init__(
        self,
        observations: Observations,
        points: Float[ndarray, "m 3"],
        camera: Camera,
        free: Parameters | Iterable[str] = (),
    ) -> None:
        self.parameters = Parameters.of(free)
        self.parameters.check(camera)
        self.free = self.parameters.names
        self._chunks = observations.chunks()
        self._points = points
        widest = max((chunk.u.size for chunk in self._chunks), default=0)
        self._buffer = np.empty((len(self.free) + POSE + 1) * 2 * widest)
        self._views = len(observations.order)

    @cached_property
    def _places(self) -> list[Places]:
        return [_places(self._points[chunk.ids]) for chunk in self._chunks]

    def linearise(self, unknowns: Estimate, loss: Loss) -> NormalEquations:
        """The solver's sums at an estimate."""
        k, m = len(self.free), self._views
        gram, cost = np.empty((m, k + POSE + 1, k + POSE + 1)), 0.0
        with np.errstate(invalid="ignore", over="ignore", divide="ignore"):
            for chunk, places in zip(self._chunks, self._places, strict=True):
                stacked = self.stack(unknowns, chunk, places)
                squared = _squared(stacked[:, -1], chunk)
                cost += float(loss.cost(squared).sum())
                if (weight := loss.weight(squared)) is not None:
                    stacked *= np.sqrt(np.concatenate([weight, weight], axis=1))[:, None]
                np.matmul(stacked, stacked.transpose(0, 2, 1), out=gram[chunk.rows])
        shared = gram[:, :k].sum(0)
        return NormalEquations(
            cost, shared[:, :k], shared[:, -1], gram[:, :k, k:-1], gram[:, k:-1, k:-1], gram[:, k:-1, -1]
        )

    def move(
        self, unknowns: Estimate, shared: Float[ndarray, " k"], views: Float[ndarray, "m 6"]
    ) -> Estimate:
        """The estimate after a step."""
        camera, poses = unknowns
        rotation = rotation_from_vector(views[:, :3]) @ poses.rotation
        return Estimate(
            self.parameters.moved(camera, shared), Poses(rotation, poses.translation + views[:, 3:])
        )

    def residuals(self, estimate: Estimate) -> Float[ndarray, "m n 2"]:
        """Projected minus detected of the whole table; NaN where the formula has no image; 0 in the
        padding.
        """
        width = max(chunk.u.shape[1] for chunk in self._chunks)
        out = np.zeros((self._views, width, 2))
        with np.errstate(invalid="ignore", over="ignore", divide="ignore"):
            for chunk, places in zip(self._chunks, self._places, strict=True):
                row = self.stack(estimate, chunk, places)[:, -1]
                n = chunk.u.shape[1]
                out[chunk.rows, :n, 0], out[chunk.rows, :n, 1] = row[:, :n], row[:, n:]
        return out

    def stack(self, estimate: Estimate, chunk: Chunk, places: Places) -> ndarray:
        """(views, columns, 2 n): d/d shared, d/d pose, residual; first n of a row for u, the others for v.

        The array is the problem's own and is written again by the next call.

        Args:
            places: of the chunk's corners in the target's frame.
        """
        camera, poses = estimate
        rotation, translation = poses.rotation[chunk.rows, :, :, None], poses.translation[chunk.rows, :, None]
        X, Y, Z = places
        q = [rotation[:, i, 0] * X + rotation[:, i, 1] * Y for i in range(3)]
        if Z is not None:
            q = [q[i] + rotation[:, i, 2] * Z for i in range(3)]
        image = camera.linearise((q[i] + translation[:, i] for i in range(3)), self.parameters)

        views, n = chunk.u.shape
        k = len(self.free)
        stacked = self._buffer[: views * (k + POSE + 1) * 2 * n].reshape(views, k + POSE + 1, 2 * n)
        for i in range(k):
            image.write(i, stacked[:, i, :n], stacked[:, i, n:])
        for half, predicted, seen, slopes in zip(
            (slice(None, n), slice(n, None)),
            (image.u, image.v),
            (chunk.u, chunk.v),
            image.by_point,
            strict=True,
        ):
            _set_pose(stacked[:, k:-1, half], slopes, q)
            np.subtract(predicted, seen, out=stacked[:, -1, half])
        if chunk.present is not None:
            absent = np.concatenate([chunk.present, chunk.present], axis=1) == 0
            np.copyto(stacked, 0.0, where=absent[:, None])
        return stacked


def _places(points: Float[ndarray, "v n 3"]) -> Places:
    """Corners by coordinate."""
    X, Y, Z = (np.ascontiguousarray(points[..., axis]) for axis in range(3))
    return Places(X, Y, Z if Z.any() else None)


def _squared(residual: ndarray, chunk: Chunk) -> ndarray:
    """|e|^2 of each corner of a chunk."""
    n = chunk.u.shape[1]
    return residual[:, :n] ** 2 + residual[:, n:] ** 2


def _set_pose(columns: ndarray, g: Covector, q: list[ndarray]) -> None:
    """Writes d/dw and d/dt into six columns (views, 6, n), from g = d/dP."""
    for i in range(3):
        j, k = (i + 1) % 3, (i + 2) % 3
        np.multiply(q[j], g[k], out=columns[:, i])
        columns[:, i] -= q[k] * g[j]
        columns[:, 3 + i] = g[i]
