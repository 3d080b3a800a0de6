"""Boards of markers by what their markers say: the dictionary, the layout and the counts.

Each marker is a frame of its own: its four corners make a unit square, in which the markers near it stand
somewhere. On a grid these places are pitches apart along the axes; on a ChArUco board, a square to the side
and a square down. Which number stands where tells the columns, and on ChArUco boards whether the first row
begins with a marker, as it does in the old layout of boards with an even number of rows. Lengths are not
seen, only their ratios: the description that comes out has lengths of ours in these ratios.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Iterator, Sequence
from functools import partial
from itertools import product
from typing import NamedTuple

import cv2
import numpy as np

from orthoscope.detection.markers.marker_corners import crossings_of_sides
from orthoscope.detection.markers.markers import Markers, homography_of
from orthoscope.detection.recognition.marker_groups import are_on_one_plane, groups
from orthoscope.detection.small_copies import resized
from orthoscope.geometry.arrays import Float, InputError, Int, ndarray
from orthoscope.targets.aprilgrid import BORDER_SQUARES, DICTIONARY, AprilGrid
from orthoscope.targets.board import Board
from orthoscope.targets.charuco import Charuco
from orthoscope.targets.grid_board import GridBoard
from orthoscope.targets.markers import dictionary

__all__ = ["marker_alone", "marker_boards"]

# Dictionaries that begin alike, the largest first: with it all their markers are read.
FAMILIES = (
    *(tuple(f"DICT_{bits}X{bits}_{size}" for size in (1000, 250, 100, 50)) for bits in (4, 5, 6, 7)),
    ("DICT_APRILTAG_36h11",),
    ("DICT_APRILTAG_36h10",),
    ("DICT_APRILTAG_25h9",),
    ("DICT_APRILTAG_16h5",),
    ("DICT_ARUCO_MIP_36h12",),
    ("DICT_ARUCO_ORIGINAL",),
)
# The longer side of the copy in which markers are read, pixels.
COPY_SIDE = 1280
# The longer side of the copy of the first photograph in which every dictionary is tried first, pixels.
SMALL_SIDE = 640
# In it of each family the dictionary of 100 markers is tried, which is read ten times as fast as 1000.
COMMON = 2
# In so many photographs every dictionary is tried.
TRIED_PHOTOGRAPHS = 3
# With so many markers, and so many times as many as of any other dictionary, it is settled.
SURELY_MARKERS, SURELY_RATIO = 8, 3
# A board shows at least so many different markers.
FEWEST_MARKERS = 4
# A number that is seen less often than this share of the commonest one was misread.
LEAST_SEEN_SHARE = 0.15
# So many markers around each one are compared with a layout.
NEIGHBOURS = 4
# A marker is where a layout has it when it is no farther from there than this share of a pitch.
NEAR_SHARE = 0.3
# A layout is believed when it has so many of the neighbours where they are seen.
LEAST_FITTING_SHARE = 0.8
# Boards have at most so many columns.
MOST_COLUMNS = 40
# A square of a ChArUco board, or a marker of a grid, as it is then described, metres.
NOMINAL = 0.03

Layout = Callable[[Int[ndarray, " n"]], Float[ndarray, "n 2"]]


class _Neighbours(NamedTuple):
    """Markers and those near them: numbers (k,) of both, and where the second stands in the first's frame, in
    its sides (k,2).
    """

    here: Int[ndarray, " k"]
    there: Int[ndarray, " k"]
    away: Float[ndarray, "k 2"]


class _LaidOut(NamedTuple):
    """A board, and where its layout has the markers of some numbers, in pitches or squares."""

    board: Board
    layout: Layout


def marker_boards(greys: Sequence[ndarray], *, others: Sequence[Board] = ()) -> Iterator[Board]:
    """The boards that the markers of photographs make, if they make any: of one dictionary.

    Args:
        greys: (h,w) uint8.
        others: boards that are known; their markers are none of these.
    """
    copies = [resized(grey, COPY_SIDE) for grey in greys]
    family, border = _family(copies)
    if not family:
        return
    read = [_read(copy, family[0], border) for copy in copies[:TRIED_PHOTOGRAPHS]]
    highest = max((int(markers.numbers.max(initial=0)) for markers in read), default=0)
    read += [_read(copy, _smallest(family, highest), border) for copy in copies[TRIED_PHOTOGRAPHS:]]
    taken = [
        one for board in others if board.markers and board.markers[0] in family for one in board.markers[1]
    ]
    numbers = np.setdiff1d(_known(read), taken)
    if len(numbers) < FEWEST_MARKERS:
        return
    modules = int(dictionary(family[0]).markerSize) + 2 * border
    read = [
        Markers(markers.numbers, crossings_of_sides(copy, markers.corners, modules)[0])
        for copy, markers in zip(copies, read, strict=True)
    ]
    lowest = max((one + 1 for one in taken if one < numbers.min()), default=0)
    laid = _laid_out(read, numbers, family, border, lowest)
    if laid and are_on_one_plane(read, laid.layout):
        yield laid.board
        return
    parts = groups(read, numbers)
    if len(parts) > 1:
        several = [
            _laid_out(read, part, family, border, lowest) for part in parts if len(part) >= FEWEST_MARKERS
        ]
        yield from (one.board for one in several if one)
    elif laid:
        yield laid.board


def marker_alone(copy: ndarray) -> tuple[str, int, Float[ndarray, "4 2"]] | None:
    """The one marker that is in a picture: the smallest dictionary that has it, its number and its corners.

    Args:
        copy: (h,w) uint8.
    """
    for family in FAMILIES:
        read = _read(copy, family[0], 1)
        if len(read.numbers) == 1:
            number = int(read.numbers[0])
            return _smallest(family, number), number, read.corners[0]
    return None


def _family(copies: Sequence[ndarray]) -> tuple[tuple[str, ...], int]:
    """The dictionaries of whose markers most are read, and their border; of a few photographs no more are
    looked at once most is far more than others.
    """
    tried = [
        (family, border)
        for family in FAMILIES
        for border in ((1, BORDER_SQUARES) if family[0] == DICTIONARY else (1,))
    ]
    counts = np.zeros(len(tried), dtype=int)
    few = copies[:TRIED_PHOTOGRAPHS]
    small = [(resized(copy, SMALL_SIDE), COMMON) for copy in few[:1]]
    for copy, member in (*small, *((copy, 0) for copy in few)):
        counts += [
            len(_read(copy, family[min(member, len(family) - 1)], border).numbers) for family, border in tried
        ]
        few, most = np.sort(counts)[-2:]
        if most >= max(SURELY_MARKERS, SURELY_RATIO * few):
            break
    return tried[int(counts.argmax())] if counts.any() else ((), 1)


def _smallest(family: tuple[str, ...], number: int) -> str:
    """The smallest dictionary of a family that has a number."""
    return min((name for name in family if _size(name) > number), key=_size)


def _size(name: str) -> int:
    return len(dictionary(name).bytesList)


def _read(copy: ndarray, name: str, border: int) -> Markers:
    parameters = cv2.aruco.DetectorParameters()
    parameters.markerBorderBits = border
    corners, numbers, _ = cv2.aruco.ArucoDetector(dictionary(name), parameters).detectMarkers(copy)
    if numbers is None:
        return Markers(np.zeros(0, dtype=int), np.zeros((0, 4, 2)))
    where = np.concatenate(corners).reshape(-1, 4, 2).astype(float)
    return Markers(np.asarray(numbers).ravel().astype(int), where)


def _known(read: Sequence[Markers]) -> Int[ndarray, " n"]:
    """The numbers that are the board's, not misread ones."""
    counts = Counter(number for markers in read for number in set(markers.numbers.tolist()))
    most = max(counts.values(), default=0)
    return np.array(sorted(n for n, count in counts.items() if count > LEAST_SEEN_SHARE * most), dtype=int)


