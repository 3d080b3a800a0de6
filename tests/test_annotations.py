"""The check of shapes in annotations has been seen to fail, in every test anew."""

from __future__ import annotations

import numpy as np
import pytest
from jaxtyping import TypeCheckError

from orthoscope.geometry.pose import Pose, cross_matrix

PAIR = np.zeros(2)


@pytest.mark.parametrize("turn", range(2))
def test_a_wrong_shape_is_told(turn):
    with pytest.raises(TypeCheckError, match="cross_matrix"):
        cross_matrix(PAIR)


@pytest.mark.parametrize("turn", range(2))
def test_a_wrong_shape_is_told_where_a_thing_is_made(turn):
    with pytest.raises(TypeCheckError, match="Pose"):
        Pose(rotation=np.eye(3), translation=[[0.0]])


def test_calls_between_those_that_are_checked_run_as_they_are():
    for _ in range(9):
        cross_matrix(np.ones(3))
    with pytest.raises(TypeCheckError):
        cross_matrix(PAIR)  # the tenth
    with pytest.raises(ValueError, match="matmul"):
        cross_matrix(PAIR)
