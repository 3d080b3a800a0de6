"""Rotations and rigid motions: one `Pose` for users, stacks of matrices for the mathematics.

A rotation vector w is axis times angle; exp(w) its matrix (Rodrigues). Steps are taken on the left, R <-
exp(w) R, so that d(R p)/dw = -[R p]_x at w = 0. After J. Sola et al., A micro Lie theory, arXiv:1812.01537.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from orthoscope.geometry.arrays import Float, InputError, frozen, ndarray, normalised

__all__ = [
    "Pose",
    "nearest_rotation",
    "quaternion_from_rotation",
    "rotation_from_quaternion",
    "rotation_from_vector",
    "vector_from_rotation",
]

# Row i is the flattened cross-product matrix [e_i]_x of the i-th axis.
CROSS_OF_AXES = np.array(
    [[0, 0, 0, 0, 0, -1, 0, 1, 0], [0, 0, 1, 0, 0, 0, -1, 0, 0], [0, -1, 0, 1, 0, 0, 0, 0, 0]], dtype=float
)


@dataclass(frozen=True, eq=False)
class Pose:
    """A rigid motion, named `a_from_b`: it takes points of frame b to frame a.

    Attributes:
        rotation: (3,3), orthonormal, determinant +1.
        translation: (3,) metres.
    Raises:
        InputError: the rotation is not one (to 1e-6).
    """

    rotation: ndarray
    translation: ndarray

    def __post_init__(self) -> None:
        rotation = frozen(self.rotation, (3, 3), "rotation")
        if np.abs(rotation).max() > 2.0 or not (
            np.abs(rotation @ rotation.T - np.eye(3)).max() <= 1e-6 and np.linalg.det(rotation) > 0
        ):
            raise InputError(
                "rotation is not orthonormal with determinant +1; hand in a proper rotation matrix."
            )
        object.__setattr__(self, "rotation", rotation)
        object.__setattr__(self, "translation", frozen(self.translation, (3,), "translation"))

    def __matmul__(self, other: Pose) -> Pose:
        """a_from_c = a_from_b @ b_from_c."""
        return Pose(self.rotation @ other.rotation, self.apply(other.translation[None])[0])

    def inverse(self) -> Pose:
        """b_from_a."""
        return Pose(self.rotation.T, -self.rotation.T @ self.translation)

    def apply(self, points: Float[ndarray, "n 3"]) -> Float[ndarray, "n 3"]:
        """Points of frame b, (n,3) metres, as points of frame a."""
        return points @ self.rotation.T + self.translation


def rotation_from_vector(vectors: Float[ndarray, "*batch 3"]) -> Float[ndarray, "*batch 3 3"]:
    """Rotation matrices of rotation v, radians: I + sin(a)/a [v]_x + (1 - cos a)/a^2 [v]_x^2, a = |v|.

    Source:
        O. Rodrigues, Journal de mathematiques pures et appliquees 5, 1840.
    """
    angle = np.sqrt((vectors * vectors).sum(axis=-1))[..., None, None]
    cross = cross_matrix(vectors)
    return (
        np.eye(3)
        + np.sinc(angle / np.pi) * cross
        + 0.5 * np.sinc(angle / (2.0 * np.pi)) ** 2 * (cross @ cross)
    )


def vector_from_rotation(rotation: Float[ndarray, "3 3"]) -> Float[ndarray, "3"]:
    """The rotation vector of one matrix, its length in [0, pi]; by the unit quaternion, so stable at pi."""
    w, axis = _quaternion(rotation)
    sine = np.linalg.norm(axis)
    return (2.0 if sine < 1e-12 else 2.0 * np.arctan2(sine, w) / sine) * axis


def nearest_rotation(matrices: Float[ndarray, "*batch 3 3"]) -> Float[ndarray, "*batch 3 3"]:
    """The rotation nearest to each matrix in the Frobenius norm.

    Source:
        W. Kabsch, A solution for the best rotation to relate two sets of vectors, Acta Cryst. A32, 1976.
    """
    left, _, right = np.linalg.svd(matrices)
    left[..., :, 2] *= np.linalg.det(left @ right)[..., None]
    return left @ right


def quaternion_from_rotation(rotation: Float[ndarray, "3 3"]) -> Float[ndarray, "4"]:
    """The unit quaternion (w, x, y, z), w >= 0, of a rotation matrix."""
    w, axis = _quaternion(rotation)
    return np.array([w, *axis])


def rotation_from_quaternion(quaternion: Float[ndarray, "4"]) -> Float[ndarray, "3 3"]:
    """The rotation matrix of a quaternion (w, x, y, z) of any length but 0."""
    w, x, y, z = normalised(quaternion).tolist()
    return np.array(
        [
            [1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)],
            [2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)],
            [2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)],
        ]
    )


def cross_matrix(vectors: Float[ndarray, "*batch 3"]) -> Float[ndarray, "*batch 3 3"]:
    """[v]_x, so that [v]_x u = v x u."""
    return (vectors @ CROSS_OF_AXES).reshape(*vectors.shape[:-1], 3, 3)


def _quaternion(rotation: Float[ndarray, "3 3"]) -> tuple[float, Float[ndarray, "3"]]:
    """The unit quaternion (w, axis) with w >= 0: last eigenvector of Bar-Itzhack's matrix.

    Source:
        I. Bar-Itzhack, New method for extracting the quaternion from a rotation matrix, JGCD 23(6), 2000.
    """
    m = rotation
    k = np.empty((4, 4))
    k[:3, :3] = m + m.T - np.trace(m) * np.eye(3)
    k[3, :3] = k[:3, 3] = [m[2, 1] - m[1, 2], m[0, 2] - m[2, 0], m[1, 0] - m[0, 1]]
    k[3, 3] = np.trace(m)
    q = np.linalg.eigh(k)[1][:, -1]
    q = q if q[3] > 0 or (q[3] == 0 and q[np.flatnonzero(q)[0]] > 0) else -q
    return float(q[3]), q[:3]
