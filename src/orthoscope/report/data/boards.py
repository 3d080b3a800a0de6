"""Boards in space: the camera's frustum and the outline of the target, camera and target frame, metres.

The poses stand with the views.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from orthoscope.evaluation.evaluate import Evaluation
from orthoscope.geometry.arrays import Float, Int, ndarray
from orthoscope.models.camera import Camera
from orthoscope.report.data.rounded import digits
from orthoscope.targets.detections import Detections
from orthoscope.targets.target import Target

__all__ = ["board_corners", "boards", "boards_in", "frustum"]

# The drawn frustum opens to at most this half angle, radians; a fisheye's has no flat front.
WIDEST_FRUSTUM_ANGLE = np.deg2rad(55.0)
# The frustum is measured by the distance than which one board in so many is nearer.
ONE_NEARER_IN = 10


def boards(evaluation: Evaluation) -> dict[str, Any] | str:
    """What the page needs to draw boards and camera."""
    calibration = evaluation.calibration
    detections = calibration.detections
    outlines, of_views = board_corners(detections.target), boards_in(detections)
    seen = zip(calibration.camera_from_target, outlines[of_views], strict=True)
    middles = np.array([pose.apply(outline).mean(0) for pose, outline in seen])
    if not len(middles):
        return "No photograph was used."
    near = float(np.sort(np.linalg.norm(middles, axis=-1))[len(middles) // ONE_NEARER_IN])
    told = {"outlines": digits(outlines), "frustum": digits(frustum(calibration.camera, near / 3.0))}
    return told | ({"boards": of_views.tolist()} if len(outlines) > 1 else {})


def board_corners(target: Target) -> Float[ndarray, "b 4 3"]:
    """The rectangle around the points of each of the target's members, beginning with the side of corner 0,
    target frame.
    """
    found = []
    for part in target.parts:
        (x0, y0, _), (x1, y1, _) = target.points[part].min(0), target.points[part].max(0)
        found.append([[x0, y0, 0.0], [x1, y0, 0.0], [x1, y1, 0.0], [x0, y1, 0.0]])
    return np.array(found)


def boards_in(detections: Detections) -> Int[ndarray, " m"]:
    """Which of the target's members each view shows."""
    return np.array([int(detections.member_of(view.ids[:1]).sum()) for view in detections.views], dtype=int)


def frustum(camera: Camera, depth: float) -> Float[ndarray, "4 3"]:
    """The four far corners of the pyramid that the frame sees, camera frame."""
    width, height = camera.image_size
    pixels = np.array([[0.0, 0.0], [width, 0.0], [width, height], [0.0, height]]) - 0.5
    plane = np.clip(
        camera.intrinsics.to_plane(pixels), -np.tan(WIDEST_FRUSTUM_ANGLE), np.tan(WIDEST_FRUSTUM_ANGLE)
    )
    return depth * np.concatenate([plane, np.ones((4, 1))], axis=-1)
