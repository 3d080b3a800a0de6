"""Films as the sensor saw them: a telephone that was held upright marks its films to be shown turned.

The frames in the file are the sensor's, and so is a camera model; the mark turns nothing that is read here.
MP4 and MOV mark it by a matrix in the header of the track (`tkhd`, ISO/IEC 14496-12, 8.3.2), by quarters.
"""

from __future__ import annotations

import struct
from collections.abc import Iterator
from pathlib import Path
from typing import BinaryIO

import cv2

from orthoscope.geometry.arrays import InputError

__all__ = ["mark_turned", "open_film", "quarter_turns"]

# The matrix is a, b, u, c, d, v, x, y, w; these are a, b, c, d of no turn and of one, two, three quarters.
QUARTERS = ((1, 0, 0, 1), (0, 1, -1, 0), (-1, 0, 0, -1), (0, -1, 1, 0))
# One in the file's numbers with 16 bits behind the point.
ONE_16_16 = 1 << 16
# From a track header's version to its matrix, bytes, by the version.
MATRIX_OFFSETS = {0: 40, 1: 52}
# Boxes that hold the boxes of a track.
HOLDERS = (b"moov", b"trak")


def open_film(path: Path) -> cv2.VideoCapture:
    """A film for reading, its frames not turned whatever it says of how to show them.

    Args:
        path: of the film.
    """
    film = cv2.VideoCapture(str(path))
    film.set(cv2.CAP_PROP_ORIENTATION_AUTO, 0)
    return film


def quarter_turns(path: Path) -> int:
    """How many quarters clockwise a film is to be turned when it is shown; 0 where it says nothing.

    Args:
        path: of an MP4 or MOV file; any other says nothing.
    """
    with path.open("rb") as film:
        size = path.stat().st_size
        for place in _matrices(film, 0, size):
            film.seek(place)
            a, b, _, c, d, *_ = struct.unpack(">9i", film.read(36))
            signs = tuple((value > 0) - (value < 0) for value in (a, b, c, d))
            if signs in QUARTERS and signs != QUARTERS[0]:
                return QUARTERS.index(signs)
    return 0


def mark_turned(path: Path, quarters: int, *, size: tuple[int, int]) -> None:
    """Mark a film to be shown turned.

    Args:
        path: of an MP4 or MOV file; any other stays as it is.
        quarters: clockwise.
        size: (width, height) of its frames.
    Raises:
        InputError: the file cannot be written.
    """
    if not quarters % 4:
        return
    (a, b, c, d), (width, height) = QUARTERS[quarters % 4], size
    shift = {1: (height, 0), 2: (width, height), 3: (0, width)}[quarters % 4]
    matrix = (a, b, 0, c, d, 0, *shift)
    try:
        with path.open("r+b") as film:
            for place in list(_matrices(film, 0, path.stat().st_size)):
                film.seek(place + 36)  # the width follows the matrix; a track of sound has none
                if struct.unpack(">I", film.read(4))[0]:
                    film.seek(place)
                    film.write(struct.pack(">8iI", *(ONE_16_16 * value for value in matrix), 1 << 30))
    except OSError as error:
        raise InputError(f"{path} cannot be written ({error.strerror}); choose another place.") from error


def _matrices(film: BinaryIO, start: int, end: int) -> Iterator[int]:
    """Where the matrices of the tracks stand, bytes from the file's beginning."""
    while start + 8 <= end:
        film.seek(start)
        length, kind = struct.unpack(">I4s", film.read(8))
        head = 8
        if length == 1:
            length, head = struct.unpack(">Q", film.read(8))[0], 16
        length = length or end - start
        if length < head:
            return
        if kind in HOLDERS:
            yield from _matrices(film, start + head, min(start + length, end))
        elif kind == b"tkhd":
            version = film.read(1)[:1]
            if version and version[0] in MATRIX_OFFSETS:
                yield start + head + MATRIX_OFFSETS[version[0]]
        start += length
