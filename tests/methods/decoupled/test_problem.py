"""Camera, poses and corners together: the sums are those of the cost, both eliminations say the same, priors
pull as they say.
"""

from __future__ import annotations

from dataclasses import replace
from typing import NamedTuple

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal

from helpers.laws import displaced
from helpers.scenes import K, camera_with
from orthoscope.fitting.observations import Observations
from orthoscope.methods.decoupled.normal_equations import Measurements, spline_unknowns
from orthoscope.methods.decoupled.problem import DecoupledEstimate, Joint, Precisions
from orthoscope.models.camera import Camera
from orthoscope.models.lenses.free import FreeLens
from orthoscope.models.lenses.table import Brown, KannalaBrandt
from orthoscope.models.target_shape import polynomials
from orthoscope.simulation.scene import Scene, random_views, simulate_detections
from orthoscope.solve.block_system import NormalEquations
from orthoscope.solve.least_squares import Options, solve
from orthoscope.solve.losses import Cauchy, Huber, Linear, Loss
from orthoscope.targets.target import chessboard

BOARD = chessboard(4, 3, 0.04)
CORNERS = len(BOARD.points)
BROWN = Brown(k1=-0.28, k2=0.09, p1=1e-3, p2=-6e-4)
OBLIQUE = replace(K, skew=12.0)
NAMES = ("fx", "fy", "cx", "cy", "skew", "k1", "k2", "p1", "p2")
HALF = (0.65, 0.5)  # of BROWN's image of 640x480, about

CAMERAS = {
    "formula": camera_with(BROWN, OBLIQUE),
    "free lens": camera_with(displaced(BROWN, HALF, 0.004, cells=(2, 1)), OBLIQUE),
    "free lens of the angle": camera_with(
        displaced(KannalaBrandt(k1=-0.02), (1.6, 1.2), 0.01, cells=(2, 1)), replace(K, fx=210.0, fy=205.0)
    ),
}
TARGETS = {
    "flat": (False, False),
    "smooth": (True, False),
    "free": (True, True),
    "of single corners only": (False, True),
}
for_every_camera = pytest.mark.parametrize("camera", CAMERAS.values(), ids=CAMERAS.keys())
for_every_target = pytest.mark.parametrize("target", TARGETS.values(), ids=TARGETS.keys())


class Case(NamedTuple):
    problem: Joint
    estimate: DecoupledEstimate


def case(camera: Camera, target: tuple[bool, bool], *, views: int = 4, seed: int = 0) -> Case:
    """A problem with every term in it, a fifth of its corners missing, and an estimate some way off its
    minimum.
    """
    rng = np.random.default_rng(seed)
    smooth, single = target
    poses = random_views(camera, BOARD, views, rng=rng, fill=(0.3, 0.5))
    whole = Observations.by_corner(simulate_detections(Scene(camera, BOARD, poses), noise_px=0.5, rng=rng))
    present = whole.present * (rng.random(whole.present.shape) < 0.8)
    observations = replace(whole, present=present, u=whole.u * present, v=whole.v * present)
    names = tuple(name for name in NAMES if name in (*NAMES[:5], *camera.lens.names()))
    surface = polynomials(BOARD.points, np.ones(CORNERS, dtype=bool)) if smooth else np.zeros((CORNERS, 0))
    energy = camera.lens.over.lattice.energy(0.5) if isinstance(camera.lens, FreeLens) else np.zeros((0, 0))
    precisions = Precisions(10 ** rng.uniform(3, 5, (surface.shape[1], 3)), 10 ** rng.uniform(3, 5, 3), 2e4)
    problem = Joint(
        Measurements(observations, camera, names, corners_move=smooth or single), BOARD.points, names,
        surface=surface, energy=energy, single=single, precisions=precisions,
    )  # fmt: skip
    singles = 1e-3 * rng.standard_normal((CORNERS, 3)) * single
    return Case(
        problem,
        DecoupledEstimate(
            camera, observations.poses_of(poses), 1e-3 * rng.standard_normal((surface.shape[1], 3)), singles
        ),
    )


