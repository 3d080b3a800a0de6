"""The chessboard with marks in its middle, by which any part of it that shows them is told from any other.

`marked:14x9:25mm` is OpenCV's: three squares in an L have a disc in their middle, white on black and black on
white, of .17 squares' radius. `marked:9x6:25mm:DICT_4X4_50:18mm` has an ArUco marker in the white square that
is nearest to its middle. Corners are counted as a chessboard's, squares from the black one whose far corner
is corner 0.
"""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Self

import numpy as np

from orthoscope.geometry.arrays import Float, InputError, Int, ndarray
from orthoscope.targets.board import Board
from orthoscope.targets.chessboard import parse_counts, squares_of
from orthoscope.targets.drawing import Drawing
from orthoscope.targets.lengths import can_be_printed, length_text, parse_length
from orthoscope.targets.markers import (
    check_numbers,
    first_text,
    marker_modules,
    modules_of,
    rectangles_of,
    split_first,
)

__all__ = ["DISC_RADIUS", "MarkedChessboard"]

# Radius of a disc, in squares, as OpenCV's generator draws it.
DISC_RADIUS = 0.17
# What stands before the squares of the discs where they are others than the usual ones.
DISCS = "discs="
# Fewest inner corners either way: a mark's square has four of them.
FEWEST = 4

Square = tuple[int, int]


