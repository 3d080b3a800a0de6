"""The rows and columns of the target as they were seen: which corners of which view lie on one line.

What the paper's J_CR and J_ST, and the straightness of `nmldc`, are sums over. A partial board shows partial
lines.
"""

from __future__ import annotations

from typing import NamedTuple, Self

import numpy as np

from orthoscope.fitting.observations import Observations
from orthoscope.geometry.arrays import Bool, CalibrationError, Int, ndarray
from orthoscope.targets.target import Target

__all__ = ["FEWEST_LINE_CORNERS", "SeenLines"]

# A line that says something has at least this many corners, since any two lie on one.
FEWEST_LINE_CORNERS = 3


class SeenLines(NamedTuple):
    """Lines with at least FEWEST_LINE_CORNERS seen corners, padded to one length.

    Attributes:
        row: (l,) of the observations' table.
        column: (l, w) of the table, its corners in the target's order.
        present: (l, w); padding comes last, its column is 0.
    """

    row: Int[ndarray, " l"]
    column: Int[ndarray, "l w"]
    present: Bool[ndarray, "l w"]

    @classmethod
    def of(cls, observations: Observations, target: Target) -> Self:
        """The lines of every view.

        Raises:
            CalibrationError: no view shows FEWEST_LINE_CORNERS corners of a line.
        """
        on_line = _padded(target.lines, len(target.points))
        column = _column_of(observations, len(target.points))[
            :, on_line
        ]  # (views, lines, places), -1 where not seen
        row, line = np.nonzero((column >= 0).sum(-1) >= FEWEST_LINE_CORNERS)
        if not len(row):
            raise CalibrationError(
                f"no photograph shows {FEWEST_LINE_CORNERS} corners of a row or column of {target.name};"
                " straightness cannot be judged without. Use a target with rows and columns,"
                " photographed whole."
            )
        column = column[row, line]
        place = np.argsort(column < 0, axis=-1, kind="stable")  # the seen ones first, in their order
        column = np.take_along_axis(column, place, axis=-1)
        width = int((column >= 0).sum(-1).max())
        column = column[:, :width]
        return cls(row, np.maximum(column, 0), column >= 0)


def _padded(lines: tuple[ndarray, ...], filling: int) -> Int[ndarray, "lines places"]:
    """Lines of ids as one table, filled up with an id that no corner has."""
    table = np.full((len(lines), max((len(line) for line in lines), default=0)), filling)
    for row, line in zip(table, lines, strict=True):
        row[: len(line)] = line
    return table


def _column_of(observations: Observations, corners: int) -> Int[ndarray, "m p"]:
    """The table's column of each corner of the target in each view, -1 where it was not seen (and for one
    corner more).
    """
    table = np.full((len(observations.order), corners + 1), -1)
    row, column = np.nonzero(observations.present)
    table[row, observations.ids[row, column]] = column
    return table
