"""All markers read together: ids where none can be read alone, none where chance or another board speaks."""

from __future__ import annotations

import cv2
import numpy as np
import pytest
from numpy.testing import assert_array_equal

from orthoscope.detection.markers import joint_reading
from orthoscope.detection.markers.joint_reading import Squares, drawings_of, likeliest_way
from orthoscope.detection.markers.markers import find_markers
from orthoscope.detection.sight import Sight, Unseen
from orthoscope.detection.table import see
from orthoscope.targets.aprilgrid import BORDER_SQUARES, AprilGrid
from orthoscope.targets.aprilgrid import DICTIONARY as APRILTAGS
from orthoscope.targets.charuco import Charuco
from orthoscope.targets.markers import dictionary, marker_modules
from orthoscope.targets.target import target_of

NAME, SQUARE = "DICT_4X4_100", 13  # px: a marker's square is 1.5 px


def small_picture(columns: int, rows: int, *, legacy: bool = False, name: str = NAME) -> np.ndarray:
    """OpenCV's own drawing of a board, so small, blurred and noisy that hardly a marker can be read."""
    board = cv2.aruco.CharucoBoard((columns, rows), 0.03, 0.021, dictionary(name))
    board.setLegacyPattern(legacy)
    large = board.generateImage((columns * 60 + 60, rows * 60 + 60), marginSize=30)
    small = cv2.resize(
        large, ((columns + 1) * SQUARE, (rows + 1) * SQUARE), interpolation=cv2.INTER_AREA
    ).astype(float)
    blurred = cv2.GaussianBlur(60 + 0.5 * np.pad(small, 30, constant_values=120), (0, 0), 0.9)
    noise = np.random.default_rng(0).normal(0.0, 2.0, blurred.shape)
    return np.clip(blurred + noise, 0, 255).astype(np.uint8)


def where(columns: int, rows: int) -> np.ndarray:
    """Where its corners are, px."""
    row, column = np.mgrid[1:rows, 1:columns].reshape(2, -1)
    return (np.stack([column, row], axis=1) + 0.5) * SQUARE + 29.5


def small_aprilgrid(board: AprilGrid, way_up: int) -> tuple[np.ndarray, np.ndarray]:
    """A board whose tags' squares are 1.8 px, turned by quarters from how OpenCV draws them; its corners."""
    module, gap, margin = 12, 36, 90  # px, before it is made smaller
    picture = np.full((4 * 156 + gap + 2 * margin, 5 * 156 + gap + 2 * margin), 255.0)
    for row in range(5):
        for column in range(6):  # the squares between tags
            y, x = margin + 156 * row, margin + 156 * column
            picture[y : y + gap, x : x + gap] = 0
    for number in range(20):
        row, column = 3 - number // 5, number % 5
        y, x = margin + gap + 156 * row, margin + gap + 156 * column
        black = np.rot90(marker_modules(APRILTAGS, number, border=BORDER_SQUARES), way_up)
        picture[y : y + 120, x : x + 120] = np.where(np.kron(black, np.ones((module, module))), 0, 255)
    shrunk = 0.15
    small = cv2.resize(60 + 0.5 * picture, None, fx=shrunk, fy=shrunk, interpolation=cv2.INTER_AREA)
    noise = np.random.default_rng(0).normal(0.0, 2.0, small.shape)
    blurred = cv2.GaussianBlur(small, (0, 0), 0.8) + noise
    low = np.array([margin + gap, margin + gap + 4 * 156 - gap])  # of corner 0, the bottom left
    corners = (low + board.points()[:, :2] / board.size * 120.0) * shrunk - 0.5
    return np.clip(blurred, 0, 255).astype(np.uint8), corners


@pytest.mark.parametrize("negative", [False, True], ids=["black", "white"])
@pytest.mark.parametrize("legacy", [False, True], ids=["new", "old"])
def test_ids_are_known_where_hardly_a_marker_can_be_read(legacy, negative):
    picture = small_picture(9, 6, legacy=legacy)
    picture = np.rot90(255 - picture if negative else picture)
    assert len(find_markers(picture, NAME, 100).numbers) <= 5  # of 27
    sight = see(picture, target_of(Charuco(9, 6, 0.03, 0.021, NAME)))
    assert isinstance(sight, Sight)
    assert len(sight.ids) >= 38  # of 40
    x, y = where(9, 6)[sight.ids].T
    turned = np.stack([y, picture.shape[0] - 1 - x], axis=1)
    assert np.linalg.norm(sight.pixels - turned, axis=1).max() < 0.3


