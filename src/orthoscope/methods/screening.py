"""Which views can take part in a calibration, and why the others cannot.

Floor 3.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from orthoscope.geometry.arrays import CalibrationError, ndarray
from orthoscope.geometry.target import Detections, SetAside, View

__all__ = ["screened"]

FEWEST = 4  # corners that a homography needs


def screened(detections: Detections) -> Detections:
    """The detections without the views that tell nothing or tell it twice; those are set aside with the reason.

    Raises CalibrationError where no view is left.
    """
    kept: list[View] = []
    aside: list[SetAside] = list(detections.set_aside)
    seen: dict[bytes, str] = {}
    for view in detections.views:
        content = view.ids.tobytes() + view.pixels.tobytes()
        if len(view.ids) < FEWEST:
            aside.append(SetAside(view.image, f"{len(view.ids)} corners; a view needs {FEWEST}"))
        elif _on_a_line(detections.target.points[view.ids]):
            aside.append(SetAside(view.image, "all its corners are on one line of the target"))
        elif content in seen:
            aside.append(SetAside(view.image, f"the same corners as {seen[content]}"))
        else:
            seen[content] = view.image
            kept.append(view)
    if not kept:
        reasons = "".join(f"\n  {entry.image}: {entry.reason}" for entry in aside[:5])
        raise CalibrationError(
            f"no view of {detections.target.name} can be used; expected at least 1, better 15 from different sides. "
            f"Take photographs that show the whole target, sharp and large.{reasons}"
        )
    return replace(detections, views=tuple(kept), set_aside=tuple(aside))


def _on_a_line(points: ndarray) -> bool:
    spread = np.linalg.svd(points - points.mean(0), compute_uv=False)
    return bool(spread[1] <= 1e-9 * spread[0])
