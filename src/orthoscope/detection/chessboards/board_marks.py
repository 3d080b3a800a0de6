"""Which way a marked chessboard lies: by the discs or the marker in its middle squares.

A lattice of corners can lie on its board in several ways (`partial_board.py`). Each says which of the squares
that are seen have a mark. A disc is seen where the middle of a square differs from the square around it
towards the other colour; a marker where OpenCV reads it. Ways in which a mark is missing, or stands where the
board has none, are left out.
"""

from __future__ import annotations

import cv2
import numpy as np

from orthoscope.detection.chessboards.partial_board import Grid
from orthoscope.detection.markers.markers import find_markers
from orthoscope.geometry.arrays import Bool, Float, Int, median, ndarray
from orthoscope.targets.marked_chessboard import DISC_RADIUS, MarkedChessboard

__all__ = ["ways_by_marks"]

# A disc is there where the middle differs from its surroundings, beyond that of most squares, by more of the
# board's contrast than this.
DISC_IS_THERE = 0.35
# And is not there where it differs by less than this share.
NO_DISC = 0.15
# A disc that is there differs by more than so many times what squares without one do.
TIMES_USUAL = 8.0
# Blur makes a square's middle differ from its surroundings the other way, and leaves less of a disc: both
# shares fall by so many times that, to no less than this share of them.
LOST_BY_BLUR, LEAST_LEFT = 5.0, 0.3
# A marker's corner is at most so many of its sides from where a way has it.
FARTHEST_CORNER = 0.25
# Where a square's middle and its surroundings are looked at, in squares from its centre.
MIDDLE, AROUND = 0.5 * DISC_RADIUS, 1.6 * DISC_RADIUS


def ways_by_marks(
    grey: ndarray,
    grid: Grid,
    ways: list[Int[ndarray, "r c"]],
    board: MarkedChessboard,
    *,
    only_seen: bool = False,
) -> list[Int[ndarray, "r c"]]:
    """Of the ways to lay a grid on a board those that its marks allow.

    Args:
        grey: (h,w) uint8.
        grid: the lattice, in the picture's pixels.
        ways: ids of the grid's corners for each way.
        board: what it is laid on.
        only_seen: whether ways that have no mark in the picture are out, too.
    """
    if not ways or min(grid.seen.shape) < 2:
        return [] if only_seen else ways
    marks = (_by_marker if board.dictionary else _by_discs)(grey, grid, ways, board)
    if not any(hits for hits, _ in marks):
        # no mark is seen where it ought to be: a way that has none in the picture is not right for that
        return [] if only_seen or any(misses for _, misses in marks) else ways
    return [way for way, (hits, misses) in zip(ways, marks, strict=True) if hits and not misses]


def _by_discs(
    grey: ndarray, grid: Grid, ways: list[ndarray], board: MarkedChessboard
) -> list[tuple[int, int]]:
    """How many discs of each way are seen, and how many are missing or stand where it has none."""
    there, absent = _there_and_absent(_disc_strengths(grey, grid))
    found = []
    for way in ways:
        marked = np.zeros(there.shape, dtype=bool)
        for square in board.discs:
            cell = _cell_of(way, board.corners_of(square))
            if cell is not None:
                marked[cell] = True
        found.append((int((marked & there).sum()), int((marked & absent).sum() + (~marked & there).sum())))
    return found


def _there_and_absent(strength: Float[ndarray, "a b"]) -> tuple[Bool[ndarray, "a b"], Bool[ndarray, "a b"]]:
    """In which squares a disc is surely seen, and in which there is surely none."""
    seen = strength[np.isfinite(strength)]
    usual = median(seen) if len(seen) else 0.0
    left = np.clip(1.0 + LOST_BY_BLUR * usual, LEAST_LEFT, 1.0)
    differs = median(np.abs(seen - usual)) if len(seen) else 0.0
    more = strength - usual
    return more > max(DISC_IS_THERE * left, TIMES_USUAL * differs), more < NO_DISC * left


