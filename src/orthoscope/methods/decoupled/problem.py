"""Camera, poses, the target's shape and the lens's displacement in one least-squares problem with priors.

Minimised over the camera (K, base lens, displacement s), the poses and the corners p_i + d_i with d_i =
surface(p_i) + single_i:

    sum over views and corners of rho(|e|^2)
    + sigma^2 ( s'Es / var_s  +  sum surface^2 / var  +  sum single^2 / var )

The priors settle what nothing else does: they have no similarity of the target (poses do that for nothing)
and no displacement of the lens that K and the base can do. Either the views (6 by 6 each) or the single
corners (3 by 3 each) are eliminated, whichever leaves the smaller system; solve/ does not know which.
"""

from __future__ import annotations

from collections.abc import Sequence
from copy import copy
from dataclasses import replace
from functools import cached_property
from typing import NamedTuple

import numpy as np

from orthoscope.fitting.observations import Poses
from orthoscope.fitting.reprojection import POSE
from orthoscope.fitting.slopes.linearised import SharedInverse
from orthoscope.geometry.arrays import Float, ndarray
from orthoscope.geometry.pose import rotation_from_vector
from orthoscope.methods.decoupled.normal_equations import SPACE, Measurements, MeasurementSums
from orthoscope.models.camera import Camera
from orthoscope.models.lenses.free import FreeLens
from orthoscope.models.lenses.spline import Displacement
from orthoscope.models.parameters import Parameters
from orthoscope.models.target_shape import WHOLE, polynomials
from orthoscope.solve.block_system import (
    NormalEquations,
    blocks_times,
    eliminated,
    inverse_roots,
    side_by_side,
)
from orthoscope.solve.losses import Loss
from orthoscope.solve.positive import positive_inverse

__all__ = ["DecoupledEstimate", "Joint", "Known", "Minimum", "Precisions"]

# Smooth patterns have these orders: a pose takes those below, and waves are single corners' matter.
PATTERN_ORDERS = (2, 3, 4)


class DecoupledEstimate(NamedTuple):
    """camera; poses of all views; surface (r,3) coefficients and singles (p,3) displacements of corners,
    metres.
    """

    camera: Camera
    poses: Poses
    surface: ndarray
    singles: ndarray


class Precisions(NamedTuple):
    """sigma^2 over the variance of each prior: surface (r,3) and singles (3,), px^2/m^2; spline, a number
    times its energy.
    """

    surface: ndarray
    singles: ndarray
    spline: float


class Known(NamedTuple):
    """Posterior covariance over sigma^2: of the camera's k parameters; the share of each prior's unknowns
    that the data determined.

    Attributes:
        spline: a number out of its unknowns.
        surface (r,3): each between 0 and 1.
        singles (3,): a number out of all corners, along each axis.
    """

    camera: ndarray
    spline: float
    surface: ndarray
    singles: ndarray


class Minimum(NamedTuple):
    """Of the sums as they are: the step there, of shared unknowns and of blocks; by how much it lowers the
    cost; what the data determined; the inverse that says all this.
    """

    shared: ndarray
    blocks: ndarray
    promised: float
    known: Known
    inverse: SharedInverse


