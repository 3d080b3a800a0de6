"""Fewer corners still span the board."""

from __future__ import annotations

import numpy as np
import pytest

from orthoscope.paper.subgrids import ids_of_subgrid, on_subgrid, subgrids
from orthoscope.targets.detections import Detections, View
from orthoscope.targets.target import chessboard

BOARD = chessboard(14, 20, 0.014)


@pytest.mark.parametrize("grid", [(14, 20), (9, 6), (3, 2)])
def test_subgrids_grow_to_the_whole_grid(grid):
    found = subgrids(grid, 8)
    sizes = [columns * rows for columns, rows in found]
    assert found[-1] == grid
    assert sizes == sorted(set(sizes))
    assert all(columns <= grid[0] and rows <= grid[1] for columns, rows in found)


@pytest.mark.parametrize("subgrid", subgrids((14, 20), 8))
def test_a_subgrid_keeps_the_outermost_corners_and_whole_lines(subgrid):
    points = BOARD.points[ids_of_subgrid(BOARD, subgrid)]
    assert len(points) == subgrid[0] * subgrid[1]
    for axis, kept in enumerate(subgrid):
        assert len(np.unique(points[:, axis])) == kept
        assert np.ptp(points[:, axis]) == np.ptp(BOARD.points[:, axis])


def test_of_a_partial_board_the_corners_that_were_seen_are_left():
    seen = View("a", np.arange(0, 280, 2), np.zeros((140, 2)) + np.arange(140)[:, None])
    detections = Detections(BOARD, (640, 480), (seen,))
    left = on_subgrid(detections, (3, 4)).views[0]
    assert set(left.ids) == set(seen.ids) & set(ids_of_subgrid(BOARD, (3, 4)))
    assert on_subgrid(detections, None) is detections