def test_a_corner_too_many_beyond_the_board_does_not_make_one_layout_of_the_other():
    picture = small_picture(9, 6)  # the old layout has the same markers a column on
    y, x = (np.array([1, 9]) + 0.5) * SQUARE + 29.5
    picture[int(y) : int(y) + SQUARE, int(x) : int(x) + SQUARE] = 60  # its corners are two more of a lattice
    sight = see(picture, target_of(Charuco(9, 6, 0.03, 0.021, NAME)))
    assert isinstance(sight, Sight)
    assert np.linalg.norm(sight.pixels - where(9, 6)[sight.ids], axis=1).max() < 0.3


@pytest.mark.parametrize("way_up", [0, 2], ids=["OpenCV", "Kalibr"])
def test_small_tags_are_read_together_whichever_way_up_they_are_printed(way_up):
    board = AprilGrid(5, 4, 0.03, 0.3)
    picture, truth = small_aprilgrid(board, way_up)
    assert len(find_markers(picture, APRILTAGS, 100, border=BORDER_SQUARES).numbers) <= 2  # of 20
    sight = see(np.ascontiguousarray(picture[::-1, ::-1]), target_of(board))  # upside down
    assert isinstance(sight, Sight)
    assert len(sight.ids) >= 76  # of 80
    turned = np.array(picture.shape[::-1]) - 1 - truth[sight.ids]
    assert np.linalg.norm(sight.pixels - turned, axis=1).max() < 0.5


def test_a_board_with_other_markers_or_none_is_not_taken():
    board = target_of(Charuco(9, 6, 0.03, 0.021, NAME))
    other = small_picture(9, 6, name="DICT_5X5_100")
    row, column = np.mgrid[: other.shape[0], : other.shape[1]] - 30 - SQUARE // 2
    plain = np.where((row // SQUARE + column // SQUARE) % 2, 180, 60).astype(np.uint8)
    for picture in (other, cv2.GaussianBlur(plain, (0, 0), 0.9), small_picture(6, 9)):
        assert isinstance(see(picture, board), Unseen)


def test_beyond_a_hidden_column_the_ids_go_on_as_they_ought_to():
    picture, truth = small_picture(9, 6), where(9, 6)
    middle = int(truth[3, 0])
    picture[:, middle - 6 : middle + 7] = 110
    sight = see(picture, target_of(Charuco(9, 6, 0.03, 0.021, NAME)))
    assert isinstance(sight, Sight)
    assert np.linalg.norm(sight.pixels - truth[sight.ids], axis=1).max() < 0.3


def test_z_of_ways_that_are_wrong_has_mean_0_and_variance_1():
    """Whatever is in the squares, by the markers of the dictionary that are not there."""
    rng, markers = np.random.default_rng(0), drawings_of(NAME, range(27))
    numbers = np.full((6, 9), -1)
    numbers[np.add.outer(np.arange(6), np.arange(9)) % 2 == 1] = np.arange(27)
    z = []
    for _ in range(40):  # markers of this dictionary, but of no board
        drawn = markers.drawn[rng.integers(27, 100, 54)].reshape(6, 9, 4, 4)
        squares = Squares(drawn + rng.normal(0.0, 0.3, drawn.shape), np.ones((6, 9), dtype=bool))
        told = joint_reading._told(squares, 0, markers)
        sums, counts, _ = joint_reading._all_shifts(told, squares.inside, numbers)
        z += (sums[counts > 0] / np.sqrt(counts[counts > 0])).tolist()
        assert likeliest_way(squares, ((1, squares.inside),), (numbers,), markers) is None
    assert abs(np.mean(z)) < 0.2
    assert 0.85 < np.std(z) < 1.15


def test_a_lattice_of_the_right_markers_lies_as_they_say():
    markers = drawings_of(NAME, range(27))
    numbers = np.full((6, 9), -1)
    numbers[np.add.outer(np.arange(6), np.arange(9)) % 2 == 1] = np.arange(27)
    drawn = np.where((numbers >= 0)[..., None], markers.drawn[numbers], 0.0).reshape(6, 9, 4, 4)
    part = np.rot90(np.rot90(drawn, 1, axes=(2, 3)), 1)[2:8, 1:5]
    squares = Squares(part, np.ones(part.shape[:2], dtype=bool))
    way = likeliest_way(squares, ((1, np.abs(part).max((2, 3)) > 0),), (numbers,), markers)
    assert way is not None
    assert (way.turns, way.row, way.column, way.layout) == (3, 1, 1, 0)
    assert_array_equal(way.agrees, True)
