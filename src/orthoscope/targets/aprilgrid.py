"""Kalibr's grid of AprilTags: `aprilgrid:6x6:88mm:0.3`, counting tags, their size, and the gaps over it.

Tags of family 36h11 with a black border of two of their squares; where four of them come together a black
square fills the gap, so that each outer corner of a tag is a corner of four squares, as on a chessboard.
Kalibr counts tags and corners from the bottom left, row by row upwards; our y runs down, so y is its y with
the sign turned.
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
    rectangles_of,
    split_first,
)

__all__ = ["BORDER_SQUARES", "DICTIONARY", "TAG_SQUARES", "AprilGrid"]

# The tags are of this family.
DICTIONARY = "DICT_APRILTAG_36h11"
# The family has so many tags.
TAG_COUNT = 587
# A tag's border has so many squares.
BORDER_SQUARES = 2
# A tag has so many squares along its whole side.
TAG_SQUARES = 10


@dataclass(frozen=True)
class AprilGrid(Board):
    """Columns x rows tags of `size` metres, the gaps between them `spacing` of it.

    Raises:
        InputError: there are no tags or more than the family has, or a size is none.
    """

    kind = "aprilgrid"
    form = "COLUMNSxROWS:TAG:SPACING[:first=NUMBER]"
    example = "aprilgrid:6x6:88mm:0.3"
    counted = "counting tags, the spacing as a share of a tag"
    advice = "Count its tags, and see that it is sharp and lit and its black corner squares are there"

    columns: int
    rows: int
    size: float
    spacing: float
    first: int = 0

    def __post_init__(self) -> None:
        tags = 0 < self.columns * self.rows <= TAG_COUNT
        if not (tags and can_be_printed(self.columns, self.rows, self.size) and 0 < self.spacing <= 1):
            raise InputError(
                f"an AprilGrid of {self.columns}x{self.rows} tags of {self.size:g} m with gaps of"
                f" {self.spacing:g} of that cannot be used; expected 1 to {TAG_COUNT} tags and gaps above 0"
                f" up to 1, such as {self.example}."
            )
        check_numbers(self.description, *self.markers)

    @classmethod
    def parse(cls, fields: Sequence[str]) -> Self:
        given, first = split_first(fields)
        if len(given) != 3:
            raise cls.not_understood(":".join([cls.kind, *fields]))
        try:
            spacing = float(given[2])
        except ValueError as error:
            raise cls.not_understood(":".join([cls.kind, *fields])) from error
        return cls(*parse_counts(cls, given[0]), parse_length(given[1]), spacing, first)

    @property
    def description(self) -> str:
        counts = f"{self.columns}x{self.rows}"
        return f"{self.kind}:{counts}:{length_text(self.size)}:{self.spacing:.10g}{first_text(self.first)}"

    @property
    def markers(self) -> tuple[str, range]:
        return DICTIONARY, range(self.first, self.first + self.columns * self.rows)

    @property
    def grid(self) -> tuple[int, int]:
        return 2 * self.columns, 2 * self.rows

    def places(self) -> Float[ndarray, "m 2"]:
        """In gaps between tags, so that a step is as far as a corner's black squares reach."""
        tag = 1.0 / self.spacing
        column, row = (
            np.add.outer(np.arange(count) * (1.0 + tag), [0.0, tag]).ravel()
            for count in (self.columns, self.rows)
        )
        x, y = np.meshgrid(column, row)
        return np.stack([x.ravel(), y.ravel()], axis=1)

    def points(self) -> Float[ndarray, "m 3"]:
        x, y = self.places().T * (self.spacing * self.size)
        return np.stack([x, -y, np.zeros_like(x)], axis=1)

    def tag_corners(self) -> Int[ndarray, "k 4"]:
        """Ids of the corners of each tag: its top left as printed, then clockwise."""
        ids = np.arange(4 * self.columns * self.rows).reshape(2 * self.rows, 2 * self.columns)
        low, high = ids[0::2], ids[1::2]
        corners = np.stack([high[:, 0::2], high[:, 1::2], low[:, 1::2], low[:, 0::2]], axis=-1)
        return corners.reshape(-1, 4)

    def drawing(self) -> Drawing:
        gap = self.spacing * self.size
        points, shapes = self.points()[:, :2], []
        for number, (top_left, top_right, _, bottom_left) in enumerate(self.tag_corners()):
            black = marker_modules(DICTIONARY, self.first + number, border=BORDER_SQUARES)
            black = np.rot90(black, 2)  # OpenCV prints these tags upside down
            shapes.append(np.tile(points[top_left], 2) + rectangles_of(black) * (self.size / len(black)))
            for corner, step in ((top_left, (-1, -1)), (top_right, (1, -1)), (bottom_left, (-1, 1))):
                shapes.append(np.concatenate([points[corner], points[corner] + gap * np.array(step)])[None])
            right = points[top_right] + [0.0, self.size]
            shapes.append(np.concatenate([right, right + gap])[None])
        boxes = np.concatenate(shapes).reshape(-1, 2, 2)
        boxes = np.concatenate([boxes.min(1), boxes.max(1)], axis=1)
        _, first = np.unique(
            np.round(boxes / gap, 6), axis=0, return_index=True
        )  # neighbours share their squares
        low, high = points.min(0) - 2.0 * gap, points.max(0) + 2.0 * gap
        return Drawing(low, high, boxes[first])

    def symmetries(self) -> tuple[Int[ndarray, " m"], ...]:
        return ()
