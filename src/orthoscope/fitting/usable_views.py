"""Which views can take part in a calibration, and why the others cannot.

A view must fix a homography: four corners of which no three are on a line, so at least two off every line of
the target; and it must not be seen edge-on, where all pixels are on a line too.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from functools import cache
from math import hypot

import numpy as np

from orthoscope.geometry.arrays import CalibrationError, Float, ndarray
from orthoscope.targets.detections import Detections, SetAside, View

__all__ = ["with_usable_views"]

# A homography needs this many corners.
FEWEST_VIEW_CORNERS = 4
# The width of a view in the image is at least this share of its length.
LEAST_WIDTH_SHARE = 0.01


def with_usable_views(detections: Detections) -> Detections:
    """The detections, themselves where all views can be used; views that tell nothing or tell it twice are
    set aside with the reason.

    Raises:
        CalibrationError: no view is left.
    """
    kept: list[View] = []
    aside: list[SetAside] = list(detections.set_aside)
    seen: dict[bytes, str] = {}
    # Most boards are whole, and alike.
    off_a_line = cache(lambda ids: _off_a_line(detections.target.points[np.frombuffer(ids, np.int64), :2]))
    for view in detections.views:
        content = view.ids.tobytes() + view.pixels.tobytes()
        if reason := _fault(view, off_a_line):
            aside.append(SetAside(view.image, reason))
        elif content in seen:
            aside.append(SetAside(view.image, f"the same corners as {seen[content]}"))
        else:
            seen[content] = view.image
            kept.append(view)
    if not kept:
        reasons = "".join(f"\n  {entry.image}: {entry.reason}" for entry in aside[:5])
        raise CalibrationError(
            f"no view of {detections.target.name} can be used; expected at least 1, better 15 from different"
            f" sides. Take photographs that show the whole target, sharp and large.{reasons}"
        )
    if len(kept) == len(detections.views):
        return detections
    return replace(detections, views=tuple(kept), set_aside=tuple(aside))


def _fault(view: View, off_a_line: Callable[[bytes], int]) -> str | None:
    """Why a view tells nothing; None where it tells something.

    Args:
        view: the one in question.
        off_a_line: `_off_a_line` of the points whose ids, as bytes, it is given.
    """
    if len(view.ids) < FEWEST_VIEW_CORNERS:
        return f"{len(view.ids)} corners; a view needs {FEWEST_VIEW_CORNERS}"
    off = off_a_line(view.ids.tobytes())
    if off < 2:
        return f"all its corners{' but one' if off else ''} are on one line of the target"
    if _thin(view.pixels):
        return "all its corners are on one line in the image: the target is seen edge-on"
    return None


def _off_a_line(points: Float[ndarray, "n 2"]) -> int:
    """How many points are off the line that has most of them, if that is none or one; else more than one."""
    fewest = len(points)
    # A line that misses one point at most goes through two of the first three.
    for a, b in ((0, 1), (0, 2), (1, 2)):
        (along_x, along_y), (x, y) = points[b] - points[a], (points - points[a]).T
        if along_x or along_y:
            off = np.abs(along_x * y - along_y * x) > 1e-9 * (x * x + y * y).max()
            fewest = min(fewest, int(off.sum()))
    return fewest


def _thin(pixels: Float[ndarray, "n 2"]) -> bool:
    """Whether pixels are all but on a line, or all at one place."""
    offsets = pixels - pixels.sum(0) / len(pixels)
    (xx, xy), (_, yy) = (offsets.T @ offsets).tolist()
    # This is the larger eigenvalue; the product of both is the determinant.
    longest = 0.5 * (xx + yy) + hypot(0.5 * (xx - yy), xy)
    return xx * yy - xy * xy <= LEAST_WIDTH_SHARE**2 * longest * longest
