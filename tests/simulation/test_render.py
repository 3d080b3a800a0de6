"""Rendered photographs: they show what the camera projects, to a small part of a pixel and of a
grey level.
"""

from __future__ import annotations

from typing import Any

import cv2
import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal

from orthoscope.geometry.arrays import InputError
from orthoscope.geometry.pose import Pose, rotation_from_vector
from orthoscope.models.camera import Camera
from orthoscope.models.intrinsics import Intrinsics
from orthoscope.models.lenses.table import Brown, KannalaBrandt, Rational
from orthoscope.simulation import render as rendering
from orthoscope.simulation.render import (
    BACKGROUND_LEVEL,
    BLACK_LEVEL,
    MID_GREY_LEVEL,
    WHITE_LEVEL,
    Renderer,
    demo_scene,
    render,
    rendered_photographs,
)
from orthoscope.simulation.scene import Scene, random_views
from orthoscope.targets.target import Target, chessboard

BARE: dict[str, Any] = {"blur_px": 0.0, "vignetting": 0.0, "noise": 0.0, "light": 0.0}
CAMERAS = {
    "narrow": Camera((320, 240), Intrinsics(750.0, 750.0, 160.0, 120.0), Brown(k1=-0.1)),
    "normal": Camera(
        (320, 240), Intrinsics(225.0, 226.0, 163.0, 118.0), Brown(k1=-0.28, k2=0.09, p1=0.0008, p2=-0.0006)
    ),
    "own distortion centre": Camera(
        (320, 240),
        Intrinsics(375.0, 375.0, 160.0, 120.0),
        Rational(k1=-0.3, k4=0.02),
        Intrinsics(375.0, 375.0, 152.0, 128.0),
    ),
    "fisheye": Camera((320, 360), Intrinsics(100.0, 100.0, 160.0, 180.0), KannalaBrandt(k1=-0.02, k2=0.003)),
}
CIRCLE = Camera(
    (240, 180), Intrinsics(42.0, 42.0, 121.0, 88.0), KannalaBrandt(k1=-0.02, k2=-0.01)
)  # its image ends inside the frame
PIN_HOLE = Camera((200, 160), Intrinsics(200.0, 200.0, 100.0, 80.0), Brown())
COLUMNS, ROWS = 6, 4
BOARD = chessboard(COLUMNS, ROWS, 0.03)

every_camera = pytest.mark.parametrize("camera", CAMERAS.values(), ids=CAMERAS.keys())


def rng(seed: int = 2) -> np.random.Generator:
    return np.random.default_rng(seed)


def facing(x: float, y: float, depth: float) -> Pose:
    return Pose(np.eye(3), np.array([x, y, depth]))


def by_many_rays(camera: Camera, pose: Pose, pixels: np.ndarray, per_side: int = 12) -> np.ndarray:
    """The mean over per_side^2 rays of each pixel, each traced onto the board by itself."""
    offset = (np.arange(per_side) + 0.5) / per_side - 0.5
    offsets = np.stack(np.meshgrid(offset, offset), axis=-1).reshape(-1, 2)
    target_from_camera = pose.inverse()
    rays = camera.unproject((pixels[:, None] + offsets).reshape(-1, 2)) @ target_from_camera.rotation.T
    reach = -target_from_camera.translation[2] / rays[:, 2]
    squares = (target_from_camera.translation + np.where(reach > 0, reach, np.nan)[:, None] * rays)[
        :, :2
    ] / 0.03
    on_sheet = ((squares > -2) & (squares < [COLUMNS + 1, ROWS + 1])).all(1)
    on_pattern = ((squares > -1) & (squares < [COLUMNS, ROWS])).all(1)
    black = on_pattern & (np.floor(squares).sum(1) % 2 == 0)
    return (
        np.where(black, BLACK_LEVEL, np.where(on_sheet, WHITE_LEVEL, BACKGROUND_LEVEL))
        .reshape(len(pixels), -1)
        .mean(1)
    )


