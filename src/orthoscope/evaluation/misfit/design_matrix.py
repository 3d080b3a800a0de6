"""What may explain residuals, as columns of a matrix that is never formed, the poses eliminated.

A block of columns says how each residual moves with a few unknowns of its own group (the corner it is of, the
image cell it is in): one row has few entries in it, so only sums over rows are formed, for each view and for
all. With V_j what the pose of view j can do and V_j T_j an orthonormal basis of it, the columns X have, poses
eliminated, the gram matrix  X^T X - sum_j X_j^T V_j T_j T_j^T V_j^T X_j. Sums run over rows, so it is
quickest where the rows of one column lie side by side in memory, as jacobian.py lays them.
"""

from __future__ import annotations

from itertools import pairwise
from typing import NamedTuple

import numpy as np

from orthoscope.geometry.arrays import Float, Int, ndarray

__all__ = ["Block", "Columns"]

# An eigenvalue of a pose's scaled system that is no larger is what a view with hardly any corners does not
# tell.
LARGEST_OPEN_EIGENVALUE = 1e-14
# With more rows than this for each index, side by side, each index's own products are quicker.
ROWS_TOGETHER = 16


class Block(NamedTuple):
    """Columns that may explain residuals: slopes (n,2,w) by the w unknowns of the group (n,) that each row
    belongs to.
    """

    slopes: Float[ndarray, "n 2 w"]
    group: Int[ndarray, " n"]
    groups: int

    @property
    def width(self) -> int:
        """How many columns these are."""
        return self.groups * self.slopes.shape[2]

    def by_view(
        self, rows: Float[ndarray, "n 2 c"], view: Int[ndarray, " n"], views: int
    ) -> Float[ndarray, "v c columns"]:
        """rows_j^T X_j of each view j."""
        sums = _sums(self.slopes, rows, view * self.groups + self.group, views * self.groups)
        return (
            sums.reshape(*sums.shape[:2], views, self.groups)
            .transpose(2, 1, 3, 0)
            .reshape(views, rows.shape[2], self.width)
        )

    def gram(self, other: Block) -> Float[ndarray, "columns others"]:
        """X^T Y with another block's columns."""
        w, c = self.slopes.shape[2], other.slopes.shape[2]
        if other is self:  # a row is in one group only
            of_groups = np.zeros((self.groups, w, self.groups, c))
            each = np.arange(self.groups)
            of_groups[each, :, each] = _sums(self.slopes, self.slopes, self.group, self.groups).transpose(
                2, 0, 1
            )
        else:
            sums = _sums(
                self.slopes, other.slopes, self.group * other.groups + other.group, self.groups * other.groups
            )
            of_groups = sums.reshape(w, c, self.groups, other.groups).transpose(2, 0, 3, 1)
        return of_groups.reshape(self.width, other.width)

    def times(self, unknowns: Float[ndarray, " columns"]) -> Float[ndarray, "n 2"]:
        """X times the unknowns."""
        return _times(self.slopes, unknowns.reshape(self.groups, -1), self.group)


class Columns:
    """Residuals (n,2) with the blocks that may explain them, the poses eliminated.

    gram, score: X^T X and X^T e of all columns side by side; places: where in it each block's columns are.
    """

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
        self._by_pose = by_pose
        self._to_basis, self.poses_rank = _orthonormal(by_pose, view, views)
        self.residual = self._without_poses(residual)
        self.score = self.scores(self.residual).sum(0)
        poses = (self._to_basis.transpose(0, 2, 1) @ self._by_view(by_pose)).reshape(-1, ends[-1])
        self.gram = _gram(blocks, ends)
        self.gram -= poses.T @ poses

    def scores(self, residual: Float[ndarray, "n 2"]) -> Float[ndarray, "v columns"]:
        """X_j^T e_j of each view j, all blocks side by side."""
        return self._by_view(residual[:, :, None])[:, 0]

    def without(self, which: list[int], unknowns: Float[ndarray, " c"]) -> Float[ndarray, "n 2"]:
        """The residuals minus what these unknowns of these blocks explain, poses eliminated."""
        ends = np.cumsum([self.blocks[i].width for i in which])[:-1]
        explained = sum(
            self.blocks[i].times(part) for i, part in zip(which, np.split(unknowns, ends), strict=True)
        )
        return self.residual - self._without_poses(np.asarray(explained))

    def _by_view(self, rows: Float[ndarray, "n 2 c"]) -> Float[ndarray, "v c columns"]:
        return np.concatenate([block.by_view(rows, self.view, self.views) for block in self.blocks], axis=2)

    def _without_poses(self, rows: Float[ndarray, "n 2"]) -> Float[ndarray, "n 2"]:
        by_pose = _sums(self._by_pose, rows[:, :, None], self.view, self.views).transpose(2, 0, 1)
        poses = self._to_basis @ (self._to_basis.transpose(0, 2, 1) @ by_pose)
        return rows - _times(self._by_pose, poses[:, :, 0], self.view)


