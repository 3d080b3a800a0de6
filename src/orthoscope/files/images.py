"""Photographs: which files they are, read as 8-bit pictures of the sensor's pixels, and written as wholes.

A camera's lens does not turn with the telephone, so a tag that says how it was held turns nothing. OpenCV
decodes; before version 5 it says nothing of a JPEG that is cut off (it comes back half grey), so the end that
JPEG and PNG must have is looked for first, chunk by chunk: thumbnails have ends of their own, and telephones
put whole films after the picture. 16-bit pictures are brought to 8 bits by the fewest bits that hold their
brightest value: cameras fill 10, 12 or 14 bits of the 16, and dividing by 257 would turn those nearly black.
"""

from __future__ import annotations

import glob
import re
import threading
from collections import Counter
from collections.abc import Callable, Iterable, Iterator
from contextlib import AbstractContextManager
from os import PathLike
from pathlib import Path

import cv2
import numpy as np

from orthoscope.files.decoders import DECODED_SUFFIXES, RAW_SUFFIXES, decoded
from orthoscope.files.image_headers import size_in_header, without_turning
from orthoscope.files.whole_files import read_bytes, write_bytes
from orthoscope.geometry.arrays import InputError, ndarray

__all__ = [
    "MOST_MEGAPIXELS",
    "SUFFIXES",
    "check_size",
    "checked_whole",
    "names_of",
    "pages_of",
    "passed_over",
    "photographs",
    "quiet",
    "read_image",
    "to_grey",
    "write_image",
]

SUFFIXES = (".png", ".jpg", ".jpeg", ".bmp", ".tif", ".tiff", ".webp", ".pgm", ".ppm", ".gif")
READ_SUFFIXES = (*SUFFIXES, *DECODED_SUFFIXES)
# Files with these suffixes may hold several pictures.
PAGED_SUFFIXES = (".tif", ".tiff", ".webp", ".gif")
# A file that says it holds more is hardly a photograph.
MOST_MEGAPIXELS = 500.0
# Grey levels between these quantiles are stretched to the whole range.
STRETCHED_QUANTILES = (0.005, 0.995)
# The quantiles are taken from about so many pixels.
SAMPLED_PIXELS = 200_000
# A JPEG begins with these bytes.
JPEG_START = b"\xff\xd8\xff"
# A PNG begins with these bytes.
PNG_START = b"\x89PNG\r\n\x1a\n"
MARKER = re.compile(
    rb"\xff[^\x00\xd0-\xd7\xff]"
)  # of a JPEG's segment; FF 00 and restarts are part of the coded picture

Path_ = str | PathLike[str]


def photographs(paths: Path_ | Iterable[Path_], *, also: tuple[str, ...] = ()) -> list[Path]:
    """The image files that files, folders (not the folders in them) and globs name, each once, `left2` before
    `left10`.

    Args:
        paths: one or several.
        also: endings of other files to take besides.
    Raises:
        InputError: a path is missing, a glob matches nothing or a folder holds no photograph.
    """
    given = [paths] if isinstance(paths, str | PathLike) else list(paths)
    if not given:
        raise InputError(
            "no photographs were named; expected files, folders or globs, such as photos/ or photos/*.png."
        )
    found: dict[Path, Path] = {}
    for path in given:
        for file in _expanded(Path(path), (*READ_SUFFIXES, *also)):
            found.setdefault(file.resolve(), file)
    return list(found.values())


def passed_over(paths: Path_ | Iterable[Path_], *, also: tuple[str, ...] = ()) -> dict[str, int]:
    """How many files of each ending the named folders hold that are no photographs."""
    given = [paths] if isinstance(paths, str | PathLike) else list(paths)
    folders = {Path(path).resolve() for path in given if Path(path).is_dir()}
    others: list[str] = []
    for folder in folders:
        files = [file for file in folder.iterdir() if file.is_file() and not file.name.startswith(".")]
        taken = _photographs_in(folder, (*READ_SUFFIXES, *also))
        others += [file.suffix.lower() or "(none)" for file in set(files) - set(taken)]
    return dict(sorted(Counter(others).items()))


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


def read_image(path: Path_, *, grey: bool = False, most_megapixels: float = MOST_MEGAPIXELS) -> ndarray:
    """A photograph as its sensor saw it: uint8 (h,w) where grey, else (h,w,3) blue, green, red.

    Args:
        path: of the file.
        grey: one channel, its contrast stretched where it has more than 8 bits.
        most_megapixels: a file that says it holds more is refused before memory is taken.
    Raises:
        InputError: the file is missing, empty, no image, cut off or too large.
    """
    suffix = Path(path).suffix.lower()
    if suffix in DECODED_SUFFIXES:
        try:
            image = decoded(_content(Path(path), most_megapixels), suffix)
        except InputError as error:
            raise error if str(path) in str(error) else InputError(f"{path}: {error}") from error
        return to_grey(image) if grey else _to_8_bits(image)
    content = without_turning(_content(Path(path), most_megapixels))
    flags = (cv2.IMREAD_GRAYSCALE if grey else cv2.IMREAD_COLOR) | cv2.IMREAD_ANYDEPTH
    flags |= cv2.IMREAD_IGNORE_ORIENTATION
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
    return to_grey(image) if grey else _to_8_bits(image)


