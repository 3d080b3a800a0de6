"""lensboy as a peer: OpenCV's formulas and a spline, with its target warp and outlier filter as they are by
default.

`plain` leaves warp and filter out: then it solves the problem that everybody else solves.
"""

from __future__ import annotations

from functools import partial
from importlib.metadata import version
from typing import Any

import cv2
import lensboy  # pyright: ignore[reportMissingImports]  # lives in an environment of its own
import numpy as np
from corners import Corners, Fit, tasks_of
from served import serve

KNOTS = (8, 6)  # on these sets more of them fit worse to unseen views and take up to ten times as long
PLAIN: dict[str, Any] = {"estimate_target_warp": False, "outlier_threshold_stddevs": None}


def _opencv(corners: Corners, coefficients: Any, **settings: Any) -> Fit:
    width, height = corners.image_size
    config = lensboy.OpenCVConfig(
        image_width=width, image_height=height, included_distortion_coefficients=coefficients
    )
    return _fit(corners, config, **settings)


def _spline(corners: Corners, **settings: Any) -> Fit:
    width, height = corners.image_size
    config = lensboy.PinholeSplinedConfig(
        image_width=width, image_height=height, num_knots_x=KNOTS[0], num_knots_y=KNOTS[1]
    )
    return _fit(corners, config, **settings)


def _fit(corners: Corners, config: Any, **settings: Any) -> Fit:
    frames = [lensboy.Frame(ids, pixels) for ids, pixels in zip(corners.ids, corners.pixels, strict=True)]
    result = lensboy.calibrate_camera(corners.points, frames, config, **settings)
    points = result.target_warp.warp_target(corners.points) if result.target_warp else corners.points
    squares = np.concatenate(
        [(one.residuals**2).sum(1)[one.inlier_mask] for one in result.frame_diagnostics if one]
    )
    return Fit(partial(_project, model=result.camera_model), points, float(np.sqrt(squares.mean())))


def _project(points: np.ndarray, *, model: Any) -> np.ndarray:
    return np.where(points[:, 2:] > 0, model.project_points(np.ascontiguousarray(points)), np.nan)


KINDS = {
    "5": partial(_opencv, coefficients=lensboy.OpenCVConfig.STANDARD),
    "14": partial(_opencv, coefficients=lensboy.OpenCVConfig.FULL_14),
    "spline": _spline,
    "5 plain": partial(_opencv, coefficients=lensboy.OpenCVConfig.STANDARD, **PLAIN),
    "spline plain": partial(_spline, **PLAIN),
}

if __name__ == "__main__":
    cv2.setNumThreads(1)
    serve(tasks_of(KINDS, lambda: f"lensboy {version('lensboy')}"))
