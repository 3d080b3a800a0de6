"""Finding Kalibr's AprilGrid: the tags say which corners are where, a saddle fit where exactly.

The family's tags are printed one way up by Kalibr and the other by OpenCV; which of a tag's four corners is
which is seen by its neighbours, where there are any, since all tags of a board are printed the same way up.
"""

from __future__ import annotations

import cv2
import numpy as np

from orthoscope.detection.chessboards.grid import grid_shape, nearest_neighbour
from orthoscope.detection.markers.foreseen import are_off
from orthoscope.detection.markers.markers import Markers, find_markers, homography_of, of_one_board, remark_on
from orthoscope.detection.saddles.linked import are_linked
from orthoscope.detection.saddles.refine import refined
from orthoscope.detection.sight import Sight, Unseen
from orthoscope.geometry.arrays import Float, ndarray
from orthoscope.targets.aprilgrid import BORDER_SQUARES, DICTIONARY, TAG_SQUARES, AprilGrid

__all__ = ["see_aprilgrid"]

# Where this share of the board's tags is found no other copy is looked at.
ENOUGH_TAGS_SHARE = 0.9
WAYS_UP = (
    2,
    0,
    1,
    3,
)  # quarter turns from OpenCV's corners to the tag's as Kalibr prints it, likely ones first
# A corner strays from its neighbours' lines by less than this share of a gap.
MOST_STRAY_SHARE = 0.1
# No corner is sought nearer to the picture's rim than this, pixels.
RIM_PX = 2.0
# A sight of the grid has at least this many corners.
FEWEST_CORNERS = 4
# A corner is fitted no farther from where it was foreseen than this share of a gap.
FARTHEST_SHARE = 0.4
# A gap counts as at least this, pixels: by 4 the tags' own corners may be off, however small the gaps.
LEAST_GAP_PX = 10.0
# Tags may be larger than OpenCV sees them by these factors; at their corners the grey is looked at so many of
# a tag's squares from there.
SCALES, LOOKED_AT = (1.0, 1.08, 1.16, 1.25), 1.0
# So many corners around it foresee one.
FORESEEING_CORNERS = 16


