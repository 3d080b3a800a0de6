"""Where the corners of a rendered target truly are, and how much of its sheet lies beyond them."""

from __future__ import annotations

import numpy as np

from orthoscope.detection.sight import Sight
from orthoscope.fitting.disc_centres import disc_offsets
from orthoscope.geometry.arrays import Float, Int, ndarray
from orthoscope.geometry.pose import Pose
from orthoscope.models.camera import Camera
from orthoscope.targets.target import Target

__all__ = ["errors_of_sight", "margin_of", "true_ids", "true_places"]


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


def true_ids(target: Target, truth: Float[ndarray, "m 2"], sight: Sight) -> Int[ndarray, " n"]:
    """Which corners those of a sight are, in the best of the ways in which the target looks the same."""
    ways = [np.arange(len(truth)), *target.symmetries()]
    return min(
        (way[sight.ids] for way in ways), key=lambda ids: float(np.median(errors_of_sight(ids, truth, sight)))
    )


def errors_of_sight(
    ids: Int[ndarray, " n"], truth: Float[ndarray, "m 2"], sight: Sight
) -> Float[ndarray, " n"]:
    """How far each corner of a sight is from where these are, pixels; infinite where that is nowhere."""
    off = np.hypot(*(truth[ids] - sight.pixels).T)
    return np.where(np.isfinite(off), off, np.inf)
