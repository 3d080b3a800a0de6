"""Boards as they are: what real ones do to their corners, by kind, in shares of the board's own size.

`stretch` (a printer that feeds too far), `bend` (a sheet on a tube), `sag` (a sheet held at two sides),
`wave` (moist paper), `singles` (each corner somewhere else, as on a screen taken by a poor camera), `dent`.
Sizes as found on real boards: surface .02 to .07 % of the size, single corners .01 to .06 %.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy import ndarray

__all__ = ["SHAPES", "grid", "shaped", "size_of", "smooth_height"]

Shape = Callable[
    [ndarray, np.random.Generator], ndarray
]  # of corners (m,2), each coordinate from -1 to 1: their (m,3)


def grid(columns: int, rows: int, square: float) -> ndarray:
    """Corners (m,3) of a flat chessboard, metres, row by row."""
    y, x = np.mgrid[:rows, :columns].reshape(2, -1)
    return np.column_stack([x, y, np.zeros(x.size)]) * square


def size_of(points: ndarray) -> float:
    """The longer side, metres."""
    return float(np.ptp(points[:, :2], axis=0).max())


def _heights(of: Callable[[ndarray, ndarray], ndarray]) -> Shape:
    return lambda plane, _: np.column_stack([np.zeros((len(plane), 2)), of(*plane.T)])


SHAPES: dict[str, Shape] = {
    "stretch": lambda plane, _: np.column_stack([0.5 * plane[:, 0], np.zeros((len(plane), 2))]),
    "bend": _heights(lambda x, y: 0.5 * x * x),
    "sag": _heights(lambda x, y: 0.5 * (1.0 - x * x) * (1.0 - 0.3 * y)),
    "wave": _heights(lambda x, y: np.sin(2.5 * x + 0.7) * np.cos(1.6 * y)),
    "dent": _heights(lambda x, y: np.exp(-6.0 * ((x - 0.3) ** 2 + (y + 0.2) ** 2))),
    "singles": lambda plane, rng: rng.normal(size=(len(plane), 3)) * [1.0, 1.0, 0.5],
}


def shaped(points: ndarray, shape: dict[str, float], rng: np.random.Generator) -> ndarray:
    """Flat corners (m,3) displaced: each kind of SHAPES by its share of the board's size."""
    size = size_of(points)
    plane = 2.0 * (points[:, :2] - points[:, :2].mean(0)) / size
    return points + sum(
        (share * size * SHAPES[kind](plane, rng) for kind, share in shape.items()), np.zeros((len(points), 3))
    )


def smooth_height(points: ndarray, share: float, rng: np.random.Generator) -> ndarray:
    """The same board (m,3) with a height of the second order at random, each coefficient N(0, share of the
    size).
    """
    size = size_of(points)
    x, y = 2.0 * (points[:, :2] - points[:, :2].mean(0)).T / size
    a, b, c = share * size * rng.normal(size=3)
    return points + np.column_stack([np.zeros((len(points), 2)), a * x * x + b * x * y + c * y * y])
