"""Double sphere and enhanced unified model: the formulas as their papers print them, with x, y, z."""

from __future__ import annotations

import numpy as np
import pytest
from numpy import ndarray
from numpy.testing import assert_allclose

from orthoscope.models.lenses.table import DoubleSphere, Eucm

RNG = np.random.default_rng(0)
AHEAD = RNG.normal(size=(200, 3)) * [1.0, 1.0, 0.3] + [0.0, 0.0, 0.8]  # some are behind the image plane


def double_sphere(rays: ndarray, xi: float, alpha: float) -> ndarray:
    x, y, z = rays.T
    d1 = np.sqrt(x * x + y * y + z * z)
    d2 = np.sqrt(x * x + y * y + (xi * d1 + z) ** 2)
    return np.stack([x, y], -1) / (alpha * d2 + (1 - alpha) * (xi * d1 + z))[:, None]


def eucm(rays: ndarray, alpha: float, beta: float) -> ndarray:
    x, y, z = rays.T
    d = np.sqrt(beta * (x * x + y * y) + z * z)
    return np.stack([x, y], -1) / (alpha * d + (1 - alpha) * z)[:, None]


@pytest.mark.parametrize(("xi", "alpha"), [(-0.2, 0.59), (0.18, 0.81), (0.0, 0.5)])
def test_the_double_sphere_is_that_of_its_paper(xi: float, alpha: float):
    found = DoubleSphere(xi=xi, alpha=alpha).distort(AHEAD)
    seen = np.isfinite(found[:, 0])
    assert (AHEAD[seen, 2] < 0).any()
    assert_allclose(found[seen], double_sphere(AHEAD, xi, alpha)[seen], rtol=1e-12)


@pytest.mark.parametrize(("alpha", "beta"), [(0.6, 1.1), (0.5, 1.0), (0.7, 0.8)])
def test_eucm_is_that_of_its_paper(alpha: float, beta: float):
    found = Eucm(alpha=alpha, beta=beta).distort(AHEAD)
    seen = np.isfinite(found[:, 0])
    assert (AHEAD[seen, 2] < 0).any()
    assert_allclose(found[seen], eucm(AHEAD, alpha, beta)[seen], rtol=1e-12)


@pytest.mark.parametrize(
    "lens", [DoubleSphere(xi=-0.2, alpha=0.6), Eucm(alpha=0.6), Eucm(alpha=0.7, beta=1.2)]
)
def test_both_see_as_far_as_the_image_grows(lens: DoubleSphere | Eucm):
    theta = np.linspace(0.0, np.pi, 100_000)[1:-1]
    rays = np.stack([np.sin(theta), 0.0 * theta, np.cos(theta)], axis=-1)
    radius = lens.distort(rays, beyond=True)[:, 0]
    assert_allclose(lens.field_angle, theta[np.argmax(radius)], atol=1e-3)
    assert 0.5 * np.pi < lens.field_angle < np.pi
