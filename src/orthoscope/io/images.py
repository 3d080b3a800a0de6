"""Photographs: which files they are, read upright as 8-bit pictures, and written as wholes.

Floor 5.  OpenCV reads; it turns pictures upright by their EXIF tag, but says nothing of a file that is cut off (a JPEG comes back half grey), so
the end that each format must have is looked for first.  16-bit pictures are brought to 8 bits by their own brightest value: cameras
fill 10, 12 or 14 bits of the 16, and a fixed divisor would turn those nearly black.
"""

from __future__ import annotations

import glob
import re
from collections.abc import Iterable
from os import PathLike
from pathlib import Path

import cv2
import numpy as np

from orthoscope.geometry.arrays import InputError, ndarray
from orthoscope.io.files import read_bytes, write_bytes

__all__ = ["SUFFIXES", "names_of", "photographs", "read_image", "write_image"]

SUFFIXES = (".png", ".jpg", ".jpeg", ".bmp", ".tif", ".tiff", ".webp", ".pgm", ".ppm")
ENDS = {b"\x89PNG": b"IEND", b"\xff\xd8\xff": b"\xff\xd9"}  # how a format begins, and what a whole file has near its end
TAIL = 4096  # bytes: some cameras put a few after the end

Path_ = str | PathLike[str]


def photographs(paths: Path_ | Iterable[Path_]) -> list[Path]:
    """The image files that files, folders (not the folders in them) and globs name, each once, `left2` before `left10`.

    Raises InputError where a path is missing, a glob matches nothing or a folder holds no photograph.
    """
    given = [paths] if isinstance(paths, str | PathLike) else list(paths)
    if not given:
        raise InputError("no photographs were named; expected files, folders or globs, such as photos/ or photos/*.png.")
    found = [file for path in given for file in _expanded(Path(path))]
    return list(dict.fromkeys(found))


def names_of(files: Iterable[Path]) -> list[str]:
    """A short name for each photograph: its file name, with as much of its folder as tells it from the others."""
    files = list(files)
    for depth in range(1, max((len(file.parts) for file in files), default=1) + 1):
        names = ["/".join(file.parts[-depth:]) for file in files]
        if len(set(names)) == len(names):
            return names
    return [str(file) for file in files]


def read_image(path: Path_, *, grey: bool) -> ndarray:
    """A photograph, upright: uint8 (h,w) where grey, else (h,w,3) blue, green, red.

    Raises InputError where the file is missing, empty, no image or cut off.
    """
    content = read_bytes(Path(path))
    if not content:
        raise InputError(f"{path} is empty; expected a photograph. Copy it again or leave it out.")
    for start, end in ENDS.items():
        if content.startswith(start) and end not in content[-TAIL:]:
            raise InputError(
                f"{path} is cut off ({len(content)} bytes without an end); expected a whole photograph. Copy it again or leave it out."
            )
    flags = (cv2.IMREAD_GRAYSCALE if grey else cv2.IMREAD_COLOR) | cv2.IMREAD_ANYDEPTH
    try:
        image = cv2.imdecode(np.frombuffer(content, dtype=np.uint8), flags)
    except cv2.error:
        image = None
    if image is None:
        raise InputError(f"{path} is not an image that can be read; expected one of {', '.join(SUFFIXES)}. Convert it or leave it out.")
    return _to_8_bits(image)


def write_image(path: Path_, image: ndarray) -> None:
    """Writes a picture, uint8 (h,w) or (h,w,3), in the format that its name ends in; as a whole or not at all.

    Raises InputError where the format is not known or the place cannot be written.
    """
    suffix = Path(path).suffix.lower()
    options = [cv2.IMWRITE_JPEG_QUALITY, 95] if suffix in (".jpg", ".jpeg") else []
    try:
        done, content = cv2.imencode(suffix, image, options)
    except cv2.error:
        done, content = False, None
    if not done or content is None:
        raise InputError(
            f"{path} cannot be written: {suffix or 'no suffix'} is no image format known here; expected one of {', '.join(SUFFIXES)}."
        )
    write_bytes(Path(path), content.tobytes())


def _expanded(path: Path) -> list[Path]:
    """The files that one path means."""
    if path.is_dir():
        files = [file for file in path.iterdir() if file.suffix.lower() in SUFFIXES and not file.name.startswith(".")]
        if not files:
            raise InputError(
                f"folder {path} holds no photograph; expected files ending in {', '.join(SUFFIXES)}. Name the folder that has them."
            )
        return sorted(files, key=_natural)
    if path.exists():
        return [path]
    files = [Path(name) for name in glob.glob(str(path))]
    if not files:
        raise InputError(f"{path} does not exist; expected a photograph, a folder of photographs or a glob that matches some.")
    return sorted(files, key=_natural)


def _natural(path: Path) -> list[tuple[int, int, str]]:
    """A sort key in which numbers count as numbers."""
    return [(0, int(part), "") if part.isdigit() else (1, 0, part.lower()) for part in re.split(r"(\d+)", path.name) if part]


def _to_8_bits(image: ndarray) -> ndarray:
    if image.dtype == np.uint8:
        return image
    brightest = float(np.nanmax(image)) if image.size else 0.0
    return np.clip(image * (255.0 / max(brightest, 1e-12)) + 0.5, 0, 255).astype(np.uint8)
