"""The distortion centre from planar grids, whatever the lens is.

Every corner lies on the line from the centre that its place on the target tells, however far out.

With h_1, h_2 the first rows of a view's homography about the centre e, X = (X, Y, 1) a place on the target
and p its pixel, (p - e) is parallel to (h_1 X, h_2 X): the radial alignment of R. Tsai (1987), and the radial
fundamental matrix F = [e]x H, p' F X = 0, of R. Hartley and S. B. Kang (PAMI 29(8), 2007). F comes from eight
corners or more of a view, linearly, and e is what all views' F leave out. That start is then made as good as
the corners are: the distances of the corners from their radial lines, pixels, are least at e, with h_1 and
h_2 of each view the best for that e.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from orthoscope.geometry.arrays import CalibrationError, Float, ndarray
from orthoscope.targets.detections import Detections

__all__ = ["GridView", "RadialView", "centre_of_distortion", "grid_views", "radial_view"]

# A view needs so many corners: its radial fundamental matrix has eight unknowns.
FEWEST_CORNERS = 8
# The centre is moved so often at most; a move below this, pixels, is none.
MOVES, SETTLED_PX = 12, 1e-4
# Slopes by the centre are differences over so much, pixels.
NUDGE_PX = 0.2
# The rows of a homography are fitted so often, each time with the distances of the last.
WEIGHINGS = 2
# A centre this much of the diagonal beyond the frame is none.
OUTSIDE = 0.25


class GridView(NamedTuple):
    """The corners of a view, or of a stack of views, each filled up with places and pixels that are zeros.

    Attributes:
        places: (n,3), on the target, homogeneous, about its middle and in units of its size.
        pixels: (n,2).
    """

    places: Float[ndarray, "*views n 3"]
    pixels: Float[ndarray, "*views n 2"]


class RadialView(NamedTuple):
    """A view about a centre.

    Attributes:
        outwards: (n,2) h_1 X and h_2 X, in the direction of the corner.
        off: (n,) distances of the corners from their radial lines, pixels.
    """

    outwards: Float[ndarray, "*views n 2"]
    off: Float[ndarray, "*views n"]


def grid_views(detections: Detections) -> list[GridView]:
    """The views that have enough corners.

    Raises:
        CalibrationError: none has, or the target is not flat.
    """
    points = detections.target.points
    if np.ptp(points[:, 2]) > 0:
        raise CalibrationError("the target is not flat; radial lines of a view need a flat one. Use fccm.")
    middle, size = points[:, :2].mean(0), float(points[:, :2].std()) or 1.0
    places = np.column_stack([(points[:, :2] - middle) / size, np.ones(len(points))])
    views = [
        GridView(places[view.ids], view.pixels)
        for view in detections.views
        if len(view.ids) >= FEWEST_CORNERS
    ]
    if not views:
        raise CalibrationError(
            f"no view has {FEWEST_CORNERS} corners, which the distortion centre needs. Take more photographs"
            " of the whole target."
        )
    return views


def centre_of_distortion(views: Sequence[GridView], image_size: tuple[int, int]) -> Float[ndarray, "2"]:
    """The distortion centre, pixels.

    Raises:
        CalibrationError: the corners put it far beyond the frame: the lens has next to no distortion.
    """
    middle = 0.5 * (np.array(image_size) - 1.0)
    reach = OUTSIDE * float(np.hypot(*image_size))
    linear = _linear_centre(views, image_size)
    centre = linear if _within(linear, image_size, reach) else middle
    stack = _together(views)
    off = _off(stack, centre)
    for _ in range(MOVES):
        slopes = np.stack(
            [
                (_off(stack, centre + nudge) - _off(stack, centre - nudge)) / (2 * NUDGE_PX)
                for nudge in NUDGE_PX * np.eye(2)
            ],
            axis=-1,
        )
        step = -np.linalg.lstsq(slopes, off, rcond=None)[0]
        share, after = 1.0, _off(stack, centre + step)
        while share > 1e-3 and after @ after > off @ off:
            share *= 0.5
            after = _off(stack, centre + share * step)
        centre, off = centre + share * step, after
        if np.hypot(*(share * step)) < SETTLED_PX:
            break
    if not _within(centre, image_size, reach):
        raise CalibrationError(
            "the corners put the distortion centre far beyond the frame: this lens has next to no distortion,"
            " and any centre would do. Use fccm."
        )
    return centre


def radial_view(view: GridView, centre: Float[ndarray, "2"]) -> RadialView:
    """The first two rows of a view's homography about a centre, as what they make of its places."""
    away = view.pixels - centre
    x, y = away[..., :1], away[..., 1:]
    rows = np.concatenate([-y * view.places, x * view.places], axis=-1)
    outwards = away
    for _ in range(WEIGHINGS):
        weight = 1.0 / np.maximum(np.hypot(outwards[..., :1], outwards[..., 1:]), 1e-12)
        h = _least_row(rows * weight)
        outwards = view.places @ h.reshape(*h.shape[:-1], 2, 3).swapaxes(-1, -2)
    outwards = np.where((outwards * away).sum((-2, -1), keepdims=True) < 0, -outwards, outwards)
    length = np.maximum(np.hypot(outwards[..., 0], outwards[..., 1]), 1e-12)
    return RadialView(outwards, (x[..., 0] * outwards[..., 1] - y[..., 0] * outwards[..., 0]) / length)


def _least_row(rows: Float[ndarray, "*views n k"]) -> Float[ndarray, "*views k"]:
    """The unit vector that many rows come nearest to leaving at nothing, by their triangle alone."""
    return np.linalg.svd(np.linalg.qr(rows, mode="r"))[2][..., -1, :]


def _together(views: Sequence[GridView]) -> GridView:
    """All views as one stack."""
    widest = max(len(view.pixels) for view in views)
    stack = GridView(np.zeros((len(views), widest, 3)), np.zeros((len(views), widest, 2)))
    for number, view in enumerate(views):
        stack.places[number, : len(view.places)] = view.places
        stack.pixels[number, : len(view.pixels)] = view.pixels
    return stack


def _off(stack: GridView, centre: Float[ndarray, "2"]) -> Float[ndarray, " n"]:
    """The distances of all corners from their radial lines, 0 where a view is filled up."""
    return radial_view(stack, centre).off.ravel()


def _linear_centre(views: Sequence[GridView], image_size: tuple[int, int]) -> Float[ndarray, "2"]:
    """What all views' radial fundamental matrices leave out."""
    middle, unit = 0.5 * (np.array(image_size) - 1.0), 0.5 * float(np.hypot(*image_size))
    matrices = []
    for view in views:
        p = np.column_stack([(view.pixels - middle) / unit, np.ones(len(view.pixels))])
        rows = (p[:, :, None] * view.places[:, None, :]).reshape(len(p), 9)
        matrices.append(_least_row(rows).reshape(3, 3))
    e = np.linalg.svd(np.concatenate(matrices, axis=1))[0][:, -1]
    return middle + unit * e[:2] / e[2] if abs(e[2]) > 1e-9 else middle


def _within(centre: Float[ndarray, "2"], image_size: tuple[int, int], margin: float) -> bool:
    return bool(((centre > -margin) & (centre < np.array(image_size) + margin)).all())
