"""NCE and coverage: worked examples."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal

from orthoscope.evaluation.coverage import COVERAGE_GRID, corners_by_cell
from orthoscope.evaluation.metrics import lateral_errors, normalised_calibration_error
from orthoscope.geometry.arrays import InputError
from orthoscope.geometry.pose import Pose, rotation_from_vector
from orthoscope.models.camera import WIDEST_ANGLE, Camera
from orthoscope.models.intrinsics import Intrinsics
from orthoscope.models.lenses.table import Brown, KannalaBrandt
from orthoscope.targets.detections import Detections, View
from orthoscope.targets.target import chessboard

PINHOLE = Camera((640, 480), Intrinsics(500.0, 500.0, 320.0, 240.0), Brown())
BOARD = chessboard(9, 6, 0.025)


def points_in_front(n: int, seed: int = 0) -> np.ndarray:
    """Points (n,3) all over the frame at depths from 0.3 to 3 metres."""
    rng = np.random.default_rng(seed)
    rays = PINHOLE.unproject(rng.uniform(0.0, [639.0, 479.0], (n, 2)))
    return rays / rays[:, 2:] * rng.uniform(0.3, 3.0, (n, 1))


def back_projected(camera: Camera, pixels: np.ndarray, depth: np.ndarray) -> np.ndarray:
    rays = camera.unproject(pixels)
    return rays * (depth / rays[:, 2])[:, None]


def test_rounding_to_whole_pixels_alone_gives_0_94():
    # rounding is uniform over a square of one pixel; the mean distance from a square's middle is (sqrt 2 +
    # asinh 1) / 6 = 0.3826 px, and NCE divides by the root mean square, sqrt(1/12 + 1/12) = 0.4082 px
    expected = (np.sqrt(2.0) + np.arcsinh(1.0)) / 6.0 / np.sqrt(1.0 / 6.0)
    points = points_in_front(40_000)
    rounded = np.round(PINHOLE.project(points))
    nce = normalised_calibration_error(
        back_projected(PINHOLE, rounded, points[:, 2]), points, PINHOLE.intrinsics
    )
    assert_allclose(expected, 0.9372, atol=5e-5)
    assert_allclose(
        nce, expected, rtol=0.006
    )  # the distance varies by 37 %: three deviations of a mean of 40 000


@pytest.mark.parametrize("offset", [(0.4082, 0.0), (0.0, -0.4082), (0.3, 0.277)])
def test_one_is_0_41_px(offset):
    points = points_in_front(50)
    seen = PINHOLE.project(points) + offset
    nce = normalised_calibration_error(
        back_projected(PINHOLE, seen, points[:, 2]), points, PINHOLE.intrinsics
    )
    assert_allclose(nce, 1.0, rtol=1e-3)


def test_an_error_along_the_finer_side_of_a_pixel_counts_by_its_size_in_space():
    K = Intrinsics(1000.0, 500.0, 320.0, 240.0)
    camera, points = Camera((640, 480), K, Brown()), np.array([[0.1, 0.05, 1.0]])
    along_x, along_y = (
        normalised_calibration_error(
            back_projected(camera, camera.project(points) + e, points[:, 2]), points, K
        )
        for e in ((1, 0), (0, 1))
    )
    assert_allclose(along_y / along_x, 2.0)
    assert_allclose(along_x, 1e-3 / np.sqrt((1e-6 + 4e-6) / 12.0))


def test_depth_does_not_matter():
    points = points_in_front(200)
    error = np.random.default_rng(1).normal(scale=0.3, size=(200, 2))
    nces = []
    for factor in (1.0, 7.0, np.random.default_rng(2).uniform(0.1, 50.0, (200, 1))):
        moved = factor * points
        seen = PINHOLE.project(moved) + error
        nces.append(
            normalised_calibration_error(
                back_projected(PINHOLE, seen, moved[:, 2]), moved, PINHOLE.intrinsics
            )
        )
    assert_allclose(nces, nces[0], rtol=1e-9)


@pytest.mark.parametrize("depth", [0.0, -1.0, float("nan")])
def test_a_point_behind_the_camera_is_refused(depth):
    with pytest.raises(InputError, match="no positive depth"):
        normalised_calibration_error(np.ones((1, 3)), np.array([[0.0, 0.0, depth]]), PINHOLE.intrinsics)


def test_lateral_errors_are_zero_where_corners_are_exact_and_pixels_at_the_depth_where_they_are_not():
    pose = Pose(rotation_from_vector(np.array([0.3, -0.2, 0.1])), np.array([-0.1, -0.05, 0.5]))
    points = pose.apply(BOARD.points)
    for offset in (0.0, 1.0):
        view = View("a", np.arange(54), PINHOLE.project(points) + np.array([offset, 0.0]))
        estimated, observed = lateral_errors(PINHOLE, [pose], Detections(BOARD, (640, 480), (view,)))
        assert_allclose(observed, points)
        assert_allclose(estimated - observed, points[:, 2:] * [offset / 500.0, 0.0, 0.0], atol=1e-12)


def test_corners_that_no_straight_image_would_hold_are_left_out():
    camera = Camera((640, 480), Intrinsics(150.0, 150.0, 320.0, 240.0), KannalaBrandt())
    turned = Pose(rotation_from_vector(np.array([0.0, 1.2, 0.0])), np.array([0.15, -0.06, 0.1]))
    pixels = camera.project(turned.apply(BOARD.points))
    angles = np.arccos(camera.unproject(pixels)[:, 2])
    assert angles.min() < WIDEST_ANGLE < angles.max()
    estimated, observed = lateral_errors(
        camera, [turned], Detections(BOARD, (640, 480), (View("a", np.arange(54), pixels),))
    )
    assert len(estimated) == len(observed) == (angles < WIDEST_ANGLE).sum()


def test_cells_share_the_frame_and_its_border_belongs_to_it():
    corners = np.array(
        [
            [-0.5, -0.5],
            [0.0, 0.0],
            [639.5, -0.5],
            [639.5, 479.5],
            [320.0, 240.0],
            [640.0, 100.0],
            [-0.6, 100.0],
        ]
    )
    target = chessboard(4, 2, 0.1)
    counts = corners_by_cell(Detections(target, (640, 480), (View("a", np.arange(7), corners),)))
    assert counts.shape == COVERAGE_GRID[::-1]
    expected = np.zeros(COVERAGE_GRID[::-1], dtype=int)
    expected[0, 0], expected[0, -1], expected[-1, -1], expected[3, 4] = 2, 1, 1, 1  # two lie outside
    assert_array_equal(counts, expected)


def test_rows_of_cells_run_down_and_columns_to_the_right():
    target = chessboard(3, 2, 0.1)
    view = View("a", np.arange(3), np.array([[600.0, 10.0], [610.0, 20.0], [620.0, 400.0]]))
    assert_array_equal(corners_by_cell(Detections(target, (640, 480), (view,)), (2, 2)), [[0, 2], [0, 1]])