@dataclass(frozen=True)
class MarkedChessboard(Board):
    """A chessboard of columns x rows inner corners, `square` metres apart, with discs or a marker.

    Attributes:
        discs: column and row of the squares with a disc; none where there is a marker.
        dictionary: of the marker; empty where there are discs.
        marker: its side, metres.
        first: its number.
    Raises:
        InputError: it has fewer than 4x4 corners, a square has no size, a disc is in no inner square, or the
            marker does not fit.
    """

    kind = "marked"
    form = "COLUMNSxROWS:SQUARE[:discs=COLUMN.ROW+...|:DICTIONARY:MARKER[:first=NUMBER]]"
    example = "marked:14x9:25mm"
    counted = "a chessboard with discs or an ArUco marker in its middle, counting inner corners"
    advice = "Count its inner corners, see which squares its marks are in, and that it is sharp and lit"

    columns: int
    rows: int
    square: float
    discs: tuple[Square, ...] = ()
    dictionary: str = ""
    marker: float = 0.0
    first: int = 0

    def __post_init__(self) -> None:
        if min(self.columns, self.rows) < FEWEST or not can_be_printed(self.columns, self.rows, self.square):
            raise InputError(
                f"a marked chessboard of {self.columns}x{self.rows} inner corners of {self.square:g} m cannot"
                f" be used; expected at least {FEWEST}x{FEWEST}, such as {self.example}."
            )
        if self.dictionary:
            if not 0 < self.marker < self.square:
                raise InputError(
                    f"a marker of {self.marker:g} m does not fit into a square of {self.square:g} m; expected"
                    " a smaller one."
                )
            check_numbers(self.description, self.dictionary, range(self.first, self.first + 1))
        squares = self.discs or (() if self.dictionary else _usual_discs(self.columns, self.rows))
        object.__setattr__(self, "discs", tuple((int(column), int(row)) for column, row in squares))
        for column, row in self.discs:
            if not (0 < column < self.columns and 0 < row < self.rows):
                raise InputError(
                    f"a disc in square {column}.{row} is not inside a board of {self.columns}x{self.rows}"
                    f" inner corners; expected columns 1 to {self.columns - 1} and rows 1 to {self.rows - 1}."
                )

    @classmethod
    def parse(cls, fields: Sequence[str]) -> Self:
        given, first = split_first(fields)
        if not 2 <= len(given) <= 4:
            raise cls.not_understood(":".join([cls.kind, *fields]))
        counts, square = parse_counts(cls, given[0]), parse_length(given[1])
        if len(given) == 4:
            return cls(*counts, square, (), given[2].strip(), parse_length(given[3]), first)
        discs: list[Square] = []
        if len(given) == 3:
            found = re.fullmatch(DISCS + r"(\d+\.\d+(\+\d+\.\d+)*)", given[2].strip())
            if not found:
                raise cls.not_understood(":".join([cls.kind, *fields]))
            squares = (square.split(".") for square in found[1].split("+"))
            discs = [(int(column), int(row)) for column, row in squares]
        return cls(*counts, square, tuple(discs))

    @property
    def description(self) -> str:
        told = f"{self.kind}:{self.columns}x{self.rows}:{length_text(self.square)}"
        if self.dictionary:
            return f"{told}:{self.dictionary}:{length_text(self.marker)}{first_text(self.first)}"
        if self.discs == _usual_discs(self.columns, self.rows):
            return told
        return f"{told}:{DISCS}{'+'.join(f'{column}.{row}' for column, row in self.discs)}"

    @property
    def grid(self) -> tuple[int, int]:
        return self.columns, self.rows

    @property
    def markers(self) -> tuple[str, range] | None:
        return (self.dictionary, range(self.first, self.first + 1)) if self.dictionary else None

    @property
    def marker_square(self) -> Square:
        """Column and row of the white square that has the marker."""
        column, row = (self.columns + 1) // 2, self.rows // 2
        return (column, row) if (column + row) % 2 else (column - 1, row)

    @property
    def arm(self) -> float:
        """How far from a square's side its mark begins, in squares."""
        return 0.5 * (1.0 - self.marker / self.square) if self.dictionary else 0.5 - DISC_RADIUS

    def marked_corners(self) -> Int[ndarray, " k"]:
        """Ids of the corners of squares with marks."""
        squares = [self.marker_square] if self.dictionary else self.discs
        corners = [self.corners_of(square) for square in squares]
        return np.unique(np.concatenate(corners))

    def corners_of(self, square: Square) -> Int[ndarray, "4"]:
        """Ids of the corners of an inner square: its top left, then clockwise."""
        column, row = square
        first = (row - 1) * self.columns + column - 1
        return np.array([first, first + 1, first + 1 + self.columns, first + self.columns])

    def points(self) -> Float[ndarray, "m 3"]:
        return np.column_stack([self.places() * self.square, np.zeros(self.columns * self.rows)])

    def drawing(self) -> Drawing:
        shapes, discs, holes = [squares_of(self.columns + 1, self.rows + 1, 0)], [], []
        for column, row in self.discs:
            round_ = holes if (column + row) % 2 == 0 else discs
            round_.append([column + 0.5, row + 0.5, DISC_RADIUS])
        if self.dictionary:
            module = (1.0 - 2.0 * self.arm) / modules_of(self.dictionary)
            black = rectangles_of(marker_modules(self.dictionary, self.first))
            shapes.append(np.tile(np.array(self.marker_square) + self.arm, 2) + module * black)
        low = np.array([-2.0, -2.0]) * self.square
        high = np.array([self.columns + 1.0, self.rows + 1.0]) * self.square
        rounds = (np.array(found).reshape(-1, 3) - [1.0, 1.0, 0.0] for found in (discs, holes))
        return Drawing(
            low, high, (np.concatenate(shapes) - 1.0) * self.square, *(some * self.square for some in rounds)
        )

    def symmetries(self) -> tuple[Int[ndarray, " m"], ...]:
        plain, squares = np.zeros((self.rows - 1, self.columns - 1), dtype=bool), self.discs
        for column, row in squares or (self.marker_square,):
            plain[row - 1, column - 1] = True
        ids = np.arange(self.columns * self.rows).reshape(self.rows, self.columns)
        alike = not self.dictionary and (self.columns + self.rows) % 2 == 0
        quarters = (1, 2, 3) if self.columns == self.rows and self.columns % 2 == 0 else (2,)
        return tuple(
            np.rot90(ids, quarter).ravel()
            for quarter in (quarters if alike else ())
            if (np.rot90(plain, quarter) == plain).all()
        )


def _usual_discs(columns: int, rows: int) -> tuple[Square, ...]:
    """The three squares in an L about the middle in which OpenCV's example has discs."""
    column, row = (columns + 1) // 2, rows // 2
    return (column, row), (column, row + 1), (column + 1, row + 1)
