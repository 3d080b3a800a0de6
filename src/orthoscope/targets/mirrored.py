"""Corners that run the other way round than on the front of their board: a mirror image, and no board's.

To a flat target it is all the same, since it may be seen from behind; but its shape, and what a tilt does to
discs, are then taken for the other side's.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from orthoscope.targets.detections import Detections, Remark, View
from orthoscope.targets.target import Target

__all__ = ["with_word_of_mirrors"]

# Fewer corners do not tell which way round they run.
FEWEST_CORNERS = 4


def with_word_of_mirrors(detections: Detections) -> Detections:
    """The detections, with a remark on each target that most of its views show as its own mirror image.

    Corners that a detector of ours found never are; those of a file, or of one's own, may be. Of targets that
    are known by their points only nobody knows the front.
    """
    target, told = detections.target, []
    for number, member in enumerate(target.members or (target,)):
        if member.board is None:
            continue
        views = [
            view
            for view in detections.views
            if len(view.ids) and detections.member_of(view.ids[:1])[0] == number
        ]
        mirrored = [view for view in views if len(view.ids) >= FEWEST_CORNERS and _turning(view, target) < 0]
        if 2 * len(mirrored) <= len(views):
            continue
        words = (
            f"a mirror image of {member.name}, as are {len(mirrored)} of {len(views)} views; expected it as"
            " seen from the front. See that x and y are not swapped, that the photographs are not mirrored,"
            " and that corners of a row run from left to right"
        )
        told.append(Remark(mirrored[0].image, words))
    new = [remark for remark in told if remark not in detections.remarks]
    return replace(detections, remarks=(*detections.remarks, *new)) if new else detections


def _turning(view: View, target: Target) -> float:
    """Positive where the target's y lies clockwise of its x in the image, as on the front of a board."""
    points = target.points[view.ids, :2]
    pixels = view.pixels / max(float(np.abs(view.pixels).max()), 1.0)
    axes = np.linalg.lstsq(points - points.mean(0), pixels - pixels.mean(0), rcond=None)[0]
    return float(np.linalg.det(axes))
