"""A photograph as a data URI, small enough to stand in a page.

Images are uint8, grey (h,w) or blue, green, red (h,w,3), as OpenCV has them.
"""

from __future__ import annotations

import base64
import io

import numpy as np
from matplotlib.image import imsave

from orthoscope.geometry.arrays import InputError, ndarray

__all__ = ["photograph_uri"]

WIDEST = 1100  # pixels; wider photographs are shrunk by a whole factor
QUALITY = 85


def photograph_uri(image: ndarray) -> str:
    """The photograph, JPEG in base64, at most 1100 pixels wide (a whole factor of its own width, averaged).

    Raises InputError where it is not uint8, grey (h,w) or BGR (h,w,3).
    """
    if (
        image.dtype != np.uint8
        or image.ndim not in (2, 3)
        or (image.ndim == 3 and image.shape[2] != 3)
        or not image.size
    ):
        raise InputError(
            f"photograph is {image.dtype} of shape {image.shape}; expected uint8 of shape (h, w) or (h, w,"
            " 3), as OpenCV reads it."
        )
    colour = np.repeat(image[..., None], 3, axis=-1) if image.ndim == 2 else image[..., ::-1]
    buffer = io.BytesIO()
    imsave(buffer, np.ascontiguousarray(_shrunk(colour)), format="jpeg", pil_kwargs={"quality": QUALITY})
    return "data:image/jpeg;base64," + base64.b64encode(buffer.getvalue()).decode("ascii")


def _shrunk(colour: ndarray) -> ndarray:
    """The mean over squares of pixels, as few as make it narrow enough; what does not fill a square at the
    far sides is cut.
    """
    height, width = colour.shape[:2]
    factor = min(-(-width // WIDEST), height)
    if factor == 1:
        return colour
    whole = colour[: height // factor * factor, : width // factor * factor]
    return (
        whole.reshape(height // factor, factor, width // factor, factor, 3)
        .mean((1, 3))
        .round()
        .astype(np.uint8)
    )
