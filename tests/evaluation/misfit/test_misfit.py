"""Misfit tests: silent on perfect boards as often as they promise, loud where the target or the lens formula
is wrong.
"""

from __future__ import annotations

import functools
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from numpy.testing import assert_allclose

from helpers.boards import (
    BOARD,
    NARROW,
    WIDE,
    bent,
    known,
    perfect,
    photographs_of,
    seen_by_the_truth,
    stretched,
    thinned,
)
from helpers.quick import first_quick
from helpers.real_sets import classic
from orthoscope.evaluation.misfit.misfit import Misfit, misfit
from orthoscope.evaluation.verdict.causes import is_misfit
from orthoscope.fitting.calibration import Calibration
from orthoscope.methods.decoupled.decoupled import decoupled
from orthoscope.methods.fccm import fccm
from orthoscope.models.camera import Camera
from orthoscope.models.difference import image_difference
from orthoscope.models.lenses.table import KannalaBrandt
from orthoscope.models.target_shape import TargetShape
from orthoscope.targets.detections import View
from orthoscope.targets.target import chessboard

# probability that a right test fails one of these bounds by bad luck; the seeds are fixed, so it is met once
# and for all
UNLUCKY = 1e-4


def assert_rate(found: np.ndarray, promised: float) -> None:
    """That no more of the trials (bool) are true than a rate as promised gives."""
    from scipy.stats import binom  # a second of its own

    assert found.sum() <= binom.isf(UNLUCKY, len(found), promised), f"{found.sum()} of {len(found)}"


def both(found: Misfit) -> tuple[float, float]:
    return found.target.test.p_value, found.lens.test.p_value


# --- perfect boards
# --------------------------------------------------------------------------------------------------

TRUTHS: dict[str, Callable[[int], Calibration]] = {
    "whole boards": lambda seed: seen_by_the_truth(NARROW, 8, seed),
    "boards that leave the frame": lambda seed: seen_by_the_truth(NARROW, 8, seed, whole=False),
    "past 90 degrees": lambda seed: seen_by_the_truth(WIDE, 8, seed, whole=False),
    "three views": lambda seed: seen_by_the_truth(NARROW, 3, seed, tilt=(0.3, 0.7)),
}


@pytest.mark.slow
@pytest.mark.parametrize("perfectly", TRUTHS.values(), ids=TRUTHS)
def test_p_values_of_perfect_boards_are_evenly_spread(perfectly):
    """The residuals of the truth are pure noise: whatever is granted, F must have its distribution."""
    from scipy.stats import kstest  # a second of its own

    p = np.array([both(misfit(perfectly(seed))) for seed in range(40)])
    assert kstest(p[:, 0], "uniform").pvalue > UNLUCKY
    assert kstest(p[:, 1], "uniform").pvalue > UNLUCKY


def some_corners(seed: int) -> Calibration:
    return fccm(thinned(perfect(NARROW, 15, seed)[1], (0.3, 0.9), seed), lens="brown")


FITS: dict[str, Callable[[int], Calibration]] = {
    "5 views": lambda seed: fccm(perfect(NARROW, 5, seed)[1], lens="brown"),
    "15 views of some corners": some_corners,
    "a lens with more coefficients than it needs": lambda seed: fccm(
        perfect(NARROW, 12, seed)[1], lens="brown:k1,k2,p1,p2,k3,s1,s2,s3,s4"
    ),
    "a lens past 90 degrees": lambda seed: fccm(perfect(WIDE, 12, seed)[1], lens="kannala_brandt"),
}


@pytest.mark.slow
@pytest.mark.parametrize("fit", FITS.values(), ids=FITS)
def test_after_a_fit_at_most_one_perfect_board_in_twenty_has_a_p_value_below_a_twentieth(fit):
    found = [misfit(fit(seed)) for seed in range(40)]
    p = np.array([both(one) for one in found])
    assert_rate(p[:, 0] < 0.05, 0.05)
    assert_rate(p[:, 1] < 0.05, 0.05)
    blamed = np.array([is_misfit(one.target.test, 12) or is_misfit(one.lens.test, 12) for one in found])
    assert_rate(blamed, 0.02)


