"""Several targets in one photograph: each is looked for on its own, those that can be told for sure first.

Markers say which board they are of. A board without them is told by its counts alone, and squares or discs of
another board could be taken for its own: what was found is painted over before one without markers is looked
for, large ones before small ones.
"""

from __future__ import annotations

import cv2
import numpy as np

from orthoscope.detection.sight import Sight, Unseen
from orthoscope.detection.table import see
from orthoscope.geometry.arrays import ndarray
from orthoscope.targets.target import Target

__all__ = ["painted_over", "see_members"]

# A board reaches beyond its corners by about so many of the steps between them.
MARGIN = 1.3


def see_members(grey: ndarray, target: Target) -> list[Sight | Unseen]:
    """What is seen of each of a target's members, in their order; of a single target what is seen of it.

    Args:
        grey: (h,w) uint8.
        target: one, or several.
    Returns:
        Ids are the whole target's.
    """
    if not target.members:
        return [see(grey, target)]
    found: dict[int, Sight | Unseen] = {}
    painted = grey
    for number in sorted(range(len(target.members)), key=lambda one: _last(target.members[one])):
        member = target.members[number]
        marked = member.board and member.board.markers
        sight = found[number] = see(grey if marked else painted, member)
        if isinstance(sight, Sight):
            painted = painted_over(painted, member, sight)
            found[number] = sight._replace(ids=sight.ids + target.parts[number].start)
    return [found[number] for number in range(len(target.members))]


def _last(member: Target) -> tuple[bool, int]:
    """What sorts boards with markers before others, then large ones before small ones."""
    return not (member.board and member.board.markers), -len(member.points)


def _step(member: Target, sight: Sight) -> float:
    """The longest step from a corner to the one nearest to it on the board, pixels."""
    points = member.points[sight.ids, :2]
    apart = np.linalg.norm(points[:, None] - points, axis=-1)
    np.fill_diagonal(apart, np.inf)
    return float(np.linalg.norm(sight.pixels - sight.pixels[apart.argmin(1)], axis=-1).max())


def painted_over(grey: ndarray, member: Target, sight: Sight) -> ndarray:
    """The picture with a board that was found in it grey and even.

    Args:
        grey: (h,w) uint8.
        member: the board.
        sight: of it.
    """
    outline = np.rint(cv2.convexHull(sight.pixels.astype(np.float32)).reshape(-1, 2)).astype(np.int32)
    mask = np.zeros(grey.shape, np.uint8)
    cv2.fillConvexPoly(mask, outline, 1)
    level = int(grey[mask > 0].mean()) if mask.any() else 128
    painted = grey.copy()
    cv2.fillConvexPoly(painted, outline, level)
    cv2.polylines(painted, [outline], True, level, max(1, round(2 * MARGIN * _step(member, sight))))
    return painted
