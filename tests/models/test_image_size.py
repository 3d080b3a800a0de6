"""A camera answers for photographs of its own size, and says what to do with others."""

from __future__ import annotations

import pytest

from orthoscope.geometry.arrays import InputError
from orthoscope.models.camera import Camera
from orthoscope.models.image_size import check_image_size, of_another_size
from orthoscope.models.intrinsics import Intrinsics
from orthoscope.models.lenses.table import Brown

CAMERA = Camera((1280, 960), Intrinsics(900.0, 900.0, 640.0, 480.0), Brown())


def test_photographs_of_its_own_size_are_right():
    assert of_another_size(CAMERA, (1280, 960)) == ""
    check_image_size(CAMERA, (1280, 960))


@pytest.mark.parametrize(
    ("size", "advice"),
    [((640, 480), "--resize 640x480"), ((427, 320), "--resize 427x320"), ((960, 960), "--crop")],
)
def test_of_another_size_the_advice_says_how_the_camera_is_changed(size, advice):
    with pytest.raises(InputError, match=advice):
        check_image_size(CAMERA, size)
