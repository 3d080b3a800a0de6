"""Charts: flattening, lifting and pulling derivatives back."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.testing import assert_allclose

from orthoscope.models.lenses.charts import EQUIDISTANT, GNOMONIC, Chart

FOR_EVERY_CHART = pytest.mark.parametrize("chart", [GNOMONIC, EQUIDISTANT], ids=["gnomonic", "equidistant"])


def rays_within(angle: float) -> np.ndarray:
    """Rays of several lengths, to `angle` from the axis, the axis itself and its neighbourhood among them."""
    theta = np.concatenate(
        [[0.0, 1e-12, 1e-6, 0.9e-4, 1.1e-4, 1e-2, 0.05, 0.09], np.linspace(0.1, angle, 20)]
    )
    phi = np.linspace(0.0, 2.0 * np.pi, 9)[:, None]
    rays = np.stack(
        [np.sin(theta) * np.cos(phi), np.sin(theta) * np.sin(phi), np.cos(theta) + 0.0 * phi], axis=-1
    ).reshape(-1, 3)
    return rays * np.linspace(0.5, 3.0, len(rays))[:, None]


def farthest(chart: Chart) -> float:
    return 1.5 if chart is GNOMONIC else 3.0  # 86 and 172 degrees


@FOR_EVERY_CHART
def test_lift_inverts_flatten(chart):
    rays = rays_within(farthest(chart))
    lifted = chart.lift(*chart.flatten(*rays.T))
    assert_allclose(lifted, rays / np.linalg.norm(rays, axis=1, keepdims=True), atol=1e-15)


@FOR_EVERY_CHART
def test_the_radius_of_a_place_is_that_of_its_angle(chart):
    rays = rays_within(farthest(chart))
    theta = np.arctan2(np.hypot(rays[:, 0], rays[:, 1]), rays[:, 2])
    x, y = chart.flatten(*rays.T)
    assert_allclose(np.hypot(x, y), chart.radius(theta), rtol=1e-13)
    assert_allclose(chart.angle(np.hypot(x, y)), theta, rtol=1e-13, atol=1e-15)


@FOR_EVERY_CHART
def test_linearise_finds_the_same_place(chart):
    rays = rays_within(farthest(chart))
    x, y, _ = chart.linearise(*rays.T)
    assert_allclose((x, y), chart.flatten(*rays.T), rtol=1e-14, atol=1e-16)


@FOR_EVERY_CHART
def test_pull_back_is_the_derivative_by_differences(chart):
    rays = rays_within(farthest(chart))
    _, _, pull_back = chart.linearise(*rays.T)
    one, zero = np.ones(len(rays)), np.zeros(len(rays))
    exact = np.stack([np.stack(pull_back(one, zero), axis=-1), np.stack(pull_back(zero, one), axis=-1)])
    step = 1e-6
    for axis in range(3):
        shift = step * np.eye(3)[axis]
        difference = np.stack(chart.flatten(*(rays + shift).T)) - np.stack(chart.flatten(*(rays - shift).T))
        # step^2 times a third derivative, which grows as 1 / cos^4 (gnomonic) and 1 / sin^3 (equidistant) up
        # to 1e5; rounding over step
        assert_allclose(exact[:, :, axis], difference / (2.0 * step), rtol=1e-6, atol=1e-7)


def test_a_pin_hole_sees_nothing_beside_or_behind_itself():
    rays = np.array([[1.0, 0.0, 0.0], [0.1, 0.0, -1.0], [0.0, 0.0, -1.0], [0.0, 0.0, 0.0]])
    assert np.isnan(np.stack(GNOMONIC.flatten(*rays.T))).all()


def test_the_equidistant_chart_has_all_directions_but_straight_back():
    x, y = EQUIDISTANT.flatten(
        *np.array([[1.0, 0.0, 0.0], [0.0, -1.0, -1.0], [0.0, 0.0, -1.0], [0.0, 0.0, 0.0]]).T
    )
    assert_allclose(x, [np.pi / 2, 0.0, np.nan, np.nan], atol=1e-15)
    assert_allclose(y, [0.0, -0.75 * np.pi, np.nan, np.nan], atol=1e-15)


def test_the_equidistant_chart_ends_at_half_a_turn():
    assert np.isnan(EQUIDISTANT.lift(np.array([np.pi, 3.2]), np.zeros(2))).all()
