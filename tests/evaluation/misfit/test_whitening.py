"""Whitening: what least squares explains, and how many columns that takes."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.testing import assert_allclose

from orthoscope.evaluation.misfit.whitening import Whitening

RNG = np.random.default_rng(0)
LENGTHS = 10.0 ** RNG.uniform(-3.0, 3.0, 150)  # more columns than are inverted at once
COLUMNS = RNG.standard_normal((400, 150)) * LENGTHS
FAINTLY = 1e-6  # FAINT, and the condition of so many random columns


def test_white_scores_are_what_least_squares_explains():
    residual = RNG.standard_normal(400)
    explained = COLUMNS @ np.linalg.lstsq(COLUMNS, residual, rcond=None)[0]
    whole = Whitening.of(COLUMNS.T @ COLUMNS)
    white = whole.white @ (COLUMNS.T @ residual / whole.lengths)
    assert_allclose(white @ white, explained @ explained, rtol=FAINTLY)


@pytest.mark.parametrize(
    "some", [np.arange(40), np.arange(30, 150), np.array([3, 1, 149])], ids=["first", "last", "any"]
)
def test_some_of_the_columns_are_whitened_as_if_they_were_alone(some: np.ndarray):
    alone = Whitening.of(COLUMNS[:, some].T @ COLUMNS[:, some])
    assert_allclose(Whitening.of(COLUMNS.T @ COLUMNS).white_of(some), alone.white, atol=1e-12)


def test_columns_that_are_zero_are_left_zero():
    columns = np.concatenate([COLUMNS[:, :3], np.zeros((400, 2))], axis=1)
    whole = Whitening.of(columns.T @ columns)
    assert np.isfinite(whole.white).all()
    assert_allclose(whole.white[:3, :3], Whitening.of(COLUMNS[:, :3].T @ COLUMNS[:, :3]).white)
