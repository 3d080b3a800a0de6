"""Boards of every kind in front of real rooms, and what real cameras add: no corner is where none is."""

from __future__ import annotations

import pytest
from benchmarks.real_sets import datasets
from benchmarks.studies.false_corners import errors_of
from benchmarks.studies.real_scenes import FALSE_IN_MOTION_PX, FALSE_PX, photographs

from orthoscope.detection.sight import Sight
from orthoscope.detection.table import see


@pytest.mark.slow  # every board with every disturbance once
@pytest.mark.skipif(datasets() is None, reason="no photographs of rooms")
def test_boards_are_found_in_rooms_and_nothing_else_is():
    count, found = 108, 0
    for shown in photographs(count, seed=3):
        sight = see(shown.picture, shown.target)
        if isinstance(sight, Sight):
            found += 1
            limit = FALSE_IN_MOTION_PX if shown.quality == "motion" else FALSE_PX
            assert errors_of(shown, sight).max() < limit, (shown.number, shown.target.name, shown.quality)
    assert found > 0.9 * count
