"""Step 2 by itself, and the number behind Fig. 7."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.testing import assert_allclose

from orthoscope.methods.mldc.mldc import mldc
from orthoscope.models.camera import Camera
from orthoscope.models.intrinsics import Intrinsics
from orthoscope.models.lenses.table import Brown
from orthoscope.paper.step_two import lens_from_images
from orthoscope.paper.straightness import bent_px
from orthoscope.paper.trials import Condition, papers_scene, simulated

TRAINING, TEST = simulated("low", Condition(0.1, (6, 9)), seed=0, trial=0)


def test_the_lens_from_all_images_is_the_lens_of_both_steps_and_from_one_nearly():
    whole, one = (lens_from_images(TRAINING, images=count) for count in (15, 1))
    usual = mldc(TRAINING)
    seen = np.concatenate([view.pixels for view in TEST.views])
    assert whole.camera.intrinsics.as_tuple() == usual.camera.intrinsics.as_tuple()
    assert_allclose(whole.camera.undistort_pixels(seen), usual.camera.undistort_pixels(seen), atol=1e-4)
    apart = np.hypot(*(one.camera.undistort_pixels(seen) - usual.camera.undistort_pixels(seen)).T)
    assert 0.001 < np.median(apart) < 1.0


def test_exact_corners_are_straight_under_the_true_camera_and_bent_without_a_lens():
    truth = papers_scene("low", Condition(), seed=0, trial=0).camera
    assert bent_px(truth, TEST) < 1e-9
    none = Camera((640, 480), Intrinsics(750.0, 750.0, 320.0, 240.0), Brown())
    assert bent_px(none, TEST) > 0.3


@pytest.mark.parametrize("shrunk", [0.1, 3.0])
def test_a_small_straight_image_gains_nothing(shrunk):
    none = Camera((640, 480), Intrinsics(750.0, 750.0, 320.0, 240.0), Brown())
    smaller = Camera(
        (640, 480),
        Intrinsics(750.0 * shrunk, 750.0 * shrunk, 320.0, 240.0),
        Brown(),
        lens_frame=Intrinsics(750.0, 750.0, 320.0, 240.0),
    )
    assert_allclose(bent_px(smaller, TEST), bent_px(none, TEST), rtol=1e-6)
