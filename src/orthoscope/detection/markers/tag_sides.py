"""On which side of a corner its tag is.

Across the black square between tags lies another tag's corner, of the same colours, and where gaps are a few
pixels it is taken for the one that is foreseen. But a tag's black goes on along its sides, beyond the length
of a gap; the square's does not, and white is beside it:

    along a side of the tag, past a gap's length     black, just inside
    the same way past the square                     white, as far from its side
"""

from __future__ import annotations

from typing import NamedTuple

import cv2
import numpy as np

from orthoscope.detection.chessboards.grid import grid_shape
from orthoscope.geometry.arrays import Bool, Float, Int, median, ndarray

__all__ = ["TagSides", "are_at_tags"]

# Tags and squares are looked at so many gaps along their sides, and so far inside: gaps, or sides at most.
ALONG_GAPS, INSIDE_GAPS, INSIDE_TAGS = 1.5, 0.4, 0.12
# That is at most this share of a tag's side, or nothing is told.
MOST_ALONG_TAGS = 0.8
# The square's side is brighter than the tag's by at least this share of what is usual.
LEAST_BRIGHTER_SHARE = 0.25


class TagSides(NamedTuple):
    """Where tags are.

    Attributes:
        towards: (m,2) from each corner to its tag: -1 or 1 along columns and rows, as seen from the front.
        spacing: gap between tags, as a share of their side.
    """

    towards: Int[ndarray, "m 2"]
    spacing: float


def are_at_tags(
    grey: ndarray,
    pixels: Float[ndarray, "k 2"],
    places: Float[ndarray, "k 2"],
    ids: Int[ndarray, " k"],
    tags: TagSides,
) -> Bool[ndarray, " k"]:
    """Which corners have their tag on the side where it must be.

    Args:
        grey: (h,w) uint8.
        pixels: the corners.
        places: where the board has them, in gaps.
        ids: of these.
        tags: of the board.
    """
    if not len(ids) or ALONG_GAPS * tags.spacing > MOST_ALONG_TAGS:
        return np.ones(len(ids), dtype=bool)
    inside = min(INSIDE_GAPS, INSIDE_TAGS / tags.spacing)
    shape, towards = grid_shape(pixels, places), tags.towards[ids].astype(float)
    steps = np.stack([shape.along * towards[:, :1], shape.down * towards[:, 1:]], axis=1)
    ways = np.array([[ALONG_GAPS, inside], [inside, ALONG_GAPS]])
    there = pixels[:, None] + np.concatenate([ways, -ways]) @ steps  # (k, 4, 2), those of the tag first
    height, width = grey.shape
    seen = np.asarray(((there >= 0) & (there <= np.array([width, height]) - 1)).all((1, 2)))
    x, y = np.where(seen[:, None, None], there, 0.0).astype(np.float32).transpose(2, 0, 1)
    values = cv2.remap(grey, x.copy(), y.copy(), cv2.INTER_LINEAR).astype(float)
    brighter = np.where(seen, values[:, 2:].sum(1) - values[:, :2].sum(1), 0.0)
    usual = median(brighter[seen]) if seen.any() else 0.0
    return ~seen | (brighter * np.sign(usual) > LEAST_BRIGHTER_SHARE * abs(usual))
