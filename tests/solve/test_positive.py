"""The inverse of a positive matrix: the one that numpy gives, whatever the units, and symmetric."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal

from orthoscope.solve.positive import positive_inverse


@pytest.mark.parametrize("side", [1, 7, 48, 49, 131])  # on both sides of where halves begin
def test_it_is_the_inverse_in_any_units(side: int):
    rng = np.random.default_rng(side)
    columns = rng.normal(size=(2 * side + 2, side)) * 10.0 ** rng.uniform(-6, 6, side)
    matrix = columns.T @ columns
    inverse = positive_inverse(matrix)
    lengths = np.sqrt(np.diag(matrix))
    assert_allclose(
        (inverse * lengths * lengths[:, None]) @ (matrix / lengths / lengths[:, None]),
        np.eye(side),
        atol=1e-9,
    )
    assert_allclose(inverse, inverse.T, rtol=1e-12)


def test_a_matrix_that_is_barely_not_positive_has_a_symmetric_inverse_too():
    matrix = np.diag([1.0, 1.0, -1.0])
    matrix[0, 1] = matrix[1, 0] = 0.5
    inverse = positive_inverse(matrix + np.diag([0.0, 0.0, 0.5]))
    assert_array_equal(inverse, inverse.T)
