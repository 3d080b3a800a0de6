"""Photographs: which files they are, read upright as 8-bit pictures, and written as wholes.

OpenCV decodes; it turns pictures upright by their EXIF tag, but before version 5 says nothing of a JPEG that
is cut off (it comes back half grey), so the end that JPEG and PNG must have is looked for first, chunk by
chunk: thumbnails have ends of their own, and telephones put whole films after the picture. 16-bit pictures
are brought to 8 bits by the fewest bits that hold their brightest value: cameras fill 10, 12 or 14 bits of
the 16, and dividing by 257 would turn those nearly black.
"""

from __future__ import annotations

import glob
import re
import threading
from collections.abc import Callable, Iterable, Iterator
from contextlib import AbstractContextManager
from os import PathLike
from pathlib import Path

import cv2
import numpy as np

from orthoscope.files.whole_files import read_bytes, write_bytes
from orthoscope.geometry.arrays import InputError, ndarray

__all__ = ["SUFFIXES", "checked_whole", "names_of", "photographs", "quiet", "read_image", "write_image"]

SUFFIXES = (".png", ".jpg", ".jpeg", ".bmp", ".tif", ".tiff", ".webp", ".pgm", ".ppm")
JPEG, PNG = b"\xff\xd8\xff", b"\x89PNG\r\n\x1a\n"  # how they begin
MARKER = re.compile(
    rb"\xff[^\x00\xd0-\xd7\xff]"
)  # of a JPEG's segment; FF 00 and restarts are part of the coded picture

Path_ = str | PathLike[str]


def photographs(paths: Path_ | Iterable[Path_]) -> list[Path]:
    """The image files that files, folders (not the folders in them) and globs name, each once, `left2` before
    `left10`.

    Raises InputError where a path is missing, a glob matches nothing or a folder holds no photograph.
    """
    given = [paths] if isinstance(paths, str | PathLike) else list(paths)
    if not given:
        raise InputError(
            "no photographs were named; expected files, folders or globs, such as photos/ or photos/*.png."
        )
    found: dict[Path, Path] = {}
    for path in given:
        for file in _expanded(Path(path)):
            found.setdefault(file.resolve(), file)
    return list(found.values())


def names_of(files: Iterable[Path]) -> list[str]:
    """A short name for each photograph: its file name, with as much of its folder as tells it from the
    others.
    """
    files = list(files)
    for depth in range(1, max((len(file.parts) for file in files), default=1) + 1):
        names = ["/".join(file.parts[-depth:]) for file in files]
        if len(set(names)) == len(names):
            return names
    return [str(file) for file in files]


def read_image(path: Path_, *, grey: bool = False) -> ndarray:
    """A photograph, upright: uint8 (h,w) where grey, else (h,w,3) blue, green, red.

    Raises InputError where the file is missing, empty, no image or cut off.
    """
    content = checked_whole(read_bytes(Path(path)), path)
    flags = (cv2.IMREAD_GRAYSCALE if grey else cv2.IMREAD_COLOR) | cv2.IMREAD_ANYDEPTH
    with _QUIET:
        try:
            image = cv2.imdecode(np.frombuffer(content, dtype=np.uint8), flags)
        except cv2.error:
            image = None
    if image is None:
        raise InputError(
            f"{path} is not an image that can be read; expected one of {', '.join(SUFFIXES)}. Convert it or"
            " leave it out."
        )
    return _to_8_bits(image)


def checked_whole(content: bytes, path: Path_) -> bytes:
    """The bytes of a picture's file.

    Raises InputError where there are none or they are cut off.
    """
    if not content:
        raise InputError(f"{path} is empty; expected a photograph. Copy it again or leave it out.")
    if not _is_whole(content):
        raise InputError(
            f"{path} is cut off ({len(content)} bytes without an end); expected a whole photograph. Copy it"
            " again or leave it out."
        )
    return content


