"""Fewer corners of the same board: sub-grids that still span it.

The paper varies the number of points and does not say which it keeps. Kept here are whole rows and columns,
spread over the board as evenly as whole numbers allow and always with the outermost ones, so that the board
covers the image as before and only the number of points changes. Corners stay where they are on the target;
nothing asks for equal distances.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from orthoscope.geometry.arrays import Int, ndarray
from orthoscope.targets.detections import Detections, View
from orthoscope.targets.target import Target

__all__ = ["ids_of_subgrid", "on_subgrid", "subgrids"]

# The shorter side has at least this many corners; with two, a line is straight whatever the lens.
SHORTEST_SIDE = 3


def subgrids(grid: tuple[int, int], count: int) -> tuple[tuple[int, int], ...]:
    """Up to `count` (columns, rows) in the grid's proportion, from 3 corners along the shorter side to the
    whole grid, in even ratios.
    """
    shorter, longer = sorted(grid)
    sides = (
        np.unique(np.geomspace(min(SHORTEST_SIDE, shorter), shorter, count).round().astype(int))
        if count > 1
        else np.array([shorter])
    )
    pairs = [(int(side), max(int(side), round(int(side) * longer / shorter))) for side in sides]
    return tuple((few, many) if grid[0] <= grid[1] else (many, few) for few, many in pairs)


def ids_of_subgrid(target: Target, subgrid: tuple[int, int]) -> Int[ndarray, " n"]:
    """Corners of a chessboard that are on so many of its columns and rows."""
    assert target.grid is not None
    columns, rows = target.grid
    across, down = (
        np.linspace(0, side - 1, kept).round().astype(int)
        for side, kept in zip(target.grid, subgrid, strict=True)
    )
    return np.arange(rows * columns).reshape(rows, columns)[np.ix_(down, across)].ravel()


def on_subgrid(detections: Detections, subgrid: tuple[int, int] | None) -> Detections:
    """The same views with the corners of a sub-grid alone; None keeps all."""
    if subgrid is None:
        return detections
    kept = ids_of_subgrid(detections.target, subgrid)

    def thinned(view: View) -> View:
        chosen = np.isin(view.ids, kept)
        return View(view.image, view.ids[chosen], view.pixels[chosen])

    return replace(detections, views=tuple(thinned(view) for view in detections.views))
