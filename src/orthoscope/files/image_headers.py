"""How large a picture is, by its file's first bytes: asked before memory is taken for it."""

from __future__ import annotations

import struct

__all__ = ["size_in_header"]

START_OF_FRAME = frozenset({*range(0xC0, 0xD0)} - {0xC4, 0xC8, 0xCC})  # markers of a JPEG that hold its size
TIFF_WIDTH, TIFF_HEIGHT = 256, 257  # tags


def size_in_header(content: bytes) -> tuple[int, int] | None:
    """Width and height as a PNG, JPEG, BMP, GIF or TIFF says them; None where the start says nothing."""
    try:
        if content.startswith(b"\x89PNG\r\n\x1a\n"):
            return struct.unpack(">II", content[16:24])
        if content.startswith((b"GIF87a", b"GIF89a")):
            return struct.unpack("<HH", content[6:10])
        if content.startswith(b"BM"):
            width, height = struct.unpack("<ii", content[18:26])
            return abs(width), abs(height)
        if content.startswith((b"II*\0", b"MM\0*")):
            return _of_tiff(content)
        if content.startswith(b"\xff\xd8"):
            return _of_jpeg(content)
    except struct.error:
        pass
    return None


def _of_jpeg(content: bytes) -> tuple[int, int] | None:
    place = 2
    while place + 9 < len(content) and content[place] == 0xFF:
        marker = content[place + 1]
        if marker in START_OF_FRAME:
            height, width = struct.unpack(">HH", content[place + 5 : place + 9])
            return width, height
        place += 2 + struct.unpack(">H", content[place + 2 : place + 4])[0] if marker != 0xFF else 1
    return None


def _of_tiff(content: bytes) -> tuple[int, int] | None:
    order = "<" if content.startswith(b"II") else ">"
    (first,) = struct.unpack(order + "I", content[4:8])
    (count,) = struct.unpack(order + "H", content[first : first + 2])
    sides = {}
    for i in range(count):
        entry = content[first + 2 + 12 * i : first + 14 + 12 * i]
        tag, kind = struct.unpack(order + "HH", entry[:4])
        if tag in (TIFF_WIDTH, TIFF_HEIGHT):
            sides[tag] = struct.unpack(
                order + ("H" if kind == 3 else "I"), entry[8 : 10 if kind == 3 else 12]
            )[0]
    return (sides[TIFF_WIDTH], sides[TIFF_HEIGHT]) if len(sides) == 2 else None
