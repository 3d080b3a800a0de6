"""Photographs that do not agree on one camera are found and named; boards that bend are not."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from numpy.testing import assert_allclose

from helpers.boards import NARROW, perfect
from helpers.studied import Recipe, found_in, made, photographs_by, richest_fit
from orthoscope.evaluation.disagreement import Views, changes_of, disagreement, spread_of, wishes
from orthoscope.evaluation.groups import two_groups
from orthoscope.fitting.unseen.leave_one_out import leave_one_out
from orthoscope.methods.fccm import fit_flat
from orthoscope.models.lenses.table import Brown
from orthoscope.simulation.scene import simulate_detections

USUAL = Recipe()
MANY = replace(USUAL, standing=replace(USUAL.standing, count=20))

AGREEING = {
    "perfect boards": USUAL,
    "few of them": replace(USUAL, standing=replace(USUAL.standing, count=6)),
    "boards of another shape": replace(USUAL, shape={"bend": 0.01, "singles": 0.0004, "stretch": 0.003}),
    "boards that bend from view to view": replace(MANY, bending=0.001),
    "errors alike within a view": replace(MANY, noise=0.05, alike=0.15),
}

DIFFERING = {
    "zoom": replace(MANY, cameras=("zoom", 0.02)),
    "centre": replace(MANY, cameras=("other", 0.015)),
    "shutter": replace(MANY, shutter=0.003),
    "lens": replace(MANY, cameras=("lenses", 0.4)),
}


@pytest.mark.parametrize("recipe", AGREEING.values(), ids=AGREEING)
def test_photographs_by_one_camera_agree(recipe):
    detections = photographs_by(recipe, seed=7)
    found = disagreement(richest_fit(detections), detections)
    assert not found.certain
    assert found.by_px == 0.0
    assert found.f2 < 2.0  # far from the 3 that would be called certain


@pytest.mark.parametrize("kind", DIFFERING)
def test_what_changed_between_photographs_is_named(kind):
    detections = photographs_by(DIFFERING[kind], seed=7)
    found = disagreement(richest_fit(detections), detections)
    assert found.certain
    assert found.kind == kind
    assert (found.by_px == 0.0) == (kind == "shutter")  # the image is sheared, the camera is one


FAR_APART = [
    pytest.param("zoom", 0.15, marks=pytest.mark.slow),
    pytest.param("lenses", 0.4, marks=pytest.mark.slow),
]


@pytest.mark.parametrize(("kind", "amount"), [("zoom", 0.02), ("other", 0.015), *FAR_APART])
def test_photographs_of_two_cameras_are_told_apart(kind: str, amount: float):
    world = made(replace(MANY, cameras=(kind, amount)), 0)
    detections = found_in(world)
    fit = richest_fit(detections)
    groups = two_groups(
        fit, disagreement(fit, detections), leave_one_out(fit), fit_flat(detections, lens="brown")
    )
    assert groups is not None
    first, second = ({world.groups[i] for i in group} for group in groups[:2])
    assert len(first) == len(second) == 1
    assert first != second
    assert len(groups.unsure) <= 6  # frontal photographs do not tell a zoom of 2 %


@pytest.mark.slow
@pytest.mark.parametrize("seed", [0, 1, 2])
def test_photographs_and_their_straightened_copies_are_told_apart_one_by_one(seed: int):
    """A grouping with some pairs swapped is better than one camera, too; the search goes on from it."""
    scene, taken = perfect(NARROW, 8, seed, noise_px=0.05)
    copies = replace(scene, camera=replace(NARROW, lens=Brown()))
    straight = simulate_detections(copies, noise_px=0.05, rng=np.random.default_rng(seed))
    copied = tuple(replace(view, image=f"straight {view.image}") for view in straight.views)
    both = [view for pair in zip(taken.views, copied, strict=True) for view in pair]
    detections = replace(taken, views=tuple(both))
    fit = richest_fit(detections)
    groups = two_groups(
        fit, disagreement(fit, detections), leave_one_out(fit), fit_flat(detections, lens="brown")
    )
    assert groups is not None
    assert {groups.first, groups.second} == {tuple(range(0, 16, 2)), tuple(range(1, 16, 2))}


def test_a_lens_that_focuses_anew_for_every_photograph_makes_no_two_groups():
    detections = photographs_by(replace(MANY, cameras=("stabiliser", 6.0)), seed=1)
    fit = richest_fit(detections)
    found = disagreement(fit, detections)
    assert found.certain
    assert two_groups(fit, found, leave_one_out(fit), fit_flat(detections, lens="brown")) is None


def test_how_far_cameras_are_apart_is_found():
    """Every other photograph is zoomed by 4 %: half of that is the standard deviation."""
    detections = photographs_by(replace(MANY, cameras=("zoom", 0.04)), seed=2)
    found = disagreement(richest_fit(detections), detections)
    assert_allclose(
        found.focal, 0.02, rtol=0.3
    )  # twenty photographs tell a deviation to a sixth; two of these


def test_wishes_are_the_changes_that_residuals_ask_for():
    """Residuals that a change of K makes in one view are a wish for minus that change, and no other view has
    one.
    """
    detections = photographs_by(USUAL, seed=5)
    fit = richest_fit(detections)
    _, changes = changes_of(fit)
    moves = fit.moves(changes)
    change = np.array([0.3, -0.2, 0.5])
    residual = np.zeros_like(fit.residual)
    residual[4] = fit.changes(changes)[4] @ change
    views = Views.of(replace(fit, residual=residual), detections.target.points, moves)
    asked = wishes(views, range(3)).kappa
    # the fit's own share in the view is granted, so that a wish is a little larger than what was put in
    assert (asked[4] / -change >= 1.0).all()
    assert (asked[4] / -change < 2.0).all()
    assert_allclose(np.delete(asked, 4, axis=0), 0.0, atol=1e-9)


def test_the_spread_of_wishes_leaves_their_noise_out():
    rng = np.random.default_rng(0)
    true, told = np.diag([4.0, 0.25]), np.repeat(np.eye(2)[None], 4000, axis=0)
    kappa = rng.multivariate_normal([0, 0], true, 4000) + rng.standard_normal((4000, 2))
    assert_allclose(
        spread_of(-(told @ kappa[..., None])[..., 0], told), true, atol=0.25
    )  # 4000 draws: to 2 % of 5


def test_too_few_views_tell_nothing():
    detections = photographs_by(replace(USUAL, standing=replace(USUAL.standing, count=4)))
    found = disagreement(richest_fit(detections), detections)
    assert np.isnan(found.f2)
    assert not found.certain
