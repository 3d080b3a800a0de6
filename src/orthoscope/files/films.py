"""Frames of a film that are worth looking at: sharp ones that differ, some tens of them.

A film is read once from its first frame to its last, whatever it says of its length, in stretches of equal
length: of each the sharpest frame is kept, if it differs from the one kept before. When more are kept than
are wanted, every other one goes and stretches become twice as long. Pictures that are kept lie in files
without names, not in memory, and go with the last that holds them. Sharpness is the mean square of the
Laplacian of a small copy; two frames differ where small copies do by more than noise.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from itertools import count
from pathlib import Path
from tempfile import TemporaryFile
from typing import NamedTuple

import cv2
import numpy as np

from orthoscope.files.images import to_grey
from orthoscope.files.sensor_frames import open_film
from orthoscope.geometry.arrays import InputError, ndarray

__all__ = ["FILMS", "MOST_FRAMES", "Frame", "frames_of", "in_a_file", "worth_looking_at"]

FILMS = (".mp4", ".avi", ".mov", ".mkv", ".webm", ".m4v", ".mpg", ".mpeg", ".wmv")
# At most so many frames are kept.
MOST_FRAMES = 60
# The first stretches have so many frames.
STRETCH_FRAMES = 4
# Copies of this size, pixels, are compared: so small that blur does not show.
COPY_SIZE = (40, 30)
# Two frames differ by at least so many grey levels, mean over a small copy.
LEAST_GREY_DIFFERENCE = 2.0


class Frame(NamedTuple):
    """seconds: when.  picture: (h,w) uint8."""

    seconds: float
    picture: ndarray


class _Kept(NamedTuple):
    frame: Frame
    sharpness: float
    small: ndarray
    stretch: int


def frames_of(path: Path, *, most: int = MOST_FRAMES) -> list[Frame]:
    """The frames of a film that are worth looking at, in order.

    Args:
        path: of the film.
        most: frames at most.
    Raises:
        InputError: it cannot be read as a film.
    """
    film = open_film(path)
    rate = film.get(cv2.CAP_PROP_FPS)
    rate = rate if np.isfinite(rate) and 0.1 < rate < 10_000 else 30.0
    frames = worth_looking_at(_read(film, rate), most=most)
    film.release()
    if not frames:
        size = Path(path).stat().st_size if Path(path).is_file() else 0
        what = "cannot be read as a film, or is cut off" if size else "is empty"
        raise InputError(
            f"{path} {what}; expected a whole film ({', '.join(FILMS)}). Copy it again or convert it."
        )
    return frames


def _read(film: cv2.VideoCapture, rate: float) -> Iterator[tuple[float, ndarray]]:
    for number in count():
        more, picture = film.read()
        if not more:
            return
        yield number / rate, picture


def worth_looking_at(frames: Iterable[tuple[float, ndarray]], *, most: int = MOST_FRAMES) -> list[Frame]:
    """The frames that are worth looking at, in order.

    Args:
        frames: seconds and picture (h,w) or (h,w,3) of each.
        most: frames at most.
    """
    kept: list[_Kept] = []
    length = STRETCH_FRAMES
    for number, (seconds, picture) in enumerate(frames):
        kept = _with(kept, picture, seconds, number // length)
        if len(kept) > most:
            kept, length = [entry._replace(stretch=entry.stretch // 2) for entry in kept[::2]], 2 * length
    return [entry.frame for entry in kept]


def _with(kept: list[_Kept], picture: ndarray, seconds: float, stretch: int) -> list[_Kept]:
    """What is kept after this frame: it takes the last one's place where it is sharper and of the same
    stretch.
    """
    grey = cv2.cvtColor(picture, cv2.COLOR_BGR2GRAY) if picture.ndim == 3 else picture
    grey = to_grey(grey) if grey.dtype != np.uint8 else grey
    copy = cv2.resize(grey, (16 * COPY_SIZE[0], 16 * COPY_SIZE[1]), interpolation=cv2.INTER_AREA)
    sharpness = float((cv2.Laplacian(copy, cv2.CV_32F) ** 2).mean())
    small = cv2.resize(copy, COPY_SIZE, interpolation=cv2.INTER_AREA).astype(np.int16)
    same = kept and kept[-1].stretch == stretch
    before = kept[:-1] if same else kept
    if before and np.abs(before[-1].small - small).mean() < LEAST_GREY_DIFFERENCE:
        return kept
    if same and kept[-1].sharpness >= sharpness:
        return kept
    return [*before, _Kept(Frame(seconds, in_a_file(grey)), sharpness, small, stretch)]


def in_a_file(picture: ndarray) -> ndarray:
    """The picture in a file without a name."""
    with TemporaryFile() as file:
        mapped = np.memmap(file, dtype=picture.dtype, mode="w+", shape=picture.shape)
    mapped[:] = picture
    return mapped
