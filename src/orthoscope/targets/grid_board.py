"""OpenCV's grid of ArUco markers, its `GridBoard`: `aruco:5x4:40mm:10mm:DICT_4X4_50`, counting markers; then
a marker's side, the gap between markers, and the dictionary.

Markers are numbered row by row from the top left, from 0 where nothing else is said (`:first=17`). A
marker's corners are its top left, then clockwise, and so are their ids: corner c of the n-th marker has the
id 4 n + c, as in OpenCV's `getObjPoints`.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Self

import numpy as np

from orthoscope.geometry.arrays import Float, InputError, Int, ndarray
from orthoscope.targets.board import Board
from orthoscope.targets.chessboard import parse_counts
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

__all__ = ["GridBoard"]


@dataclass(frozen=True)
class GridBoard(Board):
    """Columns x rows markers of `marker` metres, `gap` metres between them.

    Raises:
        InputError: there are fewer than two markers, a length is none, or the dictionary has too few.
    """

    kind = "aruco"
    form = "COLUMNSxROWS:MARKER:GAP:DICTIONARY[:first=NUMBER]"
    example = "aruco:5x4:40mm:10mm:DICT_4X4_50"
    counted = "counting markers"
    advice = "Count its markers, see which dictionary it was made with, and that it is sharp and lit"
    row_by_row = False

    columns: int
    rows: int
    marker: float
    gap: float
    dictionary: str
    first: int = 0

    def __post_init__(self) -> None:
        usable = can_be_printed(self.columns, self.rows, self.marker) and 0 < self.gap < np.inf
        if self.columns * self.rows < 2 or not usable:
            raise InputError(
                f"a grid of {self.columns}x{self.rows} markers of {self.marker:g} m, {self.gap:g} m apart,"
                f" cannot be used; expected at least 2 markers with gaps between them, such as"
                f" {self.example}."
            )
        check_numbers(self.description, *self.markers)

    @classmethod
    def parse(cls, fields: Sequence[str]) -> Self:
        given, first = split_first(fields)
        if len(given) != 4:
            raise cls.not_understood(":".join([cls.kind, *fields]))
        lengths = parse_length(given[1]), parse_length(given[2])
        return cls(*parse_counts(cls, given[0]), *lengths, given[3].strip(), first)

    @property
    def description(self) -> str:
        sizes = f"{self.columns}x{self.rows}:{length_text(self.marker)}:{length_text(self.gap)}"
        return f"{self.kind}:{sizes}:{self.dictionary}{first_text(self.first)}"

    @property
    def grid(self) -> tuple[int, int]:
        return 2 * self.columns, 2 * self.rows

    @property
    def markers(self) -> tuple[str, range]:
        return self.dictionary, range(self.first, self.first + self.columns * self.rows)

    def marker_corners(self) -> Float[ndarray, "k 4 2"]:
        """The corners of each marker, metres."""
        row, column = np.mgrid[: self.rows, : self.columns].reshape(2, -1)
        low = np.stack([column, row], axis=1) * (self.marker + self.gap)
        square = np.array([[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0]]) * self.marker
        return low[:, None] + square

    def places(self) -> Float[ndarray, "m 2"]:
        """In gaps, or in sides of a marker where these are shorter."""
        return self.marker_corners().reshape(-1, 2) / min(self.gap, self.marker)

    def points(self) -> Float[ndarray, "m 3"]:
        corners = self.marker_corners().reshape(-1, 2)
        return np.column_stack([corners, np.zeros(len(corners))])

    def lines(self) -> tuple[Int[ndarray, " k"], ...]:
        corners = np.arange(4 * self.columns * self.rows).reshape(self.rows, self.columns, 4)
        top_left, top_right, bottom_right, bottom_left = np.moveaxis(corners, -1, 0)
        rows = [
            np.stack([left, right], axis=-1).reshape(self.rows, -1)
            for left, right in ((top_left, top_right), (bottom_left, bottom_right))
        ]
        columns = [
            np.stack([top, bottom], axis=-1).transpose(1, 0, 2).reshape(self.columns, -1)
            for top, bottom in ((top_left, bottom_left), (top_right, bottom_right))
        ]
        return tuple(line for lines in (*rows, *columns) for line in lines)

    def drawing(self) -> Drawing:
        module = self.marker / modules_of(self.dictionary)
        shapes = [
            np.tile(corners[0], 2) + module * rectangles_of(marker_modules(self.dictionary, number))
            for number, corners in zip(self.markers[1], self.marker_corners(), strict=True)
        ]
        corners = self.marker_corners().reshape(-1, 2)
        margin = max(self.gap, module)
        return Drawing(corners.min(0) - margin, corners.max(0) + margin, np.concatenate(shapes))

    def symmetries(self) -> tuple[Int[ndarray, " m"], ...]:
        return ()
