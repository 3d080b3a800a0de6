"""Detections as the mathematics wants them: one padded table, views with most corners first, and the poses beside it.

Floor 3.  Rows are views, columns corners; `present` marks the padding.  Row r is view `order[r]` of the detections.  Sorted rows
let a chunk of consecutive views be cut to its own width, so partial boards cost little more than their corners.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from orthoscope.geometry.arrays import Float, Int, ndarray
from orthoscope.geometry.pose import Pose, nearest_rotation
from orthoscope.geometry.target import Detections

__all__ = ["Observations", "Poses"]

CHUNK = 8192  # corners that are linearised together: their intermediate arrays then stay in the processor's cache


class Poses(NamedTuple):
    """camera_from_target of all views: rotation (m,3,3), translation (m,3)."""

    rotation: ndarray
    translation: ndarray

    def only(self, rows: Int[ndarray, " v"]) -> Poses:
        """The poses of these rows."""
        return Poses(self.rotation[rows], self.translation[rows])


class Chunk(NamedTuple):
    """Consecutive rows of the table, cut to their own width."""

    rows: slice
    ids: ndarray  # (c, n)
    u: ndarray
    v: ndarray
    present: ndarray | None  # (c, n) of 0 and 1; None where no corner is missing


@dataclass(frozen=True, eq=False)
class Observations:
    """order: (m,).  counts: (m,).  ids, u, v, present: (m, n), 0 where there is no corner."""

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

    @property
    def corners(self) -> int:
        """How many corners there are."""
        return int(self.counts.sum())

    def pixels(self) -> Float[ndarray, "m n 2"]:
        """The table's pixels, padding included."""
        return np.stack([self.u, self.v], axis=-1)

    def evenly(self, views: int) -> Int[ndarray, " v"]:
        """At most so many rows, evenly picked."""
        return np.unique(np.linspace(0, len(self.order) - 1, views).round().astype(int))

    def only(self, rows: Int[ndarray, " v"]) -> Observations:
        """The table of these rows (ascending)."""
        width = int(self.counts[rows].max())
        table = (array[rows, :width] for array in (self.ids, self.u, self.v, self.present))
        return Observations(self.order[rows], self.counts[rows], *table)

    def chunks(self) -> list[Chunk]:
        """The table in pieces of about CHUNK corners."""
        pieces, start = [], 0
        while start < len(self.order):
            width = int(self.counts[start])
            stop = min(len(self.order), start + max(1, CHUNK // max(width, 1)))
            rows = slice(start, stop)
            full = self.counts[stop - 1] == width
            cut = (np.ascontiguousarray(array[rows, :width]) for array in (self.ids, self.u, self.v, self.present))
            ids, u, v, present = cut
            pieces.append(Chunk(rows, ids, u, v, None if full else present))
            start = stop
        return pieces

    def poses_in_order(self, poses: Poses) -> tuple[Pose, ...]:
        """The poses of the table's rows as poses of the detections' views (made exactly orthonormal)."""
        back = np.argsort(self.order)
        rotations = nearest_rotation(poses.rotation[back])
        return tuple(Pose(rotation, translation) for rotation, translation in zip(rotations, poses.translation[back], strict=True))

    def poses_of(self, poses: Sequence[Pose]) -> Poses:
        """Poses of the detections' views as rows of the table."""
        return Poses(np.array([poses[i].rotation for i in self.order]), np.array([poses[i].translation for i in self.order]))
