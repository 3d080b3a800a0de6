"""Resection: where the target was, for a known camera."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.testing import assert_allclose
from scipy.optimize import least_squares

from helpers.laws import for_every_lens
from helpers.scenes import (
    BOARD,
    NARROW,
    WIDE,
    K,
    camera_with,
    photographed,
    seen,
    some_corners,
    turned_boards,
)
from orthoscope.fitting.calibration import residuals_of
from orthoscope.fitting.resection import resect
from orthoscope.geometry.arrays import CalibrationError
from orthoscope.geometry.pose import Pose, rotation_from_vector
from orthoscope.models.camera import Camera
from orthoscope.models.intrinsics import Intrinsics
from orthoscope.models.lenses.table import Brown, Division, Pfet
from orthoscope.simulation.scene import random_views
from orthoscope.solve.losses import Cauchy
from orthoscope.targets.detections import Detections, View


def assert_same_poses(found: tuple[Pose, ...], poses: tuple[Pose, ...], atol: float) -> None:
    assert_allclose([pose.rotation for pose in found], [pose.rotation for pose in poses], atol=atol)
    assert_allclose([pose.translation for pose in found], [pose.translation for pose in poses], atol=atol)


@for_every_lens
def test_resection_is_exact_without_noise(lens):
    poses = tuple(Pose(rotation_from_vector(w), t) for w, t in zip(*turned_boards(), strict=True))
    if isinstance(lens, Pfet) and lens.a0 != 0.0:
        poses = poses[1:]  # the formula is singular where these tear the image
    camera = camera_with(lens)
    assert_same_poses(resect(camera, seen(camera, poses)), poses, atol=1e-9)


@pytest.mark.parametrize(
    "camera",
    [WIDE, Camera((640, 480), K, Division(l=-0.3), Intrinsics(500.0, 530.0, 340.0, 220.0))],
    ids=["past 90 degrees", "with a lens frame"],
)
def test_views_of_different_size_come_back_in_their_order(camera):
    poses = random_views(camera, BOARD, 12, rng=np.random.default_rng(0), whole=False)
    detections = some_corners(seen(camera, poses), (0.2, 1.0))
    assert len({len(view.ids) for view in detections.views}) > 5
    assert_same_poses(resect(camera, detections), poses, atol=1e-8)


def test_with_noise_no_pose_nearby_is_better():
    detections = photographed(NARROW, 4, noise_px=0.5)
    for i, pose in enumerate(resect(NARROW, detections)):
        alone = detections.only([i])

        def residual(step, pose=pose, alone=alone):
            moved = Pose(rotation_from_vector(step[:3]) @ pose.rotation, pose.translation + step[3:])
            return residuals_of(NARROW, [moved], alone)[0].ravel()

        oracle = least_squares(residual, np.zeros(6), xtol=1e-15, ftol=1e-15, gtol=1e-15, x_scale="jac")
        assert_allclose((residual(np.zeros(6)) ** 2).sum(), 2.0 * oracle.cost, rtol=1e-9)


def test_a_robust_loss_forgets_a_corner_that_was_mistaken():
    detections = photographed(NARROW, 1, noise_px=0.1)
    view, (pose,) = detections.views[0], resect(NARROW, detections)
    pixels = view.pixels.copy()
    pixels[7] += 40.0
    spoilt = Detections(BOARD, detections.image_size, (View("spoilt", view.ids, pixels),))
    (plain,), (robust,) = resect(NARROW, spoilt), resect(NARROW, spoilt, loss=Cauchy(0.5))
    assert (
        np.linalg.norm(robust.translation - pose.translation)
        < 2e-4
        < np.linalg.norm(plain.translation - pose.translation)
    )


def test_a_view_outside_the_lens_is_named():
    folding = camera_with(Brown(k1=-0.5))
    detections = photographed(NARROW, 2)
    corner = View("corner.jpg", np.arange(4), np.array([[0.0, 0], [9, 0], [0, 9], [9, 9]]))
    with pytest.raises(
        CalibrationError, match=r"'corner.jpg' has fewer than 4 corners where this camera sees anything"
    ):
        resect(folding, Detections(BOARD, detections.image_size, (*detections.views, corner)))


def test_no_views_have_no_poses():
    assert resect(NARROW, photographed(NARROW, 1).only([])) == ()
