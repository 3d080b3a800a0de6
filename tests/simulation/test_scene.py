"""Simulated scenes: views are where they were asked for, noise is as large as was asked for."""

from __future__ import annotations

import cv2
import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal

from orthoscope.geometry.arrays import CalibrationError, InputError
from orthoscope.geometry.pose import Pose, rotation_from_vector
from orthoscope.models.camera import Camera
from orthoscope.models.intrinsics import Intrinsics
from orthoscope.models.lenses.table import Brown, Division, KannalaBrandt
from orthoscope.simulation.scene import (
    BORDER_SHARE,
    GRAZING_ANGLE,
    LEAST_SEEN_SHARE,
    Scene,
    paper_scene,
    random_views,
    simulate_detections,
)
from orthoscope.targets.target import Target, chessboard

CAMERAS = {
    "narrow, 24 degrees": Camera((1280, 1024), Intrinsics(3000.0, 3000.0, 650.0, 500.0), Brown(k1=-0.1)),
    "normal, 70 degrees": Camera(
        (1280, 960), Intrinsics(905.0, 902.0, 652.0, 467.0), Brown(k1=-0.31, k2=0.13, p1=0.0011, p2=-0.0007)
    ),
    "skewed, with a lens frame": Camera(
        (640, 480),
        Intrinsics(760.0, 740.0, 320.0, 240.0, 2.0),
        Division(l=-0.3),
        Intrinsics(750.0, 750.0, 305.0, 257.0),
    ),
    "upright fisheye, over 180 degrees": Camera(
        (640, 720), Intrinsics(200.0, 200.0, 320.0, 360.0), KannalaBrandt(k1=-0.02, k2=0.003)
    ),
}
CIRCLE = Camera(
    (800, 600), Intrinsics(140.0, 140.0, 405.0, 290.0), KannalaBrandt(k1=-0.02, k2=-0.01)
)  # its image ends inside the frame
BOARD = chessboard(9, 6, 0.025)

every_camera = pytest.mark.parametrize("camera", CAMERAS.values(), ids=CAMERAS.keys())
every_camera_and_circle = pytest.mark.parametrize(
    "camera", [*CAMERAS.values(), CIRCLE], ids=[*CAMERAS.keys(), "image circle"]
)


def rng(seed: int = 1) -> np.random.Generator:
    return np.random.default_rng(seed)


def boxes(scene: Scene) -> tuple[np.ndarray, np.ndarray]:
    """Low and high pixel of the corners of each view (v,2)."""
    pixels = scene.corner_pixels()
    return pixels.min(1), pixels.max(1)


def at_tilts(degrees: list[float]) -> Scene:
    """A board of 2900 corners in the middle of a long lens's image, tilted about x."""
    board = chessboard(58, 50, 0.001)
    middle = board.points.mean(0)
    rotations = [rotation_from_vector(np.array([np.deg2rad(angle), 0.0, 0.0])) for angle in degrees]
    poses = tuple(Pose(rotation, np.array([0.0, 0.0, 1.0]) - rotation @ middle) for rotation in rotations)
    return Scene(Camera((1000, 1000), Intrinsics(5000.0, 5000.0, 500.0, 500.0), Brown()), board, poses)


@every_camera_and_circle
def test_a_whole_view_has_every_corner_in_the_image(camera):
    scene = Scene(camera, BOARD, random_views(camera, BOARD, 30, rng=rng()))
    assert np.isfinite(scene.corner_pixels()).all()


@every_camera_and_circle
def test_boards_stand_in_front_tilted_as_asked_and_never_at_a_grazing_angle(camera):
    least, greatest = np.deg2rad([10.0, 40.0])
    for pose in random_views(camera, BOARD, 20, rng=rng(), tilt=(least, greatest)):
        middle = pose.apply(BOARD.points.mean(0)[None])[0]
        tilt = np.arccos(pose.rotation[:, 2] @ middle / np.linalg.norm(middle))
        assert middle[2] > 0
        assert least - 1e-9 <= tilt <= greatest + 1e-9  # rounding in arccos
        sight = pose.apply(BOARD.points)
        assert (
            sight @ pose.rotation[:, 2] >= np.cos(GRAZING_ANGLE) * np.linalg.norm(sight, axis=1) - 1e-12
        ).all()


@every_camera
def test_boards_fill_the_share_of_the_image_that_was_asked_for(camera):
    scene = Scene(camera, BOARD, random_views(camera, BOARD, 20, rng=rng(), fill=(0.5, 0.7)))
    low, high = boxes(scene)
    share = ((high - low) / (np.array(camera.image_size) - 1)).max(1)
    assert (share > 0.5 * 0.95).all()  # a view is taken once its box is within 5 % of what was drawn
    assert (share < 0.7 * 1.05).all()
    assert np.ptp(share) > 0.1