@every_camera
def test_each_pixel_is_the_mean_of_the_rays_through_it(camera):
    pose = random_views(camera, BOARD, 1, rng=rng(), tilt=(0.5, 0.7))[0]
    pixels = rng().integers(0, camera.image_size, (1500, 2))
    difference = render(camera, BOARD, pose, **BARE)[pixels[:, 1], pixels[:, 0]] - by_many_rays(
        camera, pose, pixels
    )
    # 144 rays tell an edge of 185 grey levels to a twelfth of a pixel: 15 at worst; whole grey levels
    # add 0.29
    assert np.abs(difference).max() < 15
    assert np.sqrt((difference**2).mean()) < 0.5


def test_an_edge_within_a_pixel_gives_the_exact_mixture():
    # 20 px a square; corner 0 at (45.3, 42.75): column 45 is black's neighbour from 44.5 to 45.3, so
    # 0.8 of it
    image = render(PIN_HOLE, BOARD, facing(-0.08205, -0.055875, 0.3), **BARE)
    corner = PIN_HOLE.project(facing(-0.08205, -0.055875, 0.3).apply(BOARD.points[:1]))[0]
    assert_allclose(corner, [45.3, 42.75], atol=1e-9)
    black_then_white, white_then_black = (
        0.8 * BLACK_LEVEL + 0.2 * WHITE_LEVEL,
        0.8 * WHITE_LEVEL + 0.2 * BLACK_LEVEL,
    )
    assert_allclose(
        image[30:40, 45], black_then_white, atol=0.5 + 1e-3
    )  # whole grey levels; rays in single precision
    assert_allclose(image[46:56, 45], white_then_black, atol=0.5 + 1e-3)
    # row 43 is crossed from 42.5 to 42.75
    assert_allclose(image[43, 30:40], 0.25 * BLACK_LEVEL + 0.75 * WHITE_LEVEL, atol=0.5 + 1e-3)
    assert_allclose(image[43, 50:60], 0.25 * WHITE_LEVEL + 0.75 * BLACK_LEVEL, atol=0.5 + 1e-3)


def test_the_square_before_the_first_corner_is_black_and_a_white_margin_goes_around():
    pose = facing(-0.08, -0.05, 0.3)
    image = render(PIN_HOLE, BOARD, pose, **BARE)

    def grey(x, y):  # in squares
        column, row = PIN_HOLE.project(pose.apply(np.array([[0.03 * x, 0.03 * y, 0.0]])))[0]
        return image[round(row), round(column)]

    assert grey(-0.5, -0.5) == grey(0.5, 0.5) == grey(5.5, 3.5) == BLACK_LEVEL
    assert grey(0.5, -0.5) == grey(-0.5, 0.5) == grey(1.5, 0.5) == WHITE_LEVEL
    assert grey(-1.5, -0.5) == grey(2.5, -1.5) == grey(6.5, 1.5) == grey(2.5, 4.5) == WHITE_LEVEL
    assert grey(-2.5, 1.5) == grey(2.5, -2.5) == BACKGROUND_LEVEL


@every_camera
def test_corners_are_found_where_the_camera_projects_them(camera):
    views = random_views(camera, BOARD, 4, rng=rng(), tilt=(0.0, 0.6), fill=(0.6, 0.9), margin=0.03)
    renderer, errors = Renderer(camera), []
    for pose in views:
        truth = camera.project(pose.apply(BOARD.points))
        start = truth.reshape(-1, 1, 2).astype(np.float32)
        found = cv2.cornerSubPix(renderer.photograph(BOARD, pose), start, (3, 3), (-1, -1), (3, 100, 1e-5))
        errors.append(found.reshape(-1, 2) - truth)
    errors = np.concatenate(errors)
    # cornerSubPix itself errs by 0.03 px where edges meet at a slant; a half-pixel or a mirrored board
    # would be far more
    assert np.sqrt((errors**2).mean()) < 0.05
    assert np.abs(errors.mean(0)).max() < 0.02


