"""A picture file as it is: its pixels with their depth and channels, and what stands beside them in the file.

OpenCV decodes and encodes the pixels, as the sensor has them: no turning by the orientation tag, no change of
brightness. What stands beside them (EXIF with its orientation, colour profile, resolution, texts) is taken
from one file and put into the next as the bytes that it is, container by container: segments of a JPEG,
chunks of a PNG and of a WebP, tags of a TIFF, the resolution of a BMP.
"""

from __future__ import annotations

import struct
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import NamedTuple

import cv2
import numpy as np

from orthoscope.files.image_headers import without_turning
from orthoscope.files.images import SUFFIXES, checked_whole, quiet
from orthoscope.files.whole_files import read_bytes
from orthoscope.geometry.arrays import InputError, ndarray

__all__ = ["PictureFile", "encoded", "read_picture"]

# Channels that cv2.remap maps at once, and depths that it knows.
MOST_CHANNELS = 4
DEPTHS = ("uint8", "uint16", "int16", "float32", "float64")
# A JPEG is written with this quality.
JPEG_QUALITY = 95


class PictureFile(NamedTuple):
    """A picture and the file that it came in.

    Attributes:
        pixels: (h,w) or (h,w,c), blue, green, red and perhaps alpha, in the file's own depth; as the sensor
            has them.
        content: the whole file.
        suffix: of the file's kind, by its content.
    """

    pixels: ndarray
    content: bytes
    suffix: str


def read_picture(path: Path) -> PictureFile:
    """A picture as it is in its file.

    Raises:
        InputError: the file is missing, cut off, no picture, or of a depth that cannot be mapped.
    """
    content = read_bytes(path)
    checked_whole(content, path)
    with quiet():
        try:
            pixels = cv2.imdecode(
                np.frombuffer(without_turning(content), dtype=np.uint8), cv2.IMREAD_UNCHANGED
            )
        except cv2.error:
            pixels = None
    if pixels is None:
        raise InputError(
            f"{path} is not a picture that can be read; expected one of {', '.join(SUFFIXES)}. Convert it or"
            f" leave it"
            " out."
        )
    if pixels.dtype.name not in DEPTHS or (pixels.ndim == 3 and pixels.shape[2] > MOST_CHANNELS):
        raise InputError(
            f"{path} has pixels of {pixels.dtype} in {1 if pixels.ndim < 3 else pixels.shape[2]} channels;"
            f" expected"
            f" {', '.join(DEPTHS)} in up to {MOST_CHANNELS}. Convert it or leave it out."
        )
    return PictureFile(pixels, content, _suffix_of(content) or path.suffix.lower())


def encoded(pixels: ndarray, like: PictureFile, path: Path) -> bytes:
    """The file of a picture of the same kind as another, with all that stood beside its pixels.

    Args:
        pixels: of the other's depth and channels; any size.
        like: the picture that it was made from.
        path: for messages.
    Raises:
        InputError: OpenCV cannot write such pixels in such a file.
    """
    suffix = like.suffix
    options = [cv2.IMWRITE_JPEG_QUALITY, JPEG_QUALITY] if suffix == ".jpg" else []
    with quiet():
        try:
            done, content = cv2.imencode(suffix, pixels, options)
        except cv2.error:
            done, content = False, None
    if not done or content is None:
        raise InputError(
            f"{path} cannot be written: {suffix or 'no suffix'} does not take {pixels.dtype} pixels;"
            f" expected one of"
            f" {', '.join(SUFFIXES)}."
        )
    kept = KEEPERS.get(suffix)
    made = content.tobytes()
    try:
        return kept(made, like.content, pixels) if kept else made
    except (struct.error, ValueError, IndexError, OverflowError):
        return made  # what stood beside the pixels is damaged; the pixels are not


def _suffix_of(content: bytes) -> str | None:
    """The kind of a file by how it begins."""
    if content[:4] == b"RIFF" and content[8:12] == b"WEBP":
        return ".webp"
    kinds = {b"\xff\xd8\xff": ".jpg", b"\x89PNG": ".png", b"II*\0": ".tif", b"MM\0*": ".tif", b"BM": ".bmp"}
    return next((suffix for opening, suffix in kinds.items() if content.startswith(opening)), None)


