"""Robust losses: each weight is the slope of its cost, and small residuals are squares."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.testing import assert_allclose

from orthoscope.geometry.arrays import InputError
from orthoscope.solve.losses import LOSSES, Cauchy, Huber

for_every_loss = pytest.mark.parametrize(
    "loss", [kind(scale) for kind in LOSSES.values() for scale in (0.3, 1.0, 40.0)], ids=repr
)


def away_from_the_kink(scale: float) -> np.ndarray:
    """Squared residuals from almost 0 to far out; Huber's slope has a kink at scale^2."""
    return scale**2 * np.array([1e-6, 1e-3, 0.1, 0.5, 0.99, 1.01, 2.0, 10.0, 1e4])


@for_every_loss
def test_the_weight_is_the_derivative_of_the_cost(loss):
    q = away_from_the_kink(loss.scale)
    h = 1e-5 * q
    slope = (loss.cost(q + h) - loss.cost(q - h)) / (2 * h)
    weight = loss.weight(q)
    assert_allclose(
        np.ones_like(q) if weight is None else weight, slope, rtol=1e-6
    )  # of the differences: h^2 and 1e-16 / h


@for_every_loss
def test_a_small_residual_costs_its_square(loss):
    q = loss.scale**2 * np.array([0.0, 1e-12, 1e-9])
    assert_allclose(loss.cost(q), q, rtol=1e-8, atol=0)
    assert_allclose(1.0 if loss.weight(q) is None else loss.weight(q), 1.0, rtol=1e-8)


@for_every_loss
def test_a_larger_residual_costs_more_but_never_more_than_its_square(loss):
    q = np.sort(np.append(away_from_the_kink(loss.scale), 0.0))
    cost = loss.cost(q)
    assert (np.diff(cost) > 0).all()
    assert (cost <= q).all()


def test_huber_is_a_straight_line_beyond_its_scale():
    far = np.array([3.0, 4.0, 5.0])
    assert_allclose(Huber(2.0).cost(far**2), 2.0 * 2.0 * far - 4.0)


def test_cauchy_all_but_forgets_a_gross_error():
    assert Cauchy(1.0).weight(np.array([1e6]))[0] < 1.1e-6


@pytest.mark.parametrize("scale", [0.0, -1.0, float("nan")])
def test_a_scale_that_is_not_positive_is_refused(scale):
    with pytest.raises(InputError, match="expected a positive scale"):
        Huber(scale)
