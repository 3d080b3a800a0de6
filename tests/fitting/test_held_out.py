"""Held-out error: folds are what the docs say, nothing of a view reaches the camera that judges it, and the
error says how sure it is.
"""

from __future__ import annotations

import pickle
from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace
from functools import partial

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal

from helpers.scenes import BOARD, NARROW, facing, photographed, seen
from orthoscope.fitting.calibration import residuals_of
from orthoscope.fitting.resection import resect
from orthoscope.fitting.unseen.held_out import HeldOut, folds_of_views, held_out
from orthoscope.geometry.arrays import CalibrationError, InputError
from orthoscope.methods.fccm import fccm
from orthoscope.targets.detections import Detections

REFIT = partial(fccm, lens="brown:k1,k2")
TEN = photographed(NARROW, 10, noise_px=0.2)


@pytest.mark.parametrize(("views", "folds"), [(4, 2), (10, 5), (11, 5), (23, 5), (5, 5), (4, 9), (7, 7)])
def test_folds_share_the_views_out_evenly(views, folds):
    parts = folds_of_views(views, folds)
    assert_array_equal(np.sort(np.concatenate(parts)), np.arange(views))
    assert len(parts) == min(folds, views)
    assert max(map(len, parts)) - min(map(len, parts)) <= 1


def test_folds_are_a_permutation_of_numpys_default_generator_of_seed_0():
    order = np.random.default_rng(0).permutation(10)
    assert_array_equal(folds_of_views(10, 5), np.sort(order.reshape(5, 2), axis=1))
    assert_array_equal(folds_of_views(10, 5), folds_of_views(10, 5, seed=0))
    assert not np.array_equal(folds_of_views(10, 5), folds_of_views(10, 5, seed=1))


@pytest.mark.parametrize("folds", [1, 0, -3])
def test_fewer_than_two_folds_are_refused(folds):
    with pytest.raises(InputError, match="expected at least 2"):
        held_out(TEN, REFIT, folds=folds)


def test_each_view_is_judged_by_a_camera_made_without_its_fold_and_only_its_pose_is_fitted():
    unseen = held_out(TEN, REFIT)
    for part in folds_of_views(10, 5):
        others = [i for i in range(10) if i not in part]
        camera = REFIT(TEN.only(others)).camera
        poses = resect(camera, TEN.only(part))
        for i, pose, e in zip(part, poses, residuals_of(camera, poses, TEN.only(part)), strict=True):
            judge, found = unseen.cameras[i], unseen.camera_from_target[i]
            assert judge is not None
            assert found is not None
            assert judge.intrinsics.as_tuple() == camera.intrinsics.as_tuple()
            assert_array_equal(found.translation, pose.translation)
            assert_array_equal(unseen.residuals[i], e)


def test_a_view_has_no_part_in_the_camera_that_judges_it():
    spoilt = replace(
        TEN.views[3], pixels=TEN.views[3].pixels + np.random.default_rng(0).normal(scale=5.0, size=(54, 2))
    )
    other = replace(TEN, views=(*TEN.views[:3], spoilt, *TEN.views[4:]))
    before, after = held_out(TEN, REFIT).cameras[3], held_out(other, REFIT).cameras[3]
    assert before is not None
    assert after is not None
    assert before.lens.coefficients.tobytes() == after.lens.coefficients.tobytes()


def test_it_is_the_same_wherever_the_folds_run_and_progress_counts_them():
    heard = []
    here = held_out(TEN, REFIT, progress=lambda done, folds: heard.append((done, folds)))
    with ThreadPoolExecutor(2) as executor:
        there = held_out(TEN, REFIT, executor=executor)
    assert heard == [(i, 5) for i in range(1, 6)]
    assert_array_equal(np.array(here.residuals), np.array(there.residuals))


def test_what_a_fold_needs_and_gives_can_be_sent_to_another_process():
    detections, refit = pickle.loads(pickle.dumps((TEN, REFIT)))
    unseen = pickle.loads(pickle.dumps(held_out(detections, refit)))
    assert unseen.rms_px == held_out(TEN, REFIT).rms_px


@pytest.mark.parametrize("views", [1, 2, 3])
def test_fewer_than_four_views_leave_nothing_to_judge_by(views):
    unseen = held_out(TEN.only(range(views)), REFIT)
    assert unseen.cameras == (None,) * views
    assert np.isnan(unseen.rms_px)
    assert np.isnan(unseen.standard_error_px)