def test_pixels_without_a_ray_are_black_and_no_others():
    y, x = np.mgrid[:180, :240].reshape(2, -1)
    ray = np.isfinite(CIRCLE.unproject(np.stack([x, y], axis=1).astype(float))[:, 2]).reshape(180, 240)
    assert 0.2 < ray.mean() < 0.8
    pose = random_views(CIRCLE, BOARD, 1, rng=rng())[0]
    image = Renderer(CIRCLE, noise=0.0).photograph(BOARD, pose, rng=rng())
    assert (image[~ray] == 0).all()
    assert (image[ray] > 0).all()
    assert (Renderer(CIRCLE, noise=5.0).photograph(BOARD, pose, rng=rng())[~ray] == 0).all()


def test_a_board_behind_the_camera_or_edge_on_is_not_seen():
    behind = facing(-0.08, -0.05, -0.3)
    edge_on = Pose(rotation_from_vector(np.array([np.pi / 2, 0.0, 0.0])), np.array([-0.08, 0.0, 0.3]))
    for pose in (behind, edge_on):
        image = render(PIN_HOLE, BOARD, pose, **BARE)
        assert (image == BACKGROUND_LEVEL).mean() > 0.99  # edge on, rounding may leave a line


def test_the_same_generator_gives_the_same_bytes_and_none_gives_no_noise():
    pose = facing(-0.08, -0.05, 0.3)
    assert_array_equal(render(PIN_HOLE, BOARD, pose, rng=rng(5)), render(PIN_HOLE, BOARD, pose, rng=rng(5)))
    assert not np.array_equal(
        render(PIN_HOLE, BOARD, pose, rng=rng(5)), render(PIN_HOLE, BOARD, pose, rng=rng(6))
    )
    assert_array_equal(render(PIN_HOLE, BOARD, pose, noise=9.0), render(PIN_HOLE, BOARD, pose, noise=0.0))


def test_the_rows_drawn_at_once_do_not_show(monkeypatch):
    camera = CAMERAS["normal"]
    pose = random_views(camera, BOARD, 1, rng=rng())[0]
    image = render(camera, BOARD, pose, rng=rng())
    monkeypatch.setattr(rendering, "ROWS_AT_ONCE", 7)
    assert (
        np.abs(render(camera, BOARD, pose, rng=rng()).astype(int) - image).max() <= 1
    )  # sums in another order, then rounding


def test_noise_is_as_large_as_asked_at_mid_grey_and_grows_with_light():
    pose = facing(0.0, 0.0, -1.0)  # nothing but background
    calm = (
        Renderer(PIN_HOLE, vignetting=0.0, noise=0.0, light=0.0)
        .photograph(BOARD, pose, rng=rng())
        .astype(float)
    )
    loud = (
        Renderer(PIN_HOLE, vignetting=0.0, noise=4.0, light=0.0)
        .photograph(BOARD, pose, rng=rng())
        .astype(float)
    )
    scaled = (loud - calm) / np.sqrt(0.5 + 0.5 * calm / MID_GREY_LEVEL)
    # 32000 pixels: five standard errors, and what whole grey levels add to both pictures
    assert abs(scaled.mean()) < 5 * 4.0 / np.sqrt(scaled.size) + 0.01
    rounding = np.sqrt(2 / 12) / np.sqrt(0.5 + 0.5 * calm.mean() / MID_GREY_LEVEL)
    assert_allclose(scaled.std(), np.hypot(4.0, rounding), rtol=5 / np.sqrt(2 * scaled.size) + 0.01)


def test_the_farthest_corner_loses_the_light_that_vignetting_says():
    image = render(PIN_HOLE, BOARD, facing(0.0, 0.0, -1.0), **{**BARE, "vignetting": 0.4})
    assert image[80, 100] == BACKGROUND_LEVEL
    assert abs(image[0, 0] - 0.6 * BACKGROUND_LEVEL) <= 0.5  # whole grey levels
    assert image[0, 0] == image.min()


def test_blur_spreads_an_edge_by_its_sigma():
    # a square wider than the image: one straight edge at x = 100
    image = render(PIN_HOLE, chessboard(3, 3, 1.0), facing(0.0, 0.5, 1.0), **{**BARE, "blur_px": 3.0})
    weight = np.abs(np.diff(image[80].astype(float)))
    middles = np.arange(199) + 0.5
    centre = np.average(middles, weights=weight)
    assert_allclose(centre, 100.0, atol=0.05)  # whole grey levels over an edge of 185
    # a step's derivative spreads by sigma, the pixel itself (1/12) and the difference (1/12)
    assert_allclose(np.average((middles - centre) ** 2, weights=weight), 9.0 + 2 / 12, rtol=0.03)


