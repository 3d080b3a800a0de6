"""Lines and cross-ratios: what every projection keeps."""

from __future__ import annotations

import numpy as np
from numpy.testing import assert_allclose

from orthoscope.geometry.projective import cross_ratio, cross_ratio_slope, fitted_lines

FOUR = np.array([[[0.0, 0.0], [1.0, 0.5], [2.0, 1.0], [3.0, 1.5]]])  # equally spaced; a stack of one
SOME = np.array([[3.0, 1.0], [4.0, 2.5], [7.0, 2.0], [8.0, 4.0]])  # on no line


def test_four_equally_spaced_points_have_the_cross_ratio_four_thirds():
    assert_allclose(cross_ratio(FOUR), 4.0 / 3.0, rtol=1e-15)  # one rounding


def test_the_cross_ratio_survives_every_homography():
    rng = np.random.default_rng(1)
    for _ in range(20):
        h = np.eye(3) + 0.1 * rng.standard_normal((3, 3))
        seen = np.concatenate([FOUR, np.ones((1, 4, 1))], axis=2) @ h.T
        assert_allclose(
            cross_ratio(seen[..., :2] / seen[..., 2:]), 4.0 / 3.0, rtol=1e-12
        )  # a few roundings, points a unit apart


def test_the_slope_of_the_cross_ratio_is_its_derivative_off_the_line_too():
    slope, h = cross_ratio_slope(SOME[None])[0], 1e-6
    for i in range(4):
        for j in range(2):
            step = np.zeros((4, 2))
            step[i, j] = h
            ahead, back = cross_ratio(np.stack([SOME + step, SOME - step]))
            assert_allclose(slope[i, j], (ahead - back) / (2 * h), atol=1e-8)  # h^2, and rounding over h


def test_a_line_is_fitted_where_the_sum_of_squares_is_least():
    line = fitted_lines(SOME, np.ones(4))
    spread = np.linalg.svd(SOME - SOME.mean(0), compute_uv=False)
    assert_allclose((line.across**2).sum(), spread[1] ** 2, rtol=1e-12)
    assert_allclose((line.along**2).sum(), spread[0] ** 2, rtol=1e-12)
    assert_allclose(line.gap, spread[0] ** 2 - spread[1] ** 2, rtol=1e-12)


def test_points_of_weight_zero_do_not_move_a_line():
    padded = np.concatenate([SOME, [[1e3, -1e3]]])
    line, alone = fitted_lines(padded, np.array([1.0, 1.0, 1.0, 1.0, 0.0])), fitted_lines(SOME, np.ones(4))
    assert_allclose(line.direction, alone.direction, atol=1e-15)
    assert_allclose(line.across[:4], alone.across, atol=1e-12)


def test_an_upright_line_is_fitted_like_any_other():
    upright = np.array([[2.0, 0.0], [2.0, 1.0], [2.0, 5.0]])
    assert_allclose(fitted_lines(upright, np.ones(3)).across, 0.0, atol=1e-15)