def residual(problem: Joint, at: DecoupledEstimate) -> np.ndarray:
    """Everything that is squared in the cost, by plain formulas."""
    observations = problem.measurements.observations
    points = problem.points + problem.surface @ at.surface + at.singles
    rows = []
    for view, (rotation, translation) in enumerate(zip(*at.poses, strict=True)):
        seen = observations.present[view] > 0
        e = (
            at.camera.project(points[seen] @ rotation.T + translation, beyond=True)
            - observations.pixels()[view, seen]
        )
        rows.append(e.ravel())
    surface, singles, spline = problem.precisions
    rows += [(np.sqrt(surface) * at.surface).ravel(), (np.sqrt(singles) * at.singles).ravel()]
    if isinstance(at.camera.lens, FreeLens):
        root = np.linalg.cholesky(problem.energy).T
        rows.append(np.sqrt(spline) * (root @ at.camera.lens.over.coefficients).ravel())
    return np.concatenate(rows)


def by_differences(case: Case, sums: NormalEquations) -> np.ndarray:
    """The Jacobian (rows, unknowns) of `residual`, unknowns as in the sums: shared, then those of each
    block.
    """
    shared, own = len(sums.a), sums.c.size
    columns = []
    for i in range(shared + own):
        step = np.zeros(shared + own)
        step[i] = 1e-5
        ends = [
            residual(
                case.problem,
                case.problem.move(
                    case.estimate, sign * step[:shared], (sign * step[shared:]).reshape(sums.c.shape)
                ),
            )
            for sign in (1.0, -1.0)
        ]
        columns.append((ends[0] - ends[1]) / 2e-5)
    return np.stack(columns, axis=1)


def whole(sums: NormalEquations) -> tuple[np.ndarray, np.ndarray]:
    """The normal equations with no block left out."""
    n, (blocks, q) = len(sums.a), sums.c.shape
    matrix = np.zeros((n + blocks * q,) * 2)
    matrix[:n, :n] = sums.A
    for block in range(blocks):
        own = slice(n + block * q, n + (block + 1) * q)
        matrix[:n, own], matrix[own, :n], matrix[own, own] = sums.B[block], sums.B[block].T, sums.C[block]
    return matrix, np.concatenate([sums.a, sums.c.ravel()])


@pytest.mark.parametrize(
    ("camera", "target"),
    [
        *[("formula", target) for target in TARGETS],
        ("free lens", "smooth"),
        ("free lens", "free"),
        ("free lens of the angle", "free"),
    ],
)
def test_the_sums_are_those_of_the_residuals_derivatives(camera, target):
    tried = case(CAMERAS[camera], TARGETS[target])
    sums = tried.problem.linearise(tried.estimate, Linear())
    J, e = by_differences(tried, sums), residual(tried.problem, tried.estimate)
    matrix, right = whole(sums)
    scale = np.sqrt(np.diag(matrix))
    # a difference over 1e-5 is good to 1e-8 of the largest derivative, d/d rotation in a pixel's: some
    # 500
    assert_allclose(matrix / scale / scale[:, None], (J.T @ J) / scale / scale[:, None], atol=2e-6)
    assert_allclose(right / scale, (J.T @ e) / scale, atol=2e-6 * float(np.linalg.norm(e)))
    assert_allclose(sums.cost, e @ e, rtol=1e-12)


