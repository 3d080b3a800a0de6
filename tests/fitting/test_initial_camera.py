"""Where calibrations start: near enough for any field of view, and without coefficients that nobody asked
for.
"""

from __future__ import annotations

import numpy as np
import pytest
from numpy.testing import assert_allclose

from helpers.scenes import BOARD, NARROW, WIDE, camera_with, facing, photographed, seen
from orthoscope.fitting.observations import Observations
from orthoscope.fitting.starts.initial_camera import (
    FIELDS_OF_VIEW,
    Assumptions,
    StartingCameras,
    starts,
    suited_lens,
)
from orthoscope.geometry.arrays import CalibrationError
from orthoscope.models.camera import Camera
from orthoscope.models.intrinsics import Intrinsics
from orthoscope.models.lenses.table import LENSES, Brown, KannalaBrandt, Rational
from orthoscope.targets.detections import Detections


def bases_of(detections: Detections, *, skew: bool = False) -> StartingCameras:
    narrowing = Assumptions.of(len(detections.views), skew=skew)
    return StartingCameras(Observations.of(detections), BOARD.points, detections.image_size, narrowing)


def test_without_distortion_and_noise_the_pinhole_is_the_answer():
    camera = camera_with(Brown())
    bases = bases_of(photographed(camera, 5))
    assert bases.pinhole is not None
    assert_allclose(
        bases.pinhole.camera.intrinsics.as_tuple(), camera.intrinsics.as_tuple(), atol=1e-7
    )  # closed form: rounding, amplified
    assert bases.misfit(bases.pinhole) < 1e-6
    assert bases.pinhole_fits


@pytest.mark.parametrize("field", [10.0, 25.0, 50.0, 90.0, 130.0, 170.0, 210.0, 240.0])
def test_the_angle_base_is_near_for_any_field_of_view(field):
    focal = np.hypot(640, 480) / np.deg2rad(field)
    camera = Camera((640, 480), Intrinsics(focal, focal, 330.0, 230.0), KannalaBrandt())
    angle = bases_of(photographed(camera, 8, fill=(0.4, 0.7), noise_px=0.1)).angle
    assert angle is not None
    assert (
        0.7 < angle.camera.intrinsics.fx / focal < 1.4
    )  # the fields that are tried grow by a third to a half, the narrow ones faster
    assert np.degrees(FIELDS_OF_VIEW).min() < field < np.degrees(FIELDS_OF_VIEW).max()


@pytest.mark.parametrize(
    ("camera", "lens"), [(NARROW, "brown"), (WIDE, "kannala_brandt")], ids=["narrow", "wide"]
)
def test_the_lens_for_someone_who_names_none_follows_the_field_of_view(camera, lens):
    assert suited_lens(bases_of(photographed(camera, 6, noise_px=0.3))) == lens


def test_starts_come_the_likelier_first():
    bases = bases_of(photographed(WIDE, 6))
    assert bases.angle is not None
    assert (
        next(starts(bases, KannalaBrandt)).camera.intrinsics.as_tuple()
        == bases.angle.camera.intrinsics.as_tuple()
    )


def test_rational_starts_in_two_valleys_that_both_make_no_distortion():
    zero, rival = starts(bases_of(photographed(camera_with(Brown()), 5)), Rational)
    rays = NARROW.unproject(np.array([[10.0, 20.0], [600.0, 400.0]]))
    assert zero.camera.lens.coefficients.tobytes() != rival.camera.lens.coefficients.tobytes()
    assert_allclose(zero.camera.project(rays), rival.camera.project(rays), rtol=1e-12)


@pytest.mark.parametrize("coefficients", [(), ("k1", "k2"), ("k4",)])
def test_a_valley_that_needs_other_coefficients_than_those_asked_for_is_left_out(coefficients):
    (only,) = starts(bases_of(photographed(camera_with(Brown()), 5)), Rational, coefficients=coefficients)
    assert not only.camera.lens.coefficients.any()


@pytest.mark.parametrize(
    ("views", "skew", "free"),
    [
        (1, True, ("fx=fy",)),
        (2, True, ("fx", "fy", "cx", "cy")),
        (3, False, ("fx", "fy", "cx", "cy")),
        (3, True, ("fx", "fy", "cx", "cy", "skew")),
    ],
)
def test_what_so_few_views_cannot_tell_does_not_move(views, skew, free):
    narrowing = Assumptions.of(views, skew=skew)
    assert narrowing.free == free
    assert bool(narrowing.assumptions) == (views < 3)


def test_parallel_views_have_no_closed_form_but_a_start():
    bases = bases_of(seen(camera_with(Brown()), facing(5, np.eye(3))))
    assert bases.angle is not None
    assert next(starts(bases, Brown))


@pytest.mark.parametrize("lens", LENSES.values())
def test_pixels_that_are_no_image_of_a_plane_start_nothing(lens):
    detections = photographed(NARROW, 3)
    far = tuple(type(view)(view.image, view.ids, 1e9 * view.pixels) for view in detections.views)
    with pytest.raises(CalibrationError, match="fit no camera at all"):
        next(starts(bases_of(Detections(BOARD, detections.image_size, far)), lens))