class Joint:
    """The problem for given measurements.

    Args:
        points: (p,3) nominal corners.
        surface: (p,r) what its coefficients multiply.
        energy: (g,g) of the displacement, or none.
        single: whether corners have displacements of their own.
        parts: which corners are of one body.
    """

    def __init__(
        self,
        measurements: Measurements,
        points: Float[ndarray, "p 3"],
        free: Sequence[str],
        *,
        surface: Float[ndarray, "p r"],
        energy: Float[ndarray, "g g"],
        single: bool,
        precisions: Precisions,
        parts: Sequence[slice] = WHOLE,
    ) -> None:
        self.measurements, self.points, self.free = measurements, points, tuple(free)
        self.parts = tuple(parts)
        self.surface, self.energy, self.single, self.precisions = surface, energy, single, precisions
        self._n = len(free) + 2 * len(energy) + SPACE * surface.shape[1]
        views = len(measurements.observations.order)
        self.by_corner = single and SPACE * len(points) >= POSE * views

    @cached_property
    def smooth_patterns(self) -> Float[ndarray, "p c"]:
        """Over the corners that were seen: what alike errors of a view follow."""
        seen = self.measurements.observations.present.max(0) > 0
        return polynomials(self.points, seen, orders=PATTERN_ORDERS, parts=self.parts)

    def corners(self, unknowns: DecoupledEstimate) -> Float[ndarray, "p 3"]:
        """Where the target's corners are."""
        return self.points + self.surface @ unknowns.surface + unknowns.singles

    def residuals(self, unknowns: DecoupledEstimate) -> Float[ndarray, "m p 2"]:
        """Projected minus detected, pixels; 0 where a corner was not seen."""
        return self.measurements.residuals(unknowns.camera, unknowns.poses, self.corners(unknowns))

    def linearise(self, unknowns: DecoupledEstimate, loss: Loss) -> NormalEquations:
        """The solver's sums."""
        return self.with_priors(self.measured(unknowns, loss), unknowns)

    def measured(self, unknowns: DecoupledEstimate, loss: Loss) -> NormalEquations:
        """The sums without priors; asked for the same again it gives the same again."""
        sums = self.measurements.sums(unknowns.camera, unknowns.poses, self.corners(unknowns), loss)
        return self._arranged(self._with_surface(sums))

    def cost(self, unknowns: DecoupledEstimate, loss: Loss, residuals: Float[ndarray, "m p 2"]) -> float:
        """What `linearise` finds the cost to be, of residuals that are known."""
        return float(loss.cost((residuals**2).sum(2)).sum()) + sum(self.penalties(unknowns))

    def weighed(self, precisions: Precisions) -> Joint:
        """The same problem with other priors."""
        other = copy(self)
        other.precisions = precisions
        return other

    def move(
        self, unknowns: DecoupledEstimate, shared: Float[ndarray, " n"], views: Float[ndarray, "b q"]
    ) -> DecoupledEstimate:
        """The estimate after a step; views: of the blocks that were eliminated, views or single corners."""
        k, g = len(self.free), len(self.energy)
        camera = Parameters.of(self.free).moved(unknowns.camera, shared[:k])
        if isinstance(camera.lens, FreeLens):
            moved = camera.lens.over.coefficients + shared[k : k + 2 * g].reshape(2, g).T
            camera = replace(
                camera, lens=replace(camera.lens, over=Displacement(camera.lens.over.lattice, moved))
            )
        surface = unknowns.surface + shared[k + 2 * g : self._n].reshape(-1, SPACE)
        rest = shared[self._n :]
        pose_steps, singles = (
            (rest.reshape(-1, POSE), views) if self.by_corner else (views, rest.reshape(-1, SPACE))
        )
        rotation = rotation_from_vector(pose_steps[:, :3]) @ unknowns.poses.rotation
        poses = Poses(rotation, unknowns.poses.translation + pose_steps[:, 3:])
        return DecoupledEstimate(
            camera, poses, surface, unknowns.singles + singles if self.single else unknowns.singles
        )

    def penalties(self, unknowns: DecoupledEstimate) -> tuple[float, float, float]:
        """What spline, surface and singles add to the cost."""
        over = (
            unknowns.camera.lens.over.coefficients
            if isinstance(unknowns.camera.lens, FreeLens)
            else np.zeros((0, 2))
        )
        surface, singles, spline = self.precisions
        return (
            float(spline * (over * (self.energy @ over)).sum()),
            float((surface * unknowns.surface**2).sum()),
            float((singles * unknowns.singles**2).sum()),
        )

    def minimum(self, sums: NormalEquations) -> Minimum:
        """Where the sums are least, and what is known there.

        Raises:
            LinAlgError: they are least nowhere, as far as numbers go.
        """
        roots = inverse_roots(sums.C)
        inverse, covariance = roots @ roots.transpose(0, 2, 1), positive_inverse(eliminated(sums, roots))
        Y, B = blocks_times(sums.B, inverse), side_by_side(sums.B)
        shared = -(covariance @ (sums.a - Y.reshape(B.shape) @ sums.c.T.ravel()))
        right = sums.c + (shared @ B).reshape(sums.c.T.shape).T
        blocks = -(inverse @ right[:, :, None])[:, :, 0]
        promised = float(-(sums.a @ shared) - (sums.c * blocks).sum())
        known = self._known(covariance, inverse, Y)
        kept = (
            SharedInverse(covariance, inverse, B) if self.by_corner else SharedInverse.of_shared(covariance)
        )
        return Minimum(shared, blocks, promised, known, kept)

    def _known(self, covariance: ndarray, inverse: ndarray, Y: Float[ndarray, "s q b"]) -> Known:
        """Y: what was left, with the blocks that were eliminated, times their inverse."""
        k, g, n = len(self.free), len(self.energy), self._n
        spread = np.diag(covariance)
        in_spline = (
            sum(np.vdot(self.energy, covariance[i : i + g, i : i + g]) for i in (k, k + g)) if g else 0.0
        )
        singles = np.zeros(SPACE)
        if self.single:
            if self.by_corner:
                singles = np.array([np.vdot(covariance, part @ part.T) for part in Y.transpose(1, 0, 2)])
                singles += np.diagonal(inverse, axis1=1, axis2=2).sum(0)
            else:
                singles = spread[n:].reshape(-1, SPACE).sum(0)
            singles = np.clip(len(self.points) - self.precisions.singles * singles, 0.0, len(self.points))
        return Known(
            covariance[:k, :k],
            2 * g - self.precisions.spline * float(in_spline),
            np.clip(1.0 - self.precisions.surface * spread[k + 2 * g : n].reshape(-1, SPACE), 0.0, 1.0),
            singles,
        )

    def _with_surface(self, sums: MeasurementSums) -> MeasurementSums:
        """The camera's group grown by the surface's coefficients, which move every corner at once."""
        S, (p, r) = self.surface, self.surface.shape
        if r == 0:
            return sums
        n, m = len(sums.z), len(sums.vv)
        z_surface = np.tensordot(sums.zc, S, axes=(0, 0)).transpose(0, 2, 1).reshape(n, r * SPACE)
        c_surface = (sums.cc[:, None] * S[:, :, None, None]).reshape(
            p, r * SPACE, SPACE
        )  # (p, (r, axis), axis)
        surface_surface = (
            np.tensordot(S, c_surface, axes=(0, 0)).transpose(1, 0, 2).reshape(r * SPACE, r * SPACE)
        )
        v_surface = np.tensordot(sums.vc, S, axes=(1, 0)).transpose(0, 3, 2, 1).reshape(m, r * SPACE, POSE)
        return sums._replace(
            zz=np.block([[sums.zz, z_surface], [z_surface.T, surface_surface]]),
            z=np.concatenate([sums.z, (S.T @ sums.c).ravel()]),
            zv=np.concatenate([sums.zv, v_surface], axis=1),
            zc=np.concatenate([sums.zc, c_surface], axis=1),
        )

    def with_priors(self, sums: NormalEquations, unknowns: DecoupledEstimate) -> NormalEquations:
        """The sums of the measurements at a place, and what the priors add there."""
        k, g = len(self.free), len(self.energy)
        surface, singles, spline = self.precisions
        A, a = sums.A.copy(), sums.a.copy()  # the measurements keep theirs
        if isinstance(unknowns.camera.lens, FreeLens):
            pull = spline * self.energy @ unknowns.camera.lens.over.coefficients
            for i in (0, 1):
                part = slice(k + i * g, k + (i + 1) * g)
                A[part, part] += spline * self.energy
                a[part] += pull[:, i]
        _add_to_diagonal(A, a, k + 2 * g, surface.ravel(), unknowns.surface.ravel())
        cost = sums.cost + sum(self.penalties(unknowns))
        if not self.single:
            return sums._replace(cost=cost, A=A, a=a)
        if self.by_corner:
            C, c = sums.C + np.diag(singles), sums.c + singles * unknowns.singles
            return sums._replace(cost=cost, A=A, a=a, C=C, c=c)
        every = np.tile(singles, len(self.points))
        _add_to_diagonal(A, a, self._n, every, unknowns.singles.ravel())
        return sums._replace(cost=cost, A=A, a=a)

    def _arranged(self, sums: MeasurementSums) -> NormalEquations:
        """One group eliminated, the others shared."""
        if not self.single:
            return NormalEquations(sums.cost, sums.zz, sums.z, sums.zv, sums.vv, sums.v)
        if self.by_corner:
            A, a = _bordered(sums.zz, sums.z, sums.zv, sums.vv, sums.v)
            crossed = _joined(sums.zc, sums.vc.transpose(1, 0, 2, 3).reshape(len(sums.cc), -1, SPACE))
            return NormalEquations(sums.cost, A, a, crossed, sums.cc, sums.c)
        A, a = _bordered(sums.zz, sums.z, sums.zc, sums.cc, sums.c)
        crossed = _joined(sums.zv, sums.vc.transpose(0, 1, 3, 2).reshape(len(sums.vv), -1, POSE))
        return NormalEquations(sums.cost, A, a, crossed, sums.vv, sums.v)


