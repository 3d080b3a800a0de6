"""The value of every spline of a lens's displacement at every corner of every view, as it is multiplied with.

A spline of the lattice is the product of one across and one down, so a corner has nx + ny numbers that make
its nx ny values.  Of few views the values are made once; of many they are made anew, some views at a time,
which costs no more than reading them would.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from orthoscope.geometry.arrays import Float, Int, ndarray

__all__ = ["SplineValues"]

# So many values are kept (32 MB) or made at a time.
VALUES_AT_ONCE = 1 << 22


@dataclass(frozen=True, eq=False)
class SplineValues:
    """The values, 0 where a corner was not seen.

    Attributes:
        down: (m,p,ny) of the splines along y.
        across: (m,p,nx) of those along x.
    """

    down: Float[ndarray, "m p ny"]
    across: Float[ndarray, "m p nx"]

    @classmethod
    def none(cls, views: int, corners: int) -> SplineValues:
        """Of a lens without a displacement."""
        return cls(np.zeros((views, corners, 0)), np.zeros((views, corners, 0)))

    @property
    def splines(self) -> int:
        """g: how many there are."""
        return self.down.shape[2] * self.across.shape[2]

    def only(self, rows: Int[ndarray, " v"] | slice) -> SplineValues:
        """Those of some views."""
        return SplineValues(self.down[rows], self.across[rows])

    def times(self, x: ndarray) -> Float[ndarray, "m p c"]:
        """What coefficients, (g,c) for all views or (m,g,c), make of every corner."""
        found = np.empty((*self.down.shape[:2], x.shape[-1]))
        for rows, values in self._parts():
            found[rows] = values @ (x if x.ndim == 2 else x[rows])
        return found

    def gathered(self, corners: Float[ndarray, "m p c"]) -> Float[ndarray, "m g c"]:
        """The transpose of `times`, of each view."""
        found = np.empty((len(corners), self.splines, corners.shape[2]))
        for rows, values in self._parts():
            found[rows] = values.transpose(0, 2, 1) @ corners[rows]
        return found

    def _parts(self) -> Iterator[tuple[slice, Float[ndarray, "v p g"]]]:
        """The values (y-major), some views at a time."""
        views, corners = self.down.shape[:2]
        at_once = max(1, VALUES_AT_ONCE // max(corners * self.splines, 1))
        if at_once >= views:
            yield slice(None), self._whole
            return
        for start in range(0, views, at_once):
            rows = slice(start, start + at_once)
            yield rows, _products(self.down[rows], self.across[rows])

    @cached_property
    def _whole(self) -> Float[ndarray, "m p g"]:
        return _products(self.down, self.across)


def _products(down: Float[ndarray, "v p ny"], across: Float[ndarray, "v p nx"]) -> Float[ndarray, "v p g"]:
    views, corners, rows = down.shape
    return (down[..., :, None] * across[..., None, :]).reshape(views, corners, rows * across.shape[2])
