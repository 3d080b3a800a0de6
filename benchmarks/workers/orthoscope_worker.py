"""This project, asked in the same words as its peers."""

from __future__ import annotations

import importlib
from functools import partial
from typing import Any
from unittest.mock import patch

import numpy as np
from corners import Corners, Fit, tasks_of
from served import serve, timed

from orthoscope import METHODS, Calibration, Camera, Detections, Intrinsics, View
from orthoscope.models.lenses.table import Brown
from orthoscope.targets.target import Target
from orthoscope.version import __version__

SETTINGS: dict[str, tuple[str, dict[str, Any]]] = {  # what is called for each name that the parts use
    "brown": ("fccm", {"lens": "brown"}),
    "rational": ("fccm", {"lens": "rational"}),
    "kannala_brandt": ("fccm", {"lens": "kannala_brandt"}),
    "free target": (
        "decoupled",
        {"shape": "free", "lens": "brown", "base": "brown", "first_lens": "formula"},
    ),
    "free lens": ("decoupled", {"shape": "flat", "lens": "free", "base": "brown"}),
    "free target and lens": ("decoupled", {"shape": "free", "lens": "free", "base": "brown"}),
    "chosen by itself": ("decoupled", {}),
}


def _fit(corners: Corners, kind: str) -> Fit:
    calibration = _calibration(corners, kind)
    points = getattr(calibration, "target_points", calibration.detections.target.points)
    return Fit(partial(calibration.camera.project, beyond=True), points, calibration.rms_px)


def _calibration(corners: Corners, kind: str) -> Calibration:
    method, settings = SETTINGS[kind]
    if method not in METHODS:
        raise LookupError(f"there is no method {method!r}")
    return METHODS[method](_detections(corners), **settings)


def _detections(corners: Corners) -> Detections:
    target = Target("benchmark", corners.points, grid=corners.grid)
    views = [
        View(f"{i}", ids, pixels)
        for i, (ids, pixels) in enumerate(zip(corners.ids, corners.pixels, strict=True))
    ]
    return Detections(target, corners.image_size, tuple(views))


def covariance(path: str, kind: str) -> dict[str, float]:
    """CPU time of a calibration and of its covariance, seconds."""
    module = importlib.import_module("orthoscope.methods.fccm")
    corners, spent, plain = Corners.load(path), [], module.shared_covariance

    def watched(*arguments: Any) -> Any:
        result, times = timed(lambda: plain(*arguments))
        spent.append(times["cpu"])
        return result

    with patch.object(module, "shared_covariance", watched):
        _, times = timed(lambda: _calibration(corners, kind))
    return {**times, "covariance": sum(spent)}


def undistort_points(path: str) -> dict[str, Any]:
    """Pixels to rays and back: time, largest error of the round trip, share of pixels without a ray."""
    with np.load(path) as told:
        pixels, matrix, lens, size = told["pixels"], told["matrix"], told["lens"], told["image_size"]
    coefficients = dict(zip(("k1", "k2", "p1", "p2", "k3"), lens.tolist(), strict=True))
    intrinsics = Intrinsics(matrix[0, 0], matrix[1, 1], matrix[0, 2], matrix[1, 2])
    camera = Camera((int(size[0]), int(size[1])), intrinsics, Brown(**coefficients))
    rays, times = timed(lambda: camera.unproject(pixels))
    error = np.hypot(*(camera.project(rays) - pixels).T)
    return {**times, "largest": float(np.nanmax(error)), "nan": float(np.isnan(rays[:, 0]).mean())}


def find(**request: Any) -> dict[str, Any]:
    """Finding corners; imported here so that OpenCV takes no memory where only calibrating is measured."""
    import cv2
    from found import finding

    from orthoscope.detection.chessboards.chessboard import find_chessboard

    cv2.setNumThreads(1)
    return finding({"orthoscope": lambda grey, grid: find_chessboard(grey, *grid)})(**request)


def straighten(path: str, times: int, calibration: str) -> dict[str, Any]:
    """One photograph made straight so many times, the map made anew each time."""
    import cv2

    from orthoscope import load_camera, undistort

    grey, camera = cv2.imread(path, cv2.IMREAD_GRAYSCALE), load_camera(calibration)
    assert grey is not None
    return timed(lambda: [undistort(grey, camera) for _ in range(times)])[1]


if __name__ == "__main__":
    tasks = tasks_of(
        {name: partial(_fit, kind=name) for name in SETTINGS}, lambda: f"orthoscope {__version__}"
    )
    serve(
        {
            **tasks,
            "covariance": covariance,
            "undistort_points": undistort_points,
            "find": find,
            "straighten": straighten,
        }
    )
