"""The inverse of a radial curve, looked up: by how much the lens moved a place, from where the place has come
to.

u_d = r_d^2 and q(u_d) = s / r_d, so that (x, y) = q (x_d, y_d): no root, and the centre needs no case of its
own. The table is over t = u_d / (u_d + c), which has all of the plane in [0, 1) and most cells where most is
seen. Its cells are even, so finding one costs a multiplication (searching for it costs more than all the rest
of an inverse), and in each of them q is a parabola in t.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

import numpy as np

from orthoscope.geometry.arrays import ndarray

__all__ = ["Lookup", "tabulated"]

# So many cells are 48 kB of parabolas in double precision, so the table stays in a core's own cache.
CELL_COUNT = 2048


class Lookup(NamedTuple):
    """A tabulated q: to about nine digits inside the curve, fewer beside a fold, where q bends without bound.

    Attributes:
        end: u_d where the curve ends.
        last: s where the curve ends.
        middle: c of the module's docstring.
        cells: how many cells of the table there are for each 1 of t.
        parabolas: their coefficients by powers of t, lowest first, (cells,) each.
    """

    end: float
    last: float
    middle: float
    cells: float
    parabolas: tuple[ndarray, ndarray, ndarray]

    def __call__(self, u_d: ndarray) -> ndarray:
        """q at u_d, in the precision of u_d and the table; past the end the q that leads to the end."""
        t = u_d / (u_d + self.middle)
        cell = (t * self.cells).astype(np.intp)
        constant, slope, bend = (part.take(cell, mode="clip") for part in self.parabolas)
        q = constant + t * (slope + t * bend)
        past = np.flatnonzero(~(u_d <= self.end))
        q[past] = self.last / np.sqrt(u_d[past])
        return q

    def single(self) -> Lookup:
        """The same table in single precision."""
        constant, slope, bend = (part.astype(np.float32) for part in self.parabolas)
        return self._replace(parabolas=(constant, slope, bend))


def tabulated(ratio: Callable[[ndarray], ndarray], *, end: float, last: float, middle: float) -> Lookup:
    """The table of an exact q; half of all cells are for u_d below the middle where the end is far.

    Args:
        ratio: q as a function of u_d, exact; where it is NaN, as in the image of a hole, so is the table.
        end: u_d where the curve ends.
        last: s where the curve ends.
        middle: c of the module's docstring.
    """
    t = np.linspace(0.0, end / (end + middle), 2 * CELL_COUNT + 1)
    q = ratio(np.minimum(middle * t / (1.0 - t), end))
    left, half, right = q[:-1:2], q[1::2], q[2::2]
    start, width = t[:-1:2], t[2]
    bend = 2.0 * (left - 2.0 * half + right) / (width * width)
    slope = (4.0 * half - 3.0 * left - right) / width - 2.0 * start * bend
    return Lookup(end, last, middle, 1.0 / width, (left - start * (slope + start * bend), slope, bend))