@for_every_camera
@pytest.mark.parametrize("loss", [Linear(), Huber(0.3), Cauchy(0.3)], ids=["linear", "huber", "cauchy"])
def test_the_right_side_is_half_the_gradient_of_the_cost_for_any_loss(camera, loss: Loss):
    problem, at = case(camera, TARGETS["free"])
    sums = problem.linearise(at, loss)
    shared, rng = len(sums.a), np.random.default_rng(3)
    _, right = whole(sums)
    for _ in range(5):
        step = rng.standard_normal(shared + sums.c.size) / np.sqrt(np.diag(whole(sums)[0]))
        ends = [
            problem.linearise(
                problem.move(at, t * step[:shared], (t * step[shared:]).reshape(sums.c.shape)), loss
            ).cost
            for t in (1e-4, -1e-4)
        ]
        # rounding of a cost of some thousand over 2e-4 is 1e-9; a corner that crosses Huber's edge
        # bends the slope a little
        assert_allclose((ends[0] - ends[1]) / 2e-4, 2.0 * right @ step, rtol=1e-4, atol=1e-4)


@for_every_camera
def test_residuals_are_predicted_minus_detected_and_zero_where_nothing_was_seen(camera):
    problem, at = case(camera, TARGETS["free"])
    present = problem.measurements.observations.present > 0
    e = problem.residuals(at)
    assert not e[~present].any()
    assert_allclose(e[present].ravel(), residual(problem, at)[: 2 * present.sum()], atol=1e-11)


def by_unknown(problem: Joint, sums: NormalEquations, values: np.ndarray) -> tuple[np.ndarray, ...]:
    """Values in the sums' order as those of camera and surface, of poses (m,6), of single corners (p,3)."""
    n, shared = problem._n, len(sums.a)
    rest, own = values[n:shared], values[shared:]
    poses, singles = (rest, own) if problem.by_corner else (own, rest)
    return values[:n], poses.reshape(-1, 6), singles.reshape(-1, 3)


@for_every_camera
def test_whichever_group_is_eliminated_the_step_and_what_is_known_are_the_same(camera):
    problem, at = case(camera, TARGETS["free"])
    steps, known = [], []
    for problem.by_corner in (True, False):
        sums = problem.linearise(at, Huber(1.0))
        matrix, right = whole(sums)
        scale = 1.0 / np.sqrt(np.diag(matrix))
        step = scale * np.linalg.solve(matrix * scale * scale[:, None], -scale * right)
        steps.append(by_unknown(problem, sums, step))
        known.append(problem.minimum(sums).known)
    for one, other in zip(*steps, strict=True):
        assert_allclose(one, other, rtol=1e-6, atol=1e-9)
    for one, other in zip(*known, strict=True):
        assert_allclose(
            one, other, rtol=1e-5, atol=1e-8
        )  # the inverse is regularised by 1e-13 of a matrix whose condition is 1e7


@for_every_camera
@for_every_target
def test_what_is_known_is_what_the_inverse_of_the_whole_system_says(camera, target):
    problem, at = case(camera, target)
    sums = problem.linearise(at, Linear())
    matrix, _ = whole(sums)
    scale = 1.0 / np.sqrt(np.diag(matrix))
    covariance = np.linalg.inv(matrix * scale * scale[:, None]) * scale * scale[:, None]
    known, k, g = problem.minimum(sums).known, len(problem.free), len(problem.energy)
    shared, _, singles = by_unknown(problem, sums, np.diag(covariance))
    assert_allclose(known.camera, covariance[:k, :k], rtol=1e-4, atol=1e-9 * covariance[:k, :k].max())
    assert_allclose(
        known.surface, 1.0 - problem.precisions.surface * shared[k + 2 * g :].reshape(-1, 3), atol=1e-6
    )
    of_spline = (
        sum(np.trace(problem.energy @ covariance[i : i + g, i : i + g]) for i in (k, k + g)) if g else 0.0
    )
    assert_allclose(known.spline, 2 * g - problem.precisions.spline * of_spline, atol=1e-4)
    if problem.single:
        assert_allclose(known.singles, CORNERS - problem.precisions.singles * singles.sum(0), atol=1e-5)
    else:
        assert not known.singles.any()


