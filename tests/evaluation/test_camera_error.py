"""How far off the camera is said to be, beside how far off it is."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from numpy.testing import assert_allclose

from helpers.bent_boards import bowed, photographed_with
from helpers.scenes import NARROW, WIDE, photographed
from orthoscope.evaluation.camera_error import CameraError, predicted_error, rms_difference, seen_places
from orthoscope.evaluation.region import MARGIN_SHARE, between
from orthoscope.evaluation.verdict.situation import FINE_PX
from orthoscope.fitting.slopes.image_slopes import difference_of_images, image_slopes, motion_slopes
from orthoscope.fitting.unseen.leave_one_out import leave_one_out
from orthoscope.fitting.unseen.scatter import (
    STRETCH_SHARE,
    Scatter,
    likenesses,
    patterns_over_views,
    scatter_of,
)
from orthoscope.geometry.pose import rotation_from_vector
from orthoscope.methods.decoupled.step_one import fit_step_one
from orthoscope.methods.decoupled.step_one_linearised import linearised
from orthoscope.methods.fccm import fit_flat
from orthoscope.models.camera import Camera
from orthoscope.models.parameters import Parameters
from orthoscope.targets.detections import Detections

NAMES = ("fx", "fy", "cx", "cy", "k1", "k2")
DISTANCES = (np.inf, 0.7)


def moved(camera: Camera, step: np.ndarray) -> Camera:
    return Parameters.of(NAMES).moved(camera, step)


def scattered(detections: Detections, shape: str = "flat", first_lens: str = "formula") -> Scatter:
    known = linearised(fit_step_one(fit_flat(detections, lens="brown"), shape=shape, first_lens=first_lens))
    return scatter_of(known, leave_one_out(known), detections.target.points)


def places(detections: Detections) -> np.ndarray:
    return seen_places(np.concatenate([view.pixels for view in detections.views]))


@pytest.fixture(scope="module")
def noisy() -> Detections:
    return photographed(NARROW, 12, noise_px=0.1)


@pytest.fixture(scope="module")
def predicted(noisy: Detections) -> CameraError:
    corners = np.concatenate([view.pixels for view in noisy.views])
    return predicted_error(scattered(noisy), places(noisy), distance=0.5, corners=corners)


@pytest.mark.parametrize("camera", [NARROW, WIDE], ids=["narrow", "wide"])
@pytest.mark.parametrize("distance", DISTANCES)
def test_a_small_step_of_the_camera_moves_its_image_as_its_slopes_say(camera: Camera, distance: float):
    rays = camera.unproject(np.random.default_rng(0).uniform([60, 60], [580, 420], (40, 2)))
    step = 1e-3 * np.array([1.0, -2.0, 3.0, 1.0, 1e-3, 1e-3])
    slopes = image_slopes(camera, rays, NAMES).reshape(80, -1)
    motion = motion_slopes(camera, rays, distance).reshape(80, -1)
    left = slopes - motion @ np.linalg.lstsq(motion, slopes, rcond=None)[0]
    found = difference_of_images(camera, moved(camera, step), rays, rays, distance=distance)
    assert_allclose(found.ravel(), left @ step, atol=1e-6)  # of the second order in steps of 1e-3 px


@pytest.mark.parametrize("distance", DISTANCES)
def test_a_camera_that_was_only_turned_is_the_same_camera(distance: float):
    rays = NARROW.unproject(places(photographed(NARROW, 4)))
    turn = rotation_from_vector(np.array([[0.02, -0.01, 0.03]]))[0]
    apart = difference_of_images(NARROW, NARROW, rays @ turn.T, rays @ turn.T, distance=distance)
    assert_allclose(apart, 0.0, atol=1e-9)


def test_the_prediction_is_in_the_pixels_that_the_camera_is_off(noisy: Detections, predicted: CameraError):
    true = rms_difference(fit_flat(noisy, lens="brown").camera, NARROW, places(noisy))
    assert 0.2 * predicted.seen_px < true < 3.0 * predicted.seen_px  # a true error has few degrees of freedom
    assert predicted.seen_px == pytest.approx(max(predicted.alike_px, predicted.views_px))
    assert predicted.model_px <= predicted.alike_px
    assert predicted.near_seen_px < predicted.seen_px  # near the target a shift undoes more


def test_a_shift_undoes_less_where_the_target_stood_at_many_distances(noisy: Detections):
    scatter, where = scattered(noisy), places(noisy)
    spread = 0.5 * np.exp(np.random.default_rng(0).uniform(-0.3, 0.3, len(where)))
    one, many = (predicted_error(scatter, where, distance=to) for to in (0.5, spread))
    assert one.near_seen_px < many.near_seen_px < many.seen_px
    assert many.seen_px == one.seen_px


def test_a_board_that_always_stands_upright_may_be_stretched_and_nobody_would_know():
    """Its stretch is the pixels' aspect; boards turned in their plane tell the one from the other."""

    def scatter(**roll: tuple[float, float]) -> Scatter:
        return scattered(photographed_with(bowed(1e-3), NARROW, 8, noise_px=0.03, **roll), "free")

    upright, turned = scatter(roll=(-0.02, 0.02)), scatter()
    fx, fy = (upright.names.index(name) for name in ("fx", "fy"))
    aspect = np.zeros(upright.stretch.shape[1])
    aspect[[fx, fy]] = 1.0 / NARROW.intrinsics.fx, -1.0 / NARROW.intrinsics.fy
    open_upright, open_turned = (np.linalg.norm(s.stretch @ aspect) for s in (upright, turned))
    assert open_upright > 0.25 * STRETCH_SHARE  # views are tilted, and tell a part of it
    assert open_turned < 0.3 * open_upright
    assert (np.diag(upright.alike) >= np.diag(upright.model)).all()


