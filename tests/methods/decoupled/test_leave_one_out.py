"""A view left out by one linear step, beside the fit that never had it."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal

from helpers.bent_boards import bowed, photographed_with
from helpers.scenes import NARROW
from orthoscope.fitting.calibration import residuals_of
from orthoscope.fitting.resection import resect
from orthoscope.fitting.slopes.linearised import Linearised
from orthoscope.fitting.unseen.leave_one_out import leave_one_out, say_of
from orthoscope.fitting.unseen.near_copies import near_copies, summed_over
from orthoscope.methods.decoupled.step_one import StepOneFit, fit_step_one
from orthoscope.methods.decoupled.step_one_linearised import linearised
from orthoscope.methods.fccm import fccm
from orthoscope.targets.detections import Detections, View

KINDS = [("flat", "formula"), ("smooth", "formula"), ("free", "formula"), ("flat", "free"), ("free", "free")]


@pytest.fixture(scope="module")
def photographs() -> Detections:
    return photographed_with(bowed(0.5e-3), NARROW, 8, noise_px=0.1, seed=3)


def fitted(photographs: Detections, shape: str, first_lens: str) -> StepOneFit:
    return fit_step_one(fccm(photographs, lens="brown"), shape=shape, first_lens=first_lens)


@pytest.fixture(scope="module", params=KINDS, ids="-".join)
def fit(photographs: Detections, request: pytest.FixtureRequest) -> tuple[StepOneFit, Linearised]:
    found = fitted(photographs, *request.param)
    return found, linearised(found)


def test_pulls_are_the_transpose_of_moves(fit: tuple[StepOneFit, Linearised]):
    rng = np.random.default_rng(0)
    known = fit[1]
    x, rows = (
        rng.standard_normal((known.views, known.unknowns, 2)),
        rng.standard_normal((*known.residual.shape, 2)),
    )
    assert_allclose((known.moves(x) * rows).sum(), (x * known.pulls(rows)).sum(), rtol=1e-9)


def test_what_views_and_priors_say_together_is_undone_by_solved(fit: tuple[StepOneFit, Linearised]):
    known = fit[1]
    x = (
        np.random.default_rng(0).standard_normal((known.unknowns, 1))
        * np.sqrt(np.maximum(_diagonal(known), 0.0))[:, None]
    )
    k, g, _, _ = known.slopes.sizes
    together = known.pulls(known.moves(x)).sum(0)
    for i in (0, 1):
        part = slice(k + i * g, k + (i + 1) * g)
        together[part] += known.spline_precision @ x[part]
    together[k + 2 * g :] += known.shape_precision[:, None] * x[k + 2 * g :]
    assert_allclose(
        known.solved(together) / np.abs(x), np.sign(x), atol=2e-3
    )  # of the smallest of unknowns that differ by 1e6


def _diagonal(known: Linearised) -> np.ndarray:
    return np.concatenate([np.diag(known.camera_columns), np.ones(known.unknowns - known.of_camera) * 1e-6])


def test_the_camera_scatters_as_the_fit_says(fit: tuple[StepOneFit, Linearised]):
    found, known = fit
    k = len(known.names)
    assert_allclose(
        np.sqrt(np.diag(known.camera_covariance)[:k]), np.sqrt(np.diag(found.covariance)), rtol=1e-2
    )
    assert (np.diag(known.prior_covariance) <= np.diag(known.camera_covariance) * (1 + 1e-6)).all()


def test_a_view_left_out_by_one_step_is_foreseen_as_by_the_fit_that_never_had_it(
    fit: tuple[StepOneFit, Linearised], photographs: Detections
):
    found, known = fit
    by_step = np.sqrt(leave_one_out(known).squares)
    for j in (0, 5):
        others, tested = photographs.only([i for i in range(8) if i != j]), photographs.only([j])
        without = fitted(others, found.target, "free" if known.slopes.sizes[1] else "formula")
        poses = resect(without.estimate.camera, tested, shape=without.shape)
        (residuals,) = residuals_of(without.estimate.camera, poses, tested, shape=without.shape)
        assert by_step[j] == pytest.approx(
            np.sqrt((residuals**2).sum()), rel=0.04
        )  # weights are found anew, the step is linear


def test_what_a_view_alone_decides_is_no_more_than_itself(fit: tuple[StepOneFit, Linearised]):
    known = fit[1]
    rows = np.random.default_rng(1).standard_normal((*known.residual.shape, 1)) * (known.root > 0)[..., None]
    share = say_of(known, rows)[0][:, 0, 0] / (rows**2).sum((1, 2))
    assert (share >= 0.0).all()
    assert (share < 1.0).all()


def test_the_order_of_the_views_does_not_matter(photographs: Detections):
    backwards = photographs.only(range(7, -1, -1))
    forth, back = (
        leave_one_out(linearised(fitted(some, "smooth", "formula"))) for some in (photographs, backwards)
    )
    assert_allclose(forth.squares, back.squares[::-1], rtol=1e-5)


def test_views_looked_at_together_or_in_parts_say_the_same(
    fit: tuple[StepOneFit, Linearised], monkeypatch: pytest.MonkeyPatch
):
    known = fit[1]
    rows = np.random.default_rng(2).standard_normal((*known.residual.shape, 2)) * (known.root > 0)[..., None]
    together = say_of(known, rows)
    monkeypatch.setattr("orthoscope.fitting.unseen.leave_one_out.VIEWS_AT_ONCE", 3)
    for part, whole in zip(say_of(known, rows), together, strict=True):
        assert_allclose(part, whole, rtol=1e-9, atol=1e-12)


def test_a_views_say_is_what_the_whole_inverse_says(fit: tuple[StepOneFit, Linearised]):
    known = fit[1]
    rows = np.random.default_rng(3).standard_normal((*known.residual.shape, 2)) * (known.root > 0)[..., None]
    pulls = known.pulls(rows)
    solved = known.solved(pulls)
    explained, moved = say_of(known, rows)
    assert_allclose(explained, pulls.transpose(0, 2, 1) @ solved, rtol=1e-7, atol=1e-9)
    assert_allclose(moved, solved[:, : known.of_camera], rtol=1e-7, atol=1e-12)


def test_of_photographs_that_were_taken_twice_both_are_left_out(photographs: Detections):
    """Copies foretell nothing new: errors and scatter are those of the photographs taken once."""
    copies = tuple(
        replace(view, image=f"again {view.image}", pixels=view.pixels + 1e-6) for view in photographs.views
    )
    twice = replace(photographs, views=(*photographs.views, *copies))
    groups = near_copies(twice)
    assert_array_equal(groups, [*range(8), *range(8)])
    once, both, alone = (
        leave_one_out(linearised(fitted(some, "flat", "formula")), which)
        for some, which in ((photographs, None), (twice, groups), (twice, None))
    )
    assert_allclose(both.squares, [*once.squares, *once.squares], rtol=1e-3)
    assert_allclose(both.scatter.T @ both.scatter, once.scatter.T @ once.scatter, rtol=5e-3)
    assert alone.squares.sum() < 0.95 * both.squares.sum()  # a copy foretells the other


def test_photographs_are_copies_where_most_of_their_corners_are_at_the_same_place(photographs: Detections):
    first = photographs.views[0]
    shifted = [
        View(name, first.ids[part], first.pixels[part] + shift)
        for name, part, shift in (
            ("a hair aside", slice(None), 0.4),
            ("half of it", slice(0, 30), 0.4),
            ("farther", slice(None), 3.0),
            ("three corners", slice(0, 3), 0.0),
        )
    ]
    found = near_copies(replace(photographs, views=(*photographs.views, *shifted)))
    assert_array_equal(found[8:], [0, 0, 8, 9])


def test_what_copies_share_is_summed():
    groups, values = np.array([0, 1, 0, 2]), np.array([1.0, 2.0, 3.0, 4.0])
    assert_allclose(summed_over(groups, values), [4.0, 2.0, 4.0, 4.0])
    assert_allclose(summed_over(np.arange(4), values), values)
