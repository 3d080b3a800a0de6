"""The reprojection problem: how pixels move with the camera and with the pose of each view.

e = projected minus detected, of corner p in view j:  q = R_j p,  P = M (q + t_j),  (x, y) = chart(P),  (x_d,
y_d) = lens(x, y), (u, v) = L (x_d, y_d, 1). M is the identity and L = K but for a camera with a lens frame,
where M = L^-1 K. Derivatives run backwards from u and from v: a covector of the distorted plane through the
lens's Jacobian, through the chart, to g = d/dP; then d/dt = M^T g and, for a rotation step on the left, d/dw
= q x d/dt. Each chunk of views becomes one stacked array (view, column, 2 n) whose Gram matrix holds all sums
that the solver wants.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from orthoscope.fitting.observations import Chunk, Observations, Poses
from orthoscope.geometry.arrays import Float, InputError, ndarray
from orthoscope.geometry.pose import rotation_from_vector
from orthoscope.models.camera import Camera, Intrinsics
from orthoscope.models.free_lens import FreeLens
from orthoscope.models.newton_inverse import Bent, Warp
from orthoscope.models.spline import Displacement
from orthoscope.solve.least_squares import NormalEquations
from orthoscope.solve.losses import Loss

__all__ = ["Estimate", "Places", "Reprojection", "parameter_columns", "with_parameters"]

INTRINSICS = ("fx", "fy", "cx", "cy", "skew")
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

    free: parameters of K and the lens that move; `fx=fy` ties two together; none of them leaves the camera
    fixed (resection). Raises InputError for a parameter that the camera does not have, that is named twice,
    or that is K's where the lens has a frame of its own (the lens then hides K: a straight image is fitted by
    itself).
    """

    def __init__(
        self,
        observations: Observations,
        points: Float[ndarray, "m 3"],
        camera: Camera,
        free: Sequence[str] = (),
    ) -> None:
        _check_free(camera, free)
        self.free = tuple(free)
        self._coefficients = _coefficients(free)
        self._chunks = observations.chunks()
        self._places = [_places(points[chunk.ids]) for chunk in self._chunks]
        widest = max((chunk.u.size for chunk in self._chunks), default=0)
        self._buffer = np.empty((len(free) + POSE + 1) * 2 * widest)
        self._views = len(observations.order)

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
            with_parameters(camera, self.free, shared), Poses(rotation, poses.translation + views[:, 3:])
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

        places: of the chunk's corners in the target's frame. The array is the problem's own and is written
        again by the next call.
        """
        camera, poses = estimate
        frame = camera.lens_frame or camera.intrinsics
        turn = None if camera.lens_frame is None else np.linalg.solve(frame.matrix, camera.intrinsics.matrix)
        rotation, translation = poses.rotation[chunk.rows, :, :, None], poses.translation[chunk.rows, :, None]
        X, Y, Z = places
        q = [rotation[:, i, 0] * X + rotation[:, i, 1] * Y for i in range(3)]
        if Z is not None:
            q = [q[i] + rotation[:, i, 2] * Z for i in range(3)]
        P = [q[i] + translation[:, i] for i in range(3)]
        if turn is not None:
            P = [turn[i, 0] * P[0] + turn[i, 1] * P[1] + turn[i, 2] * P[2] for i in range(3)]
        x, y, pull_back = camera.lens.chart.linearise(*P)
        at = camera.lens.linearise(x, y, self._coefficients)

        views, n = chunk.u.shape
        k = len(self.free)
        stacked = self._buffer[: views * (k + POSE + 1) * 2 * n].reshape(views, k + POSE + 1, 2 * n)
        by_lens = dict(zip(self._coefficients, at.by, strict=True))
        for i, group in enumerate(self.free):
            _set_parameter(stacked[:, i, :n], stacked[:, i, n:], group, at, frame, by_lens)
        for half, predicted, seen, slopes in zip(
            (slice(None, n), slice(n, None)),
            _pixels(at, frame),
            (chunk.u, chunk.v),
            _pixels_by_place(at, frame),
            strict=True,
        ):
            _set_pose(stacked[:, k:-1, half], pull_back(*slopes), q, turn)
            np.subtract(predicted, seen, out=stacked[:, -1, half])
        if chunk.present is not None:
            absent = np.concatenate([chunk.present, chunk.present], axis=1) == 0
            np.copyto(stacked, 0.0, where=absent[:, None])
        return stacked


def _places(points: Float[ndarray, "v n 3"]) -> Places:
    """Corners by coordinate."""
    X, Y, Z = (np.ascontiguousarray(points[..., axis]) for axis in range(3))
    return Places(X, Y, Z if Z.any() else None)


def _check_free(camera: Camera, free: Sequence[str]) -> None:
    known = camera.lens.names() if camera.lens_frame else (*INTRINSICS, *camera.lens.names())
    names = [name for group in free for name in group.split("=")]
    for name in names:
        if name not in known:
            raise InputError(
                f"parameter {name!r} of this camera cannot be estimated; expected some of {', '.join(known)}."
            )
        if names.count(name) > 1:
            raise InputError(
                f"parameter {name!r} is to be estimated more than once; expected each name once. Drop the"
                " repeats."
            )


def with_parameters(camera: Camera, free: Sequence[str], step: Float[ndarray, " k"]) -> Camera:
    """The camera after a step of its free parameters; a focal length never turns negative (it halves
    instead).
    """
    steps = {
        name: float(length) for group, length in zip(free, step, strict=True) for name in group.split("=")
    }
    values = dict(zip(INTRINSICS, camera.intrinsics.as_tuple(), strict=True))
    for name in INTRINSICS:
        moved = values[name] + steps.pop(name, 0.0)
        values[name] = 0.5 * values[name] if name in ("fx", "fy") and not moved > 0 else moved
    coefficients = dict(zip(camera.lens.names(), camera.lens.coefficients.tolist(), strict=True))
    moved_lens = {name: coefficients[name] + length for name, length in steps.items()}
    K, lens = Intrinsics(**values), camera.lens.with_coefficients(**moved_lens)
    if isinstance(lens, FreeLens) and camera.lens_frame is None:
        lens = _kept_in_place(lens, camera.intrinsics, K)
    return replace(camera, intrinsics=K, lens=lens)


def _kept_in_place(lens: FreeLens, before: Intrinsics, after: Intrinsics) -> FreeLens:
    """The lens with its displacement's lattice where it was in the image.

    A lattice that went with K's principal point would have to be learnt anew wherever K goes, and would seem
    to say where it is.
    """
    scale = np.array([before.fx / after.fx, before.fy / after.fy])
    shift = np.array([(before.cx - after.cx) / after.fx, (before.cy - after.cy) / after.fy])
    return replace(lens, over=Displacement(lens.over.lattice.seen_from(scale, shift), lens.over.coefficients))


def parameter_columns(
    camera: Camera, x: ndarray, y: ndarray, free: Sequence[str]
) -> tuple[Float[ndarray, "k 2 n"], Float[ndarray, "2 n"]]:
    """d(u, v) by each free parameter at places (x, y) of the lens's chart, and (u, v) themselves."""
    frame, wanted = camera.lens_frame or camera.intrinsics, _coefficients(free)
    at = camera.lens.linearise(x, y, wanted)
    by_lens = dict(zip(wanted, at.by, strict=True))
    columns = np.empty((len(free), 2, x.size))
    for column, group in zip(columns, free, strict=True):
        _set_parameter(column[0], column[1], group, at, frame, by_lens)
    return columns, np.stack(_pixels(at, frame))