@pytest.mark.slow
def test_the_models_own_part_is_the_scatter_over_repeated_photographs():
    clean = photographed(NARROW, 10)
    rng, where = np.random.default_rng(7), places(clean)
    model = scattered(photographed(NARROW, 10, noise_px=0.1))
    said = predicted_error(model, where, distance=0.5).model_px
    errors = []
    for _ in range(200):
        views = [
            replace(view, pixels=view.pixels + 0.1 * rng.standard_normal(view.pixels.shape))
            for view in clean.views
        ]
        found = fit_flat(replace(clean, views=tuple(views)), lens="brown").camera
        errors.append(rms_difference(found, NARROW, where))
    # far away two or three degrees of freedom make most of the error: over 200 sets its rms is known to 4 %
    assert np.sqrt(np.mean(np.square(errors))) == pytest.approx(said, rel=0.15)


def test_more_unknowns_make_no_deviation_smaller(noisy: Detections):
    least = None
    for shape, first_lens in (
        ("flat", "formula"),
        ("smooth", "formula"),
        ("free", "formula"),
        ("free", "free"),
    ):
        scatter = scattered(noisy, shape, first_lens)
        deviations = np.sqrt(np.diag(scatter.model)[: len(scatter.names)])
        if least is not None:
            assert (deviations > 0.98 * least).all()  # the noise that each finds differs by a percent
        least = deviations


def test_a_bent_board_taken_for_flat_is_off_by_more_than_it_knows_and_the_richest_model_tells():
    bent = photographed_with(bowed(2e-3), NARROW, 10, noise_px=0.05)
    where, flat, rich = places(bent), scattered(bent), scattered(bent, "free", "free")
    true = rms_difference(flat.camera, NARROW, where)
    alone = predicted_error(flat, where, distance=0.5)
    told = predicted_error(flat, where, distance=0.5, richest=rich)
    assert told.seen_px > alone.seen_px
    assert 0.5 * true < told.seen_px < 2.0 * true


