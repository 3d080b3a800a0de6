"""The verdict: it counts what was not used, and its sentences are true of sets whose truth is known."""

from __future__ import annotations

import pickle
import re
from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace
from functools import partial
from pathlib import Path

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal

from helpers.boards import BOARD, NARROW, bent, perfect, photographs_of
from helpers.quick import first_quick
from helpers.real_sets import classic
from orthoscope.evaluation.coverage import corners_by_cell, emptiest_place
from orthoscope.evaluation.evaluate import Evaluation, evaluate, evaluate_on
from orthoscope.evaluation.verdict.grades import Grade
from orthoscope.fitting.calibration import rms
from orthoscope.fitting.unseen.held_out import held_out
from orthoscope.geometry.arrays import CalibrationError, InputError
from orthoscope.geometry.pose import Pose, rotation_from_vector
from orthoscope.methods.decoupled.decoupled import decoupled
from orthoscope.methods.fccm import fccm
from orthoscope.models.camera import Camera
from orthoscope.models.intrinsics import Intrinsics
from orthoscope.models.lenses.table import Brown, KannalaBrandt
from orthoscope.models.target_shape import TargetShape
from orthoscope.simulation.scene import Scene, random_views, simulate_detections
from orthoscope.targets.detections import Detections

CAMERA = Camera((640, 480), Intrinsics(520.0, 524.0, 325.0, 236.0), Brown(k1=-0.28, k2=0.09, p1=1e-3))
SIMPLE = replace(CAMERA, lens=Brown(k1=-0.2))
NOISE = 0.2  # px per coordinate


def photographed(
    views: int, *, camera: Camera = CAMERA, noise_px: float = NOISE, seed: int = 0, **how
) -> Detections:
    rng = np.random.default_rng(seed)
    return simulate_detections(
        Scene(camera, BOARD, random_views(camera, BOARD, views, rng=rng, **how)), noise_px=noise_px, rng=rng
    )


@pytest.fixture(scope="module")
def good() -> Evaluation:
    return evaluate(fccm(photographed(15), lens="brown"))


def test_a_good_set_gets_its_error_with_its_uncertainty_and_no_warning(good):
    assert good.warnings == ()
    assert good.suspects == ()
    assert good.verdict.grade == Grade.GOOD
    assert good.verdict.cause == ""
    assert str(good.verdict) == (
        f"Good: off by about {good.error.seen_px:.2g} px where corners were seen, and by less than 0.5 px"
        f" over {100 * good.error.share:.0f} % of the frame."
    )


def test_where_the_camera_may_be_used_can_be_asked(good):
    seen = np.concatenate([view.pixels for view in good.calibration.detections.views])
    assert good.trusted(seen).mean() > 0.8
    assert not good.trusted(np.array([[-200.0, -200.0]])).any()


def test_its_numbers_are_those_of_the_noise(good):
    n, unknowns = 2 * good.calibration.detections.corners, 9 + 6 * 15
    assert_allclose(
        good.rms_px, NOISE * np.sqrt(2.0 * (1.0 - unknowns / n)), rtol=0.06
    )  # 810 corners tell it to 1.8 %: three of these
    assert good.rms_px < good.held_out_rms_px < 1.1 * good.rms_px
    assert_allclose(good.median_px, NOISE * np.sqrt(2.0 * np.log(2.0)), rtol=0.1)  # Rayleigh's median
    assert 3.0 * NOISE < good.largest_px < 5.0 * NOISE
    assert_allclose(
        good.nce, NOISE * np.sqrt(np.pi / 2.0) / np.sqrt(1.0 / 6.0), rtol=0.1
    )  # Rayleigh's mean over 0.408 px


def test_views_are_told_one_by_one_and_add_up(good):
    residuals = good.calibration.residuals()
    assert [view.image for view in good.views] == [view.image for view in good.calibration.detections.views]
    assert_allclose([view.rms_px for view in good.views], [rms(e) for e in residuals])
    assert_allclose([view.held_out_rms_px for view in good.views], [rms(e) for e in good.held_out_residuals])
    assert_allclose(np.mean([view.held_out_rms_px**2 for view in good.views]), good.held_out_rms_px**2)
    assert good.coverage == (corners_by_cell(good.calibration.detections) > 0).mean()


