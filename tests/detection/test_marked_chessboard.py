"""Chessboards with discs or a marker in their middle: any part that shows these has ids."""

from __future__ import annotations

import cv2
import numpy as np
import pytest
from numpy.testing import assert_allclose

from helpers.quick import first_quick
from orthoscope.detection.sight import Sight, Unseen
from orthoscope.detection.table import see
from orthoscope.geometry.arrays import InputError
from orthoscope.geometry.pose import Pose, rotation_from_vector
from orthoscope.models.camera import Camera
from orthoscope.models.intrinsics import Intrinsics
from orthoscope.models.lenses.table import Brown
from orthoscope.simulation.render import Renderer
from orthoscope.targets.chessboard import Chessboard
from orthoscope.targets.marked_chessboard import MarkedChessboard
from orthoscope.targets.table import parse_target
from orthoscope.targets.target import target_of

CAMERA = Camera((640, 480), Intrinsics(600.0, 600.0, 320.0, 240.0), Brown(k1=-0.1))
RENDERER = Renderer(CAMERA)
DISCS, MARKER = (
    MarkedChessboard(14, 9, 0.02),
    MarkedChessboard(14, 9, 0.02, dictionary="DICT_4X4_50", marker=0.015),
)


def photographed(board, roll: float, distance: float):
    """A photograph of the board's middle, and where its corners are."""
    target, rotation = target_of(board), rotation_from_vector(np.array([0.2, 0.15, roll]))
    middle = 0.5 * (target.points.min(0) + target.points.max(0))
    pose = Pose(rotation, np.array([0.0, 0.0, distance]) - rotation @ middle)
    picture = RENDERER.photograph(target, pose, rng=np.random.default_rng(0))
    return picture, CAMERA.project(pose.apply(target.points))


@pytest.mark.parametrize("board", [DISCS, MARKER], ids=lambda board: board.description)
@pytest.mark.parametrize("roll", first_quick([1.7, 0.1, 3.0, -1.4]))
def test_a_part_without_any_of_the_boards_sides_has_ids_by_its_marks(board, roll):
    picture, truth = photographed(board, roll, 0.17)
    sight = see(picture, target_of(board))
    assert isinstance(sight, Sight)
    assert 20 < len(sight.ids) < 90  # no side is in the picture
    assert_allclose(sight.pixels, truth[sight.ids], atol=0.3)
    negative = see(255 - picture, target_of(board))
    assert isinstance(negative, Sight)
    assert_allclose(negative.pixels, truth[negative.ids], atol=0.3)


def test_a_part_of_a_plain_board_and_one_whose_marks_are_covered_have_none():
    picture, _ = photographed(Chessboard(14, 9, 0.02), 0.1, 0.17)
    assert isinstance(see(picture, target_of(Chessboard(14, 9, 0.02))), Unseen)
    assert isinstance(see(picture, target_of(DISCS)), Unseen)


@pytest.mark.parametrize("roll", [0.0, 1.5, 3.1])
def test_opencv_lists_the_corners_of_its_marked_board_in_one_order_of_ours(roll):
    picture, _ = photographed(DISCS, roll, 0.4)
    sight = see(picture, target_of(DISCS))
    found, theirs = cv2.findChessboardCornersSB(picture, (14, 9), flags=cv2.CALIB_CB_MARKER)
    assert found
    assert isinstance(sight, Sight)
    order = np.arange(9 * 14).reshape(9, 14)[::-1].ravel()  # they begin with the last row
    assert_allclose(theirs.reshape(-1, 2), sight.pixels[order], atol=1.0)  # beside discs theirs are .7 px off


@pytest.mark.parametrize(
    "spec",
    [
        "marked:14x9:20mm:discs=0.4",
        "marked:3x9:20mm",
        "marked:14x9:20mm:DICT_4X4_50:25mm",
        "marked:9x6:20mm:x",
    ],
)
def test_marks_that_do_not_fit_are_refused(spec):
    with pytest.raises(InputError):
        parse_target(spec)
