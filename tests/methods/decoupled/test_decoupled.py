"""The default method: exact without noise whatever the target is, harmless where nothing is wrong, ahead
where no formula is the lens.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal

from helpers.bent_boards import bowed, drawn, photographed_with, stretched
from helpers.quick import first_quick
from helpers.scenes import (
    BOARD,
    NARROW,
    WIDE,
    K,
    camera_with,
    image_difference,
    photographed,
    some_corners,
    worst_image,
)
from orthoscope.evaluation.metrics import lateral_errors, normalised_calibration_error
from orthoscope.fitting.calibration import Calibration, residuals_of, rms
from orthoscope.fitting.resection import resect
from orthoscope.geometry.arrays import CalibrationError, InputError
from orthoscope.methods.decoupled.candidates import Candidates
from orthoscope.methods.decoupled.decoupled import decoupled
from orthoscope.methods.decoupled.model import BASES
from orthoscope.methods.fccm import fccm
from orthoscope.models.camera import Camera
from orthoscope.models.lenses.free import FreeLens
from orthoscope.models.lenses.table import Brown, Division
from orthoscope.models.target_shape import without_similarity
from orthoscope.simulation.scene import Scene, paper_scene, random_views, simulate_detections
from orthoscope.targets.detections import Detections
from orthoscope.targets.target import chessboard

BOTH = bowed(1e-3) + stretched(0.01) + drawn((2e-4, 2e-4, 2e-4))
SHAPES = {
    "bowed": bowed(2e-3),
    "stretched": stretched(0.01),
    "bowed and stretched with each corner off": BOTH,
    "perfect": 0.0 * BOTH,
}
CAMERAS = {"narrow": NARROW, "wide": WIDE}
for_every_camera = pytest.mark.parametrize("camera", CAMERAS.values(), ids=CAMERAS.keys())
NOISE = 0.1


@pytest.fixture(scope="module")
def noisy() -> Detections:
    return photographed_with(BOTH, NARROW, 10, noise_px=NOISE)


@pytest.fixture(scope="module")
def found(noisy: Detections) -> Calibration:
    return decoupled(noisy)


def settled(displacements: np.ndarray) -> np.ndarray:
    """As they are told: without what the poses do."""
    return without_similarity(BOARD.points, displacements, np.ones(len(BOARD.points), dtype=bool))


@for_every_camera
@pytest.mark.parametrize("shape", first_quick(SHAPES))
def test_without_noise_camera_and_target_are_exact(camera: Camera, shape: np.ndarray):
    detections = photographed_with(shape, camera, 10)
    found = decoupled(detections, shape="free", first_lens="formula")
    assert found.rms_px < 1e-9
    # without noise the weights are so loose that priors cost 1e-8 px at most
    assert worst_image(camera, found.camera, detections) < 1e-6
    assert_allclose(found.target_shape.displacements, settled(shape), atol=1e-9)


@pytest.mark.slow
def test_with_noise_camera_and_target_are_found_as_well_as_the_noise_lets_them(
    found: Calibration, noisy: Detections
):
    assert found.settings["shape"] == "free"
    seen = np.concatenate([view.pixels for view in noisy.views])
    perfect = fccm(
        photographed_with(0.0 * BOTH, NARROW, 10, noise_px=NOISE)
    )  # the same noise on a board that needs no shape
    off = np.median(image_difference(NARROW, found.camera, seen))
    assert off < 2.0 * np.median(image_difference(NARROW, perfect.camera, seen))
    assert off < 0.1 * np.median(
        image_difference(NARROW, fccm(noisy).camera, seen)
    )  # what a flat target makes of the same corners
    left = found.target_shape.displacements - settled(BOTH)
    assert np.sqrt((left**2).mean()) < 0.3 * np.sqrt((settled(BOTH) ** 2).mean())


def test_candidates_are_told_with_what_each_loses_against_the_one_that_was_taken(found: Calibration):
    assert {candidate.base for candidate in found.candidates[: len(BASES)]} == set(BASES)
    tried = {
        (candidate.target, candidate.lens) for candidate in found.candidates if candidate.base == "brown"
    }
    assert tried == {("flat", "brown"), ("free", "free")}  # the simplest and the richest
    assert all(candidate.views == len(found.detections.views) for candidate in found.candidates)
    taken = next(candidate for candidate in found.candidates if candidate.loses_px == 0.0)
    assert (taken.target, taken.lens) == (found.settings["shape"], found.settings["lens"])
    for candidate in found.candidates:
        assert candidate.loses_px == pytest.approx(candidate.held_out_px - taken.held_out_px)
    flat = next(candidate for candidate in found.candidates if candidate[:2] == ("flat", "brown"))
    assert flat.loses_px > 5.0 * flat.standard_error_px


def test_parameters_that_the_data_determined_are_counted(found: Calibration):
    assert 9 + 54 < found.parameters < 9 + 3 * 54
    assert len(found.uncertainty.names) == 4 + len(Brown.free)
    assert all(0.0 < deviation < np.inf for deviation in found.uncertainty.deviations.values())


@pytest.mark.slow
@for_every_camera
def test_a_perfect_board_and_a_lens_that_its_formula_describes_are_not_harmed(camera: Camera):
    detections = photographed_with(0.0 * BOTH, camera, 10, noise_px=NOISE)
    seen = np.concatenate([view.pixels for view in detections.views])
    ours, peers = (
        np.sqrt((image_difference(camera, made.camera, seen) ** 2).mean())
        for made in (decoupled(detections), fccm(detections))
    )
    assert (
        ours < 1.2 * peers
    )  # the same noise for both, most of it in the principal point; room for a handful of parameters more


def assert_same(one: Calibration, other: Calibration) -> None:
    assert one.camera.intrinsics.as_tuple() == other.camera.intrinsics.as_tuple()
    assert one.camera.lens.coefficients.tobytes() == other.camera.lens.coefficients.tobytes()
    assert type(one.camera.lens) is type(other.camera.lens)
    if isinstance(one.camera.lens, FreeLens) and isinstance(other.camera.lens, FreeLens):
        assert one.camera.lens.over.coefficients.tobytes() == other.camera.lens.over.coefficients.tobytes()
    assert one.target_shape.displacements.tobytes() == other.target_shape.displacements.tobytes()
    for pose, again in zip(one.camera_from_target, other.camera_from_target, strict=True):
        assert pose.rotation.tobytes() == again.rotation.tobytes()
        assert pose.translation.tobytes() == again.translation.tobytes()
    assert one.settings == other.settings
    assert_array_equal(one.uncertainty.covariance, other.uncertainty.covariance)


def test_its_settings_are_plain_and_called_again_give_the_same_to_the_last_bit(
    found: Calibration, noisy: Detections
):
    assert found.method == "decoupled"
    # The lens is brown: with and without a displacement it foresees as well.
    lens = found.settings["lens"]
    assert found.settings == {
        "lens": lens,
        "shape": "free",
        "base": "brown",
        "first_lens": {"brown": "formula", "free": "free"}[lens],
        "fit": "joint",
        "skew": False,
    }
    again = decoupled(noisy, **found.settings)
    assert_same(again, found)
    assert again.candidates == ()  # nothing was left to choose


@pytest.mark.parametrize(
    "settings",
    [
        {"lens": "division", "shape": "smooth", "first_lens": "free"},
        {"lens": "brown:k1,k2", "shape": "flat", "first_lens": "formula", "skew": True},
        {"shape": "free", "first_lens": "formula", "base": "kannala_brandt"},
    ],
)
def test_whatever_is_settled_beforehand_is_kept_and_gives_the_same_again(noisy: Detections, settings: dict):
    first = decoupled(noisy, **settings)
    assert settings.items() <= first.settings.items()
    assert_same(decoupled(noisy, **first.settings), first)


@pytest.mark.slow
def test_the_same_photographs_give_the_same_choice_to_the_last_bit(noisy: Detections):
    one, other = (decoupled(noisy.only(range(6))) for _ in range(2))
    assert_same(one, other)
    assert repr(one.candidates) == repr(
        other.candidates
    )  # NaN, where a fit did not arrive, is no equal of itself


@pytest.mark.slow
def test_a_formula_that_is_asked_for_comes_with_the_free_camera_that_it_was_fitted_to(noisy: Detections):
    fitted = decoupled(noisy, lens="brown", shape="free", first_lens="free")
    assert isinstance(fitted.camera.lens, Brown)
    assert fitted.free_camera is not None
    assert isinstance(fitted.free_camera.lens, FreeLens)
    seen = np.concatenate([view.pixels for view in noisy.views])
    assert (
        np.median(image_difference(fitted.free_camera, fitted.camera, seen)) < NOISE
    )  # the lens is a brown one
    assert decoupled(noisy, lens="brown", shape="free", first_lens="formula").free_camera is None


@pytest.mark.slow
def test_out_of_several_formulas_the_one_that_foresees_best_is_taken(noisy: Detections):
    chosen = decoupled(
        noisy, shape="free", first_lens="formula", formulas=("rational", "division:l", "brown")
    )
    assert chosen.settings["lens"] == "brown"  # simpler ones do not suffice, richer ones gain nothing
    assert {(candidate.lens, candidate.fit) for candidate in chosen.candidates} >= {
        ("division:l", "pairs"),
        ("division:l", "joint"),
        ("brown", "joint"),
        ("rational", "pairs"),
        ("rational", "joint"),
    }
    only = decoupled(noisy, shape="free", first_lens="formula", formulas=("division",))
    assert isinstance(only.camera.lens, Division)


def test_a_base_whose_fit_was_stopped_on_its_way_is_left_to_those_that_arrived(
    noisy: Detections, found: Calibration, monkeypatch: pytest.MonkeyPatch
):
    first = found.settings["base"]
    monkeypatch.setattr(Candidates, "stands", lambda _, model: model.base != first)
    assert decoupled(noisy).settings["base"] != first
    monkeypatch.setattr(Candidates, "stands", lambda *_: False)  # then each is as good as the others
    assert decoupled(noisy).settings["base"] == first


def test_progress_counts_to_the_end(noisy: Detections):
    heard = []
    decoupled(
        noisy,
        lens="brown",
        first_lens="formula",
        judging=lambda done, to_do: heard.append((done, to_do)),
    )
    assert [done for done, _ in heard] == sorted(done for done, _ in heard)
    assert heard[-1][0] == heard[-1][1]
    assert len(heard) > len(BASES)


@pytest.mark.slow
def test_a_skew_is_found_where_it_is_asked_for():
    camera = Camera(NARROW.image_size, replace(K, skew=5.0), NARROW.lens)
    found = decoupled(photographed_with(BOTH, camera, 10), shape="free", first_lens="free", skew=True)
    assert found.camera.intrinsics.skew == pytest.approx(5.0, abs=0.1)  # the free lens shares in it a little
    assert "skew" in found.uncertainty.names


def test_partial_boards_are_as_welcome_as_whole_ones():
    detections = some_corners(photographed_with(bowed(2e-3), NARROW, 10, noise_px=NOISE), (0.5, 0.9))
    found = decoupled(detections, first_lens="formula")
    assert found.settings["shape"] in ("smooth", "free")
    assert worst_image(NARROW, found.camera, detections) < 0.1 * worst_image(
        NARROW, fccm(detections).camera, detections
    )


def test_a_corner_that_no_view_has_is_left_where_the_target_says():
    whole = photographed_with(BOTH, NARROW, 8, noise_px=NOISE)
    views = tuple(replace(view, ids=view.ids[2:], pixels=view.pixels[2:]) for view in whole.views)
    found = decoupled(replace(whole, views=views), shape="free", first_lens="formula")
    assert_array_equal(found.target_shape.displacements[:2], 0.0)
    assert found.target_shape.displacements[2:].all()


def test_a_board_of_few_corners_is_calibrated_too():
    target = chessboard(4, 3, 0.04)
    detections = photographed_with(
        stretched(0.01, target), NARROW, 12, target=target, noise_px=NOISE, fill=(0.5, 0.9)
    )
    found = decoupled(detections, first_lens="formula")
    assert found.settings["shape"] != "flat"
    assert found.rms_px < 2.0 * NOISE


@pytest.mark.parametrize("views", [2, 3])
def test_with_few_views_the_target_is_taken_as_flat_and_that_is_said(views: int):
    detections = photographed(NARROW, views, noise_px=NOISE)
    found, flat = decoupled(detections), fccm(detections)
    assert found.settings == {
        "lens": "brown",
        "shape": "flat",
        "base": "brown",
        "first_lens": "formula",
        "fit": "joint",
        "skew": False,
    }
    assert any(
        "fewer than 4 views cannot be judged by views that were not used" in said
        for said in found.assumptions
    )
    assert set(flat.assumptions) < set(found.assumptions)
    assert_allclose(
        found.camera.intrinsics.as_tuple(), flat.camera.intrinsics.as_tuple(), atol=1e-2
    )  # Huber's loss is all the difference
    assert_same(decoupled(detections, **found.settings), found)


def test_one_view_gives_a_camera_with_what_was_assumed_and_a_pose():
    detections = photographed(
        camera_with(Brown(k1=-0.2), replace(K, fy=K.fx, cx=319.5, cy=239.5)),
        1,
        tilt=(0.5, 0.6),
        fill=(0.6, 0.9),
    )
    found = decoupled(detections, base="brown:k1")
    assert found.camera.intrinsics.fx == pytest.approx(K.fx, rel=1e-6)
    assert len(found.camera_from_target) == 1
    assert len(found.assumptions) == 2


def test_views_that_cannot_tell_the_camera_are_refused_as_by_fccm():
    with pytest.raises(CalibrationError, match="focal length is open"):
        decoupled(photographed(NARROW, 1, tilt=(0.0, 0.01), noise_px=NOISE))


@pytest.mark.parametrize(
    ("settings", "message"),
    [
        ({"shape": "wavy"}, "target shape 'wavy' is not known; expected one of auto, flat, smooth, free"),
        ({"lens": "soap"}, "lens 'soap' is not known"),
        ({"lens": "brown:k9"}, "has no coefficient 'k9'"),
        ({"base": "soap"}, "lens 'soap' is not known"),
        ({"base": "free"}, "lens 'free' is no formula"),
        ({"first_lens": "windows"}, "first_lens is 'windows'; expected 'free'"),
        ({"lens": "free", "first_lens": "formula"}, "expected one of the two"),
        ({"formulas": ("brown", "soap")}, "lens 'soap' is not known"),
        ({"fit": "by eye"}, "fit is 'by eye'; expected 'joint'"),
        (
            {"lens": "brown", "fit": "joint", "first_lens": "free"},
            "cannot be fitted joint with first_lens free",
        ),
    ],
)
def test_a_setting_that_is_none_is_refused(noisy: Detections, settings: dict, message: str):
    with pytest.raises(InputError, match=message):
        decoupled(noisy, **settings)


def nce_on(calibration: Calibration, test: Detections) -> float:
    """NCE on views that were not used, each with its own pose."""
    poses = resect(calibration.camera, test)
    return normalised_calibration_error(
        *lateral_errors(calibration.camera, poses, test), calibration.camera.intrinsics
    )


@pytest.mark.slow
def test_in_the_papers_simulation_the_free_lens_makes_up_for_what_its_base_lacks():
    rng = np.random.default_rng(0)
    scene = paper_scene("high", count=25, rng=rng)
    train, test = (
        simulate_detections(scene, noise_px=0.1, rng=rng),
        simulate_detections(scene, noise_px=0.0, rng=rng),
    )
    train, test = train.only(range(15)), test.only(range(15, 25))
    poor = nce_on(decoupled(train, base="brown:k1,k2", lens="free", shape="flat"), test)
    assert poor <= 0.05  # measured: 0.028
    assert poor < 0.1 * nce_on(fccm(train, lens="brown:k1,k2"), test)
    assert nce_on(decoupled(train, base="brown", lens="free", shape="flat"), test) <= 1.05 * nce_on(
        fccm(train, lens="brown"), test
    )  # 0.016 and 0.027


def bump_and_astigmatism(pixels: np.ndarray) -> np.ndarray:
    """Pixels moved as no formula does: 2 px outwards on a ring at mid-field; towards the corners 2 px apart
    along x, together along y.
    """
    from_centre = pixels - [320.0, 240.0]
    r = np.hypot(*from_centre.T)[:, None]
    bump = 2.0 * np.exp(-(((r - 170.0) / 80.0) ** 2)) * from_centre / np.maximum(r, 1.0)
    return pixels + bump + 2.0 * (r / 400.0) ** 2 * from_centre / 400.0 * [1.0, -1.0]


def moved(detections: Detections, by: Callable[[np.ndarray], np.ndarray]) -> Detections:
    return replace(
        detections, views=tuple(replace(view, pixels=by(view.pixels)) for view in detections.views)
    )


@pytest.mark.slow
def test_a_lens_of_a_kind_that_no_formula_has_is_foreseen_to_within_a_tenth_of_the_noise():
    rng, target = np.random.default_rng(1), chessboard(14, 20, 0.014)
    scene = Scene(NARROW, target, random_views(NARROW, target, 25, rng=rng, fill=(0.5, 0.95)))
    exact = moved(simulate_detections(scene, noise_px=0.0, rng=rng), bump_and_astigmatism)
    detections = moved(exact, lambda pixels: pixels + NOISE * rng.standard_normal(pixels.shape))
    train, test = detections.only(range(15)), detections.only(range(15, 25))
    floor = (
        NOISE * np.sqrt(2.0) * np.sqrt(1.0 - 6 / (2 * 280))
    )  # a view's own pose takes six of its 560 numbers

    def error(calibration: Calibration) -> float:
        shape = calibration.target_shape
        poses = resect(calibration.camera, test, shape=shape)
        return rms(np.concatenate(residuals_of(calibration.camera, poses, test, shape=shape)))

    assert (
        error(decoupled(train)) < 1.1 * floor
    )  # measured: 1.03; on a ring of 60 px for 80, fine for a lattice of 80 px cells, 1.13
    assert error(fccm(train, lens="brown")) > 1.5 * floor  # measured: 1.97
    assert error(fccm(train, lens="rational")) > 1.1 * floor  # 1.17