# JPEG: segments before the coded picture. JFIF's has the resolution, APP1 EXIF and XMP, APP2 the profile (but
# MPF, a
# table of further pictures in the file, which are not copied), APP13 captions, FE a comment.
JFIF, APP1, APP2, APP13, COMMENT, SCAN = 0xE0, 0xE1, 0xE2, 0xED, 0xFE, 0xDA


def _jpeg_segments(content: bytes) -> Iterator[tuple[int, bytes]]:
    """Code and bytes, marker and length among them, of each segment before the picture."""
    place = 2
    while content[place] == 0xFF:
        code = content[place + 1]
        if code == 0xFF:
            place += 1
            continue
        if code == SCAN:
            return
        length = struct.unpack_from(">H", content, place + 2)[0]
        yield code, content[place : place + 2 + length]
        place += 2 + length


def _keep_in_jpeg(made: bytes, source: bytes, _: ndarray) -> bytes:
    def goes_along(code: int, segment: bytes) -> bool:
        if code == JFIF:
            return segment[4:8] == b"JFIF"
        return code in (APP1, APP13, COMMENT) or (code == APP2 and segment[4:7] != b"MPF")

    kept = [segment for code, segment in _jpeg_segments(source) if goes_along(code, segment)]
    rest = 2 + sum(len(segment) for code, segment in _jpeg_segments(made) if code == JFIF)
    own = b"" if any(segment[1] == JFIF for segment in kept) else made[2:rest]
    kept.sort(key=lambda segment: segment[1] != JFIF)  # stable: JFIF first, as it must be
    return made[:2] + own + b"".join(kept) + made[rest:]


# PNG: chunks that say nothing of how the pixels are coded.
PNG_KEPT = (b"iCCP", b"sRGB", b"gAMA", b"cHRM", b"cICP", b"pHYs", b"eXIf", b"tEXt", b"zTXt", b"iTXt", b"tIME")


def _png_chunks(content: bytes) -> Iterator[tuple[bytes, bytes]]:
    """Name and bytes of each chunk."""
    place = 8
    while place + 12 <= len(content):
        end = place + 12 + struct.unpack_from(">I", content, place)[0]
        yield content[place + 4 : place + 8], content[place:end]
        place = end


def _keep_in_png(made: bytes, source: bytes, _: ndarray) -> bytes:
    kept = b"".join(chunk for name, chunk in _png_chunks(source) if name in PNG_KEPT)
    parts = [(name, chunk) for name, chunk in _png_chunks(made) if name not in PNG_KEPT]
    head, rest = parts[0][1], b"".join(chunk for _, chunk in parts[1:])
    return made[:8] + head + kept + rest


# WebP: chunks of its extended form, whose head says by bits which are there.
WEBP_FLAGS = {b"ICCP": 0x20, b"EXIF": 0x08, b"XMP ": 0x04}
WEBP_ALPHA = 0x10


def _riff_chunks(content: bytes) -> Iterator[tuple[bytes, bytes]]:
    """Name and data of each chunk."""
    place = 12
    while place + 8 <= len(content):
        length = struct.unpack_from("<I", content, place + 4)[0]
        yield content[place : place + 4], content[place + 8 : place + 8 + length]
        place += 8 + length + length % 2


def _keep_in_webp(made: bytes, source: bytes, pixels: ndarray) -> bytes:
    kept = {name: data for name, data in _riff_chunks(source) if name in WEBP_FLAGS}
    if not kept:
        return made
    pictures = [(name, data) for name, data in _riff_chunks(made) if name in (b"VP8 ", b"VP8L", b"ALPH")]
    height, width, *alpha = pixels.shape
    flags = sum(WEBP_FLAGS[name] for name in kept) | (WEBP_ALPHA if alpha == [4] else 0)
    sides = (width - 1).to_bytes(3, "little") + (height - 1).to_bytes(3, "little")
    chunks = [(b"VP8X", bytes([flags, 0, 0, 0]) + sides)]
    chunks += [(name, kept[name]) for name in (b"ICCP",) if name in kept]
    chunks += pictures
    chunks += [(name, kept[name]) for name in (b"EXIF", b"XMP ") if name in kept]
    body = b"".join(
        name + struct.pack("<I", len(data)) + data + b"\0" * (len(data) % 2) for name, data in chunks
    )
    return b"RIFF" + struct.pack("<I", 4 + len(body)) + b"WEBP" + body


