"""The chessboard: `chessboard:9x6:25mm` has 9x6 inner corners, so 10x7 squares, of 25 mm.

A square is black where the sum of its column and row is even, counted from the one whose far corner is corner
0; a white margin of one square goes around. The pattern turned by half a turn is the same where columns and
rows are both even or both odd; by a quarter where both are the same even number.
"""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Self

import numpy as np

from orthoscope.geometry.arrays import Float, InputError, Int, ndarray
from orthoscope.targets.board import Board
from orthoscope.targets.drawing import Drawing
from orthoscope.targets.lengths import MOST_SQUARES, can_be_printed, length_text, parse_length

__all__ = ["Chessboard", "parse_counts", "squares_of"]


@dataclass(frozen=True)
class Chessboard(Board):
    """A chessboard of columns x rows inner corners, `square` metres apart.

    Raises:
        InputError: it has fewer than 3x2 corners, or a square without a size.
    """

    kind = "chessboard"
    form = "COLUMNSxROWS:SQUARE"
    example = "chessboard:9x6:25mm"
    counted = "counting inner corners"
    advice = (
        "Count its inner corners (one fewer than squares, each way), and see that it is whole, sharp and lit"
    )

    columns: int
    rows: int
    square: float

    def __post_init__(self) -> None:
        few = min(self.columns, self.rows) < 2 or self.columns * self.rows < 6
        if few or not can_be_printed(self.columns, self.rows, self.square):
            raise InputError(
                f"a chessboard of {self.columns}x{self.rows} inner corners of {self.square:g} m cannot be"
                f" used; expected at least 3x2 inner corners and at most {MOST_SQUARES}, and a square larger"
                " than 0 and smaller than 10 km, such as chessboard:9x6:25mm."
            )

    @classmethod
    def parse(cls, fields: Sequence[str]) -> Self:
        if len(fields) != 2:
            raise cls.not_understood(":".join([cls.kind, *fields]))
        return cls(*parse_counts(cls, fields[0]), parse_length(fields[1]))

    @property
    def description(self) -> str:
        return f"{self.kind}:{self.columns}x{self.rows}:{length_text(self.square)}"

    @property
    def grid(self) -> tuple[int, int]:
        return self.columns, self.rows

    def points(self) -> Float[ndarray, "m 3"]:
        return np.column_stack([self.places() * self.square, np.zeros(self.columns * self.rows)])

    def drawing(self) -> Drawing:
        square = self.square
        black = squares_of(self.columns + 1, self.rows + 1, 0)
        low = np.array([-2.0, -2.0]) * square
        return Drawing(low, np.array([self.columns + 1.0, self.rows + 1.0]) * square, (black - 1.0) * square)

    def symmetries(self) -> tuple[Int[ndarray, " m"], ...]:
        ids = np.arange(self.columns * self.rows).reshape(self.rows, self.columns)
        quarters = (1, 2, 3) if self.columns == self.rows and self.columns % 2 == 0 else (2,)
        return (
            tuple(np.rot90(ids, quarter).ravel() for quarter in quarters)
            if (self.columns + self.rows) % 2 == 0
            else ()
        )


def parse_counts(kind: type[Board], text: str) -> tuple[int, int]:
    """Columns and rows of a field such as `9x6`.

    Raises:
        InputError: it is no such field.
    """
    found = re.fullmatch(r"\s*([0-9]{1,9})x([0-9]{1,9})\s*", text)
    if not found:
        raise kind.not_understood(f"{kind.kind}:{text}")
    return int(found[1]), int(found[2])


def squares_of(columns: int, rows: int, odd: int) -> Float[ndarray, "n 4"]:
    """The squares whose column and row add up to an even (`odd` = 0) or an odd number, as rectangles."""
    y, x = np.mgrid[:rows, :columns].reshape(2, -1)
    mine = (x + y) % 2 == odd
    return np.stack([x, y, x + 1, y + 1], axis=1)[mine].astype(float)