def _coefficients(free: Sequence[str]) -> tuple[str, ...]:
    """The names in `free` that are the lens's, each once."""
    return tuple(dict.fromkeys(name for group in free for name in group.split("=") if name not in INTRINSICS))


def _squared(residual: ndarray, chunk: Chunk) -> ndarray:
    """|e|^2 of each corner of a chunk."""
    n = chunk.u.shape[1]
    return residual[:, :n] ** 2 + residual[:, n:] ** 2


def _pixels(at: Warp, frame: Intrinsics) -> tuple[ndarray, ndarray]:
    """u and v of distorted places."""
    u = frame.fx * at.x + frame.cx
    return u + frame.skew * at.y if frame.skew else u, frame.fy * at.y + frame.cy


def _pixels_by_place(at: Warp, frame: Intrinsics) -> tuple[tuple[ndarray, ndarray], tuple[ndarray, ndarray]]:
    """Derivatives of u, and of v, by the place (x, y) in the lens's chart."""
    u_x, u_y = frame.fx * at.j_xx, frame.fx * at.j_xy
    if frame.skew:
        u_x, u_y = u_x + frame.skew * at.j_yx, u_y + frame.skew * at.j_yy
    return (u_x, u_y), (frame.fy * at.j_yx, frame.fy * at.j_yy)


