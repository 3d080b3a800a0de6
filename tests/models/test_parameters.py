"""Parameters by name: a step moves what is named and nothing else; slopes are differences."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.testing import assert_allclose

from helpers.laws import for_every_lens
from helpers.scenes import NARROW
from orthoscope.geometry.arrays import InputError
from orthoscope.models.camera import Camera
from orthoscope.models.intrinsics import Intrinsics
from orthoscope.models.lenses.lens import Lens
from orthoscope.models.parameters import FRAME, INTRINSICS, Parameters

K = Intrinsics(520.0, 540.0, 325.0, 236.0, 12.0)
OWN_FRAME = Intrinsics(500.0, 530.0, 340.0, 220.0, 3.0)
PLACES = np.array([0.1, -0.3, 0.25]), np.array([0.2, 0.05, -0.35])


@pytest.mark.parametrize("frame", [None, OWN_FRAME], ids=["K alone", "a frame of its own"])
@for_every_lens
def test_slopes_of_pixels_are_their_differences(lens: Lens, frame: Intrinsics | None):
    camera = Camera((640, 480), K, lens, frame)
    points = 1.7 * lens.chart.lift(*PLACES)
    free = Parameters.of((*INTRINSICS, *lens.names(), *(FRAME if frame else ())))
    image = camera.linearise(points.T, free)
    assert_allclose(np.stack([image.u, image.v], -1), camera.project(points, beyond=True), rtol=1e-12)
    for i, slope in enumerate(image.by_parameters()):
        step = 1e-6 * (np.arange(len(free)) == i)
        plus, minus = (free.moved(camera, sign * step).project(points, beyond=True) for sign in (1.0, -1.0))
        assert_allclose(slope.T, (plus - minus) / 2e-6, rtol=1e-6, atol=1e-6)
    for i, slope in enumerate(np.moveaxis(np.array(image.by_point), 1, 0)):
        step = 1e-6 * np.eye(3)[i]
        plus, minus = (camera.project(points + sign * step, beyond=True) for sign in (1.0, -1.0))
        assert_allclose(slope.T, (plus - minus) / 2e-6, rtol=1e-6, atol=1e-5)


def test_a_step_moves_what_is_named_and_what_is_tied_to_it():
    free = Parameters.of(("fx=frame_scale", "cx", "k1=k2"))
    camera = Camera((640, 480), K, NARROW.lens, OWN_FRAME)
    moved = free.moved(camera, np.array([7.0, -2.0, 0.01]))
    assert moved.intrinsics.as_tuple() == (527.0, 540.0, 323.0, 236.0, 12.0)
    assert moved.lens_frame is not None
    assert moved.lens_frame.as_tuple() == (507.0, 537.0, 340.0, 220.0, 3.0)
    assert_allclose(
        moved.lens.coefficients - camera.lens.coefficients,
        [0.01, 0.01, 0, 0, 0, 0, 0, 0, 0, 0, 0][: len(camera.lens.names())],
        atol=1e-15,
    )
    assert_allclose(free.values(moved) - free.values(camera), [7.0, -2.0, 0.01], atol=1e-12)


def test_a_focal_length_halves_where_a_step_would_turn_it_negative():
    moved = Parameters.of(("fx=fy", "k1")).moved(NARROW, np.array([-600.0, 0.1]))
    assert moved.intrinsics.as_tuple()[:2] == (260.0, 262.0)


def test_names_are_written_as_they_are_read_and_a_rig_s_camera_comes_first():
    assert Parameters.of(("fx=fy", "k1")).names == ("fx=fy", "k1")
    of_left = Parameters.of(("left:fx=fy", "left:k1"))
    assert (of_left.camera, of_left.names, of_left.singles) == (
        "left",
        ("left:fx=fy", "left:k1"),
        ("fx", "fy", "k1"),
    )
    assert of_left.only(INTRINSICS).names == ("left:fx=fy",)
    assert of_left.coefficients == ("k1",)
    with pytest.raises(InputError, match="belong to 2 cameras"):
        Parameters.of(("left:fx", "right:fx"))
