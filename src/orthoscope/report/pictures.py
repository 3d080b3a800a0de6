"""The user's own photographs as the page shows them: JPEG in data URIs, as small as the page's size asks for.

A page of 20 photographs is to stay below 1.5 MB and one of 200 below 6 MB, so the more photographs there are
the smaller each is shown. OpenCV is loaded only where there are photographs.
"""

from __future__ import annotations

import base64
from collections.abc import Callable, Mapping
from concurrent.futures import Executor
from dataclasses import dataclass, field
from functools import partial
from pathlib import Path

import numpy as np

from orthoscope.fitting.calibration import Calibration
from orthoscope.geometry.arrays import InputError, ndarray

__all__ = ["Pictures", "picture_uri", "pictures_of"]

# All small photographs together have at most so many bytes, before base64 adds a third.
BYTES_OF_ALL = 2_700_000
# One small photograph has at most so many bytes, however few there are.
BYTES_OF_EACH = 36_000
# A small photograph is at most so many pixels wide.
SMALL_WIDTH = 640
# A large photograph is at most so many pixels wide.
LARGE_WIDTH = 1100
# The photograph that is shown large, before and after, has at most so many bytes.
BYTES_OF_LARGE = 120_000
QUALITIES = (
    (1.0, 82),
    (1.0, 60),
    (0.8, 60),
    (0.65, 60),
    (0.5, 55),
    (0.35, 50),
    (0.25, 45),
)  # share of the width


@dataclass(frozen=True)
class Pictures:
    """What is shown of photographs, as data URIs.

    Attributes:
        small: by the view's name.
        large: the view's name, the photograph and the same without distortion; None where there is none.
    """

    small: Mapping[str, str] = field(default_factory=dict)
    large: tuple[str, str, str] | None = None


def pictures_of(
    calibration: Calibration,
    files: Mapping[str, Path],
    *,
    keep: str = "all",
    executor: Executor | None = None,
    progress: Callable[[int, int, str], None] | None = None,
) -> Pictures:
    """The photographs of a calibration's views, as far as their files are at hand and can be read.

    Args:
        files: where the photograph of each view is.
        keep: of the straight picture, `all` or `valid`.
        executor: where photographs are read; by default here, one after the other.
        progress: called with (photographs done, photographs, name).
    """
    names = [view.image for view in calibration.detections.views if view.image in files]
    if not names:
        return Pictures()
    from orthoscope.straight.undistort import before_and_after

    most = int(min(BYTES_OF_EACH, BYTES_OF_ALL / len(names)))
    run = executor.map if executor else map
    small = {}
    shrink = partial(_small, size=calibration.camera.image_size, most=most)
    for done, (name, uri) in enumerate(
        zip(names, run(shrink, [files[name] for name in names]), strict=True), 1
    ):
        if uri:
            small[name] = uri
        if progress:
            progress(done, len(names), name)
    shown = before_and_after(calibration, files, keep=keep)
    if shown is None:
        return Pictures(small)
    name, before, after = shown
    taken, straight = (picture_uri(image, LARGE_WIDTH, BYTES_OF_LARGE) for image in (before, after))
    return Pictures(small, (name, taken, straight))


def picture_uri(image: ndarray, widest: int, most: int) -> str:
    """A photograph as a JPEG of about `most` bytes at most, as wide as that allows.

    Args:
        image: uint8, grey (h,w) or blue, green, red (h,w,3).
        widest: pixels.
    Raises:
        InputError: it is no such array.
    """
    import cv2

    if (
        image.dtype != np.uint8
        or image.ndim not in (2, 3)
        or image.shape[2:] not in ((), (3,))
        or not image.size
    ):
        raise InputError(
            f"photograph is {image.dtype} of shape {image.shape}; expected uint8 of shape (h, w) or (h, w,"
            " 3), as OpenCV reads it."
        )
    content = b""
    for share, quality in QUALITIES:
        width = max(1, round(share * min(widest, image.shape[1])))
        height = max(1, round(image.shape[0] * width / image.shape[1]))
        shrunk = cv2.resize(image, (width, height), interpolation=cv2.INTER_AREA)
        content = cv2.imencode(".jpg", shrunk, [cv2.IMWRITE_JPEG_QUALITY, quality])[1].tobytes()
        if len(content) <= most:
            break
    return "data:image/jpeg;base64," + base64.b64encode(content).decode("ascii")


def _small(path: Path, *, size: tuple[int, int], most: int) -> str | None:
    """One photograph, shrunk; None where it cannot be read or is of another size now."""
    from orthoscope.files.images import read_image

    try:
        image = read_image(path, grey=False)
    except InputError:
        return None
    return picture_uri(image, SMALL_WIDTH, most) if (image.shape[1], image.shape[0]) == tuple(size) else None
