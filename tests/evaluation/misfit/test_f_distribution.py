"""The tail of F: scipy's, over everything that a test may meet."""

from __future__ import annotations

import math

import numpy as np
import pytest
from numpy.testing import assert_allclose
from scipy.special import fdtrc

from orthoscope.evaluation.misfit.f_distribution import f_survival


@pytest.mark.parametrize("a", [1.0, 2.0, 65.0, 154.99, 900.0])
@pytest.mark.parametrize("b", [10.0, 75.3, 6000.0, 100_000.0])
def test_it_is_scipys_from_the_body_to_the_far_tail(a: float, b: float):
    f = np.array([0.01, 0.5, 0.9, 1.0, 1.05, 1.3, 3.0, 20.0])
    ours = [f_survival(value, a, b) for value in f]
    assert_allclose(
        ours, fdtrc(a, b, f), rtol=1e-8, atol=1e-290
    )  # differences of logarithms of gamma, each about 1e6, keep 9 digits


def test_at_its_ends_it_is_one_and_zero():
    assert f_survival(0.0, 5.0, 10.0) == 1.0
    assert f_survival(1e6, 500.0, 6000.0) == 0.0


def test_no_f_has_no_probability():
    assert math.isnan(f_survival(math.nan, 5.0, 10.0))
