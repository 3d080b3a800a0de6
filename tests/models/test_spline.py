"""The displacement is the bicubic spline that it says it is, zero away from its lattice, and as rough as the
integral says.
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal
from scipy.interpolate import BSpline

from orthoscope.geometry.arrays import InputError
from orthoscope.models.lenses.spline import Displacement, Lattice

LATTICES = {
    "square": Lattice.over(np.array([-1.0, -1.0]), np.array([1.0, 1.0]), (4, 4)),
    "oblong": Lattice.over(np.array([-0.9, -0.5]), np.array([0.7, 0.6]), (7, 3)),
    "of one cell": Lattice.over(np.array([0.1, 0.2]), np.array([0.4, 1.2]), (1, 1)),
}
for_every_lattice = pytest.mark.parametrize("lattice", LATTICES.values(), ids=LATTICES.keys())


def drawn(lattice: Lattice, seed: int = 0) -> Displacement:
    return Displacement(lattice, np.random.default_rng(seed).standard_normal((lattice.splines, 2)))


def border(lattice: Lattice) -> tuple[np.ndarray, np.ndarray]:
    """Where the lattice's cells begin and end."""
    return lattice.origin, lattice.origin + lattice.step * (np.array(lattice.shape) - 3)


def places(lattice: Lattice, *, around: float = 5.0, count: int = 400) -> tuple[np.ndarray, np.ndarray]:
    """Random places over the lattice and so many cells around it, its corners and some knots among them."""
    low, high = border(lattice)
    rng = np.random.default_rng(1)
    x, y = (
        rng.uniform(low[i] - around * lattice.step[i], high[i] + around * lattice.step[i], count)
        for i in (0, 1)
    )
    knots = low + lattice.step * np.arange(-4, 5)[:, None]
    return np.concatenate([x, knots[:, 0], [low[0], high[0]]]), np.concatenate(
        [y, knots[:, 1], [low[1], high[1]]]
    )


def by_scipy(lattice: Lattice, x: np.ndarray, y: np.ndarray, slope: tuple[int, int] = (0, 0)) -> np.ndarray:
    """The value of every spline (n, splines), or its derivative of these orders, by scipy."""

    def along(axis: int, values: np.ndarray) -> np.ndarray:
        starts = lattice.origin[axis] + lattice.step[axis] * (np.arange(lattice.shape[axis]) - 3)
        pieces = (
            BSpline.basis_element(start + lattice.step[axis] * np.arange(5), extrapolate=False)
            for start in starts
        )
        return np.stack([np.nan_to_num(piece(values, slope[axis])) for piece in pieces], axis=-1)

    return (along(1, y)[:, :, None] * along(0, x)[:, None, :]).reshape(len(x), -1)


@for_every_lattice
def test_splines_are_those_of_scipy(lattice):
    x, y = places(lattice)
    assert_allclose(
        lattice.design(x, y), by_scipy(lattice, x, y), atol=1e-13
    )  # cubes of places a few cells away, rounded


@for_every_lattice
def test_a_displacement_and_its_slopes_are_those_of_scipy(lattice):
    x, y = places(lattice)
    displacement = drawn(lattice)
    for found, slope in zip(displacement.at(x, y), ((0, 0), (1, 0), (0, 1)), strict=True):
        scale = np.prod(lattice.step ** np.array(slope))
        assert_allclose(
            scale * found, scale * (by_scipy(lattice, x, y, slope) @ displacement.coefficients), atol=1e-12
        )


@for_every_lattice
def test_a_displacement_is_its_coefficients_times_the_design(lattice):
    x, y = (part[:400].reshape(20, 20) for part in places(lattice))
    displacement = drawn(lattice)
    assert_allclose(
        displacement.at(x, y)[0], lattice.design(x, y) @ displacement.coefficients, atol=1e-14
    )  # the order of sums differs


@for_every_lattice
def test_over_its_cells_the_splines_add_up_to_one(lattice):
    low, high = border(lattice)
    x, y = np.random.default_rng(0).uniform(low, high, (500, 2)).T
    assert_allclose(lattice.design(x, y).sum(-1), 1.0, atol=1e-14)


@for_every_lattice
def test_any_bicubic_function_over_its_cells_is_one_of_its_displacements(lattice):
    x, y = np.random.default_rng(0).uniform(*border(lattice), (500, 2)).T
    wanted = (1.0 - x + 3.0 * x**3) * (0.5 + y**2 - 2.0 * y**3)
    design = lattice.design(x, y)
    coefficients, *_ = np.linalg.lstsq(design, wanted)
    assert_allclose(design @ coefficients, wanted, atol=1e-12)


@for_every_lattice
def test_three_cells_beyond_its_border_and_anywhere_farther_nothing_moves(lattice):
    low, high = border(lattice)
    before, after = low - 3.0 * lattice.step, high + 3.0 * lattice.step
    for far in (0.0, 1e-3, 1.0, 1e6, 1e300):
        for x, y in (
            (before[0] - far, 0.3),
            (after[0] + far, 0.3),
            (0.3, before[1] - far),
            (0.3, after[1] + far),
        ):
            for part in drawn(lattice).at(np.array([x]), np.array([y])):
                assert_allclose(part, 0.0, atol=1e-28)  # the square of a rounding, for the slopes


@for_every_lattice
def test_it_is_twice_continuously_differentiable_all_the_way_to_zero(lattice):
    displacement, step = drawn(lattice), 1e-4 * lattice.step
    x, y = (part[:400] for part in places(lattice, around=3.5))
    _, before, _ = displacement.at(x - step[0], y)
    _, after, _ = displacement.at(x + step[0], y)
    # a second derivative that leaps by its own size would change the slope by its size (some units per cell)
    # however short the step
    assert np.abs(after - before).max() * lattice.step[0] < 10.0 * 2e-4