def _joined(one: Float[ndarray, "b n q"], other: Float[ndarray, "b o q"]) -> Float[ndarray, "b s q"]:
    """Both below each other, stored in the order of `side_by_side`."""
    (blocks, n, q), o = one.shape, other.shape[1]
    joined = np.empty((n + o, q, blocks))
    joined[:n], joined[n:] = one.transpose(1, 2, 0), other.transpose(1, 2, 0)
    return joined.transpose(2, 0, 1)


def _add_to_diagonal(A: ndarray, a: ndarray, first: int, precisions: ndarray, unknowns: ndarray) -> None:
    """Adds priors about zero of unknowns that stand beside each other."""
    some = np.arange(first, first + len(precisions))
    A[some, some] += precisions
    a[some] += precisions * unknowns


def _bordered(zz: ndarray, z: ndarray, zb: ndarray, bb: ndarray, b: ndarray) -> tuple[ndarray, ndarray]:
    """The system of z and of blocks that know each other only through it."""
    n, (blocks, q) = len(z), b.shape
    A = np.zeros((n + blocks * q, n + blocks * q))
    A[:n, :n] = zz
    A[:n, n:] = zb.transpose(1, 0, 2).reshape(n, blocks * q)
    A[n:, :n] = A[:n, n:].T
    each = np.arange(blocks)
    A[n:, n:].reshape(blocks, q, blocks, q)[each, :, each] = bb
    return A, np.concatenate([z, b.ravel()])
