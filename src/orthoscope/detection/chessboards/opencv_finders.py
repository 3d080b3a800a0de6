"""OpenCV's two finders of whole chessboards, on a ladder of copies, and a look at whether it is the board.

They find boards, dim and blurred ones, whose corners do not hang together well enough for a lattice. What a
finder returns is believed where it is a grid (no corner strays from its neighbours' lines) whose squares are
bright and dark by turns.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from typing import NamedTuple

import cv2
import numpy as np

from orthoscope.detection.chessboards.grid import cross, grid_shape, lattice
from orthoscope.detection.chessboards.squares import alternating
from orthoscope.detection.small_copies import resized, to_photograph
from orthoscope.geometry.arrays import Float, ndarray

__all__ = ["opencv_boards"]

Finder = Callable[[ndarray, tuple[int, int]], ndarray | None]
# OpenCV's finders stumble over pictures with a shorter side, pixels.
SMALLEST_SIDE = 15
# A corner strays from the parabolas of its row and column by at most this share of a square.
FARTHEST_STRAY_SHARE = 0.25
# At least this share of the corners alternates; glare and shadow hide some.
LEAST_ALTERNATING_SHARE = 0.8
# At most this share of the corners alternates the wrong way.
MOST_CONTRARY_SHARE = 0.05


def opencv_boards(grey: ndarray, columns: int, rows: int) -> Iterator[Float[ndarray, "m 2"]]:
    """Corners, row by row and right to a pixel or two, of what is a grid of a board's corners.

    Args:
        grey: (h,w) uint8.
        columns, rows: inner corners, 3 or more either way, for no finder looks for fewer.
    """
    for rough in _sightings(grey, columns, rows):
        if _is_grid(grey, rough, columns, rows) and _alternates(grey, rough, columns, rows):
            yield rough


def _sightings(grey: ndarray, columns: int, rows: int) -> Iterator[Float[ndarray, "m 2"]]:
    """What the rungs find, in the photograph's pixels."""
    tried: set[tuple[Finder, tuple[int, ...]]] = set()
    for rung in LADDER:
        copy = resized(grey, rung.side)
        if (rung.find, copy.shape) in tried or min(copy.shape) < SMALLEST_SIDE:
            continue
        tried.add((rung.find, copy.shape))
        found = rung.find(copy, (columns, rows))
        if found is not None:
            yield to_photograph(found.reshape(-1, 2).astype(float), copy, grey)


def _classic(grey: ndarray, size: tuple[int, int]) -> ndarray | None:
    """Quadrangles that touch at their corners (V. Vezhnevets)."""
    found, corners = cv2.findChessboardCorners(grey, size)
    return corners if found else None


def _sector_based(grey: ndarray, size: tuple[int, int]) -> ndarray | None:
    """Saddle points by their sectors (A. Duda and U. Frese, BMVC 2018): slower, and finds what the classic
    one misses.
    """
    found, corners = cv2.findChessboardCornersSB(grey, size)
    return corners if found else None


class Rung(NamedTuple):
    """A finder, and the longer side of the copy it looks at, pixels."""

    find: Finder
    side: int


LADDER = (Rung(_classic, 640), Rung(_sector_based, 640), Rung(_sector_based, 1280))


def _is_grid(grey: ndarray, corners: ndarray, columns: int, rows: int) -> bool:
    """Whether corners lie in the picture, without folds, each on its neighbours' lines."""
    shape = grid_shape(corners, lattice(columns, rows))
    turn = cross(shape.along, shape.down)
    inside = ((corners >= 0) & (corners <= np.array(grey.shape[::-1]) - 1)).all()
    return bool(
        inside and ((turn > 0).all() or (turn < 0).all()) and shape.stray.max() <= FARTHEST_STRAY_SHARE
    )


def _alternates(grey: ndarray, corners: ndarray, columns: int, rows: int) -> bool:
    """Whether the squares between corners are bright and dark by turns."""
    signs = alternating(grey, corners.reshape(rows, columns, 2))
    contrary, agree = sorted([(signs > 0).mean(), (signs < 0).mean()])
    return bool(agree >= LEAST_ALTERNATING_SHARE and contrary <= MOST_CONTRARY_SHARE)
