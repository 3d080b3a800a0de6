"""Cameras are judged at discs' centres, not at those of their outlines: by folds, beside each other, on other
photographs.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from helpers.bent_boards import bowed
from helpers.discs import outlines_of
from orthoscope.evaluation.comparison.compare import compare
from orthoscope.evaluation.comparison.entry import camera_entry
from orthoscope.evaluation.evaluate import evaluate, evaluate_on
from orthoscope.fitting.disc_centres import at_disc_centres
from orthoscope.methods import METHODS, calibrate
from orthoscope.models.camera import Camera
from orthoscope.models.intrinsics import Intrinsics
from orthoscope.models.lenses.table import Brown
from orthoscope.models.target_shape import TargetShape, without_similarity
from orthoscope.simulation.scene import Scene, random_views
from orthoscope.targets.circles import Circles
from orthoscope.targets.detections import Detections
from orthoscope.targets.target import Target, target_of

CAMERA = Camera((1280, 960), Intrinsics(900.0, 900.0, 640.0, 480.0), Brown(k1=-0.25, k2=0.08))
TARGET = target_of(Circles(9, 7, 0.02, "symmetric", 0.014))  # outlines' centres are up to .7 px off
NOISE_PX = 0.02
# What noise makes of a residual per point where the camera is right and the pose fitted, with room.
MOST_OFF = 1.2 * NOISE_PX * np.sqrt(2.0)


def scene_of(target: Target, seed: int) -> Scene:
    how = {"tilt": (0.3, 0.9), "fill": (0.5, 0.9)}
    return Scene(CAMERA, target, random_views(CAMERA, target, 10, rng=np.random.default_rng(seed), **how))


@pytest.fixture(scope="module")
def seen() -> Detections:
    return outlines_of(scene_of(TARGET, 2), noise_px=NOISE_PX)


def test_methods_and_cameras_are_compared_at_the_discs_centres(seen):
    entries = [camera_entry("truth", CAMERA), camera_entry("longer", longer()), "fccm:brown"]
    truth, fitted, off = compare(seen, entries, folds=3).standings
    assert [truth.entry.name, fitted.entry.name, off.entry.name] == ["truth", "fccm:brown", "longer"]
    assert truth.held_out_px < MOST_OFF
    assert fitted.held_out_px < MOST_OFF
    assert off.loses_px > 5.0 * off.loses_error_px


def longer() -> Camera:
    """The camera, its centre 3 px to the side."""
    return replace(CAMERA, intrinsics=Intrinsics(900.0, 900.0, 643.0, 480.0))


def test_folds_judge_a_camera_at_the_discs_centres(seen):
    found = evaluate(calibrate(seen, method="fccm", lens="brown"), folds=3)
    assert found.held_out_rms_px < MOST_OFF
    as_outlines = evaluate(METHODS["fccm"](seen, lens="brown"), folds=3)
    assert as_outlines.held_out_rms_px > 1.3 * found.held_out_rms_px


def test_a_calibration_is_known_by_the_photographs_that_it_was_made_from_however_it_moved_them(seen):
    entries = [
        camera_entry(method, made.camera, calibration=made)
        for method in ("fccm", "nmldc")
        if (made := calibrate(seen, method=method))
    ]
    for standing in compare(seen, [*entries, "fccm:brown"], folds=3).standings:
        if standing.entry.calibration:
            assert "made from 10 of these 10 photographs" in standing.failure


def test_another_board_than_the_calibrations_is_judged_from_the_end_that_the_shape_fits():
    """A symmetric grid is listed from either end; a shape that was learnt has ends."""
    bent = bowed(2e-3, TARGET) * (1.0 + TARGET.points[:, :1] / np.ptp(TARGET.points[:, 0]))
    shape = TargetShape("smooth", without_similarity(TARGET.points, bent, np.ones(len(bent), dtype=bool)))
    scene = scene_of(TARGET, 3)
    poses = dict(zip(scene.images, scene.camera_from_target, strict=True))
    exact = at_disc_centres(outlines_of(scene), CAMERA, scene.camera_from_target, scene.images)
    turned, views = TARGET.symmetries()[0], []
    for number, view in enumerate(exact.views):
        pixels = CAMERA.project(poses[view.image].apply(TARGET.points + shape.displacements))[view.ids]
        views.append(replace(view, ids=turned[view.ids] if number % 2 else view.ids, pixels=pixels))
    others = replace(exact, views=tuple(views))
    assert evaluate_on(CAMERA, others).rms_px > 0.2
    assert evaluate_on(CAMERA, others, shape=shape).rms_px < 1e-6
