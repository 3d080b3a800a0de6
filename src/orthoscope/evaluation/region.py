"""Where in the image a camera may be used: one polygon, and the share of the frame that lies in it.

The region is grown from the middle of the corners that were seen, in every direction as far as the camera's
error stays below a limit and hardly farther than their convex hull: far beyond the corners, a small
predicted error rests on a formula that nothing has tested there.  Whoever speaks of the part of the frame
where a camera holds (the verdict's first sentence, `trusted`, the page's line) speaks of this polygon.
"""

from __future__ import annotations

import numpy as np

from orthoscope.geometry.arrays import Bool, Float, ndarray

__all__ = ["MARGIN_SHARE", "REGION_DIRECTIONS", "REGION_STEPS", "between", "grown", "inside", "ways_from"]

# The region is grown in so many directions.
REGION_DIRECTIONS = 48
# The region is grown in so many steps.
REGION_STEPS = 20
# So many corners are looked at together, to keep what is between in a core's cache.
CORNERS_AT_ONCE = 4096
# Places count as between corners up to this share of the frame's longer side beyond them.
MARGIN_SHARE = 1 / 16


def ways_from(
    middle: Float[ndarray, " 2"], image_size: tuple[int, int]
) -> Float[ndarray, "directions steps 2"]:
    """Pixels from the middle to the frame's border, in every direction."""
    along, (width, height) = _directions(), image_size
    low, high = np.array([-0.5, -0.5]), np.array([width - 0.5, height - 0.5])
    with np.errstate(divide="ignore", invalid="ignore"):
        reach = np.where(along > 0, (high - middle) / along, (low - middle) / along)
    reach = np.where(np.abs(along) > 1e-12, reach, np.inf).min(1)
    share = np.arange(1, REGION_STEPS + 1) / REGION_STEPS
    return middle + reach[:, None, None] * share[:, None] * along[:, None]


def grown(
    middle: Float[ndarray, " 2"],
    ways: Float[ndarray, "directions steps 2"],
    error: Float[ndarray, "directions steps"],
    limit: float,
    *,
    seen: Float[ndarray, "s 2"],
    margin: float,
) -> Float[ndarray, "directions 2"]:
    """The polygon: in each direction the first place where the error is too large, or where corners end; the
    middle where it is too large at once.

    Args:
        middle, ways: as of `ways_from`.
        error: along the ways, pixels; NaN where the camera has no image.
        limit: of the error, pixels.
        seen: corners.
        margin: beyond them, pixels.
    """
    good = error <= limit
    steps = np.where(good.all(1), REGION_STEPS, np.argmin(good, axis=1)).astype(float)
    stopped = np.flatnonzero((steps > 0) & (steps < REGION_STEPS))
    last, first = error[stopped, steps[stopped].astype(int) - 1], error[stopped, steps[stopped].astype(int)]
    steps[stopped] += np.nan_to_num((limit - last) / (first - last))  # where it crosses the limit
    border = ways[:, -1] - middle
    along = outwards = _directions()
    with np.errstate(divide="ignore"):
        beyond = (_ends(seen, margin) - outwards @ middle) / np.maximum(along @ outwards.T, 0.0)
    share = np.minimum(steps / REGION_STEPS, beyond.min(1) / np.linalg.norm(border, axis=1))
    return middle + share[:, None] * border


def between(seen: Float[ndarray, "s 2"], pixels: Float[ndarray, "n 2"], margin: float) -> Bool[ndarray, " n"]:
    """Which places lie between corners that were seen: in no direction farther out than all of them.

    Args:
        margin: beyond them, pixels.
    """
    return np.all(pixels @ _directions().T <= _ends(seen, margin), axis=1)


def inside(polygon: Float[ndarray, "n 2"], pixels: Float[ndarray, "m 2"]) -> Bool[ndarray, " m"]:
    """Which places lie within a polygon: how often a line from them to the right crosses its sides."""
    start, end = polygon, np.roll(polygon, -1, axis=0)
    x, y = pixels[:, :1], pixels[:, 1:]
    spans = (start[:, 1] > y) != (end[:, 1] > y)
    with np.errstate(divide="ignore", invalid="ignore"):
        crossing = start[:, 0] + (y - start[:, 1]) * (end[:, 0] - start[:, 0]) / (end[:, 1] - start[:, 1])
    return (spans & (x < crossing)).sum(1) % 2 == 1


def _ends(seen: Float[ndarray, "s 2"], margin: float) -> Float[ndarray, " directions"]:
    """How far out corners lie in every direction, and a margin."""
    directions, ends = _directions().T, np.full(REGION_DIRECTIONS, -np.inf)
    for start in range(0, len(seen), CORNERS_AT_ONCE):
        ends = np.maximum(ends, (seen[start : start + CORNERS_AT_ONCE] @ directions).max(0))
    return ends + margin


def _directions() -> Float[ndarray, "directions 2"]:
    angle = 2.0 * np.pi * np.arange(REGION_DIRECTIONS) / REGION_DIRECTIONS
    return np.stack([np.cos(angle), np.sin(angle)], axis=-1)