# TIFF: tags that say nothing of how the pixels are coded; two of them lead to tables of tags of their own.
TIFF_KEPT = (
    *(269, 270, 271, 272, 274, 282, 283, 285, 296, 305, 306, 315, 316, 700),
    *(33432, 33723, 34377, 34665, 34675, 34853),
)
TIFF_ORDERS = {b"II": "<", b"MM": ">"}
TIFF_TABLES = (34665, 34853)
# This place in EXIF leads to a third table, which nothing reads.
INTEROPERABILITY_TAG = 40965
TIFF_BYTES = {1: 1, 2: 1, 3: 2, 4: 4, 5: 8, 6: 1, 7: 1, 8: 2, 9: 4, 10: 8, 11: 4, 12: 8, 13: 4}
# A byte order turns so many bytes together in a value of each kind.
TIFF_UNITS = {3: 2, 4: 4, 5: 4, 8: 2, 9: 4, 10: 4, 11: 4, 12: 8, 13: 4}


class _Tag(NamedTuple):
    kind: int
    length: int
    data: bytes
    table: dict[int, _Tag] | None = None


def _tags(content: bytes, place: int, order: str, *, depth: int = 0) -> dict[int, _Tag]:
    """The tags of the table at a place."""
    tags = {}
    (count,) = struct.unpack_from(order + "H", content, place)
    for i in range(count):
        entry = place + 2 + 12 * i
        tag, kind, length = struct.unpack_from(order + "HHI", content, entry)
        size = TIFF_BYTES.get(kind, 0) * length
        start = entry + 8 if size <= 4 else struct.unpack_from(order + "I", content, entry + 8)[0]
        data = content[start : start + size]
        if not size or len(data) != size or tag == INTEROPERABILITY_TAG:
            continue
        table = None
        if tag in TIFF_TABLES and depth == 0:
            table = _tags(content, struct.unpack(order + "I", data[:4])[0], order, depth=1)
        tags[tag] = _Tag(kind, length, data, table)
    return tags


def _keep_in_tiff(made: bytes, source: bytes, _: ndarray) -> bytes:
    order, other = TIFF_ORDERS[made[:2]], TIFF_ORDERS[source[:2]]
    kept = _tags(source, struct.unpack_from(other + "I", source, 4)[0], other)
    tags = _tags(made, struct.unpack_from(order + "I", made, 4)[0], order)
    for tag in TIFF_KEPT:
        tags.pop(tag, None)
        if tag in kept:
            tags[tag] = _turned(kept[tag], other != order)
    made += b"\0" * (len(made) % 2)
    table = _table(tags, len(made), order)
    return made[:4] + struct.pack(order + "I", len(made)) + made[8:] + table


def _turned(tag: _Tag, turn: bool) -> _Tag:
    """A tag in the other byte order."""
    unit = TIFF_UNITS.get(tag.kind, 1) if turn else 1
    data = (
        b"".join(tag.data[i : i + unit][::-1] for i in range(0, len(tag.data), unit))
        if unit > 1
        else tag.data
    )
    inner = tag.table and {key: _turned(value, turn) for key, value in tag.table.items()}
    return _Tag(tag.kind, tag.length, data, inner)


def _table(tags: dict[int, _Tag], place: int, order: str) -> bytes:
    """A table of tags that stands at a place, with what it leads to behind it."""
    after = place + 2 + 12 * len(tags) + 4
    entries, behind = b"", b""
    for tag, (kind, count, data, inner) in sorted(tags.items()):
        if inner is not None:
            start = after + len(behind)
            behind += _table(inner, start, order)
            kind, count, data = 4, 1, struct.pack(order + "I", start)
        elif len(data) > 4:
            start = after + len(behind)
            behind += data + b"\0" * (len(data) % 2)
            entries += struct.pack(order + "HHII", tag, kind, count, start)
            continue
        entries += struct.pack(order + "HHI", tag, kind, count) + data.ljust(4, b"\0")
    return struct.pack(order + "H", len(tags)) + entries + struct.pack(order + "I", 0) + behind


def _keep_in_bmp(made: bytes, source: bytes, _: ndarray) -> bytes:
    return made[:38] + source[38:46] + made[46:]  # pixels a metre, across and down


KEEPERS: dict[str, Callable[[bytes, bytes, ndarray], bytes]] = {
    ".jpg": _keep_in_jpeg,
    ".png": _keep_in_png,
    ".webp": _keep_in_webp,
    ".tif": _keep_in_tiff,
    ".bmp": _keep_in_bmp,
}
