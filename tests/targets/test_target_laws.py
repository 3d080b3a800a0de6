"""What holds for every kind of target: descriptions, files, and which ways up it looks the same."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal

from helpers.target_laws import BOARDS, every_board
from orthoscope.formats.own.json import load_detections, save
from orthoscope.geometry.arrays import InputError
from orthoscope.simulation.sheet import Sheet
from orthoscope.targets.chessboard import Chessboard
from orthoscope.targets.detections import Detections, View
from orthoscope.targets.table import TARGETS, parse_target
from orthoscope.targets.target import Target, target_of


def test_every_kind_is_among_the_boards_on_which_laws_are_tried():
    assert {board.kind for board in BOARDS} == set(TARGETS)


@every_board
def test_a_description_gives_its_board_back(board):
    assert parse_target(board.description).board == board


@pytest.mark.parametrize("kind", TARGETS.values(), ids=TARGETS)
def test_the_example_of_each_kind_is_one_and_nonsense_names_it(kind):
    assert isinstance(parse_target(kind.example).board, kind)
    with pytest.raises(InputError, match=kind.kind):
        parse_target(f"{kind.kind}:nonsense")
    with pytest.raises(InputError, match=kind.kind):
        parse_target("nonsense:9x6:25mm")


@every_board
def test_points_are_on_their_lines_and_at_their_places(board):
    points, places, lines = board.points(), board.places(), board.lines()
    columns, rows = board.grid
    assert points.shape == (len(places), 3)
    assert_allclose(places.min(0), 0.0)
    assert places[:, 0].max() >= columns - 1
    assert places[:, 1].max() >= rows - 1
    for line in lines:
        along = points[line] - points[line[0]]
        assert_allclose(np.cross(along, along[-1]), 0.0, atol=1e-15)
        assert (np.diff(along @ along[-1]) > 0).all()


@every_board
def test_a_board_comes_back_from_a_file_as_it_was(board, tmp_path):
    target = target_of(board)
    ids = np.arange(5)
    save(Detections(target, (640, 480), (View("a", ids, ids[:, None] + np.zeros(2)),)), tmp_path / "d.json")
    again = load_detections(tmp_path / "d.json").target
    assert again.kind == board.kind
    assert again.name == target.name
    assert again.board is not None
    assert again.board.description == board.description
    assert_array_equal(again.points, target.points)


def moved_onto_itself(points: np.ndarray, quarter: int) -> np.ndarray | None:
    """The id that each corner has after quarter turns about the middle; None where there is no such."""
    middle = 0.5 * (points.min(0) + points.max(0))
    turn = np.linalg.matrix_power(np.array([[0.0, -1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, 1.0]]), quarter)
    turned = (points - middle) @ turn.T + middle
    apart = np.linalg.norm(turned[:, None] - points, axis=-1)
    ids = apart.argmin(1)
    return ids if apart[np.arange(len(ids)), ids].max() < 1e-9 else None


def looks(board, places: np.ndarray) -> np.ndarray:
    """Grey at places (n,2) of the drawing."""
    sheet = Sheet(board.drawing(), black=0.0, white=1.0)
    tiny = np.full((2, 2, len(places)), 1e-9)
    return sheet.look(places.T.copy(), tiny, 1)[1]


@every_board
def test_a_board_is_said_to_look_the_same_turned_exactly_where_its_drawing_does(board):
    points = board.points()
    middle = 0.5 * (points.min(0) + points.max(0))[:2]
    rng = np.random.default_rng(0)
    half = np.min([middle - board.drawing().low, board.drawing().high - middle], axis=0)
    places = middle + rng.uniform(-0.97, 0.97, (4000, 2)) * half.min()
    expected = []
    for quarter in (1, 2, 3):
        ids = moved_onto_itself(points, quarter)
        turn = np.linalg.matrix_power(np.array([[0.0, -1.0], [1.0, 0.0]]), quarter)
        turned = (places - middle) @ turn.T + middle
        if ids is not None and np.abs(looks(board, turned) - looks(board, places)).mean() < 1e-3:
            expected.append(ids)
    said = board.symmetries()
    assert len(said) == len(expected)
    assert {tuple(ids) for ids in said} == {tuple(ids) for ids in expected}


def test_a_target_by_hand_with_a_grid_is_a_chessboard_and_without_one_is_points():
    points = np.array([1.0, 2.0, 0.0]) + Chessboard(9, 6, 0.02).points()
    by_hand = Target("mine", points, grid=(9, 6))
    assert by_hand.board is not None
    assert by_hand.board.description == "chessboard:9x6:20mm"
    assert_allclose(by_hand.drawing().low, [0.96, 1.96])  # two squares beyond the first corner
    assert Target("mine", points).kind == "points"


def test_a_target_whose_points_are_not_where_its_board_has_them_is_not_drawn():
    points = Chessboard(9, 6, 0.02).points() * [1.0, 1.1, 1.0]
    with pytest.raises(InputError, match="cannot be drawn"):
        Target("mine", points, grid=(9, 6)).drawing()


def test_a_grid_has_as_many_points_as_it_says():
    with pytest.raises(InputError, match="a grid of 9x7 has 63"):
        Target("mine", Chessboard(9, 6, 0.02).points(), grid=(9, 7))
