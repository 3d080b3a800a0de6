"""A grid of black discs: `circles:4x11:20mm:asymmetric` is OpenCV's, counting the discs of a row, and rows.

Symmetric, disc j of row i stands at (j, i) steps; asymmetric at (2 j + i mod 2, i), so that odd rows stand
between the columns of even ones. What is seen of a disc is its outline, whose centre is not where the disc's
own centre is seen; how far they are apart depends on the disc's size, so its diameter is part of the
description where it is not OpenCV's, 0.4 steps.
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
from orthoscope.targets.lengths import length_text, parse_length

__all__ = ["Circles"]

SYMMETRIC, ASYMMETRIC = "symmetric", "asymmetric"
# OpenCV's generator draws discs with this share of a step as diameter.
USUAL_DIAMETER_SHARE = 0.4
# From a disc to the next it is so many steps.
NEAREST_STEPS = {SYMMETRIC: 1.0, ASYMMETRIC: np.sqrt(2.0)}
# A board has at least this many discs.
FEWEST_DISCS = 6


@dataclass(frozen=True)
class Circles(Board):
    """Rows of `columns` discs of `diameter` metres, in steps of `spacing` metres.

    Raises:
        InputError: there are too few discs, a length is none, or the discs touch.
    """

    kind = "circles"
    form = "COLUMNSxROWS:SPACING:asymmetric|symmetric[:DIAMETER]"
    example = "circles:4x11:20mm:asymmetric"
    counted = "counting discs of a row, then rows"
    advice = "Count its discs, see whether every other row stands between the columns, and that it is sharp"

    columns: int
    rows: int
    spacing: float
    layout: str
    diameter: float

    def __post_init__(self) -> None:
        if self.layout not in NEAREST_STEPS:
            raise InputError(
                f"a grid of circles is {self.layout!r}; expected {SYMMETRIC} or {ASYMMETRIC},"
                f" such as {self.example}."
            )
        few = min(self.columns, self.rows) < 2 or self.columns * self.rows < FEWEST_DISCS
        if few or not 0 < self.diameter < self.nearest < np.inf:
            raise InputError(
                f"a grid of {self.columns}x{self.rows} circles {self.spacing:g} m apart with diameters of"
                f" {self.diameter:g} m cannot be used; expected at least {FEWEST_DISCS} that do not"
                f" touch, such as {self.example}."
            )

    @classmethod
    def parse(cls, fields: Sequence[str]) -> Self:
        if len(fields) not in (3, 4) or fields[2].strip() not in NEAREST_STEPS:
            raise cls.not_understood(":".join([cls.kind, *fields]))
        spacing = parse_length(fields[1])
        diameter = parse_length(fields[3]) if len(fields) == 4 else USUAL_DIAMETER_SHARE * spacing
        return cls(*parse_counts(cls, fields[0]), spacing, fields[2].strip(), diameter)

    @property
    def description(self) -> str:
        usual = length_text(USUAL_DIAMETER_SHARE * self.spacing)
        size = length_text(self.diameter)
        told = "" if size == usual else f":{size}"
        return f"{self.kind}:{self.columns}x{self.rows}:{length_text(self.spacing)}:{self.layout}{told}"

    @property
    def grid(self) -> tuple[int, int]:
        return self.columns, self.rows

    @property
    def disc_radius(self) -> float:
        return 0.5 * self.diameter

    @property
    def nearest(self) -> float:
        """From a disc to the next, metres."""
        return NEAREST_STEPS[self.layout] * self.spacing

    def places(self) -> Float[ndarray, "m 2"]:
        places = super().places()
        if self.layout == ASYMMETRIC:
            places[:, 0] = 2.0 * places[:, 0] + places[:, 1] % 2.0
        return places

    def neighbour_places(self) -> Int[ndarray, "m 2"]:
        """Places in a lattice in which discs that are next to each other are one step apart."""
        x, y = self.places().astype(int).T
        return np.stack([x, y] if self.layout == SYMMETRIC else [(x + y) // 2, (y - x) // 2], axis=1)

    def points(self) -> Float[ndarray, "m 3"]:
        places = self.places() * self.spacing
        return np.column_stack([places, np.zeros(len(places))])

    def lines(self) -> tuple[Int[ndarray, " k"], ...]:
        ids = np.arange(self.columns * self.rows).reshape(self.rows, self.columns)
        every = 1 if self.layout == SYMMETRIC else 2
        columns = (line for first in range(every) for line in ids[first::every].T)
        return (*ids, *(line for line in columns if len(line) > 1))

    def drawing(self) -> Drawing:
        centres = self.points()[:, :2]
        margin = 0.5 * self.diameter + self.spacing
        discs = np.column_stack([centres, np.full(len(centres), self.disc_radius)])
        return Drawing(centres.min(0) - margin, centres.max(0) + margin, discs=discs)

    def symmetries(self) -> tuple[Int[ndarray, " m"], ...]:
        ids = np.arange(self.columns * self.rows).reshape(self.rows, self.columns)
        if self.layout == ASYMMETRIC:
            return () if self.rows % 2 else (np.rot90(ids, 2).ravel(),)
        quarters = (1, 2, 3) if self.columns == self.rows else (2,)
        return tuple(np.rot90(ids, quarter).ravel() for quarter in quarters)
