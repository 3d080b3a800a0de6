"""The boards on which every law of targets is tried: list one more and all of them hold for it."""

from __future__ import annotations

import pytest

from orthoscope.targets.board import Board
from orthoscope.targets.chessboard import Chessboard

BOARDS: tuple[Board, ...] = (
    Chessboard(9, 6, 0.025),
    Chessboard(8, 6, 0.02),
    Chessboard(7, 5, 0.0254),
    Chessboard(6, 6, 0.03),
    Chessboard(5, 5, 0.03),
)

every_board = pytest.mark.parametrize("board", BOARDS, ids=lambda board: board.description)
