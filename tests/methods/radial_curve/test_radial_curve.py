"""Lens before pin-hole, from planar grids: exact without noise, close with it, and what is refused."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from numpy.testing import assert_allclose

from orthoscope.evaluation.evaluate import evaluate_on
from orthoscope.geometry.arrays import CalibrationError
from orthoscope.methods import calibrate
from orthoscope.methods.radial_curve.curve import curve_of_views
from orthoscope.methods.radial_curve.fitzgibbon import division_of_grids
from orthoscope.methods.radial_curve.radial_lines import centre_of_distortion, grid_views
from orthoscope.models.camera import Camera
from orthoscope.models.intrinsics import Intrinsics
from orthoscope.models.lenses.table import Brown, Division
from orthoscope.paper.trials import Condition, simulated
from orthoscope.simulation.scene import Scene, random_views, simulate_detections
from orthoscope.targets.detections import Detections, View
from orthoscope.targets.target import chessboard

EXACT, TEST = simulated("low", Condition(0.0, (6, 9)), seed=0, trial=0)
NOISY, _ = simulated("low", Condition(0.1), seed=0, trial=0)


def seen_by(camera: Camera, noise_px: float = 0.0, views: int = 6) -> Detections:
    board = chessboard(9, 6, 0.025)
    poses = random_views(camera, board, views, rng=np.random.default_rng(2), fill=(0.6, 0.95))
    scene = Scene(camera, board, poses)
    return simulate_detections(scene, noise_px=noise_px, rng=np.random.default_rng(3))


def test_the_centre_is_where_all_radial_lines_meet():
    """To 1e-4 px without noise, to a pixel with a tenth of a pixel of it; one view is enough."""
    assert_allclose(centre_of_distortion(grid_views(EXACT), (640, 480)), (317.0, 244.0), atol=1e-4)
    one = EXACT.only([0])
    assert_allclose(centre_of_distortion(grid_views(one), (640, 480)), (317.0, 244.0), atol=1e-3)
    assert_allclose(centre_of_distortion(grid_views(NOISY), (640, 480)), (317.0, 244.0), atol=1.5)


def test_the_curve_is_that_of_the_lens_though_it_has_no_formula():
    """Up to its scale, to a tenth of a pixel wherever corners were seen."""
    curve = curve_of_views(grid_views(NOISY), np.array((317.0, 244.0)))
    out = np.linspace(5.0, 300.0, 40)
    pixels = np.column_stack([317.0 + 0.8 * out, 244.0 + 0.6 * out])
    truth = Camera((640, 480), Intrinsics(750.0, 750.0, 317.0, 244.0), Brown(k1=-0.2))
    straight = np.hypot(*(truth.undistort_pixels(pixels) - (317, 244)).T)
    ratio = np.hypot(*(curve.straightened(pixels) - curve.centre).T) / straight
    assert np.abs((ratio / np.median(ratio) - 1.0) * out).max() < 0.1


def test_hartley_and_kang_find_the_camera_of_the_papers_simulation():
    """Lens first and pin-hole on the corrected corners, nothing jointly: well below FCCM's .12 and .70."""
    for distortion, least in (("low", 0.03), ("high", 0.04)):
        training, test = simulated(distortion, Condition(0.1), seed=0, trial=0)
        assert evaluate_on(calibrate(training, method="hartley_kang").camera, test).nce < least


def test_the_division_model_comes_back_exactly_without_noise():
    """And is biased by noise: it is a start."""
    camera = Camera((640, 480), Intrinsics(520.0, 520.0, 319.5, 239.5), Division(l=-0.3))
    value = -0.3 * (400.0 / 520.0) ** 2
    assert_allclose(division_of_grids(grid_views(seen_by(camera)), (640, 480)), value, rtol=1e-7)
    found = calibrate(seen_by(camera, 0.05), method="fitzgibbon").camera
    assert_allclose(found.intrinsics.fx, 520.0, rtol=0.01)
    straight = Camera((640, 480), Intrinsics(520.0, 520.0, 319.5, 239.5), Brown())
    assert abs(division_of_grids(grid_views(seen_by(straight)), (640, 480))) < 1e-6


@pytest.mark.parametrize("method", ["hartley_kang", "fitzgibbon"])
def test_few_corners_a_solid_target_and_no_distortion_are_refused(method):
    few = replace(NOISY, views=tuple(View(v.image, v.ids[:6], v.pixels[:6]) for v in NOISY.views))
    with pytest.raises(CalibrationError, match=r"8 corners|no view"):
        calibrate(few, method=method)


def test_without_distortion_any_centre_within_the_frame_makes_the_same_images():
    straight = Camera((640, 480), Intrinsics(520.0, 520.0, 319.5, 239.5), Brown())
    assert calibrate(seen_by(straight, 0.1, views=15), method="hartley_kang").rms_px < 0.2
