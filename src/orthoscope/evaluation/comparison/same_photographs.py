"""Whether a calibration was made from these photographs, by their corners.

Its corners need not be the very same: a fit may list a board from its other end, leave others out, and move
the centres of discs' outlines to where it takes the discs' own centres to be.
"""

from __future__ import annotations

import numpy as np

from orthoscope.fitting.calibration import Calibration
from orthoscope.geometry.arrays import Float, ndarray
from orthoscope.targets.detections import Detections

__all__ = ["made_from"]

# A view is the same where more than this share of its corners is.
SAME_VIEW_SHARE = 0.5
# Two fits may have the centre of one disc so far apart, pixels; corners of other targets never move.
DISC_APART_PX = 1.0
# So many corners of a view say whether it is worth looking at all of them.
FIRST_CORNERS = 8


def made_from(calibration: Calibration, detections: Detections) -> int:
    """How many of the views a calibration was made from."""
    known = [view.pixels for view in calibration.detections.views]
    if not detections.target.disc_radii.any():
        rows = {row.tobytes() for pixels in known for row in pixels}
        same = [
            sum(row.tobytes() in rows for row in view.pixels) > SAME_VIEW_SHARE * len(view.pixels)
            for view in detections.views
        ]
        return sum(same)
    return sum(any(_is_near(view.pixels, pixels) for pixels in known) for view in detections.views)


def _is_near(pixels: Float[ndarray, "n 2"], others: Float[ndarray, "m 2"]) -> bool:
    """Whether most pixels are near to others."""
    some = pixels[:: max(1, len(pixels) // FIRST_CORNERS)]
    return all(_share_near(part, others) > SAME_VIEW_SHARE for part in (some, pixels))


def _share_near(pixels: Float[ndarray, "n 2"], others: Float[ndarray, "m 2"]) -> float:
    apart = np.abs(pixels[:, None] - others).max(2).min(1, initial=np.inf)
    return float((apart < DISC_APART_PX).mean())
