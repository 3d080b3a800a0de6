"""The solver: it finds minima, eliminates views without changing anything, says how it ended and what the
data leave open.
"""

from __future__ import annotations

import numpy as np
import pytest
from numpy.testing import assert_allclose
from scipy.optimize import least_squares

from helpers.blocks import Blocks, Place
from orthoscope.geometry.arrays import InputError
from orthoscope.solve.block_system import NormalEquations, shared_covariance
from orthoscope.solve.least_squares import Options, Status, solve
from orthoscope.solve.losses import Cauchy, Huber, Linear, Loss

SHAPES = {  # k shared, m views, p of each view
    "like a calibration": (9, 5, 6),
    "no views": (4, 0, 6),
    "no shared unknowns": (0, 4, 6),
    "views of one unknown": (3, 7, 1),
    "views wider than the shared block": (2, 3, 11),
    "one view": (5, 1, 2),
}
WIDE = (3, 2, 150)
for_every_shape = pytest.mark.parametrize("shape", SHAPES.values(), ids=SHAPES.keys())
with_every_damping = pytest.mark.parametrize("damp", ["diagonal", "identity"])


@for_every_shape
@with_every_damping
@pytest.mark.parametrize("seed", range(3))
def test_it_reaches_the_minimum_that_scipy_reaches(shape, damp, seed):
    problem = Blocks(*shape, rows=30, seed=seed)
    found = solve(problem, problem.start, options=Options(damp=damp))
    oracle = least_squares(
        lambda flat: problem.residual(problem.place(flat)),
        problem.start.flat(),
        jac=lambda flat: problem.jacobian(problem.place(flat)),  # pyright: ignore[reportArgumentType]
        xtol=1e-15, ftol=1e-15, gtol=1e-15,
    )  # fmt: skip
    assert found.status is Status.CONVERGED
    assert_allclose(
        found.cost, 2.0 * oracle.cost, rtol=1e-10
    )  # ten times the tolerance; scipy's cost is half the sum
    # what a step would still gain is 1e-11 of the cost: 1e-5 of a deviation, and deviations are about noise /
    # sqrt(rows) = 0.02
    assert_allclose(found.unknowns.flat(), oracle.x, atol=1e-6)


@pytest.mark.parametrize("loss", [Huber(0.2), Cauchy(0.2)], ids=repr)
def test_robust_minima_are_those_of_scipy(loss):
    problem = Blocks(3, 4, 2, rows=30, noise=0.4)
    found = solve(problem, problem.start, loss=loss)
    oracle = least_squares(
        lambda flat: problem.residual(problem.place(flat)),
        found.unknowns.flat(),  # the cost is not convex: from afar the two might take different ways
        loss=type(loss).__name__.lower(), f_scale=loss.scale, xtol=1e-15, ftol=1e-15, gtol=1e-15,
    )  # fmt: skip
    assert found.status is Status.CONVERGED
    assert_allclose(
        found.cost, 2.0 * oracle.cost, rtol=1e-9
    )  # reweighting converges linearly: the last gain is not all there is


@for_every_shape
def test_trusting_its_last_step_it_saves_the_sums_there_and_ends_where_it_ends_otherwise(shape):
    problem, formed = Blocks(*shape, rows=30), []
    linearise = problem.linearise
    problem.linearise = lambda unknowns, loss: formed.append(unknowns) or linearise(unknowns, loss)
    lowest = solve(problem, problem.start, options=Options(tolerance=1e-13)).cost
    formed.clear()
    trusting = solve(problem, problem.start, options=Options(tolerance=1e-9, trusting=True))
    assert trusting.status is Status.CONVERGED
    assert len(formed) == trusting.steps  # the start's and one for each step but the last
    assert linearise(trusting.unknowns, Linear()).cost <= lowest * (
        1.0 + 2e-9
    )  # twice the tolerance: the rate of shrinking drifts
    assert_allclose(trusting.cost, lowest, rtol=1e-5)  # as that step promised


@pytest.mark.parametrize(
    "shape", [*SHAPES.values(), WIDE], ids=[*SHAPES, "views as wide as the points of a photograph"]
)
@pytest.mark.parametrize(
    ("damp", "damping"), [("diagonal", 1e-6), ("diagonal", 0.7), ("identity", 1e-6), ("identity", 5.0)]
)
def test_eliminating_the_views_gives_the_dense_step(shape, damp, damping):
    problem = Blocks(
        *shape, rows=max(20, 2 * shape[2]), bend=0.0
    )  # linear, so the first step is always taken
    one = solve(problem, problem.start, options=Options(max_steps=1, damp=damp, damping=damping))
    J, e = problem.jacobian(problem.start), problem.residual(problem.start)
    H = J.T @ J
    weights = np.diag(H) if damp == "diagonal" else np.ones(len(H))
    step = -np.linalg.solve(H + damping * np.diag(weights), J.T @ e)
    assert_allclose(
        one.unknowns.flat() - problem.start.flat(), step, atol=1e-11
    )  # rounding times a condition of at most 1e3


