"""Corners in a file that every worker can read (workers/corners.py)."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from orthoscope.geometry.pose import Pose
from orthoscope.models.camera import Camera
from orthoscope.targets.detections import Detections

__all__ = ["write_corners"]


def write_corners(
    path: Path, detections: Detections, camera: Camera, camera_from_target: tuple[Pose, ...]
) -> str:
    """Write detections with a camera and poses near the truth, which give first guesses and start held-out
    poses; returns the path.
    """
    views = detections.views
    np.savez(
        path,
        points=detections.target.points,
        image_size=np.array(detections.image_size),
        grid=np.array(detections.target.grid or (), dtype=int),
        focal=camera.intrinsics.fx,
        fov_x=_field_of_view(camera),
        counts=np.array([len(view.ids) for view in views]),
        ids=np.concatenate([view.ids for view in views]),
        pixels=np.concatenate([view.pixels for view in views]),
        rotations=np.stack([pose.rotation for pose in camera_from_target]),
        translations=np.stack([pose.translation for pose in camera_from_target]),
    )
    return str(path)


def _field_of_view(camera: Camera) -> float:
    """Twice the angle from the axis to the farther of the left and right borders, radians; 190 degrees where
    a border sees nothing.
    """
    width, height = camera.image_size
    rays = camera.unproject(np.array([[0.0, height / 2], [width - 1.0, height / 2]]))
    return float(2.0 * np.arccos(rays[:, 2].min())) if np.isfinite(rays).all() else float(np.deg2rad(190.0))
