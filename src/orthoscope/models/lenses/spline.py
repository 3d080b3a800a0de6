"""A displacement of the plane by bicubic B-splines: smooth everywhere, zero away from its lattice.

s(x, y) = sum over i, j of B((x - x_0) / h_x - i) B((y - y_0) / h_y - j) c_ij with the uniform cubic B-spline
B, whose four pieces on a cell are the PIECE_WEIGHTS below (C. de Boor, A Practical Guide to Splines, 1978).
Coefficients outside the lattice are zero, so s falls to zero within three cells of its border, twice
continuously differentiable all the way.

How rough a displacement is, for a range l beyond which its values have nothing to say about each other:
    energy = integral of  s^2 / l^4 + 2 |grad s|^2 / l^2 + |second derivatives|^2,
a Matern prior (F. Lindgren, H. Rue, J. Lindstrom, An explicit link between Gaussian fields and Gaussian
Markov random fields, 2011): smooth where there are data, back to zero where there are none.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from orthoscope.geometry.arrays import Float, InputError, frozen, ndarray

__all__ = ["Displacement", "Lattice"]

# So many splines are not zero on a cell, in each direction.
SPLINES_ACROSS_CELL = 4
# The four pieces of the cubic B-spline on a cell are these polynomials in t = 0..1, lowest power first.
PIECE_WEIGHTS = (
    np.array([[1.0, -3.0, 3.0, -1.0], [4.0, 0.0, -6.0, 3.0], [1.0, 3.0, 3.0, -3.0], [0.0, 0.0, 0.0, 1.0]]).T
    / 6.0
)
# Four nodes of Gauss and Legendre between -1 and 1, exact for the squares of cubics.
NODES = np.array([-1.0, -1.0, 1.0, 1.0])
NODES *= np.sqrt(3.0 / 7.0 + 2.0 / 7.0 * np.sqrt(1.2) * np.array([1.0, -1.0, -1.0, 1.0]))
# The nodes' weights.
NODE_WEIGHTS = 0.5 + np.sqrt(30.0) / 36.0 * np.array([-1.0, 1.0, 1.0, -1.0])


@dataclass(frozen=True, eq=False)
class Lattice:
    """Where the splines stand.

    Attributes:
        origin: the corner of the first cell, (2,).
        step: a cell's size, (2,).
        shape: how many splines there are in x and in y.
    Raises:
        InputError: fewer than four splines in a direction, or a cell without size.
    """

    origin: ndarray
    step: ndarray
    shape: tuple[int, int]

    def __post_init__(self) -> None:
        object.__setattr__(self, "origin", frozen(self.origin, (2,), "lattice: origin"))
        object.__setattr__(self, "step", frozen(self.step, (2,), "lattice: step"))
        object.__setattr__(self, "shape", (int(self.shape[0]), int(self.shape[1])))
        if min(self.shape) < SPLINES_ACROSS_CELL or not (self.step > 0).all():
            raise InputError(
                f"a lattice of {self.shape} splines with steps {self.step} is none; expected at least 4 each"
                " way, steps above 0."
            )

    @classmethod
    def over(cls, low: Float[ndarray, " 2"], high: Float[ndarray, " 2"], cells: tuple[int, int]) -> Lattice:
        """The lattice whose splines make every bicubic function of so many cells over a rectangle.

        Args:
            low: its corner with the least x and y, (2,).
            high: its corner with the greatest, (2,).
            cells: how many in x and in y.
        """
        low, high = np.asarray(low, dtype=float), np.asarray(high, dtype=float)
        return cls(
            low,
            (high - low) / cells,
            (cells[0] + SPLINES_ACROSS_CELL - 1, cells[1] + SPLINES_ACROSS_CELL - 1),
        )

    def seen_from(self, scale: Float[ndarray, " 2"], shift: Float[ndarray, " 2"]) -> Lattice:
        """The same lattice where places of the plane are written scale * place + shift."""
        return Lattice(scale * self.origin + shift, scale * self.step, self.shape)

    @property
    def splines(self) -> int:
        """How many there are."""
        return self.shape[0] * self.shape[1]

    def reaches(self, x: ndarray, y: ndarray) -> ndarray:
        """Whether some spline is not zero at places of any shape (...)."""
        low = self.origin - (SPLINES_ACROSS_CELL - 1) * self.step
        high = self.origin + self.shape * self.step
        return (x > low[0]) & (x < high[0]) & (y > low[1]) & (y < high[1])

    def design(self, x: ndarray, y: ndarray) -> ndarray:
        """The value of every spline at places of any shape (...): (..., splines), y-major."""
        across, down = self.along(x, 0), self.along(y, 1)
        return (down[..., :, None] * across[..., None, :]).reshape(*x.shape, self.splines)

    def along(self, places: ndarray, axis: int) -> ndarray:
        """Values (..., n) of the n splines of one direction; zero where a place is no number.

        Args:
            places: coordinates along the direction, of any shape (...).
            axis: the direction, 0 for x and 1 for y.
        """
        cell, t = self._cells(places, axis)
        u, t2 = 1.0 - t, t * t
        u2 = u * u
        pieces = (u2 * u / 6.0, 2 / 3 - t2 * (1.0 - 0.5 * t), 2 / 3 - u2 * (1.0 - 0.5 * u), t2 * t / 6.0)
        return self._spread(pieces, cell, axis)

    def slopes_along(self, places: ndarray, axis: int) -> ndarray:
        """The slopes of `along`."""
        cell, t = self._cells(places, axis)
        u, by_t = 1.0 - t, 1.0 / float(self.step[axis])
        first, last = (-0.5 * by_t) * (u * u), (0.5 * by_t) * (t * t)
        pieces = (first, (by_t * t) * (1.5 * t - 2.0), (by_t * u) * (2.0 - 1.5 * u), last)
        return self._spread(pieces, cell, axis)

    def _cells(self, places: ndarray, axis: int) -> tuple[ndarray, ndarray]:
        """The first spline that is not zero at each place, counted from SPLINES_ACROSS_CELL before the first
        there is, and how far through its cell the place is, 0 to 1.
        """
        t = (places - self.origin[axis]) / self.step[axis] + SPLINES_ACROSS_CELL
        most = float(self.shape[axis] + SPLINES_ACROSS_CELL)
        t = np.clip(np.nan_to_num(t, copy=False), 0.0, most)
        cell = np.floor(t)
        return cell.astype(np.intp), t - cell

    def _spread(self, pieces: Sequence[ndarray], cell: ndarray, axis: int) -> ndarray:
        """The pieces of a place's four splines, among all of the direction."""
        n, side = self.shape[axis], self.shape[axis] + 2 * SPLINES_ACROSS_CELL + 1
        out = np.zeros((cell.size, side))
        first = cell.ravel() + side * np.arange(cell.size)
        for i, piece in enumerate(pieces):
            out.ravel()[first + i] = piece.ravel()
        return out.reshape(*cell.shape, side)[..., SPLINES_ACROSS_CELL : SPLINES_ACROSS_CELL + n]

    def energy(self, reach: float) -> Float[ndarray, "g g"]:
        """The matrix E of the roughness c'Ec, the energy in the module's docstring.

        Scaled so that a displacement drawn from exp(-c'Ec / 2) has about unit variance in the middle of the
        lattice.

        Args:
            reach: the range l, in the plane's unit.
        """
        (x0, x1, x2), (y0, y1, y2) = (_grams(self.shape[axis], float(self.step[axis])) for axis in (0, 1))
        energy = np.kron(y0, x0) / reach**4 + 2.0 / reach**2 * (np.kron(y0, x1) + np.kron(y1, x0))
        energy += np.kron(y0, x2) + 2.0 * np.kron(y1, x1) + np.kron(y2, x0)
        middle = self.origin + 0.5 * self.step * (np.array(self.shape) - SPLINES_ACROSS_CELL + 1)
        there = self.design(middle[:1], middle[1:])[0]
        return energy * float(there @ np.linalg.solve(energy, there))


