"""The camera: projection and its inverse, lens frames, and the maps that straighten photographs."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_less

from helpers.laws import for_every_lens, rays_over
from orthoscope.geometry.arrays import InputError
from orthoscope.models.camera import Camera, image_border
from orthoscope.models.intrinsics import Intrinsics
from orthoscope.models.lenses.table import Brown, Division, Fov, KannalaBrandt

SIZE = (640, 480)
INTRINSICS = Intrinsics(500.0, 510.0, 310.0, 245.0, skew=0.7)
LENS_FRAME = Intrinsics(480.0, 530.0, 330.0, 220.0, skew=-0.4)
FOR_BOTH_FRAMES = pytest.mark.parametrize("lens_frame", [None, LENS_FRAME], ids=["own frame", "lens frame"])
MILD = Brown(k1=-0.2, k2=0.05, p1=1e-3, p2=-5e-4)
FOLDING = Brown(k1=-0.5)  # its domain ends at s = 0.82, r_d = 0.54: inside a wide image


def pixel_grid(columns: int = 17, rows: int = 13) -> np.ndarray:
    return np.stack(np.meshgrid(np.linspace(0, 639, columns), np.linspace(0, 479, rows)), axis=-1).reshape(
        -1, 2
    )


def test_a_point_on_the_axis_is_seen_at_the_principal_point():
    camera = Camera(SIZE, INTRINSICS, MILD)
    assert_allclose(camera.project(np.array([[0.0, 0.0, 2.0]])), [[310.0, 245.0]], atol=1e-12)


def test_a_worked_example_of_the_steps():
    # x = 0.2, y = 0.1: s^2 = 0.05, g = 1 - 0.2 * 0.05 = 0.99; u = 500 * 0.198 + 0.7 * 0.099 + 310, v = 510 *
    # 0.099 + 245
    camera = Camera(SIZE, INTRINSICS, Brown(k1=-0.2))
    assert_allclose(camera.project(np.array([[0.4, 0.2, 2.0]])), [[409.0693, 295.49]], atol=1e-10)


@FOR_BOTH_FRAMES
def test_project_inverts_unproject(lens_frame):
    camera = Camera(SIZE, INTRINSICS, MILD, lens_frame)
    rays = camera.unproject(pixel_grid())
    assert_allclose(np.linalg.norm(rays, axis=1), 1.0, atol=1e-14)
    assert_allclose(camera.project(rays), pixel_grid(), atol=1e-10)  # 1e-16 of 500 px, times Newton's 1e-13


@for_every_lens
def test_unproject_inverts_project_for_every_lens(lens):
    rays = rays_over(lens, last=0.99)
    pixels = Camera(SIZE, INTRINSICS, lens).project(rays)
    apart = np.hypot(*(pixels - [INTRINSICS.cx, INTRINSICS.cy]).T) > 1e-3 * (
        lens.domain.hole > 0
    )  # a hole's rim is one pixel
    seen = np.isfinite(pixels).all(axis=1) & apart
    assert_allclose(
        Camera(SIZE, INTRINSICS, lens).unproject(pixels[seen]), rays[seen], atol=1e-11
    )  # rounding of 500 px and more


@for_every_lens
def test_pixels_all_over_a_large_image_come_back_to_a_billionth(lens):
    size, centre = (4000, 3000), np.array([2000.0, 1500.0])
    camera = Camera(size, Intrinsics(2400.0, 2400.0, *centre), lens)
    pixels = np.random.default_rng(0).uniform([0.0, 0.0], size, (40_000, 2))  # several blocks
    rays = camera.unproject(pixels)
    seen = np.isfinite(rays).all(axis=1)
    assert seen.mean() > 0.05
    assert_allclose(camera.project(rays[seen], beyond=True), pixels[seen], atol=1e-9)


@pytest.mark.parametrize(
    "lens",
    [FOLDING, Brown(k1=-0.5, p1=1e-3, p2=-2e-3), KannalaBrandt(k1=-0.2)],
    ids=["brown", "decentred", "angle"],
)
def test_of_many_pixels_those_past_the_fold_have_no_ray(lens):
    camera = Camera((2000, 1500), Intrinsics(1000.0, 1000.0, 1000.0, 750.0), lens)
    pixels = np.random.default_rng(0).uniform([0.0, 0.0], (2000, 1500), (40_000, 2))
    seen = np.isfinite(camera.unproject(pixels)).all(axis=1)
    phi = np.linspace(-np.pi, np.pi, 200)
    s = 0.9999 * np.interp(phi, lens.domain.angles, lens.domain.ends)
    reach = np.hypot(*(camera.project(lens.chart.lift(s * np.cos(phi), s * np.sin(phi))) - [1000.0, 750.0]).T)
    radius = np.hypot(*(pixels - [1000.0, 750.0]).T)
    assert seen[radius < 0.999 * reach.min()].all()
    assert not seen[radius > 1.01 * reach.max()].any()
    assert 0.1 < seen.mean() < 0.9


def test_a_lens_frame_equal_to_the_intrinsics_changes_nothing():
    points = np.array([[0.1, -0.2, 1.0], [0.4, 0.3, 1.5], [0.0, 0.0, 1.0]])
    plain, framed = Camera(SIZE, INTRINSICS, MILD), Camera(SIZE, INTRINSICS, MILD, INTRINSICS)
    assert_allclose(framed.project(points), plain.project(points), atol=1e-11)


def test_without_distortion_a_lens_frame_changes_nothing():
    points = np.array([[0.1, -0.2, 1.0], [0.4, 0.3, 1.5]])
    assert_allclose(
        Camera(SIZE, INTRINSICS, Brown(), LENS_FRAME).project(points),
        Camera(SIZE, INTRINSICS, Brown()).project(points),
        atol=1e-11,
    )


def test_with_a_lens_frame_the_distortion_is_about_its_own_centre():
    camera = Camera(SIZE, INTRINSICS, Brown(k1=-0.2), LENS_FRAME)
    centre = np.array([[LENS_FRAME.cx, LENS_FRAME.cy]])
    assert_allclose(camera.undistort_pixels(centre), centre, atol=1e-10)


@FOR_BOTH_FRAMES
def test_distort_pixels_inverts_undistort_pixels(lens_frame):
    camera = Camera(SIZE, INTRINSICS, MILD, lens_frame)
    for straight in (None, Intrinsics(300.0, 300.0, 320.0, 240.0)):
        assert_allclose(
            camera.distort_pixels(camera.undistort_pixels(pixel_grid(), straight), straight),
            pixel_grid(),
            atol=1e-10,
        )


def test_what_lies_past_90_degrees_has_no_straight_pixel():
    camera = Camera(SIZE, Intrinsics(150.0, 150.0, 320.0, 240.0), KannalaBrandt())
    pixel = np.array([[320.0 + 150.0 * 1.6, 240.0]])  # 92 degrees
    assert np.isfinite(camera.unproject(pixel)).all()
    assert np.isnan(camera.undistort_pixels(pixel)).all()


def test_the_map_says_where_each_straight_pixel_was():
    camera, straight = Camera(SIZE, INTRINSICS, MILD), Intrinsics(450.0, 450.0, 200.0, 150.0)
    map_x, map_y = camera.undistort_map(straight, size=(400, 300))
    assert map_x.shape == map_y.shape == (300, 400)
    assert map_x.dtype == map_y.dtype == np.float32
    expected = camera.distort_pixels(np.array([[7.0, 3.0], [200.0, 150.0], [399.0, 299.0]]), straight)
    found = np.array(
        [[map_x[3, 7], map_y[3, 7]], [map_x[150, 200], map_y[150, 200]], [map_x[299, 399], map_y[299, 399]]]
    )
    assert_allclose(found, expected, atol=1e-4)  # float32 at 640


def test_the_map_is_black_beyond_the_domain_and_never_folds():
    camera = Camera(SIZE, Intrinsics(300.0, 300.0, 319.5, 239.5), FOLDING)
    map_x, map_y = camera.undistort_map(Intrinsics(200.0, 200.0, 319.5, 239.5))
    seen = np.isfinite(map_x)
    assert (seen == np.isfinite(map_y)).all()
    y, x = np.nonzero(seen)
    s = np.hypot(x - 319.5, y - 239.5) / 200.0
    assert seen[240, 320]
    assert_array_less(s, np.sqrt(1.0 / 1.5) + 1e-6)  # 1 + 3 k1 s^2 = 0
    order = np.argsort(s)
    radius = np.hypot(map_x[seen] - 319.5, map_y[seen] - 239.5)[order]
    assert_array_less(
        -1e-3, np.diff(radius)
    )  # farther out in the straight image is farther out in the photograph, to float32


def test_the_map_is_black_outside_the_photograph():
    map_x, map_y = Camera(SIZE, INTRINSICS, Brown()).undistort_map(Intrinsics(100.0, 100.0, 319.5, 239.5))
    seen = np.isfinite(map_x)
    assert 0 < seen.sum() < seen.size
    assert map_x[seen].min() >= -1.0
    assert map_x[seen].max() <= 640.0
    assert map_y[seen].max() <= 480.0


STRAIGHTENED = {
    "barrel": Camera(SIZE, Intrinsics(500.0, 510.0, 310.0, 245.0), MILD),
    "pincushion": Camera(SIZE, Intrinsics(500.0, 510.0, 310.0, 245.0), Brown(k1=0.2)),
    "fov": Camera(SIZE, Intrinsics(300.0, 300.0, 320.0, 240.0), Fov(w=0.9)),
    "division": Camera(SIZE, Intrinsics(400.0, 400.0, 320.0, 240.0), Division(l=-0.3)),
    "lens frame": Camera(
        SIZE, Intrinsics(500.0, 510.0, 310.0, 245.0), MILD, Intrinsics(500.0, 510.0, 330.0, 230.0)
    ),
}
FOR_EVERY_STRAIGHTENED = pytest.mark.parametrize("camera", STRAIGHTENED.values(), ids=STRAIGHTENED.keys())


@FOR_EVERY_STRAIGHTENED
def test_keeping_all_shows_every_photographed_pixel(camera):
    straight = camera.straight_intrinsics("all")
    border = camera.undistort_pixels(image_border(SIZE), straight)
    last = np.array(SIZE) - 1.0
    assert ((border > -1e-6) & (border < last + 1e-6)).all()
    spans = np.ptp(border, axis=0) / last
    assert spans.max() == pytest.approx(1.0)  # nothing wasted but what the aspect asks for
    assert_allclose(border.min(0) + border.max(0), last, atol=1e-6)


@FOR_EVERY_STRAIGHTENED
def test_keeping_the_valid_shows_nothing_but_photographed_pixels(camera):
    straight = camera.straight_intrinsics("valid")
    border = camera.distort_pixels(image_border(SIZE), straight)
    assert ((border >= 0.0) & (border <= np.array(SIZE) - 1.0)).all()


def test_a_fisheye_is_kept_to_the_widest_angle():
    camera = Camera(SIZE, Intrinsics(150.0, 150.0, 320.0, 240.0), KannalaBrandt())
    straight = camera.straight_intrinsics("all", widest=np.deg2rad(70.0))
    rays = np.array([[np.sin(1.2), 0.0, np.cos(1.2)]])  # 69 degrees
    assert_array_less(straight.to_pixels(rays[:, :2] / rays[:, 2:])[:, 0], 640.0)
    down = straight.to_pixels(np.array([[0.0, np.tan(np.deg2rad(70.0))]]))[0, 1]
    assert down == pytest.approx(
        479.0, abs=0.5
    )  # the shorter side has the angle, the longer keeps the aspect


def test_another_word_for_keep_is_refused():
    with pytest.raises(InputError, match=r"keep is 'some'; expected 'all' .* or 'valid'"):
        Camera(SIZE, INTRINSICS, MILD).straight_intrinsics("some")


def test_pixels_and_places_of_the_plane_are_inverse():
    assert_allclose(INTRINSICS.to_pixels(INTRINSICS.to_plane(pixel_grid())), pixel_grid(), atol=1e-12)


def test_intrinsics_are_the_matrix():
    place = np.array([[0.3, -0.2]])
    assert_allclose(INTRINSICS.to_pixels(place)[0], (INTRINSICS.matrix @ [0.3, -0.2, 1.0])[:2], atol=1e-12)


@pytest.mark.parametrize("wrong", [(0.0, 500.0), (500.0, -1.0)])
def test_a_focal_length_that_is_not_positive_is_refused(wrong):
    with pytest.raises(InputError, match="expected positive"):
        Intrinsics(*wrong, 320.0, 240.0)


def test_intrinsics_that_are_not_finite_are_refused():
    with pytest.raises(InputError, match="expected finite numbers"):
        Intrinsics(500.0, 500.0, float("nan"), 240.0)


def test_an_image_without_size_is_refused():
    with pytest.raises(InputError, match=r"expected \(width, height\)"):
        Camera((640, 0), INTRINSICS, MILD)


def test_the_border_goes_round_the_image_once():
    border = image_border((5, 4), samples=2)
    assert_allclose(border, [[0, 0], [2, 0], [4, 0], [4, 1.5], [4, 3], [2, 3], [0, 3], [0, 1.5]])


PIXELS = np.array([[0.0, 0.0], [100.0, 50.0], [639.0, 479.0], [320.5, 7.25]])
RESIZABLE = Camera(
    SIZE, Intrinsics(500.0, 501.0, 320.0, 240.0, 0.3), MILD, Intrinsics(505.0, 503.0, 318.0, 243.0)
)


def test_a_resized_camera_sees_what_scaled_photographs_show():
    half = RESIZABLE.resized((320, 160))
    assert half.image_size == (320, 160)
    scale = np.array([320 / SIZE[0], 160 / SIZE[1]])
    assert_allclose(half.unproject((PIXELS + 0.5) * scale - 0.5), RESIZABLE.unproject(PIXELS), atol=1e-12)


def test_a_cropped_camera_sees_what_the_part_shows():
    part = RESIZABLE.cropped(60, 30, (200, 100))
    assert part.image_size == (200, 100)
    assert_allclose(part.unproject(PIXELS - np.array([60, 30])), RESIZABLE.unproject(PIXELS), atol=1e-12)


def test_a_binned_camera_sees_the_middle_of_each_block_and_cuts_what_is_left_over():
    binned = RESIZABLE.binned(7)
    assert binned.image_size == (SIZE[0] // 7, SIZE[1] // 7)
    middles = np.array([[3.0, 3.0], [10.0, 73.0]])  # of the first block, and of another
    assert_allclose(binned.unproject((middles - 3.0) / 7.0), RESIZABLE.unproject(middles), atol=1e-12)


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (lambda camera: camera.resized((0, 100)), r"the size is 0x100"),
        (lambda camera: camera.cropped(-1, 0, (10, 10)), r"is not within an image of"),
        (lambda camera: camera.cropped(0, 0, (10_000, 10)), r"is not within an image of"),
        (lambda camera: camera.binned(0), r"binning by 0 is not possible"),
        (lambda camera: camera.binned(100_000), r"binning by 100000 is not possible"),
        (lambda camera: camera.resized((10**7, 10)), r"1 to 1000000 pixels each"),
    ],
)
def test_a_size_that_cannot_be_is_refused(change, message):
    with pytest.raises(InputError, match=message):
        change(RESIZABLE)