@functools.cache
def of_views_that_hang_together(seed: int) -> Misfit:
    """Noise that is a smooth field over the target in each view, another one each time, beside what every
    corner has for itself.
    """
    _, detections = perfect(NARROW, 12, seed, noise_px=0.1)
    rng = np.random.default_rng(seed)
    x, y = 3.0 * (BOARD.points[:, :2] / BOARD.points[:, :2].max()).T
    waves = np.stack(
        [np.sin(a * x + b * y + c) for a, b, c in ((1, 0, 0), (0, 1, 1), (1, 1, 2), (1, -1, 3), (0.5, 1, 4))],
        axis=-1,
    )
    views = (
        replace(view, pixels=view.pixels + waves[view.ids] @ rng.normal(0.0, 0.3, (5, 2)))
        for view in detections.views
    )
    return misfit(fccm(replace(detections, views=tuple(views)), lens="brown"))


@pytest.mark.parametrize("seed", [0, 1, 2])
def test_noise_that_hangs_together_within_a_view_fools_f_but_not_the_vote_of_the_views(seed: int):
    lens = of_views_that_hang_together(seed).lens.test
    assert lens.p_value < 1e-6
    assert lens.f < 1.5 * lens.chance
    assert not is_misfit(lens, 12)


@pytest.mark.slow
def test_noise_that_hangs_together_is_rarely_taken_for_a_misfit():
    tests = [of_views_that_hang_together(seed) for seed in range(40)]
    for over_views in (
        [one.target.test.p_over_views for one in tests],
        [one.lens.test.p_over_views for one in tests],
    ):
        assert_rate(
            np.array(over_views) <= 0.05, 0.1
        )  # views share the camera, so the vote is right to a few per cent only


# --- what is granted, and what is too little
# -------------------------------------------------------------------------


def test_what_a_fit_takes_away_does_not_matter():
    """F of the truth and F after a fit with the same parameters are the same to first order, since all of
    them are granted.
    """
    scene, detections = perfect(NARROW, 12, 0)
    before, after = misfit(known(scene, detections)), misfit(fccm(detections, lens="brown"))
    assert_allclose(
        before.target.test.f, after.target.test.f, rtol=5e-3
    )  # the second order of a fit to 0.2 px
    # the terms of any lens are all but those of the formula: what is left of them, the second order moves
    # more
    assert_allclose(before.lens.test.f, after.lens.test.f, rtol=2e-2)


def test_degrees_of_freedom_are_counted():
    """54 corners of 3 displacements without the 7 of a similarity; 9 parameters of the camera, 6 of each
    view.
    """
    test = misfit(seen_by_the_truth(NARROW, 12, 0)).target.test
    cells = misfit(seen_by_the_truth(NARROW, 12, 0)).lens.test.between
    assert_allclose(test.between, 3 * 54 - 7, atol=1e-3)
    assert_allclose(
        test.within, 2 * 54 * 12 - 6 * 12 - 9 - cells - (3 * 54 - 7), atol=2.5
    )  # cells can do a little of what K does


@pytest.mark.parametrize("views", [0, 1, 2])
def test_fewer_than_three_views_tell_nothing(views: int):
    scene, detections = perfect(NARROW, 2, 0)
    found = misfit(
        replace(
            known(scene, detections),
            detections=detections.only(range(views)),
            camera_from_target=scene.camera_from_target[:views],
        )
    )
    assert np.isnan([found.target.test.f, found.lens.test.f, found.target.test.p_value]).all()
    assert not is_misfit(found.target.test, views)
    assert found.target.moves_camera_px == 0.0
    assert not np.nan_to_num(found.target.displacements).any()


def test_three_views_with_hardly_any_corners_tell_nothing():
    scene, detections = perfect(NARROW, 3, 0, tilt=(0.3, 0.7))
    assert np.isnan(misfit(known(scene, thinned(detections, (0.2, 0.21), 0))).target.test.f)


def test_a_corner_that_no_view_shows_has_no_displacement():
    scene, detections = perfect(NARROW, 6, 0)
    views = tuple(View(view.image, view.ids[5:], view.pixels[5:]) for view in detections.views)
    displacements = misfit(known(scene, replace(detections, views=views))).target.displacements
    assert np.isnan(displacements[:5]).all()
    assert np.isfinite(displacements[5:]).all()


