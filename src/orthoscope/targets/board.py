"""What a kind of target says about itself; a leaf of `Board` for each kind, in a file of its own.

A board is the design that was printed: a few counts and lengths. Where its corners are, how it is drawn and
which ways up it looks the same all follow from these. A corner's *id* is its row in `points`; its *place* is
where it stands in the lattice of rows and columns, in steps of that lattice, so that corners of one row and
corners of one column are neighbours by their places whichever of them were found.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Sequence
from dataclasses import dataclass
from typing import ClassVar, Self

import numpy as np

from orthoscope.geometry.arrays import Float, InputError, Int, ndarray
from orthoscope.targets.drawing import Drawing

__all__ = ["Board"]


@dataclass(frozen=True)
class Board(ABC):
    """One kind of target.

    Attributes:
        kind: the word that its descriptions begin with.
        form: what comes after it.
        example: a whole description.
        counted: what a person has to count, in a few words.
        advice: what to look at where no photograph shows it.
        row_by_row: whether ids follow the lattice's rows.
    """

    kind: ClassVar[str]
    form: ClassVar[str]
    example: ClassVar[str]
    counted: ClassVar[str]
    advice: ClassVar[str]
    row_by_row: ClassVar[bool] = True

    @classmethod
    @abstractmethod
    def parse(cls, fields: Sequence[str]) -> Self:
        """The board of a description's fields (what stands between its colons, the kind left out).

        Raises:
            InputError: the fields do not describe such a board.
        """

    @property
    @abstractmethod
    def description(self) -> str:
        """How it is asked for; `parse` gives the same board back."""

    @property
    @abstractmethod
    def grid(self) -> tuple[int, int]:
        """Columns and rows of the lattice of corners."""

    @abstractmethod
    def points(self) -> Float[ndarray, "m 3"]:
        """Where the corners are: metres, target frame, z = 0, in the order of their ids."""

    @abstractmethod
    def drawing(self) -> Drawing:
        """What is printed."""

    @abstractmethod
    def symmetries(self) -> tuple[Int[ndarray, " m"], ...]:
        """Every way to number the corners, but for their own, under which the board looks the same.

        Each is (m,): entry k is the id that corner k then has. No way where the board tells its ends apart.
        """

    def mistaken_for(self, other: Board) -> bool:
        """Whether a photograph of both boards may not tell which of them is which."""
        mine, theirs = self.markers, other.markers
        if mine and theirs:
            return mine[0] == theirs[0] and not set(mine[1]).isdisjoint(theirs[1])
        return self.kind == other.kind and sorted(self.grid) == sorted(other.grid)

    @property
    def markers(self) -> tuple[str, range] | None:
        """The dictionary of its markers and their numbers in it; None where it has none."""
        return None

    @property
    def disc_radius(self) -> float:
        """Radius of the discs whose centres the corners are, metres; 0 where they are points."""
        return 0.0

    def places(self) -> Float[ndarray, "m 2"]:
        """Column and row of each corner in the lattice, in steps (not whole ones where steps differ)."""
        columns, rows = self.grid
        row, column = np.mgrid[:rows, :columns].reshape(2, -1).astype(float)
        return np.stack([column, row], axis=1)

    def lines(self) -> tuple[Int[ndarray, " k"], ...]:
        """Ids of the corners of each row, then of each column, in order."""
        columns, rows = self.grid
        ids = np.arange(columns * rows).reshape(rows, columns)
        return (*ids, *ids.T)

    @classmethod
    def not_understood(cls, text: str) -> InputError:
        """The error of a description that is none of this kind's."""
        return InputError(
            f"target {text!r} is not understood; expected {cls.kind}:{cls.form}, {cls.counted}, such as"
            f" {cls.example}."
        )