def see_aprilgrid(grey: ndarray, board: AprilGrid) -> Sight | Unseen:
    """The tags' outer corners, of those tags that can be seen.

    Args:
        grey: (h,w) uint8.
        board: what to look for.
    """
    count = board.columns * board.rows
    found = find_markers(grey, DICTIONARY, int(ENOUGH_TAGS_SHARE * count), border=BORDER_SQUARES)
    numbers = found.numbers - board.first
    known = (numbers >= 0) & (numbers < count)
    markers = Markers(numbers[known], found.corners[known])
    markers = markers._replace(corners=_at_corner_squares(grey, markers.corners))
    ids, corners, remark = _of_board(markers, board)
    inside = ((corners >= RIM_PX) & (corners <= np.array(grey.shape[::-1]) - 1 - RIM_PX)).all(1)
    ids, corners = ids[inside], corners[inside]
    if len(ids) < FEWEST_CORNERS:
        return Unseen(f"was not found in it: {len(markers.numbers)} of its {count} tags were")
    ids, pixels, sure = _fitted(grey, ids, corners, board)
    for _ in range(board.columns + board.rows):
        more, start = _next_to(ids, pixels, board, grey.shape)
        if not len(more):
            break
        before = len(ids)
        ids, pixels, sure = _fitted(grey, np.concatenate([ids, more]), np.concatenate([pixels, start]), board)
        if len(ids) <= before:
            break
    if sure.sum() < FEWEST_CORNERS:
        return Unseen(
            f"was not found in it: {len(ids) // 4} of its tags were, but without squares at their corners"
        )
    ids, pixels = ids[sure], pixels[sure]
    cells = np.stack([ids % board.grid[0], ids // board.grid[0]], axis=1)
    linked = are_linked(pixels, cells, board.places()[ids])
    linked[linked] = ~are_off(pixels[linked], board.places()[ids[linked]])
    if linked.sum() < FEWEST_CORNERS:
        return Unseen(f"was not found in it: of its corners only {linked.sum()} are sure")
    ids, pixels = ids[linked], pixels[linked]
    order = np.argsort(ids)
    return Sight(ids[order], pixels[order], remark)


def _at_corner_squares(grey: ndarray, corners: Float[ndarray, "n 4 2"]) -> Float[ndarray, "n 4 2"]:
    """The tags' corners, of those that OpenCV saw too small moved out to where the squares between tags are.

    A threshold hollows a wide border out, and blur parts a tag from the squares at its corners: what is taken
    for the tag's outline is then inside it. At a true corner black is on one diagonal, white on the other.
    """
    if not len(corners):
        return corners
    unit = np.array([[-1.0, -1.0], [1.0, -1.0], [1.0, 1.0], [-1.0, 1.0]])
    near = LOOKED_AT / TAG_SQUARES * np.array([[1.0, 1.0], [-1.0, -1.0], [-1.0, 1.0], [1.0, -1.0]])
    scales = np.array(SCALES)
    places = scales[:, None, None, None] * unit[:, None] + 2.0 * near * unit[:, None]
    maps = (homography_of(unit, each) for each in corners)
    there = np.stack([cv2.perspectiveTransform(places.reshape(1, -1, 2), each)[0] for each in maps])
    x, y = np.clip(np.rint(there), 0, np.array(grey.shape[::-1]) - 1).astype(int).transpose(2, 0, 1)
    seen = grey[y, x].astype(float).reshape(len(corners), len(scales), 4, 4)
    white, black = seen[..., 2:], seen[..., :2]
    strength = np.maximum(white.min(-1) - black.max(-1), black.min(-1) - white.max(-1)).sum(2)
    best = scales[strength.argmax(1)]
    return np.stack(
        [
            cv2.perspectiveTransform((scale * unit)[None], homography_of(unit, each))[0]
            for scale, each in zip(best, corners, strict=True)
        ]
    )


def _fitted(
    grey: ndarray, ids: ndarray, corners: ndarray, board: AprilGrid
) -> tuple[ndarray, ndarray, ndarray]:
    """The corners at which a saddle was fitted, on their neighbours' lines, and which of them are sure."""
    places = board.places()[ids] * [1.0, -1.0]  # rows are counted upwards
    fine = refined(grey, corners, places, arm=BORDER_SQUARES / TAG_SQUARES / board.spacing)
    gap = nearest_neighbour(corners, places)
    good = fine.believed & (grid_shape(fine.pixels, places).stray < MOST_STRAY_SHARE)
    good &= np.hypot(*(fine.pixels - corners).T) < FARTHEST_SHARE * np.maximum(gap, LEAST_GAP_PX)
    return ids[good], fine.pixels[good], (fine.sure & fine.whole)[good]


def _next_to(
    ids: ndarray, pixels: ndarray, board: AprilGrid, shape: tuple[int, ...]
) -> tuple[ndarray, ndarray]:
    """Corners of tags that were not read, next to some that were, where a parabola through those foresees
    them; a line where these are on two rows or columns only.
    """
    places = board.places()
    missing = np.setdiff1d(np.arange(len(places)), ids)
    if len(ids) < FORESEEING_CORNERS or not len(missing):
        return missing[:0], np.zeros((0, 2))
    apart = np.linalg.norm(places[missing, None] - places[ids], axis=-1)
    close = apart.min(1) < 1.1 / board.spacing  # a tag's side
    start = []
    for corner, distances in zip(missing[close], apart[close], strict=True):
        nearest = np.argsort(distances, kind="stable")[:FORESEEING_CORNERS]
        x, y = (places[ids[nearest]] - places[corner]).T * board.spacing
        start.append(np.linalg.lstsq(_terms(x, y), pixels[nearest], rcond=None)[0][0])
    foreseen = np.array(start).reshape(-1, 2)
    inside = ((foreseen >= RIM_PX) & (foreseen <= np.array(shape[::-1]) - 1 - RIM_PX)).all(1)
    return missing[close][inside], foreseen[inside]


def _terms(x: Float[ndarray, " n"], y: Float[ndarray, " n"]) -> Float[ndarray, "n t"]:
    """A polynomial's terms at the corners, of second order as far as these determine it."""
    bent = [one * one for one in (x, y) if len(set(np.round(one, 6).tolist())) > 2]
    return np.stack([np.ones_like(x), x, y, x * y, *bent], axis=1)


def _of_board(markers: Markers, board: AprilGrid) -> tuple[ndarray, ndarray, str]:
    """Ids and pixels of the corners of the tags that are the board's, each once; a remark on the choice."""
    plane, corners = board.points()[:, :2], board.tag_corners()
    best = np.zeros(0, dtype=int), np.zeros((0, 2)), ""
    for quarters in WAYS_UP:
        turned = Markers(markers.numbers, np.roll(markers.corners, quarters, axis=1))
        mine = of_one_board(turned, plane[corners[markers.numbers]])
        ids, first = np.unique(corners[markers.numbers[mine]].ravel(), return_index=True)
        if len(ids) > len(best[0]):
            best = ids, turned.corners[mine].reshape(-1, 2)[first], remark_on(markers, mine)
    return best
