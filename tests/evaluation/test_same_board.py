"""The shape that was learnt goes with the board that it was learnt on, and with no other."""

from __future__ import annotations

import numpy as np
import pytest

from helpers.boards import BOARD, NARROW, bent, photographs_of
from orthoscope.evaluation.same_board import same_board
from orthoscope.models.target_shape import TargetShape

LEARNT = TargetShape("smooth", bent(1.5) - BOARD.points)


def test_other_photographs_of_the_same_board_are_known_by_its_shape():
    found = same_board(NARROW, LEARNT, photographs_of(bent(1.5), 5, 1))
    assert found.same
    assert found.sure
    assert found.learnt_px < found.said_px


@pytest.mark.parametrize("bend", [0.0, -1.5])
def test_another_board_is_not_given_that_shape(bend: float):
    found = same_board(NARROW, LEARNT, photographs_of(bent(bend), 5, 1))
    assert not found.same
    assert found.sure


def test_a_shape_that_no_corner_can_show_tells_nothing_for_sure():
    faint = TargetShape("smooth", 1e-4 * LEARNT.displacements)
    assert not same_board(NARROW, faint, photographs_of(bent(0.0), 5, 2)).sure


def test_one_photograph_is_not_sure_of_anything():
    assert not same_board(NARROW, LEARNT, photographs_of(bent(1.5), 1, 3)).sure


def test_a_board_half_as_bent_is_where_the_answer_turns():
    """Squared residuals are a parabola in the share of the shape: the learnt one is nearer above one half."""
    more, less = (
        same_board(NARROW, LEARNT, photographs_of(bent(b), 6, 4, noise_px=0.02)) for b in (1.0, 0.5)
    )
    assert more.same
    assert not less.same
    assert np.isfinite([more.learnt_px, less.said_px]).all()
