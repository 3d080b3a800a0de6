"""The field of view: closed forms, past 180 degrees, and where rays are missing."""

from __future__ import annotations

import numpy as np
from numpy.testing import assert_allclose

from orthoscope.models.camera import Camera
from orthoscope.models.intrinsics import Intrinsics
from orthoscope.models.lenses.table import Brown, KannalaBrandt
from orthoscope.report.field_of_view import field_of_view

CENTRED = Intrinsics(500.0, 500.0, 319.5, 239.5)


def test_a_pin_hole_has_the_textbooks_angles():
    half = np.arctan([320 / 500, 240 / 500, 400 / 500])
    assert_allclose(
        field_of_view(Camera((640, 480), CENTRED, Brown())), 2 * half, atol=1e-12
    )  # 512 angles summed


def test_an_off_centre_pin_hole_has_unequal_halves():
    camera = Camera((640, 480), Intrinsics(500.0, 500.0, 99.5, 239.5), Brown())
    assert_allclose(field_of_view(camera).horizontal, np.arctan(100 / 500) + np.arctan(540 / 500), atol=1e-12)


def test_an_equidistant_lens_passes_180_degrees():
    camera = Camera((640, 480), Intrinsics(160.0, 160.0, 319.5, 239.5), KannalaBrandt())
    assert_allclose(field_of_view(camera), [4.0, 3.0, 5.0], atol=1e-12)


def test_pixels_without_rays_add_nothing():
    camera = Camera(
        (640, 480), Intrinsics(100.0, 100.0, 319.5, 239.5), KannalaBrandt()
    )  # the row would need 6.4 rad; the chart ends at 2 pi
    assert 2 * np.pi - 0.03 < field_of_view(camera).horizontal < 2 * np.pi  # to a 512th of the row


def test_a_frame_that_no_ray_reaches_has_no_angles():
    camera = Camera((64, 48), Intrinsics(1.0, 1.0, 1e6, 1e6), KannalaBrandt())
    assert np.isnan(field_of_view(camera)).all()