def _neighbours(read: Sequence[Markers], numbers: Int[ndarray, " n"]) -> _Neighbours:
    unit = np.array([[-0.5, -0.5], [0.5, -0.5], [0.5, 0.5], [-0.5, 0.5]])
    here, there, away = [], [], []
    for markers in read:
        known = np.isin(markers.numbers, numbers)
        mine, corners = markers.numbers[known], markers.corners[known]
        middles = corners.mean(1)
        for i, own in enumerate(corners if len(corners) > 1 else ()):
            places = cv2.perspectiveTransform(middles[None], np.linalg.inv(homography_of(unit, own)))[0]
            far = np.hypot(*places.T)
            far[i] = np.inf
            nearest = np.argsort(far)[: min(NEIGHBOURS, len(corners) - 1)]
            here += [mine[i]] * len(nearest)
            there += mine[nearest].tolist()
            away += places[nearest].tolist()
    return _Neighbours(np.array(here, dtype=int), np.array(there, dtype=int), np.array(away).reshape(-1, 2))


def _laid_out(
    read: Sequence[Markers],
    numbers: Int[ndarray, " n"],
    family: tuple[str, ...],
    border: int,
    lowest: int,
) -> _LaidOut | None:
    """The board whose layout has most neighbours where they are seen. It begins with the lowest number that
    it may have, or the lowest that is seen.
    """
    near = _neighbours(read, numbers)
    if not len(near.here):
        return None
    name = _smallest(family, int(numbers.max()))
    far = np.hypot(*near.away.T)
    pitch, most = float(np.median(far[far < 1.2 * far.min()])), int(numbers.max())
    square = pitch / np.sqrt(2.0)
    tried: list[tuple[float, Layout, Callable[[], Board]]] = []
    for first in dict.fromkeys((lowest, int(numbers.min()))):
        for columns in range(1, min(MOST_COLUMNS, most - first + 1) + 1):
            rows = -(-(most - first + 1) // columns)
            turns, layout = (range(4), _upwards) if border == BORDER_SQUARES else (range(1), _downwards)
            fit = max(_fitting(near, pitch, layout(columns, first), turn) for turn in turns)
            tried.append(
                (fit, layout(columns, first), partial(_grid, columns, rows, pitch - 1.0, name, border, first))
            )
        for columns, start in product(range(3, MOST_COLUMNS + 1), (1, 0)):
            chequered = _chequered(columns, first, start)
            fit = _fitting(near, square, chequered)
            tried.append((fit, chequered, partial(_charuco, columns, start, square, name, first, most)))
    fit, layout, board = max(tried, key=lambda one: one[0])
    try:
        return _LaidOut(board(), layout) if fit > LEAST_FITTING_SHARE else None
    except InputError:  # what it seems to be cannot be
        return None


def _fitting(near: _Neighbours, pitch: float, layout: Layout, turn: int = 0) -> float:
    """The share of neighbours that a layout has where they are seen, markers turned by quarters."""
    quarter = np.linalg.matrix_power(np.array([[0.0, -1.0], [1.0, 0.0]]), turn)
    off = near.away @ quarter.T - pitch * (layout(near.there) - layout(near.here))
    return float((np.hypot(*off.T) < NEAR_SHARE * pitch).mean())


def _downwards(columns: int, first: int) -> Layout:
    return lambda numbers: np.stack(np.divmod(numbers - first, columns)[::-1], axis=1).astype(float)


def _upwards(columns: int, first: int) -> Layout:
    return lambda numbers: _downwards(columns, first)(numbers) * [1.0, -1.0]


def _chequered(columns: int, first: int, start: int) -> Layout:
    """Row by row in every other square; start: the column of the first."""

    def layout(numbers: Int[ndarray, " n"]) -> Float[ndarray, "n 2"]:
        pair, rest = np.divmod(numbers - first, columns)  # two rows have as many markers as there are columns
        in_first = (columns + (1 - start)) // 2
        second = rest >= in_first
        row = 2 * pair + second
        column = np.where(second, 2 * (rest - in_first) + (1 - start), 2 * rest + start)
        return np.stack([column, row], axis=1).astype(float)

    return layout


def _grid(columns: int, rows: int, gap: float, name: str, border: int, first: int) -> Board:
    if border == BORDER_SQUARES:
        return AprilGrid(columns, rows, NOMINAL, round(gap, 2), first)
    return GridBoard(columns, rows, NOMINAL, round(gap * NOMINAL, 4), name, first)


def _charuco(columns: int, start: int, square: float, name: str, first: int, most: int) -> Board:
    rows = int(_chequered(columns, first, start)(np.array([most]))[0, 1]) + 1
    return Charuco(columns, rows, NOMINAL, round(NOMINAL / square, 4), name, start == 0, first)