def test_what_is_held_out_is_held_out_by_the_calibrations_own_method_and_settings():
    calibration = fccm(photographed(8), lens="brown:k1", loss="huber", loss_scale=0.5)
    expected = held_out(
        calibration.detections,
        lambda some: fccm(some, lens="brown:k1", loss="huber", loss_scale=0.5),
        folds=4,
    )
    with ThreadPoolExecutor(2) as executor:
        evaluation = evaluate(calibration, folds=4, executor=executor)
    assert_array_equal(np.array(evaluation.held_out_residuals), np.array(expected.residuals))


@pytest.mark.parametrize(
    "fit", [partial(fccm, lens="brown:k1,k2"), pytest.param(decoupled, marks=pytest.mark.slow)]
)
def test_each_photograph_left_out_by_one_step_is_foreseen_as_by_fits_without_it(fit):
    calibration = fit(photographs_of(bent(1.0), 6, 1))
    by_step, by_fits = evaluate(calibration), evaluate(calibration, folds=6)
    assert (by_step.folds, by_fits.folds) == (0, 6)
    assert_allclose(by_step.held_out_rms_px, by_fits.held_out_rms_px, rtol=0.03)
    assert_allclose(by_step.nce, by_fits.nce, rtol=0.05)
    assert_allclose(*([rms(e) for e in found.held_out_residuals] for found in (by_step, by_fits)), rtol=0.1)


@pytest.mark.slow
def test_what_the_method_has_fitted_is_not_fitted_again(monkeypatch):
    calibration = decoupled(photographs_of(bent(1.0), 8, 1))
    found = evaluate(calibration)
    again = evaluate(pickle.loads(pickle.dumps(calibration)))  # what is kept is not sent
    assert_allclose(again.held_out_rms_px, found.held_out_rms_px, rtol=1e-9)
    assert_allclose(again.error.seen_px, found.error.seen_px, rtol=1e-9)

    def fitted(*_args, **_how):
        raise AssertionError("fitted again")

    monkeypatch.setattr("orthoscope.methods.decoupled.fitters.fit_step_one", fitted)
    monkeypatch.setattr("orthoscope.methods.decoupled.fitters.fit_flat", fitted)
    assert evaluate(calibration).held_out_rms_px == found.held_out_rms_px


def test_a_lens_that_folds_over_inside_the_data_is_not_to_be_used():
    wide = Camera((640, 480), Intrinsics(320.0, 320.0, 320.0, 240.0), KannalaBrandt(k1=-0.02))
    verdict = evaluate(fccm(photographed(12, camera=wide), lens="brown:k1"), folds=2).verdict
    assert (verdict.grade, verdict.cause) == (Grade.NO, "lens")
    assert re.search(r"lens formula ends 5\d degrees from the axis, before \d+ of the corners", verdict.limit)
    assert verdict.advice.endswith("--method decoupled.")


@pytest.mark.parametrize("views", [2, 3])
def test_too_few_views_say_that_nothing_was_held_out(views):
    evaluation = evaluate(fccm(photographed(views, tilt=(0.4, 0.7)), lens="brown:k1"))
    assert np.isnan(evaluation.held_out_rms_px)
    assert all(np.isnan(view.held_out_rms_px) for view in evaluation.views)
    assert evaluation.verdict.cause == "few"
    assert evaluation.verdict.grade in (Grade.USABLE, Grade.NO)
    told = str(evaluation.verdict)
    assert f"{views} photographs cannot tell how far" in told or f"{views} photographs are too few" in told
    assert np.isfinite(evaluation.nce)  # of the training views then


def test_assumptions_stand_among_the_warnings():
    calibration = fccm(photographed(2, tilt=(0.4, 0.7)), lens="brown:k1")
    assert calibration.assumptions == evaluate(calibration).warnings[:1] == ("two views: skew is taken as 0",)