@for_every_camera
def test_data_never_determine_more_than_there_are_unknowns_nor_less_than_none(camera):
    problem, at = case(camera, TARGETS["free"])
    known = problem.minimum(problem.linearise(at, Linear())).known
    assert 0.0 <= known.spline <= spline_unknowns(camera)
    for part, most in ((known.surface, 1.0), (known.singles, CORNERS)):
        assert part.min() >= 0.0
        assert part.max() <= most
    assert np.linalg.eigvalsh(known.camera / np.sqrt(np.outer(*[np.diag(known.camera)] * 2))).min() > 0.0


@for_every_camera
def test_the_larger_group_is_the_one_that_is_eliminated(camera):
    # 36 unknowns of corners, 36 of poses
    assert case(camera, TARGETS["free"], views=6).problem.by_corner
    assert not case(camera, TARGETS["free"], views=7).problem.by_corner
    assert not case(camera, TARGETS["smooth"], views=2).problem.by_corner


def solved(tried: Case) -> DecoupledEstimate:
    return solve(tried.problem, tried.estimate, options=Options(tolerance=1e-13, max_steps=60)).unknowns


@for_every_camera
def test_at_the_minimum_displacements_have_no_shift_turn_or_scale_of_the_whole_target(camera):
    problem, at = case(camera, TARGETS["of single corners only"])
    problem.precisions = problem.precisions._replace(singles=np.full(3, 1e5))
    d = solved(Case(problem, at)).singles
    size = np.abs(d).max()
    assert size > 1e-5  # there is something to have none of
    # poses take each of these for nothing, so the prior alone decides, and its slope along them is
    # zero: exactly these sums
    assert_allclose(d.sum(0), 0.0, atol=1e-3 * size)
    assert_allclose(
        np.cross(d, problem.points + d).sum(0), 0.0, atol=1e-3 * size * np.abs(problem.points).max()
    )
    assert_allclose((d * (problem.points + d)).sum(), 0.0, atol=1e-3 * size * np.abs(problem.points).max())


@for_every_camera
def test_a_prior_without_doubt_holds_everything_at_zero(camera):
    problem, at = case(camera, TARGETS["free"])
    problem.precisions = Precisions(np.full_like(problem.precisions.surface, 1e16), np.full(3, 1e16), 1e16)
    held = solved(Case(problem, at))
    assert np.abs(held.surface).max() < 1e-9
    assert np.abs(held.singles).max() < 1e-9
    if isinstance(held.camera.lens, FreeLens):
        assert np.abs(held.camera.lens.over.coefficients).max() < 1e-9


@for_every_camera
def test_penalties_are_what_the_priors_add_to_the_cost(camera):
    problem, at = case(camera, TARGETS["free"])
    with_priors = problem.linearise(at, Linear()).cost
    squares = float((problem.residuals(at) ** 2).sum())
    assert_allclose(sum(problem.penalties(at)), with_priors - squares, rtol=1e-9)


def test_sums_that_are_asked_for_again_are_those_of_the_new_place_and_the_new_priors():
    problem, at = case(CAMERAS["free lens"], TARGETS["free"])
    loss = Linear()
    first = problem.linearise(at, loss)
    places = [
        at,
        at._replace(singles=at.singles + 1e-4),
        at._replace(camera=replace(at.camera, intrinsics=K)),
        at,
    ]
    for place in places:
        fresh, same_place = case(CAMERAS["free lens"], TARGETS["free"])
        assert_array_equal(same_place.singles, at.singles)
        for found, wanted in zip(problem.linearise(place, loss), fresh.linearise(place, loss), strict=True):
            assert_array_equal(found, wanted)
    problem.precisions = problem.precisions._replace(singles=2.0 * problem.precisions.singles)
    again = problem.linearise(at, loss)
    assert again.cost > first.cost
    assert_allclose(
        again.C - first.C,
        np.broadcast_to(np.diag(0.5 * problem.precisions.singles), again.C.shape),
        rtol=1e-6,
    )
