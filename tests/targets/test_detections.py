"""Targets, views and detections: what they hold, and what they refuse."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal

from orthoscope.geometry.arrays import InputError, frozen, normalised
from orthoscope.targets.detections import Detections, Outlier, SetAside, View
from orthoscope.targets.lengths import parse_length
from orthoscope.targets.table import parse_target
from orthoscope.targets.target import Target, chessboard

BOARD = chessboard(9, 6, 0.025)


def view(image: str = "a.jpg", ids: tuple[int, ...] = (0, 1, 2)) -> View:
    return View(image, np.array(ids), np.arange(2.0 * len(ids)).reshape(-1, 2))


def test_a_chessboard_runs_row_by_row_from_corner_0():
    assert BOARD.points.shape == (54, 3)
    assert_allclose(
        BOARD.points[[0, 1, 8, 9, 53]],
        [[0, 0, 0], [0.025, 0, 0], [0.2, 0, 0], [0, 0.025, 0], [0.2, 0.125, 0]],
    )
    assert BOARD.grid == (9, 6)


def test_the_lines_of_a_chessboard_are_its_rows_then_its_columns():
    assert len(BOARD.lines) == 6 + 9
    assert_array_equal(BOARD.lines[1], np.arange(9, 18))
    assert_array_equal(BOARD.lines[6], np.arange(0, 54, 9))
    for line in BOARD.lines:
        offsets = BOARD.points[line] - BOARD.points[line[0]]
        assert_allclose(np.cross(offsets, offsets[-1]), 0.0, atol=1e-18)


def test_a_target_is_named_as_it_is_asked_for():
    assert BOARD.name == "chessboard:9x6:25mm"
    again = parse_target(BOARD.name)
    assert_array_equal(again.points, BOARD.points)


@pytest.mark.parametrize(
    ("text", "metres"),
    [("25mm", 0.025), ("2.5cm", 0.025), ("1m", 1.0), ("1in", 0.0254), ("300um", 3e-4), (" 1e1 mm ", 0.01)],
)
def test_a_length_has_a_number_and_a_unit(text, metres):
    assert parse_length(text) == pytest.approx(metres, rel=1e-15)


@pytest.mark.parametrize("text", ["25", "mm", "", "25 miles", "2,5mm", "--mm", "25mm2"])
def test_a_length_that_is_not_understood_is_refused(text):
    with pytest.raises(
        InputError,
        match=r"is not understood; expected a number and a unit \(m, cm, mm, um, in\), such as 25mm",
    ):
        parse_length(text)


@pytest.mark.parametrize(
    ("text", "hint"),
    [
        ("charuco:7x5:30:22mm:DICT_5X5_100", "30mm, where it is millimetres"),
        ("charuco:7x5:30mm:22mm:5x5_100", "Say DICT_5X5_100"),
    ],
)
def test_what_was_left_out_of_a_description_is_said(text, hint):
    with pytest.raises(InputError, match=hint):
        parse_target(text)


@pytest.mark.parametrize(
    "text",
    ["chessboard", "chessboard:9x6", "chessboard:9:6:25mm", "rings:9x6:25mm", "chessboard:9.5x6:25mm", ""],
)
def test_a_target_that_is_not_understood_is_refused(text):
    with pytest.raises(InputError, match="expected chessboard:COLUMNSxROWS:SQUARE"):
        parse_target(text)


@pytest.mark.parametrize(
    "text", ["chessboard:9x6:0mm", "chessboard:9x6:-25mm", "chessboard:2x2:25mm", "chessboard:1x9:25mm"]
)
def test_a_chessboard_that_cannot_be_used_is_refused(text):
    with pytest.raises(InputError, match="cannot be used; expected at least 3x2"):
        parse_target(text)


def test_a_target_off_its_plane_is_refused():
    with pytest.raises(InputError, match="off the plane z = 0"):
        Target("bent", np.array([[0.0, 0.0, 0.0], [1.0, 0.0, 0.1]]))


def test_a_line_through_a_corner_that_is_not_there_is_refused():
    with pytest.raises(InputError, match="has a line through a corner that it does not have"):
        Target("small", np.zeros((3, 3)), (np.array([0, 3]),))


def test_a_view_of_nothing_is_a_view():
    assert len(View("empty.jpg", np.array([], dtype=int), np.empty((0, 2))).ids) == 0


@pytest.mark.parametrize("bad", [np.nan, np.inf])
def test_a_view_with_a_corner_nowhere_is_refused(bad):
    with pytest.raises(
        InputError, match=r"view 'a.jpg': pixels has (nan|inf) at \[1, 0\]; expected finite numbers"
    ):
        View("a.jpg", np.array([0, 1]), np.array([[1.0, 2.0], [bad, 4.0]]))


def test_a_view_with_a_corner_twice_is_refused():
    with pytest.raises(InputError, match=r"view 'a.jpg' has corner 7 more than once"):
        View("a.jpg", np.array([7, 3, 7]), np.zeros((3, 2)))


def test_a_view_with_more_ids_than_pixels_is_refused():
    with pytest.raises(InputError, match=r"pixels has shape \(2, 2\); expected \(3, 2\)"):
        View("a.jpg", np.array([0, 1, 2]), np.zeros((2, 2)))


def test_the_same_photograph_twice_is_refused():
    with pytest.raises(InputError, match=r"view 'a.jpg' is there twice"):
        Detections(BOARD, (640, 480), (view(), view()))


@pytest.mark.parametrize("corner", [54, -1])
def test_a_corner_that_the_target_does_not_have_is_refused(corner):
    with pytest.raises(InputError, match="has corners 0 to 53"):
        Detections(BOARD, (640, 480), (view(ids=(0, corner)),))


def test_images_without_size_are_refused():
    with pytest.raises(InputError, match=r"expected \(width, height\)"):
        Detections(BOARD, (0, 480), ())


def test_detections_count_their_corners():
    assert Detections(BOARD, (640, 480), (view("a.jpg"), view("b.jpg", (4, 5)))).corners == 5


def test_a_choice_of_views_keeps_everything_else():
    detections = Detections(
        BOARD, (640, 480), (view("a.jpg"), view("b.jpg"), view("c.jpg")), (SetAside("d.jpg", "no board"),)
    )
    chosen = detections.only([2, 0])
    assert [entry.image for entry in chosen.views] == ["c.jpg", "a.jpg"]
    assert chosen.target is BOARD
    assert chosen.set_aside == (SetAside("d.jpg", "no board"),)


def test_a_choice_of_views_keeps_the_outliers_of_those_views():
    outliers = (Outlier("a.jpg", 7, (1.0, 2.0), "9 px off"), Outlier("b.jpg", 8, (3.0, 4.0), "5 px off"))
    detections = Detections(BOARD, (640, 480), (view("a.jpg"), view("b.jpg")), outliers=outliers)
    assert detections.only([1]).outliers == outliers[1:]
    assert detections.only([]).outliers == ()


def test_what_is_handed_in_can_be_changed_afterwards():
    pixels = np.zeros((3, 2))
    made = View("a.jpg", np.arange(3), pixels)
    pixels[0, 0] = 5.0
    assert made.pixels[0, 0] == 0.0
    assert not made.pixels.flags.writeable


def test_an_array_of_words_is_refused():
    with pytest.raises(InputError, match="corners is not an array of numbers"):
        frozen(["a", "b"], (None,), "corners")


def test_normalised_vectors_have_length_1():
    assert_allclose(
        np.linalg.norm(normalised(np.array([[3.0, 4.0, 0.0], [1e-8, 0.0, 0.0]])), axis=1), 1.0, rtol=1e-15
    )
