"""Corners to a few hundredths of a pixel: OpenCV's cornerSubPix to come near, then a blurred saddle fitted to
each corner's window.

Windows are measured in the board's own squares, so that a near and a far corner, a large and a small
photograph are treated alike: 0.25 squares to each side for cornerSubPix, which only has to come near and goes
astray where a larger window meets the board's margin, and 0.45 for the fit, which weighs its pixels the less
the farther out they are. Only the board's part of a photograph is looked at, and where squares are large it
is reduced first: beyond some 50 px a square more pixels add time, not truth. Where the fit moves too far, or
the picture is no saddle, cornerSubPix has the last word. docs/detection.md has the figures.
"""

from __future__ import annotations

import cv2
import numpy as np

from orthoscope.detection.grid import grid_shape, nearest_neighbour
from orthoscope.detection.saddle import fit_saddles
from orthoscope.geometry.arrays import Float, ndarray

__all__ = ["refined"]

NEAR_SHARE = 0.25  # of a square: half the window of cornerSubPix
SHARE = 0.45  # of a square: half the window of the fit
USUAL = 50.0  # px a square: larger ones are reduced to about this
REACH = 18.0  # px: half the largest window
SMOOTHING = 0.5  # px, sigma: what a camera sharpened until it jumps from pixel to pixel has slopes again
FARTHEST = 0.35  # of a square: a fit that ends farther from its start is not believed,
LEAST_EXPLAINED = 0.85  # nor one that explains less of its window's variance


def refined(grey: ndarray, rough: Float[ndarray, "m 2"], columns: int, rows: int) -> Float[ndarray, "m 2"]:
    """Corners (columns * rows, 2), row by row, pixels, from ones that are right to a fifth of a square.

    grey: (h,w) uint8.
    """
    square = nearest_neighbour(rough, columns, rows)
    shrink = max(1, round(float(np.median(square)) / USUAL))
    first, part = _surroundings(grey, rough, square.max())
    small = _reduced(part, shrink)
    near = _near(small, (rough - first + 0.5) / shrink - 0.5, columns, rows)
    shape = grid_shape(near, columns, rows)
    saddles = fit_saddles(
        cv2.GaussianBlur(small, (0, 0), SMOOTHING),
        near,
        _window(shape.along),
        _window(shape.down),
        bends=np.stack([shape.bend_along, shape.bend_down], axis=1),
    )
    allowed = np.maximum(FARTHEST * nearest_neighbour(near, columns, rows), 1.0)
    believed = (np.hypot(*(saddles.places - near).T) < allowed) & (saddles.explained > LEAST_EXPLAINED)
    return (np.where(believed[:, None], saddles.places, near) + 0.5) * shrink - 0.5 + first


def _surroundings(
    grey: ndarray, corners: Float[ndarray, "m 2"], margin: float
) -> tuple[Float[ndarray, " 2"], ndarray]:
    """The part of a picture that holds the corners with a margin, and where it begins (x, y)."""
    x, y = np.maximum(np.floor(corners.min(0) - margin), 0).astype(int)
    right, bottom = np.maximum(np.ceil(corners.max(0) + margin), (x, y)).astype(int) + 1
    return np.array([x, y], dtype=float), grey[y:bottom, x:right]


def _reduced(grey: ndarray, shrink: int) -> ndarray:
    """The picture with each block of shrink x shrink pixels averaged."""
    if shrink == 1:
        return grey
    height, width = (side // shrink for side in grey.shape)
    return cv2.resize(
        grey[: height * shrink, : width * shrink], (width, height), interpolation=cv2.INTER_AREA
    )


def _near(grey: ndarray, corners: ndarray, columns: int, rows: int) -> ndarray:
    """cornerSubPix with a window that suits each corner's own squares."""
    radius = np.clip(np.rint(NEAR_SHARE * nearest_neighbour(corners, columns, rows)), 2, REACH).astype(int)
    places = np.clip(corners, 0, np.array(grey.shape[::-1]) - 1).astype(np.float32)
    criteria = (cv2.TERM_CRITERIA_EPS + cv2.TERM_CRITERIA_COUNT, 40, 1e-2)
    for size in np.unique(radius):
        which = radius == size
        some = np.ascontiguousarray(places[which]).reshape(-1, 1, 2)
        places[which] = cv2.cornerSubPix(grey, some, (int(size), int(size)), (-1, -1), criteria).reshape(
            -1, 2
        )
    return places.astype(float)


def _window(square: Float[ndarray, "m 2"]) -> Float[ndarray, "m 2"]:
    """From a corner to the side of its window, given one square."""
    return square * np.minimum(SHARE, REACH / np.maximum(np.hypot(*square.T), 1e-9))[:, None]
