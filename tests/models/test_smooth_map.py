"""Maps that are interpolated between few places are as good as float32, and end where they would end if every
pixel were asked.
"""

from __future__ import annotations

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal

from helpers.laws import for_every_lens
from orthoscope.models.camera import Camera
from orthoscope.models.intrinsics import Intrinsics
from orthoscope.models.lenses.free import FreeLens
from orthoscope.models.lenses.spline import Displacement, Lattice
from orthoscope.models.lenses.table import Brown
from orthoscope.models.smooth_map import TOLERANCE_PX, smooth_map

SIZE = (333, 260)  # no multiple of a tile
# px: float32 sums of numbers up to 1000 px, as tiles have that reach out of the photograph, round by 6e-5
AS_FLOAT32 = 8e-5


def everywhere(pixels):
    return np.ones(len(pixels), dtype=bool)


def asked_for_each(camera: Camera, straight: Intrinsics, size: tuple[int, int]) -> np.ndarray:
    """The map as its docstring has it, pixel by pixel."""
    pixels = (
        np.stack(np.meshgrid(np.arange(size[0]), np.arange(size[1])), axis=-1).reshape(-1, 2).astype(float)
    )
    places = camera.distort_pixels(pixels, straight)
    outside = ((places < -1.0) | (places > np.array(camera.image_size))).any(axis=1)
    places[outside] = np.nan
    return places.T.reshape(2, size[1], size[0])


@for_every_lens
@pytest.mark.parametrize("focal", [60.0, 250.0], ids=["wide", "narrow"])
def test_every_lens_is_mapped_as_if_each_pixel_had_been_asked(lens, focal):
    camera, straight = (
        Camera(SIZE, Intrinsics(250.0, 255.0, 160.0, 131.0, skew=0.5), lens),
        Intrinsics(focal, focal, 170.0, 125.0),
    )
    exact = asked_for_each(camera, straight, SIZE)
    maps = np.stack(camera.undistort_map(straight))
    assert_array_equal(np.isnan(maps), np.isnan(exact))
    assert_allclose(maps, exact, atol=TOLERANCE_PX + AS_FLOAT32)


def test_a_usual_lens_is_mapped_as_well_as_float32_can_say():
    camera = Camera(SIZE, Intrinsics(250.0, 255.0, 160.0, 131.0), Brown(-0.28, 0.09, 8e-4, -5e-4, -0.01))
    assert_allclose(
        np.stack(camera.undistort_map()), asked_for_each(camera, camera.intrinsics, SIZE), atol=AS_FLOAT32
    )


def test_a_lens_about_its_own_centre_is_mapped_as_if_each_pixel_had_been_asked():
    frame = Intrinsics(240.0, 260.0, 175.0, 110.0)
    camera = Camera(SIZE, Intrinsics(250.0, 250.0, 160.0, 131.0), Brown(k1=-0.2, p1=1e-3), frame)
    exact = asked_for_each(camera, camera.intrinsics, (400, 300))
    maps = np.stack(camera.undistort_map(size=(400, 300)))
    assert_array_equal(np.isnan(maps), np.isnan(exact))
    assert_allclose(maps, exact, atol=TOLERANCE_PX + AS_FLOAT32)


def test_a_free_lens_is_mapped_to_a_thousandth_of_a_pixel():
    lattice = Lattice.over(np.array([-0.7, -0.6]), np.array([0.7, 0.6]), (7, 5))
    waves = (
        2.0 / 250.0 * np.random.default_rng(0).normal(size=(lattice.splines, 2))
    )  # 2 px from one cell to the next
    camera = Camera(
        SIZE, Intrinsics(250.0, 250.0, 160.0, 131.0), FreeLens(Brown(k1=-0.2), Displacement(lattice, waves))
    )
    exact = asked_for_each(camera, camera.intrinsics, SIZE)
    maps = np.stack(camera.undistort_map())
    assert_array_equal(np.isnan(maps), np.isnan(exact))
    assert_allclose(maps, exact, atol=TOLERANCE_PX + AS_FLOAT32)


def test_few_pixels_of_a_smooth_map_are_asked_for():
    asked = []

    def look(pixels):
        asked.append(len(pixels))
        return pixels + 2.0 * np.sin(pixels / 100.0)

    maps = smooth_map(look, (1920, 1080), vouched=everywhere, limits=(1930, 1090))
    assert sum(asked) < 0.03 * 1920 * 1080
    assert maps[0].shape == (1080, 1920)


def test_a_crease_is_asked_pixel_by_pixel():
    def look(pixels):
        return pixels + np.abs(pixels[:, :1] - 100.3) * [1.0, 0.5]

    map_x, map_y = smooth_map(look, SIZE, vouched=everywhere, limits=(1000, 1000))
    x, y = np.meshgrid(np.arange(SIZE[0]), np.arange(SIZE[1]))
    assert_allclose(map_x, x + np.abs(x - 100.3), atol=AS_FLOAT32)
    assert_allclose(map_y, y + 0.5 * np.abs(x - 100.3), atol=AS_FLOAT32)


def test_what_nobody_vouches_for_is_asked_even_where_it_looks_smooth():
    hole = np.array([130.0, 77.0])  # between the places at which polynomials are tried

    def look(pixels):
        return np.where((pixels == hole).all(axis=1, keepdims=True), np.nan, pixels)

    map_x, map_y = smooth_map(look, SIZE, vouched=lambda pixels: pixels[:, 0] > 256.0, limits=SIZE)
    assert np.argwhere(np.isnan(map_x)).tolist() == np.argwhere(np.isnan(map_y)).tolist() == [[77, 130]]


def test_the_smallest_image_has_a_map():
    map_x, map_y = smooth_map(lambda pixels: pixels + 0.25, (1, 1), vouched=everywhere, limits=(4, 4))
    assert map_x.tolist() == map_y.tolist() == [[0.25]]
