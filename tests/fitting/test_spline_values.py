"""Values of splines at corners: the same however many are made at a time."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.testing import assert_allclose

from orthoscope.fitting.slopes import spline_values
from orthoscope.fitting.slopes.spline_values import SplineValues


@pytest.fixture
def values() -> SplineValues:
    rng = np.random.default_rng(0)
    return SplineValues(rng.standard_normal((7, 5, 3)), rng.standard_normal((7, 5, 4)))


@pytest.mark.parametrize("at_once", [1, 130, 10**6])
def test_products_are_those_of_the_whole_table(
    values: SplineValues, at_once: int, monkeypatch: pytest.MonkeyPatch
):
    monkeypatch.setattr(spline_values, "VALUES_AT_ONCE", at_once)
    rng = np.random.default_rng(1)
    table = np.einsum("mpy,mpx->mpyx", values.down, values.across).reshape(7, 5, 12)
    shared, own, corners = (rng.standard_normal(shape) for shape in ((12, 2), (7, 12, 2), (7, 5, 2)))
    assert_allclose(values.times(shared), table @ shared, atol=1e-12)
    assert_allclose(values.times(own), table @ own, atol=1e-12)
    assert_allclose(values.gathered(corners), table.transpose(0, 2, 1) @ corners, atol=1e-12)
    assert_allclose(values.only(slice(2, 5)).times(shared), (table @ shared)[2:5], atol=1e-12)


def test_a_lens_without_a_displacement_has_none():
    assert SplineValues.none(3, 4).splines == 0
