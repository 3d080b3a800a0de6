"""What may explain residuals, as columns of a matrix that is never formed, the poses eliminated.

Floor 4.  A block of columns says how each residual moves with a few unknowns of its own group (the corner it is of, the image cell it is
in): one row has few entries in it, so only sums over rows are formed, for each view and for all.  With Q_j an orthonormal basis of what the
pose of view j can do, the columns X have, poses eliminated, the gram matrix  X^T X - sum_j X_j^T Q_j Q_j^T X_j.
"""

from __future__ import annotations

import math
from itertools import pairwise
from typing import NamedTuple

import numpy as np

from orthoscope.geometry.arrays import Float, Int, ndarray

__all__ = ["Block", "Columns"]

OPEN = 1e-14  # of a pose: what a view with hardly any corners does not tell


class Block(NamedTuple):
    """Columns that may explain residuals: slopes (n,2,w) by the w unknowns of the group (n,) that each row belongs to."""

    slopes: Float[ndarray, "n 2 w"]
    group: Int[ndarray, " n"]
    groups: int

    @property
    def width(self) -> int:
        """How many columns these are."""
        return self.groups * self.slopes.shape[2]

    def by_view(self, rows: Float[ndarray, "n 2 c"], view: Int[ndarray, " n"], views: int) -> Float[ndarray, "v columns c"]:
        """X_j^T rows_j of each view j."""
        products = self.slopes.transpose(0, 2, 1) @ rows
        return _sum_by(products, view * self.groups + self.group, views * self.groups).reshape(views, self.width, rows.shape[2])

    def gram(self, other: Block) -> Float[ndarray, "columns others"]:
        """X^T Y with another block's columns."""
        products = self.slopes.transpose(0, 2, 1) @ other.slopes
        sums = _sum_by(products, self.group * other.groups + other.group, self.groups * other.groups)
        return sums.reshape(self.groups, other.groups, *products.shape[1:]).transpose(0, 2, 1, 3).reshape(self.width, other.width)

    def times(self, unknowns: Float[ndarray, " columns"]) -> Float[ndarray, "n 2"]:
        """X times the unknowns."""
        return (self.slopes @ unknowns.reshape(self.groups, -1)[self.group][:, :, None])[:, :, 0]


class Columns:
    """Residuals (n,2) with the blocks that may explain them, the poses eliminated."""

    def __init__(
        self,
        residual: Float[ndarray, "n 2"],
        by_pose: Float[ndarray, "n 2 6"],
        view: Int[ndarray, " n"],
        views: int,
        blocks: tuple[Block, ...],
    ) -> None:
        self.view, self.views, self.blocks = view, views, blocks
        ends = np.cumsum([0, *(block.width for block in blocks)])
        self.places = [np.arange(start, end) for start, end in pairwise(ends)]
        self._pose_basis, self.poses_rank = _orthonormal(by_pose, view, views)
        self.residual = self._without_poses(residual)
        poses = self._by_view(self._pose_basis)
        poses = poses.transpose(1, 0, 2).reshape(poses.shape[1], -1)
        self.gram = np.block([[one.gram(other) for other in blocks] for one in blocks]) - poses @ poses.T

    def scores(self, residual: Float[ndarray, "n 2"]) -> Float[ndarray, "v columns"]:
        """X_j^T e_j of each view j, all blocks side by side."""
        return self._by_view(residual[:, :, None])[:, :, 0]

    def without(self, which: list[int], unknowns: Float[ndarray, " c"]) -> Float[ndarray, "n 2"]:
        """The residuals minus what these unknowns of these blocks explain, poses eliminated."""
        ends = np.cumsum([self.blocks[i].width for i in which])[:-1]
        explained = sum(self.blocks[i].times(part) for i, part in zip(which, np.split(unknowns, ends), strict=True))
        return self.residual - self._without_poses(np.asarray(explained))

    def _by_view(self, rows: Float[ndarray, "n 2 c"]) -> Float[ndarray, "v columns c"]:
        return np.concatenate([block.by_view(rows, self.view, self.views) for block in self.blocks], axis=1)

    def _without_poses(self, rows: Float[ndarray, "n 2"]) -> Float[ndarray, "n 2"]:
        Q = self._pose_basis
        by_pose = _sum_by((rows[:, None] @ Q)[:, 0], self.view, self.views)
        return rows - (Q @ by_pose[self.view][:, :, None])[:, :, 0]


def _sum_by(values: ndarray, index: Int[ndarray, " n"], size: int) -> ndarray:
    """Sums (size, ...) of the rows of values (n, ...) that share an index."""
    width = math.prod(values.shape[1:])
    places = index[:, None] * width + np.arange(width)
    sums = np.bincount(places.ravel(), weights=values.ravel(), minlength=size * width)
    return sums.astype(np.float64, copy=False).reshape(size, *values.shape[1:])  # of no rows at all bincount makes whole numbers


def _orthonormal(by_pose: Float[ndarray, "n 2 6"], view: ndarray, views: int) -> tuple[Float[ndarray, "n 2 6"], int]:
    """For each view an orthonormal basis of its pose's columns, as rows like theirs (0 where it tells less), and how many there are."""
    gram = _sum_by(by_pose.transpose(0, 2, 1) @ by_pose, view, views)
    scale = np.sqrt(np.maximum(np.diagonal(gram, axis1=1, axis2=2), 1e-300))
    values, vectors = np.linalg.eigh(gram / (scale[:, :, None] * scale[:, None, :]))
    told = values > OPEN
    to_basis = vectors / scale[:, :, None] * np.where(told, 1.0 / np.sqrt(np.maximum(values, OPEN)), 0.0)[:, None, :]
    return by_pose @ to_basis[view], int(told.sum())
