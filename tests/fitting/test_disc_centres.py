"""Discs: the offset between a disc's centre and the centre of its outline is known, and it is taken out."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from numpy.testing import assert_allclose

from helpers.discs import outlines_of
from orthoscope.evaluation.evaluate import evaluate_on
from orthoscope.fitting.disc_centres import at_disc_centres, disc_offsets, has_outlines
from orthoscope.formats.own.json import load_detections, save
from orthoscope.geometry.pose import Pose, rotation_from_vector
from orthoscope.methods import METHODS, calibrate
from orthoscope.models.camera import Camera
from orthoscope.models.intrinsics import Intrinsics
from orthoscope.models.lenses.table import Brown
from orthoscope.simulation.scene import Scene, random_views, simulate_detections
from orthoscope.targets.circles import Circles
from orthoscope.targets.detections import View
from orthoscope.targets.target import target_of

PIN_HOLE = Camera((1280, 960), Intrinsics(900.0, 900.0, 640.0, 480.0), Brown())
BENT = replace(PIN_HOLE, lens=Brown(k1=-0.25, k2=0.08))
TARGET = target_of(Circles(9, 7, 0.02, "symmetric", 0.014))


@pytest.fixture(scope="module")
def scene() -> Scene:
    views = random_views(BENT, TARGET, 10, rng=np.random.default_rng(2), tilt=(0.3, 0.9), fill=(0.5, 0.9))
    return Scene(BENT, TARGET, views)


def test_the_offset_of_a_pin_hole_is_that_of_the_outlines_conic():
    pose = Pose(rotation_from_vector(np.array([0.5, -0.6, 0.2])), np.array([-0.05, -0.04, 0.4]))
    points, radius = TARGET.points, TARGET.disc_radii[0]
    centres = []
    for x, y, _ in points:  # the outline is the conic H^-T C H^-1; its centre is its polar of infinity
        disc = np.array([[1.0, 0.0, -x], [0.0, 1.0, -y], [-x, -y, x * x + y * y - radius**2]])
        h = PIN_HOLE.K @ np.column_stack([pose.rotation[:, :2], pose.translation])
        dual = h @ np.linalg.inv(disc) @ h.T
        centres.append(dual[:2, 2] / dual[2, 2])
    offsets = disc_offsets(PIN_HOLE, pose, points, radius)
    assert np.hypot(*offsets.T).min() > 0.05
    assert_allclose(PIN_HOLE.project(pose.apply(points)) + offsets, centres, atol=1e-8)


def test_a_disc_face_on_in_a_pin_hole_has_no_offset():
    pose = Pose(np.eye(3), np.array([-0.05, -0.04, 0.4]))
    assert_allclose(disc_offsets(PIN_HOLE, pose, TARGET.points, TARGET.disc_radii), 0.0, atol=1e-9)


def test_correction_brings_outlines_back_to_the_discs_centres_whatever_end_they_are_listed_from(scene):
    exact = simulate_detections(scene, noise_px=0.0, rng=np.random.default_rng(0))
    seen = outlines_of(scene)
    turned = TARGET.symmetries()[0]
    views = tuple(View(view.image, turned[view.ids], view.pixels) for view in seen.views)
    for detections in (seen, replace(seen, views=views)):
        moved = at_disc_centres(detections, BENT, scene.camera_from_target, scene.images)
        assert not has_outlines(moved)
        for view, truth in zip(moved.views, exact.views, strict=True):
            assert_allclose(view.pixels, truth.pixels, atol=1e-9)
        assert at_disc_centres(moved, BENT, scene.camera_from_target, scene.images) is moved


def test_calibration_on_outlines_is_biased_without_the_correction_and_not_with_it(scene):
    seen = outlines_of(scene)
    truth = np.array(BENT.intrinsics.as_tuple()[:4])

    def off(calibration) -> float:
        return float(np.abs(np.array(calibration.camera.intrinsics.as_tuple()[:4]) - truth).max())

    plain, corrected = METHODS["fccm"](seen, lens="brown"), calibrate(seen, method="fccm", lens="brown")
    assert off(plain) > 0.3
    assert off(corrected) < 0.1 * off(plain)  # one round: what is left is of second order
    assert corrected.rms_px < 0.1 * plain.rms_px
    assert corrected.detections.disc_centres


def test_a_file_keeps_whether_pixels_are_discs_centres(scene, tmp_path):
    seen = outlines_of(scene)
    for detections in (seen, replace(seen, disc_centres=True)):
        save(detections, tmp_path / "detections.json")
        assert has_outlines(load_detections(tmp_path / "detections.json")) == has_outlines(detections)


def test_a_camera_is_judged_on_other_photographs_at_the_discs_centres(scene):
    assert evaluate_on(BENT, outlines_of(scene)).rms_px < 0.01
