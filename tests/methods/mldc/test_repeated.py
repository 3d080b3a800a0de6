"""MLDC repeated: both steps lower one cost, and nothing changes any more where the full calibration with the
same lens ends.
"""

from __future__ import annotations

import numpy as np
import pytest
from numpy.testing import assert_allclose

from helpers.quick import first_quick
from helpers.scenes import NARROW, camera_with, photographed, some_corners
from orthoscope.evaluation.evaluate import evaluate_on
from orthoscope.fitting.calibration import residuals_of
from orthoscope.fitting.observations import Observations
from orthoscope.fitting.reprojection import Estimate
from orthoscope.methods.fccm import fccm
from orthoscope.methods.mldc.mldc import mldc
from orthoscope.methods.mldc.repeated import Ended
from orthoscope.methods.own_centre import with_own_centre
from orthoscope.models.camera import Camera
from orthoscope.models.difference import image_difference
from orthoscope.models.intrinsics import Intrinsics
from orthoscope.models.lenses.table import Brown, Pfet
from orthoscope.paper.trials import Condition, simulated
from orthoscope.solve.least_squares import Options
from orthoscope.solve.losses import Linear

TIGHT = Options(max_steps=100, tolerance=1e-16)
OF_K = ("fx", "fy", "cx", "cy")
EVERY = ("a1", "a2", "a3", "a4", "a5")


def joint_minimum(detections, near):
    """The full calibration with the paper's lens about its own centre, solved as far as numbers go."""
    observations = Observations.of(detections)
    found = with_own_centre(
        Estimate(near.camera, observations.poses_of(near.camera_from_target)),
        observations,
        detections.target.points,
        OF_K,
        EVERY,
        loss=Linear(),
        options=TIGHT,
    )
    assert found is not None
    camera, poses = found[0].unknowns
    return camera, observations.poses_in_order(poses)


def predicted(camera, poses, detections):
    return np.concatenate(residuals_of(camera, poses, detections))


@pytest.mark.parametrize(("scene", "nce"), [("low", 0.02), ("high", 0.025)])
def test_repeated_ends_at_the_joint_minimum_in_few_rounds(scene, nce):
    training, test = simulated(scene, Condition(), seed=0, trial=0)
    near = fccm(training, lens="pfet")
    training = near.detections  # a board that looks alike both ways up may have been turned in some views
    found = mldc(training)
    assert (found.status, found.steps <= 20) == ("converged", True)
    camera, poses = joint_minimum(training, near)
    mine = predicted(found.camera, found.camera_from_target, training)
    assert np.sqrt(((mine - predicted(camera, poses, training)) ** 2).sum(1).mean()) < 1e-6  # px, as promised
    assert evaluate_on(found.camera, test).nce < nce
    assert evaluate_on(fccm(training, lens="brown:k1,k2").camera, test).nce > 4 * nce


@pytest.mark.slow
def test_the_straight_image_has_the_photographs_scale_at_the_centre_for_every_lens():
    """Or the normalised error, which is in units of fx, would go with a convention of the formula."""
    training, test = simulated("low", Condition(subgrid=(6, 9)), seed=0, trial=0)
    mine, joint = mldc(training, lens="fet"), fccm(training, lens="fet", own_centre=True)
    assert mine.camera.intrinsics.fx == pytest.approx(joint.camera.intrinsics.fx, rel=0.01)
    assert "l" in joint.uncertainty.names
    nce = [evaluate_on(one.camera, test).nce for one in (mine, joint)]
    assert nce[0] == pytest.approx(nce[1], rel=0.01)


def test_no_round_raises_the_cost():
    costs = []
    mldc(photographed(NARROW, 5, noise_px=0.3), progress=lambda number, cost: costs.append(cost))
    of_rounds = np.array(costs[-4:])  # the first costs are those of the pin-hole's search
    assert (np.diff(of_rounds) <= 1e-12 * of_rounds[0]).all()