def write_image(path: Path_, image: ndarray) -> None:
    """Writes a picture, uint8 (h,w) or (h,w,3), in the format that its name ends in; as a whole or not at
    all.

    Raises InputError where the format is not known or the place cannot be written.
    """
    suffix = Path(path).suffix.lower()
    options = [cv2.IMWRITE_JPEG_QUALITY, 95] if suffix in (".jpg", ".jpeg") else []
    with _QUIET:
        try:
            done, content = cv2.imencode(suffix, image, options)
        except cv2.error:
            done, content = False, None
    if not done or content is None:
        raise InputError(
            f"{path} cannot be written: {suffix or 'no suffix'} is no image format known here; expected one"
            f" of {', '.join(SUFFIXES)}."
        )
    write_bytes(Path(path), content.tobytes())


def _expanded(path: Path) -> list[Path]:
    """The files that one path means."""
    if path.is_dir():
        files = [file for file in path.iterdir() if _is_photograph(file)]
        if not files:
            raise InputError(
                f"folder {path} holds no photograph; expected files ending in {', '.join(SUFFIXES)}. Name the"
                " folder that has them."
            )
        return sorted(files, key=_natural)
    if path.exists():
        return [path]
    files = [file for name in glob.glob(str(path), recursive=True) if _is_photograph(file := Path(name))]
    if not files:
        raise InputError(
            f"{path} does not exist; expected a photograph, a folder of photographs or a glob that matches"
            " some."
        )
    return sorted(files, key=_natural)


def _is_photograph(file: Path) -> bool:
    """By its name; a file that is named itself is believed to be one."""
    return file.suffix.lower() in SUFFIXES and not file.name.startswith(".") and file.is_file()


def _natural(path: Path) -> list[tuple[int, int, str]]:
    """A sort key in which numbers count as numbers."""
    return [
        (0, int(part), "") if part.isdecimal() else (1, 0, part.lower())
        for part in re.split(r"(\d+)", str(path))
        if part
    ]


def _is_whole(content: bytes) -> bool:
    """Whether a JPEG or a PNG has its end; other formats are left to their decoder, which notices."""
    if content.startswith(JPEG):
        return b"\xd9" in _jpeg_segments(content)
    if content.startswith(PNG):
        return b"IEND" in _png_chunks(content)
    return True


def _jpeg_segments(content: bytes) -> Iterator[bytes]:
    """The codes of a JPEG's markers up to its end or the file's; what lies between coded pictures is skipped
    by its length.
    """
    place = 2
    while found := MARKER.search(content, place):
        yield (code := found[0][1:])
        place = found.end() + (
            0 if code == b"\x01" else int.from_bytes(content[found.end() : found.end() + 2], "big")
        )


def _png_chunks(content: bytes) -> Iterator[bytes]:
    """The names of a PNG's chunks that are there whole."""
    place = len(PNG)
    while (end := place + 12 + int.from_bytes(content[place : place + 4], "big")) <= len(content):
        yield content[place + 4 : place + 8]
        place = end


def _to_8_bits(image: ndarray) -> ndarray:
    """uint8 as it is; whole numbers by the fewest bits that hold the brightest, others by the brightest
    itself.
    """
    if image.dtype == np.uint8:
        return image
    brightest = float(np.nanmax(image, initial=0.0))
    if np.issubdtype(image.dtype, np.integer):
        brightest = float(2 ** max(8, int(brightest).bit_length()) - 1)
    scaled = np.nan_to_num(image.astype(np.float32)) * np.float32(255.0 / max(brightest, 1e-12))
    return np.clip(np.rint(scaled), 0, 255).astype(np.uint8)


class _Quiet:
    """OpenCV keeps its remarks to itself while any thread is inside."""

    def __init__(self) -> None:
        self.lock, self.inside, self.level = threading.Lock(), 0, 0
        # the place of these two differs between versions of OpenCV, and neither is known to type checkers in
        # both
        self.set_level: Callable[[int], int] = (
            getattr(cv2, "setLogLevel", None) or cv2.utils.logging.setLogLevel
        )  # pyright: ignore

    def __enter__(self) -> None:
        with self.lock:
            if self.inside == 0:
                self.level = self.set_level(0)
            self.inside += 1

    def __exit__(self, *_: object) -> None:
        with self.lock:
            self.inside -= 1
            if self.inside == 0:
                self.set_level(self.level)


_QUIET = _Quiet()


def quiet() -> AbstractContextManager[None]:
    """A block in which OpenCV keeps its remarks to itself."""
    return _QUIET
