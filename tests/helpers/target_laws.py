"""The boards on which every law of targets is tried: list one more and all of them hold for it."""

from __future__ import annotations

import pytest

from orthoscope.targets.aprilgrid import AprilGrid
from orthoscope.targets.board import Board
from orthoscope.targets.charuco import Charuco
from orthoscope.targets.chessboard import Chessboard
from orthoscope.targets.circles import Circles
from orthoscope.targets.grid_board import GridBoard
from orthoscope.targets.marked_chessboard import MarkedChessboard

BOARDS: tuple[Board, ...] = (
    Chessboard(9, 6, 0.025),
    Chessboard(8, 6, 0.02),
    Chessboard(7, 5, 0.0254),
    Chessboard(6, 6, 0.03),
    Chessboard(5, 5, 0.03),
    MarkedChessboard(14, 9, 0.02),
    MarkedChessboard(8, 6, 0.02, discs=((4, 2), (4, 3), (5, 3))),
    MarkedChessboard(7, 5, 0.025, dictionary="DICT_4X4_50", marker=0.02, first=3),
    Charuco(7, 5, 0.03, 0.022, "DICT_5X5_100"),
    Charuco(5, 8, 0.03, 0.024, "DICT_4X4_50", legacy=True, first=17),
    AprilGrid(4, 3, 0.05, 0.3, first=40),
    GridBoard(4, 3, 0.04, 0.01, "DICT_4X4_50", first=5),
    Circles(4, 11, 0.02, "asymmetric", 0.008),
    Circles(5, 6, 0.02, "asymmetric", 0.016),
    Circles(6, 6, 0.02, "symmetric", 0.008),
)

every_board = pytest.mark.parametrize("board", BOARDS, ids=lambda board: board.description)