def test_a_fold_that_cannot_be_calibrated_leaves_its_own_views_out_and_no_others():
    tilted = photographed(NARROW, 1, tilt=(0.5, 0.7), fill=(0.6, 0.9), noise_px=0.1).views[0]
    flat = seen(NARROW, facing(7, np.eye(3)), noise_px=0.1).views
    detections = Detections(BOARD, NARROW.image_size, (replace(tilted, image="tilted"), *flat))
    unseen = held_out(detections, partial(fccm, lens="brown:k1"), folds=8)
    assert unseen.cameras[0] is None  # without the tilted view the others are parallel
    assert np.isnan(unseen.residuals[0]).all()
    assert all(np.isfinite(e).all() for e in unseen.residuals[1:])
    assert_allclose(unseen.rms_px, np.sqrt(np.mean([(e**2).sum(-1) for e in unseen.residuals[1:]])))


def test_errors_that_are_no_calibration_errors_are_not_swallowed():
    def broken(detections):
        raise ZeroDivisionError

    with pytest.raises(ZeroDivisionError):
        held_out(TEN, broken)

    def unable(detections):
        raise CalibrationError("cannot")

    assert np.isnan(held_out(TEN, unable).rms_px)


@pytest.mark.slow
def test_where_the_lens_has_too_many_coefficients_the_held_out_error_is_larger_than_the_training_error():
    ratios = []
    for seed in range(3):
        detections = photographed(NARROW, 6, noise_px=0.5, seed=seed, fill=(0.3, 0.5))
        refit = partial(fccm, lens="brown:k1,k2,p1,p2,k3,s1,s2,s3,s4")
        ratios.append(held_out(detections, refit, folds=3).rms_px / refit(detections).rms_px)
    # noise of n numbers and u unknowns leaves sqrt(1 - u / n) in training, here 0.96, and held out at least
    # sqrt(1 - 6 / 108) = 0.97
    assert min(ratios) > 1.0
    assert np.mean(ratios) > 1.05


def drawn(views: int, seed: int) -> HeldOut:
    """Residuals of views that differ in size and in their corners' number."""
    rng = np.random.default_rng(seed)
    residuals = tuple(
        rng.gamma(4.0, 0.1) * rng.normal(size=(int(rng.integers(20, 60)), 2)) for _ in range(views)
    )
    return HeldOut((None,) * views, (None,) * views, (None,) * views, residuals)


@pytest.mark.parametrize("seed", range(3))
def test_the_standard_error_is_that_of_a_bootstrap_over_views(seed):
    unseen, rng = drawn(40, seed), np.random.default_rng(seed)
    sums, corners = (
        np.array([(e**2).sum() for e in unseen.residuals]),
        np.array([len(e) for e in unseen.residuals]),
    )
    picks = rng.integers(0, 40, (4000, 40))
    bootstrap = np.sqrt(sums[picks].sum(1) / corners[picks].sum(1)).std()
    # a formula of first order: a root of 40 skewed draws bends by a few percent; 4000 draws tell a deviation
    # to 1 %
    assert_allclose(unseen.standard_error_px, bootstrap, rtol=0.08)


def test_the_standard_error_is_the_scatter_of_the_error_over_repeated_sets_of_views():
    repeated = [drawn(30, seed) for seed in range(300)]
    scatter = np.std([unseen.rms_px for unseen in repeated])
    told = np.sqrt(np.mean([unseen.standard_error_px**2 for unseen in repeated]))
    assert_allclose(
        told, scatter, rtol=0.15
    )  # 300 draws tell a deviation to 4 %; of first order and of few skewed draws


def test_the_standard_error_of_two_views_is_half_their_difference():
    unseen = HeldOut(
        (None,) * 2,
        (None,) * 2,
        (None,) * 2,
        (np.array([[3.0, 0.0], [0.0, 3.0]]), np.array([[1.0, 0.0], [0.0, -1.0]])),
    )
    assert unseen.rms_px == pytest.approx(np.sqrt(5.0))  # of the views' mean squares, 9 and 1
    assert unseen.standard_error_px == pytest.approx(
        4.0 / (2.0 * np.sqrt(5.0))
    )  # 4 is that of their mean; a root halves it


def test_without_noise_the_error_is_zero_and_certain():
    unseen = held_out(photographed(NARROW, 6), partial(fccm, lens="brown"))
    assert unseen.rms_px < 1e-9
    assert unseen.standard_error_px < 1e-9


def test_a_corner_without_residual_has_no_say():
    e = np.array([[3.0, 4.0], [np.nan, np.nan]])
    assert HeldOut((None,), (None,), (None,), (e,)).rms_px == 5.0