def test_errors_alike_within_views_are_seen(noisy: Detections):
    independent = linearised(fit_step_one(fit_flat(noisy, lens="brown"), shape="flat", first_lens="formula"))
    found = likenesses(independent, patterns_over_views(independent, noisy.target.points))
    assert max(one.tau for one in found) < 1.6  # by chance: 20 to 32 patterns in each of twelve views
    rng, points = np.random.default_rng(0), noisy.target.points
    x = points[:, 0] - points[:, 0].mean()
    square = (x / np.abs(x).max()) ** 2
    views = [
        replace(view, pixels=view.pixels + 0.3 * rng.standard_normal(2) * square[view.ids, None])
        for view in noisy.views
    ]
    alike = linearised(
        fit_step_one(
            fit_flat(replace(noisy, views=tuple(views)), lens="brown"), shape="flat", first_lens="formula"
        )
    )
    assert likenesses(alike, patterns_over_views(alike, points))[0].tau > 5.0


def over_the_frame(columns: int, rows: int) -> np.ndarray:
    """Pixels at the centres of cells, row by row."""
    x, y = np.meshgrid((np.arange(columns) + 0.5) * 640 / columns, (np.arange(rows) + 0.5) * 480 / rows)
    return np.stack([x.ravel(), y.ravel()], axis=1) - 0.5


def test_places_are_trusted_where_the_error_is_small_and_corners_are_around(
    noisy: Detections, predicted: CameraError
):
    height, width = predicted.far.shape
    cells, pixels = over_the_frame(width, height), np.concatenate([view.pixels for view in noisy.views])
    trusted = predicted.trusted(cells)
    assert trusted.any()
    assert predicted.limit_px == FINE_PX  # what is trusted is what a grade calls good
    assert (predicted.far.ravel()[trusted] < 1.03 * FINE_PX).all()  # the way to its border goes in steps
    margin = MARGIN_SHARE * 640
    assert (cells[trusted] >= pixels.min(0) - margin).all()
    assert (cells[trusted] <= pixels.max(0) + margin).all()
    assert not predicted.trusted(np.array([[-50.0, 20.0], [700.0, 240.0]])).any()
    good = (predicted.far.ravel() < FINE_PX) & between(pixels, cells, margin)
    assert trusted.sum() > 0.95 * good.sum()  # the region is star-shaped, and so is what is good here


@pytest.mark.parametrize("noise", [0.02, 0.1, 0.3])
def test_the_share_of_the_frame_that_is_said_is_that_which_is_trusted(noise: float):
    detections = photographed(NARROW, 9, noise_px=noise)
    error = predicted_error(scattered(detections), places(detections), distance=0.5)
    assert error.share == pytest.approx(error.trusted(over_the_frame(160, 120)).mean(), abs=0.004)
    assert error.share <= error.seen_share


def test_what_is_wrong_beside_the_scatter_counts_everywhere(noisy: Detections, predicted: CameraError):
    """In the headline, in the map, and in the region."""
    scatter, seen = scattered(noisy), places(noisy)
    corners = np.concatenate([view.pixels for view in noisy.views])
    apart = predicted_error(scatter, seen, distance=0.5, corners=corners, differ_px=0.4)
    assert_allclose(apart.far, np.hypot(predicted.far, 0.4))
    assert apart.seen_px == pytest.approx(np.hypot(predicted.seen_px, 0.4))
    assert apart.share <= predicted.share
    other = moved(scatter.camera, np.array([1.0, 1.0, 0.0, 0.0, 0.01, 0.0]))
    off = predicted_error(scatter, seen, distance=0.5, judged=other)
    assert off.seen_px == pytest.approx(
        np.hypot(predicted.seen_px, rms_difference(other, scatter.camera, seen)), rel=1e-3
    )
    same = predicted_error(scatter, seen, distance=0.5, judged=scatter.camera)
    assert same.seen_px == predicted.seen_px
    assert predicted_error(scatter, seen, distance=0.5, copies=4.0).seen_px > predicted.seen_px
