"""A lens from pairs: what is met exactly, by which formula, and what is a convention."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from numpy.testing import assert_allclose

from orthoscope.fitting.lens_fit import FOCAL, converted, fit_lens
from orthoscope.geometry.arrays import CalibrationError, InputError
from orthoscope.methods.mldc.lens_about_centre import (
    _columns,
    _moved,
    fit_centred_lens,
    paired_parameters,
    parse_centred_lens,
    polynomial_of_radii,
)
from orthoscope.models.camera import Camera
from orthoscope.models.difference import frame_grid
from orthoscope.models.intrinsics import Intrinsics
from orthoscope.models.lenses.table import Brown, Division, Fet, Fov, KannalaBrandt, Pfet, Rational

SIZE = (640, 480)
K = Intrinsics(750.0, 740.0, 320.0, 240.0, 2.0)
L = Intrinsics(
    745.0, 745.0, 305.0, 257.0
)  # of the mean focal length of K, as the fit has it: a lens of the angle can then be met exactly
LENSES = {
    "pfet": Pfet(a1=0.97, a2=-0.02, a3=-0.25, a4=0.05, a5=0.02),
    "brown": Brown(k1=-0.2, k2=0.05, k3=0.01),
    "rational": Rational(k1=0.3, k2=0.1, k4=0.5, k5=0.2),
    "fet": Fet(scale=0.9, l=1.2),
    "fov": Fov(w=0.8),
    "division": Division(l=-0.2),
    "kannala_brandt": KannalaBrandt(k1=-0.02, k2=0.003),
}
every_lens = pytest.mark.parametrize("name", LENSES)


def pairs(camera):
    """Rays over the frame, and their pixels."""
    pixels = frame_grid(camera.image_size, 21, 16)
    rays = camera.unproject(pixels)
    return rays[np.isfinite(rays[:, 0])], pixels[np.isfinite(rays[:, 0])]


def camera_with(name):
    return Camera(SIZE, K, LENSES[name], lens_frame=L)


@every_lens
def test_a_lens_is_recovered_from_pairs_with_its_centre(name):
    rays, pixels = pairs(camera_with(name))
    fit = fit_centred_lens(rays, pixels, pinhole=Camera(SIZE, K, Brown()), lens=name)
    assert_allclose(
        fit.unknowns.project(rays), pixels, atol=1e-6
    )  # what is promised; converged fits are nearer by far
    assert_allclose(fit.unknowns.lens_frame.as_tuple()[2:4], (305.0, 257.0), atol=1e-3)


@every_lens
def test_the_size_of_the_straight_image_is_a_convention_that_pairs_do_not_feel(name):
    stretched = Intrinsics(1.05 * K.fx, 1.05 * K.fy, 305 + 1.05 * 15, 257 - 1.05 * 17, 1.05 * K.skew)
    rays, pixels = pairs(camera_with(name))
    fit = fit_centred_lens(rays, pixels, pinhole=Camera(SIZE, stretched, Brown()), lens=name)
    assert_allclose(
        fit.unknowns.project(rays), pixels, atol=1e-5
    )  # kannala_brandt's frame has the wrong scale then: 1e-6 px here


def test_pfet_keeps_the_pin_hole_and_lenses_of_slope_one_stretch_it():
    stretched = Camera(SIZE, Intrinsics(825.0, 814.0, 305 + 1.1 * 15, 257 - 1.1 * 17, 2.2), Brown())
    kept = fit_centred_lens(*pairs(camera_with("pfet")), pinhole=stretched, lens="pfet").unknowns
    moved = fit_centred_lens(*pairs(camera_with("brown")), pinhole=stretched, lens="brown").unknowns
    assert_allclose(kept.intrinsics.as_tuple(), stretched.intrinsics.as_tuple(), rtol=1e-14)
    assert_allclose(kept.lens.a1, 0.97 / 1.1, atol=1e-9)
    assert_allclose(
        moved.intrinsics.as_tuple(), K.as_tuple(), atol=1e-6
    )  # as far as a converged fit leaves the centre open


@every_lens
def test_the_columns_of_a_centred_lens_are_derivatives(name):
    free = (*LENSES[name].names()[1:], "stretch", "centre_x", "centre_y")
    rays, _ = pairs(camera_with(name))
    camera = _moved(camera_with(name), ("stretch", "centre_x"), np.array([0.05, 3.0]), K=K)
    columns, _ = _columns(camera, rays, free, K=K)
    for i, parameter in enumerate(free):
        step = np.where(np.arange(len(free)) == i, 1e-6, 0.0)
        ahead, back = (
            _columns(_moved(camera, free, sign * step, K=K), rays, free, K=K)[1] for sign in (1, -1)
        )
        difference = (ahead - back) / 2e-6
        assert_allclose(
            columns[i], difference, atol=1e-6 * (1 + np.abs(difference).max()), err_msg=parameter
        )  # rounding over the step


def test_the_closed_form_finds_the_polynomial_where_the_printed_normal_equations_lose_it():
    powers, true = (
        tuple(range(6)),
        np.array([0.0, 1.0, -1e-4, -4e-7, 1e-10, 1e-13]),
    )  # radii in pixels, as eq. (10) has them
    straight = np.linspace(1.0, 400.0, 500)
    distorted = straight[:, None] ** np.array(powers) @ true
    W = straight[:, None] ** np.array(powers)
    printed = np.linalg.solve(W.T @ W, W.T @ distorted)
    ours = polynomial_of_radii(straight, distorted, powers=powers)
    assert_allclose(W @ ours, distorted, atol=1e-10)
    assert np.abs(W @ printed - distorted).max() > 100 * np.abs(W @ ours - distorted).max()


def test_a_ring_is_found_when_it_is_asked_for():
    camera = replace(camera_with("pfet"), lens=Pfet(a0=0.02, a2=-0.02, a3=-0.2))
    rays, pixels = pairs(camera)
    asked = fit_centred_lens(
        rays, pixels, pinhole=Camera(SIZE, K, Brown()), lens="pfet:a0,a1,a2,a3,a4,a5"
    ).unknowns
    assert_allclose(asked.project(rays), pixels, atol=1e-6)
    silent = fit_centred_lens(rays, pixels, pinhole=Camera(SIZE, K, Brown()), lens="pfet").unknowns
    assert silent.lens.a0 == 0.0


def test_decentering_asked_for_by_name_takes_the_centre_s_place():
    kind, coefficients = parse_centred_lens("brown:k1,k2,p1,p2")
    assert paired_parameters(kind, coefficients) == ("k1", "k2", "p1", "p2", "stretch")
    assert paired_parameters(*parse_centred_lens("brown")) == (
        "k1",
        "k2",
        "k3",
        "stretch",
        "centre_x",
        "centre_y",
    )


def test_auto_is_the_papers_lens():
    assert parse_centred_lens("auto") == parse_centred_lens("pfet")


def test_a_lens_that_is_none_is_refused():
    with pytest.raises(InputError, match="not known"):
        fit_centred_lens(*pairs(camera_with("brown")), pinhole=Camera(SIZE, K, Brown()), lens="bronw")


def test_a_lens_of_the_plane_is_not_fitted_to_rays_beside_the_camera():
    rays = np.array([[0.0, 0.0, 1.0], [1.0, 0.0, 0.1], [1.0, 0.0, -0.1], [0.0, 1.0, 0.2], [0.3, 0.2, 1.0]])
    with pytest.raises(CalibrationError, match="kannala_brandt"):
        fit_centred_lens(rays, 100.0 * rays[:, :2], pinhole=Camera(SIZE, K, Brown()), lens="brown")


def test_a_camera_turned_into_its_own_formula_stays_itself():
    camera = Camera(SIZE, K, Brown(k1=-0.2, k2=0.05, p1=1e-3, p2=-1e-3))
    rays, pixels = pairs(camera)
    assert_allclose(converted(camera, Brown, rays).project(rays), pixels, atol=1e-8)


def test_pinhole_and_lens_are_recovered_together_from_pairs():
    camera = Camera(SIZE, replace(K, skew=0.0), Brown(k1=-0.2, k2=0.05))
    rays, pixels = pairs(camera)
    fit = fit_lens(
        rays, pixels, Camera(SIZE, Intrinsics(700.0, 700.0, 310.0, 250.0), Brown()), (*FOCAL, "k1", "k2")
    )
    assert_allclose(fit.unknowns.intrinsics.as_tuple(), camera.intrinsics.as_tuple(), atol=1e-8)
