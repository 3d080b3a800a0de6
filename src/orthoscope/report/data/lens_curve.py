"""The lens from its axis outwards: where rays at an angle fall, and how far that is from an ideal image.

All of it comes from `project` and `unproject` alone, so any lens can be shown. Angles are degrees, the rest
pixels; a band spans all directions around the axis.
"""

from __future__ import annotations

from functools import lru_cache
from typing import Any

import numpy as np

from orthoscope.evaluation.evaluate import Evaluation
from orthoscope.fitting.calibration import Calibration
from orthoscope.geometry.arrays import Float, ndarray
from orthoscope.models.camera import Camera, image_border
from orthoscope.report.data.frame_fields import ideal_image
from orthoscope.report.data.rounded import digits

__all__ = ["along_angles", "angles_shown", "curve", "marks"]

# The curve is looked at in so many directions around the axis.
AXIAL_DIRECTIONS = 48
# The curve is drawn this much farther than the frame's farthest corner.
BEYOND_RATIO = 1.12
# The curve has so many samples.
DRAWN_CURVE_SAMPLES = 120


def curve(evaluation: Evaluation) -> dict[str, Any] | str:
    """Distance from the principal point and radial displacement against the angle from the axis."""
    calibration = evaluation.calibration
    camera = calibration.camera
    angles = angles_shown(camera, DRAWN_CURVE_SAMPLES)
    if not len(angles):
        return "No pixel of the frame has a ray."
    radius, moved = along_angles(camera, angles)
    whole = np.isfinite(radius).all(-1)
    focal = float(np.sqrt(camera.intrinsics.fx * camera.intrinsics.fy))
    return {
        "angles": digits(np.degrees(angles[whole])),
        "radius": _band(radius[whole]),
        "moved": _band(moved[whole]),
        "focal": round(focal, 4),
        "marks": [
            {"angle": round(float(np.degrees(angle)), 2), "words": words, "kind": kind}
            for kind, angle, words in marks(calibration)
            if np.isfinite(angle) and angle <= angles[-1]
        ],
    }


def angles_shown(camera: Camera, count: int) -> Float[ndarray, " a"]:
    """From the axis to a little beyond the frame's corners, radians; empty where no pixel has a ray."""
    edge = _edge(camera)
    if not np.isfinite(edge):
        return np.empty(0)
    return np.linspace(0.0, min(BEYOND_RATIO * edge, camera.lens.chart.reach - 1e-3), count)


def along_angles(
    camera: Camera, angles: Float[ndarray, " a"]
) -> tuple[Float[ndarray, "a d"], Float[ndarray, "a d"]]:
    """For each angle and direction: distance of the image from the principal point, and how much of it the
    lens added.
    """
    phi = 2 * np.pi * np.arange(AXIAL_DIRECTIONS) / AXIAL_DIRECTIONS
    across, along = np.sin(angles[:, None]), np.cos(angles[:, None])
    rays = np.stack(np.broadcast_arrays(across * np.cos(phi), across * np.sin(phi), along), axis=-1)
    centre = np.array([camera.intrinsics.cx, camera.intrinsics.cy])
    rays = rays.reshape(-1, 3)
    image, ideal = camera.project(rays) - centre, ideal_image(camera, rays) - centre
    outwards = ideal / np.maximum(np.hypot(*ideal.T), 1e-12)[:, None]
    radius, added = np.hypot(*image.T), ((image - ideal) * outwards).sum(-1)
    return radius.reshape(len(angles), -1), added.reshape(len(angles), -1)


def marks(calibration: Calibration) -> list[tuple[str, float, str]]:
    """Kind, angle (radians, NaN where there is none) and words: how far corners were seen, where the frame
    ends, where the lens ends.
    """
    camera = calibration.camera
    pixels = [view.pixels for view in calibration.detections.views if len(view.pixels)]
    seen = _largest_angle(camera.unproject(np.concatenate(pixels))) if pixels else float("nan")
    edge, whole = _edge(camera), bool(np.isfinite(_border(camera)).all())
    return [
        ("seen", seen, "farthest corner seen"),
        ("edge", edge, "image corner" if whole else "last pixel with a ray"),
        ("end", float(camera.lens.field_angle), "end of the lens's domain"),
    ]


def _band(values: Float[ndarray, "a d"]) -> dict[str, list]:
    return {
        "low": digits(values.min(-1)),
        "mean": digits(values.mean(-1)),
        "high": digits(values.max(-1)),
    }


@lru_cache(maxsize=1)
def _border(camera: Camera) -> Float[ndarray, "n 3"]:
    """Rays of the frame's border."""
    return camera.unproject(image_border(camera.image_size))


@lru_cache(maxsize=1)
def _edge(camera: Camera) -> float:
    """The largest angle from the axis in the frame: on its border where that has rays all around, else there
    and on a coarse grid inside, which still has rays where an image circle lies within the frame.
    """
    border = _border(camera)
    if np.isfinite(border).all():
        return _largest_angle(border)
    width, height = camera.image_size
    inside = np.stack(
        np.meshgrid(np.linspace(0, width - 1, 65), np.linspace(0, height - 1, 65)), axis=-1
    ).reshape(-1, 2)
    return _largest_angle(np.concatenate([border, camera.unproject(inside)]))


def _largest_angle(rays: Float[ndarray, "n 3"]) -> float:
    """The largest angle from the axis (radians) among rays that are there; NaN without any."""
    angles = np.arctan2(np.hypot(rays[:, 0], rays[:, 1]), rays[:, 2])
    angles = angles[np.isfinite(angles)]
    return float(angles.max()) if len(angles) else float("nan")