def _set_parameter(
    u: ndarray,
    v: ndarray,
    group: str,
    at: Warp,
    frame: Intrinsics,
    by_lens: dict[str, tuple[ndarray, ndarray]],
) -> None:
    """Writes d(u, v) by a parameter, or by those that are tied in a group, into the two halves of a
    column.
    """
    first, *others = (_slopes(name, at, frame, by_lens) for name in group.split("="))
    u[...], v[...] = first
    for by_u, by_v in others:
        u += by_u
        v += by_v


def _slopes(
    name: str, at: Warp, frame: Intrinsics, by_lens: dict[str, tuple[ndarray, ndarray]]
) -> tuple[ndarray | float, ndarray | float]:
    """d(u, v) by one parameter, numbers where it is the same everywhere."""
    if name in by_lens:
        x, y = by_lens[name]
        along = frame.fx * x
        return along + frame.skew * y if frame.skew else along, frame.fy * y
    u, v = _entry(name, at.x, at.y)
    if at.bent is None:
        return u, v
    moved_u, moved_v = _carried(name, at.bent, frame)
    return u + moved_u, v + moved_v


def _entry(name: str, x: ndarray, y: ndarray) -> tuple[ndarray | float, ndarray | float]:
    """d(u, v) of K (x, y, 1) by an entry of K."""
    return {"fx": (x, 0.0), "fy": (0.0, y), "cx": (1.0, 0.0), "cy": (0.0, 1.0), "skew": (y, 0.0)}[name]


def _carried(name: str, bent: Bent, frame: Intrinsics) -> tuple[ndarray, ndarray]:
    """d(u, v) by an entry of K through the displacement alone, which stands in the image and so meets a plane
    that K moves beneath it.

    Skew moves nothing there: a lattice is shifted and stretched with the image (`_kept_in_place`), not
    sheared.
    """
    u, v = _entry(name, bent.x, bent.y) if name != "skew" else (0.0, 0.0)
    x, y = u / frame.fx, v / frame.fy
    s_x, s_y = bent.s_xx * x + bent.s_xy * y, bent.s_yx * x + bent.s_yy * y
    return frame.fx * s_x + frame.skew * s_y, frame.fy * s_y


def _set_pose(
    columns: ndarray, g: tuple[ndarray, ndarray, ndarray], q: list[ndarray], turn: ndarray | None
) -> None:
    """Writes d/dw and d/dt into six columns (views, 6, n), from g = d/dP."""
    if turn is not None:
        # type: ignore[assignment]
        g = tuple(turn[0, i] * g[0] + turn[1, i] * g[1] + turn[2, i] * g[2] for i in range(3))
    for i in range(3):
        j, k = (i + 1) % 3, (i + 2) % 3
        np.multiply(q[j], g[k], out=columns[:, i])
        columns[:, i] -= q[k] * g[j]
        columns[:, 3 + i] = g[i]
