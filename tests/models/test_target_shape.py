"""Surfaces over a target are orthogonal, of unit size, without what poses do already; a shape says what it is
and no more.
"""

from __future__ import annotations

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal
from scipy.stats import ortho_group

from orthoscope.geometry.arrays import InputError
from orthoscope.geometry.pose import rotation_from_vector
from orthoscope.models.target_shape import TargetShape, polynomials, without_similarity
from orthoscope.targets.target import chessboard

POINTS = chessboard(9, 6, 0.025).points
ALL = np.ones(len(POINTS), dtype=bool)
SOME = np.random.default_rng(0).random(len(POINTS)) < 0.7
for_either = pytest.mark.parametrize("seen", [ALL, SOME], ids=["all corners", "some corners"])
MONOMIALS = 2 + 3 + 4 + 5  # of orders 1 to 4


@for_either
def test_surfaces_are_orthogonal_and_of_mean_square_one(seen):
    surfaces = polynomials(POINTS, seen)
    assert surfaces.shape == (len(POINTS), MONOMIALS)
    assert_allclose(surfaces[seen].T @ surfaces[seen] / seen.sum(), np.eye(surfaces.shape[1]), atol=1e-12)


@for_either
@pytest.mark.parametrize("order", [1, 2, 3, 4])
def test_surfaces_up_to_an_order_and_a_constant_are_all_polynomials_of_it(seen, order):
    surfaces = np.column_stack([seen, polynomials(POINTS, seen, orders=range(1, order + 1))])[seen]
    x, y = 40.0 * (POINTS[seen, :2] - 0.06).T
    for i in range(order + 1):
        for j in range(order + 1 - i):
            wanted = x**i * y**j
            assert_allclose(surfaces @ np.linalg.lstsq(surfaces, wanted)[0], wanted, atol=1e-11)


@for_either
def test_surfaces_of_higher_orders_have_nothing_of_lower_ones(seen):
    x, y = POINTS[:, :2].T
    lower = np.stack([np.ones_like(x), 40.0 * x, 40.0 * y])[:, seen]
    assert_allclose(lower @ polynomials(POINTS, seen, orders=(2, 3, 4))[seen], 0.0, atol=1e-11)
    assert_allclose(
        lower[0] @ polynomials(POINTS, seen)[seen], 0.0, atol=1e-12
    )  # so none shifts the whole target


def test_corners_that_were_not_seen_stay_where_they_are():
    assert_array_equal(polynomials(POINTS, SOME)[~SOME], 0.0)


@pytest.mark.parametrize("unit", [1.0, 1e-3, 1e3])
def test_neither_the_unit_of_length_nor_the_origin_matters(unit):
    moved = unit * (POINTS + np.array([0.3, -7.0, 0.0]))
    assert_allclose(
        np.abs(polynomials(moved, ALL)), np.abs(polynomials(POINTS, ALL)), atol=1e-9
    )  # 7 m away: digits are lost


def test_few_corners_have_as_many_surfaces_as_they_can_tell_apart():
    corners = chessboard(3, 2, 0.03).points
    surfaces = polynomials(corners, np.ones(6, dtype=bool))
    assert surfaces.shape == (6, 5)  # six values: one is the constant
    assert np.isfinite(surfaces).all()


def test_a_row_of_corners_tells_nothing_across():
    seen = np.arange(len(POINTS)) < 9
    assert polynomials(POINTS, seen).shape[1] == 4  # x, x^2, x^3, x^4


def test_a_flat_target_is_where_it_is_said_to_be():
    shape = TargetShape.flat(54)
    assert (shape.kind, shape.rms) == ("flat", 0.0)
    assert_array_equal(shape.displacements, np.zeros((54, 3)))


def similar(displacements: np.ndarray, shift: np.ndarray, turn: np.ndarray, scale: float) -> np.ndarray:
    """The displacements of the same target moved, turned and scaled as a whole."""
    return scale * (POINTS + displacements) @ rotation_from_vector(turn).T + shift - POINTS


@for_either
def test_a_shape_without_similarity_is_the_same_wherever_the_target_was(seen):
    rng = np.random.default_rng(1)
    bent = 1e-3 * rng.standard_normal(POINTS.shape)
    moved = similar(bent, np.array([0.3, -0.1, 2.0]), np.array([0.4, -1.0, 2.0]), 1.1)
    settled = without_similarity(POINTS, bent, seen)
    assert_allclose(without_similarity(POINTS, moved, seen), settled, atol=1e-12)
    assert_allclose(without_similarity(POINTS, settled, seen), settled, atol=1e-12)
    assert not settled[~seen].any()


def test_what_is_left_has_no_shift_turn_or_scale():
    settled = without_similarity(POINTS, 1e-3 * np.random.default_rng(2).standard_normal(POINTS.shape), ALL)
    plane = POINTS - POINTS.mean(0)
    assert_allclose(settled.sum(0), 0.0, atol=1e-14)
    # to lie nearest: no small turn or scale of where the corners are brings them nearer
    assert_allclose(np.cross(plane, settled).sum(0), 0.0, atol=1e-14)
    assert_allclose((settled * (plane + settled)).sum(), 0.0, atol=1e-14)


def test_a_target_that_was_only_moved_has_no_shape():
    moved = similar(np.zeros_like(POINTS), np.array([0.3, -0.1, 2.0]), np.array([0.4, -1.0, 2.0]), 0.9)
    assert_allclose(without_similarity(POINTS, moved, ALL), 0.0, atol=1e-14)


def test_the_height_of_a_shape_is_from_its_lowest_corner_to_its_highest():
    displacements = np.zeros((6, 3))
    displacements[[1, 4], 2] = -1e-3, 2e-3
    assert TargetShape("free", displacements).height == pytest.approx(3e-3)


def test_the_size_of_a_shape_is_that_of_the_corners_that_have_one():
    displacements = np.zeros((10, 3))
    displacements[:4] = 2e-3 * ortho_group.rvs(3, random_state=0)[0]
    assert TargetShape("free", displacements).rms == pytest.approx(2e-3)


@pytest.mark.parametrize(
    ("kind", "displacements", "message"),
    [
        ("wavy", np.zeros((4, 3)), "target shape 'wavy' is not known; expected one of flat, smooth, free"),
        ("flat", np.full((4, 3), 1e-3), "a flat target's corners are displaced; expected displacements of 0"),
        ("free", np.zeros((4, 2)), r"target shape: displacements has shape \(4, 2\); expected \(n, 3\)"),
        ("smooth", np.full((4, 3), np.nan), "expected finite numbers"),
    ],
)
def test_a_shape_that_is_none_is_refused(kind, displacements, message):
    with pytest.raises(InputError, match=message):
        TargetShape(kind, displacements)


def test_displacements_are_read_only():
    with pytest.raises(ValueError, match="read-only"):
        TargetShape.flat(4).displacements[0] = 1.0
