"""Boards in space: the camera's frustum and the outline of the target, camera and target frame, metres.

The poses stand with the views.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from orthoscope.evaluation.evaluate import Evaluation
from orthoscope.geometry.arrays import Float, ndarray
from orthoscope.models.camera import Camera
from orthoscope.report.data.rounded import digits
from orthoscope.targets.detections import Target

__all__ = ["board_corners", "boards", "frustum"]

# The drawn frustum opens to at most this half angle, radians; a fisheye's has no flat front.
WIDEST_ANGLE = np.deg2rad(55.0)


def boards(evaluation: Evaluation) -> dict[str, Any] | str:
    """What the page needs to draw boards and camera."""
    calibration = evaluation.calibration
    outline = board_corners(calibration.detections.target)
    middles = np.array([pose.apply(outline).mean(0) for pose in calibration.camera_from_target])
    if not len(middles):
        return "No photograph was used."
    near = float(np.quantile(np.linalg.norm(middles, axis=-1), 0.1))
    return {"outline": digits(outline), "frustum": digits(frustum(calibration.camera, near / 3.0))}


def board_corners(target: Target) -> Float[ndarray, "4 3"]:
    """The rectangle around the target's points, beginning with the side of corner 0, target frame."""
    (x0, y0, _), (x1, y1, _) = target.points.min(0), target.points.max(0)
    return np.array([[x0, y0, 0.0], [x1, y0, 0.0], [x1, y1, 0.0], [x0, y1, 0.0]])


def frustum(camera: Camera, depth: float) -> Float[ndarray, "4 3"]:
    """The four far corners of the pyramid that the frame sees, camera frame."""
    width, height = camera.image_size
    pixels = np.array([[0.0, 0.0], [width, 0.0], [width, height], [0.0, height]]) - 0.5
    plane = np.clip(camera.intrinsics.to_plane(pixels), -np.tan(WIDEST_ANGLE), np.tan(WIDEST_ANGLE))
    return depth * np.concatenate([plane, np.ones((4, 1))], axis=-1)
