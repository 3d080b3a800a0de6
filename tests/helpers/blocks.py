"""A problem with nothing of a camera in it, for the solver's tests.

Row i measures  f(S_i s + V_i v_(view of i)) - b_i,  f(z) = z + bend sin z; rows of view -1 know the shared
unknowns only.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from orthoscope.solve.block_system import NormalEquations
from orthoscope.solve.losses import Loss

__all__ = ["Blocks", "Place"]


class Place(NamedTuple):
    """Shared unknowns (k,) and those of the views (m,p)."""

    shared: np.ndarray
    views: np.ndarray

    def flat(self) -> np.ndarray:
        """All in one row."""
        return np.concatenate([self.shared, self.views.ravel()])


class Blocks:
    """A random problem with k shared unknowns, m views of p unknowns and `rows` numbers in each view (and so
    many in none).
    """

    def __init__(
        self, k: int, m: int, p: int, rows: int, *, bend: float = 0.3, noise: float = 0.1, seed: int = 0
    ) -> None:
        rng = np.random.default_rng(seed)
        self.view = np.repeat(np.arange(-1, m), rows)
        n = len(self.view)
        self.S, self.V = rng.normal(size=(n, k)), rng.normal(size=(n, p)) * (self.view >= 0)[:, None]
        self.m, self.bend = m, bend
        self.truth = Place(rng.normal(size=k), rng.normal(size=(m, p)))
        self.b = np.zeros(n)
        self.b = self.residual(self.truth) + noise * rng.normal(size=n)
        self.start = Place(
            self.truth.shared + 0.5 * rng.normal(size=k), self.truth.views + 0.5 * rng.normal(size=(m, p))
        )

    def place(self, flat: np.ndarray) -> Place:
        """The inverse of Place.flat."""
        k = self.S.shape[1]
        return Place(flat[:k], flat[k:].reshape(self.m, self.V.shape[1]))

    def z(self, at: Place) -> np.ndarray:
        views = np.concatenate([at.views, np.zeros((1, self.V.shape[1]))])  # the last is that of view -1
        return self.S @ at.shared + (self.V * views[self.view]).sum(1)

    def residual(self, at: Place) -> np.ndarray:
        z = self.z(at)
        return z + self.bend * np.sin(z) - self.b

    def jacobian(self, at: Place) -> np.ndarray:
        """(n, k + m p), as in Place.flat."""
        slope = (1.0 + self.bend * np.cos(self.z(at)))[:, None]
        of_views = np.zeros((len(self.view), self.m, self.V.shape[1]))
        rows = np.flatnonzero(self.view >= 0)
        of_views[rows, self.view[rows]] = self.V[rows]
        return slope * np.concatenate([self.S, of_views.reshape(len(self.view), -1)], axis=1)

    def linearise(self, unknowns: Place, loss: Loss) -> NormalEquations:
        e, slope = self.residual(unknowns), (1.0 + self.bend * np.cos(self.z(unknowns)))[:, None]
        weight = loss.weight(e * e)
        root = np.ones((len(e), 1)) if weight is None else np.sqrt(weight)[:, None]
        S, V, r = root * slope * self.S, root * slope * self.V, root[:, 0] * e
        mine = [self.view == view for view in range(self.m)]
        B = np.array([S[rows].T @ V[rows] for rows in mine]).reshape(self.m, S.shape[1], V.shape[1])
        C = np.array([V[rows].T @ V[rows] for rows in mine]).reshape(self.m, V.shape[1], V.shape[1])
        c = np.array([V[rows].T @ r[rows] for rows in mine]).reshape(self.m, V.shape[1])
        return NormalEquations(float(loss.cost(e * e).sum()), S.T @ S, S.T @ r, B, C, c)

    def move(self, unknowns: Place, shared: np.ndarray, views: np.ndarray) -> Place:
        return Place(unknowns.shared + shared, unknowns.views + views)
