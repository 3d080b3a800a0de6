"""Boards of paper that curls are found as flat ones are, steep ones too."""

from __future__ import annotations

import pytest
from benchmarks.studies.curled_boards import BOARDS, TILTS, photographs
from benchmarks.studies.true_places import errors_of_sight, true_ids
from numpy.testing import assert_allclose

from orthoscope.detection.sight import Sight
from orthoscope.detection.table import see
from orthoscope.targets.table import parse_target


@pytest.mark.parametrize("spec", BOARDS)
def test_a_curled_board_at_70_degrees_is_found_with_its_ids(spec):
    target = parse_target(spec)
    (shown,) = photographs(spec, TILTS[-1], 1)
    sight = see(shown.picture, target)
    assert isinstance(sight, Sight)
    assert shown.whole[sight.ids].sum() > 0.85 * shown.whole.sum()
    off = errors_of_sight(true_ids(target, shown.truth, sight), shown.truth, sight)
    assert_allclose(off, 0.0, atol=0.5)
