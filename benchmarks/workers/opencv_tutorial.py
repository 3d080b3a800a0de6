"""The script that a user would write after OpenCV's tutorial: a folder of photographs of a 9x6 chessboard, a
camera.
"""

from __future__ import annotations

import sys
from pathlib import Path

import cv2
import numpy as np


def main(folder: str) -> None:
    """Find, refine, calibrate, print."""
    points = np.zeros((9 * 6, 3), np.float32)
    points[:, :2] = np.mgrid[:9, :6].T.reshape(-1, 2)
    criteria = (cv2.TERM_CRITERIA_EPS + cv2.TERM_CRITERIA_MAX_ITER, 30, 0.001)
    objects, images, size = [], [], (0, 0)
    for path in sorted(Path(folder).glob("*.jpg")):
        image = cv2.imread(str(path))
        assert image is not None
        grey = cv2.cvtColor(image, cv2.COLOR_BGR2GRAY)
        size = (grey.shape[1], grey.shape[0])
        found, corners = cv2.findChessboardCorners(grey, (9, 6), None)
        if found:
            objects.append(points)
            images.append(cv2.cornerSubPix(grey, corners, (11, 11), (-1, -1), criteria))
    rms, matrix, lens, *_ = cv2.calibrateCamera(objects, images, size, None, None)
    print(rms, matrix, lens)


if __name__ == "__main__":
    main(sys.argv[1])
