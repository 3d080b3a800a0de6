"""The loop that a user would write: photographs of a folder, or frames of a video, made straight with OpenCV,
one process.

python opencv_folder.py CAMERA.npz FOLDER_OR_VIDEO OUT
"""

from __future__ import annotations

import sys
from pathlib import Path

import cv2
import numpy as np


def straight_folder(folder: Path, out: Path, maps: tuple[np.ndarray, np.ndarray]) -> None:
    """imread, remap, imwrite."""
    for path in sorted(folder.iterdir()):
        image = cv2.imread(str(path))
        assert image is not None
        cv2.imwrite(str(out / path.name), cv2.remap(image, *maps, cv2.INTER_LINEAR))


def straight_video(path: Path, out: Path, maps: tuple[np.ndarray, np.ndarray], size: tuple[int, int]) -> None:
    """read, remap, write."""
    clip = cv2.VideoCapture(str(path))
    written = cv2.VideoWriter(
        str(out / path.name), cv2.VideoWriter.fourcc(*"mp4v"), clip.get(cv2.CAP_PROP_FPS), size
    )
    while True:
        there, frame = clip.read()
        if not there:
            break
        written.write(cv2.remap(frame, *maps, cv2.INTER_LINEAR))
    written.release()


def main(camera: str, source: str, target: str) -> None:
    """Make the maps once, then go over what there is."""
    with np.load(camera) as told:
        matrix, lens, straight, size = told["matrix"], told["lens"], told["straight"], told["image_size"]
    width, height = (int(side) for side in size)
    maps = cv2.initUndistortRectifyMap(matrix, lens, None, straight, (width, height), cv2.CV_16SC2)
    out = Path(target)
    out.mkdir(parents=True, exist_ok=True)
    if Path(source).is_dir():
        straight_folder(Path(source), out, maps)
    else:
        straight_video(Path(source), out, maps, (width, height))


if __name__ == "__main__":
    main(*sys.argv[1:])