@dataclass(frozen=True, eq=False)
class Displacement:
    """s(x, y): how places of a plane are moved.

    Attributes:
        lattice: where the splines stand.
        coefficients: (splines, 2), of x and of y, in the plane's unit.
    """

    lattice: Lattice
    coefficients: ndarray

    def __post_init__(self) -> None:
        object.__setattr__(
            self,
            "coefficients",
            frozen(self.coefficients, (self.lattice.splines, 2), "displacement: coefficients"),
        )

    def shift(self, x: ndarray, y: ndarray) -> ndarray:
        """s at places of any shape (...): (..., 2)."""
        across, down = self.lattice.along(x, 0), self.lattice.along(y, 1)
        return np.stack(
            [np.einsum("...i,...i->...", across, down @ of_axis) for of_axis in self._of_axes], axis=-1
        )

    def at(self, x: ndarray, y: ndarray) -> tuple[ndarray, ndarray, ndarray]:
        """s, ds/dx and ds/dy at places of any shape (...), each (..., 2)."""
        near = self.lattice.reaches(x, y)
        if near.all():
            return self._at(x, y)
        out = np.zeros((3, *x.shape, 2))
        out[:, near] = self._at(x[near], y[near])
        return out[0], out[1], out[2]

    def _at(self, x: ndarray, y: ndarray) -> tuple[ndarray, ndarray, ndarray]:
        """The same, of places that the lattice reaches."""
        across, down = self.lattice.along(x, 0), self.lattice.along(y, 1)
        across_slopes, down_slopes = self.lattice.slopes_along(x, 0), self.lattice.slopes_along(y, 1)
        out = np.empty((3, *x.shape, 2))
        for axis, of_axis in enumerate(self._of_axes):
            in_columns = down @ of_axis
            out[0, ..., axis] = np.einsum("...i,...i->...", across, in_columns)
            out[1, ..., axis] = np.einsum("...i,...i->...", across_slopes, in_columns)
            out[2, ..., axis] = np.einsum("...i,...i->...", across, down_slopes @ of_axis)
        return out[0], out[1], out[2]

    @property
    def _of_axes(self) -> Float[ndarray, "2 rows columns"]:
        columns, rows = self.lattice.shape
        return self.coefficients.T.reshape(2, rows, columns)


def _grams(splines: int, step: float) -> tuple[ndarray, ndarray, ndarray]:
    """Integrals over the lattice's cells of products of two splines, of slopes, of second derivatives."""
    powers = np.vander(0.5 * (NODES + 1.0), 4, increasing=True)
    grams, derived = [], PIECE_WEIGHTS
    for order in range(3):
        if order:
            derived = np.arange(1, len(derived))[:, None] * derived[1:]
        values = powers[:, : len(derived)] @ derived / step**order
        piece = values.T @ (0.5 * step * NODE_WEIGHTS[:, None] * values)
        gram = np.zeros((splines, splines))
        for first in range(splines - SPLINES_ACROSS_CELL + 1):
            gram[first : first + SPLINES_ACROSS_CELL, first : first + SPLINES_ACROSS_CELL] += piece
        grams.append(gram)
    return grams[0], grams[1], grams[2]
