"""A calibration keeps its evidence; `calibrate` finds methods by name."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from numpy.testing import assert_allclose

from helpers.scenes import NARROW, photographed
from orthoscope.fitting.calibration import Uncertainty, corners_beyond, residuals_of, rms
from orthoscope.geometry.arrays import InputError
from orthoscope.geometry.pose import Pose
from orthoscope.methods import METHODS, calibrate
from orthoscope.methods.fccm import fccm
from orthoscope.models.camera import Camera
from orthoscope.models.intrinsics import Intrinsics
from orthoscope.models.lenses.table import Brown
from orthoscope.targets.detections import Detections, View
from orthoscope.targets.target import Target

DETECTIONS = photographed(NARROW, 4, noise_px=0.2)


def test_calibrate_calls_the_method_with_its_settings():
    by_name, by_hand = (
        calibrate(DETECTIONS, method="fccm", lens="brown:k1"),
        fccm(DETECTIONS, lens="brown:k1"),
    )
    assert by_name.method == "fccm"
    assert by_name.camera.intrinsics.as_tuple() == by_hand.camera.intrinsics.as_tuple()


@pytest.mark.slow
def test_every_method_says_its_name_and_can_be_called_again_from_its_settings():
    for name in METHODS:
        first = calibrate(DETECTIONS, method=name)
        assert first.method == name
        again = calibrate(first.detections, method=first.method, **first.settings)
        assert again.rms_px == first.rms_px


@pytest.mark.parametrize(
    ("wrong", "message"),
    [
        ({"method": "magic"}, "method 'magic' is not known; expected one of decoupled, fccm"),
        ({"lense": "brown"}, "method 'decoupled' has no setting 'lense'; it has lens, shape"),
    ],
)
def test_a_method_or_setting_that_is_none_is_refused(wrong, message):
    with pytest.raises(InputError, match=message):
        calibrate(DETECTIONS, **wrong)


def test_poses_must_match_the_views():
    found = fccm(DETECTIONS)
    with pytest.raises(InputError, match="3 poses for 4 views"):
        replace(found, camera_from_target=found.camera_from_target[:3])


def test_rms_is_over_points():
    assert rms(np.array([[3.0, 4.0], [0.0, 0.0]])) == pytest.approx(5.0 / np.sqrt(2.0))


def test_a_tied_parameter_gives_both_its_deviation():
    uncertainty = Uncertainty(("fx=fy", "k1"), np.diag([4.0, 0.25]))
    assert uncertainty.deviations == {"fx": 2.0, "fy": 2.0, "k1": 0.5}


def test_residuals_go_on_beyond_the_lens_s_domain_as_least_squares_does():
    found = fccm(DETECTIONS)
    folding = replace(
        found.camera, lens=found.camera.lens.with_coefficients(k1=-8.0, k2=0.0, k3=0.0)
    )  # folds at 12 degrees
    e = np.concatenate(residuals_of(folding, found.camera_from_target, DETECTIONS))
    assert np.isnan(folding.project(found.camera_from_target[0].apply(DETECTIONS.target.points))).any()
    assert np.isfinite(e).all()


def test_corners_that_lie_where_the_formula_has_ended_are_counted():
    """u = r (1 - r^2 / 2) comes back from r = .816."""
    camera = Camera((640, 480), Intrinsics(500.0, 500.0, 320.0, 240.0), Brown(k1=-0.5))
    points = np.array([[0.0, 0.0, 0.0], [0.5, 0.0, 0.0], [0.8, 0.0, 0.0], [0.83, 0.0, 0.0], [0.0, 0.9, 0.0]])
    view = View("a", np.array([0, 2, 3, 4]), np.full((4, 2), 300.0))
    detections = Detections(Target("row", points), (640, 480), (view,))
    front = Pose(np.eye(3), np.array([0.0, 0.0, 1.0]))
    assert corners_beyond(camera, (front,), points, detections) == 2


def test_residuals_of_views_are_in_their_order_and_of_their_corners():
    found = fccm(DETECTIONS)
    sizes = [len(e) for e in found.residuals()]
    assert sizes == [len(view.ids) for view in DETECTIONS.views]
    assert_allclose(found.rms_px**2 * sum(sizes), sum((e**2).sum() for e in found.residuals()))


def test_corrected_points_are_a_straight_photograph_of_the_target():
    """A calibration of them finds the same pin-hole and no lens."""
    made = fccm(DETECTIONS, lens="brown")
    again = fccm(made.corrected(), lens="brown")
    assert_allclose(again.camera.intrinsics.as_tuple(), made.camera.intrinsics.as_tuple(), atol=1e-5)
    assert_allclose(again.camera.lens.coefficients, 0.0, atol=1e-6)
    assert again.rms_px < 1e-6
