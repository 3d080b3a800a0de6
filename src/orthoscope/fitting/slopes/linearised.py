"""A finished fit as linear algebra: how the residuals of each view move with what all views share.

At the minimum of   sum over views of |W_j^(1/2) e_j|^2 + x'L x   the unknowns are x (camera, displacement of
the lens, surface and single corners of the target) and one pose for each view.  With the pose of its own view
fitted to it, a small change of x moves the weighted residual of view j by

    A_j x,      A_j = (I - P_j P_j^+) W_j^(1/2) J_j,      P_j = W_j^(1/2) d e_j / d pose_j,   J_j = d e_j / d
    x,

and H = sum A_j'A_j + L is what the data and the priors know of x together.  No A_j is ever formed: J_j has a
few dense columns for the camera, one matrix of spline values for both coordinates, and three columns for each
corner that only this corner's rows know; products with A_j and A_j' are enough for all that is asked
(leave_one_out.py).
The order of x: the camera's k named parameters, the displacement's g coefficients along x, then g along y,
three for each polynomial of the surface, three for each corner.
Rows of a view are the corners of the whole target, u first and then v, 0 where a corner was not seen.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property
from typing import NamedTuple

import numpy as np

from orthoscope.fitting.slopes.spline_values import SplineValues
from orthoscope.geometry.arrays import Float, Int, ndarray
from orthoscope.models.camera import Camera

__all__ = ["Linearised", "ResidualSlopes", "SharedInverse"]

# A corner has so many coordinates.
SPACE = 3


@dataclass(frozen=True, eq=False)
class ResidualSlopes:
    """How the residuals of m views of p corners move, not weighted; 0 where a corner was not seen.

    Attributes:
        camera: (m,k,2p) by the camera's named parameters.
        pose: (m,6,2p) by the pose of the view.
        spline: value of each of the g splines of the lens's displacement at each corner; g = 0 for a formula.
        corner: (m,p,2,3) pixels per metre, by the place of each corner in the target's frame; p = 0 there
            where the target is flat.
        surface: (p,r) what the surface's coefficients multiply; r = 0 where there is none.
        plane: (2,2) d pixel / d distorted place.
    """

    camera: Float[ndarray, "m k n"]
    pose: Float[ndarray, "m 6 n"]
    spline: SplineValues
    corner: Float[ndarray, "m c 2 3"]
    surface: Float[ndarray, "p r"]
    plane: Float[ndarray, "2 2"]

    @cached_property
    def sizes(self) -> tuple[int, int, int, int]:
        """k, g, r and how many corners move on their own."""
        return self.camera.shape[1], self.spline.splines, self.surface.shape[1], self.corner.shape[1]


class SharedInverse(NamedTuple):
    """H^-1, as it was found: single corners may have been eliminated.

    Attributes:
        covariance: (s,s) the inverse of what was left.
        blocks: (b,3,3) C^-1 of the corners that were eliminated; none where it was the views.
        crossed: (s,3b) sums of what was left with them, along the first axis of all corners first. What was
            left are the shared unknowns, but for these corners, and then the poses.
    """

    covariance: Float[ndarray, "s s"]
    blocks: Float[ndarray, "b 3 3"]
    crossed: Float[ndarray, "s c"]

    @classmethod
    def of_shared(cls, covariance: Float[ndarray, "s s"]) -> SharedInverse:
        """Where the views were eliminated, and are not asked for."""
        return cls(covariance, np.zeros((0, SPACE, SPACE)), np.zeros((len(covariance), 0)))

    def times(self, pulls: Float[ndarray, "q c"]) -> Float[ndarray, "q c"]:
        """H^-1 times vectors."""
        if not len(self.blocks):
            return self.covariance @ pulls
        n, columns, blocks = len(pulls) - self.crossed.shape[1], pulls.shape[1], (len(self.blocks), SPACE, -1)
        scaled = self.blocks @ pulls[n:].reshape(blocks)  # C^-1 b
        right = -(self.crossed @ _by_axis(scaled))
        right[:n] += pulls[:n]
        found = self.covariance @ right
        back = (self.crossed.T @ found).reshape(SPACE, len(self.blocks), columns).transpose(1, 0, 2)
        return np.concatenate([found[:n], (scaled - self.blocks @ back).reshape(-1, columns)])

    def between(
        self, pulls: Float[ndarray, "m q c"]
    ) -> tuple[Float[ndarray, "m c c"], Float[ndarray, "m s c"]]:
        """b'H^-1 b of vectors (q,c) of each view, and the shared unknowns' part of H^-1 b; half the work of
        `times`.
        """
        (m, q, c), s = pulls.shape, len(self.covariance)
        right, n = np.zeros((s, m * c)), q - self.crossed.shape[1]
        right[:n] = pulls[:, :n].transpose(1, 0, 2).reshape(n, m * c)
        squares = np.zeros((m, c, c))
        if len(self.blocks):
            own = pulls[:, n:].transpose(1, 0, 2).reshape(len(self.blocks), SPACE, m * c)
            scaled = self.blocks @ own
            right -= self.crossed @ _by_axis(scaled)
            squares = pulls[:, n:].transpose(0, 2, 1) @ scaled.reshape(-1, m, c).transpose(1, 0, 2)
        found = (self.covariance @ right).reshape(s, m, c).transpose(1, 0, 2)
        return squares + right.reshape(s, m, c).transpose(1, 2, 0) @ found, found[:, :n]


@dataclass(frozen=True, eq=False)
class Linearised:
    """A finished fit at its estimate.

    Attributes:
        camera: where the fit ended.
        names: of the camera's k parameters that moved.
        slopes: of the residuals.
        single: whether corners have displacements of their own (else only the surface moves them).
        residual: (m,2p) predicted minus detected, pixels, not weighted.
        root: (m,2p) root of each row's weight, of the robust loss; 0 where a corner was not seen.
        spline_precision: (g,g), the block of L that the displacement has for x, and again for y.
        shape_precision: (3r + 3p,), the diagonal of L for surface and single corners; L is 0 for the camera's
            parameters.
        noise: px^2 of a coordinate.
        inverse: H^-1.
    """

    camera: Camera
    names: tuple[str, ...]
    slopes: ResidualSlopes
    single: bool
    residual: Float[ndarray, "m n"]
    root: Float[ndarray, "m n"]
    spline_precision: Float[ndarray, "g g"]
    shape_precision: Float[ndarray, " s"]
    noise: float
    inverse: SharedInverse

    @property
    def views(self) -> int:
        """How many."""
        return len(self.residual)

    @cached_property
    def of_camera(self) -> int:
        """How many of x, the first, are the camera's: its parameters and its displacement's coefficients."""
        k, g, _, _ = self.slopes.sizes
        return k + 2 * g

    @cached_property
    def unknowns(self) -> int:
        """q: how many x has."""
        return self.of_camera + len(self.shape_precision)

    @cached_property
    def errors(self) -> Float[ndarray, "m n"]:
        """e_j: weighted residuals, the pose of each view fitted."""
        return self.without_pose(self.root * self.residual)

    def only(self, rows: Int[ndarray, " v"] | slice) -> Linearised:
        """The same fit, which all its views made, with the rows of some of them."""
        slopes = self.slopes
        kept = replace(
            slopes,
            camera=slopes.camera[rows],
            pose=slopes.pose[rows],
            spline=slopes.spline.only(rows),
            corner=slopes.corner[rows],
        )
        some = replace(self, slopes=kept, residual=self.residual[rows], root=self.root[rows])
        some.__dict__.update(_weighted_poses=self._weighted_poses[rows], _poses=self._poses[rows])
        return some

    def without_pose(self, rows: ndarray, *, weighted: bool = True) -> ndarray:
        """What is left of changes (m,2p) or (m,2p,c) of the weighted residuals when each view's pose has been
        fitted.

        Args:
            weighted: False for residuals that are not weighted, each corner then counting alike.
        """
        basis = self._weighted_poses if weighted else self._poses
        flat = rows if rows.ndim == 3 else rows[..., None]
        left = flat - basis @ (basis.transpose(0, 2, 1) @ flat)
        return left if rows.ndim == 3 else left[..., 0]

    def changes(self, x: ndarray) -> Float[ndarray, "m n c"]:
        """J_j x: how residuals move, poses fixed and nothing weighted.

        Args:
            x: (q,c) for all views alike, or (m,q,c) for each its own.
        """
        k, g, _, c = self.slopes.sizes
        n = self.residual.shape[1]
        moved = self.slopes.camera.transpose(0, 2, 1) @ x[..., :k, :]
        if g:
            along, across = (self.slopes.spline.times(x[..., k + i * g : k + (i + 1) * g, :]) for i in (0, 1))
            (xx, xy), (yx, yy) = self.slopes.plane
            moved[:, : n // 2] += xx * along + xy * across
            moved[:, n // 2 :] += yx * along + yy * across
        if c and len(self.shape_precision):
            moved += self.changes_by_shape(self.slopes.corner, x)
        return moved

    def changes_by_shape(self, corner: Float[ndarray, "m p 2 3"], x: ndarray) -> Float[ndarray, "m n c"]:
        """The like of `changes` for the target's shape alone, with other slopes by the places of its
        corners.
        """
        pairs = corner @ self._displaced(x[..., self.of_camera :, :])  # (m, p, 2, c)
        return np.concatenate([pairs[:, :, 0], pairs[:, :, 1]], axis=1)

    def moves(self, x: ndarray) -> Float[ndarray, "m n c"]:
        """A_j x: how weighted residuals move, the pose of each view fitted; x as in `changes`."""
        return self.without_pose(self.root[..., None] * self.changes(x))

    def pulls(self, rows: Float[ndarray, "m n c"]) -> Float[ndarray, "m q c"]:
        """A_j' times rows of each view."""
        return self.gathered(self.root[..., None] * self.without_pose(rows))

    def gathered(self, rows: Float[ndarray, "m n c"]) -> Float[ndarray, "m q c"]:
        """J_j' times rows of each view; `pulls` without weights, poses fixed."""
        k, g, _, _ = self.slopes.sizes
        m, n, columns = rows.shape
        out = np.empty((m, self.unknowns, columns))
        out[:, :k] = self.slopes.camera @ rows
        if g:
            (xx, xy), (yx, yy) = self.slopes.plane
            u, v = rows[:, : n // 2], rows[:, n // 2 :]
            out[:, k : k + g] = self.slopes.spline.gathered(xx * u + yx * v)
            out[:, k + g : k + 2 * g] = self.slopes.spline.gathered(xy * u + yy * v)
        if len(self.shape_precision):
            out[:, self.of_camera :] = self._gathered_by_shape(self.slopes.corner, rows)
        return out

    def gathered_by_shape(
        self, corner: Float[ndarray, "m p 2 3"], rows: Float[ndarray, "m n c"]
    ) -> Float[ndarray, "m q c"]:
        """The like of `gathered` for the target's shape alone, with other slopes by the places of its
        corners.
        """
        out = np.zeros((len(rows), self.unknowns, rows.shape[2]))
        out[:, self.of_camera :] = self._gathered_by_shape(corner, rows)
        return out

    def _gathered_by_shape(self, corner: ndarray, rows: ndarray) -> Float[ndarray, "m s c"]:
        (m, n, columns), (p, r) = rows.shape, self.slopes.surface.shape
        pairs = np.stack([rows[:, : n // 2], rows[:, n // 2 :]], axis=2)  # (m, p, 2, c)
        of_corners = corner.transpose(0, 1, 3, 2) @ pairs  # (m, p, 3, c)
        found = []
        if r:
            of_surface = np.tensordot(of_corners, self.slopes.surface, axes=(1, 0))  # (m, 3, c, r)
            found.append(of_surface.transpose(0, 3, 1, 2).reshape(m, SPACE * r, columns))
        if self.single:
            found.append(of_corners.reshape(m, SPACE * p, columns))
        return np.concatenate(found, axis=1)

    def solved(self, pulls: ndarray) -> ndarray:
        """H^-1 times vectors (q,c) or (m,q,c)."""
        if pulls.ndim == 3:
            m, q, c = pulls.shape
            return self.solved(pulls.transpose(1, 0, 2).reshape(q, m * c)).reshape(q, m, c).transpose(1, 0, 2)
        return self.inverse.times(pulls)

    @cached_property
    def camera_columns(self) -> Float[ndarray, "q d"]:
        """The columns of H^-1 that belong to the camera; d = of_camera."""
        unit = np.zeros((self.unknowns, self.of_camera))
        np.fill_diagonal(unit, 1.0)
        return self.solved(unit)

    @cached_property
    def camera_covariance(self) -> Float[ndarray, "d d"]:
        """Posterior covariance of the camera, for independent errors of variance `noise`: noise H^-1."""
        return self.noise * self.camera_columns[: self.of_camera]

    @cached_property
    def prior_covariance(self) -> Float[ndarray, "d d"]:
        """The part of `camera_covariance` that the priors' own scatter is: noise H^-1 L H^-1.

        The rest, noise H^-1 (sum A'A) H^-1, is how the estimate scatters when the same photographs are taken
        again.
        """
        k, g, _, _ = self.slopes.sizes
        columns = self.camera_columns
        shape = columns[k + 2 * g :]
        total = shape.T @ (self.shape_precision[:, None] * shape)
        for i in (0, 1):
            part = columns[k + i * g : k + (i + 1) * g]
            total += part.T @ self.spline_precision @ part
        return self.noise * total

    def _displaced(self, x: ndarray) -> Float[ndarray, "*m p 3 c"]:
        """Displacements of the corners by coefficients (..., 3r + 3p, c)."""
        c, r = self.slopes.surface.shape
        columns, lead = x.shape[-1], x.shape[:-2]
        out = np.zeros((*lead, c, SPACE, columns))
        if r:
            out += (self.slopes.surface @ x[..., : SPACE * r, :].reshape(*lead, r, SPACE * columns)).reshape(
                out.shape
            )
        if self.single:
            out += x[..., SPACE * r :, :].reshape(out.shape)
        return out

    @cached_property
    def _weighted_poses(self) -> Float[ndarray, "m n 6"]:
        return _orthonormal(self.root[..., None] * self.slopes.pose.transpose(0, 2, 1))

    @cached_property
    def _poses(self) -> Float[ndarray, "m n 6"]:
        return _orthonormal(self.slopes.pose.transpose(0, 2, 1))


def _by_axis(corners: Float[ndarray, "b 3 c"]) -> Float[ndarray, "a c"]:
    """Rows along the first axis of all corners first."""
    return corners.transpose(1, 0, 2).reshape(-1, corners.shape[2])


def _orthonormal(columns: Float[ndarray, "m n 6"]) -> Float[ndarray, "m n 6"]:
    """Bases of the spaces that each view's columns span."""
    return np.linalg.qr(columns / np.maximum(np.sqrt((columns**2).sum(1, keepdims=True)), 1e-300))[0]
