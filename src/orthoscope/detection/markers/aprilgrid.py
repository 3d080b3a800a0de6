"""Finding Kalibr's AprilGrid: the tags say which corners are where, a saddle fit where exactly.

The family's tags are printed one way up by Kalibr and the other by OpenCV; which of a tag's four corners is
which is seen by its neighbours, where there are any, since all tags of a board are printed the same way up.
"""

from __future__ import annotations

import cv2
import numpy as np

from orthoscope.detection.markers.aprilgrid_lattice import WAYS_UP, aprilgrid_corners
from orthoscope.detection.markers.growth import CornersOfBoard, grown_from, grown_with, sight_of
from orthoscope.detection.markers.markers import Markers, find_markers, homography_of, of_one_board, remark_on
from orthoscope.detection.markers.tag_sides import TagSides
from orthoscope.detection.sight import Sight, Unseen
from orthoscope.geometry.arrays import Float, ndarray
from orthoscope.targets.aprilgrid import BORDER_SQUARES, DICTIONARY, TAG_SQUARES, AprilGrid

__all__ = ["see_aprilgrid"]

# Where this share of the board's tags is found no other copy is looked at; any, where it is seen already.
ENOUGH_TAGS_SHARE = 0.9
# A sight of the grid has at least this many corners.
FEWEST_CORNERS = 4
# Tags may be larger than OpenCV sees them by these factors; at their corners the grey is looked at so many of
# a tag's squares from there.
SCALES, LOOKED_AT = (1.0, 1.08, 1.16, 1.25), 1.0
# A corner foresees those up to a tag away, and somewhat more.
REACH_SHARE = 1.1


def see_aprilgrid(grey: ndarray, board: AprilGrid) -> Sight | Unseen:
    """The tags' outer corners, of those tags that can be seen.

    Args:
        grey: (h,w) uint8.
        board: what to look for.
    """
    together, twice = aprilgrid_corners(grey, board)
    places, arm = board.places() * [1.0, -1.0], BORDER_SQUARES / TAG_SQUARES / board.spacing
    cells = np.stack(np.divmod(np.arange(len(places)), board.grid[0])[::-1], axis=1)
    tags = TagSides(np.where(cells % 2, -1, 1) * [1, -1], board.spacing)  # rows go upwards
    corners = CornersOfBoard(places, cells, arm, REACH_SHARE / board.spacing, tags)
    seen = None if together is None else grown_from(grey, together, corners)
    if seen and seen.is_complete and (sight := sight_of(seen, corners, grey.shape, twice)):
        return sight
    count = board.columns * board.rows
    enough = 1 if seen else int(ENOUGH_TAGS_SHARE * count)
    found = find_markers(grey, DICTIONARY, enough, border=BORDER_SQUARES)
    numbers = found.numbers - board.first
    known = (numbers >= 0) & (numbers < count)
    markers = Markers(numbers[known], found.corners[known])
    markers = markers._replace(corners=_at_corner_squares(grey, markers.corners))
    ids, pixels, remark = _of_board(markers, board)
    if not seen and len(ids) < FEWEST_CORNERS:
        return Unseen(f"was not found in it: {len(markers.numbers)} of its {count} tags were")
    alone = np.full_like(places, np.nan)
    alone[ids] = pixels
    more = grown_with(grey, seen, alone, corners, approach=True)
    sight = sight_of(more, corners, grey.shape, twice or remark)
    return sight or Unseen(
        "is in it, but too blurred, dim or small to say where its corners are, or has no squares between tags"
    )


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
