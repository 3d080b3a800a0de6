"""Slopes of the residuals: a small step of anything changes the residuals by slope times step."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from numpy.testing import assert_allclose

from helpers.boards import BOARD, NARROW, WIDE, seen_by_the_truth
from orthoscope.evaluation.misfit.jacobian import parameters_of, slopes_of, stepped
from orthoscope.geometry.pose import Pose, rotation_from_vector
from orthoscope.models.camera import Camera
from orthoscope.models.intrinsics import Intrinsics
from orthoscope.models.target_shape import TargetShape

OWN_FRAME = Camera(
    NARROW.image_size, NARROW.intrinsics, NARROW.lens, lens_frame=Intrinsics(500.0, 505.0, 310.0, 250.0)
)
for_every_camera = pytest.mark.parametrize(
    "camera", [NARROW, WIDE, OWN_FRAME], ids=["plane", "angle", "lens frame"]
)

STEP = 1e-6  # radians, metres; second derivatives of up to some 10 000 pixels leave
CURVED = 5e-7  # px


@for_every_camera
def test_residuals_are_the_calibrations_own_in_the_order_of_its_views(camera: Camera):
    calibration = seen_by_the_truth(camera, 3, 0, whole=False)
    slopes = slopes_of(calibration)
    assert_allclose(slopes.residual, np.concatenate(calibration.residuals()), atol=1e-12)
    assert np.bincount(slopes.view).tolist() == [len(view.ids) for view in calibration.detections.views]


@for_every_camera
def test_a_small_displacement_of_the_corners_changes_the_residuals_by_its_slopes(camera: Camera):
    calibration = seen_by_the_truth(camera, 3, 0)
    slopes, moved = (
        slopes_of(calibration),
        STEP * np.random.default_rng(0).standard_normal(BOARD.points.shape),
    )
    after = slopes_of(replace(calibration, target_shape=TargetShape("free", moved)))
    expected = (slopes.by_place @ moved[slopes.corner][:, :, None])[:, :, 0]
    assert_allclose(after.residual - slopes.residual, expected, atol=CURVED)


@for_every_camera
def test_a_small_step_of_every_pose_changes_the_residuals_by_its_slopes(camera: Camera):
    calibration = seen_by_the_truth(camera, 3, 0)
    slopes, rng = slopes_of(calibration), np.random.default_rng(1)
    steps, poses = STEP * rng.standard_normal((3, 6)), []
    for pose, step in zip(calibration.camera_from_target, steps, strict=True):
        turn, middle = rotation_from_vector(step[:3]), pose.rotation @ BOARD.points.mean(0)
        poses.append(Pose(turn @ pose.rotation, pose.translation + step[3:] + middle - turn @ middle))
    after = slopes_of(replace(calibration, camera_from_target=tuple(poses)))
    expected = (slopes.by_pose @ steps[slopes.view][:, :, None])[:, :, 0]
    assert_allclose(after.residual - slopes.residual, expected, atol=CURVED)


@for_every_camera
def test_a_small_step_of_every_parameter_changes_the_residuals_by_its_slopes(camera: Camera):
    calibration = seen_by_the_truth(camera, 3, 0)
    slopes, after = slopes_of(calibration), calibration.camera
    names = parameters_of(calibration)
    steps = 1e-3 * np.array(
        [1.0 if "f" in name or "c" in name else 1e-3 for name in names]
    )  # pixels; coefficients
    for name, step in zip(names, steps, strict=True):
        after = stepped(after, name, float(step))
    changed = slopes_of(replace(calibration, camera=after)).residual - slopes.residual
    assert_allclose(changed, slopes.by_camera @ steps, atol=CURVED)


def test_coefficients_that_are_zero_and_were_not_estimated_are_not_granted():
    assert parameters_of(seen_by_the_truth(NARROW, 3, 0)) == (
        "fx",
        "fy",
        "cx",
        "cy",
        "k1",
        "k2",
        "p1",
        "p2",
        "k3",
    )


def test_no_corner_has_no_slopes():
    calibration = seen_by_the_truth(NARROW, 3, 0)
    empty = replace(calibration, detections=calibration.detections.only([]), camera_from_target=())
    assert slopes_of(empty).by_camera.shape == (0, 2, 9)
