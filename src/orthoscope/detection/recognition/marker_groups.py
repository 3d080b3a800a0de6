"""Markers of several boards with one dictionary: what stands together, where all are not on one plane."""

from __future__ import annotations

from collections.abc import Callable, Sequence

import cv2
import numpy as np

from orthoscope.detection.markers.markers import Markers
from orthoscope.geometry.arrays import Float, Int, ndarray

__all__ = ["are_on_one_plane", "groups"]

# Markers stand together where they are no farther apart than so many times the distance to the nearest.
TOGETHER_TIMES = 1.3
# So many markers in a photograph tell whether they stand on one plane.
FEWEST_TELLING = 6
# They do where they are off it by less than this share of the distance to the nearest, rms.
MOST_OFF_SHARE = 0.2


def are_on_one_plane(
    read: Sequence[Markers], layout: Callable[[Int[ndarray, " n"]], Float[ndarray, "n 2"]]
) -> bool:
    """Whether the markers of most photographs are where one board with this layout has them.

    Args:
        read: the markers of each photograph.
        layout: of numbers.
    """
    off = []
    for markers in read:
        if len(markers.numbers) < FEWEST_TELLING:
            continue
        places, middles = layout(markers.numbers), markers.corners.mean(1)
        plane, _ = cv2.findHomography(places, middles, 0)
        if plane is None:
            continue
        left = cv2.perspectiveTransform(places[None], plane)[0] - middles
        off.append(np.sqrt((left**2).sum(1).mean()) / np.median(_nearest(middles)))
    return not off or float(np.median(off)) < MOST_OFF_SHARE


def groups(read: Sequence[Markers], numbers: Int[ndarray, " n"]) -> list[Int[ndarray, " k"]]:
    """The numbers that stand together in some photograph, and so on from these.

    Args:
        read: the markers of each photograph.
        numbers: those that are asked for, ascending.
    """
    linked = np.eye(len(numbers), dtype=bool)
    for markers in read:
        known = np.isin(markers.numbers, numbers)
        if known.sum() < 2:
            continue
        index = np.searchsorted(numbers, markers.numbers[known])
        middles = markers.corners[known].mean(1)
        apart = np.linalg.norm(middles[:, None] - middles, axis=2)
        near = apart < TOGETHER_TIMES * np.minimum.outer(*(2 * [_nearest(middles)]))
        linked[np.ix_(index, index)] |= near
    found, left = [], np.ones(len(numbers), dtype=bool)
    while left.any():
        group = np.arange(len(numbers)) == left.argmax()
        while (grown := linked[group].any(0)).sum() > group.sum():
            group = grown
        found.append(numbers[group])
        left &= ~group
    return found


def _nearest(middles: Float[ndarray, "n 2"]) -> Float[ndarray, " n"]:
    apart = np.linalg.norm(middles[:, None] - middles, axis=2)
    np.fill_diagonal(apart, np.inf)
    return apart.min(1)