def test_a_target_of_very_many_corners_is_tested_in_patches():
    found = misfit(seen_by_the_truth(NARROW, 4, 0, board=chessboard(30, 20, 0.008))).target
    assert found.displacements.shape == (600, 3)
    assert 500 < found.test.between < 3 * 400  # about 300 patches of 3


# --- boards that are not what they are said to be
# --------------------------------------------------------------------

WRONG = {"bent by 2 mm": bent(2.0), "stretched by 0.6 %": stretched(0.006)}


@pytest.mark.parametrize("points", WRONG.values(), ids=WRONG)
@pytest.mark.parametrize("seed", [0, 1, 2])
def test_a_wrong_board_is_found_and_the_lens_is_not_blamed_for_it(points: np.ndarray, seed: int):
    found = misfit(fccm(photographs_of(points, 15, seed), lens="brown"))
    assert is_misfit(found.target.test, 15)
    assert not is_misfit(found.lens.test, 15)


@pytest.mark.parametrize("seed", [0, 1, 2])
def test_single_corners_a_tenth_of_a_millimetre_off_are_found(seed: int):
    off = 1e-4 * np.random.default_rng(seed).standard_normal(BOARD.points.shape) * [1.0, 1.0, 0.0]
    found = misfit(fccm(photographs_of(BOARD.points + off, 15, seed), lens="brown")).target
    assert is_misfit(found.test, 15)
    assert (
        np.corrcoef(found.displacements[:, :2].ravel(), off[:, :2].ravel())[0, 1] > 0.8
    )  # noise, and what poses take of it


def test_the_systematic_part_is_what_the_wrong_board_adds_to_the_error():
    right, wrong = (fccm(photographs_of(points, 20, 0), lens="brown") for points in (BOARD.points, bent(2.0)))
    test = misfit(wrong).target.test
    assert_allclose(
        test.systematic_px, np.sqrt(wrong.rms_px**2 - right.rms_px**2), rtol=0.15
    )  # image cells take some of it
    assert_allclose(test.noise_px, 0.2 * np.sqrt(2.0), rtol=0.05)


def test_a_bent_board_is_seen_to_be_bent_that_way():
    found = misfit(fccm(photographs_of(bent(2.0), 20, 0), lens="brown")).target
    height = found.displacements[:, 2].reshape(6, 9).mean(0)
    truth = (bent(2.0) - BOARD.points)[:, 2].reshape(6, 9).mean(0)
    assert np.corrcoef(height, truth)[0, 1] > 0.9


def test_it_tells_at_most_how_far_the_bent_board_has_led_the_camera_astray():
    detections = photographs_of(bent(2.0), 15, 0)
    found = fccm(detections, lens="brown")
    pixels = np.concatenate([view.pixels for view in detections.views])
    astray = np.sqrt((image_difference(NARROW, found.camera, pixels) ** 2).sum(1).mean())
    assert 0.25 * astray < misfit(found).target.moves_camera_px < 1.1 * astray
    assert astray > 5.0 * found.rms_px  # a bend of 2 mm in 200 mm: what a low error hides


def test_a_board_whose_true_shape_is_given_is_silent():
    scene, _ = perfect(NARROW, 15, 0)
    truth = replace(
        known(scene, photographs_of(bent(2.0), 15, 0)),
        target_shape=TargetShape("free", bent(2.0) - BOARD.points),
    )
    assert not is_misfit(misfit(truth).target.test, 15)
    assert is_misfit(misfit(replace(truth, target_shape=TargetShape.flat(54))).target.test, 15)


# --- lenses that a formula cannot follow
# -----------------------------------------------------------------------------

BENDING = replace(
    WIDE, lens=KannalaBrandt(k1=-0.03, k2=0.015, k3=-0.002)
)  # its curve turns, which k1 alone cannot
TOO_SMALL = {
    "brown with k1 alone": (NARROW, "brown:k1"),
    "kannala_brandt with k1 alone": (BENDING, "kannala_brandt:k1"),
}