def test_a_place_that_is_none_is_moved_by_something_finite():
    for part in drawn(LATTICES["square"]).at(np.array([np.nan, 0.0]), np.array([0.0, np.nan])):
        assert np.isfinite(part).all()


def over_cells(lattice: Lattice, nodes: int = 12) -> Iterator[tuple[np.ndarray, np.ndarray, float]]:
    """Places and weights (the same for all) of a midpoint rule, cell by cell."""
    fine = (np.arange(nodes) + 0.5) / nodes
    for i in range(lattice.shape[0] - 3):
        for j in range(lattice.shape[1] - 3):
            x, y = np.meshgrid(
                lattice.origin[0] + lattice.step[0] * (i + fine),
                lattice.origin[1] + lattice.step[1] * (j + fine),
            )
            yield x.ravel(), y.ravel(), float(lattice.step.prod() / nodes**2)


@for_every_lattice
@pytest.mark.parametrize("reach", [0.3, 3.0])
def test_the_energy_is_the_integral_of_the_matern_prior(lattice, reach):
    coefficients = np.random.default_rng(2).standard_normal(lattice.splines)
    integral = 0.0
    for x, y, weight in over_cells(lattice):
        s, s_x, s_y, s_xx, s_xy, s_yy = (
            by_scipy(lattice, x, y, slope) @ coefficients
            for slope in ((0, 0), (1, 0), (0, 1), (2, 0), (1, 1), (0, 2))
        )
        density = s**2 / reach**4 + 2.0 * (s_x**2 + s_y**2) / reach**2 + s_xx**2 + 2.0 * s_xy**2 + s_yy**2
        integral += weight * density.sum()
    energy = lattice.energy(reach)
    scale = energy[0, 0] / unscaled_first(lattice, reach)
    assert_allclose(
        coefficients @ energy @ coefficients, scale * integral, rtol=5e-3
    )  # the midpoint rule of 12 by 12 in a cell


def unscaled_first(lattice: Lattice, reach: float) -> float:
    """The integral for the first spline alone: only its last piece, (1 - t)^3 / 6, lies over a cell, in both
    directions.
    """
    t, shares = np.polynomial.legendre.leggauss(8)
    t, shares = 0.5 * (t + 1.0), 0.5 * shares
    grams = []
    for axis in (0, 1):
        h = lattice.step[axis]
        pieces = ((1.0 - t) ** 3 / 6.0, -((1.0 - t) ** 2) / 2.0 / h, (1.0 - t) / h**2)
        grams.append([h * float(shares @ piece**2) for piece in pieces])
    (x0, x1, x2), (y0, y1, y2) = grams
    return x0 * y0 / reach**4 + 2.0 * (x1 * y0 + x0 * y1) / reach**2 + x2 * y0 + 2.0 * x1 * y1 + x0 * y2


@for_every_lattice
def test_the_energy_is_positive_and_symmetric(lattice):
    energy = lattice.energy(0.5)
    assert_allclose(energy, energy.T, rtol=1e-12, atol=1e-12 * energy.max())
    assert np.linalg.eigvalsh(energy).min() > 0.0


@for_every_lattice
@pytest.mark.parametrize("reach", [0.2, 0.5, 2.0])
def test_a_displacement_drawn_from_its_prior_has_unit_variance_in_the_middle(lattice, reach):
    middle = lattice.design(*np.mean(border(lattice), axis=0).reshape(2, 1))[0]
    assert_allclose(middle @ np.linalg.solve(lattice.energy(reach), middle), 1.0, rtol=1e-9)


def test_what_a_prior_of_long_reach_likes_is_smoother():
    lattice = LATTICES["square"]
    left, right = lattice.design(np.array([-0.5, 0.5]), np.zeros(2))
    related = []
    for reach in (0.1, 0.5, 2.0):
        covariance = np.linalg.inv(lattice.energy(reach))
        related.append(
            (left @ covariance @ right) / np.sqrt((left @ covariance @ left) * (right @ covariance @ right))
        )
    assert related[0] < 0.1 < related[1] < related[2]
    assert related[2] > 0.7


def test_all_that_a_lattice_holds_is_read_only():
    lattice = LATTICES["square"]
    with pytest.raises(ValueError, match="read-only"):
        drawn(lattice).coefficients[0] = 1.0
    with pytest.raises(ValueError, match="read-only"):
        lattice.origin[0] = 1.0


def test_a_lattice_over_a_rectangle_ends_where_the_rectangle_does():
    lattice = LATTICES["oblong"]
    low, high = border(lattice)
    assert_allclose((*low, *high), (-0.9, -0.5, 0.7, 0.6), atol=1e-15)
    assert lattice.shape == (10, 6)
    assert lattice.splines == 60
    assert_array_equal(lattice.design(np.empty(0), np.empty(0)).shape, (0, 60))


@pytest.mark.parametrize(
    ("step", "shape"), [((0.1, 0.1), (3, 5)), ((0.0, 0.1), (5, 5)), ((0.1, -0.1), (5, 5))]
)
def test_a_lattice_without_cells_is_refused(step, shape):
    with pytest.raises(InputError, match="expected at least 4 each way, steps above 0"):
        Lattice(np.zeros(2), np.array(step), shape)


def test_coefficients_for_another_lattice_are_refused():
    with pytest.raises(
        InputError, match=r"displacement: coefficients has shape \(4, 2\); expected \(49, 2\)"
    ):
        Displacement(LATTICES["square"], np.zeros((4, 2)))
