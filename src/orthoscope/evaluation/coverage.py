"""How much of the frame the corners cover, and where they do not.

A camera is known where corners were seen; elsewhere its lens formula only extrapolates. Cells that no ray
reaches, outside the image circle of a wide lens, are not missed.
"""

from __future__ import annotations

import numpy as np

from orthoscope.fitting.calibration import Calibration
from orthoscope.geometry.arrays import Bool, Float, Int, ndarray
from orthoscope.models.camera import Camera
from orthoscope.targets.detections import Detections

__all__ = [
    "COVERAGE_GRID",
    "cells_with_rays",
    "corners_by_cell",
    "emptiest_place",
    "place_of",
    "share_covered",
]

# The frame is said to be covered by so many cells across and down.
COVERAGE_GRID = (8, 6)
PLACES = (("at the top", "in the middle", "at the bottom"), ("left", "", "right"))


def share_covered(calibration: Calibration) -> float:
    """The share of the frame's cells with a corner in them, among the cells that any ray reaches."""
    seen = corners_by_cell(calibration.detections) > 0
    return float(seen.sum() / max((seen | cells_with_rays(calibration.camera)).sum(), 1))


def corners_by_cell(
    detections: Detections, grid: tuple[int, int] = COVERAGE_GRID
) -> Int[ndarray, "rows columns"]:
    """How many corners were seen in each cell of a grid (columns, rows) over the frame."""
    pixels = np.concatenate([view.pixels for view in detections.views])
    x, y = _edges(detections.image_size, grid)
    return np.histogram2d(pixels[:, 1], pixels[:, 0], bins=(y, x))[0].astype(np.int64)


def cells_with_rays(camera: Camera, grid: tuple[int, int] = COVERAGE_GRID) -> Bool[ndarray, "rows columns"]:
    """Which cells have a ray at their middle or at one of their corners."""
    x, y = _edges(camera.image_size, grid)
    places = np.meshgrid(x, y), np.meshgrid(0.5 * (x[1:] + x[:-1]), 0.5 * (y[1:] + y[:-1]))
    pixels = [np.stack(place, axis=-1).reshape(-1, 2) for place in places]
    has_ray = np.isfinite(camera.unproject(np.concatenate(pixels))[:, 2])
    corners, middles = np.split(has_ray, [len(pixels[0])])
    at_corner, at_middle = corners.reshape(len(y), len(x)), middles.reshape(len(y) - 1, len(x) - 1)
    return at_middle | at_corner[1:, 1:] | at_corner[1:, :-1] | at_corner[:-1, 1:] | at_corner[:-1, :-1]


def emptiest_place(detections: Detections) -> str:
    """The ninth of the frame with the fewest corners, in words."""
    counts = corners_by_cell(detections, (3, 3))
    row, column = np.unravel_index(int(np.argmin(counts)), counts.shape)
    return _in_words(int(row), int(column))


def place_of(pixels: Float[ndarray, "n 2"], image_size: tuple[int, int]) -> str:
    """The ninth of the frame where most of these pixels are, in words."""
    thirds = np.clip((3.0 * (pixels + 0.5) / np.array(image_size)).astype(np.int64), 0, 2)
    row, column = np.divmod(int(np.bincount(3 * thirds[:, 1] + thirds[:, 0], minlength=9).argmax()), 3)
    return _in_words(int(row), int(column))


def _in_words(row: int, column: int) -> str:
    return " ".join(word for word in (PLACES[0][row], PLACES[1][column]) if word)


def _edges(image_size: tuple[int, int], grid: tuple[int, int]) -> tuple[ndarray, ndarray]:
    """The cells' sides along x and along y, pixels."""
    return np.linspace(-0.5, image_size[0] - 0.5, grid[0] + 1), np.linspace(
        -0.5, image_size[1] - 0.5, grid[1] + 1
    )