@pytest.mark.parametrize(
    ("lens", "coefficients"),
    [("pfet", Pfet(a2=-0.03, a3=-0.15, a5=0.02)), ("brown", Brown(k1=-0.2, k2=0.05))],
    ids=["pfet", "brown"],
)
def test_a_lens_of_its_own_kind_comes_back_without_noise(lens, coefficients):
    truth = Camera((640, 480), NARROW.intrinsics, coefficients, Intrinsics(520.0, 520.0, 340.0, 225.0))
    detections = some_corners(photographed(truth, 8), (0.7, 1.0))
    found = mldc(detections, lens=lens)
    pixels = np.concatenate([view.pixels for view in detections.views])
    assert np.abs(image_difference(truth, found.camera, pixels)).max() < 1e-5  # px; rounds stop at 1e-6 rms
    centred = fccm(detections, lens=lens, own_centre=True)
    assert np.abs(image_difference(truth, centred.camera, pixels)).max() < 1e-5
    assert_allclose((centred.camera.lens_frame.cx, centred.camera.lens_frame.cy), (340.0, 225.0), atol=1e-3)


def test_a_repetition_that_was_cut_short_says_how_far_it_has_to_go():
    found = mldc(photographed(NARROW, 6, noise_px=0.1), rounds=1)
    assert "stopped after 1 rounds: a round still moves the corners by" in found.status
    plain = mldc(photographed(NARROW, 6, noise_px=0.1), correct="repeated-plain", rounds=3)
    assert "stopped after 3 plain rounds" in plain.status


def test_plain_rounds_come_nearer_and_slowly():
    training, test = simulated("low", Condition(0.1, (6, 9)), seed=0, trial=0)
    once, some = (
        evaluate_on(mldc(training, correct=correct, rounds=30).camera, test).nce
        for correct in ("nearest", "repeated-plain")
    )
    assert some < 0.2 * once


def test_a_lens_without_distortion_has_no_centre_and_says_so():
    found = mldc(photographed(camera_with(Brown()), 6, noise_px=0.1))
    assert any("do not tell the distortion centre" in said for said in found.assumptions)
    centred = fccm(photographed(camera_with(Brown()), 6, noise_px=0.1), own_centre=True)
    assert centred.camera.lens_frame is None
    assert any("do not tell the distortion centre" in said for said in centred.assumptions)


def test_one_view_keeps_what_it_assumes():
    K = mldc(simulated("low", Condition(views=1), seed=0, trial=0)[0]).camera.intrinsics
    assert (K.cx, K.cy, K.fx) == (319.5, 239.5, K.fy)


@pytest.mark.slow
def test_the_uncertainty_of_camera_and_centre_is_that_of_repeated_simulations():
    found = []
    for trial in range(12):
        training, _ = simulated("high", Condition(0.1, (6, 9)), seed=1, trial=trial)
        found.append(mldc(training.only(range(8))))
    said = np.array([[c.uncertainty.deviations[name] for name in ("fx", "cx", "centre_x")] for c in found])
    values = np.array(
        [(c.camera.intrinsics.fx, c.camera.intrinsics.cx, c.camera.lens_frame.cx) for c in found]
    )
    ratio = values.std(0, ddof=1) / said.mean(0)
    assert ((ratio > 0.5) & (ratio < 1.8)).all()  # 11 degrees of freedom: within 1.6 in 99 % of experiments


def test_the_status_tells_a_cost_that_rose_and_a_direction_that_is_open_from_rounds_cut_short():
    settled = Ended(5, 1e-8, 1e-7, 0.97)
    assert settled.status == "converged"
    assert "raised the cost by 0.001" in settled._replace(raised=1e-3).status
    assert "leave a direction of the lens open" in Ended(60, 1e-3, np.inf, 1.0).status
    assert "1 px are to go" in Ended(60, 1e-2, 1.0, 0.99).status


@pytest.mark.parametrize("lens", first_quick(["pfet", "fet", "fov"]))
def test_the_stretch_is_the_only_direction_that_the_images_leave_open(lens):
    """With it taken out every eigenvalue is below 1, whatever the formula calls its size; 'fet' too
    converges.
    """
    found = mldc(simulated("low", Condition(0.1, (6, 9)), seed=0, trial=0)[0], lens=lens)
    assert found.status == "converged"
    usual = fccm(found.detections, lens=lens, own_centre=True)
    assert found.rms_px < 1.001 * usual.rms_px