def test_a_linear_problem_takes_one_step():
    problem = Blocks(4, 3, 6, rows=20, bend=0.0)
    assert solve(problem, problem.start, options=Options(damping=1e-12)).steps == 1


def test_started_at_the_minimum_it_stays_there():
    problem = Blocks(4, 3, 6, rows=20)
    there = solve(problem, problem.start).unknowns
    again = solve(problem, there)
    assert (again.steps, again.status) == (0, Status.CONVERGED)
    assert_allclose(again.unknowns.flat(), there.flat(), rtol=0, atol=0)


def test_without_noise_it_finds_the_truth():
    problem = Blocks(4, 3, 6, rows=20, noise=0.0)
    found = solve(problem, problem.start)
    assert found.status is Status.CONVERGED
    assert_allclose(
        found.unknowns.flat(), problem.truth.flat(), atol=1e-8
    )  # stops where a step gains less than 1e-18 = (1e-9)^2


def test_unknowns_that_nothing_depends_on_do_not_disturb_the_others():
    problem = Blocks(4, 3, 2, rows=20)
    reference = solve(problem, problem.start).unknowns
    problem.S = np.insert(problem.S, 1, 0.0, axis=1)
    problem.S = np.concatenate([problem.S, problem.S[:, :1]], axis=1)  # and the first column once more
    start = Place(np.concatenate([np.insert(problem.start.shared, 1, 3.0), [0.0]]), problem.start.views)
    found = solve(problem, start)
    assert found.status is Status.CONVERGED
    assert_allclose(found.unknowns.shared[1], 3.0)
    assert_allclose(
        found.unknowns.shared[0] + found.unknowns.shared[-1], reference.shared[0], atol=1e-6
    )  # as in the test against scipy
    assert_allclose(found.unknowns.shared[2:-1], reference.shared[1:], atol=1e-6)


def test_cauchy_resists_gross_errors():
    clean = Blocks(3, 4, 2, rows=40, noise=0.01)
    spoilt = Blocks(3, 4, 2, rows=40, noise=0.01)
    bad = np.random.default_rng(1).random(len(spoilt.b)) < 0.1
    spoilt.b[bad] += 8.0
    truth = clean.truth.shared
    plain = np.abs(solve(spoilt, spoilt.start).unknowns.shared - truth).max()
    robust = np.abs(solve(spoilt, spoilt.start, loss=Cauchy(0.03)).unknowns.shared - truth).max()
    assert plain > 0.1
    assert robust < 0.005  # noise / sqrt(rows of all views) is 0.001


class Valley:
    """x + y = 1 against x - y = 500, seen through 1e-4, beside a residual of 1 that nothing moves: y - x
    hardly matters, but it does.
    """

    J, b = np.array([[1.0, 1.0], [1e-4, -1e-4], [0.0, 0.0]]), np.array([1.0, 0.05, 1.0])

    def linearise(self, unknowns, loss):
        e = self.J @ unknowns - self.b
        return NormalEquations(
            float(e @ e),
            self.J.T @ self.J,
            self.J.T @ e,
            np.empty((0, 2, 0)),
            np.empty((0, 0, 0)),
            np.empty((0, 0)),
        )

    def move(self, unknowns, shared, views):
        return unknowns + shared


def test_it_does_not_trust_a_promise_that_only_damping_made_small():
    found = solve(Valley(), np.zeros(2), options=Options(tolerance=1e-6, trusting=True))
    assert found.status is Status.CONVERGED
    assert_allclose(
        found.unknowns, [250.5, -249.5], rtol=0.02
    )  # 1e-6 of a cost of 1, by the slope of 1e-4, is 10 on y - x


class Cliff:
    """(x - 2)^2, but nothing beyond x = 1."""

    def linearise(self, unknowns, loss):
        e = unknowns - 2.0
        cost = float(e * e) if unknowns <= 1.0 else float("nan")
        none = np.empty((0, 1, 0))
        return NormalEquations(
            cost, np.ones((1, 1)), np.array([e]), none, np.empty((0, 0, 0)), np.empty((0, 0))
        )

    def move(self, unknowns, shared, views):
        return unknowns + float(shared[0])


def test_at_the_end_of_a_domain_it_is_stuck_and_does_not_claim_a_minimum():
    found = solve(
        Cliff(), 0.0, options=Options(max_steps=200)
    )  # each step that is taken loosens the damping, the next falls over the edge
    assert found.status is Status.STUCK
    assert_allclose(found.unknowns, 1.0, atol=1e-9)  # where a step promises 1e-11 of the cost of 1


def test_outside_a_domain_it_cannot_start():
    found = solve(Cliff(), 1.5)
    assert (found.status, found.steps, found.unknowns) == (Status.NO_COST, 0, 1.5)


def test_at_the_step_limit_it_says_so():
    problem = Blocks(4, 3, 6, rows=20)
    found = solve(problem, problem.start, options=Options(max_steps=1))
    assert (found.status, found.steps) == (Status.STEP_LIMIT, 1)


