"""Grids of markers as OpenCV makes them: its ids, nearer to the truth than its refinement; white on black."""

from __future__ import annotations

import cv2
import numpy as np
import pytest
from numpy.testing import assert_array_equal

from orthoscope.detection.sight import Sight
from orthoscope.detection.table import see
from orthoscope.geometry.pose import Pose, rotation_from_vector
from orthoscope.models.camera import Camera
from orthoscope.models.intrinsics import Intrinsics
from orthoscope.models.lenses.table import Brown
from orthoscope.simulation.render import Renderer
from orthoscope.targets.aprilgrid import AprilGrid
from orthoscope.targets.charuco import Charuco
from orthoscope.targets.grid_board import GridBoard
from orthoscope.targets.target import target_of

CAMERA = Camera((800, 600), Intrinsics(700.0, 698.0, 404.0, 296.0), Brown(k1=-0.25, k2=0.08))
RENDERER = Renderer(CAMERA)
BOARD = GridBoard(5, 4, 0.04, 0.01, "DICT_4X4_50")


def photographed(board, seed: int, distance: float = 0.36):
    target, rng = target_of(board), np.random.default_rng(seed)
    rotation = rotation_from_vector(rng.uniform(-0.5, 0.5, 3))
    middle = 0.5 * (target.points.min(0) + target.points.max(0))
    pose = Pose(rotation, np.array([0.0, 0.0, distance]) - rotation @ middle)
    return RENDERER.photograph(target, pose, rng=rng), CAMERA.project(pose.apply(target.points))


def test_ids_are_opencvs_on_the_picture_that_it_generates():
    dictionary = cv2.aruco.getPredefinedDictionary(cv2.aruco.DICT_4X4_50)
    theirs = cv2.aruco.GridBoard((5, 4), 0.04, 0.01, dictionary)
    picture = theirs.generateImage((640, 520), marginSize=20)
    corners, numbers, _ = cv2.aruco.ArucoDetector(dictionary).detectMarkers(picture)
    points, pixels = theirs.matchImagePoints(corners, numbers)
    sight = see(picture, target_of(BOARD))
    assert isinstance(sight, Sight)
    assert_array_equal(sight.ids, np.arange(80))
    ours = {
        tuple(np.round(p, 6)): pixel for p, pixel in zip(BOARD.points()[sight.ids], sight.pixels, strict=True)
    }
    for point, pixel in zip(points.reshape(-1, 3), pixels.reshape(-1, 2), strict=True):
        assert np.linalg.norm(ours[tuple(np.round(point.astype(float), 6))] - pixel) < 1.5  # theirs are whole


def test_corners_are_twice_as_near_to_the_truth_as_opencvs_refined_ones():
    parameters = cv2.aruco.DetectorParameters()
    parameters.cornerRefinementMethod = cv2.aruco.CORNER_REFINE_SUBPIX
    theirs = cv2.aruco.ArucoDetector(cv2.aruco.getPredefinedDictionary(cv2.aruco.DICT_4X4_50), parameters)
    mine, opencvs = [], []
    for seed in range(3):
        picture, truth = photographed(BOARD, seed)
        sight = see(picture, target_of(BOARD))
        assert isinstance(sight, Sight)
        mine.append(sight.pixels - truth[sight.ids])
        corners, numbers, _ = theirs.detectMarkers(picture)
        opencvs += [
            corner[0] - truth[4 * n : 4 * n + 4] for corner, n in zip(corners, numbers.ravel(), strict=True)
        ]
    ours, usual = (np.sqrt((np.concatenate(off) ** 2).sum(1).mean()) for off in (mine, opencvs))
    assert ours < 0.5 * usual
    assert ours < 0.06  # px


@pytest.mark.parametrize(
    "board",
    [BOARD, Charuco(7, 5, 0.03, 0.022, "DICT_5X5_100"), AprilGrid(4, 3, 0.04, 0.3)],
    ids=lambda board: board.description,
)
def test_markers_white_on_black_and_a_films_negative_have_the_ids_of_the_positive(board):
    picture, truth = photographed(board, 1)
    positive, negative = see(picture, target_of(board)), see(255 - picture, target_of(board))
    assert isinstance(positive, Sight)
    assert isinstance(negative, Sight)
    assert len(negative.ids) >= 0.95 * len(positive.ids)
    assert np.linalg.norm(negative.pixels - truth[negative.ids], axis=1).max() < 0.5


def test_a_cameras_curve_and_a_covered_corner_move_no_corner():
    picture, truth = photographed(BOARD, 2)
    curved = (255 * (picture / 255.0) ** 0.45).astype(np.uint8)  # all that is black is smaller
    sight = see(curved, target_of(BOARD))
    assert isinstance(sight, Sight)
    assert len(sight.ids) > 0.9 * len(truth)
    assert np.linalg.norm(sight.pixels - truth[sight.ids], axis=1).max() < 0.3
    x, y = np.rint(truth[20]).astype(int)
    picture[y - 5 : y + 6, x - 5 : x + 6] = 120
    covered = see(picture, target_of(BOARD))
    assert isinstance(covered, Sight)
    assert np.linalg.norm(covered.pixels - truth[covered.ids], axis=1).max() < 0.5
