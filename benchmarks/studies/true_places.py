"""Where the corners of a rendered target truly are, and how much of its sheet lies beyond them."""

from __future__ import annotations

import numpy as np

from orthoscope.fitting.disc_centres import disc_offsets
from orthoscope.geometry.arrays import Float, ndarray
from orthoscope.geometry.pose import Pose
from orthoscope.models.camera import Camera
from orthoscope.targets.target import Target

__all__ = ["margin_of", "true_places"]


def margin_of(target: Target) -> float:
    """What belongs to a target's sheet beyond its corners, metres."""
    drawing, points = target.drawing(), target.points
    return float(np.max(np.abs([drawing.low - points.min(0)[:2], drawing.high - points.max(0)[:2]])))


def true_places(camera: Camera, target: Target, camera_from_target: Pose) -> Float[ndarray, "m 2"]:
    """Where each corner is seen, or the middle of each disc's outline, pixels."""
    places = camera.project(camera_from_target.apply(target.points))
    if target.disc_radii.any():
        places = places + disc_offsets(camera, camera_from_target, target.points, target.disc_radii)
    return places