def test_every_status_is_a_sentence():
    assert all(status.value[0].islower() and not status.value.endswith(".") for status in Status)
    assert {Status.CONVERGED, Status.STUCK, Status.NO_COST, Status.STEP_LIMIT} == set(
        Status
    )  # each is reached by a test above


def test_progress_hears_of_falling_costs():
    problem, heard = Blocks(4, 3, 6, rows=20), []
    found = solve(
        problem, problem.start, options=Options(progress=lambda step, cost: heard.append((step, cost)))
    )
    steps, costs = zip(*heard, strict=True)
    assert list(steps) == sorted(set(steps))
    assert list(costs) == sorted(costs, reverse=True)
    assert costs[-1] == found.cost


def test_an_unknown_way_of_damping_is_refused():
    with pytest.raises(InputError, match="expected 'diagonal' or 'identity'"):
        Options(damp="none")


@pytest.mark.parametrize("shape", [(4, 3, 6), (4, 0, 6), (0, 2, 3)])
def test_the_covariance_is_the_dense_inverse(shape):
    problem = Blocks(*shape, rows=20)
    found = solve(problem, problem.start)
    J, measurements = problem.jacobian(found.unknowns), len(problem.b)
    dense = found.cost / (measurements - J.shape[1]) * np.linalg.inv(J.T @ J)[: shape[0], : shape[0]]
    assert_allclose(shared_covariance(found.sums, measurements), dense, rtol=1e-9, atol=1e-15)


def test_the_covariance_is_the_scatter_over_repeated_measurements():
    problem = Blocks(3, 4, 2, rows=15, noise=0.0)
    exact, rng, found, told = problem.b, np.random.default_rng(5), [], []
    for _ in range(400):
        problem.b = exact + 0.05 * rng.normal(size=len(exact))
        solution = solve(problem, problem.truth)
        found.append(solution.unknowns.shared)
        told.append(shared_covariance(solution.sums, len(exact)))
    scatter, told = np.cov(np.array(found).T), np.mean(told, axis=0)
    deviations = np.sqrt(np.diag(told))
    # 400 draws tell a variance to sqrt(2 / 400) = 7 %, a correlation to 5 %: three of these
    assert_allclose(
        scatter / np.outer(deviations, deviations), told / np.outer(deviations, deviations), atol=0.21
    )


def test_the_covariance_is_infinite_for_unknowns_that_the_data_leave_open_and_only_for_them():
    problem = Blocks(3, 3, 2, rows=20)
    found = solve(problem, problem.start)
    reference = shared_covariance(found.sums, len(problem.b))
    problem.S = np.concatenate([problem.S, problem.S[:, :1], np.zeros((len(problem.S), 1))], axis=1)
    doubled = Place(np.concatenate([found.unknowns.shared, [0.0, 0.0]]), found.unknowns.views)
    covariance = shared_covariance(
        problem.linearise(doubled, Linear()), len(problem.b) + 2
    )  # as many to spare as before
    is_open = np.array([True, False, False, True, True])
    assert np.isinf(covariance[is_open]).all()
    assert np.isinf(covariance[:, is_open]).all()
    assert_allclose(covariance[1:3, 1:3], reference[1:, 1:], rtol=1e-6)


def test_a_view_that_leaves_its_own_unknown_open_still_has_its_say():
    problem = Blocks(3, 3, 2, rows=20)
    problem.V[:, 1] = 0.0
    sums = problem.linearise(problem.truth, Linear())
    without = sums._replace(B=sums.B[:, :, :1], C=sums.C[:, :1, :1], c=sums.c[:, :1])
    many = 10**9  # so many measurements that the number of unknowns makes no difference
    assert_allclose(shared_covariance(sums, many), shared_covariance(without, many), rtol=1e-7)


class Slow:
    """Residuals x + 1 and bend x^2 + x - 1, least at x = 0: what is left after a step is `bend` of what was.

    K. Madsen, H. Nielsen and O. Tingleff, Methods for non-linear least squares problems, 2004, example 3.4.
    """

    def __init__(self, bend: float) -> None:
        self.bend = bend

    def linearise(self, unknowns: np.ndarray, loss: Loss) -> NormalEquations:
        x = unknowns[0]
        e, J = np.array([x + 1.0, self.bend * x * x + x - 1.0]), np.array([1.0, 2.0 * self.bend * x + 1.0])
        nothing = np.empty((0, 1, 0)), np.empty((0, 0, 0)), np.empty((0, 0))
        return NormalEquations(float(e @ e), np.array([[J @ J]]), np.array([J @ e]), *nothing)

    def move(self, unknowns: np.ndarray, shared: np.ndarray, views: np.ndarray) -> np.ndarray:
        return unknowns + shared


@pytest.mark.parametrize("bend", [0.8, -0.8], ids=["steps too short", "steps too long"])
def test_where_every_step_errs_by_the_same_share_steps_are_made_as_long_as_is_best(bend):
    found = solve(Slow(bend), np.array([0.1]), options=Options(tolerance=1e-14))
    assert found.status is Status.CONVERGED
    assert abs(found.unknowns[0]) < 1e-5
    assert found.steps < 20  # as they are, it takes 53 and 32