@pytest.mark.parametrize(
    "wrong", [{"oversampling": 0}, {"vignetting": 1.0}, {"blur_px": -1.0}, {"noise": np.nan}, {"light": -0.1}]
)
def test_settings_out_of_range_are_named(wrong):
    with pytest.raises(InputError, match=f"^{next(iter(wrong))} is "):
        render(PIN_HOLE, BOARD, facing(0.0, 0.0, 1.0), **wrong)


def test_what_is_known_by_its_points_only_cannot_be_drawn():
    points = Target("a few corners", BOARD.points[:5])
    with pytest.raises(InputError, match="'a few corners' is known by its points only"):
        render(PIN_HOLE, points, facing(0.0, 0.0, 1.0))


def test_photographs_are_one_for_each_view_by_name():
    scene = Scene(PIN_HOLE, BOARD, (facing(-0.08, -0.05, 0.3), facing(-0.08, -0.05, 0.4)))
    made = dict(rendered_photographs(scene, rng=rng()))
    assert list(made) == ["view01", "view02"]
    assert all(image.shape == (160, 200) and image.dtype == np.uint8 for image in made.values())


@pytest.mark.slow
def test_the_demo_shows_a_detector_its_board():
    scene = demo_scene()
    assert scene.target.grid == (14, 9)
    assert len(scene.camera_from_target) == 20
    renderer = Renderer(scene.camera)
    for pose, truth in list(zip(scene.camera_from_target, scene.corner_pixels(), strict=True))[::5]:
        image = renderer.photograph(scene.target, pose, rng=rng())
        found, corners = cv2.findChessboardCorners(image, (14, 9))
        assert found
        corners = cv2.cornerSubPix(image, corners, (5, 5), (-1, -1), (3, 50, 1e-4)).reshape(-1, 2)
        error = min((corners - truth, corners[::-1] - truth), key=lambda e: np.abs(e).max())
        assert np.sqrt((error**2).mean()) < 0.06  # 0.02 to 0.036 with this noise, over many views


def test_the_demos_lens_bends_lines_visibly_and_images_the_whole_frame():
    camera = demo_scene(count=1).camera
    width, height = camera.image_size
    top = np.stack([np.linspace(0, width - 1, 41), np.full(41, 20.0)], axis=1)
    straight = camera.undistort_pixels(top)
    sagitta = straight[:, 1] - np.interp(straight[:, 0], straight[[0, -1], 0], straight[[0, -1], 1])
    assert np.abs(sagitta).max() > 20
    corners = np.array([[0.0, 0.0], [width - 1.0, 0.0], [0.0, height - 1.0], [width - 1.0, height - 1.0]])
    assert np.isfinite(camera.unproject(corners)).all()


def test_the_demos_sheet_with_its_margin_fits_a4():
    width, height, _ = (
        np.ptp(demo_scene(count=1).target.points, axis=0) + 4 * 0.016
    )  # a square and a square of margin on either side
    assert width <= 0.297
    assert height <= 0.210


def test_what_is_behind_is_seen_around_the_target_alone():
    target, renderer = chessboard(5, 4, 0.03), Renderer(CAMERAS["normal"], **BARE)
    (pose,) = random_views(renderer.camera, target, 1, rng=np.random.default_rng(3))
    plain = renderer.photograph(target, pose)
    placed = renderer.photograph_of([(target, pose)], behind=np.full((240, 320), 47.0))
    around, board = plain == BACKGROUND_LEVEL, (plain == BLACK_LEVEL) | (plain == WHITE_LEVEL)
    assert (placed[around] == 47).mean() > 0.995  # an edge within the board may be as grey
    assert_allclose(placed[board].astype(int), plain[board], atol=1)
    assert min(around.mean(), board.mean()) > 0.05
    with pytest.raises(InputError, match="resize it"):
        renderer.photograph_of([(target, pose)], behind=np.zeros((240, 319)))
