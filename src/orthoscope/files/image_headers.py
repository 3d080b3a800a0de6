"""What a picture's file says before its pixels: how large it is, asked before memory is taken for it, and
how the camera was held.
"""

from __future__ import annotations

import struct

__all__ = ["size_in_header", "without_turning"]

# These markers of a JPEG hold its size.
START_OF_FRAME_MARKERS = frozenset({*range(0xC0, 0xD0)} - {0xC4, 0xC8, 0xCC})
# This tag holds a picture's width.
TIFF_WIDTH = 256
# This tag holds a picture's height.
TIFF_HEIGHT = 257
# This tag says which side of a picture is up.
TIFF_ORIENTATION = 274
# How a TIFF begins, also one beyond 4 GB: byte order, and how a place, a count of tags and a tag are written.
TIFF_FORMS = {
    b"II*\0": ("<", "I", "H", "HHI4x"),
    b"MM\0*": (">", "I", "H", "HHI4x"),
    b"II+\0": ("<", "Q", "Q", "HHQ8x"),
    b"MM\0+": (">", "Q", "Q", "HHQ8x"),
}
# A tag's value of this kind has two bytes.
SHORT_KIND = 3


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
        if marker in START_OF_FRAME_MARKERS:
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


def without_turning(content: bytes) -> bytes:
    """A picture's file that OpenCV reads as the sensor saw it: a TIFF's orientation tags become `upright`.

    OpenCV turns TIFFs by that tag whatever it is told. Only the tags' own bytes change; a file that is no
    TIFF is given back as it is, a damaged one is mended as far as it can be followed.
    """
    if content[:4] not in TIFF_FORMS:
        return content
    order, place_form, count_form, tag_form = TIFF_FORMS[content[:4]]
    mended, seen = bytearray(content), set()
    size = struct.calcsize(order + tag_form)
    try:
        (table,) = struct.unpack_from(order + place_form, content, 8 if place_form == "Q" else 4)
        while table and table not in seen:
            seen.add(table)
            (count,) = struct.unpack_from(order + count_form, content, table)
            first = table + struct.calcsize(order + count_form)
            for entry in range(first, min(first + count * size, len(content) - size + 1), size):
                if struct.unpack_from(order + "H", content, entry)[0] == TIFF_ORIENTATION:
                    value = struct.pack(order + tag_form[:3] + "H", TIFF_ORIENTATION, SHORT_KIND, 1, 1)
                    mended[entry : entry + size] = value.ljust(size, b"\0")
            (table,) = struct.unpack_from(order + place_form, content, first + count * size)
    except (struct.error, OverflowError):
        pass  # OpenCV then says what is wrong with it
    return bytes(mended)
