"""A target: a board and where its corners are said to be, the plane z = 0 of the target's frame.

Most targets are made from a description (`table.py`); one made by hand from points takes part as well, and
one whose points run row by row over a grid is looked for in photographs as a chessboard.

Several targets that were photographed together are one `Target` with `members`: the ids of its corners are
those of the first member, then those of the second, and so on, its points stand side by side on one plane. It
is no body: each member has a pose of its own in each photograph, so that a view holds one member's corners.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from orthoscope.geometry.arrays import Float, InputError, Int, frozen, median, ndarray
from orthoscope.targets.board import Board
from orthoscope.targets.chessboard import Chessboard
from orthoscope.targets.drawing import Drawing

__all__ = ["TOGETHER", "Target", "chessboard", "several", "target_of"]

# Points nearer to the drawn ones than this share of the board's size are where they are drawn.
FARTHEST_OFF_SHARE = 1e-6
# What stands between the names of targets that were photographed together.
TOGETHER = " + "
# The gap between members that stand side by side, as a share of the larger one's width.
GAP = 0.5


@dataclass(frozen=True, eq=False)
class Target:
    """A flat calibration target: where its corners nominally are.

    Attributes:
        name: how it is asked for, such as `chessboard:9x6:25mm`.
        points: (m,3) metres, target frame, z = 0.
        lines: ids of the corners of each row and each column, in order.
        grid: (columns, rows) where the points run row by row over a full grid, else None.
        board: what was printed; a chessboard where only a grid is given, None where neither is.
        members: the targets that it is made of, where it is several (made by `several`).
    Raises:
        InputError: a point is not in the plane, a line names a corner that is not there, or the points are
            not as many as the grid or the board has.
    """

    name: str
    points: ndarray
    lines: tuple[ndarray, ...] = ()
    grid: tuple[int, int] | None = None
    board: Board | None = None
    members: tuple[Target, ...] = ()

    def __post_init__(self) -> None:
        points = frozen(self.points, (None, 3), f"target {self.name!r}: points")
        if np.abs(points[:, 2]).max(initial=0.0) > 0.0:
            raise InputError(
                f"target {self.name!r} has points off the plane z = 0; orthoscope calibrates with flat"
                " targets."
            )
        object.__setattr__(self, "points", points)
        lines = tuple(frozen(line, (None,), "line", dtype=np.int64) for line in self.lines)
        if any(((line < 0) | (line >= len(points))).any() for line in lines):
            raise InputError(f"target {self.name!r} has a line through a corner that it does not have.")
        object.__setattr__(self, "lines", lines)
        if self.grid is not None:
            self._check_grid(*self.grid)
        if self.board is None and self.grid is not None:
            object.__setattr__(self, "board", _board_on(self.grid, points))

    def __repr__(self) -> str:
        return f"Target({self.name!r}, {len(self.points)} corners)"

    def _check_grid(self, columns: int, rows: int) -> None:
        if columns * rows != len(self.points):
            raise InputError(
                f"target {self.name!r} has {len(self.points)} points; a grid of {columns}x{rows} has"
                f" {columns * rows}."
            )

    @property
    def kind(self) -> str:
        """The board's kind, a row of TARGETS; `points` where no board is known, `several` where it has
        members.
        """
        return "several" if self.members else self.board.kind if self.board else "points"

    @property
    def parts(self) -> tuple[slice, ...]:
        """The ids of each member's corners; of a single target all of them."""
        ends = np.cumsum([len(member.points) for member in self.members or (self,)]).tolist()
        return tuple(slice(first, end) for first, end in zip([0, *ends], ends, strict=False))

    @property
    def disc_radii(self) -> Float[ndarray, " m"]:
        """Radius of the disc whose centre each corner is, metres; 0 where it is a point."""
        return np.repeat(
            [member.board.disc_radius if member.board else 0.0 for member in self.members or (self,)],
            [len(member.points) for member in self.members or (self,)],
        )

    def drawing(self) -> Drawing:
        """What is printed, in the target's frame.

        Raises:
            InputError: no board is known, or the points are not where its drawing has them.
        """
        if self.members:
            raise InputError(
                f"target {self.name!r} is several sheets; expected one of them. Draw each on its own."
            )
        if self.board is None:
            raise InputError(
                f"target {self.name!r} is known by its points only and cannot be drawn; expected one such as"
                f" {Chessboard.example}."
            )
        printed = self.board.points()
        step = self.points[0] - printed[0]
        if np.abs(self.points - printed - step).max() > FARTHEST_OFF_SHARE * np.ptp(printed, axis=0).max():
            raise InputError(
                f"target {self.name!r} has points that are not where {self.board.description} has them, so it"
                " cannot be drawn; expected a target as its description makes it."
            )
        return self.board.drawing().moved(step[:2])

    def symmetries(self) -> tuple[Int[ndarray, " m"], ...]:
        """Every other way to number the corners under which the target looks the same; see `Board`."""
        return self.board.symmetries() if self.board else ()


def target_of(board: Board) -> Target:
    """The target that a board describes, corners where it is drawn."""
    return Target(
        board.description, board.points(), board.lines(), board.grid if board.row_by_row else None, board
    )


def several(targets: Sequence[Target]) -> Target:
    """Targets that were photographed together, each with a pose of its own; a single one is itself.

    Raises:
        InputError: there are none, or two of them could be taken for each other.
    """
    if not targets:
        raise InputError("no target was named; expected at least one, such as chessboard:9x6:25mm.")
    if len(targets) == 1:
        return targets[0]
    members = tuple(one for target in targets for one in (target.members or (target,)))
    _check_apart(members)
    points, lines, right = [], [], 0.0
    for member in members:
        first = sum(map(len, points))
        low, width = member.points[:, 0].min(), float(np.ptp(member.points[:, 0]))
        left = right + GAP * width if first else 0.0
        points.append(member.points + np.array([left - low, 0.0, 0.0]))
        lines += [line + first for line in member.lines]
        right = float(points[-1][:, 0].max()) + GAP * width
    name = TOGETHER.join(member.name for member in members)
    return Target(name, np.concatenate(points), tuple(lines), members=members)


def _check_apart(members: Sequence[Target]) -> None:
    """Check that a photograph could tell the targets apart.

    Raises:
        InputError: it could not tell two of them.
    """
    for i, member in enumerate(members):
        for other in members[:i]:
            if member.board and other.board and member.board.mistaken_for(other.board):
                raise InputError(
                    f"targets {other.name!r} and {member.name!r} cannot be told apart in a photograph;"
                    " expected boards of other counts or, where they have markers, of other numbers"
                    " (`:first=17` at the end says with which they begin). Take other boards."
                )


def chessboard(columns: int, rows: int, square: float) -> Target:
    """A chessboard of columns x rows inner corners, `square` metres apart; corner 0 first, row by row.

    Raises:
        InputError: it has fewer than 3x2 corners, or a square without a size.
    """
    return target_of(Chessboard(columns, rows, square))


def _board_on(grid: tuple[int, int], points: ndarray) -> Board | None:
    """A chessboard whose square is the usual step along the grid's rows; None where the grid is too small."""
    columns, rows = grid
    steps = np.hypot(*np.diff(points.reshape(rows, columns, 3)[..., :2], axis=1).reshape(-1, 2).T)
    try:
        return Chessboard(columns, rows, median(steps))
    except InputError:
        return None
