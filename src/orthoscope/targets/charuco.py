"""ChArUco, a chessboard with a marker in each white square: `charuco:7x5:30mm:22mm:DICT_5X5_100`, counting
squares.

OpenCV counts squares of these boards, of chessboards inner corners; so do we. Its boards begin with a black
square at the top left; those of OpenCV before 4.6 (`:legacy` at the end) begin with a white one where the
rows of squares are even. The corners are the same, only the markers lie elsewhere. Markers are numbered row
by row, from 0 where nothing else is said (`:first=17`), corners too.
"""

from __future__ import annotations

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

__all__ = ["Charuco"]

LEGACY = "legacy"


@dataclass(frozen=True)
class Charuco(Board):
    """A ChArUco board of columns x rows squares of `square` metres, with markers of `marker` metres.

    Raises:
        InputError: it has fewer than 3x3 squares, a marker does not fit, or the dictionary has too few.
    """

    kind = "charuco"
    form = "COLUMNSxROWS:SQUARE:MARKER:DICTIONARY[:legacy][:first=NUMBER]"
    example = "charuco:7x5:30mm:22mm:DICT_5X5_100"
    counted = "counting squares"
    advice = "Count its squares, see which dictionary it was made with, and that it is sharp and lit"

    columns: int
    rows: int
    square: float
    marker: float
    dictionary: str
    legacy: bool = False
    first: int = 0

    def __post_init__(self) -> None:
        usable = can_be_printed(self.columns, self.rows, self.square) and 0 < self.marker < self.square
        if min(self.columns, self.rows) < 3 or not usable:
            raise InputError(
                f"a ChArUco board of {self.columns}x{self.rows} squares of {self.square:g} m with markers of"
                f" {self.marker:g} m cannot be used; expected at least 3x3 squares, and markers smaller than"
                f" these, such as {self.example}."
            )
        check_numbers(self.description, *self.markers)

    @classmethod
    def parse(cls, fields: Sequence[str]) -> Self:
        given, first = split_first(fields)
        if len(given) not in (4, 5) or given[4:] not in ([], [LEGACY]):
            raise cls.not_understood(":".join([cls.kind, *fields]))
        return cls(
            *parse_counts(cls, given[0]),
            parse_length(given[1]),
            parse_length(given[2]),
            given[3].strip(),
            len(given) == 5,
            first,
        )

    @property
    def description(self) -> str:
        sizes = f"{self.columns}x{self.rows}:{length_text(self.square)}:{length_text(self.marker)}"
        legacy = f":{LEGACY}" if self.legacy else ""
        return f"{self.kind}:{sizes}:{self.dictionary}{legacy}{first_text(self.first)}"

    @property
    def markers(self) -> tuple[str, range]:
        return self.dictionary, range(self.first, self.first + len(self.marker_squares()))

    @property
    def grid(self) -> tuple[int, int]:
        return self.columns - 1, self.rows - 1

    @property
    def arm(self) -> float:
        """How far from a square's side its marker begins, in squares."""
        return 0.5 * (1.0 - self.marker / self.square)

    def points(self) -> Float[ndarray, "m 3"]:
        places = self.places() * self.square
        return np.column_stack([places, np.zeros(len(places))])

    def marker_squares(self, *, legacy: bool | None = None) -> Int[ndarray, "k 2"]:
        """Column and row of the square of each marker, in the order of their numbers."""
        legacy = self.legacy if legacy is None else legacy
        first = 1 if legacy and self.rows % 2 == 0 else 0
        row, column = np.mgrid[: self.rows, : self.columns].reshape(2, -1)
        white = (row + column) % 2 != first
        return np.stack([column, row], axis=1)[white]

    def marker_corners(self, *, legacy: bool | None = None) -> Float[ndarray, "k 4 2"]:
        """The corners of each marker in squares from corner 0, as OpenCV lists them: top left, then
        clockwise.
        """
        low = self.marker_squares(legacy=legacy)[:, None] - 1.0
        inset = self.arm + (1.0 - 2.0 * self.arm) * np.array([[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0]])
        return low + inset

    def drawing(self) -> Drawing:
        squares = self.marker_squares()
        first = int(squares[0].sum() % 2 == 0)
        module = (1.0 - 2.0 * self.arm) / modules_of(self.dictionary)
        shapes = [squares_of(self.columns, self.rows, first)]
        for number, square in enumerate(squares):
            black = rectangles_of(marker_modules(self.dictionary, self.first + number))
            shapes.append(np.tile(square + self.arm, 2) + module * black)
        low = np.array([-1.5, -1.5]) * self.square
        high = (np.array([self.columns, self.rows]) - 0.5) * self.square
        return Drawing(low, high, (np.concatenate(shapes) - 1.0) * self.square)

    def symmetries(self) -> tuple[Int[ndarray, " m"], ...]:
        return ()
