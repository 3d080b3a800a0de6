"""Weights are found: displacements of known size are found to be of that size, a perfect board's run to
nothing, smooth errors are told.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal

from helpers.bent_boards import bowed, drawn, photographed_with, stretched
from helpers.scenes import BOARD, NARROW
from orthoscope.methods.decoupled import evidence, step_one
from orthoscope.methods.decoupled.evidence import LEAST_SHARE, Evidence, first_guess
from orthoscope.methods.decoupled.step_one import FORMULA, StepOneFit, fit_step_one
from orthoscope.methods.fccm import fccm
from orthoscope.models.lenses.free import FreeLens
from orthoscope.models.lenses.table import FREE
from orthoscope.models.target_shape import polynomials
from orthoscope.targets.detections import Detections

VIEWS, NOISE = 15, 0.1
SIZE = 0.2  # metres, of BOARD
CORNER = 15e-6  # metres: noise in the mean of 15 views, where a board of 0.2 m fills some 400 px
SOME = Evidence(0.01, (1e-6, 4e-6), (1e-8, 4e-8, 1e-6), 1e-8, SIZE, parameters=40.0)


def fitted(detections: Detections, *, shape: str = "free", first_lens: str = FORMULA) -> StepOneFit:
    return fit_step_one(fccm(detections, lens="brown"), shape=shape, first_lens=first_lens)


@pytest.mark.parametrize("first_lens", [FORMULA, FREE])
def test_the_size_of_corners_displacements_is_found_within_sampling_error(first_lens):
    sigma, fits = np.array([3e-4, 2e-4, 6e-4]), []
    for seed in range(4):
        detections = photographed_with(
            drawn(tuple(sigma), seed=seed), NARROW, VIEWS, noise_px=NOISE, seed=seed
        )
        fits.append(fitted(detections, first_lens=first_lens))
    # 54 corners less what surface and poses take of them, 4 boards: a deviation is told to 1 / sqrt(2 * 4 *
    # 40), 6 %, and that three times
    assert_allclose(np.sqrt(np.mean([fit.evidence.singles for fit in fits], axis=0)), sigma, rtol=0.18)
    # 4 * 1600 measurements less some 260 unknowns each
    assert_allclose(np.sqrt(np.mean([fit.evidence.noise for fit in fits])), NOISE, rtol=0.03)


def test_the_size_of_a_surface_is_found_apart_from_that_of_single_corners():
    for displacements, part in ((stretched(0.01), 0), (bowed(2e-3), 1)):
        found = fitted(photographed_with(displacements, NARROW, VIEWS, noise_px=NOISE)).evidence
        surface = np.sqrt(found.surface)
        assert surface[part] > 50e-6
        assert surface[1 - part] < CORNER
        assert np.sqrt(found.singles).max() < 2.0 * CORNER  # of height, which is seen at an angle only


@pytest.mark.parametrize("seed", [0, 4])
def test_what_a_perfect_board_does_not_ask_for_runs_to_its_floor(monkeypatch, seed):
    for name, value in {"ROUND_LIMIT": 60, "ROUND_TOLERANCE": 1e-9}.items():
        monkeypatch.setattr(step_one, name, value)
    monkeypatch.setattr(evidence, "SETTLED_SHARE", 0.0)
    fit = fitted(photographed_with(np.zeros_like(BOARD.points), NARROW, VIEWS, noise_px=NOISE, seed=seed))
    deviations = np.sqrt([*fit.evidence.surface, *fit.evidence.singles])
    at_floor = deviations < 1.01 * LEAST_SHARE * SIZE
    assert (
        at_floor.sum() >= 3
    )  # the likelihood of nothing is the greatest for about half of all groups; the others stay within noise
    assert deviations.max() < CORNER
    assert fit.evidence.parameters < 9 + 10


def test_of_a_perfect_board_little_is_determined_after_the_usual_rounds_too():
    fit = fitted(photographed_with(np.zeros_like(BOARD.points), NARROW, VIEWS, noise_px=NOISE))
    assert fit.evidence.parameters < 9 + 0.2 * (3 * 54 + 3 * 14)
    assert_allclose(np.sqrt(fit.evidence.noise), NOISE, rtol=0.06)  # three times 1 / sqrt(2 * 1500)


def test_a_lens_that_its_formula_describes_has_next_to_no_displacement():
    fit = fitted(
        photographed_with(np.zeros_like(BOARD.points), NARROW, VIEWS, noise_px=NOISE),
        shape="flat",
        first_lens=FREE,
    )
    lens = fit.estimate.camera.lens
    assert isinstance(lens, FreeLens)
    over = lens.over
    x, y = np.random.default_rng(0).uniform([-0.6, -0.45], [0.6, 0.45], (500, 2)).T
    assert np.abs(over.at(x, y)[0]).max() * NARROW.intrinsics.fx < NOISE
    assert fit.evidence.parameters < 9 + 0.1 * over.coefficients.size


def with_smooth_errors(detections: Detections, sigma: float) -> Detections:
    """Each view's corners moved by a pattern of its own, cubic and of fourth order over the board, so many
    pixels rms.
    """
    patterns, rng = (
        polynomials(BOARD.points, np.ones(len(BOARD.points), dtype=bool), orders=(3, 4)),
        np.random.default_rng(5),
    )

    def moved(view):
        return replace(
            view, pixels=view.pixels + (patterns @ rng.standard_normal((9, 2)) * sigma / 3.0)[view.ids]
        )

    return replace(detections, views=tuple(moved(view) for view in detections.views))


@pytest.mark.parametrize("seed", range(3))
def test_independent_errors_have_a_likeness_of_one(seed):
    fit = fitted(
        photographed_with(np.zeros_like(BOARD.points), NARROW, VIEWS, noise_px=NOISE, seed=seed),
        shape="flat",
    )
    assert 1.0 <= fit.evidence.likeness < 1.2  # 12 patterns, 2 axes, 15 views: told to sqrt(2 / 360), 7 %


def test_smooth_errors_are_told_by_their_likeness():
    told = []
    for sigma in (0.05, 0.1, 0.2):
        detections = with_smooth_errors(
            photographed_with(np.zeros_like(BOARD.points), NARROW, VIEWS, noise_px=NOISE), sigma
        )
        fit = fitted(detections, shape="flat")
        told.append(fit.evidence.likeness)
        # a pattern has 54 times the power of a corner; 9 of the 12 patterns got sigma^2 / 9 of it; noise is
        # that of all errors together
        total = NOISE**2 + sigma**2
        assert_allclose(
            told[-1], (NOISE**2 + 54 * sigma**2 / 12) / total, rtol=0.3
        )  # 270 draws, less what poses take
    assert told[0] < told[1] < told[2]


def test_for_smooth_unknowns_noise_counts_as_many_times_as_errors_are_alike():
    independent, alike = SOME.precisions(5), replace(SOME, likeness=7.0).precisions(5)
    assert_array_equal(independent.surface, np.broadcast_to([0.01 / 1e-6, 0.01 / 1e-6, 0.01 / 4e-6], (5, 3)))
    assert_array_equal(independent.singles, 0.01 / np.array([1e-8, 4e-8, 1e-6]))
    assert independent.spline == 0.01 / 1e-8
    assert_allclose(alike.surface, 7.0 * independent.surface)
    assert_allclose(alike.spline, 7.0 * independent.spline)
    assert_array_equal(alike.singles, independent.singles)


def test_the_first_guess_is_a_thousandth_of_the_target_and_a_tenth_of_a_pixel():
    guess = first_guess(0.04, SIZE, 500.0)
    assert_allclose(np.sqrt([*guess.surface, *guess.singles]), 0.2e-3)
    assert np.sqrt(guess.bend) * 500.0 == pytest.approx(0.1)
    assert (guess.noise, guess.likeness) == (0.04, 1.0)


def test_two_that_agree_have_the_same_noise_and_as_many_parameters():
    assert SOME.agrees_with(replace(SOME, noise=0.01005, parameters=40.3))
    assert not SOME.agrees_with(replace(SOME, noise=0.0102))
    assert not SOME.agrees_with(replace(SOME, parameters=41.0))
    assert not replace(SOME, parameters=40.0).agrees_with(
        first_guess(0.01, SIZE, 500.0)
    )  # which has determined nothing yet