@pytest.mark.parametrize("name", ["narrow, 24 degrees", "normal, 70 degrees", "skewed, with a lens frame"])
def test_boards_reach_all_four_corners_and_every_part_of_the_image(name):
    camera = CAMERAS[name]
    scene = Scene(camera, BOARD, random_views(camera, BOARD, 20, rng=rng()))
    low, high = boxes(scene)
    frame = np.array(camera.image_size) - 1.0
    near = 3 * BORDER_SHARE * frame  # the gap itself and as much again and again for the fixed point's rest
    left, top = (low < near).T
    right, bottom = (high > frame - near).T
    for in_corner in (left & top, right & top, left & bottom, right & bottom):
        assert in_corner.any()
    cells = np.floor(scene.corner_pixels().reshape(-1, 2) / camera.image_size * 6).astype(int)
    assert len(np.unique(cells, axis=0)) >= 34  # of 36: a turned board does not reach into the very corner


@every_camera
def test_partial_views_leave_corners_out_but_keep_a_quarter(camera):
    scene = Scene(camera, BOARD, random_views(camera, BOARD, 20, rng=rng(), whole=False))
    seen = np.isfinite(scene.corner_pixels()[..., 0]).mean(1)
    assert (seen >= LEAST_SEEN_SHARE).all()
    assert (seen < 1.0).any()


def test_the_margin_is_kept_in_the_image_too():
    camera = CAMERAS["normal, 70 degrees"]
    views = random_views(camera, BOARD, 20, rng=rng(), margin=0.025)
    outer = chessboard(11, 8, 0.025).points - [0.025, 0.025, 0.0]
    assert np.isfinite(Scene(camera, Target("outer", outer), views).corner_pixels()).all()


def test_a_view_that_is_neither_tilted_nor_rolled_stands_where_the_pin_hole_says():
    camera = Camera((1001, 801), Intrinsics(1000.0, 1000.0, 500.0, 400.0), Brown())
    (pose,) = random_views(
        camera, chessboard(5, 3, 0.1), 1, rng=rng(), tilt=(0.0, 0.0), roll=(0.0, 0.0), fill=(0.5, 0.5)
    )
    # 0.4 m shall be 0.5 * 1000 px: 0.8 m away, its middle (0.2, 0.1) on the axis
    assert_allclose(pose.rotation, np.eye(3), atol=1e-12)
    assert_allclose(pose.translation, [-0.2, -0.1, 0.8], atol=1e-9)


def test_the_same_generator_gives_the_same_views_and_noise_and_another_gives_others():
    def drawn(seed):
        generator = rng(seed)
        scene = paper_scene("high", count=4, rng=generator)
        return simulate_detections(scene, noise_px=0.5, rng=generator).views

    for once, again, other in zip(drawn(3), drawn(3), drawn(4), strict=True):
        assert_array_equal(once.pixels, again.pixels)
        assert not np.array_equal(once.pixels, other.pixels)


def test_views_that_cannot_be_are_refused_with_what_to_do():
    with pytest.raises(CalibrationError, match=r"only \d+ of 5 views .* smaller fill or tilt"):
        random_views(CIRCLE, BOARD, 5, rng=rng(), fill=(0.9, 0.95))


@pytest.mark.parametrize(
    "wrong",
    [
        {"count": 0},
        {"tilt": (0.0, 1.6)},
        {"tilt": (0.5, 0.2)},
        {"roll": (1.0, 0.0)},
        {"fill": (0.0, 0.5)},
        {"fill": (0.5, 1.2)},
        {"margin": -0.1},
        {"margin": np.nan},
    ],
)
def test_ranges_that_make_no_sense_are_named(wrong):
    settings = {"count": 3, "rng": rng()} | wrong
    with pytest.raises(InputError, match=rf"^{next(iter(wrong))} is "):
        random_views(CAMERAS["normal, 70 degrees"], BOARD, **settings)


def test_without_noise_detections_are_the_corners_in_the_frame():
    camera = CAMERAS["normal, 70 degrees"]
    scene = Scene(camera, BOARD, random_views(camera, BOARD, 8, rng=rng(), whole=False))
    detections = simulate_detections(scene, noise_px=0.0, rng=rng())
    assert detections.image_size == camera.image_size
    assert [view.image for view in detections.views] == [f"view0{i}" for i in range(1, 9)]
    for view, pose in zip(detections.views, scene.camera_from_target, strict=True):
        pixels = camera.project(pose.apply(BOARD.points))
        inside = ((pixels >= -0.5) & (pixels <= [1279.5, 959.5])).all(1)
        assert_array_equal(view.ids, np.flatnonzero(inside))
        assert_array_equal(view.pixels, pixels[inside])


