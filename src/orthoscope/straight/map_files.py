"""Maps as files: where each straight pixel looks in the photograph, for other programs that straighten.

Two arrays (h,w) of float32, x and y in pixels, as `cv2.remap` takes them; NaN where the lens has no image. As
NumPy's files, or as one file of OpenCV's (`cv2.FileStorage`, read in C++ by `fs["map_x"] >> map_x`).
"""

from __future__ import annotations

import gzip
import io

import cv2
import numpy as np

from orthoscope.geometry.arrays import ndarray

__all__ = ["map_files"]

# The one file of OpenCV's, whose reader unpacks it by itself.
OPENCV_NAME = "maps.yml.gz"


def map_files(map_x: ndarray, map_y: ndarray, *, kind: str) -> dict[str, bytes]:
    """The contents of the files, by name.

    Args:
        map_x: (h,w) float32, pixels.
        map_y: (h,w) float32, pixels.
        kind: npy or opencv.
    """
    maps = {"map_x": map_x, "map_y": map_y}
    if kind == "npy":
        return {f"{name}.npy": _npy(values) for name, values in maps.items()}
    flags = cv2.FILE_STORAGE_WRITE | cv2.FILE_STORAGE_MEMORY | cv2.FILE_STORAGE_FORMAT_YAML
    storage = cv2.FileStorage(".yml", flags | cv2.FILE_STORAGE_BASE64)
    for name, values in maps.items():
        storage.write(name, np.ascontiguousarray(values))
    text = storage.releaseAndGetString()
    return {OPENCV_NAME: gzip.compress(text.encode(), mtime=0)}


def _npy(values: ndarray) -> bytes:
    np.save(content := io.BytesIO(), values)
    return content.getvalue()