def _disc_strengths(grey: ndarray, grid: Grid) -> Float[ndarray, "a b"]:
    """How far the middle of each square goes from its surroundings towards the other colour, as a share of
    the board's contrast; NaN where it is not in the picture.
    """
    angle = 2.0 * np.pi * np.arange(8) / 8
    circle = np.stack([np.cos(angle), np.sin(angle)], axis=1)
    places = np.concatenate([[[0.0, 0.0]], MIDDLE * circle, AROUND * circle]) + 0.5
    u, v = places.T[:, :, None, None, None]
    corners = grid.corners
    at = (1 - v) * ((1 - u) * corners[:-1, :-1] + u * corners[:-1, 1:]) + v * (
        (1 - u) * corners[1:, :-1] + u * corners[1:, 1:]
    )
    inside = ((at >= 0) & (at <= np.array(grey.shape[::-1]) - 1)).all(-1).all(0)
    x, y = at.reshape(len(places), -1, 2).astype(np.float32).transpose(2, 0, 1)
    values = cv2.remap(grey, x, y, cv2.INTER_LINEAR, borderMode=cv2.BORDER_REPLICATE).astype(float)
    values = values.reshape(len(places), *inside.shape)
    middle, around = values[:9].mean(0), values[9:].mean(0)
    rows, columns = inside.shape
    bright = (np.add.outer(np.arange(rows), np.arange(columns)) % 2 == 0) == grid.bright
    if not (bright & inside).any() or not (~bright & inside).any():
        return np.full(inside.shape, np.nan)
    contrast = float(np.median(around[bright & inside]) - np.median(around[~bright & inside]))
    strength = (middle - around) * np.where(bright, -1.0, 1.0) / max(contrast, 1.0)
    return np.where(inside, strength, np.nan)


def _by_marker(
    grey: ndarray, grid: Grid, ways: list[ndarray], board: MarkedChessboard
) -> list[tuple[int, int]]:
    """Whether the marker is read where each way has it, 1 or 0, and whether elsewhere."""
    found = find_markers(grey, board.dictionary, 1)
    markers = found.corners[found.numbers == board.first]
    if not len(markers):
        return [(0, 0)] * len(ways)
    off = [_off(markers, _marker_foreseen(grid, way, board)) for way in ways]
    return [(int(far < FARTHEST_CORNER), int(far >= FARTHEST_CORNER)) for far in off]


def _marker_foreseen(grid: Grid, way: ndarray, board: MarkedChessboard) -> Float[ndarray, "4 2"] | None:
    """Where a way has the corners of the marker; None where its square is not on the grid."""
    places = [np.argwhere(way == corner) for corner in board.corners_of(board.marker_square)]
    if not all(len(place) for place in places):
        return None
    square = np.array([grid.corners[tuple(place[0])] for place in places])
    inset, outset = board.arm, 1.0 - board.arm
    inside = np.array([[inset, inset], [outset, inset], [outset, outset], [inset, outset]], dtype=np.float32)
    unit = np.array([[0, 0], [1, 0], [1, 1], [0, 1]], dtype=np.float32)
    to_picture = cv2.getPerspectiveTransform(unit, square.astype(np.float32))
    return cv2.perspectiveTransform(inside[None], to_picture)[0]


def _off(markers: Float[ndarray, "n 4 2"], foreseen: ndarray | None) -> float:
    """The largest distance of the nearest marker's corners from where they are foreseen, in its sides."""
    if foreseen is None:
        return np.inf
    side = np.linalg.norm(np.roll(foreseen, 1, axis=0) - foreseen, axis=1).mean()
    return float(np.linalg.norm(markers - foreseen, axis=-1).max(1).min() / max(side, 1e-9))


def _cell_of(way: Int[ndarray, "r c"], corners: Int[ndarray, "4"]) -> tuple[int, int] | None:
    """Row and column, among the grid's squares, of the one with these corners; None where it is not there."""
    places = np.argwhere(np.isin(way, corners))
    if len(places) < 4:
        return None
    row, column = places.min(0)
    return int(row), int(column)