def pages_of(path: Path) -> list[ndarray]:
    """The pictures (h,w) of a file that holds several, read at once; none of one that holds one, or where it
    cannot be told.
    """
    if path.suffix.lower() not in PAGED_SUFFIXES:
        return []
    flags = cv2.IMREAD_GRAYSCALE | cv2.IMREAD_ANYDEPTH | cv2.IMREAD_IGNORE_ORIENTATION
    try:
        content = without_turning(_content(path, MOST_MEGAPIXELS))
        with _QUIET:
            _, pages = cv2.imdecodemulti(np.frombuffer(content, dtype=np.uint8), flags)
    except (InputError, cv2.error):
        return []
    return list(pages) if len(pages) > 1 else []


def to_grey(image: ndarray) -> ndarray:
    """A picture (h,w) or (h,w,c) of any depth as (h,w) uint8.

    More than 8 bits are stretched between the quantiles of 0.5 % and 99.5 %, with a tenth of that to spare: a
    thermal picture uses few of its levels, and one infinite pixel says nothing of the others.
    """
    if image.ndim == 3:
        colours = image[..., :3].astype(np.float32 if image.dtype != np.uint8 else np.uint8)
        image = cv2.cvtColor(colours, cv2.COLOR_BGR2GRAY) if image.shape[2] >= 3 else image[..., 0]
    if image.dtype == np.uint8:
        return np.ascontiguousarray(image)
    values = image.astype(np.float32)
    finite = values[np.isfinite(values)]
    if not len(finite):
        return np.zeros(image.shape, dtype=np.uint8)
    low, high = np.quantile(finite[:: max(1, len(finite) // SAMPLED_PIXELS)], STRETCHED_QUANTILES)
    spare = 0.1 * (high - low)
    low, high = low - spare, max(high + spare, low + 1e-12)
    stretched = np.nan_to_num(values, nan=low, posinf=high, neginf=low)
    return np.clip(np.rint((stretched - low) * np.float32(255.0 / (high - low))), 0, 255).astype(np.uint8)


def _content(path: Path, most_megapixels: float) -> bytes:
    """The bytes of a file that can be an image."""
    if path.exists() and not path.is_file():
        raise InputError(
            f"{path} is no file but a folder, pipe or device; expected a photograph. Leave it out."
        )
    content = read_bytes(path)
    check_size(path, size_in_header(content) or (0, 0), most_megapixels)
    return checked_whole(content, path)


def check_size(name: Path_, size: tuple[int, int], most_megapixels: float) -> None:
    """Checks that a picture is not too large.

    Args:
        name: of it, for the message.
        size: (width, height) pixels.
        most_megapixels: that it may have.
    Raises:
        InputError: it is.
    """
    width, height = size
    if width * height > most_megapixels * 1e6:
        raise InputError(
            f"{name} says that it is {width}x{height}, {width * height / 1e6:.0f} megapixels; expected at"
            f" most {most_megapixels:g}. Allow more (most_megapixels; detect --max-megapixels) if it is a"
            " photograph."
        )


def checked_whole(content: bytes, path: Path_) -> bytes:
    """The bytes of a picture's file.

    Raises:
        InputError: there are none or they are cut off.
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

    Raises:
        InputError: the format is not known or the place cannot be written.
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


def _expanded(path: Path, suffixes: tuple[str, ...]) -> list[Path]:
    """The files that one path means."""
    if path.is_dir():
        files = _photographs_in(path, suffixes)
        if not files:
            raise InputError(
                f"folder {path} holds no photograph; expected files ending in {', '.join(SUFFIXES)}. Name the"
                " folder that has them."
            )
        return sorted(files, key=_natural)
    if path.exists() and not path.is_file():
        raise InputError(
            f"{path} is a pipe or a device; expected a photograph, a folder or a glob. Name a file."
        )
    if path.exists():
        return [path]
    files = [
        file for name in glob.glob(str(path), recursive=True) if _is_photograph(file := Path(name), suffixes)
    ]
    if not files:
        raise InputError(
            f"{path} does not exist; expected a photograph, a folder of photographs or a glob that matches"
            " some."
        )
    return sorted(files, key=_natural)


def _photographs_in(folder: Path, suffixes: tuple[str, ...]) -> list[Path]:
    """The photographs of a folder; raw ones where there are no others."""
    files = [file for file in folder.iterdir() if _is_photograph(file, suffixes)]
    return [file for file in files if file.suffix.lower() not in RAW_SUFFIXES] or files


def _is_photograph(file: Path, suffixes: tuple[str, ...]) -> bool:
    """By its name; a file that is named itself is believed to be one."""
    return file.suffix.lower() in suffixes and not file.name.startswith(".") and file.is_file()


def _natural(path: Path) -> list[tuple[int, int, str]]:
    """A sort key in which numbers count as numbers."""
    return [
        (0, int(part), "") if part.isdecimal() else (1, 0, part.lower())
        for part in re.split(r"(\d+)", str(path))
        if part
    ]


def _is_whole(content: bytes) -> bool:
    """Whether a JPEG or a PNG has its end; other formats are left to their decoder, which notices."""
    if content.startswith(JPEG_START):
        return b"\xd9" in _jpeg_segments(content)
    if content.startswith(PNG_START):
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
    place = len(PNG_START)
    while (end := place + 12 + int.from_bytes(content[place : place + 4], "big")) <= len(content):
        yield content[place + 4 : place + 8]
        place = end


def _to_8_bits(image: ndarray) -> ndarray:
    """uint8 as it is; whole numbers by the fewest bits that hold the brightest, others by the brightest
    itself.
    """
    if image.dtype == np.uint8:
        return image
    brightest = float(np.max(image, initial=0.0, where=np.isfinite(image)))
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
