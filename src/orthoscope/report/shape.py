"""The estimated shape of a target in words and numbers: how large, how far from flat, how far from true.

The part in the plane that a print has (paper that shrank along one side, a scanner that was skew) is the
symmetric linear part of the displacements without the common scale: stretch is how much longer y is than x,
shear the angle by which the axes are not square.
"""

from __future__ import annotations

import numpy as np

from orthoscope.fitting.calibration import Calibration
from orthoscope.geometry.arrays import Bool, Float, ndarray

__all__ = ["corners_seen", "shape_rows"]


def shape_rows(calibration: Calibration) -> list[tuple[str, str]]:
    """What was estimated, as name and text; nothing for a target that was taken as flat."""
    shape = calibration.target_shape
    if shape.kind == "flat":
        return []
    seen = corners_seen(calibration)
    points, moved = calibration.detections.target.points[seen], 1e3 * shape.displacements[seen]
    size = np.sqrt((moved * moved).sum(1))
    farthest = int(np.flatnonzero(seen)[int(size.argmax())])
    stretch, shear = _stretch_and_shear(points, 1e-3 * moved)
    return [
        ("shape", {"smooth": "a smooth surface", "free": "every corner its own place"}[shape.kind]),
        ("displacement, rms", f"{np.sqrt((size * size).mean()):.3g} mm"),
        ("displacement, largest", f"{size.max():.3g} mm, corner {farthest}"),
        ("in the plane, rms", f"{np.sqrt((moved[:, :2] ** 2).sum(1).mean()):.3g} mm"),
        ("out of the plane, lowest to highest", f"{np.ptp(moved[:, 2]):.3g} mm"),
        ("stretch of y against x", f"{100.0 * stretch:+.2g} %"),
        ("shear", f"{np.degrees(shear):+.2g}°"),
    ]


def corners_seen(calibration: Calibration) -> Bool[ndarray, " m"]:
    """Which of the target's corners any view shows."""
    seen = np.zeros(len(calibration.detections.target.points), dtype=bool)
    for view in calibration.detections.views:
        seen[view.ids] = True
    return seen


def _stretch_and_shear(
    points: Float[ndarray, "n 3"], displacements: Float[ndarray, "n 3"]
) -> tuple[float, float]:
    """How much longer y is than x, as a share; and the angle by which their right angle is smaller,
    radians.
    """
    plane = np.column_stack([points[:, :2] - points[:, :2].mean(0), np.ones(len(points))])
    linear = np.linalg.lstsq(plane, displacements[:, :2], rcond=None)[0][
        :2
    ]  # of x by x, y by x; x by y, y by y
    return float(linear[1, 1] - linear[0, 0]), float(linear[0, 1] + linear[1, 0])
