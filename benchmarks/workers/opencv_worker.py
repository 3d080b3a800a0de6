"""OpenCV as a peer: calibrating with tight criteria, finding corners, undistorting points."""

from __future__ import annotations

from functools import partial
from typing import Any

import cv2
import numpy as np
from corners import Corners, Fit, tasks_of
from found import finding
from served import serve, timed

CRITERIA = (cv2.TERM_CRITERIA_EPS + cv2.TERM_CRITERIA_COUNT, 100, 1e-10)
TWENTY = (cv2.TERM_CRITERIA_EPS + cv2.TERM_CRITERIA_COUNT, 20, 1e-12)
RATIONAL, PRISM, TILT = cv2.CALIB_RATIONAL_MODEL, cv2.CALIB_THIN_PRISM_MODEL, cv2.CALIB_TILTED_MODEL
FLAGS = {"5": 0, "8": RATIONAL, "12": RATIONAL | PRISM, "14": RATIONAL | PRISM | TILT}


def flat(corners: Corners, flags: int) -> Fit:
    """The board as it was designed."""
    objects, images = _lists(corners)
    rms, matrix, lens, *_ = cv2.calibrateCamera(
        objects, images, corners.image_size, None, None, flags=flags, criteria=CRITERIA
    )
    return Fit(partial(_project, matrix=matrix, lens=lens), corners.points, rms)


def released(corners: Corners, flags: int) -> Fit:
    """The board's corners free (K. Strobl and G. Hirzinger, ICCV workshops 2011), by LU: the default solver
    takes minutes.
    """
    if any(len(ids) < len(corners.points) for ids in corners.ids):
        raise ValueError("calibrateCameraRO takes whole boards only")
    objects, images = _lists(corners)
    fixed = int(np.argmax(corners.points[:, 0] - corners.points[:, 1]))  # the end of the first row
    arguments: Any = (
        objects,
        images,
        corners.image_size,
        fixed,
        None,
        None,
    )  # the stubs do not know that no guess is needed
    rms, matrix, lens, _, _, points, *_ = cv2.calibrateCameraRO(
        *arguments, flags=flags | cv2.CALIB_USE_LU, criteria=CRITERIA
    )
    return Fit(
        partial(_project, matrix=matrix, lens=lens), np.asarray(points, dtype=float).reshape(-1, 3), rms
    )


def fisheye(corners: Corners) -> Fit:
    """Four coefficients of the angle, the flags that the tutorials show, and a focal length to start from: by
    itself it often fails.
    """
    objects, images = ([part[None].astype(float) for part in parts] for parts in _lists(corners))
    flags = (
        _fisheye_flag("RECOMPUTE_EXTRINSIC")
        | _fisheye_flag("FIX_SKEW")
        | _fisheye_flag("USE_INTRINSIC_GUESS")
    )
    width, height = corners.image_size
    matrix, lens = (
        np.array([[corners.focal, 0.0, width / 2], [0.0, corners.focal, height / 2], [0.0, 0.0, 1.0]]),
        np.zeros((4, 1)),
    )
    rms, *_ = cv2.fisheye.calibrate(
        objects, images, corners.image_size, matrix, lens, flags=flags, criteria=CRITERIA
    )
    return Fit(partial(_project_fisheye, matrix=matrix, lens=lens), corners.points, rms)


def undistort_points(path: str) -> dict[str, Any]:
    """Pixels to the plane by 20 iterations, and back by projectPoints: time, largest error of the round trip,
    share of NaN.
    """
    with np.load(path) as told:
        pixels, matrix, lens = told["pixels"], told["matrix"], told["lens"]
    plane, times = timed(lambda: cv2.undistortPoints(pixels[:, None], matrix, lens, criteria=TWENTY)[:, 0])
    back = _project(np.concatenate([plane, np.ones((len(plane), 1))], axis=-1), matrix=matrix, lens=lens)
    error = np.hypot(*(back - pixels).T)
    return {**times, "largest": float(np.nanmax(error)), "nan": float(np.isnan(plane[:, 0]).mean())}


def classic(grey: np.ndarray, grid: tuple[int, int], window: int) -> np.ndarray | None:
    """What the tutorials do."""
    found, corners = cv2.findChessboardCorners(grey, grid)
    criteria = (cv2.TERM_CRITERIA_EPS + cv2.TERM_CRITERIA_COUNT, 40, 1e-3)
    return (
        cv2.cornerSubPix(grey, corners, (window, window), (-1, -1), criteria).reshape(-1, 2)
        if found
        else None
    )


def sector_based(grey: np.ndarray, grid: tuple[int, int]) -> np.ndarray | None:
    """The newer finder, at its most accurate."""
    found, corners = cv2.findChessboardCornersSB(grey, grid, flags=cv2.CALIB_CB_ACCURACY)
    return corners.reshape(-1, 2) if found else None


def _fisheye_flag(name: str) -> int:
    """OpenCV 5 has it in the main module, OpenCV 4 in fisheye."""
    return getattr(cv2.fisheye, f"CALIB_{name}", None) or getattr(cv2, f"CALIB_{name}")


def _lists(corners: Corners) -> tuple[list[np.ndarray], list[np.ndarray]]:
    return [corners.points[ids].astype(np.float32) for ids in corners.ids], [
        pixels.astype(np.float32) for pixels in corners.pixels
    ]


def _project(points: np.ndarray, *, matrix: np.ndarray, lens: np.ndarray) -> np.ndarray:
    pixels = cv2.projectPoints(points, np.zeros(3), np.zeros(3), matrix, lens)[0].reshape(-1, 2)
    return np.where(points[:, 2:] > 0, pixels, np.nan)


def _project_fisheye(points: np.ndarray, *, matrix: np.ndarray, lens: np.ndarray) -> np.ndarray:
    return cv2.fisheye.projectPoints(points[None], np.zeros(3), np.zeros(3), matrix, lens)[0].reshape(-1, 2)


KINDS = (
    {f"flat {name}": partial(flat, flags=flags) for name, flags in FLAGS.items()}
    | {f"released {name}": partial(released, flags=flags) for name, flags in FLAGS.items()}
    | {"fisheye": fisheye}
)
FINDERS = {
    "classic 5": partial(classic, window=5),
    "classic 11": partial(classic, window=11),
    "sb": sector_based,
}

if __name__ == "__main__":
    cv2.setNumThreads(1)
    tasks = tasks_of(KINDS, lambda: f"OpenCV {cv2.__version__}")
    serve({**tasks, "find": finding(FINDERS), "undistort_points": undistort_points})
