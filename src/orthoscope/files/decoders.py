"""Photographs that OpenCV does not read: telephones' HEIC and cameras' raw files, by packages of their own.

What comes out is what the sensor saw, unturned: a HEIC file turns its picture by a property of its own, which
is undone; a raw file is developed without turning and without a change of its brightness.
"""

from __future__ import annotations

import io
from collections.abc import Callable

import numpy as np

from orthoscope.geometry.arrays import InputError, ndarray
from orthoscope.machine.missing import how_to_install

__all__ = ["DECODED_SUFFIXES", "RAW_SUFFIXES", "decoded"]

# How a turn is written in a HEIC file; the byte behind says by how many quarters, anticlockwise.
TURN = b"irot"


def decoded(content: bytes, suffix: str) -> ndarray:
    """The picture of a file with one of DECODED_SUFFIXES: (h,w,3) blue, green, red, uint8 or uint16.

    Raises:
        InputError: the package that reads it is missing, or it cannot be read.
    """
    try:
        return DECODED_SUFFIXES[suffix](content)
    except ModuleNotFoundError as error:
        raise InputError(how_to_install(error) or str(error)) from error
    except Exception as error:  # the decoders have errors of their own, and only they know which
        raise InputError(f"it cannot be read ({error}); expected a whole {suffix} file.") from error


def _heic(content: bytes) -> ndarray:
    import pillow_heif

    picture = np.asarray(pillow_heif.open_heif(content, convert_hdr_to_8bit=False))
    place = content.find(TURN)
    quarters = content[place + len(TURN)] & 3 if place >= 0 else 0
    picture = np.rot90(picture, -quarters)
    return np.ascontiguousarray(picture[..., 2::-1] if picture.ndim == 3 else picture)


def _raw(content: bytes) -> ndarray:
    import rawpy  # pyright: ignore[reportMissingImports]  no wheel for every Python

    with rawpy.imread(io.BytesIO(content)) as raw:
        picture = raw.postprocess(user_flip=0, output_bps=16, no_auto_bright=True, gamma=(1, 1))
    return np.ascontiguousarray(picture[..., ::-1])


# Raw files of cameras; beside them there is often the same photograph as JPEG.
RAW_SUFFIXES = (".dng", ".cr2", ".cr3", ".nef", ".arw", ".raf", ".orf", ".rw2", ".pef")
# What reads the files with each ending.
DECODED_SUFFIXES: dict[str, Callable[[bytes], ndarray]] = {
    **dict.fromkeys((".heic", ".heif", ".hif"), _heic),
    **dict.fromkeys(RAW_SUFFIXES, _raw),
}
