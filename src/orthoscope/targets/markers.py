"""Square markers with a number in them, as ArUco and AprilTag draw them: which squares of one are black.

The dictionaries are OpenCV's, by its names (DICT_5X5_100, DICT_APRILTAG_36h11, ...); OpenCV is loaded where
one is drawn.
"""

from __future__ import annotations

from collections.abc import Sequence
from functools import cache
from typing import Any

import numpy as np

from orthoscope.geometry.arrays import Float, InputError, ndarray

__all__ = [
    "check_numbers",
    "dictionary",
    "first_text",
    "marker_modules",
    "modules_of",
    "rectangles_of",
    "split_first",
]

# All names of OpenCV's dictionaries begin so.
PREFIX = "DICT_"
# What stands at the end of a description before the number of a board's first marker.
FIRST = "first="


@cache
def dictionary(name: str) -> Any:
    """OpenCV's dictionary of this name.

    Raises:
        InputError: OpenCV has none of this name.
    """
    import cv2

    number = getattr(cv2.aruco, name, None) if name.startswith(PREFIX) else None
    if number is None:
        names = sorted(other for other in dir(cv2.aruco) if other.startswith(PREFIX))
        meant = f"{PREFIX}{name.upper()}"
        hint = f" Say {meant}." if meant in names else ""
        raise InputError(f"dictionary {name!r} is not known; expected one of {', '.join(names)}.{hint}")
    return cv2.aruco.getPredefinedDictionary(number)


def modules_of(name: str) -> int:
    """Squares along the side of a dictionary's markers, their black border of one square included."""
    return int(dictionary(name).markerSize) + 2


def marker_modules(name: str, number: int, *, border: int = 1) -> ndarray:
    """Which squares of a marker are black (rows, columns), its border of so many squares included.

    Raises:
        InputError: the dictionary has no such number.
    """
    import cv2

    book = dictionary(name)
    if not 0 <= number < len(book.bytesList):
        raise InputError(f"{name} has markers 0 to {len(book.bytesList) - 1}; {number} is none of them.")
    side = int(book.markerSize) + 2 * border
    return cv2.aruco.generateImageMarker(book, number, side, None, border) == 0


def rectangles_of(black: ndarray) -> Float[ndarray, "n 4"]:
    """Black squares (rows, columns) as rectangles, those beside each other in a row as one, in squares."""
    found = []
    for row, line in enumerate(np.pad(black.astype(np.int8), ((0, 0), (1, 1)))):
        turns = np.diff(line)
        found += [
            (first, row, last, row + 1)
            for first, last in zip(*map(np.flatnonzero, (turns > 0, turns < 0)), strict=True)
        ]
    return np.array(found, dtype=float).reshape(-1, 4)


def split_first(fields: Sequence[str]) -> tuple[list[str], int]:
    """The fields of a description without `first=17` at its end, and that number; 0 where it is not said."""
    last = fields[-1].strip() if fields else ""
    if last.startswith(FIRST) and last.removeprefix(FIRST).isdecimal():
        return list(fields[:-1]), int(last.removeprefix(FIRST))
    return list(fields), 0


def first_text(first: int) -> str:
    """The end of a description that says with which number a board's markers begin; nothing where with 0."""
    return f":{FIRST}{first}" if first else ""


def check_numbers(description: str, name: str, numbers: range) -> None:
    """Says where a dictionary has not all of a board's markers.

    Raises:
        InputError: it has not.
    """
    if (have := len(dictionary(name).bytesList)) < numbers.stop or numbers.start < 0:
        raise InputError(
            f"{description} needs markers {numbers.start} to {numbers.stop - 1}; {name} has 0 to {have - 1}."
            " Take a larger dictionary or fewer markers."
        )
