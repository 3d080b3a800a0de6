"""How much of the world fits on the photograph, as angles.

A row of pixels sweeps a fan of rays; its opening is the sum of the angles between neighbours, so it may pass
180 degrees, and parts of the row without rays (beyond a lens's domain) add nothing.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from orthoscope.geometry.arrays import Float, ndarray
from orthoscope.models.camera import Camera

__all__ = ["FieldOfView", "field_of_view"]

# A line across the frame is followed in so many steps.
LINE_STEPS = 512


class FieldOfView(NamedTuple):
    """Angles, radians; NaN where no ray falls on the line of pixels."""

    horizontal: float
    vertical: float
    diagonal: float


def field_of_view(camera: Camera) -> FieldOfView:
    """Angles between the outer edges of the frame: along the row and the column of the principal point, and
    between opposite corners.

    The diagonal is the larger of the two.
    """
    width, height = camera.image_size
    left, top, right, bottom = -0.5, -0.5, width - 0.5, height - 0.5
    x, y = (
        float(np.clip(at, 0.0, side - 1.0))
        for at, side in zip((camera.intrinsics.cx, camera.intrinsics.cy), camera.image_size, strict=True)
    )
    ends = (
        ((left, y), (right, y)),
        ((x, top), (x, bottom)),
        ((left, top), (right, bottom)),
        ((left, bottom), (right, top)),
    )
    pixels = np.concatenate([np.linspace(start, end, LINE_STEPS + 1) for start, end in ends])
    horizontal, vertical, *diagonals = map(_swept, np.split(camera.unproject(pixels), len(ends)))
    return FieldOfView(horizontal, vertical, max(diagonals))


def _swept(rays: Float[ndarray, "n 3"]) -> float:
    """The angle that rays sweep from the first to the last, radians."""
    steps = _angles(rays[:-1], rays[1:])
    return float(np.nansum(steps)) if np.isfinite(steps).any() else float("nan")


def _angles(a: Float[ndarray, "n 3"], b: Float[ndarray, "n 3"]) -> Float[ndarray, " n"]:
    """Angles between unit vectors, exact for small ones too (W. Kahan)."""
    return 2.0 * np.arctan2(np.linalg.norm(a - b, axis=-1), np.linalg.norm(a + b, axis=-1))
