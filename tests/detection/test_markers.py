"""Boards with markers: OpenCV's own pictures are found with its ids, in both layouts, markers hidden."""

from __future__ import annotations

from dataclasses import replace

import cv2
import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal

from orthoscope.detection.detect import detect
from orthoscope.detection.sight import Sight
from orthoscope.detection.table import see
from orthoscope.geometry.arrays import CalibrationError, InputError
from orthoscope.targets.aprilgrid import AprilGrid
from orthoscope.targets.charuco import Charuco
from orthoscope.targets.markers import dictionary
from orthoscope.targets.table import parse_target
from orthoscope.targets.target import target_of

SQUARE = 60  # px


def opencv_picture(columns: int, rows: int, *, legacy: bool) -> np.ndarray:
    """OpenCV's own drawing of a board, half a square of white around it."""
    board = cv2.aruco.CharucoBoard((columns, rows), 0.03, 0.022, dictionary("DICT_5X5_100"))
    board.setLegacyPattern(legacy)
    margin = SQUARE // 2
    size = (columns * SQUARE + 2 * margin, rows * SQUARE + 2 * margin)
    return cv2.GaussianBlur(board.generateImage(size, marginSize=margin), (0, 0), 1.0)


def where(columns: int, rows: int) -> np.ndarray:
    """Where its corners are, px."""
    row, column = np.mgrid[1:rows, 1:columns].reshape(2, -1)
    return np.stack([column, row], axis=1) * SQUARE + SQUARE // 2 - 0.5


@pytest.mark.parametrize("legacy", [False, True])
@pytest.mark.parametrize("said", [False, True])
@pytest.mark.parametrize("size", [(5, 8), (6, 5), (7, 6)], ids=str)
def test_opencvs_own_boards_are_found_with_its_ids_whichever_layout_was_said(size, legacy, said):
    sight = see(
        opencv_picture(*size, legacy=legacy), target_of(Charuco(*size, 0.03, 0.022, "DICT_5X5_100", said))
    )
    assert isinstance(sight, Sight)
    assert_array_equal(sight.ids, np.arange(len(where(*size))))
    assert_allclose(sight.pixels, where(*size), atol=0.05)  # drawn in whole pixels, then blurred


def test_corners_whose_markers_are_hidden_are_found_from_the_others():
    picture = opencv_picture(7, 6, legacy=False)
    truth = where(7, 6)
    middle = truth.mean(0)
    for centre in np.argwhere(np.ones((6, 7))):  # every marker of the right half loses its bits
        x, y = (centre[1] + 1) * SQUARE, (centre[0] + 1) * SQUARE
        if (centre.sum() % 2) and x > middle[0] + SQUARE:
            picture[y - 21 : y + 22, x - 21 : x + 22] = 255
    sight = see(picture, target_of(Charuco(7, 6, 0.03, 0.022, "DICT_5X5_100")))
    assert isinstance(sight, Sight)
    assert len(sight.ids) == len(truth)
    assert_allclose(sight.pixels, truth[sight.ids], atol=0.05)


def test_kalibrs_target_yaml_is_read(tmp_path):
    text = (
        "target_type: 'aprilgrid' #gridtype\ntagCols: 6\ntagRows: 5\ntagSize: 0.088  # [m]\ntagSpacing: 0.3\n"
    )
    (tmp_path / "target.yaml").write_text(text)
    assert parse_target(str(tmp_path / "target.yaml")).board == AprilGrid(6, 5, 0.088, 0.3)
    (tmp_path / "board.yml").write_text(
        "target_type: 'checkerboard'\ntargetCols: 6\ntargetRows: 7\n"
        "rowSpacingMeters: 0.06\ncolSpacingMeters: 0.06\n"
    )
    assert parse_target(str(tmp_path / "board.yml")).name == "chessboard:6x7:60mm"
    for broken in ("", "target_type: 'star'\n", text.replace("0.3", "wide"), text.replace("tagSize", "size")):
        (tmp_path / "target.yaml").write_text(broken)
        with pytest.raises(InputError, match=r"target\.yaml"):
            parse_target(str(tmp_path / "target.yaml"))


def test_kalibrs_corners_are_counted_from_the_bottom_left():
    board = AprilGrid(3, 2, 0.1, 0.25)
    points = board.points()
    assert_allclose(points[[0, 1, 2, 6]], [[0, 0, 0], [0.1, 0, 0], [0.125, 0, 0], [0, -0.1, 0]])
    assert_array_equal(board.tag_corners()[0], [6, 7, 1, 0])  # its top left, then clockwise


def test_a_board_that_cannot_be_is_refused():
    with pytest.raises(InputError, match="needs"):
        replace(Charuco(7, 5, 0.03, 0.022, "DICT_5X5_50"), columns=20, rows=20)
    with pytest.raises(InputError, match="DICT_9X9"):
        Charuco(7, 5, 0.03, 0.022, "DICT_9X9_50")
    with pytest.raises(InputError, match="markers smaller"):
        Charuco(7, 5, 0.03, 0.03, "DICT_5X5_50")


def test_of_a_board_with_the_same_markers_no_part_is_taken_and_it_is_named():
    with pytest.raises(CalibrationError, match="charuco:7x6:30mm:22mm:DICT_5X5_50"):
        detect([opencv_picture(7, 6, legacy=False)], "charuco:9x6:30mm:22mm:DICT_5X5_100")
