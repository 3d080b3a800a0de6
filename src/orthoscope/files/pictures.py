"""What is handed in to be looked at: photographs, the pages of a file, frames of films, arrays; each with a
name.

A frame's name is its film's and its time, `walk.mp4@12.345s`; a page's its file's and its number,
`scan.tif#2`. Of a file with many pages some are looked at, as of a film.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from os import PathLike
from pathlib import Path

import numpy as np

from orthoscope.files.bags import BAGS, pictures_in_bag
from orthoscope.files.films import FILMS, MOST_FRAMES, frames_of, in_a_file, worth_looking_at
from orthoscope.files.images import check_size, names_of, pages_of, photographs, read_image, to_grey
from orthoscope.geometry.arrays import InputError, ndarray

__all__ = ["MOVING", "Given", "Picture", "file_name_of", "pictures"]

# What stands between a film's name and a frame's time, and between a file's name and a page's number.
AT, PAGE = "@", "#"
# Files of many frames, of which some are looked at.
MOVING = (*FILMS, *BAGS)

Given = str | PathLike[str] | ndarray | Iterable[str | PathLike[str] | ndarray] | Mapping[str, ndarray]


@dataclass(frozen=True, eq=False)
class Picture:
    """One picture, in memory or still in its file.

    Attributes:
        name: what its view will be called.
        source: the file, or the picture itself, (h,w) or (h,w,3).
    """

    name: str
    source: Path | ndarray

    def grey(self, *, most_megapixels: float) -> ndarray:
        """The picture, (h,w) uint8.

        Raises:
            InputError: it cannot be read, or is larger than so many million pixels.
        """
        if isinstance(self.source, Path):
            return read_image(self.source, grey=True, most_megapixels=most_megapixels)
        check_size(self.name, self.source.shape[1::-1], most_megapixels)
        return to_grey(self.source)


def pictures(given: Given, *, topic: str | None = None) -> list[Picture]:
    """Every picture of files, folders, globs, films, bags and arrays.

    Args:
        given: one of these or several; arrays by name, or numbered as they come.
        topic: of a bag with several that have pictures.
    Raises:
        InputError: a path leads to no picture, or an array is none.
    """
    if isinstance(given, Mapping):
        return [Picture(str(name), _checked(np.asarray(array))) for name, array in given.items()]
    if isinstance(given, ndarray) and given.ndim in (2, 3) and (given.ndim == 2 or given.shape[2] in (3, 4)):
        given = [given]
    entries = [given] if isinstance(given, str | PathLike) else list(given)
    arrays = [entry for entry in entries if isinstance(entry, ndarray)]
    paths = [entry for entry in entries if not isinstance(entry, ndarray)]
    digits = max(2, len(str(len(arrays))))
    found = [Picture(f"picture{i:0{digits}d}", _checked(array)) for i, array in enumerate(arrays, 1)]
    files = photographs(paths, also=MOVING) if paths or not arrays else []
    for name, file in zip(names_of(files), files, strict=True):
        found += _of_file(name, file, topic)
    return found


def file_name_of(picture: str) -> str:
    """The name of the file that a frame or a page is of.

    Args:
        picture: the name of the frame or page.
    """
    return picture[: max(picture.rfind(AT), picture.rfind(PAGE))]


def _of_file(name: str, file: Path, topic: str | None) -> list[Picture]:
    suffix = file.suffix.lower()
    if suffix in MOVING:
        frames = frames_of(file) if suffix in FILMS else worth_looking_at(pictures_in_bag(file, topic))
        return [Picture(f"{name}{AT}{frame.seconds:.3f}s", frame.picture) for frame in frames]
    pages = pages_of(file)
    if not pages:
        return [Picture(name, file)]
    if len(pages) > MOST_FRAMES:
        numbered = ((float(number), page) for number, page in enumerate(pages, 1))
        return [
            Picture(f"{name}{PAGE}{frame.seconds:.0f}", frame.picture) for frame in worth_looking_at(numbered)
        ]
    return [
        Picture(f"{name}{PAGE}{number}", in_a_file(to_grey(page))) for number, page in enumerate(pages, 1)
    ]


def _checked(array: ndarray) -> ndarray:
    if array.ndim not in (2, 3) or array.size == 0 or (array.ndim == 3 and array.shape[2] not in (1, 3, 4)):
        raise InputError(
            f"a picture has shape {array.shape}; expected (height, width) or (height, width, 3). Hand in each"
            " on its own."
        )
    return array