def test_a_view_without_a_corner_in_the_image_is_set_aside():
    scene = at_tilts([0.0, 0.0])
    behind = Pose(np.diag([1.0, -1.0, -1.0]), np.array([0.0, 0.0, -1.0]))
    detections = simulate_detections(
        Scene(scene.camera, scene.target, (scene.camera_from_target[0], behind)), noise_px=0.1, rng=rng()
    )
    assert [view.image for view in detections.views] == ["view01"]
    assert [entry.image for entry in detections.set_aside] == ["view02"]


@pytest.mark.parametrize(("tilt_noise", "factors"), [(False, [1.0, 1.0, 1.0]), (True, [1.0, 1.5, 2.0])])
def test_noise_is_gaussian_and_by_the_papers_law_doubles_towards_70_degrees(tilt_noise, factors):
    scene = at_tilts([0.0, 35.0, 70.0])
    detections = simulate_detections(scene, noise_px=0.2, rng=rng(), tilt_noise=tilt_noise)
    for view, truth, factor in zip(detections.views, scene.corner_pixels(), factors, strict=True):
        error = (view.pixels - truth) / (0.2 * factor)
        n = (
            error.size
        )  # 5800: the tolerances are four standard errors of mean, spread, and share within one sigma
        assert abs(error.mean()) < 4 / np.sqrt(n)
        assert abs(error.std() - 1.0) < 4 / np.sqrt(2 * n)
        assert abs((np.abs(error) < 1.0).mean() - 0.6827) < 4 * np.sqrt(0.6827 * 0.3173 / n)


def test_negative_noise_is_refused():
    with pytest.raises(InputError, match="noise_px is -1"):
        simulate_detections(at_tilts([0.0]), noise_px=-1.0, rng=rng())


@pytest.mark.parametrize(("distortion", "centre"), [("low", (317, 244)), ("high", (305, 257))])
def test_the_papers_camera_sees_all_280_corners_in_all_20_views(distortion, centre):
    scene = paper_scene(distortion, rng=rng())
    assert scene.corner_pixels().shape == (20, 280, 2)
    assert np.isfinite(scene.corner_pixels()).all()
    # the ray that falls on the distortion centre is not bent: the pin-hole sees it at the same offset from
    # its own centre
    straight = scene.camera.undistort_pixels(np.array([centre], dtype=float))
    assert_allclose(straight[0], centre, atol=1e-9)


def test_the_papers_board_has_the_largest_whole_millimetre_square_that_fits_its_sheet():
    board = paper_scene("low", count=1, rng=rng()).target
    assert board.grid == (14, 20)
    squares, sheet = np.array([15, 21]), np.array([0.210, 0.297])
    side = board.points[1, 0]
    assert (squares * side <= sheet + 1e-12).all()
    assert (squares * (side + 0.001) > sheet).all()


def test_another_distortion_than_the_papers_is_refused():
    with pytest.raises(InputError, match="expected one of low, high"):
        paper_scene("medium", rng=rng())


def test_a_scene_needs_a_view_and_numbers_its_views_in_order():
    scene = at_tilts([0.0])
    with pytest.raises(InputError, match="0 views"):
        Scene(scene.camera, scene.target, ())
    images = Scene(scene.camera, scene.target, scene.camera_from_target * 100).images
    assert images[0] == "view001"
    assert list(images) == sorted(images)


def test_random_views_tell_the_camera():
    camera = CAMERAS["normal, 70 degrees"]
    scene = Scene(camera, BOARD, random_views(camera, BOARD, 10, rng=rng()))
    pixels = [
        view.pixels.astype(np.float32) for view in simulate_detections(scene, noise_px=0.0, rng=rng()).views
    ]
    points = [BOARD.points.astype(np.float32)] * 10
    rms, matrix, lens, *_ = cv2.calibrateCamera(points, pixels, camera.image_size, None, None)
    assert rms < 1e-3  # OpenCV takes single precision: 1280 px to 1e-4
    assert_allclose(matrix, camera.intrinsics.matrix, atol=0.02)
    assert_allclose(lens.ravel(), [-0.31, 0.13, 0.0011, -0.0007, 0.0], atol=1e-3)
