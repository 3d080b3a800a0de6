"""Finding one chessboard in one grey photograph, roughly: OpenCV's finders on a ladder of sizes, the quick rungs first.

Floor 5.  A board that fills a 12-megapixel photograph is found in a small copy of it in milliseconds, where the full size takes OpenCV a second; a small or
dim board needs a larger copy, more contrast, or the slower finder.  Whatever rung finds it, refine.py then works at full size, so the rung does not
matter to the corners.  docs/detection.md has the figures.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

import cv2
import numpy as np

from orthoscope.geometry.arrays import Float, ndarray
from orthoscope.io.refine import refined

__all__ = ["find_chessboard", "locate_chessboard"]

Finder = Callable[[ndarray, tuple[int, int]], ndarray | None]


def find_chessboard(grey: ndarray, columns: int, rows: int) -> Float[ndarray, "m 2"] | None:
    """The inner corners (columns * rows, 2) of a board, pixels, row by row; None where there is no such board.

    grey: (h,w) uint8.  The first corner may be either end of the board: a view's pose takes that up.
    """
    rough = locate_chessboard(grey, columns, rows)
    return None if rough is None else refined(grey, rough, columns, rows)


def locate_chessboard(grey: ndarray, columns: int, rows: int) -> Float[ndarray, "m 2"] | None:
    """The corners to a pixel or two, by the first rung of the ladder that finds all of them."""
    tried: set[tuple[Finder, tuple[int, ...]]] = set()
    for rung in LADDER:
        copy = _resized(grey, rung.side)
        if (rung.find, copy.shape) in tried:
            continue
        tried.add((rung.find, copy.shape))
        found = rung.find(copy, (columns, rows))
        if found is not None:
            scale = np.array(grey.shape[::-1]) / np.array(copy.shape[::-1])
            return (found.reshape(-1, 2).astype(float) + 0.5) * scale - 0.5
    return None


def _classic(grey: ndarray, size: tuple[int, int]) -> ndarray | None:
    """Quadrangles that touch at their corners (V. Vezhnevets)."""
    found, corners = cv2.findChessboardCorners(grey, size)
    return corners if found else None


def _contrasted(grey: ndarray, size: tuple[int, int]) -> ndarray | None:
    """The same after evening out the light."""
    return _classic(cv2.createCLAHE(3.0, (8, 8)).apply(grey), size)


def _sector_based(grey: ndarray, size: tuple[int, int]) -> ndarray | None:
    """Saddle points by their sectors (A. Duda and U. Frese, BMVC 2018): slower, and finds what the classic one misses."""
    found, corners = cv2.findChessboardCornersSB(grey, size, flags=cv2.CALIB_CB_NORMALIZE_IMAGE)
    return corners if found else None


class Rung(NamedTuple):
    """A finder, and the longer side of the copy it looks at, pixels (0: the photograph itself)."""

    find: Finder
    side: int


LADDER = (
    Rung(_classic, 640),
    Rung(_classic, 1280),
    Rung(_contrasted, 1280),
    Rung(_sector_based, 640),
    Rung(_sector_based, 1280),
    Rung(_classic, 0),
    Rung(_sector_based, 2560),
)


def _resized(grey: ndarray, side: int) -> ndarray:
    """A copy whose longer side is `side`; the photograph itself where it is no larger."""
    longer = max(grey.shape)
    if not 0 < side < longer:
        return grey
    height, width = (max(1, round(length * side / longer)) for length in grey.shape)
    return cv2.resize(grey, (width, height), interpolation=cv2.INTER_AREA)