def test_one_view_is_not_called_views():
    camera = Camera((640, 480), Intrinsics(520.0, 520.0, 319.5, 239.5), Brown(k1=-0.2))
    evaluation = evaluate(
        fccm(photographed(1, camera=camera, tilt=(0.4, 0.7), fill=(0.7, 0.9)), lens="brown:k1")
    )
    assert str(evaluation.verdict).startswith(
        "Do not use this camera: nothing says how far off it is. One photograph cannot tell"
    )


def test_a_search_that_did_not_come_to_an_end_is_told_of():
    verdict = evaluate(fccm(photographed(8), max_steps=1)).verdict
    assert verdict.grade in (Grade.USABLE, Grade.NO)
    assert "max_steps" not in str(verdict)


@pytest.mark.parametrize("odd", first_quick([7, 0, 11]))
def test_a_view_whose_corners_were_badly_found_is_named_and_no_other(odd):
    detections = photographed(12)
    views = list(detections.views)
    views[odd] = replace(
        views[odd],
        pixels=views[odd].pixels + np.random.default_rng(odd).normal(scale=3.0, size=views[odd].pixels.shape),
    )
    evaluation = evaluate(fccm(replace(detections, views=tuple(views))))
    (suspect,) = evaluation.suspects
    assert suspect[0] == views[odd].image
    assert re.match(
        r"corners are off by [2-6](\.\d)? px, in a typical photograph by 0\.\d+: it may be", suspect[1]
    )
    assert f"In {views[odd].image} corners are off by" in str(evaluation.verdict)
    assert evaluation.verdict.advice == f"Look at {views[odd].image}, and take it again or leave it out."


def test_a_board_that_was_bent_another_way_in_one_photograph_is_not_called_blurred():
    detections = photographed(12)
    x = BOARD.points[:, 0] - BOARD.points[:, 0].mean()
    bulge = np.outer(6.0 * (x / np.abs(x).max()) ** 2, [0.6, 0.8])
    views = list(detections.views)
    views[4] = replace(views[4], pixels=views[4].pixels + bulge[views[4].ids])
    (suspect,) = evaluate(fccm(replace(detections, views=tuple(views)), lens="brown")).suspects
    assert suspect[0] == views[4].image
    assert suspect[1].endswith("the target was bent another way")


def test_a_photograph_that_alone_shows_a_place_is_precious_and_no_suspect():
    detections = small_boards_but_for((0, 0))
    evaluation = evaluate(fccm(detections, lens="brown"), folds=2)
    assert evaluation.suspects == ()
    assert all(place in NINTHS.values() for _, place in evaluation.situation.precious)


NINTHS = {
    (0, 0): "at the top left", (0, 1): "at the top", (0, 2): "at the top right",
    (1, 0): "in the middle left", (1, 1): "in the middle", (1, 2): "in the middle right",
    (2, 0): "at the bottom left", (2, 1): "at the bottom", (2, 2): "at the bottom right",
}  # fmt: skip


def small_boards_but_for(empty: tuple[int, int]) -> Detections:
    """A small board, tilted, in the middle of each ninth of the frame but one."""
    rng, poses = np.random.default_rng(0), []
    for row, column in NINTHS:
        if (row, column) != empty:
            sight = SIMPLE.unproject(np.array([[(column + 0.5) * 640 / 3, (row + 0.5) * 480 / 3]]))[0]
            rotation = rotation_from_vector(rng.uniform(-0.6, 0.6, 3))
            poses.append(Pose(rotation, 2.5 * sight - rotation @ BOARD.points.mean(0)))
    return simulate_detections(Scene(SIMPLE, BOARD, tuple(poses)), noise_px=0.02, rng=rng)


@pytest.mark.slow
@pytest.mark.parametrize("empty", NINTHS, ids=NINTHS.values())
def test_the_place_that_no_photograph_covers_is_found(empty):
    assert emptiest_place(small_boards_but_for(empty)) == NINTHS[empty]


