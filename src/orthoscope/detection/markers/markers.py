"""Markers in a photograph, by OpenCV, and which of them are of one board.

OpenCV looks for squares after thresholds whose windows are some pixels wide, so a photograph is looked at in
copies.
Another board of the same dictionary, or a marker read wrongly, lies elsewhere than the others have it: the
markers that foresee their neighbours, the most that hang together, are the board's. No map of the whole board
is
laid through them: a wide lens bends it.
"""

from __future__ import annotations

from typing import NamedTuple

import cv2
import numpy as np

from orthoscope.detection.sight import TWICE
from orthoscope.detection.small_copies import enlarged, resized, to_photograph
from orthoscope.geometry.arrays import Bool, Float, Int, ndarray
from orthoscope.targets.markers import dictionary

__all__ = ["Markers", "find_markers", "homography_of", "of_one_board", "remark_on"]

# Copies have these longer sides, pixels.
COPY_SIDES = (1280, 640, 2560)
# Pictures with a longer side of up to this, pixels, are enlarged where some but not enough markers were read.
LARGEST_ENLARGED = 1400
# Its neighbours foresee a marker, at worst, to this share of its side.
LOOSE_SHARE = 0.6
# With at most so many markers found, white ones on black are looked for, or a negative's.
HARDLY_ANY = 2
# Another board alike shows at least so many markers, and this share of those of the one that was taken.
FEWEST_TWICE, TWICE_SHARE = 2, 0.25
# Where less than this share of the markers hangs together, they are of a board of another size.
LEAST_HANGING_SHARE = 0.3
# So many neighbours of a marker on the board foresee it.
NEIGHBOUR_COUNT = 6


class Markers(NamedTuple):
    """Markers that were found.

    Attributes:
        numbers: (n,) their numbers in the dictionary.
        corners: (n,4,2) pixels, the marker's own top left, then clockwise.
    """

    numbers: Int[ndarray, " n"]
    corners: Float[ndarray, "n 4 2"]


def find_markers(grey: ndarray, name: str, enough: int, *, border: int = 1) -> Markers:
    """The markers of a dictionary in a photograph; where there are hardly any, white ones on black.

    Args:
        grey: (h,w) uint8.
        name: of the dictionary.
        enough: with so many no further copy is looked at.
        border: of the markers, in their squares.
    """
    parameters = cv2.aruco.DetectorParameters()
    parameters.markerBorderBits = border
    detector = cv2.aruco.ArucoDetector(dictionary(name), parameters)
    best, first = _most_markers(grey, detector, enough)
    if first is not None and len(best.numbers) <= min(HARDLY_ANY, enough - 1):
        inverted = detector.detectMarkers(255 - first)[1]
        if inverted is not None and len(inverted) > len(best.numbers):
            best, _ = _most_markers(255 - grey, detector, enough)
    return best


def _most_markers(
    grey: ndarray, detector: cv2.aruco.ArucoDetector, enough: int
) -> tuple[Markers, ndarray | None]:
    """The markers of the copy that shows most, black on white; and the first copy."""
    best, first = Markers(np.zeros(0, dtype=int), np.zeros((0, 4, 2))), None
    shapes = set()
    for side in (*COPY_SIDES, 0):
        if not side and (not len(best.numbers) or max(grey.shape) > LARGEST_ENLARGED):
            break  # enlarged where that may show more of those that are there
        copy = resized(grey, side) if side else enlarged(grey)
        if copy.shape in shapes or min(copy.shape) < 16:
            continue
        shapes.add(copy.shape)
        first = copy if first is None else first
        corners, numbers, _ = detector.detectMarkers(copy)
        if numbers is not None and len(numbers) > len(best.numbers):
            where = np.concatenate(corners).reshape(-1, 4, 2).astype(float)
            best = Markers(np.asarray(numbers).ravel().astype(int), to_photograph(where, copy, grey))
        if len(best.numbers) >= enough:
            break
    return best, first


def remark_on(markers: Markers, mine: Bool[ndarray, " n"]) -> str:
    """What to say of markers of which some are of another board alike: those with numbers that `mine` has."""
    others = np.isin(markers.numbers[~mine], markers.numbers[mine]).sum()
    return TWICE if others >= max(FEWEST_TWICE, TWICE_SHARE * mine.sum()) else ""


def of_one_board(markers: Markers, plane: Float[ndarray, "n 4 2"]) -> Bool[ndarray, " n"]:
    """Which markers hang together: each foresees its neighbours on the board.

    Args:
        markers: as found.
        plane: where the board has the corners of each.
    """
    count = len(markers.numbers)
    if count < 2:
        return np.ones(count, dtype=bool)
    middles = plane.mean(1)
    apart = np.linalg.norm(middles[:, None] - middles, axis=-1)
    near = np.argsort(apart, axis=1, kind="stable")[:, 1 : NEIGHBOUR_COUNT + 1]
    sides = np.linalg.norm(markers.corners[:, 0] - markers.corners[:, 2], axis=-1) / np.sqrt(2.0)
    linked = np.eye(count, dtype=bool)
    for i in range(count):
        there = plane[near[i]].reshape(1, -1, 2)
        foreseen = cv2.perspectiveTransform(there, homography_of(plane[i], markers.corners[i])).reshape(
            -1, 4, 2
        )
        off = np.linalg.norm(foreseen - markers.corners[near[i]], axis=-1).max(1)
        fits = (off < LOOSE_SHARE * sides[near[i]]) & (apart[i, near[i]] > 0)
        linked[i, near[i][fits]] = linked[near[i][fits], i] = True
    mine = _largest(linked)
    return mine if mine.sum() >= LEAST_HANGING_SHARE * count else np.zeros(count, dtype=bool)


def _largest(linked: Bool[ndarray, "n n"]) -> Bool[ndarray, " n"]:
    """The most that hang together."""
    best: ndarray = np.zeros(len(linked), dtype=bool)
    for first in range(len(linked)):
        if best[first]:
            continue
        mine, before = np.asarray(linked[first]), 0
        while mine.sum() > before:
            before, mine = int(mine.sum()), np.asarray(linked[mine].any(0))
        if mine.sum() > best.sum():
            best = mine
    return best


def homography_of(plane: Float[ndarray, "4 2"], pixels: Float[ndarray, "4 2"]) -> Float[ndarray, "3 3"]:
    """The map from the plane to the picture through four points."""
    return cv2.getPerspectiveTransform(plane.astype(np.float32), pixels.astype(np.float32))