@pytest.mark.parametrize(("camera", "lens"), TOO_SMALL.values(), ids=TOO_SMALL)
@pytest.mark.parametrize("seed", [0, 1, 2])
def test_a_lens_formula_that_is_too_small_is_found_and_the_target_is_not_blamed_for_it(
    camera: Camera, lens: str, seed: int
):
    found = misfit(fccm(perfect(camera, 20, seed)[1], lens=lens))
    assert is_misfit(found.lens.test, 20)
    assert not is_misfit(found.target.test, 20)


@pytest.mark.parametrize(("seed", "views", "noise_px"), [(0, 15, 0.1), (1, 8, 0.1), (2, 15, 0.03)])
def test_a_decentering_that_was_left_out_is_not_blamed_on_the_target(seed: int, views: int, noise_px: float):
    camera = replace(NARROW, lens=replace(NARROW.lens, p1=0.006, p2=-0.004))
    found = misfit(fccm(perfect(camera, views, seed, noise_px=noise_px)[1], lens="brown:k1,k2"))
    assert is_misfit(found.lens.test, views)
    assert not is_misfit(found.target.test, views)
    assert found.target.test.f < 1.5  # chance gives 1


def test_the_cells_show_as_much_as_the_test_says():
    detections = perfect(NARROW, 20, 0)[1]
    found = misfit(fccm(detections, lens="brown:k1")).lens
    corners = found.cells.count(np.concatenate([view.pixels for view in detections.views]))
    squares = (found.residuals**2).sum(-1)
    assert (np.isnan(squares) == (corners == 0)).all()
    shown = np.sqrt(np.nansum(corners * squares) / corners.sum())
    assert (
        0.7 < shown / found.test.systematic_px < 1.3
    )  # poses take a part of what is shown, and noise hides a part


# --- wild corners, real boards
# ---------------------------------------------------------------------------------------


def _with_wild_corners(calibration: Calibration, seed: int) -> Calibration:
    rng = np.random.default_rng(seed)
    detections = calibration.detections

    def spoilt(view: View) -> View:
        wild = rng.random(len(view.ids)) < 0.02
        return replace(view, pixels=view.pixels + wild[:, None] * rng.normal(0.0, 30.0, view.pixels.shape))

    return replace(
        calibration, detections=replace(detections, views=tuple(spoilt(view) for view in detections.views))
    )


@pytest.mark.parametrize("seed", [0, 1, 2])
def test_wild_corners_neither_make_a_misfit_nor_hide_one(seed: int):
    right = _with_wild_corners(seen_by_the_truth(NARROW, 15, seed), seed)
    wrong = _with_wild_corners(fccm(photographs_of(bent(2.0), 15, seed), lens="brown"), seed)
    assert not is_misfit(misfit(right).target.test, 15)
    assert is_misfit(misfit(wrong).target.test, 15)


@pytest.mark.datasets
def test_the_target_of_calibrel_is_found_wanting_and_its_lens_is_not(datasets: Path):
    calibration = fccm(classic(datasets, "calibrel"), lens="brown")
    found = misfit(calibration)
    assert found.target.test.f > 100.0
    assert is_misfit(found.target.test, 20)
    assert found.target.test.systematic_px > 3.0 * found.target.test.noise_px
    assert not is_misfit(found.lens.test, 20)
    shaped = replace(calibration, target_shape=TargetShape("free", found.target.displacements))
    assert misfit(shaped).target.test.f < 1.5  # to first order its shape is all that was wrong


@pytest.mark.datasets
@pytest.mark.parametrize("name", first_quick(["opencv-left", "calibrel"]))
def test_it_falls_silent_once_the_shape_of_the_target_is_estimated(datasets: Path, name: str):
    detections = classic(datasets, name)
    views = len(detections.views)
    flat, shaped = (
        fccm(detections, lens="brown"),
        decoupled(detections, lens="brown", shape="free", first_lens="formula"),
    )
    assert is_misfit(misfit(flat).target.test, views)
    assert (
        misfit(shaped).target.test.f < 1.0
    )  # what the shape has taken is not counted, so it is less than chance
