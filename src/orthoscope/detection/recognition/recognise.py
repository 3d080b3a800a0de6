"""Which target some photographs show: what markers, corners and discs speak for, tried on them.

What is found is painted over, and the photographs that show it are asked again: several boards in one
photograph are told one after the other.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator, Sequence
from typing import NamedTuple

import cv2
import numpy as np

from orthoscope.detection.chessboards.chessboard import board_size, lattice_sizes
from orthoscope.detection.recognition.disc_layout import disc_boards
from orthoscope.detection.recognition.marker_layout import marker_alone, marker_boards
from orthoscope.detection.several_targets import painted_over
from orthoscope.detection.sight import Sight
from orthoscope.detection.table import see
from orthoscope.files.images import MOST_MEGAPIXELS
from orthoscope.files.pictures import Given, pictures
from orthoscope.geometry.arrays import CalibrationError, InputError, ndarray
from orthoscope.targets.board import Board
from orthoscope.targets.chessboard import Chessboard
from orthoscope.targets.marked_chessboard import MarkedChessboard
from orthoscope.targets.target import Target, target_of

__all__ = ["Recognised", "recognise"]

# So many photographs are looked at, evenly picked.
LOOKED_AT = 8
# Lattices of one size in fewer photographs agree by chance.
ENOUGH_TO_AGREE = 3
# Marks of a chessboard are looked for in so many photographs.
LOOKED_AT_FOR_MARKS = 3
# A square that may have a marker is looked at as a picture of so many pixels to a side.
PATCH = 160
# So many corners around it say where it is.
CORNERS_AROUND = 12
# A marked chessboard has at least so many corners either way.
FEWEST_OF_MARKED = 4
# A marked chessboard is described with it until its marker is read.
ANY_DICTIONARY = "DICT_4X4_50"
# So many boards are told of.
MOST_BOARDS = 6
# A square of a chessboard, as it is described, metres.
NOMINAL = 0.025


class Recognised(NamedTuple):
    """What photographs seem to show.

    Attributes:
        targets: each alone, with lengths of ours, since photographs show ratios only; first the one that was
            seen first.
        seen: how many of the photographs show each and all before it.
        looked_at: how many were looked at.
    """

    targets: tuple[Target, ...]
    seen: tuple[int, ...]
    looked_at: int

    @property
    def words(self) -> str:
        """What a command is told."""
        return " ".join(f"--target {target.name}" for target in self.targets)

    @property
    def sentence(self) -> str:
        """What is seen, and what to say next."""
        shown = [f"{seen} show {target.name}" for target, seen in zip(self.targets, self.seen, strict=True)]
        return (
            f"of {self.looked_at} photographs that were looked at {' and '.join(shown)}, up to lengths, which"
            f" no photograph tells: measure them, and say {self.words} with the true ones"
        )


def recognise(photographs: Given, *, most_megapixels: float = MOST_MEGAPIXELS) -> Recognised:
    """The target that most of some photographs show.

    Args:
        photographs: as in `detect`.
        most_megapixels: larger ones are passed over.
    Raises:
        InputError: there are no photographs.
        CalibrationError: none of the kinds of target is seen.
    """
    greys = _some(photographs, most_megapixels)
    looked_at, targets, seen = len(greys), [], []
    while len(targets) < MOST_BOARDS:
        best = _best(greys, [target.board for target in targets if target.board])
        if best is None:
            break
        targets.append(best.target)
        seen.append(len(best.sights))
        greys = [painted_over(greys[number], best.target, sight) for number, sight in best.sights.items()]
    if not targets:
        raise CalibrationError(
            f"none of {looked_at} photographs shows a chessboard whose four sides are seen, markers in a"
            " known layout, or a grid of discs, nor is a chessboard of one size in most of them. Say which"
            " target it is, or photograph the whole of it."
        )
    return Recognised(tuple(targets), tuple(seen), looked_at)


class _Seen(NamedTuple):
    """A target and what is seen of it, by the number of the photograph."""

    target: Target
    sights: dict[int, Sight]

    @property
    def much(self) -> tuple[int, int]:
        """In how many photographs it is seen, and how many corners of it."""
        return len(self.sights), sum(len(sight.ids) for sight in self.sights.values())


def _best(greys: Sequence[ndarray], others: Sequence[Board]) -> _Seen | None:
    """The target that most photographs show, beside others that are known."""
    best: _Seen | None = None
    for board in _candidates(greys, others):
        if any(board.mistaken_for(other) for other in others):
            continue
        target = target_of(board)
        sights = {number: see(grey, target) for number, grey in enumerate(greys)}
        found = _Seen(target, {number: one for number, one in sights.items() if isinstance(one, Sight)})
        if found.sights and (best is None or found.much > best.much):
            best = found
        if len(found.sights) > 0.5 * len(greys) and board.kind != MarkedChessboard.kind:
            break
    return best


def _some(photographs: Given, most_megapixels: float) -> list[ndarray]:
    given, greys = pictures(photographs), []
    for picture in given[:: max(1, -(-len(given) // LOOKED_AT))]:
        try:
            greys.append(picture.grey(most_megapixels=most_megapixels))
        except InputError:  # `detect` says what is wrong with it
            continue
    if not greys:
        raise InputError(f"none of {len(given)} photographs can be read; expected images.")
    return greys


def _candidates(greys: Sequence[ndarray], others: Sequence[Board]) -> Iterator[Board]:
    """Boards that may be it; of two that are as often seen the first is taken.

    Args:
        greys: photographs.
        others: that are known. What is left of them may look like a part of a chessboard: beside them all
            four sides of one are seen.
    """
    sides = Counter(size for grey in greys if (size := board_size(grey)))
    if max(sides.values(), default=0) <= 0.5 * len(greys):  # squares take long to be no markers
        yield from marker_boards(greys, others=others)
    sizes = [size for size, _ in sides.most_common(2)]
    if not sizes and not others:
        sizes = _again_and_again(greys) or [_at_least(greys)]
    for columns, rows in sizes:
        yield from _marked(greys, columns, rows)
        if min(columns, rows) >= 3:
            yield Chessboard(columns, rows, NOMINAL)
    yield from disc_boards(greys)


def _marked(greys: Sequence[ndarray], columns: int, rows: int) -> Iterator[Board]:
    """The marked chessboards of these counts that the first photographs of a board may show."""
    if min(columns, rows) < FEWEST_OF_MARKED:
        return
    few = greys[:LOOKED_AT_FOR_MARKS]
    for counts in dict.fromkeys([(columns, rows), (rows, columns)]):
        board = MarkedChessboard(*counts, NOMINAL)
        if any(isinstance(see(grey, target_of(board)), Sight) for grey in few):
            yield board
    around_one = MarkedChessboard(columns, rows, NOMINAL, (), ANY_DICTIONARY, 0.5 * NOMINAL)
    for grey in few:
        sight = see(grey, target_of(Chessboard(columns, rows, NOMINAL)))
        for patch in _middle_squares(grey, sight, around_one) if isinstance(sight, Sight) else ():
            if (found := marker_alone(patch)) is not None:
                name, number, marker = found
                side = float(np.linalg.norm(np.roll(marker, 1, axis=0) - marker, axis=1).mean()) / PATCH
                yield MarkedChessboard(columns, rows, NOMINAL, (), name, round(side * NOMINAL, 4), number)
                return


def _middle_squares(grey: ndarray, sight: Sight, board: MarkedChessboard) -> Iterator[ndarray]:
    """The square of a board that may have a marker, straightened, for either end first."""
    corners = board.corners_of(board.marker_square)
    for ids in (sight.ids, board.columns * board.rows - 1 - sight.ids):
        places = board.places()
        apart = np.linalg.norm(places[ids] - places[corners].mean(0), axis=1)
        near = np.argsort(apart, kind="stable")[:CORNERS_AROUND]
        if len(near) < CORNERS_AROUND:
            continue
        onto = PATCH * (places[ids[near]] - places[corners[0]])
        straight, _ = cv2.findHomography(sight.pixels[near], onto, 0)
        if straight is not None:
            yield cv2.warpPerspective(grey, straight, (PATCH, PATCH))


def _again_and_again(greys: Sequence[ndarray]) -> list[tuple[int, int]]:
    """The size of the lattice that is in most photographs, for boards without a white margin, whose sides are
    not seen: what does not belong to a board changes its size from one photograph to the next.
    """
    sizes = Counter(size for grey in greys for size in lattice_sizes(grey))
    return [size for size, seen in sizes.most_common(1) if seen >= max(ENOUGH_TO_AGREE, 0.5 * len(greys))]


def _at_least(greys: Sequence[ndarray]) -> tuple[int, int]:
    """The columns and rows of the largest part of a chessboard, where no photograph shows all four sides."""
    parts = [size for grey in greys if (size := board_size(grey, whole=False))] or [(0, 0)]
    return max(columns for columns, _ in parts), max(rows for _, rows in parts)
