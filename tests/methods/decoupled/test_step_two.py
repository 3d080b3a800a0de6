"""A formula from pairs: the true one where the pairs have it, the nearest one where they have not, and no
answer where it cannot see.
"""

from __future__ import annotations

import numpy as np
import pytest
from numpy.testing import assert_allclose

from helpers.bent_boards import bowed, photographed_with
from helpers.laws import displaced
from helpers.scenes import NARROW, WIDE, K, camera_with, photographed, worst_image
from orthoscope.geometry.arrays import CalibrationError, InputError
from orthoscope.methods.decoupled.step_one import FORMULA, StepOneFit, fit_step_one
from orthoscope.methods.decoupled.step_two import (
    by_simplicity,
    formula_from_pairs,
    nearest_formula,
    pairs_of_step_one,
)
from orthoscope.methods.fccm import fccm
from orthoscope.models.camera import Camera
from orthoscope.models.lenses.table import FREE, LENSES, Brown, Division, KannalaBrandt

BOWED = photographed_with(bowed(1e-3), NARROW, 10)


@pytest.fixture(scope="module")
def exact() -> StepOneFit:
    """Step 1 of noise-free photographs of a bowed board."""
    return fit_step_one(fccm(BOWED, lens="brown"), shape="free", first_lens=FREE)


def rays_of(camera: Camera) -> np.ndarray:
    """Over the image."""
    x, y = np.meshgrid(np.linspace(0.0, 639.0, 20), np.linspace(0.0, 479.0, 15))
    rays = camera.unproject(np.stack([x.ravel(), y.ravel()], axis=1))
    return rays[np.isfinite(rays).all(1)]


def test_pairs_are_corners_of_the_real_target_and_the_pixels_where_they_were_seen(exact):
    rays, pixels = pairs_of_step_one(exact)
    assert len(rays) == len(pixels) == 10 * 54
    assert_allclose(
        exact.estimate.camera.project(rays), pixels, atol=0.02
    )  # no noise: what the priors of step 1 cost


def test_corners_that_are_missing_make_no_pairs():
    detections = photographed(NARROW, 8, whole=False, fill=(0.9, 0.95))
    fit = fit_step_one(fccm(detections, lens="brown"), shape="flat", first_lens=FORMULA)
    assert len(pairs_of_step_one(fit)[0]) == detections.corners < 8 * 54


def test_the_true_formula_is_found_and_its_parameters_are_named(exact):
    camera, names = formula_from_pairs(exact, "brown")
    assert names == ("fx", "fy", "cx", "cy", *Brown.free)
    assert isinstance(camera.lens, Brown)
    assert worst_image(NARROW, camera, BOWED) < 0.05


def test_only_the_coefficients_that_are_named_are_fitted(exact):
    camera, names = formula_from_pairs(exact, "brown:k1,k2")
    assert names[4:] == ("k1", "k2")
    assert isinstance(camera.lens, Brown)
    assert (camera.lens.p1, camera.lens.k3) == (0.0, 0.0)


@pytest.mark.parametrize("lens", ["rational", "division", "fov", "pfet", "kannala_brandt"])
def test_any_formula_of_the_table_is_fitted_as_well_as_it_can(exact, lens):
    camera, _ = formula_from_pairs(exact, lens)
    rays, pixels = pairs_of_step_one(exact)
    assert type(camera.lens) is LENSES[lens]
    assert (
        np.sqrt(((camera.project(rays) - pixels) ** 2).sum(1).mean()) < 1.0
    )  # 20 px of distortion, by a formula of another kind


@pytest.mark.parametrize("lens", ["brown", "rational"])
def test_a_lens_of_the_plane_cannot_take_what_was_seen_past_90_degrees(lens):
    fit = fit_step_one(fccm(photographed(WIDE, 12)), shape="flat", first_lens=FORMULA)
    with pytest.raises(CalibrationError, match="--lens kannala_brandt"):
        formula_from_pairs(fit, lens)


def test_a_formula_that_is_none_is_refused(exact):
    with pytest.raises(InputError, match="lens 'soap' is not known"):
        formula_from_pairs(exact, "soap")
    with pytest.raises(InputError, match="has no coefficient 'k9'"):
        formula_from_pairs(exact, "brown:k9")


def test_simpler_formulas_have_fewer_coefficients_to_find():
    assert by_simplicity(("rational", "brown", "division", "brown:k1,k2", "kannala_brandt")) == (
        "division",
        "brown:k1,k2",
        "kannala_brandt",
        "brown",
        "rational",
    )
    assert by_simplicity(()) == ()
    assert by_simplicity(("fov", "division")) == (
        "division",
        "fov",
    )  # alike: by name, so that the same comes out each time


def test_the_nearest_formula_to_a_free_lens_is_its_base_where_its_displacement_is_nothing():
    free = camera_with(displaced(Brown(k1=-0.28, k2=0.09, p1=1e-3), (0.65, 0.5), 0.0))
    found = nearest_formula(free, rays_of(free), ("division", "brown", "kannala_brandt"))
    assert isinstance(found.lens, Brown)
    assert_allclose(found.project(rays_of(free)), free.project(rays_of(free)), atol=1e-6)


def test_the_nearest_formula_is_nearer_than_the_base_that_was_displaced():
    base = Brown(k1=-0.28, k2=0.09)
    free = camera_with(displaced(base, (0.65, 0.5), 0.002))
    rays = rays_of(free)

    def apart(camera: Camera) -> float:
        return float(((camera.project(rays) - free.project(rays)) ** 2).sum())

    found = nearest_formula(free, rays, ("brown", "division"))
    assert isinstance(found.lens, Brown)
    assert apart(found) < apart(camera_with(base))
    assert apart(found) <= min(apart(nearest_formula(free, rays, (name,))) for name in ("brown", "division"))


def test_a_formula_that_cannot_see_so_far_is_passed_over():
    wide = camera_with(displaced(KannalaBrandt(k1=-0.02), (2.0, 1.5), 0.003), WIDE.intrinsics)
    assert isinstance(nearest_formula(wide, rays_of(wide), ("brown", "kannala_brandt")).lens, KannalaBrandt)
    with pytest.raises(
        CalibrationError, match="none of brown, rational sees as far from the axis as this camera does"
    ):
        nearest_formula(wide, rays_of(wide), ("brown", "rational"))


def test_a_nearest_formula_is_one_of_those_that_were_named():
    free = camera_with(displaced(Brown(k1=-0.2), (0.65, 0.5), 0.001), K)
    assert isinstance(nearest_formula(free, rays_of(free), ("division",)).lens, Division)