def _gram(blocks: tuple[Block, ...], ends: Int[ndarray, " b"]) -> Float[ndarray, "columns columns"]:
    """X^T X of all blocks side by side."""
    gram = np.empty((ends[-1], ends[-1]))
    places = [slice(start, end) for start, end in pairwise(ends)]
    for i, (one, here) in enumerate(zip(blocks, places, strict=True)):
        for other, there in zip(blocks[i:], places[i:], strict=True):
            gram[here, there] = one.gram(other)
            if other is not one:
                gram[there, here] = gram[here, there].T
    return gram


def _sums(
    one: Float[ndarray, "n 2 w"], other: Float[ndarray, "n 2 c"], index: Int[ndarray, " n"], size: int
) -> Float[ndarray, "w c size"]:
    """Sums of products one_i^T other_i of the rows i that share an index."""
    a, b = np.ascontiguousarray(one.T), np.ascontiguousarray(other.T)
    if size == 1:
        return (a.reshape(len(a), -1) @ b.reshape(len(b), -1).T)[:, :, None]
    sums = np.empty((len(a), len(b), size))
    if len(index) > ROWS_TOGETHER * size and (index[1:] >= index[:-1]).all():
        for i, rows in enumerate(pairwise(np.searchsorted(index, np.arange(size + 1)))):
            (a_x, a_y), (b_x, b_y) = (part[:, :, slice(*rows)].transpose(1, 0, 2) for part in (a, b))
            sums[:, :, i] = a_x @ b_x.T + a_y @ b_y.T
        return sums
    for i, (a_x, a_y) in enumerate(a):
        for j, (b_x, b_y) in enumerate(b):
            sums[i, j] = np.bincount(index, weights=a_x * b_x + a_y * b_y, minlength=size)
    return sums


def _times(
    slopes: Float[ndarray, "n 2 w"], unknowns: Float[ndarray, "groups w"], group: Int[ndarray, " n"]
) -> Float[ndarray, "n 2"]:
    """Each row's slopes times the unknowns of its group."""
    total = np.zeros((2, len(slopes)))
    for by, values in zip(slopes.T, np.ascontiguousarray(unknowns.T), strict=True):
        total += by * values[group]
    return total.T


def _orthonormal(
    by_pose: Float[ndarray, "n 2 6"], view: ndarray, views: int
) -> tuple[Float[ndarray, "v 6 6"], int]:
    """For each view T_j such that V_j T_j is an orthonormal basis of its pose's columns V_j (0 where it tells
    less); how many these are.
    """
    gram = _sums(by_pose, by_pose, view, views).transpose(2, 0, 1)
    scale = np.sqrt(np.maximum(np.diagonal(gram, axis1=1, axis2=2), 1e-300))
    values, vectors = np.linalg.eigh(gram / (scale[:, :, None] * scale[:, None, :]))
    told = values > LARGEST_OPEN_EIGENVALUE
    to_basis = (
        vectors
        / scale[:, :, None]
        * np.where(told, 1.0 / np.sqrt(np.maximum(values, LARGEST_OPEN_EIGENVALUE)), 0.0)[:, None, :]
    )
    return to_basis, int(told.sum())
