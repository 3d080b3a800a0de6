"""Detections as the mathematics wants them: one padded table, fullest views first, and the poses beside it.

Rows are views, columns corners; `present` marks the padding. Row r is view `order[r]` of the detections.
Sorted rows let a chunk of consecutive views be cut to its own width, so partial boards cost little more than
their corners.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from orthoscope.geometry.arrays import Float, Int, evenly, ndarray
from orthoscope.geometry.pose import Pose, nearest_rotation
from orthoscope.targets.detections import Detections

__all__ = ["Observations", "Poses"]

# So many corners are linearised together: their intermediate arrays then stay in the processor's cache.
CORNERS_AT_ONCE = 8192


class Poses(NamedTuple):
    """camera_from_target of all views.

    Attributes:
        rotation: (m,3,3).
        translation: (m,3) metres.
    """

    rotation: ndarray
    translation: ndarray

    def only(self, rows: Int[ndarray, " v"] | slice) -> Poses:
        """The poses of these rows."""
        return Poses(self.rotation[rows], self.translation[rows])


class Chunk(NamedTuple):
    """Consecutive rows of the table, cut to their own width.

    Attributes:
        rows: which of the table's.
        ids: of the corners, (c,n).
        u: their pixels' x, (c,n).
        v: their pixels' y, (c,n).
        present: 1 for a corner, 0 for padding, (c,n); None where no corner is missing.
    """

    rows: slice
    ids: ndarray
    u: ndarray
    v: ndarray
    present: ndarray | None


@dataclass(frozen=True, eq=False)
class Observations:
    """The table; 0 where there is no corner.

    Attributes:
        order: which view of the detections each row is, (m,).
        counts: how many corners each row has, (m,).
        ids: of the corners, (m,n).
        u: their pixels' x, (m,n).
        v: their pixels' y, (m,n).
        present: 1 for a corner, 0 for padding, (m,n).
    """

    order: Int[ndarray, " m"]
    counts: Int[ndarray, " m"]
    ids: Int[ndarray, "m n"]
    u: Float[ndarray, "m n"]
    v: Float[ndarray, "m n"]
    present: Float[ndarray, "m n"]

    @classmethod
    def of(cls, detections: Detections) -> Observations:
        """The table of all views."""
        views = detections.views
        counts = np.array([len(view.ids) for view in views], dtype=np.int64)
        order = np.argsort(-counts, kind="stable")
        counts = counts[order]
        present = np.arange(counts.max(initial=0)) < counts[:, None]
        ids, u, v = np.zeros(present.shape, dtype=np.int64), np.zeros(present.shape), np.zeros(present.shape)
        ids[present] = np.concatenate([np.empty(0, dtype=np.int64), *(views[i].ids for i in order)])
        pixels = np.concatenate([np.empty((0, 2)), *(views[i].pixels for i in order)])
        u[present], v[present] = pixels[:, 0], pixels[:, 1]
        return cls(order, counts, ids, u, v, present.astype(float))

    @classmethod
    def by_corner(cls, detections: Detections) -> Observations:
        """The table with a column for each of the target's corners, views in their own order.

        Sums over views are then sums of columns.
        """
        views, corners = len(detections.views), len(detections.target.points)
        seen = np.zeros((3, views, corners))
        for row, view in enumerate(detections.views):
            seen[:2, row, view.ids], seen[2, row, view.ids] = view.pixels.T, 1.0
        ids = np.broadcast_to(np.arange(corners), (views, corners))
        return cls(np.arange(views), np.full(views, corners), ids, *seen)

    @property
    def corners(self) -> int:
        """How many corners there are."""
        return int(self.present.sum())

    def pixels(self) -> Float[ndarray, "m n 2"]:
        """The table's pixels, padding included."""
        return np.stack([self.u, self.v], axis=-1)

    def evenly(self, views: int) -> Int[ndarray, " v"]:
        """The numbers of at most so many rows, evenly picked."""
        return evenly(len(self.order), views)

    def only(self, rows: Int[ndarray, " v"]) -> Observations:
        """The table of these rows (ascending)."""
        width = int(self.counts[rows].max())
        return Observations(
            self.order[rows], self.counts[rows], *(array[rows, :width] for array in self._columns())
        )

    def thinned(self, corners: int) -> Observations:
        """The table of the same rows with at most so many corners each.

        They are the first in one shuffled order, the same every time.
        """
        if self.counts.max(initial=0) <= corners:
            return self
        shuffled = np.random.default_rng(0).permutation(self.ids.shape[1])
        first = np.argsort(self.present[:, shuffled] == 0, axis=1, kind="stable")[:, :corners]
        table = (np.take_along_axis(array, shuffled[first], axis=1) for array in self._columns())
        return Observations(self.order, np.minimum(self.counts, corners), *table)

    def chunks(self) -> list[Chunk]:
        """The table in pieces of about CORNERS_AT_ONCE corners."""
        pieces, start = [], 0
        while start < len(self.order):
            width = int(self.counts[start])
            stop = min(len(self.order), start + max(1, CORNERS_AT_ONCE // max(width, 1)))
            rows = slice(start, stop)
            ids, u, v, present = (np.ascontiguousarray(array[rows, :width]) for array in self._columns())
            pieces.append(Chunk(rows, ids, u, v, None if present.all() else present))
            start = stop
        return pieces

    def poses_in_order(self, poses: Poses) -> tuple[Pose, ...]:
        """The poses of the table's rows as poses of the detections' views (made exactly orthonormal)."""
        back = np.argsort(self.order)
        stacks = nearest_rotation(poses.rotation[back]), poses.translation[back]
        for stack in stacks:
            stack.setflags(write=False)
        return tuple(_trusted(rotation, translation) for rotation, translation in zip(*stacks, strict=True))

    def poses_of(self, poses: Sequence[Pose]) -> Poses:
        """Poses of the detections' views as rows of the table."""
        return Poses(
            np.array([poses[i].rotation for i in self.order]),
            np.array([poses[i].translation for i in self.order]),
        )

    def _columns(self) -> tuple[ndarray, ndarray, ndarray, ndarray]:
        """ids, u, v and present."""
        return self.ids, self.u, self.v, self.present


def _trusted(rotation: Float[ndarray, "3 3"], translation: Float[ndarray, "3"]) -> Pose:
    """A pose without its check, since these rotations are orthonormal.

    Checking them one by one took a tenth of a calibration of 1000 views.
    """
    pose = object.__new__(Pose)
    pose.__dict__.update(rotation=rotation, translation=translation)
    return pose
