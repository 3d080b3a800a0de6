"""How far apart two cameras are: by their images over the frame, never by coefficients.

A camera's orientation trades against the poses of its views, so a common rotation is taken out first.
"""

from __future__ import annotations

import numpy as np

from orthoscope.geometry.arrays import Float, ndarray
from orthoscope.geometry.pose import nearest_rotation
from orthoscope.models.camera import Camera

__all__ = ["frame_grid", "image_difference"]


def frame_grid(image_size: tuple[int, int], columns: int = 41, rows: int = 31) -> Float[ndarray, "n 2"]:
    """Pixels of an even grid over the whole frame, row by row.

    Args:
        image_size: (width, height) pixels.
        columns: how many pixels a row has.
        rows: how many rows there are.
    """
    x, y = np.meshgrid(np.linspace(0, image_size[0] - 1, columns), np.linspace(0, image_size[1] - 1, rows))
    return np.stack([x.ravel(), y.ravel()], axis=-1)


def image_difference(camera: Camera, other: Camera, pixels: Float[ndarray, "n 2"]) -> Float[ndarray, "n 2"]:
    """Where another camera sees what this one sees at these pixels, minus these pixels.

    The rotation that brings their rays together is taken out first.

    Args:
        camera: this one.
        other: the other one.
        pixels: of this one, (n,2).
    Returns:
        (n,2) pixels; NaN where either camera has no image.
    """
    mine, theirs = camera.unproject(pixels), other.unproject(pixels)
    both = np.isfinite(mine[:, 0]) & np.isfinite(theirs[:, 0])
    other_from_camera = nearest_rotation(theirs[both].T @ mine[both]) if both.any() else np.eye(3)
    return other.project(mine @ other_from_camera.T) - pixels
