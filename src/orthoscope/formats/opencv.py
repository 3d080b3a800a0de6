"""OpenCV's calibration files (YAML, XML or JSON of cv2.FileStorage), read as a camera.

OpenCV's own sample, its interactive tool and our export name the same things differently; all of these are
known.
"""

from __future__ import annotations

from pathlib import Path

import cv2
import numpy as np

from orthoscope.files.whole_files import read_text
from orthoscope.formats.export import OPENCV_ORDER
from orthoscope.geometry.arrays import InputError, ndarray
from orthoscope.models.camera import Camera, Intrinsics
from orthoscope.models.lens import Lens
from orthoscope.models.lenses import Brown, KannalaBrandt, Rational

__all__ = ["read_opencv"]

MATRIX = ("camera_matrix", "cameraMatrix", "Camera_Matrix", "intrinsic_matrix", "K", "M1")
COEFFICIENTS = ("distortion_coefficients", "dist_coeffs", "distCoeffs", "Distortion_Coefficients", "D", "D1")
WIDTH, HEIGHT = ("image_width", "image_Width"), ("image_height", "image_Height")
FISHEYE = ("opencv_fisheye", "fisheye", "equidistant")


def read_opencv(path: str | Path, *, image_size: tuple[int, int] | None = None) -> Camera:
    """The camera in a file of cv2.FileStorage: 4, 5, 8, 12 or 14 coefficients, or the 4 of cv2.fisheye where
    the file says so.

    image_size: (width, height), for a file that does not hold it.
    Raises InputError where the file is none of OpenCV's or something is missing.
    """
    storage = _opened(read_text(path), path)
    matrix, coefficients = _matrix(storage, MATRIX), _matrix(storage, COEFFICIENTS)
    if matrix is None or matrix.shape != (3, 3):
        raise InputError(
            f"{path} has no 3x3 matrix named {' or '.join(MATRIX[:2])}; expected a file of OpenCV's"
            " calibration."
        )
    if abs(matrix[0, 1]) > 0:
        raise InputError(
            f"{path} has a skew of {matrix[0, 1]:g} px, which OpenCV itself leaves out; set it to 0 to read"
            " what OpenCV sees."
        )
    size = image_size or (_whole(storage, WIDTH), _whole(storage, HEIGHT))
    if not all(size):
        raise InputError(
            f"{path} does not say how large its images are (image_width, image_height); hand in image_size."
        )
    lens = _lens(
        np.zeros(0) if coefficients is None else coefficients.ravel(), fisheye=_is_fisheye(storage), path=path
    )
    return Camera(size, Intrinsics(matrix[0, 0], matrix[1, 1], matrix[0, 2], matrix[1, 2]), lens)


def _opened(text: str, path: str | Path) -> cv2.FileStorage:
    try:
        return cv2.FileStorage(text, cv2.FILE_STORAGE_READ | cv2.FILE_STORAGE_MEMORY)
    except (cv2.error, SystemError) as error:  # OpenCV 5 wraps the first in the second
        raise InputError(
            f"{path} cannot be read by OpenCV; expected YAML, XML or JSON of cv2.FileStorage."
        ) from error


def _lens(coefficients: ndarray, *, fisheye: bool, path: str | Path) -> Lens:
    """The lens with these coefficients; more than 5 are a rational lens unless k4, k5 and k6 are zero."""
    count = len(coefficients)
    if fisheye and count == 4:
        return KannalaBrandt(*coefficients.tolist())
    if fisheye or count not in (0, 4, 5, 8, 12, 14):
        raise InputError(
            f"{path} has {count} distortion coefficients; expected 4, 5, 8, 12 or 14, or 4 of a fisheye."
        )
    values = dict(zip(OPENCV_ORDER, coefficients.tolist(), strict=False))
    rational = any(values.get(name) for name in ("k4", "k5", "k6")) or count == 8
    kind = Rational if rational else Brown
    return kind().with_coefficients(**{name: value for name, value in values.items() if name in kind.names()})


def _is_fisheye(storage: cv2.FileStorage) -> bool:
    flag, model = storage.getNode("fisheye_model"), storage.getNode("distortion_model")
    return (not flag.empty() and flag.real() != 0) or (not model.empty() and model.string() in FISHEYE)


def _matrix(storage: cv2.FileStorage, names: tuple[str, ...]) -> ndarray | None:
    """The first matrix of these names."""
    for name in names:
        node = storage.getNode(name)
        if not node.empty() and (matrix := node.mat()) is not None:
            return np.asarray(matrix, dtype=float)
    return None


def _whole(storage: cv2.FileStorage, names: tuple[str, ...]) -> int:
    """The first whole number of these names; 0 where there is none."""
    return next((int(node.real()) for node in map(storage.getNode, names) if not node.empty()), 0)