def test_the_place_that_no_photograph_covers_is_named():
    evaluation = evaluate(fccm(small_boards_but_for((0, 0)), lens="brown:k1"), folds=2)
    assert 0.3 < evaluation.coverage < 0.6
    assert "at the top left" in evaluation.verdict.advice


# --- targets and lenses that are not what they are said to be
# --------------------------------------------------------


def test_a_bent_board_is_told_of_in_px_and_mm_with_what_to_do():
    evaluation = evaluate(fccm(photographs_of(bent(2.0), 15, 0), lens="brown"))
    told = re.search(r"corners are off by the same (0\.\d+) mm", evaluation.verdict.limit)
    assert told
    target = evaluation.misfit.target
    expected = 1e3 * target.test.systematic_px / target.pixels_per_metre
    assert_allclose(float(told[1]), expected, rtol=0.05)  # told to two digits
    assert evaluation.verdict.advice == "Let its shape be found: --method decoupled."
    assert evaluation.verdict.grade in (Grade.USABLE, Grade.NO)
    assert evaluation.error.seen_px > 5.0 * evaluation.rms_px  # which no residual shows


def test_a_shape_that_was_estimated_and_is_wrong_is_not_called_flat():
    calibration = fccm(photographs_of(bent(2.0), 15, 0), lens="brown")
    shaped = replace(calibration, target_shape=TargetShape("smooth", 0.1 * (bent(2.0) - BOARD.points)))
    verdict = evaluate(shaped).verdict
    assert verdict.limit.startswith("The target is not of the shape that was found: ")
    assert "--method decoupled" not in verdict.advice


def test_a_lens_formula_that_cannot_follow_is_told_of_with_others_to_try():
    evaluation = evaluate(fccm(perfect(NARROW, 20, 1)[1], lens="division"))
    assert evaluation.verdict.limit.startswith(
        "The formula division cannot follow this lens: at the same places"
    )
    assert evaluation.verdict.advice.endswith("--method decoupled.")


@pytest.mark.datasets
def test_calibrel_looks_perfect_by_every_usual_check_and_is_not_to_be_trusted(datasets: Path):
    evaluation = evaluate(fccm(classic(datasets, "calibrel"), lens="brown"))
    assert (
        evaluation.held_out_rms_px < 1.02 * evaluation.rms_px
    )  # photographs that were not used are no worse
    assert evaluation.suspects == ()
    assert evaluation.coverage == 1.0
    assert (
        evaluation.calibration.uncertainty.deviations["cx"] < 3.0
    )  # px, though it is about 70 px from where the target's shape puts it
    assert evaluation.verdict.cause == "target"
    assert evaluation.verdict.grade in (Grade.USABLE, Grade.NO)
    assert evaluation.error.seen_px > 3.0 * evaluation.held_out_rms_px
    assert evaluation.verdict.advice == "Let its shape be found: --method decoupled."


# --- other photographs
# -----------------------------------------------------------------------------------------------


def test_a_camera_is_judged_on_other_photographs_by_their_poses_alone():
    camera, fresh = fccm(photographed(12)).camera, photographed(6, seed=1)
    unseen = evaluate_on(camera, fresh)
    assert unseen.detections.views == fresh.views
    assert_allclose(
        unseen.rms_px, NOISE * np.sqrt(2.0 * (1.0 - 6.0 / 108.0)), rtol=0.12
    )  # 324 corners tell it to 3 %
    assert len(unseen.view_rms_px) == 6
    assert_allclose(np.mean(np.square(unseen.view_rms_px)), unseen.rms_px**2)
    assert unseen.nce > 0


def test_photographs_of_another_size_are_refused():
    other = replace(photographed(3), image_size=(1280, 960))
    with pytest.raises(
        InputError,
        match=r"the photographs are 1280x960; this camera was calibrated at 640x480.*--resize 1280x960",
    ):
        evaluate_on(CAMERA, other)


def test_photographs_that_show_nothing_are_refused():
    with pytest.raises(CalibrationError, match="no view of"):
        evaluate_on(CAMERA, photographed(3).only([]))
